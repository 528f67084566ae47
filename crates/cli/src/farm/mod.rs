//! `antumbra farm`: a picture made by the machines of a scheduler that exists already.
//!
//! Every task renders one shard of the picture, and a last one merges them. The scheduler does the rest: it opens
//! connections, moves files, starts tasks again; this program writes what it is to be told.
//!
//! - `slurm`: an array job and a dependent one, submitted
//! - `openjd`: a template of the Open Job Description, for AWS Deadline Cloud and others

mod openjd;
mod slurm;

use std::path::{Path, PathBuf};

use clap::Parser;
use serde::{Deserialize, Serialize};

use crate::args::{Cli, Command, FarmArgs, FarmCommand};
use crate::exit::Failure;
use crate::output::{self, Files};
use crate::render::check_image_names;

/// Runs the command.
pub fn run(command: &FarmCommand) -> Result<(), Failure> {
    match command {
        FarmCommand::Slurm(args) => slurm::run(args),
        FarmCommand::Openjd(args) => openjd::run(args),
    }
}

/// A job for any scheduler. All paths are absolute, and all is text that can stand in scripts.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Plan {
    program: String,
    scene: String,
    output: String,
    stderr_image: Option<String>,
    /// Where parts, scripts and logs go.
    folder: String,
    tasks: u32,
    /// Further flags of `render`.
    flags: Vec<String>,
}

impl Plan {
    fn new(args: &FarmArgs) -> Result<Self, Failure> {
        check_image_names(Some(&args.output), args.stderr_image.as_deref())?;
        check_flags(args)?;
        let program = match &args.program {
            Some(path) => path.clone(),
            None => std::env::current_exe()
                .map_err(|error| Failure::Work(format!("cannot find this program: {error}")))?,
        };
        let folder = match &args.folder {
            Some(path) => path.clone(),
            None => {
                let mut name = args.output.clone().into_os_string();
                name.push(".farm");
                name.into()
            }
        };
        let scene = if is_built_in(&args.scene) {
            text(&args.scene)?
        } else if args.scene.is_file() {
            absolute(&args.scene)?
        } else {
            let scene = args.scene.display();
            return Err(Failure::Usage(format!("there is no file {scene}")));
        };
        Ok(Self {
            program: text(&program)?,
            scene,
            output: absolute(&args.output)?,
            stderr_image: args.stderr_image.as_deref().map(absolute).transpose()?,
            folder: absolute(&folder)?,
            tasks: args.tasks,
            flags: args.flags.clone(),
        })
    }

    /// Refuses outputs that would destroy the scene or one another.
    fn check_files(&self, template: Option<&Path>) -> Result<(), Failure> {
        let mut files = Files::default();
        files.reads("the scene", Path::new(&self.scene))?;
        files.writes("--output", Path::new(&self.output))?;
        if let Some(path) = &self.stderr_image {
            files.writes("--stderr-image", Path::new(path))?;
        }
        if let Some(path) = template {
            files.writes("--template", path)?;
            output::check_file(path)?;
        }
        let images = [Some(&self.output), self.stderr_image.as_ref()];
        for path in images.into_iter().flatten().map(Path::new) {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let task = name.strip_suffix(".stderr.exr");
            if path.parent() == Some(Path::new(&self.folder))
                && task.is_some_and(|task| task.parse::<u32>().is_ok())
            {
                return Err(Failure::Usage(format!(
                    "{} is the name of a task's own image; choose another",
                    path.display()
                )));
            }
        }
        Ok(())
    }

    /// Arguments of `render` for the shard that `task` stands for.
    fn render_args(&self, scene: &str, folder: &str, task: &str) -> Vec<String> {
        let mut args: Vec<String> = ["render", scene, "--resume"].map(Into::into).into();
        args.extend(["--shard".into(), format!("{task}/{}", self.tasks)]);
        args.extend(["-o".into(), format!("{folder}/{task}.part")]);
        if self.stderr_image.is_some() {
            args.extend([
                "--stderr-image".into(),
                format!("{folder}/{task}.stderr.exr"),
            ]);
        }
        args.extend(self.flags.iter().cloned());
        args
    }

    /// Arguments of `merge`.
    fn merge_args(&self, folder: &str, output: &str, errors: Option<&str>) -> Vec<String> {
        let mut args = vec!["merge".to_owned()];
        args.extend((0..self.tasks).map(|task| format!("{folder}/{task}.part")));
        args.extend(["-o".into(), output.into()]);
        if let Some(path) = errors {
            args.extend(["--stderr-image".into(), path.into()]);
        }
        args
    }
}

/// Refuses flags that `render` does not know, before a hundred machines do, and those that are ours to set.
fn check_flags(args: &FarmArgs) -> Result<(), Failure> {
    let line = ["antumbra", "render", "scene.pbrt"].map(Into::into);
    let line = line.into_iter().chain(args.flags.iter().cloned());
    let cli = Cli::try_parse_from(line).map_err(|error| Failure::Usage(error.to_string()))?;
    let Some(Command::Render(render)) = cli.command else {
        return Err(Failure::Usage("flags after -- are those of render".into()));
    };
    let ours = [
        ("--output", render.output.is_some()),
        ("--shard", render.shard.is_some()),
        ("--resume", render.resume),
        ("--stderr-image, before --,", render.stderr_image.is_some()),
        ("--save-order", render.save_order.is_some()),
        ("--json", render.json.is_some()),
    ];
    match ours.iter().find(|(_, given)| *given) {
        Some((flag, _)) => Err(Failure::Usage(format!(
            "{flag} is set for every task by farm itself"
        ))),
        None => Ok(()),
    }
}

fn is_built_in(scene: &Path) -> bool {
    scene
        .to_str()
        .is_some_and(|name| name.starts_with("builtin:"))
}

fn absolute(path: &Path) -> Result<String, Failure> {
    let absolute: PathBuf = std::path::absolute(path).map_err(Failure::work)?;
    text(&absolute)
}

fn text(path: &Path) -> Result<String, Failure> {
    let text = path.to_str().filter(|text| !text.contains(['\n', '\0']));
    text.map(str::to_owned).ok_or_else(|| {
        let path = path.display();
        Failure::Usage(format!("{path}: such a name cannot stand in a script"))
    })
}
