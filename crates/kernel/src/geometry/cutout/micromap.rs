//! Which parts of a triangle are opaque and which are clear: worked out once, so that the filter need not be
//! asked there.
//!
//! The idea is that of opacity micro-maps (Gruen, Benthin and Woop 2020, "Sub-triangle opacity masks for
//! faster ray tracing of transparent objects"). A leaf of a tree is two triangles around a picture of it:
//! half of them is clear, and only along the outline does one need to look at the picture.
//!
//! Many leaves show the same part of the same picture. Triangles of one [`Pattern`](crate::geometry::cutout::opacity::Pattern) share
//! a map, and the more of them there are, the finer it is: a map of 64 parts takes 16 bytes, and one that is shared
//! by four times as many triangles has four times as many parts. So finer maps never cost more than a map of 64
//! parts for every triangle would.

use std::collections::HashMap;

use antumbra_simd::Simd;

use crate::geometry::cutout::opacity::{Coverage, Opacity};
use crate::parallel::map;

/// How often every map divides a triangle into four: 64 parts, a bit of a word for each.
const MIN_LEVELS: u32 = 3;
/// How often at most: 4096 parts.
const MAX_LEVELS: u32 = 6;

/// Triangles whose patterns are asked for at one go.
const CHUNK: usize = 64;

/// The corners of the whole triangle by their `(u, v)`.
const WHOLE: [[f32; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];

/// What is known of 64 parts, a bit for each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Parts {
    /// Those of opacity 1.
    opaque: u64,
    /// Those of opacity 0.
    clear: u64,
}

/// The maps of all partly transparent triangles.
#[derive(Clone, Debug, Default)]
pub(crate) struct MicroMaps {
    /// Map after map; the first is [`MapRef::UNKNOWN`].
    parts: Vec<Parts>,
}

/// One of the maps.
///
/// Bits 31 and 30 are its levels, less the fewest; the others are where it begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MapRef(u32);

impl MapRef {
    const PLACE_BITS: u32 = 30;

    /// Nothing is known.
    pub const UNKNOWN: Self = Self(0);

    /// `None` if there are too many maps before it.
    fn new(place: usize, levels: u32) -> Option<Self> {
        let place = u32::try_from(place).ok()?;
        let fits = place < 1 << Self::PLACE_BITS;
        fits.then_some(Self((levels - MIN_LEVELS) << Self::PLACE_BITS | place))
    }

    #[inline(always)]
    fn levels(self) -> u32 {
        MIN_LEVELS + (self.0 >> Self::PLACE_BITS)
    }

    #[inline(always)]
    fn place(self) -> usize {
        (self.0 & ((1 << Self::PLACE_BITS) - 1)) as usize
    }
}

/// What is known of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Known {
    /// It is opaque everywhere.
    Opaque,
    /// It is clear everywhere.
    Clear,
    /// Some of it is, or nobody knows.
    Mixed(Cutout),
}

/// What is kept of a partly transparent triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Cutout {
    pub map: MapRef,
    /// A number for what it shows: triangles of one [`Pattern`](crate::geometry::cutout::opacity::Pattern) have one number.
    pub pattern: u32,
}

impl MicroMaps {
    /// Asks the filters of `count` triangles, and, where they say that a closer look pays, of their parts. `triangle`
    /// tells the filter of a triangle and its place in its mesh. Also returns what is known of each triangle, and one triangle
    /// of each pattern that is mixed.
    pub fn new<'a>(
        count: usize,
        triangle: impl Fn(usize) -> (&'a dyn Opacity, u32) + Sync + Send,
    ) -> (Self, Vec<Known>, Vec<usize>) {
        let patterns = map(count, CHUNK, |index| {
            let (filter, prim_id) = triangle(index);
            filter.pattern(prim_id)
        });
        // A triangle of each pattern and how many have it; of those without one each by itself.
        let mut groups = Vec::new();
        let mut known_patterns = HashMap::new();
        let mut group_of = Vec::with_capacity(count);
        for (index, pattern) in patterns.into_iter().enumerate() {
            let new = groups.len();
            let group =
                pattern.map_or(new, |pattern| *known_patterns.entry(pattern).or_insert(new));
            if group == new {
                groups.push((index, 0));
            }
            groups[group].1 += 1;
            group_of.push(group);
        }
        let maps = map(groups.len(), 1, |group| {
            let (index, users) = groups[group];
            let (filter, prim_id) = triangle(index);
            Map::new(filter, prim_id, levels(users))
        });
        if count == 0 {
            return (Self::default(), Vec::new(), Vec::new());
        }
        let mut all = Self {
            parts: vec![Parts::default()],
        };
        let mut mixed = Vec::new();
        let known: Vec<_> = maps
            .iter()
            .zip(&groups)
            .map(|(map, &(index, _))| {
                if map.is_all(|parts| parts.opaque) {
                    return Known::Opaque;
                }
                if map.is_all(|parts| parts.clear) {
                    return Known::Clear;
                }
                mixed.push(index);
                Known::Mixed(Cutout {
                    map: all.place(map).unwrap_or(MapRef::UNKNOWN),
                    pattern: mixed.len() as u32 - 1,
                })
            })
            .collect();
        let known = group_of.into_iter().map(|group| known[group]).collect();
        (all, known, mixed)
    }

