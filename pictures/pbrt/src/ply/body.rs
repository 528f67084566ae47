//! Body of a PLY file: the values.
//!
//! The reader of elements is generic over the source of single values: words of an ASCII file, or bytes in either
//! order.

use antumbra_scene::TriangleMesh;
use glam::{DVec3, Vec2};

use super::header::{Element, Format, Header, Kind, Scalar};
use super::{Fault, PlyPlace};
use crate::params::shorten;

/// Source of single values.
trait Values {
    /// Next value. Every integer type of PLY is exact in an `f64`.
    fn next(&mut self, scalar: Scalar) -> Result<f64, Problem>;
    /// Skips values.
    fn skip(&mut self, scalar: Scalar, count: u64) -> Result<(), Problem>;
    /// Place of the last value read.
    fn place(&self) -> PlyPlace;
    /// Number of bytes that are not read yet.
    fn remaining(&self) -> u64;
}

/// Reason why there is no next value. The type is small, because every value is returned with it.
enum Problem {
    End,
    NotANumber,
}

/// Reads the mesh, seen from `origin`, with colours of the vertices if they are wanted and there.
pub(super) fn parse(
    bytes: &[u8],
    header: &Header,
    wants_colors: bool,
    origin: DVec3,
) -> Result<TriangleMesh, Fault> {
    let body = &bytes[header.body..];
    match header.format {
        Format::Ascii => read(
            Ascii {
                bytes: body,
                at: 0,
                word: 0..0,
                line: header.body_line,
            },
            header,
            wants_colors,
            origin,
        ),
        Format::LittleEndian => read(
            Binary::<false> {
                bytes,
                at: header.body,
                last: header.body,
            },
            header,
            wants_colors,
            origin,
        ),
        Format::BigEndian => read(
            Binary::<true> {
                bytes,
                at: header.body,
                last: header.body,
            },
            header,
            wants_colors,
            origin,
        ),
    }
}

fn read(
    mut values: impl Values,
    header: &Header,
    wants_colors: bool,
    origin: DVec3,
) -> Result<TriangleMesh, Fault> {
    let required = |name: &str| match header.element(name) {
        Some(element) if element.count > 0 => Ok(element),
        Some(element) => Err(Fault::new(
            PlyPlace::Line(element.line),
            format!("the file has no {name} (element {name} 0)"),
        )),
        None => Err(Fault::new(
            PlyPlace::Line(header.body_line - 1),
            format!("the header declares no element {name}"),
        )),
    };
    let vertices = Vertices::new(required("vertex")?, wants_colors)?;
    let faces = Faces::new(required("face")?, vertices.element.count)?;
    let mut mesh = TriangleMesh::default();
    for element in &header.elements {
        check_size(element, header.format, values.remaining())?;
        match element.name.as_str() {
            "vertex" => vertices.read(&mut values, origin, &mut mesh)?,
            "face" => faces.read(&mut values, &mut mesh)?,
            _ => skip_element(&mut values, element, header.format)?,
        }
    }
    Ok(mesh)
}

/// Compares a declared count with the rest of the file.
fn check_size(element: &Element, format: Format, remaining: u64) -> Result<(), Fault> {
    // The last number of an ASCII file needs no space after it.
    let slack = u64::from(format == Format::Ascii);
    let least = element.count.checked_mul(element.min_size(format));
    if least.is_some_and(|least| least <= remaining + slack) {
        return Ok(());
    }
    let Element { name, count, .. } = element;
    let name = shorten(name);
    Err(Fault::new(
        PlyPlace::Line(element.line),
        format!("element {name} declares {count}, which {remaining} bytes cannot hold"),
    )
    .help("the file is cut short, or its header is wrong"))
}

/// Makes the mistake for a missing or wrong value of item `index` of `what`.
fn fault(values: &impl Values, problem: Problem, what: &str, index: u64) -> Fault {
    let message = match problem {
        Problem::End => format!("the file ends in {what} {index}"),
        Problem::NotANumber => format!("{what} {index}: the value is not a number"),
    };
    Fault::new(values.place(), message)
}

