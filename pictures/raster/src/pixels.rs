//! Pixels of one band of a TIFF as they are stored (TIFF 6.0): strips and tiles that only their tags unpack.
//!
//! The decoder of the crate `tiff` makes pictures: it inverts bands where "white is zero", reads empty tiles from the beginning of
//! the file, and knows no masks. Heights are no picture, so only its directories of tags are used.

use std::io::{self, Read, Seek, SeekFrom};

use flate2::read::ZlibDecoder;
use half::f16;
use ruzstd::decoding::StreamingDecoder;
use tiff::Directory;
use tiff::decoder::Decoder;
use tiff::tags::{ByteOrder, Tag};
use weezl::{BitOrder, LzwStatus};

use crate::grid::room_for;

/// So many bytes of a file from a place on, or fewer if it ends before.
pub fn bytes(file: &mut (impl Read + Seek), from: u64, count: u64) -> Result<Vec<u8>, String> {
    // A damaged file may have a count beyond all memory.
    let mut bytes = Vec::with_capacity(count.min(1 << 20) as usize);
    let place = file.seek(SeekFrom::Start(from));
    let read = place.and_then(|_| file.take(count).read_to_end(&mut bytes));
    read.map_err(|error| error.to_string())?;
    Ok(bytes)
}

/// Tags that a page of pixels has.
#[derive(Debug)]
pub struct Page {
    is_big_endian: bool,
    pub size: [usize; 2],
    /// Columns and rows of strips or tiles.
    chunk: [usize; 2],
    is_tiled: bool,
    offsets: Vec<u64>,
    counts: Vec<u64>,
    compression: u16,
    predictor: u16,
    bits: usize,
    format: u16,
}

const UNSIGNED: u16 = 1;
const SIGNED: u16 = 2;
const FLOAT: u16 = 3;

/// Names of compressions that are not read.
const PACKERS: [(u16, &str); 8] = [
    (2, "CCITT RLE"),
    (4, "CCITT fax 4"),
    (7, "JPEG"),
    (34_887, "LERC"),
    (34_925, "LZMA"),
    (50_001, "WebP"),
    (50_002, "JPEG XL"),
    (3, "CCITT fax 3"),
];

/// Size of strips or tiles, and the tags of their offsets and lengths.
fn layout(
    number: &mut impl FnMut(Tag, u64) -> Result<u32, String>,
    is_tiled: bool,
    size: [usize; 2],
) -> Result<([usize; 2], [Tag; 2]), String> {
    if is_tiled {
        let [width, length] = [Tag::TileWidth, Tag::TileLength].map(|tag| number(tag, 0));
        let chunk = [width? as usize, length? as usize];
        return Ok((chunk, [Tag::TileOffsets, Tag::TileByteCounts]));
    }
    let rows = number(Tag::RowsPerStrip, u32::MAX.into())? as usize;
    let chunk = [size[0], rows.min(size[1])];
    Ok((chunk, [Tag::StripOffsets, Tag::StripByteCounts]))
}

