//! Pictures: rendered ones, and arrays to be saved.

use std::path::PathBuf;

use antumbra_image::heatmap::{self, Range};
use antumbra_image::{Image, Rgb8Image, Window};
use antumbra_load::{Options as LoadOptions, load, set_resolution};
use antumbra_render::{Monitor, Options, Phase, World};
use numpy::{PyArray3, PyArrayDyn, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arrays::broadcast::Operand;
use crate::arrays::{Numbers, memory, shaped, wrong_shape};
use crate::call::Call;
use crate::call::threads::ThreadCount;
use crate::call::watch::Signals;
use crate::errors::wrong;
use crate::scene::file::{unreadable, warn};

/// Name of what a picture holds, where there is no memory for it.
const PIXELS: &str = "numbers of pixels";

/// A picture: an array, with a method that saves it. Notebooks show it, and ``np.asarray(picture)`` are its pixels.
///
/// Parameters
/// ----------
/// pixels : array (height, width, 3) or (height, width)
///     Linear light as real numbers, or what a display shows as uint8. The top row comes first.
///
/// Raises
/// ------
/// ValueError
///     An argument is outside its range, or has another shape.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> import numpy as np
/// >>> am.Picture(np.zeros((2, 3)))
/// <antumbra.Picture: 3 x 2, float32>
#[pyclass(frozen, weakref, module = "antumbra")]
pub struct Picture {
    /// Pixels of shape (height, width, 3): float32, linear, or uint8.
    #[pyo3(get)]
    pixels: Py<PyAny>,
    /// Further layers by name: ``standard_error``, of pictures rendered with ``standard_error=True``.
    #[pyo3(get)]
    aov: Py<PyDict>,
}

#[pymethods]
impl Picture {
    #[new]
    fn new(py: Python<'_>, pixels: &Bound<'_, PyAny>) -> PyResult<Self> {
        let numpy = py.import("numpy")?;
        let array = numpy.call_method1("asarray", (pixels,))?;
        let array = match array.getattr("ndim")?.extract::<usize>()? {
            2 => {
                let grey = array.get_item((
                    pyo3::types::PySlice::full(py),
                    pyo3::types::PySlice::full(py),
                    py.None(),
                ))?;
                numpy.call_method1("repeat", (grey, 3, 2))?
            }
            _ => array,
        };
        let pixels = if array.cast::<PyArray3<u8>>().is_ok() {
            numpy.call_method1("ascontiguousarray", (array,))?
        } else {
            let numbers = Numbers::read(&array, "pixels", 3)?;
            if numbers.shape().len() != 3 {
                let wanted = "(height, width, 3) or (height, width)";
                return Err(wrong_shape("pixels", numbers.shape(), wanted));
            }
            let operand = Operand::new(&numbers, 3, numbers.lead(3));
            let count: usize = numbers.lead(3).iter().product();
            let pixel = |place| operand.vector(place).map(|x| x as f32);
            let values = (0..count).flat_map(pixel);
            let values = memory::collected(values, 3 * count, PIXELS)?;
            shaped(py, values, numbers.shape())?.into_any()
        };
        Ok(Self {
            pixels: pixels.unbind(),
            aov: PyDict::new(py).unbind(),
        })
    }

    /// Writes the picture to a file. A file that exists is replaced when the new one is complete.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///     .png, and for linear light .exr as well.
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
    /// >>> path = os.path.join(tempfile.mkdtemp(), "map.png")
    /// >>> am.heat_map([[0, 1], [2, 3]]).save(path)
    /// >>> os.path.getsize(path) > 100
    /// True
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let is_png = path
            .extension()
            .is_some_and(|name| name.eq_ignore_ascii_case("png"));
        let written = match Drawn::read(self.pixels.bind(py))? {
            Drawn::Bytes(_) if !is_png => {
                let path = path.display();
                let text = format!("{path}: pixels of uint8 are written as .png");
                return Err(PyValueError::new_err(text));
            }
            Drawn::Bytes(image) => py.detach(|| image.write(&path)),
            Drawn::Light(image) => py.detach(|| image.write(&path)),
        };
        written.map_err(|error| match error {
            antumbra_image::Error::Write { .. } => PyOSError::new_err(error.to_string()),
            _ => wrong(error),
        })
    }

    /// The pixels as an array, for ``np.asarray``: without a copy unless one is wanted.
    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<&Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let pixels = self.pixels.bind(py);
        let options = PyDict::new(py);
        // Older versions of numpy have no rule for "a copy if it is needed" here.
        let same = match dtype {
            None => true,
            Some(dtype) => pixels.getattr("dtype")?.eq(dtype)?,
        };
        if copy == Some(false) && !same {
            return Err(PyValueError::new_err(
                "copy: found False, but another dtype needs a copy; wanted True or None",
            ));
        }
        options.set_item("copy", copy == Some(true))?;
        let dtype = match dtype {
            Some(dtype) => dtype.clone(),
            None => pixels.getattr("dtype")?,
        };
        pixels.call_method("astype", (dtype,), Some(&options))
    }

    /// The picture as PNG, for notebooks: linear light as ``save`` writes it.
    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let made = match Drawn::read(self.pixels.bind(py))? {
            Drawn::Bytes(image) => py.detach(|| image.to_png()),
            Drawn::Light(image) => py.detach(|| image.to_srgb8().to_png()),
        };
        Ok(PyBytes::new(py, &made.map_err(wrong)?))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let pixels = self.pixels.bind(py);
        let shape: (usize, usize, usize) = pixels.getattr("shape")?.extract()?;
        let dtype = pixels.getattr("dtype")?;
        Ok(format!(
            "<antumbra.Picture: {} x {}, {dtype}>",
            shape.1, shape.0
        ))
    }
}

