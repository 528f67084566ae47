//! Table of formats: extensions, and the functions that read and write their files.

use std::io;
use std::path::Path;

use antumbra_files::Output;

use crate::atomic::atomic_write_seeking;
use crate::error::Unwritten;
use crate::memory::{self, Allowance, Claim, Unread};
use crate::{Channel, Error, Image, Notes, Raster, Rgb8Image, Target, decode, pfm};

/// Function that writes a picture as a file.
type Encode<T> = fn(&T, &mut dyn Output) -> Result<(), Unwritten>;

/// Function from the bytes of a file to a picture, which takes its memory from the claim. Errors are reasons.
type Decode = fn(&[u8], &mut Claim) -> Result<Image, String>;

/// Function from the bytes of a file to its pixels as stored, as [`Decode`].
type DecodeRaster = fn(&[u8], &mut Claim) -> Result<Raster, String>;

/// File format. Unsupported actions are `None`.
pub(crate) struct Format {
    pub extension: &'static str,
    /// Whether a file that starts with these bytes may be of the format.
    starts: fn(&[u8]) -> bool,
    encode: Option<Encode<Image>>,
    encode_rgb8: Option<Encode<Rgb8Image>>,
    decode: Option<Decode>,
    decode_raster: Option<DecodeRaster>,
}

/// Format that can only be read as a raster.
const fn raster_only(
    extension: &'static str,
    starts: fn(&[u8]) -> bool,
    decode: DecodeRaster,
) -> Format {
    Format {
        extension,
        starts,
        encode: None,
        encode_rgb8: None,
        decode: None,
        decode_raster: Some(decode),
    }
}

/// JPEG under one of its extensions.
const fn jpeg(extension: &'static str) -> Format {
    Format {
        extension,
        starts: decode::is_jpeg,
        encode: Some(|image, output| write_jpeg(&image.to_srgb8(), output)),
        encode_rgb8: Some(write_jpeg),
        decode: Some(decode::jpeg_as_linear),
        decode_raster: Some(decode::from_jpeg),
    }
}

/// Every format.
const FORMATS: &[Format] = &[
    Format {
        extension: "exr",
        starts: |bytes| bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]),
        encode: Some(crate::exr::encode),
        encode_rgb8: None,
        decode: Some(crate::exr::decode),
        decode_raster: Some(decode::from_exr),
    },
    Format {
        extension: "png",
        starts: |bytes| bytes.starts_with(b"\x89PNG\r\n\x1a\n"),
        encode: Some(|image, output| write_png(&image.to_srgb8(), output)),
        encode_rgb8: Some(write_png),
        decode: Some(decode::png_as_linear),
        decode_raster: Some(crate::png::decode),
    },
    Format {
        encode: Some(|image, output| {
            let bytes = crate::hdr::encode(image).map_err(Unwritten::Refused)?;
            output.write_all(&bytes).map_err(Unwritten::Io)
        }),
        decode: Some(decode::hdr_as_linear),
        ..raster_only("hdr", decode::is_hdr, decode::from_hdr)
    },
    jpeg("jpeg"),
    jpeg("jpg"),
    raster_only("pfm", pfm::starts, pfm::decode),
    raster_only("pic", decode::is_hdr, decode::from_hdr),
    raster_only("tga", decode::may_be_tga, decode::from_tga),
];

/// Extensions of the formats that [`Image::read`] reads, lower case, without the dot.
pub fn readable_extensions() -> impl Iterator<Item = &'static str> {
    extensions(|format| format.decode.is_some())
}

/// Extensions of the formats that [`Image::write`] writes, lower case, without the dot.
pub fn writable_extensions() -> impl Iterator<Item = &'static str> {
    extensions(|format| format.encode.is_some())
}

/// Extensions of the formats that [`Raster::read`] reads, lower case, without the dot.
pub fn raster_extensions() -> impl Iterator<Item = &'static str> {
    extensions(|format| format.decode_raster.is_some())
}

