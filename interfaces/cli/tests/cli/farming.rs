//! Names that shells and schedulers could misread arrive whole.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::Command;

use crate::support::Place;

/// Names of folders and files, each with characters that mean something to a shell, Slurm or a template.
const EVIL: [&str; 16] = [
    "$(touch pwned)",
    "`touch pwned`",
    "it's",
    "two \" quotes",
    "a b;touch pwned",
    "back\\slash",
    "per%jcent%a%%",
    "{{Param.Program}}",
    "@SLURM_ARRAY_TASK_ID@",
    "line\u{2028}end",
    "<img src=x>",
    "-rf",
    "#hash",
    "*?[a]",
    "$SLURM_ARRAY_TASK_ID",
    "~!& |é",
];

/// A program that prints its arguments to a file.
fn stub(place: &Place) -> String {
    place.write("stub", "#!/bin/sh\nprintf '%s\\0' \"$@\" >args\n");
    let executable = fs::Permissions::from_mode(0o755);
    fs::set_permissions(place.path("stub"), executable).expect("permissions");
    place.path("stub").to_str().expect("text").to_owned()
}

/// The arguments that a script gives to the stub.
fn arguments(place: &Place, script: &str) -> Vec<String> {
    let _ = fs::remove_file(place.path("args"));
    let bash = Command::new("bash")
        .args(["-c", script])
        .current_dir(place.path("."))
        .env("SLURM_ARRAY_TASK_ID", "1")
        .status();
    assert!(bash.expect("bash").success(), "{script}");
    let text = fs::read_to_string(place.path("args")).expect("arguments");
    text.split_terminator('\0').map(str::to_owned).collect()
}

/// What Slurm makes of the log's name in a header.
fn log_of(script: &str) -> String {
    let mut lines = script
        .lines()
        .filter_map(|line| line.strip_prefix("#SBATCH "));
    let words = lines.find_map(|line| {
        let word = shlex::split(line)?.pop()?;
        Some(word.strip_prefix("--output=")?.to_owned())
    });
    let marked = words.expect("a log").replace("%%", "\0");
    marked.replace("%a", "1").replace('\0', "%")
}

#[test]
fn evil_names_arrive_whole_with_slurm() {
    for name in EVIL {
        let place = Place::with_room();
        let program = stub(&place);
        let scene = format!("./{name}.pbrt");
        fs::copy(place.path("room.pbrt"), place.path(&scene)).expect("a copy");
        let folder = place.path(name);
        fs::create_dir(&folder).expect("a folder");
        let folder = folder.to_str().expect("text");
        for part in ["0.part", "1.part"] {
            fs::write(place.path(name).join(part), "").expect("a file");
        }
        let output = format!("./{name}.exr");
        let args = [
            "farm",
            "slurm",
            &scene,
            "-o",
            &output,
            "--tasks",
            "2",
            "--dry-run",
            "--program",
            &program,
            "--folder",
            &format!("./{name}"),
            "--stderr-image",
            &format!("./{name}.e.exr"),
        ];
        let printed = place.run(&args).expect(0).stdout;
        let scripts: Vec<_> = printed.split("#!/usr/bin/env bash").skip(1).collect();
        let [render, merge] = scripts[..] else {
            panic!("two scripts");
        };
        let (merge, _) = merge.split_once("\nsbatch ").expect("a command");
        let path = |end: &str| {
            place
                .path(&format!("{name}{end}"))
                .to_str()
                .expect("text")
                .to_owned()
        };
        let found = arguments(&place, render);
        assert_eq!(found[1], path(".pbrt"));
        assert_eq!(found[3..6], ["--shard", "1/2", "-o"]);
        assert_eq!(found[6], format!("{folder}/1.part"));
        assert_eq!(found[8], format!("{folder}/1.stderr.exr"));
        let found = arguments(&place, &cut(merge));
        assert_eq!(
            found[1..3],
            [format!("{folder}/0.part"), format!("{folder}/1.part")]
        );
        assert_eq!(found[4], path(".exr"));
        assert_eq!(found[6], path(".e.exr"));
        let log = log_of(render);
        if name.contains('\\') {
            assert_eq!(log, "/dev/null");
            assert!(place.path(name).join("render-1.log").is_file());
        } else {
            assert_eq!(log, format!("{folder}/render-1.log"));
        }
        assert!(!place.path("pwned").exists(), "{name}");
    }
}

