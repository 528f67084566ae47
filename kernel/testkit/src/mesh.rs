//! Triangle meshes, from ordinary to degenerate.

use crate::rng::Rng;

/// Indexed triangle mesh with a name for messages.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Name of the generator.
    pub name: &'static str,
    /// Vertex positions, `[vertices, 3]`.
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices of every triangle, `[triangles, 3]`.
    pub indices: Vec<[u32; 3]>,
}

impl Mesh {
    /// Makes a mesh of triangles that share no vertices.
    fn of_triangles(
        name: &'static str,
        triangles: impl IntoIterator<Item = [[f32; 3]; 3]>,
    ) -> Self {
        let positions: Vec<_> = triangles.into_iter().flatten().collect();
        let indices = (0..positions.len() as u32 / 3)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect();
        Self {
            name,
            positions,
            indices,
        }
    }

    /// Corners of a triangle.
    ///
    /// # Panics
    /// If there is no triangle `index`.
    pub fn triangle(&self, index: usize) -> [[f32; 3]; 3] {
        self.indices[index].map(|vertex| self.positions[vertex as usize])
    }

    /// Copy with another name, in which `f` maps every position.
    pub fn map(&self, name: &'static str, f: impl FnMut([f32; 3]) -> [f32; 3]) -> Self {
        let positions = self.positions.iter().copied().map(f).collect();
        Self {
            name,
            positions,
            indices: self.indices.clone(),
        }
    }
}

/// Generator of meshes of about `size` triangles, with details from `rng`.
pub type Generator = fn(rng: &mut Rng, size: usize) -> Mesh;

/// Generators of every kind of geometry that tests should try.
///
/// Coordinates are finite. See [`spoiled`] for meshes with NaN and infinities.
pub const ALL: &[Generator] = &[
    empty,
    single,
    soup,
    slivers,
    fan,
    bumpy_grid,
    coincident,
    axis_aligned,
    |rng, size| soup(rng, size).map("huge", |p| p.map(|x| x * 1e15)),
    |rng, size| soup(rng, size).map("tiny", |p| p.map(|x| x * 1e-15)),
    |rng, size| soup(rng, size).map("subnormal", |p| p.map(|x| x * 1e-39)),
    |rng, size| bumpy_grid(rng, size).map("far away", |[x, y, z]| [x + 1e6, y - 3e6, z + 2e6]),
    mixed_scales,
    |rng, size| soup(rng, size).map("flat", |[x, _, z]| [x, 0.5, z]),
    |_, size| icosphere((size / 20).max(1).ilog2().div_ceil(2)),
];

/// Mesh without triangles.
pub fn empty(_: &mut Rng, _: usize) -> Mesh {
    Mesh::of_triangles("empty", [])
}

/// Single triangle.
pub fn single(rng: &mut Rng, _: usize) -> Mesh {
    Mesh::of_triangles("single", [[rng.point(1.0), rng.point(1.0), rng.point(1.0)]])
}

/// Triangles of all sizes at random places.
pub fn soup(rng: &mut Rng, size: usize) -> Mesh {
    Mesh::of_triangles(
        "soup",
        (0..size).map(|_| {
            let center = rng.point(1.0);
            let extent = rng.unit() * rng.unit();
            core::array::from_fn(|_| {
                let offset = rng.point(extent);
                core::array::from_fn(|axis| center[axis] + offset[axis])
            })
        }),
    )
}

/// Triangles that are only a few units in the last place wide, in all directions.
pub fn slivers(rng: &mut Rng, size: usize) -> Mesh {
    Mesh::of_triangles(
        "slivers",
        (0..size).map(|_| {
            let (a, b) = (rng.point(1.0), rng.point(1.0));
            let along = rng.range(-0.5, 1.5);
            let c = core::array::from_fn(|axis| {
                let x = a[axis] + (b[axis] - a[axis]) * along;
                x + rng.range(-2.0, 2.0) * f32::EPSILON
            });
            [a, b, c]
        }),
    )
}

/// Long thin triangles that share one corner.
pub fn fan(rng: &mut Rng, size: usize) -> Mesh {
    let mut positions = vec![rng.point(0.1)];
    positions.extend((0..=size).map(|i| {
        let angle = i as f32 / size as f32 * std::f32::consts::TAU;
        [angle.cos(), angle.sin(), rng.range(-0.1, 0.1)]
    }));
    let indices = (1..=size as u32).map(|i| [0, i, i + 1]).collect();
    Mesh {
        name: "fan",
        positions,
        indices,
    }
}

