//! Closest hits and all hits of rays.

use antumbra::{Aabb, Batch, Hit, PrimId, Ray};
use pyo3::prelude::*;
use rayon::prelude::*;

use super::hits::{Columns, Row};
use super::piece::{self, RaySource};
use crate::arrays::memory;
use crate::call::Call;
use crate::scene::SceneData;
use crate::scene::parts::{Ids, between, cross};

/// Rays of one thread between two looks for signals, where all hits are wanted.
const PIECE_OF_LISTS: usize = 1 << 16;

/// Rows that a thread writes at a time.
const ROWS: usize = 1 << 13;

/// First hit of every ray.
pub fn first_hits(
    call: &mut Call<'_>,
    scene: &SceneData,
    rays: &impl RaySource,
) -> PyResult<Columns> {
    let mut columns = Columns::missed(rays.len())?;
    let row = |hit: &Hit| Row::of_hit(scene, hit);
    piece::first_hits(call, (scene.bvh(), rays), |piece, hits| {
        let rows = columns.rows(piece.range.clone());
        if piece.is_alone() {
            rows.fill(hits, row);
        } else {
            let rows = rows.chunks(ROWS).into_par_iter().zip(hits.par_chunks(ROWS));
            piece.run(|| rows.for_each(|(rows, hits)| rows.fill(hits, row)));
        }
        Ok(())
    })?;
    Ok(columns)
}

/// An occluder of every ray: triangle, mesh and instance, -1 for none.
pub fn occluders(
    call: &mut Call<'_>,
    scene: &SceneData,
    rays: &impl RaySource,
) -> PyResult<[Vec<i32>; 3]> {
    let mut found = memory::filled(None, rays.len(), "occluders")?;
    let query =
        |batch: Batch<'_>, found: &mut [Option<PrimId>]| batch.closed().occluders_into(found);
    piece::trace(call, (scene.bvh(), rays), &mut found, query)?;
    let column = |of: fn(Ids) -> i32| {
        let ids = found
            .iter()
            .map(|found| found.map_or(-1, |prim| of(scene.ids(prim))));
        memory::collected(ids, found.len(), "occluders")
    };
    call.py.detach(|| {
        Ok([
            column(|ids| ids.triangle)?,
            column(|ids| ids.mesh)?,
            column(|ids| ids.instance)?,
        ])
    })
}

/// First triangle of every ray, -1 for none.
pub fn first_triangles(
    call: &mut Call<'_>,
    scene: &SceneData,
    rays: &impl RaySource,
) -> PyResult<Vec<i64>> {
    let mut triangles = memory::room(rays.len(), "triangles")?;
    let triangle = |hit: &Option<Hit>| hit.map_or(-1, |hit| hit.prim_id.into());
    piece::first_hits(call, (scene.bvh(), rays), |_, hits| {
        triangles.extend(hits.iter().map(triangle));
        Ok(())
    })?;
    Ok(triangles)
}

/// Hits of many rays, one list after the other.
pub struct Lists {
    /// Where the list of each ray begins, and the number of hits at the end.
    pub splits: Vec<i64>,
    pub columns: Columns,
}

impl Lists {
    /// Ray of every hit.
    pub fn rays(&self) -> impl Iterator<Item = usize> {
        let lists = self.splits.windows(2).enumerate();
        lists.flat_map(|(ray, ends)| (ends[0]..ends[1]).map(move |_| ray))
    }
}

/// Which hits of a ray are kept.
#[derive(Clone, Copy)]
pub struct Choice {
    /// So many of the nearest.
    pub most: usize,
    /// Of those that lie together on one side of a mesh, the first.
    pub distinct: bool,
}

/// Finds out which hits of a ray are one: a ray through an edge hits two triangles.
struct Distinct<'a> {
    scene: &'a SceneData,
    bounds: Aabb,
    kept: Vec<Hit>,
}

impl Distinct<'_> {
    /// The hits that are left. Of hits of one mesh that are no farther apart than rounding reaches, the first of each side
    /// counts: a thin plate has two sides, and the outline of a body as well.
    fn of(&mut self, ray: &Ray, hits: &[Hit]) -> &[Hit] {
        self.kept.clear();
        let length = ray.dir.iter().map(|x| x * x).sum::<f32>().sqrt();
        let offset = self.bounds.union(&Aabb::around(&[ray.org])).origin_offset() / length;
        for hit in hits {
            let is_near = |last: &Hit| (last.geom_id, last.inst_id) == (hit.geom_id, hit.inst_id);
            let near = (self.kept.iter().rev()).take_while(|last| hit.t - last.t <= offset);
            let mut near = near.filter(|last| is_near(last)).peekable();
            let is_new = near.peek().is_none() || {
                let side = self.side(ray, hit);
                !near.any(|last| self.side(ray, last) == side)
            };
            if is_new {
                self.kept.push(*hit);
            }
        }
        &self.kept
    }

    /// Which side of its triangle a ray hits; `None` for spheres and curves, which are hit on one side.
    fn side(&self, ray: &Ray, hit: &Hit) -> Option<bool> {
        let [a, b, c] = self.scene.parts.corners(self.scene.ids(hit))?;
        let normal = cross(between(a, b), between(a, c));
        let along = (0..3).map(|axis| normal[axis] * f64::from(ray.dir[axis]));
        Some(along.sum::<f64>() > 0.0)
    }
}

/// The nearest hits of every ray, so many at most, over closed intervals.
pub fn all_hits(
    call: &mut Call<'_>,
    scene: &SceneData,
    rays: &impl RaySource,
    Choice { most, distinct }: Choice,
) -> PyResult<Lists> {
    let mut lists = Lists {
        splits: memory::room(rays.len() + 1, "splits")?,
        columns: Columns::default(),
    };
    lists.splits.push(0);
    let mut some = Vec::new();
    let mut unique = Distinct {
        scene,
        bounds: scene.bvh().bounds(),
        kept: Vec::new(),
    };
    piece::in_pieces(call, (scene.bvh(), rays), PIECE_OF_LISTS, |piece| {
        let (start, len) = (piece.range.start, piece.range.len());
        some.clear();
        memory::grow(&mut some, len, "rays")?;
        rays.gather(start, len, &mut some);
        let batch = rays.conditioned(piece.bvh.batch(&some).closed(), start, len);
        let found = piece.run(|| match piece.is_alone() {
            true => batch.on_this_thread().all_hits(),
            false => batch.all_hits(),
        });
        let kept = |ray| found.of(ray).len().min(most);
        let mut place = 0;
        let first = lists.columns.t.len();
        let mut rows = lists.columns.grow((0..found.len()).map(kept).sum())?;
        for ray in 0..found.len() {
            let hits = match distinct {
                true => unique.of(&some[ray], found.of(ray)),
                false => found.of(ray),
            };
            for hit in &hits[..hits.len().min(most)] {
                rows.set(place, Row::of_hit(scene, hit));
                place += 1;
            }
            lists.splits.push((first + place) as i64);
        }
        // Hits that were not distinct leave rows over.
        lists.columns.truncate(first + place);
        Ok(())
    })?;
    Ok(lists)
}
