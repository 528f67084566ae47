//! `antumbra factors`: view factors between the surfaces of a scene.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use antumbra::Bvh;
use antumbra_bake::{Array, Entry, Groups, Orientation, UpAxis, ViewFactorJob};
use antumbra_image::atomic_write;
use antumbra_lab::count;
use antumbra_scene::Geometry;
use clap::{ArgAction, Args};

use super::command::{Bake, Baking, Figure};
use super::files::{self, Format, field};
use super::parts::By;
use super::places;
use crate::args::{ChunkArgs, SCENE, SCENE_LONG, heading, up_axis, values};
use crate::exit::{Failure, tell};
use crate::interrupt;
use crate::json::Destination;
use crate::output::Files;

/// Most surfaces, whose matrix has 3 GB.
const MOST: usize = 20_000;

/// Flags of `factors`.
#[derive(Debug, Args)]
pub struct FactorArgs {
    #[arg(required = true, num_args = 1, action = ArgAction::Set, help = SCENE, long_help = SCENE_LONG)]
    pub scene: Vec<PathBuf>,
    /// Result: .csv or .npz
    ///
    /// May be given several times. A .csv has a line for each surface: its names, its area in squared units, its factor to every
    /// surface, and the part that arrives nowhere. An .npz has the array factors with the last column for nowhere, the areas, and the
    /// surface of each triangle. A shard is a .part.
    #[arg(short, long, value_name = "OUT", required = true, value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub output: Vec<PathBuf>,
    /// Figures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    /// Surfaces: object, material or facade
    ///
    /// Lines `o`, or else `g`, begin objects in an .obj; nodes are objects in a .gltf. Where nothing has a name, surfaces that touch are a
    /// body. A facade is all of an object that faces one of eight sides of the compass; roofs, ground and undersides are surfaces too.
    #[arg(long, value_name = "KIND", value_enum, default_value_t = By::Object, hide_possible_values = true, help_heading = heading::WORK)]
    pub by: By,
    /// Rays of each surface
    ///
    /// Errors of a factor are about 1 / N to 1 / sqrt(N).
    #[arg(long, value_name = "N", default_value_t = 65_536, value_parser = clap::value_parser!(u32).range(1..), help_heading = heading::WORK)]
    pub samples: u32,
    /// Axis that points up [default: the scene's]
    #[arg(long, value_name = "AXIS", value_parser = up_axis, help_heading = heading::WORK)]
    pub up: Option<UpAxis>,
    /// Angle from mesh to true north
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, allow_negative_numbers = true, value_parser = values::finite, help_heading = heading::WORK)]
    pub north: f64,
    #[command(flatten)]
    pub chunks: ChunkArgs,
}

impl Baking for FactorArgs {
    fn check(&self) -> Result<(), Failure> {
        let sentence = "view factors are written as csv or npz";
        let mut outputs = self.output.iter();
        outputs.try_for_each(|path| Format::of(path, &["csv", "npz"], sentence).map(drop))
    }

    fn bake(&self, bake: &Bake<'_>, mut files: Files) -> Result<(), Failure> {
        bake.tell_neighbours(&self.scene);
        let mut ground = bake.ground(&mut files, None)?;
        let scene = &ground.loaded.scene;
        let mut shapes = scene.shapes.iter();
        if shapes.any(|shape| !matches!(shape.geometry, Geometry::Mesh(_))) {
            let reason = "it has spheres or curves, which have no view factors";
            return Err(Failure::scene(&scene.name, reason));
        }
        let up = ground.up(self.up)?;
        let compass = Orientation::new(up, self.north).map_err(Failure::usage)?;
        // A room is seen from inside.
        ground.keep_sides(&compass);
        let groups = self.by.groups(&ground, &compass)?;
        if groups.names.len() > MOST {
            let found = groups.names.len();
            let reason = format!("--by: that makes {found} surfaces; {MOST} are the most");
            return Err(Failure::Usage(reason));
        }
        let mut surfaces = vec![Vec::new(); groups.names.len()];
        for (&group, corners) in groups.of_triangle.iter().zip(&ground.mesh.indices) {
            let corners = corners.map(|corner| ground.mesh.positions[corner as usize]);
            surfaces[group as usize].push(corners);
        }
        let bvh = tree(&surfaces)?;
        let job = ViewFactorJob::new(&surfaces, self.samples)?;
        let done = bake.compute(&job, &ground, &bvh)?;
        if let Some(factors) = &done.found {
            let mut outputs = bake.outputs.iter();
            outputs.try_for_each(|path| write(path, &groups, factors))?;
        }
        let rays = u64::from(self.samples) * surfaces.len() as u64;
        let figures: &[Figure<'_>] = &[
            ("outputs", &bake.output_names()),
            ("shard", &bake.shard()),
            ("triangles", &ground.mesh.indices.len()),
            ("surfaces", &surfaces.len()),
            ("samples", &self.samples),
            ("rays", &rays),
            ("load_seconds", &ground.loaded.seconds),
            ("build_seconds", &ground.build_seconds),
            ("trace_seconds", &done.seconds),
        ];
        let name = ("antumbra.factors/1", &*ground.loaded.scene.name);
        if bake.document(name, figures, (&done, ""))? {
            ground.tell("");
            tell(format_args!("{} surfaces", count(surfaces.len() as u64)));
            bake.end("rays", rays, &done);
        }
        Ok(())
    }
}

/// Tree of the triangles, surface after surface.
fn tree(surfaces: &[Vec<[[f32; 3]; 3]>]) -> Result<Bvh, Failure> {
    let positions: Vec<[f32; 3]> = surfaces.iter().flatten().flatten().copied().collect();
    let triangles = 0..positions.len() as u32 / 3;
    let indices = triangles.map(|triangle| [0, 1, 2].map(|corner| 3 * triangle + corner));
    places::tree(&positions, indices.collect())
}

/// Writes a table or arrays.
fn write(path: &Path, groups: &Groups, factors: &[f64]) -> Result<(), Failure> {
    let _writing = interrupt::writing();
    let width = groups.names.len() + 1;
    if Format::of_sensors(path)? == Format::Npz {
        let surface: Vec<u64> = groups
            .of_triangle
            .iter()
            .map(|&group| group.into())
            .collect();
        let entries = [
            Entry::new("factors", Array::F64(factors)).columns(width),
            Entry::new("areas", Array::F64(&groups.areas)),
            Entry::new("surface", Array::Counts(&surface)),
        ];
        return files::npz(path, &entries);
    }
    Ok(atomic_write(path, |file| {
        let mut line = groups.columns.join(",");
        line.push_str(",area");
        for names in &groups.names {
            let _ = write!(line, ",{}", field(&format!("to {}", names.join(" "))));
        }
        writeln!(file, "{line},to nowhere")?;
        for (index, names) in groups.names.iter().enumerate() {
            line.clear();
            for name in names {
                let _ = write!(line, "{},", field(name));
            }
            let _ = write!(line, "{}", groups.areas[index]);
            for factor in &factors[index * width..][..width] {
                let _ = write!(line, ",{factor}");
            }
            writeln!(file, "{line}")?;
        }
        Ok(())
    })?)
}
