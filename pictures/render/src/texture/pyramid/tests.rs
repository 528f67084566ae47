//! Levels keep the mean, lookups agree with sums written out.

use super::*;

const WRAPS: [Wrap; 3] = [Wrap::Repeat, Wrap::Clamp, Wrap::Black];

fn image(width: u32, height: u32, pixels: Pixels) -> Arc<Image> {
    Arc::new(Image {
        name: "test".into(),
        width,
        height,
        pixels,
    })
}

fn noise(index: u32) -> u8 {
    (index.wrapping_mul(2_654_435_761) >> 24) as u8
}

fn grey(width: u32, height: u32) -> Arc<Image> {
    image(
        width,
        height,
        Pixels::Grey8((0..width * height).map(noise).collect()),
    )
}

fn rgb(width: u32, height: u32) -> Arc<Image> {
    let pixels = (0..width * height).map(|i| [0, 1, 2].map(|c| noise(3 * i + c)));
    image(width, height, Pixels::Rgb8(pixels.collect()))
}

fn floats(width: u32, height: u32) -> Arc<Image> {
    let value = |i: u32| f32::from(noise(i)) * 0.1;
    let pixels = (0..width * height).map(|i| [0, 1, 2].map(|c| value(3 * i + c)));
    image(width, height, Pixels::Rgb32(pixels.collect()))
}

fn flat(st: Vec2) -> Coordinates {
    Coordinates {
        st,
        steps: [Vec2::ZERO; 2],
    }
}

const EWA: TextureFilter = TextureFilter::Ewa {
    max_anisotropy: 8.0,
};

#[test]
fn encoded_bytes_are_srgb() {
    let table = bytes(true);
    assert_eq!([table[0], table[255]], [0.0, 1.0]);
    assert!((table[1] - 1.0 / 255.0 / 12.92).abs() < 1e-9);
    assert!((table[128] - 0.215_860_5).abs() < 1e-6);
    assert_eq!(bytes(false)[51], 0.2);
}

