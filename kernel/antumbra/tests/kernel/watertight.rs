//! No ray from inside a closed mesh gets out, however exactly it is aimed at an edge or a corner.

use crate::support::{BUILDERS, geometry, ways};
use antumbra::parts::{BinaryTree, Steps};
use antumbra::recipe::{Builder, Collapse, Engine};
use antumbra::{Brute, Bvh, Primitives, Ray};
use antumbra_testkit::sample::triples;
use antumbra_testkit::{Mesh, Rng, mesh};

const BATCH: usize = 4096;

/// How many answers each test asks for: millions in `ANTUMBRA_LEAK_MILLIONS`, or else a million.
fn wanted() -> usize {
    let told = std::env::var("ANTUMBRA_LEAK_MILLIONS").ok();
    told.map_or(1, |text| text.parse().expect("millions of answers")) * 1_000_000
}

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
fn rays_at_edges_and_corners_do_not_leak() {
    let wanted = wanted();
    let seed = 2013;
    let mut rng = Rng::new(seed);
    let meshes = closed_meshes(&mut rng);
    let meshes: Vec<_> = meshes.iter().collect();
    let runs = triples(seed, &meshes, &BUILDERS, &ways());
    let mut traced = 0;
    for ((mesh, room), builder, engine) in &runs {
        let primitives = Primitives::new(&[geometry(mesh)]).expect("indices in range");
        let tree = BinaryTree::build(&primitives, *builder);
        let center = if mesh.name == "moved" {
            [7.7, -3.3, 9.1]
        } else {
            [0.0; 3]
        };
        let bvh = Bvh::collapse(&primitives, &tree, Collapse::Area, *engine);
        let mut occluded = vec![false; BATCH];
        for _ in 0..wanted.div_ceil(runs.len() * BATCH) {
            let rays: Vec<_> = (0..BATCH)
                .map(|_| aim(&mut rng, mesh, center, *room))
                .collect();
            bvh.batch(&rays).occluded_into(&mut occluded);
            traced += BATCH;
            for (ray, occluded) in rays.iter().zip(&occluded) {
                assert!(
                    *occluded,
                    "seed {seed}, {} {builder} {engine:?}: {ray:?}",
                    mesh.name,
                );
            }
        }
    }
    assert!(traced >= wanted);
    println!("{traced} answers, no ray leaked");
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

/// A prism along z from -1 to 1 with caps that meet in a middle, turned at random. `across` is its radius on x and y.
fn rod(rng: &mut Rng, sides: u32, across: [f32; 2]) -> Mesh {
    let turn = Turn::random(rng);
    let mut positions = vec![turn.of([0.0, 0.0, -1.0]), turn.of([0.0, 0.0, 1.0])];
    let mut indices = Vec::new();
    for side in 0..sides {
        let angle = (side as f32 + 0.3) / sides as f32 * core::f32::consts::TAU;
        let [x, y] = [across[0] * angle.cos(), across[1] * angle.sin()];
        positions.extend([turn.of([x, y, -1.0]), turn.of([x, y, 1.0])]);
        let [a, b] = [2 + 2 * side, 2 + 2 * ((side + 1) % sides)];
        indices.extend([
            [a, b, a + 1],
            [b, b + 1, a + 1],
            [0, b, a],
            [1, a + 1, b + 1],
        ]);
    }
    Mesh {
        name: "rod",
        positions,
        indices,
    }
}

/// A rotation.
struct Turn([[f64; 3]; 3]);

impl Turn {
    fn random(rng: &mut Rng) -> Self {
        let unit = |v: [f64; 3]| {
            let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
            v.map(|x| x / length)
        };
        let x = unit(rng.direction().map(f64::from));
        let other = rng.direction().map(f64::from);
        let share: f64 = (0..3).map(|axis| x[axis] * other[axis]).sum();
        let y = unit(core::array::from_fn(|axis| other[axis] - share * x[axis]));
        let z = core::array::from_fn(|axis| {
            let [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
            x[i] * y[j] - x[j] * y[i]
        });
        Self([x, y, z])
    }

    fn of(&self, point: [f32; 3]) -> [f32; 3] {
        core::array::from_fn(|axis| {
            let along = |of: usize| f64::from(point[of]) * self.0[of][axis];
            (along(0) + along(1) + along(2)) as f32
        })
    }
}

/// A ray from `org` to a corner, the edge or the face of a triangle, wherever that is.
fn aim_anywhere(rng: &mut Rng, mesh: &Mesh, org: [f32; 3]) -> Ray {
    let [a, b, c] = mesh.triangle(rng.below(mesh.indices.len()));
    let (mut u, mut v) = (rng.unit(), rng.unit());
    match rng.below(4) {
        0 => (u, v) = (0.0, 0.0),
        1 => (u, v) = (0.5, 0.0),
        2 => v = 0.0,
        _ if u + v > 1.0 => (u, v) = (1.0 - u, 1.0 - v),
        _ => {}
    }
    let dir = core::array::from_fn(|axis| {
        (a[axis] - org[axis]) + (b[axis] - a[axis]) * u + (c[axis] - a[axis]) * v
    });
    Ray::new(org, dir)
}

/// Bodies of any thinness: triangles seen so flat that single precision cannot tell how far they are.
#[test]
fn thin_bodies_do_not_leak() {
    const SIDES: [u32; 4] = [3, 4, 6, 41];
    const THIN: [f32; 7] = [1e-1, 1e-2, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5];
    let seed = 1905;
    let mut rng = Rng::new(seed);
    let wanted = wanted();
    let mut traced = 0;
    let across = THIN.map(|thin| [[thin, thin], [0.3 * thin, thin]]);
    let rods: Vec<_> = SIDES
        .into_iter()
        .flat_map(|sides| {
            across
                .as_flattened()
                .iter()
                .map(move |&across| (sides, across))
        })
        .collect();
    while traced < wanted {
        for ((sides, across), builder, way) in triples(rng.bits(), &rods, &BUILDERS, &ways()) {
            let mesh = rod(&mut rng, sides, across);
            let name = format!("seed {seed}, {sides} sides of {across:?}");
            traced += all_hit(&mut rng, &mesh, builder, way, &name);
        }
    }
    println!("{traced} answers, no ray leaked");
}

/// Rays from the middle of a mesh, in batches and one by one: all hit what they hit without a tree. Returns the number of
/// answers.
fn all_hit(rng: &mut Rng, mesh: &Mesh, builder: Builder, engine: Engine, name: &str) -> usize {
    let primitives = Primitives::new(&[geometry(mesh)]).expect("indices in range");
    let rays: Vec<_> = (0..BATCH)
        .map(|_| aim_anywhere(rng, mesh, [0.0; 3]))
        .collect();
    let brute = Brute::new(&primitives);
    let found: Vec<_> = rays.iter().map(|ray| brute.intersect(ray)).collect();
    for (ray, found) in rays.iter().zip(&found) {
        assert!(found.is_some(), "{name}, no tree: {ray:?}");
    }
    let tree = BinaryTree::build(&primitives, builder);
    let bvh = Bvh::collapse(&primitives, &tree, Collapse::Area, engine);
    let name = format!("{name}, {builder} {engine:?}");
    let mut occluded = vec![false; BATCH];
    let mut hits = vec![None; BATCH];
    bvh.batch(&rays).occluded_into(&mut occluded);
    bvh.batch(&rays).intersect_into(&mut hits);
    for (index, ray) in rays.iter().enumerate() {
        assert!(occluded[index] && bvh.occluded(ray), "{name}: {ray:?}");
        assert_eq!(hits[index], found[index], "{name}: {ray:?}");
        assert_eq!(bvh.intersect(ray), found[index], "{name}: {ray:?}");
    }
    4 * BATCH
}

/// A box, 1 : 10 000, and a ray in it that once got out: it meets a sliver whose distance single precision puts behind
/// the origin.
#[test]
fn a_ray_that_once_leaked() {
    let near = [
        [-0.2695318, -0.28855085, -0.30674258],
        [-0.26951733, -0.28857654, -0.3067311],
        [-0.26949495, -0.2885739, -0.3067533],
        [-0.2695094, -0.2885482, -0.30676478],
    ];
    let mut positions = near.to_vec();
    positions.extend([2, 3, 0, 1].map(|corner: usize| near[corner].map(|x: f32| -x)));
    let ray = Ray::new(
        [0.15194142, 0.1626806, 0.17294566],
        [-4.49121e-5, -3.361702e-5, -7.490814e-5],
    );
    // Quads have two diagonals: whichever the sides are cut along, one of the bodies had the leak.
    for cut in 0..16 {
        let mut indices = vec![[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]];
        for side in 0..4 {
            let next = (side + 1) % 4;
            let [a, b, c, d] = [side, next, 4 + next, 4 + side];
            indices.extend(if cut >> side & 1 == 0 {
                [[a, b, c], [a, c, d]]
            } else {
                [[a, b, d], [b, c, d]]
            });
        }
        let mesh = Mesh {
            name: "box",
            positions: positions.clone(),
            indices,
        };
        let primitives = Primitives::new(&[geometry(&mesh)]).expect("indices in range");
        assert!(Brute::new(&primitives).occluded(&ray), "cut {cut}");
    }
}
