//! Files that are damaged or forged: refused, or trees that answer something.

use std::io::{self, Read};
use std::sync::Arc;

use antumbra::recipe::{Engine, Order};
use antumbra::saved::{Functions, Saved};
use antumbra::{Bvh, Error, Instance, Object, Ray, Recipe, Width, World};
use antumbra_testkit::{Rng, mesh};

use super::{Scene, VERSION, Wary, counts, saved, scene};
use crate::support::{bits, cases, geometry};
use crate::transforms::transform;

/// Checks that a file is refused wherever it is cut off and whichever byte is wrong.
fn find_every_damage<T: Saved>(what: &str, bytes: &[u8]) {
    let read = |bytes: &[u8]| Functions::new().from_bytes::<T>(bytes).map(|_| ());
    read(bytes).expect("a file of ours");
    for end in 0..bytes.len() {
        for error in [
            read(&bytes[..end]),
            Functions::new().read::<T>(&bytes[..end]).map(|_| ()),
        ] {
            let error = error.expect_err("cut off");
            assert_eq!(
                error.to_string(),
                format!("cannot read the {what}: it ends too early")
            );
        }
    }
    for place in 0..bytes.len() {
        let mut bytes = bytes.to_vec();
        bytes[place] ^= 1 << (place % 8);
        assert!(read(&bytes).is_err(), "{what} byte {place}");
    }
    let more = [bytes, &[0; 4]].concat();
    assert_eq!(
        read(&more).expect_err("too long").to_string(),
        format!("cannot read the {what}: something follows its end")
    );
}

#[test]
fn every_damage_is_found() {
    let (primitives, _) = scene(5, 20);
    let recipe = Recipe::default().engine(Engine::best(Width::W4));
    let bytes = saved(&Bvh::build(&primitives, &recipe).expect("a tree"));
    find_every_damage::<Bvh>("tree", &bytes);
    let soup = mesh::soup(&mut Rng::new(5), 20);
    let object = Object::build(&[geometry(&soup)], &recipe).expect("in range");
    find_every_damage::<Object>("object", &object.to_bytes());
    let here = Instance::new(0, transform(&mut Rng::new(6)));
    let world = World::on_ground(&object, &[&object], &[here]).expect("in range");
    find_every_damage::<World>("world", &world.to_bytes());
    assert!(Bvh::from_bytes(&object.to_bytes()).is_err() && World::from_bytes(&bytes).is_err());
    assert!(Bvh::read(&b"ANTUMBRA\x01\0\0\0"[..]).is_err());
    // Frames that say they are longer than any, or that never end.
    for first in [u32::MAX, 0x7fff_ffff, 0x4001] {
        let endless = [&bytes[..12], &first.to_le_bytes()].concat();
        let endless = endless.chain(io::repeat(0));
        assert!(Bvh::read(endless).is_err());
    }
    let nothing = framed(b"ANTUTREE", &[&[][..]; 9], VERSION);
    let error = Bvh::read(nothing.chain(io::repeat(0))).expect_err("no contents");
    assert!(
        error.to_string().ends_with("a frame has a wrong length"),
        "{error}"
    );
    // Another version is named.
    for version in [2u8, 9] {
        let mut other = bytes.clone();
        other[8] = version;
        let error = Bvh::read(&other[..]).expect_err("another version");
        assert_eq!(
            error.to_string(),
            format!(
                "cannot read the tree: it has version {version}, not {VERSION}: build it again and save it"
            )
        );
    }
}

/// Words of contents in a frame, at most.
pub const FRAME: usize = 1 << 14;

