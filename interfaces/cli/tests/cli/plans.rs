//! Plans: tiles and shares of jobs, whatever is cut, in any order, and whatever is lost.

use std::ffi::OsString;
use std::path::Path;
use std::process::Command;
use std::{fs, thread};

use antumbra_raster::{Crs, Grid, Quantity, read_numbers, write};
use antumbra_testkit::Rng;

use crate::support::Place;

const HEIGHT: Quantity<'_> = Quantity {
    name: "height",
    unit: "m",
};

/// A raster of hills and walls with holes, written as a whole and as files that overlap a little.
fn raster(place: &Place, random: &mut Rng) -> [usize; 2] {
    let size @ [width, height] = [70 + random.below(90), 70 + random.below(60)];
    let mut grid = Grid::north_up(size, [600_000.0, 5_340_000.0], 2.0);
    grid.crs = Some(Crs::from_epsg(25_832).expect("a code"));
    let waves: Vec<[f64; 3]> = (0..6)
        .map(|_| {
            [
                0.02 + 0.2 * f64::from(random.unit()),
                0.3 * f64::from(random.unit()) - 0.15,
                7.0 * f64::from(random.unit()),
            ]
        })
        .collect();
    let mut heights: Vec<f32> = (0..width * height)
        .map(|cell| {
            let [x, y] = [(cell % width) as f64, (cell / width) as f64];
            let hills = waves
                .iter()
                .map(|[a, b, c]| 4.0 * (a * x + b * y + c).sin());
            hills.sum::<f64>() as f32
        })
        .collect();
    for _ in 0..12 {
        let [left, top] = [random.below(width - 8), random.below(height - 8)];
        let roof = if random.below(4) == 0 {
            f32::NAN
        } else {
            20.0 * random.unit()
        };
        for row in top..top + 2 + random.below(6) {
            heights[row * width + left..][..2 + random.below(6)].fill(roof);
        }
    }
    let file = |name: &str, grid: &Grid, heights: &[f32]| {
        let bytes = write(name.as_ref(), grid, heights, &[HEIGHT]).expect("a raster");
        place.write(name, bytes);
    };
    file("whole.tif", &grid, &heights);
    fs::create_dir_all(place.path("parts")).expect("a folder");
    let cuts = [
        20 + random.below(width - 40),
        20 + random.below(height - 40),
    ];
    for (number, [right, down]) in [[0, 0], [1, 0], [0, 1], [1, 1]].into_iter().enumerate() {
        let at = [[0, cuts[0]][right], [0, cuts[1]][down]];
        let more = random.below(5);
        let end = [
            [cuts[0] + more, width][right],
            [cuts[1] + more, height][down],
        ];
        let mut own = grid.clone();
        [own.width, own.height] = [end[0] - at[0], end[1] - at[1]];
        let [x, y] = grid.corner(at[0] as f64, at[1] as f64);
        (own.transform[0], own.transform[3]) = (x, y);
        let rows = heights.chunks_exact(width).take(end[1]).skip(at[1]);
        let cells: Vec<f32> = rows.flat_map(|row| &row[at[0]..end[0]]).copied().collect();
        file(&format!("parts/{number}.tif"), &own, &cells);
    }
    size
}

/// Ids of tasks with those that they need.
fn tasks(plan: &Path) -> Vec<(String, Vec<String>)> {
    let text = fs::read_to_string(plan).expect("a plan");
    let task = |line: &str| {
        let task: serde_json::Value = serde_json::from_str(line).expect("JSON");
        let names = task["after"].as_array().expect("a list").iter();
        let name = |name: &serde_json::Value| name.as_str().expect("a name").to_owned();
        (name(&task["id"]), names.map(name).collect())
    };
    text.lines().skip(1).map(task).collect()
}

/// Runs all tasks in some order that is allowed, each by itself.
fn run_in_any_order(place: &Place, plan: &str, random: &mut Rng) {
    let mut open = tasks(&place.path(plan));
    let mut done: Vec<String> = Vec::new();
    while !open.is_empty() {
        let is_ready =
            |(_, after): &&(String, Vec<String>)| after.iter().all(|id| done.contains(id));
        let ready: Vec<String> = open
            .iter()
            .filter(is_ready)
            .map(|(id, _)| id.clone())
            .collect();
        let id = ready[random.below(ready.len())].clone();
        place.run(&["run", plan, "--task", &id]).expect(0);
        open.retain(|(other, _)| *other != id);
        done.push(id);
    }
}

