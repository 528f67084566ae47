//! Textures: values of a material's parameters at a point of a surface.
//!
//! - [`Input`]: a parameter, constant or a [`Texture`]
//! - [`Place`]: the point, and the footprint of a pixel around it
//! - [`Textures`]: lowers the textures of a scene, and shares pyramids of shared images
//! - `mapping.rs`: from the surface to texture coordinates
//! - `pyramid.rs`: images, filtered over the footprint of a pixel
//! - `checkerboard.rs`: squares and cubes;  `noise.rs`: noise, and dots
//! - `check.rs`: textures and materials that are refused
//! - `cutouts.rs`, `alpha.rs`: alpha masks, which cut out parts of a surface
//!
//! Values equal the values of pbrt-v3, except where a file names a deviation.

mod alpha;
mod check;
mod checkerboard;
mod cutouts;
mod mapping;
mod noise;
mod pyramid;

use std::collections::HashMap;
use std::ops::{Add, Mul};
use std::sync::Arc;

use antumbra_scene::{Image, ImageTexture, NoisePattern, Param, TextureFilter, Wrap};
use glam::{Mat4, Vec2, Vec3};

pub use check::check;
use checkerboard::{cube_is_second, share_of_second, square_is_second};
pub use cutouts::Cutouts;
use mapping::Mapping;
use noise::Footprint;
use pyramid::Pyramid;

/// Point at which a texture is evaluated, with the steps to the neighbouring samples of the picture. Unknown steps
/// are 0.
#[derive(Clone, Copy, Debug, Default)]
pub struct Place {
    /// Position in the world.
    pub point: Vec3,
    /// Change of the position from one sample of the picture to the next, along x and y of the picture.
    pub point_steps: [Vec3; 2],
    /// The surface's own coordinates.
    pub uv: Vec2,
    /// Change of the coordinates from one sample to the next, along x and y of the picture.
    pub uv_steps: [Vec2; 2],
    /// Colour of the mesh's vertices at the point. `None` is white.
    pub color: Option<Vec3>,
}

/// Value of a texture: a number or a colour.
pub trait Value:
    Copy
    + std::fmt::Debug
    + Send
    + Sync
    + Add<Output = Self>
    + Mul<Output = Self>
    + Mul<f32, Output = Self>
    + 'static
{
    /// Value with equal channels.
    fn grey(value: f32) -> Self;

    /// Value of a colour: the colour itself, or its luminance.
    fn of(color: Vec3) -> Self;

    /// Red, green and blue.
    fn channels(self) -> [f32; 3];

    /// Applies a function to every channel.
    fn each(self, f: impl Fn(f32) -> f32) -> Self;

    /// Whether the type holds colours as they are.
    const IS_COLOR: bool;

    /// Pyramids of this type.
    fn pyramids(textures: &mut Textures) -> &mut Pyramids<Self>;
}

impl Value for f32 {
    fn grey(value: f32) -> Self {
        value
    }

    fn of(color: Vec3) -> Self {
        crate::color::luminance(color)
    }

    fn channels(self) -> [f32; 3] {
        [self; 3]
    }

    fn each(self, f: impl Fn(f32) -> f32) -> Self {
        f(self)
    }

    const IS_COLOR: bool = false;

    fn pyramids(textures: &mut Textures) -> &mut Pyramids<Self> {
        &mut textures.numbers
    }
}

impl Value for Vec3 {
    fn grey(value: f32) -> Self {
        Vec3::splat(value)
    }

    fn of(color: Vec3) -> Self {
        color
    }

    fn channels(self) -> [f32; 3] {
        self.to_array()
    }

    fn each(self, f: impl Fn(f32) -> f32) -> Self {
        Vec3::new(f(self.x), f(self.y), f(self.z))
    }

    const IS_COLOR: bool = true;

    fn pyramids(textures: &mut Textures) -> &mut Pyramids<Self> {
        &mut textures.colors
    }
}

/// A parameter of a material.
#[derive(Clone, Debug)]
pub enum Input<T> {
    /// One value for all points.
    Constant(T),
    /// A value for every point.
    Texture(Box<Texture<T>>),
}

impl<T: PartialEq> PartialEq for Input<T> {
    /// Whether both are the same constant. Two textures count as different.
    fn eq(&self, other: &Self) -> bool {
        matches!((self, other), (Self::Constant(a), Self::Constant(b)) if a == b)
    }
}

