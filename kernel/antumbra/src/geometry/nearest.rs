//! How far a point is from a primitive, and where the primitive is nearest: what answers queries about points.
//!
//! Corners are `f32`, all arithmetic is `f64`, in the world: corners in an instance are placed first. So an answer is a
//! function of the point, the primitive and the transform only, and no tree can change a bit of it.

use crate::aabb::Aabb;
use crate::geometry::Sphere;
use crate::geometry::instance::{Affine, dot};
use crate::math;

/// Nearest point of a primitive to a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Near {
    pub distance2: f64,
    pub position: [f64; 3],
    /// Barycentric weights of the second and third corner; 0 without corners.
    pub uv: [f64; 2],
}

/// Point of a query, and how an object is placed there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place<'a> {
    /// In the world.
    pub point: [f64; 3],
    /// From the object to the world; `None` for what lies in the world itself.
    pub affine: Option<&'a Affine>,
}

impl Place<'_> {
    /// A point of the object in the world.
    #[inline(always)]
    pub fn in_world(&self, [x, y, z]: [f32; 3]) -> [f64; 3] {
        let point = [f64::from(x), f64::from(y), f64::from(z)];
        self.affine.map_or(point, |affine| affine.point(point))
    }

    /// The nearest point of a triangle: on one of its sides, or inside. Sides are well-conditioned where the inside of a
    /// sliver is not, so all are tried.
    pub fn triangle(&self, [a, b, c]: &[[f32; 3]; 3]) -> Near {
        let [a, b, c] = [self.in_world(*a), self.in_world(*b), self.in_world(*c)];
        let sides = [
            (a, b, [[0.0, 0.0], [1.0, 0.0]]),
            (b, c, [[1.0, 0.0], [0.0, 1.0]]),
            (c, a, [[0.0, 1.0], [0.0, 0.0]]),
        ];
        let mut best = self.side(sides[0]);
        for side in &sides[1..] {
            let near = self.side(*side);
            if near.distance2 < best.distance2 {
                best = near;
            }
        }
        let (ab, ac, ap) = (minus(b, a), minus(c, a), minus(self.point, a));
        // Weights by the normal equations of the plane.
        let (bb, bc, cc) = (dot(ab, ab), dot(ab, ac), dot(ac, ac));
        let (pb, pc) = (dot(ap, ab), dot(ap, ac));
        let det = bb * cc - bc * bc;
        let [u, v] = [(cc * pb - bc * pc) / det, (bb * pc - bc * pb) / det];
        // Not for NaN, of corners on one line.
        if u > 0.0 && v > 0.0 && u + v < 1.0 {
            let position = [
                a[0] + u * ab[0] + v * ac[0],
                a[1] + u * ab[1] + v * ac[1],
                a[2] + u * ab[2] + v * ac[2],
            ];
            let near = self.near(position, [u, v]);
            if near.distance2 < best.distance2 {
                best = near;
            }
        }
        best
    }

    /// The largest coordinate of a box of the object, in the world. In an instance that is a bound of the parts whose sum a
    /// coordinate is there, since each of them is rounded.
    pub fn reach(&self, bounds: &Aabb) -> f64 {
        let far: [f64; 3] = core::array::from_fn(|axis| {
            f64::from(bounds.min[axis].abs().max(bounds.max[axis].abs()))
        });
        let most = |v: [f64; 3]| v.into_iter().fold(0.0, f64::max);
        self.affine.map_or(most(far), |affine| {
            let parts = |[x, y, z, at]: [f64; 4]| dot([x.abs(), y.abs(), z.abs()], far) + at.abs();
            most(affine.rows.map(parts))
        })
    }

    /// The nearest point of a side, given by its ends and their weights.
    #[inline(always)]
    fn side(&self, (from, to, weights): ([f64; 3], [f64; 3], [[f64; 2]; 2])) -> Near {
        let along = minus(to, from);
        let share = dot(minus(self.point, from), along) / dot(along, along);
        // 0 also for NaN, of ends that coincide once placed.
        let share = if share > 0.0 { share.min(1.0) } else { 0.0 };
        let blend = |from: f64, to: f64| from + share * (to - from);
        // Ends exactly, whatever is rounded between them.
        let position = if share == 1.0 {
            to
        } else {
            [
                from[0] + share * along[0],
                from[1] + share * along[1],
                from[2] + share * along[2],
            ]
        };
        let [first, second] = weights;
        self.near(
            position,
            [blend(first[0], second[0]), blend(first[1], second[1])],
        )
    }

    /// The nearest point, if that is this one.
    #[inline(always)]
    pub fn near(&self, position: [f64; 3], uv: [f64; 2]) -> Near {
        let way = minus(position, self.point);
        Near {
            distance2: dot(way, way),
            position,
            uv,
        }
    }

    /// The nearest point of the surface of a sphere, which an instance may make an ellipsoid.
    pub fn sphere(&self, sphere: &Sphere) -> Near {
        let center = self.in_world(sphere.center);
        let radius = f64::from(sphere.radius);
        let to_point = minus(self.point, center);
        let way = match self.affine {
            None => on_sphere(to_point, radius),
            Some(affine) => on_ellipsoid(affine, to_point, radius),
        };
        self.near(
            core::array::from_fn(|axis| center[axis] + way[axis]),
            [0.0; 2],
        )
    }
}