/// A script without the heading of what follows it in a dry run.
fn cut(script: &str) -> String {
    script.trim_end().to_owned()
}

#[test]
fn evil_names_are_no_templates() {
    for name in EVIL {
        let place = Place::with_room();
        let scene = format!("./{name}.pbrt");
        fs::copy(place.path("room.pbrt"), place.path(&scene)).expect("a copy");
        let args = [
            "farm",
            "openjd",
            &scene,
            "-o",
            &format!("./{name}.exr"),
            "--stderr-image",
            &format!("./{name}.e.exr"),
            "--folder",
            &format!("./{name}.d"),
            "--program",
            &format!("./{name}"),
        ];
        let template = place.run(&args).expect(0).json();
        // Everything but the values of parameters.
        let text = template["steps"].to_string();
        assert!(
            !text.contains(&name.replace('"', "\\\"")) || name == "{{Param.Program}}",
            "{text}"
        );
        assert!(!text.contains("{{Param.Program}}.e"), "{text}");
        let parameters = template["parameterDefinitions"].as_array().expect("a list");
        let errors = parameters
            .iter()
            .find(|parameter| parameter["name"] == "StderrImage");
        assert_eq!(
            errors.expect("a parameter")["default"],
            format!("{name}.e.exr")
        );
    }
}

#[test]
fn options_of_sbatch_are_one_line() {
    let place = Place::with_room();
    let slurm = ["farm", "slurm", "room.pbrt", "-o", "a.exr", "--dry-run"];
    let option = "--sbatch=--comment=x\ntouch pwned";
    let run = place.run(&[&slurm[..], &[option]].concat()).expect(2);
    assert!(run.stderr.contains("one line"), "{}", run.stderr);
}

#[test]
fn a_job_given_again_submits_what_is_missing() {
    let place = Place::with_room();
    fs::create_dir(place.path("bin")).expect("a folder");
    place.write("bin/sbatch", "#!/bin/sh\necho 7\n");
    let executable = fs::Permissions::from_mode(0o755);
    fs::set_permissions(place.path("bin/sbatch"), executable).expect("permissions");
    let path = std::env::var("PATH").expect("a path");
    let path = format!("{}:{path}", place.path("bin").display());
    let submit = |tasks: &str| {
        let run = Command::new(env!("CARGO_BIN_EXE_antumbra"))
            .args([
                "farm",
                "slurm",
                "room.pbrt",
                "-o",
                "a.exr",
                "--tasks",
                tasks,
            ])
            .current_dir(place.path("."))
            .env("PATH", &path)
            .output()
            .expect("the program starts");
        let told = String::from_utf8(run.stderr).expect("text");
        (run.status.code(), told)
    };
    let (code, told) = submit("3");
    assert!(code == Some(0) && told.contains("3 of 3 parts"), "{told}");
    place.write("a.exr.farm/1.part", "");
    let (code, told) = submit("3");
    assert!(code == Some(0) && told.contains("2 of 3 parts"), "{told}");
    let (code, told) = submit("4");
    assert!(code == Some(2) && told.contains("another job"), "{told}");
}

/// Runs the jobs that `farm slurm --dry-run` prints, as three tasks in the folder `parts`, of which one is lost in the middle of its
/// work.
fn run_on_many(place: &Place, slurm: &[&str]) {
    let printed = place.run(slurm).expect(0).stdout;
    let scripts: Vec<_> = printed.split("#!/usr/bin/env bash").skip(1).collect();
    let [compute, merge] = scripts[..] else {
        panic!("two scripts: {printed}");
    };
    let (compute, _) = compute.rsplit_once("\n# ").expect("a comment");
    let (merge, _) = merge.split_once("\nsbatch ").expect("a command");
    fs::create_dir(place.path("parts")).expect("a folder");
    let bash = |script: &str, task: &str| {
        let bash = Command::new("bash")
            .args(["-c", script])
            .current_dir(place.path("."))
            .env("SLURM_ARRAY_TASK_ID", task)
            .status();
        assert!(bash.expect("bash").success(), "{script}");
    };
    // The machine of a task was lost in the middle of its work.
    bash(compute, "1");
    let part = fs::read(place.path("parts/1.part")).expect("a part");
    fs::remove_file(place.path("parts/1.part")).expect("a file");
    place.write("parts/1.unfinished.part", &part[..part.len() / 2]);
    for task in ["0", "1", "2"] {
        bash(compute, task);
    }
    bash(merge, "");
}

