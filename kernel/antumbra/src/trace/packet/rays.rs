//! The rays of a packet, made ready: a lane each, and a frustum around all of them.
//!
//! # Why no ray of a packet misses a box that matters
//!
//! Rays of a packet have directions of the same signs and intervals that begin at 0 or later. Say they are positive, and
//! let `o⁻ <= o <= o⁺` and `r⁻ <= r <= r⁺` hold for their origins and reciprocal directions on an axis (the rays are
//! traced with these reciprocals: division is monotonic), and let `R` be the largest of theirs, in the words of
//! [`crate::geometry::ray_setup`]. A node is tested with the distance `(p - o⁺) r⁻` of its near planes, lessened by
//! `32 u R r⁻`, and the distance `(q - o⁻) r⁺` of its far planes, increased by `32 u R r⁺`. Rounding adds at most
//! `4.2 u R` times the reciprocal to either. A hit is at 0 or later and, on each axis, within `11 u R` of a point of the
//! primitive, which is in the box.
//!
//! - If the first, as computed, is positive, then `p - o⁺` exceeds `27.8 u R`. So `(p - o⁺ - 27.8 u R) r⁻` is at most
//!   the same with `o` and `r` of any ray, which is less than the distance of its hit. If it is not positive, it is not
//!   later than the interval of any ray begins.
//! - Let a ray have a hit. Then `q - o` is at least `-11 u R`, and `q - o⁻ + 27.8 u R` is positive. So the second is at
//!   least `(q - o + 27.8 u R) r`, which is later than that.
//!
//! So the frustum enters each box before the hit of any of its rays below it, and leaves it after that, and with
//! the earliest beginning and the latest end of the rays' intervals it misses no box of any of their hits.

use antumbra_simd::{Lanes, Mask, Simd, Width};

use crate::geometry::BLOCK;
use crate::geometry::edge_test::{Ends, Shear, boxes};
use crate::geometry::ray_setup::{Lengths, MIN_DIRECTION, NEAR, NODE_MARGIN, Side, max, steepness};
use crate::geometry::slab_test::NodeSlabs;
use crate::geometry::triangle::{TriangleBlock, Truths, Vector};
use crate::geometry::triangle_hit::ShearedRay;
use crate::ray::Ray;
use crate::trace::step::{NodeLanes, NodeTest};

/// Rays of a packet, on every level: what they share is worth more than registers as wide.
pub(crate) const RAYS: usize = 16;

/// A ray in one piece, as it lies in memory.
pub(crate) type Row = [f32; 8];

/// A vector with a lane for each ray.
pub(crate) type RayLanes<S> = <S as Width<RAYS>>::Lanes;

/// Largest distance of the origins of a packet on an axis, relative to the scene extent.
pub(crate) const MAX_SPREAD: f32 = 1.0 / 16.0;
/// Largest difference of directions on an axis, relative to their largest component.
pub(crate) const MAX_TURN: f32 = 0.25;

/// A ray as a row: origin, `tnear`, direction, `tfar`.
#[inline(always)]
pub(crate) fn row(ray: &Ray) -> Row {
    let [ox, oy, oz] = ray.org;
    let [dx, dy, dz] = ray.dir;
    [ox, oy, oz, ray.tnear, dx, dy, dz, ray.tfar]
}

/// Signs and largest axis of the directions, which all rays of a packet have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Likeness {
    /// Bit per axis: whether the direction is negative.
    pub signs: usize,
    /// Bit 0: the largest component of the direction is that on x; bit 1, y; neither, z.
    pub largest: usize,
}

/// Rays in lanes, in memory.
#[repr(C, align(64))]
pub(crate) struct PacketRays {
    pub org: [[f32; RAYS]; 3],
    pub dir: [[f32; RAYS]; 3],
    pub tnear: [f32; RAYS],
    pub tfar: [f32; RAYS],
    /// Reciprocals of the largest components of the directions, see [`crate::geometry::ray_setup::Lengths`].
    pub shortest: [f32; RAYS],
    /// Per axis, the lanes whose directions are negative, as bits.
    negative: [u32; 3],
    largest: [u32; 2],
    /// Lanes of rays that can hit something.
    pub valid: u32,
    /// Lanes of valid rays that a packet can take.
    pub tame: u32,
}

