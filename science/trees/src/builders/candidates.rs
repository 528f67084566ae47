//! All object splits, for builders that compare them with others or count rays for each: along each axis, between any
//! two of a few items or between bins of many.

use antumbra::Aabb;

/// Bins per axis. No more items than that are split between any two of them.
const BINS: usize = 32;

/// Splits along one axis. Split `s`, of 1 to `len - 1`, has the bins before `s` on its left.
pub(crate) struct Candidates {
    /// The bin of each item.
    pub bins: Vec<u8>,
    /// The left and the right side of each split. At 0 the left one is empty.
    pub left: Vec<Part>,
    pub right: Vec<Part>,
}

/// One side of a split.
#[derive(Clone, Copy)]
pub(crate) struct Part {
    pub bounds: Aabb,
    pub count: usize,
}

impl Part {
    const EMPTY: Self = Self {
        bounds: Aabb::EMPTY,
        count: 0,
    };

    fn union(&self, other: &Self) -> Self {
        Self {
            bounds: self.bounds.union(&other.bounds),
            count: self.count + other.count,
        }
    }
}

impl Candidates {
    /// Splits of items with these boxes; `None` if their centres coincide, or are too far apart.
    pub fn new(boxes: &[Aabb], axis: usize) -> Option<Self> {
        let (low, high) = boxes
            .iter()
            .map(|bounds| center(bounds, axis))
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            });
        let spread = high - low;
        let scale = BINS as f32 / spread;
        if !(spread > 0.0 && spread < f32::INFINITY && scale < f32::INFINITY) {
            return None;
        }
        let (bins, len) = if boxes.len() <= BINS {
            (ranks(boxes, axis), boxes.len())
        } else {
            let bin = |bounds| ((center(bounds, axis) - low) * scale) as usize;
            let bins = boxes.iter().map(|bounds| bin(bounds).min(BINS - 1) as u8);
            (bins.collect(), BINS)
        };
        let mut contents = vec![Part::EMPTY; len];
        for (bin, bounds) in bins.iter().zip(boxes) {
            let bin = &mut contents[usize::from(*bin)];
            *bin = bin.union(&Part {
                bounds: *bounds,
                count: 1,
            });
        }
        let mut left = vec![Part::EMPTY; len];
        for split in 1..len {
            left[split] = left[split - 1].union(&contents[split - 1]);
        }
        let mut right = contents;
        for split in (0..len - 1).rev() {
            right[split] = right[split].union(&right[split + 1]);
        }
        Some(Self { bins, left, right })
    }

    /// How many bins there are.
    pub fn len(&self) -> usize {
        self.left.len()
    }

    /// Splits that leave something on either side.
    pub fn splits(&self) -> impl Iterator<Item = usize> {
        (1..self.len()).filter(|&split| self.left[split].count > 0 && self.right[split].count > 0)
    }
}

/// The centre on an axis, by halves that cannot overflow when added.
pub(crate) fn center(bounds: &Aabb, axis: usize) -> f32 {
    0.5 * bounds.min[axis] + 0.5 * bounds.max[axis]
}

/// The place of each item when they are sorted by their centres; equal ones keep their order.
fn ranks(boxes: &[Aabb], axis: usize) -> Vec<u8> {
    let mut order: Vec<usize> = (0..boxes.len()).collect();
    order.sort_by(|&a, &b| center(&boxes[a], axis).total_cmp(&center(&boxes[b], axis)));
    let mut ranks = vec![0; boxes.len()];
    for (rank, place) in order.into_iter().enumerate() {
        ranks[place] = rank as u8;
    }
    ranks
}
