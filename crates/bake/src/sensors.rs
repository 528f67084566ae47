//! Sensors: points that see the sky, the sun or each other, from tables, meshes and grids.

use antumbra::{Aabb, Bvh, LocalOrigin, Ray};

use crate::{Error, Mesh, Orientation, memory};

/// Points with normals, and where they come from.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensors {
    /// Points, `[n, 3]`.
    pub points: Vec<[f32; 3]>,
    /// Normals of the surfaces there, `[n, 3]`, or none: points in free space.
    pub normals: Vec<[f32; 3]>,
    /// Where the points come from.
    pub layout: Layout,
}

/// Where sensors come from.
#[derive(Clone, Debug, PartialEq)]
pub enum Layout {
    /// A list of their own.
    List,
    /// Vertices of a mesh, in its order.
    Vertices,
    /// Cells of a grid.
    Grid(Grid),
}

/// A grid of square cells seen from above, row by row from north to south. A cell has a sensor, or none where there is no
/// surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Cell of each sensor.
    pub cells: Vec<u32>,
}

impl Grid {
    /// Values of sensors as a picture; NaN where there is no sensor.
    pub fn picture(&self, values: &[f32]) -> Vec<f32> {
        let mut picture = vec![f32::NAN; self.width * self.height];
        for (&cell, &value) in self.cells.iter().zip(values) {
            picture[cell as usize] = value;
        }
        picture
    }
}

/// Why a text is no table of points.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {reason}")]
pub struct BadTable {
    /// Line of the text, from 1.
    pub line: usize,
    /// What is wrong with the line.
    pub reason: String,
}

/// Most cells of a grid.
const MOST_CELLS: f64 = 1e8;

/// Cells whose rays are traced together.
const CELLS: usize = 1 << 18;

impl Sensors {
    /// A sensor at every vertex of a mesh.
    pub fn of_vertices(mesh: &Mesh) -> Self {
        Self {
            points: mesh.positions.clone(),
            normals: mesh.normals.clone(),
            layout: Layout::Vertices,
        }
    }

    /// Sensors on the surfaces that are seen from above, in the middle of square cells. Normals are those of the surfaces,
    /// turned upwards. The grid covers the bounds of the tree; `orientation` says where its rows run.
    ///
    /// # Errors
    /// [`Error::Range`] if the spacing is not above 0, [`Error::Cells`] if the grid has more than 100 million cells,
    /// [`Error::NothingBelow`] if no surface is seen.
    pub fn on_grid(bvh: &Bvh, spacing: f64, orientation: &Orientation) -> Result<Self, Error> {
        if !(spacing > 0.0) {
            return Err(Error::Range {
                what: "spacing",
                found: spacing,
                wanted: "a length above 0",
            });
        }
        let bounds = bvh.bounds();
        let (low, high) = extent(orientation, bounds.min, bounds.max);
        let size = [0, 1].map(|axis| ((high[axis] - low[axis]) / spacing).ceil().max(1.0));
        if !(size[0] * size[1] <= MOST_CELLS) {
            return Err(Error::Cells {
                columns: size[0],
                rows: size[1],
            });
        }
        let [width, height] = size.map(|size| size as usize);
        let start = high[2] + 0.01 * (high[2] - low[2]).max(spacing);
        let down = orientation.up.map(|x| -x as f32);
        let ray = |cell: usize| {
            let [column, row] = [cell % width, cell / width].map(|i| i as f64 + 0.5);
            let local = [low[0] + column * spacing, high[1] - row * spacing, start];
            Ray::new(orientation.scene(local).map(|x| x as f32), down)
        };
        let (mut points, mut normals, mut cells) = (Vec::new(), Vec::new(), Vec::new());
        for first in (0..width * height).step_by(CELLS) {
            let range = first..(first + CELLS).min(width * height);
            let rays: Vec<Ray> = range.clone().map(ray).collect();
            let mut hits = vec![None; rays.len()];
            bvh.intersect_batch(&rays, &mut hits);
            memory::grow(&mut points, "sensors", rays.len())?;
            memory::grow(&mut normals, "sensors", rays.len())?;
            memory::grow(&mut cells, "sensors", rays.len())?;
            for ((ray, hit), cell) in rays.iter().zip(&hits).zip(range) {
                let Some(hit) = hit else { continue };
                let Some(normal) = bvh.normal(ray, hit) else {
                    continue;
                };
                let up: f64 = (0..3)
                    .map(|i| f64::from(normal[i]) * orientation.up[i])
                    .sum();
                let sign = if up < 0.0 { -1.0 } else { 1.0 };
                points.push([0, 1, 2].map(|i: usize| {
                    (f64::from(ray.org[i]) + f64::from(hit.t) * f64::from(ray.dir[i])) as f32
                }));
                normals.push(normal.map(|x| sign * x));
                cells.push(cell as u32);
            }
        }
        if cells.is_empty() {
            return Err(Error::NothingBelow);
        }
        Ok(Self {
            points,
            normals,
            layout: Layout::Grid(Grid {
                width,
                height,
                cells,
            }),
        })
    }

