//! Creases: vertices of meshes without normals are split where triangles meet at an angle.
//!
//! A vertex of one side of a room's corner is on the planes of the other sides. Rays from there would miss them, and leave the
//! room. [`inside_edges`] therefore moves such vertices a little into their own side, for rays only.

use crate::Mesh;
use crate::vector::{cross, less, unit};

/// Angle between two triangles in degrees above which their edge is a crease, where a file has no normals.
///
/// A roof and a wall are at 90 degrees. Neighbours in a cylinder of 9 sides are at 40.
pub const CREASE_ANGLE: f64 = 40.0;

/// Most groups around one vertex that are compared with each other.
const MOST_GROUPS: usize = 64;

/// Indices of a mesh whose vertices are split at creases.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Creased {
    /// Three vertices of each triangle, in the order of the triangles.
    pub indices: Vec<[u32; 3]>,
    /// Vertex that each additional vertex is a copy of. Additional vertices have the numbers after the old ones.
    pub copies: Vec<u32>,
}

/// Splits vertices where the normals of adjacent triangles differ by more than `degrees`.
///
/// Triangles around a vertex form a group if they are connected by edges at the vertex without a crease. Groups whose mean
/// normals, weighted by area, differ by no more than the angle are one group. So a single rough edge in a smooth surface
/// splits nothing. The first group keeps the vertex, each other group has a copy of it.
///
/// Triangles without an area stay with the first group. A triangle with an index beyond the positions is left as it is.
pub fn split_at_creases(positions: &[[f32; 3]], indices: &[[u32; 3]], degrees: f64) -> Creased {
    let mut creased = Creased {
        indices: indices.to_vec(),
        copies: Vec::new(),
    };
    let least = libm::cos(degrees.to_radians());
    let areas: Vec<[f64; 3]> = indices.iter().map(|t| area(positions, t)).collect();
    // Corners of each vertex: their number before the vertex, then a sorted list.
    let mut firsts = vec![0_usize; positions.len() + 1];
    let corners = || indices.as_flattened().iter().enumerate();
    let inside = |vertex: u32| (vertex as usize) < positions.len();
    for (_, &vertex) in corners().filter(|(_, vertex)| inside(**vertex)) {
        firsts[vertex as usize + 1] += 1;
    }
    for index in 1..firsts.len() {
        firsts[index] += firsts[index - 1];
    }
    let mut next = firsts.clone();
    let mut sorted = vec![0_usize; firsts[positions.len()]];
    for (corner, &vertex) in corners().filter(|(_, vertex)| inside(**vertex)) {
        let place = &mut next[vertex as usize];
        sorted[*place] = corner;
        *place += 1;
    }
    let mut around = Around::default();
    for vertex in 0..positions.len() {
        let corners = &sorted[firsts[vertex]..firsts[vertex + 1]];
        let groups = around.group(corners, indices, &areas, least);
        let first_copy = positions.len() + creased.copies.len();
        creased
            .copies
            .resize(creased.copies.len() + groups, vertex as u32);
        for (&corner, &group) in corners.iter().zip(&around.groups) {
            if group > 0 {
                creased.indices[corner / 3][corner % 3] = (first_copy + group - 1) as u32;
            }
        }
    }
    creased
}

