//! Varying materials against constant ones, and bumps against the normals of the surface that they stand for.

use std::sync::Arc;

use antumbra_scene::material::{
    Bumped, Glass, Matte, Metal, Mix, NormalMapped, Plastic, Substrate, Translucent, Uber,
};
use antumbra_scene::{
    Geometry, Mapping, Material as Scene, Param, Rgb, Shape, Texture, TriangleMesh,
};

use super::*;
use crate::sampler::warp::uniform_sphere;
use crate::sampler::{Method, Sampler};

/// A square in the plane z = 0 with its normal up, u along x and v along y.
fn square(normals: bool) -> Shapes {
    Shapes::of_world(&[square_shape(normals)])
}

fn square_shape(normals: bool) -> Shape {
    let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
    Shape {
        geometry: Geometry::Mesh(Arc::new(TriangleMesh {
            positions: corners.map(|[x, y]| [x, y, 0.0]).to_vec(),
            indices: vec![[0, 1, 2], [0, 2, 3]],
            normals: if normals {
                vec![Vec3::Z; 4]
            } else {
                Vec::new()
            },
            uvs: corners.map(|[x, y]| glam::Vec2::new(x, y)).to_vec(),
            colors: Vec::new(),
        })),
        material: 0,
        area_light: None,
        media: None,
        alpha: None,
        shadow_alpha: None,
        reverse_orientation: false,
        transform_swaps_handedness: false,
    }
}

fn shade(material: &Scene, shapes: &Shapes) -> (Bsdf, Frame) {
    let ray = Ray::new([1.5, 0.5, 1.0], [0.0, 0.0, -1.0]);
    let hit = Hit {
        t: 1.0,
        u: 0.5,
        v: 0.25,
        prim_id: 0,
        geom_id: 0,
        inst_id: antumbra::INVALID_ID,
    };
    let surface = Surface::found(shapes, &ray, &hit);
    match Material::new(material, &mut Textures::default()) {
        Material::Varying(varying) => varying.shade(shapes, &surface, &hit, None),
        Material::Constant(bsdf) => (*bsdf, Frame::around(surface.shading_normal)),
        Material::None => panic!("it has a surface"),
    }
}

/// A constant value, as a texture that lowering does not recognize as constant.
fn hidden<T: Copy>(value: T) -> Param<T> {
    // Two halves of the value: no bit is lost.
    Param::Texture(Arc::new(Texture::Mix {
        ends: [Param::Constant(value), Param::Constant(value)],
        amount: 0.5.into(),
    }))
}

fn rgb(value: f32) -> Rgb {
    Rgb::new(value, 0.5 * value, 0.1)
}

#[test]
fn parameters_from_textures_are_parameters() {
    let color = |textured: bool, value: f32| match textured {
        true => hidden(rgb(value)),
        false => Param::Constant(rgb(value)),
    };
    let number = |textured: bool, value: f32| match textured {
        true => hidden(value),
        false => Param::Constant(value),
    };
    let materials = |t: bool| {
        let roughness = || [number(t, 0.3), number(t, 0.2)];
        let metal = Scene::Metal(Metal {
            eta: color(t, 0.9),
            k: color(t, 2.0),
            roughness: roughness(),
            remap_roughness: true,
        });
        let matte = Scene::Matte(Matte {
            kd: color(t, 0.5),
            sigma: number(t, 10.0),
        });
        vec![
            matte.clone(),
            metal.clone(),
            Scene::Plastic(Plastic {
                kd: color(t, 0.4),
                ks: color(t, 0.3),
                roughness: number(t, 0.1),
                remap_roughness: true,
            }),
            Scene::Glass(Glass {
                kr: color(t, 0.9),
                kt: color(t, 0.8),
                eta: number(t, 1.4),
                roughness: roughness(),
                remap_roughness: false,
            }),
            Scene::Uber(Uber {
                kd: color(t, 0.1),
                ks: color(t, 0.2),
                kr: color(t, 0.3),
                kt: color(t, 0.4),
                roughness: roughness(),
                opacity: color(t, 0.8),
                eta: number(t, 1.2),
                remap_roughness: true,
            }),
            Scene::Substrate(Substrate {
                kd: color(t, 0.5),
                ks: color(t, 0.25),
                roughness: roughness(),
                remap_roughness: true,
            }),
            Scene::Translucent(Translucent {
                kd: color(t, 0.5),
                ks: color(t, 0.25),
                reflect: color(t, 0.4),
                transmit: color(t, 0.6),
                roughness: number(t, 0.3),
                remap_roughness: true,
            }),
            Scene::Mix(Mix {
                materials: [Arc::new(matte), Arc::new(metal)],
                amount: color(t, 0.3),
            }),
        ]
    };
    let sampler = Sampler::new(Method::Independent, 5);
    for (constant, varying) in materials(false).iter().zip(materials(true)) {
        let shapes = square(false);
        let [one, other] = [constant, &varying].map(|material| shade(material, &shapes).0);
        assert_eq!(one.delta_share(), other.delta_share());
        assert_eq!(one.is_anisotropic(), other.is_anisotropic());
        let mut seen = 0.0;
        for i in 0..200 {
            let stream = sampler.stream(0, 0, i);
            let [wo, wi] = [0, 1].map(|d| uniform_sphere(stream.pair(d)));
            let [one, other] = [&one, &other].map(|b| b.evaluate(wo, wi, wo.z * wi.z > 0.0));
            let error = (one.value - other.value).length() + (one.pdf - other.pdf).abs();
            assert!(
                error <= 1e-4 * (one.value.length() + one.pdf),
                "{constant:?}"
            );
            seen += one.value.length();
        }
        assert!(seen > 0.0, "{constant:?}");
    }
}

