//! Scenes made by a program: no file, the same bits on every machine.
//!
//! - [`city`]: blocks of towers seen from the air; the demonstration and a bench

mod city;

pub use city::city;

use crate::Scene;

/// A built-in scene: its name after `builtin:` and its generator.
#[derive(Clone, Copy)]
pub struct Builtin {
    /// The name without the `builtin:` prefix.
    pub name: &'static str,
    /// Makes the scene.
    pub generate: fn() -> Scene,
}

/// Every built-in scene.
pub const ALL: &[Builtin] = &[Builtin {
    name: "city",
    generate: || city(DEFAULT_CITY_TRIANGLES),
}];

/// Triangles that `builtin:city` has at least.
pub const DEFAULT_CITY_TRIANGLES: usize = 500_000;

/// The built-in scene of this name (without `builtin:`), or `None`.
pub fn by_name(name: &str) -> Option<Scene> {
    ALL.iter()
        .find(|builtin| builtin.name == name)
        .map(|builtin| (builtin.generate)())
}
