//! Damaged copies of valid files, which must not crash the reader.

use std::path::Path;

use antumbra_pbrt::{Error, load, load_ply};
use antumbra_testkit::{Rng, mutate};

use super::OPTIONS;

const SCENE: &str = r#"# a small scene
Scale -1 1 1 LookAt 0 -5 1  0 0 0.5  0 0 1
Camera "perspective" "float fov" [39.5] "float lensradius" .01
Film "image" "integer xresolution" 8 "integer yresolution" [8] "string filename" "x.exr"
Sampler "halton" "integer pixelsamples" 4 Integrator "path" "integer maxdepth" [3]
Accelerator "qbvh" "string order" "simple"
WorldBegin
Include "more.pbrt"
AttributeBegin Translate 1 -2e0 +3 Rotate 30 0 0 1
  MakeNamedMaterial "a" "string type" "plastic" "rgb Kd" [.1 .2 .3] "bool remaproughness" "false"
  NamedMaterial "a" AreaLightSource "diffuse" "blackbody L" [3000 1]
  Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0 0 0 1 0 0 0 1 0] "float uv" [0 0 1 0 1 1]
  Shape "plymesh" "string filename" "m.ply"
AttributeEnd
Texture "t" "spectrum" "constant" "rgb value" [1 1 1] Material "matte" "texture Kd" "t"
TransformBegin ConcatTransform [1 0 0 0 0 1 0 0 0 0 1 0 1 1 1 1] Shape "sphere" TransformEnd
ObjectBegin "o" Scale 1 2 1 Shape "plymesh" "string filename" "m.ply" ObjectEnd
AttributeBegin Scale 1 -1 1 ObjectInstance "o" AttributeEnd ObjectInstance "o"
LightSource "infinite" "spectrum L" [400 1 600 0.5] "string mapname" "i.pfm"
Texture "i" "float" "imagemap" "string filename" "i.pfm" "string mapping" "planar" "vector v1" [1 0 0]
Texture "c" "float" "checkerboard" "texture tex1" "i" "float tex2" 2 "integer dimension" 3
Material "uber" "texture bumpmap" "c" "rgb opacity" [1 .5 1]
Shape "plymesh" "string filename" "m.ply" "texture alpha" "i" "float shadowalpha" 0
Shape "curve" "string type" "ribbon" "point P" [0 0 0 1 0 0 2 0 0 3 0 0] "normal N" [0 0 1 0 1 0] "float width1" 2
Shape "disk" "float innerradius" .5 Shape "cylinder" "float phimax" 90 Shape "sphere" "float zmin" 0
LightSource "projection" "string mapname" "i.pfm" "float fov" 30
WorldEnd
"#;

const MESH_TEXT: &str = "ply\nformat ascii 1.0\ncomment x\nelement vertex 4\nproperty float x\n\
property float y\nproperty float z\nproperty double nx\nproperty float ny\nproperty float nz\n\
element face 2\nproperty list uchar int vertex_indices\nproperty list char short more\n\
element other 1\nproperty int a\nend_header\n0 0 0 0 0 1\n1 0 0 0 0 1\n1 1 0 0 0 1\n0 1 0 0 0 1\n\
3 0 1 2 0\n4 0 1 2 3 2 7 7\n9\n";

/// Small mesh of an equal shape in binary form.
fn binary_mesh() -> Vec<u8> {
    let header = MESH_TEXT
        .split_inclusive("end_header\n")
        .next()
        .unwrap()
        .replace("ascii", "binary_little_endian");
    let mut bytes = header.into_bytes();
    for position in [
        [0f32, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ] {
        bytes.extend(position.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend(0f64.to_le_bytes());
        bytes.extend([0f32, 1.0].iter().flat_map(|v| v.to_le_bytes()));
    }
    for face in [&[0i32, 1, 2][..], &[0, 1, 2, 3]] {
        bytes.push(face.len() as u8);
        bytes.extend(face.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend([1, 7, 0]);
    }
    bytes.extend(9i32.to_le_bytes());
    bytes
}

const SEED: u64 = 0x5EED_B17E;

#[test]
fn scenes() {
    println!("seed {SEED:#x}");
    let folder = tempfile::TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("m.ply"), binary_mesh()).unwrap();
    std::fs::write(path("i.pfm"), b"Pf 1 1 -1\n\0\0\x80\x3f").unwrap();
    std::fs::write(path("more.pbrt"), "ReverseOrientation\n").unwrap();
    std::fs::write(path("s.pbrt"), SCENE).unwrap();
    if let Err(error) = load(&path("s.pbrt"), &OPTIONS) {
        panic!("the original is wrong: {error}");
    }
    let mut random = Rng::new(SEED);
    let mut wrong = 0;
    for _ in 0..2000 {
        std::fs::write(path("s.pbrt"), mutate(SCENE.as_bytes(), &mut random)).unwrap();
        if let Err(error) = load(&path("s.pbrt"), &OPTIONS) {
            let Error::Scene(diagnostics) = &error else {
                panic!("{error}")
            };
            assert!(!diagnostics.as_slice().is_empty());
            assert!(!error.to_string().is_empty());
            wrong += 1;
        }
    }
    assert!(wrong > 1000, "only {wrong} copies were noticed");
}

#[test]
fn meshes() {
    println!("seed {SEED:#x}");
    let folder = tempfile::TempDir::new().unwrap();
    let path: &Path = &folder.path().join("m.ply");
    let mut random = Rng::new(SEED);
    for original in [MESH_TEXT.as_bytes(), &binary_mesh()] {
        std::fs::write(path, original).unwrap();
        let mesh = load_ply(path).unwrap();
        assert_eq!(mesh.indices, [[0, 1, 2], [0, 1, 2], [0, 2, 3]]);
        for _ in 0..2000 {
            std::fs::write(path, mutate(original, &mut random)).unwrap();
            match load_ply(path) {
                Ok(mesh) => {
                    let count = mesh.positions.len();
                    let used = mesh.indices.as_flattened();
                    assert!(used.iter().all(|i| (*i as usize) < count));
                    assert!(mesh.normals.is_empty() || mesh.normals.len() == count);
                    assert!(mesh.uvs.is_empty() || mesh.uvs.len() == count);
                }
                Err(error) => assert!(!error.to_string().is_empty()),
            }
        }
    }
}
