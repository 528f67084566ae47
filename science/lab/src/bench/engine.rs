//! Engines: whatever answers a query for many rays.

use std::fmt;

use antumbra::{Hit, Ray};

/// Query of every ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// Whether anything is in its interval.
    Occluded,
    /// Closest hit.
    Intersect,
}

impl Query {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Occluded, Self::Intersect];

    /// The name in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Occluded => "occluded",
            Self::Intersect => "intersect",
        }
    }
}

impl fmt::Display for Query {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Answers, ray by ray.
#[derive(Clone, Debug, PartialEq)]
pub enum Answers {
    Occluded(Vec<bool>),
    /// Distances of closest hits, infinite for none. Which primitive was hit is not compared: where two touch,
    /// kernels may differ.
    Distances(Vec<f32>),
}

impl Answers {
    /// Closest hits as distances.
    pub fn of_hits(hits: &[Option<Hit>]) -> Self {
        let distance = |hit: &Option<Hit>| hit.map_or(f32::INFINITY, |hit| hit.t);
        Self::Distances(hits.iter().map(distance).collect())
    }

    /// How many rays were answered otherwise. Distances differ by more than the `tolerance` relative to the
    /// other one; at tolerance 0 by anything.
    ///
    /// # Panics
    /// If they answer different queries or numbers of rays.
    pub fn differing_from(&self, other: &Self, tolerance: f32) -> usize {
        match (self, other) {
            (Self::Occluded(a), Self::Occluded(b)) => {
                assert_eq!(a.len(), b.len(), "answers to the same rays");
                a.iter().zip(b).filter(|(a, b)| a != b).count()
            }
            (Self::Distances(a), Self::Distances(b)) => {
                assert_eq!(a.len(), b.len(), "answers to the same rays");
                // Any distance is near infinity by that measure.
                let near = |a: f32, b: f32| b.is_finite() && (a - b).abs() <= tolerance * b.abs();
                let same = |a: f32, b: f32| a == b || near(a, b);
                let differs = |(a, b): &(&f32, &f32)| !same(**a, **b);
                a.iter().zip(b).filter(differs).count()
            }
            _ => panic!("answers to different queries"),
        }
    }

    /// Appends the answers to further rays.
    ///
    /// # Panics
    /// If they answer different queries.
    pub fn append(&mut self, more: Self) {
        match (self, more) {
            (Self::Occluded(all), Self::Occluded(more)) => all.extend(more),
            (Self::Distances(all), Self::Distances(more)) => all.extend(more),
            _ => panic!("answers to different queries"),
        }
    }

    /// Share of the rays that hit something; 0 for no rays.
    pub fn occluded_share(&self) -> f64 {
        let (hits, all) = match self {
            Self::Occluded(answers) => (answers.iter().filter(|hit| **hit).count(), answers.len()),
            Self::Distances(answers) => (
                answers.iter().filter(|t| t.is_finite()).count(),
                answers.len(),
            ),
        };
        hits as f64 / all.max(1) as f64
    }
}

/// A query for a fixed list of rays, run as often as wanted by one thread.
pub trait Work: Send {
    /// Makes everything as before the first run. Not timed.
    fn reset(&mut self);
    /// Answers every ray. Timed.
    fn run(&mut self);
    /// The answers of the last run.
    fn answers(&self) -> Answers;
}

/// One way to answer queries.
pub trait Engine: Sync {
    /// Name in results.
    fn label(&self) -> Label;
    /// Work of the engine on these rays, or `None` if it has no such query.
    fn work<'a>(&'a self, query: Query, rays: &'a [Ray]) -> Option<Box<dyn Work + 'a>>;
}

/// Name of an engine, and its tree if it is ours.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Label {
    pub engine: &'static str,
    pub api: &'static str,
    pub tree: Option<TreeLabel>,
}

/// The choices behind one of our trees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TreeLabel {
    pub builder: &'static str,
    pub collapse: &'static str,
    pub width: usize,
    pub order: &'static str,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_differ_by_hit_or_distance() {
        const NONE: f32 = f32::INFINITY;
        let exact = Answers::Distances(vec![1.0, 1e6, NONE, 3.0, NONE]);
        let other = Answers::Distances(vec![1.0, 1e6 + 10.0, NONE, NONE, 2.0]);
        assert_eq!(other.differing_from(&exact, 1e-4), 2);
        assert_eq!(other.differing_from(&exact, 0.0), 3);
        assert_eq!(exact.differing_from(&exact, 0.0), 0);
        let nan = Answers::Distances(vec![f32::NAN]);
        assert_eq!(nan.differing_from(&Answers::Distances(vec![1.0]), 1.0), 1);
        assert_eq!(exact.occluded_share(), 0.6);
        let (yes, no) = (
            Answers::Occluded(vec![true]),
            Answers::Occluded(vec![false]),
        );
        assert_eq!(yes.differing_from(&no, 1.0), 1);
        assert_eq!(yes.occluded_share(), 1.0);
    }
}
