//! Nodes, meshes and their accessors.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use antumbra_scene::{Geometry, Instance, Object, Rgb, Shape, TriangleMesh};
use glam::{Affine3, DMat4, DQuat, DVec3, Vec2, Vec3};
use gltf::accessor::Dimensions;
use gltf::mesh::Mode;
use gltf::{Accessor, Document, Mesh, Node, Primitive, Semantic};

use super::accessors::{self, Numbers};
use super::looks::{Look, Looks};
use super::pose::{Pose, roots, worlds};
use super::{DRACO, compressed, needs, places};
use crate::images::Images;
use crate::{Model, Part, Warning};

/// Bytes that a place of a mesh takes at most while the file is read.
const PER_INSTANCE: u64 = 512;

/// State of reading: the model so far, the memory left, and the mistakes.
pub(super) struct Reader<'a> {
    document: &'a Document,
    buffers: &'a [Cow<'a, [u8]>],
    looks: Looks<'a>,
    model: Model,
    /// Memory left for further meshes, in bytes.
    left: u64,
    mistakes: Vec<String>,
    /// Whether integers may be lengths: by `KHR_mesh_quantization`.
    is_quantized: bool,
    /// Whether notes and warnings about materials are wanted.
    wants_looks: bool,
    /// Whether shapes are kept whose masks cut all away.
    keeps_invisible: bool,
    /// Whether such a shape was left out.
    has_invisible: bool,
}

/// A mesh where a node places it.
struct Placed<'a> {
    mesh: Mesh<'a>,
    to_world: DMat4,
    /// Shape of its own, by a skin or by weights of the node.
    pose: Option<Pose<'a>>,
    /// Name of the node, or else of the mesh.
    name: String,
}

