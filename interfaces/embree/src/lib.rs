//! Embree 4's C interface over antumbra: a `libembree4` for programs that are not to be changed.
//!
//! Build the crate as a shared library and put it in the place of Embree's. What is not here reports
//! `RTC_ERROR_INVALID_OPERATION` with a text, and never answers wrongly.
//!
//! | folder | functions |
//! |---|---|
//! | `device` | devices, settings, errors, and how functions of the interface are declared |
//! | `geometry` | what clients describe: buffers, settings, instances, attributes |
//! | `scene` | scenes, and their commits: from what clients describe to trees of the kernel |
//! | `query` | single rays, packets and streams, points, filters |
//! | `missing` | functions that report that they are not here |
//!
//! The C header is Embree's own. Ray streams of Embree 3 are declared in `include/rtcore_streams.h`.
#![allow(non_snake_case)]

mod abi;
#[macro_use]
mod device;
mod geometry;
mod missing;
mod query;
mod scene;
