//! Instances: objects placed in the world by affine transforms, any number of times.

use alloc::vec;
use alloc::vec::Vec;

use crate::aabb::Aabb;
use crate::error::Error;
use crate::geometry::primitives::Primitives;
use crate::math;
use crate::words::{Sink, Words};

/// One placement of an object; its place in the list given to the builder is the `inst_id`.
///
/// An instance holds an object, and an object holds geometries. [`NestedInstances`](crate::NestedInstances) makes instances of
/// objects that hold instances.
///
/// ```
/// use antumbra::{Bvh, Geometry, Instance, Primitives, Ray, Recipe};
///
/// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let leaf = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// let mirrored = Instance::new(0, [[-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
/// let bvh = Bvh::build(&Primitives::with_instances(&[], &[leaf], &[mirrored])?, &Recipe::default())?;
/// assert!(bvh.occluded(&Ray::new([-0.2, 0.2, 0.0], [0.0, 0.0, 1.0])));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Instance {
    /// Index of the object in the list of objects. An index out of range is an error at build.
    pub object: u32,
    /// From the object to the world: the three rows of an affine 3 x 4 matrix, translation last. Anything
    /// that can be inverted: rotations, mirrors, shears, scales that differ by axis. An instance is dropped if
    /// its transform has a NaN or infinite number, has no inverse, or brings the object or its inverse out of
    /// the range of `f32`.
    pub transform: [[f32; 4]; 3],
    /// Transforms at later keys, where the instance moves while rays are traced: see [`Instance::moving`].
    pub moves_to: Vec<[[f32; 4]; 3]>,
}

impl Instance {
    /// Places an object, named by its index in the list of objects, by an affine transform from the object to the world.
    #[must_use]
    pub const fn new(object: u32, transform: [[f32; 4]; 3]) -> Self {
        Self {
            object,
            transform,
            moves_to: Vec::new(),
        }
    }

    /// [`Instance::new`] of a matrix by columns, translation last, as `Affine3A::to_cols_array_2d` of glam returns it.
    ///
    /// ```
    /// use antumbra::Instance;
    ///
    /// let moved = Instance::from_columns(0, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [5.0, 6.0, 7.0]]);
    /// assert_eq!(moved.transform, [[1.0, 0.0, 0.0, 5.0], [0.0, 1.0, 0.0, 6.0], [0.0, 0.0, 1.0, 7.0]]);
    /// ```
    #[must_use]
    pub fn from_columns(object: u32, columns: [[f32; 3]; 4]) -> Self {
        let row = |row: usize| columns.map(|column| column[row]);
        Self::new(object, [row(0), row(1), row(2)])
    }
}

/// An affine map in double precision.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Affine {
    pub rows: [[f64; 4]; 3],
}

impl Affine {
    #[inline(always)]
    pub fn new(rows: &[[f32; 4]; 3]) -> Self {
        let mut affine = Self {
            rows: [[0.0; 4]; 3],
        };
        for (row, numbers) in affine.rows.iter_mut().enumerate() {
            for (i, number) in numbers.iter_mut().enumerate() {
                *number = f64::from(rows[row][i]);
            }
        }
        affine
    }

    /// The linear part applied to a vector.
    pub fn vector(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        self.rows.map(|[a, b, c, _]| a * x + b * y + c * z)
    }

    /// The map applied to a point.
    pub fn point(&self, point: [f64; 3]) -> [f64; 3] {
        let moved = self.vector(point);
        core::array::from_fn(|axis| moved[axis] + self.rows[axis][3])
    }

    /// The matrix that takes normals along (the transposed inverse times the determinant): its rows are the
    /// cross products of the rows of the linear part.
    pub fn cofactors(&self) -> [[f64; 3]; 3] {
        let [p, q, r] = self.rows.map(|[a, b, c, _]| [a, b, c]);
        [cross(q, r), cross(r, p), cross(p, q)]
    }

