//! Directions that go the same way, made ready for packets from any origin.

use alloc::vec::Vec;

use crate::geometry::ray_setup::{MIN_DIRECTION, NEAR, NODE_MARGIN, SANE, Side, max};
use crate::trace::packet::fans::lane_of;
use crate::trace::packet::rays::{Frustum, Likeness, MAX_TURN, RAYS};

/// Directions of a packet: of the same signs and the same largest component, and close together.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Sheaf {
    /// `[axis][lane]`. Lanes without a direction repeat another one.
    pub dir: [[f32; RAYS]; 3],
    /// Reciprocals of the largest components, see [`crate::geometry::ray_setup::Lengths`].
    pub shortest: [f32; RAYS],
    /// Place of each direction in the list that it came from.
    pub columns: [u32; RAYS],
    /// Lanes that have a direction, as bits.
    pub lanes: u32,
    pub likeness: Likeness,
    /// Reciprocals for near and for far planes, as a [`Frustum`] has them, and their magnitudes.
    rdir: [[f32; 4]; 2],
    steepness: [[f32; 4]; 2],
    near: [Side; 4],
    /// Reciprocals of each direction, `[axis][lane]`.
    pub rdirs: [[f32; RAYS]; 3],
    /// Largest magnitude of a component of the directions.
    pub largest: f32,
    /// Smallest and largest of `shortest`.
    span: [f32; 2],
}

/// A direction on its way into a sheaf.
struct Placed {
    /// Place along a curve through all directions that are alike; these come one after another.
    key: u64,
    column: u32,
    likeness: Likeness,
    dir: [f32; 3],
}

/// Sorts directions into sheaves. Those that no ray can have are in none.
pub(crate) fn sheaves(directions: &[[f32; 3]]) -> Vec<Sheaf> {
    let mut placed: Vec<Placed> = (directions.iter().zip(0..))
        .filter_map(|(dir, column)| Placed::new(*dir, column))
        .collect();
    placed.sort_unstable_by_key(|placed| (placed.key, placed.column));
    let mut sheaves = Vec::new();
    let mut rest = &placed[..];
    while !rest.is_empty() {
        let (some, others) = rest.split_at(company(rest));
        sheaves.push(Sheaf::new(some));
        rest = others;
    }
    sheaves
}

/// How many of the first of these directions make a sheaf.
fn company(placed: &[Placed]) -> usize {
    let first = &placed[0];
    let (mut least, mut most) = (first.dir.map(f32::abs), first.dir.map(f32::abs));
    for (count, next) in placed.iter().enumerate().take(RAYS) {
        for (axis, x) in next.dir.map(f32::abs).into_iter().enumerate() {
            least[axis] = least[axis].min(x);
            most[axis] = most[axis].max(x);
        }
        let turn = (0..3).fold(0.0, |turn, axis| max(turn, most[axis] - least[axis]));
        if next.likeness != first.likeness || !(turn < largest(most) * MAX_TURN) {
            return count;
        }
    }
    placed.len().min(RAYS)
}

fn largest([x, y, z]: [f32; 3]) -> f32 {
    max(max(x, y), z)
}

impl Placed {
    fn new(dir: [f32; 3], column: u32) -> Option<Self> {
        let size = dir.map(f32::abs);
        let most = largest(size);
        let is_valid = dir.iter().all(|x| x.is_finite()) && 1.0 / most < f32::INFINITY;
        if !is_valid {
            return None;
        }
        let signs = (0..3).fold(0, |signs, axis| {
            signs | usize::from(dir[axis].is_sign_negative()) << axis
        });
        // The first of equal ones.
        let (largest, others) = match size {
            [x, y, z] if x == most => (1, [y, z]),
            [x, y, z] if y == most => (2, [z, x]),
            [x, y, _] => (0, [x, y]),
        };
        let place = others.map(|x| (x / most * 65535.0) as u32);
        Some(Self {
            key: (signs as u64) << 34 | (largest as u64) << 32 | u64::from(hilbert(place)),
            column,
            likeness: Likeness { signs, largest },
            dir,
        })
    }
}

