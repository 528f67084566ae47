//! The glTF reader, JSON and binary. No file lies where the scene pretends to.
#![no_main]

use std::path::Path;

use antumbra_mesh::parse_gltf;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    match parse_gltf(bytes, Path::new("/nowhere/scene.gltf"), 1 << 26) {
        Ok(model) => {
            let objects = model.objects.iter().flat_map(|object| &object.shapes);
            let mut shapes = model.shapes.iter().chain(objects);
            assert!(shapes.all(|shape| shape.material < model.materials.len()));
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
