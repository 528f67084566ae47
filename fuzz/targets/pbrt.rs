//! The .pbrt reader: lexer, parser and scene builder. No file lies where the text pretends to.
#![no_main]

use std::path::Path;

use antumbra_pbrt::{Error, Options, parse};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &[u8]| {
    let options = Options {
        orders: &["simple", "sort+"],
        ..Options::default()
    };
    match parse(text.to_vec(), Path::new("/nowhere/scene.pbrt"), &options) {
        Ok(loaded) => assert!(
            loaded
                .scene
                .stored_shapes()
                .all(|shape| shape.material < loaded.scene.materials.len())
        ),
        Err(error) => {
            assert!(!error.to_string().is_empty());
            assert!(matches!(error, Error::Scene(_)), "{error}");
        }
    }
});
