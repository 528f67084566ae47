//! Tiles beside a height raster that is given as the only file.

use std::path::{Path, PathBuf};

use antumbra_bake::HeightField;
use antumbra_lab::count;
use antumbra_load::MemorySize;
use antumbra_raster::{Purpose, Raster, neighbours, read};
use antumbra_terrain::{Light, Skyline};

use super::raster::is_raster;
use crate::exit::tell;
use crate::progress::doing;

/// Cells whose horizons are compared, if all of them have data, and azimuths of each.
const CELLS: u32 = 256;
const AZIMUTHS: u32 = 32;

/// Degrees of elevation by which horizons differ, and how many of them are below the zenith.
const STEP: f64 = 0.1;
const STEPS: u32 = 900;

/// Says that others beside the only file go on where it ends, and about how many of its cells have a higher horizon there.
pub fn tell_neighbours(scene: &[PathBuf], memory: MemorySize) {
    let [file] = scene else {
        return;
    };
    if !is_raster(scene) || !file.is_file() {
        return;
    }
    let beside = neighbours(file);
    let Some(first) = beside.first() else {
        return;
    };
    let reading = doing(
        &file.to_string_lossy(),
        "comparing with the files beside it",
    );
    let found = higher(file, &beside, memory);
    drop(reading);
    let cells = match found {
        Some([cells, part]) => format!(
            "About {} of its {} cells ({:.0} %) have",
            count((part * cells) as u64),
            count(cells as u64),
            100.0 * part
        ),
        None => "Its cells may have".into(),
    };
    tell(format_args!(
        "note: {}: cells go on in {} files beside it, such as {}. {cells} a horizon there that is higher by {STEP} degrees or more, which \
         the results leave out unless the scene is the folder or all files",
        file.display(),
        beside.len(),
        first.file_name().unwrap_or_default().display(),
    ));
}

/// A cell that is compared: its place on the map, its height, and the lowest step at which its own raster does not hide a light in each
/// azimuth.
struct Sample {
    place: [f64; 2],
    height: f64,
    seen: Vec<u32>,
}

/// Number of cells with data, and which part of a sample of them has a higher horizon in the files beside theirs, of which one is in
/// memory at a time. `None` if a file cannot be read within the memory, or none of the sampled cells has data.
fn higher(file: &Path, beside: &[PathBuf], memory: MemorySize) -> Option<[f64; 2]> {
    let own = read(file, memory.bytes(), Purpose::Values).ok()?;
    let known = own.values.iter().filter(|height| height.is_finite());
    let cells = known.count();
    let mut samples = samples(&own)?;
    let of = samples.len();
    let left = memory.bytes().saturating_sub(8 * own.values.len() as u64);
    for path in beside {
        let other = read(path, left, Purpose::Values).ok()?;
        let field = field(&other)?;
        let skyline = Skyline::new(&field).ok()?;
        samples.retain(|sample| {
            let place = field.place(sample.place);
            let mut azimuths = (0..AZIMUTHS).zip(&sample.seen);
            let is_higher = azimuths.any(|(azimuth, &seen)| {
                let light = light(&skyline, azimuth, seen + 1);
                light.is_some_and(|light| skyline.hides(place, sample.height, &light))
            });
            !is_higher
        });
    }
    (of > 0).then(|| [cells as f64, (of - samples.len()) as f64 / of as f64])
}

/// Cells spread over a raster, with the horizons that its own surface gives them.
fn samples(own: &Raster) -> Option<Vec<Sample>> {
    let (field, grid) = (field(own)?, &own.grid);
    let skyline = Skyline::new(&field).ok()?;
    // Additive recurrence in two dimensions (Roberts 2018): even for any number of points.
    let plastic = 1.324_717_957_244_746_f64;
    let spread = |index: u32, part: f64, size: usize| {
        let at = (f64::from(index) * part + 0.5).fract() * size as f64;
        (at as usize).min(size - 1)
    };
    let mut found = Vec::new();
    for index in 0..CELLS {
        let column = spread(index, plastic.recip(), grid.width);
        let row = spread(index, plastic.powi(-2), grid.height);
        let height = own.values[row * grid.width + column];
        if !height.is_finite() {
            continue;
        }
        let hides = |azimuth: u32, step: u32| {
            let light = light(&skyline, azimuth, step)?;
            Some(skyline.hides([column as f64, row as f64], height, &light))
        };
        let seen = |azimuth: u32| {
            let [mut low, mut high] = [0, STEPS];
            while low < high {
                let middle = low.midpoint(high);
                match hides(azimuth, middle)? {
                    true => low = middle + 1,
                    false => high = middle,
                }
            }
            Some(low)
        };
        found.push(Sample {
            place: grid.centre(column, row),
            height,
            seen: (0..AZIMUTHS).map(seen).collect::<Option<_>>()?,
        });
    }
    Some(found)
}

fn field(raster: &Raster) -> Option<HeightField<'_>> {
    let size = [raster.grid.width, raster.grid.height];
    HeightField::new(size, &raster.values, raster.grid.transform).ok()
}

/// A light in one of the azimuths, so many steps above the horizontal.
fn light(skyline: &Skyline<'_>, azimuth: u32, step: u32) -> Option<Light> {
    let azimuth = 360.0 * f64::from(azimuth) / f64::from(AZIMUTHS);
    let slope = (STEP * f64::from(step)).to_radians().tan();
    skyline.light(azimuth, slope).ok()
}