    /// Keeps a map, if that helps.
    fn place(&mut self, map: &Map) -> Option<MapRef> {
        if map.parts.iter().all(|parts| *parts == Parts::default()) {
            return None;
        }
        let reference = MapRef::new(self.parts.len(), map.levels)?;
        self.parts.extend_from_slice(&map.parts);
        Some(reference)
    }

    /// The part in which a point of a triangle with this map lies, counted from the first part of the first map.
    #[inline(always)]
    pub fn part(&self, map: MapRef, u: f32, v: f32) -> usize {
        64 * map.place() + part_at(map.levels(), u, v)
    }

    /// Asks for the memory of a part.
    #[inline(always)]
    pub fn prefetch<S: Simd>(&self, simd: S, part: usize) {
        simd.prefetch(&self.parts[part / 64]);
    }

    /// Whether a hit counts in a part, if that is known.
    #[inline(always)]
    pub fn accepts(&self, part: usize) -> Option<bool> {
        let Parts { opaque, clear } = self.parts[part / 64];
        let bit = 1 << (part % 64);
        if clear & bit != 0 {
            Some(false)
        } else if opaque & bit != 0 {
            Some(true)
        } else {
            None
        }
    }

    /// Whether there is such a map.
    pub fn contains(&self, map: MapRef) -> bool {
        map.place() + words(map.levels()) <= self.parts.len()
    }

    /// Bytes of memory.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.parts[..])
    }
}

/// How often a map divides a triangle of which there are so many.
fn levels(users: usize) -> u32 {
    (MIN_LEVELS + users.max(1).ilog2() / 2).min(MAX_LEVELS)
}

/// How many times 64 parts there are.
fn words(levels: u32) -> usize {
    1 << (2 * (levels - MIN_LEVELS))
}

/// A map being made.
struct Map {
    levels: u32,
    parts: Vec<Parts>,
}

impl Map {
    fn new(filter: &dyn Opacity, prim_id: u32, levels: u32) -> Self {
        let mut map = Self {
            levels,
            parts: vec![Parts::default(); words(levels)],
        };
        map.ask(filter, prim_id, &WHOLE, levels);
        map
    }

    fn ask(&mut self, filter: &dyn Opacity, prim_id: u32, corners: &[[f32; 2]; 3], levels: u32) {
        match filter.coverage(prim_id, corners) {
            Coverage::Opaque => self.set(corners, levels, |parts| &mut parts.opaque),
            Coverage::Clear => self.set(corners, levels, |parts| &mut parts.clear),
            Coverage::Mixed if levels > 0 => {
                for quarter in quarters(corners) {
                    self.ask(filter, prim_id, &quarter, levels - 1);
                }
            }
            Coverage::Mixed | Coverage::Unknown => {}
        }
    }

    /// Sets the bits of all parts of what is `levels` divisions away from being a part.
    fn set(&mut self, corners: &[[f32; 2]; 3], levels: u32, bits: fn(&mut Parts) -> &mut u64) {
        if levels > 0 {
            for quarter in quarters(corners) {
                self.set(&quarter, levels - 1, bits);
            }
            return;
        }
        let part = part_around(self.levels, corners);
        *bits(&mut self.parts[part / 64]) |= 1 << (part % 64);
    }

    fn is_all(&self, bits: fn(&Parts) -> u64) -> bool {
        self.parts.iter().all(|parts| bits(parts) == u64::MAX)
    }
}