/// A picture as it is written.
enum Drawn {
    Bytes(Rgb8Image),
    Light(Image),
}

impl Drawn {
    fn read(pixels: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(array) = pixels.extract::<PyReadonlyArray3<'_, u8>>() {
            let rows = array.as_slice()?.as_chunks().0.to_vec();
            let image = Rgb8Image::new(array.shape()[1], array.shape()[0], rows);
            return image.map(Self::Bytes).map_err(wrong);
        }
        let array = pixels.extract::<PyReadonlyArray3<'_, f32>>()?;
        let (height, width) = (array.shape()[0], array.shape()[1]);
        let rows = array.as_slice()?.as_chunks().0.to_vec();
        let image = Image::new(width, height, Window::full(width, height), rows);
        image.map(Self::Light).map_err(wrong)
    }
}

/// A picture of numbers in the colours of viridis, from violet through green to yellow. NaN is grey.
///
/// Parameters
/// ----------
/// values : array (height, width)
///     The top row comes first.
/// low, high : float, optional
///     Numbers at the ends of the colours: 0 and the largest number.
/// legend : bool
///     Whether a bar with numbers is below.
///
/// Returns
/// -------
/// Picture
///
/// Raises
/// ------
/// ValueError
///     An argument is outside its range, or has another shape.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> am.heat_map([[0, 1, 2], [2, 3, 4]], legend=False)
/// <antumbra.Picture: 3 x 2, uint8>
#[pyfunction]
#[pyo3(signature = (values, low=None, high=None, *, legend=true))]
pub fn heat_map(
    py: Python<'_>,
    values: &Bound<'_, PyAny>,
    low: Option<f32>,
    high: Option<f32>,
    legend: bool,
) -> PyResult<Picture> {
    let (field, height, width) = Numbers::read(values, "values", 1)?.grid(PIXELS)?;
    // The picture and a copy of it.
    memory::check(field.len(), 2 * size_of::<[u8; 3]>(), PIXELS)?;
    let (min, max) = heatmap::shared_range(&[&field], Range::Max).map_err(wrong)?;
    let range = Range::Fixed {
        min: low.unwrap_or(min),
        max: high.unwrap_or(max),
    };
    let options = heatmap::Options { range, legend };
    let drawn = heatmap::render(&field, width, height, &options).map_err(wrong)?;
    let shape = [drawn.height(), drawn.width(), 3];
    Ok(Picture {
        pixels: shaped(py, drawn.pixels().as_flattened().to_vec(), &shape)?
            .into_any()
            .unbind(),
        aov: PyDict::new(py).unbind(),
    })
}

impl Monitor for Signals {
    fn progress(&self, phase: Phase, done: u64, total: u64) {
        if phase == Phase::Render {
            self.reached(done, total);
        }
    }

    fn cancelled(&self) -> bool {
        self.is_stopped()
    }
}

/// Renders a scene file, as the program does.
///
/// Parameters
/// ----------
/// path : path
///     .pbrt, .ply, .obj, .gltf, .glb, or ``builtin:NAME``.
/// spp : int, optional
///     Samples per pixel; the scene's own number.
/// size : (width, height), optional
///     Size of the picture in pixels.
/// seed : int
///     Seed of all random numbers. Only scene, samples and seed decide the picture.
/// standard_error : bool
///     Whether ``aov["standard_error"]`` has the standard error of each pixel.
/// threads : int, optional
///     Number of threads; see ``set_threads``.
/// progress : optional
///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
///
/// Returns
/// -------
/// Picture
///     Linear light.
///
/// Raises
/// ------
/// FileNotFoundError
///     There is no such file.
/// ValueError
///     There are mistakes in it, or an argument is outside its range.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> am.render("builtin:city:2000", size=(8, 6), spp=1)
/// <antumbra.Picture: 8 x 6, float32>
#[pyfunction]
#[pyo3(signature = (path, *, spp=None, size=None, seed=0, standard_error=false, threads=None, progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn render<'py>(
    py: Python<'py>,
    path: PathBuf,
    spp: Option<u32>,
    size: Option<(u32, u32)>,
    seed: u64,
    standard_error: bool,
    threads: Option<ThreadCount>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Picture> {
    let mut call = Call::new(py, threads, progress)?;
    let options = Options {
        spp,
        seed,
        standard_error,
        ..Options::default()
    };
    let made = call.watch(|signals| {
        let loaded = load(&path, &LoadOptions::default());
        let loaded = loaded.map_err(|error| unreadable(&path, &error))?;
        let (mut scene, warnings) = (loaded.scene, loaded.warnings);
        if let Some((width, height)) = size {
            set_resolution(&mut scene, [width, height]).map_err(wrong)?;
        }
        let world = World::new(&scene).map_err(wrong)?;
        let rendering = antumbra_render::render(&world, &options, signals);
        rendering.map(|done| (done, warnings)).map_err(wrong)
    })?;
    let (rendering, warnings) = made?;
    warn(py, &warnings)?;
    let layers = PyDict::new(py);
    if let Some(error) = rendering.standard_error {
        layers.set_item("standard_error", pixels(py, error)?)?;
    }
    Ok(Picture {
        pixels: pixels(py, rendering.image)?.into_any().unbind(),
        aov: layers.unbind(),
    })
}

/// Pixels of the part of a picture that there is.
fn pixels(py: Python<'_>, image: Image) -> PyResult<Bound<'_, PyArrayDyn<f32>>> {
    let window = image.window();
    let shape = [window.height(), window.width(), 3];
    shaped(py, image.into_pixels().into_flattened(), &shape)
}
