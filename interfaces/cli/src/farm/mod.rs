//! `antumbra farm`: a picture or a bake made by the machines of a scheduler that exists already.
//!
//! Every task computes a part of the work, and a last one merges them. The scheduler does the rest: it opens
//! connections, moves files, starts tasks again; this program writes its instructions.
//!
//! - `slurm`: a plan, with an array job for each of its levels and a job that merges, submitted
//! - `openjd`: a template of the Open Job Description, for AWS Deadline Cloud and others

mod openjd;
mod slurm;

use std::path::{Path, PathBuf};

use antumbra_load::MemorySize;

use crate::args::{Command, FarmArgs, FarmCommand, RenderArgs};
use crate::bake::tile::is_index;
use crate::exit::Failure;
use crate::output::Files;
use crate::plan;
use crate::render::check_image_names;

/// Runs the command.
pub fn run(command: &FarmCommand, memory: MemorySize) -> Result<(), Failure> {
    match command {
        FarmCommand::Slurm(args) => slurm::run(args, memory),
        FarmCommand::Openjd(args) => openjd::run(args),
    }
}

/// What machines share if nothing else is said: the command, and the number of tasks.
const RENDER: &str = "render";
const TASKS: u32 = 4;

impl FarmArgs {
    /// The command of all tasks, without its scene and its output. Parts have what errors are made of if they were rendered with an
    /// image of them, which nobody needs.
    fn command(&self, errors: &str) -> Vec<String> {
        let mut words = vec![self.job.as_deref().unwrap_or(RENDER).to_owned()];
        if words[0] == RENDER && self.stderr_image.is_some() {
            words.extend(["--stderr-image".to_owned(), errors.to_owned()]);
        }
        words.extend(self.flags.iter().cloned());
        words
    }

    /// Where parts, scripts and logs go.
    fn folder(&self) -> PathBuf {
        self.folder.clone().unwrap_or_else(|| {
            let mut name = self.output[0].clone().into_os_string();
            name.push(".farm");
            name.into()
        })
    }

    /// The program, as machines find it.
    fn program(&self) -> Result<String, Failure> {
        let own = || std::env::current_exe().map_err(Failure::work);
        text(&self.program.clone().map_or_else(own, Ok)?)
    }

    /// All files that the last task writes, with their flags.
    fn outputs(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        let outputs = self.output.iter().map(|path| ("--output", path));
        let errors = self.stderr_image.iter();
        let errors = errors.map(|path| ("--stderr-image", path));
        let lines = self.lines.iter().map(|path| ("--lines", path));
        let all = outputs.chain(errors).chain(lines);
        all.map(|(flag, path)| (flag, &**path))
    }

    /// The files that the job reads and writes, besides another one.
    fn files(&self, other: (&str, Option<&Path>)) -> Result<Files, Failure> {
        let mut files = Files::default();
        files.reads("the scene", &self.scene)?;
        let outputs = self.outputs().map(|(flag, path)| (flag, Some(path)));
        files.writes_some(outputs.chain([other]))?;
        Ok(files)
    }
}

/// Refuses arguments that the command does not know or that cannot make the outputs, before a hundred machines do. The scene goes
/// before the flags of `command`.
fn check(args: &FarmArgs, scene: &Path, command: &[String]) -> Result<(), Failure> {
    let mut line = plan::line(scene, command);
    let task = plan::parse(line.clone(), &["-o", "0.part", "--shard", "0/1"])?;
    let is_bake = matches!(task, Command::Bake(_)) && !is_index(scene);
    if args.lines.is_some() && !is_bake {
        return Err(Failure::usage("--lines: only visible has lines of sight"));
    }
    let errors = args.stderr_image.as_deref();
    match task {
        Command::Render(render) => {
            let [output] = &args.output[..] else {
                return Err(Failure::usage("--output: render writes one image"));
            };
            check_image_names(Some(output), errors)?;
            check_flags(&render)?;
            match errors.is_some() == render.stderr_image.is_some() {
                true => Ok(()),
                false => Err(Failure::usage(
                    "--stderr-image goes before --, and a plan has parts with errors if its command has this flag",
                )),
            }
        }
        Command::Bake(_) if errors.is_some() => Err(Failure::usage(
            "--stderr-image: only pictures have standard errors",
        )),
        // Tiles are joined as a plan knows.
        Command::Bake(_) if is_index(scene) => Ok(()),
        Command::Bake(bake) => {
            let (_, outputs, json, _) = bake.args().0.shared();
            if outputs.len() != 1 || json.is_some() {
                return Err(Failure::usage(
                    "--output goes before --, and --json with `merge`",
                ));
            }
            for (flag, path) in args.outputs() {
                line.extend([flag.to_owned(), text(path)?]);
            }
            match plan::parse(line, &[])? {
                Command::Bake(bake) => bake.args().0.check(),
                _ => Ok(()),
            }
        }
        _ => Err(Failure::usage("flags after -- belong to the command")),
    }
}

/// Refuses flags that are ours to set.
pub fn check_flags(render: &RenderArgs) -> Result<(), Failure> {
    let ours = [
        ("--resume", render.resume),
        ("--save-order", render.save_order.is_some()),
        ("--json", render.json.is_some()),
    ];
    match ours.iter().find(|(_, given)| *given) {
        Some((flag, _)) => Err(Failure::Usage(format!(
            "{flag} is set for every task by itself"
        ))),
        None => Ok(()),
    }
}

/// Whether a scene is made by the program.
pub fn is_built_in(scene: &Path) -> bool {
    scene
        .to_str()
        .is_some_and(|name| name.starts_with("builtin:"))
}

fn absolute(path: &Path) -> Result<String, Failure> {
    text(&std::path::absolute(path).map_err(Failure::work)?)
}

fn text(path: &Path) -> Result<String, Failure> {
    let text = path.to_str().filter(|text| !text.contains(['\n', '\0']));
    text.map(str::to_owned).ok_or_else(|| {
        let path = path.display();
        Failure::Usage(format!("{path}: such a name cannot stand in a script"))
    })
}
