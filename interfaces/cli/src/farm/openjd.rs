//! A job template by the Open Job Description 2023-09.

use std::path::Path;

use antumbra_image::atomic_write;
use serde_json::{Value, json};

use super::{Plan, is_built_in};
use crate::args::OpenjdArgs;
use crate::exit::{Failure, print, tell};

/// Seconds a task has for its checkpoint when it is cancelled.
const GRACE: u32 = 120;

/// Runs the command.
pub fn run(args: &OpenjdArgs) -> Result<(), Failure> {
    let mut plan = Plan::new(&args.farm)?;
    plan.check_files(args.template.as_deref())?;
    if args.farm.program.is_none() {
        // The machines of a farm are others than this one.
        plan.program = "antumbra".into();
    }
    check_texts(&plan)?;
    let file = args.template.as_deref().unwrap_or(Path::new("job.json"));
    let file = std::path::absolute(file).map_err(Failure::work)?;
    let directory = file.parent().unwrap_or(Path::new("/"));
    let template = template(&plan, is_built_in(&args.farm.scene), directory);
    let text = serde_json::to_string_pretty(&template).map_err(Failure::work)?;
    match &args.template {
        None => print(text),
        Some(path) => {
            atomic_write(path, |file| writeln!(file, "{text}"))?;
            tell(format_args!("wrote {}", path.display()));
            Ok(())
        }
    }
}

/// Refuses texts that mean something else in a template. Paths and the program are values of parameters, in which
/// braces mean nothing.
fn check_texts(plan: &Plan) -> Result<(), Failure> {
    let Plan {
        program,
        command: _,
        scene,
        output,
        more_outputs,
        stderr_image,
        lines,
        folder,
        tasks: _,
        flags,
    } = plan;
    if let Some(text) = flags.iter().find(|text| text.contains("{{")) {
        return Err(Failure::Usage(format!(
            "{text}: `{{{{` means something else there"
        )));
    }
    let paths = [program, scene, output, folder].into_iter();
    let mut texts = paths
        .chain(more_outputs)
        .chain(stderr_image)
        .chain(lines)
        .chain(flags);
    match texts.find(|text| text.contains(char::is_control)) {
        Some(text) => Err(Failure::Usage(format!(
            "{text:?}: control characters cannot stand in a template"
        ))),
        None => Ok(()),
    }
}

/// Definitions of the parameters, and the references to the outputs.
fn parameters(plan: &Plan, built_in: bool, directory: &Path) -> (Vec<Value>, Vec<String>) {
    let path = |name: &str, object: &str, flow: &str, default: &str| {
        let mut path = json!({
            "name": name, "type": "PATH", "objectType": object, "dataFlow": flow,
        });
        if let Ok(inside) = Path::new(default).strip_prefix(directory) {
            path["default"] = json!(inside);
        }
        path
    };
    let output = |name: &str, file: &str| path(name, "FILE", "OUT", file);
    let scene = if built_in {
        json!({ "name": "Scene", "type": "STRING", "default": plan.scene })
    } else {
        path("Scene", "FILE", "IN", &plan.scene)
    };
    let mut parameters = vec![
        json!({ "name": "Program", "type": "STRING", "default": plan.program }),
        scene,
        output("Output", &plan.output),
        path("Folder", "DIRECTORY", "INOUT", &plan.folder),
    ];
    let more = [("StderrImage", &plan.stderr_image), ("Lines", &plan.lines)];
    let more = more
        .into_iter()
        .filter_map(|(name, file)| Some(output(name, file.as_ref()?)));
    parameters.extend(more);
    let mut outputs = vec!["{{Param.Output}}".to_owned()];
    for (index, file) in plan.more_outputs.iter().enumerate() {
        let name = format!("Output{}", index + 2);
        parameters.push(output(&name, file));
        outputs.push(format!("{{{{Param.{name}}}}}"));
    }
    (parameters, outputs)
}

/// The template, to lie in a directory: paths inside of it are there by default, others must be given to whoever
/// runs the job.
fn template(plan: &Plan, built_in: bool, directory: &Path) -> Value {
    let (folder, task) = ("{{Param.Folder}}", "{{Task.Param.Shard}}");
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
    let (parameters, outputs) = parameters(plan, built_in, directory);
    let errors = plan.stderr_image.as_ref().map(|_| "{{Param.StderrImage}}");
    let lines = plan.lines.as_ref().map(|_| "{{Param.Lines}}");
    let (step, description) = match plan.is_bake() {
        true => ("Compute", "Computes shards of a job and merges them."),
        false => ("Render", "Renders shards of a picture and merges them."),
    };
    json!({
        "specificationVersion": "jobtemplate-2023-09",
        "name": "antumbra",
        "description": format!("{description} A task that is started again goes on from its checkpoint."),
        "parameterDefinitions": parameters,
        "steps": [
            {
                "name": step,
                "parameterSpace": { "taskParameterDefinitions": [
                    { "name": "Shard", "type": "INT", "range": format!("0-{}", plan.tasks - 1) },
                ] },
                "script": action(plan.task_args("{{Param.Scene}}", folder, (task, &format!("{task}.part")))),
            },
            {
                "name": "Merge",
                "dependencies": [{ "dependsOn": step }],
                "script": action(plan.merge_args(folder, &outputs, [errors, lines])),
            },
        ],
    })
}
