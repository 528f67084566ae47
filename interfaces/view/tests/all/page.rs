//! The page's server, by raw requests: who may send requests, what is sent, and what a wish does.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use antumbra_image::Image;
use antumbra_render::{World, render};
use antumbra_view::Server;

use crate::support::{options, scene};

/// Port and secret path of an address.
pub fn parts(address: &str) -> (u16, String) {
    let rest = address.strip_prefix("http://127.0.0.1:").expect("loopback");
    let (port, path) = rest.split_once('/').expect("a path");
    (port.parse().expect("a port"), format!("/{path}"))
}

fn connect(port: u16) -> TcpStream {
    let stream = TcpStream::connect(("127.0.0.1", port)).expect("a connection");
    let patience = Some(Duration::from_secs(60));
    stream.set_read_timeout(patience).expect("a time-out");
    stream
}

/// Status line, headers and body of the answer to one request.
pub fn ask(
    port: u16,
    method: &str,
    path: &str,
    host: &str,
    body: &str,
) -> (String, String, Vec<u8>) {
    let mut stream = connect(port);
    let length = body.len();
    write!(
        stream,
        "{method} {path} HTTP/1.1\r\nHost: {host}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{body}"
    )
    .expect("sent");
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).expect("an answer");
    let end = answer.windows(4).position(|four| four == b"\r\n\r\n");
    let end = end.expect("a head");
    let head = String::from_utf8(answer[..end].to_vec()).expect("text");
    let (status, headers) = head.split_once("\r\n").expect("headers");
    (
        status.to_owned(),
        headers.to_owned(),
        answer[end + 4..].to_vec(),
    )
}

/// A message of the stream: kind and body.
type Message = (u8, Vec<u8>);

/// The stream of one page.
pub struct Viewer {
    stream: TcpStream,
    pub status: serde_json::Value,
    /// Numbers of the last frame.
    frame: Vec<i32>,
    tiles: usize,
}

impl Viewer {
    pub fn open(port: u16, path: &str) -> Self {
        let mut stream = connect(port);
        write!(
            stream,
            "GET {path}stream HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n"
        )
        .expect("sent");
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            let mut byte = [0];
            stream.read_exact(&mut byte).expect("a head");
            head.push(byte[0]);
        }
        Self {
            stream,
            status: serde_json::Value::Null,
            frame: Vec::new(),
            tiles: 0,
        }
    }

    /// The next message. `None` at the end.
    fn next(&mut self) -> Option<Message> {
        let mut length = [0; 4];
        self.stream.read_exact(&mut length).ok()?;
        let mut body = vec![0; u32::from_le_bytes(length) as usize];
        self.stream.read_exact(&mut body).expect("a whole message");
        let kind = body.remove(0);
        match kind {
            b'S' => self.status = serde_json::from_slice(&body).expect("JSON"),
            b'F' => {
                let numbers = body.chunks_exact(4);
                let number = |bytes: &[u8]| i32::from_le_bytes(bytes.try_into().expect("four"));
                self.frame = numbers.map(number).collect();
            }
            b'T' => self.tiles += 1,
            kind => panic!("a message of kind {kind}"),
        }
        Some((kind, body))
    }

    /// Reads until the status says so.
    pub fn until(&mut self, holds: impl Fn(&serde_json::Value) -> bool) {
        while !holds(&self.status) {
            self.next().expect("the stream goes on");
        }
    }

    fn until_finished(&mut self, wish: u64) {
        self.until(|status| status["phase"] == "finished" && status["wish"] == wish);
    }
}

/// A server that renders a town while `look` sends requests.
fn with_server(spp: u32, look: impl FnOnce(u16, &str) + Send) {
    let server = Server::bind(0, "town").expect("a server");
    let (port, path) = parts(&server.address());
    let scene = scene([64, 48]);
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let engine = scope.spawn(|| {
            let world = World::new(&scene).expect("a valid scene");
            let cancelled = || done.load(Ordering::Relaxed);
            server.run(&scene, world, &options(spp), &cancelled)
        });
        // Whatever happens, the engine is to end.
        let looked = scope.spawn(move || look(port, &path)).join();
        done.store(true, Ordering::Relaxed);
        engine.join().expect("no panic").expect("no error");
        if let Err(panic) = looked {
            std::panic::resume_unwind(panic);
        }
    });
}

