//! Irradiance of every light against its closed form, and samples against their densities.

use std::sync::Arc;

use antumbra_scene::{AreaLight, Geometry, Image, Pixels, Shape, Sphere, TriangleMesh};
use glam::{Mat3, Mat4, Quat};

use super::distribution::SphereDistribution;
use super::*;
use crate::sampler::warp::uniform_sphere;
use crate::sampler::{Method, Sampler};

fn points(count: u32) -> impl Iterator<Item = [f32; 2]> {
    let sampler = Sampler::new(Method::OwenSobol, 23);
    (0..count).map(move |i| sampler.stream(0, 0, i).pair(0))
}

fn receiver(point: Vec3, normal: Vec3) -> Receiver {
    Receiver {
        point,
        normal,
        both_sides: false,
    }
}

/// Monte Carlo irradiance of an unblocked light.
fn irradiance(light: &Light, at: &Receiver) -> f64 {
    let count = 1 << 15;
    points(count)
        .filter_map(|u| light.sample(at, u))
        .map(|s| f64::from(s.radiance.x * s.wi.dot(at.normal).max(0.0) / s.pdf))
        .sum::<f64>()
        / f64::from(count)
}

fn area(geometry: Geometry, two_sided: bool) -> Light {
    Light::Area(
        Emitter::new(&Shape {
            geometry,
            material: 0,
            area_light: Some(AreaLight {
                radiance: Vec3::ONE,
                two_sided,
                samples: 1,
            }),
            alpha: None,
            shadow_alpha: None,
            reverse_orientation: false,
            transform_swaps_handedness: false,
        })
        .expect("it has an area"),
    )
}

/// A square of half-width 1 at height z = 1 that faces down.
fn ceiling() -> Geometry {
    Geometry::Mesh(Arc::new(TriangleMesh {
        positions: vec![
            [-1.0, -1.0, 1.0],
            [1.0, -1.0, 1.0],
            [1.0, 1.0, 1.0],
            [-1.0, 1.0, 1.0],
        ],
        indices: vec![[0, 2, 1], [0, 3, 2]],
        ..TriangleMesh::default()
    }))
}

fn near(found: f64, expected: f64, what: &str) {
    assert!(
        (found - expected).abs() < 0.01 * expected.max(0.01),
        "{what}: {found} {expected}"
    );
}

#[test]
fn irradiance_of_a_square_is_its_form_factor() {
    // Four corners with a = b = 1 over a point at distance 1: E = 4 * (1/2) * 2 (1/√2) atan(1/√2).
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let expected = 4.0 * half * half.atan();
    let up = receiver(Vec3::ZERO, Vec3::Z);
    near(irradiance(&area(ceiling(), false), &up), expected, "below");
    let above = receiver(Vec3::Z * 2.0, -Vec3::Z);
    near(
        irradiance(&area(ceiling(), false), &above),
        0.0,
        "above, one-sided",
    );
    near(
        irradiance(&area(ceiling(), true), &above),
        expected,
        "above, two-sided",
    );
}

#[test]
fn irradiance_of_a_sphere() {
    for (radius, distance) in [(1.0_f32, 3.0_f32), (1.0, 1.01), (0.01, 100.0)] {
        let sphere = Sphere {
            center: Vec3::Z * distance,
            radius,
        };
        let light = area(Geometry::Sphere(sphere), false);
        let expected = std::f64::consts::PI * f64::from(radius / distance).powi(2);
        let found = irradiance(&light, &receiver(Vec3::ZERO, Vec3::Z));
        assert!(
            (found - expected).abs() < 0.01 * expected,
            "{radius} {distance}: {found} {expected}"
        );
    }
}