impl Page {
    /// The page that a directory describes. `check` refuses sizes that there is no memory for.
    pub fn new(
        decoder: &mut Decoder<impl Read + Seek>,
        directory: &Directory,
        check: impl Fn([usize; 2]) -> Result<(), String>,
    ) -> Result<Self, String> {
        let is_big_endian = matches!(decoder.byte_order(), ByteOrder::BigEndian);
        let mut tags = decoder.read_directory_tags(directory);
        let mut list = |tag: Tag| match tags.find_tag_unsigned_vec::<u64>(tag) {
            Ok(list) => Ok(list.unwrap_or_default()),
            Err(error) => Err(error.to_string()),
        };
        let mut number = |tag: Tag, default: u64| {
            let found = list(tag)?.first().copied().unwrap_or(default);
            u32::try_from(found).map_err(|_| format!("tag {tag:?}: found {found}"))
        };
        let size = [
            number(Tag::ImageWidth, 0)? as usize,
            number(Tag::ImageLength, 0)? as usize,
        ];
        check(size)?;
        let samples = number(Tag::SamplesPerPixel, 1)?;
        let colours = number(Tag::PhotometricInterpretation, 1)?;
        let bits = number(Tag::BitsPerSample, 1)? as usize;
        let format = number(Tag::SampleFormat, 1)? as u16;
        is_one_band(samples, colours, (format, bits))
            .map_err(|found| format!("found pixels of {found}, wanted one band of numbers"))?;
        if number(Tag::FillOrder, 1)? != 1 {
            return Err("its bits are stored in reverse order (tag FillOrder)".into());
        }
        let compression = number(Tag::Compression, 1)? as u16;
        let predictor = number(Tag::Predictor, 1)? as u16;
        match (predictor, format) {
            (1, _) => {}
            (2, _) if bits.is_multiple_of(8) => {}
            (3, FLOAT) => {}
            _ => return Err(format!("found predictor {predictor} of {bits} bits")),
        }
        let is_tiled = directory.contains(Tag::TileOffsets);
        let (chunk, [offsets, counts]) = layout(&mut number, is_tiled, size)?;
        if chunk.contains(&0) {
            return Err("its strips or tiles have no size".into());
        }
        if is_tiled {
            check(chunk).map_err(|reason| format!("tiles: {reason}"))?;
        }
        let page = Self {
            is_big_endian,
            size,
            chunk,
            is_tiled,
            offsets: list(offsets)?,
            counts: list(counts)?,
            compression,
            predictor,
            bits,
            format,
        };
        let wanted = size[0].div_ceil(chunk[0]) * size[1].div_ceil(chunk[1]);
        let [offsets, counts] = [page.offsets.len(), page.counts.len()];
        match [offsets, counts] == [wanted; 2] {
            true => Ok(page),
            false => Err(format!(
                "found {offsets} offsets and {counts} lengths of {wanted} strips or tiles"
            )),
        }
    }

    /// Bytes of a strip or tile in the file.
    #[cfg(test)]
    pub fn packed(&self, index: usize) -> u64 {
        self.counts[index]
    }

    /// Whether values are floats, so that marks are rounded as they are.
    pub fn is_float(&self) -> bool {
        self.format == FLOAT
    }

    /// Columns and rows of cells that are read at once.
    pub fn chunk(&self) -> [usize; 2] {
        match self.compression == 1 && !self.is_tiled {
            true => [self.size[0], 1],
            false => self.chunk,
        }
    }

    /// Values of the cells `[column, row, columns, rows]`, at least one, row by row. Strips and tiles that were never written
    /// have the value `missing`.
    pub fn values(
        &self,
        file: &mut (impl Read + Seek),
        [left, top, columns, rows]: [usize; 4],
        missing: f64,
    ) -> Result<Vec<f64>, String> {
        let mut values = room_for(columns * rows)?;
        values.resize(columns * rows, missing);
        let [wide, high] = self.chunk;
        let kind = if self.is_tiled { "tile" } else { "strip" };
        let row_bytes = (wide * self.bits).div_ceil(8);
        let [right, bottom] = [left + columns, top + rows];
        let chunks = (top / high..bottom.div_ceil(high))
            .flat_map(|row| (left / wide..right.div_ceil(wide)).map(move |column| (row, column)));
        // Numbers of a row up to the window: predictors begin where the row does.
        let mut start = Vec::new();
        for (row, column) in chunks {
            let index = row * self.size[0].div_ceil(wide) + column;
            let (offset, count) = (self.offsets[index], self.counts[index]);
            // So GDAL writes those that have no data (SPARSE_OK).
            if count == 0 || offset == 0 {
                continue;
            }
            let broken = |reason: String| format!("{kind} {index}: {reason}");
            let [west, north] = [column * wide, row * high];
            let mut first = top.saturating_sub(north);
            let cells = values.chunks_exact_mut(columns).skip(north + first - top);
            let wanted = row_bytes * high.min(self.size[1] - north);
            let (mut from, mut size) = (offset, count);
            // Lines that are not packed are read where they are.
            let is_packed = self.compression != 1 || count < wanted as u64;
            if !is_packed {
                from = offset.saturating_add((row_bytes * first) as u64);
                size = (row_bytes * (high.min(bottom - north) - first)) as u64;
                first = 0;
            }
            let mut data = bytes(file, from, size).map_err(broken)?;
            if (data.len() as u64) < size {
                let reason = format!("its {count} bytes from {offset} on end behind the file");
                return Err(broken(reason));
            }
            if is_packed {
                data = self.unpack(&data, wanted).map_err(broken)?;
            }
            let skipped = left.saturating_sub(west);
            for (line, cells) in data.chunks_exact_mut(row_bytes).skip(first).zip(cells) {
                let cells = &mut cells[west + skipped - left..right.min(west + wide) - left];
                if skipped == 0 {
                    self.row(line, cells);
                    continue;
                }
                start.resize(skipped + cells.len(), 0.0);
                self.row(line, &mut start);
                cells.copy_from_slice(&start[skipped..]);
            }
        }
        Ok(values)
    }

