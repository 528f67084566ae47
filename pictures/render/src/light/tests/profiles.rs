//! Goniometric lights, projections and spots: intensity by direction, and power.

use super::*;

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
    // Twice as wide as high: the angle spans the height, and rows grow with y.
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
