//! The OBJ reader.
#![no_main]

use std::path::Path;

use antumbra_mesh::parse_obj;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    match parse_obj(bytes.to_vec(), Path::new("mesh.obj")) {
        Ok(mesh) => {
            let count = mesh.positions.len();
            assert!(
                mesh.indices
                    .as_flattened()
                    .iter()
                    .all(|i| (*i as usize) < count)
            );
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
