//! Maps of values on a grid: colours over a relief, with title, legend, scale bar and north arrow, as PNG, SVG or PDF.
//!
//! A [`Map`] holds the values and the words. [`Map::draw`] lays them out on a sheet of a chosen size, and the [`Drawing`] is
//! written in any of the three formats. All three show the same: SVG and PDF keep text as text.
//!
//! # Example
//!
//! ```
//! use antumbra_map::{Map, Steps, Theme};
//!
//! # fn main() -> Result<(), antumbra_map::Error> {
//! let hours = [1.5, 4.0, 8.0, 7.5, 0.0, f32::NAN];
//! let map = Map {
//!     values: &hours,
//!     width: 3,
//!     height: 2,
//!     cell: [10.0; 2],
//!     metres: Some(1.0),
//!     north: 0.0,
//!     title: "Courtyard",
//!     subtitle: "21 June 2025 · 48.2082° N, 16.3738° E",
//!     quantity: "Direct sun",
//!     unit: "h",
//!     steps: Steps::around(&hours, false),
//!     source: "courtyard.obj",
//!     relief: None,
//!     symbols: None,
//!     theme: Theme::Light,
//! };
//! let drawing = map.draw(map.usual_size())?;
//! assert!(drawing.svg()?.contains("Direct sun in h"));
//! assert!(drawing.pdf()?.starts_with(b"%PDF-1."));
//! # Ok(())
//! # }
//! ```
//!
//! # Files
//!
//! - `map.rs`: [`Map`]: what is drawn, with its [`Symbols`]; `layout.rs`: where
//! - `panels.rs`: [`panels`], pictures beside each other
//! - `sheet.rs`, `legend.rs`: what both are made of
//! - `steps.rs`: [`Steps`], the rounded numbers of legends, or their [`Class`]es
//! - `relief.rs`: [`Relief`], the model beneath the values
//! - `theme.rs`: [`Theme`], colours of paper and text
//! - `drawing.rs`: [`Drawing`], a list of shapes and text
//! - `pixels.rs`, `svg.rs`, `pdf.rs`: drawings in one format each
//! - `animation.rs`: [`Animation`], pictures one after the other as GIF
//! - `font.rs`: widths and outlines of letters
//! - `error.rs`: [`Error`]
#![forbid(unsafe_code)]

mod animation;
mod drawing;
mod error;
mod font;
mod layout;
mod legend;
mod map;
mod panels;
mod pdf;
mod pixels;
mod relief;
mod sheet;
mod steps;
mod svg;
mod theme;

pub use animation::Animation;
pub use drawing::Drawing;
pub use error::Error;
pub use font::check as check_text;
pub use map::{Map, Symbols};
pub use panels::{Panel, PanelLegend, panels};
pub use relief::Relief;
pub use steps::{Class, Steps};
pub use theme::Theme;