    /// Product of two maps: `first`, then this one.
    pub fn times(&self, first: &Self) -> Self {
        let columns = [0, 1, 2].map(|column| self.vector(first.rows.map(|row| row[column])));
        let moved = self.point(first.rows.map(|row| row[3]));
        Self {
            rows: [0, 1, 2].map(|row| {
                let [x, y, z] = columns.map(|column| column[row]);
                [x, y, z, moved[row]]
            }),
        }
    }

    /// The columns in single precision, as [`Placement::object_from_world`] has them.
    #[inline(always)]
    pub fn columns(&self) -> [[f32; 4]; 4] {
        let mut columns = [[0.0; 4]; 4];
        for (row, numbers) in self.rows.iter().enumerate() {
            for (column, number) in numbers.iter().enumerate() {
                columns[column][row] = *number as f32;
            }
        }
        columns
    }

    /// The inverse; `None` unless there is one, as far as double precision can distinguish.
    // Computed for each ray that enters a moving instance.
    #[inline(always)]
    pub fn inverse(&self) -> Option<Self> {
        /// Well above the rounding of a determinant relative to the product of the lengths of the rows.
        const SINGULAR: f64 = 1e-14;
        let [[a, b, c, x], [d, e, f, y], [g, h, i, z]] = self.rows;
        let (p, q, r) = ([a, b, c], [d, e, f], [g, h, i]);
        let cofactors = [cross(q, r), cross(r, p), cross(p, q)];
        let det = dot(p, cofactors[0]);
        let scale = math::sqrt(dot(p, p)) * math::sqrt(dot(q, q)) * math::sqrt(dot(r, r));
        // Also when something is NaN.
        if !(det.abs() > SINGULAR * scale) {
            return None;
        }
        let mut rows = [[0.0; 4]; 3];
        for (row, numbers) in rows.iter_mut().enumerate() {
            for column in 0..3 {
                numbers[column] = cofactors[column][row] / det;
            }
            numbers[3] = -(numbers[0] * x + numbers[1] * y + numbers[2] * z);
        }
        Some(Self { rows })
    }
}

#[inline(always)]
pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// The part of a placement that tracing needs, apart from the object.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placement {
    /// The columns of the map from the world to the object, translation last. The fourth components have no
    /// meaning.
    pub object_from_world: [[f32; 4]; 4],
    /// Scene extent of the object: its largest absolute coordinate.
    pub reach: f32,
    /// The smallest and the largest coordinates of the box around the object in the world; the fourth have no
    /// meaning.
    pub planes: [[f32; 4]; 2],
    pub inst_id: u32,
}

impl Placement {
    /// Places an object of this shape; `None` if the instance is to be dropped, see [`Instance`].
    pub fn new(transform: &[[f32; 4]; 3], shape: &ObjectShape, inst_id: u32) -> Option<Self> {
        let world_from_object = Affine::new(transform);
        let inverse = world_from_object.inverse()?;
        let bounds = shape.placed(&world_from_object, &inverse);
        let placement = Self {
            object_from_world: inverse.columns(),
            reach: shape.reach,
            planes: [bounds.min, bounds.max].map(|[x, y, z]| [x, y, z, 0.0]),
            inst_id,
        };
        let planes = placement.planes.as_flattened().iter();
        let numbers = placement.object_from_world.as_flattened().iter();
        let finite = planes.chain(numbers).all(|x| x.is_finite());
        (finite && !bounds.is_empty()).then_some(placement)
    }

    /// The box around the object in the world.
    pub fn bounds(&self) -> Aabb {
        let [min, max] = self.planes.map(|[x, y, z, _]| [x, y, z]);
        Aabb { min, max }
    }
}

/// An object among the primitives, placed in the world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlacedObject {
    pub placement: Placement,
    /// Index of the object in [`Primitives::objects`].
    pub object: u32,
    /// The transform as the user gave it, to place points of surfaces.
    pub world_from_object: [[f32; 4]; 3],
}

