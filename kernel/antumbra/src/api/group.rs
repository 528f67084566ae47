//! Groups: rays that belong together, from many points in the same directions.

use alloc::vec::Vec;
use core::fmt;

use antumbra_simd::Level;

use super::batch::CHUNK;
use super::bvh::Bvh;
use crate::parallel::for_each;
use crate::trace::memory::{Memory, Stored};
use crate::trace::packet::group::{Experience, Found, Part, Rows};
use crate::trace::packet::sheaf::{Sheaf, sheaves};
use crate::trace::query::Occlusion;
use crate::trace::ray_batch::RayBatch;
use crate::trace::stack::stack_size;

/// Rays that one thread takes at a time, about.
const RAYS: usize = 1 << 20;

/// Points that are taken at a time at most, however few directions there are.
const MOST_POINTS: usize = 1 << 12;

/// Directions that many points share, prepared once: a year of suns, the patches of a sky.
///
/// Directions are sorted along a curve over the sphere, so that rays of neighbouring directions go through the tree together.
/// Results are in the order given.
///
/// ```
/// use antumbra::Directions;
///
/// let suns = Directions::new(&[[0.0, 0.0, 1.0], [0.5, 0.0, 0.5]]);
/// assert_eq!(suns.len(), 2);
/// ```
#[derive(Clone)]
pub struct Directions {
    given: Vec<[f32; 3]>,
    sheaves: Vec<Sheaf>,
}

impl Directions {
    /// Makes directions of any length ready: `[n, 3]`. A direction without a ray has the bit 0 in all rows: zero, not
    /// finite, or so short (below 3e-39) that the reciprocal of its longest component is infinite.
    ///
    /// # Panics
    /// If there are more than 2³² directions.
    #[must_use]
    pub fn new(directions: &[[f32; 3]]) -> Self {
        assert!(
            u32::try_from(directions.len()).is_ok(),
            "more than 2³² directions"
        );
        Self {
            given: directions.to_vec(),
            sheaves: sheaves(directions),
        }
    }

    /// Number of directions, which is the number of columns of a [`Group`].
    #[must_use]
    pub fn len(&self) -> usize {
        self.given.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.given.is_empty()
    }
}

/// Rays from points in directions: a row for each point, a column for each direction. Made by [`Bvh::group`]; nothing happens
/// before the last call.
///
/// Every answer equals [`Bvh::occluded`] for the ray. Order changes only the cost: points should be near the ones
/// before and after them, as the vertices of a surface are. Directions may be in any order.
///
/// ```
/// # use antumbra::{Bvh, Directions, Geometry, Recipe};
/// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
/// let sky = Directions::new(&[[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 0.0, -1.0]]);
/// let points = [[0.2, 0.2, 0.0], [5.0, 5.0, 0.0]];
/// let normals = [[0.0, 0.0, 1.0]; 2];
/// let mut open = [0; 2];
/// bvh.group(&points, &sky).above(&normals).open_into(&mut open);
/// assert_eq!(open, [0b010, 0b011], "below the plane nothing is open");
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy)]
#[must_use = "a group does nothing until its last call"]
pub struct Group<'a> {
    bvh: &'a Bvh,
    rows: Rows<'a>,
    directions: &'a Directions,
    among_threads: bool,
}

impl Bvh {
    /// Rays from points in directions, to be traced together, at time 0 where something moves. Points are `[n, 3]`; a point that is not finite has no rays.
    pub fn group<'a>(&'a self, points: &'a [[f32; 3]], directions: &'a Directions) -> Group<'a> {
        Group {
            bvh: self,
            rows: Rows {
                points,
                normals: &[],
                near: &[],
                far: f32::INFINITY,
            },
            directions,
            among_threads: true,
        }
    }
}

impl<'a> Group<'a> {
    /// Traces all rays on the calling thread, as [`Batch::on_this_thread`](crate::Batch::on_this_thread).
    pub fn on_this_thread(self) -> Self {
        Self {
            among_threads: false,
            ..self
        }
    }

    /// Leaves out directions that are not above the plane of the normal of their point, where the surface itself is in the
    /// way: their bits are 0. Normals are `[n, 3]`, of any length; one that is zero or NaN leaves out all.
    ///
    /// # Panics
    /// If there are not as many normals as points.
    pub fn above(mut self, normals: &'a [[f32; 3]]) -> Self {
        assert_eq!(
            self.rows.points.len(),
            normals.len(),
            "one normal per point"
        );
        self.rows.normals = normals;
        self
    }

    /// Begins the interval of each point's rays here instead of at 0, in lengths of the direction.
    ///
    /// # Panics
    /// If there are not as many numbers as points.
    pub fn near(mut self, near: &'a [f32]) -> Self {
        assert_eq!(self.rows.points.len(), near.len(), "one number per point");
        self.rows.near = near;
        self
    }

    /// Ends all intervals here, in lengths of the direction. Without a call rays have no end.
    pub fn far(mut self, far: f32) -> Self {
        self.rows.far = far;
        self
    }

