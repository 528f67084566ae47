//! Sensors on surfaces as people place them: roofs, facades and ground apart, along lines, by storey.

use antumbra::{Bvh, Ray};

use crate::points::surfaces::Flat;
use crate::vector::{cross, dot, minus, unit};
use crate::{Error, Label, Mesh, Orientation, Sensors, Surface, Surfaces, memory};

/// How sensors are placed on surfaces.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    /// Distance between sensors; each stands for a square of this side.
    pub spacing: f64,
    /// Kinds of surfaces that have sensors.
    pub kinds: Vec<Surface>,
    /// Distance from the surface, along its normal.
    pub offset: f64,
    /// Height of a storey; `None` for no storeys.
    pub storey: Option<f64>,
    /// Distance to the first surface above within which a place that sees no sky is [covered](Surfaces::covered).
    pub covered: f64,
}

/// Distance from an edge, over the spacing, within which a point is on it.
const ON_EDGE: f64 = 1e-4;

/// Most sensors of a triangle, beyond which the spacing is a mistake.
const MOST_CELLS: f64 = 1e8;

impl Sensors {
    /// Sensors on some triangles of a mesh, whose front they see.
    ///
    /// Every plane has a lattice of points of its own, `spacing` apart, level and upright; triangles of the plane share it. Points
    /// inside of a triangle are sensors. So each stands for the same area, and a surface smaller than a square may have none.
    /// Places that are [covered](Surfaces::covered) have sensors only if that is one of the kinds; otherwise they are listed in
    /// [`Sensors::covered`].
    /// Labels are the kind of the [`Surface`] as `surface`, and with storeys, for facades, `storey`: their height above the surface
    /// below, just outside, over the height of a storey, rounded down. Storeys are counted from 0.
    ///
    /// # Errors
    /// [`Error::Range`] if the spacing or a storey is not above 0 or an offset is not finite, [`Error::Cells`] if a triangle has more
    /// than 100 million points, [`Error::NoSurface`] if there is no sensor.
    pub fn on_surfaces(
        bvh: &Bvh,
        flat: Flat<'_>,
        (mesh, surfaces): (&Mesh, &Surfaces),
        triangles: impl IntoIterator<Item = u32>,
        placement: &Placement,
        orientation: &Orientation,
    ) -> Result<Self, Error> {
        let lengths = [Some(placement.spacing), placement.storey];
        for found in lengths.into_iter().flatten() {
            let is_in = found > 0.0 && placement.offset.is_finite();
            let wanted = "a length above 0, and a finite offset";
            Error::check_range("spacing, storey or offset", found, is_in, wanted)?;
        }
        let of_kind = |kind| placement.kinds.contains(&kind);
        let mut places: Vec<([f64; 3], u32)> = Vec::new();
        let mut found = Vec::new();
        for triangle in triangles {
            if !of_kind(surfaces.kinds[triangle as usize]) && !of_kind(Surface::Covered) {
                continue;
            }
            let corners = mesh.corners(triangle);
            if let Some(plane) = Plane::new(corners, orientation) {
                found.clear();
                plane.lattice(corners, placement.spacing, &mut found)?;
                memory::grow(&mut places, "sensors", found.len())?;
                places.extend(found.iter().map(|&point| (point, triangle)));
            }
        }
        let are_covered = surfaces.covered((bvh, flat), mesh, &places, placement.covered);
        let mut sensors = Self::default();
        let (mut names, mut storeys) = (Vec::new(), Vec::new());
        for (&(point, triangle), is_covered) in places.iter().zip(are_covered) {
            let on = surfaces.kinds[triangle as usize];
            let kind = if is_covered { Surface::Covered } else { on };
            if !of_kind(kind) {
                if is_covered {
                    sensors.covered.push(triangle);
                }
                continue;
            }
            let Some(normal) = mesh.front(triangle) else {
                continue;
            };
            names.push(kind.name().to_owned());
            if let Some(storey) = placement.storey {
                let height = || {
                    let outside = along(point, normal, 0.1 * storey);
                    let ray =
                        Ray::new(outside.map(|x| x as f32), orientation.up.map(|x| -x as f32));
                    let ground = bvh.intersect(&ray).map(|hit| f64::from(hit.t));
                    ground.map(|height| ((height + 1e-6 * storey) / storey).floor())
                };
                let number = (on == Surface::Facade).then(height).flatten();
                storeys.push(number.map_or(String::new(), |number| number.to_string()));
            }
            let moved = along(point, normal, placement.offset);
            sensors.points.push(moved.map(|x| x as f32));
            sensors.normals.push(normal.map(|x| x as f32));
            sensors.triangles.push(triangle);
        }
        if sensors.points.is_empty() {
            return Err(Error::NoSurface);
        }
        sensors.labels.push(Label::new("surface", names));
        if placement.storey.is_some() {
            sensors.labels.push(Label::new("storey", storeys));
        }
        Ok(sensors)
    }

