//! Models with looks: files of glTF and OBJ with all kinds of textures, made from nothing.

use std::f32::consts::{PI, TAU};

use crate::picture::painted;

/// Buffer of a GLB under construction, and the JSON of its views and accessors.
#[derive(Default)]
struct Binary {
    bytes: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Binary {
    fn view(&mut self, data: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let (start, length) = (self.bytes.len(), data.len());
        self.bytes.extend(data);
        self.views.push(format!(
            r#"{{"buffer": 0, "byteOffset": {start}, "byteLength": {length}}}"#
        ));
        self.views.len() - 1
    }

    fn floats<const N: usize>(&mut self, rows: &[[f32; N]]) -> usize {
        let data: Vec<u8> = rows
            .iter()
            .flatten()
            .flat_map(|x| x.to_le_bytes())
            .collect();
        let (view, count) = (self.view(&data), rows.len());
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let ends = |pick: fn(f32, f32) -> f32| {
            let end = |axis: usize| rows.iter().map(|row| row[axis]).reduce(pick).unwrap_or(0.0);
            (0..N)
                .map(|axis| format!("{:?}", end(axis)))
                .collect::<Vec<_>>()
                .join(", ")
        };
        self.accessors.push(format!(
            r#"{{"bufferView": {view}, "componentType": 5126, "count": {count}, "type": "{kind}",
            "min": [{}], "max": [{}]}}"#,
            ends(f32::min),
            ends(f32::max)
        ));
        self.accessors.len() - 1
    }

    fn indices(&mut self, triangles: &[[u16; 3]]) -> usize {
        let data: Vec<u8> = triangles
            .iter()
            .flatten()
            .flat_map(|i| i.to_le_bytes())
            .collect();
        let (view, count) = (self.view(&data), 3 * triangles.len());
        self.accessors.push(format!(
            r#"{{"bufferView": {view}, "componentType": 5123, "count": {count}, "type": "SCALAR"}}"#
        ));
        self.accessors.len() - 1
    }
}

/// Vertices, normals, texture coordinates and triangles.
struct Surface {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    triangles: Vec<[u16; 3]>,
}

/// Surface over a grid of `columns * rows` cells by `point(u, v)`, which gives position and normal.
fn surface([columns, rows]: [u16; 2], point: impl Fn(f32, f32) -> ([f32; 3], [f32; 3])) -> Surface {
    let mut made = Surface {
        positions: Vec::new(),
        normals: Vec::new(),
        uvs: Vec::new(),
        triangles: Vec::new(),
    };
    for row in 0..=rows {
        for column in 0..=columns {
            let (u, v) = (
                f32::from(column) / f32::from(columns),
                f32::from(row) / f32::from(rows),
            );
            let (position, normal) = point(u, v);
            made.positions.push(position);
            made.normals.push(normal);
            made.uvs.push([u, v]);
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let first = row * (columns + 1) + column;
            let below = first + columns + 1;
            made.triangles.push([first, below, first + 1]);
            made.triangles.push([first + 1, below, below + 1]);
        }
    }
    made
}

/// Sphere of radius 1. v goes from the top to the bottom.
fn ball() -> Surface {
    surface([48, 24], |u, v| {
        let ((sin, cos), (flat, height)) = ((u * TAU).sin_cos(), (v * PI).sin_cos());
        let at = [flat * sin, height, flat * cos];
        (at, at)
    })
}

/// Square of side 2 in the plane z = 0. v goes from the top to the bottom.
fn card() -> Surface {
    surface([1, 1], |u, v| {
        ([2.0 * u - 1.0, 1.0 - 2.0 * v, 0.0], [0.0, 0.0, 1.0])
    })
}

