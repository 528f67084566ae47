//! Decoders of TGA, Radiance HDR and JPEG, and conversions between [`Raster`] and [`Image`].

use std::io::Cursor;

use ::image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use crate::foreign::contained;
use crate::memory::Claim;
use crate::raster::{Raster, Samples, check_fits, check_size, map_pixels, rgb8};
use crate::rgb8::linear;
use crate::{Image, Window};

/// Largest number of pixels per byte of a run-length encoded file.
///
/// TGA stores runs of 128 in two bytes, Radiance HDR runs of 255 in four. Old HDR files can chain runs to longer ones.
/// A picture that is mostly such chains is refused.
const MAX_PIXELS_PER_BYTE: u64 = 64;
/// Largest number of pixels per byte of a JPEG file: a block of 64 takes two bits, and progressive files can skip blocks.
const MAX_PIXELS_PER_JPEG_BYTE: u64 = 4096;

/// Reads the data window of an OpenEXR file.
pub(crate) fn from_exr(bytes: &[u8], claim: &mut Claim) -> Result<Raster, String> {
    from_linear(crate::exr::decode(bytes, claim)?)
}

fn from_linear(image: Image) -> Result<Raster, String> {
    let (width, height) = (image.window().width(), image.window().height());
    check_size(width as u64, height as u64)?;
    let samples = Samples::Rgb32(image.into_pixels());
    // Width and height fit, because their product does.
    Raster::new(width as u32, height as u32, samples).map_err(|error| error.to_string())
}

/// Whether a file may be a TGA file, which has no mark of its own: kind of palette, and kind of pixels.
pub(crate) fn may_be_tga(start: &[u8]) -> bool {
    matches!(start, [_, 0 | 1, 1..=3 | 9..=11, ..])
}

/// Reads a Truevision TGA file.
pub(crate) fn from_tga(bytes: &[u8], claim: &mut Claim) -> Result<Raster, String> {
    decode(bytes, ImageFormat::Tga, claim)
}

/// Alpha channel of a Truevision TGA file.
pub(crate) fn alpha_of_tga(bytes: &[u8], claim: &mut Claim) -> Result<Option<Raster>, String> {
    let image = open(bytes, ImageFormat::Tga, claim)?;
    let (width, height) = (image.width(), image.height());
    let values = match image {
        DynamicImage::ImageLumaA8(grey) => map_pixels(&grey, 2, |p| p[1]),
        DynamicImage::ImageRgba8(rgba) => map_pixels(&rgba, 4, |p| p[3]),
        _ => return Ok(None),
    };
    Raster::new(width, height, Samples::Grey8(values))
        .map(Some)
        .map_err(|error| error.to_string())
}

/// Linear picture of a raster whose values are encoded as sRGB.
fn as_linear(raster: Raster) -> Result<Image, String> {
    let (width, height) = (raster.width() as usize, raster.height() as usize);
    let table: Vec<f32> = (0..256).map(|byte| linear(byte as f32 / 255.0)).collect();
    let of_byte = |byte: u8| table[usize::from(byte)];
    let pixels = match raster.into_samples() {
        Samples::Grey8(values) => values.iter().map(|&grey| [of_byte(grey); 3]).collect(),
        Samples::Rgb8(values) => values.iter().map(|rgb| rgb.map(of_byte)).collect(),
        Samples::Rgb32(values) => values.iter().map(|rgb| rgb.map(linear)).collect(),
    };
    Image::new(width, height, Window::full(width, height), pixels).map_err(|e| e.to_string())
}

/// Reads a PNG file as a linear picture.
pub(crate) fn png_as_linear(bytes: &[u8], claim: &mut Claim) -> Result<Image, String> {
    let raster = crate::png::decode(bytes, claim)?;
    claim.take_pixels(raster.width().into(), raster.height().into(), 12)?;
    as_linear(raster)
}

/// Reads a JPEG file as a linear picture.
pub(crate) fn jpeg_as_linear(bytes: &[u8], claim: &mut Claim) -> Result<Image, String> {
    let raster = from_jpeg(bytes, claim)?;
    claim.take_pixels(raster.width().into(), raster.height().into(), 12)?;
    as_linear(raster)
}

/// Reads a Radiance HDR file as a linear picture.
pub(crate) fn hdr_as_linear(bytes: &[u8], claim: &mut Claim) -> Result<Image, String> {
    let raster = from_hdr(bytes, claim)?;
    let (width, height) = (raster.width() as usize, raster.height() as usize);
    match raster.into_samples() {
        Samples::Rgb32(pixels) => {
            let window = Window::full(width, height);
            Image::new(width, height, window, pixels).map_err(|error| error.to_string())
        }
        _ => Err("its values are no floats".into()),
    }
}

/// Whether a file starts as a JPEG file.
pub(crate) fn is_jpeg(start: &[u8]) -> bool {
    start.starts_with(&[0xff, 0xd8, 0xff])
}

/// Reads a JPEG file.
pub(crate) fn from_jpeg(bytes: &[u8], claim: &mut Claim) -> Result<Raster, String> {
    decode(bytes, ImageFormat::Jpeg, claim)
}

/// Whether a file starts as a Radiance HDR file.
pub(crate) fn is_hdr(start: &[u8]) -> bool {
    start.starts_with(b"#?")
}

/// Reads a Radiance HDR file.
pub(crate) fn from_hdr(bytes: &[u8], claim: &mut Claim) -> Result<Raster, String> {
    decode(bytes, ImageFormat::Hdr, claim)
}

/// Decodes a file with the crate `image`.
fn open(bytes: &[u8], format: ImageFormat, claim: &mut Claim) -> Result<DynamicImage, String> {
    let reader = ImageReader::with_format(Cursor::new(bytes), format);
    let decoder = contained(|| reader.into_decoder())?;
    let (width, height) = decoder.dimensions();
    check_size(width.into(), height.into())?;
    let each = match format {
        ImageFormat::Jpeg => MAX_PIXELS_PER_JPEG_BYTE,
        _ => MAX_PIXELS_PER_BYTE,
    };
    let most = each * bytes.len() as u64;
    check_fits("pixels", u64::from(width) * u64::from(height), most, bytes)?;
    // Twice: the decoder's pixels, and those of the raster.
    let each = 2 * u64::from(decoder.color_type().bytes_per_pixel());
    claim.take_pixels(width.into(), height.into(), each)?;
    contained(|| DynamicImage::from_decoder(decoder))
}

/// Reads a file with the crate `image`.
fn decode(bytes: &[u8], format: ImageFormat, claim: &mut Claim) -> Result<Raster, String> {
    let image = open(bytes, format, claim)?;
    let (width, height) = (image.width(), image.height());
    let samples = match image {
        DynamicImage::ImageLuma8(grey) => Samples::Grey8(grey.into_raw()),
        DynamicImage::ImageLumaA8(grey) => Samples::Grey8(map_pixels(&grey, 2, |p| p[0])),
        DynamicImage::ImageRgb8(rgb) => Samples::Rgb8(rgb8(&rgb, 3)),
        DynamicImage::ImageRgba8(rgba) => Samples::Rgb8(rgb8(&rgba, 4)),
        DynamicImage::ImageRgb32F(rgb) => {
            Samples::Rgb32(map_pixels(&rgb, 3, |p| [p[0], p[1], p[2]]))
        }
        other => {
            let found = other.color();
            return Err(format!("pixels of type {found:?} are not supported"));
        }
    };
    Raster::new(width, height, samples).map_err(|error| error.to_string())
}
