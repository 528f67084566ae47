//! Textures: values that vary over surfaces, and the images some of them are made of. Parameters and their
//! meaning are those of pbrt-v3.

use std::fmt;
use std::sync::Arc;

use glam::{DMat4, Vec2, Vec3};
use serde::Serialize;

/// A parameter of a material: the same everywhere, or from a texture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Param<T> {
    /// The same everywhere.
    Constant(T),
    /// Depends on the point of the surface.
    Texture(Arc<Texture<T>>),
}

impl<T> Param<T> {
    /// The value, if it is the same everywhere.
    pub fn constant(&self) -> Option<&T> {
        match self {
            Self::Constant(value) => Some(value),
            Self::Texture(_) => None,
        }
    }
}

impl<T> From<T> for Param<T> {
    fn from(value: T) -> Self {
        Self::Constant(value)
    }
}

/// A value that varies over surfaces: `T` is `f32` or [`Rgb`](crate::Rgb).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Texture<T> {
    /// The product of two.
    Scale([Param<T>; 2]),
    /// The first times `1 - amount`, plus the second times `amount`.
    Mix {
        /// What is mixed.
        ends: [Param<T>; 2],
        /// Share of the second; not clamped.
        amount: Param<f32>,
    },
    /// Two values in squares of side 1 in texture coordinates, the first where the sum of their whole parts is
    /// even.
    Checkerboard {
        /// The two values.
        squares: [Param<T>; 2],
        /// Where in texture space a point is.
        mapping: Mapping,
        /// Whether edges are smoothed over the filter's width ("closedform") or not ("none").
        smooth: bool,
    },
    /// The same in cubes of side 1.
    Checkerboard3 {
        /// The two values.
        cubes: [Param<T>; 2],
        /// World space to where the cubes are. From .pbrt files it is the current transformation itself, not
        /// its inverse: so pbrt-v3 has it.
        texture_from_world: DMat4,
    },
    /// Bilinear between the corners of the unit square of texture coordinates.
    Bilerp {
        /// Values at (0, 0), (0, 1), (1, 0) and (1, 1).
        corners: [T; 4],
        /// Where in texture space a point is.
        mapping: Mapping,
    },
    /// Looked up in an image.
    Image(ImageTexture),
}

/// A lookup in an image. A single number is the luminance of its colour.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImageTexture {
    /// What is looked up in. Textures of the same file share it.
    pub image: Arc<Image>,
    /// Where in texture space a point is; (0, 0) is the lower left corner of the image, (1, 1) the upper right.
    pub mapping: Mapping,
    /// What lies outside the unit square.
    pub wrap: Wrap,
    /// How texels are averaged.
    pub filter: TextureFilter,
    /// Whether values are sRGB-encoded and are made linear before use.
    pub gamma: bool,
    /// Factor of all values, applied after `gamma`.
    pub scale: f32,
}

/// How texels are averaged over the part of the texture that a pixel sees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub enum TextureFilter {
    /// Over squares, between two levels of the pyramid.
    Trilinear,
    /// Over ellipses (Heckbert 1989).
    Ewa {
        /// Longest axis over the shortest; the shortest is widened beyond that.
        max_anisotropy: f32,
    },
}

/// What lies outside the unit square of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub enum Wrap {
    /// The image again.
    Repeat,
    /// Zero.
    Black,
    /// Its edge.
    Clamp,
}

/// From a point of a surface to texture coordinates (s, t).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub enum Mapping {
    /// `scale * (u, v) + offset` of the surface's own coordinates.
    Uv {
        /// Factors of u and v.
        scale: Vec2,
        /// Added afterwards.
        offset: Vec2,
    },
    /// The direction from the origin of the texture's space: (polar angle over pi, azimuth over 2 pi).
    Spherical {
        /// World space to the space of the texture.
        texture_from_world: DMat4,
    },
    /// The direction from the origin of the texture's space: (azimuth over 2 pi plus 1/2, its z), the azimuth
    /// from -pi to pi.
    Cylindrical {
        /// World space to the space of the texture.
        texture_from_world: DMat4,
    },
    /// `(dot(p, axes[0]), dot(p, axes[1])) + offset`, p in world space as in pbrt-v3.
    Planar {
        /// Directions of s and t.
        axes: [Vec3; 2],
        /// Added afterwards.
        offset: Vec2,
    },
}

impl Default for Mapping {
    fn default() -> Self {
        Self::Uv {
            scale: Vec2::ONE,
            offset: Vec2::ZERO,
        }
    }
}

/// An image as it was read: rows from top to bottom, linear or as encoded, see [`ImageTexture::gamma`].
#[derive(Clone, PartialEq, Serialize)]
pub struct Image {
    /// The file's name, for messages.
    pub name: String,
    /// Pixels per row, positive.
    pub width: u32,
    /// Number of rows, positive.
    pub height: u32,
    /// Row by row.
    pub pixels: Pixels,
}

/// Values of an image, `width * height` of them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Pixels {
    /// One number from 0 to 255, standing for 0 to 1.
    Grey8(#[serde(serialize_with = "crate::raw")] Vec<u8>),
    /// Red, green, blue, from 0 to 255, standing for 0 to 1.
    Rgb8(#[serde(serialize_with = "crate::raw")] Vec<[u8; 3]>),
    /// Red, green, blue.
    Rgb32(#[serde(serialize_with = "crate::raw")] Vec<[f32; 3]>),
}

impl Pixels {
    /// The bytes they take.
    pub fn bytes(&self) -> u64 {
        let bytes = match self {
            Self::Grey8(values) => size_of_val(&values[..]),
            Self::Rgb8(values) => size_of_val(&values[..]),
            Self::Rgb32(values) => size_of_val(&values[..]),
        };
        bytes as u64
    }
}

/// Without the pixels, which nobody wants to read.
impl fmt::Debug for Image {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Image")
            .field("name", &self.name)
            .field("width", &self.width)
            .field("height", &self.height)
            .finish_non_exhaustive()
    }
}
