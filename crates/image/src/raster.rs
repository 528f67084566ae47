//! [`Raster`]: pixels as a file stores them, without conversion.
//!
//! Textures are read this way, because only the lookup knows whether they are sRGB, linear or no colours.

use std::io::Cursor;
use std::path::Path;

use ::image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use crate::foreign::contained;
use crate::memory::{Allowance, Claim};
use crate::rgb8::linear;
use crate::{Error, Image, Window, format};

/// Largest number of pixels of an image that is read.
pub(crate) const MAX_PIXELS: u64 = 1 << 27;
/// Largest number of pixels per byte of a run-length encoded file.
///
/// TGA stores runs of 128 in two bytes, Radiance HDR runs of 255 in four. Old HDR files can chain runs to longer ones.
/// A picture that is mostly such chains is refused.
const MAX_PIXELS_PER_BYTE: u64 = 64;
/// Largest number of pixels per byte of a JPEG file: a block of 64 takes two bits, and progressive files can skip blocks.
const MAX_PIXELS_PER_JPEG_BYTE: u64 = 4096;

/// Image with the values of its file, row by row, top row first. There is at least one pixel.
///
/// 8-bit values and floats are kept, and 16-bit values are divided by 65535. No colour space is converted. Alpha is
/// dropped, and palettes are looked up. OpenEXR files give the pixels of their data window.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    width: u32,
    height: u32,
    samples: Samples,
}

/// Values of a [`Raster`], `[pixels]` or `[pixels, 3]`.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Grey values from 0 to 255.
    Grey8(Vec<u8>),
    /// Red, green and blue from 0 to 255.
    Rgb8(Vec<[u8; 3]>),
    /// Red, green and blue, unbounded.
    Rgb32(Vec<[f32; 3]>),
}

impl Samples {
    /// Number of pixels.
    pub fn len(&self) -> usize {
        match self {
            Self::Grey8(values) => values.len(),
            Self::Rgb8(values) => values.len(),
            Self::Rgb32(values) => values.len(),
        }
    }

    /// Bytes of all values.
    fn bytes(&self) -> u64 {
        let bytes = match self {
            Self::Grey8(values) => size_of_val(&values[..]),
            Self::Rgb8(values) => size_of_val(&values[..]),
            Self::Rgb32(values) => size_of_val(&values[..]),
        };
        bytes as u64
    }

    /// Returns true if there are no pixels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Raster {
    /// Makes an image of `width * height` pixels, row by row, top row first.
    ///
    /// # Errors
    /// [`Error::BadSize`] or [`Error::WrongCount`].
    pub fn new(width: u32, height: u32, samples: Samples) -> Result<Self, Error> {
        let size = [width as usize, height as usize];
        let [valid_width, valid_height] = size.map(|s| (1..=i32::MAX as usize).contains(&s));
        if !valid_width || !valid_height {
            let [width, height] = size;
            return Err(Error::BadSize { width, height });
        }
        let expected = size[0].saturating_mul(size[1]);
        if samples.len() != expected {
            return Err(Error::WrongCount {
                expected,
                found: samples.len(),
            });
        }
        Ok(Self {
            width,
            height,
            samples,
        })
    }

    /// Reads an image file. The extension of its name chooses the format, in upper or lower case.
    ///
    /// Formats are those of [`raster_extensions`](crate::raster_extensions). Images have at most 2^27 pixels.
    ///
    /// # Errors
    /// [`Error::UnknownFormat`], [`Error::Read`] (also if `path` is not a regular file) or [`Error::Decode`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        Self::read_within(path, &Allowance::unlimited())
    }

    /// Reads an image file as [`Raster::read`], within the memory that is allowed.
    ///
    /// File, pixels and what a decoder needs beside them are taken from the allowance before they are allocated. The
    /// pixels stay taken.
    ///
    /// # Errors
    /// As [`Raster::read`]. [`Error::Decode`] if the memory does not suffice.
    pub fn read_within(path: impl AsRef<Path>, allowance: &Allowance) -> Result<Self, Error> {
        let path = path.as_ref();
        let (format, decode) = format::raster_decoder(path)?;
        let mut claim = Claim::new(allowance);
        let bytes = format::read_file(path, format, &mut claim)?;
        let raster =
            decode(&bytes, &mut claim).map_err(|reason| format::refusal(path, format, reason))?;
        claim.keep(raster.samples.bytes());
        Ok(raster)
    }

    /// Reads an image from the bytes of a file. The extension of `path` chooses the format; errors name the path.
    ///
    /// # Errors
    /// [`Error::UnknownFormat`] or [`Error::Decode`].
    pub fn parse(bytes: &[u8], path: impl AsRef<Path>) -> Result<Self, Error> {
        Self::parse_within(bytes, path, &Allowance::unlimited())
    }

    /// Reads an image from the bytes of a file as [`Raster::parse`], within the memory that is allowed.
    ///
    /// The pixels stay taken.
    ///
    /// # Errors
    /// As [`Raster::parse`]. [`Error::Decode`] if the memory does not suffice.
    pub fn parse_within(
        bytes: &[u8],
        path: impl AsRef<Path>,
        allowance: &Allowance,
    ) -> Result<Self, Error> {
        let path = path.as_ref();
        let (format, decode) = format::raster_decoder(path)?;
        let mut claim = Claim::new(allowance);
        let raster =
            decode(bytes, &mut claim).map_err(|reason| format::refusal(path, format, reason))?;
        claim.keep(raster.samples.bytes());
        Ok(raster)
    }

    /// Alpha channel of an image as grey bytes, from the bytes of a file. `None` without alpha.
    ///
    /// # Errors
    /// As [`Raster::parse_within`].
    pub fn parse_alpha(
        bytes: &[u8],
        path: impl AsRef<Path>,
        allowance: &Allowance,
    ) -> Result<Option<Self>, Error> {
        let path = path.as_ref();
        let (format, _) = format::raster_decoder(path)?;
        let mut claim = Claim::new(allowance);
        let found = match format.extension {
            "png" => crate::png::decode_alpha(bytes, &mut claim),
            "tga" => alpha_of_tga(bytes, &mut claim),
            _ => Ok(None),
        };
        let found = found.map_err(|reason| format::refusal(path, format, reason))?;
        claim.keep(found.as_ref().map_or(0, |raster| raster.samples.bytes()));
        Ok(found)
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Values, row by row, top row first.
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// Values by value, row by row, top row first.
    pub fn into_samples(self) -> Samples {
        self.samples
    }
}

