//! Nodes, meshes and their accessors.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use antumbra_scene::{Geometry, Instance, Object, Rgb, Shape, TriangleMesh};
use glam::{Affine3, DMat4, DVec3, Mat4, Vec2, Vec3};
use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Mode;
use gltf::{Accessor, Document, Mesh, Node, Primitive, Semantic};

use super::looks::{Look, Looks};
use super::places;
use crate::images::Images;
use crate::{Model, Part, Warning};

const INDEX_TYPES: &[DataType] = &[DataType::U8, DataType::U16, DataType::U32];
/// Types of fractions of 1. Integers are normalized.
const FRACTION_TYPES: &[DataType] = &[DataType::U8, DataType::U16, DataType::F32];

/// State of reading: the model so far, the memory left, and the mistakes.
pub(super) struct Reader<'a> {
    document: &'a Document,
    buffers: &'a [Cow<'a, [u8]>],
    looks: Looks<'a>,
    model: Model,
    /// Memory left for further meshes, in bytes.
    left: u64,
    mistakes: Vec<String>,
    /// Whether shapes are kept whose masks cut all away.
    keeps_invisible: bool,
    /// Whether such a shape was left out.
    has_invisible: bool,
}

/// A mesh where a node places it.
struct Placed<'a> {
    mesh: Mesh<'a>,
    to_world: DMat4,
    /// Name of the node, or else of the mesh.
    name: String,
}