#[inline(always)]
pub(crate) fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// The nearest point to `point` on a sphere around the origin.
fn on_sphere(point: [f64; 3], radius: f64) -> [f64; 3] {
    let length = math::sqrt(dot(point, point));
    if length == 0.0 {
        return [radius, 0.0, 0.0];
    }
    point.map(|x| x / length * radius)
}

/// The nearest point to `point` on the image of a sphere around the origin under a linear map `A`.
///
/// The least `|A x - point|` with `|x| = radius` solves `(A' A + l) x = A' point` for the largest `l` that gives `x`
/// this length. In the basis of eigenvectors of `A' A` that is an equation for the single unknown `l`, found by
/// bisection.
fn on_ellipsoid(affine: &Affine, point: [f64; 3], radius: f64) -> [f64; 3] {
    let columns: [[f64; 3]; 3] =
        core::array::from_fn(|column| core::array::from_fn(|row| affine.rows[row][column]));
    let square = columns.map(|a| columns.map(|b| dot(a, b)));
    let (values, vectors) = eigen(square);
    let shortest = (1..3).fold(0, |best, i| if values[i] < values[best] { i } else { best });
    let aim = columns.map(|column| dot(column, point));
    let aim = vectors.map(|vector| dot(vector, aim));
    // In units of the smallest eigenvalue plus `l`.
    let above = values.map(|value| value - values[shortest]);
    let part = |i: usize, s: f64| {
        let quotient = aim[i] / (above[i] + s);
        // 0 / 0: the others decide.
        if quotient.is_nan() { 0.0 } else { quotient }
    };
    let (mut low, mut high) = (
        aim[shortest].abs() / radius,
        math::sqrt(dot(aim, aim)) / radius,
    );
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        let length2: f64 = (0..3).map(|i| part(i, middle) * part(i, middle)).sum();
        if length2 > radius * radius {
            low = middle;
        } else {
            high = middle;
        }
    }
    let mut x: [f64; 3] = core::array::from_fn(|i| part(i, high));
    // What is left of the length, also where the point is in the plane of symmetry.
    x[shortest] = 0.0;
    let rest = math::sqrt((radius * radius - dot(x, x)).max(0.0));
    x[shortest] = rest.copysign(aim[shortest]);
    let turned: [f64; 3] =
        core::array::from_fn(|axis| (0..3).map(|i| x[i] * vectors[i][axis]).sum());
    affine.vector(turned)
}

