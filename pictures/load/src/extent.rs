//! Extent of a scene, and the place that its positions are measured from.

use antumbra_scene::{Geometry, Scene, Shape};
use glam::{DAffine3, DVec3, Mat4, Vec3};

/// Coordinates this many times as large as the scene is long are measured from an origin of its own: then single precision
/// would lose more than two of its bits.
const FAR: f64 = 2.0;

/// Smallest box around the finite points of a scene: corners of triangles, spheres, and control points of curves with their
/// radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Smallest coordinates.
    pub low: DVec3,
    /// Largest coordinates.
    pub high: DVec3,
}

impl Extent {
    /// Box around nothing.
    const NOTHING: Self = Self {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
    };

    /// Box around a scene, measured from its origin. `None` if it has no finite point.
    ///
    /// Every point of an instance counts where it is, at the beginning and at the end of its motion.
    pub fn of(scene: &Scene) -> Option<Self> {
        let mut extent = Self::NOTHING;
        for shape in &scene.shapes {
            extent.grow(shape, &DAffine3::IDENTITY);
        }
        let places = scene.instances.iter().flat_map(|instance| {
            let ends = [Some(instance.world_from_object), instance.end];
            let matrices = ends.into_iter().flatten();
            matrices.map(|end| {
                (
                    instance.object,
                    DAffine3::from_mat4(Mat4::from(end).as_dmat4()),
                )
            })
        });
        extent.grow_by_places(scene.objects.len(), places, |extent, object, to_world| {
            for shape in &scene.objects[object].shapes {
                extent.grow(shape, to_world);
            }
        });
        extent.known()
    }

    /// Adds objects in their places, where `grow` adds the points of an object that a transformation moves.
    ///
    /// Few places are looked at point by point: the others are inside of what is known by the corners of boxes around their
    /// objects.
    fn grow_by_places(
        &mut self,
        objects: usize,
        places: impl Iterator<Item = (usize, DAffine3)>,
        grow: impl Fn(&mut Self, usize, &DAffine3),
    ) {
        let boxes = (0..objects).map(|object| {
            let mut extent = Self::NOTHING;
            grow(&mut extent, object, &DAffine3::IDENTITY);
            extent.known()
        });
        let boxes: Vec<Option<Self>> = boxes.collect();
        let places = places.filter_map(|(object, to_world)| {
            let corners = boxes.get(object).copied()??.corners();
            let corners = corners.map(|corner| to_world.transform_point3(corner).to_array());
            Some((object, to_world, Self::around(corners.into_iter())?))
        });
        let places: Vec<(usize, DAffine3, Self)> = places.collect();
        let farthest = |side: usize| {
            let places = places.iter();
            places.max_by(|a, b| a.2.side(side).total_cmp(&b.2.side(side)))
        };
        for (object, to_world, outer) in (0..6).filter_map(farthest).chain(&places) {
            if !self.holds(outer) {
                grow(self, *object, to_world);
            }
        }
    }

    /// Box around the finite ones of these points. `None` if there is none.
    pub fn around(points: impl Iterator<Item = [f64; 3]>) -> Option<Self> {
        let mut extent = Self::NOTHING;
        points.for_each(|point| extent.add(point.into()));
        extent.known()
    }

    fn known(self) -> Option<Self> {
        (self.low.x <= self.high.x).then_some(self)
    }

    /// Adds the points of a shape where a transformation moves them.
    fn grow(&mut self, shape: &Shape, to_world: &DAffine3) {
        let rows = to_world.matrix3.transpose();
        let mut ball = |center: Vec3, radius: f32| {
            let reach = DVec3::new(
                rows.x_axis.length(),
                rows.y_axis.length(),
                rows.z_axis.length(),
            );
            let center = to_world.transform_point3(center.as_dvec3());
            self.add(center - f64::from(radius) * reach);
            self.add(center + f64::from(radius) * reach);
        };
        match &shape.geometry {
            Geometry::Mesh(mesh) => {
                for &corner in mesh.indices.as_flattened() {
                    let point = Vec3::from(mesh.positions[corner as usize]);
                    self.add(to_world.transform_point3(point.as_dvec3()));
                }
            }
            Geometry::Sphere(sphere) => ball(sphere.center, sphere.radius),
            Geometry::Curves(curves) => {
                for &[x, y, z, radius] in &curves.points {
                    ball(Vec3::new(x, y, z), radius);
                }
            }
        }
    }

