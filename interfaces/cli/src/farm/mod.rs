//! `antumbra farm`: a picture or a bake made by the machines of a scheduler that exists already.
//!
//! Every task computes one shard, and a last one merges them. The scheduler does the rest: it opens
//! connections, moves files, starts tasks again; this program writes its instructions.
//!
//! - `slurm`: an array job and a dependent one, submitted
//! - `openjd`: a template of the Open Job Description, for AWS Deadline Cloud and others

mod openjd;
mod slurm;

use std::ffi::OsString;
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

/// A job for any scheduler. All paths are absolute, and all is text that scripts can contain.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Plan {
    program: String,
    /// Name of the command of every task.
    #[serde(default = "render")]
    command: String,
    scene: String,
    output: String,
    /// Further outputs of a bake.
    #[serde(default)]
    more_outputs: Vec<String>,
    stderr_image: Option<String>,
    /// Lines of sight.
    #[serde(default)]
    lines: Option<String>,
    /// Where parts, scripts and logs go.
    folder: String,
    tasks: u32,
    /// Further arguments of the command.
    flags: Vec<String>,
}

/// The command of plans that name none.
fn render() -> String {
    "render".to_owned()
}

impl Plan {
    fn new(args: &FarmArgs) -> Result<Self, Failure> {
        let Some((output, more)) = args.output.split_first() else {
            return Err(Failure::Usage("--output is missing".into()));
        };
        match &*args.job {
            "render" => {
                if args.lines.is_some() {
                    return Err(no_lines());
                }
                check_image_names(Some(output), args.stderr_image.as_deref())?;
                if !more.is_empty() {
                    return Err(Failure::usage("--output: render writes one image"));
                }
                check_flags(&args.flags)?;
            }
            _ => check_bake(args)?,
        }
        let program = match &args.program {
            Some(path) => path.clone(),
            None => std::env::current_exe()
                .map_err(|error| Failure::Work(format!("cannot find this program: {error}")))?,
        };
        let folder = match &args.folder {
            Some(path) => path.clone(),
            None => {
                let mut name = output.clone().into_os_string();
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
            command: args.job.clone(),
            scene,
            output: absolute(output)?,
            more_outputs: more
                .iter()
                .map(|path| absolute(path))
                .collect::<Result<_, _>>()?,
            stderr_image: args.stderr_image.as_deref().map(absolute).transpose()?,
            lines: args.lines.as_deref().map(absolute).transpose()?,
            folder: absolute(&folder)?,
            tasks: args.tasks,
            flags: args.flags.clone(),
        })
    }

    /// Refuses outputs that would destroy the scene or one another.
    fn check_files(&self, template: Option<&Path>) -> Result<(), Failure> {
        let mut files = Files::default();
        files.reads("the scene", Path::new(&self.scene))?;
        let outputs = self.outputs();
        let outputs = outputs
            .iter()
            .map(|path| ("--output", Some(Path::new(path))));
        files.writes_some(outputs.chain([
            (
                "--stderr-image",
                self.stderr_image.as_deref().map(Path::new),
            ),
            ("--lines", self.lines.as_deref().map(Path::new)),
            ("--template", template),
        ]))?;
        template.map_or(Ok(()), output::check_file)?;
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

    /// All outputs.
    fn outputs(&self) -> Vec<String> {
        let first = std::iter::once(&self.output);
        first.chain(&self.more_outputs).cloned().collect()
    }

    /// Whether tasks bake, and keep unfinished work in the part itself, instead of rendering a picture.
    fn is_bake(&self) -> bool {
        self.command != render()
    }

    /// Arguments of the command for the shard that `task` stands for, with the part to write.
    fn task_args(&self, scene: &str, folder: &str, (task, part): (&str, &str)) -> Vec<String> {
        let mut args: Vec<String> = vec![self.command.clone(), scene.into()];
        if self.is_bake() {
            args.extend(self.flags.iter().cloned());
            args.extend(["--shard".into(), format!("{task}/{}", self.tasks)]);
            args.extend(["-o".into(), format!("{folder}/{part}")]);
            return args;
        }
        args.push("--resume".into());
        args.extend(["--shard".into(), format!("{task}/{}", self.tasks)]);
        args.extend(["-o".into(), format!("{folder}/{part}")]);
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
    fn merge_args(
        &self,
        folder: &str,
        outputs: &[String],
        [errors, lines]: [Option<&str>; 2],
    ) -> Vec<String> {
        let mut args = vec!["merge".to_owned()];
        args.extend((0..self.tasks).map(|task| format!("{folder}/{task}.part")));
        for output in outputs {
            args.extend(["-o".into(), output.clone()]);
        }
        if let Some(path) = errors {
            args.extend(["--stderr-image".into(), path.into()]);
        }
        if let Some(path) = lines {
            args.extend(["--lines".into(), path.into()]);
        }
        args
    }
}

/// Refuses arguments that the command of a bake does not know or that cannot make the outputs, before a hundred machines do.
fn check_bake(args: &FarmArgs) -> Result<(), Failure> {
    if args.stderr_image.is_some() {
        return Err(Failure::usage(
            "--stderr-image: only pictures have standard errors",
        ));
    }
    let parse = |more: &[OsString]| {
        let line = ["antumbra", &args.job].map(OsString::from);
        let line = line.into_iter().chain([args.scene.clone().into()]);
        let line = line.chain(args.flags.iter().map(Into::into));
        let cli = Cli::try_parse_from(line.chain(more.iter().cloned()));
        cli.map_err(|error| Failure::Usage(error.to_string()))
    };
    // As the tasks are, with flags that are ours to set.
    let task = ["-o", "0.part", "--shard", "0/1"].map(OsString::from);
    let Some(Command::Bake(mut bake)) = parse(&task)?.command else {
        return Err(Failure::usage("flags after -- belong to the command"));
    };
    if args.lines.is_some() && bake.args_mut().lines().is_none() {
        return Err(no_lines());
    }
    let (_, outputs, json, _) = bake.args().0.shared();
    if outputs.len() != 1 || json.is_some() {
        return Err(Failure::usage(
            "--output goes before --, and --json with `merge`",
        ));
    }
    let mut whole = Vec::new();
    for path in &args.output {
        whole.extend(["-o".into(), path.clone().into_os_string()]);
    }
    if let Some(path) = &args.lines {
        whole.extend(["--lines".into(), path.clone().into_os_string()]);
    }
    match parse(&whole)?.command {
        Some(Command::Bake(bake)) => bake.args().0.check(),
        _ => Ok(()),
    }
}

fn no_lines() -> Failure {
    Failure::Usage("--lines: only visible has lines of sight".into())
}

/// Refuses flags that `render` does not know, before a hundred machines do, and those that are ours to set.
pub fn check_flags(flags: &[String]) -> Result<(), Failure> {
    let line = ["antumbra", "render", "scene.pbrt"].map(Into::into);
    let line = line.into_iter().chain(flags.iter().cloned());
    let cli = Cli::try_parse_from(line).map_err(|error| Failure::Usage(error.to_string()))?;
    let Some(Command::Render(render)) = cli.command else {
        return Err(Failure::Usage("flags after -- belong to render".into()));
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
