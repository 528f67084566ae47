//! PFM reader: a text header, then raw floats from the bottom row to the top.

use crate::memory::Claim;
use crate::raster::{Raster, Samples, check_size, map_pixels};

/// Whether a file starts as a PFM file, after any white space.
pub(crate) fn starts(bytes: &[u8]) -> bool {
    let word = bytes.trim_ascii_start();
    word.is_empty() || word.starts_with(b"PF") || word.starts_with(b"Pf")
}

/// Decodes the bytes of a PFM file: `PF` (colour) or `Pf` (grey, which becomes grey RGB).
///
/// The sign of the scale in the header is the byte order; negative means little-endian. The magnitude is a factor of
/// all values, as in pbrt-v3.
pub(crate) fn decode(bytes: &[u8], claim: &mut Claim) -> Result<Raster, String> {
    let mut header = Header { bytes, at: 0 };
    let channels = match header.word()? {
        b"PF" => 3,
        b"Pf" => 1,
        _ => return Err("the file does not begin with PF or Pf".into()),
    };
    let width: u32 = header.number("width")?;
    let height: u32 = header.number("height")?;
    let scale: f32 = header.number("scale")?;
    if !(scale.is_finite() && scale != 0.0) {
        return Err(format!("the scale is {scale}; it must be finite and not 0"));
    }
    check_size(width.into(), height.into())?;
    let row = width as usize * channels;
    let expected = 4 * row * height as usize;
    let body = header.body()?;
    if body.len() < expected {
        let found = body.len();
        return Err(format!(
            "{width} x {height} pixels need {expected} bytes, but there are {found}"
        ));
    }
    claim.take_pixels(width.into(), height.into(), size_of::<[f32; 3]>() as u64)?;
    let is_little_endian = scale < 0.0;
    let factor = scale.abs();
    let value = |bytes: &[u8]| {
        let bytes = [bytes[0], bytes[1], bytes[2], bytes[3]];
        let value = if is_little_endian {
            f32::from_le_bytes(bytes)
        } else {
            f32::from_be_bytes(bytes)
        };
        factor * value
    };
    let mut pixels = Vec::with_capacity(width as usize * height as usize);
    for bytes in body[..expected].chunks_exact(4 * row).rev() {
        let values = map_pixels(bytes, 4, value);
        if channels == 3 {
            pixels.extend_from_slice(values.as_chunks().0);
        } else {
            pixels.extend(values.iter().map(|&v| [v; 3]));
        }
    }
    Raster::new(width, height, Samples::Rgb32(pixels)).map_err(|error| error.to_string())
}

/// Header: words separated by white space, with exactly one byte of white space after the last.
struct Header<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Header<'a> {
    /// Next word. The byte after the word is not consumed.
    fn word(&mut self) -> Result<&'a [u8], String> {
        let rest = &self.bytes[self.at..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace());
        let word = &rest[start.unwrap_or(rest.len())..];
        let length = word.iter().position(u8::is_ascii_whitespace);
        match (start, length) {
            (Some(start), Some(length)) => {
                self.at += start + length;
                Ok(&word[..length])
            }
            _ => Err("the file ends in its header".into()),
        }
    }

    fn number<T: std::str::FromStr>(&mut self, what: &str) -> Result<T, String> {
        let word = self.word()?;
        let text = std::str::from_utf8(word).ok();
        text.and_then(|text| text.parse().ok()).ok_or_else(|| {
            let shown = String::from_utf8_lossy(&word[..word.len().min(20)]);
            format!("the {what} {shown:?} is not a valid number")
        })
    }

    /// Bytes after the header and its last white space.
    fn body(&self) -> Result<&'a [u8], String> {
        self.bytes
            .get(self.at + 1..)
            .ok_or_else(|| "the file ends in its header".into())
    }
}