fn primitive(binary: &mut Binary, surface: &Surface, material: usize) -> String {
    let positions = binary.floats(&surface.positions);
    let normals = binary.floats(&surface.normals);
    let uvs = binary.floats(&surface.uvs);
    let indices = binary.indices(&surface.triangles);
    format!(
        r#"{{"primitives": [{{"attributes": {{"POSITION": {positions}, "NORMAL": {normals}, "TEXCOORD_0": {uvs}}},
        "indices": {indices}, "material": {material}}}]}}"#
    )
}

/// Whether (x, y) lies in a dark square of a board of `count` squares across 64 pixels.
fn is_dark(x: u32, y: u32, count: u32) -> bool {
    let size = 64 / count;
    (x / size + y / size) % 2 == 1
}

/// Images of all kinds of textures, 64 x 64: base colour with alpha, metal and roughness, normals, emission, occlusion.
fn images() -> [Vec<u8>; 5] {
    let size = 64;
    let round = |x: u32, y: u32| {
        let (dx, dy) = (f64::from(x % 16) - 7.5, f64::from(y % 16) - 7.5);
        (dx, dy, dx.hypot(dy) / 7.5)
    };
    let color = painted(size, size, |x, y| {
        let (_, _, distance) = round(x, y);
        let alpha = if distance < 1.0 { 255 } else { 30 };
        if is_dark(x, y, 8) {
            [40, 90, 160, alpha]
        } else {
            [230, 200, 120, alpha]
        }
    });
    // Red is unused, green is roughness, blue is metal.
    let metal = painted(size, size, |x, y| {
        let roughness = 60 + 2 * x as u8;
        [0, roughness, if is_dark(x, y, 4) { 255 } else { 0 }, 255]
    });
    let normal = painted(size, size, |x, y| {
        let (dx, dy, distance) = round(x, y);
        if distance >= 1.0 {
            return [128, 128, 255, 255];
        }
        // Domes. Rows go down, the green axis goes up.
        let (nx, ny) = (0.6 * dx / 7.5, -0.6 * dy / 7.5);
        let nz = (1.0 - nx * nx - ny * ny).sqrt();
        let byte = |n: f64| (127.5 * (n + 1.0)).round() as u8;
        [byte(nx), byte(ny), byte(nz), 255]
    });
    let glow = painted(size, size, |x, y| {
        let lit = (16..48).contains(&x) && (28..36).contains(&y);
        if lit {
            [255, 160, 60, 255]
        } else {
            [0, 0, 0, 255]
        }
    });
    let occlusion = painted(size, size, |_, y| [255 - 2 * y as u8, 0, 0, 255]);
    [color, metal, normal, glow, occlusion]
}

