//! What the shown scene needs of a file: only that is checked and read.

use std::collections::HashMap;

use ::gltf::Semantic;
use ::gltf::json::validation::Checked;
use ::gltf::json::{Root, Value, scene};

/// Elements that are needed, by list and index. Indices may be out of range.
pub(super) struct Needs(HashMap<&'static str, Vec<bool>>);

impl Needs {
    /// What the scene that is shown refers to, with or without images.
    pub fn of(root: &Root, looks: bool) -> Self {
        let lists = [
            ("scenes", root.scenes.len()),
            ("nodes", root.nodes.len()),
            ("meshes", root.meshes.len()),
            ("skins", root.skins.len()),
            ("cameras", root.cameras.len()),
            ("materials", root.materials.len()),
            ("accessors", root.accessors.len()),
            ("bufferViews", root.buffer_views.len()),
            ("buffers", root.buffers.len()),
            ("textures", root.textures.len()),
            ("images", root.images.len()),
        ];
        let lists = lists.map(|(list, length)| (list, vec![false; length]));
        let mut needs = Self(lists.into());
        needs.nodes(root);
        if looks && needs.0["materials"].contains(&true) {
            for list in ["textures", "images"] {
                needs.0.insert(list, vec![true; needs.0[list].len()]);
            }
            let views = root.images.iter().filter_map(|image| image.buffer_view);
            views.for_each(|view| needs.view(root, view.value()));
        }
        needs
    }

    /// Whether an element is needed.
    pub fn has(&self, list: &str, index: usize) -> bool {
        self.0.get(list).and_then(|list| list.get(index)) == Some(&true)
    }

    /// Whether a mistake matters that is at a path such as `meshes[2].primitives[0]`.
    pub fn has_path(&self, path: &str) -> bool {
        let Some((list, rest)) = path.split_once('[') else {
            return true;
        };
        let index = rest.split(']').next().and_then(|index| index.parse().ok());
        match (self.0.get(list), index) {
            (Some(_), Some(index)) => self.has(list, index),
            _ => true,
        }
    }

    /// Marks an element. Returns whether it exists and is new.
    fn mark(&mut self, list: &str, index: usize) -> bool {
        let slot = self.0.get_mut(list).and_then(|list| list.get_mut(index));
        slot.is_some_and(|slot| !std::mem::replace(slot, true))
    }

    fn nodes(&mut self, root: &Root) {
        let shown = root.scene.map_or(0, |scene| scene.value());
        let mut open: Vec<usize> = match root.scenes.get(shown) {
            Some(scene) => scene.nodes.iter().map(|node| node.value()).collect(),
            None => (0..root.nodes.len()).collect(),
        };
        self.mark("scenes", shown);
        while let Some(index) = open.pop() {
            if !self.mark("nodes", index) {
                continue;
            }
            let node = &root.nodes[index];
            let children = node.children.iter().flatten();
            open.extend(children.map(|child| child.value()));
            if let Some(camera) = node.camera {
                self.mark("cameras", camera.value());
            }
            for accessor in instancing(node).into_iter().flatten() {
                self.accessor(root, accessor.1);
            }
            if let Some(mesh) = node.mesh {
                self.mesh(root, mesh.value());
            }
            let Some(skin) = node.skin.filter(|skin| self.mark("skins", skin.value())) else {
                continue;
            };
            let skin = &root.skins[skin.value()];
            open.extend(skin.joints.iter().map(|joint| joint.value()));
            if let Some(matrices) = skin.inverse_bind_matrices {
                self.accessor(root, matrices.value());
            }
        }
    }

    fn mesh(&mut self, root: &Root, index: usize) {
        if !self.mark("meshes", index) {
            return;
        }
        for primitive in &root.meshes[index].primitives {
            for (name, accessor) in &primitive.attributes {
                use Semantic::{Colors, Joints, Normals, Positions, TexCoords, Weights};
                if let Checked::Valid(
                    Positions | Normals | TexCoords(_) | Colors(0) | Joints(_) | Weights(_),
                ) = name
                {
                    self.accessor(root, accessor.value());
                }
            }
            let targets = primitive.targets.iter().flatten();
            let moved = targets.flat_map(|target| [target.positions, target.normals]);
            for accessor in moved.chain([primitive.indices]).flatten() {
                self.accessor(root, accessor.value());
            }
            if let Some(material) = primitive.material {
                self.mark("materials", material.value());
            }
        }
    }

    fn accessor(&mut self, root: &Root, index: usize) {
        if !self.mark("accessors", index) {
            return;
        }
        let accessor = &root.accessors[index];
        let sparse = accessor.sparse.iter();
        let sparse = sparse.flat_map(|s| [s.indices.buffer_view, s.values.buffer_view]);
        for view in accessor.buffer_view.into_iter().chain(sparse) {
            self.view(root, view.value());
        }
    }

    fn view(&mut self, root: &Root, index: usize) {
        if self.mark("bufferViews", index) {
            self.mark("buffers", root.buffer_views[index].buffer.value());
        }
    }
}

/// Accessors of `EXT_mesh_gpu_instancing` by the names of their attributes. `None` without that extension.
pub(super) fn instancing(node: &scene::Node) -> Option<Vec<(&str, usize)>> {
    let others = &node.extensions.as_ref()?.others;
    let attributes = others.get("EXT_mesh_gpu_instancing")?.get("attributes")?;
    let known = attributes.as_object()?.iter();
    let number = |value: &Value| value.as_u64().map_or(usize::MAX, |index| index as usize);
    Some(
        known
            .map(|(name, value)| (name.as_str(), number(value)))
            .collect(),
    )
}