impl PacketRays {
    pub const IDLE: Self = Self {
        org: [[0.0; RAYS]; 3],
        dir: [[0.0; RAYS]; 3],
        tnear: [0.0; RAYS],
        tfar: [0.0; RAYS],
        shortest: [0.0; RAYS],
        negative: [0; 3],
        largest: [0; 2],
        valid: 0,
        tame: 0,
    };

    /// Makes rays ready for primitives whose coordinates are at most `extent`, as
    /// [`RaySetup::set`](crate::geometry::ray_setup::RaySetup::set) does with one.
    #[inline(always)]
    pub fn set<S: Simd>(&mut self, simd: S, rows: &[Row; RAYS], extent: f32) {
        let [ox, oy, oz, tnear, dx, dy, dz, tfar] = simd.columns(rows);
        ox.store(&mut self.org[0]);
        oy.store(&mut self.org[1]);
        oz.store(&mut self.org[2]);
        dx.store(&mut self.dir[0]);
        dy.store(&mut self.dir[1]);
        dz.store(&mut self.dir[2]);
        tnear.store(&mut self.tnear);
        tfar.store(&mut self.tfar);
        let zero = RayLanes::<S>::splat(simd, 0.0);

        let lengths = Lengths::new::<RAYS>(simd, [ox, oy, oz], [dx, dy, dz], extent);
        let finite = ((ox * zero + dx * zero) + (oy * zero + dy * zero)) + (oz * zero + dz * zero);
        let infinity = RayLanes::<S>::splat(simd, f32::INFINITY);
        let valid = finite.eq(zero) & lengths.shortest.lt(infinity) & tnear.lt(tfar);
        let sane = lengths.are_sane::<RAYS>(simd);

        lengths.shortest.store(&mut self.shortest);
        let one = RayLanes::<S>::splat(simd, 1.0);
        self.negative = [
            one.copysign(dx).lt(zero).bits(),
            one.copysign(dy).lt(zero).bits(),
            one.copysign(dz).lt(zero).bits(),
        ];
        let [mx, my, _] = lengths.magnitudes;
        self.largest = [mx.eq(lengths.largest).bits(), my.eq(lengths.largest).bits()];
        self.valid = valid.bits();
        self.tame = (valid & sane & zero.le(tnear)).bits();
    }

    /// The likeness of the ray of a lane, and the lanes of the rays that share it.
    #[inline(always)]
    pub fn alike(&self, lane: u32) -> (Likeness, u32) {
        let mut likeness = Likeness {
            signs: 0,
            largest: 0,
        };
        let mut unlike = 0;
        for (axis, &bits) in self.negative.iter().enumerate() {
            let own = bits >> lane & 1;
            likeness.signs |= (own as usize) << axis;
            unlike |= bits ^ own.wrapping_neg();
        }
        // The first of equal ones.
        let [x, y] = [self.largest[0], self.largest[1] & !self.largest[0]];
        for (axis, bits) in [x, y].into_iter().enumerate() {
            let own = bits >> lane & 1;
            likeness.largest |= (own as usize) << axis;
            unlike |= bits ^ own.wrapping_neg();
        }
        (likeness, !unlike)
    }
}

impl Likeness {
    /// The axes of the shear.
    #[inline(always)]
    pub fn axes(self) -> [usize; 3] {
        const AXES: [[usize; 3]; 4] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 2, 0]];
        AXES[self.largest & 3]
    }
}

/// A packet made ready for leaf tests.
pub(crate) struct LeafRays<S: Simd> {
    pub axes: [usize; 3],
    pub shear: Shear<RayLanes<S>>,
    pub ends: Ends<RayLanes<S>>,
}

