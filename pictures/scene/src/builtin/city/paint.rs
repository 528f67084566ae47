//! Materials of the city.

use crate::material::{Matte, Plastic};
use crate::{Material, Rgb};

/// Material by its use. Each is one mesh of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Paint {
    Asphalt,
    Marking,
    Pavement,
    Concrete,
    Limestone,
    Brick,
    Plaster,
    DarkStone,
    Glazing,
    BlueGlazing,
    Roofing,
    Tile,
    Metal,
    Grass,
    Bark,
    Leaf,
    AutumnLeaf,
    Red,
    White,
}

impl Paint {
    pub const ALL: [Self; 19] = [
        Self::Asphalt,
        Self::Marking,
        Self::Pavement,
        Self::Concrete,
        Self::Limestone,
        Self::Brick,
        Self::Plaster,
        Self::DarkStone,
        Self::Glazing,
        Self::BlueGlazing,
        Self::Roofing,
        Self::Tile,
        Self::Metal,
        Self::Grass,
        Self::Bark,
        Self::Leaf,
        Self::AutumnLeaf,
        Self::Red,
        Self::White,
    ];

    /// Material of the scene. Window panes are dark and shiny instead of transparent, since rooms are not modelled.
    pub fn material(self) -> Material {
        match self {
            Self::Asphalt => matte(0.09, 0.09, 0.10),
            Self::Marking => matte(0.62, 0.61, 0.56),
            Self::Pavement => matte(0.36, 0.35, 0.33),
            Self::Concrete => matte(0.50, 0.49, 0.46),
            Self::Limestone => matte(0.62, 0.56, 0.45),
            Self::Brick => matte(0.40, 0.17, 0.12),
            Self::Plaster => matte(0.74, 0.72, 0.68),
            Self::DarkStone => matte(0.20, 0.19, 0.19),
            Self::Glazing => plastic([0.035, 0.045, 0.055], 0.45, 0.03),
            Self::BlueGlazing => plastic([0.05, 0.12, 0.19], 0.55, 0.02),
            Self::Roofing => matte(0.27, 0.26, 0.25),
            Self::Tile => matte(0.45, 0.19, 0.11),
            Self::Metal => plastic([0.33, 0.34, 0.35], 0.35, 0.15),
            Self::Grass => matte(0.13, 0.23, 0.07),
            Self::Bark => matte(0.17, 0.12, 0.08),
            Self::Leaf => matte(0.09, 0.20, 0.06),
            Self::AutumnLeaf => matte(0.30, 0.26, 0.06),
            Self::Red => plastic([0.48, 0.05, 0.04], 0.3, 0.08),
            Self::White => plastic([0.70, 0.70, 0.70], 0.3, 0.08),
        }
    }
}

fn matte(r: f32, g: f32, b: f32) -> Material {
    Material::Matte(Matte {
        kd: Rgb::new(r, g, b).into(),
        sigma: 0.0.into(),
    })
}

fn plastic(kd: [f32; 3], ks: f32, roughness: f32) -> Material {
    Material::Plastic(Plastic {
        kd: Rgb::from(kd).into(),
        ks: Rgb::splat(ks).into(),
        roughness: roughness.into(),
        remap_roughness: true,
    })
}
