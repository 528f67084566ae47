//! Cloud optimised GeoTIFF (COG): tiles, overviews, and all directories before the data, so that a reader of a few tiles reads
//! little else, also over HTTP (TIFF 6.0, BigTIFF, OGC 21-026).
//!
//! # Order of a file
//!
//! After the directories of all pages, from the cells themselves to the smallest overview, come the tiles of one band after
//! the other, and in each band the smallest page comes first. How many bytes a tile takes is known only when it is packed, but
//! how many tiles there are is known before. So the room of the directories is left free and filled at the end, and each band
//! is forgotten once it is written.
//!
//! # Overviews
//!
//! Each has half the columns and rows of the page before, rounded up, and the last one fits into a tile. Its cells are means
//! of all the cells with data that they cover, and not means of means, and NaN where there are none. Tiles are made from the
//! cells when they are packed, so overviews take no memory.

use std::borrow::Cow;
use std::io::{self, Seek, SeekFrom, Write};

use flate2::Compression;
use flate2::write::ZlibEncoder;
use rayon::prelude::*;
use tiff::tags::{Tag, Type};

use crate::geotiff::GDAL_METADATA;
use crate::{Crs, Grid, Quantity};

/// Most columns and rows of a tile, as of COGs of GDAL: a map of QGIS needs a few of them, and lists of tiles stay short where
/// there are many bands. Smaller rasters have smaller tiles, by multiples of 16.
const TILE: usize = 512;

/// Tiles that are packed at once, by all threads, and wait to be written.
const BATCH: usize = 64;

/// Bytes of tiles, before they are packed, from which on a file is a BigTIFF. Those that cannot be packed grow by less than a
/// thousandth, and directories take a hundredth, so offsets of smaller files have 32 bits.
const BIG: u64 = 4_000_000_000;

/// How hard tiles are packed. Horizons of 8192 x 8192 cells take 4 s of one thread and 289 MB; level 6 takes 19 s and saves 4
/// % of them, and a quarter of counts and hours, which are a tenth of that.
const LEVEL: Compression = Compression::new(1);

/// Says to GDAL in which order a file is: directories, then tiles by their numbers, each between its length and its last four
/// bytes once more (page on the driver COG). GDAL writes over the last space if it changes the file, and directories begin at
/// an even place.
const LAYOUT: &str = "GDAL_STRUCTURAL_METADATA_SIZE=000140 bytes\nLAYOUT=IFDS_BEFORE_DATA\nBLOCK_ORDER=ROW_MAJOR\n\
                      BLOCK_LEADER=SIZE_AS_UINT4\n\
                      BLOCK_TRAILER=LAST_4_BYTES_REPEATED\nKNOWN_INCOMPATIBLE_EDITION=NO\n \0";

/// The cells, or an overview.
struct Page {
    size: [usize; 2],
    /// Number of its tiles from west to east, and of all.
    tiles: [usize; 2],
    /// Places of the tiles in the file, band by band, and their bytes.
    offsets: Vec<u64>,
    counts: Vec<u32>,
}

/// Field of a directory: its tag, type, number of values, and their bytes.
struct Field(Tag, Type, usize, Vec<u8>);

impl Field {
    fn new<const N: usize>(tag: Tag, kind: Type, values: impl Iterator<Item = [u8; N]>) -> Self {
        let bytes: Vec<u8> = values.flatten().collect();
        Self(tag, kind, bytes.len() / N, bytes)
    }

    fn shorts(tag: Tag, values: &[u16]) -> Self {
        Self::new(tag, Type::SHORT, values.iter().map(|x| x.to_le_bytes()))
    }

    fn longs(tag: Tag, values: impl IntoIterator<Item = u32>) -> Self {
        let values = values.into_iter();
        Self::new(tag, Type::LONG, values.map(u32::to_le_bytes))
    }

    fn doubles(tag: Tag, values: &[f64]) -> Self {
        Self::new(tag, Type::DOUBLE, values.iter().map(|x| x.to_le_bytes()))
    }

    fn text(tag: Tag, text: &str) -> Self {
        let bytes = text.bytes().chain([0]);
        Self::new(tag, Type::ASCII, bytes.map(|byte| [byte]))
    }
}

/// A file that is written.
pub struct Cog<'a> {
    grid: &'a Grid,
    bands: &'a [Quantity<'a>],
    /// Columns and rows of tiles.
    tile: [usize; 2],
    pages: Vec<Page>,
    /// Bytes of an offset: 4, or 8 of a BigTIFF.
    word: usize,
}

