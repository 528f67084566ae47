//! Sensors that the command line places.

use std::path::{Path, PathBuf};

use antumbra::{Bvh, Geometry, Recipe};
use antumbra_bake::{Flat, Groups, Orientation, Placement, Sensors, UpAxis};
use antumbra_lab::count;

use super::command::Named;
use super::ground::{self, Ground};
use super::raster;
use crate::args::PlaceArgs;
use crate::exit::{Failure, say};

/// Sensors, and how they were placed.
pub struct Places {
    pub sensors: Sensors,
    /// East, north and up in which the rows of a grid run; turned where facades are seen from a side.
    pub plan: Orientation,
    /// Tree of the object that has sensors, and its triangles in the mesh of the scene; `None` if all have.
    only: Option<(Bvh, Vec<u32>)>,
}

/// Refuses places that cannot be, before anything is read.
pub fn check(args: &PlaceArgs) -> Result<(), Failure> {
    if args.seen_from.is_some() && args.grid.is_none() {
        return Err(Failure::Usage("--seen-from needs --grid".into()));
    }
    args.placement.check().map_err(Failure::Usage)
}

/// Refuses a raster of results at `path` if sensors are not the cells of one.
pub fn check_raster(path: &Path, args: &PlaceArgs, scene: &[PathBuf]) -> Result<(), Failure> {
    let has_cells = match args.seen_from {
        Some(_) => false,
        None => args.grid.is_some() || args.vertices && raster::is_raster(scene),
    };
    if has_cells {
        return Ok(());
    }
    let reason = "a raster needs --grid from above, or --cells of a scene that is one";
    Err(Failure::name(path, reason))
}

impl PlaceArgs {
    /// Files with sensors.
    pub fn files(&self) -> [Named<'_>; 2] {
        [
            ("--sensors", self.sensors.as_deref()),
            ("--along", self.placement.along.as_deref()),
        ]
    }
}

impl Places {
    /// The sensors that the command line chooses.
    pub fn new(args: &PlaceArgs, ground: &mut Ground, up: UpAxis) -> Result<Self, Failure> {
        let level = Orientation::new(up, 0.0).map_err(Failure::usage)?;
        let plan = match args.seen_from {
            Some(side) => {
                let compass = Orientation::new(up, args.north.degrees()).map_err(Failure::usage)?;
                let towards = compass.direction(side.azimuth, 0.0);
                Orientation::from_vectors(towards, compass.up).map_err(Failure::usage)?
            }
            None => level,
        };
        // A grid is turned to whoever looks at it, a table has normals of its own, and a raster faces up.
        let has_sides = args.vertices && ground.loaded.raster.is_none();
        if args.placement.surfaces.is_some() || has_sides {
            ground.face(&level);
        }
        let ground = &*ground;
        let mut places = Self {
            sensors: Sensors::default(),
            plan,
            only: match (&args.only, &ground.around) {
                (Some(name), _) => Some(object(name, ground)?),
                // A grid covers the scene, and not what touches it.
                (None, Some(_)) if args.grid.is_some() => Some(tree_of(ground, |_| true)?),
                (None, _) => None,
            },
        };
        let units = |metres: f64| metres / args.units.metres();
        let placement = &args.placement;
        places.sensors = if let Some(path) = &args.sensors {
            ground::sensors(path, ground, &level)?
        } else if let Some(path) = &placement.along {
            let corners = ground::sensors(path, ground, &level)?;
            let spacing = units(placement.spacing.unwrap_or_default());
            let sensors = Sensors::along_lines(&corners, spacing);
            sensors.map_err(|error| Failure::Usage(format!("--along: {error}")))?
        } else if let (Some(spacing), Some(surfaces)) = (placement.surfaces, &ground.surfaces) {
            let options = Placement {
                spacing: units(spacing),
                kinds: placement.kinds(),
                offset: units(placement.offset),
                storey: placement.storey_height.map(units),
                covered: units(placement.covered),
            };
            let triangles = match &places.only {
                Some((_, triangles)) => triangles.clone(),
                None => (0..ground.mesh.indices.len() as u32).collect(),
            };
            let sensors = Sensors::on_surfaces(
                &ground.bvh,
                &|ids| ground.parts.flat(ids),
                (ground.whole(), surfaces),
                triangles,
                &options,
                &level,
            );
            sensors.map_err(|error| Failure::Usage(format!("--surfaces: {error}")))?
        } else if let Some(spacing) = args.grid {
            match &places.only {
                Some((bvh, triangles)) => {
                    let flat = |[_, triangle]: [u32; 2]| triangles.get(triangle as usize).copied();
                    ground.grid_of((bvh, &flat), units(spacing), &places.plan)?
                }
                None => ground.grid(units(spacing), &places.plan)?,
            }
        } else {
            Sensors::of_vertices(&ground.mesh)
        };
        if placement.height > 0.0 {
            let rise = level.up.map(|x| x * units(placement.height));
            for point in &mut places.sensors.points {
                *point = [0, 1, 2].map(|axis| (f64::from(point[axis]) + rise[axis]) as f32);
            }
        }
        Ok(places)
    }

