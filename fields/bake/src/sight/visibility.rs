//! What points see: directions of the sky or the sun, and other points.

use std::ops::Range;

use antumbra::{Aabb, Bvh, Directions, LocalOrigin, Ray, RayOrder};
use rayon::prelude::*;

use crate::Progress;
use crate::memory;
use crate::points::curve::{Places, along_curve};
use crate::sight::bits::BitMatrix;
use crate::vector::{above, dot, less, unit};
use crate::{Error, Monitor};

/// Rays that a thread hands to the tree together.
const RAYS: usize = 1 << 14;

/// Most rays that a thread hands to the tree together.
const MOST_RAYS: usize = 1 << 20;

/// Most points that a thread takes at a time, however few rays they have.
const MOST_POINTS: usize = 1 << 12;

/// Which directions each point sees: row `i` is point `i`, column `j` direction `j`.
///
/// Points are `[n, 3]`, directions `[m, 3]` of any length. `normals` are `[n, 3]` of any length, or empty:
///
/// | normals | a direction is seen if |
/// |---|---|
/// | of surfaces | it lies above the plane of the normal, and nothing is in the way from an [origin offset](Bvh::origin_offset) above the point on |
/// | empty | nothing is in the way from an origin offset along the direction on |
///
/// Points without normals may be in free space or on surfaces. A point on a surface sees from both sides of it, since nothing
/// says which side is meant. The inside of a closed body hides the directions that begin there. Give normals for points on open
/// sheets. Rounding may hide directions that are within about one degree of the surface of a point.
///
/// Surfaces count on both sides, up to `distance` in units of the scene (infinite for all surfaces). A point, normal or direction
/// that is not finite sees nothing, and neither does one of length 0. Without any surface all others see everything.
///
/// Points are traced along a curve. A row depends only on its point and normal. Its bits are the same for any number of
/// threads, any recipe of the tree, and any place of the point in a list or a part of one. So long lists may be traced in
/// parts, on any machines.
///
/// Work is shared among the threads of the current rayon pool. `monitor` counts points.
///
/// ```
/// use antumbra::{Bvh, Geometry, Recipe};
/// use antumbra_bake::sees_directions;
///
/// let wall = [[0.0, -9.0, 0.0], [0.0, 9.0, 0.0], [0.0, 0.0, 9.0]];
/// let bvh = Bvh::build(&[Geometry::triangles(&wall[..], vec![[0, 1, 2]])], &Recipe::default())?;
/// let (point, up) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
/// let directions = [up, [1.0, 0.0, 0.5], [-1.0, 0.0, 0.5], [0.0, 0.0, -1.0]];
/// let seen = sees_directions(&bvh, &[point], &[up], &directions, f32::INFINITY, &())?;
/// assert_eq!(seen.row(0), [0b0011], "not through the wall, and not through the ground");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`Error`] if the lists differ in length, if the distance is not positive, if there is no memory for the matrix, or if
/// `monitor` cancels.
pub fn sees_directions(
    bvh: &Bvh,
    points: &[[f32; 3]],
    normals: &[[f32; 3]],
    directions: &[[f32; 3]],
    distance: f32,
    monitor: &dyn Monitor,
) -> Result<BitMatrix, Error> {
    let rows = DirectionRows::new(bvh, points, normals, directions, distance)?;
    let mut seen = BitMatrix::new(points.len(), directions.len())?;
    let width = seen.words_per_row();
    rows.run(
        monitor,
        (width, seen.words_mut()),
        &|_, bits, words: &mut [u64]| {
            words.copy_from_slice(bits);
        },
    )?;
    Ok(seen)
}

/// Values made of the directions that each point sees, `width` for each point: `finish` gets the normal (of length 1, or 0 in
/// free space), the bits, and the place of the values. Points without a value are left as they are.
pub(crate) fn fold_directions<T: Send>(
    rows: &DirectionRows<'_>,
    monitor: &dyn Monitor,
    values: (usize, &mut [T]),
    finish: Finish<'_, [f64; 3], T>,
) -> Result<(), Error> {
    rows.run(monitor, values, &|row, bits, values| {
        if let Some(normal) = rows.facing(row) {
            finish(normal, bits, values);
        }
    })
}

