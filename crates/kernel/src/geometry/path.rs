//! Paths of instances: transforms that change between two keys.
//!
//! # What a transform is between its keys
//!
//! A key is a translation `T` after a linear map `M`. Polar decomposition makes `M = R S`, with a rotation `R` and a symmetric
//! stretch `S` (Shoemake and Duff 1992). Between two keys `T` and `S` change linearly, and `R` turns about one axis at one speed,
//! the shorter way (Shoemake 1985: spherical interpolation of quaternions). pbrt interpolates alike. The transform of a time is
//! rounded to single precision, and from there on a static instance has it.
//!
//! `S` is positive definite, or negative definite where `M` mirrors. Keys of one sign are demanded, so the stretch between them
//! is definite as well, and has an inverse at all times.
//!
//! # Why the boxes of a path hold the object at all times
//!
//! A point `p` of the object is at `x(s) = T(s) + R(s) S(s) p` at the share `s` of the way between two keys. Its speed on an axis is at most
//! `|T1 - T0| + w r + d`:
//! - `T` changes at the constant speed `T1 - T0`.
//! - `R` turns by the angle `w` in all. `|S(s) p|` is a convex function of `s` and of `p`, so it has its largest value `r` at a
//!   corner of the object's box at a key.
//! - `S` changes at the constant speed `S1 - S0`, and `|(S1 - S0) p|` has its largest value `d` at a corner as well.
//!
//! So around the middle `c` of a step of `2 h`, the box of the object at `c`, wider by `h` times that speed, holds the object
//! at all times of the step. Two planes that are linear in `s`, and beyond the planes of all steps at both of their ends, hold it
//! at all times. Two margins are added. Rounding `R S` and `T` to single precision moves `x` by less than [`ROUNDED`] times
//! `|S| |p| + |T|`, where `|S|` is the Frobenius norm. Rounding a plane at a time moves the plane by less than [`PLANE`]
//! times its distance from the origin.

use crate::aabb::Aabb;
use crate::geometry::instance::{Affine, ObjectShape, Placement, cross, dot};
use crate::math;

/// Steps between two keys of which boxes are made.
const STEPS: usize = 64;
/// Two roundings of `f32`.
const ROUNDED: f64 = 2.0 / (1u64 << 24) as f64;
/// Eight roundings of `f32`: evaluating a plane takes five at most.
const PLANE: f64 = 8.0 / (1u64 << 24) as f64;
/// Angles between quaternions below this, whose sine is no divisor, are none: less than a rounding of `f32`.
const NO_ANGLE: f64 = 1e-9;

/// Values between two keys, at a share of the way. Three operations, each rounded: the same bits wherever they are computed,
/// and a value that does not change keeps its value.
#[inline(always)]
pub(crate) fn between<const K: usize>(start: &[f32; K], end: &[f32; K], share: f32) -> [f32; K] {
    core::array::from_fn(|i| start[i] + share * (end[i] - start[i]))
}

/// A transform between two keys, as a translation, a rotation and a stretch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Path {
    moved: [[f64; 3]; 2],
    /// Unit quaternions, `[w, x, y, z]`, less than a quarter of a turn of the sphere apart.
    turned: [[f64; 4]; 2],
    stretched: [[[f64; 3]; 3]; 2],
    /// Angle between the quaternions: half the angle that the object turns by.
    angle: f64,
    /// One over its sine; of no meaning below [`NO_ANGLE`].
    per_sine: f64,
}

/// Why a transform cannot be a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unfit {
    /// The key of this number has a number that is not finite, or no inverse.
    Key(usize),
    /// One key mirrors and the other does not.
    Mirrors,
}

