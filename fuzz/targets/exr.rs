//! OpenEXR pictures as the image tools read them.
#![no_main]

mod decoders;

use antumbra_image::Image;
use libfuzzer_sys::fuzz_target;

fuzz_target!(init: decoders::tell_panics(), |bytes: &[u8]| {
    match Image::parse(bytes, "picture.exr") {
        Ok(image) => assert_eq!(image.pixels().len(), image.window().area()),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
