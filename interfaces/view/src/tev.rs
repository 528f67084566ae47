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
use std::sync::{Arc, OnceLock};
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
/// Time in which a viewer has to take something of what is sent.
const PATIENCE: Duration = Duration::from_secs(3);
/// Time for everything that is sent after the rendering.
const LAST: Duration = Duration::from_secs(3);
/// Longest wait of a single write, between looks at the deadlines.
const WRITE: Duration = Duration::from_millis(100);
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
    end: End,
    thread: JoinHandle<bool>,
}

impl Display {
    /// Starts to send the tiles to `HOST:PORT`, or to tev's own port on `HOST`, as an image of this name.
    ///
    /// # Errors
    /// The address cannot be resolved, or no thread can be started.
    pub fn start(address: &str, name: &str, tiles: Arc<LiveTiles>) -> io::Result<Self> {
        let addresses = resolve(address)?;
        let end = End::default();
        let sender = Sender {
            addresses,
            name: format!("{name} ({})", std::process::id()),
            tiles,
            end: end.clone(),
        };
        let thread = thread::Builder::new()
            .name("display".into())
            .spawn(move || sender.run())?;
        Ok(Self { end, thread })
    }

    /// Sends the last changes, and ends. Returns whether the viewer got all of the picture. Takes a few seconds at
    /// most, however slowly the viewer reads.
    pub fn finish(self) -> bool {
        self.end.come();
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

/// End of the rendering, which gives everything that is still to be sent one deadline.
#[derive(Clone, Debug, Default)]
struct End(Arc<OnceLock<Instant>>);

impl End {
    fn come(&self) {
        self.0.get_or_init(|| Instant::now() + LAST);
    }

    fn has_come(&self) -> bool {
        self.0.get().is_some()
    }

    /// Time left until the deadline, at most `most`.
    fn left(&self, most: Duration) -> Duration {
        let deadline = self.0.get();
        deadline.map_or(most, |at| {
            at.saturating_duration_since(Instant::now()).min(most)
        })
    }
}

struct Sender {
    addresses: Vec<SocketAddr>,
    name: String,
    tiles: Arc<LiveTiles>,
    end: End,
}

impl Sender {
    /// Sends until a stop is requested. Returns whether the last picture was sent.
    fn run(self) -> bool {
        let mut viewer: Option<Viewer> = None;
        let mut tried: Option<Instant> = None;
        loop {
            // Read before the picture, so that the last look comes after the last change.
            let last = self.end.has_come();
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
        // A time of zero is an error, so that nothing is tried after the deadline.
        let stream =
            addresses.find_map(|at| TcpStream::connect_timeout(at, self.end.left(CONNECT)).ok())?;
        Viewer::open(stream, self.end.clone(), &self.tiles, &self.name).ok()
    }
}

/// A connection to a viewer, and what the viewer has.
struct Viewer {
    stream: TcpStream,
    end: End,
    seen: Seen,
    picture: Vec<[f32; 3]>,
}

impl Viewer {
    fn open(stream: TcpStream, end: End, tiles: &LiveTiles, name: &str) -> io::Result<Self> {
        stream.set_write_timeout(Some(WRITE))?;
        stream.set_nodelay(true)?;
        let window = tiles.window();
        let mut viewer = Self {
            stream,
            end,
            seen: Seen::default(),
            picture: vec![[0.0; 3]; window.area()],
        };
        let size = [window.width() as i32, window.height() as i32];
        viewer.send(&create_image(name, size))?;
        Ok(viewer)
    }

    /// Sends a message, unless the viewer takes nothing for a while or the deadline passes.
    fn send(&mut self, mut bytes: &[u8]) -> io::Result<()> {
        let mut taken = Instant::now();
        while !bytes.is_empty() {
            if taken.elapsed() >= PATIENCE || self.end.left(WRITE).is_zero() {
                return Err(io::ErrorKind::TimedOut.into());
            }
            match self.stream.write(bytes) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(count) => {
                    bytes = &bytes[count..];
                    taken = Instant::now();
                }
                Err(error) if is_retried(error.kind()) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
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
                self.send(&message)?;
            }
        }
        Ok(())
    }
}

/// Whether a write that failed for this reason is tried again: only the wait was over.
fn is_retried(kind: io::ErrorKind) -> bool {
    use io::ErrorKind as K;
    matches!(kind, K::WouldBlock | K::TimedOut | K::Interrupted)
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
