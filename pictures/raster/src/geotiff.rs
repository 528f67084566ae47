//! Reading GeoTIFF: the crate `tiff` reads tags, and tags of places are ours (OGC 19-008r4, GeoTIFF 1.1).

use std::io::{Cursor, Read, Seek};

use tiff::Directory;
use tiff::decoder::ifd::Value;
use tiff::decoder::{Decoder, Limits};
use tiff::tags::Tag;

use crate::crs::US_FOOT;
use crate::grid::check_transform;
use crate::npy::WorldFile;
use crate::pixels::{Bytes, Page};
use crate::{Crs, Grid, Raster};

/// Notes of GDAL as XML: scale and offset of values, their names and units.
pub const GDAL_METADATA: u16 = 42_112;

/// What may lie beside a file.
pub struct Beside<'a> {
    /// Says where the cells are if the file does not.
    pub world_file: WorldFile<'a>,
    /// A mask of the cells with data, as GDAL writes it.
    pub mask: &'a dyn Fn() -> Result<Option<Vec<u8>>, String>,
    /// Whether numbers are wanted as they are stored, whatever the file says of their scale and of cells without data.
    pub is_raw: bool,
}

/// Reads a file of one band.
pub fn read(
    bytes: &[u8],
    beside: &Beside<'_>,
    check: impl Fn([usize; 2]) -> Result<(), String>,
) -> Result<Raster, String> {
    let (mut decoder, directory, inner) = pages(bytes)?;
    let page = Page::new(bytes, &mut decoder, &directory, &check)?;
    let grid = grid(&mut decoder, beside.world_file)?;
    let crs = grid.crs.as_ref();
    let no_data = no_data(&mut decoder)?;
    let notes = string(&mut decoder, Tag::Unknown(GDAL_METADATA)).unwrap_or_default();
    let [mut scale, mut offset] = scale_and_offset(&notes)?;
    // Heights in the unit of the ground, if both are known.
    let of_heights = crs.and_then(Crs::height_metres);
    let of_heights = of_heights.or_else(|| unit_of_heights(&notes));
    let of_ground = crs.and_then(Crs::metres);
    let height_factor = of_heights
        .zip(of_ground)
        .map(|(height, ground)| height / ground);
    scale *= height_factor.unwrap_or(1.0);
    offset *= height_factor.unwrap_or(1.0);
    let mut values = page.values(no_data.unwrap_or(0.0))?;
    if beside.is_raw {
        return Ok(Raster {
            grid,
            values,
            height_factor,
        });
    }
    for value in &mut values {
        // Marks of floats are written with fewer digits than the pixels have.
        let is_mark = |mark: f64| *value == mark || page.is_float() && *value as f32 == mark as f32;
        let is_data = value.is_finite() && !no_data.is_some_and(is_mark);
        *value = if is_data {
            scale * *value + offset
        } else {
            f64::NAN
        };
    }
    let mask = match inner {
        Some(directory) => Some(mask(bytes, &mut decoder, &directory, &page, &check)?),
        None => match (beside.mask)()? {
            Some(outer) => {
                let (mut decoder, directory, _) = pages(&outer)?;
                Some(mask(&outer, &mut decoder, &directory, &page, &check)?)
            }
            None => None,
        },
    };
    for (value, mask) in values.iter_mut().zip(mask.into_iter().flatten()) {
        if mask == 0.0 {
            *value = f64::NAN;
        }
    }
    Ok(Raster {
        grid,
        values,
        height_factor,
    })
}

/// Where the cells of a file are, by the tags of its first page.
pub fn grid<R: Read + Seek>(
    decoder: &mut Decoder<R>,
    world_file: WorldFile<'_>,
) -> Result<Grid, String> {
    let (width, height) = decoder.dimensions().map_err(|error| error.to_string())?;
    let crs = crs(decoder);
    let transform = match transform(decoder, crs.as_ref())? {
        Some(transform) => transform,
        None => world_file()?.ok_or(
            "it says nowhere where it is; wanted tags of GeoTIFF, or a world file of the same name with the extension .tfw",
        )?,
    };
    Ok(Grid {
        width: width as usize,
        height: height as usize,
        transform: check_transform(transform)?,
        crs,
    })
}

/// Values of a mask, which has the size of its page.
fn mask<'a>(
    bytes: &'a [u8],
    decoder: &mut Bytes<'a>,
    directory: &Directory,
    page: &Page<'_>,
    check: impl Fn([usize; 2]) -> Result<(), String>,
) -> Result<Vec<f64>, String> {
    let mask = Page::new(bytes, decoder, directory, check)?;
    if mask.size != page.size {
        let ([columns, rows], [width, height]) = (mask.size, page.size);
        return Err(format!(
            "its mask has {columns} x {rows} cells, wanted {width} x {height}"
        ));
    }
    (mask.values(0.0)).map_err(|reason| format!("mask: {reason}"))
}

/// The mark of cells without data, if the file has one.
fn no_data(decoder: &mut Bytes<'_>) -> Result<Option<f64>, String> {
    match string(decoder, Tag::GdalNodata).as_deref().map(str::trim) {
        None | Some("") => Ok(None),
        Some(text) => text.parse().map(Some).map_err(|_| {
            format!("its mark of cells without data (tag GDAL_NODATA) is `{text}`, wanted a number")
        }),
    }
}

/// A decoder of tags, the directory of the first page, and the directory of its mask.
fn pages(bytes: &[u8]) -> Result<(Bytes<'_>, Directory, Option<Directory>), String> {
    let text = |error: tiff::TiffError| error.to_string();
    let decoder = Decoder::new(Cursor::new(bytes)).map_err(text)?;
    let mut limits = Limits::unlimited();
    // A list of a tag has no more values than the file has bytes.
    limits.ifd_value_size = bytes.len();
    limits.decoding_buffer_size = bytes.len() * size_of::<Value>();
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
    use tiff::encoder::TiffEncoder;
    use tiff::encoder::colortype::Gray32Float;

    use super::*;
    use crate::Quantity;

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
        let beside = Beside {
            world_file: &|| Ok(Some(grid.transform)),
            mask: &|| Ok(None),
            is_raw: false,
        };
        let placed = read(plain.get_ref(), &beside, |_| Ok(()));
        assert_eq!(placed.expect("a raster").grid, grid);
    }

    /// Damaged files are errors or other numbers, and never a panic or much memory.
    #[test]
    fn damaged_files_of_gdal_are_refused() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/rasters");
        let beside = Beside {
            world_file: &|| Ok(None),
            mask: &|| Ok(None),
            is_raw: false,
        };
        let check = |size| crate::grid::check_size(size, 1 << 16);
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
                refused += usize::from(read(&bytes, &beside, check).is_err());
            }
        }
        assert!(refused > 1000, "{refused} files are refused");
    }
}
