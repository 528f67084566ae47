//! Alpha masks: a mesh has no surface where its `alpha` is exactly 0.
//!
//! Most masks are images. Between four texels the value is 0 only if all four are 0. One bit for every such place is
//! therefore enough. A mask of 256 x 256 texels takes 8 KiB, which stay in a cache while rays are traced.

use std::collections::HashMap;
use std::sync::Arc;

use antumbra::cutout::Coverage;
use antumbra_scene::{Geometry, Image, ImageTexture, Param, Pixels, Shape, TriangleMesh, Wrap};
use glam::{IVec2, Vec2, Vec3};

use super::mapping::Mapping;
use super::pyramid::{footprint, size_of, wrapped};
use super::{Input, Place, Textures};
use crate::color::luminance;
use crate::surface::{DEFAULT_UV, corners, vertex_color};

/// Alpha mask of a mesh. Answers are a pure function of the place, with equal bits on every thread.
#[derive(Clone, Debug)]
pub struct AlphaMask {
    mesh: Arc<TriangleMesh>,
    alpha: Input<f32>,
    /// Stencil, if `alpha` is an image laid over the mesh by its own coordinates.
    stencil: Option<LaidStencil>,
}

#[derive(Clone, Debug)]
struct LaidStencil {
    stencil: Arc<Stencil>,
    scale: Vec2,
    offset: Vec2,
    /// Equal for equal images with equal mappings.
    id: u32,
    /// Whether the stencil decides single points exactly, between texels too. If not, it decides only whole areas.
    is_exact: bool,
}

impl AlphaMask {
    /// Mask by `alpha` of this shape or of its shadows. `None` if nothing is cut out. Only meshes have masks, as in
    /// pbrt-v3.
    pub fn new(shape: &Shape, alpha: &Param<f32>, textures: &mut Textures) -> Option<Self> {
        let Geometry::Mesh(mesh) = &shape.geometry else {
            return None;
        };
        if alpha.constant().is_some_and(|&alpha| alpha != 0.0) {
            return None;
        }
        let stencil = match alpha {
            // Without finite coordinates there is no box.
            Param::Texture(texture) if mesh.uvs.iter().all(|uv| uv.is_finite()) => {
                LaidStencil::new(texture, textures)
            }
            Param::Texture(_) | Param::Constant(_) => None,
        };
        Some(Self {
            mesh: Arc::clone(mesh),
            alpha: textures.input(alpha),
            stencil,
        })
    }

    /// Value of `alpha` at the barycentrics of a hit, not filtered.
    ///
    /// # Panics
    /// If the mesh has no such triangle.
    pub fn alpha_at(&self, triangle: u32, u: f32, v: f32) -> f32 {
        let weights = [1.0 - u - v, u, v];
        let place = match &self.alpha {
            Input::Constant(value) => return *value,
            Input::Texture(_) => Place {
                point: blend(corners(&self.mesh, triangle), weights),
                uv: blend(self.uvs(triangle), weights),
                color: vertex_color(&self.mesh, triangle, weights),
                ..Place::default()
            },
        };
        self.alpha.at(&place)
    }

    /// Whether the surface exists at the barycentrics of a hit. Equals `alpha_at(..) != 0.0`, but is quicker.
    ///
    /// # Panics
    /// If the mesh has no such triangle.
    #[inline]
    pub fn is_opaque_at(&self, triangle: u32, u: f32, v: f32) -> bool {
        if let Some(laid) = self.stencil.as_ref().filter(|laid| laid.is_exact) {
            let uv = blend(self.uvs(triangle), [1.0 - u - v, u, v]);
            if let Some(answer) = laid.stencil.is_opaque_at(laid.st(uv)) {
                return answer;
            }
        }
        self.alpha_at(triangle, u, v) != 0.0
    }

