//! Distances, weights and positions of hits against double precision, on walls and shafts that are thousands of times as
//! long as they are wide.

use antumbra::{Bvh, Geometry, Hit, Ray, Recipe};
use antumbra_testkit::Rng;

type Point = [f64; 3];

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Point, b: Point) -> Point {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Distance and weights by another formula than the kernel's: the plane from the last corner, then areas at the point.
fn expected(corners: &[[f32; 3]; 3], ray: &Ray) -> [f64; 3] {
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    let (org, dir) = (ray.org.map(f64::from), ray.dir.map(f64::from));
    let normal = cross(minus(a, c), minus(b, c));
    let t = dot(minus(c, org), normal) / dot(dir, normal);
    let at = core::array::from_fn(|axis| org[axis] + t * dir[axis]);
    let area = |from, to| dot(cross(minus(from, at), minus(to, at)), normal) / dot(normal, normal);
    [t, area(c, a), area(a, b)]
}

/// Half a unit in the last place of the nearest number of single precision, and a little more.
fn rounding(x: f64) -> f64 {
    let x = x.abs() as f32;
    0.501 * f64::from(x.next_up() - x)
}

/// A mesh of quads, two triangles each, turned so that no coordinate is round.
struct Walls {
    corners: Vec<[[f32; 3]; 3]>,
    bvh: Bvh,
    turn: [Point; 3],
}

impl Walls {
    fn new(quads: &[[Point; 4]], is_turned: bool) -> Self {
        let turn = match is_turned {
            true => [[0.6, -0.48, 0.64], [0.8, 0.36, -0.48], [0.0, 0.8, 0.6]],
            false => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        };
        let placed = |point: Point| turn.map(|row| dot(row, point) as f32);
        let halves = quads.iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
        let corners: Vec<_> = halves
            .map(|half| half.map(|corner| placed(*corner)))
            .collect();
        let indices: Vec<_> = (0..corners.len() as u32)
            .map(|index| [3 * index, 3 * index + 1, 3 * index + 2])
            .collect();
        let geometry = [Geometry::triangles(corners.concat(), indices)];
        let bvh = Bvh::build(&geometry, &Recipe::default()).expect("a tree");
        Self { corners, bvh, turn }
    }

    fn ray(&self, from: Point, to: Point) -> Ray {
        let way = minus(to, from);
        let length = dot(way, way).sqrt();
        let turned = |vector: Point| self.turn.map(|row| dot(row, vector));
        Ray::new(
            turned(from).map(|x| x as f32),
            turned(way).map(|x| (x / length) as f32),
        )
    }

    /// Checks a hit, and returns how far the point by weights, the point by distance and the position are from the exact
    /// point.
    fn errors(&self, name: &str, ray: &Ray, hit: &Hit) -> [f64; 3] {
        let corners = &self.corners[hit.prim_id as usize];
        let [t, u, v] = expected(corners, ray);
        let place = format!("{name}: {ray:?} {hit:?}, exactly {t} {u} {v}");
        assert!((f64::from(hit.t) - t).abs() < rounding(t), "{place}");
        // The test in single precision may take a point beside the triangle for one in it.
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
            for (found, weight) in [(hit.u, u), (hit.v, v)] {
                let error = (f64::from(found) - weight).abs();
                assert!(error < rounding(weight) + 1e-10, "{place}");
            }
        }
        assert!(
            hit.u >= 0.0 && hit.v >= 0.0 && hit.u + hit.v < 1.000_001,
            "{place}"
        );
        let [a, b, c] = corners.map(|corner| corner.map(f64::from));
        let (org, dir) = (ray.org.map(f64::from), ray.dir.map(f64::from));
        let along = |t: f64| core::array::from_fn(|axis| org[axis] + t * dir[axis]);
        let weights = [f64::from(hit.u), f64::from(hit.v)];
        let by_weights = core::array::from_fn(|axis| {
            a[axis] + weights[0] * (b[axis] - a[axis]) + weights[1] * (c[axis] - a[axis])
        });
        let surface = self.bvh.surface(ray).expect("a hit");
        assert_eq!(surface.hit, *hit, "{place}");
        let exact: Point = along(t);
        [
            by_weights,
            along(f64::from(hit.t)),
            surface.position.map(f64::from),
        ]
        .map(|point| {
            let way = minus(point, exact);
            dot(way, way).sqrt()
        })
    }
}

