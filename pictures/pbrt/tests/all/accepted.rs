//! Valid files, and the scene of each.

use std::path::Path;

use antumbra_pbrt::{Options, Severity, parse};
use antumbra_scene::material::{Glass, Hair, Matte, Mirror, Plastic};
use antumbra_scene::{
    Accelerator, DirectStrategy, Filter, Geometry, Integrator, Light, LightStrategy, Material,
    Pigment, Projection, Rgb, SamplerKind, Shape, TriangleMesh,
};
use glam::{Mat4, Vec3};

use super::{load_files, load_text, scene, tolerated, world};

const TRIANGLE: &str =
    r#"Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0 0 0 1 0 0 0 1 0] "#;

fn mesh(shape: &Shape) -> &TriangleMesh {
    match &shape.geometry {
        Geometry::Mesh(mesh) => mesh,
        other => panic!("{other:?} is not a mesh"),
    }
}

fn assert_near(a: Vec3, b: Vec3) {
    assert!((a - b).abs().max_element() < 1e-5, "{a} is not {b}");
}

#[test]
fn an_empty_world_has_the_defaults_of_pbrt() {
    let scene = scene("WorldBegin WorldEnd");
    assert_eq!(scene.name, "scene");
    assert_eq!(scene.film.resolution, [1280, 720]);
    assert_eq!(scene.film.filter, Filter::Box { radius: [0.5, 0.5] });
    assert_eq!(scene.film.max_sample_luminance, f32::INFINITY);
    assert_eq!(scene.sampler.kind, SamplerKind::Halton);
    assert_eq!(scene.sampler.pixel_samples, 16);
    assert_eq!(
        scene.integrator,
        Integrator::Path {
            max_depth: 5,
            rr_threshold: 1.0,
            light_strategy: LightStrategy::Spatial
        }
    );
    assert_eq!(scene.camera.fov, 90.0);
    assert_eq!(scene.camera.world_from_camera, Mat4::IDENTITY);
    assert_eq!(scene.accelerator, Accelerator::default());
    assert!(scene.shapes.is_empty() && scene.materials.is_empty() && scene.lights.is_empty());
}

#[test]
fn options_are_read() {
    let scene = scene(
        r#"
        # every form of a number
        Camera "perspective" "float fov" +4.5e1 "float lensradius" .25 "float focaldistance" [5.]
            "float screenwindow" [-1 1 -0.5 .5] "float frameaspectratio" [2]
        Film "image" "integer xresolution" [4.0] "integer yresolution" 2 "float scale" 2
            "string filename" "a.exr" "float cropwindow" [0 .5 0 1] "float maxsampleluminance" 10
        PixelFilter "mitchell" "float xwidth" 3 "float B" .5
        Sampler "stratified" "integer xsamples" 3 "integer ysamples" 5 "bool jitter" true
        Integrator "directlighting" "string strategy" "one" "integer maxdepth" 7
        Accelerator "hbvh" "string order" "sort+"
        WorldBegin WorldEnd"#,
    );
    assert_eq!(scene.camera.fov, 45.0);
    assert_eq!(scene.camera.lens_radius, 0.25);
    assert_eq!(scene.camera.focal_distance, 5.0);
    assert_eq!(scene.camera.screen_window, Some([-1.0, 1.0, -0.5, 0.5]));
    assert_eq!(scene.camera.frame_aspect_ratio, Some(2.0));
    assert_eq!(scene.film.resolution, [4, 2]);
    assert_eq!(scene.film.pixel_bounds(), [0, 2, 0, 2]);
    assert_eq!(scene.film.scale, 2.0);
    assert_eq!(scene.film.max_sample_luminance, 10.0);
    assert_eq!(scene.film.file_name.as_deref(), Some("a.exr"));
    assert_eq!(
        scene.film.filter,
        Filter::Mitchell {
            radius: [3.0, 2.0],
            b: 0.5,
            c: 1.0 / 3.0
        }
    );
    assert_eq!(
        scene.sampler.kind,
        SamplerKind::Stratified {
            x: 3,
            y: 5,
            jitter: true
        }
    );
    assert_eq!(scene.sampler.pixel_samples, 15);
    assert_eq!(
        scene.integrator,
        Integrator::DirectLighting {
            strategy: DirectStrategy::One,
            max_depth: 7
        }
    );
    assert_eq!(
        scene.accelerator,
        Accelerator {
            width: Some(16),
            order: Some("sort+".into())
        }
    );
}