    /// Sensors along lines, `spacing` apart, beginning half of it after the start: consecutive points of a table with the same name
    /// are a line, or all points if they have no names. The sensors have the names of their lines, and face nowhere.
    ///
    /// # Errors
    /// [`Error::Range`] if the spacing is not above 0, [`Error::Cells`] if a line has more than 100 million sensors, or
    /// [`Error::NoSurface`] if no line is long enough.
    pub fn along_lines(corners: &Self, spacing: f64) -> Result<Self, Error> {
        Error::check_range("spacing", spacing, spacing > 0.0, "a length above 0")?;
        let mut sensors = Self::default();
        let names = corners.labels.first();
        let mut all_names = Vec::new();
        // Length from the last sensor, which is half a step before the start of a line.
        let mut gone = 0.5 * spacing;
        for (index, ends) in corners.points.windows(2).enumerate() {
            let is_one = names.is_none_or(|names| names.values[index] == names.values[index + 1]);
            if !is_one {
                gone = 0.5 * spacing;
                continue;
            }
            let [from, to] = [0, 1].map(|end| ends[end].map(f64::from));
            let apart = minus(to, from);
            let length = dot(apart, apart).sqrt();
            if length / spacing > MOST_CELLS {
                return Err(Error::Cells {
                    columns: length / spacing,
                    rows: 1.0,
                });
            }
            let mut next = spacing - gone;
            while next <= length {
                let point = along(from, apart, next / length);
                sensors.points.push(point.map(|x| x as f32));
                all_names.extend(names.map(|names| names.values[index].clone()));
                next += spacing;
            }
            gone = length - (next - spacing);
        }
        if sensors.points.is_empty() {
            return Err(Error::NoSurface);
        }
        if let Some(names) = names {
            sensors.labels.push(Label::new(&names.column, all_names));
        }
        Ok(sensors)
    }
}

/// Plane of a triangle, with axes in it that are the same for all triangles of the plane.
struct Plane {
    axes: [[f64; 3]; 2],
}

impl Plane {
    fn new([a, b, c]: [[f64; 3]; 3], orientation: &Orientation) -> Option<Self> {
        let normal = unit(cross(minus(b, a), minus(c, a)))?;
        // Triangles of a wall differ by rounding.
        let rounded = normal.map(|x| (x * 1e4).round() / 1e4);
        let level = cross(orientation.up, rounded);
        let right = match dot(level, level) > 1e-6 {
            true => unit(level)?,
            false => orientation.east,
        };
        let other = unit(cross(rounded, right))?;
        Some(Self {
            axes: [right, other],
        })
    }

    /// Points of the lattice inside of a triangle of the plane. Of two triangles with a common edge, one has its points.
    fn lattice(
        &self,
        corners: [[f64; 3]; 3],
        spacing: f64,
        found: &mut Vec<[f64; 3]>,
    ) -> Result<(), Error> {
        let flat = corners.map(|corner| self.axes.map(|axis| dot(corner, axis) / spacing));
        let ends = [0, 1].map(|axis| {
            let all = flat.map(|corner: [f64; 2]| corner[axis] - 0.5);
            let low = all.into_iter().fold(f64::INFINITY, f64::min);
            let high = all.into_iter().fold(f64::NEG_INFINITY, f64::max);
            [low.ceil(), high.floor()]
        });
        let [columns, rows] = ends.map(|[low, high]| (high - low + 1.0).max(0.0));
        if !(columns * rows <= MOST_CELLS) {
            return Err(Error::Cells { columns, rows });
        }
        let area = edge(flat[0], flat[1], flat[2]);
        for row in 0..rows as usize {
            for column in 0..columns as usize {
                let at = [ends[0][0] + column as f64, ends[1][0] + row as f64].map(|x| x + 0.5);
                let inside = (0..3).all(|side| {
                    let (from, to) = (flat[side], flat[(side + 1) % 3]);
                    let [right, up] = [0, 1].map(|axis| to[axis] - from[axis]);
                    let apart = edge(from, to, at) * area.signum() / libm::hypot(right, up);
                    // Points on an edge belong to the triangle on one side of it. Edges are rounded.
                    let is_first = right > ON_EDGE || right > -ON_EDGE && up > 0.0;
                    apart > ON_EDGE || apart >= -ON_EDGE && is_first
                });
                if inside {
                    let weights = [1, 2, 0]
                        .map(|corner: usize| edge(flat[corner], flat[(corner + 1) % 3], at) / area);
                    found.push(std::array::from_fn(|axis| {
                        (0..3)
                            .map(|corner| weights[corner] * corners[corner][axis])
                            .sum()
                    }));
                }
            }
        }
        Ok(())
    }
}

