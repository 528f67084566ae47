//! Loop's subdivision surfaces (Loop 1987, "Smooth subdivision surfaces based on triangles"), with the weights of pbrt-v3.
//!
//! Every step divides each triangle into four and moves the vertices. In the end all vertices go to where infinitely many steps
//! would take them.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// A mesh whose edges have at most two triangles, on opposite sides.
pub(super) struct Surface {
    pub positions: Vec<DVec3>,
    pub indices: Vec<[u32; 3]>,
    /// Neighbours of each vertex, in order.
    rings: Vec<Ring>,
}

/// A mesh that is no surface: the edge between these vertices has a third triangle, or one on the wrong side; or the triangles at
/// the first of them, which is then given twice, do not follow each other.
#[derive(Debug, PartialEq)]
pub(super) struct NoSurface(pub [u32; 2]);

/// The vertices around one vertex, in the order in which pbrt-v3 walks: clockwise around inner vertices, and counterclockwise from end
/// to end at the border, where triangles are counterclockwise.
#[derive(Clone, Default)]
struct Ring {
    vertices: Vec<u32>,
    is_border: bool,
}

impl Ring {
    /// Weight of each neighbour in one step.
    fn beta(&self) -> f64 {
        match self.vertices.len() {
            3 => 3.0 / 16.0,
            count => 3.0 / (8.0 * count as f64),
        }
    }

    /// The vertex with a share of each of its neighbours, at a border of those along the border.
    fn blended(&self, at: DVec3, positions: &[DVec3], [inner, border]: [f64; 2]) -> DVec3 {
        let place = |vertex: &u32| positions[*vertex as usize];
        match (&self.vertices[..], self.is_border) {
            ([first, .., last], true) => {
                at * (1.0 - 2.0 * border) + (place(first) + place(last)) * border
            }
            (all, false) => {
                let sum: DVec3 = all.iter().map(place).sum();
                at * (1.0 - inner * all.len() as f64) + sum * inner
            }
            // A vertex without triangles.
            _ => at,
        }
    }

    /// Where infinitely many steps take the vertex.
    fn limit(&self, at: DVec3, positions: &[DVec3]) -> DVec3 {
        let gamma = 1.0 / (self.vertices.len() as f64 + 3.0 / (8.0 * self.beta()));
        self.blended(at, positions, [gamma, 1.0 / 5.0])
    }

    /// A normal of any length: the product of two tangents.
    fn normal(&self, at: DVec3, positions: &[DVec3]) -> DVec3 {
        let ring: Vec<DVec3> = self
            .vertices
            .iter()
            .map(|v| positions[*v as usize])
            .collect();
        let count = ring.len();
        if count < 2 {
            return DVec3::ZERO;
        }
        if !self.is_border {
            let (mut s, mut t) = (DVec3::ZERO, DVec3::ZERO);
            for (place, position) in ring.iter().enumerate() {
                let angle = TAU * place as f64 / count as f64;
                s += *position * libm::cos(angle);
                t += *position * libm::sin(angle);
            }
            return s.cross(t);
        }
        let along = ring[count - 1] - ring[0];
        let across = match ring[..] {
            [a, b] => a + b - 2.0 * at,
            [_, b, _] => b - at,
            [a, b, c, d] => 2.0 * (b + c) - a - d - 2.0 * at,
            _ => {
                let theta = PI / (count - 1) as f64;
                let ends = (ring[0] + ring[count - 1]) * libm::sin(theta);
                let inner = (1..count - 1).map(|k| {
                    ring[k] * ((2.0 * libm::cos(theta) - 2.0) * libm::sin(k as f64 * theta))
                });
                -(ends + inner.sum::<DVec3>())
            }
        };
        along.cross(across)
    }
}

impl Surface {
    /// # Errors
    /// [`NoSurface`] where triangles do not make one.
    pub fn new(positions: Vec<DVec3>, indices: Vec<[u32; 3]>) -> Result<Self, NoSurface> {
        let rings = rings(positions.len(), &indices)?;
        Ok(Self {
            positions,
            indices,
            rings,
        })
    }

