//! Environments: samples against densities, and integrals against closed forms.

use super::*;

/// Dim noise with a few bright texels, `dark` in part.
fn noise(width: u32, height: u32, dark: f32) -> Arc<Image> {
    image(width, height, |x, y| {
        let bits = crate::sampler::mix(u64::from(x) << 32 | u64::from(y));
        let grey = (bits & 0xff) as f32 / 255.0;
        match bits >> 56 {
            0..8 => [40.0, 30.0, 20.0],
            8..100 => [dark; 3],
            _ => [grey, 1.0 - grey, 0.5],
        }
    })
}

fn environment(image: Arc<Image>, world_from_light: Mat3) -> Light {
    let environment = antumbra_scene::Environment {
        mapping: antumbra_scene::EnvironmentMapping::LongitudeLatitude,
        image,
        world_from_light,
    };
    Light::new(&antumbra_scene::Light::Infinite {
        radiance: Vec3::new(2.0, 1.0, 0.5),
        environment: Some(environment),
        samples: 3,
    })
}

/// A turn about no axis in particular, mirrored.
fn skew() -> Mat3 {
    Mat3::from_quat(Quat::from_rotation_y(0.7) * Quat::from_rotation_x(1.9))
        * Mat3::from_diagonal(Vec3::new(1.0, -1.0, 1.0))
}

/// Images of any size: the density agrees with the samples (which fall into cells of the sphere as often as it
/// says), adds up to one, and is positive wherever there is light.
#[test]
fn environments_are_sampled_as_their_density_says() {
    let everywhere = Receiver {
        both_sides: true,
        ..receiver(Vec3::ZERO, Vec3::Z)
    };
    for (width, height) in [(1, 1), (2, 1), (7, 5), (32, 16), (61, 33)] {
        let light = environment(noise(width, height, 1e-4), skew());
        let (rows, columns) = (12, 24);
        let cell = |dir: Vec3| {
            let row = ((1.0 - dir.z) * 0.5 * rows as f32) as usize;
            let turn = libm::atan2f(dir.y, dir.x) / (2.0 * PI) + 0.5;
            row.min(rows - 1) * columns + ((turn * columns as f32) as usize).min(columns - 1)
        };
        let count = 1 << 20;
        // Uniform directions: what the density says, and its integral.
        let mut expected = vec![0.0; rows * columns];
        for u in points(count) {
            let dir = uniform_sphere(u);
            let (radiance, pdf) = light.escaped(&everywhere, dir);
            assert_eq!(radiance, light.escaped_radiance(dir));
            assert!(pdf > 0.0 || radiance == Vec3::ZERO, "{dir}");
            expected[cell(dir)] += f64::from(pdf) * 4.0 * std::f64::consts::PI / f64::from(count);
        }
        let sum: f64 = expected.iter().sum();
        near(sum, 1.0, &format!("{width} x {height}: integral"));
        let samples = 1 << 15;
        let independent = Sampler::new(Method::Independent, 5);
        let mut found = vec![0.0; rows * columns];
        for index in 0..samples {
            let u = independent.stream(3, 4, index).pair(0);
            let Some(sample) = light.sample(&everywhere, u) else {
                panic!("{width} x {height}: no light in a bright direction")
            };
            assert!(sample.pdf > 0.0 && (sample.wi.length() - 1.0).abs() < 1e-4);
            found[cell(sample.wi)] += 1.0;
        }
        // Pearson's statistic has the mean `cells` and the deviation sqrt(2 cells).
        let (mut statistic, mut cells) = (0.0, 0.0);
        for (found, expected) in found.iter().zip(&expected) {
            let expected = expected * f64::from(samples);
            if expected > 5.0 {
                statistic += (found - expected).powi(2) / expected;
                cells += 1.0;
            }
        }
        let limit = cells + 5.0 * f64::sqrt(2.0 * cells) + 5.0;
        assert!(
            statistic < limit,
            "{width} x {height}: {statistic} in {cells} cells"
        );
    }
}

/// The density a sample has is the one reported for its direction, but for directions at edges of cells.
#[test]
fn environments_report_the_density_of_samples() {
    let at = Receiver {
        both_sides: true,
        ..receiver(Vec3::ZERO, Vec3::Z)
    };
    let light = environment(noise(64, 32, 1e-4), skew());
    let mut off = 0;
    for u in points(4096) {
        let sample = light.sample(&at, u).expect("it is bright somewhere");
        let (radiance, pdf) = light.escaped(&at, sample.wi);
        off += u32::from((pdf - sample.pdf).abs() > 1e-3 * sample.pdf);
        assert!((radiance - sample.radiance).abs().max_element() < 0.02 * 80.0);
    }
    assert!(off < 10, "{off} of 4096");
}

