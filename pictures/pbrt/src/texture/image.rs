//! Images that textures and lights look up. A file that is named several times is read once.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use antumbra_image::{Allowance, Error, Raster, Samples};
use antumbra_scene::{Image, Pixels};
use rayon::prelude::*;

use crate::lookup::Lookup;
use crate::params::{ParamType, Params, Values};

/// Bytes per pixel for the coarser levels of an image, which the renderer makes, and for making them.
const COARSER_LEVELS: u64 = 5;

/// Images read so far.
#[derive(Default)]
pub(crate) struct Images {
    by_path: HashMap<PathBuf, Result<Arc<Image>, Problem>>,
    /// Bytes of the images that were used for the first time since the last call of [`Self::newly_used`].
    newly_used: u64,
    used: HashSet<PathBuf>,
    /// Memory that images may take which are read when they are used, in bytes.
    pub allowed: u64,
    /// Time spent on reading.
    pub time: Duration,
}

/// Reason why an image was not read, and what would be right.
#[derive(Clone)]
struct Problem {
    message: String,
    help: Option<String>,
}

impl Images {
    /// Reads images in parallel, before they are used, within the memory that is allowed. Mistakes are reported only when
    /// an image is used.
    pub fn read_ahead(&mut self, folder: &Path, names: &[&str], allowance: &Allowance) {
        let mut unread: Vec<(PathBuf, &str)> = Vec::new();
        let mut known = HashSet::new();
        for name in names {
            let id = identity(folder.join(name));
            if !self.by_path.contains_key(&id) && known.insert(id.clone()) {
                unread.push((id, name));
            }
        }
        let start = Instant::now();
        let read: Vec<_> = unread
            .into_par_iter()
            .map(|(id, name)| {
                // The image is read by its name, because a link may lead to a name without extension.
                let image = read(&folder.join(name), name, allowance);
                (id, image)
            })
            .collect();
        self.by_path.extend(read);
        self.time += start.elapsed();
    }

    /// Canonical paths of all images.
    pub fn paths(&self) -> impl Iterator<Item = &PathBuf> {
        self.by_path.keys()
    }

    /// Image that a string parameter names. `None`: a mistake was reported.
    pub fn of(&mut self, lookup: &mut Lookup, param: &'static str) -> Option<Arc<Image>> {
        let (name, span) = lookup.needed_string(param)?;
        let folder = lookup.report.sources.folder.clone();
        self.read_ahead(&folder, &[name], &Allowance::new(self.allowed));
        let id = identity(folder.join(name));
        let image = self.by_path.get(&id)?;
        match image {
            Ok(image) => {
                if self.used.insert(id) {
                    let texels = u64::from(image.width) * u64::from(image.height);
                    self.newly_used += image.pixels.bytes() + COARSER_LEVELS * texels;
                }
                Some(Arc::clone(image))
            }
            Err(Problem { message, help }) => {
                let message = format!("cannot read image {name:?}: {message}");
                lookup.report.add_error(span, message, help.clone());
                None
            }
        }
    }
}

impl Images {
    /// Bytes of the images that were used for the first time since the last call.
    pub fn newly_used(&mut self) -> u64 {
        std::mem::take(&mut self.newly_used)
    }
}

/// File name among the parameters of an image map.
pub(super) fn file_name(params: &Params) -> Option<&str> {
    let is_it =
        |p: &&crate::params::Param| p.name == "filename" && p.param_type == ParamType::String;
    match &params.list.iter().find(is_it)?.values {
        Values::Strings(names) if names.len() == 1 => Some(&names[0]),
        _ => None,
    }
}

/// Returns true if a file of that name contains sRGB values by default, as in pbrt-v3.
pub(super) fn is_encoded(name: &str) -> bool {
    let extension = Path::new(name).extension().unwrap_or_default();
    ["jpeg", "jpg", "png", "tga"]
        .iter()
        .any(|encoded| extension.eq_ignore_ascii_case(encoded))
}

/// Canonical path of a file, or the path itself if the file is missing.
fn identity(path: PathBuf) -> PathBuf {
    path.canonicalize().unwrap_or(path)
}

fn read(path: &Path, name: &str, allowance: &Allowance) -> Result<Arc<Image>, Problem> {
    let raster = Raster::read_within(path, allowance).map_err(|error| match error {
        Error::Read { source, .. } => Problem {
            message: source.to_string(),
            help: Some("paths start at the folder of the main scene file".into()),
        },
        Error::Decode { reason, .. } => Problem {
            message: reason,
            help: None,
        },
        Error::UnknownFormat { .. } => Problem {
            message: "the image format is not supported".into(),
            help: Some(format!(
                "known: {}",
                antumbra_image::raster_extensions()
                    .collect::<Vec<_>>()
                    .join(", ")
            )),
        },
        error => Problem {
            message: error.to_string(),
            help: None,
        },
    })?;
    Ok(Arc::new(Image {
        name: name.to_owned(),
        width: raster.width(),
        height: raster.height(),
        pixels: match raster.into_samples() {
            Samples::Grey8(values) => Pixels::Grey8(values),
            Samples::Rgb8(values) => Pixels::Rgb8(values),
            Samples::Rgb32(values) => Pixels::Rgb32(values),
        },
    }))
}
