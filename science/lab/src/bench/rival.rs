//! Embree as an engine: its single-ray queries and its packets of sixteen.

use antumbra::Ray;

use super::embree::{Packet, RayHit, Scene, SingleRay};
use super::engine::{Answers, Engine, Label, Query, Work};

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
        Some(match (query, self.variant) {
            (Query::Occluded, Variant::Packets) => {
                let packets: Vec<_> = rays.chunks(16).map(Packet::new).collect();
                Box::new(Packets {
                    scene,
                    fresh: packets.clone(),
                    packets,
                })
            }
            (Query::Intersect, Variant::Packets) => return None,
            (Query::Occluded, _) => Box::new(Occlusion {
                scene,
                rays,
                used: rays.iter().map(SingleRay::new).collect(),
            }),
            (Query::Intersect, _) => Box::new(Closest {
                scene,
                rays,
                used: rays.iter().map(RayHit::new).collect(),
            }),
        })
    }
}

struct Occlusion<'a> {
    scene: &'a Scene<'a>,
    rays: &'a [Ray],
    used: Vec<SingleRay>,
}

impl Work for Occlusion<'_> {
    fn reset(&mut self) {
        for (used, ray) in self.used.iter_mut().zip(self.rays) {
            *used = SingleRay::new(ray);
        }
    }

    fn run(&mut self) {
        self.scene.occluded(&mut self.used);
    }

    fn answers(&self) -> Answers {
        Answers::Occluded(self.used.iter().map(SingleRay::is_occluded).collect())
    }
}

struct Closest<'a> {
    scene: &'a Scene<'a>,
    rays: &'a [Ray],
    used: Vec<RayHit>,
}

impl Work for Closest<'_> {
    fn reset(&mut self) {
        for (used, ray) in self.used.iter_mut().zip(self.rays) {
            *used = RayHit::new(ray);
        }
    }

    fn run(&mut self) {
        self.scene.intersect(&mut self.used);
    }

    fn answers(&self) -> Answers {
        Answers::Distances(self.used.iter().map(RayHit::distance).collect())
    }
}

struct Packets<'a> {
    scene: &'a Scene<'a>,
    /// Packets as before any query.
    fresh: Vec<Packet>,
    packets: Vec<Packet>,
}

impl Work for Packets<'_> {
    fn reset(&mut self) {
        self.packets.copy_from_slice(&self.fresh);
    }

    fn run(&mut self) {
        self.scene.occluded_packets(&mut self.packets);
    }

    fn answers(&self) -> Answers {
        Answers::Occluded(self.packets.iter().flat_map(Packet::occluded).collect())
    }
}
