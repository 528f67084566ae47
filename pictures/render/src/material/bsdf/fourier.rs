//! Scattering by tables of Fourier series, as pbrt-v3 evaluates and samples them.

use std::f32::consts::TAU;
use std::sync::Arc;

use antumbra_scene::FourierTable;
use glam::Vec3;

use super::Scatter;

/// Scattering by a table, times a factor.
#[derive(Clone, Debug)]
pub struct Fourier {
    table: Arc<FourierTable>,
    scale: Vec3,
}

/// Weights of four neighbouring cosines, by Catmull-Rom splines over their uneven distances.
#[derive(Clone, Copy, Debug)]
struct Weights {
    /// Place of the second of the four.
    place: usize,
    weights: [f32; 4],
}

impl Weights {
    /// Weights of the cosines of a table at one between them. `None` outside.
    fn at(cosines: &[f32], x: f32) -> Option<Self> {
        let last = cosines.len() - 1;
        if !(x >= cosines[0] && x <= cosines[last]) {
            return None;
        }
        let place = (cosines.partition_point(|cosine| *cosine <= x) - 1).min(last - 1);
        let [x0, x1] = [cosines[place], cosines[place + 1]];
        let width = x1 - x0;
        let t = (x - x0) / width;
        let (t2, t3) = (t * t, t * t * t);
        let mut weights = [0.0, 2.0 * t3 - 3.0 * t2 + 1.0, -2.0 * t3 + 3.0 * t2, 0.0];
        // Slopes at both ends are those between the neighbours, or of the interval itself at the ends of the table.
        let slope = t3 - 2.0 * t2 + t;
        match place.checked_sub(1) {
            Some(before) => {
                let w = slope * width / (x1 - cosines[before]);
                weights[0] -= w;
                weights[2] += w;
            }
            None => {
                weights[1] -= slope;
                weights[2] += slope;
            }
        }
        let slope = t3 - t2;
        match cosines.get(place + 2) {
            Some(after) => {
                let w = slope * width / (after - x0);
                weights[1] -= w;
                weights[3] += w;
            }
            None => {
                weights[1] -= slope;
                weights[2] += slope;
            }
        }
        Some(Self { place, weights })
    }

    /// Places with their weights, without those that weigh nothing.
    fn iter(self) -> impl Iterator<Item = (usize, f32)> {
        let Self { place, weights } = self;
        (0..4)
            .map(move |index| (place + index, weights[index]))
            .filter(|(_, weight)| *weight != 0.0)
            // The weight of what is before the first is 0.
            .map(|(place, weight)| (place - 1, weight))
    }
}

/// Value of a series at the cosine of the azimuth.
fn value_of(coefficients: &[f32], cos: f32) -> f32 {
    let cos = f64::from(cos);
    let (mut before, mut now) = (cos, 1.0);
    let mut sum = 0.0;
    for coefficient in coefficients {
        sum += f64::from(*coefficient) * now;
        (before, now) = (now, 2.0 * cos * now - before);
    }
    sum as f32
}

/// Coefficients of a series.
struct Series {
    coefficients: Vec<f32>,
}

impl Series {
    /// Azimuth whose density is proportional to the value. The mean must be positive.
    fn sample(&self, u: f32) -> f32 {
        let is_behind = u >= 0.5;
        let u = if is_behind {
            1.0 - 2.0 * (u - 0.5)
        } else {
            2.0 * u
        };
        let Some(&mean) = self.coefficients.first() else {
            return 0.0;
        };
        let mean = f64::from(mean);
        let wanted = f64::from(u) * mean * std::f64::consts::PI;
        // Newton's method, kept within an interval that shrinks.
        let (mut low, mut high) = (0.0, std::f64::consts::PI);
        let mut phi = 0.5 * high;
        loop {
            let (sin, cos) = libm::sincos(phi);
            let (mut cos_before, mut cos_now) = (cos, 1.0);
            let (mut sin_before, mut sin_now) = (-sin, 0.0);
            let (mut integral, mut value) = (mean * phi, mean);
            for (k, coefficient) in self.coefficients.iter().enumerate().skip(1) {
                (sin_before, sin_now) = (sin_now, 2.0 * cos * sin_now - sin_before);
                (cos_before, cos_now) = (cos_now, 2.0 * cos * cos_now - cos_before);
                integral += f64::from(*coefficient) / k as f64 * sin_now;
                value += f64::from(*coefficient) * cos_now;
            }
            let off = integral - wanted;
            if off > 0.0 {
                high = phi;
            } else {
                low = phi;
            }
            if off.abs() < 1e-6 || high - low < 1e-6 {
                break;
            }
            phi -= off / value;
            if !(phi > low && phi < high) {
                phi = 0.5 * (low + high);
            }
        }
        let phi = phi as f32;
        if is_behind { TAU - phi } else { phi }
    }
}

