//! `antumbra factors`: view factors between the surfaces of a scene.

use std::fmt::Write as _;
use std::path::Path;

use antumbra::Bvh;
use antumbra_bake::{Array, Entry, Groups, Orientation, ViewFactorJob};
use antumbra_image::atomic_write;
use antumbra_lab::count;
use antumbra_load::MemorySize;
use antumbra_scene::Geometry;
use serde::Serialize;

use super::chunks::{self, PartFile};
use super::command::{Bake, Head};
use super::files::{self, Format, field};
use super::{groups, places};
use crate::args::FactorArgs;
use crate::exit::{Failure, tell};
use crate::{interrupt, json};

/// The JSON document.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    head: Head<'a>,
    outputs: Vec<String>,
    shard: Option<String>,
    triangles: usize,
    surfaces: usize,
    samples: u32,
    rays: u64,
    load_seconds: f64,
    build_seconds: f64,
    trace_seconds: f64,
}

/// Most surfaces, whose matrix has 3 GB.
const MOST: usize = 20_000;

/// Refuses outputs that cannot be made, before anything is read.
pub fn check(args: &FactorArgs) -> Result<(), Failure> {
    let sentence = "view factors are written as csv or npz";
    let mut outputs = args.output.iter();
    outputs.try_for_each(|path| Format::of(path, &["csv", "npz"], sentence).map(drop))
}

/// Runs the command, or merges parts of it.
pub fn run(
    args: &FactorArgs,
    memory: MemorySize,
    parts: Option<&[PartFile]>,
) -> Result<(), Failure> {
    let isa = args.machine.isa()?;
    if args.chunks.shard.is_none() {
        check(args)?;
    }
    let bake = Bake {
        scene: &args.scene,
        outputs: &args.output,
        json: args.json.as_ref(),
        chunks: &args.chunks,
        machine: &args.machine,
        parts,
        earth: None,
    };
    let mut files = bake.declare(&[], &[])?;
    let mut ground = bake.ground(isa, memory, &mut files)?;
    let scene = &ground.loaded.scene;
    let mut shapes = scene.shapes.iter();
    if shapes.any(|shape| !matches!(shape.geometry, Geometry::Mesh(_))) {
        let reason = "it has spheres or curves, which have no view factors";
        return Err(Failure::scene(&scene.name, reason));
    }
    let up = ground.up(args.up)?;
    let compass = Orientation::new(up, args.north).map_err(Failure::usage)?;
    // A room is seen from inside.
    ground.keep_sides(&compass);
    let scene = &ground.loaded.scene;
    let groups = groups::of(&ground, args.by, &compass)?;
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
    let job = ViewFactorJob::new(&surfaces, args.samples)?;
    let done = bake.compute(&job, &ground, &bvh)?;
    let rays = u64::from(args.samples) * surfaces.len() as u64;
    let document = Document {
        head: bake.head("antumbra.factors/1", isa, &scene.name),
        outputs: bake.output_names(),
        shard: bake.shard(),
        triangles: ground.mesh.indices.len(),
        surfaces: surfaces.len(),
        samples: args.samples,
        rays,
        load_seconds: ground.loaded.seconds,
        build_seconds: ground.build_seconds,
        trace_seconds: done.seconds,
    };
    json::write(&document, args.json.as_ref())?;
    let Some(factors) = done.found else {
        let outputs = document.outputs.join(", ");
        tell(format_args!("wrote {outputs}, for merge"));
        return Ok(());
    };
    for path in &args.output {
        write(path, &groups, &factors)?;
    }
    ground.tell("");
    tell(format_args!("{} surfaces", count(surfaces.len() as u64)));
    bake.tell_done("rays", rays, document.trace_seconds);
    chunks::forget(done.checkpoint.as_deref());
    Ok(())
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