/// A file of the book with the contents of each frame.
pub fn framed(magic: &[u8; 8], frames: &[&[u8]], version: u32) -> Vec<u8> {
    fn mix(z: u64) -> u64 {
        let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    const STEP: u64 = 0x9e37_79b9_7f4a_7c15;
    let mut file = magic.to_vec();
    file.extend(version.to_le_bytes());
    let mut sum = 0u64;
    for (index, frame) in frames.iter().enumerate() {
        let is_last = index + 1 == frames.len();
        let first = (frame.len() / 4) as u32 | u32::from(is_last) << 31;
        let start = mix((sum ^ u64::from(first)).wrapping_add(STEP));
        let mut lanes: [u64; 8] = std::array::from_fn(|lane| start ^ lane as u64);
        let mut padded = frame.to_vec();
        padded.resize((frame.len() / 64 + 1) * 64, 0);
        for (place, long) in padded.chunks_exact(8).enumerate() {
            let long = u64::from_le_bytes(long.try_into().expect("eight bytes"));
            let lane = &mut lanes[place % 8];
            *lane = (*lane ^ long).wrapping_mul(STEP).rotate_left(29);
        }
        sum = lanes
            .iter()
            .fold(0, |sum, lane| mix((sum ^ lane).wrapping_add(STEP)));
        file.extend(first.to_le_bytes());
        file.extend(*frame);
        file.extend(sum.to_le_bytes());
    }
    file
}

/// A file with these contents.
pub fn sealed(magic: &[u8; 8], contents: &[u8]) -> Vec<u8> {
    let mut frames: Vec<_> = contents.chunks(4 * FRAME).collect();
    if frames.is_empty() {
        frames.push(&[]);
    }
    framed(magic, &frames, VERSION)
}

/// Beginning and contents of a file.
pub fn opened(file: &[u8]) -> ([u8; 8], Vec<u8>) {
    let mut contents = Vec::new();
    let mut rest = &file[12..];
    while let Some((first, frame)) = rest.split_first_chunk() {
        let len = 4 * (u32::from_le_bytes(*first) as usize & 0x7fff_ffff);
        contents.extend(&frame[..len]);
        rest = &frame[len + 8..];
    }
    (file[..8].try_into().expect("eight bytes"), contents)
}

/// Some words of a file are others, or its end is missing; its checksum is right.
fn forged(rng: &mut Rng, file: &[u8]) -> Vec<u8> {
    /// Numbers that mean something: counts, references, floats that are not finite.
    const TELLING: [u32; 17] = [
        0,
        1,
        2,
        3,
        0x3fff_ffff,
        0x4000_0000,
        0x4000_0001,
        0x6000_0000,
        0x7000_0000,
        0x9000_0000,
        0xc000_0000,
        0xe000_0000,
        0xe000_0001,
        u32::MAX,
        0x7f80_0000,
        0x7fc0_0000,
        0xff80_0000,
    ];
    let (magic, mut contents) = opened(file);
    let words = contents.len() / 4;
    for _ in 0..1 + rng.below(3) {
        let word = match rng.below(4) {
            // The first words are sizes, and the last ones what is behind the tree.
            0 => rng.below(40.min(words)),
            1 => words - 1 - rng.below(300.min(words)),
            _ => rng.below(words),
        };
        let value = match rng.below(3) {
            0 => TELLING[rng.below(TELLING.len())],
            1 => rng.bits() as u32,
            _ => {
                let place = 4 * rng.below(words);
                u32::from_le_bytes(contents[place..][..4].try_into().expect("a word"))
            }
        };
        contents[4 * word..][..4].copy_from_slice(&value.to_le_bytes());
    }
    if rng.below(8) == 0 {
        contents.truncate(4 * rng.below(words));
    }
    sealed(&magic, &contents)
}

/// Queries of a tree from a forged file: they end, and batches say what single rays do.
fn ask(bvh: &Bvh, rays: &[Ray]) {
    let mut occluded = vec![false; rays.len()];
    let mut hits = vec![None; rays.len()];
    bvh.batch(rays).occluded_into(&mut occluded);
    bvh.batch(rays).intersect_into(&mut hits);
    for (ray, hit) in rays.iter().zip(&hits) {
        assert_eq!(bits(bvh.intersect(ray)), bits(*hit));
        let _ = hit.map(|hit| bvh.normal(ray, &hit));
        let _ = bvh.closest(ray.org, 1.0);
    }
    for (ray, occluded) in rays.iter().zip(occluded) {
        assert_eq!(bvh.occluded(ray), occluded);
    }
    let _ = bvh.query(&rays[0]).all_hits();
    let _ = bvh.validate();
}

/// Files with a good checksum whose words are not those that were written: refused, or trees that answer something.
#[test]
fn forged_files_do_no_harm() {
    let mut rng = Rng::new(6);
    let (mut refused, mut taken) = (0, 0);
    for (index, order) in [Order::Joint, Order::Visits, Order::SortPlus]
        .into_iter()
        .enumerate()
    {
        let scene = Scene::new(7 + index as u64, 40);
        let (primitives, rays) = (scene.primitives(), &scene.rays[..]);
        let recipe = Recipe::default()
            .engine(Engine::best(Width::ALL[index]))
            .order(order);
        let good = saved(&Bvh::learn(&primitives, rays, &recipe).expect("a tree"));
        let (magic, contents) = opened(&good);
        assert_eq!(sealed(&magic, &contents), good);
        let functions = scene.functions::<Bvh>(&good);
        for _ in 0..cases(3000) {
            match functions.from_bytes::<Bvh>(&forged(&mut rng, &good)) {
                Err(Error::Unreadable { .. } | Error::OtherFunctions { .. }) => refused += 1,
                Err(error) => panic!("{error}"),
                Ok(bvh) => {
                    ask(&bvh, rays);
                    counts(&bvh, rays);
                    taken += 1;
                }
            }
        }
    }
    assert!(refused > 1000 && taken > 100, "{refused} {taken}");
}

/// Loaded worlds move, and loaded objects join one, as the originals do.
#[test]
fn forged_worlds_do_no_harm() {
    let mut rng = Rng::new(16);
    let (mut refused, mut taken) = (0, 0);
    for width in Width::ALL {
        let scene = Scene::new(17, 60);
        let recipe = Recipe::fast().engine(Engine::best(width));
        let world = scene.world(&recipe);
        let good = world.to_bytes();
        let functions = scene.functions::<World>(&good);
        let lists = scene.objects();
        let object = Object::build(&lists[1], &recipe)
            .expect("in range")
            .to_bytes();
        let of_object = Functions::new()
            .filters(vec![scene.filters[2].clone()])
            .shapes(vec![Arc::new(Wary(scene.shapes[2].clone()))]);
        let rays = &scene.rays[..40];
        for _ in 0..cases(1500) {
            match functions.from_bytes::<World>(&forged(&mut rng, &good)) {
                Err(_) => refused += 1,
                Ok(mut world) => {
                    ask(&world, rays);
                    let moved: Vec<_> = world.instances().iter().rev().cloned().collect();
                    let _ = world.set_instances(&moved);
                    ask(&world, rays);
                    let _ = world.refit(&[(0, &lists[0]), (1, &lists[1])], &scene.instances);
                    world.relearn(rays, &recipe);
                    ask(&world, rays);
                    let many = scene.instances.iter().cycle().take(200).cloned();
                    let _ = world.set_instances(&many.collect::<Vec<_>>());
                    ask(&world, rays);
                    taken += 1;
                }
            }
            match of_object.from_bytes::<Object>(&forged(&mut rng, &object)) {
                Err(_) => refused += 1,
                Ok(mut object) => {
                    let world = World::on_ground(&object, &[&object], &scene.instances[..1]);
                    if let Ok(world) = world {
                        ask(&world, rays);
                    }
                    let _ = object.refit(&lists[1]);
                    ask(&object, rays);
                    taken += 1;
                }
            }
        }
    }
    assert!(refused > 1000 && taken > 500, "{refused} {taken}");
}
