//! Curves as callers give them, and the straight segments that stand for them.

use antumbra::LocalOrigin;
use antumbra::shapes::{CurveBasis, Curves};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::arrays::broadcast::{Operand, common_shape};
use crate::arrays::{Numbers, memory, shape_text, wrong_shape};

/// Farthest that a cubic curve may be from its segments, relative to its largest radius: pbrt's.
const TOLERANCE: f32 = 0.1;

/// Segments of curves, as the kernel takes them.
#[derive(Clone, Default)]
pub struct Segments {
    /// Points with radii.
    pub points: Vec<[f32; 4]>,
    /// First point of each segment; the second one is the next point.
    pub firsts: Vec<u32>,
    /// Part of a curve that each segment stands for.
    pub places: Vec<Place>,
}

/// Part of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Number of the curve.
    pub curve: u32,
    /// Parameters at both ends of the segment. Each piece of a curve is 1 long.
    pub along: [f32; 2],
}

impl Segments {
    pub fn geometry(&self) -> Curves<'_> {
        Curves::new(&self.points[..], &self.firsts[..])
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&self.points[..])
            + size_of_val(&self.firsts[..])
            + size_of_val(&self.places[..])
    }
}

impl From<&Curves<'_>> for Segments {
    /// A copy. Each chain of segments is a curve, and each segment a piece of it.
    fn from(curves: &Curves<'_>) -> Self {
        let firsts = curves.segments.to_vec();
        let mut places: Vec<Place> = Vec::with_capacity(firsts.len());
        for (index, &first) in firsts.iter().enumerate() {
            let before = index
                .checked_sub(1)
                .map(|before| (firsts[before], places[before]));
            places.push(match before {
                Some((point, Place { curve, along })) if point.checked_add(1) == Some(first) => {
                    let along = along.map(|end| end + 1.0);
                    Place { curve, along }
                }
                before => Place {
                    curve: before.map_or(0, |(_, place)| place.curve + 1),
                    along: [0.0, 1.0],
                },
            });
        }
        Self {
            points: curves.points.to_vec(),
            firsts,
            places,
        }
    }
}

/// How control points make a curve.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Linear,
    Cubic(CurveBasis),
}

impl Kind {
    fn read(given: &Bound<'_, PyAny>) -> PyResult<Self> {
        let Ok(name) = given.extract::<String>() else {
            let found = given.get_type().name()?;
            return Err(PyTypeError::new_err(format!(
                "kind: found {found}, wanted a string"
            )));
        };
        match &name[..] {
            "linear" => Ok(Self::Linear),
            "bezier" => Ok(Self::Cubic(CurveBasis::Bezier)),
            "bspline" => Ok(Self::Cubic(CurveBasis::BSpline)),
            "catmull-rom" => Ok(Self::Cubic(CurveBasis::CatmullRom)),
            _ => Err(PyValueError::new_err(format!(
                "kind: found {name:?}, wanted \"linear\", \"bezier\", \"bspline\" or \"catmull-rom\""
            ))),
        }
    }

    /// Pieces of a curve of so many points, if it can have as many, and points from one piece to the next.
    fn pieces(self, points: usize) -> Option<(usize, usize)> {
        match self {
            Self::Linear => (points >= 2).then(|| (points - 1, 1)),
            Self::Cubic(CurveBasis::Bezier) => {
                (points >= 4 && points % 3 == 1).then_some((points / 3, 3))
            }
            Self::Cubic(_) => (points >= 4).then(|| (points - 3, 1)),
        }
    }

    /// Numbers of points that curves may have.
    fn wanted(self) -> &'static str {
        match self {
            Self::Linear => "at least 2",
            Self::Cubic(CurveBasis::Bezier) => "4, 7, 10, ...",
            Self::Cubic(_) => "at least 4",
        }
    }
}

/// Curves that are not yet rounded.
pub struct Given<'py> {
    pub points: Numbers<'py>,
    radii: Numbers<'py>,
    /// Points of each curve.
    counts: Vec<usize>,
    kind: Kind,
}

