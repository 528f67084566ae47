//! The laboratory: what a tree costs, measured on the rays of pictures.
//!
//! [`study`] answers the same rays by many orders, builders, collapses and widths, counts their node
//! tests and writes a report. [`mod@bench`] measures rays per second, side by side with Embree.
//!
//! ```
//! use antumbra_lab::study::{self, Plan};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut city = antumbra_load::load("builtin:city:2000".as_ref(), &Default::default())?.scene;
//! city.film.resolution = [32, 18];
//! let plan = Plan {
//!     scenes: study::subjects(vec![city], None)?,
//!     spp: Some(1),
//!     ..Plan::default()
//! };
//! let results = study::run(&plan, &())?;
//! for row in results.rows() {
//!     println!("{}: {:?} node tests per ray", row.order, row.node_tests_after);
//! }
//! results.verdict()?;
//! # Ok(())
//! # }
//! ```
//!
//! Nothing here prints: a [`Watcher`] receives how far the work is, and can stop it. What an experiment found is
//! returned, and written to a directory on request.
//!
//! - `study/`: the plan, its renderings and replays, and what each cost;  `report/`: a study as tables and a page
//! - `harness`: works that take turns, and their answers;  `embree/`: the binding of the C library
//! - `bench/`: rates of rays, ours and Embree's, as cases of the harness
//! - `compare/`: one picture whose queries many trees answer
//! - `rays/`, `trees`: rays of camera paths, and trees of any builder, collapse and order
//! - `gain`: how much faster one tree is than another
//! - `still`: scenes whose rays need no time;  `watch`, `error`: progress, interruption, failure
//! - `machine`, `table`, `output`: parts of all results
// Denied, not forbidden: `embree` calls a C library.
#![deny(unsafe_code)]

pub mod bench;
mod compare;
mod counted;
#[allow(unsafe_code, reason = "the binding of a C library")]
pub mod embree;
mod error;
mod gain;
pub mod harness;
mod machine;
mod output;
mod rays;
mod report;
mod still;
pub mod study;
mod table;
mod thread_time;
mod trees;
mod watch;

pub use compare::{Compared, ComparedTree, compare};
pub use error::Error;
pub use gain::{Gain, gain};
pub use machine::{Caller, Machine};
pub use output::{json, make_directory, write_file, write_json};
pub use rays::{Lot, Rays, SampledRays, collect_rays};
pub use table::{Table, count, number};
pub use thread_time::seconds as thread_seconds;
pub use trees::{CollapsedTree, OrderedTree, RaysFrom, TrainedTree};
pub use watch::{Step, Watcher, Work};
