//! Hits as trimesh returns them: in double precision, and no two of one ray at the same place.

use antumbra::Hit;
use numpy::{PyArray1, PyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::prelude::*;

use super::arguments::RayArrays;
use super::piece::{self, RaySource};
use crate::arrays::broadcast::Operand;
use crate::arrays::{Numbers, memory, shaped, wrong_shape};
use crate::call::Call;
use crate::scene::SceneData;
use crate::scene::parts::{between, cross};

/// Rays of one thread between two looks for signals, where all hits are wanted.
const PIECE_OF_LISTS: usize = 1 << 15;

/// Rays that a thread takes at a time.
const FEW: usize = 1 << 10;

/// Rays that come so near to the plane of a triangle, by the sine of the angle, are not brought onto it.
const PARALLEL: f64 = 1e-9;

/// How hits are computed, and which count as one.
pub struct Choices<'a> {
    /// Triangles of the one mesh.
    indices: &'a [[u32; 3]],
    /// Its vertices, not rounded.
    pub vertices: Operand<'a>,
    pub max_hits: usize,
    /// Hits of a ray at most so far apart, in units of the scene, are one.
    pub offset: f64,
}

/// One hit of a ray.
#[derive(Clone, Copy)]
struct Found {
    ray: i64,
    triangle: i64,
    /// Distance in units of the scene.
    distance: f64,
    place: [f64; 3],
}

/// Triangles, rays and places of hits: arrays of shapes (m,), (m,) and (m, 3).
pub type Told<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArrayDyn<f64>>,
);

/// Hits of every ray, ray by ray, the nearest first.
pub fn hits<'py>(
    call: &mut Call<'py>,
    scene: &SceneData,
    rays: &RayArrays<'_>,
    choices: &Choices<'_>,
) -> PyResult<Told<'py>> {
    let asking = Asking {
        scene,
        rays,
        choices,
    };
    let mut all: Vec<Found> = Vec::new();
    if choices.max_hits == 1 {
        piece::first_hits(call, (scene.bvh(), rays), |piece, hits| {
            memory::grow(&mut all, hits.len(), "hits")?;
            let told = hits.iter().zip(piece.range.start..);
            all.extend(told.filter_map(|(hit, ray)| asking.found(ray, hit.as_ref()?)));
            Ok(())
        })?;
    } else if choices.max_hits > 1 {
        piece::in_pieces(call, (scene.bvh(), rays), PIECE_OF_LISTS, |piece| {
            let firsts: Vec<_> = piece.range.clone().step_by(FEW).collect();
            let lists = |first: usize| asking.lists(first, (first + FEW).min(piece.range.end));
            let found: Vec<_> = piece.run(|| match piece.is_alone() {
                true => firsts.iter().map(|&first| lists(first)).collect(),
                false => firsts.par_iter().map(|&first| lists(first)).collect(),
            });
            memory::grow(&mut all, found.iter().map(Vec::len).sum(), "hits")?;
            all.extend(found.into_iter().flatten());
            Ok(())
        })?;
    }
    let py = call.py;
    let numbers = |of: fn(&Found) -> i64| {
        let numbers = memory::collected(all.iter().map(of), all.len(), "hits")?;
        Ok::<_, PyErr>(PyArray1::from_vec(py, numbers))
    };
    let places = all.iter().flat_map(|found| found.place);
    let places = memory::collected(places, 3 * all.len(), "coordinates of hits")?;
    Ok((
        numbers(|found| found.triangle)?,
        numbers(|found| found.ray)?,
        shaped(py, places, &[all.len(), 3])?,
    ))
}

struct Asking<'a> {
    scene: &'a SceneData,
    rays: &'a RayArrays<'a>,
    choices: &'a Choices<'a>,
}

impl Asking<'_> {
    /// Distinct hits of some rays.
    fn lists(&self, first: usize, end: usize) -> Vec<Found> {
        let mut rays = Vec::new();
        self.rays.gather(first, end - first, &mut rays);
        let batch = self.scene.bvh().batch(&rays).closed().on_this_thread();
        let lists = batch.all_hits();
        let (mut all, mut of_ray) = (Vec::new(), Vec::new());
        for ray in 0..lists.len() {
            of_ray.clear();
            of_ray.extend(
                lists
                    .of(ray)
                    .iter()
                    .filter_map(|hit| self.found(first + ray, hit)),
            );
            of_ray.sort_by(|a: &Found, b| a.distance.total_cmp(&b.distance));
            let mut kept = 0;
            let mut last = f64::NEG_INFINITY;
            for found in &of_ray {
                if kept < self.choices.max_hits && found.distance > last + self.choices.offset {
                    all.push(*found);
                    last = found.distance;
                    kept += 1;
                }
            }
        }
        all
    }

    /// A hit, where the ray as it was given intersects the plane of the triangle as it was given.
    fn found(&self, ray: usize, hit: &Hit) -> Option<Found> {
        let corners = *self.choices.indices.get(hit.prim_id as usize)?;
        let [a, b, c] = corners.map(|corner| self.choices.vertices.vector(corner as usize));
        let (origin, direction) = self.rays.given(ray);
        let normal = cross(between(a, b), between(a, c));
        let length = dot(direction, direction).sqrt();
        let down = dot(normal, direction);
        let t = if down.abs() > PARALLEL * length * dot(normal, normal).sqrt() {
            dot(normal, between(origin, a)) / down
        } else {
            f64::from(hit.t)
        };
        Some(Found {
            ray: ray as i64,
            triangle: hit.prim_id.into(),
            distance: t * length,
            place: [0, 1, 2].map(|axis| origin[axis] + t * direction[axis]),
        })
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Checks arguments about vertices and hits.
pub fn choices<'a>(
    scene: &'a SceneData,
    vertices: &'a Numbers<'_>,
    max_hits: usize,
    offset: f64,
) -> PyResult<Choices<'a>> {
    let rows = vertices.rows()?;
    let one = match &scene.parts.parts[..] {
        [part] => part.triangles(),
        _ => None,
    };
    let (positions, indices) =
        one.ok_or_else(|| PyValueError::new_err("the scene has not one mesh"))?;
    if rows != positions.len() {
        let wanted = format!("({}, 3)", positions.len());
        return Err(wrong_shape("vertices", vertices.shape(), &wanted));
    }
    Ok(Choices {
        indices,
        vertices: Operand::new(vertices, 3, vertices.lead(3)),
        max_hits,
        offset,
    })
}
