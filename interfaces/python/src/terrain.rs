//! Height fields: what the cells of a raster of heights see. The class `HeightField` of the package reads its arguments.

use antumbra_bake::{
    Direction, Error, FieldHorizonJob, FieldSunJob, HeightField, Lattice, Limits, Observer,
    Orientation, Place, SkyMeasure, SkyPatches, SunPosition, Sunlight, Suns, UpAxis, ones,
};
use antumbra_terrain::angles::slope;
use antumbra_terrain::{Progress, Shadows, Share, Viewer, memory};
use numpy::{Element, PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::call::Call;
use crate::call::threads::ThreadCount;
use crate::call::watch::Signals;
use crate::errors::{failed, wrong};

/// Threads and progress of a call.
type Options<'py> = (Option<ThreadCount>, Option<Bound<'py, PyAny>>);

/// Points of observers, with a z of NaN on the surface; heights of eyes; what counts as seen: target, drop and range of limits.
type Sight = (Vec<[f64; 3]>, f64, [f64; 3]);

/// Values of cells, one plane after the other, and what else is known.
type Answer<'py, T, X> = PyResult<(Bound<'py, PyArray1<T>>, X)>;

/// Where azimuths come from.
#[derive(FromPyObject)]
enum Azimuths {
    /// A lattice of so many.
    Lattice(usize),
    Degrees(Vec<f64>),
}

impl Azimuths {
    /// The azimuths, and the directions of a field.
    fn of(self, field: &HeightField<'_>) -> Result<(Vec<f64>, Vec<Direction>), Error> {
        Ok(match self {
            Self::Lattice(count) => {
                let Lattice { steps, azimuths } = Lattice::new(field, count)?;
                (azimuths, steps.into_iter().map(Direction::Step).collect())
            }
            Self::Degrees(azimuths) => {
                let direction = |&azimuth: &f64| Direction::new(field, azimuth);
                let directions = azimuths.iter().map(direction).collect();
                (azimuths, directions)
            }
        })
    }
}

/// Heights of cells, as ``HeightField`` has them: float64 in C order, which nobody changes.
#[pyclass(frozen, name = "_Field", module = "antumbra._core")]
pub struct Field {
    heights: Py<PyArray2<f64>>,
    transform: [f64; 6],
}

impl Field {
    /// Answers a question about the field without the lock of the interpreter. Ctrl-C ends the work, and progress is reported.
    fn ask<'py, T: Element + Send, X: Send>(
        &self,
        py: Python<'py>,
        (threads, progress): Options<'py>,
        question: impl FnOnce(&HeightField<'_>, &Signals) -> Result<(Vec<T>, X), Error> + Send,
    ) -> Answer<'py, T, X> {
        let array = self.heights.bind(py).try_readonly().map_err(wrong)?;
        let heights = array.as_slice().map_err(wrong)?;
        let size = [array.shape()[1], array.shape()[0]];
        let done = Call::new(py, threads, progress)?.watch(|signals| {
            let field = HeightField::new(size, heights, self.transform)?;
            question(&field, signals)
        })?;
        let (values, known) = done.map_err(failed)?;
        Ok((PyArray1::from_vec(py, values), known))
    }
}

/// Observers, the number of those below the surface, and what counts as seen.
fn observers(
    field: &HeightField<'_>,
    &(ref points, eye, [target, drop, range]): &Sight,
) -> Result<(Vec<Observer>, usize, Limits), Error> {
    let observer = |(index, &point): (usize, &[f64; 3])| {
        let found = field.observer(point).ok_or(Error::OffSurface { index });
        found.map(|own| own.raised(eye))
    };
    let eyes: Result<Vec<_>, Error> = points.iter().enumerate().map(observer).collect();
    let eyes = eyes?;
    let buried = eyes.iter().filter(|eye| field.buries(eye)).count();
    let limits = Limits {
        target,
        drop,
        range,
    };
    Ok((eyes, buried, limits))
}

/// So many planes of answers of cells. `bits` has one plane in rows of so many, each of which begins with a new word.
fn planes(
    field: &HeightField<'_>,
    signals: &Signals,
    (count, row): (usize, usize),
    bits: impl Fn(usize) -> Result<Vec<u64>, antumbra_terrain::Error> + Sync,
) -> Result<Vec<bool>, Error> {
    let (cells, progress) = (field.heights().len(), Progress::new(signals, count));
    let mut answers = memory::filled("answers", count.saturating_mul(cells), false)?;
    let planes = answers.par_chunks_exact_mut(cells).enumerate();
    planes.try_for_each(|(index, own)| {
        if signals.is_stopped() {
            return Err(Error::Cancelled);
        }
        let words = bits(index)?;
        let rows = own.chunks_exact_mut(row);
        for (own, words) in rows.zip(words.chunks_exact(row.div_ceil(64))) {
            ones(words).for_each(|bit| own[bit] = true);
        }
        progress.add(1);
        Ok(())
    })?;
    Ok(answers)
}

