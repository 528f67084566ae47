//! Textures: values that vary over surfaces, and the images that some of them look up.
//!
//! Parameters have the meaning of pbrt-v3.

use std::fmt;
use std::sync::Arc;

use glam::{DMat4, Vec2, Vec3};
use serde::Serialize;

/// Parameter of a material: a constant or a texture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Param<T> {
    /// Value that is equal everywhere.
    Constant(T),
    /// Value that depends on the point of the surface.
    Texture(Arc<Texture<T>>),
}

impl<T> Param<T> {
    /// Value of a constant; `None` for a texture.
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

/// Value that varies over surfaces: `T` is `f32` or [`Rgb`](crate::Rgb).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Texture<T> {
    /// Product of two parameters.
    Scale([Param<T>; 2]),
    /// Linear interpolation: the first times `1 - amount`, plus the second times `amount`.
    Mix {
        /// First and second parameter.
        ends: [Param<T>; 2],
        /// Share of the second parameter; not clamped.
        amount: Param<f32>,
    },
    /// Two values in squares of side 1 in texture coordinates. The first is where the sum of the floors of s and t is
    /// even.
    Checkerboard {
        /// First and second value.
        squares: [Param<T>; 2],
        /// Map from surface points to texture coordinates.
        mapping: Mapping,
        /// True if edges are smoothed over the filter's width ("closedform"), false if not ("none").
        smooth: bool,
    },
    /// Two values in cubes of side 1. The first is where the sum of the floors of x, y and z is even.
    Checkerboard3 {
        /// First and second value.
        cubes: [Param<T>; 2],
        /// World space to the space of the cubes. The reader of .pbrt files stores the current transformation
        /// itself, not its inverse, as pbrt-v3 does.
        texture_from_world: DMat4,
    },
    /// Bilinear interpolation between the corners of the unit square of texture coordinates.
    Bilerp {
        /// Values at (0, 0), (0, 1), (1, 0) and (1, 1).
        corners: [T; 4],
        /// Map from surface points to texture coordinates.
        mapping: Mapping,
    },
    /// Two values in round dots, some of them missing, one per square of side 1 in texture coordinates.
    Dots {
        /// Values outside and inside.
        dots: [Param<T>; 2],
        /// Map from surface points to texture coordinates.
        mapping: Mapping,
    },
    /// The fractions of s and t as red and green.
    Uv(Mapping),
    /// Value made of noise in space.
    Noise {
        /// How it is made.
        pattern: NoisePattern,
        /// World space to the space of the noise. The reader of .pbrt files stores the current transformation
        /// itself, not its inverse, as pbrt-v3 does.
        texture_from_world: DMat4,
    },
    /// Lookup in an image.
    Image(ImageTexture),
    /// Colour of the mesh's vertices, interpolated. White on a mesh without colours and on spheres.
    VertexColor,
    /// 1 where the value is at least `least`, and 0 elsewhere: a hard edge for an alpha mask.
    AtLeast {
        /// Value that is compared with `least`.
        value: Param<f32>,
        /// Smallest value that counts as 1.
        least: f32,
    },
    /// Square root of the value; 0 where the value is negative.
    Root(Param<f32>),
    /// 1 with the value as its probability, and 0 elsewhere. The decision depends only on the bits of the position.
    ///
    /// As an alpha mask, the texture makes a surface as transparent as 1 minus the value, for all rays alike.
    Dither(Param<f32>),
}

/// Pattern that is made of noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub enum NoisePattern {
    /// Sum of octaves: fractional Brownian motion ("fbm").
    Fbm(Octaves),
    /// Sum of the magnitudes of octaves: turbulence ("wrinkled").
    Wrinkled(Octaves),
    /// Waves on water ("windy").
    Windy,
    /// Colours of marble in layers across y ("marble").
    Marble {
        /// Noise by which the layers are moved.
        octaves: Octaves,
        /// Factor of the position.
        scale: f32,
        /// Factor of the noise.
        variation: f32,
    },
}

/// Number of octaves of noise, and their amplitudes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Octaves {
    /// Most octaves. Those that a pixel cannot show are left out.
    pub count: u32,
    /// Amplitude of an octave over the amplitude of the octave below.
    pub roughness: f32,
}