/// Bits of all cells of a raster.
fn bits(place: &Place, name: &str) -> Vec<u64> {
    let values = place.raster(name).values.into_iter();
    values
        .map(|value| if value.is_nan() { 0 } else { value.to_bits() })
        .collect()
}

#[test]
fn tiles_have_the_bits_of_the_whole_for_any_partition_and_order() {
    let jobs: [&[&str]; 6] = [
        &[
            "horizon",
            "--cells",
            "--azimuths",
            "lattice:16",
            "--show",
            "sky-view",
        ],
        &[
            "horizon",
            "--cells",
            "--azimuths",
            "12",
            "--first",
            "7",
            "--show",
            "openness",
            "--height",
            "1",
        ],
        &["horizon", "--cells", "--azimuths", "1", "--first", "33.3"],
        &[
            "sun",
            "--cells",
            "--from",
            "2025-12-21T08:00",
            "--to",
            "2025-12-21T16:00",
            "--step",
            "60",
        ],
        &["visible", "eyes.csv", "--viewshed", "--eye", "1.6"],
        &[
            "visible",
            "eyes.csv",
            "--viewshed",
            "--eye",
            "3",
            "--show",
            "height",
        ],
    ];
    let mut random = Rng::new(52);
    for round in 0..6 {
        let place = Place::empty();
        let size = raster(&place, &mut random);
        let mut eyes = "x,y\n".to_owned();
        for _ in 0..3 {
            let [x, y] = [0, 1]
                .map(|axis| (3.0 + f64::from(random.unit()) * (size[axis] as f64 - 6.0)) * 2.0);
            eyes += &format!("{},{}\n", 600_000.0 + x, 5_340_000.0 - y);
        }
        // No eye is in a hole.
        place.write("eyes.csv", eyes);
        place.run(&["index", "parts", "-o", "all.index"]).expect(0);
        for (number, job) in jobs
            .iter()
            .enumerate()
            .filter(|(number, _)| (number + round) % 2 == 0)
        {
            let (name, flags) = job.split_first().expect("a command");
            let whole = place.run(&[&[name, "whole.tif"][..], flags, &["-o", "a.tif"]].concat());
            if *name == "visible" && whole.code != 0 {
                continue;
            }
            whole.expect(0);
            let side = (16 + random.below(60)).to_string();
            let plan = format!("{number}.jsonl");
            let head = ["plan", "all.index", "-o", &plan, "--tile", &side, name];
            place.run(&[&head[..], flags].concat()).expect(0);
            // What is computed for the bill is written elsewhere.
            assert!(!place.path("tile.tif").exists());
            run_in_any_order(&place, &plan, &mut random);
            place.run(&["check", &plan]).expect(0);
            place
                .run(&["merge", &plan, "-o", "b.tif", "-o", "b.vrt"])
                .expect(0);
            for other in ["b.tif", "b.vrt"] {
                assert!(
                    bits(&place, "a.tif") == bits(&place, other),
                    "{round}: {job:?}, tiles of {side}: {other}"
                );
            }
        }
    }
}

/// A plan of one day of sun in four tiles.
fn sunny(place: &Place) {
    raster(place, &mut Rng::new(7));
    place.run(&["index", "parts", "-o", "all.index"]).expect(0);
    let job = [
        "sun",
        "--cells",
        "--from",
        "2025-12-21T11:00",
        "--to",
        "2025-12-21T12:00",
    ];
    let head = ["plan", "all.index", "-o", "plan.jsonl", "--tile", "40"];
    place.run(&[&head[..], &job].concat()).expect(0);
}

