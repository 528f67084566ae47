//! Sensors that the command line places.

use std::path::Path;

use antumbra::{Bvh, Geometry, Recipe};
use antumbra_bake::{Mesh, Orientation, Placement, Sensors, UpAxis};

use super::ground::{self, Ground};
use super::raster;
use crate::args::PlaceArgs;
use crate::exit::Failure;

/// Sensors, and how they were placed.
pub struct Places {
    pub sensors: Sensors,
    /// East, north and up in which the rows of a grid run; turned where facades are seen from a side.
    pub plan: Orientation,
    /// Tree of the object that has sensors; `None` if all have.
    only: Option<Bvh>,
}

/// Refuses places that cannot be, before anything is read.
pub fn check(args: &PlaceArgs) -> Result<(), Failure> {
    if args.seen_from.is_some() && args.grid.is_none() {
        return Err(Failure::Usage("--seen-from needs --grid".into()));
    }
    args.placement.check().map_err(Failure::Usage)
}

/// Refuses a raster of results at `path` if sensors are not the cells of one.
pub fn check_raster(path: &Path, args: &PlaceArgs, scene: &Path) -> Result<(), Failure> {
    let has_cells = match args.seen_from {
        Some(_) => false,
        None => args.grid.is_some() || args.vertices && raster::is_raster(scene),
    };
    if has_cells {
        return Ok(());
    }
    let path = path.display();
    let reason = "a raster needs --grid from above, or --cells of a scene that is one";
    Err(Failure::Usage(format!("{path}: {reason}")))
}

impl Places {
    /// The sensors that the command line chooses.
    pub fn new(args: &PlaceArgs, ground: &Ground, up: UpAxis) -> Result<Self, Failure> {
        let level = Orientation::new(up, 0.0).map_err(Failure::usage)?;
        let plan = match args.seen_from {
            Some(side) => {
                let compass = Orientation::new(up, args.north).map_err(Failure::usage)?;
                let towards = compass.direction(side.azimuth, 0.0);
                Orientation::from_vectors(towards, compass.up).map_err(Failure::usage)?
            }
            None => level,
        };
        let mesh = match &args.only {
            Some(name) => Some(object(name, ground)?),
            None => None,
        };
        let only = match &mesh {
            Some(mesh) => Some(tree(mesh)?),
            None => None,
        };
        let mut places = Self {
            sensors: Sensors::of_vertices(&Mesh::default()),
            plan,
            only,
        };
        let units = |metres: f64| metres / args.units.metres();
        let placement = &args.placement;
        let mesh = mesh.as_ref().unwrap_or(&ground.mesh);
        places.sensors = if let Some(path) = &args.sensors {
            ground::sensors(path, ground, &level)?
        } else if let Some(path) = &placement.along {
            let corners = ground::sensors(path, ground, &level)?;
            let spacing = units(placement.spacing.unwrap_or_default());
            let sensors = Sensors::along_lines(&corners, spacing);
            sensors.map_err(|error| Failure::Usage(format!("--along: {error}")))?
        } else if let Some(spacing) = placement.surfaces {
            let options = Placement {
                spacing: units(spacing),
                kinds: placement.kinds(),
                offset: units(placement.offset),
                storey: placement.storey_height.map(units),
            };
            let sensors = Sensors::on_surfaces(&ground.bvh, mesh, &options, &level);
            sensors.map_err(|error| Failure::Usage(format!("--surfaces: {error}")))?
        } else if let Some(spacing) = args.grid {
            ground.grid_of(places.bvh(ground), units(spacing), &places.plan)?
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
        self.only.as_ref().unwrap_or(&ground.bvh)
    }

    /// Triangle of the mesh that each sensor is on, if any.
    pub fn triangles(&self, ground: &Ground, up: UpAxis) -> Result<Vec<Option<u32>>, Failure> {
        let level = Orientation::new(up, 0.0).map_err(Failure::usage)?;
        let ids = self.sensors.triangles(&ground.bvh, &level).into_iter();
        Ok(ids
            .map(|ids| ids.and_then(|ids| ground.parts.flat(ids)))
            .collect())
    }
}

/// The triangles of an object.
fn object(name: &str, ground: &Ground) -> Result<Mesh, Failure> {
    let names = ground.parts.objects(&ground.mesh);
    let is_own = |triangle: &usize| names.name(*triangle) == name;
    let triangles = (0..ground.mesh.indices.len()).filter(is_own);
    let indices: Vec<[u32; 3]> = triangles.map(|i| ground.mesh.indices[i]).collect();
    if indices.is_empty() {
        let some = names.some(8).join(", ");
        let reason = format!("--only: there is no object {name:?}; some are {some}");
        return Err(Failure::Usage(reason));
    }
    Ok(Mesh {
        indices,
        ..ground.mesh.clone()
    })
}

/// Tree of a mesh.
pub fn tree(mesh: &Mesh) -> Result<Bvh, Failure> {
    let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
    let built = Bvh::build(&geometry, &Recipe::default());
    built.map_err(|error| Failure::work(error.to_string()))
}
