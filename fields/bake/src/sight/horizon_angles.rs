//! Horizon angles: how high surfaces reach in each direction of the compass.

use std::ops::Range;

use antumbra::{Bvh, Ray};
use antumbra_terrain::angles::check_azimuths;
use rayon::prelude::*;

use crate::points::curve::Places;
use crate::vector::{above, dot, unit};
use crate::{Answers, Error, Job, Key, Monitor, Orientation, Size, memory, sees_directions};

/// Degrees between the rays that look for the highest surface.
const SCAN: f64 = 0.5;

/// Rays of an azimuth that look for it: from just below the zenith, which is on the plane of every facade, to just above the nadir.
const LEVELS: usize = (180.0 / SCAN) as usize - 1;

/// Halvings of the step in which the horizon is, to less than 0.001 degrees.
const HALVINGS: usize = 9;

/// Elevation from which on all up to the zenith is closed.
const ZENITH: f64 = 89.998;

/// Elevation of a ray that looks for the horizon.
fn elevation(level: usize) -> f64 {
    90.0 - SCAN * (level + 1) as f64
}

/// Job of horizon angles at sensors of a mesh, by rays: in each azimuth, the elevation from which on up to the zenith all of the
/// sky is seen.
///
/// The result has an angle in degrees for each sensor and azimuth, `[sensors, azimuths]`: 90 below a surface, 0 on an open plain, and
/// -90 where nothing is in the way. [`sees_directions`] says what points with normals see, so what is behind the plane of
/// a normal counts as a surface. A sensor without a normal of some length has the angle NaN.
///
/// Rays are half a degree apart in elevation, so surfaces that are lower than that may be missed where they float above others.
/// The angle itself is the highest that is known to be closed, and less than 0.001 degrees below the true one.
pub struct HorizonJob {
    places: Places,
    orientation: Orientation,
    azimuths: Vec<f64>,
    /// Rays of the first search: of each azimuth, from the zenith down.
    scan: Vec<[f32; 3]>,
}

impl HorizonJob {
    /// The job of these sensors. `normals` are of surfaces, or empty for points in free space. Azimuths are in degrees from
    /// north through east.
    ///
    /// # Errors
    /// [`Error::Length`] if the lists differ in length, [`Error::Range`] if an azimuth is not finite, or [`Error::NoMemory`].
    pub fn new(
        points: &[[f32; 3]],
        normals: &[[f32; 3]],
        azimuths: &[f64],
        orientation: &Orientation,
    ) -> Result<Self, Error> {
        check_azimuths(azimuths)?;
        let places = Places::new(points, normals)?;
        let mut scan = memory::room("directions", azimuths.len() * LEVELS)?;
        for &azimuth in azimuths {
            let directions = (0..LEVELS)
                .map(elevation)
                .map(|elevation| orientation.direction(azimuth, elevation));
            scan.extend(directions.map(|direction| direction.map(|x| x as f32)));
        }
        Ok(Self {
            places,
            orientation: *orientation,
            azimuths: azimuths.to_vec(),
            scan,
        })
    }

    /// A ray of a sensor, in no direction yet, and its normal.
    fn start(&self, bvh: &Bvh, item: usize) -> (Ray, Option<[f64; 3]>) {
        let point = self.places.points[item];
        let normal = self.places.normals.get(item);
        let normal = normal.map(|normal| unit(normal.map(f64::from)).unwrap_or_default());
        let (org, tnear) = match normal {
            None => (point, bvh.origin_offset(point)),
            Some(normal) => (above(bvh, &point, normal), 0.0),
        };
        let ray = Ray::new(org, [0.0; 3]);
        (Ray { tnear, ..ray }, normal)
    }

    /// Whether a sensor has a place and faces somewhere.
    fn has_value(&self, item: usize) -> bool {
        let normal = self.places.normals.get(item);
        self.places.points[item].iter().all(|x| x.is_finite())
            && normal.is_none_or(|normal| unit(normal.map(f64::from)).is_some())
    }

