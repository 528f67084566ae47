//! Camera `realistic` and its lens files.

use antumbra_scene::{LensElement, Projection};

use super::{Loaded, load_files};

const LENS: &[u8] =
    b"# radius thickness index diameter\n50 5 1.5 20\n\n0 3 0 10 # the stop\n-50 40 1 20\n";

/// Loads a scene with a camera of these parameters, and a lens file.
fn with_lens(film: &str, parameters: &str, lens: &[u8]) -> Result<Loaded, antumbra_pbrt::Error> {
    let text = format!(
        "{film} Camera \"realistic\" \"string lensfile\" \"a.dat\" {parameters} WorldBegin WorldEnd"
    );
    load_files(&[("s.pbrt", text.as_bytes()), ("a.dat", lens)]).1
}

fn notes(loaded: &Loaded) -> String {
    loaded.notes.iter().map(ToString::to_string).collect()
}

#[test]
fn lens_files_are_surfaces_from_the_scene_to_the_film() {
    let loaded = with_lens("", "", LENS).unwrap();
    let camera = &loaded.scene.camera;
    assert_eq!(camera.projection, Projection::Realistic);
    let lenses = camera.lenses.as_ref().expect("lenses");
    let element = |radius, thickness, eta, diameter| LensElement {
        radius,
        thickness,
        eta,
        diameter,
    };
    // The stop takes the default aperture, 1 mm.
    let expected = [
        element(50.0, 5.0, 1.5, 20.0),
        element(0.0, 3.0, 0.0, 1.0),
        element(-50.0, 40.0, 1.0, 20.0),
    ];
    assert_eq!(lenses.elements, expected);
    let numbers = (lenses.focus_distance, lenses.film_diagonal, lenses.exposure);
    assert_eq!(numbers, (10.0, 35.0, None));
    assert!(notes(&loaded).contains("darker towards its edges"));
}

#[test]
fn lenses_have_the_parameters_of_pbrt() {
    let loaded = with_lens(
        "Film \"image\" \"float diagonal\" 70 \"float maxsampleluminance\" 9",
        "\"float aperturediameter\" 12 \"float focusdistance\" 3 \"bool simpleweighting\" \"false\"
        \"float shutteropen\" 0.25 \"float shutterclose\" 0.75",
        LENS,
    )
    .unwrap();
    let lenses = loaded.scene.camera.lenses.clone().expect("lenses");
    assert_eq!(lenses.elements[1].diameter, 10.0);
    let numbers = (lenses.focus_distance, lenses.film_diagonal, lenses.exposure);
    assert_eq!(numbers, (3.0, 70.0, Some(0.5)));
    let said = notes(&loaded);
    for expected in [
        "\"aperturediameter\" 12 is taken as 10",
        "\"maxsampleluminance\" limits light as the lens weights it",
    ] {
        assert!(said.contains(expected), "{said}");
    }
    assert!(!said.contains("\"diagonal\""), "{said}");
}

#[test]
fn broken_lens_files() {
    for (lens, expected) in [
        (
            &b"50 5 1.5 20\n0 3 zero 10\n"[..],
            "lens \"a.dat\": line 2: zero is not a number",
        ),
        (b"50 5 1.5\n", "the file has 3 numbers"),
        (b"# nothing\n", "the file has 0 numbers"),
        (
            b"50 5 1.5 20\n0 3 0\n-1\n",
            "line 3: a diameter of -1 is not positive",
        ),
        (
            b"50 5 -1 20\n",
            "line 1: an index of refraction of -1 is negative",
        ),
    ] {
        let error = with_lens("", "", lens).expect_err("a mistake").to_string();
        assert!(error.contains(expected), "{expected}: {error}");
        assert!(error.contains("s.pbrt:1:39"), "{error}");
    }
    let text = b"Camera \"realistic\" \"string lensfile\" \"no.dat\" WorldBegin WorldEnd";
    let error = load_files(&[("s.pbrt", text)]).1.expect_err("a mistake");
    assert!(
        error.to_string().contains("cannot read lens \"no.dat\""),
        "{error}"
    );
}
