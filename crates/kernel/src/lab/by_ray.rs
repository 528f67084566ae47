//! Orders that depend on the ray: by the distance of boxes.

use antumbra_simd::{Lanes, Mask};

use crate::aabb::Aabb;
use crate::geometry::ray_setup::{RaySetup, max};
use crate::tree::node::Node;
use crate::tree::words::Sink;

/// How an occlusion query picks the next child by the ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ByRay {
    /// By the distance at which boxes are entered, nearest first.
    Distance,
    /// By the distance at which boxes are left, farthest first.
    Far,
}

impl ByRay {
    /// The lanes of a node that `ray` hit, the one to be visited first at the end, and how many they are. `mask`
    /// are these lanes, `entry` the distances at which their boxes are entered.
    #[inline(always)]
    pub fn lanes<const N: usize, L: Lanes<N>>(
        &self,
        node: &Node<N>,
        ray: &RaySetup,
        mask: L::Mask,
        entry: L,
    ) -> ([u32; N], usize) {
        let all: [u32; N] = core::array::from_fn(|lane| lane as u32);
        let mut lanes = [0; N];
        let count = match self {
            Self::Distance => {
                let mut pairs = [0; N];
                let count = entry.compress_sorted(mask, &all, &mut pairs);
                for lane in 0..N {
                    lanes[lane] = pairs[lane] as u32;
                }
                count
            }
            Self::Far => {
                let count = mask.compress(&all, &mut lanes);
                sort_by_end(ray, node, &mut lanes[..count]);
                count
            }
        };
        (lanes, count)
    }

    /// Writes the number of the rule.
    pub fn write(self, sink: &mut Sink<'_>) {
        match self {
            Self::Distance => sink.word(1),
            Self::Far => sink.word(3),
        }
    }

    /// Rule `number`, as [`ByRay::write`] wrote it.
    pub fn read(number: u32) -> Option<Self> {
        match number {
            1 => Some(Self::Distance),
            3 => Some(Self::Far),
            _ => None,
        }
    }
}

/// Distance at which a ray leaves a box, wherever it ends itself.
fn left_at(ray: &RaySetup, bounds: &Aabb) -> f32 {
    let [rdir, _, offset] = &ray.slabs;
    let far = |axis: usize| match ray.negative(axis) {
        true => bounds.min[axis],
        false => bounds.max[axis],
    };
    (0..3).fold(f32::INFINITY, |leave, axis| {
        -max(offset[axis] - far(axis) * rdir[axis], -leave)
    })
}

/// Sorts lanes so that the box that is left last comes last; of equal ones the box of the lower slot.
fn sort_by_end<const N: usize>(ray: &RaySetup, node: &Node<N>, lanes: &mut [u32]) {
    let mut ends = [0.0; N];
    for &lane in lanes.iter() {
        ends[lane as usize] = left_at(ray, &node.bounds(N - 1 - lane as usize));
    }
    // Stable, and lanes ascend: equal ones stay so.
    lanes.sort_by(|a, b| ends[*a as usize].total_cmp(&ends[*b as usize]));
}
