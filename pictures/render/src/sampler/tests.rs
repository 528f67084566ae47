//! Promises of all generators.

use super::*;

/// In every elementary interval of area 2^-k lies exactly one of 2^k points.
#[test]
fn owen_sobol_is_a_zero_two_sequence() {
    let sampler = Sampler::new(Method::OwenSobol, 7);
    for dimension in [0, 3, 1000] {
        for k in 0..=8_u32 {
            for columns in 0..=k {
                let (across, down) = (1_u32 << columns, 1_u32 << (k - columns));
                let mut seen = vec![0; 1 << k];
                for index in 0..1_u32 << k {
                    let [x, y] = sampler.stream(5, -9, index).pair(dimension);
                    let cell = (y * down as f32) as u32 * across + (x * across as f32) as u32;
                    seen[cell as usize] += 1;
                }
                assert!(
                    seen.iter().all(|&n| n == 1),
                    "2^{k} points, {across} columns"
                );
            }
        }
    }
}

#[test]
fn parts_are_stratified_together() {
    let sampler = Sampler::new(Method::OwenSobol, 3);
    let mut seen = [0; 64];
    for index in 0..16 {
        for part in 0..4 {
            let [x, _] = sampler.stream(0, 0, index).pair_of(2, part, 4);
            seen[(x * 64.0) as usize] += 1;
        }
    }
    assert_eq!(seen, [1; 64]);
}

/// Moments and the correlation between neighbouring dimensions, samples, pixels and seeds.
#[test]
fn independent_values_look_independent() {
    let sampler = Sampler::new(Method::Independent, 1);
    let count = 20_000;
    let value = |i: u32, d: u32| f64::from(sampler.stream(i as i32 % 50, 3, i).uniform(d));
    let mean: f64 = (0..count).map(|i| value(i, 4)).sum::<f64>() / f64::from(count);
    assert!((mean - 0.5).abs() < 0.01, "mean {mean}");
    let other = Sampler::new(Method::Independent, 2);
    type Pair<'a> = (&'a str, Box<dyn Fn(u32) -> (f64, f64) + 'a>);
    let pairs: Vec<Pair> = vec![
        ("dimension", Box::new(|i| (value(i, 4), value(i, 5)))),
        ("sample", Box::new(|i| (value(i, 4), value(i + 1, 4)))),
        (
            "seed",
            Box::new(|i| {
                let theirs = other.stream(i as i32 % 50, 3, i).uniform(4);
                (value(i, 4), f64::from(theirs))
            }),
        ),
    ];
    for (what, pair) in pairs {
        let covariance: f64 = (0..count)
            .map(pair)
            .map(|(a, b)| (a - 0.5) * (b - 0.5))
            .sum::<f64>()
            / f64::from(count);
        assert!(covariance.abs() < 0.003, "{what}: {covariance}");
    }
}

#[test]
fn every_value_is_below_one() {
    assert!(unit(u32::MAX) < 1.0);
    assert_eq!(unit(0), 0.0);
    assert!(below_one(1.0) < 1.0);
    for method in methods() {
        let sampler = Sampler::new(method, 3);
        for index in (0..2000).chain([u32::MAX, u32::MAX - 1]) {
            for dimension in [0, 1, 5, 31, 32, 77, u32::MAX] {
                let stream = sampler.stream(index as i32 % 7, -2, index);
                let [x, y] = stream.pair_of(dimension, 1, 3);
                for value in [x, y, stream.uniform(dimension)] {
                    assert!((0.0..1.0).contains(&value), "{method:?}: {value}");
                }
            }
        }
    }
}

/// All generators, for 64 samples.
fn methods() -> Vec<Method> {
    let stratified = |jitter| SamplerKind::Stratified { x: 8, y: 8, jitter };
    [
        SamplerKind::Random,
        stratified(true),
        SamplerKind::Halton,
        SamplerKind::Sobol,
        SamplerKind::ZeroTwoSequence,
        SamplerKind::MaxMinDist,
    ]
    .map(|kind| Method::of(kind, 64))
    .to_vec()
}

/// The first pairs of `sobol` are nets as good as its matrices are: the first pair is a (0, 2)-sequence.
#[test]
fn sobol_is_stratified_in_its_first_pair() {
    let sampler = Sampler::new(Method::Sobol, 9);
    for k in 0..=8_u32 {
        for columns in 0..=k {
            let (across, down) = (1_u32 << columns, 1_u32 << (k - columns));
            let mut seen = vec![false; 1 << k];
            for index in 0..1_u32 << k {
                let [x, y] = sampler.stream(2, 3, index).pair(0);
                let cell = (y * down as f32) as u32 * across + (x * across as f32) as u32;
                assert!(!std::mem::replace(&mut seen[cell as usize], true));
            }
        }
    }
}

