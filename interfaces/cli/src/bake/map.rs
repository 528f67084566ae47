//! Maps of the values of a grid, or of the cells of a height raster.

use std::path::{Path, PathBuf};

use antumbra::Bvh;
use antumbra_bake::{Grid, Layout, Moment, Orientation, Sensors, UpAxis};
use antumbra_image::atomic_write;
use antumbra_map::{Drawing, Map, Relief, Steps, Symbols};
use antumbra_raster::Grid as Raster;

use super::ground::Ground;
use super::terrain::Terrain;
use crate::args::MapArgs;
use crate::exit::Failure;
use crate::output::is_one_of;
use crate::{output, version};

/// Most pixels of the relief beneath a map.
const MOST_PIXELS: f64 = 4e7;

/// Most symbols of observers: more hide the map.
const MOST_SYMBOLS: usize = 300;

/// Parts of a right angle that rows and columns of a map may be off it.
const OFF_SQUARE: f64 = 1e-6;

/// Seconds of a day.
const DAY: f64 = 86_400.0;

/// Names of the months.
const MONTHS: &str =
    "January February March April May June July August September October November December";

/// Texts of a map.
#[derive(Default)]
pub struct Words<'a> {
    /// Title, where the command line has none.
    pub title: String,
    /// Date, place and the like.
    pub subtitle: String,
    pub quantity: &'a str,
    pub unit: String,
    /// Name of the value 0, if values are counts.
    pub none: Option<&'a str>,
    /// Files that the values come from, in groups of one kind.
    pub files: Vec<&'a [PathBuf]>,
}

/// Where the grid of a map is.
pub struct Plan<'a> {
    pub ground: &'a Ground,
    /// Tree of the surfaces that have sensors.
    pub bvh: &'a Bvh,
    /// East, north and up of the mesh, in which rows of the grid run.
    pub orientation: &'a Orientation,
    pub up: UpAxis,
    /// Edge of a cell, in units of the mesh.
    pub cell: f64,
    /// Degrees from north of the mesh to true north, clockwise; `None` for a map that is not seen from above.
    pub north: Option<f64>,
    /// Metres in a unit of the mesh, if they are known.
    pub metres: Option<f64>,
}

/// Whether an output is a map that has a world file beside it.
fn has_world_file(path: &Path) -> bool {
    extension(path) == "png" && !output::is_stream(path)
}

fn extension(path: &Path) -> String {
    let extension = path.extension().unwrap_or_default();
    extension.to_string_lossy().to_ascii_lowercase()
}

/// World files of the maps among these outputs. Nobody named them, so another one is not replaced.
pub fn world_files(outputs: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let maps = outputs.iter().filter(|path| has_world_file(path));
    let beside = |map: &PathBuf| {
        let path = map.with_extension("pgw");
        output::check_beside(map, &path)?;
        Ok(path)
    };
    maps.map(beside).collect()
}

/// Refuses maps of cells that have no right angles, before anything is computed.
pub fn check_cells<'a>(
    terrain: &Terrain,
    mut outputs: impl Iterator<Item = &'a PathBuf>,
) -> Result<(), Failure> {
    let is_map = |path: &PathBuf| is_one_of(path, &["png", "svg", "pdf", "gif"]);
    match outputs.any(is_map) {
        true => upright(terrain).map(drop),
        false => Ok(()),
    }
}

/// Edges of the cells of a raster, and degrees from the top of its rows to grid north, clockwise.
fn upright(terrain: &Terrain) -> Result<([f64; 2], f64), Failure> {
    let reason =
        "a map cannot show sheared or mirrored cells; make upright ones: gdalwarp in.tif out.tif";
    let found = rectangles(terrain.heights.raster.grid.transform);
    found.ok_or_else(|| Failure::scene(&terrain.name, reason))
}

/// Edges of cells, and degrees from the top of their rows to the north, if they are rectangles that are not mirrored.
fn rectangles([_, a, b, _, d, e]: [f64; 6]) -> Option<([f64; 2], f64)> {
    let edges = [a.hypot(d), b.hypot(e)];
    let is_square = (a * b + d * e).abs() <= OFF_SQUARE * edges[0] * edges[1];
    (is_square && a * e < b * d).then(|| (edges, d.atan2(a).to_degrees()))
}

