//! Camera rays: from a point on the film to a ray in the world.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use antumbra::{Instance, Ray};
use antumbra_scene::{Film, Projection};
use glam::{Affine3, Affine3A, Mat4, Vec3, Vec4};

use crate::Error;
use crate::light::{longitude_latitude, octahedron};
use crate::sampler::warp::disk;
use crate::surface::affine;
use crate::world::lens::{HalfLine, Lens};
use crate::world::rows;

/// A camera, ready to make rays.
#[derive(Clone, Debug)]
pub struct Camera {
    world_from_camera: Mat4,
    camera_from_world: Mat4,
    /// Centre of the lens in the world.
    eye: Vec3,
    projection: Projection,
    /// Number of pixels across and down.
    size: [f32; 2],
    /// Position of the film point (0, 0) on the plane z = 1, or on the camera's own plane if the projection is orthographic.
    corner: [f32; 2],
    /// Change of that position per pixel.
    step: [f32; 2],
    lens_radius: f32,
    focal_distance: f32,
    /// Lenses and film of a realistic camera.
    lens: Option<Arc<Lens>>,
    medium: Option<u32>,
    /// Keys of the camera, if it moves: from its space to the world.
    path: Option<Instance>,
    /// Times at which the shutter opens and closes.
    shutter: [f32; 2],
    /// Whether paths have a time, as something moves.
    has_time: bool,
}

impl Camera {
    /// Prepares a scene's camera for its film.
    ///
    /// # Errors
    /// [`Error::FieldOfView`] unless the field of view lies strictly between 0 and 180 degrees.
    /// [`Error::CameraMatrix`] if the matrix is not finite or flattens space.
    /// [`Error::Lens`] if a realistic camera has no lenses, or some through which no light passes.
    pub fn new(camera: &antumbra_scene::Camera, film: &Film) -> Result<Self, Error> {
        let fov = camera.fov;
        if camera.projection == Projection::Perspective && !(fov > 0.0 && fov < 180.0) {
            return Err(Error::FieldOfView { degrees: fov });
        }
        let matrix = camera.world_from_camera;
        let determinant = Affine3A::from_mat4(matrix).matrix3.determinant();
        if !matrix.is_finite() || !determinant.is_finite() || determinant == 0.0 {
            return Err(Error::CameraMatrix { determinant });
        }
        let [width, height] = film.resolution.map(|size| size as f32);
        let aspect = camera.frame_aspect_ratio.unwrap_or(width / height);
        let [x_min, x_max, y_min, y_max] = camera.screen_window.unwrap_or(if aspect > 1.0 {
            [-aspect, aspect, -1.0, 1.0]
        } else {
            [-1.0, 1.0, -1.0 / aspect, 1.0 / aspect]
        });
        let scale = match camera.projection {
            Projection::Perspective => libm::tan(f64::from(fov).to_radians() / 2.0) as f32,
            _ => 1.0,
        };
        let lens = match (camera.projection, &camera.lenses) {
            (Projection::Realistic, Some(system)) => Some(Arc::new(Lens::new(system, film)?)),
            (Projection::Realistic, None) => {
                let reason = "it is missing".to_owned();
                return Err(Error::Lens { reason });
            }
            _ => None,
        };
        Ok(Self {
            world_from_camera: matrix,
            eye: matrix.project_point3(Vec3::ZERO),
            camera_from_world: matrix.inverse(),
            projection: camera.projection,
            size: [width, height],
            corner: [scale * x_min, scale * y_max],
            step: [
                scale * (x_max - x_min) / width,
                scale * (y_min - y_max) / height,
            ],
            lens_radius: match camera.projection {
                Projection::Perspective | Projection::Orthographic => camera.lens_radius,
                Projection::Spherical | Projection::EqualArea | Projection::Realistic => 0.0,
            },
            focal_distance: camera.focal_distance,
            lens,
            medium: camera.medium,
            path: path(camera)?,
            shutter: camera.shutter,
            has_time: camera.end.is_some(),
        })
    }