#[pymethods]
impl Field {
    #[new]
    fn new(
        py: Python<'_>,
        heights: Bound<'_, PyArray2<f64>>,
        transform: [f64; 6],
    ) -> PyResult<Self> {
        let heights = heights.unbind();
        let field = Self { heights, transform };
        field.ask(py, (None, None), |_, _| Ok((vec![0.0], ())))?;
        Ok(field)
    }

    /// Azimuths, and angles of all cells in each.
    fn horizons<'py>(
        &self,
        py: Python<'py>,
        azimuths: Azimuths,
        rise: f64,
        drop: f64,
        options: Options<'py>,
    ) -> Answer<'py, f32, Vec<f64>> {
        self.ask(py, options, |field, signals| {
            let (azimuths, directions) = azimuths.of(field)?;
            let (parts, cells) = (directions.len(), field.heights().len());
            let mut angles = memory::room("angles", parts.saturating_mul(cells))?;
            let job = FieldHorizonJob::new(field, &directions, rise, drop)?;
            for index in 0..parts {
                angles.extend(job.plane(index, &Share(signals, [index, parts]))?);
            }
            Ok((angles, azimuths))
        })
    }

    /// A measure of the sky, by its number among all, and mean and greatest difference from coarser azimuths.
    fn sky<'py>(
        &self,
        py: Python<'py>,
        measure: usize,
        azimuths: Azimuths,
        rise: f64,
        options: Options<'py>,
    ) -> Answer<'py, f32, Option<[f64; 2]>> {
        let all = [SkyMeasure::View, SkyMeasure::Open, SkyMeasure::Openness];
        self.ask(py, options, |field, signals| {
            let (_, directions) = azimuths.of(field)?;
            let job = FieldHorizonJob::new(field, &directions, rise, 0.0)?;
            let found = job.sky(all[measure % 3], signals)?;
            Ok((found.values, found.quadrature_error))
        })
    }

    /// Whether cells see lights at these azimuths and elevations.
    fn lit<'py>(
        &self,
        py: Python<'py>,
        lights: Vec<(f64, f64)>,
        rise: f64,
        options: Options<'py>,
    ) -> Answer<'py, bool, ()> {
        self.ask(py, options, |field, signals| {
            let shadows = Shadows::new(field, rise)?;
            let lit = planes(field, signals, (lights.len(), field.size()[0]), |index| {
                let (azimuth, elevation) = lights[index];
                shadows.lit(azimuth, slope(elevation))
            })?;
            Ok((lit, ()))
        })
    }

    /// Hours of direct sun, of suns at azimuths from true north and elevations.
    fn sun_hours<'py>(
        &self,
        py: Python<'py>,
        suns: Vec<(f64, f64)>,
        hours: Vec<f64>,
        place: (f64, f64),
        options: Options<'py>,
    ) -> Answer<'py, f64, ()> {
        self.ask(py, options, |field, signals| {
            let sky = SkyPatches {
                centres: Vec::new(),
                solid_angles: Vec::new(),
            };
            let orientation = Orientation::new(UpAxis::Z, place.1)?;
            let mut sunlight = Sunlight::new(&Place::default(), vec![], false, sky, orientation)?;
            let position = |(azimuth, elevation)| SunPosition { azimuth, elevation };
            sunlight.suns = Suns {
                direct: vec![0.0; suns.len()],
                positions: suns.into_iter().map(position).collect(),
                hours,
                ..Suns::default()
            };
            let job = FieldSunJob::new(field, &sunlight, place, false)?;
            let mut found = job.whole(false, signals)?.values.hours.into_iter();
            let mut hours = memory::room("hours", field.heights().len())?;
            hours.extend_from_slice(field.heights());
            let known = hours
                .iter_mut()
                .filter(|height: &&mut f64| height.is_finite());
            known.for_each(|hours| *hours = found.next().unwrap_or(f64::NAN));
            Ok((hours, ()))
        })
    }

    /// Whether observers see the cells, and how many are below the surface.
    fn viewshed<'py>(
        &self,
        py: Python<'py>,
        sight: Sight,
        options: Options<'py>,
    ) -> Answer<'py, bool, usize> {
        self.ask(py, options, |field, signals| {
            let (eyes, buried, limits) = observers(field, &sight)?;
            let (viewer, cells) = (Viewer::new(field)?, field.heights().len());
            let sees = |index: usize| viewer.sees(&eyes[index], &limits);
            Ok((planes(field, signals, (eyes.len(), cells), sees)?, buried))
        })
    }

    /// Heights above ground from which observers see the cells, and how many are below the surface.
    fn target_heights<'py>(
        &self,
        py: Python<'py>,
        sight: Sight,
        options: Options<'py>,
    ) -> Answer<'py, f32, usize> {
        self.ask(py, options, |field, signals| {
            let (eyes, buried, limits) = observers(field, &sight)?;
            let heights = Viewer::new(field)?.target_heights(&eyes, &limits, signals)?;
            Ok((heights, buried))
        })
    }
}
