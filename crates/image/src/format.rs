//! The table of formats: an extension and what can be done with its files.

use std::path::Path;
use std::{fs, io};

use crate::{Error, Image, Rgb8Image, atomic_write};

/// From a picture to the bytes of a file, or in words why not; this module adds the path.
type Encode<T> = fn(&T) -> Result<Vec<u8>, String>;

/// From the bytes of a file to a picture, or in words why not.
type Decode = fn(&[u8]) -> Result<Image, String>;

/// One file format. What it cannot do is `None`.
struct Format {
    extension: &'static str,
    encode: Option<Encode<Image>>,
    encode_rgb8: Option<Encode<Rgb8Image>>,
    decode: Option<Decode>,
}

/// Every format there is.
const FORMATS: &[Format] = &[
    Format {
        extension: "exr",
        encode: Some(crate::exr::encode),
        encode_rgb8: None,
        decode: Some(crate::exr::decode),
    },
    Format {
        extension: "png",
        encode: Some(|image| crate::png::encode(&image.to_srgb8())),
        encode_rgb8: Some(crate::png::encode),
        decode: None,
    },
];

/// Extensions of the formats that [`Image::read`] reads, lower case, without the dot.
pub fn readable_extensions() -> impl Iterator<Item = &'static str> {
    extensions(|format| format.decode.is_some())
}

/// Extensions of the formats that [`Image::write`] writes, lower case, without the dot.
pub fn writable_extensions() -> impl Iterator<Item = &'static str> {
    extensions(|format| format.encode.is_some())
}

pub(crate) fn read(path: &Path) -> Result<Image, Error> {
    let format = of(path)?;
    let decode = able(path, format, "read", |format| format.decode)?;
    let bytes = fs::read(path).map_err(|source: io::Error| Error::Read {
        path: path.to_path_buf(),
        source,
    })?;
    decode(&bytes).map_err(|reason| Error::Decode {
        path: path.to_path_buf(),
        format: format.extension,
        reason,
    })
}

pub(crate) fn write(image: &Image, path: &Path) -> Result<(), Error> {
    let format = of(path)?;
    let encode = able(path, format, "written", |format| format.encode)?;
    write_bytes(path, format, encode(image))
}

pub(crate) fn write_rgb8(image: &Rgb8Image, path: &Path) -> Result<(), Error> {
    let format = of(path)?;
    let action = "written from 8-bit pixels";
    let encode = able(path, format, action, |format| format.encode_rgb8)?;
    write_bytes(path, format, encode(image))
}

fn write_bytes(
    path: &Path,
    format: &Format,
    encoded: Result<Vec<u8>, String>,
) -> Result<(), Error> {
    let bytes = encoded.map_err(|reason| Error::Encode {
        path: path.to_path_buf(),
        format: format.extension,
        reason,
    })?;
    atomic_write(path, |file| file.write_all(&bytes))
}

/// The format that the extension of `path` names, in any case.
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

/// The function of `format` for `action`, or an error that lists the formats which have it.
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
