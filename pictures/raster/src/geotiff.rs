//! Reading GeoTIFF: the crate `tiff` reads tags, and tags of places are ours (OGC 19-008r4, GeoTIFF 1.1).

use std::io::{BufReader, Read, Seek, SeekFrom};

use tiff::Directory;
use tiff::decoder::ifd::Value;
use tiff::decoder::{Decoder, Limits};
use tiff::tags::Tag;

use crate::crs::US_FOOT;
use crate::grid::check_transform;
use crate::npy::WorldFile;
use crate::pixels::Page;
use crate::{Crs, Grid};

/// Notes of GDAL as XML: scale and offset of values, their names and units.
pub const GDAL_METADATA: u16 = 42_112;

/// What the headers of a file of one band say.
#[derive(Debug)]
pub struct Band {
    pub height_factor: Option<f64>,
    pub page: Page,
    /// A mask in the file or beside it.
    pub mask: Option<Page>,
    is_raw: bool,
    no_data: Option<f64>,
    scale: f64,
    offset: f64,
}

impl Band {
    /// Reads the headers, and says where the cells are. Numbers stay as they are stored if they are to be `is_raw`.
    pub fn new(
        file: &mut (impl Read + Seek),
        world_file: WorldFile<'_>,
        is_raw: bool,
        check: impl Fn([usize; 2]) -> Result<(), String>,
    ) -> Result<(Self, Grid), String> {
        let (mut decoder, directory, inner) = pages(file)?;
        let page = Page::new(&mut decoder, &directory, &check)?;
        let crs = crs(&mut decoder);
        let transform = match transform(&mut decoder, crs.as_ref())? {
            Some(transform) => check_transform(transform)?,
            None => world_file()?.ok_or(
                "it says nowhere where it is; wanted tags of GeoTIFF, or a world file of the same name with the extension .tfw",
            )?,
        };
        let no_data = no_data(&mut decoder)?;
        let notes = string(&mut decoder, Tag::Unknown(GDAL_METADATA)).unwrap_or_default();
        let [scale, offset] = scale_and_offset(&notes)?;
        // Heights in the unit of the ground, if both are known.
        let of_heights = crs.as_ref().and_then(Crs::height_metres);
        let of_heights = of_heights.or_else(|| unit_of_heights(&notes));
        let of_ground = crs.as_ref().and_then(Crs::metres);
        let units = of_heights.zip(of_ground);
        let height_factor = units.map(|(height, ground)| height / ground);
        let mask = |inner| mask(&mut decoder, &inner, &page, check);
        let mask = inner.filter(|_| !is_raw).map(mask).transpose()?;
        let grid = Grid {
            width: page.size[0],
            height: page.size[1],
            transform,
            crs,
        };
        let band = Self {
            height_factor,
            page,
            mask,
            is_raw,
            no_data,
            scale: scale * height_factor.unwrap_or(1.0),
            offset: offset * height_factor.unwrap_or(1.0),
        };
        Ok((band, grid))
    }

    /// Takes the mask of a file beside this one.
    pub fn take_mask(
        &mut self,
        outer: &mut (impl Read + Seek),
        check: impl Fn([usize; 2]) -> Result<(), String>,
    ) -> Result<(), String> {
        let (mut decoder, directory, _) = pages(outer)?;
        self.mask = Some(mask(&mut decoder, &directory, &self.page, check)?);
        Ok(())
    }

    /// Heights of the cells `[column, row, columns, rows]` of a file, whose mask may be in the file `outer`.
    pub fn values<R: Read + Seek>(
        &self,
        file: &mut R,
        outer: Option<&mut R>,
        window: [usize; 4],
    ) -> Result<Vec<f64>, String> {
        let missing = self.no_data.unwrap_or(0.0);
        let mut values = self.page.values(file, window, missing)?;
        if self.is_raw {
            return Ok(values);
        }
        for value in &mut values {
            // Marks of floats are written with fewer digits than the pixels have.
            let is_mark =
                |mark: f64| *value == mark || self.page.is_float() && *value as f32 == mark as f32;
            let is_data = value.is_finite() && !self.no_data.is_some_and(is_mark);
            let height = self.scale * *value + self.offset;
            *value = if is_data { height } else { f64::NAN };
        }
        if let Some(mask) = &self.mask {
            let mask = mask.values(outer.unwrap_or(file), window, 0.0);
            let mask = mask.map_err(|reason| format!("mask: {reason}"))?;
            for (value, mask) in values.iter_mut().zip(mask) {
                if mask == 0.0 {
                    *value = f64::NAN;
                }
            }
        }
        Ok(values)
    }
}