impl<S: Simd> LeafRays<S> {
    /// For rays that are all alike.
    #[inline(always)]
    pub fn new(simd: S, rays: &PacketRays, likeness: Likeness) -> Self {
        let axes @ [x, y, z] = likeness.axes();
        let zero = RayLanes::<S>::splat(simd, 0.0);
        let dir_z = RayLanes::<S>::load(simd, &rays.dir[z]);
        let along = RayLanes::<S>::load(simd, &rays.shortest).copysign(dir_z);
        let shear = Shear {
            org: [
                RayLanes::<S>::load(simd, &rays.org[x]),
                RayLanes::<S>::load(simd, &rays.org[y]),
                RayLanes::<S>::load(simd, &rays.org[z]),
            ],
            shear: [
                RayLanes::<S>::load(simd, &rays.dir[x]) * along,
                RayLanes::<S>::load(simd, &rays.dir[y]) * along,
                zero - along,
            ],
        };
        let ends = Ends {
            tnear: RayLanes::<S>::load(simd, &rays.tnear),
            tfar: RayLanes::<S>::load(simd, &rays.tfar),
        };
        Self { axes, shear, ends }
    }
}

impl PacketRays {
    /// The ray of a lane on the axes of the packet's shear.
    #[inline(always)]
    pub fn sheared(&self, lane: usize, [x, y, z]: [usize; 3]) -> ShearedRay {
        let along = self.shortest[lane].copysign(self.dir[z][lane]);
        ShearedRay {
            org: [self.org[x][lane], self.org[y][lane], self.org[z][lane]],
            shear: [self.dir[x][lane] * along, self.dir[y][lane] * along, -along],
            tnear: self.tnear[lane],
            tfar: self.tfar[lane],
        }
    }
}

/// Around all rays of a packet.
pub(crate) struct Frustum {
    /// Reciprocal direction for near planes, offset for near planes, the same two for far planes.
    pub near_slabs: [[f32; 4]; 2],
    pub far_slabs: [[f32; 4]; 2],
    pub near: [Side; 4],
    pub tnear: f32,
    pub tfar: f32,
}

impl Frustum {
    /// Around the rays in `lanes`, which are at least one and all alike. `None` if numbers are too far
    /// apart.
    #[inline(always)]
    pub fn around<S: Simd>(
        simd: S,
        rows: &[Row; RAYS],
        lanes: u32,
        likeness: Likeness,
        extent: f32,
    ) -> Option<Self> {
        type Quarter<S> = <S as Width<4>>::Lanes;
        type Whole<S> = <S as Width<8>>::Lanes;
        let first = lanes.trailing_zeros() as usize % RAYS;
        let mut least = Whole::<S>::load(simd, &rows[first]);
        let mut most = least;
        for lane in 0..RAYS {
            // Others are replaced by one of them: cheaper than a branch.
            let is_one = lanes >> lane & 1 == 1;
            let row = &rows[core::hint::select_unpredictable(is_one, lane, first)];
            let row = Whole::<S>::load(simd, row);
            least = row.min(least);
            most = row.max(most);
        }
        let mut ends = [[0.0; 8]; 2];
        least.store(&mut ends[0]);
        most.store(&mut ends[1]);
        let [[org_min, dir_min], [org_max, dir_max]] = [
            Self::halves::<S>(simd, &ends[0]),
            Self::halves::<S>(simd, &ends[1]),
        ];
        let (tnear, tfar) = (ends[0][3], ends[1][7]);

        // Of directions of the same signs.
        let (low, high) = (dir_min.flip_sign(dir_min), dir_max.flip_sign(dir_max));
        let (least, most) = (low.min(high), low.max(high));
        let sign = dir_max;
        let [least_of_all, most_of_all] = [Self::largest(least), Self::largest(most)];
        let clamp_most = Quarter::<S>::splat(simd, most_of_all * MIN_DIRECTION);
        let clamp_least = Quarter::<S>::splat(simd, least_of_all * MIN_DIRECTION);
        let shallow = steepness(simd, most, clamp_most);
        let steep = steepness(simd, least, clamp_least);
        // Rays that are far apart make no packet: it would visit everything between them.
        let spread = Self::largest(org_max - org_min);
        let turn = Self::largest(most - least);
        if !((spread < extent * MAX_SPREAD) & (turn < most_of_all * MAX_TURN)) {
            return None;
        }
        let (low, high) = (org_min.flip_sign(org_min), org_max.flip_sign(org_max));
        let reach = Self::largest(low.max(high)) + extent;
        let margin = Quarter::<S>::splat(simd, reach * NODE_MARGIN);

        let mut frustum = Self {
            near_slabs: [[0.0; 4]; 2],
            far_slabs: [[0.0; 4]; 2],
            near: NEAR[likeness.signs & 7],
            tnear,
            tfar,
        };
        let near = shallow.copysign(sign);
        let far = steep.copysign(sign);
        near.store(&mut frustum.near_slabs[0]);
        far.store(&mut frustum.far_slabs[0]);
        // Whichever origins come to near planes last, and to far planes first.
        let near_offset = (org_min * near).max(org_max * near) + margin * shallow;
        let far_offset = (org_min * far).min(org_max * far) - margin * steep;
        near_offset.store(&mut frustum.near_slabs[1]);
        far_offset.store(&mut frustum.far_slabs[1]);
        let mut steepness = [0.0; 4];
        steep.store(&mut steepness);
        let steepest = max(max(steepness[0], steepness[1]), steepness[2]);
        (4.0 * reach * steepest < f32::MAX).then_some(frustum)
    }