/// Cosine of the azimuth between two directions.
fn cos_between(a: Vec3, b: Vec3) -> f32 {
    let [a, b] = [a, b].map(|v| v.truncate());
    let lengths = a.length_squared() * b.length_squared();
    match lengths > 0.0 {
        true => (a.dot(b) / lengths.sqrt()).clamp(-1.0, 1.0),
        false => 1.0,
    }
}

impl Fourier {
    /// Scattering by a table.
    pub fn new(table: Arc<FourierTable>) -> Self {
        let scale = Vec3::ONE;
        Self { table, scale }
    }

    /// Weights of both cosines: where light goes on to as if it came from `wi`, and `wo`.
    fn weights(&self, wo: Vec3, wi: Vec3) -> Option<[Weights; 2]> {
        let at = |cosine| Weights::at(&self.table.cosines, cosine);
        Some([at(-wi.z)?, at(wo.z)?])
    }

    /// The first of the coefficients of a pair, or 0.
    fn mean(&self, outgoing: usize, incident: usize) -> f32 {
        let [first, count] = self.table.series[outgoing * self.table.cosines.len() + incident];
        match count {
            0 => 0.0,
            _ => self.table.coefficients[first as usize],
        }
    }

    /// Coefficients of a channel for the pairs of cosines of the table around a pair, with the weight of each.
    fn around(
        &self,
        [incident, outgoing]: &[Weights; 2],
        channel: usize,
    ) -> impl Iterator<Item = (&[f32], f32)> {
        let table = &self.table;
        let (incident, outgoing) = (*incident, *outgoing);
        outgoing.iter().flat_map(move |(row, row_weight)| {
            incident.iter().map(move |(column, column_weight)| {
                let [first, count] = table.series[row * table.cosines.len() + column];
                let (first, count) = (first as usize, count as usize);
                let found = &table.coefficients[first + channel * count..][..count];
                (found, row_weight * column_weight)
            })
        })
    }

    /// Value of a channel at the cosine of the azimuth.
    fn channel(&self, weights: &[Weights; 2], channel: usize, cos: f32) -> f32 {
        let series = self.around(weights, channel);
        series
            .map(|(found, weight)| weight * value_of(found, cos))
            .sum()
    }

    /// Series of luminance between the cosines of the table.
    fn series(&self, weights: &[Weights; 2]) -> Series {
        let mut coefficients = Vec::new();
        for (found, weight) in self.around(weights, 0) {
            if coefficients.len() < found.len() {
                coefficients.resize(found.len(), 0.0);
            }
            for (sum, coefficient) in coefficients.iter_mut().zip(found) {
                *sum += weight * coefficient;
            }
        }
        Series { coefficients }
    }

    /// Incident cosine by the mean over the azimuth: the spline between the rows of the table is inverted.
    fn sample_cosine(&self, outgoing: &Weights, u: f32) -> Option<f32> {
        let cosines = &self.table.cosines;
        let count = cosines.len();
        let integral = |place: usize| -> f32 {
            let rows = outgoing.iter();
            rows.map(|(row, weight)| weight * self.table.integrals[row * count + place])
                .sum()
        };
        let value = |place: usize| -> f32 {
            outgoing
                .iter()
                .map(|(row, weight)| weight * self.mean(row, place))
                .sum()
        };
        let all = integral(count - 1);
        if !(all > 0.0) {
            return None;
        }
        let wanted = u * all;
        // The last place whose integral is at most what is wanted.
        let (mut place, mut end) = (0, count - 1);
        while end - place > 1 {
            let middle = usize::midpoint(place, end);
            if integral(middle) <= wanted {
                place = middle;
            } else {
                end = middle;
            }
        }
        let [x0, x1] = [cosines[place], cosines[place + 1]];
        let [f0, f1] = [value(place), value(place + 1)];
        let width = x1 - x0;
        let rest = (wanted - integral(place)) / width;
        let d0 = match place.checked_sub(1) {
            Some(before) => width * (f1 - value(before)) / (x1 - cosines[before]),
            None => f1 - f0,
        };
        let d1 = match place + 2 < count {
            true => width * (value(place + 2) - f0) / (cosines[place + 2] - x0),
            false => f1 - f0,
        };
        let t = place_of([f0, f1], [d0, d1], rest);
        Some((x0 + width * t).clamp(cosines[0], cosines[count - 1]))
    }
}

