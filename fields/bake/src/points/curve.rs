//! Points in an order in which neighbours are near each other: along a Morton curve. Rays of neighbouring points visit the same
//! parts of the scene.

use std::ops::Range;

use antumbra::Aabb;
use rayon::prelude::*;

use crate::{Error, memory};

/// Bits of a place on one axis.
const BITS: u32 = 21;

/// Length of a short way through points of a square, relative to that along a grid.
const SHORT: f64 = 3.0;

/// Places of points along the curve: the point at place `i` is `order[i]`. Points stay as given if the way through them is already
/// about as short as a way through as many points of a square. Points that are not finite come anywhere.
///
/// # Errors
/// [`Error::NoMemory`].
pub fn along_curve(points: &[[f32; 3]]) -> Result<Vec<u32>, Error> {
    let finite = |point: &&[f32; 3]| point.iter().all(|x| x.is_finite());
    let bounds = points
        .iter()
        .filter(finite)
        .fold(Aabb::EMPTY, |bounds, point| {
            bounds.union(&Aabb::around(&[*point]))
        });
    let sides = [0, 1, 2].map(|axis| f64::from(bounds.max[axis]) - f64::from(bounds.min[axis]));
    let side = sides.into_iter().fold(f64::MIN_POSITIVE, f64::max);
    let mut order = memory::room("points", points.len())?;
    if way(points) <= SHORT * side * (points.len() as f64).sqrt() {
        order.extend(0..points.len() as u32);
        return Ok(order);
    }
    let scale = f64::from((1_u32 << BITS) - 1) / side;
    let key = |point: &[f32; 3]| {
        (0..3).fold(0, |key, axis| {
            let place = (f64::from(point[axis]) - f64::from(bounds.min[axis])) * scale;
            // NaN becomes 0.
            key | spread(place as u64) << axis
        })
    };
    let mut places = memory::room("points", points.len())?;
    places.extend(
        (0_u32..)
            .zip(points)
            .map(|(index, point)| (key(point), index)),
    );
    places.par_sort_unstable();
    order.extend(places.iter().map(|(_, index)| *index));
    Ok(order)
}

/// Length of the way through points, along the axes. Points that are not finite are left out.
fn way(points: &[[f32; 3]]) -> f64 {
    let is_finite = |point: &&[f32; 3]| point.iter().all(|x| x.is_finite());
    let mut finite = points.iter().filter(is_finite);
    let Some(mut last) = finite.next() else {
        return 0.0;
    };
    finite
        .map(|point| {
            let step = |axis: usize| (f64::from(point[axis]) - f64::from(last[axis])).abs();
            let step = step(0) + step(1) + step(2);
            last = point;
            step
        })
        .sum()
}

/// Points along a curve, with their normals.
pub struct Places {
    /// Points, `[n, 3]`.
    pub points: Vec<[f32; 3]>,
    /// Normals, as many as points, or none.
    pub normals: Vec<[f32; 3]>,
    /// Index of each point in the list that was given.
    pub order: Vec<u32>,
}

impl Places {
    /// Puts points in order. `normals` are as many, or empty.
    ///
    /// # Errors
    /// [`Error::Length`] if there is another number of normals, or [`Error::NoMemory`].
    pub fn new(points: &[[f32; 3]], normals: &[[f32; 3]]) -> Result<Self, Error> {
        if !normals.is_empty() {
            Error::check_length("normals", normals.len(), points.len())?;
        }
        let order = along_curve(points)?;
        let sorted = |vectors: &[[f32; 3]]| {
            let mut sorted = memory::room("points", vectors.len())?;
            if !vectors.is_empty() {
                sorted.extend(order.iter().map(|&index| vectors[index as usize]));
            }
            Ok::<_, Error>(sorted)
        };
        Ok(Self {
            points: sorted(points)?,
            normals: sorted(normals)?,
            order,
        })
    }

    /// Points and normals of some places.
    pub fn at(&self, items: Range<usize>) -> [&[[f32; 3]]; 2] {
        let normals = self.normals.get(items.clone()).unwrap_or_default();
        [&self.points[items], normals]
    }

    /// Moves rows of `width` values from the order of the curve to the order of the list.
    pub fn put_back<T>(&self, width: usize, values: &mut [T]) {
        let mut order = self.order.clone();
        for first in 0..order.len() {
            // Along each cycle of the permutation: whatever is here goes to its place, until the right one is here.
            while order[first] as usize != first {
                let place = order[first] as usize;
                order.swap(first, place);
                let (low, high) = (first.min(place), first.max(place));
                let (before, after) = values.split_at_mut(high * width);
                before[low * width..][..width].swap_with_slice(&mut after[..width]);
            }
        }
    }
}

/// Every bit of a place at three times its own.
fn spread(place: u64) -> u64 {
    let place = (place | place << 32) & 0x001f_0000_0000_ffff;
    let place = (place | place << 16) & 0x001f_0000_ff00_00ff;
    let place = (place | place << 8) & 0x100f_00f0_0f00_f00f;
    let place = (place | place << 4) & 0x10c3_0c30_c30c_30c3;
    (place | place << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use antumbra_testkit::Rng;

    use super::*;

    #[test]
    fn bits_go_to_three_times_their_place() {
        for bit in 0..BITS {
            assert_eq!(spread(1 << bit), 1 << (3 * bit));
        }
    }

    #[test]
    fn rows_go_back_to_where_their_points_stand() {
        let mut rng = Rng::new(3);
        for count in [0, 1, 2, 50, 777] {
            let mut points: Vec<[f32; 3]> = (0..count).map(|_| rng.point(5.0)).collect();
            if let Some(point) = points.get_mut(1) {
                *point = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
            }
            let ordered = Places::new(&points, &[]).expect("memory");
            let mut sorted = ordered.order.clone();
            sorted.sort_unstable();
            assert!(
                sorted
                    .iter()
                    .enumerate()
                    .all(|(place, &index)| place == index as usize)
            );
            let rows = ordered.order.iter().map(|&index| [index, index + 1]);
            let mut values = rows.collect::<Vec<_>>().concat();
            ordered.put_back(2, &mut values);
            for (index, row) in values.chunks(2).enumerate() {
                assert_eq!(row, [index as u32, index as u32 + 1]);
            }
        }
    }

    #[test]
    fn neighbours_along_the_curve_are_near() {
        let mut rng = Rng::new(4);
        let points: Vec<[f32; 3]> = (0..4096).map(|_| rng.point(1.0)).collect();
        let ordered = Places::new(&points, &[]).expect("memory");
        let (as_given, sorted) = (way(&points), way(&ordered.points));
        assert!(sorted < 0.15 * as_given, "{sorted} {as_given}");
        // Rows of a grid are in order already.
        let grid: Vec<[f32; 3]> = (0..4096)
            .map(|i| [(i % 64) as f32, (i / 64) as f32, 0.0])
            .collect();
        let order = along_curve(&grid).expect("memory");
        assert!(order.is_sorted());
    }
}
