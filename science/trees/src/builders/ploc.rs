//! PLOC: a tree from below. Clusters, at first single primitives, are in the order of a space-filling curve; in every
//! round each looks for its best partner nearby, and those that choose each other become one.
//!
//! Source: Meister and Bittner (2018), "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy
//! Construction": the distance of two clusters is the area of the box around both. Deviations:
//! - Of partners at equal distance the one is taken whose place differs in the lowest bits: both choose alike,
//!   so a crowd of coincident primitives is halved in a round instead of losing one pair.
//! - After [`MAX_ROUNDS`] rounds neighbours are put together whatever the distance. No scene measured needs so
//!   many; it bounds the depth of the tree for any input.
//! - Theirs chooses by the surface area heuristic which subtrees become leaves. Here it is all that fit a leaf
//!   block, which is tested at one go.

use crate::builders::pieces::Piece;
use antumbra::Aabb;
use antumbra::Primitives;
use antumbra::parts::BLOCK;
use antumbra::parts::BinaryTree;
use antumbra::parts::PrimKind;
use rayon::prelude::*;

/// How far a cluster looks in either direction; their quality setting.
const RADIUS: usize = 16;

/// Rounds of clustering by distance; then come at most 30 of halving.
const MAX_ROUNDS: usize = 60;

/// Clusters that a thread handles at one go.
const CHUNK: usize = 1024;

/// Subtrees of more primitives than this are worth a thread of their own.
const SEQUENTIAL: u32 = 4096;

/// A subtree over some primitives.
#[derive(Clone, Copy)]
struct Cluster {
    bounds: Aabb,
    /// A primitive, or a merger after them.
    name: u32,
}

/// Two clusters made one.
struct Merger {
    bounds: Aabb,
    /// Names of clusters.
    children: [u32; 2],
    /// Primitives below.
    count: u32,
    /// Their kind, if they are all of one.
    kind: Option<PrimKind>,
}

/// Builds the tree.
pub(crate) fn build(primitives: &Primitives) -> BinaryTree {
    // There may be instances all the same: they are put into the tree afterwards.
    let count = primitives.len();
    if count == 0 {
        return BinaryTree::default();
    }
    let mut forest = Forest {
        primitives,
        mergers: Vec::with_capacity(primitives.len()),
    };
    let mut clusters = in_order_of_a_curve(primitives);
    let mut round = 0;
    while clusters.len() > 1 {
        let partners = if round < MAX_ROUNDS {
            partners(&clusters)
        } else {
            (0..clusters.len()).map(|place| place ^ 1).collect()
        };
        clusters = forest.merged(&clusters, &partners);
        round += 1;
    }
    forest.piece(clusters[0].name).into_tree()
}

/// The primitives along a Morton curve through their centres.
fn in_order_of_a_curve(primitives: &Primitives) -> Vec<Cluster> {
    /// Cells per axis: 2 to this.
    const BITS: u32 = 21;
    let indices = (0..primitives.len()).into_par_iter().with_min_len(CHUNK);
    let bounds: Vec<_> = indices.map(|index| primitives.bounds_of(index)).collect();
    let center = |bounds: &Aabb, axis: usize| {
        0.5 * (f64::from(bounds.min[axis]) + f64::from(bounds.max[axis]))
    };
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for one in &bounds {
        for axis in 0..3 {
            low[axis] = low[axis].min(center(one, axis));
            high[axis] = high[axis].max(center(one, axis));
        }
    }
    let spread = (0..3).fold(0.0, |most, axis| f64::max(most, high[axis] - low[axis]));
    let cells = f64::from(1u32 << BITS);
    // The same scale on all axes, so that cells are cubes; 0 where all centres coincide.
    let scale = if spread > 0.0 { cells / spread } else { 0.0 };
    let code = |index: usize| {
        let mut code = 0;
        for axis in 0..3 {
            let cell = (center(&bounds[index], axis) - low[axis]) * scale;
            code |= spread_bits((cell as u64).min((1 << BITS) - 1)) << axis;
        }
        (code, index as u32)
    };
    let indices = (0..bounds.len()).into_par_iter().with_min_len(CHUNK);
    let mut codes: Vec<_> = indices.map(code).collect();
    codes.sort_unstable();
    let clusters = codes.into_iter().map(|(_, name)| Cluster {
        bounds: bounds[name as usize],
        name,
    });
    clusters.collect()
}

/// The 21 bits of a number with two zeros before each.
fn spread_bits(mut bits: u64) -> u64 {
    for (shift, mask) in [
        (32, 0x001f_0000_0000_ffff),
        (16, 0x001f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ] {
        bits = (bits | bits << shift) & mask;
    }
    bits
}

/// The place of the best partner of each cluster. There are at least two.
fn partners(clusters: &[Cluster]) -> Vec<usize> {
    let partner = |place: usize| {
        let own = &clusters[place].bounds;
        let first = place.saturating_sub(RADIUS);
        let last = (clusters.len() - 1).min(place + RADIUS);
        let mut best = (f32::INFINITY, usize::MAX, place);
        for other in (first..=last).filter(|other| *other != place) {
            let area = own.union(&clusters[other].bounds).half_area();
            // Symmetric in both, so that the best pair of all is always one that chooses each other.
            if (area, place ^ other) < (best.0, best.1) {
                best = (area, place ^ other, other);
            }
        }
        best.2
    };
    let places = (0..clusters.len()).into_par_iter().with_min_len(CHUNK);
    places.map(partner).collect()
}

struct Forest<'a> {
    primitives: &'a Primitives,
    mergers: Vec<Merger>,
}

