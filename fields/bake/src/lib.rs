//! Baked occlusion: numbers about points of a scene that are computed once and kept.
//!
//! Commands and other languages share these functions. Trees are the kernel's, and so are all answers about rays.
//!
//! ```
//! use antumbra::{Bvh, Geometry, Recipe};
//! use antumbra_bake::{AmbientOcclusion, ambient_occlusion, vertex_normals};
//!
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let indices = [[0, 1, 2]];
//! let geometry = [Geometry::triangles(&positions[..], &indices[..])];
//! let bvh = Bvh::build(&geometry, &Recipe::default())?;
//!
//! let normals = vertex_normals(&positions, &indices);
//! let open = ambient_occlusion(&bvh, &positions, &normals, &AmbientOcclusion::default(), &())?;
//! assert_eq!(open, [1.0; 3], "nothing stands above a triangle on its own");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | question | call | answer |
//! |---|---|---|
//! | how open is the sky above points | [`ambient_occlusion`], [`bent_normals`] | `f32`, and a direction |
//! | which patches of the sky does each point see | [`SkyDivision::patches`], [`sees_directions`] | [`BitMatrix`], points x patches |
//! | how much of the sky does each point see | [`sky_view`] | `f32` |
//! | where is the sun | [`sun_positions`], [`Orientation::direction`] | angles, a direction in the scene |
//! | which suns does each point see, and for how long | [`sees_directions`], [`sun_hours`] | [`BitMatrix`], points x suns; `f64` |
//! | how much energy does each point receive from the sun and the sky | [`SunJob`], [`run`] | [`SunValues`] |
//! | how much of the light of a surface arrives at others | [`view_factors`], [`ViewFactorJob`] | `f64`, surfaces x surfaces |
//! | which cells of a height raster does each observer see | [`ViewshedJob`], [`run`] | [`Viewsheds`] |
//! | how high is the horizon in each azimuth | [`HorizonJob`], [`FieldHorizonJob`], [`run`] | `f32`, points x azimuths |
//! | which points see each other | [`sees_points`], [`sees_each_other`] | [`BitMatrix`], points x points |
//!
//! All of them take slices of `[f32; 3]` in the coordinates of the tree, and a [`Monitor`], which receives the progress and may
//! cancel. Answers about a point depend only on this point. So they have the same bits for any number of threads, any recipe of
//! the tree, and for lists that are given in parts. Hours of direct sun on the longest day, in a scene whose z axis points up:
//!
//! ```
//! # use antumbra::{Bvh, Geometry, Recipe};
//! use antumbra_bake::{Moment, Orientation, Place, Refraction, sun_hours, sun_positions};
//!
//! # let positions = [[0.0, -9.0, 0.0], [0.0, 9.0, 0.0], [0.0, 0.0, 9.0]];
//! # let bvh = Bvh::build(&[Geometry::triangles(&positions[..], vec![[0, 1, 2]])], &Recipe::default())?;
//! let place = Place { latitude: 48.2, longitude: 16.4, height: 170.0 };
//! let midnight: Moment = "2024-06-21".parse()?;
//! let times: Vec<f64> = (0..96).map(|i| midnight.unix(1.0) + 900.0 * (f64::from(i) + 0.5)).collect();
//! let mut directions = Vec::new();
//! for sun in sun_positions(&place, Refraction::Standard, &times)? {
//!     if sun.elevation > 0.0 {
//!         let direction = Orientation::default().direction(sun.azimuth, sun.elevation);
//!         directions.push(direction.map(|x| x as f32));
//!     }
//! }
//! let quarters = vec![0.25; directions.len()];
//! let (points, normals) = ([[5.0, 0.0, 0.0], [99.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]; 2]);
//! let hours = sun_hours(&bvh, &points, &normals, &directions, &quarters, &())?;
//! assert_eq!(hours[1], 16.0);
//! assert!(hours[0] < hours[1], "the wall takes the evening sun");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Jobs
//!
//! Long bakes are jobs: [`OcclusionJob`], [`SunJob`], [`HorizonJob`], [`FieldHorizonJob`], [`ViewFactorJob`], [`VisibilityJob`] and
//! [`ViewshedJob`]. A [`Job`] has numbered items, and
//! [`Work`] computes them in chunks, which can be kept in files, resumed, and shared among machines. [`learn_when_it_pays`] makes
//! a tree that learned from rays of the job. [`Sensors`] and [`Atlas`] make points of meshes, grids, tables and textures.
//!
//! # Files
//! - `job`: jobs and their keys;  `work`, `part`: chunks of a job, and files of them;  `learn`: trees that learn from a job
//! - `occlusion_job`, `sunlight`, `visibility_job`: one job each
//! - `mesh`, `sensors`, `table`, `atlas`: points that are baked
//! - `bodies`: what is closed, and which way it faces;  `surfaces`: roofs, facades and ground, and what is covered
//! - `groups`: triangles of an object, a material or a facade, and means over their sensors
//! - `placement`: sensors on roofs, facades and ground, and along lines
//! - `ambient_occlusion`: the open part of the sky above points
//! - `view_factors`: light that goes from surface to surface
//! - `curvature`: lines of sight over a round earth
//! - `viewshed`: cells of a `height_field` that observers see;  `sweep`, `horizon`: edges of the field as an eye sees them
//! - `horizon_angles`: how high surfaces reach in each azimuth, by rays;  `field_horizon`: the same of height fields, exactly
//! - `visibility`: directions and points that points see;  `exposure`: sums of what they see
//! - `sky`: the sky in patches;  `sun`: where the sun is;  `moment`, `clock`: dates, times of day and time zones
//! - `hourly`: values step by step;  `measures`: classes of sunlight, reflected light
//! - `perez`: the light of the sky;  `epw`: weather files
//! - `orientation`: where up and north are in a scene
//! - `bits`: matrices of one bit per answer
//! - `directions`: directions over a hemisphere, spread evenly and different at every point
//! - `normals`: normals of vertices from the triangles around them
//! - `npz`: arrays for numpy;  `ply`, `glb`: meshes with a value at every vertex as files
//! - `monitor`: progress and cancellation;  `error`: why there is no result;  `memory`: lists that may not fit
#![forbid(unsafe_code)]

