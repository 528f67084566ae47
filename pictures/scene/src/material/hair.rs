//! Material `hair`.

use serde::Serialize;

use super::{Authored, Limit, Map, Slots, material, number};

material! {
    /// Hair (Chiang, Bitterli, Tappan and Burley 2016), for curves: the texture coordinate v goes from 0 to 1 across it.
    Hair, read {
        /// Absorption inside.
        pigment: Inside<Pigment>,
        /// Index of refraction.
        eta: Number = number(&["eta"], 1.55, Limit::Index),
        /// Roughness along the hair and around it, 0..=1.
        roughness: Pair = [&["beta_m"], &["beta_n"]].map(|name| number(name, 0.3, Limit::SHARE)),
        /// Tilt of the scales in degrees.
        tilt: Number = number(&["alpha"], 2.0, Limit::None),
    }
}

/// Absorption inside of a [`Hair`].
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(bound = "S::Color: Serialize, S::Number: Serialize")]
pub enum Pigment<S: Slots = Authored> {
    /// Absorption coefficient per radius of the hair.
    Absorption(S::Color),
    /// Colour of many hairs together.
    Color(S::Color),
    /// Concentrations of eumelanin and pheomelanin.
    Melanin([S::Number; 2]),
}

impl Default for Pigment {
    /// Brown hair.
    fn default() -> Self {
        Self::Melanin([1.3, 0.0].map(Into::into))
    }
}

impl<S: Slots> Pigment<S> {
    pub(super) fn map<'a, T: Slots>(&'a self, with: &mut impl Map<'a, S, T>) -> Pigment<T> {
        match self {
            Self::Absorption(value) => Pigment::Absorption(with.kind(0).color(value)),
            Self::Color(value) => Pigment::Color(with.kind(1).color(value)),
            Self::Melanin(values) => {
                with.kind(2);
                Pigment::Melanin(values.each_ref().map(|value| with.number(value)))
            }
        }
    }
}
