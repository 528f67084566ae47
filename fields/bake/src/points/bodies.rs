//! Bodies of a mesh: which triangles hang together, what is closed, and which way it faces.
//!
//! A body is closed if each of its edges belongs to exactly two triangles. Files say in three ways which corners are one:
//! by the same vertex; by vertices of one object that lie within a hundred thousandth of its size; by the same place in
//! several objects, for example in one for walls and one for roofs. What is closed in an earlier way is taken out before
//! the next one, because houses that touch share edges of four triangles, although each of them is closed by itself.
//!
//! The triangles of a body are turned until neighbours agree. A closed body then faces outwards, which is where its volume
//! is positive; an open one keeps the side that most of its area has.

use std::collections::HashMap;

use rayon::prelude::*;

use crate::Mesh;
use crate::vector::{cross, dot, less, minus, unit};

/// Distance within which corners of an object are one, over the size of the object.
const WELD: f64 = 1e-5;

/// Bodies of a mesh, numbered in the order of their first triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bodies {
    /// Body of each triangle, `[m]`.
    pub of_triangle: Vec<u32>,
    /// Whether each body is closed.
    pub is_closed: Vec<bool>,
    /// Number of edges of each triangle of an open body where the body ends, `[m]`.
    pub(crate) rims: Vec<u8>,
    /// Number of closed bodies of which triangles were turned.
    pub turned: usize,
}

/// Sets of triangles that hang together. Each triangle knows whether it is turned relative to the first one of its set.
struct Sets {
    /// Another triangle of the set, nearer to the first one, and whether this one is turned relative to it.
    next: Vec<(u32, bool)>,
}

impl Sets {
    fn new(count: usize) -> Self {
        let next = (0..count as u32).map(|triangle| (triangle, false));
        Self {
            next: next.collect(),
        }
    }

    /// First triangle of the set, and whether this one is turned relative to it.
    fn first(&mut self, triangle: u32) -> (u32, bool) {
        let (mut at, mut is_turned) = (triangle, false);
        while self.next[at as usize].0 != at {
            let (next, turns) = self.next[at as usize];
            // Half of the way is left out next time; the turns of that half are added up.
            let (after, more) = self.next[next as usize];
            self.next[at as usize] = (after, turns != more);
            is_turned ^= turns != more;
            at = after;
        }
        (at, is_turned)
    }

    /// Joins the sets of two triangles, which are turned to each other or not. `false` if the sets say otherwise.
    fn join(&mut self, [a, b]: [u32; 2], is_turned: bool) -> bool {
        let ((a, turned_a), (b, turned_b)) = (self.first(a), self.first(b));
        let is_turned = is_turned ^ turned_a ^ turned_b;
        if a == b {
            return !is_turned;
        }
        // The smaller number stays, so that sets begin with their first triangle.
        self.next[a.max(b) as usize] = (a.min(b), is_turned);
        true
    }
}

impl Mesh {
    /// Turns triangles and normals so that each [body](Bodies) faces one way, and closed ones outwards. `objects` has the
    /// number of the object of each triangle.
    ///
    /// A mesh that is already so keeps all its bits. Triangles without area belong to open bodies of their own, and so do
    /// bodies without volume, such as a sheet that was modelled with both sides.
    pub fn orient(&mut self, objects: &[u32]) -> Bodies {
        let count = self.indices.len();
        let mut bodies = Bodies {
            of_triangle: vec![u32::MAX; count],
            rims: vec![0; count],
            ..Bodies::default()
        };
        let mut is_turned = vec![false; count];
        let mut rest: Vec<u32> = (0..count as u32).collect();
        for way in 0..3 {
            let corners: Vec<[u32; 3]> = match way {
                0 => self.indices.clone(),
                1 => self.welded(&rest, objects),
                _ => self.same_places(&rest),
            };
            let corners = |index: usize| match way {
                0 => corners[rest[index] as usize],
                _ => corners[index],
            };
            let (mut sets, rims) = sets(rest.len(), corners);
            let found: Vec<(u32, bool)> = (0..rest.len() as u32).map(|i| sets.first(i)).collect();
            let mut is_open = vec![false; rest.len()];
            // Six times the volume around the first corner of each set, its size, and how much area is turned.
            let mut sums = vec![[0.0_f64; 3]; rest.len()];
            for (index, &(first, turned)) in found.iter().enumerate() {
                is_open[first as usize] |= rims[index] > 0;
                let at = |corner: u32| &self.positions[corner as usize];
                let centre = at(self.indices[rest[first as usize] as usize][0]);
                let [a, b, c] =
                    self.indices[rest[index] as usize].map(|corner| less(at(corner), centre));
                let sign = if turned { -1.0 } else { 1.0 };
                let normal = cross(minus(b, a), minus(c, a));
                let [volume, size, area] = &mut sums[first as usize];
                *volume += sign * dot(a, cross(b, c));
                *size = size.max(dot(a, a)).max(dot(b, b)).max(dot(c, c));
                *area += sign * dot(normal, normal).sqrt();
            }
            let mut left = Vec::new();
            let mut known = HashMap::new();
            for (index, &(first, turned)) in found.iter().enumerate() {
                let triangle = rest[index] as usize;
                let [volume, size, area] = sums[first as usize];
                let is_closed = !is_open[first as usize] && volume.abs() > 1e-9 * size.powf(1.5);
                if !is_closed && way < 2 {
                    left.push(rest[index]);
                    continue;
                }
                let body = *known.entry(first).or_insert_with(|| {
                    bodies.is_closed.push(is_closed);
                    bodies.is_closed.len() as u32 - 1
                });
                bodies.of_triangle[triangle] = body;
                bodies.rims[triangle] = if is_closed { 0 } else { rims[index] };
                let is_inverse = if is_closed { volume < 0.0 } else { area < 0.0 };
                is_turned[triangle] = turned != is_inverse;
            }
            rest = left;
        }
        self.turn(&is_turned);
        let mut with_turned = vec![false; bodies.is_closed.len()];
        for (&body, &is_turned) in bodies.of_triangle.iter().zip(&is_turned) {
            with_turned[body as usize] |= is_turned && bodies.is_closed[body as usize];
        }
        bodies.turned = with_turned.into_iter().filter(|&turned| turned).count();
        bodies
    }

