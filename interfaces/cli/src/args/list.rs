//! Flags of `list`.

use clap::{Args, ValueEnum};

use super::heading;
use crate::json::Destination;

/// A list of the kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ListName {
    /// Child orders of shadow rays.
    Orders,
    /// Builders of the binary tree.
    Builders,
    /// Ways to make the binary tree wide.
    Collapses,
    /// Instruction sets.
    Levels,
    /// Named recipes.
    Presets,
    /// Children per node.
    Widths,
}

/// Flags of `list`.
#[derive(Debug, Args)]
pub struct ListArgs {
    /// Which list; all of them if absent
    #[arg(hide_possible_values = true)]
    pub list: Option<ListName>,
    /// Lists as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
}
