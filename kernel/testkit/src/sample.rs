//! Samples of products of lists, where all of a product would take too long.
//!
//! A sample has every entry of every list. It depends only on the sources, so a commit passes or fails by itself; a
//! test that fails prints its seed, which `TEST_SEED` sets. With `TEST_WHOLE=1` samples are whole products.

use std::cell::Cell;
use std::path::Path;
use std::sync::OnceLock;
use std::{env, fs};

use crate::Rng;

/// Seed of all samples: `TEST_SEED`, or else a hash of the workspace's Rust sources.
///
/// Where files cannot be read, as in an interpreter, it is the hash of no file.
pub fn seed() -> u64 {
    static SEED: OnceLock<u64> = OnceLock::new();
    *SEED.get_or_init(|| match env::var("TEST_SEED") {
        Ok(text) => text.parse().expect("TEST_SEED is a whole number"),
        Err(_) => {
            let folders = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
            let root = folders
                .skip(1)
                .find(|folder| folder.join("Cargo.lock").exists());
            let mut hash = FNV_OFFSET;
            if let (Some(root), false) = (root, cfg!(miri)) {
                add_sources(root, &mut hash);
            }
            hash
        }
    })
}

/// Whether samples are whole products: with `TEST_WHOLE=1`.
pub fn is_whole() -> bool {
    env::var_os("TEST_WHOLE").is_some_and(|value| value == "1")
}

thread_local! {
    static SAID: Cell<bool> = const { Cell::new(false) };
}

/// Places in several lists of these lengths: every place of every list at least once, in as few tuples as that takes.
///
/// `salt` makes the samples of one test differ, for example by the number of a scene.
pub fn product<const N: usize>(salt: u64, lengths: [usize; N]) -> Vec<[usize; N]> {
    let all: usize = lengths.iter().product();
    if is_whole() || all == 0 {
        return (0..all).map(|index| digits(index, lengths)).collect();
    }
    let mut rng = Rng::new(seed() ^ salt);
    // Every test has a thread, whose output is shown if it fails.
    if !SAID.replace(true) {
        println!("a sample of a product: TEST_SEED={} repeats it", seed());
    }
    let count = lengths.into_iter().max().unwrap_or(1);
    let columns = lengths.map(|length| shuffles(&mut rng, length, count));
    (0..count)
        .map(|row| core::array::from_fn(|list| columns[list][row]))
        .collect()
}

/// The entries of two lists at the places of [`product`].
pub fn pairs<A: Copy, B: Copy>(salt: u64, a: &[A], b: &[B]) -> Vec<(A, B)> {
    let places = product(salt, [a.len(), b.len()]).into_iter();
    places.map(|[i, j]| (a[i], b[j])).collect()
}

/// The entries of three lists at the places of [`product`].
pub fn triples<A: Copy, B: Copy, C: Copy>(salt: u64, a: &[A], b: &[B], c: &[C]) -> Vec<(A, B, C)> {
    let places = product(salt, [a.len(), b.len(), c.len()]).into_iter();
    places.map(|[i, j, k]| (a[i], b[j], c[k])).collect()
}

/// Numbers of `index` in a system whose digits are below `lengths`, the last digit first.
fn digits<const N: usize>(mut index: usize, lengths: [usize; N]) -> [usize; N] {
    let mut digits = lengths;
    for digit in digits.iter_mut().rev() {
        (index, *digit) = (index / *digit, index % *digit);
    }
    digits
}

/// The first `count` of: all numbers below `length` in a random order, again in another, and so on.
fn shuffles(rng: &mut Rng, length: usize, count: usize) -> Vec<usize> {
    let mut numbers = Vec::with_capacity(count + length);
    while numbers.len() < count {
        let first = numbers.len();
        for number in 0..length {
            numbers.push(number);
            numbers.swap(first + number, first + rng.below(number + 1));
        }
    }
    numbers.truncate(count);
    numbers
}

const FNV_OFFSET: u64 = 0xcbf2_9ce4_8422_2325;

/// Mixes names and contents of the Rust files below `folder` into an FNV-1a hash.
fn add_sources(folder: &Path, hash: &mut u64) {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths: Vec<_> = entries.map(|entry| entry.path()).collect();
    paths.sort();
    for path in paths {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let text = match path.extension() {
            Some(end) if end == "rs" => fs::read(&path).unwrap_or_default(),
            None if name != "target" && !name.starts_with('.') => {
                add_sources(&path, hash);
                continue;
            }
            _ => continue,
        };
        for byte in name.bytes().chain(text) {
            *hash = (*hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn samples_have_every_entry_of_every_list() {
        let lengths = [3, 7, 1, 4];
        for salt in 0..50 {
            let sample = product(salt, lengths);
            assert_eq!(sample.len(), if is_whole() { 84 } else { 7 });
            for (list, length) in lengths.into_iter().enumerate() {
                let seen: BTreeSet<_> = sample.iter().map(|tuple| tuple[list]).collect();
                assert_eq!(seen, (0..length).collect(), "salt {salt}, list {list}");
            }
        }
        assert!(product(1, [3, 0]).is_empty());
        let all: BTreeSet<_> = (0..84).map(|index| digits(index, lengths)).collect();
        assert_eq!(all.len(), 84);
    }

    #[test]
    fn a_seed_gives_one_sample_and_salts_give_others() {
        assert_eq!(product(5, [9, 9]), product(5, [9, 9]));
        assert!(is_whole() || product(5, [9, 9]) != product(6, [9, 9]));
    }
}