/// Reads an image whose memory is allowed.
pub(crate) fn read(path: &Path, allowance: &Allowance) -> Result<Image, Error> {
    let (format, decode) = decoder(path)?;
    let mut claim = Claim::new(allowance);
    let bytes = read_file(path, format, &mut claim)?;
    let image = decode(&bytes, &mut claim).map_err(|reason| refusal(path, format, reason))?;
    claim.keep(size_of_val(image.pixels()) as u64);
    Ok(image)
}

pub(crate) fn parse(bytes: &[u8], path: &Path) -> Result<Image, Error> {
    let (format, decode) = decoder(path)?;
    let allowance = Allowance::unlimited();
    decode(bytes, &mut Claim::new(&allowance)).map_err(|reason| refusal(path, format, reason))
}

/// Reads the pixels of a file as stored, whose memory is allowed.
pub(crate) fn read_raster(path: &Path, allowance: &Allowance) -> Result<Raster, Error> {
    let (format, decode) = raster_decoder(path)?;
    let mut claim = Claim::new(allowance);
    let bytes = read_file(path, format, &mut claim)?;
    keep_raster(decode(&bytes, &mut claim), path, format, claim)
}

pub(crate) fn parse_raster(
    bytes: &[u8],
    path: &Path,
    allowance: &Allowance,
) -> Result<Raster, Error> {
    let (format, decode) = raster_decoder(path)?;
    let mut claim = Claim::new(allowance);
    keep_raster(decode(bytes, &mut claim), path, format, claim)
}

/// Alpha channel of a picture; `None` without alpha.
pub(crate) fn parse_alpha(
    bytes: &[u8],
    path: &Path,
    allowance: &Allowance,
) -> Result<Option<Raster>, Error> {
    let (format, _) = raster_decoder(path)?;
    let mut claim = Claim::new(allowance);
    let found = match format.extension {
        "png" => crate::png::decode_alpha(bytes, &mut claim),
        "tga" => decode::alpha_of_tga(bytes, &mut claim),
        _ => return Ok(None),
    };
    let found = found.transpose();
    let kept = found.map(|raster| keep_raster(raster, path, format, claim));
    kept.transpose()
}

/// A decoded raster, whose pixels stay taken from the claim.
fn keep_raster(
    decoded: Result<Raster, String>,
    path: &Path,
    format: &Format,
    claim: Claim,
) -> Result<Raster, Error> {
    let raster = decoded.map_err(|reason| refusal(path, format, reason))?;
    claim.keep(raster.samples().bytes());
    Ok(raster)
}

/// Format of a file name, and the decoder of its pixels as stored.
fn raster_decoder(path: &Path) -> Result<(&'static Format, DecodeRaster), Error> {
    let format = of(path)?;
    let decode = able(path, format, "read", |format| format.decode_raster)?;
    Ok((format, decode))
}

fn decoder(path: &Path) -> Result<(&'static Format, Decode), Error> {
    let format = of(path)?;
    let decode = able(path, format, "read", |format| format.decode)?;
    Ok((format, decode))
}

/// Reads the bytes of a file, or only its start if it is of another format.
fn read_file(path: &Path, format: &Format, claim: &mut Claim) -> Result<Vec<u8>, Error> {
    memory::read_file(path, claim, format.starts).map_err(|error| match error {
        Unread::Io(source) => Error::Read {
            path: path.to_path_buf(),
            source,
        },
        Unread::Refused(reason) => refusal(path, format, reason),
    })
}

/// Error of a file that is not decoded.
fn refusal(path: &Path, format: &Format, reason: String) -> Error {
    Error::Decode {
        path: path.to_path_buf(),
        format: format.extension,
        reason,
    }
}

pub(crate) fn write(image: &Image, path: &Path) -> Result<(), Error> {
    let format = of_output(path, "exr")?;
    let encode = able(path, format, "written", |format| format.encode)?;
    write_with(path, format, |output| encode(image, output))
}

pub(crate) fn write_rgb8(image: &Rgb8Image, path: &Path) -> Result<(), Error> {
    let format = of_output(path, "png")?;
    let action = "written from 8-bit pixels";
    let encode = able(path, format, action, |format| format.encode_rgb8)?;
    write_with(path, format, |output| encode(image, output))
}

