//! A scene of a few primitives of every kind, small enough for an interpreter: `.ci/miri` runs this file on the
//! scalar path and watches every memory access.

use std::sync::Arc;

use antumbra::cutout::{Candidate, Coverage, Opacity};
use antumbra::shapes::Sphere;
use antumbra::{Geometry, Instance, Primitives};
use antumbra_testkit::{Rng, mesh, rays};

use crate::support::{Odd, equals_brute, kernel_rays, quads};

/// Open on one side of the diagonal.
#[derive(Debug)]
struct Half;

impl Opacity for Half {
    fn opacity(&self, candidate: &Candidate) -> f32 {
        f32::from(u8::from(candidate.u > candidate.v))
    }

    fn coverage(&self, _: u32, _: &[[f32; 2]; 3]) -> Coverage {
        Coverage::Unknown
    }
}

#[test]
fn a_few_primitives_of_every_kind() {
    let seed = 11;
    let mut rng = Rng::new(seed);
    let (soup, grid) = (mesh::soup(&mut rng, 11), mesh::bumpy_grid(&mut rng, 4));
    let spheres: Vec<_> = (0..3)
        .map(|_| Sphere {
            center: rng.point(1.0),
            radius: 0.5 * rng.unit(),
        })
        .collect();
    let cutouts = Geometry::cutouts(&grid.positions[..], &grid.indices[..], Arc::new(Half));
    let world = [
        Geometry::triangles(&soup.positions[..], &soup.indices[..]),
        cutouts.clone(),
        Geometry::spheres(&spheres[..]),
        Odd::new(&mut rng, 7).geometry(),
        quads(&grid),
    ];
    let place = |x: f32| {
        Instance::new(
            0,
            [
                [0.5, 0.0, 0.1, x],
                [0.0, -0.7, 0.0, 0.2],
                [0.0, 0.1, 0.6, 0.0],
            ],
        )
    };
    let objects = [vec![cutouts, Geometry::spheres(&spheres[..1])]];
    let primitives = Primitives::with_instances(&world, &objects, &[place(-0.5), place(0.4)])
        .expect("indices in range");
    let rays = kernel_rays(&rays::around(&mut rng, &soup, 9));
    equals_brute("small", &primitives, &rays);
}
