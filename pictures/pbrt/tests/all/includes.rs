//! Includes, cycles and limits.

use super::{complaints, load_files, load_text};

#[test]
fn included_files_continue_the_scene() {
    let (_folder, result) = load_files(&[
        (
            "main.pbrt",
            b"WorldBegin Include \"a.pbrt\" Shape \"sphere\" WorldEnd",
        ),
        ("a.pbrt", b"Material \"mirror\" Include \"b.pbrt\""),
        (
            "b.pbrt",
            b"ReverseOrientation # the end of the line is missing",
        ),
    ]);
    let scene = result.unwrap().scene;
    assert!(scene.shapes[0].reverse_orientation);
    assert!(matches!(
        scene.materials[0],
        antumbra_scene::Material::Mirror(_)
    ));
}

#[test]
fn mistakes_in_included_files_name_those() {
    let (folder, result) = load_files(&[
        ("main.pbrt", b"WorldBegin Include \"a.pbrt\" Bad WorldEnd"),
        ("a.pbrt", b"\n  Worse"),
    ]);
    let diagnostics = complaints(result);
    assert_eq!(diagnostics.len(), 2);
    assert_eq!(diagnostics[0].column, 29);
    assert_eq!(diagnostics[1].file, folder.path().join("a.pbrt"));
    assert_eq!((diagnostics[1].line, diagnostics[1].column), (2, 3));
}

#[test]
fn a_missing_file_is_reported_where_it_is_asked_for() {
    let diagnostics = complaints(load_text("Include \"no.pbrt\" WorldBegin WorldEnd"));
    assert_eq!(diagnostics.len(), 1);
    assert_eq!(diagnostics[0].column, 9);
    assert!(
        diagnostics[0]
            .message
            .contains("cannot include \"no.pbrt\"")
    );
    let directory = complaints(load_text("Include \".\" WorldBegin WorldEnd"));
    assert!(directory[0].message.contains("folder"), "{directory:?}");
}

#[test]
fn a_file_that_includes_itself_is_one_mistake() {
    // Ten thousand times in a row, and under two names.
    let text = format!(
        "WorldBegin\n{}WorldEnd\n",
        "  Include \"./scene.pbrt\"\n".repeat(10_000)
    );
    let diagnostics = complaints(load_text(&text));
    assert_eq!(diagnostics.len(), 1, "{diagnostics:?}");
    let d = &diagnostics[0];
    assert_eq!((d.line, d.column), (2, 11));
    assert!(
        d.message
            .contains("includes itself: scene.pbrt → scene.pbrt"),
        "{d}"
    );
    assert!(d.message.contains("9999 more"), "{d}");
}

#[test]
fn a_cycle_through_other_files_shows_the_chain() {
    let diagnostics = complaints(
        load_files(&[
            ("main.pbrt", b"WorldBegin\nInclude \"a.pbrt\"\nWorldEnd"),
            ("a.pbrt", b"\n\nInclude \"b.pbrt\""),
            ("b.pbrt", b"Include \"a.pbrt\""),
        ])
        .1,
    );
    assert_eq!(diagnostics.len(), 1);
    assert!(
        diagnostics[0]
            .message
            .contains("main.pbrt:2 → a.pbrt:3 → b.pbrt → a.pbrt"),
        "{}",
        diagnostics[0]
    );
}

#[test]
fn a_chain_of_many_files_ends_at_a_limit() {
    let names: Vec<String> = (0..200).map(|i| format!("f{i}.pbrt")).collect();
    let texts: Vec<String> = (0..200)
        .map(|i| match i {
            0 => "Include \"f1.pbrt\" WorldBegin WorldEnd".into(),
            199 => String::new(),
            _ => format!("Include \"f{}.pbrt\"", i + 1),
        })
        .collect();
    let files: Vec<(&str, &[u8])> = names
        .iter()
        .zip(&texts)
        .map(|(n, t)| (n.as_str(), t.as_bytes()))
        .collect();
    let diagnostics = complaints(load_files(&files).1);
    assert_eq!(diagnostics.len(), 1);
    let d = &diagnostics[0];
    assert!(d.message.contains("more than 64 deep"), "{d}");
    assert!(d.message.contains("f0.pbrt:1 → "), "{d}");
    assert!(d.message.len() < 400, "{d}");
}

#[test]
fn files_that_double_at_every_level_end_at_a_limit() {
    let names: Vec<String> = (0..30).map(|i| format!("f{i}.pbrt")).collect();
    let texts: Vec<String> = (0..30)
        .map(|i| match i {
            29 => String::new(),
            _ => format!("Include \"f{0}.pbrt\" Include \"f{0}.pbrt\"", i + 1),
        })
        .collect();
    let files: Vec<(&str, &[u8])> = names
        .iter()
        .zip(&texts)
        .map(|(n, t)| (n.as_str(), t.as_bytes()))
        .collect();
    let diagnostics = complaints(load_files(&files).1);
    assert!(
        diagnostics
            .iter()
            .any(|d| d.message.contains("files are included")),
        "{diagnostics:?}"
    );
}

/// As with the clouds of pbrt-v3's collection: a file ends within a list of parameters, which goes on behind its
/// `Include`.
#[test]
fn parameters_go_on_after_an_included_file() {
    let (_folder, result) = load_files(&[
        (
            "main.pbrt",
            b"WorldBegin Include \"a.pbrt\" \"rgb sigma_a\" [1 2 3] \"float g\" 0.25 Shape \"sphere\" WorldEnd",
        ),
        ("a.pbrt", b"Include \"b.pbrt\" \"rgb sigma_s\" [4 5 6]"),
        (
            "b.pbrt",
            b"MakeNamedMedium \"m\" \"string type\" \"homogeneous\"\n# the list has no end here",
        ),
    ]);
    let scene = result.unwrap().scene;
    let medium = &scene.media[0];
    assert_eq!(medium.absorption, antumbra_scene::Rgb::new(1.0, 2.0, 3.0));
    assert_eq!(medium.scattering, antumbra_scene::Rgb::new(4.0, 5.0, 6.0));
    assert_eq!((medium.asymmetry, scene.shapes.len()), (0.25, 1));
    // A directive without parameters takes none.
    let (_folder, result) = load_files(&[
        (
            "main.pbrt",
            b"WorldBegin Include \"a.pbrt\" \"float g\" 1 WorldEnd",
        ),
        ("a.pbrt", b"ReverseOrientation"),
    ]);
    let message = complaints(result)[0].message.clone();
    assert!(message.contains("expected a directive"), "{message}");
}
