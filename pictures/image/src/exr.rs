//! OpenEXR reader and writer: linear RGB with a data window.
//!
//! The display window of a file is the full picture, and its data window is [`Image::window`]. Files are written as
//! scan lines of 32-bit floats with lossless ZIP compression.

use std::io::Cursor;

use ::exr::block;
use ::exr::image::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image as File, Layer, SpecificChannels,
};
use ::exr::math::Vec2;
use ::exr::meta::attribute::{IntegerBounds, LineOrder};
use ::exr::meta::header::{Header, ImageAttributes, LayerAttributes};
use ::exr::prelude::{
    Blocks, Compression, ReadChannels, ReadLayers, ReadSpecificChannel, SmallVec, Text,
    WritableImage, read,
};

use antumbra_files::Output;

use crate::error::Unwritten;
use crate::foreign::contained;
use crate::memory::Claim;
use crate::raster::check_fits;
use crate::signature::SOFTWARE;
use crate::{Channel, Image, Notes, Window, exr_chunks};

/// Largest number of pixels of an image that is read.
const MAX_PIXELS: usize = 1 << 28;
/// Largest number of bytes of pixels per compressed byte: 1032 for deflate, times 4/3 for PXR24, rounded up.
const MAX_INFLATION: u64 = 2048;

/// Writes an image as an EXR file, a block of rows at a time. Equal images give equal bytes: no times, names or
/// versions are stored.
pub(crate) fn encode(image: &Image, output: &mut dyn Output) -> Result<(), Unwritten> {
    let (window, pixels) = (image.window(), image.pixels());
    let width = window.width();
    let channels = SpecificChannels::rgb(|Vec2(x, y): Vec2<usize>| {
        let [r, g, b] = pixels[y * width + x];
        (r, g, b)
    });
    let layer = Layer::new(
        Vec2(width, window.height()),
        LayerAttributes {
            layer_position: Vec2(window.x0, window.y0),
            software_name: Some(SOFTWARE.into()),
            ..LayerAttributes::default()
        },
        Encoding {
            compression: Compression::ZIP16,
            blocks: Blocks::ScanLines,
            line_order: LineOrder::Increasing,
        },
        channels,
    );
    let display = ImageAttributes::with_size(Vec2(image.width(), image.height()));
    let file = File::new(display, layer);
    let written = file.write().non_parallel().to_buffered(output);
    written.map_err(|error| match error {
        ::exr::error::Error::Io(error) => Unwritten::Io(error),
        error => Unwritten::Refused(error.to_string()),
    })
}

/// Writes an image with further channels and notes. Equal values give equal bytes.
pub(crate) fn encode_layers(
    image: &Image,
    further: &[Channel],
    notes: &Notes,
    output: &mut dyn Output,
) -> Result<(), Unwritten> {
    let window = image.window();
    let one = |name: &str, values: Vec<f32>| AnyChannel::new(name, FlatSamples::F32(values));
    let mut channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = SmallVec::new();
    for (axis, name) in ["R", "G", "B"].into_iter().enumerate() {
        channels.push(one(
            name,
            image.pixels().iter().map(|pixel| pixel[axis]).collect(),
        ));
    }
    for channel in further {
        channels.push(one(&channel.name, channel.values.clone()));
    }
    let text = notes.text();
    let layer = Layer::new(
        Vec2(window.width(), window.height()),
        LayerAttributes {
            layer_position: Vec2(window.x0, window.y0),
            software_name: Some(SOFTWARE.into()),
            comments: if text.is_empty() {
                None
            } else {
                Text::new_or_none(text)
            },
            ..LayerAttributes::default()
        },
        Encoding {
            compression: Compression::ZIP16,
            blocks: Blocks::ScanLines,
            line_order: LineOrder::Increasing,
        },
        AnyChannels::sort(channels),
    );
    let display = ImageAttributes::with_size(Vec2(image.width(), image.height()));
    let written = File::new(display, layer)
        .write()
        .non_parallel()
        .to_buffered(output);
    written.map_err(|error| match error {
        ::exr::error::Error::Io(error) => Unwritten::Io(error),
        error => Unwritten::Refused(error.to_string()),
    })
}