impl<'a> Reader<'a> {
    /// Nothing read yet. Meshes and images may take `max_bytes` each.
    pub fn new(
        document: &'a Document,
        buffers: &'a [Cow<'a, [u8]>],
        folder: &'a Path,
        max_bytes: u64,
    ) -> Self {
        Self {
            document,
            buffers,
            looks: Looks::new(buffers, folder, Images::new(max_bytes)),
            model: Model::default(),
            left: max_bytes,
            mistakes: Vec::new(),
            keeps_invisible: false,
            has_invisible: false,
        }
    }

    /// Adds a note to the model.
    pub fn note(&mut self, note: impl Into<String>) {
        self.model.note(note);
    }

    /// Reads the scene, or lists all mistakes. Warnings are without a place.
    pub fn read(mut self, origin: DVec3) -> Result<Model, Vec<String>> {
        let placed = self.walk(origin);
        self.place(&placed);
        if self.has_invisible && self.model.shapes.is_empty() && self.model.instances.is_empty() {
            // A model without anything visible is no empty file.
            self.keeps_invisible = true;
            self.place(&placed);
        }
        self.mistakes.extend(self.looks.take_mistakes());
        if !self.mistakes.is_empty() {
            return Err(self.mistakes);
        }
        let notes = self.looks.take_notes();
        for note in notes {
            self.model.note(note);
        }
        let warnings = self.looks.take_warnings().into_iter();
        self.model.warnings.extend(warnings.map(|text| Warning {
            place: String::new(),
            text,
        }));
        self.model.materials = self.looks.take_materials();
        self.model.files.extend(self.looks.files());
        Ok(self.model)
    }

    /// Adds shapes, objects and instances of all meshes.
    fn place(&mut self, placed: &[Placed<'a>]) {
        let mut uses: HashMap<usize, usize> = HashMap::new();
        for place in placed {
            *uses.entry(place.mesh.index()).or_default() += 1;
        }
        // Objects of meshes that stand in several places, if they have shapes.
        let mut objects: HashMap<usize, Option<usize>> = HashMap::new();
        for Placed {
            mesh,
            to_world: matrix,
            name,
        } in placed
        {
            let index = mesh.index();
            let usable = matrix.is_finite() && matrix.determinant() != 0.0;
            if uses[&index] < 2 || !usable {
                self.add_shapes((mesh, name), matrix, |_| true);
                continue;
            }
            let object = match objects.get(&index) {
                Some(&known) => known,
                None => {
                    let made = self.object(mesh);
                    objects.insert(index, made);
                    made
                }
            };
            if let Some(object) = object {
                self.model.names.instances.push((name.clone(), object));
                self.model.instances.push(Instance {
                    object,
                    world_from_object: Affine3::from_mat4(matrix.as_mat4()),
                    end: None,
                });
            }
            // Lights of instances would be dark.
            self.add_shapes((mesh, name), matrix, |look| look.emission.is_some());
        }
    }

    /// Visits the nodes of the scene, parents before children, and returns their meshes. Cameras and lights are kept.
    ///
    /// The stack is explicit, because nodes may be nested deeper than the call stack allows.
    fn walk(&mut self, origin: DVec3) -> Vec<Placed<'a>> {
        let document = self.document;
        let mut placed = Vec::new();
        let mut visited = vec![false; document.nodes().len()];
        let scene = document.default_scene().or(document.scenes().next());
        let mut open: Vec<_> = match scene {
            Some(scene) => scene.nodes().collect::<Vec<_>>(),
            None => roots(document),
        }
        .into_iter()
        .rev()
        .map(|root| (root, DMat4::from_translation(-origin)))
        .collect();
        while let Some((node, to_parent)) = open.pop() {
            let index = node.index();
            if std::mem::replace(&mut visited[index], true) {
                self.mistakes.push(format!(
                    "node {index} has two parents or is its own ancestor"
                ));
                continue;
            }
            let own = Mat4::from_cols_array_2d(&node.transform().matrix());
            let to_world = to_parent * own.as_dmat4();
            if let Some(mesh) = node.mesh() {
                let name = node.name().or(mesh.name()).unwrap_or_default().to_owned();
                placed.push(Placed {
                    mesh,
                    to_world,
                    name,
                });
            }
            if let Some(camera) = node.camera() {
                places::add_camera(&camera, to_world.as_mat4(), &mut self.model);
            }
            if let Some(light) = node.light() {
                places::add_light(&light, to_world.as_mat4(), &mut self.model);
            }
            let children: Vec<_> = node.children().collect();
            open.extend(children.into_iter().rev().map(|child| (child, to_world)));
        }
        placed
    }

    /// Adds the shapes of a mesh whose looks are `wanted`, in world space.
    fn add_shapes(
        &mut self,
        (mesh, name): (&Mesh, &str),
        to_world: &DMat4,
        wanted: impl Fn(&Look) -> bool,
    ) {
        for (shape, mut part) in self.shapes(mesh, wanted) {
            part.object = name.to_owned();
            // Only spheres cannot be transformed.
            if let Some(shape) = shape.transformed(to_world) {
                self.model.shapes.push(shape);
                self.model.names.shapes.push(vec![part]);
            }
        }
    }

    /// Object of a mesh without its lights. `None` if nothing is left.
    fn object(&mut self, mesh: &Mesh) -> Option<usize> {
        let shapes = self.shapes(mesh, |look| look.emission.is_none());
        if shapes.is_empty() {
            return None;
        }
        let (shapes, parts): (_, Vec<_>) = shapes.into_iter().unzip();
        let parts = parts.into_iter().map(|part| vec![part]);
        self.model.names.objects.push(parts.collect());
        self.model.objects.push(Object {
            name: format!("mesh {}", mesh.index()),
            shapes,
        });
        Some(self.model.objects.len() - 1)
    }

    /// Shapes of a mesh whose looks are `wanted`, in the space of its node, with the names of their materials.
    fn shapes(&mut self, mesh: &Mesh, wanted: impl Fn(&Look) -> bool) -> Vec<(Shape, Part)> {
        let mut shapes = Vec::new();
        for primitive in mesh.primitives() {
            let has_colors = primitive.get(&Semantic::Colors(0)).is_some();
            let look = self.looks.of(&primitive.material(), has_colors);
            if !wanted(&look) {
                continue;
            }
            if look.is_invisible && !self.keeps_invisible {
                self.has_invisible = true;
                continue;
            }
            let alpha = match look.is_invisible {
                true => Some(0.0.into()),
                false => look.alpha.clone(),
            };
            match self.primitive(&primitive, look.uv_set) {
                Ok(None) => {}
                Ok(Some(mesh)) => {
                    let part = Part {
                        object: String::new(),
                        material: primitive.material().name().unwrap_or_default().to_owned(),
                        triangles: mesh.indices.len(),
                    };
                    let shape = Shape {
                        geometry: Geometry::Mesh(Arc::new(mesh)),
                        material: look.material,
                        area_light: look.emission.clone(),
                        media: None,
                        alpha,
                        shadow_alpha: None,
                        reverse_orientation: false,
                        transform_swaps_handedness: false,
                    };
                    shapes.push((shape, part));
                }
                Err(mistake) => {
                    let (mesh, place) = (mesh.index(), primitive.index());
                    self.mistakes
                        .push(format!("mesh {mesh}, primitive {place}: {mistake}"));
                }
            }
        }
        shapes
    }

    /// Mesh of a primitive in the space of its node, with the texture coordinates `set`.
    ///
    /// `None` if the primitive does not consist of triangles.
    fn primitive(
        &mut self,
        primitive: &Primitive,
        set: u32,
    ) -> Result<Option<TriangleMesh>, String> {
        if !matches!(
            primitive.mode(),
            Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
        ) {
            self.note("points and lines are left out");
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
        let uvs: Vec<Vec2> = match primitive.get(&Semantic::TexCoords(set)) {
            Some(uv) if self.check(&uv, Dimensions::Vec2, FRACTION_TYPES)? > 0 => {
                let read = reader.read_tex_coords(set);
                // The origin of glTF is the upper left corner of an image, that of scenes the lower left.
                let read = read.into_iter().flat_map(|uvs| uvs.into_f32());
                read.map(|[u, v]| Vec2::new(u, 1.0 - v)).collect()
            }
            _ => Vec::new(),
        };
        let colors: Vec<Rgb> = match primitive.get(&Semantic::Colors(0)) {
            Some(color) => {
                let dimensions = match color.dimensions() {
                    Dimensions::Vec4 => Dimensions::Vec4,
                    _ => Dimensions::Vec3,
                };
                if dimensions == Dimensions::Vec4 {
                    self.note("the alpha of vertex colours is left out");
                }
                match self.check(&color, dimensions, FRACTION_TYPES)? {
                    0 => Vec::new(),
                    _ => {
                        let read = reader.read_colors(0);
                        let read = read.into_iter().flat_map(|colors| colors.into_rgb_f32());
                        read.map(Rgb::from).collect()
                    }
                }
            }
            None => Vec::new(),
        };
        for (what, count) in [
            ("normals", normals.len()),
            ("texture coordinates", uvs.len()),
            ("colours", colors.len()),
        ] {
            if count != 0 && count != vertices {
                return Err(format!(
                    "there are {count} {what} for {vertices} vertices; both numbers must be equal"
                ));
            }
        }
        Ok(Some(TriangleMesh {
            positions,
            indices: triangles(primitive.mode(), &corners),
            normals: normals
                .into_iter()
                .map(|normal: [f32; 3]| Vec3::from(normal).normalize_or_zero())
                .collect(),
            uvs,
            colors,
        }))
    }

    /// Subtracts the largest possible size of a primitive from the memory left, before the primitive is read.
    ///
    /// Counts are as declared by the file. [`Self::check`] compares them with the buffers.
    fn take_memory(&mut self, primitive: &Primitive, position: &Accessor) -> Result<(), String> {
        let vertices = position.count() as u64;
        let corners = primitive.indices().map_or(vertices, |i| i.count() as u64);
        let attributes = [
            Semantic::Normals,
            Semantic::TexCoords(0),
            Semantic::Colors(0),
        ];
        let present = attributes
            .iter()
            .filter(|name| primitive.get(name).is_some());
        let lists = 1 + present.count() as u64;
        // A corner takes an index, and in a strip a triangle as well.
        let needed = vertices
            .saturating_mul(12 * lists)
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
    /// The crate checks neither the kind nor overflow of positions. Do not call it for elements if the number is 0.
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
pub(super) fn triangles(mode: Mode, corners: &[u32]) -> Vec<[u32; 3]> {
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