/// Twice the area of a triangle in the plane, above 0 if its corners run anticlockwise.
fn edge(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The point moved by so much of a vector.
fn along(point: [f64; 3], vector: [f64; 3], length: f64) -> [f64; 3] {
    [0, 1, 2].map(|axis| point[axis] + length * vector[axis])
}

#[cfg(test)]
mod tests {
    use antumbra::LocalOrigin;
    use antumbra::{Geometry, Recipe};

    use super::*;

    /// A box of 10 x 20 x 6 m without a floor, on a ground of 60 x 60 m.
    fn house() -> (Bvh, Mesh) {
        let mut mesh = Mesh::default();
        let mut wall = |corners: [[f32; 3]; 4]| {
            mesh.push((&corners, &[[0, 1, 2], [0, 2, 3]]), &[], &[], false);
        };
        let corner = |x: f32, y: f32, z: f32| [x, y, z];
        let (a, b, c, d) = ([0.0, 0.0], [10.0, 0.0], [10.0, 20.0], [0.0, 20.0]);
        for [from, to] in [[a, b], [b, c], [c, d], [d, a]] {
            wall([
                corner(from[0], from[1], 0.0),
                corner(to[0], to[1], 0.0),
                corner(to[0], to[1], 6.0),
                corner(from[0], from[1], 6.0),
            ]);
        }
        wall([a, b, c, d].map(|[x, y]| [x, y, 6.0]));
        wall(
            [[-25.0, -20.0], [35.0, -20.0], [35.0, 40.0], [-25.0, 40.0]].map(|[x, y]| [x, y, 0.0]),
        );
        let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
        let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
        (bvh, mesh)
    }

    fn on(kinds: &[Surface]) -> Result<Sensors, Error> {
        let (bvh, mut mesh) = house();
        let plan = Orientation::default();
        let objects = vec![0; mesh.indices.len()];
        let flat = |[_, triangle]: [u32; 2]| Some(triangle);
        let surfaces = Surfaces::new(&mut mesh, &objects, (&bvh, &flat), &plan);
        let placement = Placement {
            spacing: 2.0,
            kinds: kinds.to_vec(),
            offset: 0.25,
            storey: Some(3.0),
            covered: 0.5,
        };
        let triangles = 0..mesh.indices.len() as u32;
        Sensors::on_surfaces(
            &bvh,
            &flat,
            (&mesh, &surfaces),
            triangles,
            &placement,
            &plan,
        )
    }

    #[test]
    fn each_square_has_one_sensor() {
        // Areas over the area of a square: 10 x 20, 60 x 60 less 10 x 20, 2 (10 + 20) x 6. Coordinates are no odd multiples of the spacing.
        for (kind, count) in [
            (Surface::Roof, 50),
            (Surface::Ground, 850),
            (Surface::Covered, 50),
            (Surface::Facade, 90),
        ] {
            let sensors = on(&[kind]).expect("sensors");
            assert_eq!(sensors.points.len(), count, "{kind:?}");
            assert!(
                sensors.labels[0]
                    .values
                    .iter()
                    .all(|name| name == kind.name())
            );
        }
        assert_eq!(on(&[Surface::Underside]), Err(Error::NoSurface));
        assert_eq!(on(&Surface::ALL).expect("sensors").points.len(), 1040);
    }

    #[test]
    fn facades_have_storeys_and_face_outwards() {
        let sensors = on(&[Surface::Facade]).expect("sensors");
        assert_eq!(sensors.labels[1].column, "storey");
        for (index, point) in sensors.points.iter().enumerate() {
            let storey = (point[2] / 3.0).floor().to_string();
            assert_eq!(sensors.labels[1].values[index], storey);
            let outside = [point[0] + 0.25, 10.0 - point[0] + 0.25, point[1] + 0.25];
            assert!(outside.iter().any(|&x| x.abs() < 1e-5) || (point[1] - 20.25).abs() < 1e-5);
        }
    }

    #[test]
    fn lines_have_sensors_in_even_steps() {
        let table = "name,x,y,z\na,0,0,1\na,3,0,1\na,3,4,1\nb,0,0,2\nb,1,0,2\n";
        let corners = Sensors::from_table(table, &LocalOrigin::default()).expect("a table");
        let sensors = Sensors::along_lines(&corners, 2.0).expect("sensors");
        let wanted = [
            [1.0, 0.0, 1.0],
            [3.0, 0.0, 1.0],
            [3.0, 2.0, 1.0],
            [3.0, 4.0, 1.0],
            [1.0, 0.0, 2.0],
        ];
        assert_eq!(sensors.points, wanted);
        assert_eq!(sensors.labels[0].values, ["a", "a", "a", "a", "b"]);
        assert!(Sensors::along_lines(&corners, 99.0).is_err());
        assert!(Sensors::along_lines(&corners, 0.0).is_err());
    }
}
