//! Layers beside the colours of an EXR file, and notes in it.

use std::path::Path;

use crate::{Error, Image, format};

/// A channel beside red, green and blue.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name, such as `Albedo.R` or `Z`.
    pub name: String,
    /// Values of the window, row by row, top row first.
    pub values: Vec<f32>,
}

/// Sentences about a picture, kept in the attribute `comments` of an EXR file: one `name: value` per line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Notes(pub Vec<(String, String)>);

impl Notes {
    /// The text of the attribute.
    pub(crate) fn text(&self) -> String {
        let lines = self
            .0
            .iter()
            .map(|(name, value)| format!("{name}: {value}"));
        let text = lines.collect::<Vec<_>>().join("\n");
        // Texts of EXR files hold single bytes.
        let ascii = |c: char| if c.is_ascii() { c } else { '?' };
        text.chars().map(ascii).collect()
    }
}

impl Image {
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

    /// Reads three channels of an EXR file as an image, such as `Albedo.R`, `Albedo.G` and `Albedo.B`. `None` if one of
    /// them is missing.
    ///
    /// # Errors
    /// [`Error::Read`] or [`Error::Decode`].
    pub fn read_channels(path: impl AsRef<Path>, names: [&str; 3]) -> Result<Option<Self>, Error> {
        let path = path.as_ref();
        let bytes = std::fs::read(path).map_err(|source| Error::Read {
            path: path.to_path_buf(),
            source,
        })?;
        crate::exr::decode_channels(&bytes, names).map_err(|reason| Error::Decode {
            path: path.to_path_buf(),
            format: "exr",
            reason,
        })
    }
}
