//! glTF 2.0 (`.gltf` and `.glb`): the triangles of a file's scene with their base colours, read by the crate `gltf`.
//!
//! Every primitive becomes a shape in world space. Materials are diffuse, in the base colour factor of the file's
//! materials. Textures, metalness, emission, lights, cameras, points and lines are ignored. Skins and morph targets are
//! shown at rest. Unsupported ways to define surfaces, such as compression and sparse accessors, are errors.
//!
//! Version 1.4.1 of the crate panics on a few broken files. Some numbers are therefore checked first, where comments
//! say so. Buffers are opened here, because the crate would add image decoders as dependencies.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::buffer::Source;
use ::gltf::json::validation::{self, Checked, Validate};
use ::gltf::mesh::Mode;
use ::gltf::{Accessor, Buffer, Document, Gltf, Mesh, Node, Primitive, Semantic, json};
use antumbra_scene::{Geometry, Material, Rgb, Shape, TriangleMesh};
use data_url::{DataUrl, DataUrlError};
use glam::{Mat3, Mat4, Vec3};
use percent_encoding::percent_decode_str;

use crate::{Error, file};

/// Prefixes of extensions that change the look of surfaces, not their geometry. Such extensions are ignored.
const APPEARANCE_EXTENSIONS: &[&str] = &[
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "KHR_lights_",
];
const INDEX_TYPES: &[DataType] = &[DataType::U8, DataType::U16, DataType::U32];

/// Largest number of mistakes in an error. A broken file may have millions.
const MAX_MISTAKES_SHOWN: usize = 20;

/// Reads the shapes of a glTF file's scene, and their materials.
///
/// The file, all buffers and all meshes may take `max_bytes` each. The limit matters even for a small file, which may
/// use one buffer or mesh any number of times. Files that the glTF file names are looked up in its folder.
///
/// # Errors
/// [`Error::Io`], or [`Error::Broken`] with the first mistakes.
pub fn load_gltf(path: &Path, max_bytes: u64) -> Result<(Vec<Shape>, Vec<Material>), Error> {
    let bytes = file::read(path, max_bytes, is_gltf).map_err(Error::io(path))?;
    parse_gltf(&bytes, path, max_bytes)
}

/// A file that is neither JSON nor a GLB is refused before it is read.
fn is_gltf(start: &[u8]) -> Result<(), String> {
    if start.starts_with(b"glTF") || !start.contains(&0) {
        return Ok(());
    }
    Err("not a glTF file: it is neither JSON nor a GLB".to_owned())
}

/// Bytes that a JSON object and a JSON value take at most when they are read, beside the text.
const PER_OBJECT: u64 = 320;
const PER_VALUE: u64 = 16;
/// Bytes that the JSON may always take.
const ALWAYS: u64 = 1 << 20;

/// Checks the memory that the JSON of a file needs, which is far more than its text: an empty node has two bytes.
///
/// Brackets and commas in strings count, too. In a GLB, so do those of binary data, but only up to the JSON's length.
fn check_json(bytes: &[u8], max_bytes: u64) -> Result<(), Vec<String>> {
    let json = match bytes.strip_prefix(b"glTF") {
        Some(rest) => {
            let length = rest.get(8..12).and_then(<[u8]>::first_chunk::<4>);
            let length = length.map_or(0, |&length| u32::from_le_bytes(length) as usize);
            let json = rest.get(16..).unwrap_or_default();
            &json[..length.min(json.len())]
        }
        None => bytes,
    };
    let count = |byte: u8| json.iter().filter(|&&b| b == byte).count() as u64;
    let needed = json.len() as u64 + PER_OBJECT * count(b'{') + PER_VALUE * count(b',');
    if needed <= max_bytes.max(ALWAYS) {
        return Ok(());
    }
    Err(vec![format!(
        "the JSON needs {needed} bytes of memory, more than the {max_bytes} bytes that are allowed"
    )])
}