/// Where the primitives of an object are: boxes around groups of them. Turned, they fill less than one turned
/// box around them all does.
///
/// A function of the primitives only: what is around an instance decides what it is hit by, and that must not depend on
/// any tree.
#[derive(Clone, Debug)]
pub(crate) struct ObjectShape {
    boxes: Vec<Aabb>,
    /// The smallest and the largest coordinates of all boxes.
    sides: [Points; 2],
    /// Per octant of directions, see [`octant`], the corners of boxes that can be the farthest of all there. Empty until
    /// [`ObjectShape::expect_many`].
    fronts: Vec<Points>,
    reach: f32,
}

/// Groups per axis.
const GROUPS: usize = 8;

/// Points that are looked at together.
const LANES: usize = 8;

/// Coordinates of points per axis, a whole number of [`LANES`] of them: the last point may be repeated to fill it.
type Points = [Vec<f64>; 3];

impl ObjectShape {
    /// Shape of checked primitives, instances aside.
    pub fn new(primitives: &Primitives) -> Self {
        let boxes = (0..primitives.len()).map(|index| primitives.bounds_of(index));
        Self::around(&primitives.bounds(), boxes)
    }

    /// Groups primitives, given by their boxes, by the cells of a grid that their centres are in. `bounds` is the box
    /// around them all. Neither their order nor how often one is given matters.
    pub fn around(bounds: &Aabb, prims: impl Iterator<Item = Aabb>) -> Self {
        let mut boxes = vec![Aabb::EMPTY; GROUPS * GROUPS * GROUPS];
        for own in prims {
            let mut cell = 0;
            for axis in 0..3 {
                let [low, high] = [bounds.min[axis], bounds.max[axis]].map(f64::from);
                let center = 0.5 * (f64::from(own.min[axis]) + f64::from(own.max[axis]));
                let place = (center - low) / (high - low) * GROUPS as f64;
                // NaN, of a flat object, becomes 0.
                cell = cell * GROUPS + (place as usize).min(GROUPS - 1);
            }
            boxes[cell] = boxes[cell].union(&own);
        }
        boxes.retain(|bounds| !bounds.is_empty());
        Self {
            sides: [points(&boxes, 0b111), points(&boxes, 0)],
            fronts: Vec::new(),
            boxes,
            reach: bounds.reach(),
        }
    }

    pub fn write(&self, sink: &mut Sink<'_>) {
        sink.floats([self.reach]);
        sink.word(self.boxes.len() as u32);
        for Aabb { min, max } in &self.boxes {
            sink.floats(*min);
            sink.floats(*max);
        }
    }

    /// A shape as [`ObjectShape::write`] wrote it, for an object of this extent.
    pub fn read(words: &mut Words<'_>, extent: f32) -> Result<Self, Error> {
        let [reach] = words.floats()?;
        let count = words.count()?;
        if count > GROUPS * GROUPS * GROUPS || !(extent <= reach) {
            return Err(words.error("the shape of an object is not its own"));
        }
        let boxes = words.list([], count, |words| {
            let [min, max] = [words.floats()?, words.floats()?];
            Ok(Aabb { min, max })
        })?;
        Ok(Self {
            sides: [points(&boxes, 0b111), points(&boxes, 0)],
            fronts: Vec::new(),
            boxes,
            reach,
        })
    }

    /// Makes many placements cheap. No box around one changes by it: rounding is monotonic, so a corner that has another
    /// one before it on every axis is never the farthest.
    pub fn expect_many(&mut self) {
        if self.fronts.is_empty() {
            let front = |octant| points(&front(&self.boxes, octant), octant);
            self.fronts = (0..8).map(front).collect();
        }
    }

    /// The corners of a box around the object.
    pub fn corners(&self) -> [[f64; 3]; 8] {
        let all = (self.boxes.iter()).fold(Aabb::EMPTY, |all, bounds| all.union(bounds));
        core::array::from_fn(|octant| corner(&all, octant).map(f64::from))
    }

    /// Whether the object has no primitives.
    pub fn is_empty(&self) -> bool {
        self.boxes.is_empty()
    }

