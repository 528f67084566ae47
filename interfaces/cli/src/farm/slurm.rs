//! An array job of Slurm and a dependent one that merges.
//!
//! A task that is preempted, loses its machine or comes near its time limit goes on from its checkpoint when Slurm
//! starts it again. The dependent job submits again what is missing, so many times.

use std::fs::{self, File};
use std::io::{ErrorKind, Read};
use std::path::Path;
use std::process::Command;

use antumbra_image::atomic_write;
use antumbra_lab::{make_directory, write_json};

use super::Plan;
use crate::args::SlurmArgs;
use crate::exit::{Failure, print, tell};
use crate::output;

/// Name of the file that says what a folder is for.
const PLAN: &str = "farm.json";
/// Bytes of a plan at most: some names and the flags of a command.
const LARGEST_PLAN: u64 = 1 << 20;

/// Runs the command.
pub fn run(args: &SlurmArgs) -> Result<(), Failure> {
    let plan = Plan::new(&args.farm)?;
    plan.check_files(None)?;
    let folder = Path::new(&plan.folder);
    check_folder(folder, &plan)?;
    let missing: Vec<u32> = (0..plan.tasks)
        .filter(|task| !folder.join(format!("{task}.part")).exists())
        .collect();
    let scripts = Scripts::new(&plan, args)?;
    if args.dry_run {
        return scripts.show(&plan, &missing);
    }
    make_directory(folder)?;
    output::check_file(Path::new(&plan.output))?;
    write_json(&plan, &folder.join(PLAN))?;
    for (name, text) in [("render.sh", &scripts.render), ("merge.sh", &scripts.merge)] {
        atomic_write(folder.join(name), |file| file.write_all(text.as_bytes()))?;
    }
    let mut merge = vec!["--parsable".to_owned()];
    if missing.is_empty() {
        tell(format_args!("all {} parts are there already", plan.tasks));
    } else {
        let array = format!("--array={}", list(&missing));
        let script = folder.join("render.sh");
        let job = submit(&["--parsable".to_owned(), array], &script)?;
        tell(format_args!(
            "submitted job {job}: {} of {} parts",
            missing.len(),
            plan.tasks
        ));
        merge.push(format!("--dependency=afterany:{job}"));
        print(&job)?;
    }
    let job = submit(&merge, &folder.join("merge.sh"))?;
    tell(format_args!(
        "submitted job {job}: merges them to {}; parts, scripts and logs are in {}",
        plan.output, plan.folder
    ));
    print(job)
}

/// Refuses the folder of another job.
fn check_folder(folder: &Path, plan: &Plan) -> Result<(), Failure> {
    let path = folder.join(PLAN);
    let is_file = match fs::metadata(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        found => found.is_ok_and(|found| found.is_file()),
    };
    if is_file {
        let mut bytes = Vec::new();
        let file =
            File::open(&path).and_then(|file| file.take(LARGEST_PLAN).read_to_end(&mut bytes));
        file.map_err(|error| Failure::Work(format!("cannot read {}: {error}", path.display())))?;
        let found: Option<Plan> = serde_json::from_slice(&bytes).ok();
        if found.as_ref() == Some(plan) {
            return Ok(());
        }
    }
    Err(Failure::Usage(format!(
        "{} is of another job; remove it or choose another --folder",
        folder.display()
    )))
}

/// Options of sbatch for a script with this log.
fn options(plan: &Plan, args: &SlurmArgs, log: &str) -> Result<Vec<String>, Failure> {
    let directory = std::env::current_dir().map_err(Failure::work)?;
    let directory = super::text(&directory)?;
    let name = Path::new(&plan.output).file_name().unwrap_or_default();
    let mut options = vec![
        format!("--job-name=antumbra-{}", name.to_string_lossy()),
        format!("--chdir={directory}"),
        format!("--output={}", log_pattern(&plan.folder, log)),
        "--open-mode=append".to_owned(),
        "--requeue".to_owned(),
    ];
    options.extend(args.sbatch.iter().cloned());
    Ok(options)
}

