//! Methods that read and write files, in the formats of `format.rs`.

use std::path::Path;

use crate::{Allowance, Channel, Display, Error, Image, Notes, Raster, Rgb8Image, format};

impl Image {
    /// Reads an image file. The extension of its name chooses the format, in upper or lower case.
    ///
    /// # Errors
    /// [`Error::UnknownFormat`], [`Error::Unsupported`] for a format that cannot be read as an `Image`,
    /// [`Error::Read`] or [`Error::Decode`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        Self::read_within(path, &Allowance::unlimited())
    }

    /// Reads an image file as [`Image::read`], within the memory that is allowed.
    ///
    /// File, pixels and what a decoder needs beside them are taken from the allowance before they are allocated. The
    /// pixels stay taken.
    ///
    /// # Errors
    /// As [`Image::read`]. [`Error::Decode`] if the memory does not suffice.
    pub fn read_within(path: impl AsRef<Path>, allowance: &Allowance) -> Result<Self, Error> {
        format::read(path.as_ref(), allowance)
    }

    /// Reads an image from the bytes of a file. The extension of `path` chooses the format; errors name the path.
    ///
    /// # Errors
    /// As [`Image::read`], except [`Error::Read`].
    pub fn parse(bytes: &[u8], path: impl AsRef<Path>) -> Result<Self, Error> {
        format::parse(bytes, path.as_ref())
    }

    /// Writes an image file. The extension of its name chooses the format, in upper or lower case.
    ///
    /// Equal images give equal bytes. The file is replaced as a whole or not at all, as by
    /// [`atomic_write`](crate::atomic_write).
    ///
    /// # Errors
    /// [`Error::UnknownFormat`], [`Error::Encode`] or [`Error::Write`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        format::write(self, path.as_ref())
    }

    /// Writes an image as [`Image::write`] does, with these values for displays. EXR and HDR files keep linear values.
    ///
    /// # Errors
    /// As [`Image::write`].
    pub fn write_for(&self, path: impl AsRef<Path>, display: &Display) -> Result<(), Error> {
        if display.is_plain() || is_linear(path.as_ref()) {
            return self.write(path);
        }
        self.shown(display).write(path)
    }

    /// Writes a PNG file of 16-bit sRGB values.
    ///
    /// # Errors
    /// As [`Image::write`]. [`Error::Unsupported`] for other formats.
    pub fn write_png16(&self, path: impl AsRef<Path>, display: &Display) -> Result<(), Error> {
        format::write_png16(&self.shown(display), path.as_ref())
    }

    /// Writes an EXR file with further channels and with notes. Equal values give equal bytes.
    ///
    /// # Errors
    /// As [`Image::write`]. [`Error::Unsupported`] for other formats. [`Error::WrongCount`] if a channel does not have a
    /// value for every pixel of the window.
    pub fn write_layers(
        &self,
        path: impl AsRef<Path>,
        channels: &[Channel],
        notes: &Notes,
    ) -> Result<(), Error> {
        for channel in channels {
            if channel.values.len() != self.pixels().len() {
                return Err(Error::WrongCount {
                    expected: self.pixels().len(),
                    found: channel.values.len(),
                });
            }
        }
        format::write_layers(self, path.as_ref(), channels, notes)
    }

    /// Names of the channels of an EXR file, such as `R`, `Albedo.R` or `Z`.
    ///
    /// # Errors
    /// [`Error::Read`] or [`Error::Decode`].
    pub fn channel_names(path: impl AsRef<Path>) -> Result<Vec<String>, Error> {
        of_exr(path.as_ref(), crate::exr::channel_names)
    }

    /// Reads three channels of an EXR file as an image, such as `Albedo.R`, `Albedo.G` and `Albedo.B`. One name three
    /// times makes a grey image. `None` if one of them is missing.
    ///
    /// # Errors
    /// [`Error::Read`] or [`Error::Decode`].
    pub fn read_channels(path: impl AsRef<Path>, names: [&str; 3]) -> Result<Option<Self>, Error> {
        let decode = |bytes: &[u8]| crate::exr::decode_channels(bytes, names);
        of_exr(path.as_ref(), decode)
    }
}

/// Decodes an EXR file in memory.
fn of_exr<T>(path: &Path, decode: impl Fn(&[u8]) -> Result<T, String>) -> Result<T, Error> {
    let bytes = std::fs::read(path).map_err(|source| Error::Read {
        path: path.to_path_buf(),
        source,
    })?;
    decode(&bytes).map_err(|reason| Error::Decode {
        path: path.to_path_buf(),
        format: "exr",
        reason,
    })
}

impl Rgb8Image {
    /// Bytes of a PNG file of the picture. Equal pixels give equal bytes.
    ///
    /// # Errors
    /// [`Error::Encode`].
    pub fn to_png(&self) -> Result<Vec<u8>, Error> {
        crate::png::encode(self).map_err(|reason| Error::Encode {
            path: "a picture in memory".into(),
            format: "png",
            reason,
        })
    }

    /// Writes an image file in a format of 8-bit pixels, as [`Image::write`](crate::Image::write) does.
    ///
    /// # Errors
    /// [`Error::UnknownFormat`], [`Error::Unsupported`] for a format without 8-bit pixels, [`Error::Encode`] or
    /// [`Error::Write`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        format::write_rgb8(self, path.as_ref())
    }
}

impl Raster {
    /// Reads an image file. The extension of its name chooses the format, in upper or lower case.
    ///
    /// Formats are listed by [`raster_extensions`](crate::raster_extensions). Images have at most 2^27 pixels.
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
        format::read_raster(path.as_ref(), allowance)
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
        format::parse_raster(bytes, path.as_ref(), allowance)
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
        format::parse_alpha(bytes, path.as_ref(), allowance)
    }
}

/// Whether files of this name hold linear values.
fn is_linear(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default();
    !["png", "jpg", "jpeg"]
        .iter()
        .any(|name| extension.eq_ignore_ascii_case(name))
}
