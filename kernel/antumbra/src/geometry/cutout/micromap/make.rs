//! Making opacity micromaps: coverage is queried once per pattern, and the triangles of a pattern share a micromap.

use alloc::vec;
use alloc::vec::Vec;

use super::parts::{MAX_LEVELS, MIN_LEVELS, WHOLE, numbers, quarters, words};
use super::{Cutout, Known, MapRef, MicroMaps, Parts};
use crate::geometry::cutout::opacity::{Coverage, Opacity, Pattern};
use crate::hash;
use crate::parallel::map;

/// Least number of triangles whose patterns are queried in one piece.
const CHUNK: usize = 64;

impl MicroMaps {
    /// Makes micromaps of `count` triangles. Per pattern, the coverage of one triangle is queried and, as long as it is
    /// mixed, the coverage of its parts. `triangle` returns the filter of a triangle and its place in its mesh. Also
    /// returns what is known of each triangle, and one triangle of each pattern that is mixed.
    pub fn new<'a>(
        count: usize,
        triangle: impl Fn(usize) -> (&'a dyn Opacity, u32) + Sync + Send,
    ) -> (Self, Vec<Known>, Vec<usize>) {
        if count == 0 {
            return (Self::default(), Vec::new(), Vec::new());
        }
        let patterns = map(count, CHUNK, |index| {
            let (filter, prim_id) = triangle(index);
            filter.pattern(prim_id)
        });
        let Groups { groups, group_of } = Groups::new(&patterns);
        let numbers: Vec<_> = (MIN_LEVELS..=MAX_LEVELS).map(numbers).collect();
        let drafts = map(groups.len(), 1, |group| {
            let Group { first, users } = groups[group];
            let (filter, prim_id) = triangle(first);
            let levels = levels(users);
            Draft::new(filter, prim_id, &numbers[(levels - MIN_LEVELS) as usize])
        });
        let mut all = Self {
            parts: vec![Parts::default()],
        };
        let mut mixed = Vec::new();
        let known: Vec<_> = drafts
            .iter()
            .zip(&groups)
            .map(|(draft, group)| {
                if draft.is_all(|parts| parts.opaque) {
                    return Known::Opaque;
                }
                if draft.is_all(|parts| parts.clear) {
                    return Known::Clear;
                }
                mixed.push(group.first);
                Known::Mixed(Cutout {
                    map: all.keep(draft).unwrap_or(MapRef::UNKNOWN),
                    pattern: mixed.len() as u32 - 1,
                })
            })
            .collect();
        let known = group_of.into_iter().map(|group| known[group]).collect();
        (all, known, mixed)
    }

    /// Keeps a micromap, if that helps.
    fn keep(&mut self, draft: &Draft) -> Option<MapRef> {
        if draft.parts.iter().all(|parts| *parts == Parts::default()) {
            return None;
        }
        let reference = MapRef::new(self.parts.len(), draft.levels)?;
        self.parts.extend_from_slice(&draft.parts);
        Some(reference)
    }
}

/// Triangles that show the same.
struct Group {
    /// The first of them.
    first: usize,
    /// How many they are.
    users: usize,
}

/// Triangles by what they show.
struct Groups {
    groups: Vec<Group>,
    /// The group of each triangle.
    group_of: Vec<usize>,
}

impl Groups {
    /// Triangles of one pattern make a group; each without a pattern is one by itself. Groups are in the order of their
    /// first triangles.
    fn new(patterns: &[Option<Pattern>]) -> Self {
        let mut groups: Vec<Group> = Vec::new();
        let mut known = GroupTable::with_room_for(patterns.iter().flatten().count());
        let mut group_of = Vec::with_capacity(patterns.len());
        for (index, pattern) in patterns.iter().enumerate() {
            let new = groups.len();
            let group = pattern.map_or(new, |pattern| {
                known.group(&pattern, new, |group| {
                    patterns[groups[group].first] == Some(pattern)
                })
            });
            if group == new {
                groups.push(Group {
                    first: index,
                    users: 0,
                });
            }
            groups[group].users += 1;
            group_of.push(group);
        }
        Self { groups, group_of }
    }
}

/// The groups of patterns: a hash table with open addressing, at most half full.
struct GroupTable {
    /// Numbers of groups, or [`GroupTable::FREE`].
    places: Vec<u32>,
}

impl GroupTable {
    const FREE: u32 = u32::MAX;

    fn with_room_for(patterns: usize) -> Self {
        Self {
            places: vec![Self::FREE; (2 * patterns).next_power_of_two()],
        }
    }

    /// The group of a pattern: the one that `is_it`, or else `new`.
    fn group(&mut self, pattern: &Pattern, new: usize, is_it: impl Fn(usize) -> bool) -> usize {
        let mut state = 0;
        for word in pattern.0 {
            state = hash::mixed((state ^ word).wrapping_add(hash::STEP));
        }
        let last = self.places.len() - 1;
        let mut place = state as usize & last;
        loop {
            match self.places[place] {
                Self::FREE => {
                    self.places[place] = new as u32;
                    return new;
                }
                group if is_it(group as usize) => return group as usize,
                _ => place = (place + 1) & last,
            }
        }
    }
}

/// How often a micromap divides a triangle that so many triangles are like.
fn levels(users: usize) -> u32 {
    (MIN_LEVELS + users.max(1).ilog2() / 2).min(MAX_LEVELS)
}

/// A micromap being made.
struct Draft {
    levels: u32,
    parts: Vec<Parts>,
}

impl Draft {
    /// Queries the coverage of a triangle and of its parts, which have these [`numbers`].
    fn new(filter: &dyn Opacity, prim_id: u32, numbers: &[u16]) -> Self {
        let levels = numbers.len().ilog2() / 2;
        let mut map = Self {
            levels,
            parts: vec![Parts::default(); words(levels)],
        };
        map.ask(filter, prim_id, &WHOLE, numbers);
        map
    }

    /// Queries the coverage of a part, whose smallest parts have these numbers. If it is mixed, the quarters follow.
    fn ask(
        &mut self,
        filter: &dyn Opacity,
        prim_id: u32,
        corners: &[[f32; 2]; 3],
        numbers: &[u16],
    ) {
        match filter.coverage(prim_id, corners) {
            Coverage::Opaque => self.set(numbers, |parts| &mut parts.opaque),
            Coverage::Clear => self.set(numbers, |parts| &mut parts.clear),
            Coverage::Mixed if numbers.len() > 1 => {
                let quarters = quarters(corners);
                for (quarter, numbers) in quarters.iter().zip(numbers.chunks(numbers.len() / 4)) {
                    self.ask(filter, prim_id, quarter, numbers);
                }
            }
            Coverage::Mixed | Coverage::Unknown => {}
        }
    }

    /// Sets the bits of the parts of these numbers.
    fn set(&mut self, numbers: &[u16], bits: fn(&mut Parts) -> &mut u64) {
        for &part in numbers {
            let part = usize::from(part);
            *bits(&mut self.parts[part / 64]) |= 1 << (part % 64);
        }
    }

    /// Whether these bits of all parts are set.
    fn is_all(&self, bits: fn(&Parts) -> u64) -> bool {
        self.parts.iter().all(|parts| bits(parts) == u64::MAX)
    }
}
