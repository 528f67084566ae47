//! Sun and sky over a period of time: their steps, their light, and what sensors receive of it.

use std::ops::Range;

use antumbra::Bvh;
use antumbra_terrain::Light;
use antumbra_terrain::angles::sin_cos_degrees;
use rayon::prelude::*;

use crate::memory;
use crate::points::curve::Places;
use crate::vector::dot;
use crate::{
    Answers, BitMatrix, Clock, Error, Irradiance, Job, Key, Moment, Monitor, Orientation, Pieces,
    Place, Refraction, Size, SkyPatches, SunPosition, Surroundings, Weather, Weighting, ones,
    perez_sky, sees_directions, sun_positions,
};

/// Most steps of time.
const MOST_STEPS: f64 = 1e7;

/// A step of time, with the irradiance of the sun and the sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeStep {
    /// Middle of the step in Unix time.
    pub middle: f64,
    /// Beginning of the step on local clocks.
    pub begin: Moment,
    /// Length of the step in hours.
    pub hours: f64,
    /// Mean irradiance over the step; 0 where nothing was measured.
    pub irradiance: Irradiance,
}

impl TimeStep {
    /// Steps of so many seconds between two moments on these clocks. The last one may be shorter.
    ///
    /// # Errors
    /// [`Error::NoTime`] if the period ends before it begins, [`Error::Steps`] if there are more than ten million.
    pub fn regular(
        [from, to]: [Moment; 2],
        clock: &Clock,
        seconds: f64,
    ) -> Result<Vec<Self>, Error> {
        let [from, to] = [clock.unix(&from), clock.unix(&to)];
        let count = ((to - from) / seconds - 1e-9).ceil();
        if !(count >= 1.0) {
            return Err(Error::NoTime);
        }
        if count > MOST_STEPS {
            return Err(Error::Steps(count));
        }
        let step = |index| {
            let begin = from + seconds * index as f64;
            let length = seconds.min(to - begin);
            Self {
                middle: begin + 0.5 * length,
                begin: clock.moment(begin),
                hours: length / 3600.0,
                irradiance: Irradiance::default(),
            }
        };
        Ok((0..count as usize).map(step).collect())
    }

    /// A step of so many seconds around a moment on these clocks.
    pub fn around(moment: Moment, clock: &Clock, seconds: f64) -> Self {
        let middle = clock.unix(&moment);
        Self {
            middle,
            begin: clock.moment(middle - 0.5 * seconds),
            hours: seconds / 3600.0,
            irradiance: Irradiance::default(),
        }
    }

    /// Hour of the day in the middle of the step, from 0 to 24.
    pub fn hour(&self) -> f64 {
        (self.begin.seconds / 3600.0 + 0.5 * self.hours).rem_euclid(24.0)
    }
}

impl Weather {
    /// Steps of the records on clocks `zone` hours ahead of UTC: all steps, or the steps of a period. A period may run
    /// over the end of the year. Its years do not count, because years of a typical year differ.
    pub fn steps(&self, zone: f64, period: Option<[Moment; 2]>) -> Vec<TimeStep> {
        let place = |moment: &Moment| (moment.month, moment.day, moment.seconds);
        let is_in = |moment: &Moment| match &period {
            Some([from, to]) if place(from) <= place(to) => {
                place(from) <= place(moment) && place(moment) < place(to)
            }
            Some([from, to]) => place(from) <= place(moment) || place(moment) < place(to),
            None => true,
        };
        let records = self.records.iter().filter(|record| is_in(&record.begin));
        let step = |record: &crate::Record| TimeStep {
            middle: record.begin.unix(zone) + 1800.0 * record.hours,
            begin: record.begin,
            hours: record.hours,
            irradiance: record.irradiance,
        };
        records.map(step).collect()
    }
}

/// Suns above the horizon, one for each step of time that has one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Suns {
    /// Middle of each step in Unix time.
    pub times: Vec<f64>,
    /// Position of each sun in the sky.
    pub positions: Vec<SunPosition>,
    /// Hours that each sun stands for.
    pub hours: Vec<f64>,
    /// Month of each sun, 0 to 11.
    pub months: Vec<usize>,
    /// Direct normal irradiation by each sun in Wh/m².
    pub direct: Vec<f64>,
    /// Months that have steps, with or without a sun.
    pub covered: [bool; 12],
}