impl Path {
    /// A path from one transform to another.
    pub fn new(keys: [&[[f32; 4]; 3]; 2]) -> Result<Self, Unfit> {
        let parts = |key: usize| Parts::new(keys[key]).ok_or(Unfit::Key(key));
        let (start, mut end) = (parts(0)?, parts(1)?);
        if start.mirrors != end.mirrors {
            return Err(Unfit::Mirrors);
        }
        let mut cosine = dot4(start.turned, end.turned);
        if cosine < 0.0 {
            end.turned = end.turned.map(|x| -x);
            cosine = -cosine;
        }
        // The sine as well, for angles whose cosine is 1 but for rounding.
        let across: [f64; 4] = core::array::from_fn(|i| end.turned[i] - cosine * start.turned[i]);
        let angle = libm::atan2(math::sqrt(dot4(across, across)), cosine);
        Ok(Self {
            moved: [start.moved, end.moved],
            turned: [start.turned, end.turned],
            stretched: [start.stretched, end.stretched],
            angle,
            per_sine: 1.0 / sine(angle),
        })
    }

    /// The transform at a share of the way, not rounded.
    fn affine(&self, share: f64) -> Affine {
        let mix = |a: f64, b: f64| a + share * (b - a);
        let turned = self.rotation(share);
        let [from, to] = self.stretched;
        let rows = core::array::from_fn(|row| {
            let column = |column: usize| {
                let along = |i: usize| turned[row][i] * mix(from[i][column], to[i][column]);
                along(0) + along(1) + along(2)
            };
            let moved = mix(self.moved[0][row], self.moved[1][row]);
            [column(0), column(1), column(2), moved]
        });
        Affine { rows }
    }

    /// The transform at a share of the way.
    pub fn transform(&self, share: f32) -> [[f32; 4]; 3] {
        let rows = self.affine(f64::from(share)).rows;
        rows.map(|row| row.map(|x| x as f32))
    }

    fn rotation(&self, share: f64) -> [[f64; 3]; 3] {
        let [a, b] = self.turned;
        let quaternion = if self.angle < NO_ANGLE {
            a
        } else {
            let first = sine((1.0 - share) * self.angle) * self.per_sine;
            let second = sine(share * self.angle) * self.per_sine;
            core::array::from_fn(|i| first * a[i] + second * b[i])
        };
        matrix(quaternion)
    }

    /// Boxes at both ends such that the box between them, at any share of the way, holds an object of this shape.
    fn boxes(&self, shape: &ObjectShape) -> Option<[[[f64; 3]; 2]; 2]> {
        let corners = shape.corners();
        let largest = |of: &[[f64; 3]; 3]| {
            let lengths = corners.iter().map(|corner| {
                let at = of.map(|row| dot(row, *corner));
                math::sqrt(dot(at, at))
            });
            lengths.fold(0.0, f64::max)
        };
        // Of a vector, or the Frobenius norm of a matrix.
        let length = |rows: &[[f64; 3]]| math::sqrt(rows.iter().map(|row| dot(*row, *row)).sum());
        let [from, to] = self.stretched;
        let change = core::array::from_fn(|row| [0, 1, 2].map(|i| to[row][i] - from[row][i]));
        let distances = corners.iter().map(|corner| length(&[*corner]));
        let products = f64::max(length(&from), length(&to)) * distances.fold(0.0, f64::max);
        let radius = f64::max(largest(&from), largest(&to));
        let speed = 2.0 * self.angle * radius + largest(&change);
        let step = 1.0 / STEPS as f64;
        let mut steps = [[[0.0; 3]; 2]; STEPS];
        for (index, planes) in steps.iter_mut().enumerate() {
            let affine = self.affine((index as f64 + 0.5) * step);
            let bounds = shape.placed(&affine, &affine.inverse()?);
            for axis in 0..3 {
                let moved = (self.moved[1][axis] - self.moved[0][axis]).abs();
                let farthest = self.moved.map(|moved| moved[axis].abs());
                let rounded = ROUNDED * (products + f64::max(farthest[0], farthest[1]));
                let wider = 0.5 * step * (moved + speed) + rounded;
                planes[0][axis] = f64::from(bounds.min[axis]) - wider;
                planes[1][axis] = f64::from(bounds.max[axis]) + wider;
            }
        }
        let mut boxes = [steps[0], steps[STEPS - 1]];
        for axis in 0..3 {
            for (side, sign) in [(0, -1.0), (1, 1.0)] {
                let ends = boxes.map(|planes| planes[side][axis]);
                let mut wider = 0.0;
                for (index, planes) in steps.iter().enumerate() {
                    for end in [index, index + 1] {
                        let plane = ends[0] + end as f64 * step * (ends[1] - ends[0]);
                        wider = f64::max(wider, sign * (planes[side][axis] - plane));
                    }
                }
                let farthest = f64::max(ends[0].abs(), ends[1].abs()) + wider;
                for planes in &mut boxes {
                    planes[side][axis] += sign * (wider + PLANE * farthest);
                }
            }
        }
        Some(boxes)
    }
}