fn skip_element(values: &mut impl Values, element: &Element, format: Format) -> Result<(), Fault> {
    if element.properties.is_empty() {
        return Ok(());
    }
    if format != Format::Ascii && element.has_fixed_size() {
        let bytes = element.count * element.min_size(format);
        return values
            .skip(Scalar::U8, bytes)
            .map_err(|p| fault(values, p, &element.name, 0));
    }
    for index in 0..element.count {
        for property in &element.properties {
            skip_property(values, property.kind)
                .map_err(|p| fault(values, p, &shorten(&element.name), index))?;
        }
    }
    Ok(())
}

fn skip_property(values: &mut impl Values, kind: Kind) -> Result<(), Problem> {
    match kind {
        Kind::Scalar(scalar) => values.skip(scalar, 1),
        Kind::List { count, item } => {
            let count = list_length(values.next(count)?)?;
            values.skip(item, count)
        }
    }
}

/// Length of a list as a count, which must be an integer of at least 0.
fn list_length(value: f64) -> Result<u64, Problem> {
    if value >= 0.0 && value.fract() == 0.0 {
        Ok(value as u64)
    } else {
        Err(Problem::NotANumber)
    }
}

/// Linear value of an sRGB-encoded one (IEC 61966-2-1).
fn linear(encoded: f64) -> f32 {
    let value = if encoded <= 0.04045 {
        encoded / 12.92
    } else {
        libm::pow((encoded + 0.055) / 1.055, 2.4)
    };
    value as f32
}

/// Reader of the `vertex` element.
struct Vertices<'a> {
    element: &'a Element,
    /// Place of every property in a row of x y z, nx ny nz, u v, r g b.
    slots: Vec<Option<usize>>,
    has_normals: bool,
    has_uvs: bool,
    /// Factor that makes colours fractions of 1. `None` without colours.
    color_scale: Option<f64>,
}

impl<'a> Vertices<'a> {
    fn new(element: &'a Element, wants_colors: bool) -> Result<Self, Fault> {
        let place = PlyPlace::Line(element.line);
        let mut slots = vec![None; element.properties.len()];
        // The names count only if all of them exist as scalars.
        let mut assign = |names: &[&str], first: usize| {
            let found: Option<Vec<usize>> = names
                .iter()
                .map(|name| {
                    let index = element.position(name)?;
                    matches!(element.properties[index].kind, Kind::Scalar(_)).then_some(index)
                })
                .collect();
            for (offset, index) in found.iter().flatten().enumerate() {
                slots[*index] = Some(first + offset);
            }
            found.is_some()
        };
        if !assign(&["x", "y", "z"], 0) {
            return Err(Fault::new(
                place,
                "element vertex has no properties x, y and z",
            ));
        }
        let has_normals = assign(&["nx", "ny", "nz"], 3);
        // Names that pbrt-v3 looks for, in its order.
        let has_uvs = [
            ["u", "v"],
            ["s", "t"],
            ["texture_u", "texture_v"],
            ["texture_s", "texture_t"],
        ]
        .iter()
        .any(|names| assign(names, 6));
        let has_colors = wants_colors
            && [
                ["red", "green", "blue"],
                ["r", "g", "b"],
                ["diffuse_red", "diffuse_green", "diffuse_blue"],
            ]
            .iter()
            .any(|names| assign(names, 8));
        let color_scale = has_colors.then(|| {
            let first = slots.iter().position(|slot| *slot == Some(8));
            match first.map(|index| element.properties[index].kind) {
                Some(Kind::Scalar(Scalar::U8)) => 1.0 / 255.0,
                Some(Kind::Scalar(Scalar::U16)) => 1.0 / 65535.0,
                _ => 1.0,
            }
        });
        if element.count > u64::from(u32::MAX) {
            return Err(Fault::new(place, "more vertices than 32 bits can count"));
        }
        Ok(Self {
            element,
            slots,
            has_normals,
            has_uvs,
            color_scale,
        })
    }

