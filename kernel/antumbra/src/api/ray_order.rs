//! The order in which a batch is traced, and when another than the given one pays. `docs/notes/kernel.md` in the
//! repository has measurements.

use alloc::vec;
use alloc::vec::Vec;

use super::batch::CHUNK;
use super::bvh::Bvh;
use crate::geometry::QueryKind;
use crate::ray_columns::Rays;
use crate::trace::ray_batch::RayBatch;
use crate::trace::ray_sort::Grid;

/// Order in which the rays of a batch are traced. Answers, and their places, are the same.
///
/// ```
/// # use antumbra::{Bvh, Geometry, Recipe};
/// use antumbra::{Ray, RayOrder};
///
/// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
/// let rays = [Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]); 4];
/// let blocked = bvh.batch(&rays).order(RayOrder::ByRule).occluded();
/// assert_eq!(blocked, [true; 4]);
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum RayOrder {
    /// As they are given. Best if neighbouring rays begin near each other, as the rays of a picture or of a surface do.
    #[default]
    AsGiven,
    /// As they are given, where neighbours begin near each other and go the same way: what occluded the rays before is tested
    /// first. Pays for rays from one point to the points of a surface.
    Alike,
    /// Sorted by origin and then by direction, up to 2¹⁸ rays at a time. Pays for scattered rays in large trees; elsewhere it
    /// costs up to half of the rate.
    Sorted,
    /// Sorted if all of this holds, and as given otherwise:
    /// - The query is for closest hits.
    /// - Each thread has 2¹⁷ rays or more.
    /// - The tree takes 16 MiB or more, and so does not stay in the caches of a core.
    /// - Of 1024 rays, more than half begin farther from the next ray than 1/64 of the longest side of the scene's bounds.
    /// - Of the same 1024 rays, three of four hit a primitive that no other of them hits. Otherwise rays visit few
    ///   parts of the tree, and these stay in the caches.
    ByRule,
}

/// Rays that are sorted together at most. More are a little closer together, and cost as much more to bring together.
const MOST: usize = 1 << 18;

/// Rays that must be sorted together for the rule to sort at all.
const WORTHWHILE: usize = 1 << 17;

/// Bytes of the smallest tree for which the rule sorts.
const LARGE_TREE: usize = 16 << 20;

/// Number of rays that the rule samples: less than one of a hundred.
const SAMPLE: usize = 1 << 10;

/// How many rays of a batch are sorted together, so that every thread has some.
pub(super) fn piece_len(rays: usize, threads: usize) -> usize {
    rays.div_ceil(threads).clamp(CHUNK, MOST)
}

impl RayOrder {
    /// Grid to sort these rays by; `None` if they are to be traced as given.
    pub(super) fn grid(
        self,
        rays: &Rays<'_>,
        bvh: &Bvh,
        query: QueryKind,
        threads: usize,
    ) -> Option<Grid> {
        let sorts = match self {
            Self::AsGiven | Self::Alike => false,
            Self::Sorted => true,
            Self::ByRule => {
                query == QueryKind::Intersect
                    && rays.len() >= WORTHWHILE
                    && piece_len(rays.len(), threads) >= WORTHWHILE
                    && bvh.tree.bytes() >= LARGE_TREE
                    && are_scattered(rays, bvh)
                    && hit_much(rays, bvh)
            }
        };
        sorts.then(|| Grid::new(&bvh.bounds()))
    }
}

/// Indices of a sample of rays; none is the last ray.
fn sample(rays: &Rays<'_>) -> impl Iterator<Item = usize> {
    let step = rays.len() / SAMPLE;
    (0..SAMPLE).map(move |index| index * step)
}

