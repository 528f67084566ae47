//! Tables, weather files and parts: what they may be, and what they may not do.

use std::fs;
use std::process::Command;

use antumbra_bake::Part;
use serde_json::{Value, json};
use xxhash_rust::xxh3::xxh3_64;

use crate::support::Place;

/// A level square of 20 m with a wall of 2 m in the middle.
const WALL: &str = "v -10 -10 0\nv 10 -10 0\nv 10 10 0\nv -10 10 0\nf 1 2 3 4\n\
    v 0 -4 0\nv 0 4 0\nv 0 4 2\nv 0 -4 2\nf 5 6 7 8\n";

const NOON: [&str; 8] = [
    "--lat",
    "48.2",
    "--lon",
    "16.4",
    "--from",
    "2025-06-21T12:00",
    "--to",
    "2025-06-21T13:00",
];

fn place() -> Place {
    let place = Place::empty();
    place.write("wall.obj", WALL);
    place.write("a.csv", "x,y,z\n-2,0,0.5\n-2,1,0.5\n2,0,0.5\n");
    place
}

fn bytes(place: &Place, name: &str) -> Vec<u8> {
    fs::read(place.path(name)).expect("a file")
}

/// Refused with this code and hint, and nothing was written.
fn refuse(place: &Place, args: &[&str], code: i32, hints: &[&str]) {
    let before = place.files();
    let run = place.run(args).expect(code);
    for hint in hints {
        assert!(run.stderr.contains(hint), "{args:?}: {}", run.stderr);
    }
    assert_eq!(place.files(), before, "{args:?}");
}

#[test]
fn tables_that_speak_against_themselves_are_refused_with_their_place() {
    let place = place();
    for (table, hints) in [
        ("x;y;z\n1,5;2,5;3,5\n", ["t.csv:2", "decimal comma"]),
        ("x,x,y,z\n1,2,3,4\n", ["t.csv:1", "column x twice"]),
        (
            "x,y,z\n1,2,3\n1,5,2,5,3,5\n",
            ["t.csv:3", "found 6 columns"],
        ),
        ("1,2,3,4,5,6,7,8\n", ["t.csv:1", "8 columns"]),
    ] {
        place.write("t.csv", table);
        let args = ["visible", "wall.obj", "t.csv", "-o", "o.csv"];
        refuse(&place, &args, 65, &hints);
        let args = ["sun", "wall.obj", "--sensors", "t.csv", "-o", "o.csv"];
        refuse(&place, &[&args[..], &NOON].concat(), 65, &hints);
    }
}

#[cfg(unix)]
#[test]
fn devices_and_pipes_are_refused_at_once() {
    let place = place();
    for name in ["pipe", "m.ply.checkpoint"] {
        let made = Command::new("mkfifo").arg(place.path(name)).status();
        assert!(made.expect("mkfifo starts").success());
    }
    for endless in ["pipe", "/dev/zero", "/dev/full"] {
        let sun = ["sun", "wall.obj", "-o", "o.csv"];
        let sensors = [&sun[..], &["--sensors", endless], &NOON].concat();
        let weather = [&sun[..], &["--vertices", "--epw", endless]].concat();
        for args in [
            &sensors[..],
            &weather,
            &["visible", "wall.obj", endless, "-o", "o.csv"],
            &["visible", "wall.obj", "a.csv", endless, "-o", "o.csv"],
            &["merge", endless, "-o", "o.exr"],
        ] {
            refuse(&place, args, 65, &[endless, "no regular file"]);
        }
    }
    let args = ["ao", "wall.obj", "-o", "m.ply"];
    refuse(&place, &args, 65, &["m.ply.checkpoint", "left as it is"]);
}

#[test]
fn tables_and_weather_larger_than_memory_allows_are_refused() {
    let place = place();
    let file = fs::File::create(place.path("huge.csv")).expect("a file");
    file.set_len(1 << 34).expect("a file with a hole");
    let limit = ["--max-memory", "64M"];
    let args = ["visible", "wall.obj", "huge.csv", "-o", "o.csv"];
    let hints = ["huge.csv", "--max-memory"];
    refuse(&place, &[&args[..], &limit].concat(), 65, &hints);
    let args = [
        "sun",
        "wall.obj",
        "--vertices",
        "--epw",
        "huge.csv",
        "-o",
        "o.csv",
    ];
    refuse(&place, &[&args[..], &limit].concat(), 65, &hints);
}

/// A weather file of the 21st of June.
fn weather(longitude: &str, hours: u32) -> String {
    let mut text = format!(
        "LOCATION,Wien,-,AUT,Test,110350,48.2,{longitude},1.0,200.0\nDATA PERIODS,1,1,Data,Sunday,6/21,6/21\n"
    );
    for hour in 1..=hours {
        text += &format!("2019,6,21,{hour},60,f,20,10,50,101000,0,0,300,0,500,90,0,0,0\n");
    }
    text
}

