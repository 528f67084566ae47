//! Which primitives are seen: the nearest on some ray that starts where the training rays start.
//!
//! Training rays are few, and most primitives of a large scene are on none of them. So every start sends further rays,
//! into random directions of the half space of its training ray, until more of them find hardly anything new.

use super::Levels;
use antumbra::Primitives;
use antumbra::Ray;
use antumbra::parts::BinaryTree;
use antumbra::parts::Random;
use antumbra::parts::RaySetup;
use antumbra::parts::{LeafHits, Witness, follow};
use antumbra::recipe::Builder;
use rayon::prelude::*;

/// Rays of the first round. Every further round has as many as all rounds before it.
const FIRST: usize = 1 << 14;

/// At most this many rays are sent.
const MOST: usize = 1 << 19;

/// Rays are enough if the last round found fewer new primitives than this share of all that are seen.
const NEW: f64 = 1.0 / 32.0;

/// Rays that one task follows.
const CHUNK: usize = 256;

/// Any seed does.
const SEED: u64 = 2012;

/// Whether each primitive is seen.
pub(crate) type Seen = Levels<Vec<bool>>;

impl Seen {
    /// Sends rays from where these rays start. Each level counts for itself: what an instance hides from the world's
    /// own primitives is not taken into account.
    pub fn sent(primitives: &Primitives, rays: &[Ray]) -> Self {
        let mut all = Self::none(primitives);
        if rays.is_empty() || primitives.is_empty() {
            return all;
        }
        let tree = BinaryTree::build(primitives, Builder::BinnedSah);
        let (mut sent, mut count) = (0, 0);
        while sent < MOST {
            let round = sent.max(FIRST);
            let sample: Vec<_> = (sent..sent + round)
                .map(|index| probe(rays, index))
                .collect();
            all.follow(primitives, &tree, &sample);
            sent += round;
            let before = count;
            count = all.count();
            if sent > FIRST && (count - before) as f64 <= NEW * count as f64 {
                break;
            }
        }
        all
    }

    /// Nothing is seen.
    pub fn none(primitives: &Primitives) -> Self {
        Self::new(primitives, |level| vec![false; level.len()])
    }

    fn count(&self) -> usize {
        let levels = self.objects.iter().chain([&self.world]);
        levels.flatten().filter(|seen| **seen).count()
    }

    /// Adds what these rays see.
    pub fn follow(&mut self, primitives: &Primitives, tree: &BinaryTree, rays: &[Ray]) {
        let chunks = rays.par_chunks(CHUNK).map(|rays| {
            let mut world = Nearest::default();
            let mut objects: Vec<_> = self.objects.iter().map(|_| Nearest::default()).collect();
            follow(primitives, tree, rays, &mut world, &mut objects);
            (world, objects)
        });
        for (world, objects) in chunks.collect::<Vec<_>>() {
            for prim in world.prims {
                self.world[prim as usize] = true;
            }
            for (seen, object) in self.objects.iter_mut().zip(objects) {
                for prim in object.prims {
                    seen[prim as usize] = true;
                }
            }
        }
    }
}

/// A ray of the sample: the training rays themselves first, without their ends.
fn probe(rays: &[Ray], index: usize) -> Ray {
    let ray = rays[index % rays.len()];
    let dir = if index < rays.len() {
        ray.dir
    } else {
        let dir = Random::new(SEED, index).direction().map(|x| x as f32);
        let along: f32 = (0..3).map(|axis| dir[axis] * ray.dir[axis]).sum();
        if along < 0.0 { dir.map(|x| -x) } else { dir }
    };
    Ray {
        dir,
        tnear: 0.0,
        tfar: f32::INFINITY,
        ..ray
    }
}

/// The nearest primitive of each ray that hits any.
#[derive(Default)]
struct Nearest {
    prims: Vec<u32>,
    found: Option<(f32, u32)>,
}

impl Witness for Nearest {
    fn begin(&mut self, _: &RaySetup) -> bool {
        true
    }

    fn node(&mut self, _: u32) {}

    fn hits(&mut self, ray: &RaySetup, hits: LeafHits<'_>) {
        for (prim, distance) in hits.prims(ray) {
            // Of equal distances the smaller index, whatever the tree.
            if self.found.is_none_or(|found| (distance, prim) < found) {
                self.found = Some((distance, prim));
            }
        }
    }

    fn end(&mut self) {
        self.prims.extend(self.found.take().map(|found| found.1));
    }
}
