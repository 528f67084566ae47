//! A job template by the Open Job Description 2023-09.

use std::path::Path;

use antumbra_image::atomic_write;
use serde_json::{Value, json};

use super::{RENDER, TASKS, absolute, check, is_built_in, text};
use crate::args::{FarmArgs, OpenjdArgs};
use crate::bake::tile::is_index;
use crate::exit::{Failure, print, tell};
use crate::output::check_file;
use crate::plan::is_plan;

/// Seconds a task has for its checkpoint when it is cancelled.
const GRACE: u32 = 120;
/// Where parts go, the number of a task, and the end of the name of its image of errors.
const FOLDER: &str = "{{Param.Folder}}";
const TASK: &str = "{{Task.Param.Shard}}";
const ERRORS: &str = ".stderr.exr";

/// Runs the command.
pub fn run(args: &OpenjdArgs) -> Result<(), Failure> {
    let (farm, template) = (&args.farm, args.template.as_deref());
    let scene = &farm.scene;
    if is_index(scene) || is_plan(scene) {
        let reason =
            "a template has one step of shares; the page about farms has one for a level of a plan";
        return Err(Failure::name(scene, reason));
    }
    check(farm, scene, &farm.command(&format!("0{ERRORS}")))?;
    if !is_built_in(scene) && !scene.is_file() {
        return Err(Failure::name(scene, "there is no such file"));
    }
    farm.files(("--template", template))?;
    template.map_or(Ok(()), check_file)?;
    let folder = absolute(&farm.folder())?;
    for path in farm.output.iter().chain(&farm.stderr_image) {
        let path = absolute(path)?;
        if path.ends_with(ERRORS) && Path::new(&path).parent() == Some(Path::new(&folder)) {
            let reason = format!("{path} may be the name of a task's own image; choose another");
            return Err(Failure::Usage(reason));
        }
    }
    let file = template.unwrap_or(Path::new("job.json"));
    let file = std::path::absolute(file).map_err(Failure::work)?;
    let document = document(farm, file.parent().unwrap_or(Path::new("/")))?;
    let text = serde_json::to_string_pretty(&document).map_err(Failure::work)?;
    match template {
        None => print(text),
        Some(path) => {
            atomic_write(path, |file| writeln!(file, "{text}"))?;
            tell(format_args!("wrote {}", path.display()));
            Ok(())
        }
    }
}

/// A text as templates can have it. Paths and the program are values of parameters, in which braces mean nothing.
fn plain(text: String) -> Result<String, Failure> {
    let reason = format!("{text:?}: no template may have control characters");
    match text.contains(char::is_control) {
        false => Ok(text),
        true => Err(Failure::Usage(reason)),
    }
}

/// The template, to lie in a directory: paths inside of it are there by default, others must be given to whoever
/// runs the job.
fn document(farm: &FarmArgs, directory: &Path) -> Result<Value, Failure> {
    let is_bake = farm.job.as_ref().is_some_and(|job| job != RENDER);
    let tasks = farm.tasks.unwrap_or(TASKS);
    // The machines of a farm are others than this one.
    let program = farm.program.as_ref().map(|_| farm.program()).transpose()?;
    let program = plain(program.unwrap_or_else(|| "antumbra".to_owned()))?;
    let mut parameters = vec![json!({ "name": "Program", "type": "STRING", "default": program })];
    let is_built_in = is_built_in(&farm.scene);
    if is_built_in {
        let scene = plain(text(&farm.scene)?)?;
        parameters.push(json!({ "name": "Scene", "type": "STRING", "default": scene }));
    }
    // Defines a parameter, and returns what stands for it.
    let mut path = |name: &str, object: &str, flow: &str, default: &Path| {
        let mut path =
            json!({ "name": name, "type": "PATH", "objectType": object, "dataFlow": flow });
        let default = plain(absolute(default)?)?;
        if let Ok(inside) = Path::new(&default).strip_prefix(directory) {
            path["default"] = json!(inside);
        }
        parameters.push(path);
        Ok::<_, Failure>(format!("{{{{Param.{name}}}}}"))
    };
    if !is_built_in {
        path("Scene", "FILE", "IN", &farm.scene)?;
    }
    let mut merge = vec!["merge".to_owned()];
    merge.extend((0..tasks).map(|task| format!("{FOLDER}/{task}.part")));
    for (index, (flag, file)) in farm.outputs().enumerate() {
        let name = match (flag, index) {
            ("--lines", _) => "Lines".to_owned(),
            ("--stderr-image", _) => "StderrImage".to_owned(),
            (_, 0) => "Output".to_owned(),
            _ => format!("Output{}", index + 1),
        };
        merge.extend([flag.to_owned(), path(&name, "FILE", "OUT", file)?]);
    }
    path("Folder", "DIRECTORY", "INOUT", &farm.folder())?;
    let mut task = farm.command(&format!("{FOLDER}/{TASK}{ERRORS}"));
    for flag in &farm.flags {
        if plain(flag.clone())?.contains("{{") {
            let reason = format!("{flag}: `{{{{` means something else there");
            return Err(Failure::Usage(reason));
        }
    }
    task.insert(1, "{{Param.Scene}}".to_owned());
    if !is_bake {
        task.push("--resume".to_owned());
    }
    task.extend(["--shard".to_owned(), format!("{TASK}/{tasks}")]);
    task.extend(["-o".to_owned(), format!("{FOLDER}/{TASK}.part")]);
    let action = |args: Vec<String>| {
        json!({
            "actions": { "onRun": {
                "command": "{{Param.Program}}",
                "args": args,
                "cancelation": {
                    "mode": "NOTIFY_THEN_TERMINATE",
                    "notifyPeriodInSeconds": GRACE,
                },
            } }
        })
    };
    let (step, description) = match is_bake {
        true => ("Compute", "Computes shards of a job and merges them."),
        false => ("Render", "Renders shards of a picture and merges them."),
    };
    Ok(json!({
        "specificationVersion": "jobtemplate-2023-09",
        "name": "antumbra",
        "description": format!("{description} A task that is started again goes on from its checkpoint."),
        "parameterDefinitions": parameters,
        "steps": [
            {
                "name": step,
                "parameterSpace": { "taskParameterDefinitions": [
                    { "name": "Shard", "type": "INT", "range": format!("0-{}", tasks - 1) },
                ] },
                "script": action(task),
            },
            {
                "name": "Merge",
                "dependencies": [{ "dependsOn": step }],
                "script": action(merge),
            },
        ],
    }))
}
