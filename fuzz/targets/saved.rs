//! Files of trees, child orders and training logs, forged ones with a good checksum too: refused, or trees that answer every ray.
#![no_main]

use antumbra::lab::{Log, SlotOrder};
use antumbra::{Bvh, Isa, Ray};
use libfuzzer_sys::fuzz_target;

/// A file with these contents, as `docs/src/file-format.md` describes it.
fn sealed(magic: &[u8; 8], contents: &[u8]) -> Vec<u8> {
    let words = contents.len() / 4;
    let mut file = magic.to_vec();
    file.extend(2u32.to_le_bytes());
    file.extend((words as u64).to_le_bytes());
    file.extend(&contents[..4 * words]);
    let mut sum = 0u64;
    for word in file.chunks_exact(4) {
        let word = u32::from_le_bytes([word[0], word[1], word[2], word[3]]);
        let z = (sum ^ u64::from(word)).wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        sum = z ^ (z >> 31);
    }
    file.extend(sum.to_le_bytes());
    file
}

fn saved(bvh: &Bvh) -> Vec<u8> {
    let mut bytes = Vec::new();
    bvh.write(&mut bytes).expect("a vector takes anything");
    bytes
}

fn ask(mut bvh: Bvh) {
    bvh.validate().expect("what was read is valid");
    let bytes = saved(&bvh);
    let again = Bvh::read(&bytes[..]).expect("a file of ours");
    assert_eq!(saved(&again), bytes);

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
    for isa in Isa::available() {
        bvh.set_isa(isa);
        let mut occluded = vec![false; rays.len()];
        let mut hits = vec![None; rays.len()];
        bvh.occluded_batch(&rays, &mut occluded);
        bvh.intersect_batch(&rays, &mut hits);
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
    match kind % 6 {
        0 => {
            let _ = Bvh::read(contents);
        }
        1 => {
            let _ = SlotOrder::read(contents);
        }
        2 => {
            if let Ok(order) = SlotOrder::read(&sealed(b"ANTUSLOT", contents)[..]) {
                let mut again = Vec::new();
                order.write(&mut again).expect("a vector takes anything");
                assert_eq!(SlotOrder::read(&again[..]), Ok(order));
            }
        }
        3 => {
            let _ = Log::read(contents);
        }
        4 => {
            if let Ok(log) = Log::from_bytes(&sealed(b"ANTULOGS", contents)) {
                assert_eq!(Log::from_bytes(&log.to_bytes()), Ok(log));
            }
        }
        _ => {
            if let Ok(bvh) = Bvh::read(&sealed(b"ANTUTREE", contents)[..]) {
                ask(bvh);
            }
        }
    }
});