/// A sheet on which values of a grid, or of the cells of a raster, are drawn.
pub struct Sheet<'a> {
    args: &'a MapArgs,
    /// Number of cells, and where they are in coordinates of the file that the scene comes from.
    raster: Raster,
    /// Edges of a cell, in units of the scene.
    cell: [f64; 2],
    /// Degrees from the top to true north, clockwise; `None` for a map that is not seen from above.
    north: Option<f64>,
    metres: Option<f64>,
    /// Cells of sensors, which values are of; `None` if they are of all cells.
    grid: Option<&'a Grid>,
    size: [u32; 2],
    relief: Option<Relief>,
    /// Columns and rows of observers.
    observers: Vec<[f64; 2]>,
}

impl<'a> Sheet<'a> {
    /// A sheet for the values of sensors, which must be on a grid.
    pub fn new(args: &'a MapArgs, plan: &Plan<'_>, sensors: &'a Sensors) -> Result<Self, Failure> {
        let Layout::Grid(grid) = &sensors.layout else {
            return Err(Failure::Usage("a map needs --grid".into()));
        };
        let mut sheet = Self {
            args,
            raster: raster(grid, plan)?,
            cell: [plan.cell; 2],
            north: plan.north,
            metres: plan.metres,
            grid: Some(grid),
            size: [0; 2],
            relief: None,
            observers: Vec::new(),
        };
        let pixel = sheet.settle()?;
        // Sensors of pixels are where rays from above hit the model.
        let seen = Sensors::on_grid((plan.bvh, &|_| None), pixel, plan.orientation)?;
        sheet.relief = relief(&seen, plan.orientation, pixel);
        Ok(sheet)
    }

    /// A sheet for the values of all cells of a raster, with its heights beneath them. True north is so many degrees clockwise of
    /// grid north.
    pub fn of_cells(
        args: &'a MapArgs,
        terrain: &Terrain,
        (north, metres): (f64, Option<f64>),
    ) -> Result<Self, Failure> {
        let (cell, turned) = upright(terrain)?;
        let heights = &terrain.heights.raster;
        let mut sheet = Self {
            args,
            raster: heights.grid.clone(),
            cell,
            north: Some(north + turned),
            metres,
            grid: None,
            size: [0; 2],
            relief: None,
            observers: Vec::new(),
        };
        let pixel = sheet.settle()?;
        let size = [heights.grid.width, heights.grid.height];
        let relief = Relief::of_cells(&heights.values, size, cell, pixel);
        sheet.relief = Some(relief.map_err(Failure::work)?);
        Ok(sheet)
    }

    /// Chooses the size. Returns the edge of a pixel of the relief.
    fn settle(&mut self) -> Result<f64, Failure> {
        let words = Words::default();
        let map = self.map(&words, (&[], ""), Steps::between(0.0, 1.0, false));
        let size = self.args.resolution.map_or(map.usual_size(), |size| size.0);
        let [columns, rows] = map.relief_size(size).map_err(Failure::work)?;
        let coarser = (columns as f64 * rows as f64 / MOST_PIXELS).sqrt().max(1.0);
        let pixel = coarser * map.relief_pixel(size).map_err(Failure::work)?;
        self.size = size;
        Ok(pixel)
    }

    /// Adds symbols of observers, in coordinates of the file that the scene comes from, unless there are too many.
    pub fn observed(mut self, observers: impl ExactSizeIterator<Item = [f64; 2]>) -> Self {
        let [x0, a, b, y0, d, e] = self.raster.transform;
        let area = a * e - b * d;
        let place = |[x, y]: [f64; 2]| {
            let [x, y] = [x - x0, y - y0];
            [(e * x - b * y) / area, (a * y - d * x) / area]
        };
        if observers.len() <= MOST_SYMBOLS {
            self.observers = observers.map(place).collect();
        }
        self
    }

