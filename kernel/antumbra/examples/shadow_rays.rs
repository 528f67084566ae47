//! Shadow rays of a row of fences: the first program of the book in `docs/`.

// ANCHOR: use
use antumbra::{Bvh, Error, Geometry, Ray, Recipe};
// ANCHOR_END: use

/// A row of fences on a plain: positions and triangles.
fn fences(count: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for fence in 0..count {
        let (x, first) = (fence as f32, 4 * fence);
        positions.extend([[x, 0.0, 0.0], [x, 0.0, 1.0], [x, 1.0, 1.0], [x, 1.0, 0.0]]);
        triangles.extend([[0, 1, 2], [0, 2, 3]].map(|corners| corners.map(|c| first + c)));
    }
    (positions, triangles)
}

fn main() -> Result<(), Error> {
    let (positions, triangles) = fences(100);
    let lamp = [50.5, 3.0, 0.5];
    let points: Vec<[f32; 3]> = (0..5000)
        .map(|i| [i as f32 / 50.0 + 0.01, 0.5, 0.5])
        .collect();

    // ANCHOR: book
    let geometry = [Geometry::triangles(&positions[..], &triangles[..])];
    let bvh = Bvh::build(&geometry, &Recipe::default())?;

    // One segment from every point to the lamp.
    let rays: Vec<Ray> = points
        .iter()
        .map(|point| Ray::between(*point, lamp))
        .collect();
    let in_shadow = bvh.batch(&rays).occluded();
    // ANCHOR_END: book

    // ANCHOR: learn
    let sample: Vec<Ray> = rays.iter().step_by(10).copied().collect();
    let learned = Bvh::learn(&geometry, &sample, &Recipe::default())?;
    // ANCHOR_END: learn

    let again = learned.batch(&rays).occluded();
    assert_eq!(in_shadow, again, "the answers never depend on the tree");
    let shadows = in_shadow.iter().filter(|shadow| **shadow).count();
    println!("{shadows} of {} points are in shadow", points.len());
    Ok(())
}