impl<T: Value> Input<T> {
    /// Value at a place.
    #[inline]
    pub fn at(&self, place: &Place) -> T {
        match self {
            Self::Constant(value) => *value,
            Self::Texture(texture) => texture.at(place),
        }
    }
}

/// A value that varies over surfaces.
#[derive(Clone, Debug)]
pub enum Texture<T> {
    /// Product.
    Scale([Input<T>; 2]),
    /// `1 - amount` times the first plus `amount` times the second.
    Mix([Input<T>; 2], Input<f32>),
    /// Two values in unit squares.
    Checkerboard {
        squares: [Input<T>; 2],
        mapping: Mapping,
        smooth: bool,
    },
    /// Two values in unit cubes.
    Checkerboard3 {
        cubes: [Input<T>; 2],
        texture_from_world: Mat4,
    },
    /// Values at (0, 0), (0, 1), (1, 0) and (1, 1), interpolated.
    Bilerp { corners: [T; 4], mapping: Mapping },
    /// Values outside and inside of dots.
    Dots {
        dots: [Input<T>; 2],
        mapping: Mapping,
    },
    /// Texture coordinates as a colour.
    Uv(Mapping),
    /// Value made of noise.
    Noise {
        pattern: NoisePattern,
        texture_from_world: Mat4,
    },
    /// Lookup in an image.
    Image {
        pyramid: Arc<Pyramid<T>>,
        mapping: Mapping,
        filter: TextureFilter,
        scale: f32,
    },
    /// Colour of the mesh's vertices.
    VertexColor,
    /// 1 where the value is at least a number, 0 elsewhere.
    AtLeast(Input<f32>, f32),
    /// Square root of a value, or 0 below 0.
    Root(Input<f32>),
    /// 1 with the value as its probability, 0 elsewhere.
    Dither(Input<f32>),
}

