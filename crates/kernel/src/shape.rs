//! The shape of a wide tree: what a log or an order must have in common with it.

use core::fmt;

/// What a log or an order must have in common with a tree to fit it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Children per node.
    pub width: usize,
    /// How many nodes there are.
    pub nodes: usize,
    /// How many leaf blocks there are.
    pub leaves: usize,
    /// How many instances there are.
    pub instances: usize,
    /// How many objects they place.
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
