//! What points see of directions, surfaces and each other, by rays.

pub(crate) mod ambient_occlusion;
pub(crate) mod bits;
pub(crate) mod curvature;
pub(crate) mod directions;
pub(crate) mod eyes;
pub(crate) mod horizon_angles;
pub(crate) mod openness;
pub(crate) mod view_factors;
pub(crate) mod visibility;

pub use ambient_occlusion::{
    AmbientOcclusion, BentNormal, ambient_occlusion, ambient_rays, bent_normals,
};
pub use bits::{BitMatrix, ones};
pub use curvature::{Curvature, EARTH_RADIUS, REFRACTION};
pub use directions::Weighting;
pub use eyes::{Eyes, VisibilityJob};
pub use horizon_angles::HorizonJob;
pub use openness::{OcclusionJob, Openness};
pub use view_factors::{ViewFactorJob, view_factors};
pub use visibility::{SightLines, SightRange, sees_directions, sees_each_other, sees_points};
