//! A plan by Slurm: an array job for each level, and a dependent job that merges.
//!
//! A task that is preempted, loses its machine or comes near its time limit goes on from its checkpoint when Slurm
//! starts it again. The dependent job submits again what is missing, so many times.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use antumbra_image::atomic_write;
use antumbra_lab::make_directory;
use antumbra_load::MemorySize;

use super::{TASKS, absolute, check, text};
use crate::args::{FarmArgs, PlanArgs, SlurmArgs};
use crate::bake::tile::is_index;
use crate::exit::{Failure, print, tell};
use crate::plan::{self, Plan};

/// Name of the plan in the folder.
const PLAN: &str = "plan.jsonl";
/// Cells on a side of tiles.
const TILE: u32 = 2048;
/// Most jobs of a level, which share its tasks: Slurm has no longer arrays unless it is set up for them.
const MOST_JOBS: usize = 1000;
/// Character by which Slurm leaves a whole name unexpanded.
const ESCAPE: char = '\\';

/// Runs the command.
pub fn run(args: &SlurmArgs, memory: MemorySize) -> Result<(), Failure> {
    let farm = &args.farm;
    let is_long = |option: &&String| option.contains(['\n', '\r']);
    if let Some(option) = args.sbatch.iter().find(is_long) {
        return Err(Failure::usage(format_args!(
            "--sbatch {option:?}: an option of sbatch is one line"
        )));
    }
    let folder = farm.folder();
    let own = folder.join(PLAN);
    let is_given = plan::is_plan(&farm.scene);
    let (path, plan) = match is_given {
        true => (&farm.scene, given(farm)?),
        false => (&own, made(farm, &own, memory)?),
    };
    plan.check_outputs(&farm.output)?;
    let files = farm.files(("the plan", (!is_given).then_some(&*own)))?;
    let open = plan.open()?;
    let scripts = scripts(args, &folder, path)?;
    if args.dry_run {
        for (name, script) in &scripts {
            print(format_args!("# {name}\n{script}"))?;
        }
    } else {
        make_directory(&folder)?;
        files.check()?;
        if !is_given && !own.exists() {
            plan.write()?;
        }
        for (name, script) in &scripts {
            atomic_write(folder.join(name), |file| file.write_all(script.as_bytes()))?;
        }
    }
    let (mut first, mut options) = (0, Vec::new());
    for &count in &plan.head.levels {
        let (end, jobs) = (count.saturating_add(first), count.min(MOST_JOBS));
        let open = open.iter().filter(|task| (first..end).contains(task));
        let array: BTreeSet<usize> = open.clone().map(|task| (task - first) % jobs).collect();
        if !array.is_empty() {
            let array: Vec<String> = array.iter().map(usize::to_string).collect();
            options.push(format!("--array={}", array.join(",")));
            let words = format!("{} of {count} tasks", open.count());
            let share = format!("{first} {jobs} {}", end - 1);
            let job = submit(args, &options, (scripts[0].0, &share), &words)?;
            options = vec![format!("--dependency=afterany:{job}")];
        }
        first = end;
    }
    let words = format!("merges {first} tasks; scripts and logs are in {folder:?}");
    submit(args, &options, (scripts[1].0, ""), &words).map(drop)
}

/// The plan that the command line names.
fn given(farm: &FarmArgs) -> Result<Plan, Failure> {
    if farm.tasks.is_some() || farm.job.is_some() || !farm.flags.is_empty() {
        let reason = "a plan has a command with its flags, and tasks, already: leave out --command, --tasks and --";
        return Err(Failure::name(&farm.scene, reason));
    }
    let plan = Plan::read(&farm.scene, &[])?;
    check(farm, &plan.scene(), &plan.head.command)?;
    Ok(plan)
}

/// The plan of a scene, which is to be written in the folder or is there already.
fn made(farm: &FarmArgs, path: &Path, memory: MemorySize) -> Result<Plan, Failure> {
    if farm.tasks.is_some() && is_index(&farm.scene) {
        let reason = "--tasks: tiles of an index are its tasks, and `plan --tile` sets their size";
        return Err(Failure::usage(reason));
    }
    let command = farm.command("errors.exr");
    check(farm, &farm.scene, &command)?;
    let args = PlanArgs {
        scene: farm.scene.clone(),
        output: path.to_path_buf(),
        folder: path.parent().map(Path::to_path_buf),
        tile: TILE,
        tasks: farm.tasks.unwrap_or(TASKS),
        json: None,
        command,
    };
    let plan = plan::planned(&args, memory)?;
    match Plan::read(path, &[]) {
        _ if !path.exists() => Ok(plan),
        // With other estimates, perhaps.
        Ok(found) if found.is_as(&plan)? => Ok(found),
        _ => Err(Failure::name(
            path,
            "it is of another job; remove its folder or choose another --folder",
        )),
    }
}

