//! Files of trees, objects and worlds, forged ones with a good checksum too: refused, or trees that answer every ray.
#![no_main]

use std::sync::Arc;

use antumbra::cutout::{Candidate, Opacity};
use antumbra::recipe::Engine;
use antumbra::saved::{Functions, Saved};
use antumbra::shapes::{UserGeometry, UserHit};
use antumbra::{Aabb, Bvh, Instance, Object, Ray, World};
use libfuzzer_sys::fuzz_target;

fn mixed(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A file with these contents, as `docs/src/file-format.md` describes it.
fn sealed(magic: &[u8; 8], contents: &[u8]) -> Vec<u8> {
    const STEP: u64 = 0x9e37_79b9_7f4a_7c15;
    const FRAME: usize = 4 << 14;
    let contents = &contents[..contents.len() / 4 * 4];
    let mut file = magic.to_vec();
    file.extend(3u32.to_le_bytes());
    let mut sum = 0u64;
    let last = contents.len() / FRAME;
    for place in 0..=last {
        let frame = &contents[place * FRAME..contents.len().min((place + 1) * FRAME)];
        let first = (frame.len() / 4) as u32 | u32::from(place == last) << 31;
        let start = mixed((sum ^ u64::from(first)).wrapping_add(STEP));
        let mut lanes: [u64; 8] = core::array::from_fn(|lane| start ^ lane as u64);
        let mut padded = frame.to_vec();
        padded.resize((frame.len() / 64 + 1) * 64, 0);
        for (place, long) in padded.as_chunks().0.iter().enumerate() {
            let lane = &mut lanes[place % 8];
            *lane = (*lane ^ u64::from_le_bytes(*long))
                .wrapping_mul(STEP)
                .rotate_left(29);
        }
        sum = lanes
            .iter()
            .fold(0, |sum, lane| mixed((sum ^ lane).wrapping_add(STEP)));
        file.extend(first.to_le_bytes());
        file.extend(frame);
        file.extend(sum.to_le_bytes());
    }
    file
}

/// A filter and a shape.
#[derive(Debug)]
struct Half;

impl Opacity for Half {
    fn opacity(&self, candidate: &Candidate) -> f32 {
        candidate.u
    }
}

impl UserGeometry for Half {
    fn bounds(&self, _: u32) -> Aabb {
        Aabb::new([0.0; 3], [1.0; 3])
    }

    fn intersect(&self, prim_id: u32, _: &Ray) -> Option<UserHit> {
        Some(UserHit::new(0.5, prim_id as f32, 0.0))
    }
}

fn read<T: Saved>(magic: &[u8; 8], contents: &[u8]) -> Option<(T, Functions)> {
    let file = sealed(magic, contents);
    for functions in [
        Functions::new(),
        Functions::new().filters(vec![Arc::new(Half)]),
        Functions::new()
            .filters(vec![Arc::new(Half)])
            .shapes(vec![Arc::new(Half)]),
    ] {
        if let Ok(read) = functions.from_bytes(&file) {
            return Some((read, functions));
        }
    }
    None
}

fn ask_saved(bvh: Bvh, functions: &Functions) {
    let bytes = bvh.to_bytes();
    let again: Bvh = functions.from_bytes(&bytes).expect("a file of ours");
    assert_eq!(again.to_bytes(), bytes);
    ask(bvh);
}

fn ask(mut bvh: Bvh) {
    let _ = bvh.validate();
    let bounds = bvh.bounds();
    let corner = |index: usize| -> [f32; 3] {
        core::array::from_fn(|axis| match index >> axis & 1 {
            0 => bounds.min[axis],
            _ => bounds.max[axis],
        })
    };
    let rays: Vec<Ray> = (0..64)
        .map(|index| Ray::between(corner(index & 7), corner(index >> 3)).closed())
        .chain((0..8).map(|index| Ray::new([0.1, 0.2, 0.3], corner(index))))
        .collect();
    let mut expected = None;
    let width = bvh.width();
    for engine in Engine::all().filter(|engine| engine.width() == width) {
        engine.run(&mut bvh).expect("its width");
        let mut occluded = vec![false; rays.len()];
        let mut hits = vec![None; rays.len()];
        bvh.batch(&rays).occluded_into(&mut occluded);
        bvh.batch(&rays).intersect_into(&mut hits);
        for ((ray, hit), occluded) in rays.iter().zip(&hits).zip(&occluded) {
            assert_eq!(bvh.occluded(ray), *occluded);
            if let Some(hit) = hit {
                let _ = bvh.normal(ray, hit);
            }
        }
        assert_eq!(*expected.get_or_insert_with(|| occluded.clone()), occluded);
    }
}

fuzz_target!(|bytes: &[u8]| {
    let Some((kind, contents)) = bytes.split_first() else {
        return;
    };
    match kind % 4 {
        0 => {
            let _ = Bvh::read(contents);
        }
        1 => {
            if let Some((bvh, functions)) = read::<Bvh>(b"ANTUTREE", contents) {
                ask_saved(bvh, &functions);
            }
        }
        2 => {
            if let Some((mut world, functions)) = read::<World>(b"ANTUWRLD", contents) {
                ask_saved(Bvh::clone(&world), &functions);
                let bytes = world.to_bytes();
                let again: World = functions.from_bytes(&bytes).expect("a file of ours");
                assert_eq!(again.to_bytes(), bytes);
                let mut moved: Vec<_> = world.instances().iter().take(64).cloned().collect();
                moved.reverse();
                moved.extend(moved.clone());
                if world.set_instances(&moved).is_ok() {
                    ask(Bvh::clone(&world));
                }
            }
        }
        _ => {
            if let Some((object, functions)) = read::<Object>(b"ANTUOBJT", contents) {
                ask_saved(Bvh::clone(&object), &functions);
                let here = [
                    [1.0, 0.5, 0.0, 0.2],
                    [0.0, 1.0, 0.0, 0.0],
                    [0.0, 0.0, -2.0, 0.0],
                ];
                let here = [Instance::new(0, here)];
                if let Ok(world) = World::on_ground(&object, &[&object], &here) {
                    ask(Bvh::clone(&world));
                }
            }
        }
    }
});