/// Lookup in an image. Textures of numbers return the luminance of the image's colour.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImageTexture {
    /// Image, shared by all textures of one file.
    pub image: Arc<Image>,
    /// Map from surface points to texture coordinates: (0, 0) is the lower left corner of the image, (1, 1) the upper
    /// right.
    pub mapping: Mapping,
    /// Value outside the unit square.
    pub wrap: Wrap,
    /// Average over texels.
    pub filter: TextureFilter,
    /// True if values are sRGB-encoded and are made linear before use.
    pub gamma: bool,
    /// Factor of all values, applied after decoding sRGB.
    pub scale: f32,
}

/// Average of texels over the part of a texture that a pixel sees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub enum TextureFilter {
    /// Average over squares, interpolated between two levels of the pyramid.
    Trilinear,
    /// Elliptically weighted average (Heckbert 1989).
    Ewa {
        /// Largest ratio of the ellipse's axes. More eccentric ellipses get a longer minor axis.
        max_anisotropy: f32,
    },
}

/// Value outside the unit square of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize)]
pub enum Wrap {
    /// The image repeats.
    #[default]
    Repeat,
    /// The value is 0.
    Black,
    /// The edge of the image continues.
    Clamp,
}

/// Map from a point of a surface to texture coordinates (s, t).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub enum Mapping {
    /// `scale * (u, v) + offset` of the surface's own coordinates.
    Uv {
        /// Factors of u and v.
        scale: Vec2,
        /// Offset, added after scaling.
        offset: Vec2,
    },
    /// `u * columns[0] + v * columns[1] + offset` of the surface's own coordinates.
    Affine {
        /// Images of (1, 0) and (0, 1), without the offset.
        columns: [Vec2; 2],
        /// Image of (0, 0).
        offset: Vec2,
    },
    /// Direction from the origin of the texture's space: (polar angle over π, azimuth over 2 π).
    Spherical {
        /// World space to the space of the texture.
        texture_from_world: DMat4,
    },
    /// Direction from the origin of the texture's space: (azimuth over 2 π plus 1/2, its z), with the azimuth from
    /// -π to π.
    Cylindrical {
        /// World space to the space of the texture.
        texture_from_world: DMat4,
    },
    /// `(dot(p, axes[0]), dot(p, axes[1])) + offset`, with p in world space as in pbrt-v3.
    Planar {
        /// Directions of s and t.
        axes: [Vec3; 2],
        /// Offset, added to the products.
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

/// Image as read from a file: rows from top to bottom, linear or encoded (see [`ImageTexture::gamma`]).
#[derive(Clone, PartialEq, Serialize)]
pub struct Image {
    /// Name of the file, for messages.
    pub name: String,
    /// Pixels per row, positive.
    pub width: u32,
    /// Number of rows, positive.
    pub height: u32,
    /// Values, row by row.
    pub pixels: Pixels,
}

/// Values of an image, `[height, width]` or `[height, width, 3]`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Pixels {
    /// One number per pixel from 0 to 255, meaning 0 to 1.
    Grey8(#[serde(serialize_with = "crate::raw")] Vec<u8>),
    /// Red, green and blue from 0 to 255, meaning 0 to 1.
    Rgb8(#[serde(serialize_with = "crate::raw")] Vec<[u8; 3]>),
    /// Red, green and blue, unbounded.
    Rgb32(#[serde(serialize_with = "crate::raw")] Vec<[f32; 3]>),
}

impl Pixels {
    /// Size of the values in bytes.
    pub fn bytes(&self) -> u64 {
        let bytes = match self {
            Self::Grey8(values) => size_of_val(&values[..]),
            Self::Rgb8(values) => size_of_val(&values[..]),
            Self::Rgb32(values) => size_of_val(&values[..]),
        };
        bytes as u64
    }
}

/// Prints name and size only: the pixels are too many.
impl fmt::Debug for Image {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Image")
            .field("name", &self.name)
            .field("width", &self.width)
            .field("height", &self.height)
            .finish_non_exhaustive()
    }
}
