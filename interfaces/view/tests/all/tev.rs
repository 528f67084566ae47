//! A display server of our own gets the picture as tev's protocol has it.

use std::collections::BTreeMap;
use std::io::Read;
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant};

use antumbra_render::LiveTiles;
use antumbra_view::{Display, tev};

use crate::support::{grow, scene};

/// A picture as the messages have made it: channels by name.
#[derive(Debug, Default)]
struct Shown {
    name: String,
    size: [usize; 2],
    channels: BTreeMap<String, Vec<f32>>,
    updates: usize,
}

/// Fields of a message.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn byte(&mut self) -> u8 {
        let (first, rest) = self.0.split_first().expect("a byte");
        self.0 = rest;
        *first
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|&byte| byte == 0);
        let (text, rest) = self.0.split_at(end.expect("a string that ends"));
        self.0 = &rest[1..];
        String::from_utf8(text.to_vec()).expect("UTF-8")
    }

    fn number(&mut self) -> i32 {
        let (first, rest) = self.0.split_first_chunk().expect("a number");
        self.0 = rest;
        i32::from_le_bytes(*first)
    }
}

/// Reads messages until the connection ends.
fn read_all(mut stream: TcpStream) -> Shown {
    let mut shown = Shown::default();
    let mut length = [0; 4];
    while stream.read_exact(&mut length).is_ok() {
        let mut message = vec![0; u32::from_le_bytes(length) as usize - 4];
        stream.read_exact(&mut message).expect("a whole message");
        let mut fields = Fields(&message);
        match fields.byte() {
            4 => {
                assert_eq!(fields.byte(), 1, "the focus is grabbed");
                shown.name = fields.text();
                shown.size = [0; 2].map(|_: usize| fields.number() as usize);
                for _ in 0..fields.number() {
                    let pixels = vec![f32::NAN; shown.size[0] * shown.size[1]];
                    shown.channels.insert(fields.text(), pixels);
                }
            }
            3 => {
                assert_eq!(fields.byte(), 0, "the focus is left alone");
                assert_eq!(fields.text(), shown.name);
                let channel = fields.text();
                let [x, y, w, h] = [0; 4].map(|_: usize| fields.number() as usize);
                assert!(w <= 128 && h <= 128 && x % 128 == 0 && y % 128 == 0);
                let pixels = shown.channels.get_mut(&channel).expect("a known channel");
                for row in y..y + h {
                    for column in x..x + w {
                        let bits = fields.number() as u32;
                        pixels[row * shown.size[0] + column] = f32::from_bits(bits);
                    }
                }
                shown.updates += 1;
            }
            kind => panic!("a message of kind {kind}"),
        }
        assert!(fields.0.is_empty(), "bytes left over");
    }
    shown
}

fn listen() -> (TcpListener, String) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    (listener, address)
}

/// Shown pixels as a picture has them.
fn pixels(shown: &Shown) -> Vec<[f32; 3]> {
    let channel = |name: &str| shown.channels[name].clone();
    let (r, g, b) = (channel("R"), channel("G"), channel("B"));
    (0..r.len()).map(|i| [r[i], g[i], b[i]]).collect()
}

#[test]
fn a_viewer_has_the_picture_in_the_end() {
    // Larger than a block, and cropped.
    let mut scene = scene([200, 150]);
    scene.film.crop_window = [0.05, 0.9, 0.1, 1.0];
    let tiles = Arc::new(LiveTiles::new(&scene.film));
    let (listener, address) = listen();
    let server = std::thread::spawn(move || read_all(listener.accept().expect("a viewer").0));
    let display = Display::start(&address, "town", Arc::clone(&tiles)).expect("a display");
    let image = grow(&scene, &tiles, 4);
    assert!(display.finish());
    let shown = server.join().expect("a well-formed stream");
    assert_eq!(shown.name, format!("town ({})", std::process::id()));
    assert_eq!(
        shown.size,
        [image.window().width(), image.window().height()]
    );
    assert_eq!(pixels(&shown), image.pixels());
    assert!(shown.updates >= 3);
}

#[test]
fn a_viewer_that_comes_back_gets_the_whole_picture() {
    let scene = scene([60, 40]);
    let tiles = Arc::new(LiveTiles::new(&scene.film));
    let (listener, address) = listen();
    let server = std::thread::spawn(move || {
        // Gone after the first bytes.
        let (mut first, _) = listener.accept().expect("a viewer");
        first.read_exact(&mut [0; 20]).expect("some bytes");
        drop(first);
        read_all(listener.accept().expect("the viewer again").0)
    });
    let display = Display::start(&address, "town", Arc::clone(&tiles)).expect("a display");
    let image = grow(&scene, &tiles, 2);
    // Changes are needed for the loss to be noticed. The new connection comes a second later.
    let since = Instant::now();
    while !server.is_finished() && since.elapsed() < Duration::from_secs(3) {
        grow(&scene, &tiles, 2);
        std::thread::sleep(Duration::from_millis(100));
    }
    assert!(display.finish());
    let shown = server.join().expect("a well-formed stream");
    assert_eq!(pixels(&shown), image.pixels());
}

#[test]
fn a_viewer_that_is_absent_or_deaf_holds_nothing_up() {
    let scene = scene([60, 40]);
    let tiles = Arc::new(LiveTiles::new(&scene.film));
    // A port where nobody listens any more.
    let (listener, address) = listen();
    drop(listener);
    let display = Display::start(&address, "town", Arc::clone(&tiles)).expect("a display");
    grow(&scene, &tiles, 1);
    assert!(!display.finish());

    // A server that never reads: what does not fit into the buffers of the system times out.
    let scene = crate::support::scene([2048, 1500]);
    let tiles = Arc::new(LiveTiles::new(&scene.film));
    let (_listener, address) = listen();
    let display = Display::start(&address, "town", Arc::clone(&tiles)).expect("a display");
    grow(&scene, &tiles, 1);
    let since = Instant::now();
    assert!(!display.finish());
    assert!(since.elapsed() < Duration::from_secs(60));
}

/// A viewer that takes a little now and then gets a part of the picture, and no more time than one that takes nothing.
#[test]
fn a_viewer_that_reads_slowly_holds_nothing_up() {
    let scene = scene([2048, 1500]);
    let tiles = Arc::new(LiveTiles::new(&scene.film));
    let (listener, address) = listen();
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("a viewer");
        let mut some = vec![0; 16 << 10];
        while stream.read(&mut some).is_ok_and(|count| count > 0) {
            std::thread::sleep(Duration::from_millis(50));
        }
    });
    let display = Display::start(&address, "town", Arc::clone(&tiles)).expect("a display");
    grow(&scene, &tiles, 1);
    // All of it would take minutes.
    assert!(!display.finish());
}

#[test]
fn addresses_are_checked_at_once() {
    assert_eq!(tev::resolve("127.0.0.1").expect("valid")[0].port(), 14158);
    assert_eq!(tev::resolve("127.0.0.1:99").expect("valid")[0].port(), 99);
    for bad in ["", "127.0.0.1:x", "127.0.0.1:70000", ":", "no such host"] {
        assert!(tev::resolve(bad).is_err(), "{bad}");
    }
}