#[test]
fn tasks_are_done_once_and_what_is_lost_is_done_again() {
    let place = Place::empty();
    sunny(&place);
    let all: Vec<String> = tasks(&place.path("plan.jsonl"))
        .into_iter()
        .map(|(id, _)| id)
        .collect();
    let check = place.run(&["check", "plan.jsonl"]).expect(1);
    assert_eq!(
        check.stdout.lines().collect::<Vec<_>>(),
        all,
        "all are missing"
    );
    place
        .run(&["run", "plan.jsonl", "--task", "0", &all[2]])
        .expect(0);
    let merge = place
        .run(&["merge", "plan.jsonl", "-o", "sun.tif"])
        .expect(1);
    assert!(
        merge
            .stderr
            .contains(&format!("the task {} is not done", all[1])),
        "{}",
        merge.stderr
    );
    place.run(&["run", "plan.jsonl"]).expect(0);
    let sums = || {
        let name = |id: &String| place.path(&format!("plan.jsonl.results/{id}.tif"));
        let read = |id: &String| fs::read(name(id)).expect("a result");
        all.iter().map(read).collect::<Vec<Vec<u8>>>()
    };
    let before = sums();
    let [result, receipt] =
        ["tif", "receipt.json"].map(|end| format!("plan.jsonl.results/{}.{end}", all[1]));
    let text = fs::read_to_string(place.path(&receipt)).expect("a receipt");
    type Damage<'a> = (&'a str, &'a dyn Fn());
    let damages: [Damage<'_>; 5] = [
        ("a lost result", &|| {
            fs::remove_file(place.path(&result)).expect("removed")
        }),
        ("a lost receipt", &|| {
            fs::remove_file(place.path(&receipt)).expect("removed")
        }),
        ("half a receipt", &|| {
            place.write(&receipt, &text[..text.len() / 2])
        }),
        ("a damaged result", &|| place.write(&result, "no raster")),
        ("the receipt of another job", &|| {
            place.write(&receipt, text.replace("\"key\":\"", "\"key\":\"0"))
        }),
    ];
    for (what, damage) in damages {
        damage();
        let check = place.run(&["check", "plan.jsonl"]).expect(1);
        assert_eq!(check.stdout.trim(), all[1], "{what}");
        let run = place.run(&["run", "plan.jsonl"]).expect(0);
        assert!(
            run.stderr.contains("1 tasks done; "),
            "{what}: {}",
            run.stderr
        );
        assert!(sums() == before, "{what}");
        place.run(&["check", "plan.jsonl"]).expect(0);
    }
}

#[test]
fn sweeps_that_a_task_needs_are_checked() {
    let place = Place::empty();
    raster(&place, &mut Rng::new(9));
    place.run(&["index", "parts", "-o", "all.index"]).expect(0);
    let job = [
        "horizon",
        "--cells",
        "--azimuths",
        "lattice:8",
        "--show",
        "sky-view",
    ];
    let head = ["plan", "all.index", "-o", "plan.jsonl", "--tile", "60"];
    place.run(&[&head[..], &job].concat()).expect(0);
    let all = tasks(&place.path("plan.jsonl"));
    let (id, after) = all
        .iter()
        .find(|(_, after)| after.len() == 1)
        .expect("a task");
    let run = |code| {
        place
            .run(&["run", "plan.jsonl", "--task", id])
            .expect(code)
            .stderr
    };
    assert!(run(1).contains(&format!(
        "needs the result of {}, which is not there",
        after[0]
    )));
    place.run(&["run", "plan.jsonl"]).expect(0);
    let [result, receipt] =
        [".sweep", ".receipt.json"].map(|end| format!("plan.jsonl.results/{}{end}", after[0]));
    let text = fs::read_to_string(place.path(&receipt)).expect("a receipt");
    let bytes = fs::read(place.path(&result)).expect("a sweep");
    fs::remove_file(place.path(&format!("plan.jsonl.results/{id}.receipt.json"))).expect("removed");
    // A sweep whose hulls are damaged, one that is cut short, and one of another plan.
    let mut other = bytes.clone();
    other[300] ^= 1;
    place.write(&result, other);
    let told = run(65);
    assert!(
        told.contains(&result) && told.contains("as they were written"),
        "{told}"
    );
    place.write(&result, &bytes[1..]);
    assert!(run(1).contains("which is damaged"));
    place.write(&result, &bytes);
    place.write(&receipt, text.replace("\"key\":\"", "\"key\":\"0"));
    assert!(run(1).contains("which is of another plan"));
    place.write(&receipt, text);
    run(0);
    // Tiles need the angles, too.
    let (tile, _) = all.last().expect("a tile");
    fs::remove_file(place.path(&format!("plan.jsonl.results/{tile}.receipt.json")))
        .expect("removed");
    let result = format!("plan.jsonl.results/{tile}q0.sweep");
    let mut bytes = fs::read(place.path(&result)).expect("a sweep");
    *bytes.last_mut().expect("a byte") ^= 1;
    place.write(&result, bytes);
    let told = place
        .run(&["run", "plan.jsonl", "--task", tile])
        .expect(1)
        .stderr;
    assert!(told.contains("which is damaged"), "{told}");
}

