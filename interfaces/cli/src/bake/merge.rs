//! `antumbra merge` of bakes: the command that made the parts is given again, with the parts instead of its work.

use antumbra_load::MemorySize;
use clap::Parser;

use super::chunks::PartFile;
use crate::args::{BakeCommand, Cli, Command, MergeArgs, of_bake};
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
    let Some(Command::Bake(mut bake)) = cli.command else {
        return Err(Failure::Data(format!("{name}: it was made by no bake")));
    };
    match &mut bake {
        BakeCommand::Visible(visible) => visible.lines.clone_from(&args.lines),
        _ if args.lines.is_some() => {
            let reason = "--lines: only parts of visible have lines of sight";
            return Err(Failure::Usage(reason.into()));
        }
        BakeCommand::Ao(_) if args.output.len() != 1 => {
            return Err(Failure::Usage("--output: ao writes one file".into()));
        }
        _ => {}
    }
    of_bake!(&mut bake, bake => {
        bake.chunks.shard = None;
        bake.output.clone_from(&args.output);
        bake.json.clone_from(&args.json);
    });
    super::run(&bake, memory, Some(&parts))
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
