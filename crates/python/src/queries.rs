//! Closest hits and all hits of rays.

use antumbra::{Batch, Hit};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::hits::Columns;
use crate::memory;
use crate::rays::{Call, Gathering, PIECE, Piece, RaySource};
use crate::scene::SceneData;

/// Rays of one thread between two looks for signals, where all hits are asked for.
const PIECE_OF_LISTS: usize = 1 << 16;

/// Rows that a thread writes at a time.
const ROWS: usize = 1 << 13;

/// First hit of every ray.
pub fn first_hits<R: RaySource>(
    py: Python<'_>,
    scene: &SceneData,
    rays: &R,
    call: &mut Call<'_>,
) -> PyResult<Columns> {
    let mut columns = Columns::missed(rays.len())?;
    let (mut gathered, mut hits) = (Vec::new(), Vec::new());
    let query = |batch: Batch<'_>, hits: &mut [Option<Hit>]| batch.closed().intersect_into(hits);
    call.in_pieces(py, rays.len(), PIECE, |range, threads| {
        let rows = columns.rows(range.clone());
        let piece = Piece {
            bvh: &scene.bvh,
            rays,
            range,
            threads,
        };
        py.detach(|| {
            memory::refill(&mut hits, None, piece.range.len(), "hits")?;
            piece.ask(&mut gathered, Gathering::All, &mut hits, &query)?;
            if piece.is_alone() {
                rows.fill(scene, &hits);
            } else {
                let rows = rows.chunks(ROWS).into_par_iter().zip(hits.par_chunks(ROWS));
                piece.run(|| rows.for_each(|(rows, hits)| rows.fill(scene, hits)));
            }
            Ok(())
        })
    })?;
    Ok(columns)
}

/// First triangle of every ray, -1 for none.
pub fn first_triangles<R: RaySource>(
    py: Python<'_>,
    scene: &SceneData,
    rays: &R,
    call: &mut Call<'_>,
) -> PyResult<Vec<i64>> {
    let mut triangles = memory::room(rays.len(), "triangles")?;
    let (mut gathered, mut hits) = (Vec::new(), Vec::new());
    let query = |batch: Batch<'_>, hits: &mut [Option<Hit>]| batch.closed().intersect_into(hits);
    call.in_pieces(py, rays.len(), PIECE, |range, threads| {
        let piece = Piece {
            bvh: &scene.bvh,
            rays,
            range,
            threads,
        };
        py.detach(|| {
            memory::refill(&mut hits, None, piece.range.len(), "hits")?;
            piece.ask(&mut gathered, Gathering::All, &mut hits, &query)?;
            let ids = hits
                .iter()
                .map(|hit| hit.map_or(-1, |hit| i64::from(hit.prim_id)));
            triangles.extend(ids);
            Ok(())
        })
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

/// The nearest hits of every ray, so many at most, over closed intervals.
pub fn all_hits<R: RaySource>(
    py: Python<'_>,
    scene: &SceneData,
    rays: &R,
    most: usize,
    call: &mut Call<'_>,
) -> PyResult<Lists> {
    let mut lists = Lists {
        splits: memory::room(rays.len() + 1, "splits")?,
        columns: Columns::default(),
    };
    lists.splits.push(0);
    let mut some = Vec::new();
    call.in_pieces(py, rays.len(), PIECE_OF_LISTS, |range, threads| {
        let piece = Piece {
            bvh: &scene.bvh,
            rays,
            range,
            threads,
        };
        py.detach(|| {
            some.clear();
            memory::grow(&mut some, piece.range.len(), "rays")?;
            rays.gather(piece.range.start, piece.range.len(), &mut some);
            let batch = scene.bvh.batch(&some).closed();
            let found = piece.run(|| match piece.is_alone() {
                true => batch.on_this_thread().all_hits(),
                false => batch.all_hits(),
            });
            let kept = |ray| found.of(ray).len().min(most);
            lists.columns.grow((0..found.len()).map(kept).sum())?;
            for ray in 0..found.len() {
                for hit in &found.of(ray)[..kept(ray)] {
                    lists.columns.push(scene, hit);
                }
                lists.splits.push(lists.columns.t.len() as i64);
            }
            Ok(())
        })
    })?;
    Ok(lists)
}
