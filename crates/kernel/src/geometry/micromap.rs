//! Which parts of a triangle are opaque and which are clear: worked out once, so that the filter need not be
//! asked there.
//!
//! The idea is that of opacity micro-maps (Gruen, Benthin and Woop 2020, "Sub-triangle opacity masks for
//! faster ray tracing of transparent objects"). A leaf of a tree is two triangles around a picture of it:
//! half of them is clear, and only along the outline does one need to look at the picture.
//!
//! Measured on 323 thousand triangles of San Miguel's trees and shrubs, with rays from their own surfaces:
//! the filter is asked 0.67 times per occlusion ray instead of 1.49. Batches take 27 % less time with a
//! filter that interpolates texture coordinates and four texels, 15 % less with one that looks up a single
//! bit; closest hits 23 % and 14 %. For 16 bytes per triangle, a third of what one takes without. Of 16
//! parts, which take 4 bytes, 1.04 questions would be left, of 256 parts, which take 64, 0.35.

use super::opacity::{Coverage, Opacity};

/// Parts along an edge.
const PARTS: usize = 8;
/// How often a triangle is divided into four to come to the parts.
const LEVELS: u32 = PARTS.ilog2();

/// The corners of the whole triangle by their `(u, v)`.
const WHOLE: [[f32; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];

/// What is known of the 64 parts into which three times eight lines divide a triangle. A bit for each part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct MicroMap {
    /// Parts of opacity 1.
    opaque: u64,
    /// Parts of opacity 0.
    clear: u64,
}

impl MicroMap {
    /// Nothing is known.
    pub const UNKNOWN: Self = Self {
        opaque: 0,
        clear: 0,
    };

    /// Asks the filter of a triangle, and, where it says that a closer look pays, of its parts.
    pub fn new(filter: &dyn Opacity, prim_id: u32) -> Self {
        let mut map = Self::UNKNOWN;
        map.ask(filter, prim_id, &WHOLE, LEVELS);
        map
    }

    fn ask(&mut self, filter: &dyn Opacity, prim_id: u32, corners: &[[f32; 2]; 3], levels: u32) {
        match filter.coverage(prim_id, corners) {
            Coverage::Opaque => self.opaque |= parts_within(corners, levels),
            Coverage::Clear => self.clear |= parts_within(corners, levels),
            Coverage::Mixed if levels > 0 => {
                for quarter in quarters(corners) {
                    self.ask(filter, prim_id, &quarter, levels - 1);
                }
            }
            Coverage::Mixed | Coverage::Unknown => {}
        }
    }

    /// What is known of the triangle as a whole.
    pub fn coverage(&self) -> Coverage {
        if self.opaque == u64::MAX {
            Coverage::Opaque
        } else if self.clear == u64::MAX {
            Coverage::Clear
        } else {
            Coverage::Mixed
        }
    }

    /// Whether a hit counts at a point of the triangle, if that is known.
    #[inline(always)]
    pub fn accepts(&self, u: f32, v: f32) -> Option<bool> {
        let bit = 1 << part_at(u, v);
        if self.clear & bit != 0 {
            Some(false)
        } else if self.opaque & bit != 0 {
            Some(true)
        } else {
            None
        }
    }
}

/// The part in which a point lies; next to a line between two parts, within a rounding of it, either of them.
/// Parts are numbered strip by strip: strips lie along v and become shorter as u grows.
#[inline(always)]
fn part_at(u: f32, v: f32) -> usize {
    const LAST: usize = PARTS - 1;
    let (u, v) = (u * PARTS as f32, v * PARTS as f32);
    // Casts saturate, and what rounding puts outside belongs to the nearest part.
    let strip = (u as usize).min(LAST);
    let pair = (v as usize).min(LAST - strip);
    let beyond_diagonal = (u - strip as f32) + (v - pair as f32) > 1.0;
    let second = usize::from(beyond_diagonal & (pair < LAST - strip));
    // The strips before this one have 15, 13, 11 ... parts.
    strip * (2 * PARTS - strip) + 2 * pair + second
}

/// A bit for each part of what is `levels` divisions away from being a part.
fn parts_within(corners: &[[f32; 2]; 3], levels: u32) -> u64 {
    if levels > 0 {
        let quarters = quarters(corners);
        return quarters.iter().fold(0, |parts, quarter| {
            parts | parts_within(quarter, levels - 1)
        });
    }
    let [[u0, v0], [u1, v1], [u2, v2]] = corners;
    1 << part_at((u0 + u1 + u2) / 3.0, (v0 + v1 + v2) / 3.0)
}

