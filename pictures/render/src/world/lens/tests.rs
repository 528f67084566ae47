//! Lenses against the formulas of thick lenses, and against themselves backward.

use antumbra_scene::LensElement;

use super::*;
use crate::sampler::{Method, Sampler};

/// Lens of two equal surfaces: radius 50 mm, 5 mm thick, index 1.5.
fn system(diameter: f32) -> LensSystem {
    let surface = |radius, thickness, eta| LensElement {
        radius,
        thickness,
        eta,
        diameter,
    };
    LensSystem {
        elements: vec![surface(50.0, 5.0, 1.5), surface(-50.0, 45.0, 0.0)],
        focus_distance: 2.0,
        film_diagonal: 35.0,
        exposure: None,
    }
}

fn film() -> Film {
    Film {
        resolution: [300, 200],
        ..Film::default()
    }
}

fn lens(diameter: f32) -> Lens {
    Lens::new(&system(diameter), &film()).unwrap()
}

/// The lens equation, with principal planes `f (n - 1) d / (n R)` inside of the surfaces.
#[test]
fn thick_lenses_are_in_focus() {
    let lens = lens(2.0);
    let (n, r, d) = (1.5, 0.05, 0.005);
    let f = 1.0 / ((n - 1.0) * (2.0 / r - (n - 1.0) * d / (n * r * r)));
    let inset = f * (n - 1.0) * d / (n * r);
    // As in pbrt-v3, the distance is measured from the film before the lens is moved to its place.
    let moved = lens.rear_z() - 0.045;
    let image = lens.rear_z() + inset;
    let object = 2.0 + moved - (lens.rear_z() + d - inset);
    assert!(
        (1.0 / image + 1.0 / object - 1.0 / f).abs() < 2e-3 / f,
        "{image} {object} {f}"
    );
    // Rays of the middle of the film meet on the axis.
    for pupil in [[0.1, 0.5], [0.5, 0.8], [0.7, 0.3]] {
        let ray = lens.leaving([0.5, 0.5], pupil).expect("it passes").ray;
        let across = ray.dir.truncate();
        let t = -ray.org.truncate().dot(across) / across.length_squared();
        let met = ray.at(t);
        assert!(met.truncate().length() < 1e-9);
        let conjugate = image / (image / f - 1.0);
        let expected = lens.rear_z() + d - inset + conjugate;
        assert!(
            (met.z / expected - 1.0).abs() < 0.02,
            "{} {expected}",
            met.z
        );
    }
}

/// The picture is upside down on the film, so that it is upright and not mirrored.
#[test]
fn pictures_are_upright() {
    let lens = lens(2.0);
    let dir = |share| lens.leaving(share, [0.5; 2]).expect("it passes").ray.dir;
    let [left, top] = [dir([0.25, 0.5]), dir([0.5, 0.25])];
    assert!(left.x < -0.1 && left.y.abs() < 1e-9, "{left}");
    assert!(top.y > 0.05 && top.x.abs() < 1e-9, "{top}");
    // A quarter of the width: the tangent is the place on the film over the distance of the image.
    let width = 0.035 * 3.0 / 13.0_f64.sqrt();
    let expected = 0.25 * width / lens.rear_z();
    assert!((left.x / left.z + expected).abs() < 0.05 * expected);
}

#[test]
fn light_goes_the_same_way_back() {
    let lens = lens(8.0);
    let sampler = Sampler::new(Method::OwenSobol, 1);
    let mut passed = 0;
    for index in 0..500 {
        let stream = sampler.stream(0, 0, index);
        let [share, pupil] = [stream.pair(0), stream.pair(1)];
        let share = share.map(f64::from);
        let Some(Leaving { ray, .. }) = lens.leaving(share, pupil) else {
            continue;
        };
        passed += 1;
        let back = HalfLine {
            org: ray.at(1.0),
            dir: -ray.dir,
        };
        let film = lens.to_film(back).expect("it came from there");
        let place = film.at(-film.org.z / film.dir.z).truncate();
        assert!((place - lens.place(share)).length() < 1e-12, "{share:?}");
        // The neighbour has the film point beside it, and the same point of the rear plane.
        let further = [0.003, 0.0];
        let Some(found) = lens.neighbour(ray, further) else {
            continue;
        };
        let back = HalfLine {
            org: found.at(1.0),
            dir: -found.dir,
        };
        let Some(film) = lens.to_film(back) else {
            continue;
        };
        let place = film.at(-film.org.z / film.dir.z).truncate();
        let expected = lens.place([share[0] + 0.003, share[1]]);
        assert!((place - expected).length() < 1e-9, "{place} {expected}");
    }
    assert!(passed > 250, "{passed}");
}

