//! Lights: what arrives from one of them at a point, and with which density a sample of it is chosen.

use std::f32::consts::PI;
use std::sync::Arc;

use antumbra::Ray;
use antumbra_scene::{AreaLight, Geometry, Shape, Sphere, TriangleMesh};
use glam::{DVec3, Vec3};

use crate::frame::{
    Frame, around_z, cosine_hemisphere, triangle, uniform_hemisphere, uniform_sphere,
};
use crate::surface::{Surface, Vertices, corners, interpolate, plane_normal, triangle_normals};

/// A light of the scene, ready to be sampled.
#[derive(Clone, Debug)]
pub enum Light {
    /// A light without extent or infinitely far away.
    Plain(antumbra_scene::Light),
    /// An emitting shape: a whole mesh is one light, chosen from by area.
    Area(Emitter),
}

/// An emitting shape.
#[derive(Clone, Debug)]
pub struct Emitter {
    shape: Shape,
    light: AreaLight,
    surface: EmitterSurface,
    area: f32,
}

#[derive(Clone, Debug)]
enum EmitterSurface {
    Mesh {
        mesh: Arc<TriangleMesh>,
        /// Areas of triangles 0..=i added up, in double precision.
        cumulative: Vec<f64>,
        /// Their plane normals.
        planes: Vec<Vec3>,
    },
    Sphere(Sphere),
}

/// The point that asks for light.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Where it is.
    pub point: Vec3,
    /// Unit geometric normal on the side of the viewer.
    pub normal: Vec3,
    /// Whether light from the other side matters too.
    pub both_sides: bool,
}

/// A direction from which light may arrive.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit direction from the receiver to the light.
    pub wi: Vec3,
    /// Radiance that arrives if nothing is in between.
    pub radiance: Vec3,
    /// Density per solid angle; 1 for a delta light.
    pub pdf: f32,
    /// Whether no other technique can find this direction.
    pub is_delta: bool,
    end: End,
}

#[derive(Clone, Copy, Debug)]
enum End {
    Infinity,
    Point(Vec3),
    Surface {
        point: Vec3,
        error: Vec3,
        normal: Vec3,
    },
}

impl LightSample {
    /// The shadow ray from the receiver's surface.
    #[inline]
    pub fn shadow_ray(&self, from: &Surface) -> Ray {
        match self.end {
            End::Infinity => from.ray_along(self.wi),
            End::Point(point) => from.ray_to(point),
            End::Surface {
                point,
                error,
                normal,
            } => from.ray_to_surface(point, error, normal),
        }
    }
}

impl Light {
    /// Radiance that a ray which leaves the scene brings from this light.
    #[inline]
    pub fn escaped_radiance(&self) -> Vec3 {
        match self {
            Self::Plain(antumbra_scene::Light::Infinite { radiance, .. }) => *radiance,
            _ => Vec3::ZERO,
        }
    }

    /// Whether only light samples can find it, since no ray ever meets it.
    #[inline]
    pub fn is_delta(&self) -> bool {
        !matches!(
            self,
            Self::Area(_) | Self::Plain(antumbra_scene::Light::Infinite { .. })
        )
    }

    /// Number of lights that pbrt-v3 would count: one per triangle of an emitting mesh.
    pub fn elements(&self) -> usize {
        match self {
            Self::Area(emitter) => emitter.elements(),
            Self::Plain(_) => 1,
        }
    }

    /// Samples that a strategy which asks every light takes of each element.
    pub fn samples(&self) -> u32 {
        match self {
            Self::Area(emitter) => emitter.light.samples.max(1),
            Self::Plain(antumbra_scene::Light::Infinite { samples, .. }) => (*samples).max(1),
            Self::Plain(_) => 1,
        }
    }

    /// A sample of the light for `u` in `[0, 1)²`. `None` where none arrives: behind the emitter, outside the
    /// cone of a spot.
    pub fn sample(&self, at: &Receiver, u: [f32; 2]) -> Option<LightSample> {
        match self {
            Self::Plain(light) => sample_plain(light, at, u),
            Self::Area(emitter) => {
                let (element, u) = emitter.choose(u);
                emitter.sample(at, element, emitter.area, u)
            }
        }
    }

    /// A sample of one element alone, with the density of that choice.
    pub fn sample_element(
        &self,
        at: &Receiver,
        element: usize,
        u: [f32; 2],
    ) -> Option<LightSample> {
        match self {
            Self::Plain(light) => sample_plain(light, at, u),
            Self::Area(emitter) => emitter.sample(at, element, emitter.element_area(element), u),
        }
    }

    /// Density with which [`Self::sample`] chooses the direction `wi` along which a ray leaves the scene.
    pub fn escaped_pdf(&self, at: &Receiver, wi: Vec3) -> f32 {
        match self {
            Self::Plain(antumbra_scene::Light::Infinite { .. }) => sky_pdf(at, wi),
            _ => 0.0,
        }
    }
}