#[test]
fn irradiance_of_plain_lights() {
    use antumbra_scene::Light as Scene;
    let up = receiver(Vec3::ZERO, Vec3::Z);
    let intensity = Vec3::splat(5.0);
    let position = Vec3::new(0.0, 0.0, 2.0);
    let point = Light::new(&Scene::Point {
        position,
        intensity,
    });
    near(irradiance(&point, &up), 1.25, "point");
    let spot = |axis: Vec3| {
        Light::new(&Scene::Spot {
            position,
            axis: axis.normalize(),
            intensity,
            cos_total_width: 0.5,
            cos_falloff_start: 0.9,
        })
    };
    near(irradiance(&spot(-Vec3::Z), &up), 1.25, "spot, centre");
    near(irradiance(&spot(Vec3::X), &up), 0.0, "spot, outside");
    // Cosine 0.7 is halfway through the falloff.
    let edge = spot(Vec3::new((1.0_f32 - 0.49).sqrt(), 0.0, -0.7));
    near(irradiance(&edge, &up), 1.25 / 16.0, "spot, edge");
    let distant = Light::new(&Scene::Distant {
        to_light: Vec3::new(0.6, 0.0, 0.8),
        radiance: Vec3::ONE,
    });
    near(irradiance(&distant, &up), 0.8, "distant");
    let sky = Light::new(&Scene::Infinite {
        radiance: Vec3::ONE,
        environment: None,
        samples: 1,
    });
    near(irradiance(&sky, &up), std::f64::consts::PI, "sky");
    let samples = |samples| {
        let radiance = Vec3::ONE;
        Light::new(&Scene::Infinite {
            radiance,
            environment: None,
            samples,
        })
        .samples()
    };
    assert_eq!([samples(0), samples(1), samples(9)], [1, 1, 9]);
    let both = Receiver {
        both_sides: true,
        ..up
    };
    near(
        irradiance(&sky, &both),
        std::f64::consts::PI,
        "sky, both sides sampled",
    );
}

/// The densities of the elements of a mesh add up: sampling each costs as much as sampling all.
#[test]
fn elements_add_up_to_the_light() {
    let light = area(ceiling(), false);
    let at = receiver(Vec3::new(0.4, -0.3, 0.0), Vec3::Z);
    let count = 1 << 14;
    let by_element: f64 = (0..light.elements())
        .flat_map(|element| points(count).map(move |u| (element, u)))
        .filter_map(|(element, u)| light.sample_element(&at, element, u))
        .map(|s| f64::from(s.radiance.x * s.wi.z / s.pdf) / f64::from(count))
        .sum();
    let whole = irradiance(&light, &at);
    near(by_element, whole, "elements");
}

/// The density that a hit reports is the one its sample had.
#[test]
fn hits_report_the_density_of_samples() {
    let sphere = Sphere {
        center: Vec3::new(0.5, 0.2, 2.0),
        radius: 0.7,
    };
    let at = receiver(Vec3::new(0.1, 0.2, -0.3), Vec3::Z);
    for light in [area(ceiling(), true), area(Geometry::Sphere(sphere), true)] {
        let Light::Area(emitter) = &light else {
            unreachable!("area makes area lights")
        };
        for u in points(300) {
            let Some(sample) = light.sample(&at, u) else {
                panic!("two-sided emitters always have a sample")
            };
            let End::Surface {
                point,
                error,
                normal,
            } = sample.end
            else {
                panic!("emitters are surfaces")
            };
            let hit = Surface {
                point,
                error,
                origin_offset: 0.0,
                origin: point,
                normal,
                shading_normal: normal,
                wo: -sample.wi,
                shape: 0,
                inst_id: antumbra::INVALID_ID,
                primitive: 0,
            };
            let pdf = emitter.pdf(&at, &hit);
            assert!(
                (pdf - sample.pdf).abs() < 1e-3 * pdf,
                "{pdf} {}",
                sample.pdf
            );
        }
    }
    let sky = Light::new(&antumbra_scene::Light::Infinite {
        radiance: Vec3::ONE,
        environment: None,
        samples: 1,
    });
    for both_sides in [false, true] {
        let at = Receiver { both_sides, ..at };
        let count = 1 << 15;
        let mean: f64 = points(count)
            .map(|u| f64::from(sky.escaped(&at, uniform_sphere(u)).1))
            .sum::<f64>()
            / f64::from(count);
        near(mean * 4.0 * std::f64::consts::PI, 1.0, "density of the sky");
        for u in points(300) {
            let sample = sky.sample(&at, u).expect("a sky is everywhere");
            assert_eq!(sample.pdf, sky.escaped(&at, sample.wi).1);
        }
    }
}

