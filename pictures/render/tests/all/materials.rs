//! Textured, layered and absent surfaces in whole pictures, against closed forms and each other.

use std::num::NonZeroUsize;
use std::sync::Arc;

use crate::support::*;
use antumbra_render::{Options, World, render};
use antumbra_scene::material::{Bumped, Matte, Metal, Mirror, Mix, Substrate, Translucent, Uber};
use antumbra_scene::{
    DirectStrategy, Geometry, Image, ImageTexture, Integrator, LightStrategy, Mapping, Material,
    Param, Pixels, Rgb, Scene, Texture, TextureFilter, TriangleMesh, Wrap,
};
use glam::{Vec2, Vec3};

fn path(max_depth: u32) -> Integrator {
    Integrator::Path {
        max_depth,
        rr_threshold: 1.0,
        light_strategy: LightStrategy::Spatial,
    }
}

fn direct(max_depth: u32) -> Integrator {
    Integrator::DirectLighting {
        strategy: DirectStrategy::All,
        max_depth,
    }
}

fn grey(value: f32) -> Param<Rgb> {
    Rgb::splat(value).into()
}

fn uber([kd, ks, kr, kt]: [f32; 4], opacity: f32) -> Material {
    Material::Uber(Uber {
        kd: grey(kd),
        ks: grey(ks),
        kr: grey(kr),
        kt: grey(kt),
        roughness: [0.2.into(), 0.4.into()],
        opacity: grey(opacity),
        eta: 1.5.into(),
        remap_roughness: false,
    })
}

fn mix(first: Material, second: Material, amount: f32) -> Material {
    Material::Mix(Mix {
        materials: [Arc::new(first), Arc::new(second)],
        amount: grey(amount),
    })
}

/// A square of the plane z = `height`, seen from above, with texture coordinates 0 to 1.
fn square(height: f32, half: f32) -> Geometry {
    let corners = [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]];
    Geometry::Mesh(Arc::new(TriangleMesh {
        positions: corners
            .map(|[u, v]| [half * (2.0 * u - 1.0), half * (2.0 * v - 1.0), height])
            .to_vec(),
        indices: vec![[0, 1, 2], [0, 2, 3]],
        normals: Vec::new(),
        uvs: corners.map(Vec2::from).to_vec(),
        colors: Vec::new(),
    }))
}

fn picture_of(pixels: Pixels, width: u32, filter: TextureFilter) -> Texture<Rgb> {
    let count = match &pixels {
        Pixels::Grey8(pixels) => pixels.len(),
        Pixels::Rgb8(pixels) => pixels.len(),
        Pixels::Rgb32(pixels) => pixels.len(),
    };
    Texture::Image(ImageTexture {
        image: Arc::new(Image {
            name: "test".into(),
            width,
            height: count as u32 / width,
            pixels,
        }),
        mapping: Mapping::default(),
        wrap: Wrap::Repeat,
        filter,
        gamma: false,
        scale: 1.0,
    })
}

const EWA: TextureFilter = TextureFilter::Ewa {
    max_anisotropy: 8.0,
};

/// In a world of radiance 1, bodies that lose nothing cannot be seen, whatever their lobes: what is
/// straight through, mirrored, refracted or scattered is 1.
#[test]
fn bodies_that_lose_nothing_vanish_in_a_uniform_world() {
    let mirror = || Material::Mirror(Mirror { kr: grey(1.0) });
    let sheet = Material::Translucent(Translucent {
        kd: grey(1.0),
        ks: grey(0.0),
        reflect: grey(0.25),
        transmit: grey(0.75),
        roughness: 0.1.into(),
        remap_roughness: true,
    });
    for (material, depth) in [
        (Material::None, 1),
        (uber([0.0; 4], 0.0), 6),
        (uber([1.0, 0.0, 0.0, 0.0], 0.4), 30),
        (uber([0.0, 0.0, 1.0, 1.0], 1.0), 60),
        (uber([0.0, 0.0, 1.0, 1.0], 0.7), 60),
        (mix(mirror(), matte(1.0), 0.3), 4),
        (mix(glass(1.5), mirror(), 0.8), 60),
        (
            mix(
                glass(1.3),
                mix(uber([1.0, 0.0, 0.0, 0.0], 0.5), glass(1.7), 0.5),
                0.5,
            ),
            60,
        ),
        (sheet, 60),
    ] {
        let mut scene = empty();
        scene.camera.fov = 40.0;
        scene.lights.push(sky(1.0));
        add(
            &mut scene,
            sphere(Vec3::new(0.1, 0.2, 4.0), 1.0),
            material.clone(),
        );
        scene.integrator = path(depth);
        near(
            mean(&picture(&scene, 64)),
            1.0,
            0.01,
            &format!("{material:?}"),
        );
    }
}