    /// Key of the cut-outs of a triangle. Triangles with equal keys, from any mask made with one [`Textures`], have
    /// equal cut-outs. `None` unless the mask is an image laid over the mesh by its own coordinates.
    ///
    /// # Panics
    /// If the mesh has no such triangle.
    pub fn pattern(&self, triangle: u32) -> Option<([Vec2; 3], u32)> {
        let laid = self.stencil.as_ref()?;
        Some((self.uvs(triangle), laid.id))
    }

    #[inline]
    fn uvs(&self, triangle: u32) -> [Vec2; 3] {
        if self.mesh.uvs.is_empty() {
            return DEFAULT_UV;
        }
        self.mesh.indices[triangle as usize].map(|i| self.mesh.uvs[i as usize])
    }
}

#[inline]
fn blend<T: std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>>(
    [a, b, c]: [T; 3],
    [wa, wb, wc]: [f32; 3],
) -> T {
    a * wa + b * wb + c * wc
}

impl LaidStencil {
    fn new(texture: &antumbra_scene::Texture<f32>, textures: &mut Textures) -> Option<Self> {
        let (texture, edge) = match texture {
            antumbra_scene::Texture::Image(texture) => (texture, Edge::Zero),
            antumbra_scene::Texture::AtLeast {
                value: Param::Texture(value),
                least,
            } => match &**value {
                antumbra_scene::Texture::Image(texture) => (texture, Edge::of(*least, texture)?),
                _ => return None,
            },
            _ => return None,
        };
        // A tiny factor may turn a small value into 0, so the value must be computed.
        if !(texture.scale.abs() >= SMALL) {
            return None;
        }
        let Mapping::Uv { scale, offset } = Mapping::new(&texture.mapping) else {
            return None;
        };
        if !scale.is_finite() || !offset.is_finite() {
            return None;
        }
        let key = (Arc::as_ptr(&texture.image), texture.wrap, edge);
        let Stencils { stencils, laid } = &mut textures.stencils;
        let known = stencils.entry(key);
        let made =
            known.or_insert_with(|| Stencil::new(&texture.image, texture.wrap, edge).map(Arc::new));
        let stencil = Arc::clone(made.as_ref()?);
        let numbers = [scale.x, scale.y, offset.x, offset.y].map(f32::to_bits);
        let next = laid.len() as u32;
        let id = *laid.entry((key, numbers)).or_insert(next);
        Some(Self {
            stencil,
            scale,
            offset,
            id,
            is_exact: edge == Edge::Zero,
        })
    }

    #[inline]
    fn st(&self, uv: Vec2) -> Vec2 {
        self.scale * uv + self.offset
    }
}

/// Bound of size: products of two numbers of at least this size are not 0.
const SMALL: f32 = 1e-15;

/// Stencils made so far.
#[derive(Debug, Default)]
pub struct Stencils {
    /// Stencils by image and wrap mode. `None` for images that cannot be a stencil.
    stencils: HashMap<ImageKey, Option<Arc<Stencil>>>,
    /// Ids of laid stencils, by scale and offset of the coordinates.
    laid: HashMap<(ImageKey, [u32; 4]), u32>,
}

type ImageKey = (*const Image, Wrap, Edge);

/// Texels that count as there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Edge {
    /// Texels that are not 0.
    Zero,
    /// Grey bytes from this one on.
    Byte(u8),
}

impl Edge {
    /// Edge at `least` of a texture's values. `None` unless bytes separate the two sides beyond any rounding.
    fn of(least: f32, texture: &ImageTexture) -> Option<Self> {
        let plain = texture.scale == 1.0 && !texture.gamma;
        let grey = matches!(texture.image.pixels, Pixels::Grey8(_));
        let byte = least * 255.0;
        let apart = (byte - byte.floor() - 0.5).abs() < 0.25;
        let known = plain && grey && apart && (0.0..255.0).contains(&byte);
        known.then_some(Self::Byte(byte as u8 + 1))
    }
}

