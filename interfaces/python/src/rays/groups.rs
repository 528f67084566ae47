//! Rays from every point in every direction of a call, as the kernel's groups: no ray is made before it is traced.
//!
//! # Why the answers equal the answers of closed rays
//!
//! Intervals of Python are closed, and a group takes intervals that begin at 0 or later. A closed interval from 0 is the open
//! interval from 0 and what is at 0: the kernel's closed ray begins at the largest negative number that is not subnormal.
//! So a ray that is open in the group is traced once more, from there to the smallest positive number, if anything can be hit so
//! near to its point. Set-up of rays in the kernel bounds how near: at its distance `t`, a ray is off a point of the triangle
//! that it hits by at most `11 u R` on each axis. That is less than the origin offset, so points without a surface within the
//! origin offset need no second look. The bound holds for triangles that no instance places: their `t` does not depend on the
//! interval.

use antumbra::{Aabb, Directions, Ray};
use antumbra_bake::along_curve;
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::arrays::memory;
use crate::call::Call;
use crate::errors::failed;
use crate::scene::SceneData;

/// Rays of one thread between two looks for signals.
const PIECE: usize = 1 << 21;

/// Least and most rays of a thread at a time. Packets are chosen by those before, so many are better.
const RAYS: (usize, usize) = (1 << 14, 1 << 20);

/// Most points of a thread at a time, however few directions there are.
const MOST_POINTS: usize = 1 << 12;

/// Fewer directions than this do not pay: see bench/record/zen3-2026-11-26-python-groups.txt.
pub const FEW_DIRECTIONS: usize = 32;

/// Points, and the directions in which each has a ray.
pub struct RayGroup {
    points: Vec<[f32; 3]>,
    directions: Vec<[f32; 3]>,
    /// Ends of all rays, closed.
    ends: Ray,
    /// Whether answers of one point are next to each other.
    is_by_point: bool,
}

/// Open rays of some points, one bit each, a row for each point.
struct Open {
    first: usize,
    bits: Vec<u64>,
}

impl RayGroup {
    /// `ends` is any ray with the interval of all; `None` for intervals that a group cannot take.
    pub fn new(
        scene: &SceneData,
        (points, directions): (Vec<[f32; 3]>, Vec<[f32; 3]>),
        ends: Ray,
        is_by_point: bool,
    ) -> Option<Self> {
        let ends = ends.closed();
        let begins = ends.tnear >= 0.0 || (is_at_zero(&ends) && scene.has_only_world_triangles());
        let is_number = !ends.tfar.is_nan() && u32::try_from(directions.len()).is_ok();
        (begins && is_number).then_some(Self {
            points,
            directions,
            ends,
            is_by_point,
        })
    }

    /// Whether anything is in the way of each ray.
    pub fn occluded(
        &self,
        call: &mut Call<'_>,
        scene: &SceneData,
        answers: &mut [bool],
    ) -> PyResult<()> {
        let threads = call.threads.clone();
        let order = call.py.detach(|| threads.run(|| along_curve(&self.points)));
        let order = order.map_err(failed)?;
        let points = order.iter().map(|&place| self.points[place as usize]);
        let points = memory::collected(points, order.len(), "points")?;
        let directions = Directions::new(&self.directions);
        let columns = self.directions.len();
        // Pieces have whole points. Progress counts rays, as in other calls about rays.
        let piece = (PIECE / columns).max(1) * columns;
        call.in_pieces(points.len() * columns, piece, |rays, threads| {
            let first = rays.start / columns;
            let points = &points[first..rays.end / columns];
            let share = rays.len() / (4 * threads.count());
            let block = (share.clamp(RAYS.0, RAYS.1) / columns).clamp(1, MOST_POINTS);
            let of = |(index, points): (usize, &[[f32; 3]])| {
                let first = first + index * block;
                let bits = self.open(scene, points, &directions)?;
                Ok(Open { first, bits })
            };
            let blocks = points.par_chunks(block).enumerate();
            let found: PyResult<Vec<Open>> = threads.run(|| blocks.map(of).collect());
            for open in found? {
                self.write(&order[open.first..], &open.bits, answers);
            }
            Ok(())
        })
    }