/// Checks the size of an image before anything is allocated.
pub(crate) fn check_size(width: u64, height: u64) -> Result<(), String> {
    let pixels = width.saturating_mul(height);
    if pixels == 0 {
        return Err(format!(
            "the size {width} x {height} is empty; width and height must be at least 1"
        ));
    }
    if pixels > MAX_PIXELS {
        return Err(format!(
            "{width} x {height} pixels are more than the {MAX_PIXELS} allowed"
        ));
    }
    Ok(())
}

/// Checks that a file is long enough for the image that its header declares, at the best compression of its format.
///
/// Called before anything is allocated, so that a few damaged bytes cannot demand all memory. `what` names the unit of
/// `declared` and `most`.
pub(crate) fn check_fits(what: &str, declared: u64, most: u64, file: &[u8]) -> Result<(), String> {
    if declared <= most {
        return Ok(());
    }
    let length = file.len();
    Err(format!(
        "the header declares {declared} {what}, but a file of {length} bytes holds at most {most}; the file is cut \
         short, or its header is wrong"
    ))
}

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
fn alpha_of_tga(bytes: &[u8], claim: &mut Claim) -> Result<Option<Raster>, String> {
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
    let (width, height) = (raster.width as usize, raster.height as usize);
    let table: Vec<f32> = (0..256).map(|byte| linear(byte as f32 / 255.0)).collect();
    let of_byte = |byte: u8| table[usize::from(byte)];
    let pixels = match raster.samples {
        Samples::Grey8(values) => values.iter().map(|&grey| [of_byte(grey); 3]).collect(),
        Samples::Rgb8(values) => values.iter().map(|rgb| rgb.map(of_byte)).collect(),
        Samples::Rgb32(values) => values.iter().map(|rgb| rgb.map(linear)).collect(),
    };
    Image::new(width, height, Window::full(width, height), pixels).map_err(|e| e.to_string())
}

/// Reads a PNG file as a linear picture.
pub(crate) fn png_as_linear(bytes: &[u8], claim: &mut Claim) -> Result<Image, String> {
    let raster = crate::png::decode(bytes, claim)?;
    claim.take_pixels(raster.width.into(), raster.height.into(), 12)?;
    as_linear(raster)
}

/// Reads a JPEG file as a linear picture.
pub(crate) fn jpeg_as_linear(bytes: &[u8], claim: &mut Claim) -> Result<Image, String> {
    let raster = from_jpeg(bytes, claim)?;
    claim.take_pixels(raster.width.into(), raster.height.into(), 12)?;
    as_linear(raster)
}

/// Reads a Radiance HDR file as a linear picture.
pub(crate) fn hdr_as_linear(bytes: &[u8], claim: &mut Claim) -> Result<Image, String> {
    let raster = from_hdr(bytes, claim)?;
    let (width, height) = (raster.width as usize, raster.height as usize);
    match raster.samples {
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

/// Makes one value of each group of `channels` values.
pub(crate) fn map_pixels<T, U>(values: &[T], channels: usize, value: impl Fn(&[T]) -> U) -> Vec<U> {
    values.chunks_exact(channels).map(value).collect()
}

/// First three values of each group of `channels` values.
pub(crate) fn rgb8(values: &[u8], channels: usize) -> Vec<[u8; 3]> {
    map_pixels(values, channels, |p| [p[0], p[1], p[2]])
}