    /// Moves the ends of each pair, a closed and an open elevation, to each other.
    fn halve(&self, bvh: &Bvh, first: usize, ends: &mut [[f64; 2]]) {
        let items = first..first + ends.len() / self.azimuths.len();
        let starts: Vec<_> = items.map(|item| self.start(bvh, item)).collect();
        let mut open: Vec<(usize, Ray)> = Vec::with_capacity(ends.len());
        let (mut rays, mut hits) = (Vec::new(), Vec::new());
        for _ in 0..HALVINGS {
            open.clear();
            for (index, [closed, open_end]) in ends.iter_mut().enumerate() {
                if closed == open_end || closed.is_nan() {
                    continue;
                }
                let middle = 0.5 * (*closed + *open_end);
                let azimuth = self.azimuths[index % self.azimuths.len()];
                let direction = self.orientation.direction(azimuth, middle);
                let dir = direction.map(|x| x as f32);
                let (start, normal) = starts[index / self.azimuths.len()];
                // The plane of its normal may be in the way.
                match normal.is_none_or(|normal| dot(normal, dir.map(f64::from)) > 0.0) {
                    true => open.push((index, Ray { dir, ..start })),
                    false => *closed = middle,
                }
            }
            rays.clear();
            rays.extend(open.iter().map(|(_, ray)| *ray));
            hits.clear();
            hits.resize(rays.len(), false);
            bvh.batch(&rays).occluded_into(&mut hits);
            for (&(index, _), &is_hit) in open.iter().zip(&hits) {
                let [closed, open_end] = &mut ends[index];
                let middle = 0.5 * (*closed + *open_end);
                *if is_hit { closed } else { open_end } = middle;
            }
        }
    }
}

impl Job for HorizonJob {
    type Found = Vec<f32>;
    type Number = f32;

    const NAME: &'static str = "horizon/1";

    fn size(&self) -> Size {
        let azimuths = self.azimuths.len();
        let rays = (azimuths * (LEVELS + HALVINGS)) as u64;
        Size::each(self.places.points.len(), rays, azimuths)
    }

    fn places(&self) -> Option<&Places> {
        Some(&self.places)
    }

    fn identify(&self, key: &mut Key) {
        key.numbers(&self.azimuths);
        key.places(&self.places);
        key.vectors(&self.scan);
    }

    fn answers(&self, bvh: &Bvh, items: Range<usize>, monitor: &dyn Monitor) -> Answers<Self> {
        let ([points, normals], far) = (self.places.at(items.clone()), f32::INFINITY);
        let seen = sees_directions(bvh, points, normals, &self.scan, far, monitor)?;
        let of_item = |index: usize| {
            let item = items.start + index;
            let ends = (0..self.azimuths.len()).map(|azimuth| {
                let is_closed = |level: &usize| !seen.get(index, azimuth * LEVELS + level);
                match (0..LEVELS).find(is_closed) {
                    _ if !self.has_value(item) => [f64::NAN; 2],
                    None => [-90.0; 2],
                    Some(level) => [elevation(level), elevation(level) + SCAN],
                }
            });
            let mut ends: Vec<[f64; 2]> = ends.collect();
            self.halve(bvh, item, &mut ends);
            let angle = |[closed, _]: [f64; 2]| if closed > ZENITH { 90.0 } else { closed as f32 };
            ends.into_iter().map(angle).collect()
        };
        let found: Vec<Vec<f32>> = (0..items.len()).into_par_iter().map(of_item).collect();
        Ok(found.concat())
    }

    fn found(&self, angles: Vec<f32>) -> Result<Vec<f32>, Error> {
        Ok(angles)
    }
}

#[cfg(test)]
mod tests {
    use antumbra::{Geometry, Recipe};

    use super::*;
    use crate::jobs::job::{bytes_of, finish_bytes};
    use crate::run;

    const UP: [f32; 3] = [0.0, 0.0, 1.0];

    fn horizon(
        corners: &[[f32; 3]],
        indices: &[[u32; 3]],
        sensors: (&[[f32; 3]], &[[f32; 3]]),
        azimuths: &[f64],
    ) -> Vec<f32> {
        let geometry = [Geometry::triangles(corners, indices)];
        let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
        let job = HorizonJob::new(sensors.0, sensors.1, azimuths, &Orientation::default());
        run(&job.expect("a job"), &bvh, &()).expect("angles")
    }

