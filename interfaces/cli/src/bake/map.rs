//! Maps of the values of a grid.

use std::path::{Path, PathBuf};

use antumbra::Bvh;
use antumbra_bake::{Grid, Layout, Moment, Orientation, Sensors, UpAxis};
use antumbra_image::atomic_write;
use antumbra_map::{Drawing, Map, Relief, Steps};

use super::ground::Ground;
use crate::args::MapArgs;
use crate::exit::Failure;
use crate::{output, version};

/// Most pixels of the relief beneath a map.
const MOST_PIXELS: f64 = 4e7;

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
    pub unit: &'a str,
    /// Whether values are counts.
    pub whole: bool,
    /// Names of the files that the values come from.
    pub files: Vec<&'a Path>,
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

/// A sheet on which values of a grid are drawn.
pub struct Sheet<'a> {
    args: &'a MapArgs,
    plan: &'a Plan<'a>,
    grid: &'a Grid,
    size: [u32; 2],
    relief: Option<Relief>,
}

impl<'a> Sheet<'a> {
    /// A sheet for the values of sensors, which must be on a grid.
    pub fn new(
        args: &'a MapArgs,
        plan: &'a Plan<'a>,
        sensors: &'a Sensors,
    ) -> Result<Self, Failure> {
        let Layout::Grid(grid) = &sensors.layout else {
            return Err(Failure::Usage("a map needs --grid".into()));
        };
        let words = Words::default();
        let mut sheet = Self {
            args,
            plan,
            grid,
            size: [0; 2],
            relief: None,
        };
        let map = sheet.map(&words, (&[], ""), Steps::between(0.0, 1.0, false));
        let size = args.resolution.map_or(map.usual_size(), |size| size.0);
        let [columns, rows] = map.relief_size(size).map_err(Failure::work)?;
        let coarser = (columns as f64 * rows as f64 / MOST_PIXELS).sqrt().max(1.0);
        let pixel = coarser * map.relief_pixel(size).map_err(Failure::work)?;
        // Sensors of pixels are where rays from above hit the model.
        let seen = Sensors::on_grid((plan.bvh, &|_| None), pixel, plan.orientation)?;
        sheet.relief = relief(&seen, plan.orientation, pixel);
        sheet.size = size;
        Ok(sheet)
    }

    fn map<'b>(
        &'b self,
        words: &'b Words<'_>,
        (values, source): (&'b [f32], &'b str),
        steps: Steps,
    ) -> Map<'b> {
        Map {
            values,
            width: self.grid.width,
            height: self.grid.height,
            cell: [self.plan.cell; 2],
            metres: self.plan.metres,
            north: self.plan.north.unwrap_or(f64::NAN),
            title: self.args.title.as_deref().unwrap_or(&words.title),
            subtitle: &words.subtitle,
            quantity: words.quantity,
            unit: words.unit,
            steps,
            source,
            relief: self.relief.as_ref(),
            symbols: None,
            theme: self.args.theme(),
        }
    }

    /// Draws the values of the sensors.
    pub fn draw(
        &self,
        words: &Words<'_>,
        values: &[f32],
        steps: Steps,
    ) -> Result<Drawing, Failure> {
        let (values, source) = (self.grid.picture(values), source(&words.files, self.plan));
        let map = self.map(words, (&values, &source), steps);
        map.draw(self.size).map_err(Failure::work)
    }

    /// Writes the values as PNG with its world file, as SVG or as PDF, by the extension.
    pub fn write(&self, path: &Path, words: &Words<'_>, values: &[f32]) -> Result<(), Failure> {
        let steps = match self.args.ends() {
            Some([low, high]) => Steps::between(low, high, words.whole),
            None => Steps::around(values, words.whole),
        };
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
        if has_world_file(path) && self.plan.north.is_some() {
            let map = self.map(words, (&[], ""), steps);
            let text = world_file(&map, self.size, self.plan)?;
            atomic_write(path.with_extension("pgw"), |file| {
                file.write_all(text.as_bytes())
            })?;
        }
        Ok(())
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

/// Small line below a map.
fn source(files: &[&Path], plan: &Plan<'_>) -> String {
    let name = |path: &&Path| {
        let name = path.file_name().unwrap_or(path.as_os_str());
        name.to_string_lossy().into_owned()
    };
    let mut parts: Vec<String> = files.iter().map(name).collect();
    let cell = plan.cell * plan.metres.unwrap_or(1.0);
    let cell = (cell * 1e6).round() / 1e6;
    let unit = if plan.metres.is_some() { "m" } else { "units" };
    parts.push(format!("grid of {cell} {unit}"));
    parts.push(format!("Antumbra {}", version::VERSION));
    parts.join("  ·  ")
}

/// The world file of a map, in coordinates of the file that the scene comes from: x and y where z is up, x and -z where y is.
fn world_file(map: &Map<'_>, size: [u32; 2], plan: &Plan<'_>) -> Result<String, Failure> {
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
    let world = [0, 1, 2].map(|axis| corner[axis] + origin[axis]);
    let [x, y] = flat(world);
    let [a, d] = flat(plan.orientation.east).map(|part| plan.cell * part);
    let [b, e] = flat(plan.orientation.north).map(|part| -plan.cell * part);
    map.world_file(size, [x, a, b, y, d, e])
        .map_err(Failure::work)
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
    fn only_png_files_have_world_files() {
        let outputs = ["a.png", "b.svg", "c.PDF", "d.csv", "e.PNG"].map(PathBuf::from);
        let wanted = ["a.pgw", "e.pgw"].map(PathBuf::from);
        assert_eq!(world_files(&outputs).expect("free names"), wanted);
    }
}