/// Place of a point of a grid of 2¹⁶ by 2¹⁶ along Hilbert's curve.
fn hilbert([mut x, mut y]: [u32; 2]) -> u32 {
    let mut place = 0;
    for bit in (0..16).rev() {
        let (right, up) = (x >> bit & 1, y >> bit & 1);
        place = place << 2 | (3 * right) ^ up;
        // Quadrants are turned so that the curve goes on where it came out.
        if up == 0 {
            if right == 1 {
                (x, y) = (!x, !y);
            }
            (x, y) = (y, x);
        }
    }
    place
}

impl Sheaf {
    fn new(placed: &[Placed]) -> Self {
        let first = &placed[0];
        let mut sheaf = Self {
            dir: [0, 1, 2].map(|axis| [first.dir[axis]; RAYS]),
            shortest: [0.0; RAYS],
            columns: [0; RAYS],
            lanes: (1 << placed.len()) - 1,
            likeness: first.likeness,
            rdir: [[0.0; 4]; 2],
            steepness: [[0.0; 4]; 2],
            near: NEAR[first.likeness.signs],
            rdirs: [[0.0; RAYS]; 3],
            largest: 0.0,
            span: [f32::INFINITY, 0.0],
        };
        for (lane, placed) in placed.iter().enumerate() {
            for axis in 0..3 {
                sheaf.dir[axis][lane] = placed.dir[axis];
            }
            sheaf.columns[lane] = placed.column;
        }
        let (mut least, mut most) = ([f32::INFINITY; 3], [0.0; 3]);
        for lane in 0..RAYS {
            let size = sheaf.dir.map(|values| values[lane].abs());
            let shortest = 1.0 / largest(size);
            sheaf.shortest[lane] = shortest;
            sheaf.span = [sheaf.span[0].min(shortest), sheaf.span[1].max(shortest)];
            for axis in 0..3 {
                let steepness = 1.0 / max(size[axis], largest(size) * MIN_DIRECTION);
                sheaf.rdirs[axis][lane] = steepness.copysign(sheaf.dir[axis][lane]);
                least[axis] = f32::min(least[axis], size[axis]);
                most[axis] = f32::max(most[axis], size[axis]);
            }
        }
        sheaf.largest = largest(most);
        for axis in 0..3 {
            let shallow = 1.0 / max(most[axis], largest(most) * MIN_DIRECTION);
            let steep = 1.0 / max(least[axis], largest(least) * MIN_DIRECTION);
            let sign = first.dir[axis];
            sheaf.steepness[0][axis] = shallow;
            sheaf.steepness[1][axis] = steep;
            sheaf.rdir[0][axis] = shallow.copysign(sign);
            sheaf.rdir[1][axis] = steep.copysign(sign);
        }
        sheaf
    }

    /// Columns of the directions.
    pub fn columns(&self) -> impl Iterator<Item = u32> {
        let lanes = (0..RAYS).filter(|lane| self.lanes >> lane & 1 == 1);
        lanes.map(|lane| self.columns[lane])
    }

    /// Frustum around the rays from an origin whose largest coordinate and the scene extent add up to `reach`. `None` if
    /// numbers are too far apart.
    #[inline(always)]
    pub fn frustum(&self, org: [f32; 3], reach: f32, [tnear, tfar]: [f32; 2]) -> Option<Frustum> {
        let [least, most] = [self.span[0] * reach, self.span[1] * reach];
        let sane = SANE.0 < reach.min(least) && max(reach, most) < SANE.1;
        let [[nx, ny, nz, _], [fx, fy, fz, _]] = self.steepness;
        let is_finite = 4.0 * reach * max(max(fx, fy), fz) < f32::MAX;
        if !(sane && is_finite) {
            return None;
        }
        let margin = reach * NODE_MARGIN;
        let [near, far] = self.rdir;
        let [x, y, z] = org;
        let near_offset = [
            x * near[0] + margin * nx,
            y * near[1] + margin * ny,
            z * near[2] + margin * nz,
            0.0,
        ];
        let far_offset = [
            x * far[0] - margin * fx,
            y * far[1] - margin * fy,
            z * far[2] - margin * fz,
            0.0,
        ];
        Some(Frustum {
            near_slabs: [near, near_offset],
            far_slabs: [far, far_offset],
            near: self.near,
            tnear,
            tfar,
        })
    }

