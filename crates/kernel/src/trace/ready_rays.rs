//! The rays that come next in a wave, made ready sixteen at a time and handed out one by one.
//!
//! Worked out in lanes, a ray takes a quarter of the instructions that [`RaySetup::set`] takes for it alone. The results
//! are turned into rows of 16 bytes in registers, and written, read and written again as such: a CPU waits when a
//! load takes what several stores before it have just written.

use antumbra_simd::{Lanes, Mask, Scalar, Simd};

use super::ray_columns::{RAYS, RayColumns, RayLanes, RayMask, Row, row};
use super::setup::{Facing, MIN_DIRECTION, NODE_MARGIN, RaySetup};
use crate::ray::{INVALID_ID, Ray};

/// A row of a [`RaySetup`], of every ray.
type Rows = [[f32; 4]; RAYS];

#[repr(C, align(64))]
pub(crate) struct ReadyRays {
    slabs: [Rows; 3],
    shear_org: Rows,
    shear: Rows,
    reach: [f32; RAYS],
    /// Numbers of [`Facing::ALL`].
    facings: [u8; RAYS],
    /// Bits of the rays that can hit something, and that nothing is unusual about.
    plain: u32,
}

impl ReadyRays {
    /// None.
    pub const NONE: Self = Self {
        slabs: [[[0.0; 4]; RAYS]; 3],
        shear_org: [[0.0; 4]; RAYS],
        shear: [[0.0; 4]; RAYS],
        reach: [0.0; RAYS],
        facings: [0; RAYS],
        plain: 0,
    };

    /// Makes the first of the `pending` rays ready for primitives whose coordinates are at most `reach`.
    #[inline(always)]
    pub fn set<S: Simd>(&mut self, simd: S, rays: &[Ray], pending: &[u32], reach: f32) {
        let mut rows: [Row; RAYS] = [[0.0; 8]; RAYS];
        for (ready, &index) in rows.iter_mut().zip(pending) {
            *ready = row(&rays[index as usize]);
        }
        let columns = RayColumns::new(simd, &rows, reach);
        let zero = RayLanes::<S>::splat(simd, 0.0);
        let one = RayLanes::<S>::splat(simd, 1.0);

        let least = columns.largest * RayLanes::<S>::splat(simd, MIN_DIRECTION);
        let margin = columns.reach * RayLanes::<S>::splat(simd, NODE_MARGIN);
        let mut slabs = [[zero; 4]; 3];
        for axis in 0..3 {
            let steepness = one / columns.magnitude[axis].max(least);
            let rdir = steepness.copysign(columns.dir[axis]);
            let offset = columns.org[axis] * rdir;
            let widening = margin * steepness;
            slabs[0][axis] = rdir;
            slabs[1][axis] = offset + widening;
            slabs[2][axis] = offset - widening;
        }
        for (rows, columns) in self.slabs.iter_mut().zip(slabs) {
            simd.rows(columns, rows);
        }

        let [mx, my, _] = columns.magnitude;
        let (x_leads, y_leads) = (mx.eq(columns.largest), my.eq(columns.largest));
        let leads = [x_leads, y_leads];
        let [x, y, z] = turn::<S>(columns.org, leads);
        simd.rows([x, y, z, columns.doubt_by_spread], &mut self.shear_org);
        let [x, y, z] = turn::<S>(columns.dir, leads);
        let along = columns.shortest.copysign(z);
        let shear = [x * along, y * along, zero - along, columns.minus_doubt];
        simd.rows(shear, &mut self.shear);

        columns.reach.store(&mut self.reach);
        let [x, y, z] = columns.negative(simd);
        let [x_leads, y_leads] = columns.is_largest();
        for (lane, facing) in self.facings.iter_mut().enumerate() {
            let mut number = 0;
            for (place, bits) in [x, y, z, x_leads, y_leads].into_iter().enumerate() {
                number |= (bits >> lane & 1) << place;
            }
            *facing = number as u8;
        }
        self.plain = (columns.valid & columns.sane).bits();
    }

    /// [`RaySetup::set`] for a ray that is number `lane` of those made ready.
    #[inline(always)]
    pub fn hand_out(&self, lane: usize, ray: &Ray, reach: f32, setup: &mut RaySetup) -> bool {
        let lane = lane % RAYS;
        if self.plain >> lane & 1 == 0 {
            return set_alone(setup, ray, reach);
        }
        let [rdir, near_offset, far_offset] = &self.slabs;
        setup.slabs = [rdir[lane], near_offset[lane], far_offset[lane]];
        setup.shear_org = self.shear_org[lane];
        setup.shear = self.shear[lane];
        setup.ray = *ray;
        setup.facing = Facing::ALL[usize::from(self.facings[lane]) % Facing::ALL.len()];
        setup.reach = self.reach[lane];
        setup.inst_id = INVALID_ID;
        true
    }
}

/// From the axes x, y, z to those of the shear, by the lanes whose direction is largest on x, and on y.
#[inline(always)]
fn turn<S: Simd>(
    [x, y, z]: [RayLanes<S>; 3],
    [x_leads, y_leads]: [RayMask<S>; 2],
) -> [RayLanes<S>; 3] {
    [
        y.select(x_leads, z.select(y_leads, x)),
        z.select(x_leads, x.select(y_leads, y)),
        x.select(x_leads, y.select(y_leads, z)),
    ]
}

#[cold]
#[inline(never)]
fn set_alone(setup: &mut RaySetup, ray: &Ray, reach: f32) -> bool {
    setup.set(Scalar, ray, reach)
}