/// Sun and sky at a place over a period of time.
#[derive(Clone, Debug, PartialEq)]
pub struct Sunlight {
    /// Suns above the horizon.
    pub suns: Suns,
    /// Patches of the sky.
    pub patches: SkyPatches,
    /// Up and north of the scene.
    pub orientation: Orientation,
    /// Steps of time, each with the position of the sun, also below the horizon.
    steps: Vec<(TimeStep, SunPosition)>,
    /// Whether irradiance is known.
    is_measured: bool,
}

impl Sunlight {
    /// Sun and sky in the steps of time. `is_measured` says whether the steps have irradiance.
    ///
    /// # Errors
    /// [`Error::Range`] if the place or a time is outside its range.
    pub fn new(
        place: &Place,
        steps: Vec<TimeStep>,
        is_measured: bool,
        patches: SkyPatches,
        orientation: Orientation,
    ) -> Result<Self, Error> {
        let times: Vec<f64> = steps.iter().map(|step| step.middle).collect();
        let positions = sun_positions(place, Refraction::Standard, &times)?;
        let steps: Vec<_> = steps.into_iter().zip(positions).collect();
        let mut suns = Suns::default();
        for (step, position) in &steps {
            let month = step.begin.month as usize - 1;
            suns.covered[month] = true;
            if position.elevation > 0.0 {
                suns.times.push(step.middle);
                suns.positions.push(*position);
                suns.hours.push(step.hours);
                suns.months.push(month);
                suns.direct.push(step.irradiance.direct_normal * step.hours);
            }
        }
        Ok(Self {
            suns,
            patches,
            orientation,
            steps,
            is_measured,
        })
    }

    /// Number of steps of time, with and without a sun.
    pub fn steps(&self) -> usize {
        self.steps.len()
    }

    /// Directions to the suns, `[suns, 3]`.
    pub fn sun_directions(&self) -> Vec<[f32; 3]> {
        let direction = |sun: &SunPosition| {
            let direction = self.orientation.direction(sun.azimuth, sun.elevation);
            direction.map(|x| x as f32)
        };
        self.suns.positions.iter().map(direction).collect()
    }

    /// Directions to the patches of the sky, `[patches, 3]`.
    pub fn patch_directions(&self) -> Vec<[f32; 3]> {
        self.patches.directions(&self.orientation)
    }

    /// Azimuths from the north of a map and slopes of the suns, then of the patches. `north` is the angle from there to true north.
    pub(crate) fn on_map(&self, north: f64) -> Vec<[f64; 2]> {
        let suns = self.suns.positions.iter().map(|sun| {
            let (sin, cos) = sin_cos_degrees(sun.elevation);
            [sun.azimuth + north, sin / cos]
        });
        let patches = self.patches.centres.iter().map(|&[east, up_north, up]| {
            [
                libm::atan2(east, up_north).to_degrees() + north,
                up / libm::hypot(east, up_north),
            ]
        });
        suns.chain(patches).collect()
    }

    /// Steps of time with their suns.
    pub(crate) fn timeline(&self) -> &[(TimeStep, SunPosition)] {
        &self.steps
    }

    /// Whether irradiance is known.
    pub(crate) fn is_measured(&self) -> bool {
        self.is_measured
    }

    /// Light of the sky, if irradiance is known.
    fn sky(&self) -> Result<Option<SkyLight>, Error> {
        if !self.is_measured {
            return Ok(None);
        }
        let none = || vec![0.0; self.patches.len()];
        let mut sky = SkyLight {
            of_all: none(),
            by_month: Default::default(),
        };
        for (step, sun) in &self.steps {
            let of_month = &mut sky.by_month[step.begin.month as usize - 1];
            if of_month.is_empty() {
                *of_month = none();
            }
            if step.irradiance.diffuse_horizontal > 0.0 {
                let day = step.begin.day_of_year();
                let radiances = perez_sky(&self.patches, sun, day, &step.irradiance)?;
                for sums in [&mut sky.of_all, of_month] {
                    let pairs = sums.iter_mut().zip(&radiances);
                    pairs.for_each(|(sum, radiance)| *sum += radiance * step.hours);
                }
            }
        }
        Ok(Some(sky))
    }
}

