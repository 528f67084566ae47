//! Filters of several objects put together for a world that places them.

use super::{CutoutBlock, Filters, Representative};
use crate::geometry::cutout::micromap::Moved;

/// How the numbers in cut-out blocks change when their filters join others.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Joined {
    maps: Moved,
    pattern: u32,
}

impl Filters {
    /// Adds the filters and micromaps of another object.
    pub fn join(&mut self, other: &Self) -> Joined {
        let filter = self.opacities.len() as u32;
        let pattern = self.representatives.len() as u32;
        self.opacities.extend(other.opacities.iter().cloned());
        let others = other.representatives.iter();
        self.representatives
            .extend(others.map(|asked| Representative {
                filter: filter + asked.filter,
                id: asked.id,
            }));
        Joined {
            maps: self.maps.join(&other.maps),
            pattern,
        }
    }
}

impl CutoutBlock {
    /// A copy of the block for filters that joined others.
    pub fn joined(&self, how: Joined) -> Self {
        let mut block = self.clone();
        for lane in 0..block.triangles.count() {
            block.maps[lane] = how.maps.of(block.maps[lane]);
            block.patterns[lane] += how.pattern;
        }
        block
    }
}