    fn map<'b>(
        &'b self,
        words: &'b Words<'_>,
        (values, source): (&'b [f32], &'b str),
        steps: Steps,
    ) -> Map<'b> {
        let has_observers = !self.observers.is_empty();
        Map {
            values,
            width: self.raster.width,
            height: self.raster.height,
            cell: self.cell,
            metres: self.metres,
            north: self.north.unwrap_or(f64::NAN),
            title: self.args.title.as_deref().unwrap_or(&words.title),
            subtitle: &words.subtitle,
            quantity: words.quantity,
            unit: &words.unit,
            steps,
            source,
            relief: self.relief.as_ref(),
            symbols: has_observers.then_some(Symbols {
                name: "observer",
                places: &self.observers,
            }),
            theme: self.args.theme(),
        }
    }

    /// Draws the values of the sensors, or of all cells of a raster.
    pub fn draw(
        &self,
        words: &Words<'_>,
        values: &[f32],
        steps: Steps,
    ) -> Result<Drawing, Failure> {
        let picture = self.grid.map(|grid| grid.picture(values));
        let values = picture.as_deref().unwrap_or(values);
        let source = self.source(&words.files);
        let map = self.map(words, (values, &source), steps);
        map.draw(self.size).map_err(Failure::work)
    }

    /// Writes the values as PNG with its world file, as SVG or as PDF, by the extension.
    pub fn write(&self, path: &Path, words: &Words<'_>, values: &[f32]) -> Result<(), Failure> {
        let whole = words.none.is_some();
        let mut steps = match self.args.ends() {
            Some([low, high]) => Steps::between(low, high, whole),
            None => Steps::around(values, whole),
        };
        if let Some(none) = words.none {
            steps = steps.with_zero(none, values);
        }
        let drawing = self.draw(words, values, steps.clone())?;
        match extension(path).as_str() {
            "svg" => {
                let text = drawing.svg().map_err(Failure::work)?;
                atomic_write(path, |file| file.write_all(text.as_bytes()))?;
            }
            "pdf" => {
                let bytes = drawing.pdf().map_err(Failure::work)?;
                atomic_write(path, |file| file.write_all(&bytes))?;
            }
            _ => drawing.pixels().map_err(Failure::work)?.write(path)?,
        }
        if has_world_file(path) && self.north.is_some() {
            let map = self.map(words, (&[], ""), steps);
            let text = map.world_file(self.size, self.raster.transform);
            let text = text.map_err(Failure::work)?;
            atomic_write(path.with_extension("pgw"), |file| {
                file.write_all(text.as_bytes())
            })?;
        }
        Ok(())
    }

    /// Small line below a map.
    fn source(&self, files: &[&[PathBuf]]) -> String {
        let name = |group: &&[PathBuf]| {
            let first = group.first()?;
            let name = first.file_name().unwrap_or(first.as_os_str());
            let name = name.to_string_lossy();
            Some(match group.len() - 1 {
                0 => name.into_owned(),
                more => format!("{name} and {more} more"),
            })
        };
        let mut parts: Vec<String> = files.iter().filter_map(name).collect();
        let metres = self.metres.unwrap_or(1.0);
        let [wide, high] = self.cell.map(|edge| (edge * metres * 1e6).round() / 1e6);
        let kind = if self.grid.is_some() { "grid" } else { "cells" };
        let unit = if self.metres.is_some() { "m" } else { "units" };
        parts.push(match wide == high {
            true => format!("{kind} of {wide} {unit}"),
            false => format!("{kind} of {wide} x {high} {unit}"),
        });
        parts.push(format!("Antumbra {}", version::VERSION));
        parts.join("  ·  ")
    }
}

/// The model as it is seen, with places without a surface.
fn relief(sensors: &Sensors, orientation: &Orientation, pixel: f64) -> Option<Relief> {
    let Layout::Grid(grid) = &sensors.layout else {
        return None;
    };
    let local = |vector: [f32; 3]| orientation.local(vector.map(f64::from));
    let heights: Vec<f32> = sensors.points.iter().map(|p| local(*p)[2] as f32).collect();
    let mut normals = vec![[0.0, 0.0, 1.0]; grid.width * grid.height];
    for (&cell, normal) in grid.cells.iter().zip(&sensors.normals) {
        normals[cell as usize] = local(*normal).map(|x| x as f32);
    }
    Some(Relief {
        width: grid.width,
        height: grid.height,
        pixel,
        heights: grid.picture(&heights),
        normals,
        has_edges: true,
    })
}

/// Cells of a grid in coordinates of the file that the scene comes from: x and y where z is up, x and -z where y is.
fn raster(grid: &Grid, plan: &Plan<'_>) -> Result<Raster, Failure> {
    let own = Orientation::new(plan.up, 0.0).map_err(Failure::work)?;
    let flat = |vector: [f64; 3]| {
        let [x, y, _] = own.local(vector);
        [x, y]
    };
    let bounds = plan.bvh.bounds();
    let [a, b] = [bounds.min, bounds.max].map(|p| plan.orientation.local(p.map(f64::from)));
    let corner = plan
        .orientation
        .scene([a[0].min(b[0]), a[1].max(b[1]), 0.0]);
    let origin = plan.ground.local.origin;
    let [x, y] = flat([0, 1, 2].map(|axis| corner[axis] + origin[axis]));
    let mut raster = Raster::north_up([grid.width, grid.height], [x, y], plan.cell);
    let [a, d] = flat(plan.orientation.east).map(|part| plan.cell * part);
    let [b, e] = flat(plan.orientation.north).map(|part| -plan.cell * part);
    raster.transform = [x, a, b, y, d, e];
    Ok(raster)
}

