//! Rays of a batch as callers store them: one after the other, or in arrays of their own.

use alloc::vec::Vec;

use crate::error::Error;
use crate::ray::Ray;

/// Rays of a batch.
///
/// ```
/// use antumbra::Ray;
/// use antumbra::inputs::Rays;
///
/// let list = vec![Ray::new([0.0; 3], [0.0, 0.0, 1.0]); 3];
/// assert_eq!(Rays::from(&list).len(), 3);
/// ```
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one for a batch, and a box would need memory"
)]
pub enum Rays<'a> {
    /// A slice of rays, one item each.
    List(&'a [Ray]),
    /// One array for each field of a ray: origins, directions and intervals, as numpy and C programs have them.
    Columns(RayColumns<'a>),
}

/// Slices, arrays, vectors and whatever else is a list of rays.
impl<'a, R: AsRef<[Ray]> + ?Sized> From<&'a R> for Rays<'a> {
    fn from(rays: &'a R) -> Self {
        Self::List(rays.as_ref())
    }
}

impl<'a> From<RayColumns<'a>> for Rays<'a> {
    fn from(columns: RayColumns<'a>) -> Self {
        Self::Columns(columns)
    }
}

impl<'a> Rays<'a> {
    /// Number of rays.
    pub fn len(&self) -> usize {
        match self {
            Self::List(rays) => rays.len(),
            Self::Columns(columns) => columns.len,
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Ray `index`, which is one of them.
    pub(crate) fn get(&self, index: usize) -> Ray {
        match self {
            Self::List(rays) => rays[index],
            Self::Columns(columns) => columns.get(index),
        }
    }

    /// Replaces the contents of `rays` by the rays of these indices.
    pub(crate) fn pick(&self, indices: impl Iterator<Item = usize>, rays: &mut Vec<Ray>) {
        rays.clear();
        match self {
            Self::List(list) => rays.extend(indices.map(|index| list[index])),
            Self::Columns(columns) => rays.extend(indices.map(|index| columns.get(index))),
        }
    }
}

/// Numbers in memory that belong to the caller, some for each ray. The numbers of ray `i` begin at
/// `values[i * stride]`.
///
/// | memory | column |
/// |---|---|
/// | `[[f32; 3]]`, `[[f32; 4]]`, `[f32]` | `(&memory[..]).into()` |
/// | the same for all rays, `[f32; 3]` | `(&memory).into()` |
/// | x, y and z in an array each | `Column::of_axes(&x, &y, &z)` |
/// | anything else: x, y, z among other numbers | `Column::new(values, stride)` |
///
/// ```
/// use antumbra::RayColumns;
/// use antumbra::inputs::Column;
///
/// // Positions among other numbers: x, y, z, then two of no interest.
/// let vertices = [0.0, 0.0, 0.0, 9.0, 9.0, 1.0, 0.0, 0.0, 9.0, 9.0];
/// let up = [0.0, 0.0, 1.0];
/// let rays = RayColumns::new(2, Column::new(&vertices, 5), &up)?;
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Column<'a> {
    /// From the first number of each axis on.
    axes: [&'a [f32]; 3],
    stride: usize,
    /// Whether these are arrays of their own.
    is_apart: bool,
}

impl<'a> Column<'a> {
    /// Column whose items lie `stride` numbers apart. Begin the slice where the first item does. Items may overlap; a
    /// stride of 0 gives all rays the same one.
    pub fn new(values: &'a [f32], stride: usize) -> Self {
        let from = |axis| values.get(axis..).unwrap_or_default();
        let axes = [values, from(1), from(2)];
        Self {
            axes,
            stride,
            is_apart: false,
        }
    }

    /// Column of vectors whose coordinates lie in an array each, as in the packets of other kernels.
    ///
    /// ```
    /// use antumbra::RayColumns;
    /// use antumbra::inputs::Column;
    ///
    /// let (x, y, z) = ([0.0, 1.0], [2.0, 3.0], [4.0, 5.0]);
    /// let rays = RayColumns::new(2, Column::of_axes(&x, &y, &z), &[0.0, 0.0, 1.0])?;
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    pub fn of_axes(x: &'a [f32], y: &'a [f32], z: &'a [f32]) -> Self {
        Self {
            axes: [x, y, z],
            stride: 1,
            is_apart: true,
        }
    }

    /// Fails unless there are this many items of this many numbers.
    fn check(&self, what: &'static str, items: usize, numbers: usize) -> Result<(), Error> {
        let Some(last) = items.checked_sub(1) else {
            return Ok(());
        };
        let [x, y, z] = self.axes.map(<[f32]>::len);
        let (numbers, found) = match self.is_apart {
            true => (1, x.min(y).min(z)),
            false => (numbers, x),
        };
        let needed = last.saturating_mul(self.stride).saturating_add(numbers);
        match needed <= found {
            true => Ok(()),
            false => Err(Error::TooShort {
                what,
                needed,
                found,
            }),
        }
    }

    #[inline(always)]
    fn vector(&self, index: usize) -> [f32; 3] {
        let at = index * self.stride;
        let [x, y, z] = self.axes;
        [x[at], y[at], z[at]]
    }
}

impl<'a> From<&'a [[f32; 3]]> for Column<'a> {
    fn from(vectors: &'a [[f32; 3]]) -> Self {
        Self::new(vectors.as_flattened(), 3)
    }
}

impl<'a> From<&'a Vec<[f32; 3]>> for Column<'a> {
    fn from(vectors: &'a Vec<[f32; 3]>) -> Self {
        vectors.as_slice().into()
    }
}