#[test]
fn the_mean_of_all_levels_is_the_same() {
    for (width, height) in [
        (1, 1),
        (8, 8),
        (16, 4),
        (1, 7),
        (13, 9),
        (100, 3),
        (255, 257),
    ] {
        for (image, gamma) in [
            (grey(width, height), true),
            (rgb(width, height), false),
            (rgb(width, height), true),
            (floats(width, height), false),
            (floats(width, height), true),
        ] {
            let pyramid = Pyramid::<Vec3>::new(&image, Wrap::Repeat, gamma);
            let numbers = Pyramid::<f32>::new(&image, Wrap::Repeat, gamma);
            let mut means = Vec::new();
            for (level, Level { size, .. }) in pyramid.levels.iter().enumerate() {
                let mut sum = [0.0_f64; 4];
                for y in 0..size.y {
                    for x in 0..size.x {
                        let color = pyramid.stored(level, x, y);
                        let number = numbers.stored(level, x, y);
                        for (sum, value) in sum.iter_mut().zip([color.x, color.y, color.z, number])
                        {
                            *sum += f64::from(value) / f64::from(size.x * size.y);
                        }
                    }
                }
                means.push(sum);
            }
            for mean in &means {
                for (found, expected) in mean.iter().zip(means[0]) {
                    assert!(
                        (found - expected).abs() < 2e-5 * (1.0 + expected),
                        "{means:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn levels_of_powers_of_two_are_means_of_four() {
    let image = grey(8, 4);
    let pyramid = Pyramid::<f32>::new(&image, Wrap::Repeat, true);
    assert_eq!(pyramid.levels.len(), 4);
    for y in 0..2 {
        for x in 0..4 {
            let four = [(0, 0), (1, 0), (0, 1), (1, 1)]
                .map(|(i, j)| pyramid.stored(0, 2 * x + i, 2 * y + j));
            let expected = 0.25 * four.iter().sum::<f32>();
            assert!((pyramid.stored(1, x, y) - expected).abs() < 1e-5);
        }
    }
}

#[test]
fn lookups_without_width_are_bilinear_with_the_origin_at_the_bottom_left() {
    let pixels = Pixels::Grey8(vec![0, 51, 102, 153]);
    let image = image(2, 2, pixels);
    for (wrap, corner) in WRAPS.into_iter().zip([0.3, 0.4, 0.1]) {
        let pyramid = Pyramid::<f32>::new(&image, wrap, false);
        for (s, t, expected) in [
            (0.25, 0.25, 0.4),
            (0.75, 0.25, 0.6),
            (0.25, 0.75, 0.0),
            (0.75, 0.75, 0.2),
            (0.5, 0.25, 0.5),
            (0.5, 0.5, 0.3),
            (0.0, 0.0, corner),
        ] {
            for filter in [TextureFilter::Trilinear, EWA] {
                let found = pyramid.lookup(&flat(Vec2::new(s, t)), filter);
                assert!((found - expected).abs() < 1e-6, "{wrap:?} {s} {t}: {found}");
            }
        }
    }
}

/// Wherever a lookup may look, whatever its width: a constant image is constant, except beyond a black edge.
#[test]
fn constants_stay_constant() {
    for (width, height) in [(8, 8), (13, 5), (1, 3), (1, 1)] {
        let count = (width * height) as usize;
        let image = image(width, height, Pixels::Rgb32(vec![[0.25, 0.5, 4.0]; count]));
        for wrap in [Wrap::Repeat, Wrap::Clamp] {
            let pyramid = Pyramid::<Vec3>::new(&image, wrap, false);
            for i in 0..400 {
                let random = |k: u32| f32::from(noise(7 * i + k)) / 255.0;
                let size = libm::powf(10.0, 8.0 * random(0) - 6.0);
                let steps = [
                    Vec2::new(random(1) - 0.5, random(2) - 0.5) * size,
                    Vec2::new(random(3) - 0.5, random(4) - 0.5) * size * random(5),
                ];
                let st = Vec2::new(random(6), random(5)) * 4.0 - 2.0;
                for filter in [TextureFilter::Trilinear, EWA] {
                    let found = pyramid.lookup(&Coordinates { st, steps }, filter);
                    let error = (found / Vec3::new(0.25, 0.5, 4.0) - 1.0)
                        .abs()
                        .max_element();
                    assert!(error < 1e-4, "{wrap:?} {filter:?} {st} {steps:?}: {found}");
                }
            }
        }
    }
}

/// Wide lookups approach the mean. Lookups a texel wide stay close to the image blurred by a texel.
#[test]
fn width_chooses_the_level() {
    let image = grey(64, 64);
    let pyramid = Pyramid::<f32>::new(&image, Wrap::Repeat, false);
    let mean = pyramid.mean();
    let st = Vec2::new(0.3, 0.6);
    for filter in [TextureFilter::Trilinear, EWA] {
        let lookup = |width: f32| {
            let steps = [Vec2::X * width, Vec2::Y * width];
            pyramid.lookup(&Coordinates { st, steps }, filter)
        };
        assert_eq!(lookup(2.0), mean);
        assert_eq!(lookup(f32::MAX), mean);
        assert!((lookup(0.9) - mean).abs() < 0.02);
    }
    // Trilinear takes twice the longest step: 1/32 is a level whose texels are 1/16.
    let steps = [Vec2::X / 32.0, Vec2::ZERO];
    let found = pyramid.lookup(&Coordinates { st, steps }, TextureFilter::Trilinear);
    assert_eq!(found, pyramid.bilinear(2, st));
    let steps = [Vec2::X / 32.0 * 1.5, Vec2::ZERO];
    let found = pyramid.lookup(&Coordinates { st, steps }, TextureFilter::Trilinear);
    let share = libm::log2f(1.5);
    let expected = pyramid.bilinear(2, st) * (1.0 - share) + pyramid.bilinear(3, st) * share;
    assert!((found - expected).abs() < 1e-6);
}

/// Long ellipses average along themselves, not across: rows that differ stay apart.
#[test]
fn ellipses_follow_their_longer_axis() {
    let rows = (0..64 * 64).map(|i| if i / 64 / 8 % 2 == 0 { 255 } else { 0 });
    let image = image(64, 64, Pixels::Grey8(rows.collect()));
    let pyramid = Pyramid::<f32>::new(&image, Wrap::Repeat, false);
    // The middle of the row of blocks from texel 8 on, counted from the bottom: they are white.
    let st = Vec2::new(0.5, 12.0 / 64.0);
    let (along, across) = (Vec2::X * 8.0 / 64.0, Vec2::Y * 1.0 / 64.0);
    for steps in [[along, across], [across, along]] {
        let found = pyramid.lookup(&Coordinates { st, steps }, EWA);
        assert!(found > 0.99, "{found}");
        let turned = steps.map(|s| Vec2::new(s.y, s.x));
        let found = pyramid.lookup(&Coordinates { st, steps: turned }, EWA);
        assert!((0.2..0.85).contains(&found), "{found}");
    }
}

#[test]
fn numbers_that_are_none_give_something() {
    let pyramid = Pyramid::<f32>::new(&grey(5, 4), Wrap::Repeat, true);
    for bad in [
        f32::NAN,
        f32::INFINITY,
        -f32::INFINITY,
        1e30,
        -1e30,
        f32::MAX,
    ] {
        for st in [Vec2::new(bad, 0.5), Vec2::new(0.5, bad)] {
            for steps in [
                [Vec2::ZERO; 2],
                [Vec2::splat(bad), Vec2::ONE],
                [Vec2::X, Vec2::new(0.1, bad)],
                [Vec2::X * 0.01, Vec2::Y * 0.01],
            ] {
                for filter in [TextureFilter::Trilinear, EWA] {
                    let found = pyramid.lookup(&Coordinates { st, steps }, filter);
                    assert!((0.0..=1.001).contains(&found), "{st} {steps:?} {found}");
                }
            }
        }
    }
}
