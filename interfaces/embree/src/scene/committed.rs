//! What a commit makes of a scene, and the way back from the kernel's numbers to Embree's.

use std::sync::Arc;

use antumbra::{Bvh, Object, World};

use crate::abi::{Bounds, INVALID, RtcRay};
use crate::device::Device;
use crate::geometry::transform::{self, Rows};
use crate::geometry::{Geometry, Kind, State};

/// What queries of a scene use.
pub struct Committed {
    pub device: Arc<Device>,
    /// The tree of geometry in the scene itself.
    pub object: Object,
    /// The tree over that one and the instances, if there are any.
    pub world: Option<World>,
    /// Geometry of the scene itself, by `geom_id` of the kernel.
    pub ground: Vec<Placed>,
    /// By `inst_id` of the kernel.
    pub instances: Vec<PlacedInstance>,
    /// Scenes that are instanced.
    pub objects: Vec<Arc<Committed>>,
    /// Geometries and their versions, disabled ones and instances included.
    pub seen: Vec<(Arc<Geometry>, u64)>,
    pub traits: Traits,
    pub bytes: isize,
}

/// What geometries of a scene have in common, or at least one of them has.
#[derive(Clone, Copy, Debug)]
pub struct Traits {
    /// Bits that are in the masks of all geometries and instances.
    pub common_mask: u32,
    /// What one of them has, as `INTERSECT_FILTER` and the others.
    has: u32,
}

impl Traits {
    pub const INTERSECT_FILTER: u32 = 1;
    pub const OCCLUDED_FILTER: u32 = 2;
    pub const TAKES_ARGUMENT_FILTER: u32 = 4;
    pub const USER_GEOMETRY: u32 = 8;
    pub const CURVES: u32 = 16;
    /// Hits at the near end of a ray count: in robust scenes, and on everything but triangles and quads.
    pub const NEAR_IS_CLOSED: u32 = 32;

    pub fn new(common_mask: u32, has: &[(u32, bool)]) -> Self {
        let there = has.iter().filter(|(_, is_there)| *is_there);
        Self {
            common_mask,
            has: there.fold(0, |all, (bit, _)| all | bit),
        }
    }

    pub fn of(placed: &Placed) -> Self {
        let (state, kind) = (&placed.state, placed.geometry.kind);
        let has = [
            (Self::INTERSECT_FILTER, state.intersect_filter.is_some()),
            (Self::OCCLUDED_FILTER, state.occluded_filter.is_some()),
            (Self::TAKES_ARGUMENT_FILTER, state.takes_argument_filter),
            (Self::USER_GEOMETRY, kind == Kind::User),
            (Self::CURVES, matches!(kind, Kind::Curves(_))),
            (Self::NEAR_IS_CLOSED, !kind.has_corners()),
        ];
        Self::new(state.mask, &has)
    }

    pub fn and(self, other: Self) -> Self {
        Self {
            common_mask: self.common_mask & other.common_mask,
            has: self.has | other.has,
        }
    }

    #[inline]
    pub fn has(&self, bit: u32) -> bool {
        self.has & bit != 0
    }
}

/// A geometry as it was when the scene was committed.
#[derive(Clone)]
pub struct Placed {
    pub geom_id: u32,
    pub geometry: Arc<Geometry>,
    pub state: State,
}

/// An instance as it was when the scene was committed.
pub struct PlacedInstance {
    /// `geomID` of the instance, which is the `instID` of its hits.
    pub geom_id: u32,
    /// Place in the instance array, and 0 of a single instance.
    pub prim_id: u32,
    pub mask: u32,
    pub object: usize,
    pub to_world: Rows,
    pub from_world: Option<Rows>,
}

/// A geometry, and the instance that it is seen in.
#[derive(Clone, Copy)]
pub struct Site<'a> {
    pub placed: &'a Placed,
    pub instance: Option<&'a PlacedInstance>,
}

impl<'a> Site<'a> {
    pub fn kind(self) -> Kind {
        self.placed.geometry.kind
    }

    pub fn state(self) -> &'a State {
        &self.placed.state
    }

    /// Origin and direction of a ray in the space of the object.
    pub fn in_object(self, ray: &RtcRay) -> ([f32; 3], [f32; 3]) {
        match self
            .instance
            .and_then(|instance| instance.from_world.as_ref())
        {
            Some(rows) => (
                transform::apply(rows, ray.org, 1.0),
                transform::apply(rows, ray.dir, 0.0),
            ),
            None => (ray.org, ray.dir),
        }
    }
}

impl Committed {
    #[inline]
    pub fn bvh(&self) -> &Bvh {
        match &self.world {
            Some(world) => world,
            None => &self.object,
        }
    }

    pub fn bounds(&self) -> Bounds {
        let bounds = self.bvh().bounds();
        Bounds::new(bounds.min, bounds.max)
    }

    /// Geometry and instance of these numbers of the kernel.
    #[inline]
    pub fn find(&self, inst_id: u32, geom_id: u32) -> Site<'_> {
        let (ground, instance) = match inst_id {
            INVALID => (&self.ground, None),
            _ => {
                let instance = &self.instances[inst_id as usize];
                (&self.objects[instance.object].ground, Some(instance))
            }
        };
        Site {
            placed: &ground[geom_id as usize],
            instance,
        }
    }

    /// Whether a commit would find what the last one found.
    pub fn is_current(&self) -> bool {
        (self.seen.iter()).all(|(geometry, version)| geometry.version() == *version)
            && self.objects_are_current()
    }

    /// Whether instanced scenes have not been committed again.
    fn objects_are_current(&self) -> bool {
        let instanced = (self.seen.iter())
            .filter(|(geometry, _)| geometry.kind.is_instance() && geometry.is_enabled());
        let mut scenes = instanced.flat_map(|(geometry, _)| geometry.state().scenes);
        scenes.all(|scene| {
            let now = scene.map_or(std::ptr::null(), |scene| scene.committed_address());
            now.is_null() || (self.objects.iter()).any(|object| Arc::as_ptr(object) == now)
        })
    }
}

impl Drop for Committed {
    fn drop(&mut self) {
        // A monitor cannot refuse what goes.
        let _ = self.device.count_memory(-self.bytes);
    }
}
