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

/// A folder with a `sbatch` that notes what it is given, for each job a file.
struct Slurm(Place);

impl Slurm {
    fn new() -> Self {
        let place = Place::with_room();
        fs::create_dir(place.path("bin")).expect("a folder");
        let note =
            "cd \"$(dirname \"$0\")\"\nn=$(ls | wc -l)\nprintf '%s\\0' \"$@\" >job.$n\necho $n\n";
        Self(place).program("bin/sbatch", note)
    }

    fn program(self, name: &str, script: &str) -> Self {
        self.0.write(name, format!("#!/bin/sh\n{script}"));
        let executable = fs::Permissions::from_mode(0o755);
        fs::set_permissions(self.0.path(name), executable).expect("permissions");
        self
    }

    /// Runs a program here as an element of an array; returns its code and what it says.
    fn run(&self, program: &str, args: &[&str], element: &str) -> (Option<i32>, String) {
        let path = std::env::var("PATH").expect("a path");
        let bin = self.0.path("bin");
        let run = Command::new(program)
            .args(args)
            .current_dir(self.0.path("."))
            .env("PATH", format!("{}:{path}", bin.display()))
            .env("SLURM_ARRAY_TASK_ID", element)
            .output()
            .expect("the program starts");
        let said = String::from_utf8(run.stderr).expect("text");
        (run.status.code(), said)
    }

    /// Submits jobs; returns what each one was given, and what was said.
    fn submit(&self, args: &[&str]) -> (Vec<Vec<String>>, String) {
        let before = self.jobs().len();
        let farm = [&["farm", "slurm"], args].concat();
        let (code, said) = self.run(env!("CARGO_BIN_EXE_antumbra"), &farm, "");
        assert_eq!(code, Some(0), "{said}");
        (self.jobs().split_off(before), said)
    }

    /// What all jobs so far were given.
    fn jobs(&self) -> Vec<Vec<String>> {
        let texts =
            (1..).map_while(|job| fs::read_to_string(self.0.path(&format!("bin/job.{job}"))).ok());
        let words = |text: String| text.split_terminator('\0').map(str::to_owned).collect();
        texts.map(words).collect()
    }

    /// Runs an element of a job as Slurm does; returns its code and what it says.
    fn element(&self, job: &[String], element: &str) -> (Option<i32>, String) {
        let words = job.iter().skip_while(|word| word.starts_with("--"));
        let words: Vec<&str> = words.map(String::as_str).collect();
        self.run("bash", &words, element)
    }

    /// Runs all elements of a job but for a lost one.
    fn all_but(&self, lost: &str, job: &[String]) {
        let array = job.iter().find_map(|word| word.strip_prefix("--array="));
        let elements = array
            .unwrap_or("0")
            .split(',')
            .filter(|&element| element != lost);
        for element in elements {
            let (code, said) = self.element(job, element);
            assert_eq!(code, Some(0), "{job:?}: {said}");
        }
    }
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
    let spp = ["--spp", "4", "--resolution", "16x16"];
    for name in EVIL {
        let slurm = Slurm::new();
        let place = &slurm.0;
        let text = |end: &str| {
            place
                .path(&format!("{name}{end}"))
                .to_str()
                .expect("text")
                .to_owned()
        };
        let [scene, one, one_errors] =
            [".pbrt", ".1.exr", ".1e.exr"].map(|end| format!("./{name}{end}"));
        fs::copy(place.path("room.pbrt"), text(".pbrt")).expect("a copy");
        let whole = ["render", &scene, "-o", &one, "--stderr-image", &one_errors];
        place.run(&[&whole[..], &spp].concat()).expect(0);
        let [image, errors, folder] = [".exr", ".e.exr", ""].map(|end| format!("./{name}{end}"));
        let option = format!("--sbatch=--comment={name}");
        let farm = [
            &scene,
            "-o",
            &image,
            "--stderr-image",
            &errors,
            "--folder",
            &folder,
            "--tasks",
            "2",
            &option,
            "--",
        ];
        let (jobs, _) = slurm.submit(&[&farm[..], &spp].concat());
        let script = |name: &str| format!("{}/{name}", text(""));
        assert_eq!(jobs[0][2..], [&script("task.sh"), "0", "2", "1"]);
        assert_eq!(jobs[1][2..], [script("merge.sh")]);
        slurm.all_but("0", &jobs[0]);
        // What is missing is submitted with the same options.
        slurm.all_but("", &jobs[1]);
        let again = slurm.jobs().split_off(2);
        assert_eq!(again[0][1], "--array=0");
        assert_eq!(again[0][2..], jobs[0][2..]);
        assert_eq!(again[1][2..], jobs[1][2..]);
        let head = fs::read_to_string(script("merge.sh")).expect("a script");
        let mut options = head
            .lines()
            .filter_map(|line| line.strip_prefix("#SBATCH "));
        let comment =
            options.any(|line| shlex::split(line) == Some(vec![format!("--comment={name}")]));
        assert!(comment, "{head}");
        for job in &again {
            slurm.all_but("", job);
        }
        for [found, wanted] in [[".exr", ".1.exr"], [".e.exr", ".1e.exr"]] {
            let [found, wanted] = [found, wanted].map(|end| fs::read(text(end)).expect("an image"));
            assert!(found == wanted, "{name}");
        }
        let log = log_of(&fs::read_to_string(script("task.sh")).expect("a script"));
        match name.contains('\\') {
            false => assert_eq!(log, script("task-1.log")),
            true => assert!(log == "/dev/null" && place.path(name).join("task-1.log").is_file()),
        }
        assert!(!place.path("pwned").exists(), "{name}");
    }
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
    let slurm = Slurm::new();
    let farm = |tasks| ["room.pbrt", "-o", "a.exr", "--tasks", tasks];
    let (jobs, said) = slurm.submit(&farm("3"));
    assert!(said.contains("3 of 3 tasks"), "{said}");
    slurm.all_but("0", &jobs[0]);
    let (jobs, said) = slurm.submit(&farm("3"));
    assert!(said.contains("1 of 3 tasks"), "{said}");
    assert_eq!(jobs[0][1], "--array=0");
    let plan = "a.exr.farm/plan.jsonl";
    for (args, word) in [
        (&["room.pbrt", "--tasks", "4"][..], "another job"),
        (
            &["room.pbrt", "--tasks", "3", "--", "--spp", "2"],
            "another job",
        ),
        (
            &["room.pbrt", "--tasks", "3", "--", "--threads", "2"],
            "--sbatch=--cpus-per-task",
        ),
        (
            &["room.pbrt", "--tasks", "3", "--", "--stderr-image", "e.exr"],
            "before --",
        ),
        (&["room.pbrt", "--lines", "l.csv"], "only visible"),
        (&[plan, "--tasks", "3"], "leave out"),
        (&[plan, "--", "--spp", "2"], "leave out"),
        (
            &[plan, "--stderr-image", "e.exr"],
            "its command has this flag",
        ),
        (&["-"], "not the standard input"),
    ] {
        let args = [&["farm", "slurm", "-o", "a.exr"], args].concat();
        let run = slurm.0.run(&args);
        assert!(
            run.code == 2 && run.stderr.contains(word),
            "{args:?}: {}",
            run.stderr
        );
    }
    // All are done, and given as a plan only the last job is left.
    slurm.all_but("", &jobs[0]);
    let (jobs, _) = slurm.submit(&[plan, "-o", "b.exr"]);
    assert_eq!(jobs.len(), 1);
    slurm.all_but("", &jobs[0]);
    assert!(slurm.0.path("b.exr").is_file());
}

