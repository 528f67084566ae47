//! Where the cells of a raster are.

use crate::Crs;

/// Cells of a raster: their number, and their place in map coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Map coordinates of the corner of column `c` and row `r`, in the order of GDAL: `x = t[0] + c t[1] + r t[2]` and
    /// `y = t[3] + c t[4] + r t[5]`. The centre of the first cell is at `c = r = 0.5`.
    pub transform: [f64; 6],
    /// Coordinate system; `None` if it is not known.
    pub crs: Option<Crs>,
}

/// Cells of a raster that have data, as vertices of its mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct RasterCells {
    /// All cells.
    pub grid: Grid,
    /// Cell of each vertex, `[n]`: its row times the width and its column.
    pub cells: Vec<u32>,
}

impl RasterCells {
    /// Values of all cells from the values of vertices; NaN where a cell has no data.
    pub fn spread(&self, values: &[f32]) -> Vec<f32> {
        let mut all = vec![f32::NAN; self.grid.width * self.grid.height];
        for (&cell, &value) in self.cells.iter().zip(values) {
            all[cell as usize] = value;
        }
        all
    }
}

impl Grid {
    /// Square cells in rows from north to south, whose north-western corner is at `corner`.
    pub fn north_up([width, height]: [usize; 2], corner: [f64; 2], cell: f64) -> Self {
        Self {
            width,
            height,
            transform: [corner[0], cell, 0.0, corner[1], 0.0, -cell],
            crs: None,
        }
    }

    /// Map coordinates of the centre of a cell.
    pub fn centre(&self, column: usize, row: usize) -> [f64; 2] {
        self.corner(column as f64 + 0.5, row as f64 + 0.5)
    }

    /// Map coordinates of a column and a row, which may be between cells.
    pub fn corner(&self, c: f64, r: f64) -> [f64; 2] {
        let t = &self.transform;
        [t[0] + c * t[1] + r * t[2], t[3] + c * t[4] + r * t[5]]
    }

    /// Side of the cells, if they are squares in rows from north to south and columns from west to east.
    pub fn square_cell(&self) -> Option<f64> {
        let [_, width, skew, _, tilt, height] = self.transform;
        let is_square = (width + height).abs() <= 1e-9 * width.abs();
        (width > 0.0 && is_square && skew == 0.0 && tilt == 0.0).then_some(width)
    }

    /// Whether columns run from east to west, and rows from south to north; neither of turned and sheared cells.
    pub(crate) fn mirrored(&self) -> [bool; 2] {
        let [_, a, b, _, d, e] = self.transform;
        let is_level = b == 0.0 && d == 0.0;
        [is_level && a < 0.0, is_level && e > 0.0]
    }

    /// The same cells in rows from north to south and columns from west to east, unless they are turned or sheared.
    pub(crate) fn upright(mut self) -> Self {
        let [columns, rows] = self.mirrored();
        let [x, a, _, y, _, e] = self.transform;
        if rows {
            self.transform[3] = y + e * self.height as f64;
            self.transform[5] = -e;
        }
        if columns {
            self.transform[0] = x + a * self.width as f64;
            self.transform[1] = -a;
        }
        self
    }

    /// Name of the coordinate system.
    pub(crate) fn system(&self) -> String {
        let crs = self.crs.as_ref();
        crs.map_or("no coordinate system".into(), Crs::name)
    }