impl<'py> Given<'py> {
    /// Reads an object with the attributes of the class `Curves`.
    pub fn read(object: &Bound<'py, PyAny>) -> PyResult<Self> {
        let points = Numbers::read(&object.getattr("points")?, "points", 3)?;
        let radii = Numbers::read(&object.getattr("radii")?, "radii", 1)?;
        let name = object.getattr("kind")?;
        let kind = Kind::read(&name)?;
        let counts = object.getattr("counts")?;
        let lead = points.lead(3);
        if common_shape(&[(&points, 3), (&radii, 1)])? != lead {
            let wanted = format!("() or {}", shape_text(lead));
            return Err(wrong_shape("radii", radii.shape(), &wanted));
        }
        let of_radii = Operand::new(&radii, 1, lead);
        let all = (0..lead.iter().product()).map(|point| of_radii.number(point));
        if let Some(found) = all.into_iter().find(|radius| *radius < 0.0) {
            return Err(PyValueError::new_err(format!(
                "radii: found {found}, wanted numbers of at least 0"
            )));
        }
        let counts = match counts.is_none() {
            true => equal_counts(&points)?,
            false => given_counts(&counts, &points)?,
        };
        if let Some((curve, found)) =
            (counts.iter().enumerate()).find(|(_, count)| kind.pieces(**count).is_none())
        {
            let wanted = kind.wanted();
            return Err(PyValueError::new_err(format!(
                "points: found {found} of curve {curve}, wanted {wanted} for the kind {name}"
            )));
        }
        Ok(Self {
            points,
            radii,
            counts,
            kind,
        })
    }

    /// Segments around an origin.
    pub fn rounded(&self, local: &LocalOrigin) -> PyResult<Segments> {
        let lead = self.points.lead(3);
        let (places, radii) = (
            Operand::new(&self.points, 3, lead),
            Operand::new(&self.radii, 1, lead),
        );
        let count = lead.iter().product();
        let point = |point| {
            let [x, y, z] = local.local(places.vector(point));
            [x, y, z, radii.number(point) as f32]
        };
        let points = memory::collected((0..count).map(point), count, "points")?;
        let pieces = || {
            self.counts
                .iter()
                .filter_map(|&count| self.kind.pieces(count))
        };
        let all: usize = pieces().map(|(pieces, _)| pieces).sum();
        if u32::try_from(count).is_err() {
            return Err(PyValueError::new_err(format!(
                "points: found {count}, wanted fewer than 2^32"
            )));
        }
        let mut firsts = memory::room(all, "segments")?;
        let mut of_pieces = memory::room(all, "segments")?;
        let mut first = 0;
        for ((curve, count), (pieces, step)) in (0..).zip(&self.counts).zip(pieces()) {
            for piece in 0..pieces {
                firsts.push((first + step * piece) as u32);
                of_pieces.push(Place {
                    curve,
                    along: [piece as f32, (piece + 1) as f32],
                });
            }
            first += count;
        }
        let Kind::Cubic(basis) = self.kind else {
            return Ok(Segments {
                points,
                firsts,
                places: of_pieces,
            });
        };
        let cubic = Curves::cubic(&points, &firsts, basis, TOLERANCE);
        let cubic = cubic.ok_or_else(|| PyValueError::new_err("points: a curve has too few"))?;
        let place = |&(piece, along): &(u32, [f32; 2])| {
            let Place {
                curve,
                along: [begin, _],
            } = of_pieces[piece as usize];
            Place {
                curve,
                along: along.map(|parameter| begin + parameter),
            }
        };
        Ok(Segments {
            points: cubic.curves.points.into_owned(),
            firsts: cubic.curves.segments.into_owned(),
            places: memory::collected(
                cubic.parts.iter().map(place),
                cubic.parts.len(),
                "segments",
            )?,
        })
    }
}

/// Curves of points (..., n, 3): all of n.
fn equal_counts(points: &Numbers<'_>) -> PyResult<Vec<usize>> {
    match points.lead(3) {
        [curves @ .., count] => memory::filled(*count, curves.iter().product(), "curves"),
        [] => Err(wrong_shape("points", points.shape(), "(..., n, 3)")),
    }
}

/// Curves of points (n, 3), one after the other.
fn given_counts(counts: &Bound<'_, PyAny>, points: &Numbers<'_>) -> PyResult<Vec<usize>> {
    let numbers = Numbers::whole(counts, "counts")?;
    let rows = points.rows()?;
    let [curves] = numbers.shape()[..] else {
        return Err(wrong_shape("counts", numbers.shape(), "(k,)"));
    };
    let operand = Operand::new(&numbers, 1, &[curves]);
    if let Some(found) = (0..curves)
        .map(|curve| operand.number(curve))
        .find(|count| *count < 0.0)
    {
        return Err(PyValueError::new_err(format!(
            "counts: found {found}, wanted numbers of points"
        )));
    }
    let counts = (0..curves).map(|curve| operand.number(curve) as usize);
    let counts = memory::collected(counts, curves, "curves")?;
    let sum = counts
        .iter()
        .fold(0usize, |sum, &count| sum.saturating_add(count));
    match sum == rows {
        true => Ok(counts),
        false => Err(PyValueError::new_err(format!(
            "counts: found a sum of {sum}, wanted {rows}, the number of points"
        ))),
    }
}