    /// Whether the camera moves while the shutter is open.
    pub fn moves(&self) -> bool {
        self.path.is_some()
    }

    /// Gives paths a time also if the camera does not move.
    pub(super) fn with_time(self, has_time: bool) -> Self {
        let has_time = self.has_time || has_time;
        Self { has_time, ..self }
    }

    /// Whether paths have a time.
    #[inline]
    pub fn has_time(&self) -> bool {
        self.has_time
    }

    /// The time of a path, from 0 to 1, of a uniform random number.
    pub fn time(&self, uniform: f32) -> f32 {
        let [open, close] = self.shutter;
        (open + uniform * (close - open)).clamp(0.0, 1.0)
    }

    /// The camera at a time. `None` for one that does not move.
    pub fn at(&self, time: f32) -> Option<Self> {
        let rows = self.path.as_ref()?.transform_at(time).ok()?;
        let matrix = Mat4::from(affine(&rows));
        Some(Self {
            world_from_camera: matrix,
            camera_from_world: matrix.inverse(),
            eye: matrix.project_point3(Vec3::ZERO),
            path: None,
            lens: self.lens.clone(),
            ..*self
        })
    }

    /// Ray of film point (x, y), in pixels from the top left corner, through the lens point that `lens` in
    /// `[0, 1)²` chooses. The direction has unit length. A ray that lenses block hits nothing.
    pub fn ray(&self, film: [f32; 2], lens: [f32; 2]) -> Ray {
        self.weighted_ray(film, lens).0
    }

    /// [`Self::ray`] with its weight: 1, but of a realistic camera. A ray that lenses block has weight 0.
    pub fn weighted_ray(&self, film: [f32; 2], lens: [f32; 2]) -> (Ray, f32) {
        let Some(lenses) = &self.lens else {
            return (self.plain_ray(film, lens), 1.0);
        };
        let share = [0, 1].map(|axis| f64::from(film[axis]) / f64::from(self.size[axis]));
        match lenses.leaving(share, lens) {
            Some(leaving) => (self.behind_lenses(leaving.ray), leaving.weight),
            None => {
                let blocked = self.ray_from(self.eye, Vec3::Z);
                (
                    Ray {
                        tfar: 0.0,
                        ..blocked
                    },
                    0.0,
                )
            }
        }
    }

    /// World ray of a ray that leaves the lenses.
    fn behind_lenses(&self, ray: HalfLine) -> Ray {
        self.to_world(ray.org.as_vec3(), ray.dir.as_vec3())
    }

    /// Whether rays differ in weight.
    #[inline]
    pub fn has_weights(&self) -> bool {
        self.lens.is_some()
    }

    /// Ray of a camera without lenses.
    fn plain_ray(&self, film: [f32; 2], lens: [f32; 2]) -> Ray {
        if self.projection.is_all_around() {
            return self.ray_from(self.eye, self.direction(film));
        }
        let through = Vec3::new(
            self.corner[0] + film[0] * self.step[0],
            self.corner[1] + film[1] * self.step[1],
            1.0,
        );
        if self.projection == Projection::Orthographic {
            let from = through - Vec3::Z;
            let [x, y] = match self.has_lens() {
                true => disk(lens).map(|side| side * self.lens_radius),
                false => [0.0; 2],
            };
            // All points of the lens see one point in focus.
            let toward = Vec3::new(-x, -y, self.focal_distance);
            return self.to_world(from + Vec3::new(x, y, 0.0), toward);
        }
        if !self.has_lens() {
            return self.ray_from(self.eye, through);
        }
        let [x, y] = disk(lens);
        let org = Vec3::new(x * self.lens_radius, y * self.lens_radius, 0.0);
        self.to_world(org, through * self.focal_distance - org)
    }

