//! Damaged copies of files, as bad disks, broken exporters and attackers make them.

use crate::rng::Rng;

/// Bytes with a meaning for some reader.
const SPECIAL_BYTES: &[u8] = b"\0\x01\x7f\x80\xff\"[]{}#\n\r\t -+.,:eE0189/\\";

/// Replacements for numbers.
const NUMBERS: &[&str] = &[
    "nan",
    "inf",
    "-inf",
    "-1",
    "0",
    "-0",
    "1e38",
    "-1e38",
    "1e999",
    "1e-45",
    "2147483647",
    "2147483648",
    "-2147483648",
    "4294967295",
    "18446744073709551616",
    "99999999999999999999999999",
    "0.1",
    "1000000",
];

/// Makes a copy with one to four random damages. An empty file stays empty.
///
/// Bits are flipped, bytes changed, lost or inserted, pieces and lines repeated, lines dropped, numbers replaced by
/// special ones, or the end is cut off.
pub fn mutate(original: &[u8], rng: &mut Rng) -> Vec<u8> {
    let mut bytes = original.to_vec();
    // Mostly one damage: a reader that stops at the first never sees the others.
    for _ in 0..[1, 1, 1, 2, 4][rng.below(5)] {
        if bytes.is_empty() {
            break;
        }
        damage(&mut bytes, rng);
    }
    bytes
}

fn damage(bytes: &mut Vec<u8>, rng: &mut Rng) {
    let at = rng.below(bytes.len());
    match rng.below(12) {
        0 => bytes[at] ^= 1 << rng.below(8),
        1 => bytes[at] = rng.below(256) as u8,
        2 => bytes[at] = SPECIAL_BYTES[rng.below(SPECIAL_BYTES.len())],
        3 => {
            bytes.remove(at);
        }
        4 => bytes.insert(at, SPECIAL_BYTES[rng.below(SPECIAL_BYTES.len())]),
        5 => bytes.truncate(at),
        6 => {
            // A piece is repeated somewhere else.
            let end = (at + 1 + rng.below(60)).min(bytes.len());
            let piece = bytes[at..end].to_vec();
            let to = rng.below(bytes.len());
            bytes.splice(to..to, piece);
        }
        7 => {
            // A word of four bytes, as a binary count or coordinate is.
            let word = [
                0,
                1,
                0x7f80_0000,
                0x7fc0_0000,
                0xff7f_ffff,
                u32::MAX,
                0x7fff_ffff,
            ];
            let word = word[rng.below(word.len())].to_le_bytes();
            let end = (at + 4).min(bytes.len());
            bytes[at..end].copy_from_slice(&word[..end - at]);
        }
        8 => {
            let line = line(bytes, at);
            bytes.drain(line);
        }
        9 => {
            let line = line(bytes, at);
            let copy = bytes[line.clone()].to_vec();
            for _ in 0..=rng.below(3) {
                bytes.splice(line.end..line.end, copy.iter().copied());
            }
        }
        _ => {
            let number = NUMBERS[rng.below(NUMBERS.len())];
            if let Some(place) = number_after(bytes, at) {
                bytes.splice(place, number.bytes());
            }
        }
    }
}

/// Range of the line that contains a byte, including the line end.
fn line(bytes: &[u8], at: usize) -> std::ops::Range<usize> {
    let start = bytes[..at].iter().rposition(|&b| b == b'\n');
    let end = bytes[at..].iter().position(|&b| b == b'\n');
    start.map_or(0, |i| i + 1)..end.map_or(bytes.len(), |i| at + i + 1)
}

/// Range of the next number: a run of digits, signs, points and exponents that contains a digit.
fn number_after(bytes: &[u8], at: usize) -> Option<std::ops::Range<usize>> {
    let first = at + bytes[at..].iter().position(u8::is_ascii_digit)?;
    let is_part = |b: &u8| b.is_ascii_digit() || b"+-.eE".contains(b);
    let before = bytes[..first].iter().rposition(|b| !is_part(b));
    let after = bytes[first..].iter().position(|b| !is_part(b));
    Some(before.map_or(0, |i| i + 1)..after.map_or(bytes.len(), |i| first + i))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_follow_from_the_seed_and_differ_from_the_original() {
        let original = b"Shape \"sphere\" \"float radius\" [1.5]\nScale 1 -2 3e0\n";
        let all = |seed| {
            let mut rng = Rng::new(seed);
            (0..500)
                .map(|_| mutate(original, &mut rng))
                .collect::<Vec<_>>()
        };
        let copies = all(5);
        assert_eq!(copies, all(5));
        assert_ne!(copies, all(6));
        let same = copies
            .iter()
            .filter(|copy| copy[..] == original[..])
            .count();
        assert!(same < 10, "{same} are not damaged");
        for wanted in [&b"nan"[..], b"-2147483648", b"\xff"] {
            let has = |copy: &Vec<u8>| copy.windows(wanted.len()).any(|part| part == wanted);
            assert!(copies.iter().any(has), "{wanted:?}");
        }
        assert!(mutate(b"", &mut Rng::new(1)).is_empty());
    }

    #[test]
    fn numbers_are_found_whole() {
        assert_eq!(number_after(b"a -1.5e+3 b", 0), Some(2..9));
        assert_eq!(number_after(b"a -1.5e+3 b", 5), Some(2..9));
        assert_eq!(number_after(b"a b", 0), None);
        assert_eq!(line(b"a\nbc\nd", 3), 2..5);
        assert_eq!(line(b"a\nbc\nd", 5), 5..6);
    }
}