#[test]
fn openness_and_viewsheds_on_many_machines_have_the_same_bytes() {
    let place = Place::with_room();
    let cells: Vec<String> = (0..160)
        .map(|row| {
            let heights = (0..200).map(|column| (row * 7 + column * column * 3) % 11);
            let heights: Vec<String> = heights.map(|height| height.to_string()).collect();
            heights.join(" ")
        })
        .collect();
    let head = "ncols 200\nnrows 160\nxllcorner 600000\nyllcorner 5340000\ncellsize 10\n";
    place.write("dem.asc", format!("{head}{}\n", cells.join("\n")));
    // So many observers that there are chunks for each of three tasks.
    let eyes: String = (0..400)
        .map(|eye| {
            format!(
                "{},{}\n",
                600_010 + 7 * eye % 1980,
                5_340_010 + 13 * eye % 1580
            )
        })
        .collect();
    place.write("eyes.csv", format!("x,y\n{eyes}"));
    let program = env!("CARGO_BIN_EXE_antumbra");
    let visible = ["eyes.csv", "--viewshed", "--eye", "3", "--curvature"];
    let open = ["--samples", "512", "--two-sided"];
    for (scene, job, end, flags) in [
        ("dem.asc", "visible", "tif", &visible[..]),
        ("builtin:city:3000", "ao", "ply", &open),
    ] {
        let [one, all] = ["one", "all"].map(|name| format!("{name}.{end}"));
        place
            .run(&[&[job, scene], flags, &["-o", &one]].concat())
            .expect(0);
        let farm = [
            "farm",
            "slurm",
            scene,
            "--command",
            job,
            "-o",
            &all,
            "--tasks",
            "3",
        ];
        let more = ["--folder", "parts", "--program", program, "--dry-run", "--"];
        run_on_many(&place, &[&farm[..], &more, flags].concat());
        let [one, all] = [one, all].map(|name| fs::read(place.path(&name)).expect("a file"));
        assert!(one == all, "{job}");
        fs::remove_dir_all(place.path("parts")).expect("a folder");
    }
}

#[test]
fn a_bake_on_many_machines_has_the_same_bytes() {
    let place = Place::with_room();
    let flags = [
        "--vertices",
        "--lat",
        "48",
        "--lon",
        "11",
        "--up",
        "z",
        "--step",
        "5",
    ];
    let day = ["--from", "2025-06-21", "--to", "2025-06-21"];
    let flags = [&flags[..], &day].concat();
    let scene = ["sun", "builtin:city:2000", "-o", "one.csv", "-o", "one.npz"];
    place.run(&[&scene[..], &flags].concat()).expect(0);
    let program = env!("CARGO_BIN_EXE_antumbra");
    let farm = [
        "builtin:city:2000",
        "--command",
        "sun",
        "-o",
        "all.csv",
        "-o",
        "all.npz",
    ];
    let tasks = ["--tasks", "3", "--folder", "parts", "--program", program];
    let slurm = [
        &["farm", "slurm"],
        &farm[..],
        &tasks,
        &["--dry-run", "--"],
        &flags,
    ]
    .concat();
    run_on_many(&place, &slurm);
    for end in ["csv", "npz"] {
        let [one, all] = ["one", "all"].map(|name| fs::read(place.path(&format!("{name}.{end}"))));
        assert_eq!(one.expect("a file"), all.expect("a file"), "{end}");
    }
    let openjd = [&["farm", "openjd"], &farm[..], &tasks, &["--"], &flags].concat();
    let template = place.run(&openjd).expect(0).json();
    let args = &template["steps"][0]["script"]["actions"]["onRun"]["args"];
    assert_eq!(args[0], "sun");
    assert_eq!(args[15], "--shard");
    let merge = &template["steps"][1]["script"]["actions"]["onRun"]["args"];
    assert_eq!(merge[7], "{{Param.Output2}}");
    for (bad, word) in [
        (["--", "--no-such", "1"], "--no-such"),
        (["--", "--output", "a.csv"], "before --"),
        (["--", "--show", "direct"], "--epw"),
    ] {
        let run =
            place.run(&[&["farm", "slurm"], &farm[..], &["--dry-run"], &bad, &flags].concat());
        assert!(run.code == 2 && run.stderr.contains(word), "{}", run.stderr);
    }
}