/// Light from each patch of the sky, in Wh/(m² sr).
struct SkyLight {
    of_all: Vec<f64>,
    /// Empty for months without steps.
    by_month: [Vec<f64>; 12],
}

/// Hours, sky view and irradiation of sensors. Sensors without a normal of some length have the value NaN.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SunValues {
    /// Hours of direct sun, `[n]`.
    pub hours: Vec<f64>,
    /// Hours of each month, `[n, 12]`.
    pub by_month: Vec<f64>,
    /// Sky view factors, `[n]`: see [`sky_view`](crate::sky_view).
    pub sky_view: Vec<f64>,
    /// Parts of the sky's solid angle that are seen, `[n]`.
    pub sky_open: Vec<f64>,
    /// Irradiation by the sun in kWh/m², `[n]`; empty where irradiance is not known, as are all below.
    pub direct: Vec<f64>,
    /// Irradiation by the sky in kWh/m², `[n]`.
    pub diffuse: Vec<f64>,
    /// Irradiation by the sun in each month, `[n, 12]`.
    pub direct_by_month: Vec<f64>,
    /// Irradiation by the sky in each month, `[n, 12]`.
    pub diffuse_by_month: Vec<f64>,
}

impl SunValues {
    /// Direct and diffuse irradiation together.
    pub fn total(&self) -> Vec<f64> {
        let pairs = self.direct.iter().zip(&self.diffuse);
        pairs.map(|(direct, diffuse)| direct + diffuse).collect()
    }

    /// Lists with room for so many sensors, with their values by month or without them.
    pub(crate) fn with_room(sensors: usize, lights: &Lights<'_>) -> Result<Self, Error> {
        let mut values = Self::default();
        for (list, width) in values.lists(lights.sky.is_some()) {
            let width = if width > 1 && !lights.by_month {
                0
            } else {
                width
            };
            *list = memory::room("values", width * sensors)?;
        }
        Ok(values)
    }

    /// Adds a sensor with its sums, which has no values if it faces nowhere.
    pub(crate) fn push(&mut self, lights: &Lights<'_>, sums: Option<&[f64]>) {
        let sums = sums.unwrap_or(&[f64::NAN; MOST_SUMS]);
        let kilo = |watts: f64| watts / 1000.0;
        self.hours.push(sums[HOURS]);
        self.sky_view.push(sums[VIEW] / lights.whole_view);
        self.sky_open.push(sums[OPEN] / lights.whole_sky);
        let is_measured = lights.sky.is_some();
        if is_measured {
            self.direct.push(kilo(sums[DIRECT]));
            self.diffuse.push(kilo(sums[DIFFUSE]));
        }
        if !lights.by_month {
            return;
        }
        let months = |kind: usize| sums[lights.months(kind)..].iter().take(12).copied();
        self.by_month.extend(months(0));
        if is_measured {
            self.direct_by_month.extend(months(1).map(kilo));
            self.diffuse_by_month.extend(months(2).map(kilo));
        }
    }

    /// Turns the order of sensors around.
    pub(crate) fn reverse(&mut self) {
        for (list, width) in self.lists(true) {
            list.reverse();
            list.chunks_exact_mut(width).for_each(<[f64]>::reverse);
        }
    }

    /// The lists, with their values per sensor.
    fn lists(&mut self, is_measured: bool) -> Vec<(&mut Vec<f64>, usize)> {
        let mut lists = vec![(&mut self.hours, 1), (&mut self.by_month, 12)];
        lists.extend([(&mut self.sky_view, 1), (&mut self.sky_open, 1)]);
        if is_measured {
            lists.extend([(&mut self.direct, 1), (&mut self.direct_by_month, 12)]);
            lists.extend([(&mut self.diffuse, 1), (&mut self.diffuse_by_month, 12)]);
        }
        lists
    }
}