    /// Sensors of a table: columns x, y, z and perhaps nx, ny, nz, by the names in the first line or else in this order.
    /// Commas, semicolons, tabs or spaces separate columns. Empty lines and those that begin with `#` are left out. Points are
    /// those of the world; they are measured from `local` before they are rounded.
    ///
    /// # Errors
    /// [`BadTable`] names the first line that is not as it should be.
    pub fn from_table(text: &str, local: &LocalOrigin) -> Result<Self, BadTable> {
        let bad = |line, reason: &str| BadTable {
            line,
            reason: reason.into(),
        };
        let text = text.trim_start_matches('\u{feff}');
        let lines = (1..).zip(text.lines().map(str::trim));
        let mut lines = lines
            .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
            .peekable();
        let &(first, head) = lines.peek().ok_or_else(|| bad(1, "found no points"))?;
        let (places, has_names) = columns(&fields(head));
        if has_names {
            lines.next();
        }
        if places.len() != 3 && places.len() != 6 {
            let reason = "found no columns x, y, z, or x, y, z, nx, ny, nz";
            return Err(bad(first, reason));
        }
        let mut sensors = Self {
            points: Vec::new(),
            normals: Vec::new(),
            layout: Layout::List,
        };
        for (line, text) in lines {
            let fields = fields(text);
            let mut numbers = [0.0; 6];
            for (number, (&place, name)) in numbers.iter_mut().zip(places.iter().zip(COLUMNS)) {
                let field = fields.get(place).copied().unwrap_or_default();
                let found = field.parse::<f64>().ok().filter(|x| x.is_finite());
                let reason = || format!("{name}: found {field:?}, wanted a number");
                *number = found.ok_or_else(|| bad(line, &reason()))?;
            }
            let [x, y, z, nx, ny, nz] = numbers;
            sensors.points.push(local.local([x, y, z]));
            if places.len() == 6 {
                sensors.normals.push([nx, ny, nz].map(|x| x as f32));
            }
        }
        match sensors.points.is_empty() {
            true => Err(bad(first, "found no points")),
            false => Ok(sensors),
        }
    }

    /// Eyes of the sensors: raised by `height` along `up`, and an [origin offset](Aabb::origin_offset) above their surface if
    /// they have one. `bounds` is the box around the scene.
    pub fn eyes(&self, bounds: &Aabb, up: [f64; 3], height: f64) -> Vec<[f32; 3]> {
        let eye = |(index, point): (usize, &[f32; 3])| {
            let around = bounds.union(&Aabb::around(&[*point]));
            let offset = f64::from(around.origin_offset());
            let normal = self.normals.get(index).copied().unwrap_or_default();
            let normal = normal.map(f64::from);
            let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
            let along = if length > 0.0 { offset / length } else { 0.0 };
            std::array::from_fn(|axis| {
                let raised = f64::from(point[axis]) + along * normal[axis] + height * up[axis];
                raised as f32
            })
        };
        self.points.iter().enumerate().map(eye).collect()
    }
}

/// Corners of a box in terms of east, north and up.
fn extent(orientation: &Orientation, min: [f32; 3], max: [f32; 3]) -> ([f64; 3], [f64; 3]) {
    let [a, b] = [min, max].map(|corner| orientation.local(corner.map(f64::from)));
    let low = std::array::from_fn(|axis| a[axis].min(b[axis]));
    let high = std::array::from_fn(|axis| a[axis].max(b[axis]));
    (low, high)
}

/// Names of columns.
const COLUMNS: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];

fn fields(line: &str) -> Vec<&str> {
    let is_mark = |c: char| c == ',' || c == ';' || c == '\t';
    match line.contains(is_mark) {
        true => line.split(is_mark).map(str::trim).collect(),
        false => line.split_whitespace().collect(),
    }
}

/// Places of the columns by the first line of a table, and whether this line has their names.
fn columns(head: &[&str]) -> (Vec<usize>, bool) {
    if head.iter().all(|field| field.parse::<f32>().is_ok()) {
        return ((0..head.len().min(6)).collect(), false);
    }
    let at = |name: &str| {
        let mut head = head.iter();
        head.position(|field| field.eq_ignore_ascii_case(name))
    };
    (COLUMNS.into_iter().map_while(at).collect(), true)
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
            "1 2 3\n4 5 6",
        ] {
            let sensors = Sensors::from_table(text, &LocalOrigin::default())
                .unwrap_or_else(|error| panic!("{text}: {error:?}"));
            assert_eq!(sensors.points, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], "{text}");
            assert!(sensors.normals.is_empty());
        }
        let with_normals =
            Sensors::from_table("X,Y,Z,NX,NY,NZ\n1,2,3,0,0,1", &LocalOrigin::default())
                .expect("a table");
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
            let error = Sensors::from_table(text, &LocalOrigin::default()).expect_err("no table");
            assert_eq!(error.line, line, "{text:?}");
        }
    }
}