/// Command by which a script opens its log. Slurm expands nothing in a name with a backslash, so that scripts open such a
/// log themselves.
fn redirect(folder: &str, log: &str) -> Result<String, Failure> {
    if !folder.contains(ESCAPE) {
        return Ok(String::new());
    }
    let folder = quote(folder)?;
    Ok(format!("exec >>{folder}/{log} 2>&1\n"))
}

/// Scripts for Slurm.
struct Scripts {
    render: String,
    merge: String,
}

impl Scripts {
    fn new(plan: &Plan, args: &SlurmArgs) -> Result<Self, Failure> {
        let mut options = args.sbatch.iter();
        if let Some(option) = options.find(|option| option.contains(['\n', '\r'])) {
            let reason = format!("--sbatch {option:?}: an option of sbatch is one line");
            return Err(Failure::Usage(reason));
        }
        Ok(Self {
            render: Self::render(plan, args)?,
            merge: Self::merge(plan, args)?,
        })
    }

    /// Script that renders a part.
    fn render(plan: &Plan, args: &SlurmArgs) -> Result<String, Failure> {
        let folder = &plan.folder;
        let mut options = options(plan, args, "render-%a.log")?;
        // Before what was asked for, which may say otherwise.
        options.insert(0, format!("--signal=B:USR2@{}", args.grace));
        let task = "\"$SLURM_ARRAY_TASK_ID\"";
        // A part of a bake grows in its file, and has its name when it is complete.
        let [unfinished, done] = ["unfinished.part", "part"].map(|end| format!("{TASK}.{end}"));
        let (part, finish) = match plan.is_bake() {
            true => {
                let path = |name: &str| format!("{}/{name}", folder);
                let [from, to] = [path(&unfinished), path(&done)].map(|path| {
                    let pieces: Result<Vec<_>, _> = path.split(TASK).map(quote_piece).collect();
                    Ok::<_, Failure>(pieces?.join(task))
                });
                let finish = format!("if [ \"$code\" = 0 ]; then mv {} {}; fi\n", from?, to?);
                (unfinished, finish)
            }
            false => (done, String::new()),
        };
        let args = plan.task_args(&plan.scene, folder, (TASK, &part));
        let call = call(plan, &args)?.replace(TASK, task);
        let threads = if plan.flags.iter().any(|flag| flag.starts_with("--threads")) {
            ""
        } else {
            " ${SLURM_CPUS_PER_TASK:+--threads $SLURM_CPUS_PER_TASK}"
        };
        Ok(format!(
            r#"#!/usr/bin/env bash
# Computes one part of {output}.
{header}
{log}set -u
requeue=
# The time limit is near: USR2 comes from Slurm. TERM comes when the job is preempted or cancelled.
trap 'requeue=1; kill -TERM "$render" 2>/dev/null' USR2
trap 'kill -TERM "$render" 2>/dev/null' TERM
{call}{threads} &
render=$!
wait "$render"
code=$?
# A signal ends `wait` early.
while kill -0 "$render" 2>/dev/null; do
    wait "$render"
    code=$?
done
{finish}if [ -n "$requeue" ] && {{ [ "$code" = 75 ] || [ "$code" = 130 ]; }}; then
    scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID"
fi
exit "$code"
"#,
            output = plan.output,
            header = header(&options)?,
            log = redirect(folder, "render-$SLURM_ARRAY_TASK_ID.log")?,
        ))
    }

