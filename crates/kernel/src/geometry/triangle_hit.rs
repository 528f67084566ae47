//! The definition of a hit on a triangle: one ray, one triangle, in plain scalar code that every level shares.
//!
//! The corners are translated to the ray's origin and sheared so that the ray runs along z (Woop, Benthin and Wald
//! 2013, "Watertight Ray/Triangle Intersection", JCGT 2(1)), in single precision. All that follows is in double
//! precision, where products of single precision are exact. So the signs of the edge functions are those of the sheared
//! corners, and triangles that share an edge or a corner see the same ones. Zero counts as inside, on both sides. The
//! distance is a mean of the corners' distances with weights of one sign, and is rounded once at the end: thin triangles are
//! told as exactly as others, and a ray inside a closed mesh hits it, however thin the mesh is.
//!
//! What vectors can say sooner is in [`crate::geometry::edge_test`], why no tree loses a hit in
//! [`crate::geometry::ray_setup`].

/// A ray on the axes of its shear, see [`crate::geometry::ray_setup::RaySetup`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShearedRay {
    pub org: [f32; 3],
    pub shear: [f32; 3],
    pub tnear: f32,
    pub tfar: f32,
}

/// The corners of a triangle as a ray sees them, `[axis][corner]` on the axes of the shear. The ray runs through the
/// origin along the last one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShearedTriangle {
    x: [f32; 3],
    y: [f32; 3],
    z: [f32; 3],
    /// What a coordinate on the last axis is multiplied with to become a distance.
    per_z: f32,
}

impl ShearedTriangle {
    /// `corners` are `[axis][corner]`, on the axes of the shear.
    #[inline(always)]
    pub fn new([xs, ys, zs]: &[[f32; 3]; 3], ray: &ShearedRay) -> Self {
        let ([ox, oy, oz], [sx, sy, per_z]) = (ray.org, ray.shear);
        let z = zs.map(|z| oz - z);
        Self {
            x: core::array::from_fn(|corner| (ox - xs[corner]) - sx * z[corner]),
            y: core::array::from_fn(|corner| (oy - ys[corner]) - sy * z[corner]),
            z,
            per_z,
        }
    }

    /// The distance of the hit, if the ray passes through the triangle between `tnear` and `tfar`. None for a triangle that
    /// is seen as a line, for NaN, and where single precision has no number for what is sheared.
    #[inline(always)]
    pub fn distance(&self, ray: &ShearedRay) -> Option<f32> {
        let t = self.distance_or_nan(ray);
        (!t.is_nan()).then_some(t)
    }

    /// The same without a branch, for compilers to make vectors of.
    #[inline(always)]
    pub fn distance_or_nan(&self, ray: &ShearedRay) -> f32 {
        let [u, v, w] = self.edges();
        let inside = (u >= 0.0) & (v >= 0.0) & (w >= 0.0) | (u <= 0.0) & (v <= 0.0) & (w <= 0.0);
        let [a, b, c] = self.z.map(f64::from);
        let along = (u * a + v * b + w * c) / (u + v + w);
        // Adding 0 makes a zero positive.
        let t = (along * f64::from(self.per_z)) as f32 + 0.0;
        let is_hit = inside & (ray.tnear < t) & (t < ray.tfar);
        if is_hit { t } else { f32::NAN }
    }

    /// The barycentrics `u` and `v` of the hit: those of single precision, which vectors work out alike, where there are
    /// any.
    #[inline(always)]
    pub fn barycentrics(&self) -> [f32; 2] {
        let ([ax, bx, cx], [ay, by, cy]) = (self.x, self.y);
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let det = (u + v) + w;
        if (det != 0.0) & det.is_finite() {
            [v / det, w / det]
        } else {
            self.precise_barycentrics()
        }
    }

    /// The barycentrics of a triangle that is a line in single precision, or out of its range.
    #[cold]
    fn precise_barycentrics(&self) -> [f32; 2] {
        let [u, v, w] = self.edges();
        let det = u + v + w;
        [(v / det) as f32, (w / det) as f32]
    }

    /// The edge functions: each is rounded once, so its sign is exact.
    #[inline(always)]
    fn edges(&self) -> [f64; 3] {
        let ([ax, bx, cx], [ay, by, cy]) = (self.x.map(f64::from), self.y.map(f64::from));
        [cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax]
    }
}