    #[test]
    fn a_long_wall_has_the_angle_of_its_height_over_the_distance_along_the_azimuth() {
        // 9 high, 10 to the east, long enough for all azimuths that it is in.
        let corners = [
            [10.0, -60.0, 0.0],
            [10.0, 60.0, 0.0],
            [10.0, 60.0, 9.0],
            [10.0, -60.0, 9.0],
        ];
        let azimuths: Vec<f64> = (0..36).map(|i| 10.0 * f64::from(i)).collect();
        let found = horizon(
            &corners,
            &[[0, 1, 2], [0, 2, 3]],
            (&[[0.0; 3]], &[UP]),
            &azimuths,
        );
        for (azimuth, found) in azimuths.iter().zip(found) {
            let toward = azimuth.to_radians().sin();
            let wanted = match toward > 1e-3 {
                true => (9.0 * toward / 10.0).atan().to_degrees(),
                false => 0.0,
            };
            let below = wanted - f64::from(found);
            assert!(
                (-1e-4..2.1e-3).contains(&below),
                "{azimuth}: {found} for {wanted}"
            );
        }
    }

    #[test]
    fn roofs_planes_and_nothing() {
        let roof = [[-9.0, -9.0, 5.0], [9.0, -9.0, 5.0], [0.0, 9.0, 5.0]];
        let indices = [[0, 1, 2]];
        let azimuths = [0.0, 123.0];
        let below = ([0.0, 0.0, 0.0], UP);
        let above = ([0.0, 0.0, 6.0], UP);
        let facade = ([0.0, 100.0, 9.0], [0.0, 1.0, 0.0]);
        for ((point, normal), wanted) in [
            (below, [90.0, 90.0]),
            (above, [0.0, 0.0]),
            (facade, [-90.0, 90.0]),
            (([0.0; 3], [0.0; 3]), [f32::NAN; 2]),
        ] {
            let found = horizon(&roof, &indices, (&[point], &[normal]), &azimuths);
            let is_close = |(a, b): (&f32, f32)| (a - b).abs() < 0.6 || a.is_nan() && b.is_nan();
            assert!(
                found.iter().zip(wanted).all(is_close),
                "{point:?}: {found:?}"
            );
        }
        let free = horizon(&roof, &indices, (&[[0.0, 0.0, -1.0]], &[]), &azimuths);
        assert_eq!(free, [90.0, 90.0]);
        let far = horizon(&roof, &indices, (&[[0.0, 0.0, 1e3]], &[]), &[0.0]);
        assert!(far[0] < -89.0, "{far:?}");
        assert!(HorizonJob::new(&[], &[], &[f64::NAN], &Orientation::default()).is_err());
    }

    #[test]
    fn shares_have_the_angles_of_the_whole() {
        let roof = [[-9.0, -9.0, 5.0], [9.0, -9.0, 5.0], [0.0, 9.0, 5.0]];
        let geometry = [Geometry::triangles(&roof[..], vec![[0, 1, 2]])];
        let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
        let points: Vec<[f32; 3]> = (0..50)
            .map(|i| {
                [
                    (i * 37 % 50) as f32 - 25.0,
                    (i * 11 % 50) as f32 - 25.0,
                    0.0,
                ]
            })
            .collect();
        let normals = vec![UP; points.len()];
        let job = HorizonJob::new(&points, &normals, &[0.0, 90.0], &Orientation::default());
        let job = job.expect("a job");
        let whole = run(&job, &bvh, &()).expect("angles");
        let parts =
            [0..7, 7..8, 8..50].map(|items| job.answers(&bvh, items, &()).expect("answers"));
        let parts = parts.map(|numbers| bytes_of(&numbers).expect("bytes"));
        assert_eq!(finish_bytes(&job, &parts), Ok(whole));
        assert_eq!(finish_bytes(&job, &parts[1..]), Err(Error::Answers));
    }
}
