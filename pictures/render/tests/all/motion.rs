//! Motion blur: instances and cameras that move while the shutter is open.

use crate::support::*;
use antumbra::Width;
use antumbra::recipe::{Collapse, Engine, Order};
use antumbra_render::{Error, Options, Rendering, World, render};
use antumbra_scene::{Film, Filter, Instance, Integrator, Object, Projection, Scene};
use glam::{Affine3, Mat4, Quat, Vec3};
use std::num::NonZeroUsize;

/// A strip of pixels, from x = -1 to 1, of a parallel projection along z.
fn strip(width: u32) -> Scene {
    let mut scene = empty();
    scene.camera.projection = Projection::Orthographic;
    scene.camera.screen_window = Some([-1.0, 1.0, -0.1, 0.1]);
    scene.film = Film {
        resolution: [width, 2],
        filter: Filter::Box { radius: [0.5, 0.5] },
        ..Film::default()
    };
    scene.lights.push(sky(1.0));
    scene
}

/// Moves the last shape of the world into an object, with an instance that moves.
fn moving(scene: &mut Scene, start: Affine3, end: Affine3) {
    let shape = scene.shapes.pop().expect("a shape");
    scene.objects.push(Object {
        name: "moving".into(),
        shapes: vec![shape],
    });
    scene.instances.push(Instance {
        object: scene.objects.len() - 1,
        world_from_object: start,
        end: Some(end),
    });
}

/// A black post, half a unit wide.
fn post(scene: &mut Scene) {
    let corner = Vec3::new(-0.25, -9.0, 5.0);
    add(
        scene,
        quad(corner, Vec3::Y * 18.0, Vec3::X * 0.5),
        matte(0.0),
    );
}

/// First channels of a row.
fn row(rendering: &Rendering) -> Vec<f32> {
    let width = rendering.image.window().width();
    rendering.image.pixels()[..width]
        .iter()
        .map(|pixel| pixel[0])
        .collect()
}

/// The sky that is left beside a post that moves from -0.5 to 0.5: the edges are ramps as wide as the post.
#[track_caller]
fn assert_ramps(rendering: &Rendering, what: &str) {
    let row = row(rendering);
    for (column, &found) in row.iter().enumerate() {
        let x = (column as f32 + 0.5) * 2.0 / row.len() as f32 - 1.0;
        let covered = (x + 0.25).min(0.5) - (x - 0.25).max(-0.5);
        let expected = 1.0 - covered.max(0.0);
        assert!(
            (found - expected).abs() < 0.04,
            "{what}, {x}: {found}, not {expected}"
        );
    }
}

#[test]
fn the_edge_of_a_moving_post_is_a_ramp() {
    let [left, right] = [-0.5, 0.5].map(|x| Vec3::X * x);
    let mut instance = strip(40);
    post(&mut instance);
    let places = [left, right].map(Affine3::from_translation);
    moving(&mut instance, places[0], places[1]);
    assert_ramps(&picture(&instance, 256), "instance");

    // The camera moves the other way.
    let mut camera = strip(40);
    post(&mut camera);
    camera.camera.world_from_camera = Mat4::from_translation(right);
    camera.camera.end = Some(Mat4::from_translation(left));
    assert_ramps(&picture(&camera, 256), "camera");

    // Both move alike, so that nothing is blurred.
    instance.camera.world_from_camera = Mat4::from_translation(left);
    instance.camera.end = Some(Mat4::from_translation(right));
    let sharp = row(&picture(&instance, 16));
    let blurred = sharp
        .iter()
        .filter(|value| **value > 0.01 && **value < 0.99);
    assert!(blurred.count() <= 2, "{sharp:?}");
}

/// A short exposure shows the place at its time, and times outside of the motion show its ends.
#[test]
fn the_shutter_chooses_the_times() {
    for (shutter, middle) in [([0.5, 0.5], 0.0), ([0.2, 0.2], -0.3), ([3.0, 4.0], 0.5)] {
        let mut scene = strip(40);
        post(&mut scene);
        let places = [-0.5, 0.5].map(|x| Affine3::from_translation(Vec3::X * x));
        moving(&mut scene, places[0], places[1]);
        scene.camera.shutter = shutter;
        for (column, value) in row(&picture(&scene, 16)).into_iter().enumerate() {
            let x = (column as f32 + 0.5) / 20.0 - 1.0;
            let distance = f32::abs(x - middle) - 0.25;
            if distance.abs() > 0.03 {
                assert_eq!(value < 0.5, distance < 0.0, "{shutter:?}, {x}");
            }
        }
    }
}

