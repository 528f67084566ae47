//! Groups of triangles, such as the facades of buildings, and statistics of the sensors on them.

use std::collections::HashMap;

use antumbra::{Bvh, Ray};
use rayon::prelude::*;

use crate::normals::{cross, unit};
use crate::orientation::dot;
use crate::visibility::above;
use crate::{Mesh, Orientation, Sensors, Surface};

/// Sides of the compass, clockwise from north.
const SIDES: [&str; 8] = ["N", "NE", "E", "SE", "S", "SW", "W", "NW"];

/// Least cosine between the normals of a sensor and of the triangle that it is on.
const FACING: f32 = 0.7;

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
            let area = 0.5 * length(twice(mesh, *corners));
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

/// Normal of a triangle times twice its area.
fn twice(mesh: &Mesh, corners: [u32; 3]) -> [f64; 3] {
    let [a, b, c] = corners.map(|corner| mesh.positions[corner as usize].map(f64::from));
    let minus = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|axis| a[axis] - b[axis]);
    cross(minus(b, a), minus(c, a))
}

fn length(vector: [f64; 3]) -> f64 {
    dot(vector, vector).sqrt()
}

impl Mesh {
    /// Connected bodies: triangles that have a corner at the same place belong to one body. Number of the body of each triangle, from
    /// 0 in the order of the first triangles.
    pub fn bodies(&self) -> Vec<u32> {
        let mut root: Vec<u32> = (0..self.indices.len() as u32).collect();
        fn find(root: &mut [u32], mut at: u32) -> u32 {
            while root[at as usize] != at {
                let next = root[root[at as usize] as usize];
                root[at as usize] = next;
                at = next;
            }
            at
        }
        let mut first: HashMap<[u32; 3], u32> = HashMap::new();
        for (triangle, corners) in (0..).zip(&self.indices) {
            for &corner in corners {
                // 0 and -0 are the same place.
                let place = self.positions[corner as usize].map(|x| (x + 0.0).to_bits());
                let other = *first.entry(place).or_insert(triangle);
                let [a, b] = [find(&mut root, other), find(&mut root, triangle)];
                // The smaller number stays, so that roots are first triangles.
                root[a.max(b) as usize] = a.min(b);
            }
        }
        let mut numbers = HashMap::new();
        (0..self.indices.len() as u32)
            .map(|triangle| {
                let next = numbers.len() as u32;
                *numbers.entry(find(&mut root, triangle)).or_insert(next)
            })
            .collect()
    }

    /// Side of each triangle: for a facade the side of the compass to which it faces, within 22.5 degrees, as `N`, `NE` and so on;
    /// `roof`, `ground` or `underside` for other [surfaces](Surface). Empty for a triangle without area. Triangles face as their
    /// corners run anticlockwise.
    pub fn sides(&self, bvh: &Bvh, orientation: &Orientation) -> Vec<&'static str> {
        let side = |corners: &[u32; 3]| {
            let Some(normal) = unit(twice(self, *corners)) else {
                return "";
            };
            let all = corners.map(|corner| self.positions[corner as usize].map(f64::from));
            let middle = [0, 1, 2].map(|axis| all.iter().map(|p| p[axis]).sum::<f64>() / 3.0);
            match Surface::of(bvh, middle, normal, orientation) {
                Surface::Facade => {
                    let [east, north, _] = orientation.local(normal);
                    let azimuth = libm::atan2(east, north).to_degrees().rem_euclid(360.0);
                    SIDES[(azimuth / 45.0).round() as usize % 8]
                }
                other => other.name(),
            }
        };
        self.indices.par_iter().map(side).collect()
    }
}

impl Sensors {
    /// The triangle that each sensor is on, as shape and triangle of the tree: the first one behind the sensor, against its normal, or
    /// below it for a sensor without one. `None` where there is none, or where it faces elsewhere than the sensor.
    pub fn triangles(&self, bvh: &Bvh, orientation: &Orientation) -> Vec<Option<[u32; 2]>> {
        let bounds = bvh.bounds();
        let rays = self.points.iter().enumerate().map(|(index, point)| {
            let normal = self.normals.get(index).map(|normal| normal.map(f64::from));
            let normal = unit(normal.unwrap_or(orientation.up)).unwrap_or([f64::NAN; 3]);
            Ray::new(above(&bounds, point, normal), normal.map(|x| -x as f32))
        });
        let rays: Vec<Ray> = rays.collect();
        let hits = bvh.batch(&rays).intersect();
        let found = rays.iter().zip(hits).map(|(ray, hit)| {
            let hit = hit?;
            // A ray that leaves by a gap of its own surface hits another one at a slant.
            let normal = bvh.normal(ray, &hit)?;
            let slant: f32 = normal.iter().zip(ray.dir).map(|(a, b)| a * b).sum();
            let is_own = self.normals.is_empty()
                || slant.abs() > FACING * length(ray.dir.map(f64::from)) as f32;
            is_own.then_some([hit.geom_id, hit.prim_id])
        });
        found.collect()
    }
}

#[cfg(test)]
mod tests {
    use antumbra::{Geometry, Recipe};

    use super::*;
    use crate::Placement;

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
        let (bvh, mesh) = village();
        let plan = Orientation::default();
        let (bodies, sides) = (mesh.bodies(), mesh.sides(&bvh, &plan));
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
        };
        let sensors = Sensors::on_surfaces(&bvh, &mesh, &placement, &plan).expect("sensors");
        let triangles = sensors.triangles(&bvh, &plan);
        let flat: Vec<Option<u32>> = triangles.iter().map(|ids| ids.map(|ids| ids[1])).collect();
        let heights: Vec<f64> = sensors.points.iter().map(|p| f64::from(p[2])).collect();
        let found = groups.statistics(&flat, &heights);
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
        let (bvh, mesh) = village();
        // The x axis points north.
        let plan = Orientation::new(crate::UpAxis::Z, 90.0).expect("a plan");
        let sides = mesh.sides(&bvh, &plan);
        assert_eq!(
            [sides[0], sides[2], sides[4], sides[6]],
            ["E", "N", "W", "S"]
        );
    }

    #[test]
    fn bodies_are_joined_however_their_triangles_are_sorted() {
        let at = |i: u32| [i as f32, 0.0, 0.0];
        // A chain whose links come in the wrong order, and a triangle beside it.
        let mesh = Mesh {
            positions: (0..12).map(at).collect(),
            indices: vec![[4, 5, 6], [0, 1, 2], [9, 10, 11], [2, 3, 4]],
            ..Mesh::default()
        };
        assert_eq!(mesh.bodies(), [0, 0, 1, 0]);
        assert!(Mesh::default().bodies().is_empty());
    }
}
