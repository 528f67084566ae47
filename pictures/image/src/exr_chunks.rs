//! Limits on the memory that chunks of an OpenEXR file demand.
//!
//! The decoder of the crate `exr` trusts three fields of a chunk, so a few damaged bytes could demand all memory:
//!
//! - the length of the chunk, up to a block of pixels, although a block may be far larger than the picture
//! - the layer of the chunk, which may be a huge one
//! - the decompressed sizes of the sections of a chunk compressed as DWAA or DWAB
//!
//! DWA chunks are also decoded in whole squares of 8 x 8 pixels, however few of them lie in the picture.

use std::io::Cursor;

use ::exr::block::{self, chunk::CompressedBlock};
use ::exr::math::Vec2;
use ::exr::meta::{BlockDescription, header::Header};
use ::exr::prelude::Compression;

use crate::foreign::contained;

/// Number of pixels of a layer. With DWA, blocks are padded to whole squares of 8 x 8.
pub(crate) fn pixels(header: &Header) -> u64 {
    let Vec2(width, height) = header.layer_size;
    if !is_dwa(header) {
        return (width as u64).saturating_mul(height as u64);
    }
    let Vec2(block_width, block_height) = block_size(header);
    padded(width, block_width).saturating_mul(padded(height, block_height))
}

/// Largest size of a block in bytes, far above the blocks that programs write.
const MAX_BLOCK_BYTES: u64 = 1 << 26;

/// Checks the size of the blocks of a layer.
pub(crate) fn check_blocks(header: &Header) -> Result<(), String> {
    let Vec2(width, height) = block_size(header);
    let pixels = (width as u64).saturating_mul(height as u64);
    let bytes = pixels.saturating_mul(header.channels.bytes_per_pixel as u64);
    if bytes <= MAX_BLOCK_BYTES {
        return Ok(());
    }
    Err(format!(
        "blocks of {width} x {height} pixels take {bytes} bytes, more than the {MAX_BLOCK_BYTES} allowed"
    ))
}

/// Nominal size of a block. Blocks at the edge of the layer are smaller.
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

/// Length of `size` pixels in blocks of `block` pixels, each block padded to whole squares of 8 x 8.
fn padded(size: usize, block: usize) -> u64 {
    let block = block.clamp(1, size.max(1));
    let whole = size / block * block.next_multiple_of(8);
    (whole + (size % block).next_multiple_of(8)) as u64
}

/// Checks all chunks that the file lists for a layer.
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
                "a chunk that is listed for layer {layer} declares layer {found}"
            ));
        }
        if is_dwa(&header) {
            check_sections(&header, chunk.compressed_block)?;
        }
    }
    Ok(())
}

/// Checks the section sizes that a chunk declares.
///
/// No section takes much more than the samples of all squares: there are at most as many coefficients, and run-length
/// encoding adds at most one byte per 127. Twice the samples plus 64 bytes is allowed.
fn check_sections(header: &Header, chunk: CompressedBlock) -> Result<(), String> {
    let place = contained(|| header.get_block_data_indices(&chunk))?;
    let bounds = contained(|| header.get_absolute_block_pixel_coordinates(place))?;
    let Vec2(width, height) = bounds.size;
    let pixel = header.channels.bytes_per_pixel;
    let data = match chunk {
        CompressedBlock::ScanLine(lines) => lines.compressed_pixels_le,
        CompressedBlock::Tile(tile) => tile.compressed_pixels_le,
        _ => return Err("deep data is not supported".into()),
    };
    if data.len() == width * height * pixel {
        return Ok(()); // Stored uncompressed.
    }
    let most = padded(width, width) * padded(height, height) * 2 * pixel as u64 + 64;
    // Eleven numbers: version; unknown section decompressed and compressed; AC, DC and RLE compressed; RLE inflated and
    // decompressed; counts of AC and DC values; compression of AC. The numbers checked are those that size buffers.
    // The decoder itself refuses chunks that are too short for the numbers.
    let (numbers, _) = data.as_chunks();
    let numbers = [1, 6, 7, 8, 9].map(|index| numbers.get(index).copied().unwrap_or_default());
    match numbers.map(u64::from_le_bytes).into_iter().max() {
        Some(found) if found > most => Err(format!(
            "a chunk declares a section of {found} bytes, but its pixels need at most {most}"
        )),
        _ => Ok(()),
    }
}
