//! Filters of several objects put together for a world that places them.

use super::{Filters, Representative};
use crate::geometry::cutout::micromap::Moved;

/// How the numbers in cut-out blocks change when their filters join others.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Joined {
    pub maps: Moved,
    pub pattern: u32,
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
