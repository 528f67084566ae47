//! Simple solids, added to one mesh per material. Hidden faces, such as undersides on the ground, are left out.

use std::sync::Arc;

use super::paint::Paint;
use crate::{Geometry, Material, Shape, TriangleMesh};

/// Rectangle of the plan, with `low` below `high` on both axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub low: [f32; 2],
    pub high: [f32; 2],
}

impl Rect {
    /// Rectangle with the given centre and half-widths.
    pub fn around(center: [f32; 2], half: [f32; 2]) -> Self {
        Self {
            low: [center[0] - half[0], center[1] - half[1]],
            high: [center[0] + half[0], center[1] + half[1]],
        }
    }

    pub fn size(&self) -> [f32; 2] {
        [self.high[0] - self.low[0], self.high[1] - self.low[1]]
    }

    pub fn center(&self) -> [f32; 2] {
        [
            0.5 * (self.low[0] + self.high[0]),
            0.5 * (self.low[1] + self.high[1]),
        ]
    }

    /// Point at the given fractions of width and depth.
    pub fn at(&self, u: f32, v: f32) -> [f32; 2] {
        let [width, depth] = self.size();
        [self.low[0] + u * width, self.low[1] + v * depth]
    }

    /// Rectangle that is smaller by `margin` on every side. The margin must be less than half of either side.
    pub fn inset(&self, margin: f32) -> Self {
        Self {
            low: self.low.map(|x| x + margin),
            high: self.high.map(|x| x - margin),
        }
    }

    /// Corners, counter-clockwise seen from above.
    pub fn corners(&self) -> [[f32; 2]; 4] {
        let ([x0, y0], [x1, y1]) = (self.low, self.high);
        [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
    }
}

/// Corners of a regular octagon of circumradius 1.
const OCTAGON: [[f32; 2]; 8] = {
    let d = std::f32::consts::FRAC_1_SQRT_2;
    [
        [1.0, 0.0],
        [d, d],
        [0.0, 1.0],
        [-d, d],
        [-1.0, 0.0],
        [-d, -d],
        [0.0, -1.0],
        [d, -d],
    ]
};

/// Meshes under construction, one per [`Paint`].
pub(super) struct Brushes {
    meshes: Vec<TriangleMesh>,
}

impl Default for Brushes {
    fn default() -> Self {
        Self {
            meshes: Paint::ALL.map(|_| TriangleMesh::default()).into(),
        }
    }
}

impl Brushes {
    /// Number of triangles so far.
    pub fn triangles(&self) -> usize {
        self.meshes.iter().map(|mesh| mesh.indices.len()).sum()
    }

    /// Shapes of the meshes that are not empty, and their materials.
    pub fn into_shapes(self) -> (Vec<Shape>, Vec<Material>) {
        let used = Paint::ALL.into_iter().zip(self.meshes);
        used.filter(|(_, mesh)| !mesh.indices.is_empty())
            .enumerate()
            .map(|(material, (paint, mesh))| {
                let shape = Shape::new(Geometry::Mesh(Arc::new(mesh)), material);
                (shape, paint.material())
            })
            .unzip()
    }

    /// Adds vertices and the triangles between them.
    pub fn mesh(&mut self, paint: Paint, vertices: &[[f32; 3]], triangles: &[[u32; 3]]) {
        let mesh = &mut self.meshes[paint as usize];
        let first = mesh.positions.len() as u32;
        mesh.positions.extend_from_slice(vertices);
        mesh.indices
            .extend(triangles.iter().map(|t| t.map(|index| first + index)));
    }

    /// Adds a quadrilateral, with corners counter-clockwise seen from the front.
    pub fn quad(&mut self, paint: Paint, corners: [[f32; 3]; 4]) {
        self.mesh(paint, &corners, &[[0, 1, 2], [0, 2, 3]]);
    }

    /// Adds a horizontal rectangle that faces up.
    pub fn plate(&mut self, paint: Paint, rect: Rect, z: f32) {
        self.quad(paint, rect.corners().map(|[x, y]| [x, y, z]));
    }

    /// Adds a box without its underside.
    pub fn block(&mut self, paint: Paint, rect: Rect, z0: f32, z1: f32) {
        let corners = rect.corners();
        let vertices: [[f32; 3]; 8] = std::array::from_fn(|i| {
            let [x, y] = corners[i % 4];
            [x, y, if i < 4 { z0 } else { z1 }]
        });
        self.mesh(paint, &vertices, &BOX);
    }