#[test]
fn every_filter_sampler_and_accelerator_of_pbrt_is_known() {
    for (name, filter) in [
        ("box", Filter::Box { radius: [0.5; 2] }),
        ("triangle", Filter::Triangle { radius: [2.0; 2] }),
        (
            "gaussian",
            Filter::Gaussian {
                radius: [2.0; 2],
                alpha: 2.0,
            },
        ),
        (
            "sinc",
            Filter::LanczosSinc {
                radius: [4.0; 2],
                tau: 3.0,
            },
        ),
    ] {
        let text = format!("PixelFilter \"{name}\" WorldBegin WorldEnd");
        assert_eq!(scene(&text).film.filter, filter, "{name}");
    }
    for (name, kind, samples) in [
        ("random", SamplerKind::Random, 4),
        (
            "stratified",
            SamplerKind::Stratified {
                x: 4,
                y: 4,
                jitter: true,
            },
            16,
        ),
        ("halton", SamplerKind::Halton, 16),
        ("sobol", SamplerKind::Sobol, 16),
        ("02sequence", SamplerKind::ZeroTwoSequence, 16),
        ("lowdiscrepancy", SamplerKind::ZeroTwoSequence, 16),
        ("maxmindist", SamplerKind::MaxMinDist, 16),
    ] {
        let sampler = scene(&format!("Sampler \"{name}\" WorldBegin WorldEnd")).sampler;
        assert_eq!(
            (sampler.kind, sampler.pixel_samples),
            (kind, samples),
            "{name}"
        );
    }
    for (name, width) in [
        ("qbvh", Some(4)),
        ("obvh", Some(8)),
        ("hbvh", Some(16)),
        ("bvh", None),
        ("kdtree", None),
    ] {
        let text = format!("Accelerator \"{name}\" WorldBegin WorldEnd");
        assert_eq!(scene(&text).accelerator.width, width, "{name}");
    }
    let ao = scene(r#"Integrator "ambientocclusion" WorldBegin WorldEnd"#).integrator;
    assert_eq!(
        ao,
        Integrator::AmbientOcclusion {
            samples: 64,
            cosine_sampling: true,
            distance: f32::INFINITY,
            open: std::f32::consts::PI,
        }
    );
}

#[test]
fn what_cannot_change_the_picture_is_noted() {
    let loaded = load_text(
        r#"Camera "perspective" "float shutteropen" 0
        Film "image" "float diagonal" 35
        Integrator "path"
        Accelerator "kdtree" "integer maxdepth" 3
        TransformTimes 0 1
        WorldBegin WorldEnd"#,
    )
    .unwrap();
    assert_eq!(loaded.notes.len(), 2, "{:?}", loaded.notes);
    assert!(loaded.notes.is_sorted_by_key(|note| note.line));
    assert!(loaded.notes[0].to_string().contains("note: \"diagonal\""));
}

#[test]
fn samplers_need_no_note() {
    for text in [
        "",
        "Sampler \"random\"",
        "Sampler \"stratified\" \"bool jitter\" \"false\"",
        "Sampler \"halton\"",
        "Sampler \"sobol\"",
        "Sampler \"02sequence\"",
        "Sampler \"maxmindist\"",
    ] {
        let loaded = load_text(&format!("{text} WorldBegin WorldEnd")).unwrap();
        assert_eq!(loaded.notes, [], "{text}");
    }
}

#[test]
fn unknown_accelerators_are_auto_and_noted() {
    let text = r#"Accelerator "grid" "integer cells" 3 "string order" "none" WorldBegin WorldEnd"#;
    let loaded = load_text(text).unwrap();
    assert_eq!(loaded.scene.accelerator, Accelerator::default());
    let [note] = &loaded.notes[..] else {
        panic!("{:?}", loaded.notes)
    };
    assert_eq!((note.line, note.column), (1, 13));
    let words =
        "\"grid\" is taken as auto, without its parameters; known: bvh, hbvh, kdtree, obvh, qbvh";
    assert!(note.message.contains(words), "{note}");
}

#[test]
fn the_sky_may_be_sampled_more_often() {
    for (text, expected) in [
        ("", 1),
        ("\"integer nsamples\" 3", 3),
        ("\"integer samples\" 4", 4),
        ("\"integer nsamples\" 3 \"integer samples\" 4", 4),
    ] {
        let text = format!("WorldBegin LightSource \"infinite\" {text} WorldEnd");
        let loaded = load_text(&text).unwrap();
        assert_eq!(loaded.notes, []);
        let [Light::Infinite { samples, .. }] = loaded.scene.lights[..] else {
            panic!("{:?}", loaded.scene.lights)
        };
        assert_eq!(samples, expected, "{text}");
    }
}

#[test]
fn the_camera_is_the_inverse_of_the_current_transformation() {
    // Looking along +y from (0, -10, 0) with z up; then Scale mirrors camera space in x.
    let plain = scene(r#"LookAt 0 -10 0 0 0 0 0 0 1 Camera "perspective" WorldBegin WorldEnd"#);
    let m = plain.camera.world_from_camera;
    assert_near(m.transform_point3(Vec3::ZERO), Vec3::new(0.0, -10.0, 0.0));
    assert_near(m.transform_vector3(Vec3::Z), Vec3::Y);
    assert_near(m.transform_vector3(Vec3::Y), Vec3::Z);
    assert_near(m.transform_vector3(Vec3::X), -Vec3::X);
    let mirrored = scene(
        r#"Scale -1 1 1 LookAt 0 -10 0 0 0 0 0 0 1 Camera "perspective" WorldBegin WorldEnd"#,
    );
    let m = mirrored.camera.world_from_camera;
    assert_near(m.transform_vector3(Vec3::X), Vec3::X);
    assert_near(m.transform_vector3(Vec3::Z), Vec3::Y);
}

#[test]
fn transformations_apply_from_the_last_to_the_first() {
    let scene = world(&format!(
        "Translate 10 0 0 Rotate 90 0 0 1 Scale 2 2 2 {TRIANGLE}"
    ));
    let expected = [[10.0, 0.0, 0.0], [10.0, 2.0, 0.0], [8.0, 0.0, 0.0]];
    for (found, expected) in mesh(&scene.shapes[0]).positions.iter().zip(expected) {
        assert_near(Vec3::from(*found), Vec3::from(expected));
    }
    assert!(!scene.shapes[0].transform_swaps_handedness);
}

#[test]
fn matrices_are_given_column_by_column() {
    let moved = world(&format!(
        "Scale 5 5 5 Transform [1 0 0 0 0 1 0 0 0 0 1 0 7 8 9 1] ConcatTransform [2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1] {TRIANGLE}"
    ));
    let positions = &mesh(&moved.shapes[0]).positions;
    assert_eq!(positions[0], [7.0, 8.0, 9.0]);
    assert_eq!(positions[1], [9.0, 8.0, 9.0]);
}

#[test]
fn normals_go_by_the_inverse_transpose_and_mirrors_are_remembered() {
    let scene = world(
        r#"Scale 1 1 -4 ReverseOrientation
        Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0 0 0 1 0 0 0 1 1]
            "normal N" [0 0 1  0 1 1  0 0 0] "point2 uv" [0 0 1 0 0.5 1]"#,
    );
    let shape = &scene.shapes[0];
    assert!(shape.transform_swaps_handedness && shape.reverse_orientation);
    let mesh = mesh(shape);
    assert_near(mesh.normals[0], -Vec3::Z);
    assert_near(mesh.normals[1], Vec3::new(0.0, 1.0, -0.25).normalize());
    assert_eq!(mesh.normals[2], Vec3::ZERO);
    assert_eq!(mesh.uvs[2].to_array(), [0.5, 1.0]);
}

#[test]
fn blocks_restore_what_they_save() {
    let scene = world(&format!(
        r#"AttributeBegin
             Translate 1 0 0 ReverseOrientation Material "mirror"
             AreaLightSource "diffuse" "rgb L" [1 2 3]
             TransformBegin Translate 5 5 5 TransformEnd
             {TRIANGLE}
           AttributeEnd
           {TRIANGLE}"#
    ));
    let [inner, outer] = &scene.shapes[..] else {
        panic!()
    };
    assert_eq!(mesh(inner).positions[0], [1.0, 0.0, 0.0]);
    assert!(inner.reverse_orientation && !outer.reverse_orientation);
    assert_eq!(
        inner.area_light.as_ref().unwrap().radiance,
        Rgb::new(1.0, 2.0, 3.0)
    );
    assert_eq!(outer.area_light, None);
    assert_eq!(mesh(outer).positions[0], [0.0; 3]);
    assert_eq!(
        scene.materials[inner.material],
        Material::Mirror(Mirror {
            kr: Rgb::splat(0.9).into()
        })
    );
}

#[test]
fn coordinate_systems_have_names() {
    let scene = scene(&format!(
        r#"Translate 0 0 -5 Camera "perspective"
        WorldBegin
        Translate 1 2 3 CoordinateSystem "here" Identity
        CoordSysTransform "here" {TRIANGLE}
        CoordSysTransform "camera" {TRIANGLE}
        CoordSysTransform "world" {TRIANGLE}
        WorldEnd"#
    ));
    let first = |i: usize| mesh(&scene.shapes[i]).positions[0];
    assert_eq!(first(0), [1.0, 2.0, 3.0]);
    assert_eq!(first(1), [0.0, 0.0, 5.0]);
    assert_eq!(first(2), [0.0; 3]);
}

#[test]
fn animation_that_does_not_differ_is_none() {
    world(&format!(
        "ActiveTransform StartTime Translate 1 0 0 ActiveTransform EndTime Translate 1 0 0
         ActiveTransform All {TRIANGLE}"
    ));
}

#[test]
fn materials_have_the_defaults_of_pbrt_and_are_shared() {
    let scene = world(&format!(
        r#"{TRIANGLE}
        Material "plastic" {TRIANGLE}
        Material "glass" "float index" 1.3 {TRIANGLE}
        MakeNamedMaterial "m" "string type" "matte" "color Kd" [.1 .2 .3] "float sigma" 20
        NamedMaterial "m" {TRIANGLE}
        Material "matte" "rgb Kd" [.5 .5 .5] {TRIANGLE}"#
    ));
    let of = |i: usize| scene.materials[scene.shapes[i].material].clone();
    assert_eq!(
        of(0),
        Material::Matte(Matte {
            kd: Rgb::splat(0.5).into(),
            sigma: 0.0.into()
        })
    );
    assert_eq!(
        of(1),
        Material::Plastic(Plastic {
            kd: Rgb::splat(0.25).into(),
            ks: Rgb::splat(0.25).into(),
            roughness: 0.1.into(),
            remap_roughness: true
        })
    );
    assert_eq!(
        of(2),
        Material::Glass(Glass {
            kr: Rgb::ONE.into(),
            kt: Rgb::ONE.into(),
            eta: 1.3.into(),
            roughness: [0.0.into(), 0.0.into()],
            remap_roughness: true
        })
    );
    assert_eq!(
        of(3),
        Material::Matte(Matte {
            kd: Rgb::new(0.1, 0.2, 0.3).into(),
            sigma: 20.0.into()
        })
    );
    assert_eq!(scene.shapes[4].material, scene.shapes[0].material);
    assert_eq!(scene.materials.len(), 4);
}

#[test]
fn shapes_override_parameters_of_their_material() {
    let scene = world(&format!(
        r#"Material "plastic" "rgb Ks" [.7 .7 .7] {TRIANGLE} "rgb Kd" [1 0 0] {TRIANGLE}"#
    ));
    let Material::Plastic(Plastic { kd, ks, .. }) = &scene.materials[scene.shapes[0].material]
    else {
        panic!()
    };
    assert_eq!((kd, ks), (&Rgb::X.into(), &Rgb::splat(0.7).into()));
    let Material::Plastic(Plastic { kd, .. }) = &scene.materials[scene.shapes[1].material] else {
        panic!()
    };
    assert_eq!(kd, &Rgb::splat(0.25).into());
    let scene = world(
        r#"Material "hair" "float beta_m" .2
        Shape "curve" "point P" [0 0 0 1 0 0 2 0 0 3 0 0] "float eumelanin" 8 "float beta_n" 7"#,
    );
    let expected = Material::Hair(Hair {
        pigment: Pigment::Melanin([8.0.into(), 0.0.into()]),
        eta: 1.55.into(),
        roughness: [0.2.into(), 1.0.into()],
        tilt: 2.0.into(),
    });
    assert_eq!(scene.materials[scene.shapes[0].material], expected);
}

#[test]
fn constant_textures_are_values_and_unused_ones_may_be_anything() {
    let scene = world(&format!(
        r#"Texture "red" "spectrum" "constant" "rgb value" [1 0 0]
        Texture "rough" "float" "constant" "float value" .3
        Texture "unused" "float" "marble" "string filename" "nowhere.png"
        AttributeBegin
          Texture "red" "color" "constant" "rgb value" [0 1 0]
        AttributeEnd
        Material "plastic" "texture Kd" "red" "texture roughness" "rough" {TRIANGLE}"#
    ));
    let Material::Plastic(Plastic { kd, roughness, .. }) = &scene.materials[0] else {
        panic!()
    };
    assert_eq!((kd, roughness), (&Rgb::X.into(), &0.3.into()));
}

#[test]
fn lights_stand_in_world_space() {
    let scene = world(
        r#"Translate 1 0 0 Rotate 90 0 0 1
        LightSource "point" "rgb I" [1 2 3] "rgb scale" [2 2 2] "point from" [0 5 0]
        LightSource "spot" "point from" [1 0 0] "point to" [2 0 0] "float coneangle" 60
        LightSource "distant" "point from" [0 0 0] "point to" [0 3 0] "rgb L" [4 4 4]
        LightSource "infinite" "rgb L" [.5 .5 .5]"#,
    );
    let [point, spot, distant, infinite] = &scene.lights[..] else {
        panic!()
    };
    let Light::Point {
        position,
        intensity,
    } = point
    else {
        panic!()
    };
    // pbrt-v3 adds "from" after the transformation.
    assert_near(*position, Vec3::new(1.0, 5.0, 0.0));
    assert_eq!(*intensity, Rgb::new(2.0, 4.0, 6.0));
    let Light::Spot {
        position,
        axis,
        cos_total_width,
        cos_falloff_start,
        ..
    } = spot
    else {
        panic!()
    };
    assert_near(*position, Vec3::new(1.0, 1.0, 0.0));
    assert_near(*axis, Vec3::Y);
    assert!((cos_total_width - 0.5).abs() < 1e-6);
    assert!((cos_falloff_start - 55f32.to_radians().cos()).abs() < 1e-6);
    let Light::Distant { to_light, .. } = distant else {
        panic!()
    };
    assert_near(*to_light, Vec3::X);
    assert_eq!(
        *infinite,
        Light::Infinite {
            radiance: Rgb::splat(0.5),
            environment: None,
            samples: 1
        }
    );
}

#[test]
fn area_lights_belong_to_the_shapes_that_follow() {
    let scene = world(&format!(
        r#"AreaLightSource "area" "rgb L" [1 1 1] "rgb scale" [3 3 3] "bool twosided" "true" "integer nsamples" 8
        {TRIANGLE} Shape "sphere" "float radius" 2
        AreaLightSource "" {TRIANGLE}"#
    ));
    let light = scene.shapes[0].area_light.as_ref().unwrap();
    assert_eq!(light.radiance, Rgb::splat(3.0));
    assert!(light.two_sided);
    assert_eq!(light.samples, 8);
    assert_eq!(scene.shapes[1].area_light.as_ref(), Some(light));
    assert_eq!(scene.shapes[2].area_light, None);
}

#[test]
fn spheres_may_be_moved_turned_mirrored_and_scaled_evenly() {
    let scene = world(
        r#"Translate 1 2 3 Scale -2 2 2 Rotate 40 1 2 3
        Shape "sphere" "float radius" 1.5 "float zmin" -1.5"#,
    );
    let Geometry::Sphere(sphere) = scene.shapes[0].geometry else {
        panic!()
    };
    assert_near(sphere.center, Vec3::new(1.0, 2.0, 3.0));
    assert!((sphere.radius - 3.0).abs() < 1e-5);
    assert!(scene.shapes[0].transform_swaps_handedness);
}

#[test]
fn spectra_of_every_kind_become_rgb() {
    let (_folder, result) = load_files(&[
        (
            "scene.pbrt",
            br#"WorldBegin
            LightSource "infinite" "xyz L" [0.950456 1 1.089058]
            LightSource "infinite" "blackbody L" [6500 2]
            LightSource "infinite" "spectrum L" [400 1 700 1]
            LightSource "infinite" "spectrum L" "flat.spd"
            WorldEnd"#,
        ),
        ("flat.spd", b"# flat\n400 1\n500 1 # and so on\n"),
    ]);
    let scene = result.unwrap().scene;
    let radiance = |i: usize| match &scene.lights[i] {
        Light::Infinite { radiance, .. } => *radiance,
        other => panic!("{other:?}"),
    };
    assert!((radiance(0) - Rgb::ONE).abs().max_element() < 1e-3);
    assert!(radiance(1).min_element() > 1.5);
    assert_eq!(radiance(2), radiance(3));
}

#[test]
fn meshes_are_found_beside_the_scene() {
    let ply = b"ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
    let (_folder, result) = load_files(&[
        (
            "scene.pbrt",
            b"WorldBegin Translate 0 0 2 Shape \"plymesh\" \"string filename\" \"m.ply\" WorldEnd",
        ),
        ("m.ply", ply),
    ]);
    let scene = result.unwrap().scene;
    assert_eq!(scene.triangle_count(), 2);
    assert_eq!(mesh(&scene.shapes[0]).indices, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh(&scene.shapes[0]).positions[2], [1.0, 1.0, 2.0]);
}

#[test]
fn long_lists_and_odd_line_ends_are_fine() {
    let count = 100_000;
    let points: String = (0..count).map(|i| format!("{i} 0 .5\r\n")).collect();
    let indices: String = (0..count - 2)
        .map(|i| format!("{i} {} {}\r", i + 1, i + 2))
        .collect();
    let scene = world(&format!(
        "Shape \"trianglemesh\" \"point P\" [{points}] \"integer indices\" [{indices}]"
    ));
    assert_eq!(scene.triangle_count(), count - 2);
    assert_eq!(
        mesh(&scene.shapes[0]).positions[count - 1][0],
        (count - 1) as f32
    );
}

#[test]
fn integrators_that_trace_from_lights_are_taken_as_others() {
    for (name, parameters) in [
        ("bdpt", "\"bool visualizestrategies\" \"false\""),
        (
            "mlt",
            "\"integer mutationsperpixel\" 4096 \"float sigma\" .01",
        ),
        ("sppm", "\"integer iterations\" 64 \"float radius\" .05"),
    ] {
        let text = format!(
            "Integrator \"{name}\" \"integer maxdepth\" 9 {parameters} WorldBegin WorldEnd"
        );
        let loaded = load_text(&text).unwrap_or_else(|error| panic!("{error}"));
        let taken_as = match loaded.scene.integrator {
            Integrator::Path { max_depth: 9, .. } => "\"path\"",
            Integrator::VolumePath { max_depth: 9, .. } if name != "sppm" => "\"volpath\"",
            other => panic!("{other:?}"),
        };
        assert_eq!(loaded.notes.len(), 1);
        let message = &loaded.notes[0].message;
        let wanted =
            format!("taken as {taken_as}: caustics of point, spot and distant lights are missing");
        assert!(message.ends_with(&wanted), "{message}");
    }
}

#[test]
fn what_pbrt_goes_on_after_is_a_warning() {
    let (scene, warnings) = tolerated(&format!(
        r#"WorldBegin
        Material "velvet" "rgb Kd" [1 0 0] "float fuzz" 3 {TRIANGLE}
        NamedMaterial "nowhere" {TRIANGLE}
        Material "mix" "string namedmaterial1" "a" "string namedmaterial2" "a" {TRIANGLE}
        WorldEnd"#
    ));
    let said: Vec<_> = warnings.iter().map(|w| (w.severity, w.line)).collect();
    assert_eq!(said, [2, 3, 4].map(|line| (Severity::Warning, line)));
    assert!(
        warnings[0]
            .to_string()
            .contains("warning: unknown material \"velvet\"")
    );
    let material = |shape: usize| &scene.materials[scene.shapes[shape].material];
    let Material::Matte(Matte { kd, .. }) = material(0) else {
        panic!()
    };
    assert_eq!(*kd, Rgb::X.into());
    assert_eq!(material(1), material(0), "the material before it stays");
    assert!(matches!(material(2), Material::Mix(_)));
}

/// Where nobody sees the looks, nothing is said of them: also where a shape is on the same line.
#[test]
fn only_geometry_is_spoken_of_where_nothing_else_is_wanted() {
    let text = format!(
        r#"Integrator "sppm"
        WorldBegin
        Material "velvet" "rgb Kd" [1 0 0] {TRIANGLE}
        Material "matte" Shape "hyperboloid" "point p1" [1 0 0.6] "point p2" [5 0 1] {TRIANGLE}
        NamedMaterial "nowhere" {TRIANGLE}
        AttributeBegin Scale 1 2 1 LightSource "spot" AttributeEnd
        WorldEnd"#
    );
    let said = |only_geometry: bool| -> Vec<u32> {
        let options = Options {
            strict: false,
            skip_unsupported: true,
            only_geometry,
            ..crate::OPTIONS
        };
        let loaded = parse(text.clone().into_bytes(), Path::new("s.pbrt"), &options);
        let notes = loaded.expect("a scene").notes;
        notes.iter().map(|note| note.line).collect()
    };
    assert_eq!(said(false), [1, 3, 4, 5, 6]);
    assert_eq!(said(true), [4]);
}

#[test]
fn unsupported_features_can_be_left_out() {
    let (scene, warnings) = tolerated(&format!(
        r#"WorldBegin
        Shape "hyperboloid" "point p1" [-1 0 -1] "point p2" [1 0 1]
        Shape "hyperboloid" "point p1" [1 0 0.6] "point p2" [5 0 1] {TRIANGLE}
        AttributeBegin Scale 1 2 1 LightSource "spot" AttributeEnd
        ObjectBegin "o" Shape "sphere" ObjectEnd
        AttributeBegin Scale 1 2 1 ObjectInstance "o" AttributeEnd
        WorldEnd"#
    ));
    assert_eq!((scene.shapes.len(), scene.instances.len()), (1, 0));
    let lines: Vec<u32> = warnings.iter().map(|warning| warning.line).collect();
    assert_eq!(lines, [2, 3, 4, 6]);
    assert!(scene.lights.is_empty());
    assert!(
        warnings
            .iter()
            .all(|warning| warning.message.contains("left out"))
    );
}

#[test]
fn subdivided_meshes_are_smooth() {
    let scene = world(
        r#"Shape "loopsubdiv" "integer nlevels" 2 "point P" [1 0 0 0 1 0 0 0 1 -1 0 0 0 -1 0 0 0 -1]
        "integer indices" [0 1 2 1 3 2 3 4 2 4 0 2 1 0 5 3 1 5 4 3 5 0 4 5]"#,
    );
    let Geometry::Mesh(mesh) = &scene.shapes[0].geometry else {
        panic!()
    };
    assert_eq!((mesh.indices.len(), mesh.positions.len()), (128, 66));
    for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
        let position = Vec3::from(*position);
        assert!(position.normalize().dot(*normal) < -0.9);
        assert!((0.3..0.6).contains(&position.length()));
    }
}

#[test]
fn cameras_without_a_vanishing_point() {
    let camera = |text: &str| scene(&format!("{text} WorldBegin WorldEnd")).camera;
    let plain =
        camera(r#"Camera "orthographic" "float screenwindow" [-2 2 -1 1] "float lensradius" .1"#);
    assert_eq!(plain.projection, Projection::Orthographic);
    assert_eq!(plain.screen_window, Some([-2.0, 2.0, -1.0, 1.0]));
    assert_eq!(plain.lens_radius, 0.1);
    let around = camera(r#"Camera "environment""#);
    assert_eq!(around.projection, Projection::Spherical);
    let square = scene(r#"Film "rgb" Camera "spherical" WorldBegin"#).camera;
    assert_eq!(square.projection, Projection::EqualArea);
}
