//! Reconstruction filters: the weight of a sample in the pixels around it.

use std::f32::consts::PI;

use antumbra_scene::Filter;

/// Weight of a sample at `(dx, dy)` pixels from the centre of a pixel. 0 beyond the radius.
///
/// Formulas are as in pbrt-v3, evaluated exactly (pbrt looks them up in a 16 x 16 table).
pub fn weight(filter: &Filter, [dx, dy]: [f32; 2]) -> f32 {
    let [rx, ry] = radius(filter);
    if dx.abs() > rx || dy.abs() > ry {
        return 0.0;
    }
    match *filter {
        Filter::Box { .. } => 1.0,
        Filter::Triangle { .. } => (rx - dx.abs()) * (ry - dy.abs()),
        Filter::Gaussian { alpha, .. } => {
            let falloff =
                |d: f32, r: f32| (libm::expf(-alpha * d * d) - libm::expf(-alpha * r * r)).max(0.0);
            falloff(dx, rx) * falloff(dy, ry)
        }
        Filter::Mitchell { b, c, .. } => mitchell(dx / rx, b, c) * mitchell(dy / ry, b, c),
        Filter::LanczosSinc { tau, .. } => windowed_sinc(dx, rx, tau) * windowed_sinc(dy, ry, tau),
    }
}

/// Half-widths in x and y, in pixels.
pub fn radius(filter: &Filter) -> [f32; 2] {
    match *filter {
        Filter::Box { radius }
        | Filter::Triangle { radius }
        | Filter::Gaussian { radius, .. }
        | Filter::Mitchell { radius, .. }
        | Filter::LanczosSinc { radius, .. } => radius,
    }
}

/// Mitchell and Netravali (1988) with their support of 2 stretched to `x` in -1..=1.
fn mitchell(x: f32, b: f32, c: f32) -> f32 {
    let x = (2.0 * x).abs();
    let cubic = if x > 1.0 {
        ((-b - 6.0 * c) * x + 6.0 * b + 30.0 * c) * x * x
            + (-12.0 * b - 48.0 * c) * x
            + (8.0 * b + 24.0 * c)
    } else {
        ((12.0 - 9.0 * b - 6.0 * c) * x + (-18.0 + 12.0 * b + 6.0 * c)) * x * x + (6.0 - 2.0 * b)
    };
    cubic / 6.0
}

fn windowed_sinc(x: f32, radius: f32, tau: f32) -> f32 {
    sinc(x) * sinc(x / tau) * f32::from(x.abs() <= radius)
}

fn sinc(x: f32) -> f32 {
    let x = PI * x.abs();
    if x < 1e-5 { 1.0 } else { libm::sinf(x) / x }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub fn all() -> Vec<Filter> {
        let radius = [2.0, 1.5];
        vec![
            Filter::Box { radius },
            Filter::Triangle { radius },
            Filter::Gaussian { radius, alpha: 2.0 },
            Filter::Mitchell {
                radius,
                b: 1.0 / 3.0,
                c: 1.0 / 3.0,
            },
            Filter::LanczosSinc { radius, tau: 3.0 },
        ]
    }

    /// Midpoint rule over the support.
    fn integral(filter: &Filter) -> f64 {
        let [rx, ry] = radius(filter);
        let n = 400;
        let at = |i: i32, r: f32| (i as f32 + 0.5) / n as f32 * 2.0 * r - r;
        let sum: f64 = (0..n)
            .flat_map(|y| (0..n).map(move |x| [at(x, rx), at(y, ry)]))
            .map(|d| f64::from(weight(filter, d)))
            .sum();
        sum * f64::from(4.0 * rx * ry) / f64::from(n * n)
    }

    #[test]
    fn integrals_match_their_closed_forms() {
        let [rx, ry] = [2.0_f64, 1.5];
        let gauss = |r: f64, a: f64| {
            (std::f64::consts::PI / a).sqrt() * libm::erf(a.sqrt() * r)
                - 2.0 * r * (-a * r * r).exp()
        };
        // Mitchell's filter over its support of ±2 has integral 1, so r/2 after stretching.
        let expected = [
            Some(4.0 * rx * ry),
            Some(rx * rx * ry * ry),
            Some(gauss(rx, 2.0) * gauss(ry, 2.0)),
            Some(rx / 2.0 * ry / 2.0),
            None,
        ];
        for (filter, expected) in all().iter().zip(expected) {
            let Some(expected) = expected else { continue };
            let found = integral(filter);
            assert!(
                (found - expected).abs() < 2e-3 * expected,
                "{filter:?} {found} {expected}"
            );
        }
    }

    #[test]
    fn filters_are_even_and_vanish_outside() {
        for filter in all() {
            let [rx, ry] = radius(&filter);
            assert_eq!(weight(&filter, [rx * 1.01, 0.0]), 0.0);
            assert_eq!(weight(&filter, [0.0, -ry * 1.01]), 0.0);
            for d in [[0.3, 0.7], [1.2, 0.1], [1.9, 1.4]] {
                let w = weight(&filter, d);
                assert_eq!(w, weight(&filter, [-d[0], d[1]]), "{filter:?}");
                assert_eq!(w, weight(&filter, [d[0], -d[1]]), "{filter:?}");
            }
            assert!(weight(&filter, [0.0, 0.0]) > 0.0);
        }
    }
}