    /// Script that merges the parts.
    fn merge(plan: &Plan, args: &SlurmArgs) -> Result<String, Failure> {
        let Plan { folder, tasks, .. } = plan;
        let quoted = quote(folder)?;
        Ok(format!(
            r#"#!/usr/bin/env bash
# Merges the parts of {output}; those that are missing are computed first.
{header}
{log}set -u
missing=()
for task in $(seq 0 {last}); do
    [ -e {quoted}/"$task".part ] || missing+=("$task")
done
if [ ${{#missing[@]}} -gt 0 ]; then
    attempt=$((${{ANTUMBRA_ATTEMPT:-1}} + 1))
    array=$(IFS=,; echo "${{missing[*]}}")
    if [ "$attempt" -gt {attempts} ]; then
        echo "parts $array are still missing after {attempts} attempts" >&2
        exit 1
    fi
    echo "attempt $attempt: parts $array are missing"
    job=$(sbatch --parsable --array="$array" {quoted}/render.sh) || exit 1
    exec sbatch --parsable --dependency=afterany:"$job" --export=ALL,ANTUMBRA_ATTEMPT="$attempt" {quoted}/merge.sh
fi
exec {call}
"#,
            output = plan.output,
            header = header(&options(plan, args, "merge.log")?)?,
            log = redirect(folder, "merge.log")?,
            last = tasks - 1,
            attempts = args.attempts,
            call = call(
                plan,
                &plan.merge_args(
                    folder,
                    &plan.outputs(),
                    [plan.stderr_image.as_deref(), plan.lines.as_deref()],
                )
            )?,
        ))
    }

    /// Prints what would be submitted.
    fn show(&self, plan: &Plan, missing: &[u32]) -> Result<(), Failure> {
        let folder = quote(&plan.folder)?;
        print(format_args!("# {folder}/render.sh\n{}", self.render))?;
        print(format_args!("# {folder}/merge.sh\n{}", self.merge))?;
        if missing.is_empty() {
            return print(format_args!("sbatch --parsable {folder}/merge.sh"));
        }
        let array = list(missing);
        print(format_args!(
            "sbatch --parsable --array={array} {folder}/render.sh"
        ))?;
        print(format_args!(
            "sbatch --parsable --dependency=afterany:JOB {folder}/merge.sh"
        ))
    }
}

/// Character by which Slurm leaves a whole name unexpanded.
const ESCAPE: char = '\\';

/// Name of a log in the folder, as Slurm expands it: `%` of the folder stands for itself.
fn log_pattern(folder: &str, log: &str) -> String {
    if folder.contains(ESCAPE) {
        "/dev/null".to_owned()
    } else {
        format!("{}/{log}", folder.replace('%', "%%"))
    }
}

/// Stands for the number of the task until the script is complete; nothing in it is ever quoted.
/// No argument of a process can hold it.
const TASK: &str = "\0";

/// A line that calls this program.
fn call(plan: &Plan, args: &[String]) -> Result<String, Failure> {
    let mut line = quote(&plan.program)?;
    for arg in args {
        line.push(' ');
        // What is around the number of the task is quoted, the number is not.
        let pieces: Result<Vec<_>, _> = arg.split(TASK).map(quote_piece).collect();
        line.push_str(&pieces?.join(TASK));
    }
    Ok(line)
}

/// The options at the head of a script.
fn header(options: &[String]) -> Result<String, Failure> {
    let lines: Result<Vec<_>, _> = options
        .iter()
        .map(|option| {
            let plain = |c: char| c.is_ascii_graphic() && !"'\"\\#".contains(c);
            let quoted = if option.chars().all(plain) {
                option.clone()
            } else {
                quote(option)?
            };
            Ok(format!("#SBATCH {quoted}"))
        })
        .collect();
    lines.map(|lines| lines.join("\n"))
}

fn quote_piece(text: &str) -> Result<String, Failure> {
    if text.is_empty() {
        return Ok(String::new());
    }
    quote(text)
}

/// A text as a word of the shell.
fn quote(text: &str) -> Result<String, Failure> {
    match shlex::try_quote(text) {
        Ok(quoted) => Ok(quoted.into_owned()),
        Err(error) => Err(Failure::Usage(format!("{text:?}: {error}"))),
    }
}

/// Numbers as Slurm lists them.
fn list(numbers: &[u32]) -> String {
    let numbers: Vec<String> = numbers.iter().map(u32::to_string).collect();
    numbers.join(",")
}

/// Submits a script; returns the job's number.
fn submit(options: &[String], script: &Path) -> Result<String, Failure> {
    let output = Command::new("sbatch").args(options).arg(script).output();
    let output = output.map_err(|error| Failure::Work(format!("cannot run sbatch: {error}")))?;
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_owned();
    if !output.status.success() {
        let reason = text(&output.stderr);
        return Err(Failure::Work(format!("sbatch refused: {reason}")));
    }
    // `--parsable` prints the number, perhaps with `;cluster` after it.
    let answer = text(&output.stdout);
    Ok(answer.split(';').next().unwrap_or_default().to_owned())
}
