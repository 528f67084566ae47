//! Ambient occlusion: the open part of the sky above points.

use antumbra::{Bvh, Ray};
use rayon::prelude::*;

use crate::Progress;
use crate::memory;
use crate::points::curve::Places;
use crate::sight::directions::{Samples, key};
use crate::vector::{above, unit};
use crate::{Error, Monitor, Weighting};

/// Rays that a thread hands to the tree together.
const RAYS: usize = 1 << 14;

/// Most points that a thread takes at a time, however few rays they have.
const MOST_POINTS: usize = 1 << 12;

/// Rays, distance and weights of [`ambient_occlusion`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmbientOcclusion {
    /// Rays per point and side, at least 1. Powers of two are spread most evenly.
    pub samples: u32,
    /// Distance up to which surfaces occlude, in units of the scene; infinite for all surfaces.
    pub distance: f32,
    /// Whether to look to both sides of a point, and keep the more open one: for meshes whose normals point anywhere.
    pub two_sided: bool,
    /// How much each part of the sky counts.
    pub weighting: Weighting,
    /// Seed of all directions.
    pub seed: u64,
}

impl Default for AmbientOcclusion {
    /// 256 rays by the cosine, to one side and of any length, with seed 0.
    fn default() -> Self {
        Self {
            samples: 256,
            distance: f32::INFINITY,
            two_sided: false,
            weighting: Weighting::default(),
            seed: 0,
        }
    }
}

/// Open part of the sky above each point, from 0 (closed in) to 1 (nothing in the way).
///
/// Openness, and not its complement, because that is what tools call "ambient occlusion" when they draw it: a factor of the
/// light, white where a surface is open.
///
/// Points and normals are `[n, 3]`; normals have any length. A point or normal that is not finite, and a normal of
/// length 0, have the value NaN. Without any surface all others have 1. Surfaces count on both sides.
///
/// Rays begin an [origin offset](Bvh::origin_offset) above the point, towards its normal, and `distance` counts from there.
/// The offset is computed from the box that encloses the scene and this point.
///
/// A value depends only on its point, its normal and the choices. Its bits are the same for any number of threads, any recipe
/// of the tree, and any place of the point in a list or a part of one. With `n` rays, the standard error is at most
/// `0.5 / sqrt(n)`, and mostly far lower, because directions are spread evenly.
///
/// Work is shared among the threads of the current rayon pool.
///
/// # Errors
/// [`Error`] if the lists differ in length, if a choice makes no sense, or if `monitor` cancels.
pub fn ambient_occlusion(
    bvh: &Bvh,
    points: &[[f32; 3]],
    normals: &[[f32; 3]],
    options: &AmbientOcclusion,
    monitor: &dyn Monitor,
) -> Result<Vec<f32>, Error> {
    let part = |side: &Side, _| side.part(options.samples);
    let (places, wanted) = ((bvh, points, normals), (options, Wanted::Parts));
    bake(places, wanted, monitor, f32::NAN, part)
}

/// The open part of the sky above a point, and where it lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BentNormal {
    /// Open part, as of [`ambient_occlusion`], with the same bits.
    pub open: f32,
    /// Mean direction of the open part, of length 1: from where most light comes. The normal itself, scaled to length 1,
    /// where all is closed, or where open directions cancel. NaN where `open` is.
    pub direction: [f32; 3],
}

/// As [`ambient_occlusion`], with the mean direction of the open part.
///
/// Directions count by the [`Weighting`]. Of two sides, the more open one has the direction.
///
/// # Errors
/// As [`ambient_occlusion`].
pub fn bent_normals(
    bvh: &Bvh,
    points: &[[f32; 3]],
    normals: &[[f32; 3]],
    options: &AmbientOcclusion,
    monitor: &dyn Monitor,
) -> Result<Vec<BentNormal>, Error> {
    let none = BentNormal {
        open: f32::NAN,
        direction: [f32::NAN; 3],
    };
    let bent = |side: &Side, normal| BentNormal {
        open: side.part(options.samples),
        direction: unit(side.sum).unwrap_or(normal).map(|x| x as f32),
    };
    let (places, wanted) = ((bvh, points, normals), (options, Wanted::Directions));
    bake(places, wanted, monitor, none, bent)
}

