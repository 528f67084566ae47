//! View factors between surfaces.

use std::ops::Range;

use antumbra::{Bvh, Ray};
use rayon::prelude::*;

use crate::vector::{cross, minus, moved, unit};
use crate::{Answers, Error, Job, Key, Monitor, Size, memory, run};

/// Rays that a thread traces together.
const RAYS: usize = 1 << 12;

/// View factors between surfaces: row `i`, column `j` is the part of the light that leaves surface `i` evenly and arrives at surface
/// `j`; the last column is the part that arrives nowhere. `[surfaces, surfaces + 1]`, row by row.
///
/// A surface is a list of triangles, as corners, and emits on the side from which its corners run anticlockwise. The geometry of the
/// tree must be these triangles in this order, surface after surface, as one geometry. Both sides receive.
///
/// ```text
/// F_ij = 1 / A_i ∫_Ai ∫_Aj cos θ_i cos θ_j V / (π r²) dA_j dA_i
/// ```
///
/// (Howell, Menguc and Siegel, Thermal Radiation Heat Transfer, equation 4.14.) The integral is that over points of the surface and
/// over directions by their cosine, `samples` of each together, at points of the R sequence of Roberts in four dimensions (2018). So
/// every row adds up to 1 but for rounding, and errors are about `1 / samples` to `1 / sqrt(samples)`. The result has the same bits
/// for any number of threads.
///
/// # Errors
/// [`Error::NoSamples`]; [`Error::Cancelled`] if `monitor` cancels, which counts surfaces.
pub fn view_factors(
    bvh: &Bvh,
    surfaces: &[Vec<[[f32; 3]; 3]>],
    samples: u32,
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, Error> {
    run(&ViewFactorJob::new(surfaces, samples)?, bvh, monitor)
}

/// Job of [`view_factors`]: an item is a surface, and has a row.
pub struct ViewFactorJob<'a> {
    surfaces: &'a [Vec<[[f32; 3]; 3]>],
    samples: u32,
    /// Surface of each triangle.
    of_prim: Vec<u32>,
}

/// Count in the rows of surfaces without area.
const NOTHING: u64 = u64::MAX;

impl<'a> ViewFactorJob<'a> {
    /// The job of these surfaces, with so many rays from each.
    ///
    /// # Errors
    /// [`Error::NoSamples`], [`Error::NoMemory`].
    pub fn new(surfaces: &'a [Vec<[[f32; 3]; 3]>], samples: u32) -> Result<Self, Error> {
        if samples == 0 {
            return Err(Error::NoSamples);
        }
        let triangles = surfaces.iter().map(Vec::len).sum();
        let mut of_prim = memory::room("triangles", triangles)?;
        for (index, triangles) in (0..).zip(surfaces) {
            of_prim.extend(std::iter::repeat_n(index, triangles.len()));
        }
        Ok(Self {
            surfaces,
            samples,
            of_prim,
        })
    }

    /// Numbers of a row.
    fn width(&self) -> usize {
        self.surfaces.len() + 1
    }

    /// Rays of a surface that arrive at each other one, and those that arrive nowhere.
    fn counts(&self, bvh: &Bvh, surface: usize) -> Vec<u64> {
        let (width, samples) = (self.width(), self.samples as usize);
        let Some(emitter) = Emitter::new(bvh, &self.surfaces[surface]) else {
            return vec![NOTHING; width];
        };
        let firsts: Vec<usize> = (0..samples).step_by(RAYS).collect();
        let counts = firsts.par_iter().map(|&first| {
            let last = (first + RAYS).min(samples);
            let rays: Vec<Ray> = (first..last).map(|index| emitter.ray(index)).collect();
            let hits = bvh.batch(&rays).intersect();
            let mut counts = vec![0_u64; width];
            for hit in hits {
                let surface = hit.and_then(|hit| self.of_prim.get(hit.prim_id as usize));
                counts[surface.map_or(width - 1, |&surface| surface as usize)] += 1;
            }
            counts
        });
        counts.reduce(
            || vec![0; width],
            |a, b| a.iter().zip(&b).map(|(a, b)| a + b).collect(),
        )
    }
}

