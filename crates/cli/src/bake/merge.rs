//! `antumbra merge` of bakes: the command that made the parts is given again, with the parts instead of its work.

use std::path::PathBuf;

use antumbra_load::MemorySize;
use clap::Parser;

use super::chunks::Part;
use super::{ao, sun, visible};
use crate::args::{ChunkArgs, Cli, Command, MergeArgs};
use crate::exit::Failure;

/// Joins parts, and writes what the command would have written without `--shard`.
pub fn run(args: &MergeArgs, memory: MemorySize) -> Result<(), Failure> {
    if args.stderr_image.is_some() {
        return Err(Failure::Usage(
            "--stderr-image: these are no parts of a picture".into(),
        ));
    }
    let mut parts = Vec::new();
    for path in &args.parts {
        let part = Part::read(path)?;
        let missing = || Failure::Usage(format!("there is no {}", path.display()));
        parts.push(part.ok_or_else(missing)?);
    }
    for (index, part) in parts.iter().enumerate() {
        let before = &parts[..index];
        let same = before
            .iter()
            .position(|other| other.identity.shard == part.identity.shard);
        if let Some(other) = same {
            let [share, of] = part.identity.shard;
            return Err(Failure::Usage(format!(
                "{} and {} are both the shard {share}/{of}",
                args.parts[other].display(),
                args.parts[index].display()
            )));
        }
    }
    let Some(first) = parts.first() else {
        return Err(Failure::Usage("there are no parts".into()));
    };
    let cli = Cli::try_parse_from(&first.identity.command).map_err(|error| {
        Failure::Data(format!("{}: its command: {error}", args.parts[0].display()))
    })?;
    let whole = |chunks: &mut ChunkArgs| chunks.shard = None;
    let json = args.json.clone();
    match cli.command {
        Some(Command::Ao(mut bake)) => {
            let [output] = &args.output[..] else {
                return Err(Failure::Usage("--output: ao writes one file".into()));
            };
            whole(&mut bake.chunks);
            bake.output.clone_from(output);
            bake.json = json;
            ao::run(&bake, memory, Some(&parts))
        }
        Some(Command::Sun(mut bake)) => {
            whole(&mut bake.chunks);
            bake.output.clone_from(&args.output);
            bake.json = json;
            sun::run(&bake, memory, Some(&parts))
        }
        Some(Command::Visible(mut bake)) => {
            whole(&mut bake.chunks);
            bake.output.clone_from(&args.output);
            bake.json = json;
            visible::run(&bake, memory, Some(&parts))
        }
        _ => Err(Failure::Data(format!(
            "{}: it was made by no bake",
            args.parts
                .first()
                .map(PathBuf::as_path)
                .unwrap_or("".as_ref())
                .display()
        ))),
    }
}