/// Things that turn and move before a floor, under a sky.
fn turning(integrator: Integrator) -> Scene {
    let mut scene = empty();
    scene.integrator = integrator;
    scene.camera = look(Vec3::new(0.5, 0.3, -6.0), Vec3::Z, 50.0);
    scene.lights.push(sky(1.0));
    add(&mut scene, floor(2.5), matte(0.5));
    for (number, geometry) in [cube(Vec3::ZERO, 0.6), sphere(Vec3::X * 0.2, 0.5)]
        .into_iter()
        .enumerate()
    {
        add(&mut scene, geometry, matte(0.8));
        let (start, end) = turning_keys(number);
        moving(&mut scene, start, end);
    }
    scene
}

fn turning_keys(number: usize) -> (Affine3, Affine3) {
    let x = if number == 0 { -1.0 } else { 1.0 };
    let start = Affine3::from_translation(Vec3::new(x, -0.5, 0.0));
    let end = Affine3::from_rotation_translation(
        Quat::from_rotation_z(1.2) * Quat::from_rotation_y(0.4),
        Vec3::new(x, 0.7, 0.4),
    );
    (start, end)
}

#[test]
fn a_moving_picture_is_the_mean_of_pictures_at_many_times() {
    const TIMES: usize = 32;
    let path = empty().integrator;
    let direct = Integrator::DirectLighting {
        strategy: antumbra_scene::DirectStrategy::All,
        max_depth: 3,
    };
    let volume = Integrator::VolumePath {
        max_depth: 5,
        rr_threshold: 1.0,
        light_strategy: antumbra_scene::LightStrategy::Spatial,
    };
    let ambient = Integrator::AmbientOcclusion {
        samples: 2,
        cosine_sampling: true,
        distance: f32::INFINITY,
        open: 1.0,
    };
    for integrator in [path, direct, volume, ambient] {
        let mut scene = turning(integrator);
        let blurred = picture(&scene, 256);
        let pixels = blurred.image.pixels().len();
        let mut sums = vec![0.0; pixels];
        for time in 0..TIMES {
            let share = (time as f32 + 0.5) / TIMES as f32;
            for (number, instance) in scene.instances.iter_mut().enumerate() {
                let (start, end) = turning_keys(number);
                let (_, turn, to) = end.to_scale_rotation_translation();
                let (_, _, from) = start.to_scale_rotation_translation();
                let turn = Quat::IDENTITY.slerp(turn, share);
                instance.world_from_object =
                    Affine3::from_rotation_translation(turn, from.lerp(to, share));
                instance.end = None;
            }
            let options = Options {
                spp: Some(32),
                seed: time as u64,
                ..Options::default()
            };
            for (sum, pixel) in sums
                .iter_mut()
                .zip(picture_with(&scene, &options).image.pixels())
            {
                *sum += pixel[0] / TIMES as f32;
            }
        }
        let differences = blurred
            .image
            .pixels()
            .iter()
            .zip(&sums)
            .map(|(a, b)| a[0] - b);
        let differences: Vec<f32> = differences.collect();
        let worst = differences.iter().fold(0.0f32, |most, d| most.max(d.abs()));
        let mean = differences.iter().sum::<f32>() / pixels as f32;
        assert!(
            worst < 0.12 && mean.abs() < 0.01,
            "{integrator:?}: {worst}, {mean}"
        );
    }
}

#[test]
fn threads_widths_and_orders_change_no_bit() {
    let scene = turning(empty().integrator);
    let world = World::new(&scene).expect("a valid scene");
    assert!(world.moves());
    let run = |options: Options| render(&world, &options, &()).expect("nothing stops it");
    let options = |threads| Options {
        spp: Some(8),
        threads: NonZeroUsize::new(threads),
        ..Options::default()
    };
    let reference = run(options(1));
    for width in Width::ALL {
        for order in [Order::Simple, Order::default()] {
            let recipe = Options::default()
                .recipe
                .engine(Engine::best(width))
                .order(order);
            let recipe = recipe.collapse(Collapse::Area);
            let rendering = run(Options {
                recipe,
                ..options(2)
            });
            assert_eq!(rendering.image, reference.image, "{width:?} {order}");
            assert_eq!(rendering.stats.occluded_rays, reference.stats.occluded_rays);
        }
    }
}

#[test]
fn motion_without_a_way_is_refused() {
    let mirror = Affine3::from_scale(Vec3::new(1.0, 1.0, -1.0));
    let mut scene = strip(8);
    post(&mut scene);
    moving(&mut scene, Affine3::IDENTITY, mirror);
    let error = World::new(&scene).expect_err("one mirrors");
    assert!(
        matches!(error, Error::Geometry(antumbra::Error::KeysMirror { .. })),
        "{error}"
    );
    let mut scene = strip(8);
    scene.camera.end = Some(Mat4::from_scale(Vec3::new(1.0, 1.0, -1.0)));
    assert!(matches!(
        World::new(&scene),
        Err(Error::CameraMatrix { .. })
    ));
    scene.camera.end = Some(Mat4::ZERO);
    assert!(matches!(
        World::new(&scene),
        Err(Error::CameraMatrix { .. })
    ));
}
