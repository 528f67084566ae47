//! What all lobes have, and the list of lobes.

use std::f32::consts::FRAC_1_PI;
use std::ops::{Deref, DerefMut};

use glam::Vec3;

use super::{
    Blend, Clearcoat, Diffuse, DiffuseTransmission, DisneyBase, Evaluation, Fourier,
    GlossyReflection, GlossyTransmission, Hair, Metallic, cosine_side,
};
use crate::surface::same_hemisphere;

/// One way to spread light over directions.
pub trait Scatter {
    /// Whether the lobe has a value where light is reflected, or where it is transmitted.
    fn is_of(&self, reflects: bool) -> bool {
        reflects
    }

    /// Whether nothing is scattered.
    fn is_black(&self) -> bool;

    /// Multiplies all values.
    fn scale(&mut self, by: Vec3);

    /// Whether the value depends on the tangent as well as on the normal.
    fn is_anisotropic(&self) -> bool {
        false
    }

    /// Index of refraction inside over outside, of a lobe that refracts. Otherwise 1.
    fn eta(&self) -> f32 {
        1.0
    }

    /// Value without the cosine. The caller checks the sides of the directions.
    fn value(&self, wo: Vec3, wi: Vec3) -> Vec3;

    /// Density of [`Self::sample`].
    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if same_hemisphere(wo, wi) {
            wi.z.abs() * FRAC_1_PI
        } else {
            0.0
        }
    }

    /// Value and density.
    #[inline]
    fn evaluate(&self, wo: Vec3, wi: Vec3) -> Evaluation {
        Evaluation {
            value: self.value(wo, wi),
            pdf: self.pdf(wo, wi),
        }
    }

    /// Direction by a choice in `[0, 1)` and a place. By default, in proportion to the cosine on the side of `wo`. `None` if
    /// the draw fails.
    fn sample(&self, wo: Vec3, _choice: f32, u: [f32; 2]) -> Option<Vec3> {
        Some(cosine_side(wo, u))
    }
}

macro_rules! lobes {
    ($($Lobe:ident,)*) => {
        /// One of the lobes that spread light.
        #[derive(Clone, Debug)]
        pub enum Lobe {
            $(#[doc = concat!("See [`", stringify!($Lobe), "`].")] $Lobe($Lobe),)*
        }

        $(impl From<$Lobe> for Lobe {
            fn from(lobe: $Lobe) -> Self {
                Self::$Lobe(lobe)
            }
        })*

        impl Deref for Lobe {
            type Target = dyn Scatter;

            #[inline]
            fn deref(&self) -> &Self::Target {
                match self {
                    $(Self::$Lobe(lobe) => lobe,)*
                }
            }
        }

        impl DerefMut for Lobe {
            fn deref_mut(&mut self) -> &mut Self::Target {
                match self {
                    $(Self::$Lobe(lobe) => lobe,)*
                }
            }
        }
    };
}

lobes! {
    Diffuse,
    DiffuseTransmission,
    GlossyReflection,
    GlossyTransmission,
    Blend,
    Metallic,
    DisneyBase,
    Clearcoat,
    Fourier,
    Hair,
}
