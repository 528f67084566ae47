//! Maps of values on a grid: the drawing of the commands, and one by matplotlib.

use std::path::PathBuf;

use antumbra_map::{Drawing, Error, Map as Sheet, Relief, Steps, Theme};
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arrays::{Numbers, memory, shaped, wrong_shape};
use crate::errors::wrong;

/// Name of what a map holds, where there is no memory for it.
const CELLS: &str = "numbers of cells";

/// A map of values on a grid, with title, legend, scale bar and north arrow: what ``antumbra sun`` draws. Notebooks show it.
///
/// Parameters
/// ----------
/// values : array (height, width)
///     The top row comes first and is in the north. NaN is no value.
/// cell : float
///     Edge of a cell, in the unit of the model.
/// title, subtitle, source : str
///     Words above and below the map.
/// quantity, unit : str
///     Name and unit of the values, above the legend.
/// range : (low, high), optional
///     Ends of the colours; round numbers around the values. Triangles mark values beyond them.
/// metres : float, optional
///     Metres in a unit of the model, for the scale bar. None counts units.
/// north : float
///     Degrees from the top of the map to true north, clockwise.
/// heights : array, optional
///     Heights of the surface over the same area, in the unit of the model, as a relief beneath the values. May have more rows
///     and columns than the values, in the same proportion. NaN is no surface.
/// size : (width, height), optional
///     Size in pixels, of which files other than PNG have 96 to the inch; by the shape of the grid.
/// dark : bool
///     Whether text is light on a dark ground.
///
/// Raises
/// ------
/// ValueError
///     An argument is outside its range, or has another shape.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> hours = [[1.5, 4.0], [8.0, 7.5]]
/// >>> am.Map(hours, 10.0, title="Courtyard", quantity="Direct sun", unit="h", size=(640, 480))
/// <antumbra.Map: 2 x 2 cells, 640 x 480 pixels>
#[pyclass(frozen, weakref, module = "antumbra")]
pub struct Map {
    values: Vec<f32>,
    width: usize,
    height: usize,
    cell: f64,
    words: Words,
    steps: Steps,
    metres: Option<f64>,
    size: [u32; 2],
    drawing: Drawing,
}

/// Words of a map.
struct Words {
    title: String,
    subtitle: String,
    quantity: String,
    unit: String,
}

/// Numbers of a grid, its height and its width.
fn grid(array: &Bound<'_, PyAny>, name: &'static str) -> PyResult<(Vec<f32>, usize, usize)> {
    Numbers::read(array, name, 1)?.grid(CELLS)
}