/// Points that look in directions.
pub(crate) struct DirectionRows<'a> {
    bvh: &'a Bvh,
    places: Places,
    directions: Directions,
    distance: f32,
}

impl<'a> DirectionRows<'a> {
    pub fn new(
        bvh: &'a Bvh,
        points: &[[f32; 3]],
        normals: &[[f32; 3]],
        directions: &[[f32; 3]],
        distance: f32,
    ) -> Result<Self, Error> {
        let places = Places::new(points, normals)?;
        if !(distance > 0.0) {
            return Err(Error::Distance(distance));
        }
        let mut all = memory::room("directions", directions.len())?;
        // Lengths are in units of the scene, not of the direction.
        let has_lengths = distance.is_finite() || normals.is_empty();
        all.extend(
            directions
                .iter()
                .map(|&dir| ray_direction(dir, has_lengths)),
        );
        Ok(Self {
            bvh,
            places,
            directions: Directions::new(&all),
            distance,
        })
    }

    /// The normal of length 1 of a point, 0 for points in free space; `None` if point or normal have no value.
    fn facing(&self, row: usize) -> Option<[f64; 3]> {
        facing(self.places.points[row], self.places.normals.get(row))
    }

    /// Fills `values`, so many for each row, with what `finish` makes of the row and its bits, and puts them where the points
    /// are in the list.
    fn run<T: Send>(
        &self,
        monitor: &dyn Monitor,
        (width, values): (usize, &mut [T]),
        finish: Finish<'_, usize, T>,
    ) -> Result<(), Error> {
        let per_row = self.directions.len().div_ceil(64);
        let progress = Progress::new(monitor, self.places.points.len());
        // A group chooses its packets by those before, so blocks are large where all threads have some.
        let rays = self
            .directions
            .len()
            .saturating_mul(self.places.points.len());
        let rays = (rays / (4 * rayon::current_num_threads())).clamp(RAYS, MOST_RAYS);
        for_blocks(
            (rays, self.directions.len()),
            width,
            values,
            |first, values| {
                if monitor.cancelled() {
                    return Err(Error::Cancelled);
                }
                let rows = first..first + values.len() / width;
                let Places {
                    points, normals, ..
                } = &self.places;
                let origins = rows
                    .clone()
                    .map(|row| origin(self.bvh, points[row], normals.get(row)));
                let (origins, near): (Vec<_>, Vec<_>) = origins.unzip();
                let mut open = vec![0; rows.len() * per_row];
                let group = self.bvh.group(&origins, &self.directions).on_this_thread();
                let group = match &self.places.normals[..] {
                    [] => group.near(&near),
                    normals => group.above(&normals[rows.clone()]),
                };
                group.far(self.distance).open_into(&mut open);
                for (index, values) in values.chunks_exact_mut(width).enumerate() {
                    finish(
                        rows.start + index,
                        &open[index * per_row..][..per_row],
                        values,
                    );
                }
                progress.add(rows.len());
                Ok(())
            },
        )?;
        self.places.put_back(width, values);
        Ok(())
    }
}

/// The normal of length 1 of a point, 0 for points in free space; `None` if point or normal have no value.
fn facing(point: [f32; 3], normal: Option<&[f32; 3]>) -> Option<[f64; 3]> {
    let is_finite = point.iter().all(|x| x.is_finite());
    let normal = match normal {
        None => Some([0.0; 3]),
        Some(normal) => unit(normal.map(f64::from)),
    };
    normal.filter(|_| is_finite)
}

/// Where the rays of a point begin: an origin, and a distance from there.
pub(crate) fn origin(bvh: &Bvh, point: [f32; 3], normal: Option<&[f32; 3]>) -> ([f32; 3], f32) {
    match (facing(point, normal), normal) {
        (None, _) => ([f32::NAN; 3], 0.0),
        (Some(_), None) => (point, bvh.origin_offset(point)),
        (Some(facing), Some(_)) => (above(bvh, &point, facing), 0.0),
    }
}

