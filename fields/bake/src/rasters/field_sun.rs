//! Sun and sky on the cells of height fields.

use std::ops::Range;

use antumbra::{Aabb, Bvh, Ray};
use antumbra_terrain::{HeightField, Shadows, Share, per_cell};
use rayon::prelude::*;

use crate::sun::sunlight::{Lights, facing};
use crate::vector::above;
use crate::{
    Answers, BitMatrix, Error, Job, Key, Monitor, Size, SunFound, SunValues, Sunlight,
    Surroundings, memory, ones,
};

/// Job of [`SunValues`] of the cells of a height field, as of [`SunJob`](crate::SunJob), but by [`Shadows`]: exact, without rays, and
/// from the surface itself. Sensors are the cells with data, which face as the surface does.
///
/// Its items are suns and patches of the sky, since a sweep answers all cells at once.
pub struct FieldSunJob<'a> {
    field: &'a HeightField<'a>,
    shadows: Shadows<'a>,
    lights: Lights<'a>,
    sunlight: &'a Sunlight,
    rise: f64,
    /// Azimuth on the map and slope of each light.
    directions: Vec<[f64; 2]>,
    /// Normals of all cells; 0 without a triangle.
    normals: Vec<[f32; 3]>,
    scene: Option<Scene<'a>>,
    by: Option<&'a LitBy<'a>>,
}

/// Finds which cells get light from each of some directions, as [`Shadows::all_lit`] does.
pub type LitBy<'a> = dyn Fn(&[[f64; 2]], &dyn Monitor) -> Result<Vec<Vec<u64>>, Error> + Sync + 'a;

/// A scene that hides lights as well.
struct Scene<'a> {
    terrain: &'a Surroundings<'a>,
    tree: &'a Bvh,
    /// Where rays of all cells begin; NaN without data.
    origins: Vec<[f32; 3]>,
    /// Directions to the lights.
    directions: Vec<[f32; 3]>,
}

/// Cells whose sums are given back at once, when they have become values.
const GIVEN_BACK: usize = 1 << 16;

/// Lights that are answered at once.
const BATCH: usize = 64;

impl<'a> FieldSunJob<'a> {
    /// The job of sensors that are `rise` above their cells. `north` is the angle from the north of the map (`y`) to true north, as of
    /// the orientation that the sunlight was made with. Without `by_month`, lists of months stay empty, which take 288 bytes a cell.
    ///
    /// # Errors
    /// [`Error::NoMemory`], or [`Error::Range`] if a measured sky is out of its range.
    pub fn new(
        field: &'a HeightField<'a>,
        sunlight: &'a Sunlight,
        (rise, north): (f64, f64),
        by_month: bool,
    ) -> Result<Self, Error> {
        let [width, height] = field.size();
        let mut normals = memory::room("normals", width * height)?;
        for row in 0..height {
            let normal = |column| field.normal([column, row]).unwrap_or_default();
            normals.extend((0..width).map(|column| normal(column).map(|x| x as f32)));
        }
        Ok(Self {
            field,
            shadows: Shadows::new(field, rise)?,
            lights: Lights::new(sunlight, by_month)?,
            sunlight,
            rise,
            directions: sunlight.on_map(north),
            normals,
            scene: None,
            by: None,
        })
    }

    /// The same job, where something else finds what is lit: for a part of a larger raster, of which cells beyond hide lights as well.
    pub fn lit_by(mut self, by: &'a LitBy<'a>) -> Self {
        self.by = Some(by);
        self
    }

    /// The job of these cells among the surfaces of a tree, such as houses, which hide lights as the field does. `terrain` is the same
    /// field.
    ///
    /// # Errors
    /// [`Error::NoMemory`].
    pub fn among(mut self, tree: &'a Bvh, terrain: &'a Surroundings<'a>) -> Result<Self, Error> {
        let [width, _] = self.field.size();
        let [x, _, _, y, _, _] = self.field.transform();
        let mut origins = memory::room("origins", self.normals.len())?;
        let heights = self.field.heights().iter().zip(&self.normals).enumerate();
        origins.extend(heights.map(|(cell, (height, &normal))| {
            let centre = [cell % width, cell / width].map(|at| at as f64 + 0.5);
            let [east, north] = self.field.along(centre);
            let point = terrain.point([x + east, y + north, height + self.rise]);
            above(tree, &point, terrain.vector(normal))
        }));
        let orientation = terrain.orientation()?;
        let suns = self.sunlight.suns.positions.iter();
        let suns = suns.map(|sun| orientation.direction(sun.azimuth, sun.elevation));
        let suns = suns.map(|direction| direction.map(|x| x as f32));
        let patches = self.sunlight.patches.directions(&orientation);
        self.scene = Some(Scene {
            terrain,
            tree,
            origins,
            directions: suns.chain(patches).collect(),
        });
        Ok(self)
    }

