//! Materials: how surfaces scatter light. Parameters have the meaning of pbrt-v3.
//!
//! Each kind has a file with its fields, and its parameters and defaults in pbrt-v3 where they are plain. From these follow
//! readers ([`Material::read`]), lists of names and parts, and renderers' own forms ([`Material::map`]).

mod bumped;
mod coated_conductor;
mod coated_diffuse;
mod disney;
mod fourier;
mod glass;
mod hair;
mod kind;
mod matte;
mod metal;
mod metallic;
mod mirror;
mod mix;
mod plastic;
mod read;
mod substrate;
mod subsurface;
mod thin_dielectric;
mod translucent;
mod uber;

use std::fmt::Debug;
use std::sync::Arc;

use serde::Serialize;

use crate::{FourierTable, Param, Rgb};
pub use bumped::{Bumped, NormalMapped};
pub use coated_conductor::CoatedConductor;
pub use coated_diffuse::CoatedDiffuse;
pub use disney::{Disney, DisneyBody};
pub use fourier::Fourier;
pub use glass::Glass;
pub use hair::{Hair, Pigment};
use kind::material;
pub use matte::Matte;
pub use metal::Metal;
pub use metallic::Metallic;
pub use mirror::Mirror;
pub use mix::Mix;
pub use plastic::Plastic;
use read::{INDEX, REMAP, color, number, rough, spectrum};
pub use read::{Limit, Reader, Source};
pub use substrate::Substrate;
pub use subsurface::{Interior, Subsurface};
pub use thin_dielectric::ThinDielectric;
pub use translucent::Translucent;
pub use uber::Uber;

/// What the parameters of a material are: [as a scene has them](Authored), or as a renderer needs them.
pub trait Slots: Clone + Debug + PartialEq {
    /// Parameter with colours.
    type Color: Clone + Debug + PartialEq;
    /// Parameter with numbers.
    type Number: Clone + Debug + PartialEq;
    /// Table of scattering.
    type Table: Clone + Debug + PartialEq;
}

/// Parameters of a scene: constants or textures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Authored;

impl Slots for Authored {
    type Color = Param<Rgb>;
    type Number = Param<f32>;
    type Table = Arc<FourierTable>;
}

