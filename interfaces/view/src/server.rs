//! The page's server.
//!
//! # Who may send requests
//!
//! The server listens only on 127.0.0.1. Every path begins with a secret of 128 random bits, which only the printed
//! address holds. Requests for another host name are refused, so that no page of the internet can reach it through a
//! name that leads here. The page itself may load nothing from elsewhere.
//!
//! A connection that has not named the secret is a stranger. When all places are taken, the stranger who came first
//! gives way, so that strangers never shut out a viewer.

use std::io::{self, BufReader, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::{Arc, LazyLock};
use std::thread;
use std::time::Duration;

use antumbra_image::palette;
use antumbra_render::{Options, World};
use antumbra_scene::Scene;
use serde::Serialize;

use crate::engine::Engine;
use crate::files::{captioned, encoded};
use crate::guests::{Guest, Guests};
use crate::http::{Request, answer, begin_stream};
use crate::state::{Change, Mode, Phase, Shared};
use crate::sun::{Sun, SunDay};
use crate::{Error, stream};

/// The page: one file, with the colours of maps.
static PAGE: LazyLock<String> = LazyLock::new(|| {
    let colours: Vec<[u8; 3]> = (0..256)
        .map(|i| palette::colour(i as f32 / 255.0))
        .collect();
    [
        include_str!("page/head.html"),
        "<style>\n",
        include_str!("page/page.css"),
        "</style>\n",
        include_str!("page/body.html"),
        "<script>\n",
        &format!("const RAMP = {colours:?};\n"),
        include_str!("page/camera.js"),
        include_str!("page/picture.js"),
        include_str!("page/page.js"),
        include_str!("page/sun.js"),
        include_str!("page/start.js"),
        "</script>\n",
    ]
    .concat()
});

/// Longest wait for the first request of a connection.
const FIRST: Duration = Duration::from_secs(5);
/// Longest silence of a connection between requests, once it has named the secret.
const IDLE: Duration = Duration::from_secs(60);
/// Time that a page has to take what is sent.
const PATIENCE: Duration = Duration::from_secs(10);

/// A page for browsers on this machine, and the engine behind it.
#[derive(Debug)]
pub struct Server {
    port: u16,
    secret: String,
    shared: Arc<Shared>,
    day: Option<Arc<SunDay>>,
}

impl Server {
    /// Starts to serve the page at a port of 127.0.0.1; 0 is any free one. The page shows the text of
    /// [`Server::tell`] until [`Server::run`] has a scene.
    ///
    /// # Errors
    /// [`Error::Listen`], [`Error::Secret`], [`Error::Thread`].
    pub fn bind(port: u16, title: &str) -> Result<Self, Error> {
        let listen = |source| Error::Listen { port, source };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(listen)?;
        let port = listener.local_addr().map_err(listen)?.port();
        let mut bits = [0; 16];
        getrandom::fill(&mut bits).map_err(|error| Error::Secret(error.to_string()))?;
        let secret: String = bits.iter().map(|byte| format!("{byte:02x}")).collect();
        let shared = Arc::new(Shared::default());
        shared.tell(|status| title.clone_into(&mut status.title));
        let door = Door {
            prefix: format!("/{secret}/"),
            hosts: ["127.0.0.1", "localhost"].map(|name| format!("{name}:{port}")),
            shared: Arc::clone(&shared),
        };
        let accept = move || door.accept(&listener);
        let thread = thread::Builder::new().name("page".into()).spawn(accept);
        thread.map_err(Error::Thread)?;
        Ok(Self {
            port,
            secret,
            shared,
            day: None,
        })
    }

    /// Lets the page show hours of sun and shadows of a day, and begins with the hours.
    #[must_use]
    pub fn with_sun(mut self, day: SunDay) -> Self {
        let noon = day
            .suns
            .iter()
            .max_by(|a, b| a.elevation.total_cmp(&b.elevation));
        let noon = noon.map_or(12.0, |sun| sun.hour);
        self.shared.change(|state| {
            state.wish.mode = Mode::Hours;
            state.wish.hour = noon;
            (state.status.has_sun, state.status.hour) = (true, noon);
            state.day = serde_json::to_vec(&Day::of(&day)).unwrap_or_default();
            state.changes += 1;
        });
        self.day = Some(Arc::new(day));
        self
    }

    /// Address of the page, with its secret.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/{}/", self.port, self.secret)
    }

    /// Shows viewers what is being done before there is a picture.
    pub fn tell(&self, text: &str) {
        self.shared.tell(|status| text.clone_into(&mut status.text));
    }

    /// Shows viewers that there will be no picture, and why. Gives their pages time to read it.
    pub fn fail(&self, text: &str) {
        self.shared.tell(|status| {
            status.phase = Phase::Failed;
            text.clone_into(&mut status.text);
        });
        self.end();
    }

    /// Renders what the viewers wish, until one of them or `cancelled` ends it.
    ///
    /// `options.spp` samples per pixel make a picture. The recipe is for the learned tree. The first tree is by
    /// the world's own builder.
    ///
    /// # Errors
    /// [`Error::Render`].
    pub fn run(
        self,
        scene: &Scene,
        world: World,
        options: &Options,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<(), Error> {
        let engine = Engine::new(
            Arc::clone(&self.shared),
            (scene, world),
            options,
            self.day.clone(),
        );
        let outcome = engine.run(cancelled).map_err(Error::Render);
        match &outcome {
            Ok(()) => self.end(),
            Err(error) => self.fail(&error.to_string()),
        }
        outcome
    }

    /// Ends all streams, and waits a moment for them.
    fn end(&self) {
        self.shared.change(|state| {
            state.ended = true;
            state.changes += 1;
        });
        thread::sleep(Duration::from_millis(100));
    }
}

/// What every connection knows.
struct Door {
    prefix: String,
    hosts: [String; 2],
    shared: Arc<Shared>,
}

impl Door {
    /// Takes connections for as long as the program lives.
    fn accept(self, listener: &TcpListener) {
        let door = Arc::new(self);
        let guests = Arc::new(Guests::default());
        for stream in listener.incoming() {
            let Ok(stream) = stream else {
                // Too many open files, for example. Not to turn at full speed.
                thread::sleep(Duration::from_millis(20));
                continue;
            };
            let stream = Arc::new(stream);
            let Some(guest) = Guests::enter(&guests, &stream) else {
                continue;
            };
            let door = Arc::clone(&door);
            let serve = move || {
                // A connection that breaks off is none of anybody's business.
                let _ = door.serve(&stream, &guest);
            };
            let name = "connection".to_owned();
            // Where no thread can be started, the guest is dropped with its connection.
            let _ = thread::Builder::new().name(name).spawn(serve);
        }
    }

    /// Answers the requests of one connection.
    fn serve(&self, stream: &TcpStream, guest: &Guest) -> io::Result<()> {
        stream.set_read_timeout(Some(FIRST))?;
        stream.set_write_timeout(Some(PATIENCE))?;
        stream.set_nodelay(true)?;
        let (mut reader, mut writer) = (BufReader::new(stream), stream);
        loop {
            let request = match Request::read(&mut reader) {
                Ok(Some(request)) => request,
                Ok(None) => return Ok(()),
                Err(error) => {
                    if error.kind() == io::ErrorKind::InvalidData {
                        let reason = "no request that is known here";
                        plain(&mut writer, "400 Bad Request", reason)?;
                    }
                    return Ok(());
                }
            };
            if self.admits(&request) {
                guest.admit();
                stream.set_read_timeout(Some(IDLE))?;
            }
            let close = request.close;
            if self.answer(&request, &mut writer)? || close {
                return Ok(());
            }
        }
    }

    /// Whether a request names this host and the secret.
    fn admits(&self, request: &Request) -> bool {
        self.hosts.contains(&request.host) && self.named(&request.path).is_some()
    }

    /// Answers a request. Returns whether the connection is used up.
    fn answer(&self, request: &Request, out: &mut impl Write) -> io::Result<bool> {
        if !self.hosts.contains(&request.host) {
            plain(out, "403 Forbidden", "not for this host name")?;
            return Ok(true);
        }
        let Some(name) = self.named(&request.path) else {
            plain(out, "404 Not Found", "nothing here")?;
            return Ok(false);
        };
        match (request.method.as_str(), name) {
            ("GET", "") => answer(out, "200 OK", HTML, "", PAGE.as_bytes())?,
            ("GET", "stream") => {
                begin_stream(out)?;
                stream::run(&self.shared, out)?;
                return Ok(true);
            }
            ("POST", "wish") => match self.wish(&request.body) {
                Ok(number) => plain(out, "200 OK", &number.to_string())?,
                Err(reason) => plain(out, "400 Bad Request", &reason)?,
            },
            ("POST", "quit") => {
                self.shared.change(|state| state.quit = true);
                plain(out, "200 OK", "ends")?;
            }
            ("GET", "picture.png") => {
                let exposure = request.value("ev").and_then(|ev| ev.parse().ok());
                self.save(out, "png", exposure.unwrap_or(0.0))?;
            }
            ("GET", "picture.exr") => self.save(out, "exr", 0.0)?,
            ("GET", "sun") => {
                let day = self.shared.lock().day.clone();
                match day.is_empty() {
                    true => plain(out, "404 Not Found", NO_SUN)?,
                    false => answer(out, "200 OK", JSON, "", &day)?,
                }
            }
            ("GET", "point") => {
                let at = ["x", "y"].map(|axis| request.value(axis).and_then(|x| x.parse().ok()));
                // Cloned, so that nobody waits for the rays.
                let probe = self.shared.lock().probe.clone();
                match (probe, at) {
                    (Some(probe), [Some(x), Some(y)]) => {
                        let day = serde_json::to_vec(&probe.point([x, y])).unwrap_or_default();
                        answer(out, "200 OK", JSON, "", &day)?;
                    }
                    (None, _) => plain(out, "404 Not Found", NO_SUN)?,
                    _ => plain(out, "400 Bad Request", NO_POINT)?,
                }
            }
            _ => plain(out, "404 Not Found", "nothing here")?,
        }
        Ok(false)
    }

    /// Takes a change of the wish. Returns the number of the wish.
    fn wish(&self, body: &[u8]) -> Result<u64, String> {
        let change = serde_json::from_slice::<Change>(body).map_err(|error| error.to_string())?;
        self.shared.wish(&change).map_err(str::to_owned)
    }

    /// Rest of a path after the secret. Takes the same time wherever a guess goes wrong.
    fn named<'a>(&self, path: &'a str) -> Option<&'a str> {
        let (start, rest) = path.split_at_checked(self.prefix.len())?;
        let pairs = start.bytes().zip(self.prefix.bytes());
        let difference = pairs.fold(0, |all, (a, b)| all | (a ^ b));
        (difference == 0).then_some(rest)
    }

    /// Sends the picture as a file.
    fn save(&self, out: &mut impl Write, extension: &str, exposure: f32) -> io::Result<()> {
        let (frame, title, samples, sun) = {
            let state = self.shared.lock();
            let status = &state.status;
            let day = state.probe.as_ref().map(|probe| Arc::clone(&probe.day));
            let sun = day.map(|day| (day, status.hour));
            (
                state.full.clone(),
                status.title.clone(),
                status.samples,
                sun,
            )
        };
        let Some(frame) = frame else {
            let reason = "there is no picture in full size yet";
            return plain(out, "503 Service Unavailable", reason);
        };
        let is_sun = frame.mode.is_sun() && extension == "png";
        let encoded = match sun.filter(|_| is_sun) {
            Some((day, hour)) => captioned(&frame, &day, hour),
            None => encoded(&frame, extension, exposure),
        };
        match encoded {
            Ok(bytes) => {
                let kind = match extension {
                    "png" => "image/png",
                    _ => "image/x-exr",
                };
                let name: String = title
                    .chars()
                    .map(|c| if c.is_ascii_alphanumeric() { c } else { '-' })
                    .collect();
                // A picture under way is not taken for the finished one.
                let name = match frame.mode {
                    Mode::Hours => format!("{name}-sun-hours.{extension}"),
                    Mode::Shadows => format!("{name}-shadows.{extension}"),
                    _ => format!("{name}-{samples}spp.{extension}"),
                };
                let more = format!("Content-Disposition: attachment; filename=\"{name}\"\r\n");
                answer(out, "200 OK", kind, &more, &bytes)
            }
            Err(reason) => plain(out, "409 Conflict", &reason),
        }
    }
}

const JSON: &str = "application/json";
const HTML: &str = "text/html; charset=utf-8";
const NO_SUN: &str = "there is no day of sun";
const NO_POINT: &str = "x and y are fractions of the picture";

/// A day of sun, as the page gets it.
#[derive(Serialize)]
struct Day<'a> {
    caption: &'a str,
    /// Hours of a step of the diagram of a point.
    step: f64,
    /// Hours at the light end of the colours.
    longest: f32,
    suns: &'a [Sun],
}

impl<'a> Day<'a> {
    fn of(day: &'a SunDay) -> Self {
        Self {
            caption: &day.caption,
            step: day.step,
            longest: day.longest(),
            suns: &day.suns,
        }
    }
}

fn plain(out: &mut impl Write, status: &str, text: &str) -> io::Result<()> {
    answer(
        out,
        status,
        "text/plain; charset=utf-8",
        "",
        text.as_bytes(),
    )
}
