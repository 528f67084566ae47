//! Matrices of yes and no, one bit each.

use rayon::prelude::*;

use crate::Error;

/// Answers about every pair of two lists: one bit for each row and column.
///
/// A row is [`words_per_row`](Self::words_per_row) words of 64 bits. The bit of column `j` is bit `j % 64` of word `j / 64` of
/// the row, and bits behind the last column are 0. As bytes in little-endian order, rows are what
/// `numpy.unpackbits(bytes, axis=1, count=columns, bitorder="little")` reads.
///
/// ```
/// use antumbra_bake::BitMatrix;
///
/// let mut seen = BitMatrix::new(2, 70)?;
/// seen.set(1, 69, true);
/// assert!(seen.get(1, 69) && !seen.get(0, 69));
/// assert_eq!(seen.count_rows(), [0, 1]);
/// assert_eq!(seen.row(1), [0, 1 << 5]);
/// # Ok::<(), antumbra_bake::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BitMatrix {
    rows: usize,
    columns: usize,
    words: Vec<u64>,
}

impl BitMatrix {
    /// A matrix of zeros.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if there is no memory for it.
    pub fn new(rows: usize, columns: usize) -> Result<Self, Error> {
        let too_large = Error::TooLarge { rows, columns };
        let Some(len) = rows.checked_mul(columns.div_ceil(64)) else {
            return Err(too_large);
        };
        let mut words = Vec::new();
        words.try_reserve_exact(len).map_err(|_| too_large)?;
        words.resize(len, 0);
        Ok(Self {
            rows,
            columns,
            words,
        })
    }

    /// The matrix that [`words`](Self::words) was called on. Bits behind the last column are cleared.
    ///
    /// # Errors
    /// [`Error::Length`] if there are not `rows * columns.div_ceil(64)` words.
    pub fn from_words(rows: usize, columns: usize, words: Vec<u64>) -> Result<Self, Error> {
        let wanted = rows.saturating_mul(columns.div_ceil(64));
        Error::check_length("words", words.len(), wanted)?;
        let mut matrix = Self {
            rows,
            columns,
            words,
        };
        let (last, per_row) = (columns % 64, matrix.words_per_row());
        if last > 0 {
            for row in matrix.words.chunks_exact_mut(per_row) {
                row[per_row - 1] &= (1 << last) - 1;
            }
        }
        Ok(matrix)
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Words of a row: a 64th of the columns, rounded up.
    pub fn words_per_row(&self) -> usize {
        self.columns.div_ceil(64)
    }

    /// All words, row by row.
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// All words, row by row.
    pub fn into_words(self) -> Vec<u64> {
        self.words
    }

    /// All words, to be written to. Bits behind the last column must stay 0.
    pub(crate) fn words_mut(&mut self) -> &mut [u64] {
        &mut self.words
    }

    /// Words of one row.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn row(&self, row: usize) -> &[u64] {
        assert!(row < self.rows, "row {row} of {}", self.rows);
        let per_row = self.words_per_row();
        &self.words[row * per_row..][..per_row]
    }

    /// One bit.
    ///
    /// # Panics
    /// If there is no such row or column.
    pub fn get(&self, row: usize, column: usize) -> bool {
        assert!(column < self.columns, "column {column} of {}", self.columns);
        self.row(row)[column / 64] >> (column % 64) & 1 == 1
    }

    /// Sets one bit.
    ///
    /// # Panics
    /// If there is no such row or column.
    pub fn set(&mut self, row: usize, column: usize, value: bool) {
        assert!(row < self.rows, "row {row} of {}", self.rows);
        assert!(column < self.columns, "column {column} of {}", self.columns);
        let word = &mut self.words[row * self.columns.div_ceil(64) + column / 64];
        let bit = 1 << (column % 64);
        *word = if value { *word | bit } else { *word & !bit };
    }

    /// Number of ones in the matrix.
    pub fn count(&self) -> u64 {
        let words = self.words.par_iter().with_min_len(1 << 12);
        words.map(|word| u64::from(word.count_ones())).sum()
    }

    /// Number of ones in every row.
    pub fn count_rows(&self) -> Vec<u64> {
        let rows = (0..self.rows).into_par_iter().with_min_len(1 << 8);
        let ones = |word: &u64| u64::from(word.count_ones());
        let count = |row| self.row(row).iter().map(ones).sum();
        rows.map(count).collect()
    }

    /// Number of ones in every column.
    pub fn count_columns(&self) -> Vec<u64> {
        let mut counts = vec![0; self.columns];
        for row in 0..self.rows {
            for column in ones(self.row(row)) {
                counts[column] += 1;
            }
        }
        counts
    }