    /// Tree of the surfaces that have sensors.
    pub fn bvh<'a>(&'a self, ground: &'a Ground) -> &'a Bvh {
        self.only.as_ref().map_or(&ground.bvh, |(bvh, _)| bvh)
    }

    /// Triangle of the mesh that each sensor is on, if any. Points of a table are looked for, and a warning says how many lie
    /// between `groups`.
    pub fn triangles(
        &self,
        ground: &Ground,
        up: UpAxis,
        groups: &Groups,
    ) -> Result<Vec<Option<u32>>, Failure> {
        let sensors = &self.sensors;
        if !sensors.triangles.is_empty() {
            let known = |&triangle: &u32| (triangle != u32::MAX).then_some(triangle);
            return Ok(sensors.triangles.iter().map(known).collect());
        }
        let level = Orientation::new(up, 0.0).map_err(Failure::usage)?;
        let group = |triangle: u32| groups.of_triangle[triangle as usize];
        let is_own = |triangle: &u32| (*triangle as usize) < ground.mesh.indices.len();
        let tree: (_, Flat<'_>) = (&ground.bvh, &|ids| ground.parts.flat(ids).filter(is_own));
        let (triangles, ambiguous) = sensors.locate(tree, &ground.mesh, &group, &level);
        if ambiguous > 0 {
            say(format_args!(
                "warning: {} of {} points lie on surfaces of two groups that touch, and count for one of them: give them normals, or move \
                 them",
                count(ambiguous as u64),
                count(triangles.len() as u64),
            ));
        }
        Ok(triangles)
    }
}

/// Tree of an object, and its triangles.
fn object(name: &str, ground: &Ground) -> Result<(Bvh, Vec<u32>), Failure> {
    let names = ground.parts.objects(&ground.mesh);
    let is_own = |triangle: &u32| names.name(*triangle as usize) == name;
    let found = tree_of(ground, is_own)?;
    if found.1.is_empty() {
        let some = names.some(8).join(", ");
        let reason = format!("--only: there is no object {name:?}; some are {some}");
        return Err(Failure::Usage(reason));
    }
    Ok(found)
}

/// Tree of some triangles of the mesh, and their numbers.
fn tree_of(ground: &Ground, is_own: impl Fn(&u32) -> bool) -> Result<(Bvh, Vec<u32>), Failure> {
    let triangles = 0..ground.mesh.indices.len() as u32;
    let triangles: Vec<u32> = triangles.filter(is_own).collect();
    let indices = triangles.iter().map(|&i| ground.mesh.indices[i as usize]);
    Ok((tree(&ground.mesh.positions, indices.collect())?, triangles))
}

/// Tree of triangles.
pub fn tree(positions: &[[f32; 3]], indices: Vec<[u32; 3]>) -> Result<Bvh, Failure> {
    let geometry = [Geometry::triangles(positions, indices)];
    let built = Bvh::build(&geometry, &Recipe::default());
    built.map_err(|error| Failure::work(error.to_string()))
}