    /// Largest absolute coordinate of the object.
    pub fn reach(&self) -> f32 {
        self.reach
    }

    /// How far the boxes reach in a direction.
    fn support(&self, direction: [f64; 3]) -> f64 {
        let octant = octant(direction);
        let of_axis = |axis: usize| match self.fronts.get(octant) {
            Some(front) => &front[axis][..],
            None => &self.sides[usize::from(octant >> axis & 1 == 0)][axis][..],
        };
        let [a, b, c] = direction;
        let [x, y, z] = [of_axis(0), of_axis(1), of_axis(2)].map(|points| points.as_chunks().0);
        let mut farthest = [f64::NEG_INFINITY; LANES];
        for ((x, y), z) in x.iter().zip(y).zip(z) {
            let (x, y, z): (&[f64; LANES], &[f64; LANES], &[f64; LANES]) = (x, y, z);
            for lane in 0..LANES {
                let far = a * x[lane] + b * y[lane] + c * z[lane];
                // NaN is ignored.
                farthest[lane] = if far > farthest[lane] {
                    far
                } else {
                    farthest[lane]
                };
            }
        }
        let [a, b, c, d, e, f, g, h] = farthest;
        let more = |a: f64, b: f64| if a > b { a } else { b };
        more(more(more(a, b), more(c, d)), more(more(e, f), more(g, h)))
    }

    /// The box in the world: around every turned box, and wider by what the rays' way into the object and its
    /// rounding may be off: as much as a few roundings of every product of the two matrices.
    pub fn placed(&self, world_from_object: &Affine, inverse: &Affine) -> Aabb {
        /// Four roundings of `f32`.
        const ROUNDING: f64 = 4.0 / (1u64 << 24) as f64;
        let rows = world_from_object.rows;
        let min = rows.map(|[a, b, c, moved]| moved - self.support([-a, -b, -c]));
        let max = rows.map(|[a, b, c, moved]| moved + self.support([a, b, c]));
        let absolute = |affine: &Affine| Affine {
            rows: affine.rows.map(|row| row.map(f64::abs)),
        };
        let largest = core::array::from_fn(|axis| f64::max(min[axis].abs(), max[axis].abs()));
        let pads = absolute(world_from_object).vector(absolute(inverse).point(largest));
        Aabb {
            min: core::array::from_fn(|axis| (min[axis] - ROUNDING * pads[axis]) as f32)
                .map(f32::next_down),
            max: core::array::from_fn(|axis| (max[axis] + ROUNDING * pads[axis]) as f32)
                .map(f32::next_up),
        }
    }
}

/// The octant of a direction: bit `axis` is set where it points to smaller coordinates.
fn octant(direction: [f64; 3]) -> usize {
    (0..3).fold(0, |octant, axis| {
        octant | usize::from(direction[axis] < 0.0) << axis
    })
}

/// The corner of a box that is farthest in an octant.
fn corner(bounds: &Aabb, octant: usize) -> [f32; 3] {
    core::array::from_fn(|axis| {
        if octant >> axis & 1 == 1 {
            bounds.min[axis]
        } else {
            bounds.max[axis]
        }
    })
}

/// These corners of boxes.
fn points(boxes: &[Aabb], octant: usize) -> Points {
    let last = boxes.len().saturating_sub(1);
    core::array::from_fn(|axis| {
        let places = 0..boxes.len().next_multiple_of(LANES);
        let points = places.map(|place| corner(&boxes[place.min(last)], octant)[axis]);
        points.map(f64::from).collect()
    })
}

