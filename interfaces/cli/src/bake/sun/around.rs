//! Terrain around the scene: `sun --terrain`.

use antumbra_bake::{Orientation, Surroundings, UpAxis};
use antumbra_lab::count;
use antumbra_load::{Extent, MemorySize};
use antumbra_raster::{Crs, Site, unit_name};
use serde::Serialize;

use super::SunArgs;
use crate::bake::ground::Ground;
use crate::bake::raster::is_raster;
use crate::bake::site::Asked;
use crate::bake::terrain::Terrain;
use crate::exit::{Failure, say, tell};

/// What the document says of it.
#[derive(Serialize)]
pub struct Figures<'a> {
    file: &'a str,
    cells: usize,
    /// Bytes of heights and peaks, and of the tree of the scene.
    bytes: usize,
    tree_bytes: usize,
    sensors_below: usize,
}

/// Refuses what cannot be in terrain, before anything is read.
pub fn check(args: &SunArgs) -> Result<(), Failure> {
    let Some(first) = args.terrain.first() else {
        return Ok(());
    };
    let is_other = |path: &&_| !is_raster(std::slice::from_ref(path));
    if let Some(other) = args.terrain.iter().find(is_other) {
        let reason = "--terrain: it is no height raster; a scene goes before --terrain";
        return Err(Failure::name(other, reason));
    }
    if is_raster(&args.scene) {
        let reason = "--terrain: the scene is a height raster, too; give all rasters as one scene";
        return Err(Failure::name(first, reason));
    }
    let refused = |what| {
        let reason = format!("{what}: not with --cells of --terrain, which are on no mesh");
        Err(Failure::Usage(reason))
    };
    match args.places.cells {
        true if args.groups.is_some() => refused("--groups"),
        true if args.writes(&["ply"]) => refused("--output .ply"),
        _ => Ok(()),
    }
}

/// East, north and up of the corners of a scene.
fn extent(ground: &Ground, up: UpAxis) -> Result<Extent, Failure> {
    let scene = &ground.loaded.scene;
    let plan = Orientation::new(up, 0.0).map_err(Failure::usage)?;
    let own = ground.extent().into_iter();
    let corners = own.flat_map(|own| [own.low, own.high]);
    let found = Extent::around(corners.map(|corner| plan.local(corner.to_array())));
    found.ok_or_else(|| Failure::scene(&scene.name, "it is empty"))
}

/// The place of a scene in terrain. Settles unit and north, and checks that both are in the same coordinates.
pub fn settle(
    args: &SunArgs,
    (ground, up): (&Ground, UpAxis),
    terrain: &Terrain,
) -> Result<Option<Site>, Failure> {
    let own = terrain.heights.raster.grid.crs.as_ref();
    let name = &terrain.name;
    let codes = args.raster.crs.as_ref().and_then(Crs::epsg);
    if let (Some(asked), Some(own)) = (codes, own.and_then(Crs::epsg))
        && asked != own
    {
        return Err(Failure::Usage(format!(
            "--crs says EPSG:{asked}, and {name} is in EPSG:{own}: transform it first, as with gdalwarp -t_srs EPSG:{asked} in.tif out.tif"
        )));
    }
    if let (Some(asked), Some(metres)) = (args.places.units.known(), own.and_then(Crs::metres))
        && (asked / metres - 1.0).abs() > 1e-5
    {
        return Err(Failure::Usage(format!(
            "--units says {}, and {name} is in {}: scale the scene first",
            unit_name(asked),
            unit_name(metres)
        )));
    }
    let scene = extent(ground, up)?;
    warn_of_apart(&scene, &terrain.extent);
    let middle = scene.low.midpoint(scene.high).to_array();
    Asked::new(&args.raster, &args.places).settle(&ground.loaded.scene.name, own, middle)
}

/// Warns of terrain that is somewhere else.
fn warn_of_apart(scene: &Extent, terrain: &Extent) {
    // Houses may be far above a plain, but not by more than hills and houses are high.
    let most = scene.size().z.max(terrain.size().z);
    let is_apart = (0..3).any(|axis| {
        let most = if axis == 2 { most } else { 0.0 };
        scene.low[axis] > terrain.high[axis] + most || scene.high[axis] < terrain.low[axis] - most
    });
    if is_apart {
        let [scene, terrain] = [scene, terrain].map(|extent| {
            let side = |axis: usize| {
                let [low, high] = [extent.low, extent.high].map(|end| end[axis].round());
                format!("{low} to {high}")
            };
            format!("x {}, y {}, z {}", side(0), side(1), side(2))
        });
        say(format_args!(
            "warning: the scene is not in --terrain: {scene}, and the terrain {terrain}; both must have the same coordinates"
        ));
    }
}

/// Figures of terrain in which so many sensors are below the surface. Says so, and how large it is.
pub fn figures<'a>(
    terrain: &'a Terrain,
    ground: &Ground,
    around: &Surroundings<'_>,
    [below, sensors]: [usize; 2],
) -> Figures<'a> {
    if below > 0 {
        tell(format_args!(
            "note: {} of {} sensors are below the surface of {} and see nothing",
            count(below as u64),
            count(sensors as u64),
            terrain.name
        ));
    }
    Figures {
        file: &terrain.name,
        cells: terrain.known,
        bytes: size_of_val(&terrain.heights.raster.values[..]) + around.bytes(),
        tree_bytes: ground.bvh.report().bytes,
        sensors_below: below,
    }
}

impl Figures<'_> {
    /// Says how large tree and terrain are.
    pub fn tell(&self, triangles: usize) {
        let [tree, heights] =
            [self.tree_bytes, self.bytes].map(|bytes| MemorySize::new(bytes as u64));
        tell(format_args!(
            "memory: {tree} for the tree of {} triangles, {heights} for {} cells of terrain",
            count(triangles as u64),
            count(self.cells as u64),
        ));
    }
}
