//! Texels of a texture: points of triangles by their texture coordinates.

use super::mesh::Vertices;
use crate::exit::{Failure, tell};

/// A square texture over triangles.
pub struct Atlas {
    pub size: u32,
    pub points: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    /// Point of each texel, row by row from the top, or [`NONE`].
    texels: Vec<u32>,
}

/// A texel that no triangle covers.
const NONE: u32 = u32::MAX;

impl Atlas {
    /// The points in the middle of the texels that triangles cover. Row 0 has the coordinates v from 1 down: v runs upwards,
    /// as in .obj and .ply files and after reading in those of glTF. The first triangle that covers a texel has it.
    ///
    /// # Errors
    /// No triangle has texture coordinates.
    pub fn new(vertices: &Vertices, size: u32) -> Result<Self, Failure> {
        let mut atlas = Self {
            size,
            points: Vec::new(),
            normals: Vec::new(),
            texels: vec![NONE; (size * size) as usize],
        };
        let (mut without, mut twice) = (0_u64, 0_u64);
        for corners in &vertices.indices {
            let corners = corners.map(|index| index as usize);
            if corners.iter().any(|&index| index >= vertices.uvs.len()) {
                continue;
            }
            let uvs = corners.map(|index| vertices.uvs[index].map(f64::from));
            if !uvs.iter().flatten().all(|x| x.is_finite()) {
                without += 1;
                continue;
            }
            twice += atlas.cover(vertices, corners, uvs);
        }
        if without == vertices.indices.len() as u64 {
            return Err(Failure::Usage(
                "--atlas: no triangle of the scene has texture coordinates".into(),
            ));
        }
        if without > 0 {
            tell(format_args!(
                "note: {without} triangles have no texture coordinates and are left out"
            ));
        }
        if twice > 0 {
            tell(format_args!(
                "note: {twice} texels are covered more than once; the first triangle has them"
            ));
        }
        if atlas.points.is_empty() {
            return Err(Failure::Usage(
                "--atlas: no texel is covered; texture coordinates must run from 0 to 1".into(),
            ));
        }
        Ok(atlas)
    }

    /// Covers texels whose middle lies in a triangle, and counts those that had a point before.
    fn cover(&mut self, vertices: &Vertices, corners: [usize; 3], uvs: [[f64; 2]; 3]) -> u64 {
        let size = f64::from(self.size);
        let at = uvs.map(|[u, v]| [u * size, (1.0 - v) * size]);
        let [a, b, c] = at;
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area == 0.0 {
            return 0;
        }
        let span = |axis: usize| {
            let low = at.iter().fold(f64::INFINITY, |low, p| low.min(p[axis]));
            let high = at
                .iter()
                .fold(f64::NEG_INFINITY, |high, p| high.max(p[axis]));
            // Middles lie at halves.
            let first = (low - 0.5).ceil().max(0.0) as u32;
            let last = ((high - 0.5).floor() + 1.0).clamp(0.0, size) as u32;
            first..last
        };
        let mut twice = 0;
        for y in span(1) {
            for x in span(0) {
                let p = [f64::from(x) + 0.5, f64::from(y) + 0.5];
                let edge = |a: [f64; 2], b: [f64; 2]| {
                    ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])) / area
                };
                let weights = [edge(b, c), edge(c, a), edge(a, b)];
                if weights.iter().any(|&weight| weight < 0.0) {
                    continue;
                }
                let texel = &mut self.texels[(y * self.size + x) as usize];
                if *texel != NONE {
                    // Edges that two triangles share are covered twice by right.
                    twice += u64::from(weights.iter().all(|&weight| weight > 1e-6));
                    continue;
                }
                *texel = self.points.len() as u32;
                let mix = |list: &[[f32; 3]]| {
                    [0, 1, 2].map(|axis| {
                        let parts = weights.iter().zip(corners);
                        parts
                            .map(|(w, i)| w * f64::from(list[i][axis]))
                            .sum::<f64>() as f32
                    })
                };
                self.points.push(mix(&vertices.positions));
                self.normals.push(mix(&vertices.normals));
            }
        }
        twice
    }

    /// Pixels of the texture, grown by some texels over its edges. Texels far from all triangles are black.
    pub fn picture(&self, pixel: impl Fn(usize) -> [f32; 3], dilate: u32) -> Vec<[f32; 3]> {
        let size = self.size as usize;
        let known = |&texel: &u32| {
            let value = (texel != NONE).then(|| pixel(texel as usize));
            value.filter(|value| value.iter().all(|x| x.is_finite()))
        };
        let mut pixels: Vec<Option<[f32; 3]>> = self.texels.iter().map(known).collect();
        for _ in 0..dilate {
            let before = pixels.clone();
            for (index, pixel) in pixels.iter_mut().enumerate() {
                if pixel.is_some() {
                    continue;
                }
                let (x, y) = (index % size, index / size);
                let mut sum = [0.0; 3];
                let mut count = 0.0;
                for row in y.saturating_sub(1)..(y + 2).min(size) {
                    for column in x.saturating_sub(1)..(x + 2).min(size) {
                        if let Some(near) = before[row * size + column] {
                            sum = [0, 1, 2].map(|axis| sum[axis] + near[axis]);
                            count += 1.0;
                        }
                    }
                }
                if count > 0.0 {
                    *pixel = Some(sum.map(|x| x / count));
                }
            }
        }
        pixels.into_iter().map(Option::unwrap_or_default).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Vertices {
        Vertices {
            positions: vec![[0.0; 3], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0]],
            normals: vec![[0.0, 0.0, 1.0]; 4],
            indices: vec![[0, 1, 2], [0, 2, 3]],
            uvs: vec![[0.0, 0.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]],
        }
    }

    #[test]
    fn texels_lie_where_their_coordinates_are() {
        let atlas = Atlas::new(&square(), 8).expect("an atlas");
        assert_eq!(atlas.points.len(), 16, "a quarter of 64, each once");
        // The lower left quarter: rows 4 to 7, columns 0 to 3.
        let first = atlas.texels[7 * 8];
        assert_eq!(atlas.points[first as usize], [0.5, 0.5, 0.0]);
        let last = atlas.texels[4 * 8 + 3];
        assert_eq!(atlas.points[last as usize], [3.5, 3.5, 0.0]);
        assert_eq!(atlas.texels[0], NONE);
    }

    #[test]
    fn seams_are_grown_and_the_rest_is_black() {
        let atlas = Atlas::new(&square(), 8).expect("an atlas");
        let grown = atlas.picture(|_| [0.5; 3], 2);
        let at = |x: usize, y: usize| grown[8 * y + x][0];
        assert_eq!(
            [at(0, 4), at(0, 3), at(5, 2), at(0, 1), at(6, 7)],
            [0.5, 0.5, 0.5, 0.0, 0.0]
        );
    }

    #[test]
    fn meshes_without_coordinates_are_refused() {
        let mut mesh = square();
        mesh.uvs = vec![[f32::NAN; 2]; 4];
        assert!(Atlas::new(&mesh, 8).is_err());
        mesh.uvs = vec![[7.0, 7.0], [7.5, 7.0], [7.5, 7.5], [7.0, 7.5]];
        assert!(Atlas::new(&mesh, 8).is_err());
    }
}