    /// Frustum around rays from between two corners in the direction of a lane. `reach` is the largest `R`
    /// of their origins, see [`crate::geometry::ray_setup`]. `None` if numbers are too far apart.
    #[inline(always)]
    pub fn beam(
        &self,
        lane: usize,
        [low, high]: [[f32; 3]; 2],
        reach: f32,
        [tnear, tfar]: [f32; 2],
    ) -> Option<Frustum> {
        let rdir = lane_of(&self.rdirs, lane);
        let span = reach * self.shortest[lane];
        let sane = SANE.0 < reach.min(span) && max(reach, span) < SANE.1;
        let [sx, sy, sz] = [rdir[0].abs(), rdir[1].abs(), rdir[2].abs()];
        let is_finite = 4.0 * reach * max(max(sx, sy), sz) < f32::MAX;
        if !(sane && is_finite) {
            return None;
        }
        let margin = reach * NODE_MARGIN;
        let (mut near_offset, mut far_offset) = ([0.0; 4], [0.0; 4]);
        for axis in 0..3 {
            let (a, b) = (low[axis] * rdir[axis], high[axis] * rdir[axis]);
            let widening = margin * rdir[axis].abs();
            // Whichever origins come to near planes last, and to far planes first.
            near_offset[axis] = max(a, b) + widening;
            far_offset[axis] = a.min(b) - widening;
        }
        let [x, y, z] = rdir;
        let rdir = [x, y, z, 0.0];
        Some(Frustum {
            near_slabs: [rdir, near_offset],
            far_slabs: [rdir, far_offset],
            near: self.near,
            tnear,
            tfar,
        })
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use super::*;
    use antumbra_testkit::Rng;

    #[test]
    fn neighbours_on_the_curve_are_neighbours_in_the_grid() {
        let mut rng = Rng::new(5);
        let mut places: Vec<(u32, [u32; 2])> = Vec::new();
        let corner = [
            rng.below(65_000) as u32 & !15,
            rng.below(65_000) as u32 & !15,
        ];
        for x in 0..16 {
            for y in 0..16 {
                let point = [corner[0] + x, corner[1] + y];
                places.push((hilbert(point), point));
            }
        }
        places.sort_unstable();
        for pair in places.windows(2) {
            let [(a, [ax, ay]), (b, [bx, by])] = [pair[0], pair[1]];
            assert_eq!(b, a + 1, "a square of the grid is a piece of the curve");
            assert_eq!(ax.abs_diff(bx) + ay.abs_diff(by), 1);
        }
    }

    #[test]
    fn every_direction_is_in_one_sheaf() {
        let mut rng = Rng::new(9);
        for (count, spread) in [(0, 1.0), (1, 1.0), (40, 1.0), (700, 1.0), (300, 0.02)] {
            let mut directions: Vec<[f32; 3]> = (0..count)
                .map(|_| {
                    let [x, y, z] = rng.direction();
                    [1.0 + spread * (x - 1.0), spread * y, spread * z]
                        .map(|x| x * rng.range(0.9, 1.0))
                })
                .collect();
            directions.extend([
                [0.0; 3],
                [f32::NAN, 1.0, 0.0],
                [f32::INFINITY, 0.0, 0.0],
                [1e-45; 3],
            ]);
            let sheaves = sheaves(&directions);
            let mut found = vec![0; directions.len()];
            for sheaf in &sheaves {
                for lane in (0..RAYS).filter(|lane| sheaf.lanes >> lane & 1 == 1) {
                    let column = sheaf.columns[lane] as usize;
                    found[column] += 1;
                    assert_eq!(sheaf.dir.map(|values| values[lane]), directions[column]);
                }
            }
            assert!(found[..count].iter().all(|&times| times == 1));
            assert_eq!(found[count..], [0; 4]);
            if spread < 0.1 {
                assert!(sheaves.len() < 30, "{} sheaves", sheaves.len());
            }
        }
    }
}