/// Place from 0 to 1 at which the integral of a cubic, by its values and slopes at the ends, is as `wanted`.
fn place_of([f0, f1]: [f32; 2], [d0, d1]: [f32; 2], wanted: f32) -> f32 {
    // As if it were linear, then by Newton's method in an interval that shrinks.
    let mut t = match f0 == f1 {
        true => wanted / f0,
        false => (f0 - (f0 * f0 + 2.0 * wanted * (f1 - f0)).max(0.0).sqrt()) / (f0 - f1),
    };
    let (mut low, mut high) = (0.0, 1.0);
    loop {
        if !(low..=high).contains(&t) {
            t = 0.5 * (low + high);
        }
        let cubic = -2.0 * d0 - d1;
        let integral = t
            * (f0
                + t * (0.5 * d0
                    + t * (cubic / 3.0 + f1 - f0 + t * (0.25 * (d0 + d1) + 0.5 * (f0 - f1)))));
        let value = f0 + t * (d0 + t * (cubic + 3.0 * (f1 - f0) + t * (d0 + d1 + 2.0 * (f0 - f1))));
        let off = integral - wanted;
        if off.abs() < 1e-6 || high - low < 1e-6 {
            return t;
        }
        if off < 0.0 {
            low = t;
        } else {
            high = t;
        }
        t -= off / value;
    }
}

impl Scatter for Fourier {
    fn is_black(&self) -> bool {
        self.scale == Vec3::ZERO
    }

    fn scale(&mut self, by: Vec3) {
        self.scale *= by;
    }

    fn is_of(&self, _: bool) -> bool {
        true
    }

    /// Value for two unit directions.
    fn value(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let (incident, outgoing) = (-wi.z, wo.z);
        let Some(weights) = self.weights(wo, wi) else {
            return Vec3::ZERO;
        };
        let cos = cos_between(-wi, wo);
        let luminance = self.channel(&weights, 0, cos).max(0.0);
        // Series hold the cosine.
        let mut scale = if incident == 0.0 {
            0.0
        } else {
            1.0 / incident.abs()
        };
        // Radiance is squeezed where it goes over to another medium.
        if incident * outgoing > 0.0 {
            let eta = match incident > 0.0 {
                true => 1.0 / self.table.eta,
                false => self.table.eta,
            };
            scale *= eta * eta;
        }
        let color = match self.table.channels {
            1 => Vec3::splat(luminance),
            _ => {
                let [red, blue] = [1, 2].map(|channel| self.channel(&weights, channel, cos));
                // From the luminance of sRGB, as rounded by pbrt-v3.
                let green = 1.39829 * luminance - 0.100913 * blue - 0.297375 * red;
                Vec3::new(red, green, blue)
            }
        };
        (color * scale).max(Vec3::ZERO) * self.scale
    }

