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

use core::array;

use crate::aabb::Aabb;
use crate::geometry::instance::{Affine, ObjectShape, Placement, cross, dot};
use crate::math;

/// Steps between two keys of which boxes are made.
const STEPS: usize = 64;
/// Two roundings of `f32`.
const ROUNDED: f64 = 2.0 / (1u64 << 24) as f64;
/// Eight roundings of `f32`: evaluating a plane takes five at most.
const PLANE: f64 = 8.0 / (1u64 << 24) as f64;
/// Angles between quaternions below this have no axis: less than a rounding of `f32`.
const NO_ANGLE: f64 = 1e-9;
/// Terms of the series of cosine and sine.
const TERMS: usize = 8;

/// Values between two keys, at a share of the way. Three operations, each rounded: the same bits wherever they are computed,
/// and a value that does not change keeps its value.
#[inline(always)]
pub(crate) fn between<const K: usize>(start: &[f32; K], end: &[f32; K], share: f32) -> [f32; K] {
    array::from_fn(|i| start[i] + share * (end[i] - start[i]))
}

/// The transforms between two keys, made ready for rays.
///
/// Let `w` be the angle between the keys, `n` the axis, `R` the rotation in the middle, and `t` go from -1/2 to 1/2. Then the
/// rotation is `n nᵀ R + cos(w t) (R - n nᵀ R) + sin(w t) [n]× R` (Rodrigues). The stretch is `S + t D`. So their product with
/// the translation is `A + cos(w t) B + sin(w t) C`, where `A`, `B` and `C` are linear in `t`. Sine and cosine come from those
/// of the half angle, whose series are short.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Interpolation {
    /// Coefficients of the series of `cos(w t / 2)` and `sin(w t / 2) / t` in `t²`.
    series: [[f64; 2]; TERMS],
    /// `A`, `B` and `C` in the middle, and their change from key to key. Rows of three numbers and the translation.
    parts: [[[[f64; 4]; 3]; 2]; 3],
}

impl Interpolation {
    /// The transform at a share of the way, not rounded.
    // Loops over all numbers of a map, here and in `Affine`: closures over arrays in arrays take twice as long.
    #[inline(always)]
    fn affine(&self, share: f64) -> Affine {
        let t = share - 0.5;
        let (t2, t4) = (t * t, (t * t) * (t * t));
        let mut sums = [[0.0; 2]; TERMS / 2];
        for (i, sum) in sums.iter_mut().enumerate() {
            for k in 0..2 {
                sum[k] = self.series[2 * i][k] + t2 * self.series[2 * i + 1][k];
            }
        }
        let [a, b, c, d] = sums;
        let sum = |k: usize| (a[k] + t4 * b[k]) + (t4 * t4) * (c[k] + t4 * d[k]);
        let (cos, sin) = (sum(0), t * sum(1));
        let (cos, sin) = (cos * cos - sin * sin, 2.0 * cos * sin);
        let [fixed, with_cos, with_sin] = &self.parts;
        let mut rows = [[0.0; 4]; 3];
        for (row, numbers) in rows.iter_mut().enumerate() {
            for (i, number) in numbers.iter_mut().enumerate() {
                let at = |part: &[[[f64; 4]; 3]; 2]| part[0][row][i] + t * part[1][row][i];
                *number = at(fixed) + (cos * at(with_cos) + sin * at(with_sin));
            }
        }
        Affine { rows }
    }

    /// The transform at a share of the way.
    #[inline(always)]
    fn transform(&self, share: f32) -> [[f32; 4]; 3] {
        let affine = self.affine(f64::from(share));
        let mut rows = [[0.0; 4]; 3];
        for (row, numbers) in rows.iter_mut().enumerate() {
            for (i, number) in numbers.iter_mut().enumerate() {
                *number = affine.rows[row][i] as f32;
            }
        }
        rows
    }
}

