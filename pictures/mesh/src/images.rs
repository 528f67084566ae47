//! Images of textures: each file is read once, and channels are taken apart once.

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use antumbra_image::{Allowance, Raster, Samples};
use antumbra_scene::{
    Image, ImageTexture, Mapping, Param, Pixels, Rgb, Texture, TextureFilter, Wrap,
};

use crate::file;

/// Largest ratio of the axes of a texture's filter, as in pbrt.
const MAX_ANISOTROPY: f32 = 8.0;
/// Bytes per pixel for the coarser levels of an image, which the renderer makes.
const COARSER_LEVELS: u64 = 5;

/// Part of an image that a texture looks up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Channel {
    /// The colours.
    Color,
    /// Red, green or blue as grey.
    One(u8),
    /// The alpha channel. Without one, the image is opaque.
    Alpha,
    /// The alpha channel or, without one, the luminance.
    AlphaOrGrey,
}

/// Image as textures use it.
#[derive(Clone, Debug)]
pub(crate) struct Loaded {
    pub image: Arc<Image>,
    /// Whether the values are encoded for displays: 8-bit formats are.
    pub encoded: bool,
}

/// How a texture lies on a surface.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Laid {
    pub mapping: Mapping,
    pub wrap: Wrap,
}

impl Loaded {
    fn laid(&self, laid: Laid, gamma: bool, scale: f32) -> ImageTexture {
        ImageTexture {
            image: Arc::clone(&self.image),
            mapping: laid.mapping,
            wrap: laid.wrap,
            filter: TextureFilter::Ewa {
                max_anisotropy: MAX_ANISOTROPY,
            },
            gamma,
            scale,
        }
    }

    /// Colours, decoded if the image is encoded.
    pub fn color(&self, laid: Laid) -> Param<Rgb> {
        Param::Texture(Arc::new(Texture::Image(self.laid(laid, self.encoded, 1.0))))
    }

    /// Values as the file has them, as colours.
    pub fn raw(&self, laid: Laid) -> Param<Rgb> {
        Param::Texture(Arc::new(Texture::Image(self.laid(laid, false, 1.0))))
    }

    /// Values as the file has them, times a factor.
    pub fn number(&self, laid: Laid, scale: f32) -> Param<f32> {
        Param::Texture(Arc::new(Texture::Image(self.laid(laid, false, scale))))
    }
}

/// Why there is no image. The text is a reason, without the name of the image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Unread {
    /// The file does not exist, or has a format that is not supported. A model can do without.
    Absent(String),
    /// The image is damaged or too large.
    Bad(String),
}

impl From<String> for Unread {
    fn from(reason: String) -> Self {
        Self::Bad(reason)
    }
}

impl From<&str> for Unread {
    fn from(reason: &str) -> Self {
        Self::Bad(reason.to_owned())
    }
}

impl Unread {
    /// With something before the reason.
    pub fn of(self, name: &str) -> Self {
        match self {
            Self::Absent(reason) => Self::Absent(format!("{name}: {reason}")),
            Self::Bad(reason) => Self::Bad(format!("{name}: {reason}")),
        }
    }
}

/// Images read so far, with the memory that is left for more.
pub(crate) struct Images {
    allowance: Allowance,
    files: HashMap<PathBuf, Arc<[u8]>>,
    decoded: HashMap<(String, Channel), Result<Loaded, Unread>>,
}

impl Images {
    /// No images yet, within so many bytes.
    pub fn new(max_bytes: u64) -> Self {
        Self {
            allowance: Allowance::new(max_bytes),
            files: HashMap::new(),
            decoded: HashMap::new(),
        }
    }

    /// Files that were read.
    pub fn paths(&self) -> impl Iterator<Item = &PathBuf> {
        self.files.keys()
    }

    /// An image from a file.
    pub fn file(&mut self, path: &Path, channel: Channel) -> Result<Loaded, Unread> {
        let bytes = match self.files.get(path) {
            Some(bytes) => Arc::clone(bytes),
            None => {
                let left = self.allowance.left();
                let bytes =
                    file::read(path, left, |_| Ok(())).map_err(|error| match error.kind() {
                        io::ErrorKind::NotFound => Unread::Absent(error.to_string()),
                        _ => Unread::Bad(error.to_string()),
                    })?;
                let bytes: Arc<[u8]> = bytes.into();
                self.files.insert(path.to_path_buf(), Arc::clone(&bytes));
                bytes
            }
        };
        self.bytes(&bytes, &path.to_string_lossy(), channel)
    }