/// Irradiance by samples of the light against plain integration over the sphere, and against closed forms.
#[test]
fn irradiance_of_environments() {
    let at = receiver(Vec3::ZERO, Vec3::new(0.6, 0.0, 0.8));
    for world_from_light in [Mat3::IDENTITY, skew()] {
        let light = environment(noise(40, 20, 0.0), world_from_light);
        let count = 1 << 20;
        let expected: f64 = points(count)
            .map(|u| {
                let dir = uniform_sphere(u);
                f64::from(light.escaped_radiance(dir).x * dir.dot(at.normal).max(0.0))
            })
            .sum::<f64>()
            * 4.0
            * std::f64::consts::PI
            / f64::from(count);
        near(irradiance(&light, &at), expected, "noise");
    }
    let even = environment(image(5, 3, |_, _| [0.25; 3]), skew());
    near(
        irradiance(&even, &at),
        0.5 * std::f64::consts::PI,
        "one colour",
    );
    assert!(
        (even.extent().strength / PI - 0.25 * luminance(Vec3::new(2.0, 1.0, 0.5))).abs() < 1e-5
    );
    // One half of the sky bright: where latitude says, and turned as the light is.
    let upper = image(512, 256, |_, y| [if y < 128 { 0.5 } else { 0.0 }; 3]);
    let turned = Mat3::from_quat(Quat::from_rotation_y(std::f32::consts::FRAC_PI_2));
    let pi = std::f64::consts::PI;
    for (world_from_light, towards, expected) in [
        (Mat3::IDENTITY, Vec3::Z, pi),
        (Mat3::IDENTITY, -Vec3::Z, 0.0),
        (Mat3::IDENTITY, Vec3::X, 0.5 * pi),
        (turned, Vec3::X, pi),
    ] {
        let light = environment(upper.clone(), world_from_light);
        let found = irradiance(&light, &receiver(Vec3::ZERO, towards));
        // Interpolation smears the edge over a texel.
        assert!(
            (found - expected).abs() < 0.02,
            "{towards}: {found} {expected}"
        );
    }
}

/// Column 0 begins at the x axis and columns go on towards y. Row 0 is at z.
#[test]
fn environments_are_the_right_way_round() {
    let light = environment(
        image(8, 4, |x, y| [x as f32 + 1.0, y as f32 + 1.0, 0.0]),
        Mat3::IDENTITY,
    );
    for (x, y) in (0..8).flat_map(|x| (0..4).map(move |y| (x, y))) {
        let (azimuth, polar) = ((x as f32 + 0.5) * PI / 4.0, (y as f32 + 0.5) * PI / 4.0);
        let dir = Vec3::new(
            polar.sin() * azimuth.cos(),
            polar.sin() * azimuth.sin(),
            polar.cos(),
        );
        let found = light.escaped_radiance(dir);
        let expected = Vec3::new(2.0 * (x as f32 + 1.0), y as f32 + 1.0, 0.0);
        assert!((found - expected).length() < 1e-3, "{found} {expected}");
    }
}

/// Large images are cut into coarser cells that keep the integrals.
#[test]
fn coarse_cells_keep_the_integral() {
    let image = noise(97, 41, 0.0);
    let fine = SphereDistribution::new(&image, Vec3::ONE);
    for most in [4000, 1000, 37, 1] {
        let coarse = SphereDistribution::with_cells(&image, Vec3::ONE, most);
        assert!((coarse.mean() - fine.mean()).abs() < 1e-5 * fine.mean());
        let count = 1 << 16;
        let sum: f64 = points(count)
            .map(|u| {
                let place = image::longitude_latitude(uniform_sphere(u));
                f64::from(coarse.pdf(place)) * 4.0 * std::f64::consts::PI / f64::from(count)
            })
            .sum();
        near(sum, 1.0, &format!("{most} cells"));
        for u in points(512) {
            let choice = coarse.sample(u);
            let pdf = coarse.pdf(choice.place);
            assert!(choice.pdf > 0.0 && (choice.direction.length() - 1.0).abs() < 1e-5);
            // A direction at an edge may be looked up on the other side of it.
            let inside = choice.place.map(|place| (place - 1e-5, place + 1e-5));
            let same =
                coarse.pdf([inside[0].0, inside[1].0]) == coarse.pdf([inside[0].1, inside[1].1]);
            assert!(
                !same || (pdf - choice.pdf).abs() <= 1e-3 * pdf,
                "{choice:?}"
            );
        }
    }
}

/// Black, infinite and NaN texels, and images without any, are no trouble.
#[test]
fn odd_environments_are_no_trouble() {
    let at = receiver(Vec3::ZERO, Vec3::Z);
    let black = environment(image(4, 2, |_, _| [0.0; 3]), Mat3::IDENTITY);
    let odd = environment(
        image(4, 2, |x, _| {
            [[f32::NAN, f32::INFINITY, -1.0, 0.0][x as usize]; 3]
        }),
        Mat3::IDENTITY,
    );
    for u in points(100) {
        assert!(black.sample(&at, u).is_none());
        if let Some(sample) = odd.sample(&at, u) {
            assert!(sample.pdf.is_finite());
        }
    }
    let empty = Arc::new(Image {
        name: String::new(),
        width: 0,
        height: 0,
        pixels: Pixels::Grey8(Vec::new()),
    });
    let none = environment(empty, Mat3::IDENTITY);
    assert_eq!(none.escaped_radiance(Vec3::X), Vec3::ZERO);
    assert!(none.sample(&at, [0.3; 2]).is_none());
}