/// Fraction in [0, 1) by the bits of a position.
fn fraction(point: Vec3) -> f32 {
    let mut hash = 0x9e37_79b9_u32;
    for part in point.to_array() {
        // Finalizer of MurmurHash3 (Appleby 2011) after every coordinate.
        hash ^= part.to_bits();
        hash = (hash ^ (hash >> 16)).wrapping_mul(0x85eb_ca6b);
        hash = (hash ^ (hash >> 13)).wrapping_mul(0xc2b2_ae35);
        hash ^= hash >> 16;
    }
    (hash >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

/// Value between the values at the corners of the unit square.
fn bilinear<T: Value>(corners: &[T; 4], Vec2 { x: s, y: t }: Vec2) -> T {
    corners[0] * ((1.0 - s) * (1.0 - t))
        + corners[1] * ((1.0 - s) * t)
        + corners[2] * (s * (1.0 - t))
        + corners[3] * (s * t)
}

fn noisy<T: Value>(pattern: &NoisePattern, at: &Footprint) -> T {
    match *pattern {
        NoisePattern::Fbm(octaves) => T::grey(noise::fbm(at, octaves)),
        NoisePattern::Wrinkled(octaves) => T::grey(noise::turbulence(at, octaves)),
        NoisePattern::Windy => T::grey(noise::windy(at)),
        NoisePattern::Marble {
            octaves,
            scale,
            variation,
        } => T::of(noise::marble(&at.scaled(scale), octaves, variation)),
    }
}

impl<T: Value> Texture<T> {
    /// Value at a place.
    pub fn at(&self, place: &Place) -> T {
        let choose = |two: &[Input<T>; 2], second: bool| two[usize::from(second)].at(place);
        let mix = |two: &[Input<T>; 2], share: f32| {
            two[0].at(place) * (1.0 - share) + two[1].at(place) * share
        };
        match self {
            Self::Scale([a, b]) => a.at(place) * b.at(place),
            Self::Mix(ends, amount) => mix(ends, amount.at(place)),
            Self::Checkerboard {
                squares,
                mapping,
                smooth: false,
            } => choose(squares, square_is_second(mapping.at(place).st)),
            Self::Checkerboard {
                squares,
                mapping,
                smooth: true,
            } => match share_of_second(&mapping.at(place)) {
                0.0 => squares[0].at(place),
                1.0 => squares[1].at(place),
                share => mix(squares, share),
            },
            Self::Checkerboard3 {
                cubes,
                texture_from_world,
            } => choose(
                cubes,
                cube_is_second(texture_from_world.project_point3(place.point)),
            ),
            Self::Bilerp { corners, mapping } => bilinear(corners, mapping.at(place).st),
            Self::Dots { dots, mapping } => choose(dots, noise::is_in_dot(mapping.at(place).st)),
            Self::Uv(mapping) => {
                let st = mapping.at(place).st;
                T::of((st - st.floor()).extend(0.0))
            }
            Self::Noise {
                pattern,
                texture_from_world: matrix,
            } => {
                let at = Footprint {
                    point: matrix.project_point3(place.point),
                    steps: (place.point_steps).map(|step| matrix.transform_vector3(step)),
                };
                noisy(pattern, &at)
            }
            Self::Image {
                pyramid,
                mapping,
                filter,
                scale,
            } => pyramid.lookup(&mapping.at(place), *filter) * *scale,
            Self::VertexColor => place.color.map_or(T::grey(1.0), T::of),
            Self::AtLeast(value, least) => {
                T::grey(if value.at(place) >= *least { 1.0 } else { 0.0 })
            }
            Self::Root(value) => T::grey(value.at(place).max(0.0).sqrt()),
            Self::Dither(value) => {
                let solid = fraction(place.point) < value.at(place);
                T::grey(if solid { 1.0 } else { 0.0 })
            }
        }
    }
}

/// Pyramids by image, wrap mode and gamma.
type Pyramids<T> = HashMap<(*const Image, Wrap, bool), Arc<Pyramid<T>>>;

/// Lowers the textures of one scene.
///
/// Images are distinguished by their address, so the scene must outlive this value.
#[derive(Debug, Default)]
pub struct Textures {
    numbers: Pyramids<f32>,
    colors: Pyramids<Vec3>,
    stencils: alpha::Stencils,
}

impl Textures {
    /// Lowers a parameter.
    pub fn input<T: Value>(&mut self, param: &Param<T>) -> Input<T> {
        match param {
            Param::Constant(value) => Input::Constant(*value),
            Param::Texture(texture) => Input::Texture(Box::new(self.texture(texture))),
        }
    }

    fn texture<T: Value>(&mut self, texture: &antumbra_scene::Texture<T>) -> Texture<T> {
        use antumbra_scene::Texture as Scene;
        match texture {
            Scene::Scale(factors) => Texture::Scale(self.two(factors)),
            Scene::Mix { ends, amount } => Texture::Mix(self.two(ends), self.input(amount)),
            Scene::Checkerboard {
                squares,
                mapping,
                smooth,
            } => Texture::Checkerboard {
                squares: self.two(squares),
                mapping: Mapping::new(mapping),
                smooth: *smooth,
            },
            Scene::Checkerboard3 {
                cubes,
                texture_from_world,
            } => Texture::Checkerboard3 {
                cubes: self.two(cubes),
                texture_from_world: texture_from_world.as_mat4(),
            },
            Scene::Bilerp { corners, mapping } => Texture::Bilerp {
                corners: *corners,
                mapping: Mapping::new(mapping),
            },
            Scene::Dots { dots, mapping } => Texture::Dots {
                dots: self.two(dots),
                mapping: Mapping::new(mapping),
            },
            Scene::Uv(mapping) => Texture::Uv(Mapping::new(mapping)),
            Scene::Noise {
                pattern,
                texture_from_world,
            } => Texture::Noise {
                pattern: *pattern,
                texture_from_world: texture_from_world.as_mat4(),
            },
            Scene::Image(image) => Texture::Image {
                pyramid: self.pyramid(image),
                mapping: Mapping::new(&image.mapping),
                filter: image.filter,
                scale: image.scale,
            },
            Scene::VertexColor => Texture::VertexColor,
            Scene::AtLeast { value, least } => Texture::AtLeast(self.input(value), *least),
            Scene::Root(value) => Texture::Root(self.input(value)),
            Scene::Dither(value) => Texture::Dither(self.input(value)),
        }
    }

    fn two<T: Value>(&mut self, [a, b]: &[Param<T>; 2]) -> [Input<T>; 2] {
        [self.input(a), self.input(b)]
    }

    fn pyramid<T: Value>(&mut self, texture: &ImageTexture) -> Arc<Pyramid<T>> {
        let ImageTexture {
            image, wrap, gamma, ..
        } = texture;
        let key = (Arc::as_ptr(image), *wrap, *gamma);
        let known = T::pyramids(self).entry(key);
        let made = known.or_insert_with(|| Arc::new(Pyramid::new(image, *wrap, *gamma)));
        Arc::clone(made)
    }
}

#[cfg(test)]
mod tests;