    /// Divides every triangle into four.
    pub fn divide(&mut self) {
        let old = &self.positions;
        let mut positions: Vec<DVec3> = (old.iter().zip(&self.rings))
            .map(|(at, ring)| ring.blended(*at, old, [ring.beta(), 1.0 / 8.0]))
            .collect();
        // Per edge: its middle, and the vertices opposite of it.
        let mut edges: HashMap<[u32; 2], (u32, DVec3, u32)> = HashMap::new();
        for triangle in &self.indices {
            for corner in 0..3 {
                let [from, to, opposite] = [0, 1, 2].map(|next| triangle[(corner + next) % 3]);
                let middle = positions.len() as u32;
                let (_, sum, count) =
                    edges
                        .entry([from.min(to), from.max(to)])
                        .or_insert_with(|| {
                            positions.push(DVec3::ZERO);
                            (middle, DVec3::ZERO, 0)
                        });
                *sum += old[opposite as usize];
                *count += 1;
            }
        }
        for ([from, to], (middle, sum, count)) in &edges {
            let ends = old[*from as usize] + old[*to as usize];
            positions[*middle as usize] = match count {
                1 => ends / 2.0,
                _ => ends * (3.0 / 8.0) + *sum / 8.0,
            };
        }
        let middle = |from: u32, to: u32| edges[&[from.min(to), from.max(to)]].0;
        let divided = self.indices.iter().flat_map(|&[a, b, c]| {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        });
        self.indices = divided.collect();
        self.positions = positions;
        self.rings = rings(self.positions.len(), &self.indices)
            .unwrap_or_else(|_| unreachable!("a divided surface is a surface"));
    }

    /// Positions on the limit surface, and normals there of any length.
    pub fn limit(&self) -> (Vec<DVec3>, Vec<DVec3>) {
        let vertices = || self.positions.iter().zip(&self.rings);
        let limit: Vec<DVec3> = vertices()
            .map(|(at, ring)| ring.limit(*at, &self.positions))
            .collect();
        let normals = (limit.iter().zip(&self.rings)).map(|(at, ring)| ring.normal(*at, &limit));
        let normals = normals.collect();
        (limit, normals)
    }
}

/// The rings of all vertices of a surface.
fn rings(vertices: usize, indices: &[[u32; 3]]) -> Result<Vec<Ring>, NoSurface> {
    // Per vertex, the ends of its triangles' opposite edges: from, to.
    let mut corners: Vec<Vec<[u32; 2]>> = vec![Vec::new(); vertices];
    for triangle in indices {
        for corner in 0..3 {
            let [at, from, to] = [0, 1, 2].map(|next| triangle[(corner + next) % 3]);
            corners[at as usize].push([from, to]);
        }
    }
    (0..)
        .zip(corners)
        .map(|(at, corners)| ring(at, corners))
        .collect()
}