    /// Turns triangles. Normals of their vertices that came from the triangles come from them again, and others are turned where
    /// they contradict.
    pub(crate) fn turn(&mut self, is_turned: &[bool]) {
        if !is_turned.contains(&true) {
            return;
        }
        let turned = self.indices.iter().zip(is_turned);
        let turned = turned.filter(|(_, is_turned)| **is_turned);
        let mut sums: HashMap<u32, [[f64; 3]; 2]> = HashMap::new();
        sums.extend(
            turned.flat_map(|(corners, _)| corners.map(|corner| (corner, Default::default()))),
        );
        for (triangle, is_turned) in is_turned.iter().enumerate() {
            let corners = self.indices[triangle];
            let normal = self.twice_of(corners);
            let sign = if *is_turned { -1.0 } else { 1.0 };
            for corner in corners {
                if let Some([before, after]) = sums.get_mut(&corner) {
                    *before = [0, 1, 2].map(|axis| before[axis] + normal[axis]);
                    *after = [0, 1, 2].map(|axis| after[axis] + sign * normal[axis]);
                }
            }
            if *is_turned {
                self.indices[triangle].swap(1, 2);
            }
        }
        for (corner, [before, after]) in sums {
            let normal = &mut self.normals[corner as usize];
            let [before, after] = [before, after].map(|sum| unit(sum).unwrap_or_default());
            if less(&before.map(|x| x as f32), normal)
                .iter()
                .all(|x| x.abs() < 1e-3)
            {
                *normal = after.map(|x| x as f32);
            } else if dot(normal.map(f64::from), after) < 0.0 {
                *normal = normal.map(|x| -x);
            }
        }
    }

    /// Corners of some triangles, by numbers that are the same for the same place.
    fn same_places(&self, triangles: &[u32]) -> Vec<[u32; 3]> {
        let mut known = HashMap::new();
        let mut number = |corner: u32| {
            // 0 and -0 are the same place.
            let place = self.positions[corner as usize].map(|x| (x + 0.0).to_bits());
            *known.entry(place).or_insert(corner)
        };
        let corners = triangles.iter().map(|&i| self.indices[i as usize]);
        corners.map(|corners| corners.map(&mut number)).collect()
    }

