//! Shapes of the world and of its objects, found by a hit of the kernel.

use std::borrow::Cow;
use std::ops::Index;

use antumbra::{Aabb, Hit, INVALID_ID, Instance};
use antumbra_scene::{Scene, Shape};
use glam::{Affine3A, Mat3A, Vec3, Vec3A};

use super::curve::CurvePart;
use super::triangle::gamma;
use crate::world::of_instance;

/// All shapes of a scene: first the shapes of the world, then the shapes of every object in turn.
///
/// Every shape is stored once, however many instances show it.
#[derive(Debug)]
pub struct Shapes {
    shapes: Vec<Shape>,
    /// Parts of curves by segment, for every shape.
    curve_parts: Vec<Vec<CurvePart>>,
    /// Place of the first shape of the object of each instance. Apart from the placements, which miss the cache.
    first_of_instance: Vec<u32>,
    placements: Vec<Placement>,
    motion: Option<Motion>,
    /// Origin offset of rays, see [`Aabb::origin_offset`].
    pub origin_offset: f32,
}

impl Shapes {
    /// Shapes of a scene inside `bounds`, with the parts of their curves. Instances must be of objects that exist.
    pub fn new(scene: &Scene, bounds: &Aabb, curve_parts: Vec<Vec<CurvePart>>) -> Self {
        let mut shapes = scene.shapes.clone();
        let mut first_of_object = Vec::with_capacity(scene.objects.len());
        for object in &scene.objects {
            first_of_object.push(shapes.len());
            shapes.extend_from_slice(&object.shapes);
        }
        let placements = scene.instances.iter().map(|instance| {
            let matrix = instance.world_from_object;
            Placement::new(Affine3A::from(matrix))
        });
        let objects = scene.instances.iter().map(|instance| instance.object);
        let first_of_instance = objects.map(|object| first_of_object[object] as u32);
        Self {
            shapes,
            curve_parts,
            first_of_instance: first_of_instance.collect(),
            placements: placements.collect(),
            motion: Motion::new(scene),
            origin_offset: bounds.origin_offset(),
        }
    }

    /// Shapes without objects.
    #[cfg(test)]
    pub fn of_world(shapes: &[Shape]) -> Self {
        Self {
            shapes: shapes.to_vec(),
            curve_parts: vec![Vec::new(); shapes.len()],
            first_of_instance: Vec::new(),
            placements: Vec::new(),
            motion: None,
            origin_offset: 0.0,
        }
    }

    /// Position of the shape that was hit.
    #[inline]
    pub fn index_of(&self, hit: &Hit) -> usize {
        let first = match hit.inst_id {
            INVALID_ID => 0,
            instance => self.first_of_instance[self.instance(instance).0],
        };
        first as usize + hit.geom_id as usize
    }

    /// Parts of the curves of a shape, by segment.
    #[inline]
    pub fn curve_parts(&self, index: usize) -> &[CurvePart] {
        &self.curve_parts[index]
    }

    /// Placement of the instance that was hit. `None` for a shape of the world.
    #[inline]
    pub fn placement(&self, hit: &Hit) -> Option<Cow<'_, Placement>> {
        self.placement_of(hit.inst_id)
    }

    /// Placement of an instance by its id, which has the time where something moves.
    #[inline]
    pub fn placement_of(&self, inst_id: u32) -> Option<Cow<'_, Placement>> {
        if inst_id == INVALID_ID {
            return None;
        }
        let (instance, time) = self.instance(inst_id);
        let moving = self
            .motion
            .as_ref()
            .and_then(|motion| motion.instances[instance].as_ref());
        Some(match moving {
            None => Cow::Borrowed(&self.placements[instance]),
            Some(moving) => Cow::Owned(Placement::new(at(moving, time))),
        })
    }

    /// Stored placement of the instance that was hit, to be prefetched.
    #[inline]
    pub fn stored_placement(&self, hit: &Hit) -> Option<&Placement> {
        (hit.inst_id != INVALID_ID).then(|| &self.placements[self.instance(hit.inst_id).0])
    }

    /// Index of an instance and the time, of an id.
    #[inline(always)]
    fn instance(&self, inst_id: u32) -> (usize, f32) {
        match &self.motion {
            None => (inst_id as usize, 0.0),
            Some(motion) => motion.times.split(inst_id),
        }
    }

    /// Times that ids can have. `None` where no instance moves.
    pub fn times(&self) -> Option<Times> {
        self.motion.as_ref().map(|motion| motion.times)
    }
}

impl Index<usize> for Shapes {
    type Output = Shape;

    #[inline]
    fn index(&self, index: usize) -> &Shape {
        &self.shapes[index]
    }
}

/// Times of a scene that moves, and ids of instances that carry them, because a surface depends on the time of its hit.
///
/// The number of the instance is in the lower bits of an id, and the time in the others. Times are therefore multiples of a
/// step: about a millionth with up to 4095 instances, and more with more instances.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Times {
    /// Bits of the number of an instance.
    bits: u32,
}

impl Times {
    /// Most bits of a time.
    const MOST: u32 = 20;

    /// Times for so many instances, none of which is all ones, as [`INVALID_ID`] is.
    fn new(instances: usize) -> Self {
        let bits = usize::BITS - instances.leading_zeros();
        Self {
            bits: bits.max(32 - Self::MOST),
        }
    }

    fn steps(self) -> u32 {
        1 << (32 - self.bits)
    }