    /// The first bytes of a strip or tile, as many as are wanted.
    fn unpack(&self, packed: &[u8], wanted: usize) -> Result<Vec<u8>, String> {
        let read = |reader: &mut dyn Read| {
            let mut data = Vec::new();
            reader.take(wanted as u64).read_to_end(&mut data)?;
            Ok::<_, io::Error>(data)
        };
        let text = |error: io::Error| error.to_string();
        let data = match self.compression {
            1 => packed.to_vec(),
            // A code has 9 bits or more, and is for at most 4096 bytes.
            5 => lzw(packed, wanted.min(packed.len().saturating_mul(1 << 12)))?,
            8 | 32_946 => read(&mut ZlibDecoder::new(packed)).map_err(text)?,
            32_773 => pack_bits(packed, wanted),
            50_000 => {
                let decoder = StreamingDecoder::new(packed);
                read(&mut decoder.map_err(|error| error.to_string())?).map_err(text)?
            }
            other => {
                let name = PACKERS.iter().find(|(code, _)| *code == other);
                let name = name.map_or(format!("method {other}"), |(_, name)| (*name).into());
                return Err(format!(
                    "its pixels are compressed by {name}, which is not read; rewrite the file with \
                     gdal_translate -co COMPRESS=DEFLATE in.tif out.tif"
                ));
            }
        };
        match data.len() == wanted {
            true => Ok(data),
            false => Err(format!("found {} bytes, wanted {wanted}", data.len())),
        }
    }

    /// Numbers of a row of a strip or tile.
    fn row(&self, line: &mut [u8], values: &mut [f64]) {
        match (self.format, self.bits) {
            (FLOAT, 16) => self.words::<2>(line, values, |word| f16::from_bits(word as u16).into()),
            (FLOAT, 32) => self.words::<4>(line, values, |word| f32::from_bits(word as u32).into()),
            (FLOAT, _) => self.words::<8>(line, values, f64::from_bits),
            (SIGNED, 8) => self.words::<1>(line, values, |word| (word as i8).into()),
            (SIGNED, 16) => self.words::<2>(line, values, |word| (word as i16).into()),
            (SIGNED, 32) => self.words::<4>(line, values, |word| (word as i32).into()),
            (SIGNED, _) => self.words::<8>(line, values, |word| word as i64 as f64),
            (_, 8) => self.words::<1>(line, values, |word| word as f64),
            (_, 16) => self.words::<2>(line, values, |word| word as f64),
            (_, 32) => self.words::<4>(line, values, |word| word as f64),
            (_, 64) => self.words::<8>(line, values, |word| word as f64),
            // From the highest bit on, whatever the order of bytes.
            _ => {
                for (index, value) in values.iter_mut().enumerate() {
                    let bits = index * self.bits..(index + 1) * self.bits;
                    let bit = |at: usize| u32::from(line[at / 8] >> (7 - at % 8) & 1);
                    *value = f64::from(bits.fold(0, |sum, at| 2 * sum + bit(at)));
                }
            }
        }
    }

