//! Height rasters, answered exactly and without rays.

pub(crate) mod field_horizon;
pub(crate) mod height_field;
pub(crate) mod horizon;
pub(crate) mod sweep;
pub(crate) mod viewshed;

pub use field_horizon::FieldHorizonJob;
pub use height_field::{HeightField, Observer};
pub use viewshed::{ViewshedJob, Viewsheds};
