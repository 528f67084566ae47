//! Graphics state: the attributes in force at a point of the file, and blocks that save and restore them.

use std::collections::HashMap;
use std::sync::Arc;

use antumbra_scene::{AreaLight, Material, Param, Rgb};
use glam::{DMat3, DMat4};

use crate::directive::{ActiveTransform, Quoted};
use crate::params::Params;
use crate::source::Span;
use crate::transform;

/// Message for transformations that nothing can move between.
pub(crate) const MIRRORS: &str =
    "of the transformations at the start and at the end, one mirrors and the other does not";
pub(crate) const MIRRORS_HELP: &str = "negative factors of Scale belong under ActiveTransform All";

/// Current transformation at the start and at the end of the exposure.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Transforms {
    pub start: DMat4,
    pub end: DMat4,
    pub active: ActiveTransform,
}

impl Default for Transforms {
    fn default() -> Self {
        Self {
            start: DMat4::IDENTITY,
            end: DMat4::IDENTITY,
            active: ActiveTransform::All,
        }
    }
}

impl Transforms {
    /// Applies `f` to the active transformations.
    pub fn change(&mut self, f: impl Fn(DMat4) -> DMat4) {
        if self.active != ActiveTransform::EndTime {
            self.start = f(self.start);
        }
        if self.active != ActiveTransform::StartTime {
            self.end = f(self.end);
        }
    }

    /// Sets both transformations from a named coordinate system, whichever are active, as in pbrt.
    pub fn set(&mut self, [start, end]: [DMat4; 2]) {
        self.start = start;
        self.end = end;
    }

    /// Returns true if one of the two mirrors and the other does not, so that nothing can move from one to the other.
    pub fn mirror_differently(&self) -> bool {
        transform::swaps_handedness(&self.start) != transform::swaps_handedness(&self.end)
    }

    /// Returns true if the two transformations differ.
    pub fn is_animated(&self) -> bool {
        self.start != self.end
    }
}

/// Material with its declaration, because shapes can override its parameters.
#[derive(Clone, Debug)]
pub(crate) struct MaterialSpec {
    pub kind: Quoted,
    pub params: Params,
    pub material: Material,
}

/// Meaning of a texture's name.
#[derive(Clone, Debug)]
pub(crate) enum Definition<T> {
    Known(Param<T>),
    /// Texture of an unsupported class of pbrt-v3, whose use is an error.
    Unsupported(String),
    /// Texture with a mistake, which was reported at its definition.
    Broken,
}

/// Attributes that `AttributeBegin` saves, apart from names.
#[derive(Clone, Default)]
pub(crate) struct Attributes {
    pub transforms: Transforms,
    /// Current material; `None` means the default, matte.
    pub material: Option<Arc<MaterialSpec>>,
    /// Name of the current material, if pbrt-v4 defines it after its use.
    pub later_material: Option<Arc<Quoted>>,
    pub area_light: Option<AreaLight>,
    /// Names of the media inside and outside of surfaces, of which an empty one is vacuum.
    pub media: [Option<Arc<Quoted>>; 2],
    pub reverse_orientation: bool,
    /// Values of parameters that directives of a group do not give, the newest last.
    pub attributes: Vec<(String, Arc<Params>)>,
    /// Primaries of colours, where the picture has others.
    pub color_space: Option<DMat3>,
    /// Place of the `ObjectBegin` of the open object.
    pub object: Option<Span>,
}

/// Names with block scope.
///
/// The end of a block undoes its own definitions, so a block costs only as much as it defines.
pub(crate) struct Scoped<T> {
    map: HashMap<String, T>,
    undo: Vec<(String, Option<T>)>,
}

impl<T> Default for Scoped<T> {
    fn default() -> Self {
        Self {
            map: HashMap::new(),
            undo: Vec::new(),
        }
    }
}

impl<T> Scoped<T> {
    /// Defines or redefines a name.
    pub fn define(&mut self, name: String, value: T) {
        let earlier = self.map.insert(name.clone(), value);
        self.undo.push((name, earlier));
    }

    pub fn get(&self, name: &str) -> Option<&T> {
        self.map.get(name)
    }

    /// All names in alphabetical order.
    pub fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.map.keys().map(String::as_str).collect();
        names.sort_unstable();
        names
    }

    /// Mark of the current state, for [`Self::rewind`].
    fn mark(&self) -> usize {
        self.undo.len()
    }

    fn rewind(&mut self, mark: usize) {
        for (name, earlier) in self.undo.drain(mark..).rev() {
            match earlier {
                Some(value) => self.map.insert(name, value),
                None => self.map.remove(&name),
            };
        }
    }
}

/// Kind of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BlockKind {
    Attribute,
    Transform,
    Object,
}

impl BlockKind {
    /// Directives that begin and end the block.
    pub fn names(self) -> [&'static str; 2] {
        match self {
            Self::Attribute => ["AttributeBegin", "AttributeEnd"],
            Self::Transform => ["TransformBegin", "TransformEnd"],
            Self::Object => ["ObjectBegin", "ObjectEnd"],
        }
    }
}

/// Open block, and the state that its end restores.
pub(crate) struct Block {
    pub kind: BlockKind,
    pub begun_at: Span,
    saved: Attributes,
    marks: [usize; 3],
}

/// State in force: attributes, names and open blocks.
#[derive(Default)]
pub(crate) struct State {
    pub now: Attributes,
    pub named_materials: Scoped<Arc<MaterialSpec>>,
    pub float_textures: Scoped<Definition<f32>>,
    pub color_textures: Scoped<Definition<Rgb>>,
    /// Whether names outlive the blocks that define them, as in pbrt-v4.
    pub names_stay: bool,
    blocks: Vec<Block>,
}

impl State {
    /// Open blocks, the innermost last.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Opens a block.
    pub fn push(&mut self, kind: BlockKind, begun_at: Span) {
        self.blocks.push(Block {
            kind,
            begun_at,
            saved: self.now.clone(),
            marks: [
                self.named_materials.mark(),
                self.float_textures.mark(),
                self.color_textures.mark(),
            ],
        });
        if kind == BlockKind::Object {
            self.now.object = Some(begun_at);
        }
    }

    /// Closes the innermost block of any kind.
    pub fn pop(&mut self) {
        let Some(block) = self.blocks.pop() else {
            return;
        };
        if block.kind == BlockKind::Transform {
            self.now.transforms = block.saved.transforms;
            return;
        }
        self.now = block.saved;
        if self.names_stay {
            return;
        }
        let [materials, floats, colors] = block.marks;
        self.named_materials.rewind(materials);
        self.float_textures.rewind(floats);
        self.color_textures.rewind(colors);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn going_back_restores_what_was_hidden() {
        let mut names = Scoped::default();
        names.define("a".into(), 1);
        let mark = names.mark();
        names.define("a".into(), 2);
        names.define("a".into(), 3);
        names.define("b".into(), 4);
        assert_eq!(names.get("a"), Some(&3));
        assert_eq!(names.names(), ["a", "b"]);
        names.rewind(mark);
        assert_eq!(names.get("a"), Some(&1));
        assert_eq!(names.get("b"), None);
    }

    #[test]
    fn only_active_transforms_change() {
        let mut transforms = Transforms {
            active: ActiveTransform::EndTime,
            ..Default::default()
        };
        transforms.change(|m| m * 2.0);
        assert!(transforms.is_animated());
        assert_eq!(transforms.start, DMat4::IDENTITY);
        transforms.active = ActiveTransform::StartTime;
        transforms.change(|m| m * 2.0);
        assert!(!transforms.is_animated());
    }
}
