//! Arrays of numpy (.npy), version 1 to 3 of the format.

use std::borrow::Cow;
use std::io::{self, Read, Seek, Write};

use crate::Grid;
use crate::grid::{check_transform, room_for};
use crate::pixels::bytes;

const MAGIC: &[u8] = b"\x93NUMPY";

/// What says where the cells of an array are.
pub type WorldFile<'a> = &'a dyn Fn() -> Result<Option<[f64; 6]>, String>;

/// What the header of an array says.
#[derive(Debug)]
pub struct Array {
    pub grid: Grid,
    /// Whether the numbers of a column follow each other, and not the numbers of a row.
    is_fortran: bool,
    /// Type of the numbers, such as `<f4`.
    kind: String,
    /// Bytes of each of them, and before all of them.
    size: u64,
    start: u64,
}

impl Array {
    /// Reads the header in the first bytes of a file, which has so many.
    pub fn new(
        bytes: &[u8],
        length_of_file: u64,
        world_file: WorldFile<'_>,
    ) -> Result<Self, String> {
        let not_npy = || "it is no .npy file".to_owned();
        let rest = bytes.strip_prefix(MAGIC).ok_or_else(not_npy)?;
        let &[major, _minor, ref rest @ ..] = rest else {
            return Err(not_npy());
        };
        let (length, rest) = match major {
            1 => rest.split_at_checked(2),
            2 | 3 => rest.split_at_checked(4),
            _ => return Err(format!("version {major} of .npy is not known")),
        }
        .ok_or_else(not_npy)?;
        // The lowest byte comes first.
        let length = length.iter().rev();
        let length = length.fold(0, |sum, &byte| sum << 8 | usize::from(byte));
        let (head, data) = rest.split_at_checked(length).ok_or_else(not_npy)?;
        let head = String::from_utf8_lossy(head);
        let [height, width] = shape(&head)?;
        let transform = world_file()?.ok_or(
            "an .npy has no place; add a world file of the same name with the extension .wld, of six lines: cell width, 0, 0, \
             minus cell height, x and y of the centre of the first cell",
        )?;
        let kind = field(&head, "descr").unwrap_or_default();
        let kind = kind.trim_start_matches(['\'', '"']);
        let kind: String = kind.chars().take_while(|c| !"'\"".contains(*c)).collect();
        // The kind is known, so its size follows its letter.
        numbers(&kind, &[], 0)?;
        let size: u64 = kind[2..].parse().unwrap_or_default();
        let start = (bytes.len() - data.len()) as u64;
        let found = u128::from(length_of_file.saturating_sub(start));
        let wanted = width as u128 * height as u128 * u128::from(size);
        if found != wanted {
            return Err(format!("found {found} bytes of numbers, wanted {wanted}"));
        }
        Ok(Self {
            grid: Grid {
                width,
                height,
                transform: check_transform(transform)?,
                crs: None,
            },
            is_fortran: field(&head, "fortran_order").is_some_and(|text| text.starts_with("True")),
            kind,
            size,
            start,
        })
    }

    /// Columns and rows of cells that follow each other.
    pub fn chunk(&self) -> [usize; 2] {
        match self.is_fortran {
            true => [1, self.grid.height],
            false => [self.grid.width, 1],
        }
    }

    /// Numbers of the cells `[column, row, columns, rows]` of a file, row by row; NaN unless they are finite.
    pub fn values(
        &self,
        file: &mut (impl Read + Seek),
        [left, top, columns, rows]: [usize; 4],
    ) -> Result<Vec<f64>, String> {
        let [width, height] = [self.grid.width, self.grid.height];
        // Lines of the file, and cells of each.
        let (length, [first, lines], [before, cells]) = match self.is_fortran {
            true => (height, [left, columns], [top, rows]),
            false => (width, [top, rows], [left, columns]),
        };
        let mut all = room_for(columns * rows)?;
        for line in first..first + lines {
            let from = self.start + (line * length + before) as u64 * self.size;
            let bytes = bytes(file, from, cells as u64 * self.size)?;
            let numbers = numbers(&self.kind, &bytes, cells)?.into_iter();
            all.extend(numbers.map(|x| if x.is_finite() { x } else { f64::NAN }));
        }
        if !self.is_fortran {
            return Ok(all);
        }
        let turned = (0..columns * rows).map(|at| all[at % columns * rows + at / columns]);
        Ok(turned.collect())
    }
}

/// Text after a key of the header.
fn field<'a>(head: &'a str, key: &str) -> Option<&'a str> {
    let quoted = [format!("'{key}'"), format!("\"{key}\"")];
    let (_, rest) = quoted
        .iter()
        .find_map(|key| head.split_once(key.as_str()))?;
    Some(rest.trim_start().strip_prefix(':')?.trim_start())
}

/// Rows and columns.
fn shape(head: &str) -> Result<[usize; 2], String> {
    let text = field(head, "shape").and_then(|text| text.strip_prefix('('));
    let text = text
        .and_then(|text| text.split_once(')'))
        .map(|(text, _)| text);
    let text = text.ok_or("its header has no shape")?;
    let sizes: Option<Vec<usize>> = (text.split(',').map(str::trim))
        .filter(|size| !size.is_empty())
        .map(|size| size.parse().ok())
        .collect();
    match sizes.as_deref() {
        Some(&[height, width]) => Ok([height, width]),
        _ => Err(format!("found the shape ({text}), wanted two dimensions")),
    }
}

