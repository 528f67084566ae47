//! Planes of bits: a bit for each cell, where each row begins with a new word.

use rayon::prelude::*;

use crate::{Error, memory};

/// The plane of a raster whose columns are the rows of another one, of so many columns and rows.
pub fn turn(plane: &[u64], [columns, rows]: [usize; 2]) -> Result<Vec<u64>, Error> {
    let [from, to] = [columns.div_ceil(64), rows.div_ceil(64)];
    let mut turned = memory::filled("words", columns * to, 0)?;
    for (at, first) in (0..rows).step_by(64).enumerate() {
        for word in 0..from {
            let mut block = [0; 64];
            for (row, own) in block.iter_mut().enumerate().take(rows - first) {
                *own = plane[(first + row) * from + word];
            }
            transpose(&mut block);
            for (row, own) in block.iter().enumerate().take(columns - 64 * word) {
                turned[(64 * word + row) * to + at] = *own;
            }
        }
    }
    Ok(turned)
}

/// The plane of so many columns of another one with so many words in a row, which begin at a bit of its first words.
pub fn moved(plane: Vec<u64>, words: usize, bit: usize, columns: usize) -> Result<Vec<u64>, Error> {
    let count = columns.div_ceil(64);
    if bit == 0 {
        return Ok(plane);
    }
    let mut moved = memory::room("words", plane.len() / words * count)?;
    for row in plane.chunks_exact(words) {
        let next = |word: usize| row.get(word + 1).map_or(0, |next| next << (64 - bit));
        moved.extend((0..count).map(|word| row[word] >> bit | next(word)));
    }
    Ok(moved)
}

/// Calls `add` for each cell of a raster of this width: with its number, its values, of which all cells have as many, and its bits in up
/// to 64 planes of [`Shadows::lit`](crate::Shadows::lit), the first one lowest.
///
/// ```
/// use antumbra_terrain::{HeightField, Shadows, per_cell};
///
/// let heights = [0.0, 0.0, 0.0, 2.0].repeat(2);
/// let field = HeightField::new([4, 2], &heights, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0])?;
/// // A sun in the east, low and then high.
/// let planes = Shadows::new(&field, 0.0)?.all_lit(&[[90.0, 0.5], [90.0, 1.5]], &())?;
/// let mut suns = [0; 8];
/// per_cell(&planes, 4, &mut suns, |_, suns, seen| suns[0] += seen.count_ones());
/// assert_eq!(suns, [1, 1, 0, 2, 1, 1, 0, 2]);
/// # Ok::<(), antumbra_terrain::Error>(())
/// ```
///
/// # Panics
/// If there are more than 64 planes, or not as many values for each of their cells.
pub fn per_cell<T: Send, P: AsRef<[u64]> + Sync>(
    planes: &[P],
    width: usize,
    values: &mut [T],
    add: impl Fn(usize, &mut [T], u64) + Sync,
) {
    let words = width.div_ceil(64);
    let Some(rows) = planes.first().map(|plane| plane.as_ref().len() / words) else {
        return;
    };
    let each = values.len() / (width * rows);
    assert_eq!(
        values.len(),
        each * width * rows,
        "as many values for each cell"
    );
    if each == 0 {
        return;
    }
    let rows = values.par_chunks_mut(each * width).enumerate();
    rows.for_each(|(row, values)| {
        for (word, values) in values.chunks_mut(each * 64).enumerate() {
            let mut block = [0; 64];
            for (index, plane) in planes.iter().enumerate() {
                block[index] = plane.as_ref()[row * words + word];
            }
            transpose(&mut block);
            let first = row * width + 64 * word;
            let cells = values.chunks_exact_mut(each).zip(&block).enumerate();
            for (column, (values, &seen)) in cells {
                add(first + column, values, seen);
            }
        }
    });
}

/// Swaps rows and columns of 64 by 64 bits: in halves, quarters and so on (Warren, "Hacker's Delight", 7-3).
fn transpose(rows: &mut [u64; 64]) {
    let mut size = 32;
    let mut mask = u64::MAX >> 32;
    while size > 0 {
        let mut row = 0;
        while row < 64 {
            let swapped = (rows[row] >> size ^ rows[row + size]) & mask;
            rows[row] ^= swapped << size;
            rows[row + size] ^= swapped;
            row = (row + size + 1) & !size;
        }
        size /= 2;
        mask ^= mask << size;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turned_planes_have_columns_for_rows() {
        let [columns, rows] = [150_usize, 70];
        let is_set = |column: usize, row: usize| (column * 7 + row * row).is_multiple_of(3);
        let mut plane = vec![0; rows * columns.div_ceil(64)];
        for row in 0..rows {
            for column in 0..columns {
                let bit = u64::from(is_set(column, row)) << (column % 64);
                plane[row * columns.div_ceil(64) + column / 64] |= bit;
            }
        }
        let turned = turn(&plane, [columns, rows]).expect("a plane");
        assert_eq!(turned.len(), columns * 2);
        for row in 0..rows {
            for column in 0..columns {
                let bit = turned[column * 2 + row / 64] >> (row % 64) & 1;
                assert_eq!(bit == 1, is_set(column, row), "{column} {row}");
            }
        }
    }
}
