//! The order in which a batch is traced, and when another than the given one pays. `docs/notes/kernel.md` in the
//! repository has measurements.

use super::batch::CHUNK;
use super::bvh::Bvh;
use super::columns::Rays;
use crate::geometry::QueryKind;
use crate::trace::ray_sort::Grid;
use crate::tree::any::on_tree;

/// Order in which the rays of a batch are traced. Answers, and their places, are the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum RayOrder {
    /// As they are given. Best if neighbouring rays begin near each other, as those of a picture or of a surface do.
    #[default]
    AsGiven,
    /// Sorted by origin and then by direction, up to 2¹⁸ rays at a time. Sorting takes as long as half of an occlusion
    /// query in a small tree.
    Sorted,
    /// Sorted if all of this holds, and as given otherwise:
    /// - The query asks for closest hits.
    /// - Each thread has 2¹⁶ rays or more.
    /// - The tree takes 16 MiB or more, and so does not stay in the caches of a core.
    /// - Of 64 rays, more than half begin farther from the next ray than 1/64 of the longest side of the scene's bounds.
    ByRule,
}

/// Rays that are sorted together at most. More are a little closer together, and cost as much more to bring together.
const MOST: usize = 1 << 18;

/// Rays that must be sorted together for the rule to sort at all.
const WORTHWHILE: usize = 1 << 16;

/// Bytes of the smallest tree for which the rule sorts.
const LARGE_TREE: usize = 16 << 20;

/// Pairs of neighbouring rays that the rule looks at.
const PAIRS: usize = 64;

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
            Self::AsGiven => false,
            Self::Sorted => true,
            Self::ByRule => {
                query == QueryKind::Intersect
                    && rays.len() >= WORTHWHILE
                    && piece_len(rays.len(), threads) >= WORTHWHILE
                    && on_tree!(&bvh.tree, tree => tree.bytes()) >= LARGE_TREE
                    && are_scattered(rays, bvh)
            }
        };
        sorts.then(|| Grid::new(&bvh.bounds()))
    }
}

/// Whether most rays begin far from their neighbours. There are more than [`PAIRS`].
fn are_scattered(rays: &Rays<'_>, bvh: &Bvh) -> bool {
    let bounds = bvh.bounds();
    let side = (0..3).fold(0.0, |side: f32, axis| {
        side.max(bounds.max[axis] - bounds.min[axis])
    });
    let step = rays.len() / PAIRS;
    let is_far = |pair: &usize| {
        let [a, b] = [pair * step, pair * step + 1].map(|index| rays.get(index).org);
        (0..3).any(|axis| (a[axis] - b[axis]).abs() > side / 64.0)
    };
    2 * (0..PAIRS).filter(is_far).count() > PAIRS
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::api::recipe::Recipe;
    use crate::geometry::Geometry;
    use crate::ray::Ray;
    use antumbra_testkit::{Rng, mesh};

    #[test]
    fn the_rule_asks_for_everything_that_it_names() {
        let mut rng = Rng::new(12);
        let build = |size: usize| {
            let mesh = mesh::soup(&mut Rng::new(3), size);
            let geometries = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
            Bvh::build(&geometries, &Recipe::fast().width(crate::Width::W4)).expect("in range")
        };
        let (large, small) = (build(400_000), build(100));
        assert!(large.build_report().bytes > LARGE_TREE);
        let scattered: Vec<Ray> = (0..1 << 17)
            .map(|_| Ray::new(rng.point(1.0), rng.direction()))
            .collect();
        let together: Vec<Ray> = (0..1 << 17)
            .map(|index| Ray::new([index as f32 * 1e-5, 0.0, 0.0], rng.direction()))
            .collect();
        let sorts = |rays: &[Ray], bvh, query, threads| {
            let grid = RayOrder::ByRule.grid(&rays.into(), bvh, query, threads);
            grid.is_some()
        };
        let closest = QueryKind::Intersect;
        assert!(sorts(&scattered, &large, closest, 2));
        assert!(!sorts(&scattered, &large, closest, 3), "too many threads");
        assert!(!sorts(&scattered[..60_000], &large, closest, 1));
        assert!(!sorts(&scattered, &small, closest, 1));
        assert!(!sorts(&together, &large, closest, 1));
        assert!(!sorts(&scattered, &large, QueryKind::Occluded, 1));
        assert!(!sorts(&[], &large, closest, 1));
    }
}
