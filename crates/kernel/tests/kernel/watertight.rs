//! No ray from inside a closed mesh gets out, however exactly it is aimed at an edge or a corner.

use crate::support::geometry;
use antumbra::lab::{BinaryTree, Laboratory};
use antumbra::{Builder, Bvh, Collapse, Isa, Primitives, Ray, Width};
use antumbra_testkit::{Mesh, Rng, mesh};

const RAYS: usize = 10_000_000;
const BATCH: usize = 4096;

/// Closed meshes that the origin sees all of, and how far around the origin one can move inside.
fn closed_meshes(rng: &mut Rng) -> Vec<(Mesh, f32)> {
    let coarse = mesh::icosphere(1);
    let fine = mesh::icosphere(5);
    // A hedgehog: every corner at its own distance, long thin triangles between them.
    let spiky = mesh::icosphere(3).map("spiky", |p| {
        let length = rng.range(0.3, 3.0);
        p.map(|x| x * length)
    });
    // A needle: triangles a thousand times longer than wide.
    let needle = mesh::icosphere(4).map("needle", |[x, y, z]| [x * 1e-2, y * 1e-2, z * 10.0]);
    let moved = mesh::icosphere(4).map("moved", |[x, y, z]| [x + 7.7, y - 3.3, z + 9.1]);
    vec![
        (coarse, 0.3),
        (fine, 0.3),
        (spiky, 0.0),
        (needle, 0.0),
        (moved, 0.3),
    ]
}

#[test]
fn ten_million_rays_at_edges_and_corners_do_not_leak() {
    let seed = 2013;
    let mut rng = Rng::new(seed);
    let meshes = closed_meshes(&mut rng);
    let levels: Vec<_> = Isa::available().collect();
    let runs = meshes.len() * Builder::ALL.len() * Width::ALL.len() * levels.len();
    let mut traced = 0;
    for (mesh, room) in &meshes {
        let primitives = Primitives::new(&[geometry(mesh)]).expect("indices in range");
        let trees = Builder::ALL.map(|builder| (builder, BinaryTree::build(&primitives, builder)));
        let center = if mesh.name == "moved" {
            [7.7, -3.3, 9.1]
        } else {
            [0.0; 3]
        };
        for (width, (builder, tree)) in Width::ALL
            .into_iter()
            .flat_map(|width| trees.iter().map(move |tree| (width, tree)))
        {
            for isa in &levels {
                let bvh = Bvh::collapse(&primitives, tree, Collapse::Area, width, *isa);
                let mut occluded = vec![false; BATCH];
                for _ in 0..RAYS.div_ceil(runs * BATCH) {
                    let rays: Vec<_> = (0..BATCH)
                        .map(|_| aim(&mut rng, mesh, center, *room))
                        .collect();
                    bvh.occluded_batch(&rays, &mut occluded);
                    traced += BATCH;
                    for (ray, occluded) in rays.iter().zip(&occluded) {
                        assert!(
                            *occluded,
                            "seed {seed}, {} {builder} x{width} {}: {ray:?}",
                            mesh.name,
                            isa.level()
                        );
                    }
                }
            }
        }
    }
    assert!(traced >= RAYS);
    println!("{traced} rays, none leaked");
}

/// A ray from inside to a corner, to the middle of an edge, or to somewhere on an edge.
fn aim(rng: &mut Rng, mesh: &Mesh, center: [f32; 3], room: f32) -> Ray {
    let [a, b, _] = mesh.triangle(rng.below(mesh.indices.len()));
    let share = match rng.below(3) {
        0 => 0.0,
        1 => 0.5,
        _ => rng.unit(),
    };
    let offset = rng.point(room);
    let org: [f32; 3] = core::array::from_fn(|axis| center[axis] + offset[axis]);
    let dir = core::array::from_fn(|axis| a[axis] + (b[axis] - a[axis]) * share - org[axis]);
    Ray::new(org, dir)
}
