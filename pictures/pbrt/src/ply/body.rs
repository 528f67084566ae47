//! Body of a PLY file: its vertices and faces, from any source of single values.

use antumbra_scene::{TriangleMesh, polygon};
use glam::{DVec3, Vec2};

use super::header::{Element, Format, Header, Kind, Scalar};
use super::values::{Ascii, Binary, Problem, Values};
use super::{Fault, Wanted};
use crate::params::shorten;

/// Reads the mesh, seen from an origin, with colours of the vertices if they are wanted and there. Also returns how many faces
/// have fewer than three corners.
pub(super) fn parse(
    bytes: &[u8],
    header: &Header,
    most_triangles: u64,
    wanted: &Wanted,
) -> Result<(TriangleMesh, u64), Fault> {
    let at = header.body;
    match header.format {
        Format::Ascii => {
            let mut values = Ascii::new(&bytes[at..], header.body_line);
            let read = read(&mut values, header, most_triangles, wanted);
            values.judge(read)
        }
        Format::LittleEndian => {
            let mut values = Binary::<false>::new(bytes, at);
            read(&mut values, header, most_triangles, wanted)
        }
        Format::BigEndian => {
            let mut values = Binary::<true>::new(bytes, at);
            read(&mut values, header, most_triangles, wanted)
        }
    }
}

fn read(
    values: &mut impl Values,
    header: &Header,
    most_triangles: u64,
    wanted: &Wanted,
) -> Result<(TriangleMesh, u64), Fault> {
    let required = |name: &str| match header.element(name) {
        Some(element) if element.count > 0 => Ok(element),
        Some(element) => {
            let message = format!("the file has no {name} (element {name} 0)");
            Err(Fault::at_line(element.line, message))
        }
        None => {
            let message = format!("the header declares no element {name}");
            Err(Fault::at_line(header.body_line - 1, message))
        }
    };
    let vertices = Vertices::new(required("vertex")?, wanted.colors)?;
    let has_strips = |element: &&Element| element.name == STRIPS && element.count > 0;
    if !header.elements.iter().any(|element| has_strips(&element)) {
        required("face")?;
    }
    let mut mesh = TriangleMesh::default();
    let mut faces = Faces {
        vertex_count: vertices.element.count,
        most_triangles: most_triangles.min(u32::MAX.into()),
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
    let message = format!("element {name} declares {count}, which {remaining} bytes cannot hold");
    let help = "the file is cut short, or its header is wrong";
    Err(Fault::at_line(element.line, message).help(help))
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
        let mistake = |message| Err(Fault::at_line(element.line, message));
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
            return mistake("element vertex has no properties x, y and z");
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
            return mistake("more vertices than 32 bits can count");
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
            return Err(Fault::at_line(*line, message));
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
        let message =
            format!("the mesh has more triangles than the {most} for which memory is allowed");
        Fault::new(values.place(), message)
    }

    #[cold]
    fn bad_index(&self, values: &impl Values, what: &str, index: u64, vertex: f64) -> Fault {
        let count = self.vertex_count;
        let message =
            format!("{what} {index}: vertex index {vertex} is not one of the {count} vertices");
        Fault::new(values.place(), message).help(format!("indices are 0 to {}", count - 1))
    }
}