/// The scripts that run tasks and that merge them, and their names. All paths in them are absolute.
///
/// The first one gets the number of the first task of a level, how many jobs share the level, and the number of the last task. A job
/// runs every so many of them. The second one submits itself again after what is missing.
fn scripts(
    args: &SlurmArgs,
    folder: &Path,
    plan: &Path,
) -> Result<[(&'static str, String); 2], Failure> {
    let farm = &args.farm;
    let program = quote(&farm.program()?)?;
    let (plan, folder) = (quote(&absolute(plan)?)?, quote(&absolute(folder)?)?);
    let mut outputs = String::new();
    for (flag, path) in farm.outputs() {
        outputs += &format!(" {flag} {}", quote(&absolute(path)?)?);
    }
    let mut again = format!(
        "exec {program} farm slurm {plan}{outputs} --folder {folder} --program {program} --grace {} --attempts {}",
        args.grace,
        args.attempts - 1
    );
    for option in &args.sbatch {
        again += &format!(" {}", quote(&format!("--sbatch={option}"))?);
    }
    if args.attempts == 1 {
        again = "exit 1".to_owned();
    }
    let grace = format!("--signal=B:USR2@{}", args.grace);
    let run = head(farm, &args.sbatch, ("task-%a.log", Some(grace)))?;
    let merge = head(farm, &args.sbatch, ("merge.log", None))?;
    let merge =
        format!("{merge}{program} check {plan} && exec {program} merge {plan}{outputs}\n{again}\n");
    let run = format!(
        r#"{run}set -u
requeue= task=
# The time limit is near: USR2 comes from Slurm. TERM comes when the job is preempted or cancelled.
trap 'requeue=1; kill -TERM $task 2>/dev/null' USR2
trap 'kill -TERM $task 2>/dev/null' TERM
{program} run {plan} ${{SLURM_CPUS_PER_TASK:+--threads $SLURM_CPUS_PER_TASK}} \
    --task $(seq $(($1 + SLURM_ARRAY_TASK_ID)) "$2" "$3") &
task=$!
wait "$task"
code=$?
# A signal ends `wait` early.
while kill -0 "$task" 2>/dev/null; do
    wait "$task"
    code=$?
done
if [ -n "$requeue" ] && {{ [ "$code" = 75 ] || [ "$code" = 130 ]; }}; then
    scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID"
fi
exit "$code"
"#
    );
    Ok([("task.sh", run), ("merge.sh", merge)])
}

/// The head of a script: options of sbatch, with own ones before others that may replace them.
fn head(
    farm: &FarmArgs,
    others: &[String],
    (log, more): (&str, Option<String>),
) -> Result<String, Failure> {
    let folder = absolute(&farm.folder())?;
    let directory = std::env::current_dir().map_err(Failure::work)?;
    let name = farm.output[0].file_name().unwrap_or_default();
    // Slurm expands nothing in a name with a backslash, so that scripts open such a log themselves.
    let (output, open) = match folder.contains(ESCAPE) {
        false => (
            format!("{}/{log}", folder.replace('%', "%%")),
            String::new(),
        ),
        true => {
            let log = log.replace("%a", "$SLURM_ARRAY_TASK_ID");
            let open = format!("exec >>{}/{log} 2>&1\n", quote(&folder)?);
            ("/dev/null".to_owned(), open)
        }
    };
    let own = [
        format!("--job-name=antumbra-{}", name.to_string_lossy()),
        format!("--chdir={}", text(&directory)?),
        format!("--output={output}"),
        "--open-mode=append".to_owned(),
        "--requeue".to_owned(),
    ];
    let mut head = "#!/usr/bin/env bash\n".to_owned();
    for option in own.iter().chain(&more).chain(others) {
        let plain = |c: char| c.is_ascii_graphic() && !"'\"\\#".contains(c);
        let quoted = match option.chars().all(plain) {
            true => option.clone(),
            false => quote(option)?,
        };
        head += &format!("#SBATCH {quoted}\n");
    }
    Ok(head + &open)
}

/// Submits a script with arguments, and prints the number of the job, which it returns. A dry run prints only how.
fn submit(
    args: &SlurmArgs,
    options: &[String],
    (script, more): (&str, &str),
    words: &str,
) -> Result<String, Failure> {
    let script = absolute(&args.farm.folder().join(script))?;
    if args.dry_run {
        let (options, script) = (options.join(" "), quote(&script)?);
        print(format_args!("sbatch --parsable {options} {script} {more}"))?;
        return Ok("JOB".to_owned());
    }
    let mut command = Command::new("sbatch");
    let command = command.arg("--parsable").args(options).arg(script);
    let output = command.args(more.split_whitespace()).output();
    let output = output.map_err(|error| Failure::Work(format!("cannot run sbatch: {error}")))?;
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_owned();
    if !output.status.success() {
        return Err(Failure::work(format_args!(
            "sbatch refused: {}",
            text(&output.stderr)
        )));
    }
    // `--parsable` prints the number, perhaps with `;cluster` after it.
    let answer = text(&output.stdout);
    let job = answer.split(';').next().unwrap_or_default().to_owned();
    tell(format_args!("submitted job {job}: {words}"));
    print(&job)?;
    Ok(job)
}

/// A text as a word of the shell.
fn quote(text: &str) -> Result<String, Failure> {
    let quoted = shlex::try_quote(text).map_err(Failure::usage)?;
    Ok(quoted.into_owned())
}
