//! Light from far away at any place, above the surface or beside it.
//!
//! A ray hits the surface where it is not above it at a crossing with an edge of a triangle, as in [`March`](crate::March): between
//! crossings, both are straight. The ray is divided at the borders of squares of 512 cells, of 64 and of 8. Each square knows the peak of
//! its cells and of the next row and column, which has the ends of all edges that cross it. A stretch of the ray that stays above the
//! peaks of its squares is left out, and one that is hit ends the search. Behind the distance at which the ray is above all of the field
//! nothing is looked at.
//!
//! Stretches are divided by computed distances, and crossings near their ends belong to both. So rounding decides only how much is looked
//! at. What counts are slopes of crossings, which at the centres of cells have the same bits as in `March`.

use crate::crossing::{CLOSE, edge_at, floor, is_edge, is_twice};
use crate::height_field::{Family, families};
use crate::peaks::{Peaks, SIDES};
use crate::{Error, HeightField, Observer, angles::check_azimuths};

/// Cells beyond the ends of a stretch in which crossings are looked for.
const BEYOND: f64 = 1e-6;

/// Parts of a height by which a stretch must be above a peak: more than both are rounded.
const SLACK: f64 = 1e-12;

/// A slope that is as good as infinite.
const STEEP: f64 = 1e20;

/// What a height field hides at any place: with [`Shadows`](crate::Shadows), the answer for all cells is faster.
pub struct Skyline<'a> {
    field: &'a HeightField<'a>,
    levels: [Peaks; 3],
    /// The largest height.
    top: f64,
    /// More than a height on an edge is rounded.
    slack: f64,
}

/// A light infinitely far away, seen from a height field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Columns and rows of a length of 1 towards it.
    step: [f64; 2],
    slope: f64,
}

/// A ray towards a light.
struct Ray<'a> {
    light: &'a Light,
    /// Cell before the eye, and how far the eye is behind its centre, in columns and rows.
    cell: [isize; 2],
    beyond: [f64; 2],
    height: f64,
    /// 0 if it crosses more columns than rows, otherwise 1.
    axis: usize,
    /// Distance from one of them to the next; negative towards the first.
    per_step: f64,
}

impl<'a> Skyline<'a> {
    /// The skyline of a field. The memory is an eighth of a byte for each cell.
    ///
    /// # Errors
    /// [`Error::NoMemory`].
    pub fn new(field: &'a HeightField<'a>) -> Result<Self, Error> {
        let known = || field.heights().iter().filter(|height| height.is_finite());
        let largest = known().fold(0.0, |most: f64, height| most.max(height.abs()));
        Ok(Self {
            field,
            levels: Peaks::of_squares(field, SIDES[0], 1)?.levels()?,
            top: known().copied().fold(f64::NEG_INFINITY, f64::max),
            slack: SLACK * largest,
        })
    }

    /// A light in an azimuth, in degrees from the north of the map (`y`) through east, whose elevation has the tangent `slope`: infinite
    /// at the zenith.
    ///
    /// # Errors
    /// [`Error::Range`] if the azimuth is not finite or the slope NaN.
    pub fn light(&self, azimuth: f64, slope: f64) -> Result<Light, Error> {
        check_azimuths(&[azimuth])?;
        let wanted = "the tangent of an elevation";
        Error::check_range("slope", slope, !slope.is_nan(), wanted)?;
        Ok(Light {
            step: self.field.step(azimuth),
            slope,
        })
    }

    /// Whether the surface hides a light at a column and a row, of which [`HeightField::place`] makes those that are exact, and a height.
    ///
    /// A light exactly on the horizon is hidden, as for [`Shadows`](crate::Shadows). The place may be beside the raster or in a hole. A
    /// point below the surface sees nothing (see [`Skyline::buries`]), and neither does one that is not finite.
    ///
    /// ```
    /// use antumbra_terrain::{HeightField, Skyline};
    ///
    /// // A wall of 2 m in the east of a plain hides a sun 30 degrees high at a window 1 m above ground for 1.73 m.
    /// let heights = [0.0, 0.0, 0.0, 0.0, 0.0, 2.0].repeat(2);
    /// let field = HeightField::new([6, 2], &heights, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0])?;
    /// let skyline = Skyline::new(&field)?;
    /// let sun = skyline.light(90.0, 30f64.to_radians().tan())?;
    /// assert!(skyline.hides([3.3, 0.5], 1.0, &sun) && !skyline.hides([3.2, 0.5], 1.0, &sun));
    /// # Ok::<(), antumbra_terrain::Error>(())
    /// ```
    pub fn hides(&self, place: [f64; 2], height: f64, light: &Light) -> bool {
        let is_finite = place.iter().chain([&height]).all(|x| x.is_finite());
        if !is_finite || self.buries(place, height) || light.slope == f64::NEG_INFINITY {
            return true;
        }
        let slope = light.slope.clamp(-STEEP, STEEP);
        let light = Light { slope, ..*light };
        let [columns, rows] = light.step;
        let axis = usize::from(columns.abs() <= rows.abs());
        let ray = Ray {
            light: &light,
            cell: place.map(floor),
            beyond: place.map(|at| at - floor(at) as f64),
            height,
            axis,
            per_step: 1.0 / light.step[axis],
        };
        let up = self.top + self.slack - height;
        // Farther away nothing is high enough.
        let reach = if slope > 0.0 {
            up / slope * (1.0 + SLACK)
        } else {
            f64::INFINITY
        };
        let mut ends = [0.0, reach];
        for ((size, at), step) in self.field.size().into_iter().zip(place).zip(light.step) {
            let ways = [-CLOSE - at, (size - 1) as f64 + CLOSE - at];
            match ways.map(|way| way / step) {
                _ if step == 0.0 && (ways[0] > 0.0 || ways[1] < 0.0) => return false,
                _ if step == 0.0 => {}
                [a, b] => ends = [ends[0].max(a.min(b)), ends[1].min(a.max(b))],
            }
        }
        ends[0] <= ends[1] && self.stops(&ray, SIDES.len() - 1, ends)
    }

