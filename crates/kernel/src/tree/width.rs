//! Node widths.

use core::fmt;
use core::str::FromStr;

use antumbra_simd::Level;

/// How many children a node has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Width {
    /// 4 children: the paper's QBVH.
    W4,
    /// 8 children: the paper's OBVH.
    W8,
    /// 16 children.
    W16,
}

impl Width {
    /// Every width there is.
    pub const ALL: [Self; 3] = [Self::W4, Self::W8, Self::W16];

    /// Children per node: 4, 8 or 16.
    pub const fn lanes(self) -> usize {
        match self {
            Self::W4 => 4,
            Self::W8 => 8,
            Self::W16 => 16,
        }
    }

    /// The width with so many children per node; `None` unless that is 4, 8 or 16.
    pub fn from_lanes(lanes: usize) -> Option<Self> {
        Self::ALL.into_iter().find(|width| width.lanes() == lanes)
    }

    /// The width that is used by default on a level: as wide as its registers, and twice that on SSE4.1, where fewer visits
    /// more than make up for two steps per node.
    pub fn auto(level: Level) -> Self {
        match level {
            Level::Avx512 => Self::W16,
            Level::Avx2 | Level::Sse41 => Self::W8,
            Level::Neon | Level::Scalar => Self::W4,
        }
    }
}

impl fmt::Display for Width {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.lanes())
    }
}

/// A text that names no [`Width`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown width `{0}`; known are 4, 8, 16")]
pub struct UnknownWidth(pub String);

impl FromStr for Width {
    type Err = UnknownWidth;

    fn from_str(text: &str) -> Result<Self, UnknownWidth> {
        text.parse()
            .ok()
            .and_then(Self::from_lanes)
            .ok_or_else(|| UnknownWidth(text.to_owned()))
    }
}