    /// Corners of some triangles, by numbers that are the same for near places of an object.
    fn welded(&self, triangles: &[u32], objects: &[u32]) -> Vec<[u32; 3]> {
        let mut sizes = HashMap::new();
        for &triangle in triangles {
            let (low, high) = sizes
                .entry(objects[triangle as usize])
                .or_insert(([f32::MAX; 3], [f32::MIN; 3]));
            for corner in self.indices[triangle as usize] {
                let point = self.positions[corner as usize];
                for axis in 0..3 {
                    low[axis] = point[axis].min(low[axis]);
                    high[axis] = point[axis].max(high[axis]);
                }
            }
        }
        // Corners by the cell that they lie in. Those that are one lie in the same cell or in neighbours.
        let mut cells: HashMap<(u32, [i64; 3]), Vec<[u32; 2]>> = HashMap::new();
        let (mut known, mut count) = (HashMap::new(), 0);
        let mut number = |object: u32, corner: u32| {
            *known.entry((object, corner)).or_insert_with(|| {
                let (low, high) = sizes[&object];
                let apart = less(&high, &low);
                let near = (WELD * dot(apart, apart).sqrt()).max(f64::MIN_POSITIVE);
                let point = &self.positions[corner as usize];
                let place = less(point, &low).map(|x| x / near);
                // Twice as large as what is near, so that half of the neighbours are too far away.
                let sides = place.map(|x| {
                    let cell = (0.5 * x).floor();
                    [
                        cell,
                        if 0.5 * x - cell < 0.5 {
                            cell - 1.0
                        } else {
                            cell + 1.0
                        },
                    ]
                });
                let around =
                    (0..8).map(|i| [0, 1, 2].map(|axis| sides[axis][i >> axis & 1] as i64));
                let mut others =
                    around.flat_map(|cell| cells.get(&(object, cell)).into_iter().flatten());
                let is_near = |[_, other]: &&[u32; 2]| {
                    let apart = less(&self.positions[*other as usize], point);
                    dot(apart, apart) <= near * near
                };
                match others.find(is_near) {
                    Some(&[number, _]) => number,
                    None => {
                        let cell = sides.map(|[cell, _]| cell as i64);
                        cells
                            .entry((object, cell))
                            .or_default()
                            .push([count, corner]);
                        count += 1;
                        count - 1
                    }
                }
            })
        };
        let of = |&triangle: &u32| {
            let object = objects[triangle as usize];
            self.indices[triangle as usize].map(|corner| number(object, corner))
        };
        triangles.iter().map(of).collect()
    }
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
}

/// Triangles that hang together by edges of exactly two triangles, and how many edges each has that are not so, or where
/// it contradicts its neighbour.
fn sets(count: usize, corners: impl Fn(usize) -> [u32; 3]) -> (Sets, Vec<u8>) {
    // Ends of each edge, the smaller number first; its triangle, and whether it runs from the smaller number.
    let mut edges: Vec<([u32; 2], u32, bool)> = Vec::with_capacity(3 * count);
    let mut rims = vec![0; count];
    for index in 0..count {
        let [a, b, c] = corners(index);
        // A triangle that is a line by now leaves its neighbours to each other.
        if a != b && b != c && c != a {
            for [from, to] in [[a, b], [b, c], [c, a]] {
                edges.push(([from.min(to), from.max(to)], index as u32, from < to));
            }
        } else {
            rims[index] = 3;
        }
    }
    edges.par_sort_unstable();
    let mut sets = Sets::new(count);
    for edge in edges.chunk_by(|a, b| a.0 == b.0) {
        let is_good = match *edge {
            [(_, a, runs_a), (_, b, runs_b)] => sets.join([a, b], runs_a == runs_b),
            _ => false,
        };
        if !is_good {
            for &(_, index, _) in edge {
                rims[index as usize] += 1;
            }
        }
    }
    (sets, rims)
}

#[cfg(test)]
mod tests {
    use antumbra_testkit::Rng;

    use super::*;

