//! Scenes outside the repository, if they are present.

use std::collections::HashSet;
use std::sync::Arc;

use antumbra_pbrt::load;
use antumbra_scene::{Error, Geometry, Image, Param, Pixels, Shape, Texture};
use glam::Vec3;

use super::{OPTIONS, shared};

fn triangles(shapes: &[Shape], of_lights: bool) -> usize {
    shapes
        .iter()
        .filter(|shape| shape.area_light.is_some() == of_lights)
        .map(|shape| match &shape.geometry {
            Geometry::Mesh(mesh) => mesh.indices.len(),
            Geometry::Sphere(_) | Geometry::Curves(_) => 0,
        })
        .sum()
}

#[test]
fn scenes_without_instances_load_whole() {
    // Triangles and light triangles; eye and target as the files give them.
    for (name, surfaces, lights, eye, target) in [
        ("sponza", 66_453, 2, [12.0, -1.0, 7.0], [-4.0, 0.2, 1.5]),
        ("sibenik", 75_273, 4, [20.0, 0.0, 10.0], [0.0, 0.0, 4.0]),
        ("bathroom", 444_412, 32, [0.0, 23.0, 30.0], [10.2, 5.0, 0.0]),
        (
            "microcity",
            30_072,
            2,
            [1.42702, -3.30238, 1.79759],
            [-0.023598, 9.69691, -4.68208],
        ),
    ] {
        let Some(path) = shared(&format!("scenes/{name}/{name}.pbrt")) else {
            return;
        };
        let loaded = match load(&path, &OPTIONS) {
            Ok(loaded) => loaded,
            Err(error) => panic!("{error}"),
        };
        let scene = loaded.scene;
        assert!(loaded.notes.is_empty(), "{:?}", loaded.notes);
        assert_eq!(scene.name, name);
        assert_eq!(triangles(&scene.shapes, false), surfaces, "{name}");
        assert_eq!(triangles(&scene.shapes, true), lights, "{name}");
        assert!(
            scene
                .shapes
                .iter()
                .all(|s| s.material < scene.materials.len())
        );
        let m = scene.camera.world_from_camera;
        let (eye, target) = (Vec3::from(eye), Vec3::from(target));
        assert!(
            (m.transform_point3(Vec3::ZERO) - eye).length() < 1e-4,
            "{name}"
        );
        let forward = (target - eye).normalize();
        assert!(
            (m.transform_vector3(Vec3::Z) - forward).length() < 1e-5,
            "{name}"
        );
        // pbrt's camera space is left-handed; Scale -1 1 1 makes it right-handed.
        let is_mirrored = name != "bathroom";
        assert_eq!(m.determinant() > 0.0, !is_mirrored, "{name}");
    }
}

#[test]
fn scenes_with_instances_load_whole() {
    // Triangles in memory and triangles in the world, both without triangles of lights, then objects and instances.
    for (name, stored, standing, lights, objects, instances) in [
        ("scans", 589_654, 11_595_496, 8, 4, 77),
        ("ingolstadt", 182_737, 3_837_437, 2, 1, 21),
        ("buddha-fractal", 29_892, 754_722_502, 2, 1, 25_250),
        ("pavilion", 204_606, 3_317_226, 2, 1, 43),
        ("ecosys", 475_784, 38_932_329, 2, 18, 4_817),
        ("sanmiguel", 1_850_797, 9_567_631, 2, 421, 9_121),
    ] {
        let Some(path) = shared(&format!("scenes/{name}/{name}.pbrt")) else {
            return;
        };
        let loaded = match load(&path, &OPTIONS) {
            Ok(loaded) => loaded,
            Err(error) => panic!("{error}"),
        };
        assert!(loaded.notes.is_empty(), "{:?}", loaded.notes);
        let scene = loaded.scene;
        assert_eq!(triangles(&scene.shapes, true), lights, "{name}");
        assert_eq!(scene.stored_triangle_count(), stored + lights, "{name}");
        assert_eq!(scene.triangle_count(), standing + lights, "{name}");
        let found = (scene.objects.len(), scene.instances.len());
        assert_eq!(found, (objects, instances), "{name}");
        let count = standing + lights;
        match scene.flattened() {
            Ok(flat) => assert_eq!(flat.triangle_count(), count, "{name}"),
            Err(Error::TooLarge { triangles, .. }) => {
                assert_eq!((name, triangles), ("buddha-fractal", count as u64));
            }
            Err(error) => panic!("{name}: {error}"),
        }
    }
}

#[test]
fn cut_out_leaves_share_their_masks() {
    // Meshes in memory with alpha masks, and the masks.
    for (name, cut_out, masks) in [
        ("pavilion", 1, 1),
        ("ecosys", 36, 33),
        ("sanmiguel", 175, 76),
    ] {
        let Some(path) = shared(&format!("scenes/{name}/{name}.pbrt")) else {
            return;
        };
        let scene = load(&path, &OPTIONS).unwrap().scene;
        let of_objects = scene.objects.iter().flat_map(|object| &object.shapes);
        let shapes = scene.shapes.iter().chain(of_objects);
        let images: Vec<&Arc<Image>> = shapes
            .filter_map(|shape| shape.alpha.as_ref())
            .map(|alpha| match alpha {
                Param::Texture(texture) => match &**texture {
                    Texture::Image(texture) => &texture.image,
                    other => panic!("{other:?}"),
                },
                Param::Constant(value) => panic!("{value}"),
            })
            .collect();
        let distinct: HashSet<_> = images.iter().map(|image| Arc::as_ptr(image)).collect();
        assert_eq!((images.len(), distinct.len()), (cut_out, masks), "{name}");
        for image in images {
            // The masks are black and white.
            let Pixels::Grey8(values) = &image.pixels else {
                panic!("{image:?}")
            };
            assert_eq!(values.len(), (image.width * image.height) as usize);
            assert!(values.iter().all(|v| [0, 255].contains(v)), "{image:?}");
            assert!(values.contains(&0) && values.contains(&255), "{image:?}");
        }
    }
}
