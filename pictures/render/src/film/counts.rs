//! Numbers of samples of many pixels: 2 bytes each, as long as none exceeds 65 535.

use serde::{Deserialize, Serialize};

/// Numbers of samples of many pixels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Counts {
    /// All below 2¹⁶.
    Short(Vec<u16>),
    /// Some were not.
    Long(Vec<u32>),
}

impl Counts {
    /// `len` pixels without samples.
    pub fn new(len: usize) -> Self {
        Self::Short(vec![0; len])
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        match self {
            Self::Short(counts) => counts.len(),
            Self::Long(counts) => counts.len(),
        }
    }

    /// Number of samples of a pixel.
    #[inline]
    pub fn get(&self, index: usize) -> u32 {
        match self {
            Self::Short(counts) => u32::from(counts[index]),
            Self::Long(counts) => counts[index],
        }
    }

    /// Adds samples to a pixel. More than [`u32::MAX`] count as so many.
    #[inline]
    pub fn add(&mut self, index: usize, more: u32) {
        let sum = self.get(index).saturating_add(more);
        if let (Self::Short(counts), Ok(sum)) = (&mut *self, u16::try_from(sum)) {
            counts[index] = sum;
            return;
        }
        if let Self::Short(counts) = self {
            *self = Self::Long(counts.iter().copied().map(u32::from).collect());
        }
        if let Self::Long(counts) = self {
            counts[index] = sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_grow_beyond_their_width() {
        let mut counts = Counts::new(3);
        for (more, sum) in [
            (65_535, 65_535),
            (1, 65_536),
            (u32::MAX - 65_537, u32::MAX - 1),
            (1, u32::MAX),
            (1, u32::MAX),
        ] {
            counts.add(1, more);
            assert_eq!([0, 1, 2].map(|i| counts.get(i)), [0, sum, 0]);
            assert_eq!(matches!(counts, Counts::Long(_)), sum > 65_535);
        }
        assert_eq!(counts.len(), 3);
    }
}
