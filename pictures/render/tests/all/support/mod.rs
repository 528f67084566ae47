//! Small scenes for the tests.

pub mod heap;

use std::sync::Arc;

use antumbra_render::{Options, Rendering, World, render};
use antumbra_scene::material::{Glass, Matte};
use antumbra_scene::{
    AreaLight, Camera, Film, Geometry, Integrator, Light, LightStrategy, Material, Param, Rgb,
    Sampler, SamplerKind, Scene, Shape, Sphere, TriangleMesh,
};
use glam::{Mat4, Vec3};

/// An empty scene, seen from the origin along z through a narrow lens. All pixels see nearly one point.
pub fn empty() -> Scene {
    Scene {
        name: "test".into(),
        shapes: Vec::new(),
        objects: Vec::new(),
        instances: Vec::new(),
        materials: Vec::new(),
        media: Vec::new(),
        lights: Vec::new(),
        camera: Camera {
            fov: 0.5,
            ..Camera::default()
        },
        film: Film {
            resolution: [16, 16],
            ..Film::default()
        },
        sampler: Sampler {
            kind: SamplerKind::Sobol,
            pixel_samples: 64,
        },
        integrator: Integrator::Path {
            max_depth: 5,
            rr_threshold: 1.0,
            light_strategy: LightStrategy::Spatial,
        },
        accelerator: Default::default(),
        origin: Default::default(),
    }
}

/// A camera at `from` that looks at `to`.
pub fn look(from: Vec3, to: Vec3, fov: f32) -> Camera {
    let z = (to - from).normalize();
    let x = z.any_orthonormal_vector();
    let y = z.cross(x);
    Camera {
        world_from_camera: Mat4::from_cols(
            x.extend(0.0),
            y.extend(0.0),
            z.extend(0.0),
            from.extend(1.0),
        ),
        fov,
        ..Camera::default()
    }
}

/// Adds a shape of its own material; returns it for changes.
pub fn add(scene: &mut Scene, geometry: Geometry, material: Material) -> &mut Shape {
    scene.materials.push(material);
    scene.shapes.push(Shape {
        geometry,
        material: scene.materials.len() - 1,
        area_light: None,
        media: None,
        alpha: None,
        shadow_alpha: None,
        reverse_orientation: false,
        transform_swaps_handedness: false,
    });
    scene.shapes.last_mut().expect("just added")
}

/// A parallelogram with normal `u x v`.
pub fn quad(corner: Vec3, u: Vec3, v: Vec3) -> Geometry {
    let positions = [corner, corner + u, corner + u + v, corner + v];
    Geometry::Mesh(Arc::new(TriangleMesh {
        positions: positions.map(|p| p.to_array()).to_vec(),
        indices: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    }))
}

/// A cube of half-width 1 around `center`, triangles facing outward.
pub fn cube(center: Vec3, half: f32) -> Geometry {
    let positions = (0..8)
        .map(|i| {
            let sign = |bit: usize| if i >> bit & 1 == 1 { half } else { -half };
            (center + Vec3::new(sign(0), sign(1), sign(2))).to_array()
        })
        .collect();
    let faces = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    Geometry::Mesh(Arc::new(TriangleMesh {
        positions,
        indices: faces
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect(),
        ..TriangleMesh::default()
    }))
}

/// A sphere.
pub fn sphere(center: Vec3, radius: f32) -> Geometry {
    Geometry::Sphere(Sphere::new(center, radius))
}

/// A floor at z = `height` that faces the origin from beyond it: normal (0, 0, -1).
pub fn floor(height: f32) -> Geometry {
    quad(
        Vec3::new(-100.0, -100.0, height),
        Vec3::Y * 200.0,
        Vec3::X * 200.0,
    )
}

/// A Lambertian material.
pub fn matte(reflectance: f32) -> Material {
    Material::Matte(Matte {
        kd: Rgb::splat(reflectance).into(),
        sigma: 0.0.into(),
    })
}

/// Smooth glass that loses nothing.
pub fn glass(eta: f32) -> Material {
    Material::Glass(Glass {
        kr: Rgb::ONE.into(),
        kt: Rgb::ONE.into(),
        eta: eta.into(),
        roughness: [0.0, 0.0].map(Param::Constant),
        remap_roughness: true,
    })
}

/// A one-sided area light.
pub fn emission(radiance: f32) -> Option<AreaLight> {
    Some(AreaLight {
        radiance: Rgb::splat(radiance),
        texture: None,
        two_sided: false,
        samples: 1,
    })
}

/// A sky of one grey.
pub fn sky(radiance: f32) -> Light {
    Light::Infinite {
        radiance: Rgb::splat(radiance),
        environment: None,
        samples: 1,
    }
}

/// Renders with options that only name the samples.
pub fn picture(scene: &Scene, spp: u32) -> Rendering {
    picture_with(
        scene,
        &Options {
            spp: Some(spp),
            standard_error: true,
            ..Options::default()
        },
    )
}

/// Renders a valid scene.
pub fn picture_with(scene: &Scene, options: &Options) -> Rendering {
    let world = World::new(scene).expect("a valid scene");
    render(&world, options, &()).expect("nothing stops it")
}

/// Mean of the first channel.
pub fn mean(rendering: &Rendering) -> f64 {
    assert_eq!(rendering.stats.dropped_samples, 0);
    rendering.image.mean()[0]
}

/// Fails unless `found` is within `relative` of `expected`.
#[track_caller]
pub fn near(found: f64, expected: f64, relative: f64, what: &str) {
    assert!(
        (found - expected).abs() <= relative * expected.abs().max(1e-3),
        "{what}: found {found}, expected {expected}"
    );
}

/// Mean of the first channel and its standard error, were all samples independent.
pub fn estimate(rendering: &Rendering) -> (f64, f64) {
    let errors = rendering.standard_error.as_ref().expect("asked for");
    let pixels = errors.pixels();
    let count = errors.window().area() as f64;
    let squares: f64 = pixels.iter().map(|pixel| f64::from(pixel[0]).powi(2)).sum();
    (mean(rendering), squares.sqrt() / count)
}

/// Fails unless two estimates agree within four standard errors of their difference.
#[track_caller]
pub fn agree(a: (f64, f64), b: (f64, f64), what: &str) {
    let deviation = (a.0 - b.0) / a.1.hypot(b.1);
    assert!(
        deviation.abs() < 4.0,
        "{what}: {a:?} {b:?}, {deviation} standard errors"
    );
}