/// An instance on its way between two keys.
#[derive(Clone, Debug)]
pub(crate) struct MovingPlacement {
    path: Path,
    /// Boxes around the object at both ends, see [`Placement::planes`].
    planes: [[[f32; 4]; 2]; 2],
    reach: f32,
    inst_id: u32,
}

impl MovingPlacement {
    /// Moves an object of this shape; `None` if that is out of the range of `f32`.
    pub fn new(path: Path, shape: &ObjectShape, inst_id: u32) -> Option<Self> {
        let boxes = path.boxes(shape)?;
        let planes = boxes.map(|[min, max]| {
            let [x, y, z] = min.map(|x| (x as f32).next_down());
            let [u, v, w] = max.map(|x| (x as f32).next_up());
            [[x, y, z, 0.0], [u, v, w, 0.0]]
        });
        // Differences of planes must be finite as well.
        let is_sane = |x: &f32| x.abs() < f32::MAX / 4.0;
        let placement = Self {
            path,
            planes,
            reach: shape.reach(),
            inst_id,
        };
        planes
            .as_flattened()
            .as_flattened()
            .iter()
            .all(is_sane)
            .then_some(placement)
    }

    /// The boxes around the object at both ends.
    pub fn bounds(&self) -> [Aabb; 2] {
        self.planes.map(|planes| {
            let [min, max] = planes.map(|[x, y, z, _]| [x, y, z]);
            Aabb { min, max }
        })
    }

    /// Smallest and largest coordinates of the box around the object at a share of the way.
    #[inline(always)]
    pub fn planes(&self, share: f32) -> [[f32; 4]; 2] {
        let [start, end] = &self.planes;
        core::array::from_fn(|side| between(&start[side], &end[side], share))
    }

    /// The placement at a share of the way, with the box of that time. `None` where the transform has no inverse, which
    /// only rounding can bring about.
    #[inline(never)]
    pub fn at(&self, share: f32, planes: [[f32; 4]; 2]) -> Option<Placement> {
        let inverse = Affine::new(&self.path.transform(share)).inverse()?;
        Some(Placement {
            object_from_world: inverse.columns(),
            reach: self.reach,
            planes,
            inst_id: self.inst_id,
        })
    }
}

/// A transform taken apart.
struct Parts {
    moved: [f64; 3],
    /// A unit quaternion, `[w, x, y, z]`.
    turned: [f64; 4],
    stretched: [[f64; 3]; 3],
    mirrors: bool,
}