    /// Bits of rays that nothing is in the way of.
    fn open(
        &self,
        scene: &SceneData,
        points: &[[f32; 3]],
        directions: &Directions,
    ) -> PyResult<Vec<u64>> {
        let group = scene.bvh().group(points, directions).on_this_thread();
        let words = group.words_per_row();
        let mut open = memory::filled(0, points.len() * words, "bits")?;
        if is_at_zero(&self.ends) {
            group.far(self.ends.tfar).open_into(&mut open);
            self.look_at_zero(scene, points, &mut open)?;
        } else {
            let near = memory::filled(self.ends.tnear, points.len(), "distances")?;
            group.near(&near).far(self.ends.tfar).open_into(&mut open);
        }
        Ok(open)
    }

    /// Clears bits of rays that hit something where they begin.
    fn look_at_zero(
        &self,
        scene: &SceneData,
        points: &[[f32; 3]],
        open: &mut [u64],
    ) -> PyResult<()> {
        let (bvh, bounds) = (scene.bvh(), scene.bvh().bounds());
        // Added to the bound: the way of a ray from 0 to the smallest normal number.
        let sizes = self.directions.as_flattened().iter().map(|x| x.abs());
        let most = sizes.filter(|size| size.is_finite()).fold(0.0, f32::max);
        let limit = |point: &[f32; 3]| {
            bounds.union(&Aabb::around(&[*point])).origin_offset() + 2.0 * most * f32::MIN_POSITIVE
        };
        let limits = memory::collected(points.iter().map(limit), points.len(), "distances")?;
        let mut near = memory::filled(None, points.len(), "answers")?;
        bvh.points(points).within(&limits).closest_into(&mut near);
        let words = open.len() / points.len();
        let (mut columns, mut rays, mut hits) = (Vec::new(), Vec::new(), Vec::new());
        for (row, _) in near.iter().enumerate().filter(|(_, near)| near.is_some()) {
            let open = &mut open[row * words..][..words];
            columns.clear();
            columns.extend((0..self.directions.len()).filter(|&column| bit(open, column)));
            rays.clear();
            rays.extend(columns.iter().map(|&column| Ray {
                org: points[row],
                dir: self.directions[column],
                tnear: self.ends.tnear,
                tfar: self.ends.tfar.min(f32::MIN_POSITIVE),
            }));
            hits.clear();
            hits.resize(rays.len(), false);
            let batch = bvh.batch(&rays[..]).on_this_thread();
            batch.occluded_into(&mut hits);
            for (&column, _) in columns.iter().zip(&hits).filter(|(_, hit)| **hit) {
                open[column / 64] &= !(1 << (column % 64));
            }
        }
        Ok(())
    }

    /// Writes answers of the points at these places. Rays that cannot hit anything are not occluded.
    fn write(&self, places: &[u32], open: &[u64], answers: &mut [bool]) {
        let columns = self.directions.len();
        let words = columns.div_ceil(64);
        let is_ray = |dir: &[f32; 3]| {
            let most = dir.iter().fold(0.0, |most: f32, x| most.max(x.abs()));
            dir.iter().all(|x| x.is_finite()) && 1.0 / most < f32::INFINITY
        };
        let mut rays = vec![0; words];
        for column in (0..columns).filter(|&column| is_ray(&self.directions[column])) {
            rays[column / 64] |= 1 << (column % 64);
        }
        for (&place, open) in places.iter().zip(open.chunks_exact(words)) {
            let place = place as usize;
            let is_finite = self.points[place].iter().all(|x| x.is_finite());
            for word in 0..words {
                let mut hits = if is_finite {
                    rays[word] & !open[word]
                } else {
                    0
                };
                let end = columns.min(64 * (word + 1));
                for column in 64 * word..end {
                    let answer = match self.is_by_point {
                        true => place * columns + column,
                        false => column * self.points.len() + place,
                    };
                    answers[answer] = hits & 1 == 1;
                    hits >>= 1;
                }
            }
        }
    }
}

fn bit(bits: &[u64], column: usize) -> bool {
    bits[column / 64] >> (column % 64) & 1 == 1
}

/// Whether a closed interval begins at 0.
fn is_at_zero(ends: &Ray) -> bool {
    ends.tnear == -f32::MIN_POSITIVE
}