#[test]
fn other_inputs_are_refused_by_name() {
    let place = Place::empty();
    sunny(&place);
    let whole = fs::read(place.path("parts/0.tif")).expect("a file");
    let mut changed = whole.clone();
    *changed.last_mut().expect("a byte") ^= 1;
    place.write("parts/0.tif", changed);
    let run = place.run(&["run", "plan.jsonl", "--task", "0"]).expect(65);
    assert!(
        run.stderr.contains("parts/0.tif") && run.stderr.contains("make the plan again"),
        "{}",
        run.stderr
    );
    // Also where the command is given by itself.
    let job = [
        "sun",
        "all.index",
        "--cells",
        "--from",
        "2025-12-21T11:00",
        "--to",
        "2025-12-21T12:00",
    ];
    let sun = place.run(&[&job[..], &["-o", "a.tif"]].concat()).expect(65);
    assert!(
        sun.stderr.contains("make the index again"),
        "{}",
        sun.stderr
    );
    place.write("parts/0.tif", whole);
    // Another index has other peaks.
    let index = fs::read_to_string(place.path("all.index")).expect("an index");
    place
        .run(&["index", "whole.tif", "-o", "all.index"])
        .expect(0);
    let run = place.run(&["run", "plan.jsonl", "--task", "0"]).expect(65);
    assert!(
        run.stderr.contains("all.index has the checksum"),
        "{}",
        run.stderr
    );
    place.write("all.index", index);
    let run = place.run(&["run", "plan.jsonl", "--task", "0"]).expect(65);
    assert!(
        run.stderr.contains("all.index.peaks: error: it is not of"),
        "{}",
        run.stderr
    );
    let run = place
        .run(&["run", "plan.jsonl", "--task", "north"])
        .expect(2);
    assert!(
        run.stderr.contains("there is no task north"),
        "{}",
        run.stderr
    );
}

#[test]
fn results_keep_their_numbers_where_heights_are_in_feet() {
    let place = Place::empty();
    let size = [96, 64];
    let mut grid = Grid::north_up(size, [600_000.0, 5_340_000.0], 2.0);
    let mut crs = Crs::from_epsg(25_832).expect("a code");
    // Heights of EPSG:6360, in feet.
    crs.directory.extend([4096, 0, 1, 6360]);
    crs.directory[3] += 1;
    grid.crs = Some(crs);
    // A whole tile has no data, and a wall stands beside it.
    let height = |cell: usize| match (cell % 96, cell / 96) {
        (0..=31, 0..=31) => f32::NAN,
        (60, _) => 90.0,
        _ => 3.0,
    };
    let heights: Vec<f32> = (0..96 * 64).map(height).collect();
    let bytes = write("feet.tif".as_ref(), &grid, &heights, &[HEIGHT]).expect("a raster");
    place.write("feet.tif", bytes);
    place
        .run(&["index", "feet.tif", "-o", "feet.index"])
        .expect(0);
    let day = ["--cells", "--from", "2025-06-21", "--to", "2025-06-21"];
    place
        .run(&[&["sun", "feet.tif", "-o", "whole.tif"][..], &day].concat())
        .expect(0);
    let head = [
        "plan",
        "feet.index",
        "-o",
        "sun.jsonl",
        "--tile",
        "32",
        "sun",
    ];
    place.run(&[&head[..], &day].concat()).expect(0);
    place.run(&["run", "sun.jsonl"]).expect(0);
    fs::create_dir_all(place.path("maps")).expect("a folder");
    place
        .run(&["merge", "sun.jsonl", "-o", "sun.tif", "-o", "maps/sun.vrt"])
        .expect(0);
    let numbers = |name: &str| read_numbers(&place.path(name), u64::MAX).expect("a raster");
    let whole = numbers("whole.tif");
    let most = whole.values.iter().copied().fold(0.0, f64::max);
    assert!(
        most > 12.0,
        "hours of a day in June, not of it in feet: {most}"
    );
    let found = numbers("sun.tif");
    assert_eq!(found.grid, whole.grid);
    let same = |(a, b): (&f64, &f64)| a.is_nan() && b.is_nan() || a == b;
    assert!(found.values.iter().zip(&whole.values).all(same));
    assert!(whole.values[0].is_nan());
    let text = fs::read_to_string(place.path("maps/sun.vrt")).expect("a text");
    let tile = place.path("sun.jsonl.results/r0000c0001.tif");
    assert!(
        text.contains(&tile.display().to_string()),
        "names are absolute: {text}"
    );
}

