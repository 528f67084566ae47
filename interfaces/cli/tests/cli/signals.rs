//! TERM, INT and USR1 at any moment: a run ends within some seconds, with a checkpoint where there are samples.
#![cfg(target_os = "linux")]

use std::fs;
use std::io::Read;
use std::net::TcpListener;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::support::Place;

/// The time that a run may take to end, on a machine that is busy.
const LIMIT: Duration = Duration::from_secs(8);

/// The camera is in a closed white sphere, which no path ever leaves or ends in.
const ENDLESS: &str = r#"
Film "image" "integer xresolution" [16] "integer yresolution" [16]
Sampler "random" "integer pixelsamples" [64]
Integrator "path" "integer maxdepth" [2147483647] "float rrthreshold" [0]
WorldBegin
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [1 1 1]
  Translate 0 0.5 0
  Shape "sphere" "float radius" [0.01]
AttributeEnd
Material "matte" "rgb Kd" [1 1 1]
Shape "sphere" "float radius" [1]
WorldEnd
"#;

fn start(place: &Place, args: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_antumbra"))
        .args(args)
        .current_dir(place.path("."))
        .env_remove("ANTUMBRA_EMBREE")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts")
}

fn send(child: &Child, signal: &str) {
    let kill = Command::new("kill")
        .args([signal, &child.id().to_string()])
        .status();
    assert!(kill.expect("kill starts").success());
}

