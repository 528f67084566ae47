//! A shard: part of a picture, for one machine of several.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Every `count`-th tile of a picture, from tile `index` on. Neighbouring tiles, of about equal cost, go to different
/// shards.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    index: u32,
    count: u32,
}

impl Shard {
    /// The whole picture.
    pub const WHOLE: Self = Self { index: 0, count: 1 };

    /// Shard `index` of `count`, counted from 0. `None` unless `index < count`.
    pub fn new(index: u32, count: u32) -> Option<Self> {
        (index < count).then_some(Self { index, count })
    }

    /// Number of the shard, from 0.
    pub fn index(self) -> u32 {
        self.index
    }

    /// Number of shards.
    pub fn count(self) -> u32 {
        self.count
    }

    /// Whether the shard is the whole picture.
    pub fn is_whole(self) -> bool {
        self.count == 1
    }

    /// Whether a tile is in this shard.
    pub fn holds(self, tile: usize) -> bool {
        tile % self.count as usize == self.index as usize
    }

    /// Whether [`Shard::new`] makes this shard. A shard from a file may be invalid.
    pub(crate) fn is_valid(self) -> bool {
        self.index < self.count
    }
}

impl Default for Shard {
    fn default() -> Self {
        Self::WHOLE
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

/// Error of a text that is not `I/N` with I from 0 to N - 1.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not I/N with I from 0 to N - 1, as 0/4 is the first of four")]
pub struct BadShard(String);

impl FromStr for Shard {
    type Err = BadShard;

    fn from_str(text: &str) -> Result<Self, BadShard> {
        let numbers = text.split_once('/');
        numbers
            .and_then(|(index, count)| Self::new(index.parse().ok()?, count.parse().ok()?))
            .ok_or_else(|| BadShard(text.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_share_the_tiles() {
        for count in [1, 2, 3, 7, 100] {
            for tile in 0..50 {
                let holders = (0..count).filter_map(|index| Shard::new(index, count));
                assert_eq!(holders.filter(|shard| shard.holds(tile)).count(), 1);
            }
        }
    }

    #[test]
    fn shards_are_read_as_they_are_written() {
        for text in ["0/1", "3/4", "0/4294967295"] {
            assert_eq!(
                text.parse::<Shard>().map(|s| s.to_string()),
                Ok(text.into())
            );
        }
        for text in [
            "",
            "1",
            "1/1",
            "4/3",
            "0/0",
            "-1/2",
            "1/2/3",
            "a/b",
            "0/4294967296",
        ] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }
}
