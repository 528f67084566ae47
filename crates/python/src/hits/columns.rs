//! Ids and places of hits before they become arrays.

use std::ops::Range;

use antumbra::{ClosestPoint, Hit};
use pyo3::prelude::*;

use crate::geometry::Ids;
use crate::memory;
use crate::scene::SceneData;

/// Ids and places of hits, one column for each.
#[derive(Default)]
pub struct Columns {
    pub t: Vec<f32>,
    pub triangle: Vec<i32>,
    pub mesh: Vec<i32>,
    pub instance: Vec<i32>,
    pub uv: Vec<f32>,
}

/// Names of what columns hold, where there is no memory for it.
const HITS: &str = "hits";
const WEIGHTS: &str = "weights of hits";

/// Some rows of columns.
pub struct Rows<'a> {
    t: &'a mut [f32],
    triangle: &'a mut [i32],
    mesh: &'a mut [i32],
    instance: &'a mut [i32],
    uv: &'a mut [[f32; 2]],
}

impl Columns {
    /// Rows of rays that hit nothing.
    pub fn missed(len: usize) -> PyResult<Self> {
        Ok(Self {
            t: memory::filled(f32::INFINITY, len, HITS)?,
            triangle: memory::filled(-1, len, HITS)?,
            mesh: memory::filled(-1, len, HITS)?,
            instance: memory::filled(-1, len, HITS)?,
            uv: memory::filled(0.0, 2 * len, WEIGHTS)?,
        })
    }

    /// Makes room for more rows.
    pub fn grow(&mut self, more: usize) -> PyResult<()> {
        memory::grow(&mut self.t, more, HITS)?;
        memory::grow(&mut self.triangle, more, HITS)?;
        memory::grow(&mut self.mesh, more, HITS)?;
        memory::grow(&mut self.instance, more, HITS)?;
        memory::grow(&mut self.uv, 2 * more, WEIGHTS)
    }

    pub fn rows(&mut self, range: Range<usize>) -> Rows<'_> {
        Rows {
            t: &mut self.t[range.clone()],
            triangle: &mut self.triangle[range.clone()],
            mesh: &mut self.mesh[range.clone()],
            instance: &mut self.instance[range.clone()],
            uv: &mut self.uv.as_chunks_mut().0[range],
        }
    }

    pub fn push(&mut self, scene: &SceneData, hit: &Hit) {
        let ids = Ids::of_hit(scene, hit);
        self.t.push(hit.t);
        self.triangle.push(ids.triangle);
        self.mesh.push(ids.mesh);
        self.instance.push(ids.instance);
        self.uv.extend([hit.u, hit.v]);
    }
}

impl Rows<'_> {
    /// Writes hits of as many rays. Rows of rays that hit nothing stay as they are.
    pub fn fill(self, scene: &SceneData, hits: &[Option<Hit>]) {
        for (row, hit) in hits.iter().enumerate() {
            if let Some(hit) = hit {
                let ids = Ids::of_hit(scene, hit);
                self.t[row] = hit.t;
                self.triangle[row] = ids.triangle;
                self.mesh[row] = ids.mesh;
                self.instance[row] = ids.instance;
                self.uv[row] = [hit.u, hit.v];
            }
        }
    }

    /// Writes nearest points of as many points.
    pub fn fill_near(self, scene: &SceneData, found: &[Option<ClosestPoint>]) {
        for (row, near) in found.iter().enumerate() {
            if let Some(near) = near {
                let ids = Ids::of_point(scene, near);
                self.t[row] = near.distance;
                self.triangle[row] = ids.triangle;
                self.mesh[row] = ids.mesh;
                self.instance[row] = ids.instance;
                self.uv[row] = [near.u, near.v];
            }
        }
    }

    /// Chunks of `len` rows, the last one perhaps shorter.
    pub fn chunks(self, len: usize) -> Vec<Self> {
        let columns = self.t.chunks_mut(len).zip(self.triangle.chunks_mut(len));
        let columns = columns
            .zip(self.mesh.chunks_mut(len))
            .zip(self.instance.chunks_mut(len));
        let columns = columns.zip(self.uv.chunks_mut(len));
        columns
            .map(|((((t, triangle), mesh), instance), uv)| Self {
                t,
                triangle,
                mesh,
                instance,
                uv,
            })
            .collect()
    }
}
