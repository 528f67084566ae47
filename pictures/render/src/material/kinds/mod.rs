//! Parameters of materials as the renderer has them: lowered once, and turned into a [`Bsdf`] where they are evaluated.

mod coated;
mod disney;
mod fourier;
mod glass;
mod hair;
mod matte;
mod metal;
mod metallic;
mod mirror;
mod plastic;
mod substrate;
mod subsurface;
mod translucent;
mod uber;

use std::sync::Arc;

use antumbra_scene::material::{Authored, Map, Slots};
use antumbra_scene::{FourierTable, Material, Param, Rgb};
use glam::Vec3;

use super::bsdf::Bsdf;
use crate::texture::{Input, Place, Textures, Value};

/// Parameters that are lowered: constants, or textures with their images.
#[derive(Clone, Debug, PartialEq)]
pub struct Lowered;

impl Slots for Lowered {
    type Color = Input<Rgb>;
    type Number = Input<f32>;
    type Table = Arc<FourierTable>;
}

/// Parameters at one place.
#[derive(Clone, Debug, PartialEq)]
pub struct Here;

impl Slots for Here {
    type Color = Vec3;
    type Number = f32;
    type Table = Arc<FourierTable>;
}

/// A kind of material that scatters light.
trait Shade {
    /// Lobes at a place. Negative colours count as 0, as in pbrt.
    fn bsdf(self, place: &Place) -> Bsdf;
}

/// A colour without negative parts.
fn positive(color: Vec3) -> Vec3 {
    color.max(Vec3::ZERO)
}

/// Lowers parameters, and remembers whether one of them varies.
pub struct Lowering<'a> {
    pub textures: &'a mut Textures,
    /// Whether a parameter so far varies.
    pub varies: bool,
}

impl Lowering<'_> {
    fn input<T: Value>(&mut self, param: &Param<T>) -> Input<T> {
        self.varies |= param.constant().is_none();
        self.textures.input(param)
    }
}

impl<'a> Map<'a, Authored, Lowered> for Lowering<'_> {
    fn color(&mut self, color: &'a Param<Rgb>) -> Input<Rgb> {
        self.input(color)
    }

    fn number(&mut self, number: &'a Param<f32>) -> Input<f32> {
        self.input(number)
    }

    fn table(&mut self, table: &'a Arc<FourierTable>) -> Arc<FourierTable> {
        Arc::clone(table)
    }

    fn material(&mut self, material: &'a Material) -> Material<Lowered> {
        // By the texture coordinate across the hair.
        self.varies |= matches!(material, Material::Hair(_));
        material.map(self)
    }
}

impl<'a> Map<'a, Lowered, Here> for &Place {
    fn color(&mut self, color: &'a Input<Rgb>) -> Vec3 {
        color.at(self)
    }

    fn number(&mut self, number: &'a Input<f32>) -> f32 {
        number.at(self)
    }

    fn table(&mut self, table: &'a Arc<FourierTable>) -> Arc<FourierTable> {
        Arc::clone(table)
    }
}

/// How a material scatters at a place. Bump maps and normal maps have no effect here.
pub fn bsdf(material: &Material<Lowered>, mut place: &Place) -> Bsdf {
    match material {
        Material::Mix(mix) => {
            let first = positive(mix.amount.at(place));
            let shares = [first, positive(Vec3::ONE - first)];
            let parts = mix.materials.iter().zip(shares);
            parts.fold(Bsdf::black(), |sum, (part, share)| {
                sum.with_scaled(bsdf(part, place), share)
            })
        }
        Material::Bumped(bumped) => bsdf(&bumped.material, place),
        Material::NormalMapped(mapped) => bsdf(&mapped.material, place),
        other => shade(other.map(&mut place), place),
    }
}

macro_rules! shade {
    ($($Kind:ident),*) => {
        fn shade(material: Material<Here>, place: &Place) -> Bsdf {
            match material {
                $(Material::$Kind(material) => material.bsdf(place),)*
                Material::None | Material::Mix(_) | Material::Bumped(_) | Material::NormalMapped(_) => Bsdf::black(),
            }
        }
    };
}

shade!(
    Matte,
    Plastic,
    Mirror,
    Glass,
    Metal,
    Uber,
    Substrate,
    Metallic,
    Disney,
    CoatedDiffuse,
    CoatedConductor,
    ThinDielectric,
    Translucent,
    Subsurface,
    Hair,
    Fourier
);