/// A direction as rays take it: of length 1 if lengths count or if it is so long or short that the kernel takes it for none; 0
/// for a direction that nothing sees.
pub(crate) fn ray_direction(dir: [f32; 3], has_lengths: bool) -> [f32; 3] {
    let Some(unit) = unit(dir.map(f64::from)) else {
        return [0.0; 3];
    };
    let largest = dir.iter().fold(0.0, |most: f32, x| most.max(x.abs()));
    match has_lengths || !(1e-18..1e18).contains(&largest) {
        true => unit.map(|x| x as f32),
        false => dir,
    }
}

/// Lines of sight between points of a scene, which may be on its surfaces.
///
/// Two points see each other if nothing is strictly between them. A length at both ends of the line is left out, since a
/// point on a surface is rounded and its own surface would hide it now and then:
///
/// | margin | length left out |
/// |---|---|
/// | `None` | the [origin offset](Bvh::origin_offset) of the point at that end |
/// | `Some(length)` | this length, in units of the scene; 0 for the bare segment |
///
/// Points nearer to each other than both lengths together see each other, and so do equal points. Rounding may hide lines that
/// are within about one degree of the surface of a point.
pub struct SightLines<'a> {
    bvh: &'a Bvh,
    margin: Option<f32>,
}

impl<'a> SightLines<'a> {
    /// Lines in the scene of a tree.
    ///
    /// # Errors
    /// [`Error::Range`] if the margin is negative or not finite.
    pub fn new(bvh: &'a Bvh, margin: Option<f32>) -> Result<Self, Error> {
        if let Some(found) = margin {
            let is_in = found >= 0.0 && found.is_finite();
            Error::check_range("margin", found.into(), is_in, "a finite number from 0")?;
        }
        Ok(Self { bvh, margin })
    }

    /// Ray over the part of the line that counts: the points see each other if it is not occluded. Its interval is empty if no
    /// part counts.
    ///
    /// By default the ray begins at the end that is not beyond the scene, so that a far end does not make the other one less precise.
    pub fn ray(&self, local: &LocalOrigin, from: [f64; 3], to: [f64; 3]) -> Ray {
        let end = |point| (point, self.margin(local.local(point)));
        between(local, [end(from), end(to)])
    }

    /// Length left out at a point.
    fn margin(&self, point: [f32; 3]) -> Margin {
        let box_of_all = || self.bvh.bounds().union(&Aabb::around(&[point]));
        Margin {
            length: (self.margin).unwrap_or_else(|| self.bvh.origin_offset(point)),
            extent: self.margin.map_or_else(|| box_of_all().reach(), |_| 0.0),
        }
    }

    /// Points with the lengths left out there, in the order of `places`.
    fn ends(
        &self,
        points: &[[f32; 3]],
        places: impl ExactSizeIterator<Item = usize>,
    ) -> Result<Vec<End>, Error> {
        let mut ends = memory::room("points", places.len())?;
        ends.extend(places.map(|place| (points[place], self.margin(points[place]))));
        Ok(ends)
    }
}

/// An end of a line of sight, and what is left out there.
type End = ([f32; 3], Margin);

/// What is left out at an end of a line.
#[derive(Clone, Copy)]
struct Margin {
    length: f32,
    /// Largest coordinate of the scene and this end, or 0 if the margin is given.
    extent: f32,
}

/// Ray over the part of the line between two points that is farther from each of them than the length beside it.
#[inline]
fn between(local: &LocalOrigin, ends: [([f64; 3], Margin); 2]) -> Ray {
    let [(first, near), (last, far)] = match ends[1].1.extent < ends[0].1.extent {
        true => [ends[1], ends[0]],
        false => ends,
    };
    let ray = local.between(first, last);
    let apart = ray.dir.map(f64::from);
    let [near, far] = [near.length, far.length];
    let length = match far > 0.0 {
        true => dot(apart, apart).sqrt(),
        false => f64::INFINITY,
    };
    Ray {
        tnear: (f64::from(near) / length) as f32,
        tfar: (1.0 - f64::from(far) / length) as f32,
        ..ray
    }
}

/// Sends the ray between two points that are finite.
#[inline]
fn send_between(from: End, to: End, send: impl FnOnce(Ray)) {
    if from.0.iter().chain(&to.0).all(|x| x.is_finite()) {
        let ends = [from, to].map(|(point, margin)| (point.map(f64::from), margin));
        send(between(&LocalOrigin::default(), ends));
    }
}

