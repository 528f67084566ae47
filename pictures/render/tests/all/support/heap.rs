//! A scene with a little of everything, for tests that hold for any scene.

use std::sync::Arc;

use antumbra_render::Options;
use antumbra_scene::material::{
    Bumped, Glass, Matte, Metal, Mirror, Mix, Plastic, Substrate, Translucent, Uber,
};
use antumbra_scene::{
    Geometry, Light, Mapping, Material, Param, Rgb, Scene, Texture, TriangleMesh,
};
use glam::Vec3;

use super::*;

/// Numbers in -1..1, equal on every machine.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }
}

/// A heap of triangles of every material, with vertex normals on some, lit by everything.
pub fn heap(seed: u64) -> Scene {
    println!("seed {seed}");
    let mut numbers = Numbers(seed);
    let mut scene = empty();
    scene.camera = look(Vec3::new(0.0, 0.0, -6.0), Vec3::ZERO, 35.0);
    scene.film.resolution = [40, 27];
    let plastic = Material::Plastic(Plastic {
        kd: Rgb::splat(0.3).into(),
        ks: Rgb::splat(0.3).into(),
        roughness: 0.1.into(),
        remap_roughness: true,
    });
    let rough = Material::Glass(Glass {
        kr: Rgb::ONE.into(),
        kt: Rgb::splat(0.9).into(),
        eta: 1.5.into(),
        roughness: [0.2, 0.1].map(Param::Constant),
        remap_roughness: false,
    });
    let mirror = Material::Mirror(Mirror {
        kr: Rgb::splat(0.9).into(),
    });
    let oren_nayar = Material::Matte(Matte {
        kd: Rgb::new(0.2, 0.5, 0.8).into(),
        sigma: 20.0.into(),
    });
    let mut materials = vec![matte(0.6), oren_nayar, plastic, rough, mirror, glass(1.3)];
    materials.extend(layered());
    for material in materials {
        let mut mesh = TriangleMesh::default();
        for triangle in 0..60 {
            let center = numbers.vector() * 2.0;
            for _ in 0..3 {
                mesh.positions
                    .push((center + numbers.vector() * 0.4).to_array());
                mesh.normals.push(numbers.vector().normalize());
            }
            mesh.indices
                .push([0, 1, 2].map(|corner| 3 * triangle + corner));
        }
        if matches!(material, Material::Plastic(_) | Material::Mirror(_)) {
            mesh.normals.clear();
        }
        add(&mut scene, Geometry::Mesh(Arc::new(mesh)), material);
    }
    add(&mut scene, floor(3.0), matte(0.5));
    let lamp = quad(Vec3::new(-1.0, 3.0, -1.0), Vec3::X, Vec3::Z);
    add(&mut scene, lamp, matte(0.0)).area_light = emission(20.0);
    add(
        &mut scene,
        sphere(Vec3::new(2.0, -2.0, 0.0), 0.5),
        matte(0.2),
    )
    .area_light = emission(5.0);
    scene.lights = vec![
        sky(0.2),
        Light::Point {
            position: Vec3::new(0.0, 0.0, -5.0),
            intensity: Rgb::splat(4.0),
        },
    ];
    scene
}

/// Materials whose lobes are side by side, and one that is not there.
fn layered() -> [Material; 5] {
    let grey = |value: f32| Param::Constant(Rgb::splat(value));
    let roughness = [0.1, 0.3].map(Param::Constant);
    let metal = Material::Metal(Metal {
        eta: Rgb::new(0.2, 0.9, 1.1).into(),
        k: Rgb::new(3.9, 2.5, 2.1).into(),
        roughness: roughness.clone(),
        remap_roughness: true,
    });
    let uber = Material::Uber(Uber {
        kd: grey(0.3),
        ks: grey(0.2),
        kr: grey(0.2),
        kt: grey(0.3),
        roughness: roughness.clone(),
        opacity: grey(0.6),
        eta: 1.4.into(),
        remap_roughness: true,
    });
    let substrate = Material::Substrate(Substrate {
        kd: grey(0.4),
        ks: grey(0.3),
        roughness,
        remap_roughness: true,
    });
    let translucent = Material::Translucent(Translucent {
        kd: grey(0.4),
        ks: grey(0.3),
        reflect: grey(0.5),
        transmit: grey(0.5),
        roughness: 0.2.into(),
        remap_roughness: true,
    });
    let mixed = Material::Mix(Mix {
        materials: [metal, translucent].map(Arc::new),
        amount: grey(0.3),
    });
    // `materials.rs` tests other textures.
    let bumped = Material::Bumped(Bumped {
        material: Arc::new(substrate.clone()),
        height: Param::Texture(Arc::new(Texture::Bilerp {
            corners: [0.0, 0.1, 0.0, 0.3],
            mapping: Mapping::default(),
        })),
    });
    [uber, substrate, mixed, bumped, Material::None]
}

/// Few samples.
pub fn options() -> Options {
    Options {
        spp: Some(9),
        ..Options::default()
    }
}
