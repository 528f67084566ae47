//! `antumbra merge`: parts of a picture become the picture.

use std::path::PathBuf;

use antumbra_load::MemorySize;
use antumbra_render::{Identity, Snapshot, image_hash};
use serde::Serialize;

use crate::args::{MergeArgs, usual};
use crate::bake::{self, chunks::is_part};
use crate::exit::{Failure, tell};
use crate::json::Destination;
use crate::output::{Files, text};
use crate::render::{check_image_names, hash_text};
use crate::version::VERSION;
use crate::{archive, interrupt, json, plan};

/// Runs the command.
pub fn run(args: &MergeArgs, memory: MemorySize) -> Result<(), Failure> {
    if args.parts.iter().any(|path| plan::is_plan(path)) {
        return match plan::merge(args, memory)? {
            Some(parts) => run(
                &MergeArgs {
                    parts,
                    ..args.clone()
                },
                memory,
            ),
            None => Ok(()),
        };
    }
    if args.parts.iter().any(|path| is_part(path)) {
        return bake::merge::run(args, memory);
    }
    let [output] = &args.output[..] else {
        return Err(Failure::Usage("--output: a picture is one file".into()));
    };
    if args.lines.is_some() {
        return Err(Failure::usage("--lines: a picture has no lines of sight"));
    }
    check_image_names(Some(output), args.stderr_image.as_deref())?;
    let mut files = Files::default();
    files.writes_some([
        ("--output", Some(&**output)),
        ("--stderr-image", args.stderr_image.as_deref()),
        ("--json", args.json.as_ref().map(Destination::path)),
    ])?;
    files.reads_some(args.parts.iter().map(|part| ("the part", Some(&**part))))?;
    files.check()?;
    let (identity, whole) = joined(&args.parts)?;
    let image = whole.image()?;
    let errors = whole.standard_error()?;
    if args.stderr_image.is_some() && errors.is_none() {
        return Err(Failure::usage(
            "the parts were rendered without --stderr-image",
        ));
    }
    let _writing = interrupt::writing();
    image.write_for(output, &usual(identity.is_light()))?;
    if let (Some(path), Some(errors)) = (&args.stderr_image, &errors) {
        errors.write(path)?;
    }
    let [closest_rays, shadow_rays] = whole.rays();
    let document = Document {
        schema: "antumbra.merge/1",
        version: VERSION,
        scene: identity.scene(),
        parts: args.parts.iter().map(|path| text(path)).collect(),
        output: text(output),
        stderr_image: args.stderr_image.as_deref().map(text),
        resolution: [image.width(), image.height()],
        spp: identity.spp(),
        seed: identity.seed(),
        closest_rays,
        shadow_rays,
        render_seconds: whole.seconds(),
        dropped_samples: whole.dropped_samples(),
        image_hash: hash_text(image_hash(&image)),
    };
    json::write(&document, args.json.as_ref())?;
    tell(format_args!(
        "joined {} parts of {}, rendered in {:.2} s in all; wrote {}",
        args.parts.len(),
        document.scene,
        document.render_seconds,
        document.output
    ));
    if let Some(path) = &document.stderr_image {
        tell(format_args!("wrote {path}"));
    }
    Ok(())
}

/// What the parts have in common, and all of their samples.
fn joined(paths: &[PathBuf]) -> Result<(Identity, Snapshot), Failure> {
    let mut parts = Vec::with_capacity(paths.len());
    for path in paths {
        let Some(bytes) = archive::read(path)? else {
            return Err(Failure::Usage(format!("there is no {}", path.display())));
        };
        let (identity, snapshot) =
            Snapshot::from_bytes(&bytes).map_err(|error| Failure::refused(path, &error))?;
        parts.push((text(path), identity, snapshot));
        interrupt::check()?;
    }
    let Some((_, identity, _)) = parts.first() else {
        return Err(Failure::Usage("there are no parts".into()));
    };
    let identity = identity.clone();
    let whole = Snapshot::join(parts).map_err(|error| Failure::Usage(error.to_string()))?;
    Ok((identity, whole))
}

/// The JSON document.
#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    version: &'static str,
    scene: &'a str,
    parts: Vec<String>,
    output: String,
    stderr_image: Option<String>,
    resolution: [usize; 2],
    spp: u32,
    seed: u64,
    closest_rays: u64,
    shadow_rays: u64,
    /// Wall-clock, added up over the parts.
    render_seconds: f64,
    dropped_samples: u64,
    image_hash: String,
}
