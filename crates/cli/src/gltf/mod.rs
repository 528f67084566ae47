//! glTF 2.0 (`.gltf` and `.glb`): the triangles of a file's scene with their base colours.
//!
//! Every primitive becomes a shape in world space, diffuse in the base colour factor of its material.
//! Textures, metalness, emission, lights and cameras are passed over, and so are points and lines; skins
//! and morph targets are shown at rest. What says where the surfaces are and is not understood, such as
//! compression and sparse accessors, is an error.
//!
//! - `document`: the JSON, as far as it is read
//! - `container`: GLB chunks and buffers, wherever they are
//! - `accessor`: typed values in buffers, every access checked

mod accessor;
mod container;
mod document;

use std::path::Path;
use std::sync::Arc;

use antumbra_scene::{Geometry, Material, Rgb, Shape, TriangleMesh};
use glam::{Mat3, Mat4, Quat, Vec3};

use crate::exit::Failure;
use accessor::Accessors;
use document::{Document, Mesh, Node, Primitive};

/// Extensions that change how surfaces look, not where they are.
const HARMLESS: &[&str] = &[
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "KHR_lights_",
];

/// Reads the shapes of the file's scene, and their materials.
pub fn load(path: &Path) -> Result<(Vec<Shape>, Vec<Material>), Failure> {
    read(path).map_err(|mistakes| {
        let lines = mistakes
            .iter()
            .map(|mistake| format!("error: {}: {mistake}", path.display()));
        Failure::Scene(lines.collect::<Vec<_>>().join("\n"))
    })
}

/// The same, or every mistake in words.
fn read(path: &Path) -> Result<(Vec<Shape>, Vec<Material>), Vec<String>> {
    let bytes = std::fs::read(path).map_err(|source| vec![source.to_string()])?;
    let (json, binary) = container::open(&bytes).map_err(|mistake| vec![mistake])?;
    let document: Document =
        serde_json::from_slice(json).map_err(|error| vec![format!("JSON: {error}")])?;
    let mut mistakes = unsupported(&document);
    let folder = path.parent().unwrap_or(Path::new(""));
    let buffers = container::buffers(&document, binary, folder, &mut mistakes);
    if !mistakes.is_empty() {
        return Err(mistakes);
    }

    let mut reader = Reader {
        document: &document,
        accessors: Accessors::new(&document, &buffers),
        shapes: Vec::new(),
        mistakes,
    };
    reader.walk();
    if reader.mistakes.is_empty() {
        Ok((reader.shapes, materials(&document)))
    } else {
        Err(reader.mistakes)
    }
}

fn unsupported(document: &Document) -> Vec<String> {
    let mut mistakes = Vec::new();
    let version = &document.asset.version;
    if !version.starts_with("2.") {
        mistakes.push(format!("glTF version `{version}`; version 2 is supported"));
    }
    for extension in &document.extensions_required {
        if !HARMLESS.iter().any(|start| extension.starts_with(start)) {
            mistakes.push(format!("the extension {extension} is not supported"));
        }
    }
    mistakes
}

/// Diffuse materials; one more at the end is for primitives without.
fn materials(document: &Document) -> Vec<Material> {
    let colours = document.materials.iter().map(|material| {
        let [r, g, b, _] = material.pbr_metallic_roughness.base_color_factor;
        Rgb::new(r, g, b).clamp(Rgb::ZERO, Rgb::ONE)
    });
    let matte = |kd| Material::Matte { kd, sigma: 0.0 };
    colours.chain([Rgb::splat(0.6)]).map(matte).collect()
}

/// The scene as it grows.
struct Reader<'a> {
    document: &'a Document,
    accessors: Accessors<'a>,
    shapes: Vec<Shape>,
    mistakes: Vec<String>,
}