    /// An image from the bytes of a file, which `name` stands for.
    pub fn bytes(&mut self, bytes: &[u8], name: &str, channel: Channel) -> Result<Loaded, Unread> {
        let key = (name.to_owned(), channel);
        if let Some(known) = self.decoded.get(&key) {
            return known.clone();
        }
        let loaded = decode(bytes, name, channel, &self.allowance);
        self.decoded.insert(key, loaded.clone());
        loaded
    }

    /// A flat image made by the reader.
    pub fn make(&mut self, name: &str, make: impl FnOnce() -> Image) -> Loaded {
        let key = (name.to_owned(), Channel::Color);
        let made = self.decoded.entry(key).or_insert_with(|| {
            Ok(Loaded {
                image: Arc::new(make()),
                encoded: false,
            })
        });
        made.clone().unwrap_or_else(|_| Loaded {
            image: Arc::new(Image {
                name: name.to_owned(),
                width: 1,
                height: 1,
                pixels: Pixels::Grey8(vec![255]),
            }),
            encoded: false,
        })
    }
}

/// Name whose extension gives the format: by the first bytes of the file, or else by its name.
fn named_by_contents(bytes: &[u8], name: &str) -> PathBuf {
    let path = Path::new(name);
    let format = match bytes {
        [0x89, b'P', b'N', b'G', ..] => "png",
        [0xff, 0xd8, 0xff, ..] => "jpg",
        [0x76, 0x2f, 0x31, 0x01, ..] => "exr",
        [b'#', b'?', ..] => "hdr",
        _ => return path.to_path_buf(),
    };
    path.with_extension(format)
}

fn decode(
    bytes: &[u8],
    name: &str,
    channel: Channel,
    allowance: &Allowance,
) -> Result<Loaded, Unread> {
    let path = named_by_contents(bytes, name);
    let reason = |error: antumbra_image::Error| match error {
        antumbra_image::Error::Decode { reason, .. } => Unread::Bad(reason),
        antumbra_image::Error::UnknownFormat { known, .. } => Unread::Absent(format!(
            "the image format is not supported; known are {known}"
        )),
        error => Unread::Bad(error.to_string()),
    };
    let alpha = match channel {
        Channel::Alpha | Channel::AlphaOrGrey => {
            Raster::parse_alpha(bytes, &path, allowance).map_err(reason)?
        }
        Channel::Color | Channel::One(_) => None,
    };
    let raster = match (alpha, channel) {
        (Some(alpha), _) => alpha,
        (None, Channel::Alpha) => {
            Raster::new(1, 1, Samples::Grey8(vec![255])).map_err(|e| e.to_string())?
        }
        (None, _) => Raster::parse_within(bytes, &path, allowance).map_err(reason)?,
    };
    let (width, height) = (raster.width(), raster.height());
    let pixels = match (raster.into_samples(), channel) {
        (Samples::Grey8(values), _) => Pixels::Grey8(values),
        (Samples::Rgb8(values), Channel::One(one)) => {
            Pixels::Grey8(values.iter().map(|rgb| rgb[usize::from(one)]).collect())
        }
        (Samples::Rgb32(values), Channel::One(one)) => {
            let grey = |rgb: &[f32; 3]| [rgb[usize::from(one)]; 3];
            Pixels::Rgb32(values.iter().map(grey).collect())
        }
        (Samples::Rgb8(values), _) => Pixels::Rgb8(values),
        (Samples::Rgb32(values), _) => Pixels::Rgb32(values),
    };
    let levels = u64::from(width) * u64::from(height) * COARSER_LEVELS;
    if allowance.left() < levels {
        let left = allowance.left();
        return Err(Unread::Bad(format!(
            "its levels need {levels} bytes of memory, more than the {left} bytes that are left"
        )));
    }
    let extension = path.extension().unwrap_or_default();
    let linear = ["exr", "hdr", "pfm", "pic"];
    Ok(Loaded {
        image: Arc::new(Image {
            name: name.to_owned(),
            width,
            height,
            pixels,
        }),
        encoded: !(linear.iter()).any(|linear| extension.eq_ignore_ascii_case(linear)),
    })
}

/// Product of a constant and a texture.
pub(crate) fn times<T>(factor: T, one: T, texture: Option<Param<T>>) -> Param<T>
where
    T: PartialEq + 'static,
{
    match texture {
        None => Param::Constant(factor),
        Some(texture) if factor == one => texture,
        Some(texture) => {
            let factors = [Param::Constant(factor), texture];
            Param::Texture(Arc::new(Texture::Scale(factors)))
        }
    }
}