impl<'a> From<&'a [[f32; 4]]> for Column<'a> {
    fn from(vectors: &'a [[f32; 4]]) -> Self {
        Self::new(vectors.as_flattened(), 4)
    }
}

impl<'a> From<&'a [f32; 3]> for Column<'a> {
    fn from(vector: &'a [f32; 3]) -> Self {
        Self::new(vector, 0)
    }
}

impl<'a> From<&'a [f32]> for Column<'a> {
    fn from(numbers: &'a [f32]) -> Self {
        Self::new(numbers, 1)
    }
}

/// Distances of a batch: an end of the intervals of rays, or how far away from points something may be.
///
/// ```
/// use antumbra::RayColumns;
///
/// let (origins, up) = ([[0.0; 3], [1.0, 0.0, 0.0]], [0.0, 0.0, 1.0]);
/// let same = RayColumns::new(2, &origins[..], &up)?.far(10.0)?;
/// let each = RayColumns::new(2, &origins[..], &up)?.far(&[10.0, 20.0][..])?;
/// assert!(RayColumns::new(2, &origins[..], &up)?.far(&[10.0][..]).is_err());
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Distance<'a> {
    /// One value for every ray or point.
    Same(f32),
    /// A value of its own for each ray or point.
    Each(Column<'a>),
}

impl From<f32> for Distance<'_> {
    fn from(distance: f32) -> Self {
        Self::Same(distance)
    }
}

/// Slices, arrays, vectors and whatever else is a list of numbers.
impl<'a, N: AsRef<[f32]> + ?Sized> From<&'a N> for Distance<'a> {
    fn from(distances: &'a N) -> Self {
        Self::Each(distances.as_ref().into())
    }
}

impl<'a> From<Column<'a>> for Distance<'a> {
    fn from(column: Column<'a>) -> Self {
        Self::Each(column)
    }
}

impl Distance<'_> {
    pub(crate) fn check(&self, what: &'static str, rays: usize) -> Result<(), Error> {
        match self {
            Self::Same(_) => Ok(()),
            Self::Each(column) => column.check(what, rays, 1),
        }
    }

    #[inline(always)]
    pub(crate) fn get(&self, index: usize) -> f32 {
        match self {
            Self::Same(distance) => *distance,
            Self::Each(column) => column.axes[0][index * column.stride],
        }
    }
}

/// Rays in separate arrays, read where they are. The fields are the fields of [`Ray`].
///
/// The arrays are brought together a few thousand rays at a time, in memory that stays in the cache.
///
/// ```
/// use antumbra::{Bvh, Geometry, RayColumns, Recipe};
///
/// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// let bvh = Bvh::build(&geometry, &Recipe::default())?;
///
/// let origins = [[0.2, 0.2, 0.0], [0.9, 0.9, 0.0]];
/// let up = [0.0, 0.0, 1.0];
/// let rays = RayColumns::new(2, &origins[..], &up)?.far(2.0)?;
/// let mut occluded = [false; 2];
/// bvh.batch(rays).occluded_into(&mut occluded);
/// assert_eq!(occluded, [true, false]);
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct RayColumns<'a> {
    len: usize,
    origins: Column<'a>,
    directions: Column<'a>,
    near: Distance<'a>,
    far: Distance<'a>,
}

impl<'a> RayColumns<'a> {
    /// A list of `len` rays over the interval (0, ∞).
    ///
    /// # Errors
    /// [`Error::TooShort`] if a column has too few numbers.
    pub fn new(
        len: usize,
        origins: impl Into<Column<'a>>,
        directions: impl Into<Column<'a>>,
    ) -> Result<Self, Error> {
        let (origins, directions) = (origins.into(), directions.into());
        origins.check("origins", len, 3)?;
        directions.check("directions", len, 3)?;
        Ok(Self {
            len,
            origins,
            directions,
            near: Distance::Same(0.0),
            far: Distance::Same(f32::INFINITY),
        })
    }

    /// The rays with other lower ends of their intervals: one number, or one for each ray.
    ///
    /// # Errors
    /// [`Error::TooShort`] if there are too few numbers.
    pub fn near(self, near: impl Into<Distance<'a>>) -> Result<Self, Error> {
        let near = near.into();
        near.check("near ends", self.len)?;
        Ok(Self { near, ..self })
    }

    /// The rays with other upper ends of their intervals: one number, or one for each ray.
    ///
    /// # Errors
    /// [`Error::TooShort`] if there are too few numbers.
    pub fn far(self, far: impl Into<Distance<'a>>) -> Result<Self, Error> {
        let far = far.into();
        far.check("far ends", self.len)?;
        Ok(Self { far, ..self })
    }

    #[inline(always)]
    pub(crate) fn get(&self, index: usize) -> Ray {
        Ray {
            org: self.origins.vector(index),
            tnear: self.near.get(index),
            dir: self.directions.vector(index),
            tfar: self.far.get(index),
        }
    }
}
