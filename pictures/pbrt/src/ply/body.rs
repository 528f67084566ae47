//! Body of a PLY file: the values.
//!
//! The reader of elements is generic over the source of single values: words of an ASCII file, or bytes in either
//! order.

use antumbra_scene::{TriangleMesh, polygon};
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
    /// Notes that one of the items called `what` is complete.
    fn end_item(&mut self, _what: &'static str) {}
}

/// Reason why there is no next value. The type is small, because every value is returned with it.
enum Problem {
    End,
    NotANumber,
}

/// Reads the mesh, seen from `origin`, with colours of the vertices if they are wanted and there. Also returns how many faces
/// have fewer than three corners.
pub(super) fn parse(
    bytes: &[u8],
    header: &Header,
    most_triangles: u64,
    wants_colors: bool,
    origin: DVec3,
) -> Result<(TriangleMesh, u64), Fault> {
    let wanted = Wanted {
        most_triangles,
        wants_colors,
        origin,
    };
    let at = header.body;
    match header.format {
        Format::Ascii => {
            let mut values = Ascii {
                bytes: &bytes[at..],
                at: 0,
                word: 0..0,
                line: header.body_line,
                words: 0,
                crowded: None,
            };
            let read = read(&mut values, header, &wanted);
            values.judge(read)
        }
        Format::LittleEndian => {
            let last = at;
            read(&mut Binary::<false> { bytes, at, last }, header, &wanted)
        }
        Format::BigEndian => {
            let last = at;
            read(&mut Binary::<true> { bytes, at, last }, header, &wanted)
        }
    }
}

/// What a caller wants of a mesh.
struct Wanted {
    most_triangles: u64,
    wants_colors: bool,
    origin: DVec3,
}

fn read(
    values: &mut impl Values,
    header: &Header,
    wanted: &Wanted,
) -> Result<(TriangleMesh, u64), Fault> {
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
    let vertices = Vertices::new(required("vertex")?, wanted.wants_colors)?;
    let has_strips = |element: &&Element| element.name == STRIPS && element.count > 0;
    if !header.elements.iter().any(|element| has_strips(&element)) {
        required("face")?;
    }
    let mut mesh = TriangleMesh::default();
    let mut faces = Faces {
        vertex_count: vertices.element.count,
        most_triangles: wanted.most_triangles.min(u32::MAX.into()),
        corners: Vec::new(),
        unsplit: Vec::new(),
        flat: 0,
    };
    for element in &header.elements {
        check_size(element, header.format, values.remaining())?;
        match element.name.as_str() {
            "vertex" => vertices.read(values, wanted.origin, &mut mesh)?,
            "face" | STRIPS if element.count > 0 => faces.read(values, element, &mut mesh)?,
            _ => skip_element(values, element, header.format)?,
        }
    }
    for (first, count) in std::mem::take(&mut faces.unsplit) {
        split(&mut mesh, first as usize, count as usize);
    }
    Ok((mesh, faces.flat))
}

