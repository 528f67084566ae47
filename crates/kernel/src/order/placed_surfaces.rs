//! Points on the surfaces of instances.

use super::surface_rays::{Extent, Random, SurfacePoint, area, point, unit_normal};
use crate::build::parallel;
use crate::geometry::instance::{Affine, PlacedObject};
use crate::primitives::Primitives;

/// All instances, and how much surface they have in the world.
pub(super) struct PlacedSurfaces<'a> {
    primitives: &'a Primitives,
    /// Of every object.
    surfaces: Vec<Surface>,
    /// Of every instance.
    pub extents: Vec<Extent>,
}

/// The surface of an object.
#[derive(Default)]
struct Surface {
    /// Sums over the primitives up to each one: of their areas, and of the roots of these.
    areas: Vec<f64>,
    roots: Vec<f64>,
    /// Sum of area times the outer product of the normal with itself.
    moments: [[f64; 3]; 3],
}

impl Surface {
    fn new(primitives: &Primitives) -> Self {
        let mut surface = Self::default();
        let (mut areas, mut roots) = (0.0, 0.0);
        for index in 0..primitives.len() {
            let area = area(primitives, index);
            areas += area;
            roots += area.sqrt();
            surface.areas.push(areas);
            surface.roots.push(roots);
            let normal = primitives.triangles.get(index).map(unit_normal);
            for (row, moments) in surface.moments.iter_mut().enumerate() {
                for (column, moment) in moments.iter_mut().enumerate() {
                    *moment += area
                        * match normal {
                            Some(normal) => normal[row] * normal[column],
                            // The mean over a sphere.
                            None if row == column => 1.0 / 3.0,
                            None => 0.0,
                        };
                }
            }
        }
        surface
    }

    fn area(&self) -> f64 {
        self.areas.last().copied().unwrap_or(0.0)
    }

    fn root(&self) -> f64 {
        self.roots.last().copied().unwrap_or(0.0)
    }

    /// By how much a map enlarges the area: as the root of the mean square over all normals, which is exact for
    /// maps that keep shapes and a little too much for others.
    fn enlargement(&self, affine: &Affine) -> f64 {
        let cofactors = affine.cofactors();
        let mut square = 0.0;
        for row in cofactors {
            for (a, moments) in row.iter().zip(&self.moments) {
                for (b, moment) in row.iter().zip(moments) {
                    square += a * moment * b;
                }
            }
        }
        (square / self.area()).sqrt()
    }
}

impl<'a> PlacedSurfaces<'a> {
    pub fn new(primitives: &'a Primitives) -> Self {
        let surfaces = parallel::map(primitives.objects.len(), 1, |object| {
            Surface::new(&primitives.objects[object])
        });
        let extents = primitives.instances.iter().map(|placed| {
            let surface = &surfaces[placed.object as usize];
            let enlargement = surface.enlargement(&Affine::new(&placed.world_from_object));
            // Without area nothing is enlarged.
            let finite = enlargement.is_finite();
            let enlargement = if finite { enlargement } else { 0.0 };
            Extent {
                area: surface.area() * enlargement,
                root: surface.root() * enlargement.sqrt(),
                bounds: placed.placement.bounds(),
            }
        });
        Self {
            primitives,
            extents: extents.collect(),
            surfaces,
        }
    }

    /// A point on an instance: with the chances that its primitives have among all surfaces, of which there is
    /// as much as `all` says.
    pub fn point(&self, instance: usize, all: &Extent, random: &mut Random) -> SurfacePoint {
        let PlacedObject {
            object,
            world_from_object,
            ..
        } = &self.primitives.instances[instance];
        let (object, affine) = (*object as usize, Affine::new(world_from_object));
        let (surface, extent) = (&self.surfaces[object], &self.extents[instance]);
        let by_area = extent.area / all.area;
        let by_root = extent.root / all.root;
        let sums = if random.unit() * (by_area + by_root) < by_area {
            &surface.areas
        } else {
            &surface.roots
        };
        let target = random.unit() * sums.last().copied().unwrap_or(0.0);
        let index = sums.partition_point(|sum| *sum <= target);
        let index = index.min(sums.len() - 1);
        let SurfacePoint { position, normal } =
            point(&self.primitives.objects[object], index, random);
        let normal = affine
            .cofactors()
            .map(|[a, b, c]| a * normal[0] + b * normal[1] + c * normal[2]);
        let length = normal.map(|x| x * x).iter().sum::<f64>().sqrt();
        SurfacePoint {
            position: affine.point(position),
            normal: normal.map(|x| x / length),
        }
    }
}