/// Names of all channels.
pub(crate) fn channel_names(bytes: &[u8]) -> Result<Vec<String>, String> {
    let chunks = contained(|| block::read(Cursor::new(bytes), false))?;
    let headers = chunks.headers().iter();
    let names = headers.flat_map(|header| &header.channels.list);
    Ok(names.map(|channel| channel.name.to_string()).collect())
}

/// Reads three channels of the first layer that has them.
pub(crate) fn decode_channels(bytes: &[u8], names: [&str; 3]) -> Result<Option<Image>, String> {
    let chunks = contained(|| block::read(Cursor::new(bytes), false))?;
    let has = |header: &Header| {
        let list = &header.channels.list;
        names
            .iter()
            .all(|name| list.iter().any(|channel| channel.name == **name))
    };
    let Some(header) = chunks.headers().iter().find(|header| has(header)) else {
        return Ok(None);
    };
    exr_chunks::check_blocks(header)?;
    let (display, window) = windows(header)?;
    let width = window.width();
    let black = move || vec![[0.0_f32; 3]; window.area()];
    // The decoder takes no name twice.
    let [a, b, c] = names;
    let pixels = contained(|| {
        let layers = read()
            .no_deep_data()
            .largest_resolution_level()
            .specific_channels();
        match a == b && b == c {
            true => layers
                .required(a)
                .collect_pixels(
                    move |_, _| black(),
                    move |pixels: &mut Vec<_>, Vec2(x, y), (grey,): (f32,)| {
                        pixels[y * width + x] = [grey; 3];
                    },
                )
                .first_valid_layer()
                .all_attributes()
                .non_parallel()
                .from_chunks(chunks)
                .map(|file| file.layer_data.channel_data.pixels),
            false => layers
                .required(a)
                .required(b)
                .required(c)
                .collect_pixels(
                    move |_, _| black(),
                    move |pixels: &mut Vec<_>, Vec2(x, y), (a, b, c): (f32, f32, f32)| {
                        pixels[y * width + x] = [a, b, c];
                    },
                )
                .first_valid_layer()
                .all_attributes()
                .non_parallel()
                .from_chunks(chunks)
                .map(|file| file.layer_data.channel_data.pixels),
        }
    })?;
    let image = Image::new(display.width(), display.height(), window, pixels);
    image.map(Some).map_err(|error| error.to_string())
}

/// Decodes the bytes of an EXR file.
///
/// The first layer with channels R, G and B is read. Without such a layer, the first with a luminance channel Y and no
/// chroma is read as grey. Channels of any sample type are converted to `f32`. Other channels and layers are
/// ignored. Positions count from the corner of the display window.
pub(crate) fn decode(bytes: &[u8], claim: &mut Claim) -> Result<Image, String> {
    let chunks = contained(|| block::read(Cursor::new(bytes), false))?;
    for header in chunks.headers() {
        exr_chunks::check_blocks(header)?;
    }
    let (layer, colour) = choose_layer(chunks.headers())?;
    let header = &chunks.headers()[layer];
    let (display, window) = windows(header)?;
    let samples = header.channels.list.iter();
    let pixel: usize = samples.map(|c| c.sample_type.bytes_per_sample()).sum();
    let declared = exr_chunks::pixels(header).saturating_mul(pixel as u64);
    let most = MAX_INFLATION * bytes.len() as u64;
    check_fits("bytes of pixels", declared, most, bytes)?;
    let pixels = [window.width(), window.height()].map(|size| size as u64);
    claim.take_pixels(pixels[0], pixels[1], size_of::<[f32; 3]>() as u64)?;
    exr_chunks::check(bytes, layer)?;
    let width = window.width();

    let black = move |_: Vec2<usize>| vec![[0.0_f32; 3]; window.area()];
    let samples = read().no_deep_data().largest_resolution_level();
    let pixels = contained(|| match colour {
        Colour::Rgb => samples
            .rgb_channels(
                move |size, _| black(size),
                move |pixels: &mut Vec<_>, Vec2(x, y), (r, g, b): (f32, f32, f32)| {
                    pixels[y * width + x] = [r, g, b];
                },
            )
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_chunks(chunks)
            .map(|file| file.layer_data.channel_data.pixels),
        Colour::Luminance => samples
            .specific_channels()
            .required("Y")
            .collect_pixels(
                move |size, _| black(size),
                move |pixels: &mut Vec<_>, Vec2(x, y), (luminance,): (f32,)| {
                    pixels[y * width + x] = [luminance; 3];
                },
            )
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_chunks(chunks)
            .map(|file| file.layer_data.channel_data.pixels),
    })?;
    Image::new(display.width(), display.height(), window, pixels).map_err(|error| error.to_string())
}