/// Vertices at edges of surfaces, moved by a distance into their surface; all others as they are.
///
/// An edge of a surface is an edge of one triangle only, which sides of a crease have, too. The move is along the mean direction
/// of the triangles around the vertex, at a right angle to the vertex normal. Vertices without a normal stay.
pub fn inside_edges(mesh: &Mesh, distance: impl Fn([f32; 3]) -> f32) -> Vec<[f32; 3]> {
    let Mesh {
        positions,
        normals,
        indices,
        ..
    } = mesh;
    let edges_of = |[a, b, c]: [u32; 3]| [(a, b), (b, c), (c, a)];
    let sorted = |(a, b): (u32, u32)| (a.min(b), a.max(b));
    let mut edges: Vec<(u32, u32)> = indices.iter().copied().flat_map(edges_of).collect();
    edges.iter_mut().for_each(|edge| *edge = sorted(*edge));
    edges.sort_unstable();
    let mut inwards: Vec<Option<[f64; 3]>> = vec![None; positions.len()];
    for same in edges.chunk_by(|a, b| a == b) {
        if let [(a, b)] = same {
            for &end in [a, b] {
                if let Some(inwards) = inwards.get_mut(end as usize) {
                    *inwards = Some([0.0; 3]);
                }
            }
        }
    }
    drop(edges);
    for triangle in indices {
        for turn in 0..3 {
            let [a, b, c] = [0, 1, 2].map(|next| triangle[(turn + next) % 3] as usize);
            if let Some(Some(sum)) = inwards.get_mut(a)
                && let (Some(b), Some(c)) = (positions.get(b), positions.get(c))
                && let Some(halfway) = halfway(&positions[a], b, c)
            {
                *sum = [0, 1, 2].map(|axis| sum[axis] + halfway[axis]);
            }
        }
    }
    let moved = |(vertex, position): (usize, &[f32; 3])| -> Option<[f32; 3]> {
        let sum = inwards[vertex]?;
        let normal = unit(normals.get(vertex)?.map(f64::from))?;
        let along = dot(sum, normal);
        let flat = [0, 1, 2].map(|axis| sum[axis] - along * normal[axis]);
        let inwards = unit(flat)?;
        let distance = f64::from(distance(*position));
        let place = |axis: usize| f64::from(position[axis]) + distance * inwards[axis];
        Some([0, 1, 2].map(|axis| place(axis) as f32))
    };
    let all = positions.iter().enumerate();
    all.map(|vertex| moved(vertex).unwrap_or(*vertex.1))
        .collect()
}

/// Direction from a corner of a triangle halfway between the others. `None` if there is none.
fn halfway(corner: &[f32; 3], b: &[f32; 3], c: &[f32; 3]) -> Option<[f64; 3]> {
    let (b, c) = (unit(less(b, corner))?, unit(less(c, corner))?);
    unit([0, 1, 2].map(|axis| b[axis] + c[axis]))
}

/// Normal of a triangle, twice as long as its area; 0 if it has none.
fn area(positions: &[[f32; 3]], triangle: &[u32; 3]) -> [f64; 3] {
    let corners = triangle.map(|index| positions.get(index as usize));
    let [Some(a), Some(b), Some(c)] = corners else {
        return [0.0; 3];
    };
    let area = cross(less(b, a), less(c, a));
    match area.iter().all(|x| x.is_finite()) {
        true => area,
        false => [0.0; 3],
    }
}

/// The triangles around a vertex, with memory that is used again.
#[derive(Default)]
struct Around {
    /// Edges at the vertex: the other end, and the place of the corner.
    edges: Vec<(u32, usize)>,
    /// Place of a corner in the same group; a corner that has its own place stands for its group.
    parents: Vec<usize>,
    normals: Vec<Option<[f64; 3]>>,
    /// Corners that stand for groups, and the mean normals of these.
    roots: Vec<usize>,
    means: Vec<[f64; 3]>,
    /// Group of each corner, counted from 0.
    groups: Vec<usize>,
}

impl Around {
    /// Groups the corners at a vertex. Returns the number of groups after the first.
    fn group(
        &mut self,
        corners: &[usize],
        indices: &[[u32; 3]],
        areas: &[[f64; 3]],
        least: f64,
    ) -> usize {
        self.parents.clear();
        self.parents.extend(0..corners.len());
        self.normals.clear();
        let normals = corners.iter().map(|corner| unit(areas[corner / 3]));
        self.normals.extend(normals);
        self.edges.clear();
        for (place, &corner) in corners.iter().enumerate() {
            let triangle = indices[corner / 3];
            let others = [1, 2].map(|turn| triangle[(corner % 3 + turn) % 3]);
            self.edges.extend(others.map(|other| (other, place)));
        }
        self.edges.sort_unstable();
        for index in 1..self.edges.len() {
            let [(a, i), (b, j)] = [self.edges[index - 1], self.edges[index]];
            if let (true, Some(m), Some(n)) = (a == b, self.normals[i], self.normals[j])
                && dot(m, n) >= least
            {
                self.join(i, j);
            }
        }
        self.join_alike(corners, areas, least);
        self.number()
    }

