//! Materials: parameters and defaults of pbrt-v3.

use antumbra_scene::material::Disney;
use antumbra_scene::material::{
    Bumped, Hair, Matte, Metal, Mirror, Mix, Substrate, Subsurface, Translucent, Uber,
};
use antumbra_scene::{DisneyBody, Material, Param, Rgb, Scene};

use super::{load_text, tolerated, world};

const TRIANGLE: &str =
    r#"Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0 0 0 1 0 0 0 1 0] "#;

/// Material of the first shape.
fn material(text: &str) -> Material {
    let scene = world(&format!("{text} {TRIANGLE}"));
    of_shape(&scene, 0).clone()
}

fn of_shape(scene: &Scene, shape: usize) -> &Material {
    &scene.materials[scene.shapes[shape].material]
}

fn grey(value: f32) -> Param<Rgb> {
    Rgb::splat(value).into()
}

fn both(value: f32) -> [Param<f32>; 2] {
    [value.into(), value.into()]
}

#[test]
fn defaults() {
    for (name, expected) in [
        ("none", Material::None),
        ("", Material::None),
        (
            "metal",
            Material::Metal(Metal {
                // Copper.
                eta: Rgb::new(0.200438, 0.924033, 1.102212).into(),
                k: Rgb::new(3.912949, 2.452848, 2.142188).into(),
                roughness: both(0.01),
                remap_roughness: true,
            }),
        ),
        (
            "uber",
            Material::Uber(Uber {
                kd: grey(0.25),
                ks: grey(0.25),
                kr: grey(0.0),
                kt: grey(0.0),
                roughness: both(0.1),
                opacity: grey(1.0),
                eta: 1.5.into(),
                remap_roughness: true,
            }),
        ),
        (
            "substrate",
            Material::Substrate(Substrate {
                kd: grey(0.5),
                ks: grey(0.5),
                roughness: both(0.1),
                remap_roughness: true,
            }),
        ),
        (
            "translucent",
            Material::Translucent(Translucent {
                kd: grey(0.25),
                ks: grey(0.25),
                reflect: grey(0.5),
                transmit: grey(0.5),
                roughness: 0.1.into(),
                remap_roughness: true,
            }),
        ),
    ] {
        assert_eq!(material(&format!("Material {name:?}")), expected, "{name}");
    }
}

