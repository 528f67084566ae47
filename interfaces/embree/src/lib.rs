//! Embree 4's C interface over antumbra: a `libembree4` for programs that are not to be changed.
//!
//! Build the crate as a shared library and put it in the place of Embree's. What is not here reports
//! `RTC_ERROR_INVALID_OPERATION` with a text, and never answers wrongly.
//!
//! | module | functions |
//! |---|---|
//! | `device`, `failure` | devices, settings, errors |
//! | `buffer`, `geometry`, `transform` | what clients describe |
//! | `scene`, `commit` | from there to trees of the kernel |
//! | `query`, `lanes` | single rays, packets, streams |
//! | `filter`, `user` | functions of the client during queries |
//! | `points`, `normal`, `interpolate` | point queries, normals, attributes |
//! | `missing` | functions that report that they are not here |
//!
//! The C header is Embree's own. Ray streams of Embree 3 are declared in `include/rtcore_streams.h`.
#![allow(non_snake_case)]

mod abi;
mod buffer;
mod commit;
mod curves;
mod device;
mod failure;
mod filter;
mod geometry;
mod handle;
mod interpolate;
mod lanes;
mod missing;
mod normal;
mod points;
mod query;
mod scene;
mod transform;
mod user;
