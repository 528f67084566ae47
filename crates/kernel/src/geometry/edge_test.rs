//! The arithmetic of the triangle test in vectors: one ray against many triangles, or many rays against one.
//!
//! The arithmetic does not depend on what the lanes stand for, and nothing is fused where that could decide, so both
//! ways give the same bits. The test is described in [`crate::geometry::triangle`], what can be said of a hit
//! without a division in [`crate::geometry::ray_setup`].

use antumbra_simd::Lanes;

/// Input of the edge functions: the ray of each lane on the axes of its shear, see
/// [`crate::geometry::ray_setup::RaySetup`].
#[derive(Clone, Copy)]
pub(crate) struct Shear<V> {
    pub org: [V; 3],
    pub shear: [V; 3],
}

impl<V> Shear<V> {
    /// Corners relative to the origin, sheared so that the ray runs along the last axis.
    ///
    /// Takes the origin relative to the corners, not the corners relative to the origin: two signs that cancel,
    /// for the sake of loads that are part of the subtraction.
    #[inline(always)]
    pub fn of<const L: usize>(&self, [xs, ys, zs]: &Corners<V>) -> Corners<V>
    where
        V: Lanes<L>,
    {
        let ([ox, oy, oz], [sx, sy, _]) = (self.org, self.shear);
        let [az, bz, cz] = [oz - zs[0], oz - zs[1], oz - zs[2]];
        [
            [
                (ox - xs[0]) - sx * az,
                (ox - xs[1]) - sx * bz,
                (ox - xs[2]) - sx * cz,
            ],
            [
                (oy - ys[0]) - sy * az,
                (oy - ys[1]) - sy * bz,
                (oy - ys[2]) - sy * cz,
            ],
            [az, bz, cz],
        ]
    }

    /// What makes distances of coordinates on the last axis.
    #[inline(always)]
    pub fn per_z(&self) -> V
    where
        V: Copy,
    {
        self.shear[2]
    }
}

/// Input of [`Edges::judge`]: the interval of the ray of each lane, and the sizes of doubt.
#[derive(Clone, Copy)]
pub(crate) struct Ends<V> {
    pub tnear: V,
    pub tfar: V,
    pub doubt_by_spread: V,
    pub minus_doubt: V,
}

/// The part of the test that all lanes go through.
#[derive(Clone, Copy)]
pub(crate) struct Edges<V> {
    /// The edge functions.
    pub u: V,
    pub v: V,
    pub w: V,
    /// Their sum.
    pub det: V,
    /// Distances of the corners along the ray.
    t: [V; 3],
    /// Mean of those, weighted by the edge functions: the distance of the hit times `det`.
    t_det: V,
}

/// The hits as far as they can be told without a division. Every lane that is hit is in one of the masks.
pub(crate) struct Verdict<M> {
    /// Lanes that are hit beyond doubt.
    pub sure: M,
    /// Lanes that may be hit or not.
    pub doubtful: M,
}

/// Corners on three axes: `[axis][corner]`.
pub(crate) type Corners<V> = [[V; 3]; 3];

impl<V> Edges<V> {
    /// From corners as [`Shear::of`] makes them, and what makes distances of their last coordinates.
    #[inline(always)]
    pub fn new<const L: usize>(corners: &Corners<V>, per_z: V) -> Self
    where
        V: Lanes<L>,
    {
        let [[ax, bx, cx], [ay, by, cy], [az, bz, cz]] = *corners;
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let t = [az * per_z, bz * per_z, cz * per_z];
        Self {
            u,
            v,
            w,
            det: (u + v) + w,
            t,
            t_det: (u * t[0] + v * t[1]) + w * t[2],
        }
    }

    /// The lanes whose ray may pass through the triangle, at whatever distance.
    #[inline(always)]
    pub fn inside<const L: usize>(&self, zero: V) -> V::Mask
    where
        V: Lanes<L>,
    {
        let least = self.u.min(self.v.min(self.w));
        let most = self.u.max(self.v.max(self.w));
        zero.le(least) | most.le(zero)
    }

    /// Decides nearly all lanes, by the argument in [`crate::geometry::ray_setup`].
    #[inline(always)]
    pub fn judge<const L: usize>(&self, zero: V, ray: &Ends<V>) -> Verdict<V::Mask>
    where
        V: Lanes<L>,
    {
        let size = self.det.flip_sign(self.det);
        let t_size = self.t_det.flip_sign(self.det);
        // In this order: an infinite end times nothing is NaN, and then the other end counts.
        let to_end = (ray.tfar.mul_sub(size, t_size)).min(t_size - ray.tnear * size);
        let [a, b, c] = self.t;
        let spread = a.max(b.max(c)) - a.min(b.min(c));
        let doubt = size * ray.minus_doubt;
        let doubt = spread.mul_sub(ray.doubt_by_spread, doubt);

        let product = (self.u * self.v) * self.w;
        let off_edges = zero.lt(product.flip_sign(product));
        let sides_differ = self.u.signs_differ(self.v, self.w);
        let sure = doubt.lt(to_end) & off_edges & !sides_differ;
        let possible = zero.le(to_end + doubt) & !(sides_differ & off_edges);
        Verdict {
            sure,
            doubtful: possible & !sure,
        }
    }

    /// The barycentrics `u` and `v`, of meaning in lanes that are surely hit: those of
    /// [`crate::geometry::triangle_hit::ShearedTriangle::barycentrics`].
    #[inline(always)]
    pub fn barycentrics<const L: usize>(&self) -> [V; 2]
    where
        V: Lanes<L>,
    {
        [self.v / self.det, self.w / self.det]
    }
}

/// The boxes of triangles with these corners, given as smallest and largest coordinates.
#[inline(always)]
pub(crate) fn boxes<const L: usize, V: Lanes<L>>(corners: &Corners<V>) -> [[V; 3]; 2] {
    let [[ax, bx, cx], [ay, by, cy], [az, bz, cz]] = *corners;
    [
        [ax.min(bx.min(cx)), ay.min(by.min(cy)), az.min(bz.min(cz))],
        [ax.max(bx.max(cx)), ay.max(by.max(cy)), az.max(bz.max(cz))],
    ]
}
