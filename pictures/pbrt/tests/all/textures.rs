//! Textures, the images they look up, and alpha masks.

use std::sync::Arc;

use antumbra_image::{Image as Picture, Window};
use antumbra_scene::material::Matte;
use antumbra_scene::{
    ImageTexture, Mapping, Material, Param, Pixels, Rgb, Scene, Texture, TextureFilter, Wrap,
};
use glam::{DMat4, DVec3, Vec2, Vec3};

use super::{complaints, load_files, world};

const TRIANGLE: &str =
    r#"Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0 0 0 1 0 0 0 1 0] "#;

/// Grey PFM of 2 x 1 pixels.
const PFM: &[u8] = b"Pf 2 1 -1\n\0\0\0\0\0\0\x80\x3f";

/// Diffuse colour of a matte material.
fn kd(scene: &Scene, material: usize) -> &Param<Rgb> {
    match &scene.materials[material] {
        Material::Matte(Matte { kd, .. }) => kd,
        other => panic!("{other:?}"),
    }
}

fn texture<T>(param: &Param<T>) -> &Arc<Texture<T>> {
    match param {
        Param::Texture(texture) => texture,
        Param::Constant(_) => panic!("a constant"),
    }
}

/// Texture `t` of a world block, read as the diffuse colour of a shape.
fn color_texture(text: &str) -> Texture<Rgb> {
    let scene = world(&format!(
        "{text} Material \"matte\" \"texture Kd\" \"t\" {TRIANGLE}"
    ));
    Texture::clone(texture(kd(&scene, 0)))
}