/// A mask, which has the size of its page.
fn mask(
    decoder: &mut Decoder<impl Read + Seek>,
    directory: &Directory,
    page: &Page,
    check: impl Fn([usize; 2]) -> Result<(), String>,
) -> Result<Page, String> {
    let mask = Page::new(decoder, directory, check)?;
    if mask.size != page.size {
        let ([columns, rows], [width, height]) = (mask.size, page.size);
        return Err(format!(
            "its mask has {columns} x {rows} cells, wanted {width} x {height}"
        ));
    }
    Ok(mask)
}

/// The mark of cells without data, if the file has one.
fn no_data(decoder: &mut Decoder<impl Read + Seek>) -> Result<Option<f64>, String> {
    match string(decoder, Tag::GdalNodata).as_deref().map(str::trim) {
        None | Some("") => Ok(None),
        Some(text) => text.parse().map(Some).map_err(|_| {
            format!("its mark of cells without data (tag GDAL_NODATA) is `{text}`, wanted a number")
        }),
    }
}

/// A decoder of tags, the directory of the first page, and the directory of its mask.
type Pages<R> = (Decoder<R>, Directory, Option<Directory>);

/// Finds the pages of a file.
fn pages<R: Read + Seek>(file: &mut R) -> Result<Pages<BufReader<&mut R>>, String> {
    let text = |error: tiff::TiffError| error.to_string();
    let length = file.seek(SeekFrom::End(0));
    let length = length.and_then(|length| file.rewind().map(|()| length));
    let length = length.map_err(|error| error.to_string())?;
    let decoder = Decoder::new(BufReader::new(file)).map_err(text)?;
    let mut limits = Limits::unlimited();
    // A list of a tag has no more values than the file has bytes, and no more than a lattice of 8192 x 8192 tiles.
    limits.ifd_value_size = length.min(8 << 26) as usize;
    limits.decoding_buffer_size = length.min(1 << 26) as usize * size_of::<Value>();
    let mut decoder = decoder.with_limits(limits);
    let start = decoder.ifd_pointer().ok_or("it has no page")?;
    let first = decoder.read_directory(start).map_err(text)?;
    let mut next = first.next();
    // As GDAL, which looks at no more either: a longer chain runs in a circle.
    for _ in 0..MOST_PAGES {
        let Some(place) = next.filter(|place| place.0 != start.0) else {
            break;
        };
        let page = decoder.read_directory(place).map_err(text)?;
        let mut tags = decoder.read_directory_tags(&page);
        let kind = tags.find_tag_unsigned::<u32>(Tag::NewSubfileType);
        // A mask of the first page, and no overview of one.
        if kind
            .map_err(text)?
            .is_some_and(|kind| kind & 0b101 == 0b100)
        {
            return Ok((decoder, first, Some(page)));
        }
        next = page.next();
    }
    Ok((decoder, first, None))
}

/// Most pages that are searched for a mask.
const MOST_PAGES: usize = 4096;

fn string<R: Read + Seek>(decoder: &mut Decoder<R>, tag: Tag) -> Option<String> {
    let text = decoder.get_tag_ascii_string(tag).ok()?;
    Some(text.trim_end_matches('\0').to_owned())
}

fn doubles<R: Read + Seek>(decoder: &mut Decoder<R>, tag: Tag) -> Option<Vec<f64>> {
    decoder.get_tag_f64_vec(tag).ok()
}

fn crs<R: Read + Seek>(decoder: &mut Decoder<R>) -> Option<Crs> {
    let directory = decoder.get_tag_u16_vec(Tag::GeoKeyDirectoryTag).ok()?;
    Some(Crs {
        directory,
        doubles: doubles(decoder, Tag::GeoDoubleParamsTag).unwrap_or_default(),
        names: string(decoder, Tag::GeoAsciiParamsTag).unwrap_or_default(),
        projection: String::new(),
    })
}

/// Where the cells are; `None` if the file does not say.
fn transform<R: Read + Seek>(
    decoder: &mut Decoder<R>,
    crs: Option<&Crs>,
) -> Result<Option<[f64; 6]>, String> {
    let matrix = doubles(decoder, Tag::ModelTransformationTag);
    let ties = doubles(decoder, Tag::ModelTiepointTag);
    let scale = doubles(decoder, Tag::ModelPixelScaleTag);
    let [x, a, b, y, d, e] = match (matrix.as_deref(), ties.as_deref(), scale.as_deref()) {
        (Some(&[a, b, _, x, d, e, _, y, ..]), ..) => [x, a, b, y, d, e],
        (None, Some(&[column, row, _, x, y, _]), Some(&[width, height, ..])) => [
            x - column * width,
            width,
            0.0,
            y + row * height,
            0.0,
            -height,
        ],
        (None, None, None) => return Ok(None),
        _ => {
            let reason = "its place is given by points only; resample it first, as with gdalwarp";
            return Err(reason.into());
        }
    };
    // Of points, the first cell's centre is where the tags say.
    Ok(Some(match crs.is_some_and(Crs::is_point) {
        true => [x - 0.5 * (a + b), a, b, y - 0.5 * (d + e), d, e],
        false => [x, a, b, y, d, e],
    }))
}