impl Reader<'_> {
    /// Visits the nodes of the scene, parents before children. A stack of its own, since a file may nest
    /// nodes deeper than threads may nest calls.
    fn walk(&mut self) {
        let nodes = &self.document.nodes;
        let mut visited = vec![false; nodes.len()];
        let mut open: Vec<(usize, Mat4)> = self
            .roots()
            .into_iter()
            .rev()
            .map(|root| (root, Mat4::IDENTITY))
            .collect();
        while let Some((index, to_parent)) = open.pop() {
            let Some(node) = nodes.get(index) else {
                self.missing("node", index, nodes.len());
                continue;
            };
            if std::mem::replace(&mut visited[index], true) {
                self.mistakes.push(format!(
                    "node {index} has two parents or is its own ancestor"
                ));
                continue;
            }
            let to_world = to_parent * transform(node);
            if let Some(mesh) = node.mesh {
                match self.document.meshes.get(mesh) {
                    Some(found) => self.mesh(mesh, found, to_world),
                    None => self.missing("mesh", mesh, self.document.meshes.len()),
                }
            }
            open.extend(node.children.iter().rev().map(|&child| (child, to_world)));
        }
    }

    /// The nodes the scene starts with; in a file without scenes, those that are nobody's children.
    fn roots(&mut self) -> Vec<usize> {
        let document = self.document;
        let index = document.scene.unwrap_or(0);
        match document.scenes.get(index) {
            Some(scene) => scene.nodes.clone(),
            None if document.scene.is_some() => {
                self.missing("scene", index, document.scenes.len());
                Vec::new()
            }
            None => {
                let mut child = vec![false; document.nodes.len()];
                for &index in document.nodes.iter().flat_map(|node| &node.children) {
                    if let Some(child) = child.get_mut(index) {
                        *child = true;
                    }
                }
                (0..child.len()).filter(|&index| !child[index]).collect()
            }
        }
    }

    fn missing(&mut self, what: &str, index: usize, count: usize) {
        self.mistakes
            .push(format!("{what} {index} is used, but there are {count}"));
    }

    fn mesh(&mut self, index: usize, mesh: &Mesh, to_world: Mat4) {
        for (place, primitive) in mesh.primitives.iter().enumerate() {
            let (material, materials) = (primitive.material, self.document.materials.len());
            if let Some(material) = material.filter(|&material| material >= materials) {
                self.missing("material", material, materials);
            }
            match self.primitive(primitive, to_world) {
                Ok(None) => {}
                Ok(Some(mesh)) => self.shapes.push(Shape {
                    geometry: Geometry::Mesh(Arc::new(mesh)),
                    material: material.unwrap_or(materials),
                    area_light: None,
                    reverse_orientation: false,
                    transform_swaps_handedness: to_world.determinant() < 0.0,
                }),
                Err(mistake) => self
                    .mistakes
                    .push(format!("mesh {index}, primitive {place}: {mistake}")),
            }
        }
    }

    /// A primitive in world space; `None` if it is not made of triangles.
    fn primitive(
        &self,
        primitive: &Primitive,
        to_world: Mat4,
    ) -> Result<Option<TriangleMesh>, String> {
        if !matches!(primitive.mode, 4..=6) {
            return if primitive.mode < 4 {
                Ok(None)
            } else {
                Err(format!("mode {} is not one of 0 to 6", primitive.mode))
            };
        }
        let position = primitive.attributes.position;
        let position = position.ok_or("there is no attribute POSITION")?;
        let positions: Vec<[f32; 3]> = self.accessors.vectors(position)?;
        let vertices = positions.len();
        let corners = match primitive.indices {
            Some(indices) => self.accessors.indices(indices)?,
            None => (0..u32::try_from(vertices).map_err(|_| "too many vertices")?).collect(),
        };
        if let Some(&corner) = corners.iter().find(|&&corner| corner as usize >= vertices) {
            return Err(format!("vertex {corner} is used, but there are {vertices}"));
        }
        let normals = match primitive.attributes.normal {
            Some(normal) => self.accessors.vectors(normal)?,
            None => Vec::new(),
        };
        if !normals.is_empty() && normals.len() != vertices {
            let count = normals.len();
            return Err(format!("there are {count} normals for {vertices} vertices"));
        }
        let normal_to_world = Mat3::from_mat4(to_world).inverse().transpose();
        Ok(Some(TriangleMesh {
            positions: positions
                .into_iter()
                .map(|point| to_world.transform_point3(Vec3::from(point)).into())
                .collect(),
            indices: triangles(primitive.mode, &corners),
            normals: normals
                .into_iter()
                .map(|normal: [f32; 3]| (normal_to_world * Vec3::from(normal)).normalize_or_zero())
                .collect(),
            uvs: Vec::new(),
        }))
    }
}

/// The triangles of a list (4), a strip (5) or a fan (6) of corners. Corners left over are no triangle.
fn triangles(mode: u32, corners: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        4 => corners.as_chunks::<3>().0.to_vec(),
        5 => corners
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
        _ => corners
            .windows(2)
            .skip(1)
            .map(|w| [corners[0], w[0], w[1]])
            .collect(),
    }
}

/// A node's own transformation.
fn transform(node: &Node) -> Mat4 {
    match &node.matrix {
        Some(columns) => Mat4::from_cols_array(columns),
        None => Mat4::from_scale_rotation_translation(
            Vec3::from(node.scale),
            Quat::from_array(node.rotation),
            Vec3::from(node.translation),
        ),
    }
}

#[cfg(test)]
mod tests;
