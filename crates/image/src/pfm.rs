//! PFM: floats as they are, from the bottom row to the top, after a header of words.

use crate::raster::{Raster, Samples, check_size, every};

/// The image in the bytes of a PFM file: `PF` (colour) or `Pf` (grey, which becomes grey RGB).
///
/// The sign of the scale in its header is the byte order (negative: little-endian); other values than 1 are
/// factors, as pbrt-v3 has it.
pub(crate) fn decode(bytes: &[u8]) -> Result<Raster, String> {
    let mut header = Header { bytes, at: 0 };
    let channels = match header.word()? {
        b"PF" => 3,
        b"Pf" => 1,
        _ => return Err("it does not begin with PF or Pf".into()),
    };
    let width: u32 = header.number("width")?;
    let height: u32 = header.number("height")?;
    let scale: f32 = header.number("scale")?;
    if !(scale.is_finite() && scale != 0.0) {
        return Err(format!("its scale is {scale}"));
    }
    check_size(width.into(), height.into())?;
    let row = width as usize * channels;
    let expected = 4 * row * height as usize;
    let body = header.body()?;
    if body.len() < expected {
        let found = body.len();
        return Err(format!(
            "{width} x {height} pixels need {expected} bytes, there are {found}"
        ));
    }
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
        let values = every(bytes, 4, value);
        if channels == 3 {
            pixels.extend_from_slice(values.as_chunks().0);
        } else {
            pixels.extend(values.iter().map(|&v| [v; 3]));
        }
    }
    Raster::new(width, height, Samples::Rgb32(pixels)).map_err(|error| error.to_string())
}

/// Words separated by white space, exactly one byte of it after the last.
struct Header<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Header<'a> {
    /// The next word; the byte after it stays.
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
            _ => Err("it ends in its header".into()),
        }
    }

    fn number<T: std::str::FromStr>(&mut self, what: &str) -> Result<T, String> {
        let word = self.word()?;
        let text = std::str::from_utf8(word).ok();
        text.and_then(|text| text.parse().ok()).ok_or_else(|| {
            let shown = String::from_utf8_lossy(&word[..word.len().min(20)]);
            format!("its {what} is {shown:?}")
        })
    }

    /// What follows the white space behind the header.
    fn body(&self) -> Result<&'a [u8], String> {
        self.bytes
            .get(self.at + 1..)
            .ok_or_else(|| "it ends in its header".into())
    }
}
