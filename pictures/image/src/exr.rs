//! OpenEXR reader and writer: linear RGB with a data window.
//!
//! The display window of a file is the full picture, and its data window is [`Image::window`]. Files are written as
//! scan lines of 32-bit floats with lossless ZIP compression.

use std::io::Cursor;

use ::exr::block;
use ::exr::image::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image as File, Layer, SpecificChannels,
    write::channels::WritableChannels,
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
    let (pixels, width) = (image.pixels(), image.window().width());
    let channels = SpecificChannels::rgb(|Vec2(x, y): Vec2<usize>| {
        let [r, g, b] = pixels[y * width + x];
        (r, g, b)
    });
    let file = file(image, None, channels);
    let written = file.write().non_parallel().to_buffered(output);
    written.map_err(unwritten)
}

/// Writes an image with further channels and notes. Equal values give equal bytes.
pub(crate) fn encode_layers(
    image: &Image,
    further: &[Channel],
    notes: &Notes,
    output: &mut dyn Output,
) -> Result<(), Unwritten> {
    let one = |name: &str, values: Vec<f32>| AnyChannel::new(name, FlatSamples::F32(values));
    let mut channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = SmallVec::new();
    for (axis, name) in ["R", "G", "B"].into_iter().enumerate() {
        let values = image.pixels().iter().map(|pixel| pixel[axis]);
        channels.push(one(name, values.collect()));
    }
    for channel in further {
        channels.push(one(&channel.name, channel.values.clone()));
    }
    let comments = Some(notes.text()).filter(|text| !text.is_empty());
    let comments = comments.and_then(Text::new_or_none);
    let file = file(image, comments, AnyChannels::sort(channels));
    let written = file.write().non_parallel().to_buffered(output);
    written.map_err(unwritten)
}

/// A file of one layer of the image's window.
fn file<'c, C: WritableChannels<'c> + 'c>(
    image: &Image,
    comments: Option<Text>,
    channels: C,
) -> File<Layer<C>> {
    let window = image.window();
    let layer = Layer::new(
        Vec2(window.width(), window.height()),
        LayerAttributes {
            layer_position: Vec2(window.x0, window.y0),
            software_name: Some(SOFTWARE.into()),
            comments,
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
    File::new(display, layer)
}

fn unwritten(error: ::exr::error::Error) -> Unwritten {
    match error {
        ::exr::error::Error::Io(error) => Unwritten::Io(error),
        error => Unwritten::Refused(error.to_string()),
    }
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
    let pixels = contained(|| pixels_of(chunks, names, window))?;
    let image = Image::new(display.width(), display.height(), window, pixels);
    image.map(Some).map_err(|error| error.to_string())
}

/// Pixels of the first layer that has three channels, or one that is given three times, which is grey.
fn pixels_of(
    chunks: block::reader::Reader<Cursor<&[u8]>>,
    [a, b, c]: [&str; 3],
    window: Window,
) -> ::exr::error::Result<Vec<[f32; 3]>> {
    let width = window.width();
    let black = move || vec![[0.0_f32; 3]; window.area()];
    let samples = read().no_deep_data().largest_resolution_level();
    let samples = samples.specific_channels().required(a);
    // The decoder takes no name twice.
    if a == b && b == c {
        let set = move |pixels: &mut Vec<_>, Vec2(x, y), (grey,): (f32,)| {
            pixels[y * width + x] = [grey; 3];
        };
        let layers = samples.collect_pixels(move |_, _| black(), set);
        let file = (layers.first_valid_layer().all_attributes())
            .non_parallel()
            .from_chunks(chunks)?;
        return Ok(file.layer_data.channel_data.pixels);
    }
    let set = move |pixels: &mut Vec<_>, Vec2(x, y), (a, b, c): (f32, f32, f32)| {
        pixels[y * width + x] = [a, b, c];
    };
    let samples = samples.required(b).required(c);
    let layers = samples.collect_pixels(move |_, _| black(), set);
    let file = (layers.first_valid_layer().all_attributes())
        .non_parallel()
        .from_chunks(chunks)?;
    Ok(file.layer_data.channel_data.pixels)
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
    let (layer, names) = choose_layer(chunks.headers())?;
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
    let pixels = contained(|| pixels_of(chunks, names, window))?;
    Image::new(display.width(), display.height(), window, pixels).map_err(|error| error.to_string())
}

/// Channels of colours, and of luminance by itself.
const RGB: [&str; 3] = ["R", "G", "B"];
const LUMINANCE: [&str; 3] = ["Y"; 3];

/// Chooses the layer to read: the first that has the channels, as the reader of the crate `exr` does.
fn choose_layer(headers: &[Header]) -> Result<(usize, [&'static str; 3]), String> {
    let has = |header: &Header, name: &str| header.channels.list.iter().any(|c| c.name == *name);
    let found = [RGB, LUMINANCE].into_iter().find_map(|names| {
        let complete = |header: &Header| names.iter().all(|name| has(header, name));
        Some((headers.iter().position(complete)?, names))
    });
    let Some((layer, names)) = found else {
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
    if names == LUMINANCE && (has(header, "RY") || has(header, "BY")) {
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
    Ok((layer, names))
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
