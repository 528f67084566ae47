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
    /// Triangles it has at least, unless told otherwise.
    pub triangles: usize,
    /// Makes the scene of at least so many triangles.
    pub generate: fn(usize) -> Scene,
}

/// Every built-in scene.
pub const ALL: &[Builtin] = &[Builtin {
    name: "city",
    triangles: 500_000,
    generate: city,
}];

/// The most triangles that [`by_name`] makes.
pub const MAX_TRIANGLES: usize = 100_000_000;

/// The built-in scene of this name (without `builtin:`), or of this name, a colon and a number of triangles
/// from 1 to [`MAX_TRIANGLES`], such as `city:1000000`. `None` for anything else.
pub fn by_name(text: &str) -> Option<Scene> {
    let (name, triangles) = match text.split_once(':') {
        Some((name, number)) => (name, Some(number.parse().ok()?)),
        None => (text, None),
    };
    let builtin = ALL.iter().find(|builtin| builtin.name == name)?;
    let triangles = triangles.unwrap_or(builtin.triangles);
    (1..=MAX_TRIANGLES).contains(&triangles).then(|| {
        let mut scene = (builtin.generate)(triangles);
        scene.name = text.replace(':', "-");
        scene
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_may_say_how_many_triangles() {
        let small = by_name("city:2000").expect("a city");
        assert!((2000..20_000).contains(&small.triangle_count()));
        assert_eq!(small.name, "city-2000");
        for bad in [
            "",
            "town",
            "city:",
            "city:0",
            "city:many",
            "city:1e6",
            "city:200000000",
        ] {
            assert!(by_name(bad).is_none(), "{bad}");
        }
    }
}