    fn read(
        &self,
        values: &mut impl Values,
        origin: DVec3,
        mesh: &mut TriangleMesh,
    ) -> Result<(), Fault> {
        // The count was compared with the file, so memory is a small multiple of the file's size.
        let count = self.element.count as usize;
        mesh.positions.reserve_exact(count);
        mesh.normals
            .reserve_exact(if self.has_normals { count } else { 0 });
        mesh.uvs.reserve_exact(if self.has_uvs { count } else { 0 });
        if self.color_scale.is_some() {
            mesh.colors.reserve_exact(count);
        }
        let mut row = [0.0; 11];
        for index in 0..self.element.count {
            for (property, slot) in self.element.properties.iter().zip(&self.slots) {
                let result = match (property.kind, slot) {
                    (Kind::Scalar(scalar), Some(slot)) => {
                        values.next(scalar).map(|value| row[*slot] = value)
                    }
                    (kind, _) => skip_property(values, kind),
                };
                result.map_err(|p| fault(values, p, "vertex", index))?;
            }
            let [x, y, z, nx, ny, nz, u, v, rgb @ ..] = row;
            let position = DVec3::new(x, y, z) - origin;
            mesh.positions.push(position.as_vec3().into());
            if self.has_normals {
                let normal = DVec3::new(nx, ny, nz);
                let unit = normal.try_normalize().unwrap_or(normal);
                mesh.normals.push(unit.as_vec3());
            }
            if self.has_uvs {
                mesh.uvs.push(Vec2::new(u as f32, v as f32));
            }
            if let Some(scale) = self.color_scale {
                // Integers are encoded as for displays. Floats are taken as linear.
                let color = rgb.map(|value| match scale {
                    1.0 => value as f32,
                    scale => linear(value * scale),
                });
                mesh.colors.push(color.into());
            }
        }
        Ok(())
    }
}

/// Reader of the `face` element.
struct Faces<'a> {
    element: &'a Element,
    vertex_count: u64,
    /// Index of the property that lists vertices.
    list: usize,
}

impl<'a> Faces<'a> {
    fn new(element: &'a Element, vertex_count: u64) -> Result<Self, Fault> {
        let list = ["vertex_indices", "vertex_index"]
            .iter()
            .find_map(|name| element.position(name))
            .filter(|index| matches!(element.properties[*index].kind, Kind::List { .. }));
        let Some(list) = list else {
            let place = PlyPlace::Line(element.line);
            return Err(Fault::new(place, "element face has no list vertex_indices"));
        };
        Ok(Self {
            element,
            vertex_count,
            list,
        })
    }

    fn read(&self, values: &mut impl Values, mesh: &mut TriangleMesh) -> Result<(), Fault> {
        mesh.indices.reserve(self.element.count as usize);
        for index in 0..self.element.count {
            for (i, property) in self.element.properties.iter().enumerate() {
                match property.kind {
                    Kind::List { count, item } if i == self.list => {
                        self.read_face(values, index, count, item, mesh)?;
                    }
                    kind => {
                        skip_property(values, kind).map_err(|p| fault(values, p, "face", index))?
                    }
                }
            }
        }
        Ok(())
    }

    #[inline]
    fn read_face(
        &self,
        values: &mut impl Values,
        index: u64,
        count: Scalar,
        item: Scalar,
        mesh: &mut TriangleMesh,
    ) -> Result<(), Fault> {
        let at_face = |values: &_, problem| fault(values, problem, "face", index);
        let length = values.next(count).map_err(|p| at_face(values, p))?;
        if length != 3.0 && length != 4.0 {
            return Err(Fault::new(
                values.place(),
                format!("face {index} has {length} vertices"),
            )
            .help("split it into triangles or quads"));
        }
        let mut corners = [0; 4];
        for corner in corners.iter_mut().take(length as usize) {
            let vertex = values.next(item).map_err(|p| at_face(values, p))?;
            // The cast saturates, so negative numbers, NaN and fractions differ from their result.
            *corner = vertex as u32;
            if f64::from(*corner) != vertex || u64::from(*corner) >= self.vertex_count {
                return Err(self.bad_index(values, index, vertex));
            }
        }
        let [a, b, c, d] = corners;
        mesh.indices.push([a, b, c]);
        if length == 4.0 {
            mesh.indices.push([a, c, d]);
        }
        Ok(())
    }