#[test]
fn weather_that_speaks_against_itself_is_refused_or_warned_about() {
    let place = place();
    let args = [
        "sun",
        "wall.obj",
        "--vertices",
        "--epw",
        "w.epw",
        "-o",
        "o.csv",
    ];
    place.write("w.epw", weather("16.4", 20));
    let hints = ["w.epw:22", "20 records", "6/21 to 6/21", "24"];
    refuse(&place, &args, 65, &hints);

    place.write("w.epw", weather("16.4", 24));
    let run = place.run(&args).expect(0);
    assert!(!run.stderr.contains("warning"), "{}", run.stderr);
    let run = place
        .run(&[&args[..], &["--timezone", "-7"]].concat())
        .expect(0);
    assert!(run.stderr.contains("8.1 hours apart"), "{}", run.stderr);
    place.write("w.epw", weather("116.37", 24));
    let run = place.run(&args).expect(0);
    assert!(run.stderr.contains("warning: UTC+1"), "{}", run.stderr);
    assert!(run.stderr.contains("6.8 hours apart"), "{}", run.stderr);
    // A day ahead, as on the islands of Kiribati.
    place.write("w.epw", weather("-157.4", 24));
    let run = place
        .run(&[&args[..], &["--timezone", "14"]].concat())
        .expect(0);
    assert!(!run.stderr.contains("warning"), "{}", run.stderr);
    place.write(
        "w.epw",
        weather("16.4", 24).replace(",500,90,", ",9999,90,"),
    );
    let run = place.run(&args).expect(0);
    assert!(run.stderr.contains("24 of 24 records"), "{}", run.stderr);
}

/// A part with something else in its identity, and chunks of so many bytes.
fn forged(part: &[u8], change: impl Fn(&mut Value), chunk: Option<usize>) -> Vec<u8> {
    let mut out = Part::MAGIC.to_vec();
    let mut rest = &part[Part::MAGIC.len()..];
    let mut is_first = true;
    while !rest.is_empty() {
        let word = |at: usize| u64::from_le_bytes(rest[at..at + 8].try_into().expect("8 bytes"));
        let (number, length) = (word(0), word(8) as usize);
        let mut bytes = rest[24..24 + length].to_vec();
        rest = &rest[24 + length..];
        if std::mem::take(&mut is_first) {
            let mut identity: Value = serde_json::from_slice(&bytes).expect("JSON");
            change(&mut identity);
            bytes = serde_json::to_vec(&identity).expect("JSON");
        } else if let Some(chunk) = chunk {
            bytes.truncate(chunk);
        }
        for word in [number, bytes.len() as u64, xxh3_64(&bytes) ^ number] {
            out.extend(word.to_le_bytes());
        }
        out.extend(bytes);
    }
    out
}

/// An argument as it stands in the identity of a part.
#[cfg(unix)]
fn argument(text: &str) -> Value {
    json!({ "Unix": text.as_bytes() })
}

#[cfg(not(unix))]
fn argument(text: &str) -> Value {
    json!({ "Windows": text.encode_utf16().collect::<Vec<_>>() })
}

#[test]
fn parts_of_strangers_write_nothing_that_was_not_asked_for() {
    let place = place();
    let job = ["visible", "wall.obj", "a.csv"];
    place
        .run(&[&job[..], &["-o", "w.csv", "--lines", "w.ply"]].concat())
        .expect(0);
    place
        .run(&[&job[..], &["--shard", "0/1", "-o", "p.part"]].concat())
        .expect(0);
    let part = bytes(&place, "p.part");

    place.write("thesis.csv", "years of work\n");
    let add = |identity: &mut Value| {
        let command = identity["command"].as_array_mut().expect("a list");
        command.retain(|found| ![argument("--shard"), argument("0/1")].contains(found));
        command.extend(["--lines", "thesis.csv"].map(argument));
    };
    place.write("evil.part", forged(&part, add, None));
    place.run(&["merge", "evil.part", "-o", "m.csv"]).expect(0);
    assert_eq!(bytes(&place, "thesis.csv"), b"years of work\n");
    assert_eq!(bytes(&place, "m.csv"), bytes(&place, "w.csv"));

    // Lines are asked for where they are written.
    place
        .run(&["merge", "p.part", "-o", "m.csv", "--lines", "m.ply"])
        .expect(0);
    assert_eq!(bytes(&place, "m.ply"), bytes(&place, "w.ply"));
    let shard = ["--shard", "0/1", "-o", "q.part", "--lines", "q.ply"];
    refuse(&place, &[&job[..], &shard].concat(), 2, &["--lines"]);
    let merge = ["merge", "p.part", "-o", "x.csv", "--lines", "a.csv"];
    refuse(&place, &merge, 2, &["destroy"]);

    for shard in [[0, 0], [1, 1], [5, 2]] {
        let change = |identity: &mut Value| identity["shard"] = json!(shard);
        place.write("evil.part", forged(&part, change, None));
        refuse(
            &place,
            &["merge", "evil.part", "-o", "x.csv"],
            65,
            &["damaged"],
        );
    }
}

