//! glTF 2.0 (`.gltf` and `.glb`): geometry, metallic-roughness materials, cameras and lights, read by the crate `gltf`.
//!
//! Meshes of several nodes become objects with instances, unless they emit light. Skins and morph targets become plain
//! meshes at rest. What is left out and changes only looks is named in the model's notes. Compressed meshes are errors.
//! Only what the shown scene needs is checked.
//!
//! Version 1.4.1 of the crate panics on a few broken files. Some numbers are therefore checked first, where comments
//! say so. Buffers are opened here, because the crate would add image decoders as dependencies.
//!
//! - `needs.rs`: what the shown scene refers to
//! - `reader.rs`: nodes, meshes and instances
//! - `accessors.rs`: numbers in buffers
//! - `pose.rs`: morph targets and skins
//! - `looks.rs`: materials and textures
//! - `places.rs`: cameras and lights

mod accessors;
mod looks;
mod needs;
mod places;
mod pose;
mod reader;

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use ::gltf::buffer::Source;
use ::gltf::json::validation::{self, Checked, Validate};
use ::gltf::json::{Root, Value};
use ::gltf::{Buffer, Document, Glb, Semantic, json};
use data_url::{DataUrl, DataUrlError};
use glam::DVec3;
use percent_encoding::percent_decode_str;

use crate::{Error, Model, broken, file};
use needs::Needs;
use reader::Reader;

/// Extensions that are read.
const SUPPORTED_EXTENSIONS: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
];
/// Extension of meshes that are compressed.
const DRACO: &str = "KHR_draco_mesh_compression";
/// Extensions of compression. Files may have the same meshes without it as well, if they do not require them.
const COMPRESSIONS: &[&str] = &[DRACO, "EXT_meshopt_compression", "KHR_meshopt_compression"];
/// Extensions that move what they are left out of.
const MOVING_EXTENSIONS: &[&str] = &["CESIUM_RTC"];
/// Prefixes of extensions that change the look of surfaces, not their geometry. Others are left out with a note.
const APPEARANCE_EXTENSIONS: &[&str] = &[
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "KHR_lights_",
    "KHR_technique",
];

/// Reads the scene of a glTF file.
///
/// Everything is measured from `origin`; nodes are composed in double precision, and rounded after that.
///
/// The file, all buffers, all meshes and all images may take `max_bytes` each. The limit matters even for a small file, which may
/// use one buffer or mesh any number of times. Files that the glTF file names are looked up in its folder.
///
/// # Errors
/// [`Error::Io`], or [`Error::Broken`] with the first mistakes. Missing images are [warnings](Model::warnings). Without
/// `looks`, no image is read, and nothing is said of materials.
pub fn load_gltf(path: &Path, max_bytes: u64, origin: DVec3, looks: bool) -> Result<Model, Error> {
    let bytes = file::read(path, max_bytes, is_gltf).map_err(Error::io(path))?;
    parse_from(&bytes, path, max_bytes, origin, looks)
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
const PER_VALUE: u64 = 32;
/// Bytes that the JSON may always take.
const ALWAYS: u64 = 1 << 20;

/// Contents the memory that the JSON of a file needs, which is far more than its text: an empty node has two bytes.
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
    parse_from(bytes, path, max_bytes, DVec3::ZERO, true)
}