/// A height of a u + b v is a plane tilted by (a, b): its normal is known.
#[test]
fn bumps_tilt_the_frame() {
    let (a, b) = (0.3, -0.2);
    // Bilinear between the corners of the unit square, also beyond.
    let corners = [0.0, b, a, a + b];
    let mapping = Mapping::default();
    let height = Param::Texture(Arc::new(Texture::Bilerp { corners, mapping }));
    let matte = Arc::new(Scene::Matte(Matte {
        kd: rgb(0.5).into(),
        sigma: 0.0.into(),
    }));
    let bumped = Scene::Bumped(Bumped {
        material: Arc::clone(&matte),
        height: height.clone(),
    });
    let mixed = |first: &Scene, second: &Scene| {
        Scene::Mix(Mix {
            materials: [first.clone(), second.clone()].map(Arc::new),
            amount: Rgb::splat(0.5).into(),
        })
    };
    let expected = Vec3::new(-a, -b, 1.0).normalize();
    for (material, normals, expected) in [
        (bumped.clone(), false, expected),
        (mixed(&bumped, &matte), false, expected),
        (mixed(&matte, &bumped), false, Vec3::Z),
        // pbrt-v3 turns the tangents of meshes with normals round, and with them the bumps.
        (bumped.clone(), true, Vec3::new(a, b, 1.0).normalize()),
    ] {
        let (_, frame) = shade(&material, &square(normals));
        let found = frame.to_world(Vec3::Z);
        assert!((found - expected).length() < 1e-3, "{found} {expected}");
    }
    // Seen from a surface whose normal points down, the bumps go down.
    let mut shape = square_shape(false);
    shape.reverse_orientation = true;
    let (_, frame) = shade(&bumped, &Shapes::of_world(&[shape]));
    let found = frame.to_world(Vec3::Z);
    assert!(
        (found - Vec3::new(-a, -b, -1.0).normalize()).length() < 1e-3,
        "{found}"
    );
}

#[test]
fn what_does_not_vary_is_lowered_once() {
    let mut textures = Textures::default();
    let mut new = |material: &Scene| Material::new(material, &mut textures);
    let matte = |kd| {
        Scene::Matte(Matte {
            kd,
            sigma: 0.0.into(),
        })
    };
    assert!(matches!(new(&Scene::None), Material::None));
    let plain = matte(rgb(0.5).into());
    assert!(matches!(new(&plain), Material::Constant(_)));
    let flat = Scene::Bumped(Bumped {
        material: Arc::new(plain),
        height: 0.5.into(),
    });
    assert!(matches!(new(&flat), Material::Constant(_)));
    assert!(matches!(
        new(&matte(hidden(rgb(0.5)))),
        Material::Varying(_)
    ));
}

/// A normal map gives the normal that its colour stands for, along u, v and the surface's normal.
#[test]
fn normal_maps_tilt_the_normal() {
    for normals in [false, true] {
        let shapes = square(normals);
        for (color, scale, expected) in [
            ([0.5, 0.5, 1.0], 1.0, [0.0, 0.0, 1.0]),
            ([0.8, 0.5, 0.9], 1.0, [0.6, 0.0, 0.8]),
            ([0.5, 0.2, 0.9], 1.0, [0.0, -0.6, 0.8]),
            ([0.8, 0.5, 0.9], 0.5, [0.3, 0.0, 0.8]),
        ] {
            let mapped = Scene::NormalMapped(NormalMapped {
                material: Arc::new(Scene::Matte(Matte {
                    kd: rgb(0.5).into(),
                    sigma: 0.0.into(),
                })),
                normal: hidden(Rgb::from(color)),
                scale,
            });
            let (_, frame) = shade(&mapped, &shapes);
            let found = frame.to_world(Vec3::Z);
            let expected = Vec3::from(expected).normalize();
            assert!((found - expected).length() < 1e-5, "{found} {expected}");
        }
    }
}