    fn corners(&self) -> [DVec3; 8] {
        [0, 1, 2, 3, 4, 5, 6, 7].map(|corner: u32| {
            let side = |axis: usize| [self.low, self.high][corner as usize >> axis & 1][axis];
            DVec3::new(side(0), side(1), side(2))
        })
    }

    /// How far the box reaches to one of six sides.
    fn side(&self, side: usize) -> f64 {
        match side {
            0..3 => -self.low[side],
            _ => self.high[side - 3],
        }
    }

    /// Whether another box is inside.
    fn holds(&self, other: &Self) -> bool {
        (0..6).all(|side| other.side(side) <= self.side(side))
    }

    fn add(&mut self, point: DVec3) {
        if point.is_finite() {
            self.low = self.low.min(point);
            self.high = self.high.max(point);
        }
    }

    /// Lengths of the sides.
    pub fn size(&self) -> DVec3 {
        self.high - self.low
    }

    /// The best place to measure a scene from: zero, so that coordinates stay as they are, unless they are large for the
    /// size of the scene. Otherwise it is near the middle, and has few digits.
    pub fn local_origin(&self) -> DVec3 {
        let longest = self.size().max_element();
        let farthest = self.low.abs().max(self.high.abs()).max_element();
        if farthest <= FAR * longest {
            return DVec3::ZERO;
        }
        let middle = self.low.midpoint(self.high);
        // A power of two, at most as long as the scene.
        let step = libm::exp2(libm::floor(libm::log2(longest)));
        let near = (middle / step).round() * step;
        if near.is_finite() { near } else { middle }
    }
}

/// Calls `add` with all points of the world that a picture is framed by: vertices, and corners of boxes around spheres and
/// instances.
pub(crate) fn for_each_point(scene: &Scene, add: &mut impl FnMut(Vec3)) {
    for shape in &scene.shapes {
        points_of(shape, add);
    }
    let boxes: Vec<_> = scene
        .objects
        .iter()
        .map(|object| {
            let mut extent = Extent::NOTHING;
            for shape in &object.shapes {
                extent.grow(shape, &DAffine3::IDENTITY);
            }
            extent.corners().map(|corner| corner.as_vec3())
        })
        .collect();
    for instance in &scene.instances {
        for &corner in boxes.get(instance.object).into_iter().flatten() {
            add(instance.world_from_object.transform_point3(corner));
            if let Some(end) = instance.end {
                add(end.transform_point3(corner));
            }
        }
    }
}