/// Reads a model that is measured from `origin`.
fn parse_from(
    bytes: &[u8],
    path: &Path,
    max_bytes: u64,
    origin: DVec3,
    looks: bool,
) -> Result<Model, Error> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let parsed = parse(bytes, folder, max_bytes, origin, looks).map_err(|mistakes| {
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
fn parse(
    bytes: &[u8],
    folder: &Path,
    max_bytes: u64,
    origin: DVec3,
    looks: bool,
) -> Result<Model, Vec<String>> {
    check_json(bytes, max_bytes)?;
    let (document, binary, needs) = document(bytes, looks)?;
    let mut mistakes = Vec::new();
    let mut left = max_bytes;
    let mut files = Vec::new();
    let buffers: Vec<_> = document
        .buffers()
        .map(|buffer| {
            if !needs.has("buffers", buffer.index()) {
                return Cow::Borrowed(&[][..]);
            }
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
    let mut reader = Reader::new(&document, &buffers, looks.then_some(folder), max_bytes);
    for name in document.extensions_used() {
        let text = format!("extension {name} is not supported and is left out");
        match name {
            // What is compressed is also there without compression, or else an error.
            name if SUPPORTED_EXTENSIONS.contains(&name) || COMPRESSIONS.contains(&name) => {}
            name if MOVING_EXTENSIONS.contains(&name) => {
                reader.warn(format!("{text}: the model may be in another place"));
            }
            name if changes_looks(name) => reader.look_note(&text),
            _ => reader.note(text),
        }
    }
    if !document.as_json().animations.is_empty() {
        reader.note("animations are left out: everything is shown at rest");
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

/// Whether an extension changes the looks of surfaces, and not their geometry.
fn changes_looks(name: &str) -> bool {
    let mut prefixes = APPEARANCE_EXTENSIONS.iter();
    prefixes.any(|start| name.starts_with(start))
}

/// Why a compressed file is refused.
fn compressed(extension: &str) -> String {
    format!(
        "the meshes are compressed by {extension}, which is not read; \
         `gltf-transform copy IN.glb OUT.glb` writes them without"
    )
}

/// Why a file of another version is refused.
fn of_version(version: &str) -> Vec<String> {
    let help = match version.starts_with("1.") {
        true => "; `gltf-pipeline -i IN.gltf -o OUT.gltf` makes version 2 of version 1",
        false => "",
    };
    vec![format!(
        "glTF version `{version}`, where version 2 is supported{help}"
    )]
}

/// A document, its binary chunk, and what the shown scene needs.
type Contents = (Document, Option<Vec<u8>>, Needs);

/// Reads the JSON of a file, with all references checked that the shown scene needs, and its binary chunk.
fn document(bytes: &[u8], looks: bool) -> Result<Contents, Vec<String>> {
    let (text, binary) = container(bytes)?;
    let mut json = root(antumbra_scene::without_mark(&text))?;
    let required = std::mem::take(&mut json.extensions_required);
    if let Some(name) = required
        .iter()
        .find(|name| COMPRESSIONS.contains(&&***name))
    {
        return Err(vec![compressed(name)]);
    }
    let mut mistakes = Vec::new();
    for name in required {
        if !SUPPORTED_EXTENSIONS.contains(&&*name) && !changes_looks(&name) {
            mistakes.push(format!(
                "the file requires the extension {name}, which is not supported"
            ));
        }
    }
    let needs = Needs::of(&json, looks);
    // The crate looks up the accessor of positions during validation, without a check of its index.
    let accessors = json.accessors.len();
    for (index, mesh) in json.meshes.iter_mut().enumerate() {
        if !needs.has("meshes", index) {
            mesh.primitives.clear();
        }
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
    json.validate(&json, json::Path::new, &mut |path, error| {
        let path = path();
        // Nothing here needs bounds, which some writers omit. Primitives without positions are left out, and accessors without
        // a view are zero.
        let may_lack = ["min", "max", "[\"POSITION\"]", "bufferView"];
        let may_lack = may_lack.iter().any(|end| path.0.ends_with(end));
        let is_lack = may_lack && error == validation::Error::Missing;
        // Attributes with names of their own are not read.
        let is_own = path.0.ends_with("<invalid semantic name>\"]");
        if !is_lack && !is_own && needs.has_path(&path.0) && !path.0.starts_with("animations[") {
            mistakes.push(format!("{path}: {error}"));
        }
    });
    match mistakes.is_empty() {
        true => Ok((Document::from_json_without_validation(json), binary, needs)),
        false => Err(mistakes),
    }
}

/// The JSON of a file, and the binary data of a GLB.
type Container<'a> = (Cow<'a, [u8]>, Option<Vec<u8>>);

/// Takes a GLB apart. Other files are JSON as a whole.
fn container(bytes: &[u8]) -> Result<Container<'_>, Vec<String>> {
    // The crate subtracts the size of the header from the stated length without a check.
    if bytes.is_empty() {
        return Err(vec!["the file is empty".to_owned()]);
    }
    let is_glb = bytes.starts_with(b"glTF");
    let number = |place: usize| {
        let bytes = bytes.get(place..).and_then(<[u8]>::first_chunk::<4>);
        bytes.map(|&bytes| u32::from_le_bytes(bytes))
    };
    if is_glb && number(8).is_none_or(|length| length < 12) {
        return Err(vec!["the GLB is shorter than its header".to_owned()]);
    }
    if is_glb && number(4) == Some(1) {
        return Err(of_version("1.0"));
    }
    if !is_glb {
        return Ok((Cow::Borrowed(bytes), None));
    }
    match Glb::from_slice(bytes) {
        Ok(glb) => Ok((glb.json, glb.bin.map(Cow::into_owned))),
        Err(error) => {
            let (is, stated) = (bytes.len() as u64, number(8).unwrap_or_default());
            Err(vec![match error {
                _ if is < stated.into() => {
                    format!("the file ends early: {is} of {stated} bytes are there")
                }
                ::gltf::Error::Binary(error) => format!("GLB: {error}"),
                error => error.to_string(),
            }])
        }
    }
}

/// The JSON of a file. Scenes without nodes are valid, but not for the crate.
fn root(text: &[u8]) -> Result<Root, Vec<String>> {
    let error = match json::deserialize::from_slice::<Root>(text) {
        Ok(root) => match &root.asset.version {
            version if version.starts_with("2.") => return Ok(root),
            version => return Err(of_version(version)),
        },
        Err(error) => vec![format!("JSON: {error}")],
    };
    let mut value: Value = json::deserialize::from_slice(text).map_err(|_| error.clone())?;
    // Version 1 has objects where version 2 has lists.
    let version = value
        .get("asset")
        .and_then(|asset| asset.get("version"))
        .cloned();
    let is_old = value.get("meshes").is_some_and(Value::is_object);
    match version.as_ref().and_then(Value::as_str) {
        Some(version) if !version.starts_with("2.") => return Err(of_version(version)),
        None if is_old => return Err(of_version("1.0")),
        _ => {}
    }
    let scenes = value.get_mut("scenes").and_then(Value::as_array_mut);
    for scene in scenes
        .into_iter()
        .flatten()
        .filter_map(Value::as_object_mut)
    {
        scene
            .entry("nodes")
            .or_insert_with(|| Value::Array(Vec::new()));
    }
    json::deserialize::from_value(value).map_err(|_| error)
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