    /// A box with its own eight vertices.
    fn push_box(mesh: &mut Mesh, low: [f32; 3], high: [f32; 3]) {
        let corner = |i: usize| [0, 1, 2].map(|axis| [low, high][i >> axis & 1][axis]);
        let corners: Vec<[f32; 3]> = (0..8).map(corner).collect();
        let quads = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [1, 3, 7, 5],
            [3, 2, 6, 7],
            [2, 0, 4, 6],
        ];
        let indices: Vec<[u32; 3]> = quads
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect();
        mesh.push((&corners, &indices), &[], &[], false);
    }

    fn volume(mesh: &Mesh) -> f64 {
        let at = |corner: u32| mesh.positions[corner as usize].map(f64::from);
        let all = mesh
            .indices
            .iter()
            .map(|&[a, b, c]| dot(at(a), cross(at(b), at(c))) / 6.0);
        all.sum()
    }

    /// The same triangles, each with vertices of its own, which are moved by up to so much.
    fn apart(mesh: &Mesh, most: f32, rng: &mut Rng) -> Mesh {
        let corners = mesh.indices.as_flattened().iter();
        let mut positions: Vec<[f32; 3]> = corners.map(|&i| mesh.positions[i as usize]).collect();
        for x in positions.as_flattened_mut() {
            *x += most * (rng.range(-1.0, 1.0));
        }
        let indices: Vec<[u32; 3]> = (0..mesh.indices.len() as u32)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect();
        let mut apart = Mesh::default();
        apart.push((&positions, &indices), &[], &[], false);
        apart
    }

    #[test]
    fn closed_bodies_face_outwards_whichever_way_they_were_wound() {
        let mut rng = Rng::new(1);
        // A house against a higher one: walls and edges coincide in part. Both are objects of their own.
        let mut town = Mesh::default();
        push_box(&mut town, [0.0, 0.0, 0.0], [10.0, 10.0, 10.0]);
        push_box(&mut town, [10.0, 0.0, 0.0], [20.0, 10.0, 20.0]);
        push_box(&mut town, [300.0, 0.0, 0.0], [310.0, 10.0, 20.0]);
        let objects: Vec<u32> = (0..36).map(|triangle| triangle / 12).collect();
        assert!(volume(&town) > 0.0);
        let same = town.orient(&objects);
        assert_eq!((same.turned, &same.is_closed[..]), (0, &[true; 3][..]));
        assert_eq!(same.of_triangle, objects);
        for most in [0.0, 3e-5] {
            for _ in 0..20 {
                let wanted = if most > 0.0 {
                    apart(&town, most, &mut rng)
                } else {
                    town.clone()
                };
                let mut mesh = wanted.clone();
                let turned: Vec<bool> = (0..36).map(|_| rng.below(2) == 1).collect();
                mesh.turn(&turned);
                let bodies = mesh.orient(&objects);
                assert_eq!(bodies.is_closed, [true; 3], "moved by {most}");
                assert_eq!(mesh.indices, wanted.indices);
                assert_eq!(bodies.of_triangle, objects);
                for (found, normal) in mesh.normals.iter().zip(&wanted.normals) {
                    assert!(
                        less(found, normal).iter().all(|x| x.abs() < 1e-6),
                        "{found:?} {normal:?}"
                    );
                }
                let touched = |body: u32| (0..36).any(|i| turned[i] && objects[i] == body);
                assert_eq!(bodies.turned, (0..3).filter(|&body| touched(body)).count());
            }
        }
        // Too far apart to be one corner.
        let bodies = apart(&town, 0.01, &mut rng).orient(&objects);
        assert!(!bodies.is_closed.contains(&true));
    }

    #[test]
    fn walls_and_roofs_of_several_objects_are_a_body() {
        let mut mesh = Mesh::default();
        push_box(&mut mesh, [0.0; 3], [4.0, 5.0, 6.0]);
        let mut mesh = apart(&mesh, 0.0, &mut Rng::new(2));
        mesh.turn(&[true; 12]);
        // The quads along z are floor and roof.
        let objects: Vec<u32> = (0..12).map(|triangle| u32::from(triangle < 4)).collect();
        let bodies = mesh.orient(&objects);
        assert_eq!((bodies.is_closed, bodies.turned), (vec![true], 1));
        assert!((volume(&mesh) - 120.0).abs() < 1e-3);
    }

    #[test]
    fn open_bodies_keep_the_side_of_most_of_their_area() {
        let mut mesh = Mesh::default();
        push_box(&mut mesh, [0.0; 3], [4.0, 5.0, 6.0]);
        // Without the floor. One wall is wound the other way.
        mesh.indices.drain(0..2);
        let wanted = mesh.indices.clone();
        mesh.indices[4].swap(1, 2);
        let bodies = mesh.orient(&[0; 10]);
        assert_eq!(mesh.indices, wanted);
        assert_eq!((bodies.is_closed, bodies.turned), (vec![false], 0));
        assert_eq!(
            bodies
                .rims
                .iter()
                .map(|&edges| u32::from(edges))
                .sum::<u32>(),
            4
        );

        // A sheet with both sides has no volume, and a strip with a twist no sides.
        let mut sheet = Mesh::default();
        sheet.push(
            (
                &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
                &[[0, 1, 2], [0, 2, 1]],
            ),
            &[],
            &[],
            false,
        );
        let before = sheet.clone();
        assert_eq!(sheet.orient(&[0, 0]).is_closed, [false]);
        assert_eq!(sheet.indices, before.indices);
        let ring: Vec<[f32; 3]> = (0..16)
            .map(|i| {
                let turn = (i / 2) as f32 * std::f32::consts::TAU / 8.0;
                let side = if i % 2 == 0 { 1.0 } else { -1.0 };
                let radius = 3.0 + side * (0.5 * turn).cos();
                [
                    radius * turn.cos(),
                    radius * turn.sin(),
                    side * (0.5 * turn).sin(),
                ]
            })
            .collect();
        let strip = (0..16_u32).map(|i| {
            // The last pair meets the first one upside down.
            let at = |j: u32| if j < 16 { j } else { (j - 16) ^ 1 };
            if i % 2 == 0 {
                [at(i), at(i + 1), at(i + 2)]
            } else {
                [at(i), at(i + 2), at(i + 1)]
            }
        });
        let mut strip_mesh = Mesh::default();
        strip_mesh.push((&ring, &strip.collect::<Vec<_>>()), &[], &[], false);
        assert!(!strip_mesh.orient(&[0; 16]).is_closed.contains(&true));
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