    #[cold]
    fn bad_index(&self, values: &impl Values, face: u64, vertex: f64) -> Fault {
        let count = self.vertex_count;
        Fault::new(
            values.place(),
            format!("face {face}: vertex index {vertex} is not one of the {count} vertices"),
        )
        .help(format!("indices are 0 to {}", count - 1))
    }
}

/// Source of values in ASCII files.
struct Ascii<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Range of the last word read.
    word: std::ops::Range<usize>,
    line: u64,
}

impl Ascii<'_> {
    fn next_word(&mut self) -> Result<(), Problem> {
        while let Some(byte) = self.bytes.get(self.at) {
            match byte {
                b'\n' => self.line += 1,
                b'\r' if self.bytes.get(self.at + 1) != Some(&b'\n') => self.line += 1,
                byte if byte.is_ascii_whitespace() => {}
                _ => break,
            }
            self.at += 1;
        }
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(u8::is_ascii_whitespace);
        let length = length.unwrap_or(rest.len());
        self.word = self.at..self.at + length;
        self.at += length;
        if length == 0 {
            return Err(Problem::End);
        }
        Ok(())
    }
}

impl Values for Ascii<'_> {
    fn next(&mut self, _: Scalar) -> Result<f64, Problem> {
        self.next_word()?;
        std::str::from_utf8(&self.bytes[self.word.clone()])
            .ok()
            .and_then(|word| word.parse().ok())
            .ok_or(Problem::NotANumber)
    }

    fn skip(&mut self, _: Scalar, count: u64) -> Result<(), Problem> {
        // Ends with the file at the latest, whatever the count.
        (0..count).try_for_each(|_| self.next_word())
    }

    fn place(&self) -> PlyPlace {
        PlyPlace::Line(self.line)
    }

    fn remaining(&self) -> u64 {
        (self.bytes.len() - self.at) as u64
    }
}

/// Source of values in binary files, in big-endian order if `BIG`.
struct Binary<'a, const BIG: bool> {
    bytes: &'a [u8],
    at: usize,
    /// Offset of the last value read.
    last: usize,
}

impl<const BIG: bool> Binary<'_, BIG> {
    #[inline]
    fn take<const N: usize>(&mut self) -> Result<[u8; N], Problem> {
        self.last = self.at;
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let mut bytes = *rest.first_chunk::<N>().ok_or(Problem::End)?;
        self.at += N;
        if BIG {
            bytes.reverse();
        }
        Ok(bytes)
    }
}

impl<const BIG: bool> Values for Binary<'_, BIG> {
    #[inline]
    fn next(&mut self, scalar: Scalar) -> Result<f64, Problem> {
        Ok(match scalar {
            Scalar::I8 => i8::from_le_bytes(self.take()?).into(),
            Scalar::U8 => u8::from_le_bytes(self.take()?).into(),
            Scalar::I16 => i16::from_le_bytes(self.take()?).into(),
            Scalar::U16 => u16::from_le_bytes(self.take()?).into(),
            Scalar::I32 => i32::from_le_bytes(self.take()?).into(),
            Scalar::U32 => u32::from_le_bytes(self.take()?).into(),
            Scalar::F32 => f32::from_le_bytes(self.take()?).into(),
            Scalar::F64 => f64::from_le_bytes(self.take()?),
        })
    }

    fn skip(&mut self, scalar: Scalar, count: u64) -> Result<(), Problem> {
        self.last = self.at;
        let bytes = count.checked_mul(scalar.size() as u64);
        match bytes {
            Some(bytes) if bytes <= self.remaining() => {
                self.at += bytes as usize;
                Ok(())
            }
            _ => Err(Problem::End),
        }
    }

    fn place(&self) -> PlyPlace {
        PlyPlace::Byte(self.last as u64)
    }

    fn remaining(&self) -> u64 {
        (self.bytes.len() - self.at) as u64
    }
}
