//! Pixels as a file stores them: textures are decoded by whoever looks them up, who knows whether they are
//! sRGB, linear or no colours at all.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use ::image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use crate::foreign::contained;
use crate::{Error, Image, format};

/// Largest number of pixels that is read.
pub(crate) const MAX_PIXELS: u64 = 1 << 27;
/// Pixels that a byte of a run-length encoded file stands for at most: TGA has runs of 128 in two bytes, Radiance
/// HDR of 255 in four. (HDR of old can chain runs to longer ones; a picture that is mostly such chains is refused.)
const MOST_PIXELS_PER_BYTE: u64 = 64;

/// An image with the values of its file, row by row, top row first; at least one pixel.
///
/// Nothing is converted: 8-bit values stay what they are, those of 16 bits are divided by 65535, floats are
/// taken over. Alpha is left out, palettes are looked up. Of OpenEXR the pixels of the data window are taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    width: u32,
    height: u32,
    samples: Samples,
}

/// The values of a [`Raster`].
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// One number from 0 to 255 per pixel.
    Grey8(Vec<u8>),
    /// Red, green and blue from 0 to 255.
    Rgb8(Vec<[u8; 3]>),
    /// Red, green and blue.
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

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Raster {
    /// An image from its parts.
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

    /// Reads an image file; the extension of its name, in any case, chooses the format. All formats of
    /// [`raster_extensions`](crate::raster_extensions) are read. At most 2^27 pixels.
    ///
    /// # Errors
    /// [`Error::UnknownFormat`], [`Error::Read`] (also for what is not a regular file) or [`Error::Decode`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        format::raster_decoder(path)?;
        let bytes = read_file(path).map_err(|source| Error::Read {
            path: path.to_path_buf(),
            source,
        })?;
        Self::parse(&bytes, path)
    }

    /// The same for the bytes of a file; `path` names the format, and is what messages call it.
    ///
    /// # Errors
    /// [`Error::UnknownFormat`] or [`Error::Decode`].
    pub fn parse(bytes: &[u8], path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let (extension, decode) = format::raster_decoder(path)?;
        decode(bytes).map_err(|reason| Error::Decode {
            path: path.to_path_buf(),
            format: extension,
            reason,
        })
    }

    /// Pixels per row.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Number of rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The values, row by row, top row first.
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// The values, taken out of the image.
    pub fn into_samples(self) -> Samples {
        self.samples
    }
}

/// A device may never end, so that only regular files are read.
pub(crate) fn read_file(path: &Path) -> std::io::Result<Vec<u8>> {
    // Asked before opening: opening a pipe would wait for its writer.
    if !fs::metadata(path)?.is_file() {
        let message = "it is not a regular file";
        return Err(std::io::Error::new(
            std::io::ErrorKind::InvalidInput,
            message,
        ));
    }
    fs::read(path)
}

/// Whether a size is one that is read; checked before anything is allocated.
pub(crate) fn check_size(width: u64, height: u64) -> Result<(), String> {
    let pixels = width.saturating_mul(height);
    if pixels == 0 {
        return Err(format!("it has {width} x {height} pixels"));
    }
    if pixels > MAX_PIXELS {
        return Err(format!(
            "{width} x {height} pixels are more than {MAX_PIXELS}"
        ));
    }
    Ok(())
}

/// Whether a file is long enough for what its header declares, compressed as well as its format can; checked before
/// anything is allocated, so that a few damaged bytes cannot ask for all the memory. `declared` and `most` are in the
/// same unit, which `what` names.
pub(crate) fn check_fits(what: &str, declared: u64, most: u64, file: &[u8]) -> Result<(), String> {
    if declared <= most {
        return Ok(());
    }
    let length = file.len();
    Err(format!(
        "its header declares {declared} {what}, but a file of {length} bytes holds {most} at most; it is cut short, or \
         its header is wrong"
    ))
}

/// The data window of an OpenEXR file.
pub(crate) fn from_exr(bytes: &[u8]) -> Result<Raster, String> {
    from_linear(crate::exr::decode(bytes)?)
}

fn from_linear(image: Image) -> Result<Raster, String> {
    let (width, height) = (image.window().width(), image.window().height());
    check_size(width as u64, height as u64)?;
    let samples = Samples::Rgb32(image.into_pixels());
    // Both fit: the product does.
    Raster::new(width as u32, height as u32, samples).map_err(|error| error.to_string())
}

/// A Truevision TGA file.
pub(crate) fn from_tga(bytes: &[u8]) -> Result<Raster, String> {
    decode(bytes, ImageFormat::Tga)
}

/// A Radiance HDR file.
pub(crate) fn from_hdr(bytes: &[u8]) -> Result<Raster, String> {
    decode(bytes, ImageFormat::Hdr)
}

/// What the crate `image` reads.
fn decode(bytes: &[u8], format: ImageFormat) -> Result<Raster, String> {
    let reader = ImageReader::with_format(Cursor::new(bytes), format);
    let decoder = contained(|| reader.into_decoder())?;
    let (width, height) = decoder.dimensions();
    check_size(width.into(), height.into())?;
    let most = MOST_PIXELS_PER_BYTE * bytes.len() as u64;
    check_fits("pixels", u64::from(width) * u64::from(height), most, bytes)?;
    let image = contained(|| DynamicImage::from_decoder(decoder))?;
    let samples = match image {
        DynamicImage::ImageLuma8(grey) => Samples::Grey8(grey.into_raw()),
        DynamicImage::ImageLumaA8(grey) => Samples::Grey8(every(&grey, 2, |p| p[0])),
        DynamicImage::ImageRgb8(rgb) => Samples::Rgb8(rgb8(&rgb, 3)),
        DynamicImage::ImageRgba8(rgba) => Samples::Rgb8(rgb8(&rgba, 4)),
        DynamicImage::ImageRgb32F(rgb) => Samples::Rgb32(every(&rgb, 3, |p| [p[0], p[1], p[2]])),
        other => return Err(format!("its pixels are of type {:?}", other.color())),
    };
    Raster::new(width, height, samples).map_err(|error| error.to_string())
}

/// One value made of each group of `channels`.
pub(crate) fn every<T, U>(values: &[T], channels: usize, value: impl Fn(&[T]) -> U) -> Vec<U> {
    values.chunks_exact(channels).map(value).collect()
}

/// The first three of each group of `channels`.
pub(crate) fn rgb8(values: &[u8], channels: usize) -> Vec<[u8; 3]> {
    every(values, channels, |p| [p[0], p[1], p[2]])
}