impl Job for ViewFactorJob<'_> {
    type Found = Vec<f64>;
    type Number = u64;

    const NAME: &'static str = "view-factors/1";

    fn size(&self) -> Size {
        Size::each(self.surfaces.len(), self.samples.into(), self.width())
    }

    fn identify(&self, key: &mut Key) {
        key.text(&format!("{}", self.samples));
        for triangles in self.surfaces {
            key.vectors(triangles.as_flattened());
        }
    }

    fn answers(&self, bvh: &Bvh, items: Range<usize>, monitor: &dyn Monitor) -> Answers<Self> {
        let total = items.len();
        let mut words = memory::room("view factors", total * self.width())?;
        for (done, surface) in items.enumerate() {
            if monitor.cancelled() {
                return Err(Error::Cancelled);
            }
            words.extend(self.counts(bvh, surface));
            monitor.progress(done + 1, total);
        }
        Ok(words)
    }

    fn found(&self, counts: Vec<u64>) -> Result<Vec<f64>, Error> {
        let factor = |count: u64| match count {
            NOTHING => f64::NAN,
            _ => count as f64 / f64::from(self.samples),
        };
        Ok(counts.into_iter().map(factor).collect())
    }
}

/// A surface that emits.
struct Emitter<'a> {
    triangles: &'a [[[f32; 3]; 3]],
    /// Normals of length 1, and origin offsets, each the largest of the corners.
    normals: Vec<Option<[f64; 3]>>,
    offsets: Vec<f32>,
    /// Sums of areas up to and including each triangle, over the total area: ascending to 1.
    ends: Vec<f64>,
}

impl<'a> Emitter<'a> {
    /// `None` if the surface has no area.
    fn new(bvh: &Bvh, triangles: &'a [[[f32; 3]; 3]]) -> Option<Self> {
        let mut sum = 0.0;
        let (mut ends, mut normals, mut offsets) = (Vec::new(), Vec::new(), Vec::new());
        for corners in triangles {
            let [a, b, c] = corners.map(|corner| corner.map(f64::from));
            let twice = cross(minus(b, a), minus(c, a));
            let area = twice.iter().map(|x| x * x).sum::<f64>().sqrt();
            sum += if area.is_finite() { area } else { 0.0 };
            ends.push(sum);
            normals.push(unit(twice));
            let most = corners.map(|corner| bvh.origin_offset(corner));
            offsets.push(most.into_iter().fold(0.0, f32::max));
        }
        ends.iter_mut().for_each(|end| *end /= sum);
        (sum > 0.0).then_some(Self {
            triangles,
            normals,
            offsets,
            ends,
        })
    }

    /// A ray from a point of the surface in a direction, by their number.
    fn ray(&self, index: usize) -> Ray {
        let [place, u, v, w] = sequence(index);
        let triangle = self.ends.partition_point(|&end| end <= place);
        let triangle = triangle.min(self.ends.len() - 1);
        // What is left of the number that chose the triangle is even again.
        let begin = match triangle {
            0 => 0.0,
            _ => self.ends[triangle - 1],
        };
        let s = ((place - begin) / (self.ends[triangle] - begin)).clamp(0.0, 1.0);
        let root = s.sqrt();
        let weights = [1.0 - root, root * (1.0 - u), root * u];
        let corners = self.triangles[triangle];
        let point: [f64; 3] = std::array::from_fn(|axis| {
            (0..3)
                .map(|corner| weights[corner] * f64::from(corners[corner][axis]))
                .sum()
        });
        let Some(normal) = self.normals[triangle] else {
            return Ray::new([f32::NAN; 3], [0.0; 3]);
        };
        let least = (0..3).min_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs()));
        let mut other = [0.0; 3];
        other[least.unwrap_or_default()] = 1.0;
        let right = unit(cross(other, normal)).unwrap_or(other);
        let up = cross(normal, right);
        let radius = v.sqrt();
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * w);
        let height = (1.0 - v).sqrt();
        let direction: [f64; 3] = std::array::from_fn(|axis| {
            radius * (cos * right[axis] + sin * up[axis]) + height * normal[axis]
        });
        let start = moved(&point.map(|x| x as f32), self.offsets[triangle], normal);
        Ray::new(start, direction.map(|x| x as f32))
    }
}

/// Point of the R sequence in four dimensions: multiples of the powers of the root of `x⁵ = x + 1`.
fn sequence(index: usize) -> [f64; 4] {
    const ROOT: f64 = 1.167_303_978_261_418_7;
    let mut step = 1.0;
    std::array::from_fn(|_| {
        step /= ROOT;
        (0.5 + step * (index as f64 + 1.0)).fract()
    })
}

#[cfg(test)]
mod tests {
    use antumbra::{Geometry, Recipe};

    use super::*;

    type Surface = Vec<[[f32; 3]; 3]>;

    fn quad([a, b, c, d]: [[f32; 3]; 4]) -> Surface {
        vec![[a, b, c], [a, c, d]]
    }