/// Some of the rays that [`ambient_occlusion`] traces: `count` of them at most, from points spread over the list, and from each
/// of these its first `per_point`. For trees that learn from their own rays.
///
/// Points without a value have none, and so have lists or choices that [`ambient_occlusion`] refuses.
pub fn ambient_rays(
    bvh: &Bvh,
    (points, normals): (&[[f32; 3]], &[[f32; 3]]),
    options: &AmbientOcclusion,
    count: usize,
    per_point: usize,
) -> Vec<Ray> {
    let per_point = per_point.clamp(1, options.samples.max(1) as usize);
    let some = count.div_ceil(per_point).min(points.len());
    let mut rays = Vec::new();
    if check(points, normals, options).is_err() {
        return rays;
    }
    let samples = Samples::new(per_point as u32, options.weighting);
    for index in 0..some {
        // The product may be beyond a word.
        let place = (index as u128 * points.len() as u128 / some as u128) as usize;
        let (point, normal) = (&points[place], &normals[place]);
        if let Some(unit) = unit_normal(point, normal) {
            let org = above(bvh, point, unit);
            let directions = samples.around(unit, key(options.seed, point, normal));
            let ray = |sample| Ray::new(org, directions.get(sample)).far(options.distance);
            rays.extend((0..per_point as u32).map(ray));
        }
    }
    rays.truncate(count);
    rays
}

/// Rays of one side of a point that nothing stopped.
#[derive(Clone, Copy, Default)]
struct Side {
    open: u32,
    /// Sum of their directions, where directions are wanted.
    sum: [f64; 3],
}

impl Side {
    /// Part of all rays that nothing stopped.
    fn part(&self, samples: u32) -> f32 {
        (f64::from(self.open) / f64::from(samples)) as f32
    }
}

/// Result that is wanted from the open rays of a side.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Wanted {
    Parts,
    Directions,
}

/// One value per point: `none`, or what `finish` makes of the more open side and its normal.
fn bake<T: Copy + Send + Sync>(
    (bvh, points, normals): (&Bvh, &[[f32; 3]], &[[f32; 3]]),
    (options, wanted): (&AmbientOcclusion, Wanted),
    monitor: &dyn Monitor,
    none: T,
    finish: impl Fn(&Side, [f64; 3]) -> T + Sync,
) -> Result<Vec<T>, Error> {
    check(points, normals, options)?;
    let sides = if options.two_sided { 2 } else { 1 };
    let per_point = (options.samples as usize).saturating_mul(sides);
    let block = (RAYS / per_point).clamp(1, MOST_POINTS);
    let mut values = memory::filled("values", points.len(), none)?;
    let samples = Samples::new(options.samples, options.weighting);
    let places = Places::new(points, normals)?;
    let Places {
        points, normals, ..
    } = &places;
    let progress = Progress::new(monitor, points.len());
    let blocks = values.par_chunks_mut(block).enumerate();
    blocks.try_for_each_init(
        || Worker::new(bvh, (options, &samples, wanted), monitor),
        |worker, (index, values)| {
            let first = index * block;
            let range = first..first + values.len();
            worker.bake(&points[range.clone()], &normals[range], values, &finish)?;
            progress.add(values.len());
            Ok::<_, Error>(())
        },
    )?;
    places.put_back(1, &mut values);
    Ok(values)
}

/// Whether lists and choices make sense.
pub(crate) fn check(
    points: &[[f32; 3]],
    normals: &[[f32; 3]],
    options: &AmbientOcclusion,
) -> Result<(), Error> {
    Error::check_length("normals", normals.len(), points.len())?;
    if options.samples == 0 {
        return Err(Error::NoSamples);
    }
    if !(options.distance > 0.0) {
        return Err(Error::Distance(options.distance));
    }
    Ok(())
}

/// Rays of some points, with the memory that they take.
struct Worker<'a> {
    bvh: &'a Bvh,
    options: &'a AmbientOcclusion,
    samples: &'a Samples,
    wanted: Wanted,
    monitor: &'a dyn Monitor,
    rays: Vec<Ray>,
    /// Places in `found` of the sides whose rays wait, each with the number of rays up to its last.
    sides: Vec<(usize, usize)>,
    occluded: Vec<bool>,
    /// Two sides of each point.
    found: Vec<Side>,
}