    /// Sum of the weights of the ones of every row. Weights are added in the order of columns, so that sums have the same
    /// bits for any number of threads.
    ///
    /// # Errors
    /// [`Error::Length`] if there is not one weight for each column.
    pub fn weighted_sums(&self, weights: &[f64]) -> Result<Vec<f64>, Error> {
        Error::check_length("weights", weights.len(), self.columns)?;
        let rows = (0..self.rows).into_par_iter().with_min_len(64);
        let sum = |row| ones(self.row(row)).fold(0.0, |sum, column| sum + weights[column]);
        Ok(rows.map(sum).collect())
    }

    /// Appends the rows of another matrix below the rows of this one.
    ///
    /// # Errors
    /// [`Error::Length`] if the matrices differ in their columns, [`Error::TooLarge`] if there is no memory for both.
    pub fn append(&mut self, below: &Self) -> Result<(), Error> {
        Error::check_length("columns", below.columns, self.columns)?;
        let rows = self.rows.saturating_add(below.rows);
        let reserved = self.words.try_reserve(below.words.len());
        reserved.map_err(|_| Error::TooLarge {
            rows,
            columns: self.columns,
        })?;
        self.words.extend_from_slice(&below.words);
        self.rows = rows;
        Ok(())
    }
}

/// Columns of the ones of a row, in ascending order.
pub fn ones(row: &[u64]) -> impl Iterator<Item = usize> + '_ {
    row.iter().enumerate().flat_map(|(index, &word)| {
        let mut left = word;
        std::iter::from_fn(move || {
            (left != 0).then(|| {
                let bit = left.trailing_zeros() as usize;
                left &= left - 1;
                64 * index + bit
            })
        })
    })
}

#[cfg(test)]
mod tests {
    use antumbra_testkit::Rng;

    use super::*;

    #[test]
    fn counts_and_sums_are_those_of_single_bits() {
        let mut rng = Rng::new(3);
        for (rows, columns) in [(0, 5), (5, 0), (3, 1), (7, 64), (9, 65), (4, 700)] {
            let mut matrix = BitMatrix::new(rows, columns).expect("a matrix");
            let mut plain = vec![vec![false; columns]; rows];
            for _ in 0..rows * columns {
                let pick = |rng: &mut Rng, n: usize| (rng.bits() % n as u64) as usize;
                let (row, column) = (pick(&mut rng, rows), pick(&mut rng, columns));
                let value = rng.bits() & 3 > 0;
                matrix.set(row, column, value);
                plain[row][column] = value;
            }
            let weights: Vec<f64> = (0..columns).map(|i| 1.0 / (1 + i) as f64).collect();
            let sums = matrix.weighted_sums(&weights).expect("sums");
            let counts = matrix.count_rows();
            for row in 0..rows {
                let ones = (0..columns).filter(|&column| plain[row][column]);
                assert!(ones.clone().eq(super::ones(matrix.row(row))));
                assert!((0..columns).all(|column| matrix.get(row, column) == plain[row][column]));
                assert_eq!(counts[row], ones.clone().count() as u64);
                assert_eq!(
                    sums[row],
                    ones.fold(0.0, |sum, column| sum + weights[column])
                );
            }
            for (column, &count) in matrix.count_columns().iter().enumerate() {
                assert_eq!(count, plain.iter().filter(|row| row[column]).count() as u64);
            }
            assert_eq!(matrix.count(), counts.iter().sum::<u64>());
            let words = matrix.words().to_vec();
            let same = BitMatrix::from_words(rows, columns, words).expect("the same");
            assert_eq!(same, matrix);
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        assert!(matches!(
            BitMatrix::new(usize::MAX, 65),
            Err(Error::TooLarge { .. })
        ));
        assert!(matches!(
            BitMatrix::new(1 << 60, 1),
            Err(Error::TooLarge { .. })
        ));
        let error = BitMatrix::from_words(2, 65, vec![0; 3]).unwrap_err();
        assert_eq!(error.to_string(), "words: found 3, wanted 4");
        let full = BitMatrix::from_words(1, 3, vec![u64::MAX]).expect("a matrix");
        assert_eq!((full.count(), full.row(0)[0]), (3, 7));
        assert!(full.weighted_sums(&[1.0]).is_err());
        let mut two = full.clone();
        two.append(&full).expect("the same columns");
        assert_eq!((two.rows(), two.count()), (2, 6));
        assert!(
            two.append(&BitMatrix::new(1, 4).expect("a matrix"))
                .is_err()
        );
    }
}
