//! A cache of occluders: the leaf that last occluded a ray from this part of space in this direction is tried first.
//!
//! Answers stay the same bits: an occluder found is an occluder, and a ray whose guess is wrong is traced as ever.

use alloc::vec;
use alloc::vec::Vec;

use antumbra_simd::{Dispatch, Level};

use super::bvh::Bvh;
use crate::hash;
use crate::ray::Ray;
use crate::trace::known_leaf::{Guess, TestGuesses};
use crate::trace::which::{Occluder, Which};
use crate::tree::any::on_tree;

/// Rays that are looked up together.
const CHUNK: usize = 1 << 12;
/// Guesses of an entry after which it must be right often enough.
const TRIES: u8 = 8;
/// An entry is asked as long as one guess of so many is right.
const WORTH: u8 = 2;

/// An occluder of rays from one cell of space and direction.
#[derive(Clone, Copy, Debug, Default)]
struct Entry {
    leaf: u32,
    instance: u32,
    /// What tells the cell from others of the same place in the table.
    tag: u32,
    /// Guesses so far, halved together with those that were right.
    tries: u8,
    right: u8,
    /// Rays that pass without a guess before the entry is asked again.
    wait: u16,
}

/// How well a cache has guessed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CacheCounts {
    /// Rays asked about.
    pub rays: u64,
    /// Rays for which a leaf was tried first.
    pub guesses: u64,
    /// Rays that this leaf occluded.
    pub right: u64,
    /// Primitives in the leaves tried.
    pub prim_tests: u64,
}

/// Remembers, for cells of space and direction, the leaf that occluded the last ray, and tries it first.
///
/// A cache belongs to one tree and one thread. A tree that was ordered anew or refitted keeps its leaves; any other
/// change wants a new cache.
#[derive(Clone, Debug)]
pub struct OccluderCache {
    entries: Vec<Entry>,
    origin: [f32; 3],
    /// Cells per unit of length.
    scale: f32,
    /// Half of the cells along each side of the six faces of a cube of directions.
    half_facets: f32,
    counts: CacheCounts,
    /// Memory of a batch.
    keys: Vec<(u32, u32)>,
    guesses: Vec<Guess>,
    right: Vec<bool>,
    pending: Vec<u32>,
    found: Vec<Occluder>,
}

impl OccluderCache {
    /// An empty cache of 2^`log2_entries` entries, 20 bytes each, for rays that begin about where these do. Space is divided
    /// into `cells` along the longest side of the box around their origins, directions into `facets`² on each side of a cube.
    pub fn new(rays: &[Ray], log2_entries: u32, cells: u16, facets: u8) -> Self {
        let mut sides = [[0.0, 1.0]; 3];
        for (axis, side) in sides.iter_mut().enumerate() {
            let finite = rays.iter().map(|ray| ray.org[axis]);
            let mut origins: Vec<f32> = finite.filter(|x| x.is_finite()).collect();
            origins.sort_by(f32::total_cmp);
            if let Some(last) = origins.len().checked_sub(1) {
                // Without the outermost, which may be far away.
                *side = [origins[last / 50], origins[last - last / 50]];
            }
        }
        let longest = sides
            .iter()
            .map(|[low, high]| high - low)
            .fold(0.0, f32::max);
        let scale = f32::from(cells) / longest;
        Self {
            entries: vec![Entry::default(); 1 << log2_entries.clamp(4, 24)],
            origin: sides.map(|[low, _]| low),
            scale: if scale.is_finite() { scale } else { 1.0 },
            half_facets: 0.5 * f32::from(facets.clamp(1, 15)),
            counts: CacheCounts::default(),
            keys: Vec::new(),
            guesses: Vec::new(),
            right: Vec::new(),
            pending: Vec::new(),
            found: Vec::new(),
        }
    }

    /// How well it has guessed so far.
    pub fn counts(&self) -> CacheCounts {
        self.counts
    }

    /// Forgets the counts, but no occluder.
    pub fn reset_counts(&mut self) {
        self.counts = CacheCounts::default();
    }

