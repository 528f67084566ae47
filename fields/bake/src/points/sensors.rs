//! Sensors: points that see the sky, the sun or each other, from meshes and grids.

use antumbra::{Bvh, Ray};

use crate::points::surfaces::Flat;
use crate::vector::{dot, unit};
use crate::{Error, Mesh, Orientation, memory};

/// Points with normals, and where they come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sensors {
    /// Points, `[n, 3]`.
    pub points: Vec<[f32; 3]>,
    /// Normals of the surfaces there, `[n, 3]`, or none: points in free space.
    pub normals: Vec<[f32; 3]>,
    /// What else is known of each point, such as its name.
    pub labels: Vec<Label>,
    /// Triangle of the mesh that each sensor was made on, `[n]`; none for points of a table or of lines.
    pub triangles: Vec<u32>,
    /// Triangle of each place that would have a sensor, but is covered.
    pub covered: Vec<u32>,
    /// Where the points come from.
    pub layout: Layout,
}

/// Texts of sensors that come back in tables of results: a column.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// Name of the column in tables of results.
    pub column: String,
    /// Texts, `[n]`.
    pub values: Vec<String>,
}

impl Label {
    pub(crate) fn new(column: &str, values: Vec<String>) -> Self {
        let column = column.to_owned();
        Self { column, values }
    }
}

/// Where sensors come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Layout {
    /// A list of their own.
    #[default]
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
    /// North-western corner, in terms of east and north from the origin of the scene.
    pub corner: [f64; 2],
    /// Side of the cells.
    pub spacing: f64,
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

/// Most cells of a grid.
const MOST_CELLS: f64 = 1e8;

/// Cells whose rays are traced together.
const CELLS: usize = 1 << 18;

impl Sensors {
    /// A sensor at every vertex of a mesh. Of the triangles around a vertex, it is on the first one that faces as the vertex does.
    /// A vertex without triangles is left to be found as points of a table are.
    pub fn of_vertices(mesh: &Mesh) -> Self {
        let mut nearest = vec![(f64::NEG_INFINITY, u32::MAX); mesh.positions.len()];
        for (triangle, &corners) in (0..).zip(&mesh.indices) {
            let facing = unit(mesh.twice_of(corners)).unwrap_or_default();
            for corner in corners {
                let cosine = dot(mesh.normals[corner as usize].map(f64::from), facing);
                // Triangles of one plane differ by rounding.
                if cosine > nearest[corner as usize].0 + 1e-6 {
                    nearest[corner as usize] = (cosine, triangle);
                }
            }
        }
        Self {
            points: mesh.positions.clone(),
            normals: mesh.normals.clone(),
            triangles: nearest.into_iter().map(|(_, triangle)| triangle).collect(),
            layout: Layout::Vertices,
            ..Self::default()
        }
    }

