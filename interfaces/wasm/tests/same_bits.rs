//! Answers of the library for the scene of `scene.mjs`. Node and a browser compare them with `expected.txt`: see `run`.

use antumbra::{Bvh, Geometry, Ray, Recipe};
use antumbra_wasm::Module;

const TRIANGLES: usize = 2000;
const RAYS: usize = 5000;

struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = (self.0)
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 16_777_216.0
    }
}

fn scene() -> (Vec<f32>, Vec<Ray>) {
    let mut random = Random(7);
    let mut positions = Vec::new();
    for _ in 0..TRIANGLES {
        let centre = [random.next(), random.next(), random.next()];
        for item in 0..9 {
            positions.push(centre[item % 3] + random.next() * 0.125);
        }
    }
    let mut triples = |offset: f32| -> Vec<[f32; 3]> {
        (0..RAYS)
            .map(|_| [(); 3].map(|()| random.next() - offset))
            .collect()
    };
    let (origins, directions) = (triples(0.0), triples(0.5));
    let rays = origins.into_iter().zip(directions);
    (
        positions,
        rays.map(|(org, dir)| Ray::new(org, dir)).collect(),
    )
}

fn digest(bytes: impl Iterator<Item = u8>) -> u64 {
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
    })
}

#[test]
fn the_module_and_the_library_answer_with_the_same_bits() {
    let (positions, rays) = scene();
    let (points, _) = positions.as_chunks::<3>();
    let indices: Vec<_> = (0..TRIANGLES as u32)
        .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
        .collect();
    let mut module = Module {
        indices: indices.clone(),
        positions: points.to_vec(),
        rays: rays.clone(),
        ..Module::default()
    };
    module.add_mesh();
    let number = module.build(antumbra::recipe::Preset::Default).unwrap();
    module.rays.clone_from(&rays);
    module.occluded(number).unwrap();
    module.intersect(number).unwrap();

    let bvh = Bvh::build(&[Geometry::triangles(points, indices)], &Recipe::default()).unwrap();
    let hits = bvh.batch(&rays).intersect();
    let hit: Vec<_> = hits.iter().map(|hit| u8::from(hit.is_some())).collect();
    assert_eq!(module.occluded, hit);
    assert!((RAYS / 4..RAYS).contains(&hit.iter().filter(|&&hit| hit == 1).count()));
    for (ray, hit) in hits.iter().enumerate() {
        let expected = hit.map_or((f32::INFINITY, -1), |hit| {
            (hit.t, hit.prim_id.cast_signed())
        });
        assert_eq!((module.hits.t[ray], module.hits.triangle[ray]), expected);
    }

    let occluded = digest(module.occluded.iter().copied());
    let hits = &module.hits;
    let closest = digest(
        (hits.t.iter().flat_map(|t| t.to_le_bytes()))
            .chain(hits.uv.iter().flat_map(|x| x.to_le_bytes()))
            .chain(hits.triangle.iter().flat_map(|x| x.to_le_bytes()))
            .chain(hits.mesh.iter().flat_map(|x| x.to_le_bytes())),
    );
    let found = format!("{occluded:016x} {closest:016x}\n");
    assert_eq!(
        found,
        include_str!("expected.txt"),
        "the digests of expected.txt"
    );
}

#[test]
fn scenes_are_freed_and_their_numbers_are_used_again() {
    let mut module = Module::default();
    let [a, b] = [0, 1].map(|_| module.build(antumbra::recipe::Preset::Fast).unwrap());
    assert_ne!(a, b);
    module.free(a);
    assert_eq!(
        module.occluded(a),
        Err(String::from("the scene has been freed"))
    );
    assert_eq!(module.occluded(b), Ok(()));
    assert_eq!(module.build(antumbra::recipe::Preset::Fast), Ok(a));
    module.free(17);
}

#[test]
fn a_mistake_says_what_is_wrong_and_leaves_nothing() {
    let mut module = Module {
        positions: vec![[0.0; 3]; 3],
        indices: vec![[0, 1, 3]],
        ..Module::default()
    };
    module.add_mesh();
    let text = module.build(antumbra::recipe::Preset::Fast).unwrap_err();
    assert!(text.contains('3'), "{text}");
    assert_eq!(module.build(antumbra::recipe::Preset::Fast), Ok(0));
}
