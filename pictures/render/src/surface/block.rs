//! Surfaces of many hits at once, in columns.
//!
//! Vertices miss the cache. They are prefetched for the whole block, so that the misses of different hits overlap.
//! The rest is computed in vectors. A lane has the same bits whatever the other lanes have, on every instruction set.

use antumbra::{Hit, INVALID_ID, Isa, Ray};
use antumbra_scene::{Geometry, TriangleMesh};
use antumbra_simd::{Dispatch, Simd, Width, WithSimd};
use glam::Vec3;

use super::Surface;
use super::curve::CurvePoint;
use super::origin_offset::{self, EDGE_ERRORS, Room, offset, offset_distance};
use super::point::{on_sphere, start_inside};
use super::shapes::Shapes;
use super::triangle::{Plane, edge_distance, interpolate, oriented, sides};
use crate::columns::{BLOCK, Column, Column3, Flags, Stage, columns, run, zero};

columns! {
    /// Surfaces of a block of hits.
    #[derive(Clone, Debug)]
    pub struct SurfaceBlock {
        found: Found,
        surfaces: Surfaces,
        /// Shape of each lane.
        pub hit: [ShapeHit; BLOCK],
    }
}

zero!(Found ShapeHit);

/// Part of the scene that was hit.
#[derive(Clone, Copy, Debug, Default)]
pub struct ShapeHit {
    /// Position in the scene's list of shapes.
    pub shape: u32,
    /// Instance that was hit, by the kernel's `inst_id`.
    pub inst_id: u32,
    /// Triangle of the mesh, or segment of the curves. 0 on a sphere.
    pub primitive: u32,
}

/// Hits and the vertices of their triangles.
#[derive(Clone, Debug, Default)]
struct Found {
    corners: [Column3; 3],
    normals: [Column3; 3],
    /// 1 or -1: the side of the geometric normal, and of the normals at the vertices.
    side: Column3,
    /// Barycentric coordinates and distance of the hits.
    uvt: Column3,
    /// Directions of the rays.
    dir: Column3,
    origin_offset: f32,
}

columns! {
    /// Columns of [`Surface`].
    #[derive(Clone, Debug)]
    pub struct Surfaces {
        /// Position in the world.
        pub point: Column3,
        /// Point of the surface above which rays begin.
        pub start: Column3,
        /// Distance from `start` at which rays begin.
        pub distance: Column,
        /// Beginning of rays on the side from which the ray came.
        pub origin: Column3,
        /// Unit geometric normal.
        pub normal: Column3,
        /// Unit shading normal.
        pub shading_normal: Column3,
        /// Unit direction towards where the ray came from.
        pub wo: Column3,
        error: Column3,
        /// Distance to the nearest edge in the space of the object, and the scale from there to the world.
        edge: Column,
        scale: Column,
        /// Whether the point is too close to an edge.
        narrow: Flags,
    }
}

impl Surfaces {
    /// [`Surface::faces_same_side`] of a lane.
    #[inline(always)]
    pub fn faces_same_side(&self, lane: usize, wi: Vec3) -> bool {
        let normal = self.normal.get(lane);
        wi.dot(normal) * self.wo.get(lane).dot(normal) > 0.0
    }

    /// Start of a ray along `dir`, as [`Surface::ray_along`] has it.
    #[inline(always)]
    pub fn leave(&self, lane: usize, dir: Vec3) -> Vec3 {
        let points = [self.start.get(lane), self.origin.get(lane)];
        let directions = [self.normal.get(lane), self.wo.get(lane)];
        origin_offset::leave(points, directions, self.distance[lane], dir)
    }
}

impl SurfaceBlock {
    /// Prefetches the triangles of hits at these `places`, to be computed later.
    pub fn prefetch(isa: Isa, shapes: &Shapes, hits: &[Option<Hit>], places: &[u32]) {
        isa.dispatch(FetchIndices {
            shapes,
            hits,
            places,
        });
    }

