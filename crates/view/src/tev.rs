//! Pictures for [tev](https://github.com/Tom94/tev), a viewer that listens on a TCP port, as pbrt-v4 sends them.
//!
//! # Messages
//!
//! A message is its length with everything (`u32`), its kind (`u8`), and fields. Numbers are little-endian, strings end
//! with a zero byte, and a `bool` is one byte. Nothing is answered. Two kinds are sent:
//!
//! - 4, *create image*: whether to grab the focus, name, width and height (`i32`), number of channels (`i32`), their
//!   names;
//! - 3, *update image*: whether to grab the focus, name, name of one channel, x, y, width and height (`i32`), `f32`
//!   values row by row.

use std::io::{self, Write};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use antumbra_image::Window;
use antumbra_render::{LiveTiles, Seen};

/// Port that tev listens on by default.
pub const PORT: u16 = 14158;

const UPDATE_IMAGE: u8 = 3;
const CREATE_IMAGE: u8 = 4;
const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// Edge of the blocks that are sent, in pixels.
const BLOCK: i32 = 128;
/// Time between two looks at the picture.
const EVERY: Duration = Duration::from_millis(250);
/// Time that a viewer has to take what is sent.
const PATIENCE: Duration = Duration::from_secs(3);
/// Time that a viewer has to accept a connection.
const CONNECT: Duration = Duration::from_secs(1);
/// Time between attempts to connect.
const AGAIN: Duration = Duration::from_secs(1);

/// A running rendering as tev shows it, sent by a thread of its own.
///
/// A viewer that is absent, slow or gone never holds up the rendering. A new connection is tried every second, and
/// gets the whole picture.
#[derive(Debug)]
pub struct Display {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<bool>,
}

impl Display {
    /// Starts to send the tiles to `HOST:PORT`, or to tev's own port on `HOST`, as an image of this name.
    ///
    /// # Errors
    /// The address cannot be resolved, or no thread can be started.
    pub fn start(address: &str, name: &str, tiles: Arc<LiveTiles>) -> io::Result<Self> {
        let addresses = resolve(address)?;
        let stop = Arc::new(AtomicBool::new(false));
        let sender = Sender {
            addresses,
            name: format!("{name} ({})", std::process::id()),
            tiles,
            stop: Arc::clone(&stop),
        };
        let thread = thread::Builder::new()
            .name("display".into())
            .spawn(move || sender.run())?;
        Ok(Self { stop, thread })
    }

    /// Sends the last changes, and ends. Returns whether the viewer got all of the picture. Takes some seconds at most.
    pub fn finish(self) -> bool {
        self.stop.store(true, Ordering::Release);
        self.thread.thread().unpark();
        self.thread.join().unwrap_or(false)
    }
}

/// Addresses of `HOST:PORT` or `HOST`.
///
/// # Errors
/// No such host, or no port number.
pub fn resolve(address: &str) -> io::Result<Vec<SocketAddr>> {
    let found: Vec<_> = match address.rsplit_once(':') {
        Some(_) => address.to_socket_addrs()?.collect(),
        None => (address, PORT).to_socket_addrs()?.collect(),
    };
    match found.is_empty() {
        true => Err(io::ErrorKind::NotFound.into()),
        false => Ok(found),
    }
}

struct Sender {
    addresses: Vec<SocketAddr>,
    name: String,
    tiles: Arc<LiveTiles>,
    stop: Arc<AtomicBool>,
}

impl Sender {
    /// Sends until it is told to stop. Returns whether the last picture was sent.
    fn run(self) -> bool {
        let mut viewer: Option<Viewer> = None;
        let mut tried: Option<Instant> = None;
        loop {
            // Asked before the picture, so that the last look comes after the last change.
            let last = self.stop.load(Ordering::Acquire);
            let due = tried.is_none_or(|at| at.elapsed() >= AGAIN);
            if viewer.is_none() && (due || last) {
                viewer = self.connect();
                tried = Some(Instant::now());
            }
            if let Some(open) = &mut viewer
                && open.update(&self.tiles, &self.name).is_err()
            {
                viewer = None;
            }
            if last {
                return viewer.is_some();
            }
            thread::park_timeout(EVERY);
        }
    }

    fn connect(&self) -> Option<Viewer> {
        let mut addresses = self.addresses.iter();
        let stream = addresses.find_map(|at| TcpStream::connect_timeout(at, CONNECT).ok())?;
        Viewer::open(stream, &self.tiles, &self.name).ok()
    }
}