/// A transform between two keys, and what its boxes are made of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Path {
    interpolation: Interpolation,
    /// Translations of both keys.
    moved: [[f64; 3]; 2],
    /// Stretches of both keys.
    stretched: [[[f64; 3]; 3]; 2],
    /// Half the angle that the object turns by, at most a quarter of a turn.
    half_angle: f64,
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
        if dot4(start.turned, end.turned) < 0.0 {
            end.turned = end.turned.map(|x| -x);
        }
        // The rotation from the first key to the second: the cosine of half its angle, and its axis times the sine.
        let [cosine, across @ ..] = quotient(end.turned, start.turned);
        let sine = math::sqrt(dot(across, across));
        let half_angle = libm::atan2(sine, cosine);
        let axis = across.map(|x| if half_angle < NO_ANGLE { 0.0 } else { x / sine });
        let middle = matrix(array::from_fn(|i| start.turned[i] + end.turned[i]));
        let columns = [0, 1, 2].map(|column| middle.map(|row| row[column]));
        // `n nᵀ R`, what is left of `R`, and `[n]× R`.
        let along = columns.map(|column| axis.map(|x| x * dot(axis, column)));
        let left = array::from_fn(|i| array::from_fn(|k| columns[i][k] - along[i][k]));
        let turned = columns.map(|column| cross(axis, column));
        let [from, to] = [start.stretched, end.stretched];
        let stretches = [
            array::from_fn(|row| array::from_fn(|i| 0.5 * (from[row][i] + to[row][i]))),
            array::from_fn(|row| array::from_fn(|i| to[row][i] - from[row][i])),
        ];
        let mut parts = [along, left, turned]
            .map(|columns| stretches.map(|stretch| product(&columns, &stretch)));
        for axis in 0..3 {
            let [first, last] = [start.moved[axis], end.moved[axis]];
            parts[0][0][axis][3] = 0.5 * (first + last);
            parts[0][1][axis][3] = last - first;
        }
        let series = series(half_angle);
        Ok(Self {
            interpolation: Interpolation { series, parts },
            moved: [start.moved, end.moved],
            stretched: [from, to],
            half_angle,
        })
    }

    /// The transform at a share of the way.
    pub fn transform(&self, share: f32) -> [[f32; 4]; 3] {
        self.interpolation.transform(share)
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
        let change = array::from_fn(|row| [0, 1, 2].map(|i| to[row][i] - from[row][i]));
        let distances = corners.iter().map(|corner| length(&[*corner]));
        let products = f64::max(length(&from), length(&to)) * distances.fold(0.0, f64::max);
        let radius = f64::max(largest(&from), largest(&to));
        let speed = 2.0 * self.half_angle * radius + largest(&change);
        let step = 1.0 / STEPS as f64;
        let mut steps = [[[0.0; 3]; 2]; STEPS];
        for (index, planes) in steps.iter_mut().enumerate() {
            let affine = self.interpolation.affine((index as f64 + 0.5) * step);
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
    interpolation: Interpolation,
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
            interpolation: path.interpolation,
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
        array::from_fn(|side| between(&start[side], &end[side], share))
    }

    /// The transform at a share of the way.
    pub fn transform(&self, share: f32) -> [[f32; 4]; 3] {
        self.interpolation.transform(share)
    }

    /// The placement at a share of the way, with the box of that time, and the transform. `None` where the transform has no
    /// inverse, which only rounding can bring about.
    #[inline(never)]
    pub fn at(&self, share: f32, planes: [[f32; 4]; 2]) -> Option<(Placement, [[f32; 4]; 3])> {
        let world_from_object = self.transform(share);
        let inverse = Affine::new(&world_from_object).inverse()?;
        let placement = Placement {
            object_from_world: inverse.columns(),
            reach: self.reach,
            planes,
            inst_id: self.inst_id,
        };
        Some((placement, world_from_object))
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
            let next: [[f64; 3]; 3] = array::from_fn(|row| {
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
        let stretched = array::from_fn(|row| {
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

/// Coefficients of the series of `cos(a t)` and `sin(a t) / t` in `t²`. They are right to `2e-15` where `a |t|` is below an eighth of
/// a turn.
fn series(a: f64) -> [[f64; 2]; TERMS] {
    let mut series = [[1.0, a]; TERMS];
    for term in 1..TERMS {
        let n = 2.0 * term as f64;
        let [cos, sin] = series[term - 1];
        series[term] = [
            -cos * a * a / ((n - 1.0) * n),
            -sin * a * a / (n * (n + 1.0)),
        ];
    }
    series
}

/// The map of these columns after a stretch, without translation.
fn product(columns: &[[f64; 3]; 3], stretch: &[[f64; 3]; 3]) -> [[f64; 4]; 3] {
    array::from_fn(|row| {
        let of = |column: usize| (0..3).map(|i| columns[i][row] * stretch[i][column]).sum();
        [of(0), of(1), of(2), 0.0]
    })
}

/// The unit quaternion `a b⁻¹`.
fn quotient([w, x, y, z]: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    let [u, i, j, k] = b;
    [
        dot4([w, x, y, z], b),
        x * u - w * i + z * j - y * k,
        y * u - w * j + x * k - z * i,
        z * u - w * k + y * i - x * j,
    ]
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

/// The rotation of a quaternion of any length.
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
    fn the_series_are_cosine_and_sine() {
        for step in -500..=500 {
            let (w, t) = (core::f64::consts::FRAC_PI_2, f64::from(step) / 1000.0);
            let sums = series(w).iter().rev().fold([0.0; 2], |sum, terms| {
                array::from_fn(|k| terms[k] + t * t * sum[k])
            });
            assert!((sums[0] - libm::cos(w * t)).abs() < 2e-15, "{t}");
            assert!((t * sums[1] - libm::sin(w * t)).abs() < 2e-15, "{t}");
        }
    }

    /// The way of the papers: quaternions on the arc, rotation times stretch.
    #[test]
    fn a_path_follows_the_arc_of_quaternions() {
        let keys = [
            [
                [1.5, 0.25, 0.0, 3.0],
                [0.0, 1.0, 0.5, -2.0],
                [0.125, 0.0, 2.0, 1.0],
            ],
            [
                [0.0, -1.0, 0.25, 5.0],
                [1.75, 0.25, 0.0, 2.5],
                [0.0, 0.5, 1.0, -7.0],
            ],
        ];
        for keys in [keys, [keys[1], keys[0]], [keys[0], keys[0]]] {
            let path = Path::new([&keys[0], &keys[1]]).unwrap();
            let [from, to] = keys.each_ref().map(|key| Parts::new(key).unwrap());
            let cosine = dot4(from.turned, to.turned);
            let angle = libm::acos(cosine.abs().min(1.0));
            for step in 0..=64 {
                let share = f64::from(step) / 64.0;
                let arc = |share: f64| match angle < 1e-6 {
                    true => share,
                    false => libm::sin(share * angle) / libm::sin(angle),
                };
                let (first, second) = (arc(1.0 - share), arc(share) * cosine.signum());
                let turned = matrix(array::from_fn(|i| {
                    first * from.turned[i] + second * to.turned[i]
                }));
                let mix = |a: f64, b: f64| a + share * (b - a);
                for row in 0..3 {
                    let got = path.interpolation.affine(share).rows[row];
                    for column in 0..3 {
                        let stretched =
                            |i: usize| mix(from.stretched[i][column], to.stretched[i][column]);
                        let wanted: f64 = (0..3).map(|i| turned[row][i] * stretched(i)).sum();
                        assert!(
                            (got[column] - wanted).abs() < 1e-14,
                            "{share} {row} {column}"
                        );
                    }
                    assert!((got[3] - mix(from.moved[row], to.moved[row])).abs() < 1e-14);
                }
            }
        }
    }
}