    fn factors(surfaces: &[Surface], samples: u32) -> Vec<f64> {
        let corners: Vec<[f32; 3]> = surfaces.iter().flatten().flatten().copied().collect();
        let indices: Vec<[u32; 3]> = (0..corners.len() as u32 / 3)
            .map(|triangle| [3 * triangle, 3 * triangle + 1, 3 * triangle + 2])
            .collect();
        let geometry = [Geometry::triangles(&corners[..], &indices[..])];
        let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
        view_factors(&bvh, surfaces, samples, &()).expect("factors")
    }

    /// Sides of a box of `size`, which face inwards: bottom, top, and four walls.
    fn inside([x, y, z]: [f32; 3]) -> Vec<Surface> {
        vec![
            quad([[0.0, 0.0, 0.0], [x, 0.0, 0.0], [x, y, 0.0], [0.0, y, 0.0]]),
            quad([[0.0, 0.0, z], [0.0, y, z], [x, y, z], [x, 0.0, z]]),
            quad([[0.0, 0.0, 0.0], [0.0, y, 0.0], [0.0, y, z], [0.0, 0.0, z]]),
            quad([[x, 0.0, 0.0], [x, 0.0, z], [x, y, z], [x, y, 0.0]]),
            quad([[0.0, 0.0, 0.0], [0.0, 0.0, z], [x, 0.0, z], [x, 0.0, 0.0]]),
            quad([[0.0, y, 0.0], [x, y, 0.0], [x, y, z], [0.0, y, z]]),
        ]
    }

    /// Two equal parallel rectangles of `a` by `b` in the distance `c` (Howell's catalogue, C-11).
    fn parallel(a: f64, b: f64, c: f64) -> f64 {
        let (x, y) = (a / c, b / c);
        let (p, q) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
        let sum = (p * q / (1.0 + x * x + y * y).sqrt()).ln()
            + x * q * (x / q).atan()
            + y * p * (y / p).atan()
            - x * x.atan()
            - y * y.atan();
        2.0 / (std::f64::consts::PI * x * y) * sum
    }

    /// From a rectangle of depth `w` to one of height `h` at right angles, with the common edge `l` (Howell's catalogue, C-14).
    fn perpendicular(w: f64, h: f64, l: f64) -> f64 {
        let (w, h) = (w / l, h / l);
        let (w2, h2) = (w * w, h * h);
        let s = w2 + h2;
        let logs = ((1.0 + w2) * (1.0 + h2) / (1.0 + s)).ln()
            + w2 * (w2 * (1.0 + s) / ((1.0 + w2) * s)).ln()
            + h2 * (h2 * (1.0 + s) / ((1.0 + h2) * s)).ln();
        let angles =
            w * (1.0 / w).atan() + h * (1.0 / h).atan() - s.sqrt() * (1.0 / s.sqrt()).atan();
        (angles + 0.25 * logs) / (std::f64::consts::PI * w)
    }

    #[test]
    fn rectangles_agree_with_closed_forms_and_rows_add_up() {
        let (x, y, z) = (2.0, 3.0, 1.0);
        let found = factors(&inside([x as f32, y as f32, z as f32]), 1 << 18);
        let at = |from: usize, to: usize| found[7 * from + to];
        for (from, to, wanted) in [
            (0, 1, parallel(x, y, z)),
            (2, 3, parallel(y, z, x)),
            (4, 5, parallel(x, z, y)),
            (0, 2, perpendicular(x, z, y)),
            (2, 0, perpendicular(z, x, y)),
            (4, 2, perpendicular(x, y, z)),
        ] {
            let error = (at(from, to) - wanted).abs();
            assert!(
                error < 1e-3,
                "{from} to {to}: {} for {wanted}",
                at(from, to)
            );
        }
        for row in found.chunks(7) {
            assert!(
                (row.iter().sum::<f64>() - 1.0).abs() < 1e-12,
                "the sum rule"
            );
            assert!(row[6] < 1e-5, "rays leave a closed box: {row:?}");
        }
    }

    #[test]
    fn surfaces_without_area_have_no_factors() {
        let flat = vec![[[0.0; 3]; 3]];
        let floor = inside([1.0; 3]).swap_remove(0);
        let found = factors(&[floor, flat], 64);
        assert_eq!(found[..3], [0.0, 0.0, 1.0]);
        assert!(found[3..].iter().all(|x| x.is_nan()));
        let bvh = Bvh::build(&[], &Recipe::default()).expect("a tree");
        assert_eq!(view_factors(&bvh, &[], 0, &()), Err(Error::NoSamples));
    }
}
