//! Packets of rays from neighbouring points in one direction.
//!
//! The block of triangles that occluded rays in this direction from the points before is tested first.

use core::ops::Range;

use antumbra_simd::{Simd, Width};

use crate::geometry::ray_setup::max;
use crate::geometry::triangle::LanesOf;
use crate::trace::packet::fans::{above, lane_of};
use crate::trace::packet::group::{Found, Rows, Tally, Way, is_above, trace_packet};
use crate::trace::packet::rays::{LeafRays, MAX_SPREAD, PacketRays, RAYS};
use crate::trace::packet::{FEW, Packet};
use crate::trace::ray_batch::RayBatch;

/// Points of some rows, side by side.
pub(super) struct Beams<'a> {
    rows: &'a Rows<'a>,
    range: Range<usize>,
    rays: PacketRays,
    /// Normals of the rows, `[axis][lane]`.
    normals: [[f32; RAYS]; 3],
    /// Lanes of rows that have rays.
    lanes: u32,
    /// Smallest and largest coordinates of the points.
    corners: [[f32; 3]; 2],
    /// Largest coordinate of a point, by magnitude, plus the scene extent.
    reach: f32,
    ends: [f32; 2],
    /// The largest component of a normal.
    largest: f32,
}

impl<'a> Beams<'a> {
    /// Rows of a range, of at most [`RAYS`]. `None` if they are few or too far apart, or if the interval of one
    /// is empty or begins before 0.
    pub fn around(rows: &'a Rows<'a>, range: Range<usize>, extent: f32) -> Option<Self> {
        let mut beams = Self {
            rows,
            range: range.clone(),
            rays: PacketRays::IDLE,
            normals: [[0.0; RAYS]; 3],
            lanes: 0,
            corners: [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]],
            reach: extent,
            ends: [f32::INFINITY, rows.far],
            largest: 0.0,
        };
        for (lane, row) in range.enumerate() {
            if !rows.is_valid(row) {
                continue;
            }
            if !rows.goes_together(row) {
                return None;
            }
            beams.lanes |= 1 << lane;
            let (point, [tnear, tfar]) = (rows.points[row], rows.ends(row));
            for axis in 0..3 {
                beams.rays.org[axis][lane] = point[axis];
                let [low, high] = &mut beams.corners;
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
                beams.reach = max(beams.reach, point[axis].abs() + extent);
            }
            beams.rays.tnear[lane] = tnear;
            beams.rays.tfar[lane] = tfar;
            beams.ends[0] = beams.ends[0].min(tnear);
            if let Some(normal) = rows.normals.get(row) {
                for axis in 0..3 {
                    beams.normals[axis][lane] = normal[axis];
                    beams.largest = max(beams.largest, normal[axis].abs());
                }
            }
        }
        let [low, high] = beams.corners;
        let spread = (0..3).fold(0.0, |spread, axis| max(spread, high[axis] - low[axis]));
        let is_one =
            beams.lanes.count_ones() >= FEW && spread < extent * MAX_SPREAD && beams.ends[0] >= 0.0;
        is_one.then_some(beams)
    }

    /// Traces all rays of the rows that go in packets. `guesses` are the blocks that occluded rays in each direction before.
    #[inline(always)]
    pub fn trace<S: Simd + Width<N>, const N: usize>(
        mut self,
        simd: S,
        &Way { bvh, sheaves, .. }: &Way<'_, N>,
        stack: &mut [u32],
        guesses: &mut [Option<u32>],
        tally: &mut Tally,
        found: &mut Found<'_>,
    ) {
        let batch = RayBatch::new(&[], 0);
        let has_normals = !self.rows.normals.is_empty();
        for (sheaf, guesses) in sheaves.iter().zip(guesses.chunks_exact_mut(RAYS)) {
            for which in LanesOf::<RAYS>(sheaf.lanes) {
                let column = sheaf.columns[which];
                let dir = lane_of(&sheaf.dir, which);
                let lanes = if has_normals {
                    self.facing(simd, dir, sheaf.largest)
                } else {
                    self.lanes
                };
                if lanes == 0 {
                    continue;
                }
                let mut traced = [0, lanes];
                let tries = lanes.count_ones() >= FEW && tally.luck.tries();
                let frustum = if tries {
                    sheaf.beam(which, self.corners, self.reach, self.ends)
                } else {
                    None
                };
                if let Some(frustum) = frustum {
                    for axis in 0..3 {
                        self.rays.dir[axis] = [dir[axis]; RAYS];
                    }
                    self.rays.shortest = [sheaf.shortest[which]; RAYS];
                    let leaf_rays = LeafRays::new(simd, &self.rays, sheaf.likeness);
                    let packet = Packet {
                        bvh,
                        rays: &self.rays,
                        frustum: &frustum,
                        lanes,
                        batch: &batch,
                        first: 0,
                    };
                    let guess = &mut guesses[which];
                    traced = trace_packet(simd, &packet, &leaf_rays, stack, guess, tally);
                } else {
                    tally.skip(lanes.count_ones());
                }
                found.add(traced, |lane| (self.range.start + lane, column));
            }
        }
    }

    /// Lanes whose normal has a direction above its plane.
    #[inline(always)]
    fn facing<S: Simd>(&self, simd: S, dir: [f32; 3], largest: f32) -> u32 {
        let size = self.largest * largest;
        let (sure, doubtful) = above(simd, &self.normals, dir, size, self.lanes);
        let mut lanes = sure;
        for lane in LanesOf::<RAYS>(doubtful) {
            lanes |= u32::from(is_above(lane_of(&self.normals, lane), dir)) << lane;
        }
        lanes
    }
}