/// The exit code, which has to come within the limit; `None` after a signal.
fn ends(mut child: Child) -> Option<i32> {
    let since = Instant::now();
    loop {
        if let Some(status) = child.try_wait().expect("a process") {
            return status.code();
        }
        if since.elapsed() > LIMIT {
            child.kill().expect("a process");
            panic!("the run did not end");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn endless_paths_end() {
    let place = Place::empty();
    place.write("l.pbrt", ENDLESS);
    // With a pre-pass, and without.
    for order in ["joint", "simple"] {
        for signal in ["-TERM", "-INT"] {
            let render = [
                "render",
                "l.pbrt",
                "-o",
                "o.exr",
                "--order",
                order,
                "--threads",
                "2",
            ];
            // The file is read in a moment. From then on something is kept, even while the renderer learns.
            let child = start(&place, &render);
            std::thread::sleep(Duration::from_millis(700));
            send(&child, signal);
            let code = ends(child);
            assert_eq!(code, Some(75), "{order} {signal}");
            assert!(place.path("o.exr.checkpoint").exists());
            assert!(!place.path("o.exr").exists());
            let _ = fs::remove_file(place.path("o.exr.checkpoint"));
        }
    }
}

#[test]
fn whatever_moment_a_signal_comes_at_nothing_is_lost() {
    let place = Place::with_room();
    let render = |output: &'static str| {
        let size = ["--resolution", "96x64", "--spp", "256", "--threads", "2"];
        [&["render", "room.pbrt", "-o", output][..], &size].concat()
    };
    place.run(&render("whole.exr")).expect(0);
    // Runs of growing length, each of which goes on where the one before it ended.
    let (mut ended, mut kept) = (0, 0);
    for step in (0..400).step_by(5) {
        let child = start(&place, &render("o.exr"));
        wait_for_handler(&child);
        std::thread::sleep(Duration::from_millis(step));
        if place.path("o.exr").exists() {
            ends(child);
            break;
        }
        send(&child, if step % 10 == 0 { "-TERM" } else { "-INT" });
        match ends(child) {
            Some(0) => break,
            Some(75) => {
                kept += 1;
                assert!(place.path("o.exr.checkpoint").exists(), "after {step} ms");
            }
            // Before the file was read.
            Some(130) => assert!(!place.path("o.exr.checkpoint").exists(), "after {step} ms"),
            other => panic!("after {step} ms: {other:?}"),
        }
        ended += 1;
    }
    assert!(ended > 1 && kept > 0, "{ended} {kept}");
    place.run(&render("o.exr")).expect(0);
    let bytes = |name: &str| fs::read(place.path(name)).expect("a picture");
    assert!(bytes("o.exr") == bytes("whole.exr"), "the bits of one run");
}

#[test]
fn a_second_signal_ends_at_once() {
    let place = Place::with_room();
    for signals in [["-TERM", "-TERM"], ["-INT", "-TERM"], ["-TERM", "-INT"]] {
        // The input never comes, so that the first signal alone takes its time.
        let child = start(&place, &["bench", "builtin:city:3000000", "--out", "b"]);
        std::thread::sleep(Duration::from_millis(300));
        send(&child, signals[0]);
        std::thread::sleep(Duration::from_millis(300));
        let since = Instant::now();
        send(&child, signals[1]);
        assert_eq!(ends(child), Some(130), "{signals:?}");
        assert!(since.elapsed() < Duration::from_secs(2), "{signals:?}");
    }
}

#[test]
fn every_command_ends_while_it_works() {
    let place = Place::empty();
    let big = "builtin:city:3000000";
    for args in [
        &["render", big, "-o", "o.exr", "--resolution", "64x64"][..],
        &["info", big],
        &[
            "study",
            big,
            "--out",
            "s",
            "--resolution",
            "64x64",
            "--spp",
            "1",
        ],
        &["bench", big],
    ] {
        let child = start(&place, args);
        std::thread::sleep(Duration::from_millis(1500));
        send(&child, "-TERM");
        let code = ends(child);
        assert!(matches!(code, Some(75 | 130)), "{args:?}: {code:?}");
    }
}

/// A viewer that takes a little now and then holds up neither the end of a run nor a signal.
#[test]
fn a_slow_display_server_holds_up_no_signal() {
    let place = Place::with_room();
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    std::thread::spawn(move || {
        for mut stream in listener.incoming().flatten() {
            let mut some = vec![0; 16 << 10];
            while stream.read(&mut some).is_ok_and(|count| count > 0) {
                std::thread::sleep(Duration::from_millis(50));
            }
        }
    });
    let args = ["render", "room.pbrt", "-o", "o.exr", "--resolution"];
    let more = ["2048x1500", "--spp", "1", "--display-server", &address];
    for signal in [None, Some("-TERM")] {
        let child = start(&place, &[&args[..], &more].concat());
        // All of the picture would take the viewer minutes.
        while !place.path("o.exr").exists() {
            std::thread::sleep(Duration::from_millis(20));
        }
        if let Some(signal) = signal {
            send(&child, signal);
        }
        assert_eq!(ends(child), Some(0), "{signal:?}: the picture is complete");
        fs::remove_file(place.path("o.exr")).expect("a picture");
    }
}

/// A file that cannot be written when it is known is reported once, and the picture is there.
#[test]
fn an_order_that_cannot_be_written_is_said_once() {
    let place = Place::with_room();
    let args = ["render", "room.pbrt", "-o", "o.exr"];
    let run = place.run(&[&args[..], &["--save-order", "/dev/full"]].concat());
    assert_eq!(run.code, 1);
    assert_eq!(run.stderr.matches("/dev/full").count(), 1, "{}", run.stderr);
    assert!(place.path("o.exr").exists());
}

/// Waits until a program catches USR1, where the system tells; some time elsewhere.
fn wait_for_handler(child: &Child) {
    let status = format!("/proc/{}/status", child.id());
    for _ in 0..500 {
        std::thread::sleep(Duration::from_millis(10));
        let Ok(text) = fs::read_to_string(&status) else {
            return;
        };
        let caught = text.lines().find_map(|line| line.strip_prefix("SigCgt:"));
        let caught = caught.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
        // USR1 is signal 10, and signals begin at 1.
        if caught.is_some_and(|mask| mask >> 9 & 1 == 1) {
            return;
        }
    }
}

#[test]
fn usr1_never_ends_a_run() {
    let place = Place::with_room();
    for wait in [0, 2, 5, 20, 40] {
        let child = start(&place, &["render", "room.pbrt", "-o", "o.exr"]);
        // Until the program itself runs, the system answers.
        wait_for_handler(&child);
        std::thread::sleep(Duration::from_millis(wait));
        send(&child, "-USR1");
        assert_eq!(ends(child), Some(0), "after {wait} ms");
    }
}