    /// Column and row of the first cell of another grid among the cells of this one; `None` unless cells fall on cells.
    pub(crate) fn place_of(&self, other: &Self) -> Option<[i64; 2]> {
        let [x, a, b, y, d, e] = self.transform;
        let area = a * e - b * d;
        let cell = |c: usize, r: usize| {
            let [east, north] = other.corner(c as f64, r as f64);
            let [east, north] = [east - x, north - y];
            [(e * east - b * north) / area, (a * north - d * east) / area]
        };
        let first = cell(0, 0).map(f64::round);
        let is_on = |[c, r]: [usize; 2]| {
            let [column, row] = cell(c, r);
            let off = [column - first[0] - c as f64, row - first[1] - r as f64];
            off.iter().all(|off| off.abs() <= OFF_LATTICE)
        };
        let corners = [[0, 0], [other.width, 0], [0, other.height]];
        let is_one = self.system() == other.system() && corners.into_iter().all(is_on);
        // No memory reaches so far, and sums do not overflow.
        is_one.then(|| first.map(|cells| cells.clamp(-1e15, 1e15) as i64))
    }

    /// Whether coordinates could be degrees: no coordinate system is known, and cells are small numbers on the globe.
    pub fn may_be_degrees(&self) -> bool {
        let ends = [[0, 0], [self.width, self.height]].map(|[c, r]| self.centre(c, r));
        let is_on_globe = |[x, y]: [f64; 2]| x.abs() <= 360.0 && y.abs() <= 90.0;
        let cell = self.transform[1].abs().max(self.transform[5].abs());
        self.crs.is_none() && cell < 0.1 && ends.into_iter().all(is_on_globe)
    }
}

/// Parts of a cell that cells of one lattice may lie beside each other.
const OFF_LATTICE: f64 = 1e-6;

/// Refuses transforms that are no places of cells.
pub(crate) fn check_transform(transform: [f64; 6]) -> Result<[f64; 6], String> {
    let [_, a, b, _, d, e] = transform;
    let area = a * e - b * d;
    match transform.iter().all(|x| x.is_finite()) && area != 0.0 && area.is_finite() {
        true => Ok(transform),
        false => Err(format!("its cells have no size: {transform:?}")),
    }
}

/// Refuses rasters without a triangle, and those that have more cells than there is room for.
pub(crate) fn check_size([width, height]: [usize; 2], room: u64) -> Result<(), String> {
    let cells = width as u128 * height as u128;
    if width < 2 || height < 2 {
        return Err(format!(
            "found {width} x {height} cells, wanted at least 2 x 2"
        ));
    }
    match cells <= u128::from(room) {
        true => Ok(()),
        false => Err(format!(
            "{width} x {height} cells are more than the {room} that fit into memory"
        )),
    }
}

/// A list with room for so many values.
pub(crate) fn room_for<T>(count: usize) -> Result<Vec<T>, String> {
    let mut values = Vec::new();
    let room = values.try_reserve_exact(count);
    room.map_err(|error| error.to_string())?;
    Ok(values)
}

/// Transform of a world file: six lines, of which the last two are the centre of the first cell.
pub(crate) fn world_file(text: &str) -> Result<[f64; 6], String> {
    let numbers: Option<Vec<f64>> = text
        .split_whitespace()
        .map(|word| word.parse().ok())
        .collect();
    let Some(&[a, d, b, e, x, y]) = numbers.as_deref() else {
        return Err("a world file has six numbers".into());
    };
    check_transform([x - 0.5 * (a + b), a, b, y - 0.5 * (d + e), d, e])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn world_files_name_the_centre_of_the_first_cell() {
        let transform = world_file("10\n0\n0\n-10\n600005\n5340095\n").expect("a transform");
        assert_eq!(transform, [600_000.0, 10.0, 0.0, 5_340_100.0, 0.0, -10.0]);
        for text in [
            "",
            "10 0 0 -10 5",
            "a 0 0 -1 0 0",
            "0 0 0 -1 0 0",
            "nan 0 0 1 0 0",
        ] {
            assert!(world_file(text).is_err(), "{text}");
        }
    }

    #[test]
    fn cells_of_a_size_that_fits() {
        assert!(check_size([2, 2], 4).is_ok());
        assert!(check_size([2, 2], 3).is_err());
        assert!(check_size([1, 9], 100).is_err());
        assert!(check_size([usize::MAX, usize::MAX], u64::MAX).is_err());
    }
}
