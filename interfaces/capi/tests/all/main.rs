//! Tests of the C interface.
//!
//! - `header`: what it declares is what the library has
//! - `same_bits`: answers of its functions against the kernel
//! - `programs`: programs in C and C++ that are compiled, linked and run
//! - `support`: compilers and the static library

mod header;
#[cfg(unix)]
mod programs;
mod same_bits;
mod support;