#[test]
fn shapes_without_area_are_no_lights() {
    let flat = Geometry::Mesh(Arc::new(TriangleMesh {
        positions: vec![[f32::NAN; 3], [1.0; 3], [2.0; 3]],
        indices: vec![[0, 1, 2], [1, 1, 2]],
        ..TriangleMesh::default()
    }));
    let shape = Shape {
        geometry: flat,
        material: 0,
        area_light: Some(AreaLight {
            radiance: Vec3::ONE,
            two_sided: false,
            samples: 1,
        }),
        alpha: None,
        shadow_alpha: None,
        reverse_orientation: false,
        transform_swaps_handedness: false,
    };
    assert!(Emitter::new(&shape).is_none());
}

/// An image of this function of column and row.
fn image(width: u32, height: u32, value: impl Fn(u32, u32) -> [f32; 3]) -> Arc<Image> {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    Arc::new(Image {
        name: "test".into(),
        width,
        height,
        pixels: Pixels::Rgb32(pixels.map(|(x, y)| value(x, y)).collect()),
    })
}

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

/// Images of any size: the density is that of the samples (which fall into cells of the sphere as often as it
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

#[test]
fn goniometric_lights_shine_by_direction() {
    use antumbra_scene::Light as Scene;
    let light = |image, world_from_light| {
        Light::new(&Scene::Goniometric {
            world_from_light,
            intensity: Vec3::new(4.0, 8.0, 0.0),
            image,
        })
    };
    let away = Mat4::from_translation(Vec3::new(0.0, 0.0, 2.0));
    let up = receiver(Vec3::ZERO, Vec3::Z);
    near(irradiance(&light(None, away), &up), 1.0, "no image");
    // Azimuth in the plane of x and z, the pole at y. Scaling does not matter.
    let image = image(8, 4, |x, y| [x as f32 + 1.0, y as f32 + 1.0, 0.0]);
    let found = light(
        Some(image.clone()),
        away * Mat4::from_scale(Vec3::splat(3.0)),
    );
    for (x, y) in (0..8).flat_map(|x| (0..4).map(move |y| (x, y))) {
        let (azimuth, polar) = ((x as f32 + 0.5) * PI / 4.0, (y as f32 + 0.5) * PI / 4.0);
        let w = Vec3::new(
            polar.sin() * azimuth.cos(),
            polar.cos(),
            polar.sin() * azimuth.sin(),
        );
        let at = receiver(Vec3::new(0.0, 0.0, 2.0) + w * 2.0, -w);
        let sample = found.sample(&at, [0.5; 2]).expect("bright everywhere");
        let expected = Vec3::new(x as f32 + 1.0, 2.0 * (y as f32 + 1.0), 0.0);
        assert!((sample.radiance - expected).length() < 1e-3);
        assert!((sample.wi + w).length() < 1e-5 && sample.is_delta && sample.pdf == 1.0);
    }
    near(f64::from(found.power(1.0)), flux(&found), "power");
}

/// Luminance of the energy through a sphere around a light at (0, 0, 2).
fn flux(light: &Light) -> f64 {
    let count = 1 << 18;
    points(count)
        .map(|u| {
            let w = uniform_sphere(u);
            let at = receiver(Vec3::new(0.0, 0.0, 2.0) + w * 3.0, -w);
            light
                .sample(&at, [0.5; 2])
                .map_or(0.0, |s| f64::from(luminance(s.radiance)) * 9.0)
        })
        .sum::<f64>()
        * 4.0
        * std::f64::consts::PI
        / f64::from(count)
}