impl<'a> Cog<'a> {
    /// A file of a grid with bands; an error if it cannot hold them.
    pub fn new(grid: &'a Grid, bands: &'a [Quantity<'a>]) -> io::Result<Self> {
        let size = [grid.width, grid.height];
        let is_side = |side: &usize| (1..=1 << 31).contains(side);
        if !size.iter().all(is_side) || !(1..=usize::from(u16::MAX)).contains(&bands.len()) {
            let (count, [width, height]) = (bands.len(), size);
            let reason = format!("a GeoTIFF has no {count} bands of {width} x {height} cells");
            return Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
        }
        let tile = size.map(|side| side.next_multiple_of(16).min(TILE));
        let half = |level: u32| size.map(|side| side.div_ceil(1 << level));
        let last = (0..).find(|&level| half(level).iter().all(|&side| side <= TILE));
        let page = |level| {
            let size = half(level);
            let across = size[0].div_ceil(tile[0]);
            let all = across * size[1].div_ceil(tile[1]);
            Page {
                size,
                tiles: [across, all],
                offsets: vec![0; bands.len() * all],
                counts: vec![0; bands.len() * all],
            }
        };
        let pages: Vec<Page> = (0..=last.unwrap_or(0)).map(page).collect();
        let tiles: usize = pages.iter().map(|page| page.offsets.len()).sum();
        let is_big = tiles as u64 * (4 * tile[0] * tile[1]) as u64 > BIG;
        Ok(Self {
            grid,
            bands,
            tile,
            pages,
            word: if is_big { 8 } else { 4 },
        })
    }

    /// Writes the bands that `plane` makes one after the other, from the start of a file on.
    pub fn write<'b>(
        mut self,
        file: &mut (impl Write + Seek + ?Sized),
        plane: &mut dyn FnMut(usize) -> io::Result<Cow<'b, [f32]>>,
    ) -> io::Result<()> {
        let cells = self.grid.width * self.grid.height;
        let room = self.head().len();
        file.write_all(&vec![0; room])?;
        let mut offset = room as u64;
        for band in 0..self.bands.len() {
            let values = plane(band)?;
            assert_eq!(values.len(), cells, "one value per cell");
            for level in (0..self.pages.len()).rev() {
                let tiles = self.pages[level].tiles[1];
                for first in (0..tiles).step_by(BATCH) {
                    let batch = first..tiles.min(first + BATCH);
                    let pack = |tile| self.pack(&values, level, tile);
                    let packed: io::Result<Vec<Vec<u8>>> =
                        batch.clone().into_par_iter().map(pack).collect();
                    for (tile, bytes) in batch.zip(packed?) {
                        let count = bytes.len() as u32;
                        file.write_all(&count.to_le_bytes())?;
                        file.write_all(&bytes)?;
                        file.write_all(&bytes[bytes.len() - 4..])?;
                        let page = &mut self.pages[level];
                        page.offsets[band * tiles + tile] = offset + 4;
                        page.counts[band * tiles + tile] = count;
                        offset += u64::from(count) + 8;
                    }
                }
            }
        }
        file.seek(SeekFrom::Start(0))?;
        file.write_all(&self.head())
    }

    /// A tile, packed: in each row the first bytes of all numbers, then the second ones and so on, as differences (Adobe
    /// Photoshop TIFF, Technical Note 3).
    fn pack(&self, values: &[f32], level: usize, tile: usize) -> io::Result<Vec<u8>> {
        let ([width, height], page) = (self.tile, &self.pages[level]);
        let [left, top] = [tile % page.tiles[0] * width, tile / page.tiles[0] * height];
        let mut encoder = ZlibEncoder::new(Vec::new(), LEVEL);
        let (mut means, mut sums) = (vec![f32::NAN; width], Default::default());
        let (mut line, mut packed) = (vec![0; 4 * width], vec![0; 4 * width]);
        for row in top..top + height {
            means.fill(f32::NAN);
            self.means(values, level, [left, row], &mut means, &mut sums);
            for (place, bytes) in line.chunks_exact_mut(width).enumerate() {
                for (byte, mean) in bytes.iter_mut().zip(&means) {
                    *byte = (mean.to_bits() >> (24 - 8 * place)) as u8;
                }
            }
            packed[0] = line[0];
            for ((packed, byte), before) in packed[1..].iter_mut().zip(&line[1..]).zip(&line) {
                *packed = byte.wrapping_sub(*before);
            }
            encoder.write_all(&packed)?;
        }
        encoder.finish()
    }