/// Text of the note of GDAL with a role.
fn note<'a>(notes: &'a str, role: &str) -> Option<&'a str> {
    let (_, rest) = notes.split_once(&format!("role=\"{role}\""))?;
    let (_, rest) = rest.split_once('>')?;
    Some(rest.split_once('<')?.0.trim())
}

/// Scale and offset of values in the notes of GDAL.
fn scale_and_offset(notes: &str) -> Result<[f64; 2], String> {
    let item = |role: &str, default: f64| {
        let Some(text) = note(notes, role) else {
            return Ok(default);
        };
        let number = text.parse::<f64>().ok().filter(|x| x.is_finite());
        number.ok_or_else(|| format!("{role}: found `{text}`, wanted a number"))
    };
    Ok([item("scale", 1.0)?, item("offset", 0.0)?])
}

/// Metres in the unit of values in the notes of GDAL, by the names that programs write.
fn unit_of_heights(notes: &str) -> Option<f64> {
    match &*note(notes, "unittype")?.to_ascii_lowercase() {
        "m" | "metre" | "metres" | "meter" | "meters" => Some(1.0),
        "ft" | "foot" | "feet" | "international foot" => Some(0.3048),
        "us survey foot" | "us survey feet" | "us-ft" | "ftus" => Some(US_FOOT),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use tiff::encoder::TiffEncoder;
    use tiff::encoder::colortype::Gray32Float;

    use super::*;
    use crate::{Quantity, Raster};

    const HOURS: Quantity<'_> = Quantity {
        name: "hours",
        unit: "h",
    };

    #[test]
    fn rasters_come_back_where_they_were() {
        let values = [1.0, 2.5, f32::NAN, 4.0, 5.0, 6.0];
        let point_keys = [1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, 2, 3072, 0, 1, 25_832];
        let point = Crs {
            directory: point_keys.to_vec(),
            doubles: vec![1.5],
            names: "a name|".into(),
            projection: String::new(),
        };
        let systems = [
            None,
            Some(Crs::from_epsg(25_832).expect("a code")),
            Some(point),
        ];
        for crs in systems {
            for transform in [
                [600_000.0, 10.0, 0.0, 5_340_000.0, 0.0, -10.0],
                [600_000.0, 10.0, 0.0, 5_340_000.0, 0.0, -5.0],
                [600_000.0, 7.0, 3.0, 5_340_000.0, 3.0, -7.0],
            ] {
                let grid = Grid {
                    width: 3,
                    height: 2,
                    transform,
                    crs: crs.clone(),
                };
                let bytes =
                    crate::write("a.tif".as_ref(), &grid, &values, &[HOURS]).expect("a file");
                let raster = Raster::from_geotiff(&bytes).expect("a raster");
                assert_eq!(raster.grid, grid);
                assert!(raster.values[2].is_nan());
                assert_eq!(raster.values[1], 2.5);
            }
        }
    }

    #[test]
    fn notes_of_gdal_scale_values() {
        let notes = "<Item name=\"OFFSET\" sample=\"0\" role=\"offset\">100</Item>\n\
                     <Item name=\"SCALE\" sample=\"0\" role=\"scale\">0.01</Item>";
        assert_eq!(scale_and_offset(notes), Ok([0.01, 100.0]));
        assert_eq!(scale_and_offset(""), Ok([1.0, 0.0]));
        assert!(scale_and_offset("role=\"scale\">two<").is_err());
        let unit = "<Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">US survey foot</Item>";
        assert_eq!(unit_of_heights(unit), Some(US_FOOT));
        assert_eq!(unit_of_heights(notes), None);
    }

    #[test]
    fn files_without_a_place_and_damaged_ones_are_refused() {
        let grid = Grid::north_up([2, 2], [0.0; 2], 1.0);
        let bytes = crate::write("a.tif".as_ref(), &grid, &[0.0; 4], &[HOURS]).expect("a file");
        for cut in 0..bytes.len() {
            let _ = Raster::from_geotiff(&bytes[..cut]);
        }
        let mut plain = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut plain).expect("an encoder");
        encoder
            .write_image::<Gray32Float>(2, 2, &[0.0; 4])
            .expect("a picture");
        let error = Raster::from_geotiff(plain.get_ref()).expect_err("no place");
        assert!(error.contains(".tfw"), "{error}");
        let placed = Band::new(&mut plain, &|| Ok(Some(grid.transform)), false, |_| Ok(()));
        assert_eq!(placed.expect("a raster").1, grid);
    }

    /// Damaged files are errors or other numbers, and never a panic or much memory.
    #[test]
    fn damaged_files_of_gdal_are_refused() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/rasters");
        let (mut state, mut refused) = (1_u64, 0);
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("a file").path();
            if path.extension().is_none_or(|extension| extension != "tif") {
                continue;
            }
            let whole = std::fs::read(&path).expect("a file");
            for place in 0..whole.len() {
                let mut bytes = whole.clone();
                state = state.wrapping_mul(6_364_136_223_846_793_005) | 1;
                bytes[place] ^= 1 << (state >> 61);
                refused += usize::from(!is_read_in_parts(&bytes, state >> 3));
            }
        }
        assert!(refused > 1000, "{refused} files are refused");
    }

    /// Whether all cells are read. A window of them, which numbers choose, has the bits of all of them then, and is never a panic.
    fn is_read_in_parts(bytes: &[u8], mut numbers: u64) -> bool {
        let mut file = Cursor::new(bytes);
        let check = |size| crate::grid::check_size(size, 1 << 16);
        let Ok((band, grid)) = Band::new(&mut file, &|| Ok(None), false, check) else {
            return false;
        };
        let mut below = |end: usize| {
            let number = numbers as usize % end;
            numbers /= end as u64;
            number
        };
        let [left, top] = [below(grid.width), below(grid.height)];
        let [columns, rows] = [1 + below(grid.width - left), 1 + below(grid.height - top)];
        let part = band.values(&mut file, None, [left, top, columns, rows]);
        let all = [0, 0, grid.width, grid.height];
        let Ok(all) = band.values(&mut file, None, all) else {
            return false;
        };
        let lines = all.chunks(grid.width).skip(top).take(rows);
        let wanted = lines.flat_map(|line| line[left..][..columns].iter().map(|x| x.to_bits()));
        let part: Vec<u64> = part.expect("a part").iter().map(|x| x.to_bits()).collect();
        assert_eq!(part, wanted.collect::<Vec<u64>>());
        true
    }

    /// A file that counts the bytes that are read.
    struct Counted<'a>(Cursor<&'a [u8]>, u64);

    impl Read for Counted<'_> {
        fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
            let count = self.0.read(bytes)?;
            self.1 += count as u64;
            Ok(count)
        }
    }

    impl Seek for Counted<'_> {
        fn seek(&mut self, place: SeekFrom) -> std::io::Result<u64> {
            self.0.seek(place)
        }
    }

    /// Bytes that a window of a file reads beside the header.
    fn bytes_read(bytes: &[u8], window: [usize; 4]) -> (Band, u64) {
        let mut file = Counted(Cursor::new(bytes), 0);
        let place: WorldFile<'_> = &|| Ok(Some([0.0, 1.0, 0.0, 0.0, 0.0, -1.0]));
        let (band, _) = Band::new(&mut file, place, false, |_| Ok(())).expect("a file");
        file.1 = 0;
        band.values(&mut file, None, window).expect("a window");
        (band, file.1)
    }

    #[test]
    fn windows_read_the_bytes_of_their_tiles_and_rows_only() {
        let size = [1300, 1100];
        let grid = Grid::north_up(size, [0.0; 2], 1.0);
        let values: Vec<f32> = (0..size[0] * size[1]).map(|cell| cell as f32).collect();
        let bytes = crate::write("a.tif".as_ref(), &grid, &values, &[HOURS]).expect("a file");
        let (band, count) = bytes_read(&bytes, [500, 600, 64, 64]);
        assert_eq!(count, band.page.packed(3) + band.page.packed(4));
        // One strip without compression.
        let mut plain = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut plain).expect("an encoder");
        let mut image = encoder
            .new_image::<Gray32Float>(1300, 1100)
            .expect("a picture");
        image.rows_per_strip(1100).expect("a strip");
        image.write_data(&values).expect("a picture");
        let (band, count) = bytes_read(plain.get_ref(), [500, 600, 64, 64]);
        assert_eq!(band.page.chunk(), [1300, 1]);
        assert_eq!(count, 64 * 1300 * 4);
    }
}