    /// The time nearest to one in [0, 1] that an id can have.
    #[inline]
    pub fn nearest(self, time: f32) -> f32 {
        let last = (self.steps() - 1) as f32;
        (time.clamp(0.0, 1.0) * last).round() / last
    }

    /// The id of an instance at a time that ids can have.
    #[inline]
    pub fn join(self, inst_id: u32, time: f32) -> u32 {
        let last = (self.steps() - 1) as f32;
        if inst_id == INVALID_ID {
            return inst_id;
        }
        inst_id | ((time * last).round() as u32) << self.bits
    }

    /// Number of an instance, and the time, of an id.
    #[inline]
    fn split(self, id: u32) -> (usize, f32) {
        let last = (self.steps() - 1) as f32;
        let instance = id & ((1 << self.bits) - 1);
        (instance as usize, (id >> self.bits) as f32 / last)
    }
}

/// Instances that move.
#[derive(Debug)]
struct Motion {
    times: Times,
    /// Keys of each instance. `None` for instances that do not move.
    instances: Vec<Option<Instance>>,
}

impl Motion {
    /// `None` if no instance moves.
    fn new(scene: &Scene) -> Option<Self> {
        let moving = |instance: &antumbra_scene::Instance| {
            instance.end.is_some().then(|| of_instance(instance))
        };
        let instances: Vec<_> = scene.instances.iter().map(moving).collect();
        (instances.iter().any(Option::is_some)).then(|| Self {
            times: Times::new(instances.len()),
            instances,
        })
    }
}

/// The transform of a moving instance at a time, as the kernel has it.
fn at(instance: &Instance, time: f32) -> Affine3A {
    // Keys were checked when the scene was lowered.
    let rows = instance.transform_at(time).unwrap_or(instance.transform);
    affine(&rows)
}

/// An affine map of its rows.
pub fn affine(rows: &[[f32; 4]; 3]) -> Affine3A {
    let column = |column: usize| Vec3A::from(rows.map(|row| row[column]));
    Affine3A {
        matrix3: Mat3A::from_cols(column(0), column(1), column(2)),
        translation: column(3),
    }
}

/// Transformation of an instance between its object and the world.
#[derive(Clone, Debug)]
pub struct Placement {
    world_from_object: Affine3A,
    object_from_world: Affine3A,
    /// Absolute values of `world_from_object`, translation included: the bound of its rounding errors.
    magnitude: Affine3A,
    /// Bound of the rounding errors of the way back to the object, as seen from the world.
    magnitude_of_return: Affine3A,
    /// Inverse transpose of the linear part, up to a positive factor.
    normals: Mat3A,
    /// Lower bound of the factor by which distances change on the way to the world.
    pub least_scale: f32,
}

impl Placement {
    fn new(world_from_object: Affine3A) -> Self {
        let linear = world_from_object.matrix3;
        let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
        // Cofactors are the inverse transpose times the determinant, whose sign would flip normals of mirror
        // images.
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
            world_from_object,
            object_from_world,
            magnitude,
            magnitude_of_return: linear_magnitude * abs(&object_from_world),
            normals,
            least_scale: least_scale(&linear),
        }
    }

    /// Point of the object with its error bound, moved to the world. The bound covers also the way of a later ray
    /// back to the object.
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

    /// Origin and direction of a ray, moved to the object. Distances along the ray do not change.
    #[inline]
    pub fn ray(&self, org: Vec3, dir: Vec3) -> [Vec3; 2] {
        let seen = &self.object_from_world;
        [seen.transform_point3(org), seen.transform_vector3(dir)]
    }

    /// Unit normal of the object, moved to the world. Unchanged if it vanishes there.
    #[inline]
    pub fn normal(&self, normal: Vec3) -> Vec3 {
        Vec3::from(self.normals * Vec3A::from(normal)).normalize_or(normal)
    }

    /// Change of a normal in the world, if it changes by `change` in the object.
    #[inline]
    pub fn normal_change(&self, normal: Vec3, change: Vec3) -> Vec3 {
        let [normal, change] = [normal, change].map(|v| self.normals * Vec3A::from(v));
        Vec3::from(change * normal.length_recip())
    }

    /// Point of the world, moved to the object.
    #[inline]
    pub fn object_point(&self, point: Vec3) -> Vec3 {
        self.object_from_world.transform_point3(point)
    }

    /// Normal of the world, moved to the object. Has any length.
    #[inline]
    pub fn object_normal(&self, normal: Vec3) -> Vec3 {
        let linear = self.world_from_object.matrix3;
        Vec3::from(linear.transpose() * Vec3A::from(normal))
    }

    /// Direction along the surface, moved to the world.
    #[inline]
    pub fn tangent(&self, tangent: Vec3) -> Vec3 {
        self.world_from_object.transform_vector3(tangent)
    }
}

/// Lower bound of the length of `linear * v` over the length of `v`, by the discs of Gershgorin. Exact for rotations of
/// stretched axes. 0 for strong shears and singular matrices.
fn least_scale(linear: &Mat3A) -> f32 {
    let gram = (linear.transpose() * *linear).to_cols_array_2d();
    let squared = (0..3)
        .map(|i| {
            let others: f32 = (0..3).filter(|&j| j != i).map(|j| gram[i][j].abs()).sum();
            gram[i][i] - others
        })
        .fold(f32::INFINITY, f32::min);
    squared.max(0.0).sqrt()
}

fn abs(matrix: &Affine3A) -> Affine3A {
    Affine3A {
        matrix3: matrix.matrix3.abs(),
        translation: matrix.translation.abs(),
    }
}
