//! `antumbra merge` of bakes: the command that made the parts is given again, with the parts instead of its work.

use antumbra_load::MemorySize;
use clap::Parser;

use super::chunks::PartFile;
use crate::args::{Cli, Command, MergeArgs};
use crate::exit::Failure;

/// Joins parts, and writes what the command would have written without `--shard`. Outputs are named by the command line only:
/// a part may come from somebody else.
pub fn run(args: &MergeArgs, memory: MemorySize) -> Result<(), Failure> {
    if args.stderr_image.is_some() {
        return Err(Failure::usage(
            "--stderr-image: these are no parts of a picture",
        ));
    }
    let parts = read(args)?;
    let Some(first) = parts.first() else {
        return Err(Failure::Usage("there are no parts".into()));
    };
    let name = first.path.display();
    let cli = Cli::try_parse_from(&first.part.identity.command)
        .map_err(|error| Failure::Data(format!("{name}: its command: {error}")))?;
    let Some(Command::Bake(mut bake)) = cli.command else {
        return Err(Failure::Data(format!("{name}: it was made by no bake")));
    };
    match bake.args_mut().lines() {
        Some(lines) => lines.clone_from(&args.lines),
        None if args.lines.is_some() => {
            return Err(Failure::usage(
                "--lines: only parts of visible have lines of sight",
            ));
        }
        None => {}
    }
    let (baking, name) = bake.args();
    if baking.is_picture() && args.output.len() != 1 {
        return Err(Failure::usage(format_args!(
            "--output: {name} writes one file"
        )));
    }
    bake.args_mut().want(&args.output, args.json.as_ref());
    super::run(bake.args().0, memory, Some(&parts))
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