    /// Memory of the peaks.
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(Peaks::bytes).sum()
    }

    /// Whether a place is below the surface by more than rounding, as of [`HeightField::buries`].
    pub fn buries(&self, place: [f64; 2], height: f64) -> bool {
        let normal = [0.0; 3];
        self.field.buries(&Observer {
            place,
            height,
            normal,
        })
    }

    /// Whether the surface stops a ray between two distances, in squares of a level.
    fn stops(&self, ray: &Ray<'_>, level: usize, [mut from, to]: [f64; 2]) -> bool {
        let side = SIDES[level] as isize;
        let step = ray.light.step[ray.axis];
        let mut square = floor(ray.at(ray.axis, from)) >> side.trailing_zeros();
        loop {
            let border = side * if step > 0.0 { square + 1 } else { square };
            let line = (border - ray.cell[ray.axis]) as f64 - ray.beyond[ray.axis];
            let end = to.min(line * ray.per_step);
            if self.reaches(ray, level, square, [from, end])
                && match level.checked_sub(1) {
                    Some(below) => self.stops(ray, below, [from, end]),
                    None => {
                        let mut all = families(self.field.has_holes()).iter();
                        all.any(|&family| self.crosses(ray, family, [from, end]))
                    }
                }
            {
                return true;
            }
            if end >= to {
                return false;
            }
            (from, square) = (end, square + if step > 0.0 { 1 } else { -1 });
        }
    }

    /// Whether a peak of the squares between two distances may be as high as the ray. All of them have the same number along its axis.
    fn reaches(&self, ray: &Ray<'_>, level: usize, square: isize, ends: [f64; 2]) -> bool {
        let [a, b] = ends.map(|distance| ray.at(1 - ray.axis, distance));
        // A ray along a border may be rounded to a place beside it.
        let first = floor(a.min(b)).max(0);
        let across = first..(-floor(-a.max(b))).max(first + 1);
        let own = square * SIDES[level] as isize;
        let cells = match ray.axis {
            0 => [own..own + 1, across],
            _ => [across, own..own + 1],
        };
        let peak = self.levels[level].most(cells);
        let nearest = ends[usize::from(ray.light.slope <= 0.0)];
        peak + self.slack - ray.height >= ray.least(nearest)
    }

    /// Whether the ray is not above the surface at a crossing with a line of a family between two distances.
    fn crosses(&self, ray: &Ray<'_>, family: Family, ends: [f64; 2]) -> bool {
        let Light { step, slope } = *ray.light;
        let ([u, v], along) = family;
        let of = |[c, r]: [f64; 2]| u as f64 * c + v as f64 * r;
        let (speed, start) = (of(step), of(ray.beyond));
        if speed == 0.0 {
            return false;
        }
        let axis = usize::from(along[0] == 0);
        let [a, b] = ends.map(|distance| start + distance * speed);
        let lines = -floor(BEYOND - a.min(b))..=floor(a.max(b) + BEYOND);
        lines.into_iter().any(|line| {
            let way = line as f64 - start;
            let distance = way / speed;
            // An eye that is close to an edge is on it.
            if !(distance > 0.0 && way.abs() > CLOSE) {
                return false;
            }
            let place = ray.beyond[axis] + distance * step[axis];
            let (ends, part) = edge_at(family, line, place);
            if is_twice([u, v], ends) {
                return false;
            }
            let ends = ends.map(|[c, r]| [ray.cell[0] + c, ray.cell[1] + r]);
            let [a, b] = ends.map(|end| self.height(end));
            let up = a + part * (b - a) - ray.height;
            // NaN hides nothing.
            up >= ray.least(distance)
                && up * (1.0 / distance) >= slope
                && (!self.field.has_holes()
                    || is_edge(self.field, ends.map(|end| end.map(|at| at as f64))))
        })
    }

    /// Height of a cell; NaN without data, or beside the field.
    fn height(&self, [column, row]: [isize; 2]) -> f64 {
        let [width, height] = self.field.size().map(|size| size as isize);
        match (0..width).contains(&column) && (0..height).contains(&row) {
            true => self.field.heights()[(row * width + column) as usize],
            false => f64::NAN,
        }
    }
}

impl Ray<'_> {
    /// What it has climbed at a distance, less more than that is rounded.
    fn least(&self, distance: f64) -> f64 {
        let climb = self.light.slope * distance;
        climb - SLACK * climb.abs()
    }

    /// Column (axis 0) or row at a distance.
    fn at(&self, axis: usize, distance: f64) -> f64 {
        self.cell[axis] as f64 + (self.beyond[axis] + distance * self.light.step[axis])
    }
}
