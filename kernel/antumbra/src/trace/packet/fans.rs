//! Packets of rays from one point in neighbouring directions.
//!
//! Neighbouring directions are mostly occluded by the same part of the scene. So the block of triangles that occluded
//! the last packet is tested first, and only the rays that are left are traced through the tree.

use core::ops::Range;

use antumbra_simd::{Lanes, Mask, Simd, Width};

use crate::geometry::ray_setup::max;
use crate::geometry::triangle::LanesOf;
use crate::trace::packet::group::{Found, Tally, Way, is_above, trace_packet};
use crate::trace::packet::rays::{LeafRays, PacketRays, RAYS, RayLanes};
use crate::trace::packet::sheaf::Sheaf;
use crate::trace::packet::{FEW, Packet};
use crate::trace::ray_batch::RayBatch;

/// Traces all rays of some rows that go in packets.
#[inline(always)]
pub(super) fn trace<S: Simd + Width<N>, const N: usize>(
    simd: S,
    &Way { bvh, rows, sheaves }: &Way<'_, N>,
    range: Range<usize>,
    stack: &mut [u32],
    tally: &mut Tally,
    found: &mut Found<'_>,
) {
    let batch = RayBatch::new(&[], 0);
    let mut rays = PacketRays::IDLE;
    for row in range {
        if !rows.is_valid(row) {
            continue;
        }
        let (org, ends) = (rows.points[row], rows.ends(row));
        let goes_together = rows.goes_together(row);
        let reach = max(max(org[0].abs(), org[1].abs()), org[2].abs()) + bvh.reach;
        for axis in 0..3 {
            rays.org[axis] = [org[axis]; RAYS];
        }
        rays.tnear = [ends[0]; RAYS];
        rays.tfar = [ends[1]; RAYS];
        // The block that occluded the packet before.
        let mut last = None;
        for sheaf in sheaves {
            let lanes = match rows.normals.get(row) {
                None => sheaf.lanes,
                Some(normal) => facing(simd, sheaf, *normal),
            };
            if lanes == 0 {
                continue;
            }
            let mut traced = [0, lanes];
            let tries = goes_together && lanes.count_ones() >= FEW && tally.luck.tries();
            let frustum = if tries {
                sheaf.frustum(org, reach, ends)
            } else {
                None
            };
            if let Some(frustum) = frustum {
                rays.dir = sheaf.dir;
                rays.shortest = sheaf.shortest;
                let leaf_rays = LeafRays::new(simd, &rays, sheaf.likeness);
                let packet = Packet {
                    bvh,
                    rays: &rays,
                    frustum: &frustum,
                    lanes,
                    batch: &batch,
                    first: 0,
                };
                traced = trace_packet(simd, &packet, &leaf_rays, stack, &mut last, tally);
            } else {
                tally.skip(lanes.count_ones());
            }
            found.add(traced, |lane| (row, sheaf.columns[lane]));
        }
    }
}

/// Lanes whose direction is above the plane of a normal.
#[inline(always)]
fn facing<S: Simd>(simd: S, sheaf: &Sheaf, normal: [f32; 3]) -> u32 {
    let size = max(max(normal[0].abs(), normal[1].abs()), normal[2].abs());
    let (sure, doubtful) = above(simd, &sheaf.dir, normal, size * sheaf.largest, sheaf.lanes);
    let mut lanes = sure;
    for lane in LanesOf::<RAYS>(doubtful) {
        lanes |= u32::from(is_above(normal, lane_of(&sheaf.dir, lane))) << lane;
    }
    lanes
}

/// The vector of a lane.
#[inline(always)]
pub(super) fn lane_of(vectors: &[[f32; RAYS]; 3], lane: usize) -> [f32; 3] {
    [vectors[0][lane], vectors[1][lane], vectors[2][lane]]
}

/// Lanes whose vector surely has a positive product with another one, and lanes in doubt. `size` is at least the product of the
/// largest components.
#[inline(always)]
pub(super) fn above<S: Simd>(
    simd: S,
    vectors: &[[f32; RAYS]; 3],
    other: [f32; 3],
    size: f32,
    lanes: u32,
) -> (u32, u32) {
    /// More than the roundings of three products and two sums, relative to the largest of the products.
    const DOUBT: f32 = 1e-6;

    // No closures here: they are not compiled for the level.
    let x = RayLanes::<S>::load(simd, &vectors[0]) * RayLanes::<S>::splat(simd, other[0]);
    let y = RayLanes::<S>::load(simd, &vectors[1]) * RayLanes::<S>::splat(simd, other[1]);
    let z = RayLanes::<S>::load(simd, &vectors[2]) * RayLanes::<S>::splat(simd, other[2]);
    let height = (x + y) + z;
    let doubt = size * DOUBT;
    let is_above = RayLanes::<S>::splat(simd, doubt).lt(height).bits();
    let is_below = height.lt(RayLanes::<S>::splat(simd, -doubt)).bits();
    // What underflows or overflows is in doubt as well.
    if doubt > f32::MIN_POSITIVE && doubt < 1e30 {
        (is_above & lanes, lanes & !(is_above | is_below))
    } else {
        (0, lanes)
    }
}
