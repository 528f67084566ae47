//! Tests of builders, collapses and child orders that plug into the kernel.
//!
//! - [`lists`]: what lists say of their rows
//! - [`answers`]: every row, in turns with all others, against brute force
//! - [`engines`]: every width on every instruction set, against the kernel's own
//! - [`builds`]: trees of every builder are shallow, complete and deterministic
//! - [`oracle`]: no order beats it
//! - [`worked_example`]: the order that the book shows how to write

mod answers;
mod builds;
mod engines;
mod lists;
mod oracle;
mod worked_example;

use antumbra::{Geometry, Ray};
use antumbra_testkit::{Mesh, TestRay};

/// The mesh as kernel geometry.
fn geometry(mesh: &Mesh) -> Geometry<'_> {
    Geometry::triangles(&mesh.positions[..], &mesh.indices[..])
}

/// A test ray as a kernel ray.
fn kernel_ray(ray: &TestRay) -> Ray {
    let mut made = Ray::new(ray.org, ray.dir);
    (made.tnear, made.tfar) = (ray.tnear, ray.tfar);
    made
}