/// Makes other parameters of the parameters of a material, in the order of its fields.
pub trait Map<'a, S: Slots, T: Slots>: Sized {
    /// Makes a parameter with colours.
    fn color(&mut self, color: &'a S::Color) -> T::Color;
    /// Makes a parameter with numbers.
    fn number(&mut self, number: &'a S::Number) -> T::Number;
    /// Makes a table of scattering.
    fn table(&mut self, table: &'a S::Table) -> T::Table;
    /// Makes a material of the one inside of a [`Mix`], [`Bumped`] or [`NormalMapped`].
    fn material(&mut self, material: &'a Material<S>) -> Material<T> {
        material.map(self)
    }
    /// Sees a number that is equal everywhere; a switch is 0 or 1.
    fn setting(&mut self, setting: f32) -> f32 {
        setting
    }
    /// Sees which of several ways to describe a material is taken.
    fn kind(&mut self, kind: u8) -> &mut Self {
        self.setting(kind.into());
        self
    }
}

/// Part of a material.
#[derive(Clone, Copy, Debug)]
pub enum MaterialPart<'a> {
    /// Parameter with colours.
    Color(&'a Param<Rgb>),
    /// Parameter with numbers.
    Number(&'a Param<f32>),
    /// Number that is equal everywhere; a switch is 0 or 1.
    Setting(f32),
    /// Table of scattering.
    Table(&'a Arc<FourierTable>),
    /// Material inside.
    Material(&'a Material),
}

/// Lists the kinds of materials: the family that counts of materials name, and `read` where [`Reader`]s read the kind.
macro_rules! materials {
    ($($Kind:ident $family:literal $($read:ident)?,)*) => {
        /// Material of a surface: how it scatters light.
        ///
        /// Roughness is mapped to a microfacet alpha where `remap_roughness` is true.
        #[derive(Clone, Debug, PartialEq, Serialize)]
        #[serde(bound = "S::Color: Serialize, S::Number: Serialize, S::Table: Serialize")]
        pub enum Material<S: Slots = Authored> {
            /// No surface: paths continue straight through. Shadow rays are blocked nevertheless, as in pbrt-v3.
            None,
            $(#[doc = concat!("See [`", stringify!($Kind), "`].")] $Kind($Kind<S>),)*
        }

        $(impl<S: Slots> From<$Kind<S>> for Material<S> {
            fn from(material: $Kind<S>) -> Self {
                Self::$Kind(material)
            }
        })*

        impl<S: Slots> Material<S> {
            /// Family of the kind, a word for people: both coated kinds are "coated".
            pub fn family(&self) -> &'static str {
                match self {
                    Self::None => "none",
                    $(Self::$Kind(_) => $family,)*
                }
            }

            /// The same material with other parameters.
            pub fn map<'a, T: Slots>(&'a self, with: &mut impl Map<'a, S, T>) -> Material<T> {
                match self {
                    Self::None => Material::None,
                    $(Self::$Kind(material) => Material::$Kind(material.map(with)),)*
                }
            }
        }

        impl Material {
            /// All families, the most usual first.
            pub fn families() -> Vec<&'static str> {
                let mut families = vec![$($family),*];
                families.dedup();
                families
            }

            /// Kinds that [`Self::read`] knows.
            pub const READ: &'static [&'static str] = &[$($(materials!(@ $read $family),)?)*];

            /// Reads the parameters of a kind of [`Self::READ`]; `None` for other names.
            pub fn read(kind: &str, reader: &mut impl Reader) -> Option<Self> {
                match kind {
                    $($($family => Some($Kind::$read(reader).into()),)?)*
                    _ => None,
                }
            }
        }
    };
    (@ read $family:literal) => { $family };
}

materials! {
    Matte "matte" read,
    Plastic "plastic" read,
    Mirror "mirror" read,
    Glass "glass" read,
    ThinDielectric "glass",
    Metal "metal" read,
    Uber "uber" read,
    Substrate "substrate" read,
    Translucent "translucent" read,
    Fourier "fourier",
    Hair "hair" read,
    Disney "disney" read,
    CoatedDiffuse "coated",
    CoatedConductor "coated",
    Subsurface "subsurface",
    Mix "mix",
    Metallic "metallic",
    Bumped "none",
    NormalMapped "none",
}

impl Material {
    /// All parts of the material in the order of its fields, except the parts of materials inside.
    pub fn parts(&self) -> Vec<MaterialPart<'_>> {
        let mut parts = Parts(Vec::new());
        let _ = self.map(&mut parts);
        parts.0
    }
}

/// Parameters that hold nothing.
#[derive(Clone, Debug, PartialEq)]
struct Nothing;

impl Slots for Nothing {
    type Color = ();
    type Number = ();
    type Table = ();
}

struct Parts<'a>(Vec<MaterialPart<'a>>);

impl<'a> Map<'a, Authored, Nothing> for Parts<'a> {
    fn color(&mut self, color: &'a Param<Rgb>) {
        self.0.push(MaterialPart::Color(color));
    }

    fn number(&mut self, number: &'a Param<f32>) {
        self.0.push(MaterialPart::Number(number));
    }

    fn material(&mut self, material: &'a Material) -> Material<Nothing> {
        self.0.push(MaterialPart::Material(material));
        Material::None
    }

    fn setting(&mut self, setting: f32) -> f32 {
        self.0.push(MaterialPart::Setting(setting));
        setting
    }

    fn table(&mut self, table: &'a Arc<FourierTable>) {
        self.0.push(MaterialPart::Table(table));
    }
}
