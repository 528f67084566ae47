//! Images as textures. The first byte chooses the format.
#![no_main]

mod decoders;

use antumbra_image::Raster;
use libfuzzer_sys::fuzz_target;

const NAMES: [&str; 5] = ["t.png", "t.tga", "t.exr", "t.pfm", "t.hdr"];

fuzz_target!(init: decoders::tell_panics(), |bytes: &[u8]| {
    let Some((format, bytes)) = bytes.split_first() else {
        return;
    };
    match Raster::parse(bytes, NAMES[usize::from(*format) % NAMES.len()]) {
        Ok(raster) => {
            let pixels = raster.width() as usize * raster.height() as usize;
            assert_eq!(raster.samples().len(), pixels);
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