/// So many numbers of a kind, such as `<f4`.
fn numbers(kind: &str, data: &[u8], count: usize) -> Result<Vec<f64>, String> {
    let unknown = || format!("found numbers `{kind}`, wanted f4, f8, i1 to i8 or u1 to u8");
    let (order, letter) = kind.split_at_checked(1).ok_or_else(unknown)?;
    let is_big = match order {
        "<" | "|" | "=" => false,
        ">" => true,
        _ => return Err(unknown()),
    };
    macro_rules! as_numbers {
        ($type:ty) => {{
            const SIZE: usize = size_of::<$type>();
            let (chunks, rest) = data.as_chunks::<SIZE>();
            if chunks.len() != count || !rest.is_empty() {
                let (found, wanted) = (data.len(), count * SIZE);
                return Err(format!("found {found} bytes of numbers, wanted {wanted}"));
            }
            let number = |bytes: &[u8; SIZE]| match is_big {
                true => <$type>::from_be_bytes(*bytes) as f64,
                false => <$type>::from_le_bytes(*bytes) as f64,
            };
            Ok(chunks.iter().map(number).collect())
        }};
    }
    match letter {
        "f4" => as_numbers!(f32),
        "f8" => as_numbers!(f64),
        "i1" => as_numbers!(i8),
        "i2" => as_numbers!(i16),
        "i4" => as_numbers!(i32),
        "i8" => as_numbers!(i64),
        "u1" => as_numbers!(u8),
        "u2" => as_numbers!(u16),
        "u4" => as_numbers!(u32),
        "u8" => as_numbers!(u64),
        _ => Err(unknown()),
    }
}

/// What is before the numbers of an array of 32-bit floats; of three dimensions if there are several planes of values.
fn head(grid: &Grid, planes: usize) -> Vec<u8> {
    let (height, width) = (grid.height, grid.width);
    let planes = match planes {
        0 | 1 => String::new(),
        planes => format!("{planes}, "),
    };
    let mut head = format!(
        "{{'descr': '<f4', 'fortran_order': False, 'shape': ({planes}{height}, {width}), }}"
    );
    // Data begin at a multiple of 64 bytes, and the header ends with a line.
    let before = MAGIC.len() + 4;
    let padding = (64 - (before + head.len() + 1) % 64) % 64;
    head.extend(std::iter::repeat_n(' ', padding));
    head.push('\n');
    let length = (head.len() as u16).to_le_bytes();
    [MAGIC, &[1, 0], &length, head.as_bytes()].concat()
}

/// Writes planes of 32-bit floats, which `plane` makes one after the other.
pub fn write<'a>(
    file: &mut (impl Write + ?Sized),
    grid: &Grid,
    planes: usize,
    plane: &mut dyn FnMut(usize) -> io::Result<Cow<'a, [f32]>>,
) -> io::Result<()> {
    file.write_all(&head(grid, planes))?;
    for index in 0..planes {
        let values = plane(index)?;
        assert_eq!(values.len(), grid.width * grid.height, "one value per cell");
        for values in values.chunks(1 << 14) {
            let bytes = values.iter().flat_map(|value| value.to_le_bytes());
            file.write_all(&bytes.collect::<Vec<u8>>())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::Raster;

    fn read(bytes: &[u8], place: WorldFile<'_>) -> Result<Raster, String> {
        let array = Array::new(bytes, bytes.len() as u64, place)?;
        let all = [0, 0, array.grid.width, array.grid.height];
        Ok(Raster {
            values: array.values(&mut Cursor::new(bytes), all)?,
            grid: array.grid,
            height_factor: None,
        })
    }

    const PLACE: [f64; 6] = [0.0, 1.0, 0.0, 2.0, 0.0, -1.0];

    fn array(descr: &str, order: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let head =
            format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
        let mut bytes = [MAGIC, &[1, 0]].concat();
        bytes.extend((head.len() as u16).to_le_bytes());
        bytes.extend(head.as_bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn arrays_come_back_in_any_order() {
        let place: WorldFile<'_> = &|| Ok(Some(PLACE));
        let values = [1.0, 2.0, f32::NAN, 4.0, 5.0, 6.0];
        let grid = Grid::north_up([3, 2], [0.0, 2.0], 1.0);
        let mut file = Vec::new();
        write(&mut file, &grid, 1, &mut |_| Ok(values.as_slice().into())).expect("a file");
        let raster = read(&file, place).expect("a raster");
        assert_eq!(raster.grid, grid);
        assert_eq!((raster.values[1], raster.values[5]), (2.0, 6.0));
        assert!(raster.values[2].is_nan());
        let big: Vec<u8> = [1_i16, 4, 2, 5, 3, 6]
            .iter()
            .flat_map(|x| x.to_be_bytes())
            .collect();
        let turned = array(">i2", "True", "(2, 3)", &big);
        let turned = read(&turned, place).expect("a raster");
        assert_eq!(turned.values, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    }

    #[test]
    fn arrays_that_are_no_rasters_are_refused() {
        let place: WorldFile<'_> = &|| Ok(Some(PLACE));
        for (bytes, word) in [
            (array("<f4", "False", "(2, 3)", &[0; 20]), "found 20 bytes"),
            (array("<f4", "False", "(6,)", &[0; 24]), "two dimensions"),
            (
                array("<c8", "False", "(2, 2)", &[0; 32]),
                "found numbers `<c8`",
            ),
            (b"\x93NUMPY\x01".to_vec(), "no .npy"),
            (
                array("<f4", "False", "(2, 2)", &[0; 16])[..20].to_vec(),
                "no .npy",
            ),
        ] {
            let error = read(&bytes, place).expect_err(word);
            assert!(error.contains(word), "{error}");
        }
        let whole = array("<f4", "False", "(2, 2)", &[0; 16]);
        let error = read(&whole, &|| Ok(None)).expect_err("no place");
        assert!(error.contains(".wld"), "{error}");
    }
}
