//! Files of `antumbra sun`: tables, meshes in colours, maps and arrays.

use std::path::Path;

use antumbra_bake::{Array, Entry, ShadedMesh, npz_bytes, write_npz};
use antumbra_image::{atomic_write, heatmap};

use super::sensors::Layout;
use super::sun::Baked;
use crate::args::{Shown, SunArgs};
use crate::exit::Failure;
use crate::output;

/// Formats, by extension.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Csv,
    Ply,
    Png,
    Npz,
}

fn format(path: &Path) -> Result<Format, Failure> {
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    match extension.to_str() {
        Some("csv") => Ok(Format::Csv),
        Some("ply") => Ok(Format::Ply),
        Some("png") => Ok(Format::Png),
        Some("npz") => Ok(Format::Npz),
        _ if output::is_stream(path) => Ok(Format::Csv),
        _ => Err(Failure::Usage(format!(
            "{}: results are written as csv, ply, png or npz",
            path.display()
        ))),
    }
}

/// Refuses outputs that cannot be made, before anything is read.
pub fn check(args: &SunArgs) -> Result<(), Failure> {
    for path in &args.output {
        if format(path)? == Format::Png && args.grid.is_none() {
            let path = path.display();
            return Err(Failure::Usage(format!("{path}: a map needs --grid")));
        }
    }
    if args.epw.is_none() && !matches!(args.show, Shown::Hours | Shown::SkyView) {
        return Err(Failure::Usage("--show: irradiation needs --epw".into()));
    }
    Ok(())
}

/// Name of the value in files.
fn name(shown: Shown) -> &'static str {
    match shown {
        Shown::Hours => "hours",
        Shown::SkyView => "sky_view",
        Shown::Direct => "direct_kwh_m2",
        Shown::Diffuse => "diffuse_kwh_m2",
        Shown::Total => "total_kwh_m2",
    }
}

/// Writes one file.
pub fn write(path: &Path, baked: &Baked<'_>) -> Result<(), Failure> {
    let _writing = crate::interrupt::writing();
    match format(path)? {
        Format::Csv => csv(path, baked),
        Format::Ply => ply(path, baked),
        Format::Png => png(path, baked),
        Format::Npz => npz(path, baked),
    }
}

fn csv(path: &Path, baked: &Baked<'_>) -> Result<(), Failure> {
    let sensors = baked.sensors;
    let values = &baked.values;
    let covered = baked.suns.covered;
    let months: Vec<usize> = (0..12).filter(|&month| covered[month]).collect();
    // Columns of twelve values for each sensor, of which those of months with steps are written.
    let mut by_month = vec![("hours", &values.by_month)];
    if !values.direct.is_empty() {
        by_month.push(("direct_kwh_m2", &values.direct_by_month));
        by_month.push(("diffuse_kwh_m2", &values.diffuse_by_month));
    }
    let numbers = 12 + (by_month.len() * months.len()) as u64;
    output::check_room(path, sensors.points.len() as u64 * 10 * numbers)?;
    Ok(atomic_write(path, |file| {
        let mut head = "x,y,z".to_owned();
        if !sensors.normals.is_empty() {
            head.push_str(",nx,ny,nz");
        }
        head.push_str(",hours,sky_view");
        if !values.direct.is_empty() {
            head.push_str(",direct_kwh_m2,diffuse_kwh_m2");
        }
        for (name, _) in &by_month {
            for month in &months {
                head.push_str(&format!(",{name}_{:02}", month + 1));
            }
        }
        writeln!(file, "{head}")?;
        let mut line = String::new();
        for (row, point) in sensors.points.iter().enumerate() {
            use std::fmt::Write as _;
            line.clear();
            let normal = sensors.normals.get(row).into_iter().flatten();
            for (index, x) in point.iter().chain(normal).enumerate() {
                let comma = if index > 0 { "," } else { "" };
                let _ = write!(line, "{comma}{x}");
            }
            let mut more = vec![values.hours[row], values.sky_view[row]];
            let light = [values.direct.get(row), values.diffuse.get(row)];
            more.extend(light.into_iter().flatten());
            for (_, list) in &by_month {
                more.extend(months.iter().map(|month| list[12 * row + month]));
            }
            for x in more {
                // More digits than any ray can tell.
                let _ = write!(line, ",{}", (x * 1e9).round() / 1e9);
            }
            writeln!(file, "{line}")?;
        }
        Ok(())
    })?)
}