    /// Density of a direction in [`Self::sample`].
    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let Some(weights) = self.weights(wo, wi) else {
            return 0.0;
        };
        let luminance = self.channel(&weights, 0, cos_between(-wi, wo));
        let count = self.table.cosines.len();
        let all: f32 = weights[1]
            .iter()
            .map(|(row, weight)| weight * self.table.integrals[row * count + count - 1] * TAU)
            .sum();
        if all > 0.0 && luminance > 0.0 {
            luminance / all
        } else {
            0.0
        }
    }

    /// Direction by the luminance of the table.
    fn sample(&self, wo: Vec3, _: f32, u: [f32; 2]) -> Option<Vec3> {
        let outgoing = Weights::at(&self.table.cosines, wo.z)?;
        let cosine = self.sample_cosine(&outgoing, u[1])?;
        let incident = Weights::at(&self.table.cosines, cosine)?;
        let series = self.series(&[incident, outgoing]);
        if !(series.coefficients.first().copied().unwrap_or(0.0) > 0.0) {
            return None;
        }
        let (sin_phi, cos_phi) = libm::sincosf(series.sample(u[0]));
        let sin = (1.0 - cosine * cosine).max(0.0).sqrt();
        let across = wo.truncate().length();
        let [x, y] = match across > 0.0 {
            true => [wo.x / across, wo.y / across],
            false => [1.0, 0.0],
        };
        let wi = -Vec3::new(
            sin * (cos_phi * x - sin_phi * y),
            sin * (sin_phi * x + cos_phi * y),
            cosine,
        );
        wi.try_normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A table of a function of both cosines and of the azimuth: `f(incident, outgoing) (1 + cos(azimuth) / 2)`.
    fn table(channels: u32, f: impl Fn(f32, f32) -> f32) -> Fourier {
        let count = 33;
        let cosines: Vec<f32> = (0..count).map(|i| i as f32 / 16.0 - 1.0).collect();
        let (mut coefficients, mut series, mut integrals) = (Vec::new(), Vec::new(), Vec::new());
        for outgoing in &cosines {
            let mut sum = 0.0;
            let mut before = None;
            for incident in &cosines {
                let value = f(*incident, *outgoing);
                // Splines through smooth functions have about the integral of trapezoids.
                sum += before.map_or(0.0, |before: f32| 0.5 * (before + value) / 16.0);
                before = Some(value);
                integrals.push(sum);
                series.push([coefficients.len() as u32, 2]);
                for channel in 0..channels {
                    let share = [1.0, 0.5, 0.25][channel as usize];
                    coefficients.extend([share * value, 0.5 * share * value]);
                }
            }
        }
        Fourier::new(Arc::new(FourierTable {
            name: "test".into(),
            eta: 1.0,
            channels,
            cosines,
            integrals,
            series,
            coefficients,
        }))
    }

    /// Directions over the sphere, evenly.
    fn directions() -> impl Iterator<Item = Vec3> {
        let count = 40_000;
        (0..count).map(move |i| {
            let z = 1.0 - 2.0 * (i as f32 + 0.5) / count as f32;
            let (sin, cos) = (i as f32 * 2.399_963).sin_cos();
            let r = (1.0 - z * z).sqrt();
            Vec3::new(r * cos, r * sin, z)
        })
    }

    #[test]
    fn values_are_those_of_the_function() {
        let lobe = table(3, |i, o| 0.2 + 0.1 * i + 0.05 * o);
        let wo = Vec3::new(0.6, 0.0, 0.8);
        for wi in directions().step_by(997) {
            let (incident, cos) = (-wi.z, cos_between(-wi, wo));
            let luminance =
                (0.2 + 0.1 * incident + 0.05 * 0.8) * (1.0 + 0.5 * cos) / incident.abs();
            let [red, blue] = [0.5 * luminance, 0.25 * luminance];
            let green = 1.39829 * luminance - 0.100913 * blue - 0.297375 * red;
            let expected = Vec3::new(red, green, blue);
            let found = lobe.value(wo, wi);
            assert!(
                (found - expected).abs().max_element() < 1e-4 * expected.max_element(),
                "{wi}"
            );
        }
    }

    #[test]
    fn densities_have_the_sum_one_and_are_those_of_samples() {
        for lobe in [
            table(1, |i, o| 0.2 + 0.15 * i + 0.1 * o),
            table(1, |_, _| 0.3),
        ] {
            for wo in [
                Vec3::new(0.6, 0.0, 0.8),
                Vec3::new(0.3, -0.9, -0.316),
                Vec3::new(0.0, 0.1, 0.995),
            ] {
                let wo = wo.normalize();
                let mean: f64 = directions().map(|wi| f64::from(lobe.pdf(wo, wi))).sum();
                let sum = mean * f64::from(2.0 * TAU) / 40_000.0;
                assert!((sum - 1.0).abs() < 5e-3, "{wo}: {sum}");
                // The mean of a function over samples is its integral with the density.
                let test = |wi: Vec3| wi.x + 0.5 * wi.z * wi.z + 0.2 * wi.y;
                let expected: f64 = directions()
                    .map(|wi| f64::from(test(wi) * lobe.pdf(wo, wi)))
                    .sum();
                let expected = expected * f64::from(2.0 * TAU) / 40_000.0;
                let side = 200;
                let mut found = 0.0;
                for index in 0..side * side {
                    let place = |i: usize| (i as f32 + 0.5) / side as f32;
                    let u = [place(index % side), place(index / side)];
                    let wi = lobe.sample(wo, 0.0, u).expect("the function is positive");
                    assert!((wi.length() - 1.0).abs() < 1e-5);
                    found += f64::from(test(wi));
                }
                found /= (side * side) as f64;
                assert!((found - expected).abs() < 5e-3, "{wo}: {found} {expected}");
            }
        }
    }

    #[test]
    fn weights_are_those_of_a_spline() {
        let cosines = [-1.0, -0.5, 0.1, 0.4, 1.0];
        for step in 0..=200 {
            let x = step as f32 / 100.0 - 1.0;
            let weights = Weights::at(&cosines, x).expect("within");
            let sum: f32 = weights.iter().map(|(_, weight)| weight).sum();
            let line: f32 = weights
                .iter()
                .map(|(place, weight)| weight * cosines[place])
                .sum();
            assert!(
                (sum - 1.0).abs() < 1e-5 && (line - x).abs() < 1e-5,
                "{x}: {sum} {line}"
            );
        }
        assert!(Weights::at(&cosines, 1.1).is_none() && Weights::at(&cosines, f32::NAN).is_none());
    }
}
