//! How much faster one tree answers occlusion rays than another.

use std::convert::Infallible;

use antumbra::{Bvh, Ray};

use crate::harness::{interleave, ratios};
use crate::thread_time;

/// Speedup of a tree over another one, measured interleaved on one thread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gain {
    /// Median of the speedups of all turns.
    pub median: f64,
    /// First and third quartile of the speedups of all turns.
    pub quartiles: [f64; 2],
    /// Number of turns.
    pub turns: usize,
    /// Rays of one turn.
    pub rays: usize,
}

/// Speedup of `tree` over `baseline` on occlusion rays, as ray streams. Every turn traces all rays in both trees, and every
/// other turn begins with the other tree. `None` without rays or turns, or if an answer differs.
pub fn gain(baseline: &Bvh, tree: &Bvh, rays: &[Ray], turns: usize) -> Option<Gain> {
    if rays.is_empty() || turns == 0 {
        return None;
    }
    let mut answers = [vec![false; rays.len()], vec![false; rays.len()]];
    let seconds = interleave(turns, 2, |which| {
        let start = thread_time::seconds();
        let batch = [baseline, tree][which].batch(rays).on_this_thread();
        batch.occluded_into(&mut answers[which]);
        Ok::<_, Infallible>((thread_time::seconds() - start).max(1e-9))
    });
    let Ok(seconds) = seconds;
    if answers[0] != answers[1] {
        return None;
    }
    let mut ratios: Vec<f64> = ratios(&seconds[1], &seconds[0]).collect();
    ratios.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| ratios[(share * (turns - 1) as f64).round() as usize];
    Some(Gain {
        median: at(0.5),
        quartiles: [at(0.25), at(0.75)],
        turns,
        rays: rays.len(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra::{Geometry, Recipe};

    fn tree() -> Bvh {
        let corners = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
        let geometry = [Geometry::triangles(&corners[..], vec![[0, 1, 2]])];
        Bvh::build(&geometry, &Recipe::default()).expect("a tree")
    }

    #[test]
    fn a_tree_is_about_as_fast_as_itself() {
        let rays = vec![Ray::new([0.1, 0.1, 0.0], [0.0, 0.0, 1.0]); 20_000];
        let found = gain(&tree(), &tree(), &rays, 5).expect("equal answers");
        assert!(found.quartiles[0] <= found.median && found.median <= found.quartiles[1]);
        assert_eq!((found.turns, found.rays), (5, 20_000));
        assert_eq!(gain(&tree(), &tree(), &[], 5), None);
        assert_eq!(gain(&tree(), &tree(), &rays, 0), None);
    }

    #[test]
    fn other_answers_are_no_gain() {
        let rays = [Ray::new([0.1, 0.1, 0.0], [0.0, 0.0, 1.0])];
        let corners = [[5.0, 5.0, 1.0], [6.0, 5.0, 1.0], [5.0, 6.0, 1.0]];
        let geometry = [Geometry::triangles(&corners[..], vec![[0, 1, 2]])];
        let other = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
        assert_eq!(gain(&tree(), &other, &rays, 1), None);
    }
}
