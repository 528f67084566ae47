//! No ray from inside a closed mesh gets out, however exactly it is aimed at an edge or a corner.

use crate::support::geometry;
use antumbra::lab::{BinaryTree, Laboratory};
use antumbra::{Brute, Builder, Bvh, Collapse, Isa, Preset, Primitives, Ray, Width};
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

/// A closed prism along z from -1 to 1 with so many sides, turned anyhow. The ends are fans around their middles.
fn rod(rng: &mut Rng, sides: u32, radius: f32) -> Mesh {
    let mut positions = vec![[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]];
    let mut indices = Vec::new();
    for side in 0..sides {
        let angle = core::f32::consts::TAU * side as f32 / sides as f32;
        let (x, y) = (radius * angle.cos(), radius * angle.sin());
        positions.extend([[x, y, -1.0], [x, y, 1.0]]);
        let [a, b] = [side, (side + 1) % sides].map(|side| 2 + 2 * side);
        indices.extend([
            [a, b, b + 1],
            [a, b + 1, a + 1],
            [0, b, a],
            [1, a + 1, b + 1],
        ]);
    }
    let axes = basis(rng);
    let turned = |p: &[f32; 3]| -> [f32; 3] {
        core::array::from_fn(|i| p[0] * axes[0][i] + p[1] * axes[1][i] + p[2] * axes[2][i])
    };
    Mesh {
        name: "rod",
        positions: positions.iter().map(turned).collect(),
        indices,
    }
}

/// Three directions at right angles.
fn basis(rng: &mut Rng) -> [[f32; 3]; 3] {
    let cross = |a: [f32; 3], b: [f32; 3]| -> [f32; 3] {
        core::array::from_fn(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
    };
    let unit = |a: [f32; 3]| {
        let length = a.iter().map(|x| x * x).sum::<f32>().sqrt();
        a.map(|x| x / length)
    };
    let z = unit(rng.direction());
    let x = unit(cross(z, unit(rng.direction())));
    [x, cross(z, x), z]
}

/// Rods and bars up to 1 : 100 000, from whose middle rays go to corners, to edges and anywhere. Every level answers as brute
/// force does, and nothing gets out.
#[test]
fn thin_closed_bodies_do_not_leak() {
    const RAYS: usize = 8192;
    let seed = 2026;
    let mut rng = Rng::new(seed);
    for sides in [3, 4, 6, 41] {
        for radius in [1e-1, 1e-2, 1e-3, 3.2e-4, 1e-4, 3.2e-5, 1e-5] {
            let mesh = rod(&mut rng, sides, radius);
            let primitives = Primitives::new(&[geometry(&mesh)]).expect("indices in range");
            let rays: Vec<_> = (0..RAYS)
                .map(|index| match index % 2 {
                    0 => aim(&mut rng, &mesh, [0.0; 3], 0.0),
                    _ => Ray::new([0.0; 3], rng.direction()),
                })
                .collect();
            let place = format!("seed {seed}, {sides} sides, radius {radius}");
            let brute = Brute::new(primitives.clone());
            let mut expected = vec![None; RAYS];
            brute.intersect_batch(&rays, &mut expected);
            let leaks = expected.iter().filter(|hit| hit.is_none()).count();
            assert_eq!(leaks, 0, "{place}: rays that get out");
            for preset in Preset::ALL {
                let mut bvh = Bvh::build_over(&primitives, &preset.recipe());
                for isa in Isa::available() {
                    bvh.set_isa(isa);
                    let (mut occluded, mut hits) = (vec![false; RAYS], vec![None; RAYS]);
                    bvh.occluded_batch(&rays, &mut occluded);
                    bvh.intersect_batch(&rays, &mut hits);
                    assert!(
                        occluded.iter().all(|occluded| *occluded),
                        "{place} {preset}"
                    );
                    assert!(hits == expected, "{place} {preset} {}", isa.level());
                    let mut tracer = bvh.tracer();
                    for (ray, hit) in rays.iter().zip(&expected).step_by(16) {
                        assert!(tracer.occluded(ray), "{place} {preset}: {ray:?}");
                        assert_eq!(tracer.intersect(ray), *hit, "{place} {preset}: {ray:?}");
                    }
                }
            }
        }
    }
}

/// A box 40 000 times longer than wide, and a ray that once left it between two slivers.
#[test]
fn a_ray_along_a_sliver_does_not_leak() {
    let positions = vec![
        [-0.2695318, -0.28855085, -0.30674258],
        [-0.26951733, -0.28857654, -0.3067311],
        [-0.26949495, -0.2885739, -0.3067533],
        [-0.2695094, -0.2885482, -0.30676478],
        [0.26949495, 0.2885739, 0.3067533],
        [0.2695094, 0.2885482, 0.30676478],
        [0.2695318, 0.28855085, 0.30674258],
        [0.26951733, 0.28857654, 0.3067311],
    ];
    let quads = [
        [0, 1, 2, 3],
        [4, 5, 6, 7],
        [0, 1, 5, 4],
        [1, 2, 6, 5],
        [2, 3, 7, 6],
        [3, 0, 4, 7],
    ];
    let indices = quads
        .iter()
        .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    let mesh = Mesh {
        name: "bar",
        positions,
        indices: indices.collect(),
    };
    let primitives = Primitives::new(&[geometry(&mesh)]).expect("indices in range");
    let ray = Ray::new(
        [0.15194142, 0.1626806, 0.17294566],
        [-4.49121e-5, -3.361702e-5, -7.490814e-5],
    );
    assert!(Brute::new(primitives).occluded(&ray));
}