/// Which points of `to` each point of `from` sees: row `i` is `from[i]`, column `j` is `to[j]`.
///
/// Points are `[n, 3]` and `[m, 3]`. `margin` is as in [`SightLines`], which say what counts. A point that is not finite sees
/// nothing.
///
/// A row depends only on its own point and on `to`, as a row of [`sees_directions`] does.
///
/// # Errors
/// [`Error`] if the margin is negative or not finite, if there is no memory for the matrix, or if `monitor` cancels.
pub fn sees_points(
    bvh: &Bvh,
    from: &[[f32; 3]],
    to: &[[f32; 3]],
    margin: Option<f32>,
    monitor: &dyn Monitor,
) -> Result<BitMatrix, Error> {
    sees_points_within(bvh, (from, to), margin, None, monitor)
}

/// Greatest distance of points that see each other: the length in plan, and the direction up.
pub type SightRange = (f64, [f64; 3]);

/// [`sees_points`], where points that are farther apart than a range do not see each other.
pub(crate) fn sees_points_within(
    bvh: &Bvh,
    (from, to): (&[[f32; 3]], &[[f32; 3]]),
    margin: Option<f32>,
    range: Option<SightRange>,
    monitor: &dyn Monitor,
) -> Result<BitMatrix, Error> {
    let lines = SightLines::new(bvh, margin)?;
    let order = along_curve(to)?;
    let ends = lines.ends(to, order.iter().map(|&place| place as usize))?;
    let is_near = |a: [f32; 3], b: [f32; 3]| {
        range.is_none_or(|(most, up)| {
            let apart = less(&b, &a);
            let height = dot(apart, up);
            dot(apart, apart) - height * height <= most * most
        })
    };
    let rays = |row: usize, send: &mut dyn FnMut(usize, Ray)| {
        let from = (from[row], lines.margin(from[row]));
        for (&column, &end) in order.iter().zip(&ends) {
            if is_near(from.0, end.0) {
                send_between(from, end, |ray| send(column as usize, ray));
            }
        }
    };
    let task = Task {
        bvh,
        rows: 0..from.len(),
        columns: to.len(),
        rays: &rays,
        monitor,
    };
    task.matrix()
}

/// Which points of one list see each other: the points of `rows` in rows, all points in columns.
///
/// As [`sees_points`] from `points[rows]` to `points`, with two differences. A point does not see itself. Each line is traced once
/// for both of its points, so the whole matrix is symmetric, and its parts agree.
///
/// # Errors
/// As [`sees_points`], and [`Error::Length`] if `rows` ends behind the last point.
pub fn sees_each_other(
    bvh: &Bvh,
    points: &[[f32; 3]],
    rows: Range<usize>,
    margin: Option<f32>,
    monitor: &dyn Monitor,
) -> Result<BitMatrix, Error> {
    let lines = SightLines::new(bvh, margin)?;
    if rows.end > points.len() {
        return Err(Error::Length {
            what: "rows",
            found: rows.end,
            wanted: points.len(),
        });
    }
    let order = along_curve(points)?;
    let ends = lines.ends(points, order.iter().map(|&place| place as usize))?;
    let rays = |row: usize, send: &mut dyn FnMut(usize, Ray)| {
        let this = (points[row], lines.margin(points[row]));
        // Lines to later points of these rows are traced; lines from them are copied below.
        for (&column, &other) in order.iter().zip(&ends) {
            let column = column as usize;
            let (first, second) = match column < row {
                _ if column == row => continue,
                true if rows.contains(&column) => continue,
                true => (other, this),
                false => (this, other),
            };
            send_between(first, second, |ray| send(column, ray));
        }
    };
    let task = Task {
        bvh,
        rows: rows.clone(),
        columns: points.len(),
        rays: &rays,
        monitor,
    };
    let mut seen = task.matrix()?;
    for row in rows.clone() {
        for column in rows.start..row {
            if seen.get(column - rows.start, row) {
                seen.set(row - rows.start, column, true);
            }
        }
    }
    Ok(seen)
}

