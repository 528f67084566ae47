//! What can be hit: the shapes of the world and those of its objects, found by what the kernel says of a hit.

use std::ops::Index;

use antumbra::{Aabb, Hit, INVALID_ID};
use antumbra_scene::{Scene, Shape};
use glam::{Affine3A, Mat3A, Vec3, Vec3A};

use crate::surface::gamma;

/// All shapes that stand in the world, each once however often it is seen: first those of the world, then those of
/// every object in turn.
#[derive(Debug)]
pub struct Shapes {
    shapes: Vec<Shape>,
    /// Where the shapes of each object begin.
    first_of_object: Vec<usize>,
    placements: Vec<Placement>,
    /// How far rays should begin from them, see [`Aabb::origin_offset`].
    pub clearance: f32,
}

impl Shapes {
    /// Those of a scene, whose instances are of objects that are there, and the box around them all.
    pub fn new(scene: &Scene, bounds: &Aabb) -> Self {
        let mut shapes = scene.shapes.clone();
        let mut first_of_object = Vec::with_capacity(scene.objects.len());
        for object in &scene.objects {
            first_of_object.push(shapes.len());
            shapes.extend_from_slice(&object.shapes);
        }
        let placements = scene.instances.iter().map(|instance| {
            let matrix = instance.world_from_object;
            Placement::new(instance.object, Affine3A::from(matrix))
        });
        Self {
            shapes,
            first_of_object,
            placements: placements.collect(),
            clearance: bounds.origin_offset(),
        }
    }

    /// Shapes without objects.
    #[cfg(test)]
    pub fn of_world(shapes: &[Shape]) -> Self {
        Self {
            shapes: shapes.to_vec(),
            first_of_object: Vec::new(),
            placements: Vec::new(),
            clearance: 0.0,
        }
    }

    /// Position of the shape that was hit.
    #[inline]
    pub fn index_of(&self, hit: &Hit) -> usize {
        let first = match self.placement(hit) {
            Some(placement) => self.first_of_object[placement.object],
            None => 0,
        };
        first + hit.geom_id as usize
    }

    /// Where the instance stands that was hit; `None` for what stands in the world by itself.
    #[inline]
    pub fn placement(&self, hit: &Hit) -> Option<&Placement> {
        self.placement_of(hit.inst_id)
    }

    /// The same by the instance's id.
    #[inline]
    pub fn placement_of(&self, inst_id: u32) -> Option<&Placement> {
        (inst_id != INVALID_ID).then(|| &self.placements[inst_id as usize])
    }
}

impl Index<usize> for Shapes {
    type Output = Shape;

    #[inline]
    fn index(&self, index: usize) -> &Shape {
        &self.shapes[index]
    }
}

/// How an instance brings its object to the world.
#[derive(Clone, Debug)]
pub struct Placement {
    object: usize,
    world_from_object: Affine3A,
    object_from_world: Affine3A,
    /// Absolute values of `world_from_object`, the translation included: bound the errors of its roundings.
    magnitude: Affine3A,
    /// The same for a point of the world on its way to the object's space, seen from the world.
    magnitude_of_return: Affine3A,
    /// Inverse transpose of the linear part, up to a positive factor.
    normals: Mat3A,
}

impl Placement {
    fn new(object: usize, world_from_object: Affine3A) -> Self {
        let linear = world_from_object.matrix3;
        let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
        // The cofactors: the inverse transpose times the determinant, whose sign would turn normals of mirror
        // images around.
        let side = if linear.determinant() < 0.0 {
            -1.0
        } else {
            1.0
        };
        let normals = Mat3A::from_cols(y.cross(z), z.cross(x), x.cross(y)) * side;
        let object_from_world = world_from_object.inverse();
        let magnitude = abs(&world_from_object);
        let linear_magnitude = Affine3A::from_mat3(magnitude.matrix3.into());
        Self {
            object,
            world_from_object,
            object_from_world,
            magnitude,
            magnitude_of_return: linear_magnitude * abs(&object_from_world),
            normals,
        }
    }

    /// A point of the object with its error bound, moved to the world. The bound covers that of a later ray on
    /// its way back to the object's space, too.
    #[inline]
    pub fn point(&self, point: Vec3, error: Vec3) -> (Vec3, Vec3) {
        let moved = self.world_from_object.transform_point3(point);
        let size = self.magnitude.transform_point3(point.abs());
        let return_size = self.magnitude_of_return.transform_point3(moved.abs());
        let error = self.magnitude.transform_vector3(error);
        // Three products and three sums in each direction, and one more rounding of the inverse itself.
        let bound = error * (1.0 + gamma(3)) + size * gamma(4) + return_size * gamma(8);
        (moved, bound)
    }

    /// Origin and direction of a ray as the object sees it; distances along it stay the same.
    #[inline]
    pub fn ray(&self, org: Vec3, dir: Vec3) -> [Vec3; 2] {
        let seen = &self.object_from_world;
        [seen.transform_point3(org), seen.transform_vector3(dir)]
    }

    /// A unit normal, moved to the world; itself if it vanishes there.
    #[inline]
    pub fn normal(&self, normal: Vec3) -> Vec3 {
        Vec3::from(self.normals * Vec3A::from(normal)).normalize_or(normal)
    }

    /// How a normal that was moved to the world changes, if it changes by `change` in the object.
    #[inline]
    pub fn normal_change(&self, normal: Vec3, change: Vec3) -> Vec3 {
        let [normal, change] = [normal, change].map(|v| self.normals * Vec3A::from(v));
        Vec3::from(change * normal.length_recip())
    }

    /// A point of the world as the object has it.
    #[inline]
    pub fn object_point(&self, point: Vec3) -> Vec3 {
        self.object_from_world.transform_point3(point)
    }

    /// A normal of the world as the object has it, of any length.
    #[inline]
    pub fn object_normal(&self, normal: Vec3) -> Vec3 {
        let linear = self.world_from_object.matrix3;
        Vec3::from(linear.transpose() * Vec3A::from(normal))
    }

    /// A direction along the surface, moved to the world.
    #[inline]
    pub fn tangent(&self, tangent: Vec3) -> Vec3 {
        self.world_from_object.transform_vector3(tangent)
    }
}

fn abs(matrix: &Affine3A) -> Affine3A {
    Affine3A {
        matrix3: matrix.matrix3.abs(),
        translation: matrix.translation.abs(),
    }
}
