//! The glTF reader, JSON and binary. No file lies where the scene pretends to.
#![no_main]

use std::path::Path;

use antumbra_mesh::parse_gltf;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    match parse_gltf(bytes, Path::new("/nowhere/scene.gltf"), 1 << 26) {
        Ok((shapes, materials)) => {
            assert!(shapes.iter().all(|shape| shape.material < materials.len()));
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