/// Suns and patches of the sky, and the light of each.
pub(crate) struct Lights<'a> {
    sunlight: &'a Sunlight,
    to_suns: Vec<[f64; 3]>,
    sky: Option<SkyLight>,
    /// Sums over all patches on open level ground.
    whole_view: f64,
    whole_sky: f64,
    by_month: bool,
}

/// Places in the sums of a sensor: hours, solid angles of the sky that are weighted by the cosine and as they are, and where irradiance
/// is known the irradiation by the sun and by the sky in Wh/m². Then come twelve numbers each of the first and the last two, if months
/// are wanted.
const HOURS: usize = 0;
const VIEW: usize = 1;
const OPEN: usize = 2;
const DIRECT: usize = 3;
const DIFFUSE: usize = 4;

/// Most sums of a sensor.
const MOST_SUMS: usize = 5 + 3 * 12;

impl<'a> Lights<'a> {
    /// The lights of a sky. With `by_month`, there are sums for each month as well.
    pub fn new(sunlight: &'a Sunlight, by_month: bool) -> Result<Self, Error> {
        let patches = &sunlight.patches;
        let all = |weighting| {
            (0..patches.len()).fold(0.0, |sum, patch| sum + patches.weight(patch, UP, weighting))
        };
        Ok(Self {
            sunlight,
            to_suns: to_suns(&sunlight.suns),
            sky: sunlight.sky()?,
            whole_view: all(Weighting::Cosine),
            whole_sky: all(Weighting::Uniform),
            by_month,
        })
    }

    /// Number of sums of a sensor.
    pub fn sums(&self) -> usize {
        match self.by_month {
            true => self.months(if self.sky.is_some() { 3 } else { 1 }),
            false => self.months(0),
        }
    }

    /// Place of the sums of January: of hours, direct and diffuse irradiation.
    fn months(&self, kind: usize) -> usize {
        let first = if self.sky.is_some() { DIFFUSE } else { OPEN } + 1;
        first + 12 * kind
    }

    /// Number of suns and patches.
    pub fn len(&self) -> usize {
        self.to_suns.len() + self.sunlight.patches.len()
    }