    /// Computes the surfaces of at most [`BLOCK`] hits, one per lane: hits of the `rays` at these `places`.
    ///
    /// # Panics
    /// If a ray has no hit.
    pub fn compute(
        &mut self,
        isa: Isa,
        shapes: &Shapes,
        rays: &[Ray],
        hits: &[Option<Hit>],
        places: &[u32],
    ) {
        let hit = |place: u32| hits[place as usize].as_ref().expect("a hit");
        let (mut special, mut has_curves) = (false, false);
        let found = &mut self.found;
        let mut triangles = Triangles {
            mesh: [None; BLOCK],
            number: [0; BLOCK],
            indices: [[0; 3]; BLOCK],
        };
        for (lane, &place) in places.iter().enumerate() {
            let hit = hit(place);
            let index = shapes.index_of(hit);
            let shape = &shapes[index];
            self.hit[lane] = ShapeHit {
                shape: index as u32,
                inst_id: hit.inst_id,
                primitive: hit.prim_id,
            };
            triangles.number[lane] = hit.prim_id;
            match &shape.geometry {
                Geometry::Mesh(mesh) => triangles.mesh[lane] = Some(mesh),
                Geometry::Sphere(_) => special = true,
                Geometry::Curves(_) => has_curves = true,
            }
        }
        for (lane, &place) in places.iter().enumerate() {
            let hit = hit(place);
            let [geometric, shading] = sides(&shapes[self.hit[lane].shape as usize]);
            found.side.set(lane, Vec3::new(geometric, shading, 0.0));
            found.uvt.set(lane, Vec3::new(hit.u, hit.v, hit.t));
            found.dir.set(lane, Vec3::from(rays[place as usize].dir));
            special |= hit.inst_id != INVALID_ID;
        }
        isa.dispatch(FetchVertices(&mut triangles));
        triangles.copy(found);
        found.origin_offset = shapes.origin_offset;
        run(isa, Interpolate(&self.found), &mut self.surfaces);
        if special {
            for (lane, &place) in places.iter().enumerate() {
                self.place(lane, shapes, &rays[place as usize], hit(place));
            }
        }
        run(isa, Leave(&self.found), &mut self.surfaces);
        for (lane, &place) in places.iter().enumerate() {
            if self.surfaces.narrow[lane] != 0 {
                self.move_inside(lane, shapes, hit(place));
            }
        }
        if has_curves {
            for (lane, &place) in places.iter().enumerate() {
                self.put_on_curve(lane, shapes, hit(place));
            }
        }
    }

    /// Surfaces of all lanes, as one column per number.
    #[inline]
    pub fn columns(&self) -> &Surfaces {
        &self.surfaces
    }

    /// Surface of a lane, with all its numbers.
    #[inline]
    pub fn surface(&self, lane: usize) -> Surface {
        let (columns, hit) = (&self.surfaces, &self.hit[lane]);
        Surface {
            point: columns.point.get(lane),
            start: columns.start.get(lane),
            distance: columns.distance[lane],
            origin_offset: self.found.origin_offset,
            origin: columns.origin.get(lane),
            normal: columns.normal.get(lane),
            shading_normal: columns.shading_normal.get(lane),
            wo: columns.wo.get(lane),
            shape: hit.shape as usize,
            inst_id: hit.inst_id,
            primitive: hit.primitive,
        }
    }

    /// Largest origin offset of rays.
    #[inline]
    pub fn origin_offset(&self) -> f32 {
        self.found.origin_offset
    }

