//! Node widths.

use antumbra_simd::Level;

use antumbra_simd::named_list;

named_list! {
    /// How many children a node has.
    ///
    /// ```
    /// use antumbra::Width;
    ///
    /// assert_eq!(Width::from_lanes(8), Some(Width::W8));
    /// assert_eq!(Width::W4.lanes(), 4);
    /// ```
    pub enum Width("width"): () {
        W4 = "4", "Four children per node: the paper's QBVH", None, ();
        W8 = "8", "Eight children per node: the paper's OBVH", None, ();
        W16 = "16", "Sixteen children per node: as many as an AVX-512 register has lanes", None, ();
    }
}

impl Width {
    /// Children per node.
    pub const fn lanes(self) -> usize {
        match self {
            Self::W4 => 4,
            Self::W8 => 8,
            Self::W16 => 16,
        }
    }

    /// The width with so many children per node; `None` unless that is 4, 8 or 16.
    pub const fn from_lanes(lanes: usize) -> Option<Self> {
        match lanes {
            4 => Some(Self::W4),
            8 => Some(Self::W8),
            16 => Some(Self::W16),
            _ => None,
        }
    }

    /// Default width for a level: as wide as its registers.
    pub fn auto(level: Level) -> Self {
        match level {
            Level::Avx512 => Self::W16,
            Level::Avx2 => Self::W8,
            _ => Self::W4,
        }
    }
}
