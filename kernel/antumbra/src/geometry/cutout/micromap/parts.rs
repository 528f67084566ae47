//! How a triangle is divided into parts, and how parts are numbered.
//!
//! A triangle is divided by the middles of its edges, again and again: every level has four times as many parts.

use alloc::vec::Vec;

/// How often every micromap divides a triangle into four: 64 parts, a bit of a word for each.
pub(super) const MIN_LEVELS: u32 = 3;
/// How often at most: 4096 parts.
pub(super) const MAX_LEVELS: u32 = 6;

/// The corners of the whole triangle by their `(u, v)`.
pub(super) const WHOLE: [[f32; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];

/// How many words of 64 parts a micromap of so many levels has.
pub(super) fn words(levels: u32) -> usize {
    1 << (2 * (levels - MIN_LEVELS))
}

/// The part in which a point lies; next to a line between two parts, within a rounding of it, either of them.
/// Parts are numbered strip by strip: strips lie along v and become shorter as u grows.
#[inline(always)]
pub(super) fn part_at(levels: u32, u: f32, v: f32) -> usize {
    let along_edge = 1 << levels;
    let last = along_edge - 1;
    let (u, v) = (u * along_edge as f32, v * along_edge as f32);
    // Casts saturate, and what rounding puts outside belongs to the nearest part.
    let strip = (u as usize).min(last);
    let pair = (v as usize).min(last - strip);
    let beyond_diagonal = (u - strip as f32) + (v - pair as f32) > 1.0;
    let second = usize::from(beyond_diagonal & (pair < last - strip));
    // Of 8 parts along an edge the strips before this one have 15, 13, 11 ... parts.
    strip * (2 * along_edge - strip) + 2 * pair + second
}

/// The part that has these corners.
pub(super) fn part_around(levels: u32, [[u0, v0], [u1, v1], [u2, v2]]: &[[f32; 2]; 3]) -> usize {
    part_at(levels, (u0 + u1 + u2) / 3.0, (v0 + v1 + v2) / 3.0)
}

/// Numbers of the smallest parts of a triangle that is divided `levels` times, in the order in which [`quarters`] come
/// to them. The `4^n` smallest parts of a part that is divided `n` more times follow each other.
pub(super) fn numbers(levels: u32) -> Vec<u16> {
    fn visit(all: u32, levels: u32, corners: &[[f32; 2]; 3], numbers: &mut Vec<u16>) {
        if levels == 0 {
            numbers.push(part_around(all, corners) as u16);
            return;
        }
        for quarter in quarters(corners) {
            visit(all, levels - 1, &quarter, numbers);
        }
    }
    let mut numbers = Vec::with_capacity(64 * words(levels));
    visit(levels, levels, &WHOLE, &mut numbers);
    numbers
}

/// A triangle divided by the middles of its edges.
pub(super) fn quarters(&[a, b, c]: &[[f32; 2]; 3]) -> [[[f32; 2]; 3]; 4] {
    let middle = |p: [f32; 2], q: [f32; 2]| [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]]
}
