//! The shape of a wide tree: a log or an order fits trees of its shape.

use core::fmt;

/// Counts that a log or an order must have in common with a tree to fit it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Children per node.
    pub width: usize,
    /// Number of nodes, at least 1.
    pub nodes: usize,
    /// Number of leaf blocks, with an empty one that stands for empty slots.
    pub leaves: usize,
    /// Number of instances.
    pub instances: usize,
    /// Number of objects that they place.
    pub objects: usize,
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} nodes of {} children and {} leaves",
            self.nodes, self.width, self.leaves
        )?;
        if self.instances > 0 {
            write!(
                f,
                " with {} instances of {} objects",
                self.instances, self.objects
            )?;
        }
        Ok(())
    }
}
