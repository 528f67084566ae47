//! Groups of triangles, such as the facades of buildings, and statistics of the sensors on them.

use std::collections::HashMap;

use antumbra::{Bvh, Ray, Visit};
use rayon::prelude::*;

use crate::points::surfaces::Flat;
use crate::vector::{above, dot, unit};
use crate::{Mesh, Orientation, Sensors, Surface};

/// Sides of the compass, clockwise from north.
const SIDES: [&str; 8] = ["N", "NE", "E", "SE", "S", "SW", "W", "NW"];

/// Least cosine between the normals of a sensor and of the triangle that it is on.
const FACING: f64 = 0.7;

/// Groups of the triangles of a mesh. Each triangle is in one group.
#[derive(Clone, Debug, PartialEq)]
pub struct Groups {
    /// Names of the columns that distinguish groups.
    pub columns: Vec<&'static str>,
    /// Texts of each group in these columns, in the order of the first triangles.
    pub names: Vec<Vec<String>>,
    /// Area of the triangles of each group, in squared units of the mesh.
    pub areas: Vec<f64>,
    /// Group of each triangle, `[m]`.
    pub of_triangle: Vec<u32>,
}

impl Groups {
    /// Groups of triangles with the same texts, which `name` says of each triangle.
    pub fn new(
        mesh: &Mesh,
        columns: Vec<&'static str>,
        name: impl Fn(usize) -> Vec<String>,
    ) -> Self {
        let mut known: HashMap<Vec<String>, u32> = HashMap::new();
        let mut groups = Self {
            columns,
            names: Vec::new(),
            areas: Vec::new(),
            of_triangle: Vec::with_capacity(mesh.indices.len()),
        };
        for (triangle, corners) in mesh.indices.iter().enumerate() {
            let name = name(triangle);
            let group = match known.get(&name) {
                Some(&group) => group,
                None => {
                    let group = groups.names.len() as u32;
                    known.insert(name.clone(), group);
                    groups.names.push(name);
                    groups.areas.push(0.0);
                    group
                }
            };
            let normal = mesh.twice_of(*corners);
            let area = 0.5 * dot(normal, normal).sqrt();
            if area.is_finite() {
                groups.areas[group as usize] += area;
            }
            groups.of_triangle.push(group);
        }
        groups
    }

    /// Number of sensors of each group whose value is a number, with the mean, the smallest and the largest value. All three are NaN
    /// without such a sensor. `triangles` has the triangle of each sensor, if it is on one.
    pub fn statistics(&self, triangles: &[Option<u32>], values: &[f64]) -> Vec<Statistics> {
        let mut all = vec![Statistics::NONE; self.names.len()];
        for (&triangle, &value) in triangles.iter().zip(values) {
            let group = triangle.and_then(|triangle| self.of_triangle.get(triangle as usize));
            let Some(&group) = group.filter(|_| !value.is_nan()) else {
                continue;
            };
            let own = &mut all[group as usize];
            own.count += 1;
            own.mean += value;
            own.least = own.least.min(value);
            own.most = own.most.max(value);
        }
        for own in &mut all {
            own.mean /= own.count as f64;
            if own.count == 0 {
                (own.least, own.most) = (f64::NAN, f64::NAN);
            }
        }
        all
    }
}

/// Statistics of the sensors of a group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistics {
    /// Number of sensors whose value is a number.
    pub count: usize,
    /// Mean value, each sensor weighing the same. NaN without a sensor.
    pub mean: f64,
    /// Smallest value. NaN without a sensor.
    pub least: f64,
    /// Largest value. NaN without a sensor.
    pub most: f64,
}

impl Statistics {
    const NONE: Self = Self {
        count: 0,
        mean: 0.0,
        least: f64::INFINITY,
        most: f64::NEG_INFINITY,
    };
}

