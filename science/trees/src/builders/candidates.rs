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

/// Items divided in two.
pub(crate) struct Split {
    pub cost: f64,
    pub is_left: Vec<bool>,
    /// What is around either side.
    pub bounds: [Aabb; 2],
}

impl Split {
    /// The items of either side.
    pub fn sides<T>(&self, items: impl IntoIterator<Item = T>) -> [Vec<T>; 2] {
        let mut sides = [Vec::new(), Vec::new()];
        for (item, is_left) in items.into_iter().zip(&self.is_left) {
            sides[usize::from(!is_left)].push(item);
        }
        sides
    }
}

/// The cheapest split of all axes, the first of equals, with what else is known of it. `costs` returns the costs of
/// [`Candidates::splits`], in their order.
pub(crate) fn cheapest<T>(
    boxes: &[Aabb],
    costs: impl Fn(&Candidates) -> Vec<(f64, T)>,
) -> Option<(Split, T)> {
    let mut best: Option<(Split, T)> = None;
    for candidates in (0..3).filter_map(|axis| Candidates::new(boxes, axis)) {
        for (split, (cost, more)) in candidates.splits().zip(costs(&candidates)) {
            if cost < best.as_ref().map_or(f64::INFINITY, |(best, _)| best.cost) {
                let is_left = |bin: &u8| usize::from(*bin) < split;
                let best_split = Split {
                    cost,
                    is_left: candidates.bins.iter().map(is_left).collect(),
                    bounds: [
                        candidates.left[split].bounds,
                        candidates.right[split].bounds,
                    ],
                };
                best = Some((best_split, more));
            }
        }
    }
    best
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