    /// Numbers of whole bytes, from their words of bits.
    fn words<const N: usize>(
        &self,
        line: &mut [u8],
        values: &mut [f64],
        number: impl Fn(u64) -> f64,
    ) {
        let mut is_big_endian = self.is_big_endian;
        if self.predictor == 3 {
            // Differences of bytes, of which all first and highest ones come first (Adobe Photoshop TIFF, Technical Note 3).
            for at in 1..line.len() {
                line[at] = line[at].wrapping_add(line[at - 1]);
            }
            let planes = line.to_vec();
            let count = line.len() / N;
            for (index, word) in line.as_chunks_mut::<N>().0.iter_mut().enumerate() {
                *word = std::array::from_fn(|place| planes[place * count + index]);
            }
            is_big_endian = true;
        }
        let mut before = 0_u64;
        for (value, bytes) in values.iter_mut().zip(line.as_chunks::<N>().0) {
            let mut all = [0; 8];
            let mut word = if is_big_endian {
                all[8 - N..].copy_from_slice(bytes);
                u64::from_be_bytes(all)
            } else {
                all[..N].copy_from_slice(bytes);
                u64::from_le_bytes(all)
            };
            if self.predictor == 2 {
                word = word.wrapping_add(before) & u64::MAX >> (64 - self.bits);
                before = word;
            }
            *value = number(word);
        }
    }
}

/// Checks that pixels are one number each. The error says what they are.
fn is_one_band(samples: u32, colours: u32, kind: (u16, usize)) -> Result<(), String> {
    match kind {
        _ if samples != 1 => Err(format!("{samples} bands")),
        // White is 0, black is 0, or a mask: hints how to show a band, which leave its numbers alone.
        _ if !matches!(colours, 0 | 1 | 4) => Err("colours".into()),
        (UNSIGNED, 1..=16 | 32 | 64) | (SIGNED, 8 | 16 | 32 | 64) | (FLOAT, 16 | 32 | 64) => Ok(()),
        (5 | 6, _) => Err("complex numbers".into()),
        (format, bits) => Err(format!("{bits} bits of the sample format {format}")),
    }
}

/// LZW as TIFF has it. Bytes are missing where the code ends early.
fn lzw(packed: &[u8], wanted: usize) -> Result<Vec<u8>, String> {
    let mut decoder = weezl::decode::Decoder::with_tiff_size_switch(BitOrder::Msb, 8);
    let mut data = room_for(wanted)?;
    data.resize(wanted, 0);
    let (mut read, mut written) = (0, 0);
    while written < wanted {
        let done = decoder.decode_bytes(&packed[read..], &mut data[written..]);
        read += done.consumed_in;
        written += done.consumed_out;
        match done.status {
            Ok(LzwStatus::Ok) => {}
            Ok(_) => break,
            Err(error) => return Err(format!("LZW: {error}")),
        }
    }
    data.truncate(written);
    Ok(data)
}

/// Runs of equal bytes (TIFF 6.0, section 9).
fn pack_bits(mut packed: &[u8], wanted: usize) -> Vec<u8> {
    let mut data = Vec::new();
    while let ([head, rest @ ..], true) = (packed, data.len() < wanted) {
        let (run, times) = match *head as i8 {
            -128 => (0, 1),
            count @ 0.. => (count as usize + 1, 1),
            count => (1, 1 - count as isize),
        };
        let run = &rest[..run.min(rest.len())];
        (0..times).for_each(|_| data.extend(run));
        packed = &rest[run.len()..];
    }
    data.truncate(wanted);
    data
}
