//! Emitting shapes: points chosen by area, or by solid angle on a sphere.

use std::f32::consts::PI;

use antumbra_scene::{AreaLight, Geometry, Shape, Sphere, TriangleMesh};
use glam::{DVec3, Vec3};

use super::sphere::{cone, sample_sphere};
use super::{End, LightSample, Receiver};
use crate::sampler::warp::triangle;
use crate::surface::{Plane, Surface, Vertices, corners, interpolate, triangle_normals};
use crate::texture::Textures;
use emission::Emission;

mod emission;

/// Number of elements among which one is counted, not searched.
const FEW: usize = 8;

/// An emitting shape.
#[derive(Clone, Debug)]
pub struct Emitter {
    shape: Shape,
    light: AreaLight,
    surface: EmitterSurface,
    area: f32,
    /// Emission that varies over a mesh.
    emission: Option<Box<Emission>>,
}

#[derive(Clone, Debug)]
enum EmitterSurface {
    Mesh {
        triangles: Vec<Triangle>,
        /// Cumulative areas of the triangles, in double precision. With a texture, areas times mean luminance.
        cumulative: Vec<f64>,
        /// All but the last of them, if they are few. Infinity fills up.
        ends: [f64; FEW],
    },
    Sphere(Sphere),
}

/// A flat triangle of one radiance, and a place on it.
pub(super) struct AreaDraw<'a> {
    /// Positions of its vertices.
    pub corners: &'a [Vec3; 3],
    /// Unit geometric normal.
    pub normal: Vec3,
    /// Radiance on the sides that emit.
    pub radiance: Vec3,
    /// Whether both sides emit.
    pub two_sided: bool,
    /// Inverse of the density of samples on the triangle: the area of all that may be sampled.
    pub area: f32,
    /// See [`stretch`], which makes of it the first coordinate of the place on the triangle.
    pub into: [f64; 2],
}

/// A triangle prepared for sampling, since lights are sampled at every point.
#[derive(Clone, Debug)]
struct Triangle {
    vertices: Vertices,
    plane: Vec3,
    /// Geometric normal, if constant.
    normal: Option<Vec3>,
    /// Cumulative area before the triangle, and its own.
    span: [f64; 2],
}

impl Triangle {
    fn new(shape: &Shape, mesh: &TriangleMesh, index: usize, cumulative: &[f64]) -> Self {
        let vertices = Vertices::new(mesh, mesh.indices[index]);
        let plane = Plane::new(vertices.corners).normal;
        let is_flat = mesh.normals.is_empty();
        let start = before(cumulative, index);
        Self {
            vertices,
            plane,
            normal: is_flat.then(|| triangle_normals(shape, &vertices, plane, [1.0, 0.0, 0.0]).0),
            span: [start, cumulative[index] - start],
        }
    }
}

impl Emitter {
    /// Emitter of a shape. `None` if the shape emits nothing, or has no area (NaN vertices included).
    ///
    /// A texture that is black everywhere emits nothing.
    pub fn new(shape: &Shape, textures: &mut Textures) -> Option<Self> {
        let light = shape.area_light.clone()?;
        let mut emission = None;
        let (surface, area) = match &shape.geometry {
            Geometry::Mesh(mesh) => {
                let mut sum = 0.0;
                let mut cumulative: Vec<f64> = (0..mesh.indices.len())
                    .map(|i| {
                        sum += triangle_area(mesh, i);
                        sum
                    })
                    .collect();
                if let Some(texture) = &light.texture {
                    let found = Emission::new(mesh, textures.input(texture), &mut cumulative)?;
                    emission = Some(Box::new(found));
                }
                let triangles = (0..mesh.indices.len())
                    .map(|index| Triangle::new(shape, mesh, index, &cumulative))
                    .collect();
                let mut ends = [f64::INFINITY; FEW];
                if let Some((_, sums)) = cumulative.split_last()
                    && sums.len() < FEW
                {
                    ends[..sums.len()].copy_from_slice(sums);
                }
                let surface = EmitterSurface::Mesh {
                    triangles,
                    cumulative,
                    ends,
                };
                (surface, sum as f32)
            }
            Geometry::Sphere(sphere) => {
                let area = 4.0 * PI * sphere.radius * sphere.radius;
                (EmitterSurface::Sphere(*sphere), area)
            }
            // Refused before.
            Geometry::Curves(_) => return None,
        };
        (area > 0.0 && area.is_finite()).then(|| Self {
            shape: shape.clone(),
            light,
            surface,
            area,
            emission,
        })
    }

    /// Radiance emitted by a point of this emitter towards where the ray came from.
    #[inline]
    pub fn radiance_of(&self, surface: &Surface) -> Vec3 {
        let radiance = self.radiance(surface.normal, surface.wo);
        match &self.emission {
            Some(emission) if radiance != Vec3::ZERO => {
                radiance * emission.at_point(surface.primitive, surface.point)
            }
            _ => radiance,
        }
    }

