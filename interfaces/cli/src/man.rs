//! `antumbra man` and `antumbra completions`: texts made from the definition of the command line.

use std::io;

use antumbra_image::atomic_write;
use antumbra_lab::make_directory;
use clap::{Command, CommandFactory};
use clap_mangen::Man;

use crate::args::{Cli, CompletionsArgs, ManArgs};
use crate::exit::{Failure, print, tell};

/// Runs `man`.
pub fn run(args: &ManArgs) -> Result<(), Failure> {
    // Pages are the same on every machine: without the instruction set that the long version tells.
    let mut cli = Cli::command().long_version(None::<&str>);
    let Some(directory) = &args.out else {
        return print(page(cli)?.trim_end());
    };
    make_directory(directory)?;
    cli.build();
    let mut written = 0;
    let mut pending = vec![cli];
    while let Some(command) = pending.pop() {
        if command.get_name() == "help" {
            continue;
        }
        pending.extend(command.get_subcommands().cloned());
        let name = command.get_display_name().unwrap_or(command.get_name());
        let path = directory.join(format!("{name}.1"));
        let text = page(command)?;
        atomic_write(path, |file| file.write_all(text.as_bytes()))?;
        written += 1;
    }
    tell(format_args!(
        "wrote {written} pages to {}",
        directory.display()
    ));
    Ok(())
}

/// The page of one command.
fn page(command: Command) -> Result<String, Failure> {
    let mut text = Vec::new();
    let rendered: io::Result<()> = Man::new(command).render(&mut text);
    rendered.map_err(Failure::work)?;
    String::from_utf8(text).map_err(Failure::work)
}

/// Runs `completions`.
pub fn completions(args: &CompletionsArgs) -> Result<(), Failure> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "antumbra", &mut text);
    print(String::from_utf8_lossy(&text).trim_end())
}
