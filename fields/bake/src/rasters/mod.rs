//! Jobs of height rasters, which [`antumbra_terrain`] answers exactly and without rays.

pub(crate) mod field_horizon;
pub(crate) mod field_sun;
pub(crate) mod viewshed;

pub use field_horizon::FieldHorizonJob;
pub use field_sun::{FieldSunJob, LitBy};
pub use viewshed::{TargetHeightJob, ViewshedJob, Viewsheds};