/// A connection to a viewer, and what the viewer has.
struct Viewer {
    stream: TcpStream,
    seen: Seen,
    picture: Vec<[f32; 3]>,
}

impl Viewer {
    fn open(stream: TcpStream, tiles: &LiveTiles, name: &str) -> io::Result<Self> {
        stream.set_write_timeout(Some(PATIENCE))?;
        stream.set_nodelay(true)?;
        let window = tiles.window();
        let mut viewer = Self {
            stream,
            seen: Seen::default(),
            picture: vec![[0.0; 3]; window.area()],
        };
        let size = [window.width() as i32, window.height() as i32];
        viewer.stream.write_all(&create_image(name, size))?;
        Ok(viewer)
    }

    /// Sends the blocks that changed.
    fn update(&mut self, tiles: &LiveTiles, name: &str) -> io::Result<()> {
        let whole = tiles.window();
        let changed = tiles.changed(&mut self.seen);
        if changed.is_empty() {
            return Ok(());
        }
        let across = (whole.width() as i32 + BLOCK - 1) / BLOCK;
        let down = (whole.height() as i32 + BLOCK - 1) / BLOCK;
        let mut dirty = vec![false; (across * down) as usize];
        for tile in &changed {
            tile.copy_to(&mut self.picture, whole);
            let [x0, x1] = [tile.window.x0, tile.window.x1 - 1].map(|x| (x - whole.x0) / BLOCK);
            let [y0, y1] = [tile.window.y0, tile.window.y1 - 1].map(|y| (y - whole.y0) / BLOCK);
            for y in y0..=y1 {
                for x in x0..=x1 {
                    dirty[(y * across + x) as usize] = true;
                }
            }
        }
        for (index, _) in dirty.iter().enumerate().filter(|(_, dirty)| **dirty) {
            let (x0, y0) = (index as i32 % across * BLOCK, index as i32 / across * BLOCK);
            let block = Window {
                x0,
                y0,
                x1: (x0 + BLOCK).min(whole.width() as i32),
                y1: (y0 + BLOCK).min(whole.height() as i32),
            };
            for (channel, channel_name) in CHANNELS.iter().enumerate() {
                let values = (block.y0..block.y1).flat_map(|y| {
                    let row = y as usize * whole.width();
                    let row = &self.picture[row + block.x0 as usize..row + block.x1 as usize];
                    row.iter().map(move |pixel| pixel[channel])
                });
                let message = update_image(name, channel_name, block, values);
                self.stream.write_all(&message)?;
            }
        }
        Ok(())
    }
}

/// A message under construction.
struct Message(Vec<u8>);

impl Message {
    fn new(kind: u8) -> Self {
        // The length is filled in at the end.
        Self(vec![0, 0, 0, 0, kind])
    }

    fn flag(mut self, value: bool) -> Self {
        self.0.push(value.into());
        self
    }

    /// A string. A zero byte would end it early, and is left out.
    fn text(mut self, text: &str) -> Self {
        self.0.extend(text.bytes().filter(|&byte| byte != 0));
        self.0.push(0);
        self
    }

    fn numbers(mut self, numbers: &[i32]) -> Self {
        self.0.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
        self
    }

    fn finish(mut self) -> Vec<u8> {
        let length = self.0.len() as u32;
        self.0[..4].copy_from_slice(&length.to_le_bytes());
        self.0
    }
}

fn create_image(name: &str, size: [i32; 2]) -> Vec<u8> {
    let start = Message::new(CREATE_IMAGE).flag(true).text(name);
    let start = start.numbers(&[size[0], size[1], CHANNELS.len() as i32]);
    let channels = CHANNELS.iter();
    channels
        .fold(start, |message, name| message.text(name))
        .finish()
}

fn update_image(
    name: &str,
    channel: &str,
    block: Window,
    values: impl Iterator<Item = f32>,
) -> Vec<u8> {
    let size = [block.width() as i32, block.height() as i32];
    let mut message = Message::new(UPDATE_IMAGE)
        .flag(false)
        .text(name)
        .text(channel)
        .numbers(&[block.x0, block.y0, size[0], size[1]]);
    message.0.extend(values.flat_map(f32::to_le_bytes));
    message.finish()
}
