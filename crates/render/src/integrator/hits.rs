//! Closest hits of many rays, and the surfaces that were hit.
//!
//! # Blocks
//!
//! Surfaces are computed a block at a time, in short loops: indices, vertices, roots, results. Vertices miss the
//! cache and roots take long. In a short loop the misses and roots of different hits overlap. One hit at a time,
//! between shading, each would be waited for in full.

use antumbra::{Hit, Ray};
use antumbra_scene::Geometry;

use super::tracer::Tracer;
use crate::surface::{Plane, Shapes, Surface, Vertices};

/// Number of hits in a block. Their data fits the first cache.
pub const BLOCK: usize = 64;

/// Hits of the rays of one stage.
#[derive(Debug, Default)]
pub struct Hits {
    hits: Vec<Option<Hit>>,
    /// Block that the other fields hold, if any.
    block: Option<usize>,
    indices: Vec<[u32; 3]>,
    vertices: Vec<Vertices>,
    planes: Vec<Plane>,
    surfaces: Vec<Option<Surface>>,
}

impl Hits {
    /// Traces `rays`. Earlier hits are forgotten.
    pub fn find(&mut self, tracer: &mut Tracer, rays: &[Ray]) {
        tracer.intersect(rays, &mut self.hits);
        self.block = None;
    }

    /// Surface that ray `index` of the traced `rays` has hit. Quick if asked in order.
    pub fn surface(&mut self, shapes: &Shapes, rays: &[Ray], index: usize) -> Option<Surface> {
        let (block, place) = (index / BLOCK, index % BLOCK);
        if self.block != Some(block) {
            self.compute(shapes, rays, block);
        }
        self.surfaces[place]
    }

    /// Hit of ray `index`.
    pub fn hit(&self, index: usize) -> Option<&Hit> {
        self.hits[index].as_ref()
    }

    fn compute(&mut self, shapes: &Shapes, rays: &[Ray], block: usize) {
        self.block = Some(block);
        let range = block * BLOCK..self.hits.len().min((block + 1) * BLOCK);
        let (hits, rays) = (&self.hits[range.clone()], &rays[range]);
        let mesh = |hit: &Option<Hit>| {
            hit.as_ref()
                .and_then(|hit| match &shapes[shapes.index_of(hit)].geometry {
                    Geometry::Mesh(mesh) => Some((mesh, hit.prim_id as usize)),
                    Geometry::Sphere(_) => None,
                })
        };
        self.indices.clear();
        self.indices.extend(
            hits.iter()
                .map(|hit| mesh(hit).map_or([0; 3], |(mesh, triangle)| mesh.indices[triangle])),
        );
        self.vertices.clear();
        let found = hits.iter().zip(&self.indices);
        self.vertices.extend(found.map(|(hit, &indices)| {
            mesh(hit).map_or(Vertices::default(), |(mesh, _)| {
                Vertices::new(mesh, indices)
            })
        }));
        self.planes.clear();
        let vertices = self.vertices.iter();
        self.planes
            .extend(vertices.map(|vertices| Plane::new(vertices.corners)));
        self.surfaces.clear();
        let found = hits.iter().zip(rays).zip(&self.vertices).zip(&self.planes);
        self.surfaces
            .extend(found.map(|(((hit, ray), vertices), plane)| {
                hit.as_ref()
                    .map(|hit| Surface::at(shapes, ray, hit, vertices, plane))
            }));
    }
}