#[test]
fn every_class_has_the_defaults_of_pbrt() {
    let zero_one = [Param::Constant(Rgb::ZERO), Param::Constant(Rgb::ONE)];
    let one_zero = [Param::Constant(Rgb::ONE), Param::Constant(Rgb::ZERO)];
    let mapping = Mapping::default();
    assert_eq!(
        color_texture(r#"Texture "t" "spectrum" "checkerboard""#),
        Texture::Checkerboard {
            squares: one_zero.clone(),
            mapping,
            smooth: true
        }
    );
    assert_eq!(
        color_texture(r#"Texture "t" "color" "bilerp""#),
        Texture::Bilerp {
            corners: [Rgb::ZERO, Rgb::ONE, Rgb::ZERO, Rgb::ONE],
            mapping
        }
    );
    let amount = r#"Texture "a" "float" "checkerboard" "#;
    let Texture::Mix { ends, amount } = color_texture(&format!(
        "{amount} Texture \"t\" \"color\" \"mix\" \"texture amount\" \"a\""
    )) else {
        panic!()
    };
    assert_eq!(ends, zero_one);
    assert!(amount.constant().is_none());
    let Texture::Scale([first, second]) = color_texture(
        r#"Texture "c" "color" "bilerp" Texture "t" "color" "scale" "texture tex2" "c""#,
    ) else {
        panic!()
    };
    assert_eq!(first, Rgb::ONE.into());
    assert!(second.constant().is_none());
    // pbrt-v3 uses the transformation itself here, not its inverse.
    assert_eq!(
        color_texture(
            r#"Translate 1 2 3 Texture "t" "color" "checkerboard" "integer dimension" 3"#
        ),
        Texture::Checkerboard3 {
            cubes: one_zero,
            texture_from_world: DMat4::from_translation(DVec3::new(1.0, 2.0, 3.0))
        }
    );
}

#[test]
fn what_is_made_of_constants_is_a_constant() {
    let scene = world(&format!(
        r#"Texture "a" "color" "constant" "rgb value" [.5 .25 1]
        Texture "b" "color" "scale" "texture tex1" "a" "rgb tex2" [1 1 .5]
        Texture "t" "color" "mix" "texture tex1" "b" "rgb tex2" [0 1 0] "float amount" .25
        Material "matte" "texture Kd" "t" {TRIANGLE}"#
    ));
    assert_eq!(*kd(&scene, 0), Rgb::new(0.375, 0.4375, 0.375).into());
}

#[test]
fn mappings_are_those_of_pbrt() {
    let mapping = |text: &str| {
        let text = format!("Translate 1 0 0 Texture \"t\" \"color\" \"bilerp\" {text}");
        match color_texture(&text) {
            Texture::Bilerp { mapping, .. } => mapping,
            other => panic!("{other:?}"),
        }
    };
    let texture_from_world = DMat4::from_translation(-DVec3::X);
    for (text, expected) in [
        ("", Mapping::default()),
        (
            r#""float uscale" 2 "float vscale" 3 "float udelta" 4 "float vdelta" 5"#,
            Mapping::Uv {
                scale: Vec2::new(2.0, 3.0),
                offset: Vec2::new(4.0, 5.0),
            },
        ),
        (
            r#""string mapping" "spherical""#,
            Mapping::Spherical { texture_from_world },
        ),
        (
            r#""string mapping" "cylindrical""#,
            Mapping::Cylindrical { texture_from_world },
        ),
        (
            r#""string mapping" "planar" "float udelta" 4"#,
            Mapping::Planar {
                axes: [Vec3::X, Vec3::Y],
                offset: Vec2::new(4.0, 0.0),
            },
        ),
        (
            r#""string mapping" "planar" "vector v1" [1 2 3] "vector3 v2" [0 0 1]"#,
            Mapping::Planar {
                axes: [Vec3::new(1.0, 2.0, 3.0), Vec3::Z],
                offset: Vec2::ZERO,
            },
        ),
    ] {
        assert_eq!(mapping(text), expected, "{text}");
    }
}

#[test]
fn image_maps_share_their_image_and_know_what_is_encoded() {
    let png = {
        let folder = tempfile::TempDir::new().unwrap();
        let path = folder.path().join("x.png");
        let pixels = vec![[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]];
        let picture = Picture::new(2, 1, Window::full(2, 1), pixels).unwrap();
        picture.write(&path).unwrap();
        std::fs::read(&path).unwrap()
    };
    let text = br#"WorldBegin
        Texture "a" "float" "imagemap" "string filename" "i.PNG"
        Texture "b" "color" "imagemap" "string filename" "./i.PNG" "bool gamma" "false"
            "string wrap" "clamp" "bool trilinear" "true" "float scale" 2 "float vscale" -1
        Texture "c" "color" "imagemap" "string filename" "i.pfm" "float maxanisotropy" 3 "string wrap" "black"
        Material "matte" "texture Kd" "b" "texture sigma" "a" Shape "plymesh" "string filename" "m.ply"
        Material "matte" "texture Kd" "c" Shape "plymesh" "string filename" "m.ply"
        WorldEnd"#;
    let ply = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n3 0 0 0\n";
    let (_folder, result) = load_files(&[
        ("s.pbrt", text),
        ("i.PNG", &png),
        ("i.pfm", PFM),
        ("m.ply", ply),
    ]);
    let scene = result.unwrap().scene;
    let Material::Matte(Matte { sigma, .. }) = &scene.materials[0] else {
        panic!()
    };
    let image = |texture: &Texture<f32>| match texture {
        Texture::Image(texture) => texture.clone(),
        other => panic!("{other:?}"),
    };
    let colored = |texture: &Texture<Rgb>| match texture {
        Texture::Image(texture) => texture.clone(),
        other => panic!("{other:?}"),
    };
    let a = image(texture(sigma));
    let [b, c] = [0, 1].map(|i| colored(texture(kd(&scene, i))));
    assert!(Arc::ptr_eq(&a.image, &b.image));
    assert_eq!(a.image.pixels, Pixels::Rgb8(vec![[255, 0, 0], [0, 0, 0]]));
    assert_eq!((a.image.width, a.image.height), (2, 1));
    assert_eq!(
        a,
        ImageTexture {
            image: Arc::clone(&b.image),
            mapping: Mapping::default(),
            wrap: Wrap::Repeat,
            filter: TextureFilter::Ewa {
                max_anisotropy: 8.0
            },
            gamma: true,
            scale: 1.0
        }
    );
    assert_eq!(
        b,
        ImageTexture {
            image: Arc::clone(&a.image),
            mapping: Mapping::Uv {
                scale: Vec2::new(1.0, -1.0),
                offset: Vec2::ZERO
            },
            wrap: Wrap::Clamp,
            filter: TextureFilter::Trilinear,
            gamma: false,
            scale: 2.0
        }
    );
    assert_eq!(c.image.pixels, Pixels::Rgb32(vec![[0.0; 3], [1.0; 3]]));
    assert!(!c.gamma && c.wrap == Wrap::Black);
    let max_anisotropy = 3.0;
    assert_eq!(c.filter, TextureFilter::Ewa { max_anisotropy });
    // Two shapes of one file under one transformation share its mesh.
    let [first, second] = &scene.shapes[..] else {
        panic!()
    };
    assert_eq!(first.geometry, second.geometry);
}

#[test]
fn broken_images_are_reported_wherever_they_are_named() {
    let text = b"WorldBegin\nTexture \"a\" \"float\" \"imagemap\" \"string filename\" \"i.png\"\n\
        Texture \"b\" \"color\" \"imagemap\" \"string filename\" \"i.png\"\n\
        Texture \"c\" \"color\" \"imagemap\" \"string filename\" \"i.pfm\"\n\
        Material \"matte\" \"texture Kd\" \"b\" \"texture sigma\" \"d\"\nWorldEnd";
    let (_folder, result) = load_files(&[
        ("s.pbrt", text),
        ("i.png", b"no picture"),
        ("i.pfm", b"PF 9 9 1\n"),
    ]);
    let found = complaints(result);
    let places: Vec<_> = found.iter().map(|d| (d.line, d.column)).collect();
    assert_eq!(places, [(2, 50), (3, 50), (4, 50), (5, 51)]);
    let words = "cannot read image \"i.pfm\": 9 x 9 pixels need 972 bytes, but there are 0";
    assert_eq!(found[2].message, words);
}

#[test]
fn textures_are_scoped_and_belong_to_a_type() {
    let scene = world(&format!(
        r#"Texture "t" "color" "checkerboard" Texture "t" "float" "bilerp"
        AttributeBegin Texture "t" "color" "bilerp"
          Material "matte" "texture Kd" "t" "texture sigma" "t" {TRIANGLE} AttributeEnd
        Material "matte" "texture Kd" "t" {TRIANGLE} {TRIANGLE}
        Material "matte" "texture Kd" "t" {TRIANGLE} "float sigma" 0"#
    ));
    assert!(matches!(**texture(kd(&scene, 0)), Texture::Bilerp { .. }));
    assert!(matches!(
        **texture(kd(&scene, 1)),
        Texture::Checkerboard { .. }
    ));
    // Equal textures give equal materials.
    let materials: Vec<_> = scene.shapes.iter().map(|shape| shape.material).collect();
    assert_eq!(materials, [0, 1, 1, 1]);
}

#[test]
fn meshes_are_cut_out_where_alpha_is_0() {
    let scene = world(&format!(
        r#"Texture "a" "float" "checkerboard" Texture "one" "float" "constant"
        Texture "zero" "float" "constant" "float value" 0
        {TRIANGLE} "texture alpha" "a"
        {TRIANGLE} "float alpha" 0.5 "texture shadowalpha" "zero"
        {TRIANGLE} "texture alpha" "one" "float shadowalpha" 0"#
    ));
    let zero = Some(Param::Constant(0.0));
    let [first, second, third] = &scene.shapes[..] else {
        panic!()
    };
    assert!(matches!(first.alpha, Some(Param::Texture(_))));
    assert_eq!(first.shadow_alpha, None);
    // Only 0 cuts out.
    assert_eq!((&second.alpha, &second.shadow_alpha), (&None, &zero));
    assert_eq!((&third.alpha, &third.shadow_alpha), (&None, &zero));
}
