//! The PLY reader: ascii and both byte orders.
#![no_main]

use std::path::Path;

use antumbra_pbrt::parse_ply;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    match parse_ply(bytes, Path::new("mesh.ply")) {
        Ok(mesh) => {
            let count = mesh.positions.len();
            assert!(
                mesh.indices
                    .as_flattened()
                    .iter()
                    .all(|i| (*i as usize) < count)
            );
            assert!(mesh.normals.is_empty() || mesh.normals.len() == count);
            assert!(mesh.uvs.is_empty() || mesh.uvs.len() == count);
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
