//! `antumbra check`: which tasks of a plan are done.

use serde::Serialize;

use super::{Plan, State};
use crate::args::CheckArgs;
use crate::exit::{Failure, print, tell};
use crate::json;

/// What was found.
#[derive(Serialize)]
struct Document {
    schema: &'static str,
    tasks: usize,
    done: usize,
    missing: Vec<String>,
    stale: Vec<String>,
    disagreeing: Vec<String>,
}

/// Runs the command. Prints what is to be run again, an id in each line, unless a document is wanted.
///
/// # Errors
/// Something is to be run.
pub fn check(args: &CheckArgs) -> Result<(), Failure> {
    let plan = Plan::read(&args.plan, &[])?;
    let mut found = Document {
        schema: "antumbra.check/1",
        tasks: plan.tasks.len(),
        done: 0,
        missing: Vec::new(),
        stale: Vec::new(),
        disagreeing: Vec::new(),
    };
    for task in &plan.tasks {
        let list = match plan.state(task, true)? {
            State::Done => {
                found.done += 1;
                continue;
            }
            State::Missing => &mut found.missing,
            State::Stale => &mut found.stale,
            State::Disagreeing => &mut found.disagreeing,
        };
        list.push(task.id.clone());
    }
    let ends = [
        ("missing", &found.missing),
        ("stale", &found.stale),
        ("disagreeing", &found.disagreeing),
    ];
    let is_open = |id: &&String| ends.iter().any(|(_, list)| list.contains(id));
    let mut open = plan.tasks.iter().map(|task| &task.id).filter(is_open);
    if args.json.is_none() {
        open.try_for_each(print)?;
    }
    json::write(&found, args.json.as_ref())?;
    let words: Vec<String> = ends
        .iter()
        .filter(|(_, list)| !list.is_empty())
        .map(|(what, list)| format!("{} {what}", list.len()))
        .collect();
    let name = plan.path.display();
    match words.is_empty() {
        true => {
            tell(format_args!("{name}: all {} tasks are done", found.tasks));
            Ok(())
        }
        false => Err(Failure::Work(format!(
            "{name}: {} of {} tasks are done, {}; antumbra run {name} does the rest",
            found.done,
            found.tasks,
            words.join(", ")
        ))),
    }
}