    /// Direction of a film point in the space of a camera that sees all around.
    fn direction(&self, film: [f32; 2]) -> Vec3 {
        let at = [film[0] / self.size[0], film[1] / self.size[1]];
        if self.projection == Projection::EqualArea {
            // The octahedron stands on z.
            let dir = octahedron::direction(octahedron::wrap(at));
            return Vec3::new(dir.x, dir.z, dir.y);
        }
        let (sin_turn, turn) = libm::sincosf(TAU * at[0]);
        let (sin, cos) = libm::sincosf(PI * at[1]);
        Vec3::new(sin * turn, cos, sin * sin_turn)
    }

    /// Film point of a direction, the inverse of [`Self::direction`].
    fn film(&self, dir: Vec3) -> [f32; 2] {
        let turned = Vec3::new(dir.x, dir.z, dir.y);
        let at = match self.projection {
            Projection::EqualArea => octahedron::place(turned),
            _ => longitude_latitude(turned),
        };
        [at[0] * self.size[0], at[1] * self.size[1]]
    }

    /// Medium around the camera. `None` is vacuum.
    pub fn medium(&self) -> Option<u32> {
        self.medium
    }

    /// Whether rays depend on the lens point.
    #[inline]
    pub fn has_lens(&self) -> bool {
        self.lens_radius > 0.0 || self.lens.is_some()
    }

    /// Rays of film points `distance` pixels further along x and along y, through the lens point of `ray`.
    pub fn neighbours(&self, ray: &Ray, distance: f32) -> [Ray; 2] {
        let org = self.camera_from_world.project_point3(ray.org.into());
        let dir = self.camera_from_world.transform_vector3(ray.dir.into());
        if self.projection.is_all_around() {
            let [x, y] = self.film(dir);
            return [[x + distance, y], [x, y + distance]]
                .map(|film| self.ray_from(self.eye, self.direction(film)));
        }
        if let Some(lenses) = &self.lens {
            let local = HalfLine {
                org: org.as_dvec3(),
                dir: dir.as_dvec3().normalize(),
            };
            let [x, y] = self.size.map(|size| f64::from(distance / size));
            return [[x, 0.0], [0.0, y]].map(|further| {
                let found = lenses.neighbour(local, further);
                // At the edge of a lens, the other neighbour is as far.
                let mirrored = || {
                    let opposite = lenses.neighbour(local, further.map(|share| -share))?;
                    Some(HalfLine {
                        org: local.org * 2.0 - opposite.org,
                        dir: local.dir * 2.0 - opposite.dir.normalize(),
                    })
                };
                self.behind_lenses(found.or_else(mirrored).unwrap_or(local))
            });
        }
        if self.projection == Projection::Orthographic {
            let [x, y] = self.step.map(|step| step * distance);
            return [Vec3::X * x, Vec3::Y * y].map(|further| self.to_world(org + further, dir));
        }
        // Scales the direction to the length that `Camera::ray` gives it before it normalizes.
        let (dir, reach) = if self.has_lens() {
            (dir * (self.focal_distance / dir.z), self.focal_distance)
        } else {
            (dir / dir.z, 1.0)
        };
        let [x, y] = self.step.map(|step| step * distance * reach);
        [Vec3::X * x, Vec3::Y * y].map(|further| self.to_world(org, dir + further))
    }

    /// Distance of a point from the camera along its axis, in units of the world. Distance from the place of a camera that sees
    /// all around.
    pub fn depth(&self, point: Vec3) -> f32 {
        if self.projection.is_all_around() {
            return point.distance(self.eye);
        }
        let axis = self.world_from_camera.transform_vector3(Vec3::Z);
        (point - self.eye).dot(axis) / axis.length()
    }

    /// World ray of a ray in the camera's space.
    fn to_world(&self, org: Vec3, dir: Vec3) -> Ray {
        self.ray_from(self.world_from_camera.project_point3(org), dir)
    }