    /// Emitted radiance towards `w` from a point with geometric normal `normal`, without the texture.
    #[inline]
    fn radiance(&self, normal: Vec3, w: Vec3) -> Vec3 {
        if self.light.two_sided || normal.dot(w) > 0.0 {
            self.light.radiance
        } else {
            Vec3::ZERO
        }
    }

    /// Radiance times area times sides: the power over π.
    pub fn strength(&self) -> Vec3 {
        let sides = if self.light.two_sided { 2.0 } else { 1.0 };
        let mean = self.emission.as_ref().map_or(Vec3::ONE, |e| e.mean());
        self.light.radiance * mean * (self.area * sides)
    }

    /// Centre and radius of a ball around the shape.
    pub fn ball(&self) -> (Vec3, f32) {
        match &self.surface {
            EmitterSurface::Sphere(sphere) => (sphere.center, sphere.radius),
            EmitterSurface::Mesh { triangles, .. } => {
                let used = || {
                    let corners = triangles.iter().flat_map(|found| found.vertices.corners);
                    corners.filter(|p| p.is_finite())
                };
                let low = used().fold(Vec3::INFINITY, Vec3::min);
                let high = used().fold(Vec3::NEG_INFINITY, Vec3::max);
                ((low + high) * 0.5, (high - low).length() * 0.5)
            }
        }
    }

    /// Number of triangles. 1 for a sphere.
    pub fn elements(&self) -> usize {
        match &self.surface {
            EmitterSurface::Mesh { cumulative, .. } => cumulative.len(),
            EmitterSurface::Sphere(_) => 1,
        }
    }

    /// Samples of each element, for a strategy that samples every light.
    pub fn samples(&self) -> u32 {
        self.light.samples.max(1)
    }

    fn element_area(&self, element: usize) -> f32 {
        if let Some(emission) = &self.emission {
            return emission.area(element);
        }
        match &self.surface {
            EmitterSurface::Mesh { cumulative, .. } => {
                (cumulative[element] - before(cumulative, element)) as f32
            }
            EmitterSurface::Sphere(_) => self.area,
        }
    }

    /// Sample of the whole shape, see [`Light::sample`](super::Light::sample).
    #[inline]
    pub fn sample(&self, at: &Receiver, u: [f32; 2]) -> Option<LightSample> {
        let (element, u) = self.choose(u);
        self.sample_by_area(at, element, self.effective_area(element), u)
    }