    #[inline(always)]
    fn halves<S: Simd>(simd: S, row: &Row) -> [<S as Width<4>>::Lanes; 2] {
        let (halves, _) = row.as_chunks::<4>();
        [
            <S as Width<4>>::Lanes::load(simd, &halves[0]),
            <S as Width<4>>::Lanes::load(simd, &halves[1]),
        ]
    }

    /// The largest of the first three.
    #[inline(always)]
    fn largest(lanes: impl Lanes<4>) -> f32 {
        let mut values = [0.0; 4];
        lanes.store(&mut values);
        max(max(values[0], values[1]), values[2])
    }
}

impl Frustum {
    /// The test of N boxes at once. The distances that it returns are such that no ray enters before.
    #[inline(always)]
    pub fn test<S: Simd + Width<N>, const N: usize>(&self, simd: S) -> NodeTest<S, N> {
        NodeTest {
            slabs: NodeSlabs {
                near_rdir: splats::<S, N>(simd, &self.near_slabs[0]),
                near_offset: splats::<S, N>(simd, &self.near_slabs[1]),
                far_rdir: splats::<S, N>(simd, &self.far_slabs[0]),
                far_offset: splats::<S, N>(simd, &self.far_slabs[1]),
                tnear: NodeLanes::<S, N>::splat(simd, self.tnear),
            },
            near: self.near,
        }
    }
}

/// The first three values, in all lanes each.
#[inline(always)]
fn splats<S: Simd + Width<N>, const N: usize>(simd: S, row: &[f32; 4]) -> [NodeLanes<S, N>; 3] {
    [
        NodeLanes::<S, N>::splat(simd, row[0]),
        NodeLanes::<S, N>::splat(simd, row[1]),
        NodeLanes::<S, N>::splat(simd, row[2]),
    ]
}

/// The triangles of a block whose boxes a frustum may hit, up to `tfar`. Empty lanes are NaN and not touched.
#[inline(always)]
pub(crate) fn touched<S: Simd>(
    simd: S,
    test: &NodeTest<S, BLOCK>,
    block: &TriangleBlock,
    tfar: f32,
) -> Truths<S> {
    let [low, high] = boxes(&block.corners_on(simd, [0, 1, 2]));
    let present = low[0].le(high[0]);
    // The near sides are the same for all leaves of a packet: branches that a CPU guesses.
    let (mut near, mut far) = (low, high);
    for axis in 0..3 {
        if test.near[axis] == Side::High {
            (near[axis], far[axis]) = (high[axis], low[axis]);
        }
    }
    let tfar = Vector::<S>::splat(simd, tfar);
    test.slabs.test::<BLOCK>(near, far, tfar).0 & present
}