    /// World ray from a point of the world along a direction in the camera's space.
    fn ray_from(&self, org: Vec3, dir: Vec3) -> Ray {
        let dir = self.world_from_camera.transform_vector3(dir).normalize();
        Ray {
            org: org.to_array(),
            dir: dir.to_array(),
            tnear: 0.0,
            tfar: f32::INFINITY,
        }
    }
}

/// Keys of a camera that moves.
fn path(camera: &antumbra_scene::Camera) -> Result<Option<Instance>, Error> {
    let Some(end) = camera.end else {
        return Ok(None);
    };
    let matrices = [camera.world_from_camera, end];
    let keys = matrices.map(|matrix| rows(&Affine3::from_mat4(matrix)));
    let path = Instance::moving(0, keys);
    let is_sound = path.transform_at(0.5).is_ok() && camera.shutter.iter().all(|t| t.is_finite());
    // Both mirror or none does, and neither flattens space.
    if !is_sound || matrices.iter().any(|matrix| matrix.row(3) != Vec4::W) {
        let determinant = Affine3A::from_mat4(end).matrix3.determinant();
        return Err(Error::CameraMatrix { determinant });
    }
    Ok(Some(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn film(width: u32, height: u32) -> Film {
        Film {
            resolution: [width, height],
            ..Film::default()
        }
    }

    fn camera() -> antumbra_scene::Camera {
        antumbra_scene::Camera::default()
    }

    fn near(a: [f32; 3], b: [f32; 3]) {
        let distance = (Vec3::from(a) - Vec3::from(b)).length();
        assert!(distance < 1e-5, "{a:?} {b:?}");
    }

    #[test]
    fn the_field_of_view_spans_the_shorter_side() {
        let wide = Camera::new(&camera(), &film(200, 100)).unwrap();
        let centre = wide.ray([100.0, 50.0], [0.5; 2]);
        near(centre.dir, [0.0, 0.0, 1.0]);
        let half = std::f32::consts::FRAC_1_SQRT_2;
        near(wide.ray([100.0, 0.0], [0.5; 2]).dir, [0.0, half, half]);
        let left = wide.ray([0.0, 50.0], [0.5; 2]).dir;
        assert!((left[0] / left[2] + 2.0).abs() < 1e-5);
        let tall = Camera::new(&camera(), &film(100, 200)).unwrap();
        near(tall.ray([100.0, 100.0], [0.5; 2]).dir, [half, 0.0, half]);
    }

    #[test]
    fn every_lens_point_sees_the_same_point_in_focus() {
        let mut scene = camera();
        scene.lens_radius = 0.3;
        scene.focal_distance = 4.0;
        scene.world_from_camera = Mat4::from_translation(Vec3::new(1.0, 2.0, 3.0))
            * Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        let camera = Camera::new(&scene, &film(100, 100)).unwrap();
        let focus = |lens| {
            let ray = camera.ray([20.0, 70.0], lens);
            let (org, dir) = (Vec3::from(ray.org), Vec3::from(ray.dir));
            org + dir * ((7.0 - org.z) / dir.z)
        };
        let middle = focus([0.5, 0.5]);
        for lens in [[0.0, 0.0], [0.9, 0.1], [0.3, 0.99]] {
            near(focus(lens).to_array(), middle.to_array());
        }
    }

    #[test]
    fn neighbours_are_rays_of_points_further_on_the_film() {
        for lens_radius in [0.0, 0.3] {
            let mut scene = camera();
            scene.lens_radius = lens_radius;
            scene.focal_distance = 4.0;
            scene.world_from_camera = Mat4::from_rotation_translation(
                glam::Quat::from_rotation_y(0.7),
                Vec3::new(1.0, 2.0, 3.0),
            ) * Mat4::from_scale(Vec3::new(-1.0, 2.0, 1.0));
            let camera = Camera::new(&scene, &film(30, 20)).unwrap();
            let lens = [0.3, 0.8];
            let found = camera.neighbours(&camera.ray([4.0, 7.0], lens), 0.5);
            for (found, film) in found.iter().zip([[4.5, 7.0], [4.0, 7.5]]) {
                let expected = camera.ray(film, lens);
                near(found.org, expected.org);
                near(found.dir, expected.dir);
            }
        }
    }

    #[test]
    fn orthographic_rays_are_parallel_and_meet_in_focus() {
        let mut scene = camera();
        scene.projection = Projection::Orthographic;
        scene.screen_window = Some([-3.0, 3.0, -2.0, 2.0]);
        let plain = Camera::new(&scene, &film(60, 40)).unwrap();
        let ray = plain.ray([60.0, 0.0], [0.7; 2]);
        near(ray.org, [3.0, 2.0, 0.0]);
        near(ray.dir, [0.0, 0.0, 1.0]);
        scene.lens_radius = 0.5;
        scene.focal_distance = 4.0;
        let lens = Camera::new(&scene, &film(60, 40)).unwrap();
        for at in [[0.1, 0.9], [0.5, 0.5]] {
            let ray = lens.ray([30.0, 10.0], at);
            let (org, dir) = (Vec3::from(ray.org), Vec3::from(ray.dir));
            near((org + dir * (4.0 / dir.z)).to_array(), [0.0, 1.0, 4.0]);
            let next = lens.ray([30.5, 10.0], at);
            let found = lens.neighbours(&ray, 0.5)[0];
            near(found.org, next.org);
            near(found.dir, next.dir);
        }
    }

    /// The directions of pbrt: up at the upper edge, x at the left, z a quarter further. Neighbours on the film are neighbours.
    #[test]
    fn all_around_cameras_see_every_direction() {
        for projection in [Projection::Spherical, Projection::EqualArea] {
            let scene = antumbra_scene::Camera {
                projection,
                world_from_camera: Mat4::from_translation(Vec3::ONE),
                ..camera()
            };
            let camera = Camera::new(&scene, &film(80, 40)).unwrap();
            for film in [[13.0, 9.0], [71.5, 31.5], [45.25, 20.5]] {
                let ray = camera.ray(film, [0.5; 2]);
                near(ray.org, [1.0; 3]);
                let neighbours = camera.neighbours(&ray, 0.5);
                let further = [[film[0] + 0.5, film[1]], [film[0], film[1] + 0.5]];
                for (found, film) in neighbours.iter().zip(further) {
                    near(found.dir, camera.ray(film, [0.5; 2]).dir);
                }
            }
            assert_eq!(camera.depth(Vec3::new(1.0, 1.0, -2.0)), 3.0);
            if projection == Projection::Spherical {
                near(camera.ray([0.0, 20.0], [0.0; 2]).dir, [1.0, 0.0, 0.0]);
                near(camera.ray([20.0, 20.0], [0.0; 2]).dir, [0.0, 0.0, 1.0]);
                near(camera.ray([33.0, 0.0], [0.0; 2]).dir, [0.0, 1.0, 0.0]);
            } else {
                near(camera.ray([40.0, 20.0], [0.0; 2]).dir, [0.0, 1.0, 0.0]);
                // Beyond an edge, the square goes on where it is folded.
                near(
                    camera.ray([-2.0, 15.0], [0.0; 2]).dir,
                    camera.ray([2.0, 25.0], [0.0; 2]).dir,
                );
            }
        }
    }

    #[test]
    fn impossible_cameras_are_refused() {
        for fov in [0.0, 180.0, f32::NAN] {
            let scene = antumbra_scene::Camera { fov, ..camera() };
            let error = Camera::new(&scene, &film(4, 4)).unwrap_err();
            assert!(matches!(error, Error::FieldOfView { .. }));
        }
        let flat = antumbra_scene::Camera {
            world_from_camera: Mat4::from_scale(Vec3::new(1.0, 0.0, 1.0)),
            ..camera()
        };
        let error = Camera::new(&flat, &film(4, 4)).unwrap_err();
        assert!(matches!(error, Error::CameraMatrix { .. }));
    }
}