    /// Means of the cells with data that cells of a row of a page cover, from the first column on and as far as there are any; NaN,
    /// always of the same bits, without data. `sums` is room for sums and counts of columns.
    fn means(
        &self,
        values: &[f32],
        level: usize,
        first: [usize; 2],
        means: &mut [f32],
        sums: &mut [Vec<f64>; 2],
    ) {
        let (size, counts) = ([self.grid.width, self.grid.height], [means.len(), 1]);
        let [columns, rows] = [0, 1].map(|axis| {
            let ends = [first[axis], first[axis] + counts[axis]];
            let [start, end] = ends.map(|at| (at << level).min(size[axis]));
            start..end
        });
        let line = |row: usize| &values[row * size[0]..][columns.clone()];
        if level == 0 {
            for (mean, &value) in means.iter_mut().zip(rows.flat_map(line)) {
                *mean = if value.is_nan() { f32::NAN } else { value };
            }
            return;
        }
        let [sums, counts] = sums;
        // The sum of a negative zero is one, too.
        for (list, start) in [(&mut *sums, -0.0), (&mut *counts, 0.0)] {
            list.clear();
            list.resize(columns.len(), start);
        }
        for row in rows {
            for ((sum, count), &value) in sums.iter_mut().zip(counts.iter_mut()).zip(line(row)) {
                *sum += f64::from(if value.is_nan() { -0.0 } else { value });
                *count += if value.is_nan() { 0.0 } else { 1.0 };
            }
        }
        let cells = sums.chunks(1 << level).zip(counts.chunks(1 << level));
        for (mean, (sums, counts)) in means.iter_mut().zip(cells) {
            let sum = sums.iter().fold(-0.0, |all, sum| all + sum);
            let count = counts.iter().fold(0.0, |all, count| all + count);
            *mean = if count > 0.0 {
                (sum / count) as f32
            } else {
                f32::NAN
            };
        }
    }

    /// All before the tiles.
    fn head(&self) -> Vec<u8> {
        let mut bytes = match self.word {
            4 => b"II\x2a\0".to_vec(),
            _ => b"II\x2b\0\x08\0\0\0".to_vec(),
        };
        let first = bytes.len() + self.word + LAYOUT.len();
        self.number(&mut bytes, first);
        bytes.extend(LAYOUT.bytes());
        for level in 0..self.pages.len() {
            self.directory(&mut bytes, level);
        }
        bytes
    }

    fn number(&self, bytes: &mut Vec<u8>, number: usize) {
        bytes.extend(&(number as u64).to_le_bytes()[..self.word]);
    }

    /// The directory of a page, and behind it the values that have no room in it.
    fn directory(&self, bytes: &mut Vec<u8>, level: usize) {
        let (fields, word) = (self.fields(level), self.word);
        let count = (fields.len() as u64).to_le_bytes();
        bytes.extend(&count[..if word == 8 { 8 } else { 2 }]);
        let start = bytes.len() + fields.len() * (4 + 2 * word) + word;
        let mut outside = Vec::new();
        for Field(tag, kind, count, mut values) in fields {
            bytes.extend(tag.to_u16().to_le_bytes());
            bytes.extend(kind.to_u16().to_le_bytes());
            self.number(bytes, count);
            if values.len() <= word {
                values.resize(word, 0);
                bytes.extend(values);
            } else {
                self.number(bytes, start + outside.len());
                outside.extend(values);
                outside.resize(outside.len().next_multiple_of(2), 0);
            }
        }
        let is_last = level + 1 == self.pages.len();
        let next = if is_last { 0 } else { start + outside.len() };
        self.number(bytes, next);
        bytes.append(&mut outside);
    }

    /// Fields of the directory of a page, by their tags.
    fn fields(&self, level: usize) -> Vec<Field> {
        let (page, bands) = (&self.pages[level], self.bands.len());
        let long = |tag: Tag, number: usize| Field::longs(tag, [number as u32]);
        let short = |tag: Tag, number: u16| Field::shorts(tag, &[number]);
        let (tag, offsets) = (Tag::TileOffsets, page.offsets.iter());
        let offsets = match self.word {
            4 => Field::longs(tag, offsets.map(|&offset| offset as u32)),
            _ => Field::new(tag, Type::LONG8, offsets.map(|x| x.to_le_bytes())),
        };
        let mut fields = vec![
            // An overview, or not.
            long(Tag::NewSubfileType, usize::from(level > 0)),
            long(Tag::ImageWidth, page.size[0]),
            long(Tag::ImageLength, page.size[1]),
            Field::shorts(Tag::BitsPerSample, &vec![32; bands]),
            // Deflate, black is 0, bands one after the other.
            short(Tag::Compression, 8),
            short(Tag::PhotometricInterpretation, 1),
            short(Tag::SamplesPerPixel, bands as u16),
            short(Tag::PlanarConfiguration, if bands > 1 { 2 } else { 1 }),
            short(Tag::Predictor, 3),
            long(Tag::TileWidth, self.tile[0]),
            long(Tag::TileLength, self.tile[1]),
            offsets,
            Field::longs(Tag::TileByteCounts, page.counts.iter().copied()),
        ];
        if bands > 1 {
            // No colours.
            fields.push(Field::shorts(Tag::ExtraSamples, &vec![0; bands - 1]));
        }
        fields.push(Field::shorts(Tag::SampleFormat, &vec![3; bands]));
        if level == 0 {
            fields.extend(place(self.grid));
            fields.push(Field::text(Tag::Unknown(GDAL_METADATA), &notes(self.bands)));
        }
        fields.push(Field::text(Tag::GdalNodata, "nan"));
        fields
    }
}