#[test]
fn receipts_name_what_a_task_has_read() {
    let place = Place::empty();
    raster(&place, &mut Rng::new(7));
    place.run(&["index", "parts", "-o", "all.index"]).expect(0);
    let job = ["horizon", "--cells", "--azimuths", "1", "--first", "50"];
    let head = ["plan", "all.index", "-o", "plan.jsonl", "--tile", "16"];
    place.run(&[&head[..], &job].concat()).expect(0);
    // Under another name of the same folder.
    place.run(&["run", "./plan.jsonl"]).expect(0);
    let mut numbers = Vec::new();
    for (id, _) in tasks(&place.path("plan.jsonl")) {
        let receipt = place.json(&format!("plan.jsonl.results/{id}.receipt.json"));
        // Relative or absolute, a file is there once.
        let name = |path: &serde_json::Value| {
            let path = Path::new(path.as_str().expect("a name"));
            path.file_name().expect("a name").to_owned()
        };
        let inputs = receipt["inputs"].as_array().expect("a list").iter();
        let paths: Vec<OsString> = inputs.map(|input| name(&input["path"])).collect();
        let mut once = paths.clone();
        once.sort_unstable();
        once.dedup();
        assert_eq!(once.len(), paths.len(), "{paths:?}");
        numbers.push(paths.len());
    }
    let last = numbers.last().copied();
    assert!(
        last < Some(5),
        "only what the last one has read, not all of the run: {numbers:?}"
    );
}