/// Mean over pixels of the squared error of a pixel's estimate, over the same mean for independent samples.
fn relative_error(method: Method, dimension: u32, value: impl Fn([f32; 2]) -> f32) -> f64 {
    let error = |method| {
        let sampler = Sampler::new(method, 12);
        let pixels = 400;
        let exact = 1.0;
        let sum: f64 = (0..pixels)
            .map(|pixel| {
                let sum: f64 = (0..64)
                    .map(|i| f64::from(value(sampler.stream(pixel, 5, i).pair(dimension))))
                    .sum();
                (sum / 64.0 - exact).powi(2)
            })
            .sum();
        sum / f64::from(pixels)
    };
    error(method) / error(Method::Independent)
}

/// The variance of a smooth function and of an edge is well below the variance of independent samples, in every
/// pair: those with tables of their own and those beyond.
#[test]
fn stratification_lowers_the_error() {
    let smooth = |[x, y]: [f32; 2]| 4.0 * x * y;
    let edge = |[x, y]: [f32; 2]| if x + y < 1.0 { 2.0 } else { 0.0 };
    for method in methods() {
        if method == Method::Independent {
            continue;
        }
        for dimension in [0, 1, 2, 7, 40, 0x8000_0001] {
            let found = relative_error(method, dimension, smooth);
            // The bases of a far Halton pair are larger than the number of samples, and a point set that
            // is far apart on the torus is no better than others at a corner.
            let far_halton = method == Method::Halton && (2..32).contains(&dimension);
            let limit = if far_halton { 1.1 } else { 0.12 };
            assert!(found < limit, "{method:?} {dimension}: {found}");
            let found = relative_error(method, dimension, edge);
            let limit = if far_halton { 1.2 } else { 0.5 };
            assert!(found < limit, "{method:?} {dimension}, edge: {found}");
        }
    }
}

/// Values of different pixels, dimensions and seeds have nothing to do with each other: over many pixels no
/// two of them are correlated, nor do their means differ from one half.
#[test]
fn pixels_dimensions_and_seeds_are_independent() {
    for method in methods() {
        let samplers = [1, 2].map(|seed| Sampler::new(method, seed));
        let count = 20_000;
        let dimensions = [0, 1, 3, 33];
        // Sample 5 of pixel i in all dimensions, of its neighbours, and with the other seed.
        let row = |i: i32| {
            let stream = |seed: usize, x, y| samplers[seed].stream(x, y, 5);
            let mut values = Vec::new();
            for dimension in dimensions {
                values.extend(stream(0, i, 0).pair(dimension));
            }
            for stream in [stream(0, i + 1, 0), stream(0, i, 1), stream(1, i, 0)] {
                values.extend(stream.pair(0));
            }
            values.push(samplers[0].stream(i, 0, 5).uniform(4));
            values
        };
        let width = row(0).len();
        let mut means = vec![0.0; width];
        let mut products = vec![0.0; width * width];
        for i in 0..count {
            let values = row(i);
            for (a, x) in values.iter().enumerate() {
                means[a] += f64::from(*x) - 0.5;
                for (b, y) in values[..a].iter().enumerate() {
                    products[a * width + b] += f64::from((x - 0.5) * (y - 0.5));
                }
            }
        }
        let count = f64::from(count);
        for mean in means {
            let deviation = mean / (count / 12.0).sqrt();
            assert!(deviation.abs() < 5.0, "{method:?}: mean off by {deviation}");
        }
        for (place, product) in products.iter().enumerate() {
            let deviation = product / (count.sqrt() / 12.0);
            let pair = (place / width, place % width);
            assert!(deviation.abs() < 5.0, "{method:?} {pair:?}: {deviation}");
        }
    }
}

/// Only the address decides a value: in reverse order, all values are equal.
#[test]
fn values_do_not_depend_on_the_order_in_which_they_are_asked() {
    for method in methods() {
        let sampler = Sampler::new(method, 4);
        let value = |i: u32| sampler.stream(i as i32 / 9, 2, i % 9).pair(i % 5);
        let forward: Vec<_> = (0..500).map(value).collect();
        let backward: Vec<_> = (0..500).rev().map(value).collect();
        assert!(forward.iter().eq(backward.iter().rev()));
    }
}