fn ply(path: &Path, baked: &Baked<'_>) -> Result<(), Failure> {
    let sensors = baked.sensors;
    let values = baked.shown();
    let options = heatmap::Options {
        legend: false,
        ..heatmap::Options::default()
    };
    let colours = heatmap::render(&values, values.len(), 1, &options)?;
    let up = baked.patch_directions.last().copied().unwrap_or_default();
    let level = vec![
        up;
        if sensors.normals.is_empty() {
            values.len()
        } else {
            0
        }
    ];
    let normals = if level.is_empty() {
        &sensors.normals
    } else {
        &level
    };
    let mesh = ShadedMesh {
        positions: &sensors.points,
        normals,
        values: &values,
        colours: colours.pixels(),
        bent_normals: &[],
        indices: match sensors.layout {
            Layout::Vertices => &baked.ground.vertices.indices,
            Layout::List | Layout::Grid(_) => &[],
        },
    };
    output::check_room(path, mesh.bytes())?;
    Ok(atomic_write(path, |file| {
        mesh.write(name(baked.shown), file)
    })?)
}

fn png(path: &Path, baked: &Baked<'_>) -> Result<(), Failure> {
    let Layout::Grid(grid) = &baked.sensors.layout else {
        return Err(Failure::Usage("a map needs --grid".into()));
    };
    let field = grid.picture(&baked.shown());
    let picture = heatmap::render(
        &field,
        grid.width,
        grid.height,
        &heatmap::Options::default(),
    )?;
    Ok(picture.write(path)?)
}

fn npz(path: &Path, baked: &Baked<'_>) -> Result<(), Failure> {
    let (sensors, suns, values) = (baked.sensors, baked.suns, &baked.values);
    let azimuths: Vec<f64> = suns.positions.iter().map(|sun| sun.azimuth).collect();
    let elevations: Vec<f64> = suns.positions.iter().map(|sun| sun.elevation).collect();
    let counts = [
        baked.suns_seen.columns() as u64,
        baked.sky_seen.columns() as u64,
    ];
    let mut entries = vec![
        Entry::new("points", Array::Points(&sensors.points)),
        Entry::new("normals", Array::Points(&sensors.normals)),
        Entry::new("hours", Array::F64(&values.hours)),
        Entry::new("hours_by_month", Array::F64(&values.by_month)).columns(12),
        Entry::new("sky_view", Array::F64(&values.sky_view)),
        Entry::new("suns_seen", Array::Bits(&baked.suns_seen)),
        Entry::new("patches_seen", Array::Bits(&baked.sky_seen)),
        Entry::new("suns_and_patches", Array::Counts(&counts)),
        Entry::new("sun_times", Array::F64(&suns.times)),
        Entry::new("sun_hours", Array::F64(&suns.hours)),
        Entry::new("sun_azimuths", Array::F64(&azimuths)),
        Entry::new("sun_elevations", Array::F64(&elevations)),
        Entry::new("sun_directions", Array::Points(&baked.sun_directions)),
        Entry::new("patch_directions", Array::Points(&baked.patch_directions)),
        Entry::new(
            "patch_solid_angles",
            Array::F64(&baked.patches.solid_angles),
        ),
    ];
    if !values.direct.is_empty() {
        entries.push(Entry::new("direct_kwh_m2", Array::F64(&values.direct)));
        entries.push(Entry::new("diffuse_kwh_m2", Array::F64(&values.diffuse)));
        for (name, list) in [
            ("direct_kwh_m2_by_month", &values.direct_by_month),
            ("diffuse_kwh_m2_by_month", &values.diffuse_by_month),
        ] {
            entries.push(Entry::new(name, Array::F64(list)).columns(12));
        }
    }
    let cells: Vec<u64>;
    let shape: [u64; 2];
    if let Layout::Grid(grid) = &sensors.layout {
        cells = grid.cells.iter().map(|&cell| u64::from(cell)).collect();
        shape = [grid.height as u64, grid.width as u64];
        entries.push(Entry::new("cells", Array::Counts(&cells)));
        entries.push(Entry::new("grid", Array::Counts(&shape)));
    }
    output::check_room(path, npz_bytes(&entries))?;
    Ok(atomic_write(path, |file| write_npz(&entries, file))?)
}