#[test]
fn only_the_secret_address_is_answered() {
    with_server(1, |port, path| {
        let host = format!("127.0.0.1:{port}");
        let (status, headers, body) = ask(port, "GET", path, &host, "");
        assert_eq!(status, "HTTP/1.1 200 OK");
        assert!(headers.contains("default-src 'none'"));
        let page = String::from_utf8(body).expect("text");
        assert!(page.starts_with("<!doctype html>"));
        for network in ["http://", "https://", "src=\"//", "@import"] {
            assert!(!page.contains(network), "{network}");
        }
        let wrong = format!("/{}/", "0".repeat(path.len() - 2));
        for other in ["/", "/favicon.ico", &wrong, &path[..path.len() - 2], ""] {
            let target = if other.is_empty() { "*" } else { other };
            let (status, ..) = ask(port, "GET", target, &host, "");
            assert_eq!(status, "HTTP/1.1 404 Not Found", "{other}");
        }
        let (status, ..) = ask(port, "GET", &format!("{path}secret"), &host, "");
        assert_eq!(status, "HTTP/1.1 404 Not Found");
        let (status, ..) = ask(port, "GET", path, "evil.example", "");
        assert_eq!(status, "HTTP/1.1 403 Forbidden");
        let localhost = format!("localhost:{port}");
        let (status, ..) = ask(port, "GET", path, &localhost, "");
        assert_eq!(status, "HTTP/1.1 200 OK");
        let (status, ..) = ask(port, "POST", &format!("{path}wish"), &host, "{}{}");
        assert_eq!(status, "HTTP/1.1 400 Bad Request");
    });
}

#[test]
fn the_picture_that_is_saved_is_that_of_render() {
    with_server(8, |port, path| {
        let host = format!("127.0.0.1:{port}");
        let mut viewer = Viewer::open(port, path);
        viewer.until_finished(0);
        assert!(viewer.tiles > 1);
        let (status, headers, body) = ask(port, "GET", &format!("{path}picture.exr"), &host, "");
        assert_eq!(status, "HTTP/1.1 200 OK");
        assert!(headers.contains("filename=\"town-8spp.exr\""), "{headers}");
        let saved = Image::parse(&body, "town.exr").expect("a picture");
        let scene = scene([64, 48]);
        let world = World::new(&scene).expect("a valid scene");
        let expected = render(&world, &options(8), &()).expect("a picture").image;
        assert!(saved == expected);
        let (status, _, body) = ask(port, "GET", &format!("{path}picture.png?ev=2"), &host, "");
        assert_eq!(status, "HTTP/1.1 200 OK");
        assert!(body.starts_with(b"\x89PNG"));
    });
}

#[test]
fn wishes_move_the_camera_for_all_viewers() {
    with_server(4, |port, path| {
        let host = format!("127.0.0.1:{port}");
        let wish = |body: &str| ask(port, "POST", &format!("{path}wish"), &host, body);
        let (mut one, mut two) = (Viewer::open(port, path), Viewer::open(port, path));
        one.until_finished(0);
        let home = one.status["look"].clone();
        let mut moved = home.clone();
        moved["eye"][1] = (moved["eye"][1].as_f64().expect("a number") + 1.0).into();
        let (status, _, body) = wish(&format!("{{\"look\": {moved}}}"));
        assert_eq!(status, "HTTP/1.1 200 OK");
        assert_eq!(body, b"1");
        for viewer in [&mut one, &mut two] {
            viewer.until_finished(1);
            assert_eq!(viewer.status["look"]["eye"][1], moved["eye"][1]);
            assert_eq!(viewer.frame[1], 1, "the last frame is in full size");
        }
        // A part of the picture.
        wish("{\"crop\": [0.25, 0.75, 0.5, 1.0], \"home\": true}");
        one.until_finished(2);
        assert_eq!(one.status["look"], home);
        assert_eq!(one.frame[4..8], [16, 24, 48, 48]);
        // Stop, refuse, go on.
        wish("{\"stopped\": true}");
        one.until(|status| status["phase"] == "stopped");
        let (status, ..) = wish("{\"crop\": [1, 0, 0, 1]}");
        assert_eq!(status, "HTTP/1.1 400 Bad Request");
        wish("{\"whole\": true}");
        one.until_finished(4);
    });
}

#[test]
fn maps_show_fewer_tests_after_learning() {
    with_server(16, |port, path| {
        let host = format!("127.0.0.1:{port}");
        let wish = |body: &str| ask(port, "POST", &format!("{path}wish"), &host, body);
        let mut viewer = Viewer::open(port, path);
        viewer.until(|status| status["learned"] == true);
        wish("{\"mode\": \"before\"}");
        viewer.until(|status| status["phase"] == "finished" && status["mode"] == "before");
        assert_eq!(viewer.frame[8], 1);
        let (status, ..) = ask(port, "GET", &format!("{path}picture.exr"), &host, "");
        assert_eq!(status, "HTTP/1.1 409 Conflict");
        let (_, _, body) = ask(port, "GET", &format!("{path}picture.png"), &host, "");
        assert!(body.starts_with(b"\x89PNG"));
        wish("{\"mode\": \"after\"}");
        viewer.until(|status| status["phase"] == "finished" && status["mode"] == "after");
        let tests = |name: &str| viewer.status[name][0].as_f64().expect("node tests");
        assert!(tests("after") < tests("before"), "{}", viewer.status);
    });
}