    /// Sensors on the surfaces that are seen from above, in the middle of square cells. Normals are the surface normals, turned
    /// upwards. The grid covers the bounds of the tree; `orientation` says where its rows run, and `flat` which triangle of the mesh a
    /// hit is on.
    ///
    /// # Errors
    /// [`Error::Range`] if the spacing is not above 0, [`Error::Cells`] if the grid has more than 100 million cells,
    /// [`Error::NothingBelow`] if no surface is seen.
    pub fn on_grid(
        (bvh, flat): (&Bvh, Flat<'_>),
        spacing: f64,
        orientation: &Orientation,
    ) -> Result<Self, Error> {
        Error::check_range("spacing", spacing, spacing > 0.0, "a length above 0")?;
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
        let mut sensors = Self::default();
        let Self {
            points,
            normals,
            triangles,
            ..
        } = &mut sensors;
        let mut cells = Vec::new();
        for first in (0..width * height).step_by(CELLS) {
            let range = first..(first + CELLS).min(width * height);
            let rays: Vec<Ray> = range.clone().map(ray).collect();
            let hits = bvh.batch(&rays).intersect();
            memory::grow(points, "sensors", rays.len())?;
            memory::grow(normals, "sensors", rays.len())?;
            memory::grow(triangles, "sensors", rays.len())?;
            memory::grow(&mut cells, "sensors", rays.len())?;
            for ((ray, hit), cell) in rays.iter().zip(&hits).zip(range) {
                let Some(hit) = hit else { continue };
                let Some(normal) = bvh.normal(ray, hit) else {
                    continue;
                };
                let up = dot(normal.map(f64::from), orientation.up);
                let sign = if up < 0.0 { -1.0 } else { 1.0 };
                points.push([0, 1, 2].map(|i: usize| {
                    (f64::from(ray.org[i]) + f64::from(hit.t) * f64::from(ray.dir[i])) as f32
                }));
                normals.push(normal.map(|x| sign * x));
                triangles.push(flat([hit.geom_id, hit.prim_id]).unwrap_or(u32::MAX));
                cells.push(cell as u32);
            }
        }
        if cells.is_empty() {
            return Err(Error::NothingBelow);
        }
        sensors.layout = Layout::Grid(Grid {
            width,
            height,
            cells,
            corner: [low[0], high[1]],
            spacing,
        });
        Ok(sensors)
    }

    /// Texts of a label.
    pub fn label(&self, column: &str) -> Option<&[String]> {
        let label = self.labels.iter().find(|label| label.column == column);
        label.map(|label| &label.values[..])
    }

    /// Puts points without a height on the surface that is seen from above. A height that is missing is NaN, as
    /// [`Sensors::from_table`] leaves it.
    ///
    /// # Errors
    /// [`Error::OffSurface`] with the first point that no surface is below.
    pub fn drape(&mut self, bvh: &Bvh, orientation: &Orientation) -> Result<(), Error> {
        let Some(axis) = (0..3).find(|&axis| orientation.up[axis].abs() == 1.0) else {
            return Ok(());
        };
        let bounds = bvh.bounds();
        let (low, high) = extent(orientation, bounds.min, bounds.max);
        let start = high[2] + 0.01 * (high[2] - low[2]).max(1.0);
        let down = orientation.up.map(|x| -x as f32);
        for (index, point) in self.points.iter_mut().enumerate() {
            if !point[axis].is_nan() {
                continue;
            }
            let mut above = *point;
            above[axis] = (start * orientation.up[axis]) as f32;
            let ray = Ray::new(above, down);
            let hit = bvh.intersect(&ray).ok_or(Error::OffSurface { index })?;
            let height = f64::from(above[axis]) + f64::from(hit.t) * f64::from(down[axis]);
            point[axis] = height as f32;
        }
        Ok(())
    }

    /// Eyes of the sensors: raised by `height` along `up`, and an [origin offset](Bvh::origin_offset) above their surface if
    /// they have one.
    pub fn eyes(&self, bvh: &Bvh, up: [f64; 3], height: f64) -> Vec<[f32; 3]> {
        let eye = |(index, point): (usize, &[f32; 3])| {
            let offset = f64::from(bvh.origin_offset(*point));
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

/// Ends of a box in terms of east, north and up, which may run across it.
fn extent(orientation: &Orientation, min: [f32; 3], max: [f32; 3]) -> ([f64; 3], [f64; 3]) {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for corner in 0..8 {
        let at = |axis: usize| [min, max][corner >> axis & 1][axis];
        let place = orientation.local([0, 1, 2].map(|axis| f64::from(at(axis))));
        for axis in 0..3 {
            low[axis] = low[axis].min(place[axis]);
            high[axis] = high[axis].max(place[axis]);
        }
    }
    (low, high)
}

#[cfg(test)]
mod tests {
    use antumbra::{Geometry, Recipe};

    use super::*;

    #[test]
    fn grids_that_look_across_a_box_see_all_of_it() {
        // Walls of a box of 4 x 4 x 2, without roof and floor.
        let [a, b, c, d] = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        let mut corners = Vec::new();
        for [[x, y], [u, v]] in [[a, b], [b, c], [c, d], [d, a]] {
            corners.extend([[x, y, 0.0], [u, v, 0.0], [u, v, 2.0]]);
            corners.extend([[x, y, 0.0], [u, v, 2.0], [x, y, 2.0]]);
        }
        let indices: Vec<[u32; 3]> = (0..8).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let geometry = [Geometry::triangles(&corners[..], &indices[..])];
        let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
        // From the south-east, both walls there are seen, and no other one.
        let up = [0.0, 0.0, 1.0];
        let view = Orientation::from_vectors([1.0, -1.0, 0.0], up).expect("a view");
        let sensors =
            Sensors::on_grid((&bvh, &|[_, triangle]| Some(triangle)), 0.1, &view).expect("sensors");
        let Layout::Grid(grid) = &sensors.layout else {
            panic!("no grid");
        };
        assert_eq!((grid.width, grid.height), (57, 20), "4 √2 wide and 2 high");
        assert!(sensors.points.len() > 55 * 20);
        for [x, y, _] in sensors.points {
            assert!(y.abs() < 1e-4 || (x - 4.0).abs() < 1e-4, "{x}, {y}");
        }
    }
}