/// Bits that mark where an image, bilinearly interpolated, is 0, or where it is below an [`Edge`].
#[derive(Debug)]
pub struct Stencil {
    size: IVec2,
    wrap: Wrap,
    /// A bit for every place between four texels: whether one of them is not 0. The first place lies left of and
    /// below the first texel.
    places: Bits,
    sums: Sums,
}

impl Stencil {
    /// Stencil of an image. `None` if interpolation could be 0 between texels that are not.
    fn new(image: &Image, wrap: Wrap, edge: Edge) -> Option<Self> {
        let size = size_of(image);
        let values: Vec<bool> = match &image.pixels {
            Pixels::Grey8(pixels) => {
                let least = match edge {
                    Edge::Zero => 1,
                    Edge::Byte(least) => least,
                };
                pixels.iter().map(|&p| p >= least).collect()
            }
            Pixels::Rgb8(pixels) => pixels.iter().map(|&p| p != [0; 3]).collect(),
            Pixels::Rgb32(pixels) => {
                let value = |&p: &[f32; 3]| luminance(Vec3::from(p));
                if !pixels.iter().map(value).all(|v| v == 0.0 || v >= SMALL) {
                    return None;
                }
                pixels.iter().map(|p| value(p) != 0.0).collect()
            }
        };
        let at = |x: i32, y: i32| values[((size.y - 1 - y) * size.x + x) as usize];
        let texels = Bits::new(size, at);
        let there = |s: i32, t: i32| match (wrapped(s, size.x, wrap), wrapped(t, size.y, wrap)) {
            (Some(x), Some(y)) => texels.get(x, y),
            _ => false,
        };
        let places = Bits::new(size + 1, |x, y| {
            let (s, t) = (x - 1, y - 1);
            there(s, t) || there(x, t) || there(s, y) || there(x, y)
        });
        let sums = Sums::new(size, &texels);
        Some(Self {
            size,
            wrap,
            places,
            sums,
        })
    }

    /// Whether the value is not 0. `None` for a point exactly on a line of texels.
    #[inline]
    fn is_opaque_at(&self, st: Vec2) -> Option<bool> {
        let (low, part) = footprint(st, self.size);
        if part.x == 0.0 || part.y == 0.0 {
            return None;
        }
        let place = |low: i32, size: i32| match self.wrap {
            Wrap::Repeat => wrapped(low, size, Wrap::Repeat).map(|low| low + 1),
            Wrap::Clamp => Some(low.clamp(-1, size - 1) + 1),
            Wrap::Black => (-1..size).contains(&low).then_some(low + 1),
        };
        match (place(low.x, self.size.x), place(low.y, self.size.y)) {
            (Some(x), Some(y)) => Some(self.places.get(x, y)),
            _ => Some(false),
        }
    }
}

/// A rectangle of bits.
#[derive(Debug)]
struct Bits {
    width: usize,
    words: Vec<u64>,
}

impl Bits {
    fn new(size: IVec2, bit: impl Fn(i32, i32) -> bool) -> Self {
        let width = size.x as usize;
        let mut words = vec![0; (width * size.y as usize).div_ceil(64)];
        for y in 0..size.y {
            for x in 0..size.x {
                let index = y as usize * width + x as usize;
                words[index / 64] |= u64::from(bit(x, y)) << (index % 64);
            }
        }
        Self { width, words }
    }

    #[inline]
    fn get(&self, x: i32, y: i32) -> bool {
        let index = y as usize * self.width + x as usize;
        self.words[index / 64] >> (index % 64) & 1 == 1
    }
}