    /// Normals of the cells with data.
    pub fn normals(&self) -> Vec<[f32; 3]> {
        self.with_data().map(|cell| self.normals[cell]).collect()
    }

    /// Bytes that [`FieldSunJob::whole`] takes, about.
    pub fn memory(&self, keeps: bool) -> u64 {
        let kept = if keeps { 2 * self.lights.len() / 8 } else { 0 };
        // Sums become values one by one.
        let planes = if self.by.is_some() { BATCH } else { BATCH / 8 };
        let bytes = size_of::<f64>() * self.lights.sums() + planes + kept;
        self.normals.len() as u64 * bytes as u64
    }

    fn with_data(&self) -> impl DoubleEndedIterator<Item = usize> + '_ {
        let heights = self.field.heights();
        (0..heights.len()).filter(|&cell| heights[cell].is_finite())
    }

    /// Computes the job with little memory: 64 directions at once. What each sensor sees is in the result only if it is to be kept.
    ///
    /// # Errors
    /// [`Error::NoMemory`], [`Error::Cancelled`].
    pub fn whole(&self, keeps: bool, monitor: &dyn Monitor) -> Result<SunFound, Error> {
        // What else finds lit cells reads less if it finds more of them together.
        let each = if self.by.is_some() { 8 * BATCH } else { BATCH };
        let (total, calls) = (self.directions.len(), self.directions.len().div_ceil(each));
        let planes = (0..calls).flat_map(|call| {
            let lights = each * call..total.min(each * (call + 1));
            match self.lit(lights, &Share(monitor, [call, calls])) {
                Ok(planes) => batches(planes).map(Ok).collect(),
                Err(error) => vec![Err(error)],
            }
        });
        self.sums(keeps, planes)
    }

    /// The cells that see each of some lights.
    fn lit(&self, lights: Range<usize>, monitor: &dyn Monitor) -> Result<Vec<Vec<u64>>, Error> {
        let directions = &self.directions[lights.clone()];
        let mut planes = match self.by {
            Some(by) => by(directions, monitor)?,
            None => self.shadows.all_lit(directions, monitor)?,
        };
        if let Some(scene) = &self.scene {
            let [width, _] = self.field.size();
            let planes = planes.par_iter_mut().zip(&scene.directions[lights]);
            planes.try_for_each(|(plane, &direction)| {
                if monitor.cancelled() {
                    return Err(Error::Cancelled);
                }
                scene.hide(plane, width, direction);
                Ok(())
            })?;
        }
        Ok(planes)
    }

    /// Sums over planes, which come in batches.
    fn sums<P: AsRef<[u64]> + Sync>(
        &self,
        keeps: bool,
        batches: impl Iterator<Item = Result<Vec<P>, Error>>,
    ) -> Result<SunFound, Error> {
        let [width, _] = self.field.size();
        let (cells, each) = (self.normals.len(), self.lights.sums());
        let mut seen = BitMatrix::new(if keeps { cells } else { 0 }, self.lights.len())?;
        let mut all = memory::filled("sums", cells * each, 0.0)?;
        let normal_of = |cell: usize| facing(Some(self.normals[cell]), &self.sunlight.orientation);
        for (batch, planes) in batches.enumerate() {
            let (planes, first) = (planes?, BATCH * batch);
            per_cell(&planes, width, &mut all, |cell, sums, lit| {
                if let Some(normal) = normal_of(cell).filter(|_| lit != 0) {
                    self.lights.add(sums, normal, (first, lit), true);
                }
            });
            per_cell(&planes, width, seen.words_mut(), |cell, seen, lit| {
                if let Some(normal) = normal_of(cell).filter(|_| lit != 0) {
                    seen[batch] = self.lights.faced(normal, (first, lit));
                }
            });
        }
        // From the last cell on, so that the sums of those behind are given back on the way.
        let mut values = SunValues::with_room(cells, &self.lights)?;
        for cell in self.with_data().rev() {
            let faces = self.normals[cell] != [0.0; 3];
            let sums = &all[each * cell..][..each];
            values.push(&self.lights, faces.then_some(sums));
            if cell.is_multiple_of(GIVEN_BACK) {
                all.truncate(each * cell);
                all.shrink_to_fit();
            }
        }
        values.reverse();
        drop(all);
        let kept: Vec<&[u64]> = match keeps {
            true => self.with_data().map(|cell| seen.row(cell)).collect(),
            false => Vec::new(),
        };
        let [suns_seen, sky_seen] = self.lights.split(kept.into_iter())?;
        Ok(SunFound {
            suns_seen,
            sky_seen,
            values,
        })
    }
}