    /// Puts a lane on its sphere, and moves it from the object to the world.
    fn place(&mut self, lane: usize, shapes: &Shapes, ray: &Ray, hit: &Hit) {
        let columns = &mut self.surfaces;
        let placement = shapes.placement(hit);
        let placement = placement.as_deref();
        let shape = &shapes[self.hit[lane].shape as usize];
        if let Geometry::Sphere(sphere) = &shape.geometry {
            let (point, error, normal) = on_sphere(shape, sphere, placement, ray, hit);
            columns.point.set(lane, point);
            columns.error.set(lane, error);
            columns.normal.set(lane, normal);
            columns.shading_normal.set(lane, normal);
            columns.edge[lane] = f32::INFINITY;
        }
        if let Some(placement) = placement {
            let (point, error) = placement.point(columns.point.get(lane), columns.error.get(lane));
            columns.point.set(lane, point);
            columns.error.set(lane, error);
            for normals in [&mut columns.normal, &mut columns.shading_normal] {
                normals.set(lane, placement.normal(normals.get(lane)));
            }
            columns.scale[lane] = placement.least_scale;
        }
    }

    /// Puts a lane that hit a curve on the curve.
    fn put_on_curve(&mut self, lane: usize, shapes: &Shapes, hit: &Hit) {
        let index = self.hit[lane].shape as usize;
        let Geometry::Curves(curves) = &shapes[index].geometry else {
            return;
        };
        let columns = &mut self.surfaces;
        let (wo, placement) = (columns.wo.get(lane), shapes.placement(hit));
        let found = CurvePoint::new(shapes, (index, curves), hit, wo, placement.as_deref());
        columns.point.set(lane, found.point);
        columns.normal.set(lane, found.normal);
        columns.shading_normal.set(lane, found.normal);
        columns.start.set(lane, found.start);
        columns.distance[lane] = found.distance;
        let origin = offset(found.start, found.normal, found.distance, wo);
        columns.origin.set(lane, origin);
    }

    /// Moves the beginning of rays from an edge.
    #[cold]
    fn move_inside(&mut self, lane: usize, shapes: &Shapes, hit: &Hit) {
        let (columns, found) = (&mut self.surfaces, &self.found);
        let [u, v, t] = found.uvt.get(lane).to_array();
        let error = columns.error.get(lane);
        let corners = [0, 1, 2].map(|corner| found.corners[corner].get(lane));
        let (edge, scale) = (columns.edge[lane], columns.scale[lane]);
        let weights = [1.0 - u - v, u, v];
        let wanted = EDGE_ERRORS * error.max_element();
        let placement = shapes.placement(hit);
        let placement = placement.as_deref();
        let (start, edge) = start_inside(corners, weights, edge, wanted / scale, placement);
        let normal = columns.normal.get(lane);
        let room = Room {
            edge: edge * scale,
            height: t * found.dir.get(lane).dot(normal).abs(),
        };
        let distance = offset_distance(error, normal, found.origin_offset, room);
        columns.start.set(lane, start);
        columns.distance[lane] = distance;
        let origin = offset(start, normal, distance, columns.wo.get(lane));
        columns.origin.set(lane, origin);
    }
}

/// Triangles of a block of hits.
struct Triangles<'a> {
    mesh: [Option<&'a TriangleMesh>; BLOCK],
    number: [u32; BLOCK],
    indices: [[u32; 3]; BLOCK],
}

impl Triangles<'_> {
    fn copy(&self, found: &mut Found) {
        for lane in 0..BLOCK {
            let Some(mesh) = self.mesh[lane] else {
                continue;
            };
            let indices = self.indices[lane];
            for (corners, index) in found.corners.iter_mut().zip(indices) {
                corners.set(lane, Vec3::from(mesh.positions[index as usize]));
            }
            let has_normals = !mesh.normals.is_empty();
            for (normals, index) in found.normals.iter_mut().zip(indices) {
                let normal = if has_normals {
                    mesh.normals[index as usize]
                } else {
                    Vec3::ZERO
                };
                normals.set(lane, normal);
            }
        }
    }
}

/// Prefetches the indices of the triangles that were hit, and the placements of instances. A prefetch does not wait, so all misses overlap.
struct FetchIndices<'a> {
    shapes: &'a Shapes,
    hits: &'a [Option<Hit>],
    places: &'a [u32],
}