impl Forest<'_> {
    /// Makes one of those that chose each other, in the place of the first.
    fn merged(&mut self, clusters: &[Cluster], partners: &[usize]) -> Vec<Cluster> {
        let mut next = Vec::with_capacity(clusters.len());
        for (place, cluster) in clusters.iter().enumerate() {
            let partner = partners[place];
            let mutual = partners.get(partner) == Some(&place);
            if !mutual {
                next.push(*cluster);
            } else if place < partner {
                next.push(self.merge(cluster, &clusters[partner]));
            }
        }
        next
    }

    fn merge(&mut self, a: &Cluster, b: &Cluster) -> Cluster {
        let bounds = a.bounds.union(&b.bounds);
        let children = [a.name, b.name];
        let [(a_count, a_kind), (b_count, b_kind)] = children.map(|name| self.contents(name));
        self.mergers.push(Merger {
            bounds,
            children,
            count: a_count + b_count,
            kind: a_kind.filter(|_| a_kind == b_kind),
        });
        let name = (self.primitives.len() + self.mergers.len() - 1) as u32;
        Cluster { bounds, name }
    }

    /// How many primitives a cluster has, and what kind they are of, if of one.
    fn contents(&self, name: u32) -> (u32, Option<PrimKind>) {
        match self.merger(name) {
            None => (1, Some(self.primitives.kind(name as usize))),
            Some(merger) => (merger.count, merger.kind),
        }
    }

    fn merger(&self, name: u32) -> Option<&Merger> {
        self.mergers
            .get((name as usize).checked_sub(self.primitives.len())?)
    }

    /// The subtree of a cluster.
    fn piece(&self, name: u32) -> Piece {
        let Some(merger) = self.merger(name) else {
            let bounds = self.primitives.bounds_of(name as usize);
            return Piece::leaf(bounds, vec![name]);
        };
        if merger.kind.is_some() && merger.count as usize <= BLOCK {
            let mut prims = Vec::with_capacity(BLOCK);
            self.gather(name, &mut prims);
            return Piece::leaf(merger.bounds, prims);
        }
        let is_large = merger.count > SEQUENTIAL;
        Piece::of_parts(merger.bounds, merger.children, is_large, |child| {
            self.piece(child)
        })
    }

    /// The primitives of a cluster.
    fn gather(&self, name: u32, prims: &mut Vec<u32>) {
        match self.merger(name) {
            None => prims.push(name),
            Some(merger) => merger
                .children
                .iter()
                .for_each(|child| self.gather(*child, prims)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_primitives::primitives;
    use antumbra_testkit::{Rng, mesh};

    /// Of few clusters the two that are nearest to each other are always made one, and everyone's partner is the nearest.
    #[test]
    fn the_nearest_pair_is_made_one() {
        let mut rng = Rng::new(65);
        for _ in 0..50 {
            let mesh = mesh::soup(&mut rng, 3 + 13);
            let primitives = primitives(&mesh, 0, &mut rng);
            let clusters = in_order_of_a_curve(&primitives);
            let partners = partners(&clusters);
            let distance =
                |a: usize, b: usize| clusters[a].bounds.union(&clusters[b].bounds).half_area();
            let others = |a: usize| (0..clusters.len()).filter(move |b| *b != a);
            for (place, &partner) in partners.iter().enumerate() {
                let nearest = others(place).map(|other| distance(place, other));
                assert_eq!(
                    distance(place, partner),
                    nearest.fold(f32::INFINITY, f32::min)
                );
            }
            let mutual = (0..clusters.len()).filter(|place| partners[partners[*place]] == *place);
            assert!(mutual.count() >= 2);
        }
    }

    /// However many primitives coincide, they are halved in every round.
    #[test]
    fn crowds_make_balanced_trees() {
        let cluster = Cluster {
            bounds: Aabb {
                min: [0.0; 3],
                max: [1.0; 3],
            },
            name: 0,
        };
        let partners = partners(&[cluster; 1000]);
        assert!(
            partners
                .iter()
                .enumerate()
                .all(|(place, partner)| place ^ 1 == *partner)
        );
    }

    #[test]
    fn the_curve_visits_octants_one_after_the_other() {
        assert_eq!(spread_bits(0b101), 0b001_000_001);
        assert_eq!(spread_bits((1 << 21) - 1).count_ones(), 21);
        assert_eq!(spread_bits(1 << 20), 1 << 60);
    }
}