/// The largest errors on walls are at most twice those that Embree 4.4 has in its robust mode: by weights, and by distance.
#[test]
fn hits_on_long_walls_are_where_the_walls_are() {
    let walls = [
        (10.0, 1.0, [2.5e-6, 5.2e-7]),
        (100.0, 1.0, [2.7e-5, 6.1e-7]),
        (1000.0, 1.0, [3.8e-4, 4.9e-7]),
        (1000.0, 0.1, [2.8e-3, 5.5e-7]),
        (10_000.0, 1.0, [2.6e-3, 6.0e-7]),
        (10_000.0, 0.1, [2.6e-3, 6.0e-7]),
    ];
    let mut rng = Rng::new(52);
    for (length, height, [by_weights, by_distance]) in walls {
        for is_turned in [false, true] {
            let corner = |y: f64, z: f64| [1.0, y * height / 2.0, z * length / 2.0];
            let quad = [
                corner(-1.0, -1.0),
                corner(1.0, -1.0),
                corner(1.0, 1.0),
                corner(-1.0, 1.0),
            ];
            let walls = Walls::new(&[quad], is_turned);
            let name = format!("{length} by {height}");
            let (mut hits, mut most) = (0, [0.0f64; 3]);
            for _ in 0..4000 {
                let mut unit = || f64::from(rng.unit()) - 0.5;
                let to = [1.0, unit() * height * 0.98, unit() * length * 0.9];
                let from = [-0.5 - unit(), to[1] + 4.0 * unit(), to[2] + 4.0 * unit()];
                let ray = walls.ray(from, to);
                if let Some(hit) = walls.bvh.intersect(&ray) {
                    hits += 1;
                    let errors = walls.errors(&name, &ray, &hit);
                    most = core::array::from_fn(|which| most[which].max(errors[which]));
                }
            }
            assert!(hits > 3000, "{name}: {hits} hits");
            assert!(most[0] < 2.0 * by_weights, "{name}: {most:?}");
            assert!(most[1] < 2.0 * by_distance, "{name}: {most:?}");
            // Three coordinates of up to half the length are rounded.
            assert!(
                most[2] < 2.0 * by_distance + length * 1e-7,
                "{name}: {most:?}"
            );
        }
    }
}

/// Rays in a shaft of 2 by 2 by 120,000: their distances were wrong by up to 3 %.
#[test]
fn distances_in_shafts_are_right() {
    let mut rng = Rng::new(53);
    let corner = |x: f64, y: f64, z: f64| [x, y, 60_000.0 * z];
    let side = |[x, y]: [f64; 2], [p, q]: [f64; 2]| {
        [
            corner(x, y, -1.0),
            corner(p, q, -1.0),
            corner(p, q, 1.0),
            corner(x, y, 1.0),
        ]
    };
    let around = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let quads: Vec<_> = (0..4)
        .map(|index| side(around[index], around[(index + 1) % 4]))
        .collect();
    for is_turned in [false, true] {
        let walls = Walls::new(&quads, is_turned);
        let mut hits = 0;
        for _ in 0..4000 {
            let mut unit = || 2.0 * f64::from(rng.unit()) - 1.0;
            let from = [0.9 * unit(), 0.9 * unit(), 50_000.0 * unit()];
            let to = [3.0 * unit(), 3.0 * unit(), from[2] + 3.0 * unit()];
            let ray = walls.ray(from, to);
            if let Some(hit) = walls.bvh.intersect(&ray) {
                hits += 1;
                walls.errors("shaft", &ray, &hit);
            }
        }
        assert!(hits > 3900, "{hits} hits");
    }
}

/// What is reported of a hit lies in the interval of its ray, and is the same for a filter, a visit and an answer.
#[test]
fn hits_are_in_the_interval_and_the_same_everywhere() {
    let mut rng = Rng::new(54);
    let corner = |y: f64, z: f64| [1.0, y * 0.05, z * 5000.0];
    let quad = [
        corner(-1.0, -1.0),
        corner(1.0, -1.0),
        corner(1.0, 1.0),
        corner(-1.0, 1.0),
    ];
    let walls = Walls::new(&[quad], true);
    let mut moved = 0;
    for _ in 0..2000 {
        let mut unit = || f64::from(rng.unit()) - 0.5;
        let to = [1.0, unit() * 0.09, unit() * 9000.0];
        let ray = walls.ray([-unit(), to[1] + unit(), to[2] + unit()], to);
        let Some(hit) = walls.bvh.intersect(&ray) else {
            continue;
        };
        let seen = std::cell::Cell::new(None);
        let filter = |hit: &Hit| {
            seen.set(Some(*hit));
            true
        };
        let filtered = walls.bvh.query(&ray).filter(&filter).intersect();
        assert_eq!((filtered, seen.get()), (Some(hit), Some(hit)), "{ray:?}");
        let all = walls.bvh.query(&ray).all_hits();
        assert_eq!(all.first(), Some(&hit), "{ray:?}");
        let batch = [ray; 20];
        let mut hits = [None; 20];
        walls.bvh.batch(&batch).intersect_into(&mut hits);
        assert_eq!(hits, [Some(hit); 20], "{ray:?}");
        // An interval that begins or ends next to the distance that decides.
        for (tnear, tfar) in [(hit.t, f32::INFINITY), (0.0, hit.t)] {
            let ray = Ray { tnear, tfar, ..ray };
            if let Some(hit) = walls.bvh.intersect(&ray) {
                moved += 1;
                assert!(tnear < hit.t && hit.t < tfar, "{ray:?} {hit:?}");
            }
        }
    }
    assert!(moved > 0, "the distances never differed");
}
