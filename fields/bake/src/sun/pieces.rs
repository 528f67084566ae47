//! Scenes in pieces: what is around a scene is loaded when a ray may reach it.

use std::sync::Arc;

use antumbra::{Aabb, Bvh, Geometry, Ray, Recipe, Visit};
use rayon::prelude::*;

use crate::sight::visibility::{origin, ray_direction};
use crate::{Error, Key, Monitor, ones};

/// Points that a thread takes at a time.
const POINTS: usize = 256;

/// Boxes are wider than what they hold, in parts of the largest coordinate: more than tests of boxes and triangles round.
const SLACK: f32 = 4e-6;

/// Gives the tree of a piece by its number.
pub type LoadPiece<'a> = dyn Fn(usize) -> Result<Arc<Bvh>, Error> + Sync + 'a;

/// Geometry around a scene in pieces, such as the files of a city. It hides lights from points of the scene: see [`SunJob::beside`].
///
/// [`SunJob::beside`]: crate::SunJob::beside
///
/// A ray that nothing of the scene hides waits for the pieces whose boxes it enters. The piece for which most rays wait is loaded
/// first, and those that it hides wait no longer. So answers have the same bits as with one tree of everything, and pieces that no
/// ray needs are not loaded.
pub struct Pieces<'a> {
    /// A box for each piece: a geometry.
    around: Bvh,
    /// Number and boxes of each piece, with slack.
    pieces: Vec<(usize, Vec<Box3>)>,
    load: &'a LoadPiece<'a>,
    key: u64,
}

type Box3 = [[f32; 3]; 2];

/// A ray that waits: its point and its direction.
type Waiting = [u32; 2];

impl<'a> Pieces<'a> {
    /// Pieces by their numbers, with boxes that hold all that they have, from least to largest coordinates. `key` changes with their
    /// geometry.
    ///
    /// # Errors
    /// There is no tree of the boxes, such as for too many.
    pub fn new<'b>(
        pieces: impl IntoIterator<Item = (usize, &'b [[[f32; 3]; 2]])>,
        key: u64,
        load: &'a LoadPiece<'a>,
    ) -> Result<Self, antumbra::Error> {
        let wide = |(number, boxes): (usize, &[Box3])| {
            let slack = SLACK * Aabb::around(boxes.as_flattened()).reach();
            let wide = boxes.iter();
            let wide = wide.map(|[low, high]| [low.map(|x| x - slack), high.map(|x| x + slack)]);
            (number, wide.collect())
        };
        let pieces: Vec<(usize, Vec<Box3>)> = pieces.into_iter().map(wide).collect();
        let all = pieces.iter();
        let all = all.map(|(_, boxes)| solid(&Aabb::around(boxes.as_flattened())));
        Ok(Self {
            around: Bvh::build(&all.collect::<Vec<_>>(), &Recipe::fast())?,
            pieces,
            load,
            key,
        })
    }

    /// A triangle without an area at the farthest corner of a box around everything. A tree with it has the
    /// [origin offsets](Bvh::origin_offset) of a tree of everything, for points of which it has all surfaces on which they lie.
    pub fn mark(bounds: [[f32; 3]; 2]) -> [[f32; 3]; 3] {
        let reach = |axis: &usize| bounds[0][*axis].abs().max(bounds[1][*axis].abs());
        let farthest = (0..3).max_by(|a, b| reach(a).total_cmp(&reach(b)));
        let axis = farthest.unwrap_or_default();
        // The others are as low as they get, where nothing looks.
        let mut corner = bounds[0];
        if bounds[1][axis].abs() > corner[axis].abs() {
            corner[axis] = bounds[1][axis];
        }
        let beside = (axis + 1) % 3;
        let mut corners = [corner; 3];
        corners[1][beside] = corner[beside].next_up();
        corners[2][beside] = corners[1][beside].next_up();
        corners
    }