#[pymethods]
impl Map {
    #[new]
    // The written signature shows the default of `metres`, which would be an ellipsis.
    #[pyo3(
        signature = (
            values, cell, *, title="", subtitle="", quantity="", unit="", range=None, metres=Some(1.0), north=0.0,
            heights=None, source="", size=None, dark=false
        ),
        text_signature = "(values, cell, *, title='', subtitle='', quantity='', unit='', range=None, metres=1.0, \
            north=0.0, heights=None, source='', size=None, dark=False)"
    )]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        values: &Bound<'_, PyAny>,
        cell: f64,
        title: &str,
        subtitle: &str,
        quantity: &str,
        unit: &str,
        range: Option<(f64, f64)>,
        metres: Option<f64>,
        north: f64,
        heights: Option<&Bound<'_, PyAny>>,
        source: &str,
        size: Option<(u32, u32)>,
        dark: bool,
    ) -> PyResult<Self> {
        let (values, height, width) = grid(values, "values")?;
        if !north.is_finite() {
            let wanted = "wanted an angle in degrees";
            return Err(PyValueError::new_err(format!(
                "north: found {north}, {wanted}"
            )));
        }
        if metres.is_some_and(|metres| !(metres > 0.0 && metres.is_finite())) {
            return Err(PyValueError::new_err(
                "metres: wanted a length above 0, or None",
            ));
        }
        let surface = heights.map(|heights| grid(heights, "heights"));
        let surface = surface.transpose()?;
        let steps = steps(range, &values)?;
        let relief = surface.map(|(heights, rows, columns)| {
            if rows * width != columns * height {
                let wanted = format!("the proportions of ({height}, {width})");
                return Err(wrong_shape("heights", &[rows, columns], &wanted));
            }
            memory::check(heights.len(), size_of::<[f32; 3]>(), CELLS)?;
            let pixel = cell * width as f64 / columns.max(1) as f64;
            Ok(Relief::of_heights(heights, columns, pixel))
        });
        let relief = relief.transpose()?;
        let sheet = Sheet {
            values: &values,
            width,
            height,
            cell: [cell; 2],
            metres,
            north,
            title,
            subtitle,
            quantity,
            unit,
            steps: steps.clone(),
            source,
            relief: relief.as_ref(),
            symbols: None,
            theme: if dark { Theme::Dark } else { Theme::Light },
        };
        let size = size.map_or_else(|| sheet.usual_size(), |(width, height)| [width, height]);
        let drawing = py.detach(|| sheet.draw(size)).map_err(wrong)?;
        let words = Words {
            title: title.to_owned(),
            subtitle: subtitle.to_owned(),
            quantity: quantity.to_owned(),
            unit: unit.to_owned(),
        };
        drop(sheet);
        Ok(Self {
            values,
            width,
            height,
            cell,
            words,
            steps,
            metres,
            size,
            drawing,
        })
    }

    /// Writes the map to a file.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///     .png, .svg or .pdf. A file that exists is replaced when the new one is complete.
    ///
    /// Raises
    /// ------
    /// OSError
    ///     The file cannot be written.
    /// ValueError
    ///     The format is another one.
    ///
    /// Examples
    /// --------
    /// >>> import os, tempfile
    /// >>> import antumbra as am
    /// >>> path = os.path.join(tempfile.mkdtemp(), "map.pdf")
    /// >>> am.Map([[0, 1], [2, 3]], 1.0, title="Four cells").save(path)
    /// >>> open(path, "rb").read(5)
    /// b'%PDF-'
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        let bytes = match extension.to_ascii_lowercase().as_str() {
            "png" => {
                let picture = py.detach(|| self.drawing.pixels()).map_err(wrong)?;
                return py.detach(|| picture.write(&path)).map_err(unwritten);
            }
            "svg" => self.drawing.svg().map_err(wrong)?.into_bytes(),
            "pdf" => py.detach(|| self.drawing.pdf()).map_err(wrong)?,
            _ => {
                let path = path.display();
                let reason = format!("{path}: maps are written as .png, .svg or .pdf");
                return Err(PyValueError::new_err(reason));
            }
        };
        let write = || antumbra_image::atomic_write(&path, |file| file.write_all(&bytes));
        py.detach(write).map_err(unwritten)
    }

    /// Draws the map by matplotlib, which must be installed.
    ///
    /// Parameters
    /// ----------
    /// ax : matplotlib.axes.Axes, optional
    ///     Where to draw; a new figure.
    ///
    /// Returns
    /// -------
    /// matplotlib.axes.Axes
    ///     Axes in units of the model from the lower left corner, with a colour bar.
    ///
    /// Raises
    /// ------
    /// ImportError
    ///     matplotlib is not installed. ``save`` needs nothing.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> map = am.Map([[0, 1], [2, 3]], 1.0, title="Four cells")
    /// >>> axes = map.plot()  # doctest: +SKIP
    #[pyo3(signature = (ax=None))]
    fn plot<'py>(
        &self,
        py: Python<'py>,
        ax: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let ax = match ax {
            Some(ax) => ax,
            None => {
                let pyplot = py.import("matplotlib.pyplot")?;
                pyplot.call_method0("subplots")?.get_item(1)?
            }
        };
        let shape = [self.height, self.width];
        let values = shaped(py, self.values.clone(), &shape)?;
        let [east, north] = [self.width, self.height].map(|count| count as f64 * self.cell);
        let options = PyDict::new(py);
        options.set_item("cmap", "viridis")?;
        options.set_item("vmin", self.steps.low)?;
        options.set_item("vmax", self.steps.high)?;
        options.set_item("extent", (0.0, east, 0.0, north))?;
        options.set_item("interpolation", "nearest")?;
        let image = ax.call_method("imshow", (values,), Some(&options))?;
        let extend = match self.steps.beyond(&self.values) {
            [true, true] => "both",
            [true, false] => "min",
            [false, true] => "max",
            [false, false] => "neither",
        };
        let options = PyDict::new(py);
        options.set_item("ax", &ax)?;
        options.set_item("extend", extend)?;
        options.set_item("ticks", self.steps.marks.clone())?;
        let words = &self.words;
        options.set_item(
            "label",
            match words.unit.as_str() {
                "" => words.quantity.clone(),
                unit => format!("{} in {unit}", words.quantity),
            },
        )?;
        ax.getattr("figure")?
            .call_method("colorbar", (image,), Some(&options))?;
        let title = [words.title.as_str(), words.subtitle.as_str()].join("\n");
        ax.call_method1("set_title", (title.trim(),))?;
        let unit = if self.metres == Some(1.0) {
            "m"
        } else {
            "units"
        };
        ax.call_method1("set_xlabel", (format!("east in {unit}"),))?;
        ax.call_method1("set_ylabel", (format!("north in {unit}"),))?;
        Ok(ax)
    }

    /// Size in pixels, as width and height.
    #[getter]
    fn size(&self) -> (u32, u32) {
        (self.size[0], self.size[1])
    }

    /// Values at the dark and at the light end of the colours.
    #[getter]
    fn range(&self) -> (f64, f64) {
        (self.steps.low, self.steps.high)
    }

    /// The map as PNG, for notebooks.
    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let picture = py.detach(|| self.drawing.pixels()).map_err(wrong)?;
        Ok(PyBytes::new(py, &picture.to_png().map_err(wrong)?))
    }

    fn __repr__(&self) -> String {
        let [width, height] = self.size;
        format!(
            "<antumbra.Map: {} x {} cells, {width} x {height} pixels>",
            self.width, self.height
        )
    }
}

/// Steps of the colours between the ends that a call gives, or around the values.
fn steps(range: Option<(f64, f64)>, values: &[f32]) -> PyResult<Steps> {
    match range {
        Some((low, high)) if !(low < high && (high - low).is_finite()) => {
            Err(wrong(Error::Range(low, high)))
        }
        Some((low, high)) => Ok(Steps::between(low, high, false)),
        None => Ok(Steps::around(values, false)),
    }
}

fn unwritten(error: antumbra_image::Error) -> PyErr {
    PyOSError::new_err(error.to_string())
}