impl AlphaMask {
    /// Coverage of the part of a triangle with these barycentric corners, from all texels that can matter to its box
    /// in texture space.
    ///
    /// The answer is never wrong, but often [`Coverage::Mixed`]. Masks other than an image laid over the mesh by its
    /// own coordinates are [`Coverage::Unknown`].
    ///
    /// # Panics
    /// If the mesh has no such triangle.
    pub fn coverage(&self, triangle: u32, corners: &[[f32; 2]; 3]) -> Coverage {
        let Some(laid) = &self.stencil else {
            // A constant that cuts nothing out is no mask.
            return match self.alpha {
                Input::Constant(_) => Coverage::Clear,
                Input::Texture(_) => Coverage::Unknown,
            };
        };
        let Stencil {
            size, wrap, sums, ..
        } = &*laid.stencil;
        let (size, wrap) = (*size, *wrap);
        // Corners in texels. `slack` bounds the rounding of interpolation.
        let uvs = self.uvs(triangle);
        let corners = corners.map(|[u, v]| {
            let uv = blend(uvs, [1.0 - u - v, u, v]);
            laid.st(uv) * size.as_vec2()
        });
        let [a, b, c] = corners;
        let largest = corners.map(|at| at.abs().max_element());
        let uvs = uvs.map(|uv| (laid.scale * uv).abs().max_element());
        let extent = uvs
            .iter()
            .fold(laid.offset.abs().max_element(), |e, uv| e + uv);
        let slack = extent * size.max_element() as f32 * 4e-6 + 1e-4;
        if !(largest.iter().all(|&l| l < FAR) && slack < 1.0) {
            return Coverage::Unknown;
        }
        let low = (a.min(b).min(c) - 0.5 - slack).floor().as_ivec2();
        let high = (a.max(b).max(c) - 0.5 + slack).floor().as_ivec2() + 1;
        let ranges = |low: i32, high: i32, size: i32| match wrap {
            Wrap::Repeat if high - low + 1 >= size => [(0, size), (0, 0)],
            Wrap::Repeat => {
                let first = low.rem_euclid(size);
                let end = first + high - low + 1;
                [(first, end.min(size)), (0, (end - size).max(0))]
            }
            Wrap::Clamp => [
                (low.clamp(0, size - 1), high.clamp(0, size - 1) + 1),
                (0, 0),
            ],
            Wrap::Black => [(low.clamp(0, size), (high + 1).clamp(0, size)), (0, 0)],
        };
        let (mut there, mut seen) = (0, 0);
        for x in ranges(low.x, high.x, size.x) {
            for y in ranges(low.y, high.y, size.y) {
                there += sums.count(x, y);
                seen += (x.1 - x.0) * (y.1 - y.0);
            }
        }
        let inside = low.cmpge(IVec2::ZERO).all() && high.cmplt(size).all();
        match there {
            0 => Coverage::Clear,
            _ if there as i32 == seen && (inside || wrap != Wrap::Black) => Coverage::Opaque,
            _ => Coverage::Mixed,
        }
    }
}

/// Coordinates beyond this number of texels have unknown coverage.
const FAR: f32 = 1e6;

/// Numbers of texels that are not 0, in the rectangles from the first texel: a summed-area table.
#[derive(Debug)]
struct Sums {
    width: usize,
    sums: Vec<u32>,
}

impl Sums {
    fn new(size: IVec2, texels: &Bits) -> Self {
        let width = size.x as usize + 1;
        let mut sums = vec![0; width * (size.y as usize + 1)];
        for y in 0..size.y {
            let mut of_row = 0;
            for x in 0..size.x {
                of_row += u32::from(texels.get(x, y));
                let index = (y as usize + 1) * width + x as usize + 1;
                sums[index] = sums[index - width] + of_row;
            }
        }
        Self { width, sums }
    }

    /// Number of texels that are not 0 in a rectangle, ends excluded.
    fn count(&self, (x0, x1): (i32, i32), (y0, y1): (i32, i32)) -> u32 {
        let sum = |x: i32, y: i32| self.sums[y as usize * self.width + x as usize];
        (sum(x1, y1) + sum(x0, y0)) - (sum(x0, y1) + sum(x1, y0))
    }
}

#[cfg(test)]
mod tests;