/// Whether most rays begin far from their neighbours.
fn are_scattered(rays: &Rays<'_>, bvh: &Bvh) -> bool {
    let bounds = bvh.bounds();
    let side = (0..3).fold(0.0, |side: f32, axis| {
        side.max(bounds.max[axis] - bounds.min[axis])
    });
    let is_far = |index: &usize| {
        let [a, b] = [rays.get(*index).org, rays.get(index + 1).org];
        (0..3).any(|axis| (a[axis] - b[axis]).abs() > side / 64.0)
    };
    2 * sample(rays).filter(is_far).count() > SAMPLE
}

/// Whether most rays hit primitives that no other ray of the sample hits.
fn hit_much(rays: &Rays<'_>, bvh: &Bvh) -> bool {
    let mut sampled = Vec::new();
    rays.pick(sample(rays), &mut sampled);
    let mut hits = vec![None; sampled.len()];
    (bvh.pool).with(|memory| bvh.intersect_many(memory, &RayBatch::new(&sampled, 0), &mut hits));
    let mut ids: Vec<_> = (hits.iter().flatten())
        .map(|hit| (hit.inst_id, hit.geom_id, hit.prim_id))
        .collect();
    ids.sort_unstable();
    let alone = ids.chunk_by(|a, b| a == b).filter(|same| same.len() == 1);
    4 * alone.count() >= 3 * SAMPLE
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::api::recipe::Recipe;
    use crate::geometry::Geometry;
    use crate::ray::Ray;
    use antumbra_testkit::Rng;

    #[test]
    fn the_rule_asks_for_everything_that_it_names() {
        let mut rng = Rng::new(12);
        // Squares on a plain, on a grid of so many by as many.
        let build = |size: u32| {
            let corner = |index: u32| [index % (size + 1), index / (size + 1)];
            let positions: Vec<[f32; 3]> = (0..(size + 1) * (size + 1))
                .map(|index| corner(index).map(|x| x as f32 / size as f32))
                .map(|[x, y]| [x, y, 0.0])
                .collect();
            let indices: Vec<[u32; 3]> = (0..size * size)
                .map(|square| square + square / size)
                .flat_map(|low| {
                    [
                        [low, low + 1, low + size + 1],
                        [low + 1, low + size + 1, low + size + 2],
                    ]
                })
                .collect();
            let recipe = Recipe::fast().engine(crate::recipe::Engine::best(crate::Width::W4));
            Bvh::build(&[Geometry::triangles(positions, indices)], &recipe).expect("in range")
        };
        let (large, small) = (build(500), build(50));
        assert!(large.report().bytes > LARGE_TREE);
        assert!(small.report().bytes < LARGE_TREE);
        let mut rays = |place: fn([f32; 2], usize) -> [f32; 2]| -> Vec<Ray> {
            (0..1 << 18)
                .map(|index| {
                    let [x, y] = place([rng.unit(), rng.unit()], index);
                    Ray::new([x, y, 1.0], [0.0, 0.0, -1.0])
                })
                .collect()
        };
        let scattered = rays(|point, _| point);
        let in_a_row = rays(|_, index| {
            let index = index as f32 / (1 << 18) as f32;
            [index, index]
        });
        // Far from each other, and over few triangles.
        let corners =
            rays(|point, _| point.map(|x| if x < 0.5 { 0.01 * x } else { 1.0 - 0.01 * x }));
        let sorts = |rays: &[Ray], bvh, query, threads| {
            let grid = RayOrder::ByRule.grid(&rays.into(), bvh, query, threads);
            grid.is_some()
        };
        let closest = QueryKind::Intersect;
        assert!(sorts(&scattered, &large, closest, 2));
        assert!(!sorts(&scattered, &large, closest, 3), "too many threads");
        assert!(!sorts(&scattered[..100_000], &large, closest, 1));
        assert!(!sorts(&scattered, &small, closest, 1));
        assert!(!sorts(&in_a_row, &large, closest, 1));
        assert!(!sorts(&corners, &large, closest, 1));
        assert!(!sorts(&scattered, &large, QueryKind::Occluded, 1));
        assert!(!sorts(&[], &large, closest, 1));
    }
}
