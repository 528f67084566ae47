//! Meshes with a value at every vertex as binary glTF files (.glb, version 2.0).

use std::io::{self, Write};

use antumbra::LocalOrigin;

use crate::ShadedMesh;

/// Part of the data: what it is called, its type, and its numbers.
struct Part {
    /// Name of the attribute; empty for indices.
    name: &'static str,
    kind: &'static str,
    /// Code of the component type: 5126 is `f32`, 5125 `u32`.
    component: u32,
    count: usize,
    bytes: usize,
    /// `min` and `max` of positions.
    extent: String,
}

/// Writes a mesh as a .glb file of one primitive.
///
/// Vertices have POSITION, NORMAL, and COLOR_0: the value three times, or the colour over 255, as numbers from 0 to 1 without a
/// display curve, as glTF has it. Values beyond 0 and 1 become the nearer one, NaN becomes 0. Bent normals, where there are any, are
/// _BENT_NORMAL. The material is white, matt and double-sided.
///
/// # Errors
/// [`io::ErrorKind::InvalidInput`] if the lists differ in length, if a position is not finite, if there is no triangle, or if the file
/// would be larger than 4 GiB. Otherwise errors of the writer.
pub fn write_glb(mesh: &ShadedMesh<'_>, file: &mut dyn Write) -> io::Result<()> {
    let vertices = mesh.positions.len();
    check(mesh)?;
    let bound = |start: f32, pick: fn(f32, f32) -> f32| {
        let fold = |axis: usize| mesh.positions.iter().fold(start, |x, p| pick(x, p[axis]));
        format!("[{},{},{}]", fold(0), fold(1), fold(2))
    };
    let vector = |name, extent| Part {
        name,
        kind: "VEC3",
        component: 5126,
        count: vertices,
        bytes: 12 * vertices,
        extent,
    };
    let low = bound(f32::INFINITY, f32::min);
    let high = bound(f32::NEG_INFINITY, f32::max);
    let mut parts = vec![
        vector("POSITION", format!(r#","min":{low},"max":{high}"#)),
        vector("NORMAL", String::new()),
        vector("COLOR_0", String::new()),
    ];
    if !mesh.bent_normals.is_empty() {
        parts.push(vector("_BENT_NORMAL", String::new()));
    }
    parts.push(Part {
        name: "",
        kind: "SCALAR",
        component: 5125,
        count: 3 * mesh.indices.len(),
        bytes: 12 * mesh.indices.len(),
        extent: String::new(),
    });
    let json = describe(&parts, mesh.local);
    let data: usize = parts.iter().map(|part| part.bytes).sum();
    let total = 12 + 8 + json.len() + 8 + data;
    let size = u32::try_from(total).map_err(|_| invalid("a file of more than 4 GiB"))?;

    file.write_all(b"glTF")?;
    for number in [2, size, json.len() as u32] {
        file.write_all(&number.to_le_bytes())?;
    }
    file.write_all(b"JSON")?;
    file.write_all(json.as_bytes())?;
    file.write_all(&(data as u32).to_le_bytes())?;
    file.write_all(b"BIN\0")?;
    let unit = |normal: &[f32; 3]| {
        let [x, y, z] = normal.map(f64::from);
        // Readers insist on length 1; a vertex without a normal gets some direction.
        crate::vector::unit([x, y, z]).map_or([0.0, 0.0, 1.0], |unit| unit.map(|x| x as f32))
    };
    let colour = |index: usize| match mesh.colours.get(index) {
        Some(colour) => colour.map(|byte| f32::from(byte) / 255.0),
        None if mesh.values[index].is_nan() => [0.0; 3],
        None => [mesh.values[index].clamp(0.0, 1.0); 3],
    };
    let mut put = |vectors: &mut dyn Iterator<Item = [f32; 3]>| -> io::Result<()> {
        for x in vectors.flatten() {
            file.write_all(&x.to_le_bytes())?;
        }
        Ok(())
    };
    put(&mut mesh.positions.iter().copied())?;
    put(&mut mesh.normals.iter().map(unit))?;
    put(&mut (0..vertices).map(colour))?;
    put(&mut mesh.bent_normals.iter().map(unit))?;
    let mut corners = mesh.indices.as_flattened().iter();
    corners.try_for_each(|corner| file.write_all(&corner.to_le_bytes()))
}

/// Refuses meshes that a file cannot hold.
fn check(mesh: &ShadedMesh<'_>) -> io::Result<()> {
    if !mesh.is_whole() || mesh.indices.is_empty() {
        return Err(invalid("a mesh that a .glb file cannot hold"));
    }
    if !mesh.positions.as_flattened().iter().all(|x| x.is_finite()) {
        return Err(invalid(
            "a position that is not finite, which a .glb file cannot hold",
        ));
    }
    Ok(())
}

fn invalid(reason: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, reason.to_owned())
}

/// The JSON part, with spaces behind it up to a multiple of four bytes.
fn describe(parts: &[Part], local: LocalOrigin) -> String {
    let mut attributes = Vec::new();
    let (mut accessors, mut views) = (Vec::new(), Vec::new());
    let mut offset = 0;
    for (index, part) in parts.iter().enumerate() {
        let Part {
            name,
            kind,
            component,
            count,
            bytes,
            extent,
        } = part;
        // Arrays of vertices and of indices have targets of their own.
        let target = if name.is_empty() { 34963 } else { 34962 };
        views.push(format!(
            r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{bytes},"target":{target}}}"#
        ));
        accessors.push(format!(
            r#"{{"bufferView":{index},"componentType":{component},"count":{count},"type":"{kind}"{extent}}}"#
        ));
        if !name.is_empty() {
            attributes.push(format!(r#""{name}":{index}"#));
        }
        offset += bytes;
    }
    let place = match local.origin {
        [0.0, 0.0, 0.0] => String::new(),
        [x, y, z] => format!(r#","translation":[{x},{y},{z}]"#),
    };
    let mut json = format!(
        concat!(
            r#"{{"asset":{{"version":"2.0","generator":"antumbra"}},"scene":0,"scenes":[{{"nodes":[0]}}],"#,
            r#""nodes":[{{"mesh":0{}}}],"materials":[{{"pbrMetallicRoughness":{{"metallicFactor":0}},"doubleSided":true}}],"#,
            r#""meshes":[{{"primitives":[{{"attributes":{{{}}},"indices":{},"material":0}}]}}],"#,
            r#""accessors":[{}],"bufferViews":[{}],"buffers":[{{"byteLength":{}}}]}}"#
        ),
        place,
        attributes.join(","),
        parts.len() - 1,
        accessors.join(","),
        views.join(","),
        offset
    );
    while json.len() % 4 != 0 {
        json.push(' ');
    }
    json
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_places_are_right() {
        let mesh = ShadedMesh {
            positions: &[[1.0, 2.0, 3.0], [-4.0, 5.0, 6.0], [7.0, 8.0, 9.5]],
            local: LocalOrigin::default(),
            normals: &[[0.0, 0.0, 2.0], [0.0; 3], [0.0, 1.0, 0.0]],
            values: &[0.5, 2.0, f32::NAN],
            colours: &[],
            bent_normals: &[],
            indices: &[[0, 1, 2]],
        };
        let mut file = Vec::new();
        write_glb(&mesh, &mut file).expect("written");
        let number = |at: usize| {
            u32::from_le_bytes([file[at], file[at + 1], file[at + 2], file[at + 3]]) as usize
        };
        assert_eq!(
            (&file[..4], number(4), number(8)),
            (&b"glTF"[..], 2, file.len())
        );
        let json = number(12);
        assert_eq!((json % 4, &file[16..20]), (0, &b"JSON"[..]));
        let text = String::from_utf8_lossy(&file[20..20 + json]);
        assert!(text.contains(r#""min":[-4,2,3],"max":[7,8,9.5]"#), "{text}");
        assert!(
            text.contains(r#""COLOR_0":2"#) && text.contains(r#""indices":3"#),
            "{text}"
        );
        let data = 20 + json + 8;
        assert_eq!(number(20 + json), file.len() - data);
        let colours = &file[data + 72..data + 108];
        let red = |vertex: usize| {
            f32::from_le_bytes(colours[12 * vertex..][..4].try_into().expect("four"))
        };
        assert_eq!([red(0), red(1), red(2)], [0.5, 1.0, 0.0]);
        assert_eq!(
            file[file.len() - 12..],
            [0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]
        );
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let mesh = ShadedMesh {
            positions: &[[f32::NAN, 0.0, 0.0]],
            local: LocalOrigin::default(),
            normals: &[[0.0; 3]],
            values: &[0.0],
            colours: &[],
            bent_normals: &[],
            indices: &[[0, 0, 0]],
        };
        assert!(write_glb(&mesh, &mut Vec::new()).is_err());
        let none = ShadedMesh {
            positions: &[[0.0; 3]],
            local: LocalOrigin::default(),
            indices: &[],
            ..mesh
        };
        assert!(write_glb(&none, &mut Vec::new()).is_err());
    }
}
