//! The class `HitList`: all hits of rays.

use numpy::{PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::{PyIndexError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice};

use super::{Columns, Hits, Source, State};
use crate::arrays::{from_start, memory, shaped};
use crate::errors::wrong;
use crate::html;
use crate::scene::saved::Reduced;

/// All hits of rays, one list after the other: hits of ray ``i`` are at ``splits[i]:splits[i + 1]``, the nearest first.
///
/// The arrays of ``Hits``, with one item for each hit. ``hits[i]`` are the ``Hits`` of ray ``i``, and ``len(hits)`` is the number of rays.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
/// >>> hits = scene.intersect_all([[0.2, 0.2, 0], [2, 2, 0]], [0, 0, 1])
/// >>> [len(of_ray) for of_ray in hits]
/// [1, 0]
#[pyclass(frozen, extends = Hits, module = "antumbra")]
pub struct HitList {
    splits: Py<PyArrayDyn<i64>>,
}

impl HitList {
    pub fn new<'py>(
        py: Python<'py>,
        splits: Vec<i64>,
        columns: Columns,
        source: Source,
    ) -> PyResult<Bound<'py, Self>> {
        let (rays, hits) = (splits.len(), columns.t.len());
        let list = Self {
            splits: shaped(py, splits, &[rays])?.unbind(),
        };
        Bound::new(py, (list, Hits::new(py, columns, &[hits], source)?))
    }
}

#[pymethods]
impl HitList {
    /// Where the hits of each ray begin, and the number of hits at the end: int64 of shape (n + 1,), rays in C order.
    #[getter]
    fn splits<'py>(&self, py: Python<'py>) -> Bound<'py, PyArrayDyn<i64>> {
        self.splits.bind(py).clone()
    }

    /// Ray of each hit: int64.
    #[getter]
    fn ray<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
        let py = slf.py();
        let splits = slf.get().splits.bind(py).try_readonly().map_err(wrong)?;
        let hits = slf.as_super().get().t.bind(py).len();
        let mut rays = memory::room(hits, "rays of hits")?;
        for (ray, ends) in splits.as_slice()?.windows(2).enumerate() {
            rays.extend((ends[0]..ends[1]).map(|_| ray as i64));
        }
        let hits = rays.len();
        shaped(py, rays, &[hits])
    }

    fn __len__(&self, py: Python<'_>) -> usize {
        self.splits.bind(py).len() - 1
    }

    fn __getitem__<'py>(slf: &Bound<'py, Self>, ray: &Bound<'py, PyAny>) -> PyResult<Hits> {
        let py = slf.py();
        let splits = slf.get().splits.bind(py);
        let rays = splits.len() - 1;
        let Ok(index) = ray.extract::<isize>() else {
            let found = ray.get_type().name()?;
            return Err(PyTypeError::new_err(format!(
                "index: found {found}, wanted the number of one ray; arrays such as .t and .ray have all hits"
            )));
        };
        let place = from_start(index, rays)
            .ok_or_else(|| PyIndexError::new_err(format!("ray {index} of hits of {rays} rays")))?;
        let ends: [i64; 2] = [
            splits.get_item(place)?.extract()?,
            splits.get_item(place + 1)?.extract()?,
        ];
        let hits = slf.as_super().get();
        let places = PySlice::new(py, ends[0] as isize, ends[1] as isize, 1);
        hits.of(&hits.chosen(py, &places)?)
    }

    /// A table of all hits, such as ``pandas.DataFrame`` takes: one row for each hit.
    ///
    /// Parameters
    /// ----------
    /// point : bool
    ///     Whether to add ``x``, ``y`` and ``z``.
    /// normal : bool
    ///     Whether to add ``nx``, ``ny`` and ``nz``.
    ///
    /// Returns
    /// -------
    /// dict of str to array (m,)
    ///     ``ray``, ``t``, ``triangle``, ``mesh``, ``instance``, ``u``, ``v``.
    ///
    /// Raises
    /// ------
    /// RuntimeError
    ///     The hits were pickled without the points or normals that are wanted.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> list(scene.intersect_all([[0.2, 0.2, 0]], [0, 0, 1]).to_dict())
    /// ['ray', 't', 'triangle', 'mesh', 'instance', 'u', 'v']
    #[pyo3(signature = (*, point=false, normal=false))]
    fn to_dict<'py>(
        slf: &Bound<'py, Self>,
        point: bool,
        normal: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let py = slf.py();
        let columns = PyDict::new(py);
        columns.set_item("ray", Self::ray(slf)?)?;
        let hits = slf.as_super().get().columns(py, ("t", point, normal))?;
        columns.update(hits.as_mapping())?;
        Ok(columns)
    }

    fn _repr_html_(slf: &Bound<'_, Self>) -> PyResult<String> {
        let py = slf.py();
        let rays = (slf.get().splits.bind(py).len() - 1).to_string();
        let hits = slf.as_super().get().t.bind(py).len().to_string();
        Ok(html::table(
            "antumbra.HitList",
            &[("rays", rays), ("hits", hits)],
        ))
    }

    #[staticmethod]
    #[pyo3(name = "_restore_list")]
    fn restore_list<'py>(
        py: Python<'py>,
        splits: Bound<'py, PyArrayDyn<i64>>,
        state: State<'py>,
    ) -> PyResult<Bound<'py, Self>> {
        let list = Self {
            splits: splits.unbind(),
        };
        Bound::new(py, (list, Hits::restore(state)))
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> Reduced<'py, (Bound<'py, PyArrayDyn<i64>>, State<'py>)> {
        let (py, list) = (slf.py(), slf.get());
        let restore = slf.get_type().getattr("_restore_list")?;
        let state = slf.as_super().get().state(py);
        Ok((restore, (list.splits.bind(py).clone(), state)))
    }

    fn __repr__(slf: &Bound<'_, Self>) -> String {
        let (py, rays) = (slf.py(), slf.get().splits.bind(slf.py()).len() - 1);
        let hits = slf.as_super().get().t.bind(py).len();
        format!("<antumbra.HitList: {hits} hits of {rays} rays>")
    }
}