/// Height field, in which every inner edge is shared.
pub fn bumpy_grid(rng: &mut Rng, size: usize) -> Mesh {
    let side = (size as f32 / 2.0).sqrt().ceil().max(1.0) as u32;
    let mut positions = Vec::new();
    for y in 0..=side {
        for x in 0..=side {
            let place = |i: u32| i as f32 / side as f32 * 2.0 - 1.0;
            positions.push([place(x), place(y), rng.range(-0.1, 0.1)]);
        }
    }
    let mut indices = Vec::new();
    for y in 0..side {
        for x in 0..side {
            let corner = y * (side + 1) + x;
            let above = corner + side + 1;
            indices.extend([[corner, corner + 1, above], [above, corner + 1, above + 1]]);
        }
    }
    Mesh {
        name: "bumpy grid",
        positions,
        indices,
    }
}

/// Five triangles repeated many times, so that every distance is a tie.
pub fn coincident(rng: &mut Rng, size: usize) -> Mesh {
    let few: Vec<_> = soup(rng, 5).positions;
    Mesh::of_triangles(
        "coincident",
        (0..size).map(|i| core::array::from_fn(|corner| few[i % 5 * 3 + corner])),
    )
}

/// Boxes on a lattice: axis-aligned triangles, shared planes, bounds without volume.
pub fn axis_aligned(rng: &mut Rng, size: usize) -> Mesh {
    let mut triangles = Vec::new();
    while triangles.len() < size {
        let low: [f32; 3] = core::array::from_fn(|_| rng.below(8) as f32 * 0.25 - 1.0);
        let extent: [f32; 3] = core::array::from_fn(|_| 0.25 * (1 + rng.below(3)) as f32);
        let corner = |bits: usize| {
            core::array::from_fn(|axis| low[axis] + extent[axis] * (bits >> axis & 1) as f32)
        };
        for axis in 0..3 {
            let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
            for side in [0, 1 << axis] {
                let quad = [side, side | u, side | u | v, side | v].map(corner);
                triangles.push([quad[0], quad[1], quad[2]]);
                triangles.push([quad[0], quad[2], quad[3]]);
            }
        }
    }
    triangles.truncate(size);
    Mesh::of_triangles("axis aligned", triangles)
}

/// Triangles around one point whose sizes span twelve orders of magnitude.
pub fn mixed_scales(rng: &mut Rng, size: usize) -> Mesh {
    Mesh::of_triangles(
        "mixed scales",
        (0..size).map(|_| {
            let scale = 10f32.powf(rng.range(-8.0, 4.0));
            [rng.point(scale), rng.point(scale), rng.point(scale)]
        }),
    )
}

/// Closed sphere of `20 * 4^level` triangles.
pub fn icosphere(level: u32) -> Mesh {
    let phi = (1.0 + 5f32.sqrt()) / 2.0;
    let mut positions = Vec::new();
    for (a, b) in [(1.0, phi), (1.0, -phi), (-1.0, phi), (-1.0, -phi)] {
        positions.extend([[0.0, a, b], [a, b, 0.0], [b, 0.0, a]]);
    }
    // Faces of the icosahedron are the triples of vertices at distance 2 from each other.
    let near = |a: [f32; 3], b: [f32; 3]| {
        let d: f32 = (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum();
        (d - 4.0).abs() < 1e-3
    };
    let mut indices = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let [pa, pb, pc] = [positions[a], positions[b], positions[c]];
                if near(pa, pb) && near(pb, pc) && near(pc, pa) {
                    indices.push([a as u32, b as u32, c as u32]);
                }
            }
        }
    }
    for _ in 0..level {
        let mut middles = std::collections::HashMap::new();
        let mut finer = Vec::with_capacity(indices.len() * 4);
        for &[a, b, c] in &indices {
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let (pa, pb) = (positions[a as usize], positions[b as usize]);
                    positions.push(core::array::from_fn(|axis| 0.5 * (pa[axis] + pb[axis])));
                    positions.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        indices = finer;
    }
    for position in &mut positions {
        let length = position.iter().map(|x| x * x).sum::<f32>().sqrt();
        *position = position.map(|x| x / length);
    }
    Mesh {
        name: "icosphere",
        positions,
        indices,
    }
}

/// Mesh in which some triangles have NaN, infinite coordinates or coinciding corners, and the number of such triangles.
pub fn spoiled(rng: &mut Rng, size: usize) -> (Mesh, usize) {
    let mut mesh = soup(rng, size);
    mesh.name = "spoiled";
    let mut bad = 0;
    for index in 0..size {
        let corner = 3 * index + rng.below(3);
        match rng.below(6) {
            0 => mesh.positions[corner][rng.below(3)] = f32::NAN,
            1 => mesh.positions[corner][rng.below(3)] = f32::INFINITY,
            2 => mesh.positions[corner] = mesh.positions[3 * index + (corner + 1) % 3],
            _ => continue,
        }
        bad += 1;
    }
    (mesh, bad)
}
