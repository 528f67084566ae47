//! Points that look at the sky, the sun or each other, with normals.

use std::path::Path;

use antumbra::{Bvh, Ray};
use antumbra_bake::Orientation;

use super::mesh::Vertices;
use crate::exit::Failure;

/// Points with normals, and where they came from.
pub struct Sensors {
    pub points: Vec<[f32; 3]>,
    /// As many as points, or none: points in free space.
    pub normals: Vec<[f32; 3]>,
    pub layout: Layout,
}

/// Where points came from.
pub enum Layout {
    /// A list of their own.
    List,
    /// Vertices of the mesh, in its order.
    Vertices,
    /// Cells of a plan, row by row from north to south.
    Grid(Grid),
}

/// A plan of cells; each cell has a point, or none where there is no surface.
pub struct Grid {
    pub width: usize,
    pub height: usize,
    /// Cell of each point.
    pub cells: Vec<u32>,
}

impl Grid {
    /// Values of points as a picture; NaN where there is no point.
    pub fn picture(&self, values: &[f32]) -> Vec<f32> {
        let mut picture = vec![f32::NAN; self.width * self.height];
        for (&cell, &value) in self.cells.iter().zip(values) {
            picture[cell as usize] = value;
        }
        picture
    }
}

/// Most cells of a plan.
const MOST_CELLS: f64 = 1e8;

/// Cells whose rays are traced together.
const CELLS: usize = 1 << 18;

impl Sensors {
    /// Points of a table: columns x, y, z and perhaps nx, ny, nz, by the names in the first line or else in this order.
    pub fn from_csv(path: &Path) -> Result<Self, Failure> {
        let name = path.display();
        let text = std::fs::read_to_string(path)
            .map_err(|error| Failure::Work(format!("cannot read {name}: {error}")))?;
        parse(&text).map_err(|(line, reason)| Failure::Data(format!("{name}:{line}: {reason}")))
    }

    /// The vertices of the mesh.
    pub fn of_vertices(vertices: &Vertices) -> Self {
        Self {
            points: vertices.positions.clone(),
            normals: vertices.normals.clone(),
            layout: Layout::Vertices,
        }
    }

    /// Points on the surfaces that are seen from above, in the middle of square cells of a plan. Normals are those of the
    /// surfaces, turned upwards. `plan` has the up axis, without a turn to the north.
    pub fn on_grid(bvh: &Bvh, spacing: f64, plan: &Orientation) -> Result<Self, Failure> {
        let bounds = bvh.bounds();
        let (low, high) = extent(plan, bounds.min, bounds.max);
        let size = [0, 1].map(|axis| ((high[axis] - low[axis]) / spacing).ceil().max(1.0));
        if !(size[0] * size[1] <= MOST_CELLS) {
            return Err(Failure::Usage(format!(
                "--grid {spacing}: that makes {:.0} x {:.0} cells; 100 million are the most",
                size[0], size[1]
            )));
        }
        let [width, height] = size.map(|size| size as usize);
        let start = high[2] + 0.01 * (high[2] - low[2]).max(spacing);
        let down = plan.up.map(|x| -x as f32);
        let mut sensors = Self {
            points: Vec::new(),
            normals: Vec::new(),
            layout: Layout::List,
        };
        let mut cells = Vec::new();
        for first in (0..width * height).step_by(CELLS) {
            let range = first..(first + CELLS).min(width * height);
            let rays: Vec<Ray> = range
                .clone()
                .map(|cell| {
                    let [column, row] = [cell % width, cell / width].map(|i| i as f64 + 0.5);
                    let local = [low[0] + column * spacing, high[1] - row * spacing, start];
                    Ray::new(plan.scene(local).map(|x| x as f32), down)
                })
                .collect();
            let mut hits = vec![None; rays.len()];
            bvh.intersect_batch(&rays, &mut hits);
            for ((ray, hit), cell) in rays.iter().zip(&hits).zip(range) {
                let Some(hit) = hit else { continue };
                let Some(normal) = bvh.normal(ray, hit) else {
                    continue;
                };
                let up: f64 = (0..3).map(|i| f64::from(normal[i]) * plan.up[i]).sum();
                let sign = if up < 0.0 { -1.0 } else { 1.0 };
                let along = |i: usize| {
                    (f64::from(ray.org[i]) + f64::from(hit.t) * f64::from(ray.dir[i])) as f32
                };
                sensors.points.push([along(0), along(1), along(2)]);
                sensors.normals.push(normal.map(|x| sign * x));
                cells.push(cell as u32);
            }
        }
        if cells.is_empty() {
            let reason = "--grid: no surface is seen from above; is --up right?";
            return Err(Failure::Usage(reason.into()));
        }
        sensors.layout = Layout::Grid(Grid {
            width,
            height,
            cells,
        });
        Ok(sensors)
    }
}

