//! Flags of `info`.

use std::path::PathBuf;

use antumbra::{Builder, Recipe};
use clap::Args;

use super::names::{self, help_one, one_of};
use super::{SCENE, SCENE_LONG, heading};
use crate::json::Destination;

/// Flags of `info`.
#[derive(Debug, Args)]
pub struct InfoArgs {
    #[arg(help = SCENE, long_help = SCENE_LONG)]
    pub scene: PathBuf,
    /// Everything as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    #[arg(
        long,
        value_name = "B",
        value_parser = one_of::<Builder>(names::builders()),
        hide_possible_values = true,
        default_value_t = Recipe::default().builder,
        help_heading = heading::TREE,
        help = "Builder of the binary tree",
        long_help = help_one("Builder of the binary tree", &names::builders(),
            "Builders that are driven by rays are given surface rays.")
    )]
    pub builder: Builder,
}