/// A triangle divided by the middles of its edges.
fn quarters(&[a, b, c]: &[[f32; 2]; 3]) -> [[[f32; 2]; 3]; 4] {
    let middle = |p: [f32; 2], q: [f32; 2]| [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Candidate;
    use antumbra_testkit::Rng;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// All parts, by dividing.
    fn all_parts(corners: [[f32; 2]; 3], levels: u32, parts: &mut Vec<[[f32; 2]; 3]>) {
        if levels == 0 {
            parts.push(corners);
        } else {
            for quarter in quarters(&corners) {
                all_parts(quarter, levels - 1, parts);
            }
        }
    }

    #[test]
    fn every_point_lies_in_the_part_of_its_number() {
        let mut parts = Vec::new();
        all_parts(WHOLE, LEVELS, &mut parts);
        let mut numbers: Vec<_> = parts
            .iter()
            .map(|part| parts_within(part, 0).trailing_zeros())
            .collect();
        numbers.sort_unstable();
        assert_eq!(numbers, (0..64).collect::<Vec<_>>());
        assert_eq!(parts_within(&WHOLE, LEVELS), u64::MAX);

        let mut rng = Rng::new(51);
        for part in parts {
            for _ in 0..200 {
                let (mut s, mut t) = (rng.unit(), rng.unit());
                if s + t > 1.0 {
                    (s, t) = (1.0 - s, 1.0 - t);
                }
                // Away from the lines between parts.
                let [s, t] = [s, t].map(|x| 0.001 + 0.997 * x);
                let at = |i: usize| {
                    part[0][i] + s * (part[1][i] - part[0][i]) + t * (part[2][i] - part[0][i])
                };
                assert_eq!(1 << part_at(at(0), at(1)), parts_within(&part, 0));
            }
        }
        // What rounding puts outside of the triangle.
        let over = 1.0f32.next_up();
        for (u, v) in [
            (over, 0.0),
            (0.0, over),
            (0.5, 0.5f32.next_up()),
            (-0.0, -0.0),
            (over, over),
        ] {
            assert!(part_at(u, v) < 64, "{u} {v}");
        }
    }

    /// A disk. Looked at closely if asked for.
    #[derive(Debug)]
    struct Disk {
        coverage: Option<Coverage>,
        asked: AtomicUsize,
    }

    impl Opacity for Disk {
        fn opacity(&self, candidate: &Candidate) -> f32 {
            let (u, v) = (candidate.u - 0.3, candidate.v - 0.3);
            if u * u + v * v < 0.04 { 1.0 } else { 0.0 }
        }
        fn coverage(&self, _: u32, corners: &[[f32; 2]; 3]) -> Coverage {
            self.asked.fetch_add(1, Ordering::Relaxed);
            let distance = |[u, v]: [f32; 2]| (u - 0.3).hypot(v - 0.3);
            let distances = corners.map(distance);
            let size = (corners[0][0] - corners[1][0]).abs() * 1.5;
            self.coverage
                .unwrap_or(if distances.iter().all(|d| *d < 0.199) {
                    Coverage::Opaque
                } else if distances.iter().all(|d| *d > 0.201 + size) {
                    Coverage::Clear
                } else {
                    Coverage::Mixed
                })
        }
    }

    #[test]
    fn what_is_known_is_right() {
        let disk = Disk {
            coverage: None,
            asked: AtomicUsize::new(0),
        };
        let map = MicroMap::new(&disk, 0);
        assert_eq!(map.opaque & map.clear, 0);
        assert!(
            map.opaque.count_ones() >= 4 && map.clear.count_ones() >= 8,
            "{map:x?}"
        );
        assert_eq!(map.coverage(), Coverage::Mixed);
        let mut rng = Rng::new(52);
        for _ in 0..10_000 {
            let (u, v) = (rng.unit(), rng.unit());
            if u + v > 1.0 {
                continue;
            }
            let candidate = Candidate {
                u,
                v,
                prim_id: 0,
                geom_id: 0,
                inst_id: 0,
                query: crate::geometry::QueryKind::Occluded,
            };
            if let Some(accepts) = map.accepts(u, v) {
                assert_eq!(accepts, disk.opacity(&candidate) == 1.0, "{u} {v}");
            }
        }
    }

    #[test]
    fn only_mixed_triangles_are_looked_at_closely() {
        for (coverage, whole, asked) in [
            (Coverage::Opaque, Coverage::Opaque, 1),
            (Coverage::Clear, Coverage::Clear, 1),
            (Coverage::Unknown, Coverage::Mixed, 1),
            (Coverage::Mixed, Coverage::Mixed, 1 + 4 + 16 + 64),
        ] {
            let disk = Disk {
                coverage: Some(coverage),
                asked: AtomicUsize::new(0),
            };
            assert_eq!(MicroMap::new(&disk, 0).coverage(), whole);
            assert_eq!(disk.asked.into_inner(), asked, "{coverage:?}");
        }
    }
}