    fn root(&self, mut place: usize) -> usize {
        while self.parents[place] != place {
            place = self.parents[place];
        }
        place
    }

    /// Makes one group of two. The first corner of both stands for it.
    fn join(&mut self, i: usize, j: usize) {
        let (i, j) = (self.root(i), self.root(j));
        let (first, second) = (i.min(j), i.max(j));
        self.parents[second] = first;
    }

    /// Joins groups whose mean normals differ by no more than the angle.
    fn join_alike(&mut self, corners: &[usize], areas: &[[f64; 3]], least: f64) {
        self.roots.clear();
        let some = (0..corners.len()).filter(|&place| self.normals[place].is_some());
        self.roots
            .extend(some.filter(|&place| self.parents[place] == place));
        if self.roots.len() < 2 || self.roots.len() > MOST_GROUPS {
            return;
        }
        self.means.clear();
        self.means.resize(corners.len(), [0.0; 3]);
        for (place, corner) in corners.iter().enumerate() {
            let (root, area) = (self.root(place), areas[corner / 3]);
            let mean = &mut self.means[root];
            *mean = [0, 1, 2].map(|axis| mean[axis] + area[axis]);
        }
        let roots = std::mem::take(&mut self.roots);
        for (index, &i) in roots.iter().enumerate() {
            for &j in &roots[index + 1..] {
                if let (Some(m), Some(n)) = (unit(self.means[i]), unit(self.means[j]))
                    && dot(m, n) >= least
                {
                    self.join(i, j);
                }
            }
        }
        self.roots = roots;
    }

    /// Numbers the groups in the order of their first corners. Returns the number of groups after the first.
    fn number(&mut self) -> usize {
        self.groups.clear();
        self.groups.resize(self.parents.len(), 0);
        let mut count = 0;
        for place in 0..self.parents.len() {
            let root = self.root(place);
            self.groups[place] = match (self.normals[place], root == place) {
                (None, _) => 0,
                (Some(_), true) => {
                    count += 1;
                    count - 1
                }
                (Some(_), false) => self.groups[root],
            };
        }
        count.saturating_sub(1)
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vertex_normals;

    /// Corners of a unit cube, and its sides as pairs of triangles that face outside.
    fn cube() -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let bit = |corner: u32, axis: u32| (corner >> axis & 1) as f32;
        let corner = |corner| [0, 1, 2].map(|axis| bit(corner, axis));
        let quads = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let triangles = quads.map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
        ((0..8).map(corner).collect(), triangles.concat())
    }

    fn split(positions: &[[f32; 3]], indices: &[[u32; 3]]) -> (Vec<[f32; 3]>, Creased) {
        let creased = split_at_creases(positions, indices, CREASE_ANGLE);
        let mut all = positions.to_vec();
        all.extend(
            creased
                .copies
                .iter()
                .map(|&vertex| positions[vertex as usize]),
        );
        (all, creased)
    }

    #[test]
    fn corners_of_a_cube_have_three_normals() {
        let (positions, indices) = cube();
        let (all, creased) = split(&positions, &indices);
        assert_eq!(all.len(), 24);
        let normals = vertex_normals(&all, &creased.indices);
        for (old, new) in indices.iter().zip(&creased.indices) {
            let face = vertex_normals(&positions, &[*old])[old[0] as usize];
            for (old, new) in old.iter().zip(new) {
                assert_eq!(all[*new as usize], positions[*old as usize]);
                assert_eq!(normals[*new as usize], face);
            }
        }
        // Every vertex is still used by its first triangle.
        assert_eq!(creased.indices[0], indices[0]);
    }

