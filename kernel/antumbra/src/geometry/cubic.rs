//! Cubic curves as chains of segments.

use alloc::vec::Vec;

use crate::geometry::curve::Curves;
use crate::math;

/// Meaning of the four control points of a cubic curve.
///
/// ```
/// use antumbra::shapes::{CurveBasis, Curves};
///
/// let points = [[0.0, 0.0, 0.0, 0.01], [0.0, 0.5, 0.0, 0.01], [0.5, 1.0, 0.0, 0.01], [1.0, 1.0, 0.0, 0.01]];
/// let through = |basis| Curves::cubic(&points, &[0], basis, 0.1).expect("four points").curves.points[0];
/// assert_eq!(through(CurveBasis::Bezier), points[0]);
/// assert_ne!(through(CurveBasis::BSpline), points[0]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CurveBasis {
    /// Bezier: the curve goes through the first and the last point.
    Bezier,
    /// Uniform B-spline: the curve is near the points.
    BSpline,
    /// Catmull-Rom: the curve goes through the second and the third point.
    CatmullRom,
}

/// Segments that stand for cubic curves, and where they lie on them.
///
/// ```
/// use antumbra::shapes::{CurveBasis, Curves};
///
/// let points = [[0.0, 0.0, 0.0, 0.01], [0.0, 0.5, 0.0, 0.01], [0.5, 1.0, 0.0, 0.01], [1.0, 1.0, 0.0, 0.01]];
/// let cubic = Curves::cubic(&points, &[0], CurveBasis::Bezier, 0.1).expect("four points");
/// // A hit at `u` on the first segment is at this parameter of its cubic curve.
/// let (curve, [from, to]) = cubic.parts[0];
/// let parameter = |u: f32| from + u * (to - from);
/// assert_eq!((curve, parameter(0.0)), (0, 0.0));
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct CubicSegments {
    /// Straight segments of all cubic curves, in the order of the curves.
    pub curves: Curves<'static>,
    /// For each segment, the index of its cubic curve and the part of that curve's parameter, from 0 to 1, that it stands for: a hit
    /// at `u` is at the parameter `from + u * (to - from)`.
    pub parts: Vec<(u32, [f32; 2])>,
}

/// Most segments of one cubic curve.
const MOST: f64 = 256.0;

impl Curves<'_> {
    /// Segments in place of cubic curves with four control points each, `[n, 4]`: x, y, z, radius. Cubic curve `i` has the
    /// points from `first[i]` on; curves that share points, as in a B-spline, are one chain.
    ///
    /// No point of a curve, and no radius, is farther from its segments than `tolerance` times the largest radius of its control
    /// points, unless that takes more than 256 segments. pbrt stops at 0.1. By the second derivative: a cubic whose
    /// control points have second differences of at most `d` is at most `3/4 d / n²` away from `n` chords of equal parameter.
    ///
    /// A cubic curve with a number that is not finite becomes segments with such numbers, which a build drops.
    /// Returns `None` if an index is out of range or the tolerance is not above 0.
    ///
    /// ```
    /// use antumbra::shapes::{CurveBasis, Curves};
    ///
    /// let arc = [[0.0, 0.0, 0.0, 0.01], [0.0, 0.5, 0.0, 0.01], [0.5, 1.0, 0.0, 0.01], [1.0, 1.0, 0.0, 0.01]];
    /// let cubic = Curves::cubic(&arc, &[0], CurveBasis::Bezier, 0.1).expect("four points");
    /// assert_eq!(cubic.curves.points.first(), Some(&arc[0]));
    /// assert_eq!(cubic.curves.points.last(), Some(&arc[3]));
    /// assert_eq!(cubic.parts.last().map(|(_, [_, to])| *to), Some(1.0));
    /// ```
    #[must_use]
    pub fn cubic(
        points: &[[f32; 4]],
        first: &[u32],
        basis: CurveBasis,
        tolerance: f32,
    ) -> Option<CubicSegments> {
        if !(tolerance > 0.0) {
            return None;
        }
        let mut chain: Vec<[f32; 4]> = Vec::new();
        let (mut segments, mut parts) = (Vec::new(), Vec::new());
        for (curve, &first) in first.iter().enumerate() {
            let control = points.get(first as usize..)?.first_chunk::<4>()?;
            let control = basis.bezier(control.map(|point| point.map(f64::from)));
            let count = pieces(&control, f64::from(tolerance));
            let at = |piece: u32| point(&control, f64::from(piece) / f64::from(count));
            let begin = at(0).map(|x| x as f32);
            if chain.last() != Some(&begin) {
                chain.push(begin);
            }
            for piece in 0..count {
                segments.push(chain.len() as u32 - 1);
                chain.push(at(piece + 1).map(|x| x as f32));
                let bound = |piece: u32| piece as f32 / count as f32;
                parts.push((curve as u32, [bound(piece), bound(piece + 1)]));
            }
        }
        Some(CubicSegments {
            curves: Curves::new(chain, segments),
            parts,
        })
    }
}

impl CurveBasis {
    /// The Bezier curve that is the same.
    fn bezier(self, control: [[f64; 4]; 4]) -> [[f64; 4]; 4] {
        let [a, b, c, d] = control;
        let mix = |weights: [f64; 4], by: f64| -> [f64; 4] {
            core::array::from_fn(|i| {
                (weights[0] * a[i] + weights[1] * b[i] + weights[2] * c[i] + weights[3] * d[i]) / by
            })
        };
        match self {
            Self::Bezier => control,
            // The ends are computed in the same way for neighbours, which makes them one point.
            Self::BSpline => [
                core::array::from_fn(|i| (a[i] + 4.0 * b[i] + c[i]) / 6.0),
                mix([0.0, 2.0, 1.0, 0.0], 3.0),
                mix([0.0, 1.0, 2.0, 0.0], 3.0),
                core::array::from_fn(|i| (b[i] + 4.0 * c[i] + d[i]) / 6.0),
            ],
            Self::CatmullRom => [
                b,
                mix([-1.0, 6.0, 1.0, 0.0], 6.0),
                mix([0.0, 1.0, 6.0, -1.0], 6.0),
                c,
            ],
        }
    }
}

/// How many segments a Bezier curve needs.
fn pieces(control: &[[f64; 4]; 4], tolerance: f64) -> u32 {
    let second = [0, 1].map(|first| -> [f64; 4] {
        core::array::from_fn(|i| {
            control[first][i] - 2.0 * control[first + 1][i] + control[first + 2][i]
        })
    });
    let most = |values: [f64; 2]| values[0].max(values[1]);
    let bend = most(second.map(|[x, y, z, _]| math::sqrt(x * x + y * y + z * z)));
    let taper = most(second.map(|[.., radius]| radius.abs()));
    let radius = control.iter().fold(0.0, |most: f64, [.., r]| most.max(*r));
    let count = math::sqrt(0.75 * bend.max(taper) / (tolerance * radius));
    // NaN is 1.
    if !(count > 1.0) {
        return 1;
    }
    let count = count.min(MOST);
    let whole = count as u32;
    whole + u32::from(f64::from(whole) < count)
}

/// A point of a Bezier curve: exactly its first or last control point at 0 and 1.
fn point(control: &[[f64; 4]; 4], u: f64) -> [f64; 4] {
    let mix = |a: [f64; 4], b: [f64; 4]| -> [f64; 4] {
        core::array::from_fn(|i| (1.0 - u) * a[i] + u * b[i])
    };
    let [a, b, c, d] = *control;
    let [ab, bc, cd] = [mix(a, b), mix(b, c), mix(c, d)];
    mix(mix(ab, bc), mix(bc, cd))
}
