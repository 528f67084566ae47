//! Looking at renderings: tev, the page of `view`, what is said meanwhile, and the standard input.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};

#[cfg(target_os = "linux")]
use antumbra_image::Image;

use crate::support::Place;

fn start(place: &Place, args: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_antumbra"))
        .args(args)
        .current_dir(place.path("."))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts")
}

#[test]
fn a_display_server_gets_the_picture_and_changes_no_bit() {
    let place = Place::with_room();
    place
        .run(&["render", "room.pbrt", "-o", "plain.exr"])
        .expect(0);
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    let server = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        let (mut stream, _) = listener.accept().expect("the program");
        stream.read_to_end(&mut bytes).expect("messages");
        bytes
    });
    let args = ["render", "room.pbrt", "-o", "shown.exr", "--display-server"];
    place.run(&[&args[..], &[&address]].concat()).expect(0);
    let bytes = server.join().expect("a server");
    assert_eq!(bytes[4], 4, "an image is created first");
    assert!(bytes[6..].starts_with(b"room ("));
    // The last message holds the blue channel of the only block.
    let picture = place.image("shown.exr");
    let values = picture.pixels().iter().map(|pixel| pixel[2].to_le_bytes());
    let blue: Vec<u8> = values.flatten().collect();
    assert!(bytes.ends_with(&blue));
    assert!(picture == place.image("plain.exr"));
}

#[test]
fn a_display_server_that_is_absent_costs_nothing() {
    let place = Place::with_room();
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    drop(listener);
    let args = ["render", "room.pbrt", "-o", "a.exr", "--display-server"];
    let run = place.run(&[&args[..], &[&address]].concat()).expect(0);
    assert!(
        run.stderr.contains("did not get all of the picture"),
        "{}",
        run.stderr
    );
    assert!(place.path("a.exr").exists());
    let run = place
        .run(&[&args[..], &["127.0.0.1:port"]].concat())
        .expect(2);
    assert!(run.stderr.contains("--display-server"), "{}", run.stderr);
}

#[test]
fn a_preview_is_gone_when_the_image_is_there() {
    let place = Place::with_room();
    let args = ["render", "room.pbrt", "-o", "a.exr", "--preview"];
    place.run(&args).expect(0);
    assert_eq!(place.files(), ["a.exr", "room.pbrt", "thing.ply"]);
}

/// Answer to a request at an address, as text.
#[cfg(target_os = "linux")]
fn get(address: &str, path: &str, method: &str) -> String {
    String::from_utf8_lossy(&get_bytes(address, path, method)).into_owned()
}

/// Answer to a request at an address.
#[cfg(target_os = "linux")]
fn get_bytes(address: &str, path: &str, method: &str) -> Vec<u8> {
    let rest = address.strip_prefix("http://").expect("an address");
    let (host, secret) = rest.split_once('/').expect("a path");
    let mut stream = TcpStream::connect(host).expect("a server");
    write!(
        stream,
        "{method} /{secret}{path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"
    )
    .expect("sent");
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).expect("an answer");
    answer
}

/// Ends a program by Ctrl-C.
#[cfg(target_os = "linux")]
fn interrupt(child: &Child) {
    let kill = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(kill.expect("kill starts").success());
}