/// The ring of a vertex whose triangles have these corners besides.
fn ring(at: u32, mut corners: Vec<[u32; 2]>) -> Result<Ring, NoSurface> {
    let Some(&any) = corners.first() else {
        return Ok(Ring::default());
    };
    corners.sort_unstable();
    let mut ends: Vec<u32> = corners.iter().map(|corner| corner[1]).collect();
    ends.sort_unstable();
    let twice = (corners
        .windows(2)
        .find(|two| two[0][0] == two[1][0])
        .map(|two| two[0][0]))
    .or_else(|| {
        ends.windows(2)
            .find(|two| two[0] == two[1])
            .map(|two| two[0])
    })
    .or_else(|| {
        corners
            .iter()
            .flatten()
            .find(|other| **other == at)
            .copied()
    });
    if let Some(other) = twice {
        return Err(NoSurface([at, other]));
    }
    // A corner that follows no other is the first of a border.
    let start = corners
        .iter()
        .find(|corner| ends.binary_search(&corner[0]).is_err());
    let mut now = *start.unwrap_or(&any);
    let mut ring = Ring {
        vertices: vec![now[0]],
        is_border: start.is_some(),
    };
    loop {
        ring.vertices.push(now[1]);
        match corners.binary_search_by_key(&now[1], |corner| corner[0]) {
            Ok(next) if corners[next][0] != ring.vertices[0] => now = corners[next],
            _ => break,
        }
    }
    if ring.vertices.len() != corners.len() + 1 {
        return Err(NoSurface([at, at]));
    }
    if !ring.is_border {
        // It closed where it began.
        ring.vertices.pop();
        ring.vertices.reverse();
    }
    Ok(ring)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn octahedron() -> Surface {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let positions = axes.into_iter().chain(axes.map(|axis| -axis)).collect();
        let mut indices = Vec::new();
        for octant in 0..8_u32 {
            let corner = |axis: u32| axis + 3 * (octant >> axis & 1);
            let [a, b, c] = [corner(0), corner(1), corner(2)];
            // Counterclockwise from outside.
            indices.push(if octant.count_ones().is_multiple_of(2) {
                [a, b, c]
            } else {
                [a, c, b]
            });
        }
        Surface::new(positions, indices).expect("a surface")
    }

    #[test]
    fn a_closed_surface_stays_closed_and_symmetric() {
        let mut surface = octahedron();
        // Loop's limit of a vertex of valence 4 by hand: gamma = 1 / (4 + 3 / (8 * 3/32)) = 1/8.
        let (limit, normals) = surface.limit();
        assert_eq!(limit[0], DVec3::X * 0.5);
        // As in pbrt-v3, normals point inwards where triangles are counterclockwise.
        assert!(normals[0].normalize().dot(DVec3::X) < -0.999_999);
        let before = limit[1];
        for level in 1..4 {
            surface.divide();
            assert_eq!(surface.indices.len(), 8 * 4_usize.pow(level));
            assert!(surface.rings.iter().all(|ring| !ring.is_border));
            let (limit, normals) = surface.limit();
            // A step does not change the limit.
            assert!((limit[1] - before).length() < 1e-12);
            for (at, normal) in limit.iter().zip(&normals) {
                let mirrored = limit.iter().any(|other| (*other + *at).length() < 1e-12);
                assert!(
                    mirrored && at.length() > 0.3 && normal.dot(*at) < 0.0,
                    "{at} {normal}"
                );
            }
        }
    }

    #[test]
    fn a_flat_border_stays_straight() {
        let positions = (0..16)
            .map(|i| DVec3::new(f64::from(i % 4), f64::from(i / 4), 0.0))
            .collect();
        let mut indices = Vec::new();
        for square in 0..9 {
            let a = square % 3 + square / 3 * 4;
            indices.extend([[a, a + 1, a + 5], [a, a + 5, a + 4]]);
        }
        let mut surface = Surface::new(positions, indices).expect("a surface");
        surface.divide();
        surface.divide();
        let (limit, normals) = surface.limit();
        for (at, normal) in limit.iter().zip(&normals) {
            assert!(at.z == 0.0 && at.min_element() >= 0.0 && at.max_element() <= 3.0);
            assert!(
                normal.z < 0.0 && normal.x.abs() + normal.y.abs() < 1e-12,
                "{at}: {normal}"
            );
        }
        let border = limit.iter().filter(|at| at.y == 0.0).count();
        // A cubic spline: on its middle piece, no corner of the square has a share.
        assert_eq!(border, 4 + 1);
    }

    #[test]
    fn what_is_no_surface_is_refused() {
        let positions = || {
            (0..5)
                .map(|i| DVec3::splat(f64::from(i)))
                .collect::<Vec<_>>()
        };
        let refused = |indices: &[[u32; 3]]| Surface::new(positions(), indices.to_vec()).err();
        // Three triangles at an edge, a flipped triangle, two fans at a vertex.
        assert!(refused(&[[0, 1, 2], [1, 0, 3], [0, 1, 4]]).is_some());
        assert!(refused(&[[0, 1, 2], [0, 1, 3]]).is_some());
        assert_eq!(refused(&[[0, 1, 2], [0, 3, 4]]), Some(NoSurface([0, 0])));
        assert!(refused(&[[0, 0, 1]]).is_some());
        assert!(refused(&[[0, 1, 2], [1, 0, 3]]).is_none());
    }
}