/// Reads the bytes of a glTF file. Errors name `path`, and files are looked up in its folder.
///
/// # Errors
/// [`Error::Broken`], as for [`load_gltf`].
pub fn parse_gltf(
    bytes: &[u8],
    path: &Path,
    max_bytes: u64,
) -> Result<(Vec<Shape>, Vec<Material>), Error> {
    let folder = path.parent().unwrap_or(Path::new(""));
    parse(bytes, folder, max_bytes).map_err(|mistakes| {
        let shown = mistakes.iter().take(MAX_MISTAKES_SHOWN);
        let mut lines: Vec<_> = shown
            .map(|mistake| format!("error: {}: {mistake}", path.display()))
            .collect();
        if mistakes.len() > MAX_MISTAKES_SHOWN {
            lines.push(format!("and {} more", mistakes.len() - MAX_MISTAKES_SHOWN));
        }
        Error::Broken(lines)
    })
}

/// Lists the files that a glTF file names as its buffers. Reads the JSON of the file only.
///
/// # Errors
/// [`Error::Io`]. A file without valid JSON names no files.
pub fn gltf_files(path: &Path, max_bytes: u64) -> Result<Vec<PathBuf>, Error> {
    let bytes = json_of(path, max_bytes).map_err(Error::io(path))?;
    let Ok(root) = json::Root::from_slice(&bytes) else {
        return Ok(Vec::new());
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let uris = root
        .buffers
        .iter()
        .filter_map(|buffer| buffer.uri.as_deref());
    let is_file = |uri: &&str| {
        !uri.contains("://") && matches!(DataUrl::process(uri), Err(DataUrlError::NotADataUrl))
    };
    let names = uris.filter(is_file).filter_map(|uri| {
        let name = percent_decode_str(uri).decode_utf8().ok()?;
        Some(folder.join(&*name))
    });
    Ok(names.collect())
}

/// JSON of a file: the first chunk of a GLB, or all of a glTF.
fn json_of(path: &Path, max_bytes: u64) -> io::Result<Vec<u8>> {
    const GLB_HEADER: usize = 20;
    let mut head = Vec::new();
    let mut file = File::open(path)?.take(GLB_HEADER as u64);
    file.read_to_end(&mut head)?;
    let length = head.get(12..16).and_then(<[u8]>::first_chunk::<4>);
    match length {
        Some(&length) if head.starts_with(b"glTF") => {
            let length = u64::from(u32::from_le_bytes(length)).min(max_bytes);
            let mut bytes = Vec::new();
            file.into_inner().take(length).read_to_end(&mut bytes)?;
            Ok(bytes)
        }
        _ => file::read(path, max_bytes, is_gltf),
    }
}

/// Reads the shapes and materials, or lists all mistakes.
fn parse(
    bytes: &[u8],
    folder: &Path,
    max_bytes: u64,
) -> Result<(Vec<Shape>, Vec<Material>), Vec<String>> {
    check_json(bytes, max_bytes)?;
    let (document, binary) = document(bytes)?;
    let mut mistakes = Vec::new();
    let mut left = max_bytes;
    let buffers: Vec<_> = document
        .buffers()
        .map(|buffer| {
            let binary = binary.as_deref().filter(|_| buffer.index() == 0);
            let contents = contents(&buffer, binary, folder, left).unwrap_or_else(|mistake| {
                mistakes.push(format!("buffer {}: {mistake}", buffer.index()));
                Cow::Borrowed(&[])
            });
            left = left.saturating_sub(contents.len() as u64);
            contents
        })
        .collect();
    if !mistakes.is_empty() {
        return Err(mistakes);
    }

    let mut reader = Reader {
        document: &document,
        buffers: &buffers,
        shapes: Vec::new(),
        left: max_bytes,
        mistakes,
    };
    reader.walk();
    if reader.mistakes.is_empty() {
        Ok((reader.shapes, materials(&document)))
    } else {
        Err(reader.mistakes)
    }
}

/// Reads the JSON of a file, with all references checked, and its binary chunk.
fn document(bytes: &[u8]) -> Result<(Document, Option<Vec<u8>>), Vec<String>> {
    // The crate subtracts the size of the header from the stated length without a check.
    let stated = bytes.get(8..).and_then(<[u8]>::first_chunk::<4>);
    if bytes.starts_with(b"glTF") && stated.is_none_or(|&length| u32::from_le_bytes(length) < 12) {
        return Err(vec!["the GLB is shorter than its header".to_owned()]);
    }
    let Gltf { document, blob } =
        Gltf::from_slice_without_validation(bytes).map_err(|error| match error {
            ::gltf::Error::Deserialize(error) => vec![format!("JSON: {error}")],
            ::gltf::Error::Binary(error) => vec![format!("GLB: {error}")],
            error => vec![error.to_string()],
        })?;

    let mut json = document.into_json();
    let mut mistakes = Vec::new();
    let version = &json.asset.version;
    if !version.starts_with("2.") {
        mistakes.push(format!("glTF version `{version}`; version 2 is supported"));
    }
    // The crate looks up the accessor of positions during validation, without a check of its index.
    let accessors = json.accessors.len();
    for (index, mesh) in json.meshes.iter().enumerate() {
        for (place, primitive) in mesh.primitives.iter().enumerate() {
            let positions = &Checked::Valid(Semantic::Positions);
            let position = primitive.attributes.get(positions);
            if let Some(position) = position.filter(|position| position.value() >= accessors) {
                mistakes.push(format!(
                    "mesh {index}, primitive {place}: accessor {position} is used, but there are only {accessors} \
                     accessors"
                ));
            }
        }
    }
    if !mistakes.is_empty() {
        return Err(mistakes);
    }
    let harmful = |name: &String| {
        !APPEARANCE_EXTENSIONS
            .iter()
            .any(|start| name.starts_with(start))
    };
    json.extensions_required.retain(harmful);
    json.validate(&json, json::Path::new, &mut |path, error| {
        let path = path();
        // Bounds are required by the specification, but some writers omit them, and nothing here needs them.
        let bound = [".min", ".max"].iter().any(|end| path.0.ends_with(end));
        if !(bound && error == validation::Error::Missing) {
            mistakes.push(format!("{path}: {error}"));
        }
    });
    if mistakes.is_empty() {
        Ok((Document::from_json_without_validation(json), blob))
    } else {
        Err(mistakes)
    }
}

/// Bytes of a buffer: the binary chunk, base64 inside the JSON, or a file in the same folder.
fn contents<'a>(
    buffer: &Buffer,
    binary: Option<&'a [u8]>,
    folder: &Path,
    max_bytes: u64,
) -> Result<Cow<'a, [u8]>, String> {
    let bytes = match buffer.source() {
        Source::Bin => {
            Cow::Borrowed(binary.ok_or("no file is named, and there is no binary chunk")?)
        }
        Source::Uri(uri) => Cow::Owned(match DataUrl::process(uri) {
            Ok(data) => data.decode_to_vec().map_err(|error| error.to_string())?.0,
            Err(DataUrlError::NotADataUrl) => {
                let name = percent_decode_str(uri).decode_utf8().ok();
                let name = name.filter(|_| !uri.contains("://"));
                let name = name.ok_or_else(|| format!("`{uri}` is not the name of a file"))?;
                let read = file::read(&folder.join(&*name), max_bytes, |_| Ok(()));
                read.map_err(|error| format!("{name}: {error}"))?
            }
            Err(error) => return Err(error.to_string()),
        }),
    };
    if bytes.len() < buffer.length() {
        let (found, wanted) = (bytes.len(), buffer.length());
        return Err(format!(
            "the buffer declares {wanted} bytes, but its data has only {found}"
        ));
    }
    Ok(bytes)
}

