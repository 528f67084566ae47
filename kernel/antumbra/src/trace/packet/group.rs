//! Groups: rays from many points in the same directions.
//!
//! Rays go in packets either way: in neighbouring directions from one point ([`fans`]), or in one direction from
//! neighbouring points ([`Beams`]). Suns of a year are close together. Patches of a sky are not. Both are tried, and the
//! one that does less work goes on.

use alloc::vec::Vec;

use antumbra_simd::{Simd, Width, WithSimd};

use crate::geometry::triangle::LanesOf;
use crate::ray::Ray;
use crate::trace::packet::beams::Beams;
use crate::trace::packet::fans;
use crate::trace::packet::rays::{LeafRays, RAYS};
use crate::trace::packet::sheaf::Sheaf;
use crate::trace::packet::{Luck, Occluded, Packet, occlude};
use crate::tree::wide::WideTree;

/// Ray origins, one per row, with the intervals of their rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows<'a> {
    pub points: &'a [[f32; 3]],
    /// Rays below the planes of these normals are left out; empty for none.
    pub normals: &'a [[f32; 3]],
    /// Begin of the interval of each point; empty for 0.
    pub near: &'a [f32],
    /// End of all intervals.
    pub far: f32,
}

impl Rows<'_> {
    /// The interval of a row.
    #[inline(always)]
    pub fn ends(&self, row: usize) -> [f32; 2] {
        match self.near.get(row) {
            Some(&near) => [near, self.far],
            None => [0.0, self.far],
        }
    }

    /// The ray of a row in a direction.
    pub fn ray(&self, row: usize, dir: [f32; 3]) -> Ray {
        let [tnear, tfar] = self.ends(row);
        Ray {
            org: self.points[row],
            dir,
            tnear,
            tfar,
        }
    }

    /// Whether a row has rays. Their interval may be empty.
    #[inline(always)]
    pub fn is_valid(&self, row: usize) -> bool {
        let ([tnear, tfar], [x, y, z]) = (self.ends(row), self.points[row]);
        !(tnear.is_nan() | tfar.is_nan()) && x.is_finite() && y.is_finite() && z.is_finite()
    }

    /// Whether rays of a row can go in packets.
    #[inline(always)]
    pub fn goes_together(&self, row: usize) -> bool {
        let [tnear, tfar] = self.ends(row);
        tnear >= 0.0 && tnear < tfar
    }

    /// Whether a direction is above the plane of the normal of a row.
    pub fn faces(&self, row: usize, dir: [f32; 3]) -> bool {
        (self.normals.get(row)).is_none_or(|normal| is_above(*normal, dir))
    }
}

/// Whether a direction is above a plane.
pub(crate) fn is_above(normal: [f32; 3], dir: [f32; 3]) -> bool {
    let [x, y, z] = [0, 1, 2].map(|axis| f64::from(normal[axis]) * f64::from(dir[axis]));
    x + y + z > 0.0
}

/// Finds which rays of rows nothing is in the way of, until so many rays are left to others that these should be traced.
/// Returns the row to go on with.
pub(crate) struct GroupQuery<'a, const N: usize> {
    pub bvh: &'a WideTree<'a, N>,
    /// Memory of a stack for this tree.
    pub stack: &'a mut [u32],
    pub part: Part<'a>,
}

/// What is left of a group.
pub(crate) struct Part<'a> {
    pub rows: &'a Rows<'a>,
    /// Row to begin with: a multiple of [`RAYS`].
    pub first: usize,
    pub sheaves: &'a [Sheaf],
    pub found: Found<'a>,
    pub experience: &'a mut Experience,
}

/// Answers, and rays without one.
pub(crate) struct Found<'a> {
    /// Bits of the rows, so many words for each. The bits of open rays are set.
    pub open: &'a mut [u64],
    /// Words of a row.
    pub words: usize,
    /// Rays that are left are appended here.
    pub pending: &'a mut Vec<[u32; 2]>,
}

impl Found<'_> {
    /// Nothing is in the way of a ray.
    #[inline(always)]
    pub fn set(&mut self, row: usize, column: u32) {
        let column = column as usize;
        self.open[row * self.words + column / 64] |= 1 << (column % 64);
    }

    /// Nothing is in the way of rays in these lanes, and others are left. `at` says where the ray of a lane is.
    #[inline(always)]
    pub fn add(&mut self, [free, left]: [u32; 2], at: impl Fn(usize) -> (usize, u32)) {
        for (row, column) in LanesOf::<RAYS>(free).map(&at) {
            self.set(row, column);
        }
        let left = LanesOf::<RAYS>(left).map(at);
        self.pending
            .extend(left.map(|(row, column)| [row as u32, column]));
    }
}