impl Emitter {
    /// The emitter of a shape, or `None` if the shape is none or has no area (NaN vertices included).
    pub fn new(shape: &Shape) -> Option<Self> {
        let light = shape.area_light?;
        let (surface, area) = match &shape.geometry {
            Geometry::Mesh(mesh) => {
                let mut sum = 0.0;
                let cumulative: Vec<f64> = (0..mesh.indices.len())
                    .map(|i| {
                        sum += triangle_area(mesh, i);
                        sum
                    })
                    .collect();
                let planes = (0..mesh.indices.len())
                    .map(|i| plane_normal(corners(mesh, i as u32)))
                    .collect();
                let surface = EmitterSurface::Mesh {
                    mesh: Arc::clone(mesh),
                    cumulative,
                    planes,
                };
                (surface, sum as f32)
            }
            Geometry::Sphere(sphere) => {
                let area = 4.0 * PI * sphere.radius * sphere.radius;
                (EmitterSurface::Sphere(*sphere), area)
            }
        };
        (area > 0.0 && area.is_finite()).then(|| Self {
            shape: shape.clone(),
            light,
            surface,
            area,
        })
    }

    /// Emitted radiance towards `w` from a point with geometric normal `normal`.
    #[inline]
    pub fn radiance(&self, normal: Vec3, w: Vec3) -> Vec3 {
        if self.light.two_sided || normal.dot(w) > 0.0 {
            self.light.radiance
        } else {
            Vec3::ZERO
        }
    }

    /// Radiance times area times sides: what the emitter amounts to, up to a factor π.
    pub fn strength(&self) -> Vec3 {
        let sides = if self.light.two_sided { 2.0 } else { 1.0 };
        self.light.radiance * (self.area * sides)
    }

    /// Centre and radius of a ball around it.
    pub fn ball(&self) -> (Vec3, f32) {
        match &self.surface {
            EmitterSurface::Sphere(sphere) => (sphere.center, sphere.radius),
            EmitterSurface::Mesh { mesh, .. } => {
                let used = || {
                    (0..mesh.indices.len())
                        .flat_map(|i| corners(mesh, i as u32))
                        .filter(|p| p.is_finite())
                };
                let low = used().fold(Vec3::INFINITY, Vec3::min);
                let high = used().fold(Vec3::NEG_INFINITY, Vec3::max);
                ((low + high) * 0.5, (high - low).length() * 0.5)
            }
        }
    }

    fn elements(&self) -> usize {
        match &self.surface {
            EmitterSurface::Mesh { cumulative, .. } => cumulative.len(),
            EmitterSurface::Sphere(_) => 1,
        }
    }

    fn element_area(&self, element: usize) -> f32 {
        match &self.surface {
            EmitterSurface::Mesh { mesh, .. } => triangle_area(mesh, element) as f32,
            EmitterSurface::Sphere(_) => self.area,
        }
    }

    /// An element in proportion to its area; `u` is stretched so that it can be used again.
    #[inline]
    fn choose(&self, u: [f32; 2]) -> (usize, [f32; 2]) {
        let EmitterSurface::Mesh { cumulative, .. } = &self.surface else {
            return (0, u);
        };
        let last = cumulative.len() - 1;
        let target = f64::from(u[0]) * cumulative[last];
        let element = cumulative.partition_point(|&sum| sum <= target).min(last);
        let start = if element == 0 {
            0.0
        } else {
            cumulative[element - 1]
        };
        let inside = (target - start) / (cumulative[element] - start);
        // Rounding to f32 may reach 1.
        (
            element,
            [(inside as f32).clamp(0.0, 1.0 - f32::EPSILON), u[1]],
        )
    }

