//! Parts of bakes, forged ones with good check sums too: refused, or answers as many as the job has.
#![no_main]

use antumbra::{Bvh, Recipe};
use antumbra_bake::{Eyes, Key, Part, Sensors, VisibilityJob, Work};
use libfuzzer_sys::fuzz_target;
use xxhash_rust::xxh3::xxh3_64;

/// Records of these bytes, each of a number, a length and a content.
fn sealed(mut bytes: &[u8], identity: Option<&[u8]>) -> Vec<u8> {
    let mut out = Part::MAGIC.to_vec();
    let mut push = |number: u64, content: &[u8]| {
        for word in [number, content.len() as u64, xxh3_64(content) ^ number] {
            out.extend(word.to_le_bytes());
        }
        out.extend(content);
    };
    if let Some(identity) = identity {
        push(0, identity);
    }
    while let [number, length, rest @ ..] = bytes {
        let (content, rest) = rest.split_at((*length as usize).min(rest.len()));
        push(u64::from(*number), content);
        bytes = rest;
    }
    out
}

fuzz_target!(|bytes: &[u8]| {
    let Some((kind, contents)) = bytes.split_first() else {
        return;
    };
    let bvh = Bvh::build(&[], &Recipe::default()).expect("an empty tree");
    let table = "0 0 0\n1 0 0\n0 1 0\n";
    let sensors = Sensors::from_table(table, &Default::default()).expect("a table");
    let rows = Eyes::new(&sensors, &bvh, [0.0, 0.0, 1.0], 0.0);
    let job = VisibilityJob {
        rows: &rows,
        columns: None,
        margin: None,
        range: None,
    };
    let key = Key::of(&job, |_| ());
    let mut work = Work::new(&job, key, [0, 1], Vec::new());
    let bytes = match kind % 3 {
        0 => contents.to_vec(),
        1 => sealed(contents, None),
        _ => {
            let mut empty = Vec::new();
            work.write(&mut empty).expect("a vector takes anything");
            let identity = &empty[Part::MAGIC.len() + 24..];
            sealed(contents, Some(identity))
        }
    };
    let Ok(part) = Part::read(&bytes) else {
        return;
    };
    let added = if part.is_sound && kind & 64 == 0 {
        work.add(part)
    } else {
        work.resume(part)
    };
    if added.is_ok() {
        while work.step(&bvh, &()).expect("a small job") {}
        if let Ok(matrix) = work.finish() {
            assert_eq!((matrix.rows(), matrix.columns()), (3, 3));
        }
    }
});