/// Statistics of the packets so far, by which the next ones are made.
#[derive(Default)]
pub(crate) struct Experience {
    fans: Tally,
    beams: Tally,
    /// For each direction the block that occluded rays last.
    guesses: Vec<Option<u32>>,
}

/// How a way of making packets has done.
#[derive(Clone, Copy, Default)]
pub(super) struct Tally {
    pub luck: Luck,
    work: u64,
    rays: u64,
}

impl Tally {
    /// Work of a ray that goes on by itself, in units of [`Occluded::work`].
    const ALONE: u32 = 4;
    /// Work of making a packet ready.
    const SETUP: u32 = 3;

    /// A packet of so many rays was traced.
    #[inline(always)]
    pub fn count(&mut self, rays: u32, way: &Occluded) {
        let left = way.left.count_ones();
        let work = way.work + Self::SETUP;
        self.luck.count(work < Self::ALONE * (rays - left));
        self.work += u64::from(work + Self::ALONE * left);
        self.rays += u64::from(rays);
    }

    /// Counts rays that were not tried in a packet.
    #[inline(always)]
    pub fn skip(&mut self, rays: u32) {
        self.work += u64::from(Self::ALONE * rays);
        self.rays += u64::from(rays);
    }

    /// Counts rays of a packet that the guess answered without the tree.
    #[inline(always)]
    pub fn guessed(&mut self, rays: u32) {
        self.work += u64::from(Self::SETUP);
        self.rays += u64::from(rays);
    }

    /// Whether rays were counted.
    fn is_known(&self) -> bool {
        self.rays > 0
    }

    /// Whether there is more work for each ray than with another way.
    fn is_worse(&self, other: &Self) -> bool {
        u128::from(self.work) * u128::from(other.rays)
            > u128::from(other.work) * u128::from(self.rays)
    }

    /// Halves both counts, so that recent rays count more.
    fn fade(&mut self) {
        self.work /= 2;
        self.rays /= 2;
    }
}

impl<const N: usize> WithSimd<N> for GroupQuery<'_, N> {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) -> usize {
        /// Rays that are worth a stream.
        const MANY: usize = 1 << 13;
        /// Every so many blocks of points the worse way is tried again.
        const AGAIN: usize = 32;

        let Self {
            bvh,
            stack,
            part:
                Part {
                    rows,
                    first,
                    sheaves,
                    mut found,
                    experience,
                },
        } = self;
        let Experience {
            fans,
            beams,
            guesses,
        } = experience;
        let count = rows.points.len();
        let mut next = first;
        while next < count && found.pending.len() < MANY {
            let block = next / RAYS;
            let range = next..count.min(next + RAYS);
            next = range.end;
            let takes_beams = match block {
                0 => false,
                _ if !beams.is_known() => true,
                _ => fans.is_worse(beams) != (block % AGAIN == AGAIN - 1),
            };
            let points = if takes_beams {
                Beams::around(rows, range.clone(), bvh.reach)
            } else {
                None
            };
            let way = Way { bvh, rows, sheaves };
            if let Some(points) = points {
                guesses.resize(sheaves.len() * RAYS, None);
                points.trace::<S, N>(simd, &way, stack, guesses, beams, &mut found);
            } else {
                fans::trace::<S, N>(simd, &way, range, stack, fans, &mut found);
            }
            if block.is_multiple_of(AGAIN) {
                fans.fade();
                beams.fade();
            }
        }
        next
    }
}

/// Tree, points and directions, for packets of either way.
pub(super) struct Way<'a, const N: usize> {
    pub bvh: &'a WideTree<'a, N>,
    pub rows: &'a Rows<'a>,
    pub sheaves: &'a [Sheaf],
}

/// Traces the rays of a packet. The block of triangles that occluded others before is tested first. Returns the lanes
/// whose rays nothing occludes, and the lanes that are left to others.
#[inline(always)]
pub(super) fn trace_packet<S: Simd + Width<N>, const N: usize>(
    simd: S,
    packet: &Packet<'_, N>,
    leaf_rays: &LeafRays<S>,
    stack: &mut [u32],
    guess: &mut Option<u32>,
    tally: &mut Tally,
) -> [u32; 2] {
    let way = occlude(simd, packet, leaf_rays, stack, guess);
    let count = packet.lanes.count_ones();
    match way.work {
        0 => tally.guessed(count),
        _ => tally.count(count, &way),
    }
    [packet.lanes & !(way.occluded | way.left), way.left]
}