    /// A point of `element`, taken with density 1 / `area` on the surface.
    fn sample(&self, at: &Receiver, element: usize, area: f32, u: [f32; 2]) -> Option<LightSample> {
        let (point, error, normal, cone_pdf) = match &self.surface {
            EmitterSurface::Mesh { mesh, planes, .. } => {
                let [w0, w1] = triangle(u);
                let weights = [w0, w1, 1.0 - w0 - w1];
                let vertices = Vertices::new(mesh, mesh.indices[element]);
                let (point, error) = interpolate(vertices.corners, weights);
                let plane = planes[element];
                let (normal, _) = triangle_normals(&self.shape, &vertices, plane, weights);
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
        let radiance = self.radiance(normal, -wi);
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

    /// Density per solid angle with which [`Light::sample`] chooses the direction to `hit`, a point of this
    /// emitter; 0 where it never would.
    pub fn pdf(&self, at: &Receiver, hit: &Surface) -> f32 {
        self.hit_pdf(at, hit, self.area)
    }

    /// The same for [`Light::sample_element`] and the element that was hit.
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

/// Density 1 / `area` on a surface, seen along `to_light`, per solid angle.
#[inline]
fn solid_angle_pdf(to_light: Vec3, normal: Vec3, area: f32) -> f32 {
    let squared = to_light.length_squared();
    squared * squared.sqrt() / (normal.dot(to_light).abs() * area)
}

/// 0 for a triangle with a NaN or infinite vertex.
fn triangle_area(mesh: &TriangleMesh, triangle: usize) -> f64 {
    let [p0, p1, p2] = corners(mesh, triangle as u32).map(DVec3::from);
    let area = (p1 - p0).cross(p2 - p0).length() * 0.5;
    if area.is_finite() { area } else { 0.0 }
}

/// The cone of directions that a sphere fills.
struct Cone {
    /// 1 - cosine of its half-angle, computed without cancellation.
    height: f32,
}

impl Cone {
    fn pdf(&self) -> f32 {
        1.0 / (2.0 * PI * self.height)
    }
}

/// `None` from inside the sphere or too close to its surface.
fn cone(sphere: &Sphere, from: Vec3) -> Option<Cone> {
    let squared = (sphere.center - from).length_squared();
    let radius2 = sphere.radius * sphere.radius;
    (squared > 1.0001 * radius2).then(|| {
        let sin2 = radius2 / squared;
        Cone {
            height: sin2 / (1.0 + (1.0 - sin2).sqrt()),
        }
    })
}

/// A point of a sphere as an outward unit vector, and its density per solid angle unless it is the one of
/// uniform choice by area.
fn sample_sphere(sphere: &Sphere, from: Vec3, u: [f32; 2]) -> (Vec3, Option<f32>) {
    let Some(cone) = cone(sphere, from) else {
        return (uniform_sphere(u), None);
    };
    let to_center = sphere.center - from;
    let distance = to_center.length();
    // Uniform in the height of the cone; then the angle at the centre by the law of sines.
    let height = u[0] * cone.height;
    let (cos, sin2) = (1.0 - height, height * (2.0 - height));
    let radius = sphere.radius;
    let chord = (radius * radius - distance * distance * sin2)
        .max(0.0)
        .sqrt();
    let reach = distance * cos - chord;
    let cos_alpha = ((distance - reach * cos) / radius).clamp(-1.0, 1.0);
    let sin_alpha = (reach * sin2.sqrt() / radius).clamp(0.0, 1.0);
    let outward = Frame::around(-to_center / distance)
        .to_world(around_z(cos_alpha, sin_alpha, u[1]))
        .normalize();
    (outward, Some(cone.pdf()))
}

fn sample_plain(light: &antumbra_scene::Light, at: &Receiver, u: [f32; 2]) -> Option<LightSample> {
    use antumbra_scene::Light as Scene;
    let (wi, radiance, pdf, end) = match *light {
        Scene::Point {
            position,
            intensity,
        } => {
            let to_light = position - at.point;
            let radiance = intensity / to_light.length_squared();
            (
                to_light.try_normalize()?,
                radiance,
                1.0,
                End::Point(position),
            )
        }
        Scene::Spot {
            position,
            axis,
            intensity,
            cos_total_width,
            cos_falloff_start,
        } => {
            let to_light = position - at.point;
            let wi = to_light.try_normalize()?;
            let falloff = spot_falloff(-wi.dot(axis), cos_total_width, cos_falloff_start);
            let radiance = intensity * (falloff / to_light.length_squared());
            (wi, radiance, 1.0, End::Point(position))
        }
        Scene::Distant { to_light, radiance } => (to_light, radiance, 1.0, End::Infinity),
        Scene::Goniometric { .. } | Scene::Projection { .. } => return None,
        Scene::Infinite { radiance, .. } => {
            let wi = sample_sky(at, u);
            (wi, radiance, sky_pdf(at, wi), End::Infinity)
        }
    };
    (pdf > 0.0 && radiance != Vec3::ZERO).then_some(LightSample {
        wi,
        radiance,
        pdf,
        is_delta: !matches!(light, Scene::Infinite { .. }),
        end,
    })
}

/// 1 inside the falloff cone, 0 outside the total one, a quartic between.
fn spot_falloff(cos: f32, cos_total_width: f32, cos_falloff_start: f32) -> f32 {
    if cos < cos_total_width {
        0.0
    } else if cos >= cos_falloff_start {
        1.0
    } else {
        let share = (cos - cos_total_width) / (cos_falloff_start - cos_total_width);
        share * share * share * share
    }
}

/// A sky of one colour is sampled half by cosine, half uniformly, on the side(s) that matter. Cosine alone
/// would be optimal for a flat diffuse surface but gives unbounded weights where the shading normal leans
/// away from the geometric one.
fn sample_sky(at: &Receiver, [u, v]: [f32; 2]) -> Vec3 {
    let (other_side, u) = halve(u, at.both_sides);
    let (uniform, u) = halve(u, true);
    let local = if uniform {
        uniform_hemisphere([u, v])
    } else {
        cosine_hemisphere([u, v])
    };
    let normal = if other_side { -at.normal } else { at.normal };
    Frame::around(normal).to_world(local)
}

/// Takes a fair bit out of `u` if `wanted`.
fn halve(u: f32, wanted: bool) -> (bool, f32) {
    if !wanted {
        (false, u)
    } else if u < 0.5 {
        (false, 2.0 * u)
    } else {
        (true, 2.0 * u - 1.0)
    }
}

fn sky_pdf(at: &Receiver, wi: Vec3) -> f32 {
    let cos = wi.dot(at.normal);
    if at.both_sides {
        0.5 * (0.5 * cos.abs() + 0.25) / PI
    } else if cos >= 0.0 {
        (0.5 * cos + 0.25) / PI
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests;
