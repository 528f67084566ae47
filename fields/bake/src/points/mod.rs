//! Points that are baked, and the meshes that they come from.

pub(crate) mod atlas;
pub(crate) mod bodies;
pub(crate) mod creases;
pub(crate) mod curve;
pub(crate) mod groups;
pub(crate) mod mesh;
pub(crate) mod normals;
pub(crate) mod placement;
pub(crate) mod sensors;
pub(crate) mod surfaces;
pub(crate) mod table;

pub use atlas::Atlas;
pub use bodies::Bodies;
pub use creases::{CREASE_ANGLE, Creased, inside_edges, split_at_creases};
pub use curve::{Places, along_curve};
pub use groups::{Groups, Statistics};
pub use mesh::Mesh;
pub use normals::vertex_normals;
pub use placement::Placement;
pub use sensors::{Grid, Label, Layout, Sensors};
pub use surfaces::{Flat, Surface, Surfaces};
pub use table::BadTable;
