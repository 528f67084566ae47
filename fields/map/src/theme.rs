//! Colours of everything but the values.

use crate::drawing::Colour;

/// Colours of paper and text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Theme {
    /// Dark text on white, for print.
    #[default]
    Light,
    /// Light text on a dark ground, for slides.
    Dark,
}

impl Theme {
    pub(crate) fn paper(self) -> Colour {
        match self {
            Self::Light => [255, 255, 255],
            Self::Dark => [22, 24, 29],
        }
    }

    pub(crate) fn text(self) -> Colour {
        match self {
            Self::Light => [28, 30, 34],
            Self::Dark => [236, 237, 240],
        }
    }

    pub(crate) fn soft(self) -> Colour {
        match self {
            Self::Light => [95, 99, 107],
            Self::Dark => [163, 168, 178],
        }
    }

    /// Colour of a surface without a value, at full brightness.
    pub(crate) fn surface(self) -> [f32; 3] {
        match self {
            Self::Light => [244.0, 244.0, 246.0],
            Self::Dark => [112.0, 115.0, 122.0],
        }
    }
}
