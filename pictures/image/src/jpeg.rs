//! JPEG writer for 8-bit sRGB pixels. Equal pixels give equal bytes.

use ::image::codecs::jpeg::JpegEncoder;
use ::image::{ExtendedColorType, ImageEncoder};

use crate::Rgb8Image;

/// Quality from 1 to 100. At 92 a picture shows no blocks.
const QUALITY: u8 = 92;
/// Longest side of a JPEG file.
const MAX_SIDE: usize = 65535;

/// Encodes a picture as a JPEG file.
pub(crate) fn encode(image: &Rgb8Image) -> Result<Vec<u8>, String> {
    let (width, height) = (image.width(), image.height());
    if width > MAX_SIDE || height > MAX_SIDE {
        return Err(format!(
            "{width} x {height} pixels are too many; a side has at most {MAX_SIDE}"
        ));
    }
    let mut bytes = Vec::new();
    let encoder = JpegEncoder::new_with_quality(&mut bytes, QUALITY);
    let pixels = image.pixels().as_flattened();
    let written = encoder.write_image(pixels, width as u32, height as u32, ExtendedColorType::Rgb8);
    written.map_err(|error| error.to_string())?;
    Ok(bytes)
}