impl WithSimd<16> for FetchIndices<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<16>>(self, simd: S) {
        for &place in self.places {
            let Some(hit) = &self.hits[place as usize] else {
                continue;
            };
            let index = self.shapes.index_of(hit);
            match &self.shapes[index].geometry {
                Geometry::Mesh(mesh) => {
                    if let Some(indices) = mesh.indices.get(hit.prim_id as usize) {
                        simd.prefetch(indices);
                    }
                }
                Geometry::Sphere(_) => {}
                Geometry::Curves(_) => {
                    if let Some(part) = self.shapes.curve_parts(index).get(hit.prim_id as usize) {
                        simd.prefetch(part);
                    }
                }
            }
            if let Some(placement) = self.shapes.stored_placement(hit) {
                simd.prefetch(placement);
            }
        }
    }
}

/// Reads the indices of all triangles and prefetches their vertices.
struct FetchVertices<'a, 'm>(&'a mut Triangles<'m>);

impl WithSimd<16> for FetchVertices<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<16>>(self, simd: S) {
        let Triangles {
            mesh,
            number,
            indices,
        } = self.0;
        for lane in 0..BLOCK {
            let Some(mesh) = mesh[lane] else {
                continue;
            };
            indices[lane] = mesh.indices[number[lane] as usize];
            for index in indices[lane] {
                simd.prefetch(&mesh.positions[index as usize]);
                if let Some(normal) = mesh.normals.get(index as usize) {
                    simd.prefetch(normal);
                }
            }
        }
    }
}

/// Points of triangles in their own space.
struct Interpolate<'a>(&'a Found);

impl Stage for Interpolate<'_> {
    type Out = Surfaces;

    #[inline(always)]
    fn run(self, out: &mut Surfaces) {
        let found = self.0;
        for lane in 0..BLOCK {
            let [a, b, c] = &found.corners;
            let corners = [a.get(lane), b.get(lane), c.get(lane)];
            let [a, b, c] = &found.normals;
            let normals = [a.get(lane), b.get(lane), c.get(lane)];
            let [u, v, _] = found.uvt.get(lane).to_array();
            let weights = [1.0 - u - v, u, v];
            let [geometric, shading, _] = found.side.get(lane).to_array();
            let plane = Plane::new(corners);
            let (point, error) = interpolate(corners, weights);
            let (normal, shading) = oriented(plane.normal * geometric, normals, weights, shading);
            out.point.set(lane, point);
            out.error.set(lane, error);
            out.normal.set(lane, normal);
            out.shading_normal.set(lane, shading);
            out.edge[lane] = edge_distance(corners, weights, plane.double_area);
            out.scale[lane] = 1.0;
        }
    }
}

/// Beginning of the rays that leave the points.
struct Leave<'a>(&'a Found);

impl Stage for Leave<'_> {
    type Out = Surfaces;

    #[inline(always)]
    fn run(self, out: &mut Surfaces) {
        let found = self.0;
        let origin_offset = found.origin_offset;
        for lane in 0..BLOCK {
            let (point, error) = (out.point.get(lane), out.error.get(lane));
            let (normal, dir) = (out.normal.get(lane), found.dir.get(lane));
            let edge = out.edge[lane] * out.scale[lane];
            let [_, _, t] = found.uvt.get(lane).to_array();
            let room = Room {
                edge,
                height: t * dir.dot(normal).abs(),
            };
            let distance = offset_distance(error, normal, origin_offset, room);
            let wo = (-dir).normalize();
            out.wo.set(lane, wo);
            out.start.set(lane, point);
            out.distance[lane] = distance;
            out.origin.set(lane, offset(point, normal, distance, wo));
            out.narrow[lane] = u32::from(edge < EDGE_ERRORS * error.max_element());
        }
    }
}
