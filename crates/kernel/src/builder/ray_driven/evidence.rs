//! What sample rays tell of primitives before there is a tree to be judged: for the builders that are driven by
//! rays.
//!
//! The rays are followed to their ends through a tree of binned SAH, so every primitive that they hit is
//! known, not only the nearest. An object has the rays of all its instances.

use antumbra_simd::Scalar;

use crate::builder::Builder;
use crate::geometry::QueryKind;
use crate::geometry::primitives::Primitives;
use crate::geometry::ray_setup::RaySetup;
use crate::parallel;
use crate::ray::Ray;
use crate::trace::binary::hits_box;
use crate::tree::binary::{BinaryKind, BinaryTree};

/// Of more rays than this, every second, third, ... is used.
const MOST_RAYS: usize = 1 << 14;

/// No more rays than this are kept for an object: instances multiply them.
const MOST_RAYS_IN_OBJECT: usize = 1 << 15;

/// Rays that one task follows.
const CHUNK: usize = 128;

/// What rays meet in the world or in an object.
#[derive(Default)]
pub(crate) struct Evidence {
    pub rays: Vec<RaySetup>,
    /// A ray and a primitive that it hits, ray after ray.
    pub hits: Vec<(u32, u32)>,
    /// Primitives that are the nearest to some ray; they may be listed several times.
    pub seen: Vec<u32>,
}

/// What rays meet on both levels.
pub(crate) struct AllEvidence {
    /// Primitives that lie in the world itself.
    pub world: Evidence,
    pub objects: Vec<Evidence>,
}

impl AllEvidence {
    /// Follows the rays. Those that cannot hit anything are left out.
    pub fn new(primitives: &Primitives, rays: &[Ray]) -> Self {
        let mut all = Self::none(primitives);
        if rays.is_empty() || primitives.is_empty() {
            return all;
        }
        let tree = BinaryTree::build(primitives, Builder::BinnedSah);
        let stride = rays.len().div_ceil(MOST_RAYS);
        let rays: Vec<_> = rays.iter().step_by(stride).collect();
        let reach = tree.nodes[0].bounds.reach();
        let chunks = parallel::map(rays.len().div_ceil(CHUNK), 1, |chunk| {
            let mut all = Self::none(primitives);
            let mut inside = RaySetup::IDLE;
            for ray in &rays[chunk * CHUNK..rays.len().min((chunk + 1) * CHUNK)] {
                let Some(setup) = RaySetup::new(ray, reach) else {
                    continue;
                };
                let mut entered = Vec::new();
                all.world.follow(primitives, &tree, &setup, &mut entered);
                for index in entered {
                    let Some(placed) = primitives.instance(index) else {
                        continue;
                    };
                    let object = placed.object as usize;
                    let interval = placed.placement.enter(Scalar, &setup, &mut inside);
                    let evidence = &mut all.objects[object];
                    if interval.is_some() && evidence.rays.len() < MOST_RAYS_IN_OBJECT {
                        let (primitives, tree) =
                            (&primitives.objects[object], &tree.objects[object]);
                        evidence.follow(primitives, tree, &inside, &mut Vec::new());
                    }
                }
            }
            all
        });
        for chunk in chunks {
            all.world.append(chunk.world);
            for (evidence, object) in all.objects.iter_mut().zip(chunk.objects) {
                if evidence.rays.len() < MOST_RAYS_IN_OBJECT {
                    evidence.append(object);
                }
            }
        }
        all
    }

    /// No rays.
    pub fn none(primitives: &Primitives) -> Self {
        let objects = primitives.objects.iter();
        Self {
            world: Evidence::default(),
            objects: objects.map(|_| Evidence::default()).collect(),
        }
    }
}

impl Evidence {
    /// Adds what a ray meets in a tree of at least one node, and notes the instances that it comes to.
    fn follow(
        &mut self,
        primitives: &Primitives,
        tree: &BinaryTree,
        setup: &RaySetup,
        instances: &mut Vec<usize>,
    ) {
        let ray = self.rays.len() as u32;
        self.rays.push(*setup);
        let mut nearest = None;
        let mut open = vec![0];
        while let Some(node) = open.pop() {
            match tree.nodes[node].kind {
                BinaryKind::Inner { right } => {
                    let children = [node + 1, node + right as usize];
                    open.extend(
                        children
                            .into_iter()
                            .filter(|child| hits_box(setup, &tree.nodes[*child].bounds)),
                    );
                }
                BinaryKind::Leaf { first, count } => {
                    for &prim in &tree.prims[first as usize..][..count as usize] {
                        let index = prim as usize;
                        if primitives.instance(index).is_some() {
                            instances.push(index);
                        } else if let Some(hit) = primitives.hit(index, setup, QueryKind::Occluded)
                        {
                            self.hits.push((ray, prim));
                            if nearest.is_none_or(|(t, _)| hit.t < t) {
                                nearest = Some((hit.t, prim));
                            }
                        }
                    }
                }
            }
        }
        self.seen.extend(nearest.map(|(_, prim)| prim));
    }

    /// Adds what other rays meet.
    fn append(&mut self, other: Self) {
        let before = self.rays.len() as u32;
        self.rays.extend(other.rays);
        let hits = other.hits.into_iter();
        self.hits
            .extend(hits.map(|(ray, prim)| (before + ray, prim)));
        self.seen.extend(other.seen);
    }
}