impl<'a> Reader<'a> {
    /// Nothing read yet. Meshes and images may take `max_bytes` each. Without a folder, no image is read.
    pub fn new(
        document: &'a Document,
        buffers: &'a [Cow<'a, [u8]>],
        folder: Option<&'a Path>,
        max_bytes: u64,
    ) -> Self {
        let mut used = document.extensions_used();
        Self {
            document,
            buffers,
            looks: Looks::new(buffers, folder, Images::new(max_bytes)),
            model: Model::default(),
            left: max_bytes,
            mistakes: Vec::new(),
            is_quantized: used.any(|name| name == "KHR_mesh_quantization"),
            wants_looks: folder.is_some(),
            keeps_invisible: false,
            has_invisible: false,
        }
    }

    /// Adds a note to the model.
    pub fn note(&mut self, note: impl Into<String>) {
        self.model.note(note);
    }

    /// Adds a note about materials to the model.
    pub fn look_note(&mut self, note: &str) {
        if self.wants_looks {
            self.model.note(note);
        }
    }

    /// Adds a warning to the model.
    pub fn warn(&mut self, text: String) {
        let place = String::new();
        let warning = Warning { place, text };
        if !self.model.warnings.contains(&warning) {
            self.model.warnings.push(warning);
        }
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
        let wants_looks = self.wants_looks;
        let Self {
            looks,
            mut model,
            mut mistakes,
            ..
        } = self;
        mistakes.extend(looks.mistakes);
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        for note in looks.notes.iter().filter(|_| wants_looks) {
            model.note(note);
        }
        model
            .warnings
            .extend(looks.warnings.into_iter().map(|text| Warning {
                place: String::new(),
                text,
            }));
        model.materials = looks.materials;
        model.files.extend(looks.images.paths().cloned());
        Ok(model)
    }

    /// Adds shapes, objects and instances of all meshes.
    fn place(&mut self, placed: &[Placed<'a>]) {
        let mut uses: HashMap<usize, usize> = HashMap::new();
        for place in placed.iter().filter(|place| place.pose.is_none()) {
            *uses.entry(place.mesh.index()).or_default() += 1;
        }
        // Objects of meshes that stand in several places, if they have shapes.
        let mut objects: HashMap<usize, Option<usize>> = HashMap::new();
        for Placed {
            mesh,
            to_world: matrix,
            pose,
            name,
        } in placed
        {
            let index = mesh.index();
            let usable = matrix.is_finite() && matrix.determinant() != 0.0;
            if pose.is_some() || uses[&index] < 2 || !usable {
                let pose = pose.clone().unwrap_or_default();
                self.add_shapes((mesh, name, &pose), matrix, |_| true);
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
            let lights = |look: &Look| look.emission.is_some();
            self.add_shapes((mesh, name, &Pose::default()), matrix, lights);
        }
    }

    /// Visits the nodes of the scene, parents before children, and returns their meshes. Cameras and lights are kept.
    ///
    /// The stack is explicit, because nodes may be nested deeper than the call stack allows.
    fn walk(&mut self, origin: DVec3) -> Vec<Placed<'a>> {
        let document = self.document;
        let mut placed = Vec::new();
        let mut visited = vec![false; document.nodes().len()];
        let worlds = worlds(document, DMat4::from_translation(-origin));
        let scene = document.default_scene().or(document.scenes().next());
        let mut open: Vec<Node> = match scene {
            Some(scene) => scene.nodes().collect(),
            None => roots(document)
                .into_iter()
                .filter_map(|root| document.nodes().nth(root))
                .collect(),
        };
        open.reverse();
        while let Some(node) = open.pop() {
            let index = node.index();
            if std::mem::replace(&mut visited[index], true) {
                self.mistakes.push(format!(
                    "node {index} has two parents or is its own ancestor"
                ));
                continue;
            }
            let visible = node.extension_value("KHR_node_visibility");
            if visible.and_then(|value| value.get("visible")?.as_bool()) == Some(false) {
                continue;
            }
            let to_world = worlds[index];
            if let Some(mesh) = node.mesh()
                && let Err(mistake) = self.add_places(&node, mesh, &worlds, &mut placed)
            {
                self.mistakes.push(format!("node {index}: {mistake}"));
            }
            if let Some(camera) = node.camera() {
                places::add_camera(&camera, to_world.as_mat4(), &mut self.model);
            }
            if let Some(light) = node.light() {
                places::add_light(&light, to_world.as_mat4(), &mut self.model);
            }
            let children: Vec<_> = node.children().collect();
            open.extend(children.into_iter().rev());
        }
        placed
    }

    /// Adds the places of a node's mesh.
    fn add_places(
        &mut self,
        node: &Node<'a>,
        mesh: Mesh<'a>,
        worlds: &[DMat4],
        placed: &mut Vec<Placed<'a>>,
    ) -> Result<(), String> {
        let name = node.name().or(mesh.name()).unwrap_or_default();
        let joints = match node.skin() {
            Some(skin) => self.joints(&skin, worlds)?,
            None => Vec::new(),
        };
        let weights = node.weights();
        let is_own = weights.is_some() || !joints.is_empty();
        let pose = is_own.then_some(Pose { weights, joints });
        for to_world in self.places(node, worlds[node.index()])? {
            placed.push(Placed {
                mesh: mesh.clone(),
                to_world,
                pose: pose.clone(),
                name: name.to_owned(),
            });
        }
        Ok(())
    }

    /// Adds the shapes of a mesh whose looks are `wanted`, in world space.
    fn add_shapes(
        &mut self,
        (mesh, name, pose): (&Mesh<'a>, &str, &Pose<'a>),
        to_world: &DMat4,
        wanted: impl Fn(&Look) -> bool,
    ) {
        for (shape, mut part, is_placed) in self.shapes(mesh, pose, wanted) {
            part.object = name.to_owned();
            let to_world = if is_placed {
                &DMat4::IDENTITY
            } else {
                to_world
            };
            // Only spheres cannot be transformed.
            if let Some(shape) = shape.transformed(to_world) {
                self.model.shapes.push(shape);
                self.model.names.shapes.push(vec![part]);
            }
        }
    }

    /// Object of a mesh without its lights. `None` if nothing is left.
    fn object(&mut self, mesh: &Mesh<'a>) -> Option<usize> {
        let shapes = self.shapes(mesh, &Pose::default(), |look| look.emission.is_none());
        if shapes.is_empty() {
            return None;
        }
        let shapes = shapes.into_iter().map(|(shape, part, _)| (shape, part));
        let (shapes, parts): (_, Vec<_>) = shapes.unzip();
        let parts = parts.into_iter().map(|part| vec![part]);
        self.model.names.objects.push(parts.collect());
        self.model.objects.push(Object {
            name: format!("mesh {}", mesh.index()),
            shapes,
        });
        Some(self.model.objects.len() - 1)
    }

    /// Shapes of a mesh whose looks are `wanted`, in the space of its node or, where that is `true`, in the world, with the
    /// names of their materials.
    fn shapes(
        &mut self,
        mesh: &Mesh<'a>,
        pose: &Pose<'a>,
        wanted: impl Fn(&Look) -> bool,
    ) -> Vec<(Shape, Part, bool)> {
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
            let weights = mesh.weights().unwrap_or_default();
            match self.primitive(&primitive, look.uv_set, pose, weights) {
                Ok(None) => {}
                Ok(Some((mesh, is_placed))) => {
                    let part = Part {
                        object: String::new(),
                        material: primitive.material().name().unwrap_or_default().to_owned(),
                        triangles: mesh.indices.len(),
                    };
                    let shape = Shape {
                        area_light: look.emission.clone(),
                        alpha,
                        ..Shape::new(Geometry::Mesh(Arc::new(mesh)), look.material)
                    };
                    shapes.push((shape, part, is_placed));
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

    /// Mesh of a primitive, with the texture coordinates `set`: in the world if a skin moves it, otherwise in the space of its
    /// node. The second value says which.
    ///
    /// `None` if the primitive does not consist of triangles.
    fn primitive(
        &mut self,
        primitive: &Primitive,
        set: u32,
        pose: &Pose<'a>,
        own_weights: &[f32],
    ) -> Result<Option<(TriangleMesh, bool)>, String> {
        use Mode::{TriangleFan, TriangleStrip, Triangles};
        if !matches!(primitive.mode(), Triangles | TriangleStrip | TriangleFan) {
            self.note("points and lines are left out");
            return Ok(None);
        }
        let Some(position) = primitive.get(&Semantic::Positions) else {
            self.note("primitives without positions are left out");
            return Ok(None);
        };
        let is_absent = position.view().is_none() && position.sparse().is_none();
        if is_absent && primitive.extension_value(DRACO).is_some() {
            return Err(compressed(DRACO));
        }
        let mut positions: Vec<DVec3> =
            self.elements(&position, Dimensions::Vec3, Numbers::Quantized, DVec3::from)?;
        let vertices = positions.len();
        let corners = self.corners(primitive, vertices)?;
        let normal = Semantic::Normals;
        let mut normals = self.attribute(primitive, &normal, Dimensions::Vec3, Vec3::from)?;
        // The origin of glTF is the upper left corner of an image, that of scenes the lower left.
        let upright = |[u, v]: [f32; 2]| Vec2::new(u, 1.0 - v);
        let uv = Semantic::TexCoords(set);
        let uvs = self.attribute(primitive, &uv, Dimensions::Vec2, upright)?;
        let colors = self.colors(primitive)?;
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
        let weights = pose.weights.unwrap_or(own_weights);
        self.morph(primitive, weights, &mut positions, &mut normals)?;
        let is_placed = !pose.joints.is_empty()
            && self.skin(primitive, &pose.joints, &mut positions, &mut normals)?;
        let mesh = TriangleMesh {
            positions: positions.iter().map(|at| at.as_vec3().into()).collect(),
            indices: triangles(primitive.mode(), &corners),
            normals: normals.into_iter().map(Vec3::normalize_or_zero).collect(),
            uvs,
            colors,
        };
        Ok(Some((mesh, is_placed)))
    }

    /// Vertices of the corners of a primitive, one after another if it names none.
    fn corners(&mut self, primitive: &Primitive, vertices: usize) -> Result<Vec<u32>, String> {
        let corners: Vec<u32> = match primitive.indices() {
            None => (0..u32::try_from(vertices).map_err(|_| "too many vertices")?).collect(),
            Some(indices) => {
                self.elements(&indices, Dimensions::Scalar, Numbers::Whole, |[i]| i as u32)?
            }
        };
        // A corner takes an index, and in a strip a triangle as well.
        self.take_memory(corners.len() as u64 * 12)?;
        match corners.iter().find(|&&corner| corner as usize >= vertices) {
            None => Ok(corners),
            Some(corner) => Err(format!(
                "vertex {corner} is used, but there are only {vertices} vertices"
            )),
        }
    }

    /// Colours of the vertices of a primitive, which may have none.
    fn colors(&mut self, primitive: &Primitive) -> Result<Vec<Rgb>, String> {
        let color = Semantic::Colors(0);
        match primitive.get(&color).map(|color| color.dimensions()) {
            Some(Dimensions::Vec4) => {
                self.look_note("the alpha of vertex colours is left out");
                let opaque = |[r, g, b, _]: [f32; 4]| Rgb::new(r, g, b);
                self.attribute(primitive, &color, Dimensions::Vec4, opaque)
            }
            _ => self.attribute(primitive, &color, Dimensions::Vec3, Rgb::from),
        }
    }

    /// Reads an attribute of a primitive, which may have none.
    fn attribute<const N: usize, T>(
        &mut self,
        primitive: &Primitive,
        name: &Semantic,
        dimensions: Dimensions,
        make: impl Fn([f32; N]) -> T,
    ) -> Result<Vec<T>, String> {
        let Some(accessor) = primitive.get(name) else {
            return Ok(Vec::new());
        };
        let numbers = Numbers::of(name, self.is_quantized);
        let make = |numbers: [f64; N]| make(numbers.map(|number| number as f32));
        self.elements(&accessor, dimensions, numbers, make)
    }

    /// Reads the elements of an accessor, if memory allows.
    pub fn elements<const N: usize, T>(
        &mut self,
        accessor: &Accessor,
        dimensions: Dimensions,
        numbers: Numbers,
        make: impl Fn([f64; N]) -> T,
    ) -> Result<Vec<T>, String> {
        let bytes = (accessor.count() as u64).saturating_mul(size_of::<T>() as u64);
        self.take_memory(bytes)
            .map_err(|reason| format!("accessor {}: {reason}", accessor.index()))?;
        accessors::read(self.buffers, accessor, dimensions, numbers, make)
    }

    /// Subtracts bytes from the memory left, before they are taken. Counts are as declared by the file.
    fn take_memory(&mut self, needed: u64) -> Result<(), String> {
        self.left = self.left.checked_sub(needed).ok_or_else(|| {
            let left = self.left;
            format!(
                "{needed} bytes are needed, but only {left} bytes are left of the memory allowed"
            )
        })?;
        Ok(())
    }

    /// Where a node has its mesh: once, or by the attributes of `EXT_mesh_gpu_instancing`.
    fn places(&mut self, node: &Node, to_world: DMat4) -> Result<Vec<DMat4>, String> {
        let json = &self.document.as_json().nodes[node.index()];
        let Some(attributes) = needs::instancing(json).filter(|list| !list.is_empty()) else {
            return Ok(vec![to_world]);
        };
        let mut count = None;
        let (mut moves, mut turns, mut scales) = (Vec::new(), Vec::new(), Vec::new());
        for (name, index) in attributes {
            let accessor = self.document.accessors().nth(index);
            let accessor = accessor.ok_or_else(|| format!("there is no accessor {index}"))?;
            let quantized = Numbers::Quantized;
            match name {
                "TRANSLATION" => {
                    moves = self.elements(&accessor, Dimensions::Vec3, quantized, DVec3::from)?;
                }
                "SCALE" => {
                    scales = self.elements(&accessor, Dimensions::Vec3, quantized, DVec3::from)?;
                }
                "ROTATION" => {
                    turns =
                        self.elements(&accessor, Dimensions::Vec4, quantized, DQuat::from_array)?;
                }
                _ => {}
            }
            let found = accessor.count();
            if *count.get_or_insert(found) != found {
                return Err("its attributes of instances have different lengths".into());
            }
        }
        let count = count.unwrap_or(0);
        self.take_memory((count as u64).saturating_mul(PER_INSTANCE))?;
        let place = |index: usize| {
            let turn = turns.get(index).copied().unwrap_or(DQuat::IDENTITY);
            let scale = scales.get(index).copied().unwrap_or(DVec3::ONE);
            let by = moves.get(index).copied().unwrap_or(DVec3::ZERO);
            to_world * DMat4::from_scale_rotation_translation(scale, turn.normalize(), by)
        };
        Ok((0..count).map(place).collect())
    }
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