#[test]
fn roughness_along_one_direction() {
    for (kind, parameters, expected) in [
        ("metal", r#""float roughness" .5"#, [0.5, 0.5]),
        (
            "metal",
            r#""float roughness" .5 "float uroughness" .2"#,
            [0.2, 0.5],
        ),
        ("metal", r#""float vroughness" .2"#, [0.01, 0.2]),
        (
            "uber",
            r#""float roughness" .5 "float vroughness" .2"#,
            [0.5, 0.2],
        ),
        // Here roughness along v defaults to the one along u, as in pbrt-v3.
        (
            "uber",
            r#""float roughness" .5 "float uroughness" .2"#,
            [0.2, 0.2],
        ),
        ("substrate", r#""float vroughness" .2"#, [0.1, 0.2]),
    ] {
        let material = material(&format!("Material \"{kind}\" {parameters}"));
        let (Material::Metal(Metal { roughness, .. })
        | Material::Uber(Uber { roughness, .. })
        | Material::Substrate(Substrate { roughness, .. })) = material
        else {
            panic!("{material:?}")
        };
        assert_eq!(
            roughness,
            expected.map(Param::Constant),
            "{kind} {parameters}"
        );
    }
}

#[test]
fn bump_maps_tilt_what_they_are_given_to() {
    let height = r#"Texture "h" "float" "bilerp" Texture "flat" "float" "constant""#;
    let bumped = material(&format!(
        "{height} Material \"mirror\" \"texture bumpmap\" \"h\""
    ));
    let Material::Bumped(Bumped {
        material: inner,
        height: Param::Texture(_),
    }) = bumped
    else {
        panic!("{bumped:?}")
    };
    assert_eq!(*inner, Material::Mirror(Mirror { kr: grey(0.9) }));
    // A constant height does not tilt normals.
    let flat = material(&format!(
        "{height} Material \"mirror\" \"texture bumpmap\" \"flat\""
    ));
    assert_eq!(flat, Material::Mirror(Mirror { kr: grey(0.9) }));
    // Bump map of the shape's own parameters.
    let scene = world(&format!(
        "{height} Material \"mirror\" {TRIANGLE} \"texture bumpmap\" \"h\" {TRIANGLE}"
    ));
    assert!(matches!(of_shape(&scene, 0), Material::Bumped(_)));
    assert!(matches!(of_shape(&scene, 1), Material::Mirror(_)));
}

#[test]
fn mixtures_are_of_named_materials_and_bumped_as_a_whole() {
    let named = r#"Texture "h" "float" "bilerp"
        MakeNamedMaterial "plain" "string type" "matte"
        MakeNamedMaterial "bumpy" "string type" "mirror" "texture bumpmap" "h"
        Material "mix" "rgb amount" [1 0 0]"#;
    let matte = Material::Matte(Matte {
        kd: grey(0.5),
        sigma: 0.0.into(),
    });
    let mirror = Material::Mirror(Mirror { kr: grey(0.9) });
    let mixed = |first: &str, second: &str| {
        material(&format!(
            "{named} \"string namedmaterial1\" \"{first}\" \"string namedmaterial2\" \"{second}\""
        ))
    };
    let Material::Bumped(Bumped {
        material: inner, ..
    }) = mixed("bumpy", "plain")
    else {
        panic!()
    };
    assert_eq!(
        *inner,
        Material::Mix(Mix {
            materials: [mirror.clone().into(), matte.clone().into()],
            amount: Rgb::X.into()
        })
    );
    // The bump map of the second material is ignored, as in pbrt-v3.
    assert_eq!(
        mixed("plain", "bumpy"),
        Material::Mix(Mix {
            materials: [matte.into(), mirror.into()],
            amount: Rgb::X.into()
        })
    );
}

#[test]
fn equal_materials_are_one() {
    let mix = r#"Material "mix" "string namedmaterial1" "a" "string namedmaterial2" "a""#;
    let scene = world(&format!(
        r#"MakeNamedMaterial "a" "string type" "metal" "float roughness" .2
        {mix} {TRIANGLE} Material "none" {TRIANGLE} {mix} {TRIANGLE}
        Material "metal" "float uroughness" .2 "float vroughness" .2 {TRIANGLE} NamedMaterial "a" {TRIANGLE}
        Material "metal" {TRIANGLE}"#
    ));
    let materials: Vec<_> = scene.shapes.iter().map(|shape| shape.material).collect();
    assert_eq!(materials, [0, 1, 0, 2, 2, 3]);
}

#[test]
fn subsurface_scattering_has_the_defaults_of_pbrt() {
    use antumbra_scene::Interior;
    let scene = load_text(
        r#"WorldBegin
        Material "subsurface" Shape "sphere"
        Material "subsurface" "string name" "Ketchup" "float g" 0.9 "float scale" 2 "float uroughness" 0.05
        Shape "sphere"
        Material "kdsubsurface" "rgb Kd" [.1 .2 .3] "rgb mfp" [1 2 3] "float eta" 1.5 Shape "sphere"
        WorldEnd"#,
    )
    .unwrap()
    .scene;
    let found: Vec<_> = (scene.materials.iter())
        .map(|material| match material {
            Material::Subsurface(Subsurface {
                interior,
                eta,
                asymmetry,
                ..
            }) => (interior.clone(), *eta, *asymmetry),
            other => panic!("{other:?}"),
        })
        .collect();
    let coefficients = |absorption: [f32; 3], scattering: [f32; 3], scale| Interior::Coefficients {
        absorption: Rgb::from(absorption).into(),
        scattering: Rgb::from(scattering).into(),
        scale,
    };
    let milk = coefficients([0.0011, 0.0024, 0.014], [2.55, 3.21, 3.77], 1.0);
    let ketchup = coefficients([0.061, 0.97, 1.45], [0.18, 0.07, 0.03], 2.0);
    let diffuse = Interior::Diffuse {
        reflectance: Rgb::new(0.1, 0.2, 0.3).into(),
        mean_free_path: Rgb::new(1.0, 2.0, 3.0).into(),
        scale: 1.0,
    };
    assert_eq!(
        found,
        [(milk, 1.33, 0.0), (ketchup, 1.33, 0.0), (diffuse, 1.5, 0.0)]
    );
    let (_, warnings) = tolerated(
        r#"WorldBegin Material "subsurface" "string name" "Cheese" Shape "sphere" WorldEnd"#,
    );
    assert!(
        warnings
            .iter()
            .any(|warning| warning.message.contains("\"Cheese\""))
    );
}

#[test]
fn hair_has_the_defaults_of_pbrt() {
    use antumbra_scene::Pigment;
    let curve = r#"Shape "curve" "string type" "cylinder" "float width" 0.1 "point P" [0 0 0 1 0 0 2 0 0 3 0 0]"#;
    let scene = load_text(&format!(
        r#"WorldBegin
        Material "hair" {curve}
        Material "hair" "rgb color" [.5 .2 .1] "float eumelanin" 3 "float beta_n" .7 {curve}
        Material "hair" "float pheomelanin" .2 "float eta" 1.6 "float alpha" 3 "float beta_m" .1 {curve}
        WorldEnd"#,
    ))
    .unwrap()
    .scene;
    let hair = |pigment, eta: f32, roughness: [f32; 2], tilt: f32| {
        Material::Hair(Hair {
            pigment,
            eta: eta.into(),
            roughness: roughness.map(Param::Constant),
            tilt: tilt.into(),
        })
    };
    let melanin = |amounts: [f32; 2]| Pigment::Melanin(amounts.map(Param::Constant));
    assert_eq!(
        scene.materials,
        [
            hair(melanin([1.3, 0.0]), 1.55, [0.3, 0.3], 2.0),
            hair(
                Pigment::Color(Rgb::new(0.5, 0.2, 0.1).into()),
                1.55,
                [0.3, 0.7],
                2.0
            ),
            hair(melanin([0.0, 0.2]), 1.6, [0.1, 0.3], 3.0),
        ]
    );
}

/// Material of a `disney` of the given parameters.
fn disney(parameters: &str) -> Disney {
    match material(&format!("Material \"disney\" {parameters}")) {
        Material::Disney(disney) => disney,
        other => panic!("{other:?}"),
    }
}

#[test]
fn disney_has_the_defaults_of_pbrt() {
    let expected = Disney {
        color: grey(0.5),
        metallic: 0.0.into(),
        eta: 1.5.into(),
        roughness: 0.5.into(),
        specular_tint: 0.0.into(),
        anisotropic: 0.0.into(),
        sheen: 0.0.into(),
        sheen_tint: 0.5.into(),
        clearcoat: 0.0.into(),
        clearcoat_gloss: 1.0.into(),
        specular_transmission: 0.0.into(),
        body: DisneyBody::Solid {
            scatter_distance: grey(0.0),
        },
    };
    assert_eq!(disney(""), expected);
    let thin = DisneyBody::Thin {
        flatness: 0.0.into(),
        diffuse_transmission: 1.0.into(),
    };
    assert_eq!(disney("\"bool thin\" \"true\"").body, thin);
}

/// Each parameter has its own place. All of them may be textures, and shapes override them.
#[test]
fn disney_reads_all_parameters() {
    let found = disney(
        r#""rgb color" [.9 .6 .3] "float metallic" .11 "float eta" 1.7 "float roughness" .12 "float speculartint" .13
        "float anisotropic" .14 "float sheen" 1.5 "float sheentint" .16 "float clearcoat" 2 "float clearcoatgloss" .18
        "float spectrans" .19 "bool thin" "true" "float flatness" .21 "float difftrans" 1.2"#,
    );
    let expected = Disney {
        color: Rgb::new(0.9, 0.6, 0.3).into(),
        metallic: 0.11.into(),
        eta: 1.7.into(),
        roughness: 0.12.into(),
        specular_tint: 0.13.into(),
        anisotropic: 0.14.into(),
        sheen: 1.5.into(),
        sheen_tint: 0.16.into(),
        clearcoat: 2.0.into(),
        clearcoat_gloss: 0.18.into(),
        specular_transmission: 0.19.into(),
        body: DisneyBody::Thin {
            flatness: 0.21.into(),
            diffuse_transmission: 1.2.into(),
        },
    };
    assert_eq!(found, expected);
    for name in [
        "metallic",
        "eta",
        "roughness",
        "speculartint",
        "anisotropic",
        "sheen",
        "sheentint",
        "clearcoat",
        "clearcoatgloss",
        "spectrans",
        "flatness",
        "difftrans",
    ] {
        let found = world(&format!(
            r#"Texture "t" "float" "checkerboard" Material "disney" "bool thin" "true" "texture {name}" "t" {TRIANGLE}"#
        ));
        let text = format!("{:?}", found.materials);
        assert!(text.contains("Checkerboard"), "{name}: {text}");
    }
    let found = world(&format!(
        r#"Texture "t" "color" "checkerboard" Material "disney" "texture color" "t" "texture scatterdistance" "t"
        {TRIANGLE} "float metallic" .5"#
    ));
    let Material::Disney(found) = of_shape(&found, 0) else {
        panic!("{:?}", found.materials);
    };
    assert!(found.color.constant().is_none() && found.scatters_inside());
    assert_eq!(found.metallic, 0.5.into());
}

/// What does nothing, or is taken as something else, is said. What is not supported is an error.
#[test]
fn disney_says_what_it_leaves_out() {
    for (parameters, expected) in [
        (
            r#""bool thin" "true" "rgb scatterdistance" [1 1 1]"#,
            "\"scatterdistance\" is left out",
        ),
        (r#""float flatness" .5"#, "\"flatness\" is left out"),
        (r#""float metallic" 1.5"#, "\"metallic\" is taken as 1"),
        (
            r#""rgb scatterdistance" [1 1 1]"#,
            "subsurface scattering is rendered by walks",
        ),
        (
            r#""rgb scatterdistance" [1 1 1] "float spectrans" .5"#,
            "\"scatterdistance\" together with \"spectrans\" is not supported",
        ),
    ] {
        let text = format!("WorldBegin Material \"disney\" {parameters} {TRIANGLE} WorldEnd");
        let (_, said) = tolerated(&text);
        let said: String = said.iter().map(|one| one.message.as_str()).collect();
        assert!(said.contains(expected), "{parameters}: {said}");
    }
    let broken = load_text(r#"WorldBegin Material "disney" "float eta" 0 WorldEnd"#);
    let error = broken.expect_err("an index of 0").to_string();
    assert!(error.contains("must be positive, found 0"), "{error}");
}