/// Eigenvalues and eigenvectors (rows of the result) of a symmetric matrix, by rotations (Jacobi 1846).
pub(crate) fn eigen(mut a: [[f64; 3]; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
    let mut vectors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    // A few sweeps are enough: convergence is quadratic.
    for _ in 0..16 {
        if a[0][1] == 0.0 && a[0][2] == 0.0 && a[1][2] == 0.0 {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let tan = theta.signum() / (theta.abs() + math::sqrt(theta * theta + 1.0));
            let cos = 1.0 / math::sqrt(tan * tan + 1.0);
            let sin = tan * cos;
            for k in 0..3 {
                let (kp, kq) = (a[k][p], a[k][q]);
                a[k][p] = cos * kp - sin * kq;
                a[k][q] = sin * kp + cos * kq;
            }
            for k in 0..3 {
                let (pk, qk) = (a[p][k], a[q][k]);
                a[p][k] = cos * pk - sin * qk;
                a[q][k] = sin * pk + cos * qk;
            }
            for k in 0..3 {
                let (pk, qk) = (vectors[p][k], vectors[q][k]);
                vectors[p][k] = cos * pk - sin * qk;
                vectors[q][k] = sin * pk + cos * qk;
            }
            (a[p][q], a[q][p]) = (0.0, 0.0);
        }
    }
    (core::array::from_fn(|i| a[i][i]), vectors)
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_testkit::Rng;

    fn random(rng: &mut Rng) -> [f64; 3] {
        rng.point(1.0).map(f64::from)
    }

    /// No point of a dense sample is nearer, and one of them is nearly as near.
    #[test]
    fn triangles_are_nearest_there() {
        let mut rng = Rng::new(301);
        for case in 0..300 {
            let mut corners = [(); 3].map(|()| rng.point(1.0));
            if case % 3 == 0 {
                // A sliver, or a line.
                let share = rng.unit();
                corners[2] = core::array::from_fn(|axis| {
                    corners[0][axis] + share * (corners[1][axis] - corners[0][axis])
                });
            }
            let place = Place {
                point: random(&mut rng),
                affine: None,
            };
            let near = place.triangle(&corners);
            let [a, b, c] = corners.map(|corner| corner.map(f64::from));
            let mut least = f64::INFINITY;
            for i in 0..=60 {
                for j in 0..=60 - i {
                    let (u, v) = (f64::from(i) / 60.0, f64::from(j) / 60.0);
                    let at: [f64; 3] = core::array::from_fn(|axis| {
                        a[axis] + u * (b[axis] - a[axis]) + v * (c[axis] - a[axis])
                    });
                    least = least.min(place.near(at, [u, v]).distance2);
                }
            }
            let (near, least) = (near.distance2.sqrt(), least.sqrt());
            assert!(near <= least + 1e-12, "{near} {least} {corners:?}");
            assert!(near > least - 0.06, "{near} {least} {corners:?}");
        }
    }

    /// Of all points on an ellipsoid the one found is the nearest.
    #[test]
    fn ellipsoids_are_nearest_there() {
        let mut rng = Rng::new(302);
        for case in 0..300 {
            let mut affine = Affine {
                rows: [(); 3].map(|()| {
                    let [a, b, c] = random(&mut rng);
                    [a, b, c, 0.0]
                }),
            };
            if case % 3 == 0 {
                let [a, b, _] = random(&mut rng).map(|x| 0.2 + x.abs());
                affine.rows = [[a, 0.0, 0.0, 0.0], [0.0, a, 0.0, 0.0], [0.0, 0.0, b, 0.0]];
            }
            let mut point = random(&mut rng);
            if case % 2 == 0 {
                // In planes of symmetry, on axes and in the centre.
                for axis in 0..rng.below(4) {
                    point[axis] = 0.0;
                }
            }
            let radius = 0.1 + f64::from(rng.unit());
            let found = on_ellipsoid(&affine, point, radius);
            let distance = |at: [f64; 3]| dot(minus(at, point), minus(at, point)).sqrt();
            let mut least = f64::INFINITY;
            for _ in 0..3000 {
                let direction = on_sphere(rng.direction().map(f64::from), radius);
                least = least.min(distance(affine.vector(direction)));
            }
            assert!(
                distance(found) <= least + 1e-9,
                "{affine:?} {point:?} {radius}"
            );
            let back = affine.inverse().map(|inverse| inverse.vector(found));
            if let Some(back) = back {
                let length = dot(back, back).sqrt();
                assert!(
                    (length - radius).abs() < 1e-6,
                    "{length} {radius} {affine:?}"
                );
            }
        }
    }
}
