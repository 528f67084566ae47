//! glTF 2.0 (`.gltf` and `.glb`): geometry, metallic-roughness materials, cameras and lights, read by the crate `gltf`.
//!
//! Meshes of several nodes become objects with instances, unless they emit light. Skins and morph targets are shown at
//! rest. What is left out is named in the model's notes. Unsupported ways to define surfaces, such as compression and
//! sparse accessors, are errors.
//!
//! Version 1.4.1 of the crate panics on a few broken files. Some numbers are therefore checked first, where comments
//! say so. Buffers are opened here, because the crate would add image decoders as dependencies.
//!
//! - `reader.rs`: nodes, meshes and their accessors
//! - `looks.rs`: materials and textures
//! - `places.rs`: cameras and lights

mod looks;
mod places;
mod reader;

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use ::gltf::buffer::Source;
use ::gltf::json::validation::{self, Checked, Validate};
use ::gltf::{Buffer, Document, Gltf, Semantic, json};
use data_url::{DataUrl, DataUrlError};
use glam::DVec3;
use percent_encoding::percent_decode_str;

use crate::{Error, Model, broken, file};
use reader::Reader;

/// Extensions that are read.
const SUPPORTED_EXTENSIONS: &[&str] = &[
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_texture_transform",
];
/// Prefixes of extensions that change the look of surfaces, not their geometry. Others are left out with a note.
const APPEARANCE_EXTENSIONS: &[&str] = &[
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "KHR_lights_",
];

/// Reads the scene of a glTF file.
///
/// Everything is measured from `origin`; nodes are composed in double precision, and rounded after that.
///
/// The file, all buffers, all meshes and all images may take `max_bytes` each. The limit matters even for a small file, which may
/// use one buffer or mesh any number of times. Files that the glTF file names are looked up in its folder.
///
/// # Errors
/// [`Error::Io`], or [`Error::Broken`] with the first mistakes. Missing images are [warnings](Model::warnings).
pub fn load_gltf(path: &Path, max_bytes: u64, origin: DVec3) -> Result<Model, Error> {
    let bytes = file::read(path, max_bytes, is_gltf).map_err(Error::io(path))?;
    parse_from(&bytes, path, max_bytes, origin)
}

/// A file that is neither JSON nor a GLB is refused before it is read.
fn is_gltf(start: &[u8]) -> Result<(), String> {
    if start.starts_with(b"glTF") || !start.contains(&0) {
        return Ok(());
    }
    Err("not a glTF file: it is neither JSON nor a GLB".to_owned())
}

/// Bytes that a JSON object and a JSON value take at most when they are read, beside the text.
const PER_OBJECT: u64 = 320;
const PER_VALUE: u64 = 16;
/// Bytes that the JSON may always take.
const ALWAYS: u64 = 1 << 20;

/// Checks the memory that the JSON of a file needs, which is far more than its text: an empty node has two bytes.
///
/// Brackets and commas in strings count, too, as do such bytes in the binary data of a GLB up to the JSON's length.
fn check_json(bytes: &[u8], max_bytes: u64) -> Result<(), Vec<String>> {
    let json = match bytes.strip_prefix(b"glTF") {
        Some(rest) => {
            let length = rest.get(8..12).and_then(<[u8]>::first_chunk::<4>);
            let length = length.map_or(0, |&length| u32::from_le_bytes(length) as usize);
            let json = rest.get(16..).unwrap_or_default();
            &json[..length.min(json.len())]
        }
        None => bytes,
    };
    let count = |byte: u8| json.iter().filter(|&&b| b == byte).count() as u64;
    let needed = json.len() as u64 + PER_OBJECT * count(b'{') + PER_VALUE * count(b',');
    if needed <= max_bytes.max(ALWAYS) {
        return Ok(());
    }
    Err(vec![format!(
        "the JSON needs {needed} bytes of memory, more than the {max_bytes} bytes that are allowed"
    )])
}

/// Reads the bytes of a glTF file. Errors name `path`, and files are looked up in its folder.
///
/// # Errors
/// [`Error::Broken`], as for [`load_gltf`].
pub fn parse_gltf(bytes: &[u8], path: &Path, max_bytes: u64) -> Result<Model, Error> {
    parse_from(bytes, path, max_bytes, DVec3::ZERO)
}

/// Reads a model that is measured from `origin`.
fn parse_from(bytes: &[u8], path: &Path, max_bytes: u64, origin: DVec3) -> Result<Model, Error> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let parsed = parse(bytes, folder, max_bytes, origin).map_err(|mistakes| {
        let lines = mistakes.iter();
        let lines = lines.map(|mistake| format!("error: {}: {mistake}", path.display()));
        broken(lines.collect())
    });
    let mut model = parsed?;
    for warning in &mut model.warnings {
        warning.place = path.display().to_string();
    }
    Ok(model)
}