/// Planes, so many together as sums take.
fn batches(planes: Vec<Vec<u64>>) -> impl Iterator<Item = Vec<Vec<u64>>> {
    let mut planes = planes.into_iter().peekable();
    std::iter::from_fn(move || {
        planes.peek()?;
        Some(planes.by_ref().take(BATCH).collect())
    })
}

impl Scene<'_> {
    /// Removes the cells whose light in a direction is hidden from those that see it.
    fn hide(&self, plane: &mut [u64], width: usize, direction: [f32; 3]) {
        let bounds = self.tree.bounds();
        let rows = plane.chunks_exact_mut(width.div_ceil(64));
        let (mut rays, mut hidden) = (Vec::new(), Vec::new());
        for (row, origins) in rows.zip(self.origins.chunks_exact(width)) {
            let may = |&column: &usize| may_hit(&bounds, origins[column], direction);
            let columns: Vec<usize> = ones(row).filter(may).collect();
            rays.clear();
            rays.extend(
                columns
                    .iter()
                    .map(|&column| Ray::new(origins[column], direction)),
            );
            hidden.clear();
            hidden.resize(rays.len().div_ceil(64), 0);
            let batch = self.tree.batch(&rays).on_this_thread();
            batch.occluded_bits_into(&mut hidden);
            for ray in ones(&hidden) {
                row[columns[ray] / 64] &= !(1 << (columns[ray] % 64));
            }
        }
    }
}

/// Whether a ray may hit a box: most cells are far from all houses.
fn may_hit(bounds: &Aabb, origin: [f32; 3], direction: [f32; 3]) -> bool {
    let (mut near, mut far) = (0.0, f32::INFINITY);
    for axis in 0..3 {
        let ends = [bounds.min, bounds.max].map(|end| (end[axis] - origin[axis]) / direction[axis]);
        // NaN, of a ray along a side, does not count.
        near = ends[0].min(ends[1]).max(near);
        far = ends[0].max(ends[1]).min(far);
    }
    near <= far * (1.0 + 1e-5)
}

impl Job for FieldSunJob<'_> {
    type Found = SunFound;
    type Number = u64;

    const NAME: &'static str = "field-sun/1";

    fn size(&self) -> Size {
        let [width, height] = self.field.size();
        let cells = self.normals.len() as u64;
        Size::each(self.directions.len(), cells, height * width.div_ceil(64))
    }

    fn identify(&self, key: &mut Key) {
        key.text(&format!(
            "{:?} {:?} {}",
            self.field.size(),
            self.field.transform(),
            self.rise
        ));
        key.numbers(self.directions.as_flattened());
        key.numbers(self.field.heights());
        if let Some(scene) = &self.scene {
            scene.terrain.identify(key);
        }
    }

    fn answers(&self, _: &Bvh, items: Range<usize>, monitor: &dyn Monitor) -> Answers<Self> {
        Ok(self.lit(items, monitor)?.concat())
    }

    fn found(&self, words: Vec<u64>) -> Result<SunFound, Error> {
        let [width, height] = self.field.size();
        let planes = words.chunks_exact(height * width.div_ceil(64));
        let planes: Vec<&[u64]> = planes.collect();
        if planes.len() != self.directions.len() {
            return Err(Error::Answers);
        }
        self.sums(true, planes.chunks(BATCH).map(|planes| Ok(planes.to_vec())))
    }
}