/// Fields that say where the cells are.
fn place(grid: &Grid) -> Vec<Field> {
    let [x, a, b, y, d, e] = grid.transform;
    let is_point = grid.crs.as_ref().is_some_and(Crs::is_point);
    let [x, y] = match is_point {
        true => [x + 0.5 * (a + b), y + 0.5 * (d + e)],
        false => [x, y],
    };
    let mut fields = match a > 0.0 && e < 0.0 && b == 0.0 && d == 0.0 {
        true => vec![
            Field::doubles(Tag::ModelPixelScaleTag, &[a, -e, 0.0]),
            Field::doubles(Tag::ModelTiepointTag, &[0.0, 0.0, 0.0, x, y, 0.0]),
        ],
        false => {
            let rows = [
                [a, b, 0.0, x],
                [d, e, 0.0, y],
                [0.0; 4],
                [0.0, 0.0, 0.0, 1.0],
            ];
            let tag = Tag::ModelTransformationTag;
            vec![Field::doubles(tag, rows.as_flattened())]
        }
    };
    if let Some(crs) = &grid.crs {
        fields.push(Field::shorts(Tag::GeoKeyDirectoryTag, &crs.directory));
        if !crs.doubles.is_empty() {
            fields.push(Field::doubles(Tag::GeoDoubleParamsTag, &crs.doubles));
        }
        if !crs.names.is_empty() {
            fields.push(Field::text(Tag::GeoAsciiParamsTag, &crs.names));
        }
    }
    fields
}

/// Names and units of bands as notes of GDAL.
fn notes(bands: &[Quantity<'_>]) -> String {
    let mut notes = "<GDALMetadata>\n".to_owned();
    for (band, &Quantity { name, unit }) in bands.iter().enumerate() {
        let items = [("description", name), ("unittype", unit)];
        for (role, text) in items.into_iter().filter(|(_, text)| !text.is_empty()) {
            let item = role.to_ascii_uppercase();
            let text = text.replace('&', "&amp;").replace('<', "&lt;");
            notes +=
                &format!("<Item name=\"{item}\" sample=\"{band}\" role=\"{role}\">{text}</Item>\n");
        }
    }
    notes + "</GDALMetadata>"
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::Raster;

    const BAND: Quantity<'_> = Quantity {
        name: "hours",
        unit: "h",
    };

    /// As if a file had more than 4 GB.
    #[test]
    fn large_files_are_bigtiffs() {
        let wide = Grid::north_up([8192; 2], [0.0; 2], 1.0);
        for (count, is_big) in [(11, false), (12, true)] {
            let bands = vec![BAND; count];
            let cog = Cog::new(&wide, &bands).expect("a file");
            assert_eq!(cog.word == 8, is_big, "{count} bands of 358 MB");
        }
        let grid = Grid::north_up([700, 30], [600_000.0, 5_340_000.0], 10.0);
        let values: Vec<f32> = (0..700 * 30).map(|cell| cell as f32 / 3.0).collect();
        let bands = [BAND];
        let mut cog = Cog::new(&grid, &bands).expect("a file");
        cog.word = 8;
        let mut file = Cursor::new(Vec::new());
        cog.write(&mut file, &mut |_| Ok(Cow::Borrowed(&values)))
            .expect("a file");
        let bytes = file.into_inner();
        assert_eq!(bytes[..8], *b"II\x2b\0\x08\0\0\0");
        let raster = Raster::from_geotiff(&bytes).expect("a raster");
        assert_eq!(raster.grid, grid);
        let pairs = raster.values.iter().zip(&values);
        assert!(pairs.into_iter().all(|(&a, &b)| a == f64::from(b)));
        let mut decoder = tiff::decoder::Decoder::new(Cursor::new(bytes)).expect("a file");
        decoder.next_image().expect("an overview");
        assert_eq!(decoder.dimensions().expect("a size"), (350, 15));
        let tiff::decoder::DecodingResult::F32(found) = decoder.read_image().expect("a page")
        else {
            panic!("no floats");
        };
        assert_eq!(found[1], ((2.0 + 3.0 + 702.0 + 703.0) / 12.0_f64) as f32);
    }
}
