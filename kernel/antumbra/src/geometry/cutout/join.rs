//! Filters of several objects put together for a world that places them.

use super::{Filters, MeshFilter, Representative};
use crate::geometry::cutout::micromap::Moved;

/// How the numbers in cut-out blocks change when their filters join others.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Joined {
    pub maps: Moved,
    pub pattern: u32,
}

impl Filters {
    /// Adds the filters and micromaps of another object, which gets this number; without one it is the ground.
    pub fn join(&mut self, other: &Self, object: Option<u32>) -> Joined {
        let filter = self.opacities.len() as u32;
        let pattern = self.representatives.len() as u32;
        let named = |filter: &MeshFilter| {
            let mut filter = filter.clone();
            filter.mesh.object = object;
            filter
        };
        self.opacities.extend(other.opacities.iter().map(named));
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
