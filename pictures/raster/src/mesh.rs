//! Cells as triangles.

use crate::{Raster, RasterCells};

/// Triangles between the centres of the cells of a raster.
#[derive(Clone, Debug, PartialEq)]
pub struct RasterMesh {
    /// Centres of the cells that have data, row by row, `[n, 3]`, measured from an origin.
    pub positions: Vec<[f32; 3]>,
    /// Normals there: means of the triangles around each vertex, weighted by area, upwards. 0 where there is no triangle.
    pub normals: Vec<[f32; 3]>,
    /// Three vertices of each triangle, anticlockwise as seen from above.
    pub indices: Vec<[u32; 3]>,
    /// Cell of each vertex, `[n]`.
    pub cells: Vec<u32>,
}

/// Mark of a cell without a vertex.
const NONE: u32 = u32::MAX;

/// Vector of length 1, or 0 for none.
fn unit(vector: [f64; 3]) -> [f32; 3] {
    let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    match length > 0.0 {
        true => vector.map(|x| (x / length) as f32),
        false => [0.0; 3],
    }
}

impl Raster {
    /// The surface of a raster of heights, with z up, measured from `origin` before it is rounded.
    ///
    /// Each square between four centres is two triangles, which share the diagonal from its first to its last centre in the order
    /// of the grid: from north west to south east where rows run south, as in all rasters that were read upright. A square with three centres is one triangle, one with fewer is a
    /// hole. So the surface ends half a cell inside of the raster.
    pub fn mesh(&self, origin: [f64; 3]) -> RasterMesh {
        let (width, height) = (self.grid.width, self.grid.height);
        let mut numbers = vec![NONE; width * height];
        let mut mesh = RasterMesh {
            positions: Vec::with_capacity(width * height),
            normals: Vec::new(),
            indices: Vec::with_capacity(2 * (width - 1) * (height - 1)),
            cells: Vec::with_capacity(width * height),
        };
        let local = |row: usize, column: usize, z: f64| {
            let [x, y] = self.grid.centre(column, row);
            [x - origin[0], y - origin[1], z - origin[2]]
        };
        for (cell, &z) in self.values.iter().enumerate() {
            if z.is_finite() {
                numbers[cell] = mesh.positions.len() as u32;
                let point = local(cell / width, cell % width, z);
                mesh.positions.push(point.map(|x| x as f32));
                mesh.cells.push(cell as u32);
            }
        }
        let mut sums = vec![[0.0; 3]; mesh.positions.len()];
        // Rows run south in most files; then first, below, right is anticlockwise from above.
        let [_, a, b, _, d, e] = self.grid.transform;
        let is_turned = a * e - b * d > 0.0;
        let mut add = |corners: [usize; 3]| {
            let mut indices = corners.map(|cell| numbers[cell]);
            if indices.contains(&NONE) {
                return;
            }
            if is_turned {
                indices.swap(1, 2);
            }
            let points = indices.map(|i| mesh.positions[i as usize].map(f64::from));
            let normal = cross(minus(points[1], points[0]), minus(points[2], points[0]));
            for index in indices {
                let sum: &mut [f64; 3] = &mut sums[index as usize];
                (0..3).for_each(|axis| sum[axis] += normal[axis]);
            }
            mesh.indices.push(indices);
        };
        for row in 1..height {
            for column in 1..width {
                let last = row * width + column;
                let [first, right, below] = [last - width - 1, last - width, last - 1];
                let is_missing = |cell: usize| numbers[cell] == NONE;
                if is_missing(first) || is_missing(last) {
                    // Of four triangles in the square, those that keep off the missing centre.
                    add([first, below, right]);
                    add([right, below, last]);
                } else {
                    add([first, below, last]);
                    add([first, last, right]);
                }
            }
        }
        mesh.normals = sums.into_iter().map(unit).collect();
        mesh
    }

    /// Cells of the mesh, without the values.
    pub fn into_cells(self, mesh: &RasterMesh) -> RasterCells {
        RasterCells {
            grid: self.grid,
            cells: mesh.cells.clone(),
        }
    }
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| a[axis] - b[axis])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Grid;

    fn raster(rows: &[&[f64]]) -> Raster {
        let size = [rows[0].len(), rows.len()];
        Raster {
            grid: Grid::north_up(size, [100.0, 50.0], 10.0),
            values: rows.concat(),
            height_factor: None,
        }
    }

    #[test]
    fn squares_are_two_triangles_that_face_up() {
        let flat = raster(&[&[1.0; 3], &[1.0; 3]]);
        let mesh = flat.mesh([100.0, 0.0, 0.0]);
        assert_eq!(mesh.positions[0], [5.0, 45.0, 1.0]);
        assert_eq!(mesh.positions[5], [25.0, 35.0, 1.0]);
        assert_eq!(mesh.indices.len(), 4);
        assert_eq!(mesh.normals, [[0.0, 0.0, 1.0]; 6]);
        // Rows from south to north face up, too.
        let mut turned = flat;
        turned.grid.transform[5] = 10.0;
        assert_eq!(turned.mesh([0.0; 3]).normals, [[0.0, 0.0, 1.0]; 6]);
        let slope = raster(&[&[0.0, 10.0], &[0.0, 10.0]]).mesh([0.0; 3]);
        let half = 0.5_f32.sqrt();
        for normal in slope.normals {
            assert!((normal[0] + half).abs() < 1e-6 && (normal[2] - half).abs() < 1e-6);
        }
    }

    #[test]
    fn cells_without_data_are_holes() {
        let nan = f64::NAN;
        for missing in 0..4 {
            let mut one = raster(&[&[1.0, 2.0], &[3.0, 4.0]]);
            one.values[missing] = nan;
            let mesh = one.mesh([0.0; 3]);
            assert_eq!((mesh.positions.len(), mesh.indices.len()), (3, 1));
            assert!(mesh.normals[0][2] > 0.0);
        }
        let two = raster(&[&[1.0, nan, 1.0], &[nan, 1.0, 1.0]]);
        let mesh = two.mesh([0.0; 3]);
        assert_eq!(mesh.indices, [[1, 2, 3]]);
        assert_eq!(mesh.normals[0], [0.0; 3], "a centre without a triangle");
        assert_eq!(mesh.cells, [0, 2, 4, 5]);
        let cells = two.into_cells(&mesh);
        let all = cells.spread(&[1.0, 2.0, 3.0, 4.0]);
        assert!(all[1].is_nan() && all[3].is_nan());
        assert_eq!((all[0], all[2], all[4], all[5]), (1.0, 2.0, 3.0, 4.0));
    }
}
