//! PNG writer for 8-bit sRGB pixels, and reader for pixels of any kind as stored.
//!
//! PNG has no data window. Of a cropped picture, only the pixels of the window are written.

use std::io::Cursor;

use ::png::{
    BitDepth, ColorType, Compression, Decoder, Encoder, Info, Limits, OutputInfo,
    SrgbRenderingIntent, Transformations,
};

use crate::Rgb8Image;
use crate::foreign::contained;
use crate::memory::Claim;
use crate::raster::{MAX_PIXELS, Raster, Samples, check_fits, check_size, map_pixels, rgb8};
use crate::signature::SOFTWARE;

/// Largest number of bytes per deflated byte, 1032 (258 bytes in two bits), rounded up.
const MAX_INFLATION: u64 = 1040;

/// Encodes a picture as a PNG file. Equal pixels give equal bytes: the only text is the name of this program.
pub(crate) fn encode(image: &Rgb8Image) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    encode_into(&mut bytes, image).map_err(|error| error.to_string())?;
    Ok(bytes)
}

fn encode_into(bytes: &mut Vec<u8>, image: &Rgb8Image) -> Result<(), ::png::EncodingError> {
    // Width and height fit, because an image is at most `i32::MAX` wide and high.
    let mut encoder = Encoder::new(bytes, image.width() as u32, image.height() as u32);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_source_srgb(SrgbRenderingIntent::RelativeColorimetric);
    encoder.set_compression(Compression::Balanced);
    encoder.add_text_chunk("Software".into(), SOFTWARE.into())?;
    let mut writer = encoder.write_header()?;
    writer.write_image_data(image.pixels().as_flattened())?;
    writer.finish()
}

/// Encodes linear values as a PNG file of 16-bit sRGB values. Values below 0 and NaN give 0.
pub(crate) fn encode16(image: &crate::Image) -> Result<Vec<u8>, String> {
    let window = image.window();
    let mut bytes = Vec::new();
    let mut encode = || -> Result<(), ::png::EncodingError> {
        let (width, height) = (window.width() as u32, window.height() as u32);
        let mut encoder = Encoder::new(&mut bytes, width, height);
        encoder.set_color(ColorType::Rgb);
        encoder.set_depth(BitDepth::Sixteen);
        encoder.set_source_srgb(SrgbRenderingIntent::RelativeColorimetric);
        encoder.set_compression(Compression::Balanced);
        encoder.add_text_chunk("Software".into(), SOFTWARE.into())?;
        let values = image.pixels().as_flattened().iter();
        let values = values.flat_map(|&value| crate::rgb8::srgb16(value).to_be_bytes());
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&values.collect::<Vec<u8>>())?;
        writer.finish()
    };
    encode().map_err(|error| error.to_string())?;
    Ok(bytes)
}

/// Decodes the bytes of a PNG file: grey or colour, 1 to 16 bits or with a palette, interlaced or not.
///
/// Alpha is dropped. Values are not converted from sRGB.
pub(crate) fn decode(bytes: &[u8], claim: &mut Claim) -> Result<Raster, String> {
    let (values, info) = values(bytes, claim)?;
    let samples = match (info.color_type, info.bit_depth) {
        (ColorType::Grayscale, BitDepth::Eight) => Samples::Grey8(values),
        (ColorType::GrayscaleAlpha, BitDepth::Eight) => {
            Samples::Grey8(map_pixels(&values, 2, |p| p[0]))
        }
        (ColorType::Rgb, BitDepth::Eight) => Samples::Rgb8(rgb8(&values, 3)),
        (ColorType::Rgba, BitDepth::Eight) => Samples::Rgb8(rgb8(&values, 4)),
        (ColorType::Grayscale, BitDepth::Sixteen) => wide(&values, 1),
        (ColorType::GrayscaleAlpha, BitDepth::Sixteen) => wide(&values, 2),
        (ColorType::Rgb, BitDepth::Sixteen) => wide(&values, 3),
        (ColorType::Rgba, BitDepth::Sixteen) => wide(&values, 4),
        (color, depth) => {
            return Err(format!(
                "pixels of type {color:?}, {depth:?} bits, are not supported"
            ));
        }
    };
    Raster::new(info.width, info.height, samples).map_err(|error| error.to_string())
}

/// Alpha channel of a PNG file, in 8 bits. `None` without alpha.
pub(crate) fn decode_alpha(bytes: &[u8], claim: &mut Claim) -> Result<Option<Raster>, String> {
    let (values, info) = values(bytes, claim)?;
    let alpha = match (info.color_type, info.bit_depth) {
        (ColorType::GrayscaleAlpha, BitDepth::Eight) => map_pixels(&values, 2, |p| p[1]),
        (ColorType::Rgba, BitDepth::Eight) => map_pixels(&values, 4, |p| p[3]),
        // The high byte comes first.
        (ColorType::GrayscaleAlpha, BitDepth::Sixteen) => map_pixels(&values, 4, |p| p[2]),
        (ColorType::Rgba, BitDepth::Sixteen) => map_pixels(&values, 8, |p| p[6]),
        _ => return Ok(None),
    };
    Raster::new(info.width, info.height, Samples::Grey8(alpha))
        .map(Some)
        .map_err(|error| error.to_string())
}

/// Values of a PNG file, channels side by side, with their kind.
fn values(bytes: &[u8], claim: &mut Claim) -> Result<(Vec<u8>, OutputInfo), String> {
    // The decoder itself needs at most a row of pixels. The size is checked below.
    let bytes_limit = 16 * MAX_PIXELS as usize;
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: bytes_limit });
    decoder.set_transformations(Transformations::EXPAND);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let info = contained(|| decoder.read_header_info())?;
    let (width, height) = info.size();
    check_size(width.into(), height.into())?;
    let packed = info.raw_bytes() as u64;
    let most = MAX_INFLATION * bytes.len() as u64;
    check_fits("bytes of pixels", packed, most, bytes)?;
    let mut reader = contained(|| decoder.read_info())?;
    check_palette(reader.info())?;
    let size = reader
        .output_buffer_size()
        .ok_or("the image is too large")?;
    // Beside the decoder's values, those of the raster: as many, or floats.
    let floats = reader.output_color_type().1 == BitDepth::Sixteen;
    claim.take(size as u64)?;
    claim.take_pixels(width.into(), height.into(), if floats { 12 } else { 3 })?;
    let mut values = vec![0; size];
    let info = contained(|| reader.next_frame(&mut values))?;
    values.truncate(info.buffer_size());
    Ok((values, info))
}

/// Checks that a palette consists of whole colours. The decoder panics on other palettes.
fn check_palette(info: &Info) -> Result<(), String> {
    match info.palette.as_ref().map_or(0, |palette| palette.len()) {
        bytes if bytes % 3 == 0 => Ok(()),
        bytes => Err(format!(
            "the palette has {bytes} bytes; it must have 3 for every colour"
        )),
    }
}

/// Converts big-endian values of 16 bits to fractions of 1.
fn wide(values: &[u8], channels: usize) -> Samples {
    let value = |p: &[u8], channel: usize| {
        f32::from(u16::from_be_bytes([p[2 * channel], p[2 * channel + 1]])) / 65535.0
    };
    let color_step = usize::from(channels > 2);
    Samples::Rgb32(map_pixels(values, 2 * channels, |p| {
        [value(p, 0), value(p, color_step), value(p, 2 * color_step)]
    }))
}
