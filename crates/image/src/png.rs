//! PNG: 8-bit sRGB pixels, written only.
//!
//! PNG has no data window: of a crop only the pixels of the window are written.

use ::png::{BitDepth, ColorType, Compression, Encoder, SrgbRenderingIntent};

use crate::Rgb8Image;

/// The bytes of a PNG file. They depend on the pixels alone: no times, no text.
pub(crate) fn encode(image: &Rgb8Image) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    encode_into(&mut bytes, image).map_err(|error| error.to_string())?;
    Ok(bytes)
}

fn encode_into(bytes: &mut Vec<u8>, image: &Rgb8Image) -> Result<(), ::png::EncodingError> {
    // Both fit: an image is at most `i32::MAX` wide and high.
    let mut encoder = Encoder::new(bytes, image.width() as u32, image.height() as u32);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_source_srgb(SrgbRenderingIntent::RelativeColorimetric);
    encoder.set_compression(Compression::Balanced);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(image.pixels().as_flattened())?;
    writer.finish()
}
