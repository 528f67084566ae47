//! ESRI ASCII grids.

use std::fmt::Write as _;

use crate::grid::{check_transform, room_for};
use crate::{Grid, Raster};

/// Mark of cells without data in files that we write.
const NO_DATA: f64 = -9999.0;

/// What the header has said so far.
#[derive(Default)]
struct Header {
    size: [Option<usize>; 2],
    /// West and south, and whether this is the centre of a cell.
    corner: [Option<(f64, bool)>; 2],
    cell: [Option<f64>; 2],
    no_data: Option<f64>,
}

/// Reads a grid; `check` refuses one before there is memory for it. Marks of cells without data stay if it is to be `is_raw`.
pub fn read(
    bytes: &[u8],
    is_raw: bool,
    check: impl FnOnce(&Grid) -> Result<(), String>,
) -> Result<Raster, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "it is no text")?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = (1..).zip(text.lines()).peekable();
    let mut header = Header::default();
    while let Some((line, text)) = lines.peek() {
        let mut words = text.split_whitespace();
        let Some(key) = words.next() else {
            lines.next();
            continue;
        };
        if !key.starts_with(|c: char| c.is_ascii_alphabetic()) || key.eq_ignore_ascii_case("nan") {
            break;
        }
        let value = words.next().unwrap_or_default();
        header
            .take(&key.to_ascii_lowercase(), value)
            .map_err(|reason| format!("line {line}: {reason}"))?;
        lines.next();
    }
    let grid = header.grid()?;
    check(&grid)?;
    let no_data = header.no_data.filter(|_| !is_raw);
    let count = grid.width * grid.height;
    let mut values = room_for(count)?;
    for (line, text) in lines {
        for word in text.split_whitespace() {
            let value: f64 = word
                .parse()
                .map_err(|_| format!("line {line}: found `{word}`, wanted a number"))?;
            if values.len() == count {
                return Err(format!("line {line}: found more than {count} values"));
            }
            // Marks may have fewer digits than values.
            let is_mark = |mark: f64| value == mark || value as f32 == mark as f32;
            let is_data = value.is_finite() && !no_data.is_some_and(is_mark);
            values.push(if is_data { value } else { f64::NAN });
        }
    }
    if values.len() != count {
        let (found, Grid { width, height, .. }) = (values.len(), grid);
        return Err(format!(
            "found {found} values, wanted {width} x {height} = {count}: the file is not complete"
        ));
    }
    Ok(Raster {
        grid,
        values,
        height_factor: None,
    })
}

impl Header {
    fn take(&mut self, key: &str, text: &str) -> Result<(), String> {
        let number = || match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(format!("{key}: found `{text}`, wanted a number")),
        };
        let size = || {
            text.parse::<usize>()
                .map_err(|_| format!("{key}: found `{text}`, wanted a whole number"))
        };
        match key {
            "ncols" => self.size[0] = Some(size()?),
            "nrows" => self.size[1] = Some(size()?),
            "xllcorner" => self.corner[0] = Some((number()?, false)),
            "yllcorner" => self.corner[1] = Some((number()?, false)),
            "xllcenter" => self.corner[0] = Some((number()?, true)),
            "yllcenter" => self.corner[1] = Some((number()?, true)),
            "cellsize" => self.cell = [Some(number()?); 2],
            "dx" => self.cell[0] = Some(number()?),
            "dy" => self.cell[1] = Some(number()?),
            "nodata_value" | "nodata" => match text.parse() {
                Ok(mark) => self.no_data = Some(mark),
                Err(_) => return Err(format!("{key}: found `{text}`, wanted a number")),
            },
            _ => return Err(format!("`{key}` is no key of an ESRI ASCII grid")),
        }
        Ok(())
    }

    fn grid(&self) -> Result<Grid, String> {
        let missing = |key: &str| format!("its header has no {key}");
        let width = self.size[0].ok_or_else(|| missing("ncols"))?;
        let height = self.size[1].ok_or_else(|| missing("nrows"))?;
        let (west, is_west_centre) = self.corner[0].ok_or_else(|| missing("xllcorner"))?;
        let (south, is_south_centre) = self.corner[1].ok_or_else(|| missing("yllcorner"))?;
        let [Some(dx), Some(dy)] = self.cell else {
            return Err(missing("cellsize"));
        };
        if !(dx > 0.0 && dy > 0.0) {
            return Err(format!(
                "cellsize: found {dx} and {dy}, wanted lengths above 0"
            ));
        }
        let west = west - if is_west_centre { 0.5 * dx } else { 0.0 };
        let south = south - if is_south_centre { 0.5 * dy } else { 0.0 };
        let north = south + dy * height as f64;
        Ok(Grid {
            width,
            height,
            transform: check_transform([west, dx, 0.0, north, 0.0, -dy])?,
            crs: None,
        })
    }
}

