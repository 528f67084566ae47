//! Micromaps of several objects put one behind the other.

use super::{MapRef, MicroMaps, Parts};

/// Offset of micromaps that were appended to others, in words of 64 parts.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Moved(usize);

impl MicroMaps {
    /// Adds the micromaps of another object. The first of every list, of which nothing is known, is shared.
    pub fn join(&mut self, other: &Self) -> Moved {
        if other.parts.is_empty() {
            return Moved(0);
        }
        if self.parts.is_empty() {
            self.parts.push(Parts::default());
        }
        let by = self.parts.len() - 1;
        self.parts.extend_from_slice(&other.parts[1..]);
        Moved(by)
    }
}

impl Moved {
    /// The reference to a micromap that moved; unknown if it is too far behind to be referred to.
    pub fn of(self, map: MapRef) -> MapRef {
        if map == MapRef::UNKNOWN {
            return map;
        }
        MapRef::new(map.place() + self.0, map.levels()).unwrap_or(MapRef::UNKNOWN)
    }
}