#[test]
fn shares_of_other_scenes_are_plans_too() {
    let place = Place::empty();
    let job = ["--resolution", "32x18", "--spp", "2"];
    place
        .run(&[&["render", "builtin:city:2000", "-o", "a.png"][..], &job].concat())
        .expect(0);
    let head = [
        "plan",
        "builtin:city:2000",
        "-o",
        "city.jsonl",
        "--tasks",
        "3",
        "render",
    ];
    place.run(&[&head[..], &job].concat()).expect(0);
    run_in_any_order(&place, "city.jsonl", &mut Rng::new(3));
    place.run(&["check", "city.jsonl"]).expect(0);
    place.run(&["merge", "city.jsonl", "-o", "b.png"]).expect(0);
    let [a, b] = ["a.png", "b.png"].map(|name| place.image(name));
    assert!(a == b, "the same picture");
    // Parts of a bake are joined from any folder.
    fs::create_dir(place.path("deep")).expect("a folder");
    place.write(
        "ground.obj",
        "v 0 0 0\nv 9 0 0\nv 0 9 0\nv 1 1 5\nf 1 2 3\nf 1 2 4\n",
    );
    let ao = ["ao", "ground.obj", "-o", "one.ply"];
    place.run(&ao).expect(0);
    let plan = [
        "plan",
        "ground.obj",
        "-o",
        "deep/ao.jsonl",
        "--tasks",
        "2",
        "ao",
    ];
    place.run(&plan).expect(0);
    place
        .run(&["run", "deep/ao.jsonl", "--threads", "1"])
        .expect(0);
    let deep = Command::new(env!("CARGO_BIN_EXE_antumbra"))
        .args(["merge", "ao.jsonl", "-o", "../all.ply"])
        .current_dir(place.path("deep"))
        .output();
    assert!(deep.expect("the program starts").status.success());
    let [one, all] = ["one.ply", "all.ply"].map(|name| fs::read(place.path(name)).expect("a mesh"));
    assert!(one == all);
    // Another scene of the program is another plan, whatever folder plans are in.
    let head = [
        "plan",
        "builtin:city:3000",
        "-o",
        "city.jsonl",
        "--tasks",
        "3",
        "render",
    ];
    place.run(&[&head[..], &job].concat()).expect(0);
    let check = place.run(&["check", "city.jsonl"]).expect(1);
    assert!(check.stderr.contains("3 stale"), "{}", check.stderr);
    fs::create_dir_all(place.path("plans")).expect("a folder");
    let head = [
        "plan",
        "builtin:city:2000",
        "-o",
        "plans/city.jsonl",
        "--tasks",
        "1",
        "render",
    ];
    place.run(&[&head[..], &job].concat()).expect(0);
    place.run(&["run", "plans/city.jsonl"]).expect(0);
    // Two runs of one share need not take as long, and agree.
    let head = ["plan", "builtin:city:2000", "-o", "twice.jsonl"];
    let long = ["render", "--resolution", "200x120", "--spp", "32"];
    place
        .run(&[&head[..], &["--tasks", "1"], &long].concat())
        .expect(0);
    thread::scope(|scope| {
        let run = || place.run(&["run", "twice.jsonl"]).expect(0);
        let other = scope.spawn(run);
        run();
        other.join().expect("the other one ends well");
    });
    place.run(&["check", "twice.jsonl"]).expect(0);
    // A file that the scene includes is one of its inputs.
    let plane =
        "Shape \"trianglemesh\" \"integer indices\" [0 1 2] \"point P\" [-9 -9 5 9 -9 5 0 9 5]";
    place.write("plane.pbrt", plane);
    let scene = "Camera \"perspective\"\nWorldBegin\nLightSource \"infinite\"\nInclude \"plane.pbrt\"\nWorldEnd\n";
    place.write("scene.pbrt", scene);
    let head = [
        "plan",
        "scene.pbrt",
        "-o",
        "scene.jsonl",
        "--tasks",
        "1",
        "render",
    ];
    place.run(&[&head[..], &job].concat()).expect(0);
    place.run(&["run", "scene.jsonl"]).expect(0);
    place.write("plane.pbrt", plane.replace('5', "6"));
    place.run(&[&head[..], &job].concat()).expect(0);
    place.run(&["check", "scene.jsonl"]).expect(1);
    let plan = place
        .run(&["plan", "-", "-o", "other.jsonl", "render"])
        .expect(2);
    assert!(plan.stderr.contains("standard input"), "{}", plan.stderr);
    // How tolerant readers are goes with the plan, and what a machine may take does not.
    let skipped = "Camera \"perspective\"\nWorldBegin\nShape \"hyperboloid\" \"point p1\" [-1 0 -1] \"point p2\" [1 0 1]\nWorldEnd\n";
    place.write("skipped.pbrt", skipped);
    let plan = ["plan", "skipped.pbrt", "-o", "skipped.jsonl", "render"];
    place.run(&[&plan[..], &job].concat()).expect(65);
    let tolerant = [&plan[..], &["--skip-unsupported"], &job].concat();
    place.run(&tolerant).expect(0);
    place.run(&["run", "skipped.jsonl"]).expect(0);
    let limited = place.run(&[&plan[..], &["--max-memory=8G"]].concat());
    assert!(limited.expect(2).stderr.contains("machines differ"));
    // Flags that would write a file of each task are refused, and so are commands without tasks.
    for (more, reason) in [
        (&["render", "--json", "a.json"][..], "--json"),
        (&["info"], "a plan is for"),
    ] {
        let head = ["plan", "builtin:city:2000", "-o", "other.jsonl"];
        let plan = place.run(&[&head[..], more].concat()).expect(2);
        assert!(plan.stderr.contains(reason), "{}", plan.stderr);
    }
}
