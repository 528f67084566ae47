//! Points on the surfaces of instances.

use alloc::vec::Vec;

use crate::geometry::instance::{Affine, PlacedObject};
use crate::geometry::primitives::{Prim, Primitives};
use crate::geometry::scalar::SurfacePoint;
use crate::hash::Random;
use crate::learn::surface_rays::{Surfaces, Weights, area, unit, unit_normal};
use crate::math;
use crate::parallel;

/// Primitives that are summed up at one go.
const CHUNK: usize = 4096;

/// The surfaces of instances one after the other, behind the surfaces of the world itself.
pub(crate) struct PlacedSurfaces<'a> {
    primitives: &'a Primitives,
    /// Surfaces of every object.
    objects: Vec<Surfaces<'a>>,
    /// Factor by which each instance enlarges areas.
    enlargements: Vec<f64>,
    /// All surfaces, including the surfaces of the world.
    pub all: Weights,
    /// Share of all surfaces that comes before each instance, as far as there are surfaces.
    before: Vec<f64>,
}

impl<'a> PlacedSurfaces<'a> {
    /// Surfaces of all instances, behind so much in the world.
    pub fn new(primitives: &'a Primitives, world: Weights) -> Self {
        let (objects, moments): (Vec<_>, Vec<_>) =
            parallel::map(primitives.objects.len(), 1, |object| {
                let object = &primitives.objects[object];
                (Surfaces::new(object), Moments::new(object))
            })
            .into_iter()
            .unzip();
        let (mut enlargements, mut weights) = (Vec::new(), Vec::new());
        let mut all = world;
        for placed in &primitives.instances {
            let object = placed.object as usize;
            let affine = Affine::new(&placed.world_from_object);
            let enlargement = moments[object].enlargement(&affine, objects[object].all.area);
            enlargements.push(enlargement);
            weights.push(all);
            all = all.plus(objects[object].all.enlarged(enlargement));
        }
        let mut before: Vec<f64> = weights.iter().map(|sum| sum.share_of(&all)).collect();
        // Rounding may lead beyond the end, but not to what has no area.
        let end = all.share_of(&all);
        while before.last().is_some_and(|before| *before >= end) {
            before.pop();
        }
        Self {
            primitives,
            objects,
            enlargements,
            all,
            before,
        }
    }

    /// A point on the instance that such a share of all surfaces leads to; `None` if that is in the world itself.
    pub fn point(&self, place: f64, random: &mut Random) -> Option<SurfacePoint> {
        let instance = self
            .before
            .partition_point(|before| *before <= place)
            .checked_sub(1)?;
        let PlacedObject {
            object,
            world_from_object,
            ..
        } = &self.primitives.instances[instance];
        let affine = Affine::new(world_from_object);
        // The whole as it were if the object stayed as it is and all else was reduced.
        let whole = self.all.enlarged(1.0 / self.enlargements[instance]);
        let place = place - self.before[instance];
        let SurfacePoint { position, normal } =
            self.objects[*object as usize].point(place, &whole, random);
        let normal = affine
            .cofactors()
            .map(|[a, b, c]| a * normal[0] + b * normal[1] + c * normal[2]);
        Some(SurfacePoint {
            position: affine.point(position),
            normal: unit(normal),
        })
    }
}

/// Sum of area times the outer product of the normal with itself.
#[derive(Clone, Copy, Default)]
struct Moments([[f64; 3]; 3]);

impl Moments {
    fn new(primitives: &Primitives) -> Self {
        let chunks = parallel::map(primitives.len().div_ceil(CHUNK), 1, |chunk| {
            let mut moments = Self::default();
            for index in chunk * CHUNK..primitives.len().min((chunk + 1) * CHUNK) {
                moments.add(primitives, index);
            }
            moments
        });
        chunks.iter().fold(Self::default(), |sum, moments| {
            Self(core::array::from_fn(|row| {
                core::array::from_fn(|column| sum.0[row][column] + moments.0[row][column])
            }))
        })
    }

    fn add(&mut self, primitives: &Primitives, index: usize) {
        let area = area(primitives, index);
        let normal = match primitives.prim(index) {
            Prim::Triangle(corners, _) => Some(unit_normal(corners)),
            Prim::Scalar(shape, _) => shape.flat_normal(),
        };
        for (row, moments) in self.0.iter_mut().enumerate() {
            for (column, moment) in moments.iter_mut().enumerate() {
                *moment += area
                    * match normal {
                        Some(normal) => normal[row] * normal[column],
                        // The mean over a sphere, or over a cube.
                        None if row == column => 1.0 / 3.0,
                        None => 0.0,
                    };
            }
        }
    }

    /// Factor by which a map enlarges the area: the root of the mean square over all normals, which is exact for
    /// maps that keep shapes and a little too much for others. 0 if there is no area.
    fn enlargement(&self, affine: &Affine, area: f64) -> f64 {
        let mut square = 0.0;
        for row in affine.cofactors() {
            for (a, moments) in row.iter().zip(&self.0) {
                for (b, moment) in row.iter().zip(moments) {
                    square += a * moment * b;
                }
            }
        }
        let enlargement = math::sqrt(square / area);
        if enlargement.is_finite() {
            enlargement
        } else {
            0.0
        }
    }
}