/// Writes a grid.
pub fn write(grid: &Grid, values: &[f32]) -> Result<Vec<u8>, String> {
    let Some(cell) = grid.square_cell() else {
        let reason = "an .asc has square cells in rows from north to south; choose a .tif";
        return Err(reason.into());
    };
    let [west, _, _, north, ..] = grid.transform;
    let mut text = format!(
        "ncols {}\nnrows {}\nxllcorner {west}\nyllcorner {}\ncellsize {cell}\nNODATA_value {NO_DATA}\n",
        grid.width,
        grid.height,
        north - cell * grid.height as f64,
    );
    for row in values.chunks(grid.width) {
        for (column, value) in row.iter().enumerate() {
            let gap = if column == 0 { "" } else { " " };
            let _ = match value.is_finite() {
                true => write!(text, "{gap}{value}"),
                false => write!(text, "{gap}{NO_DATA}"),
            };
        }
        text.push('\n');
    }
    Ok(text.into_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str =
        "NCOLS 3\nnrows 2\nxllcorner 100\nyllcorner 50\ncellsize 10\nNODATA_value -1\n";

    fn text(text: &str) -> Result<Raster, String> {
        read(text.as_bytes(), false, |_| Ok(()))
    }

    #[test]
    fn rows_run_from_the_north() {
        let raster = text(&format!("{HEAD}1 2 -1\r\n\n4 nan\n6.5\n")).expect("a raster");
        let known: Vec<f64> = raster
            .values
            .iter()
            .copied()
            .filter(|x| !x.is_nan())
            .collect();
        assert_eq!(known, [1.0, 2.0, 4.0, 6.5]);
        assert!(raster.values[2].is_nan() && raster.values[4].is_nan());
        assert_eq!(raster.grid.centre(0, 0), [105.0, 65.0]);
        let centres = HEAD.replace("xllcorner 100", "xllcenter 105");
        let same = text(&format!("{centres}1 2 3 4 5 6")).expect("a raster");
        assert_eq!(same.grid, raster.grid);
        let marked = text(&format!("\u{feff}{HEAD}1 2 -1 4 nan 6.5")).expect("a byte order mark");
        assert_eq!(marked.grid, raster.grid);
        let values: Vec<f32> = raster.values.iter().map(|&x| x as f32).collect();
        let again = write(&raster.grid, &values).expect("square cells");
        let again = read(&again, false, |_| Ok(())).expect("a raster");
        assert_eq!(again.grid, raster.grid);
        assert_eq!(
            format!("{:?}", again.values),
            format!("{:?}", raster.values)
        );
    }

    #[test]
    fn mistakes_have_a_line() {
        for (given, word) in [
            (format!("{HEAD}1 2 3 4 5"), "found 5 values, wanted 3 x 2"),
            (format!("{HEAD}1 2 3 4 5 6 7"), "line 7: found more than 6"),
            (format!("{HEAD}1 2 3\n4,5 5 6"), "line 8: found `4,5`"),
            (HEAD.replace("NCOLS 3\n", ""), "no ncols"),
            (HEAD.replace("cellsize 10", "cellsize 0"), "lengths above 0"),
            (HEAD.replace("cellsize", "cell"), "line 5: `cell`"),
            (
                HEAD.replace("-1\n", "-9999,0\n"),
                "line 6: nodata_value: found `-9999,0`",
            ),
        ] {
            let error = text(&given).expect_err(&given);
            assert!(error.contains(word), "{error}");
        }
    }
}
