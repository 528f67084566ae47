//! `antumbra merge` of bakes: the command that made the parts is given again, with the parts instead of its work.

use antumbra_load::MemorySize;
use clap::Parser;

use super::chunks::PartFile;
use super::{ao, factors, horizon, sun, visible};
use crate::args::{Cli, Command, MergeArgs};
use crate::exit::Failure;

/// Joins parts, and writes what the command would have written without `--shard`. Outputs are named by the command line only:
/// a part may come from somebody else.
pub fn run(args: &MergeArgs, memory: MemorySize) -> Result<(), Failure> {
    if args.stderr_image.is_some() {
        let reason = "--stderr-image: these are no parts of a picture";
        return Err(Failure::Usage(reason.into()));
    }
    let parts = read(args)?;
    let Some(first) = parts.first() else {
        return Err(Failure::Usage("there are no parts".into()));
    };
    let name = first.path.display();
    let cli = Cli::try_parse_from(&first.part.identity.command)
        .map_err(|error| Failure::Data(format!("{name}: its command: {error}")))?;
    let (output, json) = (args.output.clone(), args.json.clone());
    if args.lines.is_some() && !matches!(cli.command, Some(Command::Visible(_))) {
        let reason = "--lines: only parts of visible have lines of sight";
        return Err(Failure::Usage(reason.into()));
    }
    match cli.command {
        Some(Command::Ao(mut bake)) => {
            let Ok([output]) = <[_; 1]>::try_from(output) else {
                return Err(Failure::Usage("--output: ao writes one file".into()));
            };
            (bake.chunks.shard, bake.output, bake.json) = (None, output, json);
            ao::run(&bake, memory, Some(&parts))
        }
        Some(Command::Sun(mut bake)) => {
            (bake.chunks.shard, bake.output, bake.json) = (None, output, json);
            sun::run(&bake, memory, Some(&parts))
        }
        Some(Command::Visible(mut bake)) => {
            (bake.chunks.shard, bake.output, bake.json) = (None, output, json);
            bake.lines.clone_from(&args.lines);
            visible::run(&bake, memory, Some(&parts))
        }
        Some(Command::Horizon(mut bake)) => {
            (bake.chunks.shard, bake.output, bake.json) = (None, output, json);
            horizon::run(&bake, memory, Some(&parts))
        }
        Some(Command::Factors(mut bake)) => {
            (bake.chunks.shard, bake.output, bake.json) = (None, output, json);
            factors::run(&bake, memory, Some(&parts))
        }
        _ => Err(Failure::Data(format!("{name}: it was made by no bake"))),
    }
}

/// Reads the parts: no share may be there twice.
fn read(args: &MergeArgs) -> Result<Vec<PartFile>, Failure> {
    let mut parts = Vec::<PartFile>::new();
    for path in &args.parts {
        let missing = || Failure::Usage(format!("there is no {}", path.display()));
        parts.push(PartFile::read(path)?.ok_or_else(missing)?);
    }
    for (index, file) in parts.iter().enumerate() {
        let shard = file.part.identity.shard;
        let mut before = parts[..index].iter();
        if let Some(other) = before.find(|other| other.part.identity.shard == shard) {
            return Err(Failure::Usage(format!(
                "{} and {} are both the shard {}/{}",
                other.path.display(),
                file.path.display(),
                shard[0],
                shard[1],
            )));
        }
    }
    Ok(parts)
}
