//! Embree as an engine: its single-ray queries and its packets of sixteen.

use antumbra::Ray;

use super::engine::{Engine, Label, Query};
use crate::embree::{Packet, RayHit, Scene, SingleRay};
use crate::harness::{Work, work};

/// How Embree is queried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// `rtcOccluded1` and `rtcIntersect1` with default flags: what ratios refer to.
    Default,
    /// `rtcOccluded1` and `rtcIntersect1` on a scene with the robust flag.
    Robust,
    /// `rtcOccluded16` on sixteen consecutive rays at a time.
    Packets,
}

/// A scene and how it is queried.
pub struct Rival<'s> {
    pub scene: &'s Scene<'s>,
    pub variant: Variant,
}

impl Rival<'_> {
    /// Engine that ratios refer to.
    pub const REFERENCE: Label = Label {
        engine: "embree",
        api: "single",
        tree: None,
    };
}

impl Engine for Rival<'_> {
    fn label(&self) -> Label {
        match self.variant {
            Variant::Default => Self::REFERENCE,
            Variant::Robust => Label {
                engine: "embree-robust",
                ..Self::REFERENCE
            },
            Variant::Packets => Label {
                engine: "embree-packets",
                api: "batch",
                tree: None,
            },
        }
    }

    fn work<'a>(&'a self, query: Query, rays: &'a [Ray]) -> Option<Box<dyn Work + 'a>> {
        let scene = self.scene;
        let packet = |rays: &[Ray]| Packet::new(0, rays.len(), |lane| rays[lane]);
        Some(match (query, self.variant) {
            (Query::Occluded, Variant::Packets) => {
                let packets = rays.chunks(16).map(packet).collect();
                work(packets, |used| scene.occluded_packets(used))
            }
            (Query::Intersect, Variant::Packets) => return None,
            (Query::Occluded, _) => {
                let rays = rays.iter().map(|&ray| SingleRay::from(ray)).collect();
                work(rays, |used| scene.occluded_rays(used))
            }
            (Query::Intersect, _) => {
                let rays = rays.iter().map(|&ray| RayHit::from(ray)).collect();
                work(rays, |used| scene.intersect_rays(used))
            }
        })
    }
}