/// Replaces a file by what `encode` writes.
fn write_with(
    path: &Path,
    format: &Format,
    encode: impl FnOnce(&mut dyn Output) -> Result<(), Unwritten>,
) -> Result<(), Error> {
    let mut refused = None;
    let written = atomic_write_seeking(path, |output| {
        encode(output).map_err(|error| match error {
            Unwritten::Io(error) => error,
            Unwritten::Refused(reason) => {
                refused = Some(reason);
                io::ErrorKind::InvalidData.into()
            }
        })
    });
    match refused {
        Some(reason) => Err(Error::Encode {
            path: path.to_path_buf(),
            format: format.extension,
            reason,
        }),
        None => written,
    }
}

fn write_png(image: &Rgb8Image, output: &mut dyn Output) -> Result<(), Unwritten> {
    let bytes = crate::png::encode(image).map_err(Unwritten::Refused)?;
    output.write_all(&bytes).map_err(Unwritten::Io)
}

fn write_jpeg(image: &Rgb8Image, output: &mut dyn Output) -> Result<(), Unwritten> {
    let bytes = crate::jpeg::encode(image).map_err(Unwritten::Refused)?;
    output.write_all(&bytes).map_err(Unwritten::Io)
}

/// Writes an image with further channels.
pub(crate) fn write_layers(
    image: &Image,
    path: &Path,
    channels: &[Channel],
    notes: &Notes,
) -> Result<(), Error> {
    let format = only(path, "exr", "written with layers")?;
    write_with(path, format, |output| {
        crate::exr::encode_layers(image, channels, notes, output)
    })
}

/// Writes an image of 16-bit sRGB values as PNG.
pub(crate) fn write_png16(image: &Image, path: &Path) -> Result<(), Error> {
    let format = only(path, "png", "written with 16 bits")?;
    write_with(path, format, |output| {
        let bytes = crate::png::encode16(image).map_err(Unwritten::Refused)?;
        output.write_all(&bytes).map_err(Unwritten::Io)
    })
}

/// The one format that supports `action`, if an output has that format.
fn only(path: &Path, able: &str, action: &'static str) -> Result<&'static Format, Error> {
    let format = of_output(path, able)?;
    if format.extension == able {
        return Ok(format);
    }
    Err(Error::Unsupported {
        path: path.to_path_buf(),
        format: format.extension,
        action,
        able: able.into(),
    })
}

/// Format of an output. A stream whose name has no known extension gets the format of `default`.
fn of_output(path: &Path, default: &str) -> Result<&'static Format, Error> {
    let is_stream = || {
        let target = Target::of(path);
        matches!(
            target,
            Ok(Target::Stream(_) | Target::Stdout | Target::Stderr)
        )
    };
    match of(path) {
        Err(Error::UnknownFormat { .. }) if is_stream() => {
            of(&Path::new("-").with_extension(default))
        }
        format => format,
    }
}

/// Format that the extension of `path` names, in upper or lower case.
fn of(path: &Path) -> Result<&'static Format, Error> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    FORMATS
        .iter()
        .find(|format| extension.eq_ignore_ascii_case(format.extension))
        .ok_or_else(|| Error::UnknownFormat {
            path: path.to_path_buf(),
            extension: extension.into_owned(),
            known: join(extensions(|_| true)),
        })
}

/// Function of `format` for `action`, or an error that lists the formats which support the action.
fn able<F>(
    path: &Path,
    format: &Format,
    action: &'static str,
    function: fn(&Format) -> Option<F>,
) -> Result<F, Error> {
    function(format).ok_or_else(|| Error::Unsupported {
        path: path.to_path_buf(),
        format: format.extension,
        action,
        able: join(extensions(move |format| function(format).is_some())),
    })
}

fn extensions(filter: impl Fn(&Format) -> bool) -> impl Iterator<Item = &'static str> {
    FORMATS
        .iter()
        .filter(move |format| filter(format))
        .map(|format| format.extension)
}

fn join(extensions: impl Iterator<Item = &'static str>) -> String {
    extensions.collect::<Vec<_>>().join(", ")
}
