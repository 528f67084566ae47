//! The program from outside: what it prints, writes and returns.
//!
//! - `support`: running it in a folder of its own, and the scenes it is given
//! - `usage`: the command line and its mistakes
//! - `bad_scenes`: every mistake named, nothing written
//! - `rendering`: `render` and what it promises about its picture
//! - `studying`: `study`, row by row
//! - `benching`: `bench`, with and without Embree
//! - `describing`: `info`
//! - `images`: `image compare`, `convert` and `heatmap`

mod bad_scenes;
mod benching;
mod describing;
mod images;
mod rendering;
mod studying;
mod support;
mod usage;
