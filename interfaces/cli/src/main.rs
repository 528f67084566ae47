//! The program `antumbra`: renders scenes, and compares the orders in which shadow rays visit a tree.
//!
//! The program parses, prints and exits. The command line becomes calls of the library crates; what
//! they return becomes text, JSON and files. Text for people goes to the standard error output, results to the
//! standard output.
//!
//! - `args/`: commands and flags, each defined once with its help
//! - `render/`, `view`, `merge`, `farm/`, `plan/`, `study`, `bench`, `bake/`, `info`, `image_tools`, `list`, `man`, `demo`: one command each
//! - `scenes`: scenes that the command line names
//! - `table`, `json`, `output`: results as text, JSON and files;  `archive`: files of this program's own kinds
//! - `version`, `progress/`, `interrupt`, `exit`: what this program is, how far it is, how it ends
#![forbid(unsafe_code)]

mod archive;
mod args;
mod bake;
mod bench;
mod demo;
mod exit;
mod farm;
mod image_tools;
mod info;
mod input;
mod interrupt;
mod json;
mod list;
mod man;
mod merge;
mod output;
mod plan;
mod progress;
mod render;
mod scenes;
mod study;
mod table;
mod version;
mod view;

use std::process::ExitCode;

use antumbra_guard::Limited;
use antumbra_load::MemorySize;

use args::{Cli, Command};
use exit::{Failure, Loudness, say};

/// Ends the program with a message where its memory would pass `--max-memory`, or the machine's.
#[global_allocator]
static ALLOCATOR: Limited = Limited;

fn main() -> ExitCode {
    // First of all, because the signals that it takes would end the program until then.
    let outcome = interrupt::install().and_then(|()| run(args::parse()));
    match outcome {
        Ok(code) => code,
        Err(failure) => {
            say(format_args!("{failure}"));
            failure.code()
        }
    }
}

fn run(cli: Cli) -> Result<ExitCode, Failure> {
    exit::set_loudness(match (cli.quiet, cli.verbose) {
        (true, _) => Loudness::Quiet,
        (_, true) => Loudness::Verbose,
        _ => Loudness::Usual,
    });
    let memory = cli.max_memory.unwrap_or_else(MemorySize::of_machine);
    antumbra_guard::set_limit(memory.bytes());
    scenes::set_tolerance(cli.strict, cli.skip_unsupported);
    match cli.command {
        None => demo::run(memory),
        Some(Command::Render(args)) => render::run(&args, memory),
        Some(Command::View(args)) => view::run(&args, memory),
        Some(Command::Merge(args)) => merge::run(&args, memory),
        Some(Command::Farm(command)) => farm::run(&command, memory),
        Some(Command::Index(args)) => plan::survey(&args, memory),
        Some(Command::Plan(args)) => plan::make(&args, memory),
        Some(Command::Run(args)) => plan::run(&args, memory),
        Some(Command::Check(args)) => plan::check(&args),
        Some(Command::Study(args)) => study::run(&args, memory),
        Some(Command::Bench(args)) => bench::run(&args, memory),
        Some(Command::Bake(command)) => bake::run(command.args().0, memory, None),
        Some(Command::Info(args)) => info::run(&args, memory),
        Some(Command::Image(command)) => return image_tools::run(&command),
        Some(Command::List(args)) => list::run(&args),
        Some(Command::Completions(args)) => man::completions(&args),
        Some(Command::Man(args)) => man::run(&args),
    }?;
    Ok(ExitCode::SUCCESS)
}