/// Boxes whose corner in an octant no other one has before it on every axis.
fn front(boxes: &[Aabb], octant: usize) -> Vec<Aabb> {
    // As if the octant were the one of large coordinates.
    let far = |bounds: &Aabb| {
        let corner = corner(bounds, octant);
        core::array::from_fn::<_, 3, _>(|axis| {
            if octant >> axis & 1 == 1 {
                -corner[axis]
            } else {
                corner[axis]
            }
        })
    };
    let mut sorted: Vec<_> = boxes.iter().map(|bounds| (far(bounds), *bounds)).collect();
    sorted.sort_by(|(a, _), (b, _)| b[0].total_cmp(&a[0]));
    // Whatever comes before another in this list is as far on the first axis.
    let mut kept: Vec<([f32; 3], Aabb)> = Vec::new();
    for (point, bounds) in sorted {
        let is_behind =
            |(other, _): &([f32; 3], Aabb)| point[1] <= other[1] && point[2] <= other[2];
        if !kept.iter().any(is_behind) {
            kept.push((point, bounds));
        }
    }
    kept.into_iter().map(|(_, bounds)| bounds).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Geometry;
    use antumbra_testkit::{Rng, mesh};

    fn random_transform(rng: &mut Rng) -> [[f32; 4]; 3] {
        core::array::from_fn(|_| core::array::from_fn(|_| rng.range(-2.0, 2.0)))
    }

    #[test]
    fn inverses_invert_and_singular_maps_have_none() {
        let mut rng = Rng::new(81);
        for _ in 0..1000 {
            let affine = Affine::new(&random_transform(&mut rng));
            let Some(inverse) = affine.inverse() else {
                continue;
            };
            let point = rng.point(3.0).map(f64::from);
            let back = inverse.point(affine.point(point));
            for axis in 0..3 {
                assert!((back[axis] - point[axis]).abs() < 1e-6, "{affine:?}");
            }
        }
        let nan = f32::NAN;
        for rows in [
            [[0.0; 4]; 3],
            [
                [1.0, 2.0, 3.0, 0.0],
                [4.0, 5.0, 6.0, 0.0],
                [7.0, 8.0, 9.0, 0.0],
            ],
            [
                [1.0, 0.0, 0.0, 0.0],
                [0.0, 1.0, 0.0, 0.0],
                [0.0, 0.0, 0.0, 5.0],
            ],
            [
                [1.0, 0.0, 0.0, 0.0],
                [0.0, nan, 0.0, 0.0],
                [0.0, 0.0, 1.0, 5.0],
            ],
        ] {
            assert!(Affine::new(&rows).inverse().is_none(), "{rows:?}");
        }
    }

    /// The box of an instance holds every transformed corner, and is much smaller than the turned box of the
    /// object where that wastes space.
    #[test]
    fn boxes_hold_the_object_and_are_tight() {
        let seed = 82;
        let mut rng = Rng::new(seed);
        let sphere = mesh::icosphere(3);
        let geometry = [Geometry::triangles(
            &sphere.positions[..],
            &sphere.indices[..],
        )];
        let primitives = Primitives::new(&geometry).expect("indices in range");
        let shape = ObjectShape::new(&primitives);
        for _ in 0..200 {
            let rows = random_transform(&mut rng);
            let Some(placement) = Placement::new(&rows, &shape, 0) else {
                continue;
            };
            let affine = Affine::new(&rows);
            for position in &sphere.positions {
                let point = affine.point(position.map(f64::from)).map(|x| x as f32);
                let point = Aabb::around(&[point]);
                assert!(placement.bounds().contains(&point), "seed {seed} {rows:?}");
            }
        }
        let mut many = shape.clone();
        many.expect_many();
        for _ in 0..200 {
            let rows = random_transform(&mut rng);
            let [one, other] = [&shape, &many].map(|shape| Placement::new(&rows, shape, 0));
            let planes = |placement: Option<Placement>| placement.map(|placed| placed.planes);
            assert_eq!(planes(one), planes(other), "seed {seed} {rows:?}");
        }
        let half = core::f32::consts::FRAC_1_SQRT_2;
        let turned = [
            [half, -half, 0.0, 0.0],
            [half, half, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ];
        let placement = Placement::new(&turned, &shape, 0).expect("a rotation");
        assert!(placement.bounds().max[0] < 1.25, "{:?}", placement.bounds());
    }
}