/// Splits the last triangles of a mesh, or others, which are a fan, if the polygon has inward corners.
fn split(mesh: &mut TriangleMesh, first: usize, count: usize) {
    let positions = &mesh.positions;
    polygon::split(&mut mesh.indices[first..first + count], |corner: u32| {
        DVec3::from(positions[corner as usize].map(f64::from))
    });
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
        values.end_item("item");
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
            values.end_item("vertex");
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

/// Reader of the elements `face` and `tristrips`.
struct Faces {
    vertex_count: u64,
    most_triangles: u64,
    /// Corners of the current face, or of a part of a strip.
    corners: Vec<u32>,
    /// First triangle and number of triangles of polygons that were read before their vertices.
    unsplit: Vec<(u32, u32)>,
    /// Number of faces of fewer than three corners.
    flat: u64,
}

/// Element of lists of vertices in which each one makes a triangle with the two before it.
const STRIPS: &str = "tristrips";

impl Faces {
    fn read(
        &mut self,
        values: &mut impl Values,
        element: &Element,
        mesh: &mut TriangleMesh,
    ) -> Result<(), Fault> {
        let list = ["vertex_indices", "vertex_index"]
            .iter()
            .find_map(|name| element.position(name))
            .filter(|index| matches!(element.properties[*index].kind, Kind::List { .. }));
        let Element { name, line, .. } = element;
        let Some(list) = list else {
            let message = format!("element {name} has no list vertex_indices");
            return Err(Fault::new(PlyPlace::Line(*line), message));
        };
        let strips = name == STRIPS;
        let what = if strips { "strip" } else { "face" };
        mesh.indices.reserve(element.count as usize);
        for index in 0..element.count {
            for (i, property) in element.properties.iter().enumerate() {
                match property.kind {
                    Kind::List { count, item } if i == list => {
                        let length = values.next(count).and_then(list_length);
                        let length = length.map_err(|p| fault(values, p, what, index))?;
                        if length.saturating_add(mesh.indices.len() as u64)
                            > self.most_triangles + 2
                        {
                            return Err(self.too_many(values));
                        }
                        self.corners.clear();
                        for _ in 0..length {
                            let vertex = values.next(item);
                            let vertex = vertex.map_err(|p| fault(values, p, what, index))?;
                            if strips && vertex == -1.0 {
                                self.strip(mesh);
                                continue;
                            }
                            // The cast saturates, so negative numbers, NaN and fractions differ from their result.
                            let corner = vertex as u32;
                            if f64::from(corner) != vertex || u64::from(corner) >= self.vertex_count
                            {
                                return Err(self.bad_index(values, what, index, vertex));
                            }
                            self.corners.push(corner);
                        }
                        match strips {
                            true => self.strip(mesh),
                            false => self.face(mesh),
                        }
                    }
                    kind => {
                        skip_property(values, kind).map_err(|p| fault(values, p, what, index))?
                    }
                }
            }
            values.end_item(what);
        }
        Ok(())
    }

    /// Adds the triangles of a polygon.
    #[inline]
    fn face(&mut self, mesh: &mut TriangleMesh) {
        let (&[a, b, c, ref rest @ ..], first) = (&self.corners[..], mesh.indices.len()) else {
            self.flat += 1;
            return;
        };
        mesh.indices.push([a, b, c]);
        let mut last = c;
        for &corner in rest {
            mesh.indices.push([a, last, corner]);
            last = corner;
        }
        match rest.len() + 1 {
            1 => {}
            count if mesh.positions.len() as u64 == self.vertex_count => split(mesh, first, count),
            count => self.unsplit.push((first as u32, count as u32)),
        }
    }

    /// Adds the triangles of a strip, every other one with two corners exchanged, so that all face to one side.
    fn strip(&mut self, mesh: &mut TriangleMesh) {
        for (index, corners) in self.corners.windows(3).enumerate() {
            let [a, b, c] = [corners[0], corners[1], corners[2]];
            mesh.indices
                .push(if index % 2 == 0 { [a, b, c] } else { [b, a, c] });
        }
        self.corners.clear();
    }

    #[cold]
    fn too_many(&self, values: &impl Values) -> Fault {
        let most = self.most_triangles;
        Fault::new(
            values.place(),
            format!("the mesh has more triangles than the {most} for which memory is allowed"),
        )
    }

    #[cold]
    fn bad_index(&self, values: &impl Values, what: &str, index: u64, vertex: f64) -> Fault {
        let count = self.vertex_count;
        Fault::new(
            values.place(),
            format!("{what} {index}: vertex index {vertex} is not one of the {count} vertices"),
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
    /// Number of words of the current item.
    words: u64,
    /// First line on which something follows an item, with the words on it, the words of the item, and its name.
    crowded: Option<(u64, u64, u64, &'static str)>,
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
        self.words += 1;
        if length == 0 {
            return Err(Problem::End);
        }
        Ok(())
    }

    /// The mesh, unless a line has more values than its item and the values do not end with the file. Then items are cut
    /// at the wrong places. A file that has all its values on one line is as good as others.
    fn judge(
        mut self,
        read: Result<(TriangleMesh, u64), Fault>,
    ) -> Result<(TriangleMesh, u64), Fault> {
        let Some((line, found, declared, what)) = self.crowded else {
            return read;
        };
        if read.is_ok() && self.next_word().is_err() {
            return read;
        }
        let message = format!(
            "the line has {found} values, but the header declares {declared} for this {what}"
        );
        Err(Fault::new(PlyPlace::Line(line), message))
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

    fn end_item(&mut self, what: &'static str) {
        let declared = std::mem::take(&mut self.words);
        if self.crowded.is_none() {
            let is_end = |byte: &u8| matches!(byte, b'\n' | b'\r');
            let line = self.bytes[self.at..]
                .split(is_end)
                .next()
                .unwrap_or_default();
            let more = line
                .split(u8::is_ascii_whitespace)
                .filter(|word| !word.is_empty());
            let more = more.count() as u64;
            if more > 0 {
                self.crowded = Some((self.line, declared + more, declared, what));
            }
        }
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