/// `directlighting` follows delta lobes beside others: a pane of opacity o over a lit floor.
#[test]
fn panes_let_their_share_through() {
    for integrator in [path(5), direct(5)] {
        let mut scene = empty();
        scene.integrator = integrator;
        // A wall that shines, behind a pane that is lit by nothing else.
        let wall = add(&mut scene, floor(3.0), matte(0.0));
        wall.area_light = emission(2.0);
        add(&mut scene, square(2.0, 1.0), uber([0.0; 4], 0.3));
        near(mean(&picture(&scene, 4)), 0.7 * 2.0, 1e-4, "through");
        // A pane that is mostly a mirror, with a lamp behind the camera.
        let behind = quad(Vec3::new(-5.0, -5.0, -3.0), Vec3::X * 10.0, Vec3::Y * 10.0);
        add(&mut scene, behind, matte(0.0)).area_light = emission(1.0);
        scene.shapes[1].material = scene.materials.len();
        scene.materials.push(mix(
            uber([0.0; 4], 0.0),
            Material::Mirror(Mirror { kr: grey(1.0) }),
            0.25,
        ));
        let found = mean(&picture(&scene, 256));
        near(found, 0.25 * 2.0 + 0.75, 0.01, &format!("{integrator:?}"));
    }
}

/// Direct light on materials without delta lobes does not depend on the integrator.
#[test]
fn integrators_agree_on_layered_materials() {
    let rough = || [0.3.into(), 0.1.into()];
    let materials = [
        Material::Metal(Metal {
            eta: Rgb::new(0.2, 0.9, 1.1).into(),
            k: Rgb::new(3.9, 2.5, 2.1).into(),
            roughness: rough(),
            remap_roughness: true,
        }),
        Material::Substrate(Substrate {
            kd: grey(0.5),
            ks: grey(0.3),
            roughness: rough(),
            remap_roughness: true,
        }),
        Material::Translucent(Translucent {
            kd: grey(0.5),
            ks: grey(0.5),
            reflect: grey(0.5),
            transmit: grey(0.5),
            roughness: 0.3.into(),
            remap_roughness: false,
        }),
        uber([0.3, 0.3, 0.0, 0.0], 1.0),
    ];
    for material in materials {
        let mut scene = empty();
        scene.camera = look(Vec3::new(0.0, -4.0, 1.0), Vec3::new(0.0, 0.0, 2.5), 60.0);
        add(&mut scene, floor(3.0), material.clone());
        add(
            &mut scene,
            sphere(Vec3::new(0.5, 0.0, 2.0), 0.7),
            material.clone(),
        );
        add(
            &mut scene,
            cube(Vec3::new(-1.0, -1.0, 0.5), 0.4),
            matte(0.1),
        )
        .area_light = emission(4.0);
        scene.lights = vec![sky(0.3)];
        let means = [(path(1), 256), (direct(1), 64)].map(|(integrator, spp)| {
            scene.integrator = integrator;
            mean(&picture(&scene, spp))
        });
        near(means[1], means[0], 0.01, &format!("{material:?}"));
    }
}

/// Surfaces that are not there are seen through and cast a shadow; only `path` sees them shine. As in pbrt-v3.
#[test]
fn absent_surfaces() {
    let world = |integrator| {
        let mut scene = empty();
        scene.integrator = integrator;
        let wall = add(&mut scene, floor(3.0), matte(0.0));
        wall.area_light = emission(2.0);
        for height in [1.0, 1.5, 2.0] {
            add(&mut scene, square(height, 10.0), Material::None);
        }
        scene
    };
    for integrator in [path(1), direct(1)] {
        near(
            mean(&picture(&world(integrator), 1)),
            2.0,
            0.0,
            "seen through",
        );
        // Only the emission of the last point of a path is used.
        let mut ends = world(integrator);
        if let Integrator::Path { max_depth, .. } = &mut ends.integrator {
            *max_depth = 0;
            near(mean(&picture(&ends, 1)), 0.0, 0.0, "the end of a path");
        }
        let mut shining = world(integrator);
        shining.shapes[1].area_light = emission(0.5);
        let expected = if let Integrator::Path { .. } = integrator {
            2.5
        } else {
            2.0
        };
        near(mean(&picture(&shining, 1)), expected, 0.0, "shining");
    }
    let occlusion = Integrator::AmbientOcclusion {
        samples: 16,
        cosine_sampling: true,
        distance: f32::INFINITY,
        open: std::f32::consts::PI,
    };
    let mut scene = world(occlusion);
    let found = mean(&picture(&scene, 4));
    assert!(found < 0.2, "the floor is seen, and it is covered: {found}");
    scene.shapes.truncate(1);
    near(
        mean(&picture(&scene, 4)),
        std::f64::consts::PI,
        0.01,
        "open",
    );

    // A floor under a surface that is not there gets nothing from the sky, however the sky is sampled.
    for integrator in [path(1), path(3), direct(1)] {
        let mut scene = empty();
        scene.integrator = integrator;
        scene.lights.push(sky(1.0));
        scene.camera = look(Vec3::ZERO, Vec3::Z, 0.5);
        add(&mut scene, floor(3.0), matte(0.5));
        add(&mut scene, cube(Vec3::Z * 3.0, 2.0), Material::None);
        near(mean(&picture(&scene, 16)), 0.0, 0.0, "covered");
    }
}