/// Corners of a box in terms of east, north and up.
fn extent(plan: &Orientation, min: [f32; 3], max: [f32; 3]) -> ([f64; 3], [f64; 3]) {
    let [a, b] = [min, max].map(|corner| plan.local(corner.map(f64::from)));
    let low = std::array::from_fn(|axis| a[axis].min(b[axis]));
    let high = std::array::from_fn(|axis| a[axis].max(b[axis]));
    (low, high)
}

/// Names of columns.
const COLUMNS: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];

fn parse(text: &str) -> Result<Sensors, (usize, String)> {
    let text = text.trim_start_matches('\u{feff}');
    let lines = text
        .lines()
        .enumerate()
        .map(|(index, line)| (index + 1, line.trim()));
    let mut lines = lines
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
        .peekable();
    let fields = |line: &str| -> Vec<String> {
        let split = |c: char| c == ',' || c == ';' || c == '\t';
        let fields = match line.contains(split) {
            true => line.split(split).collect::<Vec<_>>(),
            false => line.split_whitespace().collect(),
        };
        fields.iter().map(|field| field.trim().to_owned()).collect()
    };
    let Some(&(first, head)) = lines.peek() else {
        return Err((1, "found no points".into()));
    };
    let head = fields(head);
    let mut places: Vec<usize> = (0..head.len().min(6)).collect();
    if head.iter().any(|field| field.parse::<f32>().is_err()) {
        let at = |name: &str| {
            head.iter()
                .position(|field| field.eq_ignore_ascii_case(name))
        };
        let found = COLUMNS.map(at);
        places = found.iter().map_while(|place| *place).collect();
        lines.next();
    }
    if places.len() != 3 && places.len() != 6 {
        let reason = "found no columns x, y, z, or x, y, z, nx, ny, nz";
        return Err((first, reason.into()));
    }
    let mut sensors = Sensors {
        points: Vec::new(),
        normals: Vec::new(),
        layout: Layout::List,
    };
    for (line, text) in lines {
        let fields = fields(text);
        let mut numbers = [0.0; 6];
        for (number, (&place, name)) in numbers.iter_mut().zip(places.iter().zip(COLUMNS)) {
            let field = fields.get(place).map_or("", String::as_str);
            let found = field.parse::<f32>().ok().filter(|x| x.is_finite());
            *number =
                found.ok_or_else(|| (line, format!("{name}: found {field:?}, wanted a number")))?;
        }
        let [x, y, z, nx, ny, nz] = numbers;
        sensors.points.push([x, y, z]);
        if places.len() == 6 {
            sensors.normals.push([nx, ny, nz]);
        }
    }
    if sensors.points.is_empty() {
        return Err((first, "found no points".into()));
    }
    Ok(sensors)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_read_by_names_or_places() {
        for text in [
            "1,2,3\n4,5,6\n",
            "# comment\nx,y,z\n1,2,3\n\n4,5,6",
            "id;z;y;x\na;3;2;1\nb;6;5;4\n",
            "1 2 3\n4\t5\t6".replace('\t', " ").as_str(),
        ] {
            let sensors = parse(text).unwrap_or_else(|error| panic!("{text}: {error:?}"));
            assert_eq!(sensors.points, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], "{text}");
            assert!(sensors.normals.is_empty());
        }
        let with_normals = parse("X,Y,Z,NX,NY,NZ\n1,2,3,0,0,1").expect("a table");
        assert_eq!(with_normals.normals, [[0.0, 0.0, 1.0]]);
    }

    #[test]
    fn mistakes_have_a_line() {
        for (text, line) in [
            ("", 1),
            ("x,y\n1,2", 1),
            ("1,2,3,4\n", 1),
            ("x,y,z\n1,2,3\n1,2\n", 3),
            ("x,y,z\n1,2,inf\n", 2),
            ("x,y,z\n", 1),
        ] {
            assert_eq!(
                parse(text).err().map(|error| error.0),
                Some(line),
                "{text:?}"
            );
        }
    }
}
