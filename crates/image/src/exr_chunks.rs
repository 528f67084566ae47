//! What the chunks of an OpenEXR file may ask for.
//!
//! The decoder believes them in three things, so that a few damaged bytes could ask for all the memory:
//!
//! - how long they are, as long as that is no more than a block of pixels: and a block may be far larger than the picture
//! - in which layer they belong, where there are several: a huge one, perhaps
//! - compressed as DWAA or DWAB, how much memory their sections take when they are decompressed. Besides, they are worked
//!   on in whole squares of 8 x 8, of 768 bytes however little of one is in the picture.

use std::io::Cursor;

use ::exr::block::{self, chunk::CompressedBlock};
use ::exr::math::Vec2;
use ::exr::meta::{BlockDescription, header::Header};
use ::exr::prelude::Compression;

use crate::foreign::contained;

/// Pixels of a layer; with DWA, of the squares that its blocks consist of.
pub(crate) fn pixels(header: &Header) -> u64 {
    let Vec2(width, height) = header.layer_size;
    if !is_dwa(header) {
        return (width as u64).saturating_mul(height as u64);
    }
    let Vec2(block_width, block_height) = block_size(header);
    squared(width, block_width).saturating_mul(squared(height, block_height))
}

/// Bytes that a block of a layer has at most, so large that nobody writes larger ones.
const MOST_BLOCK_BYTES: u64 = 1 << 26;

/// Checks the size of the blocks of a layer.
pub(crate) fn check_blocks(header: &Header) -> Result<(), String> {
    let Vec2(width, height) = block_size(header);
    let pixels = (width as u64).saturating_mul(height as u64);
    let bytes = pixels.saturating_mul(header.channels.bytes_per_pixel as u64);
    if bytes <= MOST_BLOCK_BYTES {
        return Ok(());
    }
    Err(format!(
        "its blocks of {width} x {height} pixels take {bytes} bytes, more than {MOST_BLOCK_BYTES}"
    ))
}

/// The size of a block that lies wholly within the layer, which may be none.
fn block_size(header: &Header) -> Vec2<usize> {
    match header.blocks {
        BlockDescription::Tiles(tiles) => tiles.tile_size,
        BlockDescription::ScanLines => Vec2(
            header.layer_size.width(),
            header.compression.scan_lines_per_block(),
        ),
    }
}

fn is_dwa(header: &Header) -> bool {
    let compression = header.compression;
    matches!(compression, Compression::DWAA(_) | Compression::DWAB(_))
}

/// `size` pixels in blocks of `block`, each rounded up to whole squares.
fn squared(size: usize, block: usize) -> u64 {
    let block = block.clamp(1, size.max(1));
    let whole = size / block * block.next_multiple_of(8);
    (whole + (size % block).next_multiple_of(8)) as u64
}

/// Checks the chunks of a layer: all that are listed as its own.
pub(crate) fn check(bytes: &[u8], layer: usize) -> Result<(), String> {
    let file = contained(|| block::read(Cursor::new(bytes), false))?;
    let header = file.headers()[layer].clone();
    if file.headers().len() == 1 && !is_dwa(&header) {
        return Ok(());
    }
    let mut chunks = contained(|| file.filter_chunks(false, |_, _, block| block.layer == layer))?;
    while let Some(chunk) = contained(|| chunks.next().transpose())? {
        let found = chunk.layer_index;
        if found != layer {
            return Err(format!(
                "a chunk listed as one of layer {layer} says that it is of another layer, {found}"
            ));
        }
        if is_dwa(&header) {
            check_sections(&header, chunk.compressed_block)?;
        }
    }
    Ok(())
}

/// Checks what a chunk declares of its sections.
///
/// None takes more than the samples of all squares: there are at most as many coefficients, and bytes without runs
/// are stored with one more for every 127. Twice that and a little is allowed.
fn check_sections(header: &Header, chunk: CompressedBlock) -> Result<(), String> {
    let place = contained(|| header.get_block_data_indices(&chunk))?;
    let bounds = contained(|| header.get_absolute_block_pixel_coordinates(place))?;
    let Vec2(width, height) = bounds.size;
    let pixel = header.channels.bytes_per_pixel;
    let data = match chunk {
        CompressedBlock::ScanLine(lines) => lines.compressed_pixels_le,
        CompressedBlock::Tile(tile) => tile.compressed_pixels_le,
        _ => return Err("it holds deep data".into()),
    };
    if data.len() == width * height * pixel {
        return Ok(()); // Stored as they are.
    }
    let most = squared(width, width) * squared(height, height) * 2 * pixel as u64 + 64;
    // Version; sizes of the unknown section, decompressed and compressed, and of AC, DC and RLE, compressed; of RLE,
    // inflated and decompressed; numbers of AC and DC values; how AC values are compressed. What is too short for all
    // that is refused by the decoder.
    let (numbers, _) = data.as_chunks();
    let numbers = [1, 6, 7, 8, 9].map(|index| numbers.get(index).copied().unwrap_or_default());
    match numbers.map(u64::from_le_bytes).into_iter().max() {
        Some(found) if found > most => Err(format!(
            "a chunk declares sizes of sections up to {found}, where {most} is the most for its pixels"
        )),
        _ => Ok(()),
    }
}