    /// Element of [`Self::sample`] and the place on it. `None` unless the shape is a flat mesh of one radiance.
    #[inline]
    pub(super) fn draw(&self, u: [f32; 2]) -> Option<AreaDraw<'_>> {
        let (element, into) = self.locate(u[0])?;
        Some(AreaDraw {
            area: self.area,
            into,
            ..self.draw_element(element)?
        })
    }

    /// An element that [`Self::sample_element`] samples. `None` unless the shape is a flat mesh of one radiance.
    #[inline]
    pub(super) fn draw_element(&self, element: usize) -> Option<AreaDraw<'_>> {
        let EmitterSurface::Mesh { triangles, .. } = &self.surface else {
            return None;
        };
        if self.emission.is_some() {
            return None;
        }
        let triangle = &triangles[element];
        triangle.normal.map(|normal| AreaDraw {
            corners: &triangle.vertices.corners,
            normal,
            radiance: self.light.radiance,
            two_sided: self.light.two_sided,
            area: self.element_area(element),
            into: [0.0, 1.0],
        })
    }

    /// Sample of one element only.
    pub fn sample_element(
        &self,
        at: &Receiver,
        element: usize,
        u: [f32; 2],
    ) -> Option<LightSample> {
        self.sample_by_area(at, element, self.element_area(element), u)
    }

    /// Inverse of the density of [`Self::sample`] on an element: the whole area, unless a texture weighs elements.
    #[inline]
    fn effective_area(&self, element: usize) -> f32 {
        match (&self.emission, &self.surface) {
            (Some(emission), EmitterSurface::Mesh { cumulative, .. }) => {
                let weight = cumulative[element] - before(cumulative, element);
                let all = cumulative[cumulative.len() - 1];
                (f64::from(emission.area(element)) * all / weight) as f32
            }
            _ => self.area,
        }
    }

    /// Element in proportion to its area, and `u` stretched to be used again.
    #[inline]
    fn choose(&self, u: [f32; 2]) -> (usize, [f32; 2]) {
        match self.locate(u[0]) {
            Some((element, into)) => (element, [stretch(into), u[1]]),
            None => (0, u),
        }
    }

    /// Element in proportion to its area by `u` in `[0, 1)`, how far `u` reaches into it, and its size. `None` for a
    /// sphere.
    #[inline(always)]
    fn locate(&self, u: f32) -> Option<(usize, [f64; 2])> {
        let EmitterSurface::Mesh {
            triangles,
            cumulative,
            ends,
        } = &self.surface
        else {
            return None;
        };
        let last = cumulative.len() - 1;
        let target = f64::from(u) * cumulative[last];
        let element = if last < FEW {
            // Counted without a branch, which nobody could predict.
            ends.iter().map(|&end| usize::from(end <= target)).sum()
        } else {
            cumulative.partition_point(|&sum| sum <= target).min(last)
        };
        let [start, size] = triangles[element].span;
        Some((element, [target - start, size]))
    }

    /// Sample of a point of `element`, of density 1 / `area` on the surface.
    fn sample_by_area(
        &self,
        at: &Receiver,
        element: usize,
        area: f32,
        u: [f32; 2],
    ) -> Option<LightSample> {
        let mut factor = Vec3::ONE;
        let (point, error, normal, cone_pdf) = match &self.surface {
            EmitterSurface::Mesh { triangles, .. } => {
                let Triangle {
                    vertices,
                    plane,
                    normal,
                    ..
                } = &triangles[element];
                let [w0, w1] = triangle(u);
                let weights = [w0, w1, 1.0 - w0 - w1];
                if let Some(emission) = &self.emission {
                    factor = emission.at(element as u32, weights);
                }
                let (point, error) = interpolate(vertices.corners, weights);
                let normal = normal
                    .unwrap_or_else(|| triangle_normals(&self.shape, vertices, *plane, weights).0);
                (point, error, normal, None)
            }
            EmitterSurface::Sphere(sphere) => {
                let (outward, cone_pdf) = sample_sphere(sphere, at.point, u);
                let offset = outward * sphere.radius;
                let error = (offset.abs() + sphere.center.abs()) * (8.0 * f32::EPSILON);
                let normal = if self.shape.reverse_orientation {
                    -outward
                } else {
                    outward
                };
                (sphere.center + offset, error, normal, cone_pdf)
            }
        };
        let to_light = point - at.point;
        let wi = to_light.try_normalize()?;
        let radiance = self.radiance(normal, -wi) * factor;
        let pdf = cone_pdf.unwrap_or_else(|| solid_angle_pdf(to_light, normal, area));
        (pdf > 0.0 && pdf.is_finite() && radiance != Vec3::ZERO).then_some(LightSample {
            wi,
            radiance,
            pdf,
            is_delta: false,
            end: End::Surface {
                point,
                error,
                normal,
            },
        })
    }

    /// Density per solid angle of the direction to `hit`, a point of this emitter, in
    /// [`Light::sample`](super::Light::sample). 0 where no sample points.
    pub fn pdf(&self, at: &Receiver, hit: &Surface) -> f32 {
        self.hit_pdf(at, hit, self.effective_area(hit.primitive as usize))
    }

    /// Density per solid angle of the direction to `hit` in
    /// [`Light::sample_element`](super::Light::sample_element) of the element that was hit.
    pub fn element_pdf(&self, at: &Receiver, hit: &Surface) -> f32 {
        self.hit_pdf(at, hit, self.element_area(hit.primitive as usize))
    }

    fn hit_pdf(&self, at: &Receiver, hit: &Surface, area: f32) -> f32 {
        let cone = match &self.surface {
            EmitterSurface::Sphere(sphere) => cone(sphere, at.point),
            EmitterSurface::Mesh { .. } => None,
        };
        let pdf = match cone {
            Some(cone) => cone.pdf(),
            None => solid_angle_pdf(hit.point - at.point, hit.normal, area),
        };
        if pdf.is_finite() { pdf } else { 0.0 }
    }
}

/// Share of an element's size that a random value reaches into it: a value in `[0, 1)` to be used again.
#[inline]
pub(super) fn stretch([into, size]: [f64; 2]) -> f32 {
    // Rounding to f32 could reach 1.
    ((into / size) as f32).clamp(0.0, 1.0 - f32::EPSILON)
}

/// Sum of the areas of all elements before `element`.
#[inline]
fn before(cumulative: &[f64], element: usize) -> f64 {
    if element == 0 {
        0.0
    } else {
        cumulative[element - 1]
    }
}

/// Density per solid angle of density 1 / `area` on a surface, seen along `to_light`.
#[inline]
pub(super) fn solid_angle_pdf(to_light: Vec3, normal: Vec3, area: f32) -> f32 {
    let squared = to_light.length_squared();
    squared * squared.sqrt() / (normal.dot(to_light).abs() * area)
}

/// Area of a triangle. 0 if a vertex is NaN or infinite.
fn triangle_area(mesh: &TriangleMesh, triangle: usize) -> f64 {
    let [p0, p1, p2] = corners(mesh, triangle as u32).map(DVec3::from);
    let area = (p1 - p0).cross(p2 - p0).length() * 0.5;
    if area.is_finite() { area } else { 0.0 }
}