    /// Rows of bits as a matrix of suns and one of patches.
    pub fn split<'r>(
        &self,
        rows: impl ExactSizeIterator<Item = &'r [u64]>,
    ) -> Result<[BitMatrix; 2], Error> {
        let (suns, patches) = (self.to_suns.len(), self.sunlight.patches.len());
        let mut suns_seen = BitMatrix::new(rows.len(), suns)?;
        let mut sky_seen = BitMatrix::new(rows.len(), patches)?;
        for (row, words) in rows.enumerate() {
            for column in ones(words) {
                match column.checked_sub(suns) {
                    None => suns_seen.set(row, column, true),
                    Some(patch) if patch < patches => sky_seen.set(row, patch, true),
                    Some(_) => return Err(Error::Answers),
                }
            }
        }
        Ok([suns_seen, sky_seen])
    }

    /// Lights of 64 that a sensor sees, but for the ones behind the plane of its normal; `first` is the number of the lowest bit.
    pub fn faced(&self, normal: [f64; 3], (first, seen): (usize, u64)) -> u64 {
        let suns = self.to_suns.len();
        let centres = &self.sunlight.patches.centres;
        let is_faced = |&bit: &usize| {
            let light = first + bit;
            let direction = match light.checked_sub(suns) {
                None => self.to_suns[light],
                Some(patch) => centres[patch],
            };
            dot(normal, direction) > 0.0
        };
        let seen = [seen];
        let faced = ones(&seen).filter(is_faced);
        faced.fold(0, |faced, bit| faced | 1 << bit)
    }

    /// Adds what a surface with this normal receives from the lights of 64 that it sees; `first` is the number of the lowest bit. If
    /// `has_plane`, it sees none behind its plane.
    pub fn add(
        &self,
        sums: &mut [f64],
        normal: [f64; 3],
        (first, seen): (usize, u64),
        has_plane: bool,
    ) {
        let suns = self.to_suns.len();
        let Suns {
            hours,
            months,
            direct,
            ..
        } = &self.sunlight.suns;
        let is_measured = self.sky.is_some();
        let mut left = seen;
        // In registers, since there may be billions.
        let mut all = [sums[HOURS], if is_measured { sums[DIRECT] } else { 0.0 }];
        while left != 0 {
            let bit = left.trailing_zeros();
            let light = first + bit as usize;
            if light >= suns {
                break;
            }
            left &= left - 1;
            let cosine = dot(normal, self.to_suns[light]);
            if has_plane && !(cosine > 0.0) {
                continue;
            }
            let beam = direct[light] * cosine.max(0.0);
            all = [all[0] + hours[light], all[1] + beam];
            if self.by_month {
                sums[self.months(0) + months[light]] += hours[light];
                if is_measured {
                    sums[self.months(1) + months[light]] += beam;
                }
            }
        }
        sums[HOURS] = all[0];
        if is_measured {
            sums[DIRECT] = all[1];
        }
        for bit in ones(&[left]) {
            self.add_patch(sums, normal, first + bit - suns, has_plane);
        }
    }

    /// Adds what a surface receives from a patch of the sky, unless that is behind its plane.
    fn add_patch(&self, sums: &mut [f64], normal: [f64; 3], patch: usize, has_plane: bool) {
        let patches = &self.sunlight.patches;
        let cosine = dot(patches.centres[patch], normal);
        if has_plane && !(cosine > 0.0) {
            return;
        }
        let cosine = cosine.max(0.0);
        sums[VIEW] += patches.solid_angles[patch] * cosine;
        sums[OPEN] += patches.solid_angles[patch];
        if let Some(sky) = &self.sky {
            let of = |radiances: &[f64]| radiances[patch] * patches.solid_angles[patch] * cosine;
            sums[DIFFUSE] += of(&sky.of_all);
            if self.by_month {
                let known = sky.by_month.iter().zip(&mut sums[self.months(2)..]);
                let known = known.filter(|(sky, _)| !sky.is_empty());
                known.for_each(|(sky, diffuse)| *diffuse += of(sky));
            }
        }
    }
}

/// Normal of level ground.
const UP: [f64; 3] = [0.0, 0.0, 1.0];

/// Directions to suns in terms of east, north and up.
pub(crate) fn to_suns(suns: &Suns) -> Vec<[f64; 3]> {
    let direction =
        |sun: &SunPosition| Orientation::default().direction(sun.azimuth, sun.elevation);
    suns.positions.iter().map(direction).collect()
}

/// Normal in terms of east, north and up, of length 1. Of points in free space, what falls on a level surface counts.
pub(crate) fn facing(normal: Option<[f32; 3]>, orientation: &Orientation) -> Option<[f64; 3]> {
    match normal {
        None => Some(UP),
        Some(normal) => unscaled_unit(orientation.local(normal.map(f64::from))),
    }
}

/// The vector scaled to length 1, if it has a direction.
fn unscaled_unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    let length = dot(vector, vector).sqrt();
    (length > 0.0 && length.is_finite()).then(|| vector.map(|x| x / length))
}

/// Job of [`SunValues`]: which suns and patches of the sky sensors see.
///
/// Points, normals and visibility are as in [`sees_directions`]. Items are points along a curve, so that the items of a
/// chunk are near each other.
pub struct SunJob<'a> {
    /// Normals as they were given.
    facing: &'a [[f32; 3]],
    places: Places,
    sunlight: &'a Sunlight,
    /// Directions to the suns, then to the patches.
    directions: Vec<[f32; 3]>,
    /// Terrain, and the same lights seen from there.
    terrain: Option<(&'a Surroundings<'a>, Vec<Light>)>,
    pieces: Option<&'a Pieces<'a>>,
}

/// Result of a [`SunJob`].
pub struct SunFound {
    /// Suns that each sensor sees.
    pub suns_seen: BitMatrix,
    /// Patches that each sensor sees.
    pub sky_seen: BitMatrix,
    /// Sums over them.
    pub values: SunValues,
}

