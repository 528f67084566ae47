//! Where the bytes are: the chunks of a GLB file, files beside it, and base64 inside the JSON.

use std::borrow::Cow;
use std::path::Path;

use super::document::{Buffer, Document};

const MAGIC: &[u8] = b"glTF";
const JSON: &[u8] = b"JSON";
const BINARY: &[u8] = b"BIN\0";

/// The JSON of a file and its binary chunk. A file that does not begin as a GLB is JSON as a whole.
pub(super) fn open(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), String> {
    if !bytes.starts_with(MAGIC) {
        return Ok((bytes, None));
    }
    let version = number(bytes, 4)?;
    if version != 2 {
        return Err(format!("GLB version {version}; version 2 is supported"));
    }
    let (kind, json, next) = chunk(bytes, 12)?;
    if kind != JSON {
        return Err("the first chunk of the GLB is not JSON".to_owned());
    }
    let binary = match next < bytes.len() {
        true => Some(chunk(bytes, next)?),
        false => None,
    };
    let binary = binary.filter(|(kind, ..)| *kind == BINARY);
    Ok((json, binary.map(|(_, data, _)| data)))
}

/// Kind and data of the chunk at `start`, and where the next one starts.
fn chunk(bytes: &[u8], start: usize) -> Result<(&[u8], &[u8], usize), String> {
    let length = number(bytes, start)? as usize;
    let data = start + 8;
    let kind = bytes.get(start + 4..data);
    let end = data.checked_add(length);
    let content = end.and_then(|end| Some((bytes.get(data..end)?, end)));
    match (kind, content) {
        (Some(kind), Some((content, end))) => Ok((kind, content, end)),
        _ => Err(format!(
            "the GLB chunk at byte {start} wants {length} bytes, but the file ends at byte {}",
            bytes.len()
        )),
    }
}

fn number(bytes: &[u8], at: usize) -> Result<u32, String> {
    let found = bytes.get(at..).and_then(<[u8]>::first_chunk::<4>);
    let found = found.ok_or_else(|| format!("the GLB file ends at byte {}", bytes.len()))?;
    Ok(u32::from_le_bytes(*found))
}

/// The contents of all buffers; those that are not there leave a mistake and an empty one.
pub(super) fn buffers<'a>(
    document: &Document,
    binary: Option<&'a [u8]>,
    folder: &Path,
    mistakes: &mut Vec<String>,
) -> Vec<Cow<'a, [u8]>> {
    let list = document.buffers.iter().enumerate();
    list.map(|(index, buffer)| {
        let binary = binary.filter(|_| index == 0);
        buffer_bytes(buffer, binary, folder).unwrap_or_else(|mistake| {
            mistakes.push(format!("buffer {index}: {mistake}"));
            Cow::Borrowed(&[])
        })
    })
    .collect()
}

fn buffer_bytes<'a>(
    buffer: &Buffer,
    binary: Option<&'a [u8]>,
    folder: &Path,
) -> Result<Cow<'a, [u8]>, String> {
    let bytes = match &buffer.uri {
        None => Cow::Borrowed(binary.ok_or("it names no file, and there is no binary chunk")?),
        Some(uri) => Cow::Owned(match uri.strip_prefix("data:") {
            Some(data) => {
                let (_, text) = data
                    .split_once(";base64,")
                    .ok_or("its data are not base64")?;
                base64(text)?
            }
            None => {
                let name = unescape(uri)?;
                std::fs::read(folder.join(&name)).map_err(|error| format!("{name}: {error}"))?
            }
        }),
    };
    if bytes.len() < buffer.byte_length {
        let (found, wanted) = (bytes.len(), buffer.byte_length);
        return Err(format!(
            "it should hold {wanted} bytes, but there are {found}"
        ));
    }
    Ok(bytes)
}

/// A relative reference as the name of a file: `%20` and the like are what they stand for.
fn unescape(uri: &str) -> Result<String, String> {
    let bad = || format!("`{uri}` is not the name of a file");
    if uri.contains("://") {
        return Err(bad());
    }
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        rest = after;
        bytes.push(if first == b'%' {
            let (digits, after) = rest.split_at_checked(2).ok_or_else(bad)?;
            rest = after;
            let digits = std::str::from_utf8(digits).map_err(|_| bad())?;
            u8::from_str_radix(digits, 16).map_err(|_| bad())?
        } else {
            first
        });
    }
    String::from_utf8(bytes).map_err(|_| bad())
}

/// The bytes that base64 text stands for (RFC 4648).
pub(super) fn base64(text: &str) -> Result<Vec<u8>, String> {
    let digits = text.trim_end_matches('=').as_bytes();
    let mut bytes = Vec::with_capacity(digits.len() / 4 * 3 + 2);
    for (block, group) in digits.chunks(4).enumerate() {
        let mut bits = 0u32;
        for (i, &digit) in group.iter().enumerate() {
            let value = match digit {
                b'A'..=b'Z' => digit - b'A',
                b'a'..=b'z' => digit - b'a' + 26,
                b'0'..=b'9' => digit - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => {
                    let place = 4 * block + i + 1;
                    return Err(format!("character {place} of its data is not base64"));
                }
            };
            bits |= u32::from(value) << (18 - 6 * i);
        }
        if group.len() == 1 {
            return Err("its base64 data end within a byte".to_owned());
        }
        let [_, decoded @ ..] = bits.to_be_bytes();
        bytes.extend_from_slice(&decoded[..group.len() - 1]);
    }
    Ok(bytes)
}
