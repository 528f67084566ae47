//! Recipes: presets and choices by name.

use std::ffi::c_char;
use std::fmt::Display;
use std::str::FromStr;

use antumbra::recipe::{Builder, Collapse, CostModel, Engine, Level, Order, Preset, TrainingRays};
use antumbra::{Isa, Recipe, Width};

use crate::arrays::{Slot, Versioned, sized, text};
use crate::interface::functions;
use crate::status::{Failure, Outcome};

/// Number that stands for a choice of the library.
const AUTO: u32 = u32::MAX;

/// Choices of a build, `antumbra_recipe`.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct RecipeChoices {
    pub size: usize,
    pub preset: *const c_char,
    pub builder: *const c_char,
    pub collapse: *const c_char,
    pub order: *const c_char,
    pub level: *const c_char,
    pub width: u32,
    pub training: u32,
    pub surface_rays: u64,
    pub seed: u64,
    pub node_cost: f32,
    pub prim_cost: f32,
    pub entry_cost: f32,
    pub cutout_cost: f32,
    pub prefetch: u32,
    pub reserved: u32,
}

// SAFETY: `repr(C)`, the size first, and then numbers and pointers, which are only used as the header says.
unsafe impl Versioned for RecipeChoices {
    const NAME: &'static str = "antumbra_recipe";
}

/// A choice by name; `None` for null.
///
/// # Safety
/// As [`text`].
unsafe fn named<T: FromStr<Err: Display>>(name: *const c_char, field: &str) -> Outcome<Option<T>> {
    if name.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller's promise.
    let name = unsafe { text(name, field) }?.to_string_lossy();
    name.parse().map(Some).map_err(Failure::argument)
}

/// A cost; `None` for a NaN, which stands for the cost of the preset.
fn cost(cost: f32, name: &str) -> Outcome<Option<f32>> {
    match cost {
        _ if cost.is_nan() => Ok(None),
        0.0..f32::INFINITY => Ok(Some(cost)),
        _ => Err(Failure::argument(format_args!(
            "`recipe->{name}` is {cost}, not a cost"
        ))),
    }
}

/// Fails for a number that no name of an enum stands for.
pub fn unknown(number: u32, name: &str) -> Failure {
    Failure::argument(format_args!(
        "`{name}` is {number}, which stands for nothing"
    ))
}

impl RecipeChoices {
    /// The recipe; null for the default.
    ///
    /// # Safety
    /// If the pointer is not null, it is of a structure as the header says, with names that are null or texts.
    pub unsafe fn recipe(choices: *const Self) -> Outcome<Recipe> {
        if choices.is_null() {
            return Ok(Recipe::default());
        }
        // SAFETY: the caller's promise.
        let choices = unsafe { sized(choices, "recipe") }?;
        // SAFETY: as above.
        let (preset, builder, collapse, order, level) = unsafe {
            (
                named::<Preset>(choices.preset, "preset")?,
                named::<Builder>(choices.builder, "builder")?,
                named::<Collapse>(choices.collapse, "collapse")?,
                named::<Order>(choices.order, "order")?,
                named::<Level>(choices.level, "level")?,
            )
        };
        let mut recipe = preset.unwrap_or_default().recipe();
        recipe.builder = builder.unwrap_or(recipe.builder);
        recipe.collapse = collapse.unwrap_or(recipe.collapse);
        recipe.order = order.unwrap_or(recipe.order);
        if let Some(level) = level {
            recipe = recipe.isa(Isa::new(level).map_err(Failure::argument)?);
        }
        if choices.width != 0 {
            let width = Width::from_lanes(choices.width as usize);
            let width = width.ok_or_else(|| unknown(choices.width, "recipe->width"))?;
            let engine = Engine::new(recipe.engine.isa(), width);
            recipe.engine = engine.map_err(Failure::argument)?;
        }
        match choices.training {
            AUTO => {}
            0 => recipe.training.rays = TrainingRays::Both,
            1 => recipe.training.rays = TrainingRays::Given,
            2 => recipe.training.rays = TrainingRays::Surface,
            other => return Err(unknown(other, "recipe->training")),
        }
        if choices.surface_rays != u64::MAX {
            let count = usize::try_from(choices.surface_rays);
            let count =
                count.map_err(|_| Failure::argument("`recipe->surface_rays` is too large"))?;
            recipe = recipe.surface_rays(Some(count));
        }
        recipe = recipe.seed(choices.seed);
        recipe.costs = choices.costs(recipe.costs)?;
        recipe.prefetch = match choices.prefetch {
            AUTO => recipe.prefetch,
            0 => Some(false),
            1 => Some(true),
            other => return Err(unknown(other, "recipe->prefetch")),
        };
        match choices.reserved {
            0 => Ok(recipe),
            other => Err(unknown(other, "recipe->reserved")),
        }
    }

    fn costs(&self, costs: CostModel) -> Outcome<CostModel> {
        Ok(costs
            .node(cost(self.node_cost, "node_cost")?.unwrap_or(costs.node))
            .prim(cost(self.prim_cost, "prim_cost")?.unwrap_or(costs.prim))
            .entry(cost(self.entry_cost, "entry_cost")?.unwrap_or(costs.entry))
            .cutout(cost(self.cutout_cost, "cutout_cost")?.unwrap_or(costs.cutout)))
    }
}

functions! {
    /// Makes a recipe that leaves all choices to a preset; NULL for "default". Keeps the address of the name.
    ///
    /// Errors: INVALID_ARGUMENT for an unknown name.
    fn antumbra_recipe_init(recipe: Slot<RecipeChoices>, preset: *const c_char) {
        // SAFETY: the header says that `preset` is null or a text.
        unsafe { named::<Preset>(preset, "preset") }?;
        recipe.put(RecipeChoices {
            size: size_of::<RecipeChoices>(),
            preset,
            builder: std::ptr::null(),
            collapse: std::ptr::null(),
            order: std::ptr::null(),
            level: std::ptr::null(),
            width: 0,
            training: AUTO,
            surface_rays: u64::MAX,
            seed: 0,
            node_cost: f32::NAN,
            prim_cost: f32::NAN,
            entry_cost: f32::NAN,
            cutout_cost: f32::NAN,
            prefetch: AUTO,
            reserved: 0,
        });
        Ok(())
    }
}