#[test]
fn a_finished_picture_stays_while_a_map_is_looked_at() {
    with_server(16, |port, path| {
        let host = format!("127.0.0.1:{port}");
        let wish = |body: &str| ask(port, "POST", &format!("{path}wish"), &host, body);
        let mut viewer = Viewer::open(port, path);
        viewer.until_finished(0);
        viewer.until(|status| status["learned"] == true);
        wish("{\"mode\": \"before\"}");
        viewer.until(|status| status["phase"] == "finished" && status["mode"] == "before");
        let before = viewer.status["before"].clone();
        wish("{\"mode\": \"picture\"}");
        viewer.until(|status| status["mode"] == "picture");
        assert_eq!(viewer.status["phase"], "finished", "{}", viewer.status);
        assert_eq!(viewer.status["samples"], 16);
        assert_eq!(viewer.status["before"], before);
        assert_eq!(viewer.frame[1], 1, "no coarse frame");
        // Another camera is another picture.
        let mut moved = viewer.status["look"].clone();
        moved["eye"][1] = (moved["eye"][1].as_f64().expect("a number") + 1.0).into();
        wish(&format!("{{\"look\": {moved}}}"));
        viewer.until(|status| status["phase"] == "rendering" && status["samples"] == 0);
    });
}

#[test]
fn a_picture_under_way_goes_on_after_a_map_and_after_a_stop() {
    with_server(1 << 20, |port, path| {
        let host = format!("127.0.0.1:{port}");
        let wish = |body: &str| ask(port, "POST", &format!("{path}wish"), &host, body);
        let mut viewer = Viewer::open(port, path);
        let samples = |viewer: &Viewer| viewer.status["samples"].as_u64().unwrap_or(0);
        viewer.until(|status| status["samples"].as_u64() > Some(32));
        let mut last = samples(&viewer);
        for change in ["{\"mode\": \"before\"}", "{\"stopped\": true}"] {
            wish(change);
            viewer.until(|status| status["mode"] == "before" || status["phase"] == "stopped");
            wish("{\"mode\": \"picture\"}");
            viewer.until(|status| status["mode"] == "picture" && status["phase"] == "rendering");
            assert!(samples(&viewer) >= last, "{}", viewer.status);
            assert_eq!(viewer.frame[1], 1, "no coarse frame");
            last = samples(&viewer) + 1;
            viewer.until(|status| status["samples"].as_u64() >= Some(last));
        }
    });
}

#[test]
fn a_viewer_can_end_the_program() {
    let server = Server::bind(0, "town").expect("a server");
    let (port, path) = parts(&server.address());
    let host = format!("127.0.0.1:{port}");
    let scene = scene([64, 48]);
    let world = World::new(&scene).expect("a valid scene");
    std::thread::scope(|scope| {
        let engine = scope.spawn(|| server.run(&scene, world, &options(1 << 20), &|| false));
        let mut viewer = Viewer::open(port, &path);
        viewer.until(|status| status["samples"].as_u64() > Some(0));
        ask(port, "POST", &format!("{path}quit"), &host, "");
        while viewer.next().is_some() {}
        engine.join().expect("no panic").expect("no error");
    });
}

#[test]
fn a_scene_that_cannot_be_shown_says_why() {
    let server = Server::bind(0, "town").expect("a server");
    let (port, path) = parts(&server.address());
    let mut viewer = Viewer::open(port, &path);
    server.tell("reading the scene");
    viewer.until(|status| status["text"] == "reading the scene");
    server.fail("no lights");
    viewer.until(|status| status["phase"] == "failed");
    assert_eq!(viewer.status["text"], "no lights");
    // The end may be reported once more before the stream ends.
    while viewer.next().is_some() {
        assert_eq!(viewer.status["phase"], "failed");
    }
}

#[test]
fn connections_that_say_nothing_sensible_are_closed() {
    let server = Server::bind(0, "town").expect("a server");
    let (port, _) = parts(&server.address());
    let since = Instant::now();
    for text in ["\r\n\r\n", "GET\r\n\r\n", "\0\u{1}\u{2}\n"] {
        let mut stream = connect(port);
        stream.write_all(text.as_bytes()).expect("sent");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("an answer");
        assert!(answer.starts_with("HTTP/1.1 400"), "{answer}");
    }
    assert!(since.elapsed() < Duration::from_secs(30));
}

/// Connections without the secret never keep a viewer out, and never push one out.
#[test]
fn strangers_give_way_to_viewers() {
    let server = Server::bind(0, "town").expect("a server");
    let (port, path) = parts(&server.address());
    let host = format!("127.0.0.1:{port}");
    let silent: Vec<_> = (0..150).map(|_| connect(port)).collect();
    let mut viewer = Viewer::open(port, &path);
    let more: Vec<_> = (0..150).map(|_| connect(port)).collect();
    let (status, ..) = ask(port, "GET", &path, &host, "");
    assert_eq!(status, "HTTP/1.1 200 OK");
    server.tell("still here");
    viewer.until(|status| status["text"] == "still here");
    drop((silent, more));
}