/// A far floor has the mean of its texture in every pixel, with one sample: that is what filtering is for.
#[test]
fn camera_rays_filter_textures() {
    let noise = |i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8;
    let texels: Vec<u8> = (0..64 * 64).map(noise).collect();
    let mean_texel =
        texels.iter().map(|&t| f64::from(t)).sum::<f64>() / texels.len() as f64 / 255.0;
    let board = Texture::Checkerboard {
        squares: [grey(0.2), grey(0.6)],
        mapping: Mapping::Uv {
            scale: Vec2::splat(300.0),
            offset: Vec2::ZERO,
        },
        smooth: true,
    };
    for (texture, expected) in [
        (
            picture_of(Pixels::Grey8(texels.clone()), 64, EWA),
            mean_texel,
        ),
        (
            picture_of(Pixels::Grey8(texels), 64, TextureFilter::Trilinear),
            mean_texel,
        ),
        (board, 0.4),
    ] {
        let mut scene = empty();
        scene.lights.push(sky(1.0));
        scene.camera.fov = 30.0;
        let matte = Material::Matte(Matte {
            kd: Param::Texture(Arc::new(texture)),
            sigma: 0.0.into(),
        });
        // Each of 16 x 16 pixels sees a 16th of the texture or more, but one sample would see a texel.
        add(&mut scene, square(2.0, 0.6), matte);
        for integrator in [path(1), direct(1)] {
            scene.integrator = integrator;
            let one = picture(&scene, 1);
            let many = picture(&scene, 256);
            near(mean(&one), expected, 0.1, "one sample");
            near(mean(&many), expected, 0.03, "many");
        }
    }
}

/// Everything at once, from two cameras: the same bits on one thread and on three.
#[test]
fn threads_do_not_matter() {
    let scene = everything();
    let world = World::new(&scene).expect("a valid scene");
    let on = |threads| {
        let options = Options {
            spp: Some(5),
            threads: NonZeroUsize::new(threads),
            ..Options::default()
        };
        render(&world, &options, &()).expect("nothing stops it")
    };
    let (one, three) = (on(1), on(3));
    assert_eq!(one.stats.dropped_samples, 0);
    for (a, b) in one.image.pixels().iter().zip(three.image.pixels()) {
        assert_eq!(a.map(f32::to_bits), b.map(f32::to_bits));
    }
}

/// A textured, bumped, absent, mixed and mapped scene.
fn everything() -> Scene {
    let mut scene = empty();
    scene.camera = look(Vec3::new(0.0, -3.0, -2.0), Vec3::new(0.0, 0.0, 2.0), 60.0);
    scene.lights = vec![sky(0.5)];
    let colors = (0..35).map(|i| [i as u8 * 7, 255 - i as u8, 128]).collect();
    let image = Arc::new(picture_of(Pixels::Rgb8(colors), 7, EWA));
    let kd = || Param::Texture(Arc::clone(&image));
    let textured = Material::Matte(Matte {
        kd: kd(),
        sigma: 10.0.into(),
    });
    let height = Param::Texture(Arc::new(Texture::Checkerboard {
        squares: [0.0.into(), 0.01.into()],
        mapping: Mapping::Spherical {
            texture_from_world: glam::DMat4::from_scale(glam::DVec3::splat(2.0)),
        },
        smooth: true,
    }));
    let bumped = Material::Bumped(Bumped {
        material: Arc::new(uber([0.3, 0.2, 0.2, 0.2], 0.6)),
        height,
    });
    let blend = Material::Substrate(Substrate {
        kd: kd(),
        ks: kd(),
        roughness: [0.1.into(), 0.3.into()],
        remap_roughness: true,
    });
    add(&mut scene, square(3.0, 4.0), textured.clone());
    add(
        &mut scene,
        sphere(Vec3::new(-1.0, 0.0, 2.0), 0.7),
        bumped.clone(),
    );
    add(
        &mut scene,
        sphere(Vec3::new(1.0, 0.0, 2.0), 0.7),
        mix(blend, bumped, 0.5),
    );
    add(
        &mut scene,
        cube(Vec3::new(0.0, 0.0, 1.0), 0.3),
        Material::None,
    );
    let lamp = quad(Vec3::new(-1.0, -3.0, -1.0), Vec3::X, Vec3::Z);
    add(&mut scene, lamp, textured).area_light = emission(10.0);
    scene
}
