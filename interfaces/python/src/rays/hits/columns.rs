//! Ids and places of hits before they become arrays.

use std::ops::Range;

use antumbra::{ClosestPoint, Hit, PrimId};
use pyo3::prelude::*;

use crate::arrays::memory;
use crate::scene::SceneData;
use crate::scene::parts::Ids;

/// Ids and places of hits, one column for each.
#[derive(Default)]
pub struct Columns {
    pub t: Vec<f32>,
    pub triangle: Vec<i32>,
    pub mesh: Vec<i32>,
    pub instance: Vec<i32>,
    pub uv: Vec<f32>,
}

/// What columns have of one hit, or of one nearest point.
#[derive(Clone, Copy)]
pub struct Row {
    t: f32,
    ids: Ids,
    uv: [f32; 2],
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
        let mut columns = Self::default();
        columns.grow(len)?;
        Ok(columns)
    }

    /// Appends rows of rays that hit nothing.
    pub fn grow(&mut self, more: usize) -> PyResult<Rows<'_>> {
        let first = self.t.len();
        let len = first + more;
        memory::grow(&mut self.t, more, HITS)?;
        memory::grow(&mut self.triangle, more, HITS)?;
        memory::grow(&mut self.mesh, more, HITS)?;
        memory::grow(&mut self.instance, more, HITS)?;
        memory::grow(&mut self.uv, 2 * more, WEIGHTS)?;
        self.t.resize(len, f32::INFINITY);
        self.triangle.resize(len, -1);
        self.mesh.resize(len, -1);
        self.instance.resize(len, -1);
        self.uv.resize(2 * len, 0.0);
        Ok(self.rows(first..len))
    }

    /// Drops all rows but the first so many.
    pub fn truncate(&mut self, len: usize) {
        self.t.truncate(len);
        self.triangle.truncate(len);
        self.mesh.truncate(len);
        self.instance.truncate(len);
        self.uv.truncate(2 * len);
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
}

impl Row {
    pub fn of_hit(scene: &SceneData, hit: &Hit) -> Self {
        Self {
            t: hit.t,
            ids: scene.ids(hit),
            uv: [hit.u, hit.v],
        }
    }

    pub fn of_point(scene: &SceneData, near: &ClosestPoint) -> Self {
        Self {
            t: near.distance,
            ids: scene.ids(PrimId {
                inst_id: near.inst_id,
                geom_id: near.geom_id,
                prim_id: near.prim_id,
            }),
            uv: [near.u, near.v],
        }
    }
}

impl Rows<'_> {
    #[inline(always)]
    pub fn set(&mut self, place: usize, row: Row) {
        self.t[place] = row.t;
        self.triangle[place] = row.ids.triangle;
        self.mesh[place] = row.ids.mesh;
        self.instance[place] = row.ids.instance;
        self.uv[place] = row.uv;
    }

    /// Writes what was found for as many rays or points. Rows without anything stay as they are.
    pub fn fill<T>(mut self, found: &[Option<T>], row: impl Fn(&T) -> Row) {
        for (place, found) in found.iter().enumerate() {
            if let Some(found) = found {
                self.set(place, row(found));
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