/// Bytes of a GLB with all kinds of textures, alpha modes MASK and BLEND, glass, lights of all kinds, a camera, and one
/// mesh in three places.
pub fn all_textures() -> Vec<u8> {
    let mut binary = Binary::default();
    let (ball, card) = (ball(), card());
    let floor = surface([1, 1], |u, v| {
        ([8.0 * u - 4.0, -1.0, 8.0 * v - 4.0], [0.0, 1.0, 0.0])
    });
    let mut small = self::ball();
    small
        .positions
        .iter_mut()
        .flatten()
        .for_each(|x| *x *= 0.25);
    let meshes = [
        (&ball, 0),
        (&floor, 1),
        (&card, 2),
        (&card, 3),
        (&card, 4),
        (&ball, 5),
        (&small, 6),
    ]
    .map(|(surface, material)| primitive(&mut binary, surface, material))
    .join(",\n");
    let views = images().map(|png| binary.view(&png));
    let images = views
        .map(|view| format!(r#"{{"bufferView": {view}, "mimeType": "image/png"}}"#))
        .join(", ");
    let length = binary.bytes.len();
    let json = format!(
        r#"{{"asset": {{"version": "2.0", "generator": "antumbra-testkit"}}, "scene": 0,
"scenes": [{{"nodes": [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]}}],
"extensionsUsed": ["KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_materials_ior",
    "KHR_materials_transmission", "KHR_materials_volume", "KHR_texture_transform", "KHR_materials_sheen"],
"extensions": {{"KHR_lights_punctual": {{"lights": [
    {{"type": "directional", "color": [1, 1, 0.5], "intensity": 3}},
    {{"type": "point", "intensity": 20}},
    {{"type": "spot", "intensity": 40, "spot": {{"innerConeAngle": 0.2, "outerConeAngle": 0.6}}}}]}}}},
"cameras": [{{"type": "perspective", "perspective": {{"yfov": 0.6981317, "aspectRatio": 1.5, "znear": 0.1}}}}],
"nodes": [{{"mesh": 0}}, {{"mesh": 1}}, {{"mesh": 2, "translation": [-2.6, 0, 0]}},
    {{"mesh": 3, "translation": [2.6, 0, 0]}}, {{"mesh": 4, "translation": [0, 2.2, -1]}},
    {{"mesh": 5, "translation": [1.3, -0.4, 1.5], "scale": [0.6, 0.6, 0.6]}},
    {{"mesh": 6, "translation": [-1.6, -0.75, 2]}}, {{"mesh": 6, "translation": [-0.9, -0.75, 2]}},
    {{"mesh": 6, "translation": [-0.2, -0.75, 2], "scale": [1, 1.5, 1]}},
    {{"camera": 0, "translation": [0, 0.4, 9]}},
    {{"rotation": [-0.70710678, 0, 0, 0.70710678], "extensions": {{"KHR_lights_punctual": {{"light": 0}}}}}},
    {{"translation": [1, 2, 3], "extensions": {{"KHR_lights_punctual": {{"light": 1}}}}}},
    {{"translation": [0, 1, 6], "extensions": {{"KHR_lights_punctual": {{"light": 2}}}}}}],
"meshes": [{meshes}],
"materials": [
    {{"name": "painted metal", "pbrMetallicRoughness": {{"baseColorTexture": {{"index": 0}},
        "metallicRoughnessTexture": {{"index": 1}}}}, "normalTexture": {{"index": 2, "scale": 0.5}},
        "occlusionTexture": {{"index": 4}}, "extensions": {{"KHR_materials_sheen": {{}}}}}},
    {{"name": "floor", "pbrMetallicRoughness": {{"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0}}}},
    {{"name": "holes", "alphaMode": "MASK", "alphaCutoff": 0.4, "doubleSided": true,
        "pbrMetallicRoughness": {{"metallicFactor": 0, "baseColorTexture": {{"index": 0, "extensions":
        {{"KHR_texture_transform": {{"offset": [0.25, 0.5], "rotation": 1.57079633, "scale": [2, 3]}}}}}}}}}},
    {{"name": "veil", "alphaMode": "BLEND", "doubleSided": true,
        "pbrMetallicRoughness": {{"metallicFactor": 0, "baseColorFactor": [0.9, 0.3, 0.3, 0.5]}}}},
    {{"name": "lamp", "emissiveFactor": [1, 1, 1], "emissiveTexture": {{"index": 3}}, "doubleSided": true,
        "pbrMetallicRoughness": {{"baseColorFactor": [0.1, 0.1, 0.1, 1], "metallicFactor": 0}},
        "extensions": {{"KHR_materials_emissive_strength": {{"emissiveStrength": 8}}}}}},
    {{"name": "glass", "pbrMetallicRoughness": {{"metallicFactor": 0, "roughnessFactor": 0}}, "extensions": {{
        "KHR_materials_transmission": {{"transmissionFactor": 1}}, "KHR_materials_ior": {{"ior": 1.45}},
        "KHR_materials_volume": {{"thicknessFactor": 1}}}}}},
    {{"name": "gold", "pbrMetallicRoughness": {{"baseColorFactor": [1, 0.77, 0.34, 1], "roughnessFactor": 0.3}}}}],
"textures": [{{"source": 0}}, {{"source": 1}}, {{"source": 2}}, {{"source": 3}}, {{"source": 4}}],
"images": [{images}],
"accessors": [{accessors}],
"bufferViews": [{views}],
"buffers": [{{"byteLength": {length}}}]}}"#,
        accessors = binary.accessors.join(",\n"),
        views = binary.views.join(",\n"),
    );
    glb(json, binary.bytes)
}

/// Bytes of a GLB of balls under one distant light, for comparisons with other renderers: rows of metal 0, 1/2 and 1 with
/// roughness from 0.1 to 1, and a row of balls with textures. No ball shades another one.
pub fn balls() -> Vec<u8> {
    const COLUMNS: usize = 6;
    let mut binary = Binary::default();
    let ball = self::ball();
    let plain = (0..3).flat_map(|row| {
        (0..COLUMNS).map(move |column| {
            let roughness = 0.1 + 0.9 * column as f32 / (COLUMNS - 1) as f32;
            let metallic = 0.5 * row as f32;
            format!(
                r#"{{"pbrMetallicRoughness": {{"baseColorFactor": [0.9, 0.6, 0.2, 1],
                "metallicFactor": {metallic:?}, "roughnessFactor": {roughness:?}}}}}"#
            )
        })
    });
    let color = r#""baseColorTexture": {"index": 0}"#;
    let metal = r#""metallicRoughnessTexture": {"index": 1}"#;
    let normal = r#""normalTexture": {"index": 2, "scale": 0.5}"#;
    let glow = r#""emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 3}"#;
    let matte = r#""metallicFactor": 0"#;
    let textured = [
        format!(r#"{{"pbrMetallicRoughness": {{{matte}, {color}}}}}"#),
        format!(r#"{{"pbrMetallicRoughness": {{{metal}}}}}"#),
        format!(r#"{{"pbrMetallicRoughness": {{{matte}}}, {normal}}}"#),
        format!(r#"{{"pbrMetallicRoughness": {{{matte}}}, {glow}}}"#),
        format!(r#"{{"pbrMetallicRoughness": {{{color}, {metal}}}}}"#),
        format!(r#"{{"pbrMetallicRoughness": {{{color}, {metal}}}, {normal}, {glow}}}"#),
    ];
    let materials: Vec<String> = plain.chain(textured).collect();
    let count = materials.len();
    let meshes: Vec<String> = (0..count)
        .map(|material| primitive(&mut binary, &ball, material))
        .collect();
    let nodes: Vec<String> = (0..count)
        .map(|mesh| {
            let x = 2.5 * ((mesh % COLUMNS) as f32 - 0.5 * (COLUMNS - 1) as f32);
            let y = 2.5 * (1.5 - (mesh / COLUMNS) as f32);
            format!(r#"{{"mesh": {mesh}, "translation": [{x:?}, {y:?}, 0]}}"#)
        })
        .collect();
    let views = images().map(|png| binary.view(&png));
    let images = views
        .map(|view| format!(r#"{{"bufferView": {view}, "mimeType": "image/png"}}"#))
        .join(", ");
    let length = binary.bytes.len();
    let all: Vec<String> = (0..count + 2).map(|node| node.to_string()).collect();
    let json = format!(
        r#"{{"asset": {{"version": "2.0", "generator": "antumbra-testkit"}}, "scene": 0,
"scenes": [{{"nodes": [{all}]}}],
"extensionsUsed": ["KHR_lights_punctual"],
"extensions": {{"KHR_lights_punctual": {{"lights": [{{"type": "directional", "intensity": 3}}]}}}},
"cameras": [{{"type": "perspective", "perspective": {{"yfov": 0.35, "aspectRatio": 1.5, "znear": 0.1}}}}],
"nodes": [{nodes},
    {{"camera": 0, "translation": [0, 0, 30]}},
    {{"rotation": [-0.17, 0.17, 0.03, 0.97], "extensions": {{"KHR_lights_punctual": {{"light": 0}}}}}}],
"meshes": [{meshes}],
"materials": [{materials}],
"textures": [{{"source": 0}}, {{"source": 1}}, {{"source": 2}}, {{"source": 3}}, {{"source": 4}}],
"images": [{images}],
"accessors": [{accessors}],
"bufferViews": [{views}],
"buffers": [{{"byteLength": {length}}}]}}"#,
        all = all.join(", "),
        nodes = nodes.join(",\n    "),
        meshes = meshes.join(",\n"),
        materials = materials.join(",\n"),
        accessors = binary.accessors.join(",\n"),
        views = binary.views.join(",\n"),
    );
    glb(json, binary.bytes)
}

/// A GLB of JSON and a binary chunk.
fn glb(json: String, mut binary: Vec<u8>) -> Vec<u8> {
    let mut json = json.into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let length = 12 + 8 + json.len() + 8 + binary.len();
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((length as u32).to_le_bytes());
    for (kind, data) in [(b"JSON", &json), (b"BIN\0", &binary)] {
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(data);
    }
    bytes
}

/// Files of an OBJ model with a library and a texture: names and contents. The first is the OBJ file.
pub fn obj_with_materials() -> Vec<(&'static str, Vec<u8>)> {
    let mut obj = String::from("# Made by antumbra-testkit\nmtllib looks.mtl\n");
    let mut first = 1;
    let ball = ball();
    let floor = surface([1, 1], |u, v| {
        ([9.0 * u - 4.5, -1.0, 6.0 * v - 3.0], [0.0, 1.0, 0.0])
    });
    let mut add = |surface: &Surface, material: &str, moved: f32| {
        obj += &format!("usemtl {material}\n");
        for ([x, y, z], ([u, v], [nx, ny, nz])) in surface
            .positions
            .iter()
            .zip(surface.uvs.iter().zip(&surface.normals))
        {
            let x = x + moved;
            obj += &format!("v {x} {y} {z}\nvt {u} {}\nvn {nx} {ny} {nz}\n", 1.0 - v);
        }
        for triangle in &surface.triangles {
            let corners = triangle.map(|i| usize::from(i) + first);
            let corner = |i: usize| format!("{i}/{i}/{i}");
            obj += &format!("f {}\n", corners.map(corner).join(" "));
        }
        first += surface.positions.len();
    };
    add(&floor, "floor", 0.0);
    add(&ball, "clay", -3.3);
    add(&ball, "lacquer", -1.1);
    add(&ball, "glass", 1.1);
    add(&ball, "leaves", 3.3);
    let mtl = "newmtl floor\nKd 0.5 0.5 0.5\nillum 1\n\
        newmtl clay\nKd 0.7 0.35 0.2\nillum 1\nmap_Bump -bm 2 dots.png\n\
        newmtl lacquer\nKd 0.5 0.02 0.02\nKs 0.08 0.08 0.08\nNs 400\nillum 2\n\
        newmtl glass\nKd 0 0 0\nNi 1.5\nTf 0.95 1 0.97\nillum 7\n\
        newmtl leaves\nKd 1 1 1\nmap_Kd leaf.png\nmap_d leaf.png\nillum 1\n";
    let dots = painted(64, 64, |x, y| {
        let (dx, dy) = (f64::from(x % 16) - 7.5, f64::from(y % 16) - 7.5);
        let height = (1.0 - dx.hypot(dy) / 7.5).max(0.0).sqrt();
        let byte = (255.0 * height) as u8;
        [byte, byte, byte, 255]
    });
    let leaf = painted(64, 64, |x, y| {
        let (dx, dy) = (f64::from(x % 16) - 7.5, f64::from(y % 32) - 15.5);
        let inside = dx.abs() < 6.0 * (1.0 - (dy / 15.0) * (dy / 15.0));
        [70, 130, 40, if inside { 255 } else { 0 }]
    });
    vec![
        ("model.obj", obj.into_bytes()),
        ("looks.mtl", mtl.as_bytes().to_vec()),
        ("dots.png", dots),
        ("leaf.png", leaf),
    ]
}