impl Parts {
    /// Translation, rotation and stretch of a transform. `None` unless all is finite and has an inverse.
    fn new(transform: &[[f32; 4]; 3]) -> Option<Self> {
        if !transform.as_flattened().iter().all(|x| x.is_finite()) {
            return None;
        }
        let affine = Affine::new(transform);
        affine.inverse()?;
        let linear = affine.rows.map(|[a, b, c, _]| [a, b, c]);
        let mirrors = dot(linear[0], affine.cofactors()[0]) < 0.0;
        let sign = if mirrors { -1.0 } else { 1.0 };
        // Scaled to about 1, so that nothing overflows; Newton's iteration converges from any matrix with an inverse.
        let size = linear.iter().map(|row| dot(*row, *row)).fold(0.0, f64::max);
        let scale = sign / math::sqrt(size);
        let mut turned = linear.map(|row| row.map(|x| x * scale));
        for _ in 0..100 {
            let [p, q, r] = turned;
            let cofactors = [cross(q, r), cross(r, p), cross(p, q)];
            let per_det = 1.0 / dot(p, cofactors[0]);
            let next: [[f64; 3]; 3] = core::array::from_fn(|row| {
                [0, 1, 2].map(|i| 0.5 * (turned[row][i] + cofactors[row][i] * per_det))
            });
            let change = (turned.iter().flatten().zip(next.iter().flatten()))
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max);
            turned = next;
            if change < 1e-15 {
                break;
            }
        }
        // The transposed rotation brings the map back to its stretch.
        let stretched = core::array::from_fn(|row| {
            [0, 1, 2].map(|column| {
                (0..3)
                    .map(|i| turned[i][row] * linear[i][column])
                    .sum::<f64>()
            })
        });
        Some(Self {
            moved: affine.rows.map(|row| row[3]),
            turned: quaternion(&turned),
            stretched,
            mirrors,
        })
    }
}

/// Per term of the series of the sine, one over the next two factors of the factorial.
const PER_FACTORS: [f64; 9] = {
    let mut per_factors = [0.0; 9];
    let mut term = 0;
    while term < per_factors.len() {
        let next = 2.0 * (term as f64 + 1.0);
        per_factors[term] = 1.0 / (next * (next + 1.0));
        term += 1;
    }
    per_factors
};

/// Sine of an angle from 0 to a quarter of a turn, to `1e-13`: its series, as a library would first bring the angle into that
/// range.
fn sine(angle: f64) -> f64 {
    let square = angle * angle;
    let terms = PER_FACTORS.iter().rev();
    angle * terms.fold(1.0, |sum, per_factors| 1.0 - square * per_factors * sum)
}

fn dot4(a: [f64; 4], b: [f64; 4]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
}

/// The unit quaternion of a rotation (Shepperd 1978): by the largest of its four numbers.
fn quaternion(m: &[[f64; 3]; 3]) -> [f64; 4] {
    let trace = m[0][0] + m[1][1] + m[2][2];
    let sizes = [trace, m[0][0], m[1][1], m[2][2]];
    let largest = (0..4).fold(0, |best, i| if sizes[i] > sizes[best] { i } else { best });
    let [yz, zx, xy] = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]];
    let [a, b, c] = [m[1][0] + m[0][1], m[0][2] + m[2][0], m[2][1] + m[1][2]];
    let q = match largest {
        0 => [1.0 + trace, yz, zx, xy],
        1 => [yz, 1.0 + 2.0 * m[0][0] - trace, a, b],
        2 => [zx, a, 1.0 + 2.0 * m[1][1] - trace, c],
        _ => [xy, b, c, 1.0 + 2.0 * m[2][2] - trace],
    };
    let per_length = 1.0 / math::sqrt(dot4(q, q));
    q.map(|x| x * per_length)
}

/// The rotation of a quaternion of about length 1.
fn matrix(q: [f64; 4]) -> [[f64; 3]; 3] {
    let per_length2 = 2.0 / dot4(q, q);
    let [w, x, y, z] = q;
    let of = |a: f64, b: f64| a * b * per_length2;
    [
        [
            1.0 - of(y, y) - of(z, z),
            of(x, y) - of(w, z),
            of(x, z) + of(w, y),
        ],
        [
            of(x, y) + of(w, z),
            1.0 - of(x, x) - of(z, z),
            of(y, z) - of(w, x),
        ],
        [
            of(x, z) - of(w, y),
            of(y, z) + of(w, x),
            1.0 - of(x, x) - of(y, y),
        ],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_is_the_sine() {
        for step in 0..=1000 {
            let angle = core::f64::consts::FRAC_PI_2 * f64::from(step) / 1000.0;
            assert!((sine(angle) - libm::sin(angle)).abs() < 1e-13, "{angle}");
        }
    }
}