impl Mesh {
    /// Side of each triangle: for a facade the side of the compass to which it faces, within 22.5 degrees, as `N`, `NE` and so on;
    /// the name of the kind for other [surfaces](Surface). Empty for a triangle without area.
    pub fn sides(&self, kinds: &[Surface], orientation: &Orientation) -> Vec<&'static str> {
        let side = |(&corners, kind): (&[u32; 3], &Surface)| {
            let Some(normal) = unit(self.twice_of(corners)) else {
                return "";
            };
            match kind {
                Surface::Facade => {
                    let [east, north, _] = orientation.local(normal);
                    let azimuth = libm::atan2(east, north).to_degrees().rem_euclid(360.0);
                    SIDES[(azimuth / 45.0).round() as usize % 8]
                }
                other => other.name(),
            }
        };
        self.indices.iter().zip(kinds).map(side).collect()
    }
}

impl Sensors {
    /// Triangle of the mesh that each point of a table is on, and how many points are ambiguous. Sensors that were made on a
    /// triangle know it without a search.
    ///
    /// A point is on the first surface behind it, against its normal, or below it for a point without one. Of surfaces that touch,
    /// it is on the one that faces as its normal does, and `None` if the first surface does not. A point is ambiguous where
    /// surfaces of two groups do; `group` says to which one a triangle belongs.
    pub fn locate(
        &self,
        (bvh, flat): (&Bvh, Flat<'_>),
        mesh: &Mesh,
        group: &(dyn Fn(u32) -> u32 + Sync),
        orientation: &Orientation,
    ) -> (Vec<Option<u32>>, usize) {
        let locate = |index: usize| {
            let point = &self.points[index];
            let normal = self.normals.get(index).map(|normal| normal.map(f64::from));
            let normal = unit(normal.unwrap_or(orientation.up)).unwrap_or([f64::NAN; 3]);
            let ray = Ray::new(above(bvh, point, normal), normal.map(|x| -x as f32));
            let offset = bvh.origin_offset(*point);
            let (mut end, mut own, mut is_ambiguous) = (f32::INFINITY, None, false);
            bvh.query(&ray).visit_hits(|hit| {
                end = end.min(hit.t + offset);
                if hit.t > end {
                    return Visit::Stop;
                }
                let triangle = flat([hit.geom_id, hit.prim_id]).filter(|&triangle| {
                    let front = mesh.front(triangle);
                    // A ray that leaves by a gap of its own surface hits another one at a slant.
                    let cosine = front.map_or(0.0, |front| dot(front, normal));
                    self.normals.is_empty() || cosine > FACING
                });
                if let Some(triangle) = triangle {
                    let own = *own.get_or_insert(triangle);
                    is_ambiguous |= group(own) != group(triangle);
                }
                Visit::Reject
            });
            (own, is_ambiguous)
        };
        let found: Vec<(Option<u32>, bool)> =
            (0..self.points.len()).into_par_iter().map(locate).collect();
        let ambiguous = found
            .iter()
            .filter(|(_, is_ambiguous)| *is_ambiguous)
            .count();
        (found.into_iter().map(|(own, _)| own).collect(), ambiguous)
    }
}

#[cfg(test)]
mod tests {
    use antumbra::{Geometry, Recipe};

    use super::*;
    use crate::{Placement, Surfaces};

    /// Two boxes of 10 x 20 x 6 and 4 x 4 x 9 without floors, on a ground.
    fn village() -> (Bvh, Mesh) {
        let mut mesh = Mesh::default();
        let mut quad = |corners: [[f32; 3]; 4]| {
            mesh.push((&corners, &[[0, 1, 2], [0, 2, 3]]), &[], &[], false);
        };
        for ([x, y], [w, d, h]) in [
            ([0.0, 0.0], [10.0, 20.0, 6.0]),
            ([30.0, 0.0], [4.0, 4.0, 9.0]),
        ] {
            let corners = [[x, y], [x + w, y], [x + w, y + d], [x, y + d]];
            for side in 0..4 {
                let ([a, b], [c, e]) = (corners[side], corners[(side + 1) % 4]);
                quad([[a, b, 0.0], [c, e, 0.0], [c, e, h], [a, b, h]]);
            }
            quad(corners.map(|[x, y]| [x, y, h]));
        }
        quad([
            [-50.0, -50.0, 0.0],
            [50.0, -50.0, 0.0],
            [50.0, 50.0, 0.0],
            [-50.0, 50.0, 0.0],
        ]);
        let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
        let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
        (bvh, mesh)
    }