/// A place on earth, as maps write it.
pub fn place(latitude: f64, longitude: f64) -> String {
    let part = |angle: f64, [positive, negative]: [&str; 2]| {
        let side = if angle < 0.0 { negative } else { positive };
        format!("{:.4}° {side}", angle.abs())
    };
    let (latitude, longitude) = (part(latitude, ["N", "S"]), part(longitude, ["E", "W"]));
    format!("{latitude}, {longitude}")
}

fn date(moment: &Moment) -> String {
    let month = MONTHS.split(' ').nth(moment.month as usize - 1);
    let month = month.unwrap_or_default();
    format!("{} {month} {}", moment.day, moment.year)
}

fn clock(moment: &Moment) -> String {
    let minutes = (moment.seconds / 60.0).round() as u32;
    format!("{:02}:{:02}", minutes / 60, minutes % 60)
}

/// A moment, as maps write it.
pub fn moment(moment: &Moment) -> String {
    format!("{}, {}", date(moment), clock(moment))
}

/// A time from one moment to another, as maps write it. Midnight at the end is the day before.
pub fn period(from: &Moment, to: &Moment) -> String {
    let is_whole = from.seconds == 0.0 && matches!(to.seconds, 0.0 | DAY);
    let last = match to.seconds {
        0.0 => Moment::at_unix(to.unix(0.0) - 1.0, 0.0),
        _ => *to,
    };
    let is_one_day = date(from) == date(&last);
    match (is_whole, is_one_day) {
        (true, true) => date(from),
        (true, false) => format!("{} to {}", date(from), date(&last)),
        (false, true) => format!("{}, {} to {}", date(from), clock(from), clock(to)),
        (false, false) => {
            let [from, to] = [from, to].map(|end| format!("{} {}", date(end), clock(end)));
            format!("{from} to {to}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_have_sides() {
        assert_eq!(place(48.2082, 16.3738), "48.2082° N, 16.3738° E");
        assert_eq!(place(-33.86, -0.5), "33.8600° S, 0.5000° W");
    }

    #[test]
    fn periods_are_short() {
        let at = |text: &str| text.parse::<Moment>().expect("a moment");
        let end = |text: &str| Moment {
            seconds: DAY,
            ..at(text)
        };
        let day = at("2025-06-21");
        assert_eq!(period(&day, &end("2025-06-21")), "21 June 2025");
        assert_eq!(period(&day, &at("2025-06-22T00:00")), "21 June 2025");
        assert_eq!(
            period(&day, &end("2025-07-02")),
            "21 June 2025 to 2 July 2025"
        );
        let (from, to) = (at("2025-06-21T09:30"), at("2025-06-21T17:00"));
        assert_eq!(period(&from, &to), "21 June 2025, 09:30 to 17:00");
    }

    #[test]
    fn north_is_where_map_coordinates_say() {
        for degrees in [0.0_f64, 25.0, -70.0, 120.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            // Rows of cells of 10 x 20 that run this much to the north of east.
            let turned = [5.0, 10.0 * cos, 20.0 * sin, 7.0, 10.0 * sin, -20.0 * cos];
            let (edges, north) = rectangles(turned).expect("rectangles");
            assert!((edges[0] - 10.0).abs() < 1e-9 && (edges[1] - 20.0).abs() < 1e-9);
            // A step of 1 in this direction on the sheet.
            let (right, up) = north.to_radians().sin_cos();
            let [c, r] = [right / edges[0], -up / edges[1]];
            let [_, a, b, _, d, e] = turned;
            let step = [c * a + r * b, c * d + r * e];
            assert!(
                step[0].abs() < 1e-9 && (step[1] - 1.0).abs() < 1e-9,
                "{step:?}"
            );
        }
        assert_eq!(rectangles([0.0, 10.0, 0.1, 0.0, 0.0, -10.0]), None);
        assert_eq!(rectangles([0.0, 10.0, 0.0, 0.0, 0.0, 10.0]), None);
    }

    #[test]
    fn only_png_files_have_world_files() {
        let outputs = ["a.png", "b.svg", "c.PDF", "d.csv", "e.PNG"].map(PathBuf::from);
        let wanted = ["a.pgw", "e.pgw"].map(PathBuf::from);
        assert_eq!(world_files(&outputs).expect("free names"), wanted);
    }
}
