//! Flat curves: Embree's segments and ribbons as segments of the kernel.
//!
//! A linear primitive of Embree has round ends, with and without neighbours. The kernel has them only where a segment goes on.
//! So each chain begins and ends with a segment without length, which the kernel drops.
//!
//! A cubic primitive is a ribbon of quads that face the ray, as many as the tessellation rate says. Each quad lies within the
//! segment of the kernel with its ends and radii. The kernel finds the segments, and Embree's rule decides which are hit.

use antumbra::Geometry as Kernel;
use antumbra::shapes::Curves;

use super::{Basis, State};

impl Basis {
    /// Visible segments of a primitive.
    pub fn pieces(self, state: &State) -> u32 {
        match self {
            Self::Linear => 1,
            _ => state.tessellation,
        }
    }

    /// Primitive and piece of a segment of the kernel.
    pub fn place(self, state: &State, prim_id: u32) -> (u32, u32) {
        let all = self.pieces(state) + 2;
        (prim_id / all, (prim_id % all).saturating_sub(1))
    }

    /// Weights of four points at a place of a cubic curve.
    pub fn weights(self, u: f64) -> [f64; 4] {
        let w = 1.0 - u;
        match self {
            Self::Linear => [w, u, 0.0, 0.0],
            Self::Bezier => [w * w * w, 3.0 * u * w * w, 3.0 * u * u * w, u * u * u],
            Self::BSpline => [
                w * w * w,
                (3.0 * u - 6.0) * u * u + 4.0,
                (3.0 * w - 6.0) * w * w + 4.0,
                u * u * u,
            ]
            .map(|weight| weight / 6.0),
            Self::CatmullRom => [
                -u * w * w,
                2.0 + u * u * (3.0 * u - 5.0),
                2.0 + w * w * (3.0 * w - 5.0),
                -w * u * u,
            ]
            .map(|weight| weight / 2.0),
        }
    }

    /// Weights of four points in the derivative by the place.
    pub fn slopes(self, u: f64) -> [f64; 4] {
        let w = 1.0 - u;
        match self {
            Self::Linear => [-1.0, 1.0, 0.0, 0.0],
            Self::Bezier => {
                [-w * w, w * w - 2.0 * u * w, 2.0 * u * w - u * u, u * u].map(|x| 3.0 * x)
            }
            Self::BSpline => [-w * w, u * (3.0 * u - 4.0), -w * (3.0 * w - 4.0), u * u]
                .map(|weight| weight / 2.0),
            Self::CatmullRom => [
                w * (2.0 * u - w),
                u * (9.0 * u - 10.0),
                -w * (9.0 * w - 10.0),
                u * (u - 2.0 * w),
            ]
            .map(|weight| weight / 2.0),
        }
    }
}

/// Points of a primitive, with radii: two, or four. `None` if an index is out of range.
fn points<const N: usize>(state: &State, prim: usize) -> Option<[[f32; 4]; N]> {
    let index = state.index.as_ref().filter(|index| prim < index.count)?;
    let vertices = state.vertices.as_ref()?;
    let [first] = index.read::<1, u32>(prim);
    let first = first as usize;
    let last = first.checked_add(N - 1)?;
    (last < vertices.count).then(|| std::array::from_fn(|place| vertices.read(first + place)))
}

/// Points of a primitive of any basis. A linear one has two, and no weight for others.
pub fn controls(basis: Basis, state: &State, prim: u32) -> Option<[[f32; 4]; 4]> {
    match basis {
        Basis::Linear => points(state, prim as usize).map(|[a, b]| [a, b, b, b]),
        _ => points(state, prim as usize),
    }
}

pub fn sum(points: &[[f32; 4]; 4], weights: [f64; 4]) -> [f64; 4] {
    std::array::from_fn(|axis| {
        let terms = (0..4).map(|place| weights[place] * f64::from(points[place][axis]));
        terms.sum()
    })
}

/// Curves as the kernel takes them. Primitives with an index out of range are dropped, as by Embree.
pub fn kernel_curves(basis: Basis, state: &State) -> Kernel<'static> {
    let pieces = basis.pieces(state);
    let count = state.index.as_ref().map_or(0, |index| index.count);
    let mut all: Vec<[f32; 4]> = Vec::new();
    let mut segments = Vec::new();
    for prim in 0..count {
        // Where there are too many points the index is out of range, which is an error of the build.
        let first = u32::try_from(all.len()).unwrap_or(u32::MAX);
        segments.extend((0..pieces + 2).map(|piece| first.saturating_add(piece)));
        let points = controls(basis, state, prim as u32).unwrap_or([[f32::NAN; 4]; 4]);
        let at = |place: u32| {
            let weights = basis.weights(f64::from(place) / f64::from(pieces));
            sum(&points, weights).map(|x| x as f32)
        };
        all.push(at(0));
        all.extend((0..=pieces).map(at));
        all.push(at(pieces));
    }
    Kernel::curves(Curves::new(all, segments))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Weights add up to 1, their slopes to 0, and slopes are derivatives.
    #[test]
    fn weights_and_their_slopes_fit() {
        for basis in [
            Basis::Linear,
            Basis::Bezier,
            Basis::BSpline,
            Basis::CatmullRom,
        ] {
            for step in 0..=8 {
                let (u, h) = (f64::from(step) / 8.0, 1e-6);
                let (weights, slopes) = (basis.weights(u), basis.slopes(u));
                assert!(
                    (weights.iter().sum::<f64>() - 1.0).abs() < 1e-12,
                    "{basis:?}"
                );
                assert!(slopes.iter().sum::<f64>().abs() < 1e-12, "{basis:?} {u}");
                let (after, before) = (basis.weights(u + h), basis.weights(u - h));
                for place in 0..4 {
                    let slope = (after[place] - before[place]) / (2.0 * h);
                    assert!(
                        (slope - slopes[place]).abs() < 1e-8,
                        "{basis:?} {u} {place}"
                    );
                }
            }
        }
        assert_eq!(Basis::Bezier.weights(1.0), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(Basis::CatmullRom.weights(0.0), [0.0, 1.0, 0.0, 0.0]);
        assert_eq!(
            Basis::BSpline.weights(0.0),
            [1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0, 0.0]
        );
    }
}