    /// Words of a row: a 64th of the directions, rounded up.
    #[must_use]
    pub fn words_per_row(&self) -> usize {
        self.directions.len().div_ceil(64)
    }

    /// Finds the rays that nothing is in the way of and sets one bit for each. Bit `j % 64` of word `j / 64` of row `i`
    /// belongs to point `i` and direction `j`. Bits behind the last column become 0.
    ///
    /// Rows of points that are not finite, and of intervals that begin or end at NaN, are 0. In an empty interval nothing is in
    /// the way.
    ///
    /// # Panics
    /// If there are not as many words as rows have together.
    pub fn open_into(self, open: &mut [u64]) {
        let (points, words) = (self.rows.points.len(), self.words_per_row());
        assert_eq!(points * words, open.len(), "all words of all rows");
        open.fill(0);
        if open.is_empty() {
            return;
        }
        let block = (RAYS / self.directions.len()).clamp(1, MOST_POINTS);
        let piece = |(index, open): (usize, &mut [u64])| {
            let rows = self.part(index * block, open.len() / words);
            (self.bvh.pool).with(|memory| self.bvh.open_rays(memory, &rows, self.directions, open));
        };
        let blocks = open.chunks_mut(block * words).enumerate();
        if self.among_threads && points > block {
            for_each(blocks.collect(), piece);
        } else {
            blocks.for_each(piece);
        }
    }

    /// Some of the rows.
    fn part(&self, first: usize, count: usize) -> Rows<'a> {
        let Rows {
            points,
            normals,
            near,
            far,
        } = self.rows;
        Rows {
            points: &points[first..][..count],
            normals: normals.get(first..first + count).unwrap_or(&[]),
            near: near.get(first..first + count).unwrap_or(&[]),
            far,
        }
    }
}

impl Bvh {
    /// Sets the bits of rays that nothing is in the way of.
    fn open_rays(
        &self,
        memory: &mut Memory,
        rows: &Rows<'_>,
        directions: &Directions,
        open: &mut [u64],
    ) {
        let words = open.len() / rows.points.len();
        let goes_together = self.isa().level() != Level::Scalar && self.tree.pick.is_none();
        let mut pending = Vec::new();
        let mut experience = Experience::default();
        let mut next = 0;
        while next < rows.points.len() {
            pending.clear();
            if goes_together {
                let (first, sheaves) = (next, &directions.sheaves);
                let stack =
                    Stored::at_least(memory, stack_size(self.width().lanes(), self.depth()));
                let (experience, pending) = (&mut experience, &mut pending);
                let found = Found {
                    open,
                    words,
                    pending,
                };
                let part = Part {
                    rows,
                    first,
                    sheaves,
                    found,
                    experience,
                };
                next = (self.engine.0).group(&self.tree, stack, part);
            } else {
                if rows.is_valid(next) {
                    let columns = directions.sheaves.iter().flat_map(Sheaf::columns);
                    let faced = |column: &u32| rows.faces(next, directions.given[*column as usize]);
                    pending.extend(columns.filter(faced).map(|column| [next as u32, column]));
                }
                next += 1;
            }
            self.open_alone(
                memory,
                rows,
                directions,
                &pending,
                goes_together,
                |row, column| {
                    open[row * words + column / 64] |= 1 << (column % 64);
                },
            );
        }
    }

    /// Reports row and column of each pending ray that nothing is in the way of. Many rays that packets have given up
    /// are traced as a stream.
    fn open_alone(
        &self,
        memory: &mut Memory,
        rows: &Rows<'_>,
        directions: &Directions,
        pending: &[[u32; 2]],
        given_up: bool,
        mut report: impl FnMut(usize, usize),
    ) {
        let mut rays = core::mem::take(&mut memory.rays);
        let mut occluded = core::mem::take(&mut memory.answers);
        let all: Vec<u32> = (0..CHUNK.min(pending.len()) as u32).collect();
        for pending in pending.chunks(CHUNK) {
            rays.clear();
            rays.extend(
                pending.iter().map(|&[row, column]| {
                    rows.ray(row as usize, directions.given[column as usize])
                }),
            );
            occluded.clear();
            occluded.resize(rays.len(), false);
            let batch = RayBatch::new(&rays, 0);
            if given_up && self.is_worth_a_stream(rays.len()) {
                self.stream::<Occlusion>(memory, &batch, &all[..rays.len()], &mut occluded);
            } else {
                self.occluded_many(memory, &batch, &mut occluded);
            }
            for (&[row, column], &occluded) in pending.iter().zip(&occluded) {
                if !occluded {
                    report(row as usize, column as usize);
                }
            }
        }
        memory.rays = rays;
        memory.answers = occluded;
    }
}

impl fmt::Debug for Directions {
    /// Counts, not contents.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Directions")
            .field("len", &self.len())
            .finish_non_exhaustive()
    }
}

impl fmt::Debug for Group<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Group")
            .field("points", &self.rows.points.len())
            .field("directions", &self.directions)
            .field("far", &self.rows.far)
            .field("among_threads", &self.among_threads)
            .finish_non_exhaustive()
    }
}