    #[test]
    fn facades_have_their_areas_sides_and_sensors() {
        let (bvh, mut mesh) = village();
        let plan = Orientation::default();
        let bodies = mesh.bodies();
        let flat = |[_, triangle]: [u32; 2]| Some(triangle);
        let surfaces = Surfaces::new(&mut mesh, &bodies, (&bvh, &flat), &plan);
        let sides = mesh.sides(&surfaces.kinds, &plan);
        let groups = Groups::new(&mesh, vec!["object", "facade"], |triangle| {
            vec![bodies[triangle].to_string(), sides[triangle].to_owned()]
        });
        let wanted = [
            ("0", "S", 60.0),
            ("0", "E", 120.0),
            ("0", "N", 60.0),
            ("0", "W", 120.0),
            ("0", "roof", 200.0),
            ("1", "S", 36.0),
            ("1", "E", 36.0),
            ("1", "N", 36.0),
            ("1", "W", 36.0),
            ("1", "roof", 16.0),
            ("2", "ground", 10_000.0),
        ];
        let names = wanted.map(|(object, side, _)| vec![object.to_owned(), side.to_owned()]);
        assert_eq!(groups.names, names);
        assert_eq!(groups.areas, wanted.map(|(.., area)| area));

        let placement = Placement {
            spacing: 1.0,
            kinds: Surface::ALL.to_vec(),
            offset: 0.1,
            storey: None,
            covered: 0.5,
        };
        let all = 0..mesh.indices.len() as u32;
        let sensors = Sensors::on_surfaces(&bvh, &flat, (&mesh, &surfaces), all, &placement, &plan);
        let sensors = sensors.expect("sensors");
        let triangles: Vec<Option<u32>> = sensors.triangles.iter().copied().map(Some).collect();
        let group = |triangle: u32| groups.of_triangle[triangle as usize];
        let located = sensors.locate((&bvh, &flat), &mesh, &group, &plan);
        assert_eq!(located.1, 0);
        for (found, made) in located.0.iter().zip(&sensors.triangles) {
            assert_eq!(
                found.map(group),
                Some(group(*made)),
                "found where they were made"
            );
        }
        let heights: Vec<f64> = sensors.points.iter().map(|p| f64::from(p[2])).collect();
        let found = groups.statistics(&triangles, &heights);
        for (found, area) in found.iter().zip(&groups.areas) {
            assert_eq!(found.count as f64, *area, "a sensor for each square metre");
        }
        assert!((found[0].mean - 3.0).abs() < 1e-6);
        assert_eq!([found[0].least, found[0].most], [0.5, 5.5]);
        let none = groups.statistics(&[None, Some(0)], &[1.0, f64::NAN]);
        assert!(
            none.iter()
                .all(|own| own.count == 0 && own.mean.is_nan() && own.least.is_nan())
        );
    }

    #[test]
    fn north_turns_the_sides() {
        let (bvh, mut mesh) = village();
        // The x axis points north.
        let plan = Orientation::new(crate::UpAxis::Z, 90.0).expect("a plan");
        let objects = mesh.bodies();
        let flat = |[_, triangle]: [u32; 2]| Some(triangle);
        let surfaces = Surfaces::new(&mut mesh, &objects, (&bvh, &flat), &plan);
        let sides = mesh.sides(&surfaces.kinds, &plan);
        assert_eq!(
            [sides[0], sides[2], sides[4], sides[6]],
            ["E", "N", "W", "S"]
        );
    }
}