#[test]
fn checkpoints_that_do_not_fit_are_refused_and_stay() {
    let place = place();
    let job = ["visible", "wall.obj", "a.csv"];
    place
        .run(&[&job[..], &["--shard", "0/1", "-o", "p.part"]].concat())
        .expect(0);
    let short = forged(&bytes(&place, "p.part"), |_| (), Some(1));
    place.write("o.csv.checkpoint", &short);
    let args = [&job[..], &["-o", "o.csv"]].concat();
    refuse(&place, &args, 65, &["do not fit", "--restart"]);
    assert_eq!(bytes(&place, "o.csv.checkpoint"), short);
    place.run(&[&args[..], &["--restart"]].concat()).expect(0);
    let mut left = place.files();
    left.retain(|name| name.ends_with("checkpoint"));
    assert!(left.is_empty(), "{left:?}");
}

/// A limit on the size of files fails as a full disk does: in the middle of a write.
#[cfg(unix)]
#[test]
fn a_full_disk_keeps_the_checkpoint_of_a_bake() {
    let place = place();
    let job = ["ao", "wall.obj", "--samples", "1000000", "-o"];
    place.run(&[&job[..], &["whole.ply"]].concat()).expect(0);
    place
        .run(&[&job[..], &["p.part", "--shard", "0/1"]].concat())
        .expect(0);
    let part = bytes(&place, "p.part");
    let ends = record_ends(&part);
    assert!(ends.len() > 2, "two chunks at least: {ends:?}");
    // With the first chunk, and with the second one cut short.
    for kept in [ends[1], ends[2] - 1] {
        place.write("o.ply.checkpoint", &part[..kept]);
        let before = place.files();
        let limited = Command::new("sh")
            .args(["-c", "trap '' XFSZ; ulimit -f 0; exec \"$0\" \"$@\""])
            .arg(env!("CARGO_BIN_EXE_antumbra"))
            .args(job)
            .arg("o.ply")
            .current_dir(place.path("."))
            .output()
            .expect("a shell");
        let said = String::from_utf8_lossy(&limited.stderr);
        assert_eq!(limited.status.code(), Some(1), "{said}");
        assert!(said.contains("cannot write o.ply"), "{said}");
        assert!(said.contains("items were done before"), "{said}");
        assert_eq!(place.files(), before);
        assert_eq!(bytes(&place, "o.ply.checkpoint"), part[..kept]);

        let run = place.run(&[&job[..], &["o.ply"]].concat()).expect(0);
        let said = &run.stderr;
        assert!(said.contains("items were done before"), "{said}");
        assert!(bytes(&place, "o.ply") == bytes(&place, "whole.ply"));
        assert!(!place.path("o.ply.checkpoint").exists());
        fs::remove_file(place.path("o.ply")).expect("a file");
    }
}

/// Ends of the records of a part: of its identity, and of its chunks.
#[cfg(unix)]
fn record_ends(part: &[u8]) -> Vec<usize> {
    let mut at = Part::MAGIC.len();
    let mut ends = Vec::new();
    while at < part.len() {
        let length: [u8; 8] = part[at + 8..at + 16].try_into().expect("8 bytes");
        at += 24 + u64::from_le_bytes(length) as usize;
        ends.push(at);
    }
    ends
}

#[cfg(target_os = "linux")]
#[test]
fn names_may_hold_any_bytes_and_shards_need_a_file() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

    let place = place();
    let odd = OsStr::from_bytes(b"\xff\xfe-\x01.obj");
    let folder = place.path("");
    fs::write(folder.join(odd), WALL).expect("a file");
    let run = |args: &[&OsStr]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_antumbra"));
        let done = command.args(args).current_dir(&folder).output();
        let done = done.expect("the program starts");
        assert!(
            done.status.success(),
            "{}",
            String::from_utf8_lossy(&done.stderr)
        );
    };
    let ao = ["ao", "-o", "whole.ply"].map(OsStr::new);
    run(&[&ao[..], &[odd]].concat());
    let shard = ["ao", "--shard", "0/1", "-o", "p.part"].map(OsStr::new);
    run(&[&shard[..], &[odd]].concat());
    run(&["merge", "p.part", "-o", "joined.ply"].map(OsStr::new));
    assert_eq!(bytes(&place, "joined.ply"), bytes(&place, "whole.ply"));

    let run = place.run(&["ao", "-", "--shard", "0/1", "-o", "s.part"]);
    assert!(run.expect(2).stderr.contains("standard input"));
}

#[test]
fn grids_are_found_however_high_a_level_mesh_lies() {
    let place = place();
    for (height, size, spacing) in [(1e6, 5.0, "1"), (3000.0, 0.05, "0.01"), (-4e5, 5.0, "1")] {
        let corner = |x: f64, y: f64| format!("v {} {} {height}\n", size * x, size * y);
        let mut mesh: String = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| corner(x, y))
            .concat();
        mesh += "f 1 2 3 4\n";
        place.write("level.obj", mesh);
        let args = [
            "sun",
            "level.obj",
            "--up",
            "z",
            "--grid",
            spacing,
            "-o",
            "o.csv",
        ];
        place.run(&[&args[..], &NOON].concat()).expect(0);
        let rows = fs::read_to_string(place.path("o.csv")).expect("a table");
        assert_eq!(rows.lines().count(), 101, "at {height}");
    }
}
