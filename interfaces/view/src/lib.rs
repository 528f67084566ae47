//! Looking at renderings while they run.
//!
//! Everything here is fed by [`LiveTiles`](antumbra_render::LiveTiles), which a rendering publishes and never waits
//! for:
//!
//! - [`PreviewFile`]: a picture file that is replaced every few seconds
//! - [`Display`]: the viewer tev, over its network protocol
//! - [`Server`]: a page for a browser on the same machine, with a camera that can be moved
//!
//! # Source
//!
//! - `preview.rs`, `tev.rs`: the first two
//! - `server.rs`: the page's server: who may send requests, and which
//! - `files.rs`: what is shown, as files
//! - `guests.rs`: open connections, and who gives way when there are too many
//! - `http.rs`: requests and answers
//! - `stream.rs`: the stream that a page reads
//! - `engine.rs`: renders what the viewers wish
//! - `sun.rs`: hours of sun and shadows of a day; `sun_frames.rs`: their frames
//! - `state.rs`: what server, streams and engine share
//! - `camera.rs`: cameras as a page moves them
//! - `page/`: the page: HTML, style and script, served as one file
#![forbid(unsafe_code)]

mod camera;
mod engine;
mod error;
mod files;
mod guests;
mod http;
mod preview;
mod server;
mod state;
mod stream;
mod sun;
mod sun_frames;
pub mod tev;

pub use error::Error;
pub use preview::PreviewFile;
pub use server::Server;
pub use sun::{Sun, SunDay};
pub use tev::Display;