impl<'a> Worker<'a> {
    fn new(
        bvh: &'a Bvh,
        (options, samples, wanted): (&'a AmbientOcclusion, &'a Samples, Wanted),
        monitor: &'a dyn Monitor,
    ) -> Self {
        Self {
            bvh,
            options,
            samples,
            wanted,
            monitor,
            rays: Vec::new(),
            sides: Vec::new(),
            occluded: Vec::new(),
            found: Vec::new(),
        }
    }

    /// Values of some points; those that have none are left as they are.
    fn bake<T>(
        &mut self,
        points: &[[f32; 3]],
        normals: &[[f32; 3]],
        values: &mut [T],
        finish: &impl Fn(&Side, [f64; 3]) -> T,
    ) -> Result<(), Error> {
        self.found.clear();
        self.found.resize(2 * points.len(), Side::default());
        let sides = if self.options.two_sided { 2 } else { 1 };
        for (index, (point, normal)) in points.iter().zip(normals).enumerate() {
            let Some(unit) = unit_normal(point, normal) else {
                continue;
            };
            let key = key(self.options.seed, point, normal);
            for (side, sign) in [1.0, -1.0].iter().enumerate().take(sides) {
                let place = 2 * index + side;
                self.look(place, point, unit.map(|x| sign * x), key)?;
            }
        }
        self.flush()?;
        for (index, value) in values.iter_mut().enumerate() {
            let Some(normal) = unit_normal(&points[index], &normals[index]) else {
                continue;
            };
            let [front, back] = [2 * index, 2 * index + 1].map(|place| self.found[place]);
            *value = if back.open > front.open {
                finish(&back, normal.map(|x| -x))
            } else {
                finish(&front, normal)
            };
        }
        Ok(())
    }

    /// Sends the rays of one side of a point.
    fn look(
        &mut self,
        place: usize,
        point: &[f32; 3],
        normal: [f64; 3],
        key: u64,
    ) -> Result<(), Error> {
        let org = above(self.bvh, point, normal);
        let directions = self.samples.around(normal, key);
        let tfar = self.options.distance;
        let mut sent = 0;
        while sent < self.options.samples {
            let room = (RAYS - self.rays.len()).min((self.options.samples - sent) as usize) as u32;
            self.rays.extend((sent..sent + room).map(|sample| Ray {
                tfar,
                ..Ray::new(org, directions.get(sample))
            }));
            self.sides.push((place, self.rays.len()));
            sent += room;
            if self.rays.len() == RAYS {
                self.flush()?;
            }
        }
        Ok(())
    }

    /// Traces the rays that wait.
    fn flush(&mut self) -> Result<(), Error> {
        if self.monitor.cancelled() {
            return Err(Error::Cancelled);
        }
        self.occluded.clear();
        self.occluded.resize(self.rays.len(), false);
        let batch = self.bvh.batch(&self.rays[..]).on_this_thread();
        batch.occluded_into(&mut self.occluded);
        let mut first = 0;
        for &(place, end) in &self.sides {
            let found = &mut self.found[place];
            let occluded = &self.occluded[first..end];
            found.open += occluded
                .iter()
                .map(|&occluded| u32::from(!occluded))
                .sum::<u32>();
            if self.wanted == Wanted::Directions {
                let rays = self.rays[first..end].iter().zip(occluded);
                for (Ray { dir, .. }, _) in rays.filter(|(_, occluded)| !**occluded) {
                    found.sum = [0, 1, 2].map(|axis| found.sum[axis] + f64::from(dir[axis]));
                }
            }
            first = end;
        }
        self.rays.clear();
        self.sides.clear();
        Ok(())
    }
}

/// The normal of length 1, if point and normal have a value.
fn unit_normal(point: &[f32; 3], normal: &[f32; 3]) -> Option<[f64; 3]> {
    let finite = point.iter().all(|x| x.is_finite());
    finite.then(|| unit(normal.map(f64::from))).flatten()
}

#[cfg(test)]
mod tests {
    use antumbra::{Brute, Geometry, Primitives, Recipe, Width};
    use antumbra_testkit::{Rng, mesh};

    use super::*;
    use crate::vertex_normals;