    /// A tube of so many sides, without ends.
    fn tube(sides: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let point = |index: u32| {
            let angle = f64::from(index / 2) * std::f64::consts::TAU / f64::from(sides);
            [
                libm::cos(angle) as f32,
                libm::sin(angle) as f32,
                (index % 2) as f32,
            ]
        };
        let triangles = (0..sides).flat_map(|side| {
            let [a, b] = [2 * side, 2 * ((side + 1) % sides)];
            [[a, b, a + 1], [b, b + 1, a + 1]]
        });
        ((0..2 * sides).map(point).collect(), triangles.collect())
    }

    #[test]
    fn round_surfaces_stay_as_they_are() {
        for (sides, copies) in [(6, 12), (8, 16), (10, 0), (30, 0)] {
            let (positions, indices) = tube(sides);
            let (_, creased) = split(&positions, &indices);
            assert_eq!(creased.copies.len(), copies, "{sides} sides");
            assert_eq!(creased.indices == indices, copies == 0);
        }
    }

    #[test]
    fn one_rough_edge_splits_nothing() {
        // Six triangles around a vertex in a plane, one of their ends raised.
        let ring = |index: u32| {
            let angle = f64::from(index) * std::f64::consts::TAU / 6.0;
            let height = if index == 0 { 0.7 } else { 0.0 };
            [libm::cos(angle) as f32, libm::sin(angle) as f32, height]
        };
        let mut positions = vec![[0.0; 3]];
        positions.extend((0..6).map(ring));
        let indices: Vec<[u32; 3]> = (0..6).map(|i| [0, 1 + i, 1 + (i + 1) % 6]).collect();
        let (_, creased) = split(&positions, &indices);
        assert!(creased.copies.is_empty(), "{creased:?}");
    }

    #[test]
    fn surfaces_that_share_a_vertex_only_are_split_if_they_differ() {
        let mut positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
        positions.extend([[-1.0, 0.0, 0.0], [-1.0, -1.0, 0.0], [-1.0, 0.0, 1.0]]);
        // Twice upwards, then upwards and sideways.
        let (_, creased) = split(&positions, &[[0, 1, 2], [0, 3, 4]]);
        assert!(creased.copies.is_empty());
        let (_, creased) = split(&positions, &[[0, 1, 2], [0, 3, 5]]);
        assert_eq!(creased.copies, [0]);
        assert_eq!(creased.indices, [[0, 1, 2], [6, 3, 5]]);
    }

    #[test]
    fn vertices_at_edges_move_into_their_surface() {
        let (positions, indices) = cube();
        let mut mesh = Mesh::default();
        mesh.push((&positions, &indices), &[], &[], false);
        assert_eq!(inside_edges(&mesh, |_| 0.25), positions, "no edges");
        let mut mesh = Mesh::default();
        mesh.push_creased((&positions, &indices), &[], false);
        let moved = inside_edges(&mesh, |_| 0.25);
        for (index, ((from, to), normal)) in mesh
            .positions
            .iter()
            .zip(&moved)
            .zip(&mesh.normals)
            .enumerate()
        {
            for axis in 0..3 {
                let is_flat = normal[axis] == 0.0;
                let by = (to[axis] - from[axis]).abs();
                // Towards the middle of its side, along the side only.
                let inside = (to[axis] - 0.5).abs() < (from[axis] - 0.5).abs();
                assert!(
                    if is_flat {
                        inside && by > 0.1
                    } else {
                        by == 0.0
                    },
                    "{index}"
                );
            }
            let length: f32 = (0..3).map(|axis| (to[axis] - from[axis]).powi(2)).sum();
            assert!((length.sqrt() - 0.25).abs() < 1e-6, "{index}");
        }
    }

    #[test]
    fn triangles_without_area_join_nothing() {
        let (positions, mut indices) = cube();
        indices.insert(0, [0, 0, 1]);
        indices.push([7, 7, 7]);
        indices.push([0, 1, 99]);
        let (all, creased) = split(&positions, &indices);
        assert_eq!(all.len(), 24);
        assert_eq!(creased.indices[0], [0, 0, 1]);
        assert_eq!(creased.indices[13..], [[7, 7, 7], [0, 1, 99]]);
        assert_eq!(
            split_at_creases(&[], &[[0, 1, 2]], 40.0).indices,
            [[0, 1, 2]]
        );
    }
}