#[test]
fn a_last_job_gives_up_after_some_attempts() {
    let slurm = Slurm::new();
    let (mut jobs, _) = slurm.submit(&["room.pbrt", "-o", "a.exr", "--attempts", "3"]);
    for attempt in 1..=3 {
        let before = slurm.jobs().len();
        assert_eq!(
            slurm.element(&jobs[1], "0").0,
            Some(i32::from(attempt == 3))
        );
        jobs = slurm.jobs().split_off(before);
        assert_eq!(jobs.is_empty(), attempt == 3);
    }
}

#[test]
fn a_thousand_jobs_share_more_tasks() {
    let slurm = Slurm::new().program("stub", "printf '%s ' \"$@\" >args\n");
    let farm = [
        "room.pbrt",
        "-o",
        "a.exr",
        "--tasks",
        "2500",
        "--program",
        "./stub",
    ];
    let (jobs, _) = slurm.submit(&farm);
    let array: Vec<String> = (0..1000).map(|element| element.to_string()).collect();
    assert_eq!(jobs[0][1], format!("--array={}", array.join(",")));
    let plan = slurm.0.path("a.exr.farm/plan.jsonl");
    for (element, tasks) in [
        ("0", "0 1000 2000"),
        ("499", "499 1499 2499"),
        ("500", "500 1500"),
    ] {
        assert_eq!(slurm.element(&jobs[0], element).0, Some(0));
        let found = fs::read_to_string(slurm.0.path("args")).expect("arguments");
        assert_eq!(found, format!("run {} --task {tasks} ", plan.display()));
    }
}

/// Runs what is submitted in the folder `parts`, as three tasks, of which one is lost in the middle of its work.
fn run_on_many(slurm: &Slurm, farm: &[&str]) {
    let (jobs, _) = slurm.submit(farm);
    assert_eq!(slurm.element(&jobs[0], "1").0, Some(0));
    let path = |name: &str| slurm.0.path("parts").join(name);
    let part = fs::read(path("s00001.part")).expect("a part");
    for name in ["s00001.part", "s00001.receipt.json"] {
        fs::remove_file(path(name)).expect("a file");
    }
    fs::write(path("unfinished.s00001.part"), &part[..part.len() / 2]).expect("a file");
    for job in &jobs {
        slurm.all_but("", job);
    }
}