    /// Place in the table and tag of a ray.
    #[inline(always)]
    fn key(&self, ray: &Ray) -> (u32, u32) {
        let mut state = 0_u64;
        for axis in 0..3 {
            let cell = (ray.org[axis] - self.origin[axis]) * self.scale;
            // Saturates; NaN is 0.
            let cell = (cell + 1024.0) as i32 as u64 & 0xffff;
            state = state << 16 | cell;
        }
        let [x, y, z] = ray.dir;
        let [mx, my, mz] = [x.abs(), y.abs(), z.abs()];
        let (face, along, u, v) = if mx >= my && mx >= mz {
            (0, x, y, z)
        } else if my >= mz {
            (1, y, x, z)
        } else {
            (2, z, x, y)
        };
        let half = self.half_facets;
        let inverse = half / along.abs();
        let facet = |w: f32| (w * inverse + half) as u32 as u64;
        let face = face << 1 | u64::from(along < 0.0);
        state ^= (face << 8 | facet(u) << 4 | facet(v)) << 48;
        let mixed = state.wrapping_mul(hash::STEP);
        let mixed = (mixed ^ mixed >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let place = (mixed >> 32) as u32 & (self.entries.len() as u32 - 1);
        // Never 0, which is the tag of an empty entry.
        (place, mixed as u32 | 1)
    }

    /// [`Bvh::occluded_batch`] on the calling thread, by way of the cache.
    ///
    /// # Panics
    /// If the slices differ in length, or the cache was used with another tree that has more leaves.
    pub fn occluded_batch(&mut self, bvh: &Bvh, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        for (rays, occluded) in rays.chunks(CHUNK).zip(occluded.chunks_mut(CHUNK)) {
            self.guess(bvh, rays, occluded);
            let mut found = core::mem::take(&mut self.found);
            found.clear();
            found.resize(rays.len(), Occluder::default());
            bvh.pool.with(|memory| {
                if bvh.isa().level() == Level::Scalar {
                    bvh.each::<Which>(memory, rays, &mut found);
                } else {
                    bvh.stream::<Which>(memory, rays, &self.pending, &mut found);
                }
            });
            self.learn(bvh, &found);
            for &ray in &self.pending {
                occluded[ray as usize] = found[ray as usize].is_some();
            }
            self.found = found;
        }
    }

    /// [`Bvh::occluded`] by way of the cache.
    pub fn occluded(&mut self, bvh: &Bvh, ray: &Ray) -> bool {
        let rays = core::slice::from_ref(ray);
        let mut occluded = [false];
        self.guess(bvh, rays, &mut occluded);
        if occluded[0] {
            return true;
        }
        let found = [bvh.one::<Which>(ray)];
        self.learn(bvh, &found);
        found[0].is_some()
    }

    /// Answers the rays of a batch whose guesses are right; returns the indices of the others, with which
    /// [`OccluderCache::teach`] goes on. For those who count what the others cost.
    pub fn guess(&mut self, bvh: &Bvh, rays: &[Ray], occluded: &mut [bool]) -> &[u32] {
        self.keys.clear();
        self.guesses.clear();
        self.pending.clear();
        for ray in rays {
            let key = self.key(ray);
            self.keys.push(key);
        }
        for (index, &(place, tag)) in self.keys.iter().enumerate() {
            let entry = &mut self.entries[place as usize];
            if entry.tag == tag {
                if entry.wait == 0 {
                    self.guesses.push(Guess {
                        ray: index as u32,
                        leaf: entry.leaf,
                        instance: entry.instance,
                        place,
                    });
                } else {
                    entry.wait -= 1;
                }
            }
        }
        self.right.clear();
        self.right.resize(self.guesses.len(), false);
        let (guesses, right) = (&self.guesses, &mut self.right);
        on_tree!(&bvh.tree, tree => {
            bvh.isa().dispatch(TestGuesses { bvh: tree, rays, guesses, right });
        });
        occluded.fill(false);
        for (guess, &right) in self.guesses.iter().zip(&self.right) {
            occluded[guess.ray as usize] = right;
            let entry = &mut self.entries[guess.place as usize];
            entry.tries += 1;
            entry.right += u8::from(right);
            if entry.tries == TRIES {
                // A bandit of its own: entries that guess badly are asked ever more rarely.
                if entry.right * WORTH < TRIES {
                    entry.wait = 64;
                }
                entry.tries /= 2;
                entry.right /= 2;
            }
            self.counts.right += u64::from(right);
        }
        self.counts.rays += rays.len() as u64;
        self.counts.guesses += self.guesses.len() as u64;
        let open = (0..rays.len() as u32).filter(|ray| !occluded[*ray as usize]);
        self.pending.extend(open);
        &self.pending
    }

    /// Primitives in the leaves of the last guesses, summed up: for those who count.
    pub fn count_prims(&mut self, bvh: &Bvh) {
        let mut sum = 0;
        on_tree!(&bvh.tree, tree => {
            for guess in &self.guesses {
                if let crate::tree::node::ChildKind::Leaf(leaf) =
                    crate::tree::node::Child(guess.leaf).kind()
                {
                    sum += tree.leaf_len(leaf) as u64;
                }
            }
        });
        self.counts.prim_tests += sum;
    }

    /// Traces the rays that the last [`OccluderCache::guess`] left over and remembers their occluders.
    pub fn teach(&mut self, bvh: &Bvh, rays: &[Ray]) {
        let mut found = core::mem::take(&mut self.found);
        found.clear();
        found.resize(rays.len(), Occluder::default());
        bvh.pool
            .with(|memory| bvh.each::<Which>(memory, rays, &mut found));
        self.learn(bvh, &found);
        self.found = found;
    }

    /// Remembers what occluded the pending rays.
    fn learn(&mut self, bvh: &Bvh, found: &[Occluder]) {
        on_tree!(&bvh.tree, tree => {
            for &ray in &self.pending {
                let occluder = &found[ray as usize];
                let Some(leaf) = occluder.leaf_of(tree) else {
                    continue;
                };
                let (place, tag) = self.keys[ray as usize];
                let entry = &mut self.entries[place as usize];
                if entry.tag == tag {
                    entry.leaf = leaf.0;
                    entry.instance = occluder.instance;
                } else {
                    *entry = Entry {
                        leaf: leaf.0,
                        instance: occluder.instance,
                        tag,
                        ..Entry::default()
                    };
                }
            }
        });
    }
}
