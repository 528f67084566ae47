//! The program `antumbra`: renders scenes and compares the orders in which shadow rays visit a tree.
//!
//! It translates and decides nothing about light: what is asked on the command line becomes calls of the
//! library crates, what they return becomes text, JSON and files. Human text goes to the standard error
//! output, results to the standard output.
//!
//! - `args`: commands and flags, each defined once with its help
//! - `render`, `study`, `bench`, `info`, `image_tools`, `demo`: one command each
//! - `checkpoint`: what is kept of a rendering while it lasts;  `merge`: parts of a picture become one;
//!   `farm`: many machines
//! - `source`: from what a scene is called to a scene;  `mesh_scene`: meshes as scenes
//! - `report`, `table`, `json`, `output`: results as Markdown, tables, JSON and files
//! - `memory`: how much scenes may take
//! - `machine`, `progress`, `interrupt`, `exit`: where it runs, how far it is, how it ends
// Denied, not forbidden: `bench::embree` calls a C library.
#![deny(unsafe_code)]

mod args;
mod bench;
mod checkpoint;
mod demo;
mod exit;
mod farm;
mod image_tools;
mod info;
mod interrupt;
mod json;
mod machine;
mod memory;
mod merge;
mod mesh_scene;
mod output;
mod progress;
mod render;
mod report;
mod source;
mod study;
mod table;

use std::process::ExitCode;

use clap::Parser;

use args::{Cli, Command};
use exit::{Failure, say};

fn main() -> ExitCode {
    let cli = Cli::parse();
    match run(cli) {
        Ok(code) => code,
        Err(failure) => {
            say(format_args!("{failure}"));
            failure.code()
        }
    }
}

fn run(cli: Cli) -> Result<ExitCode, Failure> {
    interrupt::install()?;
    memory::allow(cli.max_memory);
    match cli.command {
        None => demo::run(),
        Some(Command::Render(args)) => render::run(&args),
        Some(Command::Merge(args)) => merge::run(&args),
        Some(Command::Farm(command)) => farm::run(&command),
        Some(Command::Study(args)) => study::run(&args),
        Some(Command::Bench(args)) => bench::run(&args),
        Some(Command::Info(args)) => info::run(&args),
        Some(Command::Image(command)) => return image_tools::run(&command),
    }?;
    Ok(ExitCode::SUCCESS)
}