#[test]
fn projections_throw_their_image() {
    use antumbra_scene::Light as Scene;
    let light = |image, fov| {
        Light::new(&Scene::Projection {
            world_from_light: Mat4::from_translation(Vec3::new(0.0, 0.0, 2.0)),
            intensity: Vec3::splat(9.0),
            fov,
            image,
        })
    };
    // Light that arrives at (x, y) on the plane at distance 3 in front of it, undone to intensity over nine.
    let seen = |light: &Light, x: f32, y: f32, z: f32| {
        let at = receiver(Vec3::new(x, y, 2.0 + z), -Vec3::Z);
        let squared = x * x + y * y + z * z;
        light
            .sample(&at, [0.5; 2])
            .map_or(Vec3::ZERO, |s| s.radiance * squared / 9.0)
    };
    let square = light(None, 90.0);
    assert!((seen(&square, 0.0, 0.0, 3.0) - Vec3::ONE).length() < 1e-5);
    assert!((seen(&square, 2.99, -2.99, 3.0) - Vec3::ONE).length() < 1e-5);
    for (x, y, z) in [
        (3.01, 0.0, 3.0),
        (0.0, -3.01, 3.0),
        (0.0, 0.0, -3.0),
        (1.0, 0.0, 0.0),
    ] {
        assert_eq!(seen(&square, x, y, z), Vec3::ZERO, "({x}, {y}, {z})");
    }
    // A square of 90 degrees is a side of a cube.
    near(
        f64::from(square.power(1.0)),
        9.0 * 4.0 * std::f64::consts::PI / 6.0,
        "power",
    );
    // Twice as wide as high: the angle is that of the height, and rows grow with y.
    let wide = light(Some(image(8, 4, |x, y| [x as f32, y as f32, 1.0])), 90.0);
    for (x, y) in (0..8).flat_map(|x| (0..4).map(move |y| (x, y))) {
        let place = [(x as f32 + 0.5) / 4.0 - 1.0, (y as f32 + 0.5) / 2.0 - 1.0];
        let found = seen(&wide, place[0] * 6.0, place[1] * 3.0, 3.0);
        let expected = Vec3::new(x as f32, y as f32, 1.0);
        assert!((found - expected).length() < 1e-3, "{found} {expected}");
    }
    let tall = light(Some(image(20, 40, |_, _| [1.0; 3])), 60.0);
    let half = 3.0 * (30.0_f32).to_radians().tan();
    assert!(seen(&tall, 0.99 * half, 1.99 * half, 3.0) != Vec3::ZERO);
    assert!(seen(&tall, 1.01 * half, 0.0, 3.0) == Vec3::ZERO);
    assert!(seen(&tall, 0.0, 2.01 * half, 3.0) == Vec3::ZERO);
    for light in [square, tall] {
        near(f64::from(light.power(1.0)), flux(&light), "power");
    }
    // A matrix that flattens space makes no light and no fuss.
    let flat = Light::new(&Scene::Projection {
        world_from_light: Mat4::ZERO,
        intensity: Vec3::ONE,
        fov: 45.0,
        image: None,
    });
    assert!(
        flat.sample(&receiver(Vec3::ONE, Vec3::Z), [0.5; 2])
            .is_none()
    );
}

/// The power of a spot is what passes through a sphere around it.
#[test]
fn powers_are_energies() {
    let spot = Light::new(&antumbra_scene::Light::Spot {
        position: Vec3::new(0.0, 0.0, 2.0),
        axis: Vec3::X,
        intensity: Vec3::splat(3.0),
        cos_total_width: 0.3,
        cos_falloff_start: 0.7,
    });
    near(f64::from(spot.power(1.0)), flux(&spot), "spot");
}
