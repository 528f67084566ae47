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
//! | the same for the cells of a height raster | [`FieldSunJob`], [`FieldSunJob::whole`] | [`SunValues`] |
//! | the same for a scene in terrain, such as houses on a height raster | [`SunJob::within`], [`FieldSunJob::among`] | [`SunValues`] |
//! | how much of the light of a surface arrives at others | [`view_factors`], [`ViewFactorJob`] | `f64`, surfaces x surfaces |
//! | which cells of a height raster does each observer see | [`ViewshedJob`], [`run`] | [`Viewsheds`] |
//! | how high must something on a cell be until an observer sees it | [`TargetHeightJob`], [`run`] | a number for each cell |
//! | how high is the horizon in each azimuth | [`HorizonJob`], [`run`] | `f32`, points x azimuths |
//! | how high is the horizon of each cell of a height raster | [`FieldHorizonJob`], [`run`] | `f32`, directions x cells |
//! | how much of the sky does each cell see | [`FieldSky`] | [`SkyValues`] |
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
//! Long bakes are jobs: [`OcclusionJob`], [`SunJob`], [`HorizonJob`], [`FieldHorizonJob`], [`FieldSunJob`], [`ViewFactorJob`], [`VisibilityJob`] and
//! [`ViewshedJob`]. A [`Job`] has numbered items, and
//! [`Work`] computes them in chunks, which can be kept in files, resumed, and shared among machines. [`learn_when_it_pays`] makes
//! a tree that learned from rays of the job. [`Sensors`] and [`Atlas`] make points of meshes, grids, tables and textures.
//!
//! # Files
//! A folder uses itself and the folders before it, but for the sky, which decides what is covered:
//! - `points`: what is baked. `mesh`, `normals`, `creases`, `bodies`: meshes, and which way they face;  `surfaces`: roofs, facades and
//!   ground;  `sensors`, `placement`, `table`, `atlas`: points of them;  `groups`: means over their sensors;  `curve`: points in an
//!   order in which neighbours are near each other
//! - `jobs`: `job`: what a bake is, and its key;  `work`, `part`: chunks of a job, and files of them;  `learn`: trees that learn from a job
//! - `sight`: rays. `ambient_occlusion`, `openness`: the open part of the sky, and its job;  `visibility`, `eyes`: directions and
//!   points that points see, and the job of the latter;  `horizon_angles`, `view_factors`: one job each;  `bits`: matrices of one
//!   bit per answer;  `directions`: directions over a hemisphere;  `curvature`: lines of sight over a round earth
//! - `sun`: `position`: where the sun is;  `sky`, `perez`: the sky in patches, and its light;  `moment`, `clock`, `epw`: dates, time
//!   zones, weather files;  `sunlight`: the job of a period;  `surroundings`: scenes in terrain;  `pieces`: scenes among files that are loaded when rays need them;  `exposure`, `hourly`, `measures`: sums, steps and classes
//! - `rasters`: `viewshed`, `field_horizon`, `field_sun`: jobs of height rasters, which `antumbra-terrain` answers without rays;
//! - `files`: `npz`: arrays for numpy;  `ply`, `glb`: meshes with a value at every vertex
//! - `vector`, `orientation`: vectors, and where up and north are in a scene
//! - `error`: why there is no result
#![forbid(unsafe_code)]

mod error;
mod files;
mod jobs;
mod orientation;
mod points;
mod rasters;
mod sight;
mod sun;
mod vector;

pub use antumbra_terrain::{
    Direction, FieldSky, HeightField, Lattice, Limits, Monitor, Observer, SkyMeasure, SkyValues,
};
use antumbra_terrain::{Progress, memory};

pub use error::Error;
pub use files::*;
pub use jobs::*;
pub use orientation::{Orientation, UpAxis};
pub use points::*;
pub use rasters::*;
pub use sight::*;
pub use sun::*;
