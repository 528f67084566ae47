//! Opacity micromaps being made: filters are asked, patterns share.

use alloc::collections::BTreeMap;
use alloc::vec;
use alloc::vec::Vec;

use super::parts::{MAX_LEVELS, MIN_LEVELS, WHOLE, part_around, quarters, words};
use super::{Cutout, Known, MapRef, MicroMaps, Parts};
use crate::geometry::cutout::opacity::{Coverage, Opacity, Pattern};
use crate::parallel::map;

/// Triangles whose patterns are asked for at one go.
const CHUNK: usize = 64;

impl MicroMaps {
    /// Asks the filters of `count` triangles, and, where they say that a closer look pays, of their parts. `triangle`
    /// tells the filter of a triangle and its place in its mesh. Also returns what is known of each triangle, and one triangle
    /// of each pattern that is mixed.
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
        let drafts = map(groups.len(), 1, |group| {
            let Group { first, users } = groups[group];
            let (filter, prim_id) = triangle(first);
            Draft::new(filter, prim_id, levels(users))
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
    /// Triangles of one pattern make a group; each without a pattern is one by itself.
    fn new(patterns: &[Option<Pattern>]) -> Self {
        let mut groups: Vec<Group> = Vec::new();
        let mut known = BTreeMap::new();
        let mut group_of = Vec::with_capacity(patterns.len());
        for (index, pattern) in patterns.iter().enumerate() {
            let new = groups.len();
            let group = pattern.map_or(new, |pattern| *known.entry(pattern).or_insert(new));
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
    fn new(filter: &dyn Opacity, prim_id: u32, levels: u32) -> Self {
        let mut map = Self {
            levels,
            parts: vec![Parts::default(); words(levels)],
        };
        map.ask(filter, prim_id, &WHOLE, levels);
        map
    }

    /// Asks about a part that is `levels` divisions away from the smallest ones, and about its quarters if that pays.
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

    /// Sets the bits of all smallest parts of a part that is `levels` divisions away from them.
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

    /// Whether these bits of all parts are set.
    fn is_all(&self, bits: fn(&Parts) -> u64) -> bool {
        self.parts.iter().all(|parts| bits(parts) == u64::MAX)
    }
}
