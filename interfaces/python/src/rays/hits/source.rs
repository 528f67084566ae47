//! Where hits are, and their normals.

use std::sync::Arc;

use antumbra::{Hit, Instance, Ray};
use pyo3::prelude::*;

use super::At;
use crate::arrays::memory;
use crate::scene::SceneData;
use crate::scene::parts::{Ids, Parts, Triangles, between, cross, placed};

/// Data from which points and normals of hits are computed.
#[derive(Clone)]
pub struct Source {
    pub(super) parts: Arc<Parts>,
    /// The scene where it has spheres or curves: only its tree knows their normals.
    others: Option<Arc<SceneData>>,
    /// Rays of the hits where the scene has spheres or curves, on which ids and weights do not give the place.
    pub(super) rays: Vec<Ray>,
}

impl Source {
    /// `rays` has the ray of each of so many hits, and is used if that is needed.
    pub fn new(
        scene: &Arc<SceneData>,
        rays: impl Iterator<Item = Ray>,
        hits: usize,
    ) -> PyResult<Self> {
        let rays = match scene.has_others {
            true => memory::collected(rays, hits, "rays")?,
            false => Vec::new(),
        };
        Ok(Self {
            parts: scene.parts.clone(),
            others: scene.has_others.then(|| scene.clone()),
            rays,
        })
    }

    /// The data of some of the hits.
    pub(super) fn of(&self, places: &[usize]) -> PyResult<Self> {
        let rays = match self.rays.is_empty() {
            true => Vec::new(),
            false => {
                let rays = places.iter().map(|&place| self.rays[place]);
                memory::collected(rays, places.len(), "rays")?
            }
        };
        Ok(Self {
            rays,
            ..self.clone()
        })
    }

    /// Point of a hit of something that has no triangles.
    #[cold]
    pub(super) fn point_on_ray(&self, t: f32, place: usize) -> Option<[f64; 3]> {
        let ray = self.rays.get(place)?;
        Some([0, 1, 2].map(|axis| {
            let here = f64::from(ray.org[axis]) + f64::from(t) * f64::from(ray.dir[axis]);
            here + self.parts.local.origin[axis]
        }))
    }

    /// Normal of a hit of something that has no triangles.
    #[cold]
    pub(super) fn normal_on_ray(&self, at: At) -> Option<[f32; 3]> {
        let ray = self.rays.get(at.place)?;
        let [geom_id, inst_id] = self.parts.kernel_ids(at.ids)?;
        let hit = Hit {
            t: at.t,
            u: at.uv[0],
            v: at.uv[1],
            prim_id: at.ids.triangle as u32,
            geom_id,
            inst_id,
        };
        self.others.as_ref()?.bvh().normal(ray, &hit)
    }
}

/// Meshes by their numbers, to find the corners of many hits.
pub(super) struct Meshes<'a> {
    meshes: Vec<Triangles<'a>>,
    instances: &'a [Instance],
    origin: [f64; 3],
}

impl<'a> Meshes<'a> {
    pub(super) fn of(parts: &'a Parts) -> Self {
        let meshes = parts
            .parts
            .iter()
            .map(|part| part.triangles().unwrap_or_default());
        Self {
            meshes: meshes.collect(),
            instances: &parts.instances,
            origin: parts.local.origin,
        }
    }

    /// Corners of a triangle in its mesh.
    #[inline(always)]
    fn corners(&self, ids: Ids) -> Option<[[f64; 3]; 3]> {
        // Ids of what is not there are negative, and therefore beyond all lists.
        let (positions, indices) = self.meshes.get(ids.mesh as usize)?;
        let [a, b, c] = *indices.get(ids.triangle as usize)?;
        let corner = |corner: u32| positions.get(corner as usize);
        let corners = [corner(a)?, corner(b)?, corner(c)?];
        Some(corners.map(|corner| corner.map(f64::from)))
    }

    #[inline(always)]
    pub(super) fn point(&self, ids: Ids, uv: [f32; 2]) -> Option<[f64; 3]> {
        let [a, b, c] = self.corners(ids)?;
        let [u, v] = uv.map(f64::from);
        let w = 1.0 - u - v;
        let [x, y, z] = [0, 1, 2].map(|axis| w * a[axis] + u * b[axis] + v * c[axis]);
        let placed = placed(self.instances.get(ids.instance as usize), [x, y, z]);
        Some([0, 1, 2].map(|axis| placed[axis] + self.origin[axis]))
    }

    #[inline(always)]
    pub(super) fn normal(&self, ids: Ids) -> Option<[f32; 3]> {
        let [a, b, c] = self.corners(ids)?;
        let (p, q) = (between(a, b), between(a, c));
        match self.instances.get(ids.instance as usize) {
            None => unit_normal(p, q),
            Some(instance) => {
                let placed = |[x, y, z]: [f64; 3]| {
                    instance.transform.map(|row| {
                        let [a, b, c, _] = row.map(f64::from);
                        a * x + b * y + c * z
                    })
                };
                unit_normal(placed(p), placed(q))
            }
        }
    }
}

/// Normal of a triangle with these sides, of length 1; `None` if it has no area.
#[inline(always)]
fn unit_normal(p: [f64; 3], q: [f64; 3]) -> Option<[f32; 3]> {
    let [x, y, z] = cross(p, q);
    let squared = x * x + y * y + z * z;
    let scale = 1.0 / squared.sqrt();
    (squared > 0.0).then(|| [x, y, z].map(|x| (x * scale) as f32))
}
