//! Engines: whatever answers a query for many rays.

use std::fmt;

use antumbra::Ray;

use crate::harness::Work;

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
