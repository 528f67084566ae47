//! The OBJ reader.
#![no_main]

use std::path::Path;

use antumbra_mesh::parse_obj;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    match parse_obj(bytes, Path::new("mesh.obj")) {
        Ok(model) => {
            for shape in &model.shapes {
                let antumbra_scene::Geometry::Mesh(mesh) = &shape.geometry else {
                    continue;
                };
                let count = mesh.positions.len();
                let mut corners = mesh.indices.as_flattened().iter();
                assert!(corners.all(|i| (*i as usize) < count));
            }
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