/// Reads the model, or lists all mistakes. Warnings are without a place.
fn parse(bytes: &[u8], folder: &Path, max_bytes: u64, origin: DVec3) -> Result<Model, Vec<String>> {
    check_json(bytes, max_bytes)?;
    let (document, binary) = document(bytes)?;
    let mut mistakes = Vec::new();
    let mut left = max_bytes;
    let mut files = Vec::new();
    let buffers: Vec<_> = document
        .buffers()
        .map(|buffer| {
            let binary = binary.as_deref().filter(|_| buffer.index() == 0);
            let found = contents(&buffer, binary, folder, left, &mut files);
            let contents = found.unwrap_or_else(|mistake| {
                mistakes.push(format!("buffer {}: {mistake}", buffer.index()));
                Cow::Borrowed(&[])
            });
            left = left.saturating_sub(contents.len() as u64);
            contents
        })
        .collect();
    if !mistakes.is_empty() {
        return Err(mistakes);
    }
    let mut reader = Reader::new(&document, &buffers, folder, max_bytes);
    for name in document.extensions_used() {
        if !SUPPORTED_EXTENSIONS.contains(&name) {
            reader.note(format!("extension {name} is not supported and is left out"));
        }
    }
    if document.animations().len() > 0 || document.skins().len() > 0 {
        reader.note("animations and skins are left out: everything is shown at rest");
    }
    let mut model = reader.read(origin)?;
    model.files.extend(files);
    model.files.sort();
    model.files.dedup();
    Ok(model)
}

/// File that a relative reference names, and its name for messages. Errors are reasons.
fn file_of(uri: &str, folder: &Path) -> Result<(PathBuf, String), String> {
    let name = percent_decode_str(uri).decode_utf8().ok();
    let name = name.filter(|_| !uri.contains("://"));
    let name = name.ok_or_else(|| format!("`{uri}` is not the name of a file"))?;
    Ok((folder.join(&*name), name.into_owned()))
}

/// Whether a GLB has fewer bytes than it states.
fn is_short(bytes: &[u8], stated: [u8; 4]) -> bool {
    (bytes.len() as u64) < u64::from(u32::from_le_bytes(stated))
}

/// Reads the JSON of a file, with all references checked, and its binary chunk.
fn document(bytes: &[u8]) -> Result<(Document, Option<Vec<u8>>), Vec<String>> {
    // The crate subtracts the size of the header from the stated length without a check.
    if bytes.is_empty() {
        return Err(vec!["the file is empty".to_owned()]);
    }
    let stated = bytes.get(8..).and_then(<[u8]>::first_chunk::<4>);
    if bytes.starts_with(b"glTF") && stated.is_none_or(|&length| u32::from_le_bytes(length) < 12) {
        return Err(vec!["the GLB is shorter than its header".to_owned()]);
    }
    let Gltf { document, blob } =
        Gltf::from_slice_without_validation(bytes).map_err(|error| match error {
            ::gltf::Error::Deserialize(error) => vec![format!("JSON: {error}")],
            ::gltf::Error::Binary(_) if stated.is_some_and(|&length| is_short(bytes, length)) => {
                let (is, length) = (
                    bytes.len(),
                    stated.map(|&length| u32::from_le_bytes(length)),
                );
                let length = length.unwrap_or_default();
                vec![format!(
                    "the file ends early: {is} of {length} bytes are there"
                )]
            }
            ::gltf::Error::Binary(error) => vec![format!("GLB: {error}")],
            error => vec![error.to_string()],
        })?;

    let mut json = document.into_json();
    let mut mistakes = Vec::new();
    let version = &json.asset.version;
    if !version.starts_with("2.") {
        mistakes.push(format!("glTF version `{version}`; version 2 is supported"));
    }
    // The crate looks up the accessor of positions during validation, without a check of its index.
    let accessors = json.accessors.len();
    for (index, mesh) in json.meshes.iter().enumerate() {
        for (place, primitive) in mesh.primitives.iter().enumerate() {
            let positions = &Checked::Valid(Semantic::Positions);
            let position = primitive.attributes.get(positions);
            if let Some(position) = position.filter(|position| position.value() >= accessors) {
                mistakes.push(format!(
                    "mesh {index}, primitive {place}: accessor {position} is used, but there are only {accessors} \
                     accessors"
                ));
            }
        }
    }
    if !mistakes.is_empty() {
        return Err(mistakes);
    }
    let harmful = |name: &String| {
        !APPEARANCE_EXTENSIONS
            .iter()
            .any(|start| name.starts_with(start))
    };
    json.extensions_required.retain(harmful);
    json.validate(&json, json::Path::new, &mut |path, error| {
        let path = path();
        // Bounds are required by the specification, but some writers omit them, and nothing here needs them.
        let bound = [".min", ".max"].iter().any(|end| path.0.ends_with(end));
        if !(bound && error == validation::Error::Missing) {
            mistakes.push(format!("{path}: {error}"));
        }
    });
    if mistakes.is_empty() {
        Ok((Document::from_json_without_validation(json), blob))
    } else {
        Err(mistakes)
    }
}

/// Bytes of a buffer: the binary chunk, base64 inside the JSON, or a file in the same folder.
fn contents<'a>(
    buffer: &Buffer,
    binary: Option<&'a [u8]>,
    folder: &Path,
    max_bytes: u64,
    files: &mut Vec<PathBuf>,
) -> Result<Cow<'a, [u8]>, String> {
    let bytes = match buffer.source() {
        Source::Bin => {
            Cow::Borrowed(binary.ok_or("no file is named, and there is no binary chunk")?)
        }
        Source::Uri(uri) => Cow::Owned(match DataUrl::process(uri) {
            Ok(data) => data.decode_to_vec().map_err(|error| error.to_string())?.0,
            Err(DataUrlError::NotADataUrl) => {
                let (path, name) = file_of(uri, folder)?;
                let read = file::read(&path, max_bytes, |_| Ok(()));
                files.push(path);
                read.map_err(|error| format!("{name}: {error}"))?
            }
            Err(error) => return Err(error.to_string()),
        }),
    };
    if bytes.len() < buffer.length() {
        let (found, wanted) = (bytes.len(), buffer.length());
        return Err(format!(
            "the buffer declares {wanted} bytes, but its data has only {found}"
        ));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests;
