//! Bakes that are killed or ended in the middle of their work, and go on from their checkpoints.
#![cfg(unix)]

use std::fs;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::support::Place;

fn start(place: &Place, args: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_antumbra"))
        .args(args)
        .current_dir(place.path("."))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts")
}

fn send(child: &Child, signal: &str) -> bool {
    let id = child.id().to_string();
    let kill = Command::new("kill").args([signal, &id]).output();
    kill.expect("kill starts").status.success()
}

/// Requests checkpoints until there is a new one; false if the process ended first.
fn awaits_checkpoint(place: &Place, child: &mut Child, name: &str) -> bool {
    let length = || fs::metadata(place.path(name)).map_or(0, |about| about.len());
    let (before, since) = (length(), Instant::now());
    std::thread::sleep(Duration::from_millis(200));
    while since.elapsed() < Duration::from_secs(120) {
        if child.try_wait().expect("a process").is_some() {
            return false;
        }
        if length() > before {
            return true;
        }
        send(child, "-USR1");
        std::thread::sleep(Duration::from_millis(10));
    }
    panic!("no checkpoint");
}

/// Kills a job after a new checkpoint, ends it after the next, and compares its files with those of an undisturbed run.
fn goes_on(place: &Place, job: &[&str], output: &str) {
    place.run(&[job, &["-o", output]].concat()).expect(0);
    let whole = fs::read(place.path(output)).expect("a result");
    fs::remove_file(place.path(output)).expect("a file");
    let checkpoint = format!("{output}.checkpoint");
    let args = [job, &["-o", output, "--threads", "1"]].concat();
    let mut stops = 0;
    for _ in 0..6 {
        let mut child = start(place, &args);
        if !awaits_checkpoint(place, &mut child, &checkpoint) {
            // A signal before the program ignores it ends it without a code.
            match child.wait().expect("a process").code() {
                None => continue,
                Some(_) => break,
            }
        }
        let ends = stops == 1;
        match ends {
            true => assert!(send(&child, "-TERM")),
            false => child.kill().expect("a process"),
        }
        match (ends, child.wait().expect("a process").code()) {
            (true, Some(75)) | (false, None) => stops += 1,
            // It may be done by now.
            (true, Some(0)) => break,
            other => panic!("{job:?}: {other:?}"),
        }
        assert!(!place.path(output).exists(), "half a result");
        if stops == 2 {
            break;
        }
    }
    assert!(stops > 0, "{job:?} was never stopped");
    place.run(&args).expect(0);
    assert!(
        fs::read(place.path(output)).expect("a result") == whole,
        "{job:?}"
    );
    assert!(!place.path(&checkpoint).exists());
}

#[test]
fn bakes_that_are_killed_go_on() {
    let place = Place::empty();
    let points: String = (0..900)
        .map(|i| {
            format!(
                "{},{},{}\n",
                i % 40 * 9 - 180,
                i / 40 * 9 - 180,
                i % 7 * 10 + 5
            )
        })
        .collect();
    place.write("points.csv", format!("x,z,y\n{points}"));
    let city = "builtin:city:20000";
    let sun = ["sun", city, "--grid", "8", "--lat", "48.2", "--lon", "16.4"];
    goes_on(&place, &sun, "sun.npz");
    goes_on(&place, &["ao", city, "--samples", "384"], "ao.ply");
    let viewshed = ["visible", city, "points.csv", "--viewshed", "--eye", "2"];
    goes_on(&place, &viewshed, "seen.npz");
    goes_on(&place, &["horizon", city, "--grid", "9"], "horizon.npz");
    let factors = ["factors", "builtin:city:2000", "--samples", "8192"];
    goes_on(&place, &factors, "factors.npz");
}
