//! Extent of a scene, and the place that its positions are measured from.

use antumbra_scene::{Geometry, Scene, Shape};
use glam::{DVec3, Vec3};

/// Coordinates this many times as large as the scene is long are measured from an origin of its own: then single precision
/// would lose more than two of its bits.
const FAR: f64 = 2.0;

/// Box around the finite points of a scene.
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
    pub fn of(scene: &Scene) -> Option<Self> {
        let mut extent = Self::NOTHING;
        for_each_point(scene, &mut |point| extent.grow(point));
        extent.known()
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

    fn grow(&mut self, point: Vec3) {
        self.add(point.as_dvec3());
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

/// Calls `add` with all points of the world: vertices, and corners of boxes around spheres and instances.
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
                points_of(shape, &mut |point| extent.grow(point));
            }
            [extent.low.as_vec3(), extent.high.as_vec3()]
        })
        .collect();
    for instance in &scene.instances {
        let Some(&[low, high]) = boxes.get(instance.object) else {
            continue;
        };
        for corner in 0..8_u32 {
            let side = |axis: usize| if corner >> axis & 1 == 0 { low } else { high }[axis];
            let corner = Vec3::new(side(0), side(1), side(2));
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

    #[test]
    fn points_that_are_not_finite_do_not_count() {
        let points = [[f64::NAN, 0.0, 0.0], [1.0, f64::INFINITY, 0.0]];
        assert_eq!(Extent::around(points.into_iter()), None);
        assert_eq!(Extent::around(std::iter::empty()), None);
    }
}