/// The mean weight is the solid angle of the pupil with cosines, or its share of the bounds.
#[test]
fn weights_add_up_to_the_area_of_the_pupil() {
    // The rear element is the stop.
    let mut system = system(4.0);
    system.elements[0].diameter = 20.0;
    let mean_at = |lens: &Lens, place: [f64; 2]| {
        let sampler = Sampler::new(Method::OwenSobol, 1);
        let count = 1 << 14;
        let rays = (0..count).filter_map(|index| {
            let pupil = sampler.stream(0, 0, index).pair(0);
            lens.leaving(place, pupil)
        });
        rays.map(|ray| f64::from(ray.weight)).sum::<f64>() / f64::from(count)
    };
    let mean = |lens: &Lens| mean_at(lens, [0.5; 2]);
    let simple = Lens::new(&system, &film()).unwrap();
    let [low, high] = simple.pupils[0];
    // The opening is 2 mm around the axis. Light on the edge is bent little before it reaches the rear element.
    let radius = 0.5 * (high.x - low.x);
    assert!((radius - 0.002).abs() < 3e-5, "{radius}");
    let circle = std::f64::consts::PI * 0.002 * 0.002;
    let share = circle / (high - low).element_product();
    assert!(
        (mean(&simple) - share).abs() < 0.01,
        "{} {share}",
        mean(&simple)
    );
    // From the corner the opening is as large, and further away at a slant.
    let cos2 = simple.rear_z().powi(2) / (simple.rear_z().powi(2) + simple.reach.powi(2));
    let darker = mean_at(&simple, [0.0; 2]) / mean(&simple);
    assert!((darker / cos2.powi(2) - 1.0).abs() < 0.02, "{darker}");
    system.exposure = Some(3.0);
    let timed = Lens::new(&system, &film()).unwrap();
    let expected = 3.0 * circle / timed.rear_z().powi(2);
    assert!((mean(&timed) / expected - 1.0).abs() < 0.02);
}

/// No light passes outside of the bounds, wherever on the film it comes from.
#[test]
fn pupils_bound_the_light() {
    let mut system = system(20.0);
    // A stop in front of the lens moves the pupil of outer film points.
    let stop = LensElement {
        radius: 0.0,
        thickness: 15.0,
        eta: 0.0,
        diameter: 8.0,
    };
    system.elements.insert(0, stop);
    let lens = Lens::new(&system, &film()).unwrap();
    assert!(
        lens.pupils[60][0].x.abs() < lens.pupils[60][1].x.abs() * 0.9
            || lens.pupils[60] != lens.pupils[0]
    );
    let sampler = Sampler::new(Method::OwenSobol, 4);
    let mut passed = 0;
    for index in 0..20_000 {
        let stream = sampler.stream(0, 0, index);
        let x = f64::from(stream.uniform(0)) * lens.reach;
        let [px, py] = stream.pair(1).map(|u| (2.0 * f64::from(u) - 1.0) * 0.015);
        let org = DVec3::new(x, 0.0, 0.0);
        let dir = DVec3::new(px, py, lens.rear_z()) - org;
        if lens.to_scene(HalfLine { org, dir }).is_none() {
            continue;
        }
        passed += 1;
        let ring = (x / lens.reach * RINGS as f64) as usize;
        let [low, high] = lens.pupils[ring.min(RINGS - 1)];
        let inside = px >= low.x && px <= high.x && py >= low.y && py <= high.y;
        assert!(inside, "{x} {px} {py} {low} {high}");
    }
    assert!(passed > 500, "{passed}");
}

#[test]
fn lenses_that_make_no_picture_are_refused() {
    let refused = |change: fn(&mut LensSystem)| {
        let mut system = system(8.0);
        change(&mut system);
        Lens::new(&system, &film()).unwrap_err().to_string()
    };
    for (change, expected) in [
        (
            (|s| s.elements.clear()) as fn(&mut LensSystem),
            "no elements",
        ),
        (|s| s.elements[0].diameter = 0.0, "without an opening"),
        (|s| s.elements[1].radius = f32::NAN, "without an opening"),
        (|s| s.focus_distance = 0.15, "too short"),
        (|s| s.film_diagonal = 0.0, "diagonal"),
        (
            |s| {
                s.elements.truncate(1);
                s.elements[0].radius = 0.0;
            },
            "does not focus",
        ),
        (|s| s.elements[0].diameter = 1e-6, "no light passes"),
    ] {
        let found = refused(change);
        assert!(found.contains(expected), "{expected}: {found}");
    }
}