mod ambient_occlusion;
mod atlas;
mod bits;
mod bodies;
mod clock;
mod creases;
mod curvature;
mod curve;
mod directions;
mod epw;
mod error;
mod exposure;
mod field_horizon;
mod glb;
mod groups;
mod height_field;
mod horizon;
mod horizon_angles;
mod hourly;
mod job;
mod learn;
mod measures;
mod memory;
mod mesh;
mod moment;
mod monitor;
mod normals;
mod npz;
mod occlusion_job;
mod orientation;
mod part;
mod perez;
mod placement;
mod ply;
mod sensors;
mod sky;
mod sun;
mod sunlight;
mod surfaces;
mod sweep;
mod table;
mod view_factors;
mod viewshed;
mod visibility;
mod visibility_job;
mod work;

pub use ambient_occlusion::{
    AmbientOcclusion, BentNormal, ambient_occlusion, ambient_rays, bent_normals,
};
pub use atlas::Atlas;
pub use bits::{BitMatrix, ones};
pub use bodies::Bodies;
pub use clock::Clock;
pub use creases::{CREASE_ANGLE, Creased, inside_edges, split_at_creases};
pub use curvature::{Curvature, EARTH_RADIUS, REFRACTION};
pub use curve::along_curve;
pub use directions::Weighting;
pub use epw::{BadWeather, Record, Weather};
pub use error::Error;
pub use exposure::{sky_view, sun_hours};
pub use field_horizon::FieldHorizonJob;
pub use glb::write_glb;
pub use groups::{Groups, Statistics};
pub use height_field::HeightField;
pub use horizon_angles::HorizonJob;
pub use hourly::{Hourly, Receipt};
pub use job::{Answers, Job, Key, run};
pub use learn::{Learned, learn_when_it_pays};
pub use measures::SunlightClass;
pub use mesh::Mesh;
pub use moment::{BadMoment, Moment, is_leap_year};
pub use monitor::Monitor;
pub use normals::vertex_normals;
pub use npz::{Array, Entry, npz_bytes, write_npz};
pub use occlusion_job::{OcclusionJob, Openness};
pub use orientation::{Orientation, UpAxis};
pub use part::{Identity, Part};
pub use perez::{Irradiance, perez_sky};
pub use placement::Placement;
pub use ply::ShadedMesh;
pub use sensors::{Grid, Label, Layout, Sensors};
pub use sky::{SkyDivision, SkyPatches};
pub use sun::{Place, Refraction, SunPosition, sun_positions};
pub use sunlight::{SunFound, SunJob, SunValues, Sunlight, Suns, TimeStep};
pub use surfaces::{Flat, Surface, Surfaces};
pub use table::BadTable;
pub use view_factors::{ViewFactorJob, view_factors};
pub use viewshed::{Observer, ViewshedJob, Viewsheds};
pub use visibility::{SightLines, SightRange, sees_directions, sees_each_other, sees_points};
pub use visibility_job::{Eyes, VisibilityJob};
pub use work::Work;