    /// Adds a hip roof: four slopes that rise to a ridge along the longer side.
    pub fn hip_roof(&mut self, paint: Paint, rect: Rect, z0: f32, z1: f32) {
        let [width, depth] = rect.size();
        let run = 0.5 * width.min(depth);
        let [x, y] = rect.center();
        // The ridge is never a point, so that no triangle of a square roof is degenerate.
        let ridge = |size: f32| (0.5 * size - run).max(0.05);
        let (a, b) = if width > depth {
            ([x - ridge(width), y], [x + ridge(width), y])
        } else {
            ([x, y - ridge(depth)], [x, y + ridge(depth)])
        };
        let mut vertices = [[0.0; 3]; 6];
        for (vertex, [x, y]) in vertices.iter_mut().zip(rect.corners()) {
            *vertex = [x, y, z0];
        }
        vertices[4] = [a[0], a[1], z1];
        vertices[5] = [b[0], b[1], z1];
        let faces: [[u32; 3]; 6] = if width > depth {
            [
                [0, 1, 5],
                [0, 5, 4],
                [1, 2, 5],
                [2, 3, 4],
                [2, 4, 5],
                [3, 0, 4],
            ]
        } else {
            [
                [0, 1, 4],
                [1, 2, 5],
                [1, 5, 4],
                [2, 3, 5],
                [3, 0, 4],
                [3, 4, 5],
            ]
        };
        self.mesh(paint, &vertices, &faces);
    }

    /// Adds an upright octagonal column without its underside, which tapers from radius `r[0]` to `r[1]`.
    pub fn column(&mut self, paint: Paint, [x, y]: [f32; 2], r: [f32; 2], z: [f32; 2]) {
        let vertices: [[f32; 3]; 16] = std::array::from_fn(|i| {
            let [cos, sin] = OCTAGON[i % 8];
            let top = i / 8;
            [x + r[top] * cos, y + r[top] * sin, z[top]]
        });
        let mut faces = Vec::with_capacity(22);
        for i in 0..8u32 {
            let next = (i + 1) % 8;
            faces.extend([[i, next, next + 8], [i, next + 8, i + 8]]);
        }
        faces.extend((1..7).map(|i| [8, 8 + i, 9 + i]));
        self.mesh(paint, &vertices, &faces);
    }

    /// Adds a rounded body: an octahedron with split edges, each vertex scaled by a call of `radius`.
    pub fn blob(&mut self, paint: Paint, center: [f32; 3], mut radius: impl FnMut() -> [f32; 3]) {
        let d = std::f32::consts::FRAC_1_SQRT_2;
        #[rustfmt::skip]
        let sphere: [[f32; 3]; 18] = [
            [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0],
            [d, d, 0.0], [-d, d, 0.0], [-d, -d, 0.0], [d, -d, 0.0],
            [d, 0.0, d], [0.0, d, d], [-d, 0.0, d], [0.0, -d, d],
            [d, 0.0, -d], [0.0, d, -d], [-d, 0.0, -d], [0.0, -d, -d],
        ];
        let vertices = sphere.map(|direction| {
            let radius = radius();
            std::array::from_fn(|axis| center[axis] + radius[axis] * direction[axis])
        });
        let mut faces = Vec::with_capacity(32);
        // Each quarter has two corners on the equator, the middle between them, and the middles of the corners'
        // edges to a pole.
        let quarters = [
            (0, 2, 6, 10, 11),
            (2, 1, 7, 11, 12),
            (1, 3, 8, 12, 13),
            (3, 0, 9, 13, 10),
        ];
        for (a, b, middle, up_a, up_b) in quarters {
            let (down_a, down_b) = (up_a + 4, up_b + 4);
            faces.extend([
                [a, middle, up_a],
                [middle, b, up_b],
                [middle, up_b, up_a],
                [up_a, up_b, 4],
            ]);
            faces.extend([
                [middle, a, down_a],
                [b, middle, down_b],
                [down_b, middle, down_a],
                [down_b, down_a, 5],
            ]);
        }
        self.mesh(paint, &vertices, &faces);
    }
}

/// Sides and top of a box with four corners below and four above, counter-clockwise.
const BOX: [[u32; 3]; 10] = [
    [0, 1, 5],
    [0, 5, 4],
    [1, 2, 6],
    [1, 6, 5],
    [2, 3, 7],
    [2, 7, 6],
    [3, 0, 4],
    [3, 4, 7],
    [4, 5, 6],
    [4, 6, 7],
];