/// Diffuse materials. The last one is for primitives without a material.
fn materials(document: &Document) -> Vec<Material> {
    let colours = document.materials().map(|material| {
        let [r, g, b, _] = material.pbr_metallic_roughness().base_color_factor();
        Rgb::new(r, g, b).clamp(Rgb::ZERO, Rgb::ONE)
    });
    let matte = |kd: Rgb| Material::Matte {
        kd: kd.into(),
        sigma: 0.0.into(),
    };
    colours.chain([Rgb::splat(0.6)]).map(matte).collect()
}

/// State of reading: the shapes so far, the memory left, and the mistakes.
struct Reader<'a> {
    document: &'a Document,
    buffers: &'a [Cow<'a, [u8]>],
    shapes: Vec<Shape>,
    /// Memory left for further meshes, in bytes.
    left: u64,
    mistakes: Vec<String>,
}

impl Reader<'_> {
    /// Visits the nodes of the scene, parents before children.
    ///
    /// The stack is explicit, because nodes may be nested deeper than the call stack allows.
    fn walk(&mut self) {
        let document = self.document;
        let mut visited = vec![false; document.nodes().len()];
        let scene = document.default_scene().or(document.scenes().next());
        let mut open: Vec<_> = match scene {
            Some(scene) => scene.nodes().collect::<Vec<_>>(),
            None => roots(document),
        }
        .into_iter()
        .rev()
        .map(|root| (root, Mat4::IDENTITY))
        .collect();
        while let Some((node, to_parent)) = open.pop() {
            let index = node.index();
            if std::mem::replace(&mut visited[index], true) {
                self.mistakes.push(format!(
                    "node {index} has two parents or is its own ancestor"
                ));
                continue;
            }
            let to_world = to_parent * Mat4::from_cols_array_2d(&node.transform().matrix());
            if let Some(mesh) = node.mesh() {
                self.mesh(&mesh, to_world);
            }
            let children: Vec<_> = node.children().collect();
            open.extend(children.into_iter().rev().map(|child| (child, to_world)));
        }
    }

    fn mesh(&mut self, mesh: &Mesh, to_world: Mat4) {
        for primitive in mesh.primitives() {
            let material = primitive.material().index();
            match self.primitive(&primitive, to_world) {
                Ok(None) => {}
                Ok(Some(mesh)) => self.shapes.push(Shape {
                    geometry: Geometry::Mesh(Arc::new(mesh)),
                    material: material.unwrap_or(self.document.materials().len()),
                    area_light: None,
                    alpha: None,
                    shadow_alpha: None,
                    reverse_orientation: false,
                    transform_swaps_handedness: to_world.determinant() < 0.0,
                }),
                Err(mistake) => {
                    let (mesh, place) = (mesh.index(), primitive.index());
                    self.mistakes
                        .push(format!("mesh {mesh}, primitive {place}: {mistake}"));
                }
            }
        }
    }

    /// Mesh of a primitive in world space; `None` if the primitive does not consist of triangles.
    fn primitive(
        &mut self,
        primitive: &Primitive,
        to_world: Mat4,
    ) -> Result<Option<TriangleMesh>, String> {
        if !matches!(
            primitive.mode(),
            Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
        ) {
            return Ok(None);
        }
        let position = primitive.get(&Semantic::Positions);
        let position = position.ok_or("there is no attribute POSITION")?;
        self.take_memory(primitive, &position)?;
        let buffers = self.buffers;
        let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(|b| &**b));
        let positions: Vec<_> = match self.check(&position, Dimensions::Vec3, &[DataType::F32])? {
            0 => Vec::new(),
            _ => reader.read_positions().into_iter().flatten().collect(),
        };
        let vertices = positions.len();
        let corners: Vec<u32> = match primitive.indices() {
            None => (0..u32::try_from(vertices).map_err(|_| "too many vertices")?).collect(),
            Some(indices) => match self.check(&indices, Dimensions::Scalar, INDEX_TYPES)? {
                0 => Vec::new(),
                _ => reader
                    .read_indices()
                    .into_iter()
                    .flat_map(|indices| indices.into_u32())
                    .collect(),
            },
        };
        if let Some(&corner) = corners.iter().find(|&&corner| corner as usize >= vertices) {
            return Err(format!(
                "vertex {corner} is used, but there are only {vertices} vertices"
            ));
        }
        let normals: Vec<_> = match primitive.get(&Semantic::Normals) {
            Some(normal) if self.check(&normal, Dimensions::Vec3, &[DataType::F32])? > 0 => {
                reader.read_normals().into_iter().flatten().collect()
            }
            _ => Vec::new(),
        };
        if !normals.is_empty() && normals.len() != vertices {
            let count = normals.len();
            return Err(format!(
                "there are {count} normals for {vertices} vertices; both numbers must be equal"
            ));
        }
        let normal_to_world = Mat3::from_mat4(to_world).inverse().transpose();
        Ok(Some(TriangleMesh {
            positions: positions
                .into_iter()
                .map(|point| to_world.transform_point3(Vec3::from(point)).into())
                .collect(),
            indices: triangles(primitive.mode(), &corners),
            normals: normals
                .into_iter()
                .map(|normal: [f32; 3]| (normal_to_world * Vec3::from(normal)).normalize_or_zero())
                .collect(),
            uvs: Vec::new(),
        }))
    }

    /// Subtracts the largest possible size of a primitive from the memory left, before the primitive is read.
    ///
    /// Counts are as declared by the file. [`Self::check`] compares them with the buffers.
    fn take_memory(&mut self, primitive: &Primitive, position: &Accessor) -> Result<(), String> {
        let vertices = position.count() as u64;
        let corners = primitive.indices().map_or(vertices, |i| i.count() as u64);
        let normals = match primitive.get(&Semantic::Normals) {
            Some(_) => vertices,
            None => 0,
        };
        // A corner takes an index, and in a strip a triangle as well.
        let needed = (vertices.saturating_add(normals).saturating_mul(12))
            .saturating_add(corners.saturating_mul(16));
        self.left = self.left.checked_sub(needed).ok_or_else(|| {
            format!(
                "{vertices} vertices and {corners} corners take {needed} bytes, but only {} bytes are left of the memory \
                 allowed",
                self.left
            )
        })?;
        Ok(())
    }

    /// Checks that an accessor has elements of the given kind, all within its buffer, and returns their number.
    ///
    /// The crate checks neither the kind nor overflow of positions. Do not ask it for elements if the number is 0.
    fn check(
        &self,
        accessor: &Accessor,
        dimensions: Dimensions,
        types: &[DataType],
    ) -> Result<usize, String> {
        let index = accessor.index();
        let (found, kind) = (accessor.dimensions(), accessor.data_type());
        if found != dimensions || !types.contains(&kind) {
            return Err(format!(
                "accessor {index} holds {found:?} of {kind:?}, not {dimensions:?} of {types:?}"
            ));
        }
        let view = accessor.view().filter(|_| accessor.sparse().is_none());
        let view = view.ok_or_else(|| {
            format!("accessor {index} is sparse or has no bufferView, which is not supported")
        })?;

        let (view_index, offset, length) = (view.index(), view.offset(), view.length());
        let held = self
            .buffers
            .get(view.buffer().index())
            .map_or(0, |b| b.len());
        if offset.checked_add(length).is_none_or(|end| end > held) {
            return Err(format!(
                "bufferView {view_index} has {length} bytes from byte {offset}, but its buffer has only {held}"
            ));
        }
        let (size, count) = (accessor.size(), accessor.count());
        let stride = view.stride().unwrap_or(size);
        if stride < size {
            return Err(format!(
                "bufferView {view_index} has a stride of {stride} bytes, less than its elements of {size} bytes"
            ));
        }
        let Some(last) = count.checked_sub(1) else {
            return Ok(0);
        };
        let end = last
            .checked_mul(stride)
            .and_then(|start| start.checked_add(accessor.offset())?.checked_add(size));
        if end.is_none_or(|end| end > length) {
            return Err(format!(
                "accessor {index} has {count} elements, more than fit in the {length} bytes of its bufferView"
            ));
        }
        Ok(count)
    }
}

/// Nodes without a parent, the roots of a file without scenes.
fn roots(document: &Document) -> Vec<Node<'_>> {
    let nodes = document.nodes();
    let mut child = vec![false; nodes.len()];
    for node in nodes.clone().flat_map(|node| node.children()) {
        child[node.index()] = true;
    }
    nodes.filter(|node| !child[node.index()]).collect()
}

/// Triangles of a list, strip or fan of corners; none for other modes. Incomplete triangles are dropped.
fn triangles(mode: Mode, corners: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::Triangles => corners.as_chunks::<3>().0.to_vec(),
        Mode::TriangleStrip => corners
            .windows(3)
            .enumerate()
            .map(|(i, w)| {
                if i % 2 == 0 {
                    [w[0], w[1], w[2]]
                } else {
                    [w[1], w[0], w[2]]
                }
            })
            .collect(),
        Mode::TriangleFan => corners
            .windows(2)
            .skip(1)
            .map(|w| [corners[0], w[0], w[1]])
            .collect(),
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests;