impl<'a> SunJob<'a> {
    /// The job of these sensors. `normals` are the normals of surfaces, or empty for points in free space.
    ///
    /// # Errors
    /// [`Error::Length`] if the lists differ in length, or [`Error::NoMemory`].
    pub fn new(
        points: &[[f32; 3]],
        normals: &'a [[f32; 3]],
        sunlight: &'a Sunlight,
    ) -> Result<Self, Error> {
        Ok(Self {
            facing: normals,
            places: Places::new(points, normals)?,
            sunlight,
            directions: [sunlight.sun_directions(), sunlight.patch_directions()].concat(),
            terrain: None,
            pieces: None,
        })
    }

    /// The job of these sensors in terrain, which hides lights as the scene does. Sensors below its surface see nothing.
    ///
    /// # Errors
    /// [`Error::NoMemory`].
    pub fn within(mut self, terrain: &'a Surroundings<'a>) -> Result<Self, Error> {
        let lights = terrain.lights(&self.sunlight.on_map(terrain.north()))?;
        self.terrain = Some((terrain, lights));
        Ok(self)
    }

    /// The job of these sensors beside pieces of a larger scene, which hide lights as the scene does.
    pub fn beside(mut self, pieces: &'a Pieces<'a>) -> Self {
        self.pieces = Some(pieces);
        self
    }

    /// Number of rays: one to each sun and patch above the plane of each sensor.
    pub fn rays(&self) -> u64 {
        if self.places.normals.is_empty() {
            return self.places.points.len() as u64 * self.directions.len() as u64;
        }
        let above = |normal: &[f32; 3]| {
            let normal = normal.map(f64::from);
            let faces = |direction: &&[f32; 3]| dot(normal, direction.map(f64::from)) > 0.0;
            self.directions.iter().filter(faces).count() as u64
        };
        self.places.normals.par_iter().map(above).sum()
    }
}

impl Job for SunJob<'_> {
    type Found = SunFound;
    type Number = u64;

    const NAME: &'static str = "sun/3";

    fn size(&self) -> Size {
        let directions = self.directions.len();
        let words = directions.div_ceil(64);
        Size::each(self.places.points.len(), directions as u64, words)
    }

    fn places(&self) -> Option<&Places> {
        Some(&self.places)
    }

    fn identify(&self, key: &mut Key) {
        key.places(&self.places);
        key.vectors(&self.directions);
        if let Some((terrain, _)) = &self.terrain {
            terrain.identify(key);
        }
        if let Some(pieces) = self.pieces {
            pieces.identify(key);
        }
    }

    fn answers(&self, bvh: &Bvh, items: Range<usize>, monitor: &dyn Monitor) -> Answers<Self> {
        let ([points, normals], far) = (self.places.at(items), f32::INFINITY);
        let seen = sees_directions(bvh, points, normals, &self.directions, far, monitor)?;
        let mut words = seen.into_words();
        if let Some((terrain, lights)) = &self.terrain {
            terrain.hide((bvh, points), lights, &mut words, monitor)?;
        }
        if let Some(pieces) = self.pieces {
            let scene = (bvh, points, normals);
            pieces.hide(scene, &self.directions, &mut words, monitor)?;
        }
        Ok(words)
    }

    fn found(&self, words: Vec<u64>) -> Result<SunFound, Error> {
        let (lights, sensors) = (Lights::new(self.sunlight, true)?, self.places.points.len());
        let rows = words.chunks_exact(lights.len().div_ceil(64).max(1));
        let [suns_seen, sky_seen] = lights.split(rows.clone())?;
        let mut values = SunValues::with_room(sensors, &lights)?;
        let mut sums = vec![0.0; lights.sums()];
        for (row, words) in rows.enumerate() {
            let normal = facing(self.facing.get(row).copied(), &self.sunlight.orientation);
            if let Some(normal) = normal {
                sums.fill(0.0);
                for (word, &seen) in words.iter().enumerate() {
                    lights.add(&mut sums, normal, (64 * word, seen), false);
                }
            }
            values.push(&lights, normal.is_some().then_some(&sums));
        }
        Ok(SunFound {
            values,
            suns_seen,
            sky_seen,
        })
    }
}