fn points_of(shape: &Shape, add: &mut impl FnMut(Vec3)) {
    match &shape.geometry {
        Geometry::Mesh(mesh) => mesh.positions.iter().for_each(|&point| add(point.into())),
        Geometry::Sphere(sphere) => {
            let radius = Vec3::splat(sphere.radius);
            add(sphere.center - radius);
            add(sphere.center + radius);
        }
        Geometry::Curves(curves) => {
            for &[x, y, z, radius] in &curves.points {
                let (point, radius) = (Vec3::new(x, y, z), Vec3::splat(radius));
                add(point - radius);
                add(point + radius);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extent(low: [f64; 3], high: [f64; 3]) -> Extent {
        Extent::around([low, high].into_iter()).expect("finite points")
    }

    #[test]
    fn coordinates_stay_unless_they_are_far_away() {
        let near = extent([-100.0, 0.0, 3.0], [200.0, 50.0, 4.0]);
        assert_eq!(near.local_origin(), DVec3::ZERO);
        let city = extent(
            [600_000.0, 5_340_000.0, 150.0],
            [601_200.0, 5_341_200.0, 240.0],
        );
        let origin = city.local_origin();
        assert_eq!(origin, DVec3::new(601_088.0, 5_340_160.0, 0.0));
        assert!((city.low - origin).abs().max_element() < city.size().max_element());
        // All of this origin's digits are in the file's coordinates, whatever their size.
        let small = extent([7.0e6, 1.0, 0.0], [7.0e6 + 0.01, 1.0, 0.0]);
        assert!((small.low - small.local_origin()).abs().max_element() <= 0.01);
        let point = extent([5.0, 6.0, 7.0], [5.0, 6.0, 7.0]);
        assert_eq!(point.local_origin(), DVec3::new(5.0, 6.0, 7.0));
        assert_eq!(extent([0.0; 3], [0.0; 3]).local_origin(), DVec3::ZERO);
    }

    /// A scene of random triangles in objects with some instances, and the box around all their corners.
    #[test]
    fn boxes_around_instances_are_as_small_as_boxes_around_their_points() {
        let mut state = 1_u64;
        let mut random = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 40) as f32 / (1_u32 << 23) as f32 - 1.0
        };
        for instances in [0, 1, 5, 400] {
            let mut scene = antumbra_scene::builtin::by_name("city:2000").expect("a scene");
            scene.shapes.truncate(0);
            let mut mesh = || {
                let mut positions: Vec<[f32; 3]> =
                    (0..30).map(|_| [(); 3].map(|()| random())).collect();
                // No triangle has this corner.
                positions.push([1000.0; 3]);
                let indices = (0..10).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
                let mesh = antumbra_scene::TriangleMesh {
                    positions,
                    indices,
                    ..Default::default()
                };
                crate::scene_of_mesh(String::new(), mesh, antumbra_mesh::plain_material()).shapes
            };
            scene.shapes = mesh();
            scene.objects = [mesh(), mesh()]
                .map(|shapes| antumbra_scene::Object {
                    name: String::new(),
                    shapes,
                })
                .to_vec();
            scene.instances = (0..instances)
                .map(|index| {
                    let matrix = glam::Mat3::from_cols_array(&[(); 9].map(|()| random()));
                    let by = 10.0 * Vec3::new(random(), random(), random());
                    antumbra_scene::Instance {
                        object: index % 2,
                        world_from_object: glam::Affine3::from_mat4(
                            glam::Mat4::from_translation(by) * glam::Mat4::from_mat3(matrix),
                        ),
                        end: None,
                    }
                })
                .collect();
            let flat = scene.flattened().expect("a flat scene");
            let mut points = Vec::new();
            for shape in &flat.shapes {
                let Geometry::Mesh(mesh) = &shape.geometry else {
                    panic!("a mesh")
                };
                let corners = mesh.indices.as_flattened().iter();
                points
                    .extend(corners.map(|&corner| mesh.positions[corner as usize].map(f64::from)));
            }
            let expected = Extent::around(points.into_iter()).expect("points");
            let found = Extent::of(&scene).expect("points");
            let apart = (found.low - expected.low)
                .abs()
                .max((found.high - expected.high).abs());
            assert!(
                apart.max_element() < 1e-5,
                "{instances}: {found:?} for {expected:?}"
            );
        }
    }

    #[test]
    fn spheres_under_instances_are_ellipsoids() {
        let mut scene = antumbra_scene::builtin::by_name("city:2000").expect("a scene");
        let sphere = antumbra_scene::Sphere::new(Vec3::X, 2.0);
        let shape = Shape {
            geometry: Geometry::Sphere(sphere),
            ..scene.shapes[0].clone()
        };
        scene.shapes.clear();
        scene.objects = vec![antumbra_scene::Object {
            name: String::new(),
            shapes: vec![shape],
        }];
        let turn = glam::Mat4::from_rotation_z(std::f32::consts::FRAC_PI_4);
        let matrix = turn * glam::Mat4::from_scale(Vec3::new(3.0, 1.0, 1.0));
        let world_from_object = glam::Affine3::from_mat4(matrix);
        scene.instances = vec![antumbra_scene::Instance {
            object: 0,
            world_from_object,
            end: None,
        }];
        // An ellipse with the half axes 6 and 2 that is turned by 45 degrees reaches sqrt((36 + 4) / 2) to all sides.
        let found = Extent::of(&scene).expect("a sphere");
        let (middle, reach) = (3.0 / 2.0_f64.sqrt(), 20.0_f64.sqrt());
        let low = DVec3::new(middle - reach, middle - reach, -2.0);
        assert!((found.low - low).abs().max_element() < 1e-5, "{found:?}");
        assert!((found.high.x - middle - reach).abs() < 1e-5, "{found:?}");
    }

    #[test]
    fn points_that_are_not_finite_do_not_count() {
        let points = [[f64::NAN, 0.0, 0.0], [1.0, f64::INFINITY, 0.0]];
        assert_eq!(Extent::around(points.into_iter()), None);
        assert_eq!(Extent::around(std::iter::empty()), None);
    }
}