    /// Removes the lights in these directions that pieces hide from rows of those that points see. `bvh` is of the scene.
    pub(crate) fn hide(
        &self,
        (bvh, points, normals): (&Bvh, &[[f32; 3]], &[[f32; 3]]),
        directions: &[[f32; 3]],
        seen: &mut [u64],
        monitor: &dyn Monitor,
    ) -> Result<(), Error> {
        let width = directions.len().div_ceil(64).max(1);
        let directions: Vec<_> = directions
            .iter()
            .map(|&direction| ray_direction(direction, normals.is_empty()))
            .collect();
        let rays_of = |point: usize| {
            let (org, tnear) = origin(bvh, points[point], normals.get(point));
            let directions = &directions;
            move |direction: usize| Ray {
                tnear,
                ..Ray::new(org, directions[direction])
            }
        };
        let blocks = seen.par_chunks(width * POINTS).enumerate();
        let entered = blocks.map(|(block, rows)| {
            if monitor.cancelled() {
                return Err(Error::Cancelled);
            }
            let (mut rays, mut waiting) = (Vec::new(), Vec::new());
            for (row, seen) in rows.chunks_exact(width).enumerate() {
                let point = POINTS * block + row;
                let ray = rays_of(point);
                for direction in ones(seen) {
                    rays.push(ray(direction));
                    waiting.push([point as u32, direction as u32]);
                }
            }
            let mut entered = vec![Vec::new(); rays.len()];
            let batch = self.around.batch(&rays).on_this_thread();
            batch.visit_hits(&mut entered, |pieces: &mut Vec<u32>, hit| {
                if !pieces.contains(&hit.geom_id) {
                    pieces.push(hit.geom_id);
                }
                Visit::Reject
            });
            let pairs = entered.into_iter().zip(waiting);
            let pairs =
                pairs.flat_map(|(pieces, ray)| pieces.into_iter().map(move |piece| (piece, ray)));
            Ok(pairs.collect::<Vec<(u32, Waiting)>>())
        });
        let mut queues = vec![Vec::new(); self.pieces.len()];
        for (piece, ray) in entered
            .collect::<Result<Vec<_>, Error>>()?
            .into_iter()
            .flatten()
        {
            queues[piece as usize].push(ray);
        }
        let ray = |&[point, direction]: &Waiting| rays_of(point as usize)(direction as usize);
        let rays = |queue: &[Waiting]| queue.par_iter().map(ray).collect::<Vec<Ray>>();
        for ((_, boxes), queue) in self.pieces.iter().zip(&mut queues) {
            queue.retain(|waiting| enters(&ray(waiting), boxes));
        }
        while let Some((piece, queue)) = (queues.iter_mut().enumerate())
            .max_by_key(|(_, queue)| queue.len())
            .filter(|(_, queue)| !queue.is_empty())
        {
            if monitor.cancelled() {
                return Err(Error::Cancelled);
            }
            let bit = |[point, direction]: Waiting| {
                let (point, direction) = (point as usize, direction as usize);
                (width * point + direction / 64, 1 << (direction % 64))
            };
            let mut queue = std::mem::take(queue);
            queue.retain(|&ray| {
                let (word, bit) = bit(ray);
                seen[word] & bit != 0
            });
            if queue.is_empty() {
                continue;
            }
            let tree = (self.load)(self.pieces[piece].0)?;
            let hidden = tree.batch(&rays(&queue)).occluded();
            for (&ray, _) in queue.iter().zip(&hidden).filter(|(_, hidden)| **hidden) {
                let (word, bit) = bit(ray);
                seen[word] &= !bit;
            }
        }
        Ok(())
    }

    /// Adds the pieces to the key of a job.
    pub(crate) fn identify(&self, key: &mut Key) {
        key.text(&format!("beside {:016x}", self.key));
    }
}

/// Whether a ray enters one of some boxes.
fn enters(ray: &Ray, boxes: &[Box3]) -> bool {
    let inverse = ray.dir.map(|x| 1.0 / f64::from(x));
    boxes.iter().any(|own| {
        let mut ends = [f64::from(ray.tnear), f64::from(ray.tfar)];
        for axis in 0..3 {
            let at = |side: f32| (f64::from(side) - f64::from(ray.org[axis])) * inverse[axis];
            let [a, b] = own.map(|corner| at(corner[axis]));
            // A ray within the plane of a side may be taken for one beside it, which it is by the slack.
            ends = [ends[0].max(a.min(b)), ends[1].min(a.max(b))];
        }
        ends[0] <= ends[1]
    })
}

/// A box as triangles.
fn solid(around: &Aabb) -> Geometry<'static> {
    let positions: [[f32; 3]; 8] = std::array::from_fn(|corner| {
        [0, 1, 2].map(|axis| [around.min, around.max][corner >> axis & 1][axis])
    });
    let mut indices = Vec::new();
    for axis in 0..3 {
        // Two sides that face each other, of two triangles each.
        let [a, b, side] = [(axis + 1) % 3, (axis + 2) % 3, axis].map(|axis| 1 << axis);
        for first in [0, side] {
            indices.push([first, first + a, first + a + b]);
            indices.push([first, first + a + b, first + b]);
        }
    }
    Geometry::triangles(positions.to_vec(), indices)
}