#[cfg(target_os = "linux")]
#[test]
fn view_serves_a_page_until_it_is_told_to_end() {
    let place = Place::with_room();
    for by_page in [true, false] {
        let mut child = start(&place, &["view", "room.pbrt"]);
        let mut address = String::new();
        let stdout = child.stdout.take().expect("a pipe");
        BufReader::new(stdout)
            .read_line(&mut address)
            .expect("an address");
        let page = get(address.trim(), "", "GET");
        assert!(page.starts_with("HTTP/1.1 200 OK"), "{page}");
        assert!(page.contains("<canvas"));
        // There is a picture before long.
        while !get(address.trim(), "picture.png", "GET").starts_with("HTTP/1.1 200 OK") {
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        if by_page {
            get(address.trim(), "quit", "POST");
        } else {
            interrupt(&child);
        }
        assert_eq!(child.wait().expect("an end").code(), Some(0));
    }
    assert_eq!(place.files(), ["room.pbrt", "thing.ply"]);
}

/// Flags of camera, film and light are those of `render`.
#[cfg(target_os = "linux")]
#[test]
fn view_takes_the_camera_flags_of_render() {
    let place = Place::with_room();
    let flags = [
        &[
            "thing.ply",
            "--spp",
            "3",
            "--resolution",
            "40x30",
            "--up",
            "z",
        ][..],
        &["--camera", "LookAt 1 -4 2  0 0 0.5  0 0 1", "--fov", "40"],
        &["--crop", "4,5,30x20", "--max-depth", "2", "--sun", "100,30"],
        &["--filter", "box", "--sampler", "halton"],
    ]
    .concat();
    place
        .run(&[&["render", "-o", "a.exr"], &flags[..]].concat())
        .expect(0);
    let expected = place.image("a.exr");
    let mut child = start(&place, &[&["view"], &flags[..]].concat());
    let mut address = String::new();
    let stdout = child.stdout.take().expect("a pipe");
    BufReader::new(stdout)
        .read_line(&mut address)
        .expect("an address");
    let begun = std::time::Instant::now();
    loop {
        let answer = get_bytes(address.trim(), "picture.exr", "GET");
        let body = answer.windows(4).position(|four| four == b"\r\n\r\n");
        let body = &answer[body.expect("a head") + 4..];
        if Image::parse(body, "picture.exr").is_ok_and(|image| image == expected) {
            break;
        }
        assert!(begun.elapsed().as_secs() < 60, "another picture");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    get(address.trim(), "quit", "POST");
    assert_eq!(child.wait().expect("an end").code(), Some(0));
}

#[test]
fn view_ends_at_once_where_there_is_no_scene() {
    let place = Place::empty();
    place.write("bad.pbrt", "WorldBegin\nShape \"spere\"\nWorldEnd\n");
    let run = place.run(&["view", "bad.pbrt"]).expect(65);
    assert!(run.stderr.contains("bad.pbrt:2"), "{}", run.stderr);
    assert!(run.stdout.starts_with("http://127.0.0.1:"));
    let taken = TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = taken.local_addr().expect("an address").port().to_string();
    let run = place.run(&["view", "bad.pbrt", "--port", &port]).expect(1);
    assert!(run.stderr.contains(&port), "{}", run.stderr);
}

#[test]
fn a_scene_comes_from_the_standard_input() {
    let place = Place::with_room();
    let text = std::fs::read(place.path("room.pbrt")).expect("a scene");
    place
        .run(&["render", "room.pbrt", "-o", "file.exr"])
        .expect(0);
    let given = |args: &[&str], text: &[u8]| {
        let mut child = start(&place, args);
        let mut input = child.stdin.take().expect("a pipe");
        input.write_all(text).expect("sent");
        drop(input);
        child.wait_with_output().expect("an end")
    };
    let run = given(&["render", "-", "-o", "stdin.exr"], &text);
    assert!(run.status.success(), "{run:?}");
    assert!(place.image("stdin.exr") == place.image("file.exr"));
    // And to the standard output.
    let run = given(&["render", "-", "-o", "-"], &text);
    let file = std::fs::read(place.path("file.exr")).expect("a file");
    assert!(run.stdout == file);
    let run = given(&["render", "-", "-o", "x.exr"], b"Shape");
    assert_eq!(run.status.code(), Some(65));
    let words = String::from_utf8(run.stderr).expect("text");
    assert!(words.contains("stdin:1:"), "{words}");
}

#[test]
fn pictures_go_to_the_standard_output() {
    let place = Place::with_room();
    place.run(&["render", "room.pbrt", "-o", "a.exr"]).expect(0);
    for (args, start) in [
        (["image", "convert", "a.exr", "-"], &b"\x76\x2f\x31\x01"[..]),
        (["image", "heatmap", "a.exr", "-"], &b"\x89PNG"[..]),
    ] {
        let run = start_and_wait(&place, &args);
        assert!(run.starts_with(start), "{args:?}");
    }
}

fn start_and_wait(place: &Place, args: &[&str]) -> Vec<u8> {
    let output = start(place, args).wait_with_output().expect("an end");
    assert!(output.status.success(), "{output:?}");
    output.stdout
}

#[test]
fn quiet_says_errors_alone_and_verbose_says_more() {
    let place = Place::with_room();
    let said = |flags: &[&str], code: i32| {
        let args = [&["render", "room.pbrt", "-o", "a.exr"], flags].concat();
        place.run(&args).expect(code).stderr
    };
    let usual = said(&[], 0);
    assert!(usual.contains("wrote a.exr"), "{usual}");
    assert_eq!(said(&["-q"], 0), "");
    assert!(said(&["--noise", "90%"], 0).contains("of the mean"));
    assert_eq!(said(&["-q", "--noise", "90%"], 0), "");
    let verbose = said(&["--verbose"], 0);
    assert!(verbose.lines().count() > usual.lines().count(), "{verbose}");
    assert!(verbose.contains("collapse learned"), "{verbose}");
    let run = place.run(&["-q", "render", "none.pbrt"]).expect(65);
    assert!(run.stderr.contains("none.pbrt"), "{}", run.stderr);
    place.run(&["render", "room.pbrt", "-q", "-v"]).expect(2);
    // No colours and no cursor movements where nobody looks.
    assert!(!verbose.contains('\u{1b}') && !verbose.contains('\r'));
}

#[test]
fn the_names_of_flags_are_the_same_in_all_commands() {
    let place = Place::empty();
    let help = |command: &str| place.run(&[command, "--help"]).expect(0).stdout;
    let flags = ["--builder", "--order", "--width", "--preset", "--collapse"];
    for command in ["render", "view", "study", "bench"] {
        let help = help(command);
        for flag in flags {
            assert!(help.contains(&format!("{flag} <")), "{command}: {flag}");
        }
    }
    for command in ["study", "bench"] {
        assert!(help(command).contains("--training-rays <"), "{command}");
    }
    for command in ["render", "study"] {
        assert!(help(command).contains("--resume"), "{command}");
    }
}

#[test]
fn negative_numbers_are_named_as_what_they_are() {
    let place = Place::with_room();
    for flag in ["--spp", "--seed"] {
        let run = place.run(&["render", "room.pbrt", flag, "-3"]).expect(2);
        assert!(run.stderr.contains("-3"), "{}", run.stderr);
        assert!(!run.stderr.contains("-- -3"), "{}", run.stderr);
    }
}