/// The part in which a point lies; next to a line between two parts, within a rounding of it, either of them.
/// Parts are numbered strip by strip: strips lie along v and become shorter as u grows.
#[inline(always)]
fn part_at(levels: u32, u: f32, v: f32) -> usize {
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
fn part_around(levels: u32, [[u0, v0], [u1, v1], [u2, v2]]: &[[f32; 2]; 3]) -> usize {
    part_at(levels, (u0 + u1 + u2) / 3.0, (v0 + v1 + v2) / 3.0)
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
    use crate::geometry::{Candidate, Pattern};
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
        for levels in MIN_LEVELS..=MAX_LEVELS {
            let mut parts = Vec::new();
            all_parts(WHOLE, levels, &mut parts);
            let mut numbers: Vec<_> = parts.iter().map(|part| part_around(levels, part)).collect();
            numbers.sort_unstable();
            assert_eq!(numbers, (0..64 * words(levels)).collect::<Vec<_>>());

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
                    assert_eq!(part_at(levels, at(0), at(1)), part_around(levels, &part));
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
                assert!(part_at(levels, u, v) < 64 * words(levels), "{u} {v}");
            }
        }
    }

    /// A disk. Looked at closely if asked for.
    #[derive(Debug)]
    struct Disk {
        coverage: Option<Coverage>,
        /// How many triangles in a row show the same.
        alike: Option<u32>,
        asked: AtomicUsize,
    }

    impl Disk {
        fn new() -> Self {
            Self {
                coverage: None,
                alike: None,
                asked: AtomicUsize::new(0),
            }
        }

        fn maps(&self, count: usize) -> (MicroMaps, Vec<Known>) {
            let (maps, known, mixed) =
                MicroMaps::new(count, |index| (self as &dyn Opacity, index as u32));
            // Whoever is asked for others shows the same as they.
            for (index, of_it) in known.iter().enumerate() {
                if let Known::Mixed(cutout) = of_it {
                    let asked = mixed[cutout.pattern as usize];
                    assert_eq!(known[asked], *of_it);
                    let pattern = |index: usize| self.pattern(index as u32);
                    assert!(asked == index || pattern(asked) == pattern(index));
                }
            }
            (maps, known)
        }

        /// Whether the hit counts.
        fn accepts(&self, u: f32, v: f32) -> bool {
            let candidate = Candidate {
                u,
                v,
                prim_id: 0,
                geom_id: 0,
                inst_id: 0,
                query: crate::geometry::QueryKind::Occluded,
            };
            self.opacity(&candidate) == 1.0
        }
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
        fn pattern(&self, prim_id: u32) -> Option<Pattern> {
            self.alike
                .map(|alike| Pattern([u64::from(prim_id / alike), 1, 2, 3]))
        }
    }

    /// How many of these points a map does not know; what it knows is right.
    fn unknown(disk: &Disk, maps: &MicroMaps, known: Known) -> usize {
        let Known::Mixed(Cutout { map, .. }) = known else {
            panic!("{known:?}");
        };
        let mut rng = Rng::new(52);
        let mut unknown = 0;
        for _ in 0..10_000 {
            let (u, v) = (rng.unit(), rng.unit());
            if u + v > 1.0 {
                continue;
            }
            match maps.accepts(maps.part(map, u, v)) {
                Some(accepts) => assert_eq!(accepts, disk.accepts(u, v), "{u} {v}"),
                None => unknown += 1,
            }
        }
        unknown
    }

    #[test]
    fn what_is_known_is_right() {
        let disk = Disk::new();
        let (maps, known) = disk.maps(1);
        assert_eq!(known.len(), 1);
        // About 5000 points are in the triangle.
        let unknown = unknown(&disk, &maps, known[0]);
        assert!((500..4000).contains(&unknown), "{unknown}");
    }

    /// Triangles that show the same have one map, and it is the finer, the more they are.
    #[test]
    fn what_many_triangles_share_is_known_better() {
        let mut last = 10_000;
        for alike in [1, 4, 16, 64, 4096] {
            let disk = Disk {
                alike: Some(alike),
                ..Disk::new()
            };
            let count = 2 * alike as usize;
            let (maps, known) = disk.maps(count);
            let (first, second) = known.split_at(alike as usize);
            assert!(first.iter().all(|known| *known == first[0]), "{alike}");
            assert!(second.iter().all(|known| *known == second[0]), "{alike}");
            assert_ne!(first[0], second[0]);
            let unknown = unknown(&disk, &maps, first[0]);
            assert!(
                alike > 64 || unknown < last * 3 / 4,
                "{alike}: {unknown}, {last}"
            );
            last = unknown;
            assert!(maps.bytes() <= 16 * (1 + count), "{alike}");
        }
        let disk = Disk::new();
        let (maps, known) = disk.maps(3);
        assert_eq!(maps.bytes(), 16 * 4);
        assert_ne!(known[0], known[1]);
    }

    #[test]
    fn only_mixed_triangles_are_looked_at_closely() {
        let nothing = Known::Mixed(Cutout {
            map: MapRef::UNKNOWN,
            pattern: 0,
        });
        for (coverage, whole, asked) in [
            (Coverage::Opaque, Known::Opaque, 1),
            (Coverage::Clear, Known::Clear, 1),
            (Coverage::Unknown, nothing, 1),
            (Coverage::Mixed, nothing, 1 + 4 + 16 + 64),
        ] {
            let disk = Disk {
                coverage: Some(coverage),
                ..Disk::new()
            };
            let (maps, known) = disk.maps(1);
            assert_eq!(known, [whole]);
            assert_eq!(maps.bytes(), 16);
            assert_eq!(disk.asked.into_inner(), asked, "{coverage:?}");
        }
    }
}
