//! Meshes whose vertices, texels or surfaces are baked.

use crate::vector::{cross, less, unit};
use crate::{CREASE_ANGLE, split_at_creases, vertex_normals};

/// Vertices and triangles, for example of all meshes of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertices, `[n, 3]`.
    pub positions: Vec<[f32; 3]>,
    /// Normals of the vertices, `[n, 3]`.
    pub normals: Vec<[f32; 3]>,
    /// Three vertices of each triangle, `[m, 3]`.
    pub indices: Vec<[u32; 3]>,
    /// Texture coordinates of the vertices, `[n, 2]`: NaN where there are none.
    pub uvs: Vec<[f32; 2]>,
}

impl Mesh {
    /// Adds a mesh. `normals` may be empty: [`vertex_normals`] are taken then. `uvs` may be empty, too. Normals are turned
    /// around if `is_turned`.
    pub fn push(
        &mut self,
        (positions, indices): (&[[f32; 3]], &[[u32; 3]]),
        normals: &[[f32; 3]],
        uvs: &[[f32; 2]],
        is_turned: bool,
    ) {
        let first = self.positions.len() as u32;
        let sign = if is_turned { -1.0 } else { 1.0 };
        let turned = |normal: &[f32; 3]| normal.map(|x| sign * x);
        match normals.is_empty() {
            true => {
                let normals = vertex_normals(positions, indices);
                self.normals.extend(normals.iter().map(turned));
            }
            false => self.normals.extend(normals.iter().map(turned)),
        }
        self.positions.extend(positions);
        self.uvs.extend(uvs);
        self.uvs.resize(self.positions.len(), [f32::NAN; 2]);
        // More vertices than 32 bits can number are left to the caller.
        let moved = |corner: u32| corner.wrapping_add(first);
        let corners = indices.iter().map(|corners| corners.map(moved));
        self.indices.extend(corners);
    }

    /// Corners of a triangle.
    pub(crate) fn corners(&self, triangle: u32) -> [[f64; 3]; 3] {
        let corners = self.indices[triangle as usize];
        corners.map(|corner| self.positions[corner as usize].map(f64::from))
    }

    /// Normal of a triangle times twice its area.
    pub(crate) fn twice(&self, triangle: u32) -> [f64; 3] {
        self.twice_of(self.indices[triangle as usize])
    }

    /// Normal of a triangle with these corners, times twice its area.
    pub(crate) fn twice_of(&self, corners: [u32; 3]) -> [f64; 3] {
        let [a, b, c] = corners.map(|corner| &self.positions[corner as usize]);
        cross(less(b, a), less(c, a))
    }

    /// Normal of a triangle, of length 1; `None` if it has no area.
    pub(crate) fn front(&self, triangle: u32) -> Option<[f64; 3]> {
        unit(self.twice(triangle))
    }

    /// Adds a mesh without normals, whose vertices are split at creases of more than [`CREASE_ANGLE`]: see
    /// [`split_at_creases`]. Copies of vertices come last. `uvs` and `is_turned` are as in [`Mesh::push`].
    ///
    /// Returns the number of copies.
    pub fn push_creased(
        &mut self,
        (positions, indices): (&[[f32; 3]], &[[u32; 3]]),
        uvs: &[[f32; 2]],
        is_turned: bool,
    ) -> usize {
        let creased = split_at_creases(positions, indices, CREASE_ANGLE);
        let copies = || creased.copies.iter().map(|&vertex| vertex as usize);
        let all = [
            positions,
            &copies().map(|i| positions[i]).collect::<Vec<_>>(),
        ]
        .concat();
        let more: Vec<[f32; 2]> = match uvs.is_empty() {
            true => Vec::new(),
            false => copies().map(|i| uvs[i]).collect(),
        };
        let uvs = [uvs, &more].concat();
        self.push((&all, &creased.indices), &[], &uvs, is_turned);
        creased.copies.len()
    }
}