/// Colour channels of a layer.
#[derive(Clone, Copy)]
enum Colour {
    Rgb,
    Luminance,
}

impl Colour {
    fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Rgb => &["R", "G", "B"],
            Self::Luminance => &["Y"],
        }
    }
}

/// Chooses the layer to read: the first that has the channels, as the reader of the crate `exr` does.
fn choose_layer(headers: &[Header]) -> Result<(usize, Colour), String> {
    let has = |header: &Header, name: &str| header.channels.list.iter().any(|c| c.name == *name);
    let found = [Colour::Rgb, Colour::Luminance]
        .into_iter()
        .find_map(|colour| {
            let complete = |header: &Header| colour.channels().iter().all(|name| has(header, name));
            Some((headers.iter().position(complete)?, colour))
        });
    let Some((layer, colour)) = found else {
        let names = headers.iter().flat_map(|header| &header.channels.list);
        let names: Vec<_> = names.map(|channel| channel.name.to_string()).collect();
        let names = names.join(", ");
        return Err(format!(
            "no layer has channels R, G and B or a channel Y; the channels are: {names}"
        ));
    };
    let header = &headers[layer];
    if header.deep {
        return Err("deep data is not supported".into());
    }
    if matches!(colour, Colour::Luminance) && (has(header, "RY") || has(header, "BY")) {
        return Err("colours stored as luminance and chroma are not supported".into());
    }
    if let Some(channel) = header
        .channels
        .list
        .iter()
        .find(|c| c.sampling != Vec2(1, 1))
    {
        let Vec2(x, y) = channel.sampling;
        let name = &channel.name;
        return Err(format!(
            "channel {name} is subsampled {x} x {y}, which is not supported"
        ));
    }
    Ok((layer, colour))
}

/// Display and data window of a layer, relative to the corner of the display window.
fn windows(header: &Header) -> Result<(Window, Window), String> {
    let display = header.shared_attributes.display_window;
    let data = IntegerBounds::new(header.own_attributes.layer_position, header.layer_size);
    let move_window = |bounds: IntegerBounds| -> Option<Window> {
        let axis = |origin: i32, start: i32, size: usize| -> Option<(i32, i32)> {
            let start = i64::from(start) - i64::from(origin);
            let end = start.checked_add(i64::try_from(size).ok()?)?;
            Some((i32::try_from(start).ok()?, i32::try_from(end).ok()?))
        };
        let (x0, x1) = axis(display.position.0, bounds.position.0, bounds.size.0)?;
        let (y0, y1) = axis(display.position.1, bounds.position.1, bounds.size.1)?;
        Some(Window { x0, y0, x1, y1 })
    };
    let (Some(full), Some(window)) = (move_window(display), move_window(data)) else {
        return Err(format!(
            "the display window {display:?} or the data window {data:?} is out of range"
        ));
    };
    if window.is_empty() || full.is_empty() {
        return Err(format!(
            "the display window {full} or the data window {window} is empty"
        ));
    }
    if window.area() > MAX_PIXELS {
        let (width, height) = (window.width(), window.height());
        return Err(format!(
            "{width} x {height} pixels are more than the {MAX_PIXELS} allowed"
        ));
    }
    Ok((full, window))
}
