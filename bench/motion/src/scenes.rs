//! Scenes of two keys, and rays from their surfaces at random times.

use antumbra::{Geometry, MovingBvh, MovingInstance, MovingMesh, MovingScene, Ray, Recipe};
use antumbra_scene::{Geometry as SceneGeometry, builtin};
use antumbra_testkit::{Rng, mesh};

/// Triangles.
pub struct Mesh {
    pub positions: Vec<[f32; 3]>,
    pub indices: Vec<[u32; 3]>,
}

/// A rotation, `[w, x, y, z]`, and a translation.
#[derive(Clone, Copy)]
pub struct Key {
    pub quaternion: [f32; 4],
    pub translation: [f32; 3],
}

impl Key {
    pub fn rows(&self) -> [[f32; 4]; 3] {
        let [w, x, y, z] = self.quaternion;
        let [a, b, c] = self.translation;
        [
            [
                1.0 - 2.0 * (y * y + z * z),
                2.0 * (x * y - w * z),
                2.0 * (x * z + w * y),
                a,
            ],
            [
                2.0 * (x * y + w * z),
                1.0 - 2.0 * (x * x + z * z),
                2.0 * (y * z - w * x),
                b,
            ],
            [
                2.0 * (x * z - w * y),
                2.0 * (y * z + w * x),
                1.0 - 2.0 * (x * x + y * y),
                c,
            ],
        ]
    }
}

/// The built-in city as one mesh, and the same bent and moved by a share of its size.
pub fn city(triangles: usize, share: f32) -> (Mesh, Vec<[f32; 3]>) {
    let scene = builtin::by_name(&format!("city:{triangles}")).expect("a city");
    let mut mesh = Mesh {
        positions: Vec::new(),
        indices: Vec::new(),
    };
    for shape in &scene.shapes {
        if let SceneGeometry::Mesh(part) = &shape.geometry {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend_from_slice(&part.positions);
            let indices = part.indices.iter();
            mesh.indices
                .extend(indices.map(|triangle| triangle.map(|index| first + index)));
        }
    }
    let size = mesh
        .positions
        .iter()
        .flatten()
        .fold(0.0f32, |size, x| size.max(x.abs()));
    let moved = (mesh.positions.iter()).map(|&[x, y, z]| {
        let by = share * size;
        let wave = |at: f32| (6.0 * at / size).sin();
        [x + by * wave(y), y + by * wave(x + z), z + by * wave(x)]
    });
    let moved = moved.collect();
    (mesh, moved)
}

/// A ball with bumps, and instances of it that turn and move by about their size.
pub fn balls(count: usize) -> (Mesh, Vec<[Key; 2]>) {
    let mut rng = Rng::new(7);
    let ball = mesh::icosphere(4);
    let mesh = Mesh {
        positions: ball
            .map("bumpy", |at| {
                let bump = 1.0 + 0.2 * (9.0 * at[0]).sin() * (9.0 * at[1]).sin();
                at.map(|x| x * bump)
            })
            .positions,
        indices: ball.indices,
    };
    let half = 1.6 * (count as f32).cbrt();
    let instances = (0..count).map(|_| {
        let at = rng.point(half);
        let way = rng.direction();
        let axis = rng.direction();
        let length = axis.iter().map(|x| x * x).sum::<f32>().sqrt();
        let angles = [rng.range(-0.6, 0.6), rng.range(-0.6, 0.6)];
        let key = |angle: f32, share: f32| Key {
            quaternion: {
                let (sin, cos) = angle.sin_cos();
                let [x, y, z] = axis.map(|x| x / length * sin);
                [cos, x, y, z]
            },
            translation: [0, 1, 2].map(|i| at[i] + share * way[i]),
        };
        [key(angles[0], 0.0), key(angles[1], 1.0)]
    });
    let instances = instances.collect();
    (mesh, instances)
}

pub fn moving_mesh(
    mesh: &Mesh,
    end: &[[f32; 3]],
    recipe: &Recipe,
) -> (MovingScene<'static>, MovingBvh) {
    let keys = vec![mesh.positions.clone().into(), end.to_vec().into()];
    let mesh = MovingMesh::new(keys, mesh.indices.clone());
    built(
        MovingScene::new(vec![mesh.into()], vec![], vec![]).expect("sound"),
        recipe,
    )
}

pub fn moving_instances(
    mesh: &Mesh,
    keys: &[[Key; 2]],
    recipe: &Recipe,
) -> (MovingScene<'static>, MovingBvh) {
    let object = vec![Geometry::triangles(
        mesh.positions.clone(),
        mesh.indices.clone(),
    )];
    let instances = keys
        .iter()
        .map(|keys| MovingInstance::new(0, keys.iter().map(Key::rows).collect()));
    built(
        MovingScene::new(vec![], vec![object], instances.collect()).expect("sound"),
        recipe,
    )
}

fn built(scene: MovingScene<'static>, recipe: &Recipe) -> (MovingScene<'static>, MovingBvh) {
    let bvh = MovingBvh::build(&scene, recipe).expect("sound");
    (scene, bvh)
}

/// Rays without end from what the first rays through the scene hit, in random directions away from there, each at a time of its own.
pub fn rays(bvh: &MovingBvh, count: usize) -> (Vec<Ray>, Vec<f32>) {
    let mut rng = Rng::new(11);
    let bounds = bvh.bounds();
    let offset = bounds.origin_offset();
    let inside = |rng: &mut Rng| -> [f32; 3] {
        core::array::from_fn(|i| bounds.min[i] + rng.unit() * (bounds.max[i] - bounds.min[i]))
    };
    let (mut rays, mut times) = (Vec::new(), Vec::new());
    while rays.len() < count {
        let time = rng.unit();
        let first = Ray::new(inside(&mut rng), rng.direction());
        let Some(hit) = bvh.intersect(&first, time) else {
            continue;
        };
        let at = first.at(hit.t);
        // Back to the side that the first ray came from.
        let dir = rng.direction();
        let side = dir.iter().zip(first.dir).map(|(a, b)| a * b).sum::<f32>();
        let dir = if side > 0.0 { dir.map(|x| -x) } else { dir };
        let length = first.dir.iter().map(|x| x * x).sum::<f32>().sqrt();
        let back = first.dir.map(|x| x / length * offset.max(1e-4 * hit.t));
        rays.push(Ray::new([0, 1, 2].map(|i| at[i] - back[i]), dir));
        times.push(time);
    }
    (rays, times)
}
