//! Flags that choose the tree for shadow rays, each declared once: [`TreeArgs`] for commands with one tree, and single
//! flags for commands that compare trees.

use antumbra::recipe::{Builder, Collapse, Order, Preset};
use antumbra::{Isa, Recipe};
use antumbra_scene::Scene;
use antumbra_trees::{BUILDERS, COLLAPSES, ORDERS};
use clap::Args;

use super::heading;
use super::names::{self, help_list, help_one, one_of, row};
use super::values::{Collapses, PrefetchChoice, WidthChoice, Widths};

/// Flags that choose the tree.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::TREE)]
pub struct TreeArgs {
    #[command(flatten)]
    pub preset: PresetArgs,
    #[arg(
        long,
        value_name = "O",
        value_parser = row(names::all(&ORDERS), antumbra_trees::order),
        hide_possible_values = true,
        help = "Child order, see `antumbra list orders`",
        long_help = help_one("Child order of shadow rays", &names::all(&ORDERS),
            "If absent: the choice of the scene, or of the preset.")
    )]
    pub order: Option<Order>,
    #[command(flatten)]
    pub builder: BuilderArgs,
    #[arg(
        long,
        value_name = "C",
        value_parser = row(names::all(&COLLAPSES), antumbra_trees::collapse),
        hide_possible_values = true,
        help = "Collapse of the binary tree",
        long_help = help_one("How the binary tree is made wide", &names::all(&COLLAPSES),
            "Collapses that learn are given surface rays and the scene's own shadow rays. If absent: the choice of the preset.")
    )]
    pub collapse: Option<Collapse>,
    #[arg(
        long,
        value_name = "W",
        value_parser = one_of::<WidthChoice>(names::widths()),
        hide_possible_values = true,
        help = "Children per node",
        long_help = help_one("Children per node", &names::widths(),
            "auto is what suits the instruction set. If absent: the choice of the scene, or auto.")
    )]
    pub width: Option<WidthChoice>,
    #[command(flatten)]
    pub prefetch: PrefetchArgs,
}

/// The flag of the preset.
#[derive(Debug, Args)]
pub struct PresetArgs {
    #[arg(
        long,
        value_name = "P",
        value_parser = one_of::<Preset>(names::all(&Preset::ALL)),
        hide_possible_values = true,
        default_value_t = Preset::default(),
        help_heading = heading::TREE,
        help = "Named recipe of the tree",
        long_help = help_one("Builder, collapse and order by one name", &names::all(&Preset::ALL),
            "Other flags choose one of the three apart.")
    )]
    pub preset: Preset,
}

/// The flag of the builder.
#[derive(Debug, Args)]
pub struct BuilderArgs {
    #[arg(
        long,
        value_name = "B",
        value_parser = row(names::all(&BUILDERS), antumbra_trees::builder),
        hide_possible_values = true,
        help_heading = heading::TREE,
        help = "Builder of the binary tree",
        long_help = help_one("Builder of the binary tree", &names::all(&BUILDERS),
            "Builders that are driven by rays are given the scene's own shadow rays, or surface rays where there are none. \
             If absent: the choice of the preset.")
    )]
    pub builder: Option<Builder>,
}

/// The flag of several collapses.
#[derive(Debug, Args)]
pub struct CollapsesArgs {
    #[arg(
        long = "collapse",
        alias = "collapses",
        value_name = "LIST",
        help_heading = heading::TREE,
        help = "Collapses of the binary tree, or all",
        long_help = help_list("How the binary tree is made wide", &names::all(&COLLAPSES),
            "all is every one. Collapses that learn are given the training rays and surface rays. If absent: the choice of the \
             preset.")
    )]
    pub collapses: Option<Collapses>,
}

impl CollapsesArgs {
    /// The collapses, by default the collapse of a recipe.
    pub fn or(&self, recipe: &Recipe) -> Vec<Collapse> {
        let list = self.collapses.as_ref();
        list.map_or(vec![recipe.collapse], |list| list.0.clone())
    }
}

/// The flag of several widths.
#[derive(Debug, Args)]
pub struct WidthsArgs {
    #[arg(
        long = "width",
        alias = "widths",
        value_name = "LIST",
        default_value = names::AUTO,
        help_heading = heading::TREE,
        help = "Children per node",
        long_help = help_list("Children per node", &names::widths(), "auto is what suits the instruction set.")
    )]
    pub widths: Widths,
}

/// The flag of prefetching.
#[derive(Debug, Args)]
pub struct PrefetchArgs {
    /// Prefetching of nodes: auto, on, off
    ///
    /// Leaves are prefetched, too. auto is on unless the tree fits the first cache of a CPU.
    #[arg(long, value_name = "P", default_value = "auto", help_heading = heading::TREE)]
    pub prefetch: PrefetchChoice,
}

impl TreeArgs {
    /// The recipe for a scene, which may name an order and a width.
    pub fn recipe(&self, scene: &Scene, isa: Isa) -> Recipe {
        let preset = self.preset.preset.recipe();
        let asked = &scene.accelerator;
        // The reader was given the names of all orders, so that there are no others.
        let scenes = asked
            .order
            .as_deref()
            .and_then(|name| antumbra_trees::order(name).ok());
        let width = match self.width {
            Some(choice) => choice.on(isa),
            None => asked
                .width
                .and_then(|width| antumbra::Width::from_lanes(width.into()))
                .unwrap_or(antumbra::Width::auto(isa.level())),
        };
        preset
            .engine(antumbra_trees::engine(isa, width))
            .order(self.order.or(scenes).unwrap_or(preset.order))
            .builder(self.builder.builder.unwrap_or(preset.builder))
            .collapse(self.collapse.unwrap_or(preset.collapse))
            .prefetch(self.prefetch.prefetch.0)
    }
}
