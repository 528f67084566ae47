//! Tests of the viewers through their public interface, with servers and clients of our own.
//!
//! - `tev`: what a display server gets
//! - `preview`: the file beside a running rendering
//! - `page`: the page's server, by raw requests
//! - `sun`: a day of sun on the page
//! - `support`: a scene, and a picture of it while it grows

mod page;
mod preview;
mod sun;
mod support;
mod tev;