    /// The definition, ray by ray, without blocks, threads or a tree.
    fn by_brute_force(
        brute: &Brute,
        point: &[f32; 3],
        normal: &[f32; 3],
        options: &AmbientOcclusion,
    ) -> f32 {
        let Some(unit) = unit_normal(point, normal) else {
            return f32::NAN;
        };
        let offset = f64::from(brute.origin_offset(*point));
        let is_open = |sign: f64, sample: u32| {
            let up = unit.map(|x| sign * x);
            let samples = Samples::new(options.samples / 2, options.weighting);
            let directions = samples.around(up, key(options.seed, point, normal));
            let org = [0, 1, 2].map(|axis| (f64::from(point[axis]) + offset * up[axis]) as f32);
            !brute.occluded(&Ray::new(org, directions.get(sample)).far(options.distance))
        };
        let open = |sign| (0..options.samples).filter(|&i| is_open(sign, i)).count();
        let most = match options.two_sided {
            false => open(1.0),
            true => open(1.0).max(open(-1.0)),
        };
        (most as f64 / f64::from(options.samples)) as f32
    }

    #[test]
    fn values_are_those_of_brute_force_on_every_width() {
        let mut rng = Rng::new(21);
        let choices = [
            (1, f32::INFINITY, false, Weighting::Cosine),
            (37, 0.5, true, Weighting::Uniform),
            (64, f32::INFINITY, true, Weighting::Cosine),
        ];
        for generate in mesh::ALL {
            let mesh = generate(&mut rng, 60);
            let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
            let primitives = Primitives::new(&geometry).expect("primitives");
            let brute = Brute::new(&primitives);
            let mut normals = vertex_normals(&mesh.positions, &mesh.indices);
            for normal in normals.iter_mut().step_by(3) {
                *normal = rng.direction();
            }
            for (choice, width) in choices.iter().zip(Width::ALL) {
                let bvh = Bvh::build(
                    &primitives,
                    &Recipe::default().engine(antumbra::recipe::Engine::best(width)),
                )
                .expect("a tree");
                let &(samples, distance, two_sided, weighting) = choice;
                let options = AmbientOcclusion {
                    samples,
                    distance,
                    two_sided,
                    weighting,
                    seed: rng.bits(),
                };
                let values = ambient_occlusion(&bvh, &mesh.positions, &normals, &options, &());
                let values = values.expect("values");
                for (index, value) in values.iter().enumerate().take(120) {
                    let expected =
                        by_brute_force(&brute, &mesh.positions[index], &normals[index], &options);
                    assert_eq!(value.to_bits(), expected.to_bits(), "{} {index}", mesh.name);
                }
            }
        }
    }

    #[test]
    fn some_rays_are_those_that_are_traced() {
        let mesh = mesh::bumpy_grid(&mut Rng::new(2), 200);
        let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
        let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
        let normals = vertex_normals(&mesh.positions, &mesh.indices);
        let options = AmbientOcclusion {
            samples: 8,
            distance: 0.7,
            ..Default::default()
        };
        let rays = |count, per_point| {
            ambient_rays(
                &bvh,
                (&mesh.positions, &normals),
                &options,
                count,
                per_point,
            )
        };
        // All rays of all points: their share of open ones is the mean of all values.
        let all = rays(usize::MAX >> 1, usize::MAX);
        assert_eq!(all.len(), 8 * mesh.positions.len());
        let open = all.iter().filter(|ray| !bvh.occluded(ray)).count();
        let values = ambient_occlusion(&bvh, &mesh.positions, &normals, &options, &());
        let sum: f32 = values.expect("values").iter().sum();
        assert_eq!(8.0 * sum, open as f32);
        assert_eq!(rays(10, 3).len(), 10);
        assert!(all.contains(&rays(10, 3)[9]));
    }

    #[test]
    fn rays_of_one_point_may_be_more_than_a_batch() {
        let bvh = Bvh::build(&[], &Recipe::default()).expect("a tree");
        let options = AmbientOcclusion {
            samples: 3 * RAYS as u32 + 5,
            ..Default::default()
        };
        let values = ambient_occlusion(&bvh, &[[0.0; 3]], &[[0.0, 2.0, 0.0]], &options, &());
        assert_eq!(values, Ok(vec![1.0]));
    }
}