#[test]
fn openness_and_viewsheds_on_many_machines_have_the_same_bytes() {
    let slurm = Slurm::new();
    let place = &slurm.0;
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
        let farm = [scene, "--command", job, "-o", &all, "--tasks", "3"];
        let more = ["--folder", "parts", "--"];
        run_on_many(&slurm, &[&farm[..], &more, flags].concat());
        let [one, all] = [one, all].map(|name| fs::read(place.path(&name)).expect("a file"));
        assert!(one == all, "{job}");
        fs::remove_dir_all(place.path("parts")).expect("a folder");
    }
    // The last job writes lines of sight.
    place.write(
        "a.csv",
        "x,y,z\n600100,5340100,30\n600900,5340100,9\n600100,5340900,30\n",
    );
    let pairs = ["visible", "dem.asc", "a.csv", "-o", "one.csv", "--lines"];
    place.run(&[&pairs[..], &["lines.csv"]].concat()).expect(0);
    let farm = [
        "dem.asc",
        "--command",
        "visible",
        "-o",
        "all.csv",
        "--lines",
    ];
    for job in slurm
        .submit(&[&farm[..], &["all.lines.csv", "--", "a.csv"]].concat())
        .0
    {
        slurm.all_but("", &job);
    }
    for [one, all] in [["one.csv", "all.csv"], ["lines.csv", "all.lines.csv"]] {
        let [one, all] = [one, all].map(|name| fs::read(place.path(name)).expect("a table"));
        assert!(one == all && !one.is_empty());
    }
}

#[test]
fn a_bake_on_many_machines_has_the_same_bytes() {
    let slurm = Slurm::new();
    let place = &slurm.0;
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
    let farm = [
        "builtin:city:2000",
        "--command",
        "sun",
        "-o",
        "all.csv",
        "-o",
        "all.npz",
    ];
    let tasks = ["--tasks", "3", "--folder", "parts"];
    run_on_many(&slurm, &[&farm[..], &tasks, &["--"], &flags].concat());
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

#[test]
fn a_plan_of_a_raster_is_submitted_level_by_level() {
    let slurm = Slurm::new();
    let place = &slurm.0;
    let raster = |left: usize| {
        let row = |row: usize| {
            let heights =
                (left..96).map(|column| ((row * 7 + column * column * 3) % 11).to_string());
            heights.collect::<Vec<_>>().join(" ")
        };
        let cells: Vec<String> = (0..90).map(row).collect();
        let (columns, corner) = (96 - left, 600_000 + left);
        format!(
            "ncols {columns}\nnrows 90\nxllcorner {corner}\nyllcorner 0\ncellsize 1\n{}\n",
            cells.join("\n")
        )
    };
    place.write("whole.asc", raster(0));
    place.write("east.asc", raster(50));
    let horizon = ["--cells", "--azimuths", "lattice:16", "--show", "sky-view"];
    let whole = [&["horizon", "whole.asc", "-o", "whole.tif"], &horizon[..]].concat();
    place.run(&whole).expect(0);
    let index = ["index", "east.asc", "whole.asc", "-o", "all.index"];
    place.run(&index).expect(0);
    let plan = [
        "plan",
        "all.index",
        "-o",
        "all.jsonl",
        "--tile",
        "48",
        "horizon",
    ];
    place.run(&[&plan, &horizon[..]].concat()).expect(0);
    let (jobs, _) = slurm.submit(&["all.jsonl", "-o", "sky.tif"]);
    assert_eq!(jobs.len(), 5);
    for (number, job) in jobs.iter().enumerate() {
        let before = format!("--dependency=afterany:{number}");
        assert_eq!(job.contains(&before), number > 0, "{job:?}");
    }
    // A job of the first level is lost, so that others of each level fail.
    slurm.all_but("1", &jobs[0]);
    for job in &jobs[1..4] {
        let array = job.iter().find_map(|word| word.strip_prefix("--array="));
        let codes = array
            .expect("an array")
            .split(',')
            .map(|element| slurm.element(job, element).0);
        let failed = codes.filter(|&code| code != Some(0)).count();
        assert!(failed > 0, "{job:?}");
    }
    slurm.all_but("", &jobs[4]);
    let again = slurm.jobs().split_off(5);
    assert!(again.len() == 5 && again[0][1] == "--array=1", "{again:?}");
    for job in &again {
        slurm.all_but("", job);
    }
    let [sky, whole] =
        ["sky.tif", "whole.tif"].map(|name| fs::read(place.path(name)).expect("a raster"));
    assert!(sky == whole);
    // An index makes a plan, with tiles that are as large as all of it.
    let farm = ["all.index", "--command", "horizon", "-o", "one.tif", "--"];
    let farm = [&farm, &horizon[..]].concat();
    for job in slurm.submit(&farm).0 {
        slurm.all_but("", &job);
    }
    assert!(fs::read(place.path("one.tif")).expect("a raster") == whole);
    assert_eq!(slurm.submit(&farm).0.len(), 1);
    for (args, word) in [
        (&["all.jsonl", "-o", "sky.png"][..], ".vrt"),
        (
            &[
                "all.index",
                "-o",
                "b.tif",
                "--tasks",
                "2",
                "--command",
                "horizon",
            ],
            "--tile",
        ),
    ] {
        let run = place.run(&[&["farm", "slurm"], args, &["--dry-run"]].concat());
        assert!(run.code == 2 && run.stderr.contains(word), "{}", run.stderr);
    }
}