/// Sends the rays of a row: column and ray. The answer is yes where the interval of the ray is empty, and no for columns that
/// are not sent.
type RaysOf<'a> = &'a (dyn Fn(usize, &mut dyn FnMut(usize, Ray)) + Sync);

/// Makes values of the bits of a row, which is known by `R`.
type Finish<'a, R, T> = &'a (dyn Fn(R, &[u64], &mut [T]) + Sync);

/// Rows of answers that are to be found.
struct Task<'a> {
    bvh: &'a Bvh,
    rows: Range<usize>,
    columns: usize,
    rays: RaysOf<'a>,
    monitor: &'a dyn Monitor,
}

impl Task<'_> {
    /// All bits, 1 where nothing is in the way.
    fn matrix(&self) -> Result<BitMatrix, Error> {
        let mut seen = BitMatrix::new(self.rows.len(), self.columns)?;
        let width = seen.words_per_row();
        let progress = Progress::new(self.monitor, self.rows.len());
        let sizes = (RAYS, self.columns);
        for_blocks(sizes, width, seen.words_mut(), |first, words| {
            let first = self.rows.start + first;
            let rows = first..first + words.len() / width;
            let count = rows.len();
            let mut tracer = Tracer::new(self.bvh, self.monitor);
            tracer.trace(rows, width, self.rays)?;
            words.copy_from_slice(&tracer.seen);
            progress.add(count);
            Ok(())
        })?;
        Ok(seen)
    }
}

/// Calls `work` with the first row and the values of every block of about so many rays, on all threads. A row has so many columns
/// and values.
fn for_blocks<T: Send>(
    (rays, columns): (usize, usize),
    width: usize,
    values: &mut [T],
    work: impl Fn(usize, &mut [T]) -> Result<(), Error> + Sync,
) -> Result<(), Error> {
    if width == 0 {
        return Ok(());
    }
    let block = (rays / columns.max(1)).clamp(1, MOST_POINTS);
    let blocks = values.par_chunks_mut(block * width).enumerate();
    blocks.try_for_each(|(index, values)| work(index * block, values))
}

/// Rays that wait, and the places of their bits.
struct Tracer<'a> {
    bvh: &'a Bvh,
    monitor: &'a dyn Monitor,
    rays: Vec<Ray>,
    places: Vec<usize>,
    occluded: Vec<u64>,
    /// Bits of some rows.
    seen: Vec<u64>,
}

impl<'a> Tracer<'a> {
    fn new(bvh: &'a Bvh, monitor: &'a dyn Monitor) -> Self {
        Self {
            bvh,
            monitor,
            rays: Vec::new(),
            places: Vec::new(),
            occluded: Vec::new(),
            seen: Vec::new(),
        }
    }

    /// Finds the bits of some rows.
    fn trace(&mut self, rows: Range<usize>, per_row: usize, rays: RaysOf<'_>) -> Result<(), Error> {
        self.seen.clear();
        self.seen.resize(rows.len() * per_row, 0);
        for (index, row) in rows.enumerate() {
            let mut outcome = Ok(());
            rays(row, &mut |column, ray| {
                let place = 64 * per_row * index + column;
                if !(ray.tnear < ray.tfar) {
                    self.seen[place / 64] |= 1 << (place % 64);
                    return;
                }
                self.rays.push(ray);
                self.places.push(place);
                if self.rays.len() == RAYS && outcome.is_ok() {
                    outcome = self.flush();
                }
            });
            outcome?;
        }
        self.flush()
    }

    /// Traces the rays that wait.
    fn flush(&mut self) -> Result<(), Error> {
        if self.monitor.cancelled() {
            return Err(Error::Cancelled);
        }
        self.occluded.clear();
        self.occluded.resize(self.rays.len().div_ceil(64), 0);
        let batch = self.bvh.batch(&self.rays[..]).on_this_thread();
        let batch = batch.order(RayOrder::Alike);
        batch.occluded_bits_into(&mut self.occluded);
        for (ray, &place) in self.places.iter().enumerate() {
            let open = !(self.occluded[ray / 64] >> (ray % 64)) & 1;
            self.seen[place / 64] |= open << (place % 64);
        }
        self.rays.clear();
        self.places.clear();
        Ok(())
    }
}
