//! Texture atlases: points of a mesh by its texture coordinates.

use crate::{Error, Mesh, memory};

/// A square texture over a mesh, with a point for each texel that a triangle covers.
#[derive(Clone, Debug, PartialEq)]
pub struct Atlas {
    /// Texels of a row, and number of rows.
    pub size: u32,
    /// Points on the mesh, `[n, 3]`.
    pub points: Vec<[f32; 3]>,
    /// Normals at the points, interpolated from the vertex normals, `[n, 3]`.
    pub normals: Vec<[f32; 3]>,
    /// Number of triangles without texture coordinates, which are left out.
    pub left_out: u64,
    /// Number of texels that more than one triangle covers. Edges that triangles share do not count.
    pub overlaps: u64,
    /// Point of each texel, row by row from the top, or [`NONE`].
    texels: Vec<u32>,
}

/// A texel that no triangle covers.
const NONE: u32 = u32::MAX;

impl Atlas {
    /// Points in the middle of the texels that triangles cover. Row 0 has the coordinates v from 1 down: v runs upwards, as in
    /// .obj and .ply files, and as in glTF files once they are read. The first triangle that covers a texel has it.
    ///
    /// # Errors
    /// [`Error::NoTextureCoordinates`] if no triangle has texture coordinates, [`Error::NoTexels`] if no texel is covered.
    pub fn new(mesh: &Mesh, size: u32) -> Result<Self, Error> {
        let mut atlas = Self {
            size,
            points: Vec::new(),
            normals: Vec::new(),
            left_out: 0,
            overlaps: 0,
            texels: memory::filled("texels", size as usize * size as usize, NONE)?,
        };
        for corners in &mesh.indices {
            let corners = corners.map(|index| index as usize);
            if corners.iter().any(|&index| index >= mesh.uvs.len()) {
                continue;
            }
            let uvs = corners.map(|index| mesh.uvs[index].map(f64::from));
            match uvs.iter().flatten().all(|x| x.is_finite()) {
                true => atlas.cover(mesh, corners, uvs)?,
                false => atlas.left_out += 1,
            }
        }
        if atlas.left_out == mesh.indices.len() as u64 {
            return Err(Error::NoTextureCoordinates);
        }
        match atlas.points.is_empty() {
            true => Err(Error::NoTexels),
            false => Ok(atlas),
        }
    }

    /// Point of each texel, row by row from the top; `None` where no triangle is.
    pub fn texels(&self) -> impl Iterator<Item = Option<usize>> + '_ {
        let texels = self.texels.iter();
        texels.map(|&point| (point != NONE).then_some(point as usize))
    }

    /// Covers texels whose middle lies in a triangle.
    fn cover(&mut self, mesh: &Mesh, corners: [usize; 3], uvs: [[f64; 2]; 3]) -> Result<(), Error> {
        let size = f64::from(self.size);
        let at = uvs.map(|[u, v]| [u * size, (1.0 - v) * size]);
        let [a, b, c] = at;
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area == 0.0 {
            return Ok(());
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
        let columns = span(0);
        for y in span(1) {
            memory::grow(&mut self.points, "points of texels", columns.len())?;
            memory::grow(&mut self.normals, "points of texels", columns.len())?;
            for x in columns.clone() {
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
                    self.overlaps += u64::from(weights.iter().all(|&weight| weight > 1e-6));
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
                self.points.push(mix(&mesh.positions));
                self.normals.push(mix(&mesh.normals));
            }
        }
        Ok(())
    }

    /// Pixels of the texture, grown by `dilate` texels over its edges. Texels far from all triangles are black.
    pub fn picture(&self, pixel: impl Fn(usize) -> [f32; 3], dilate: u32) -> Vec<[f32; 3]> {
        let size = self.size as usize;
        let known = |point: Option<usize>| {
            let value = point.map(&pixel);
            value.filter(|value| value.iter().all(|x| x.is_finite()))
        };
        let mut pixels: Vec<Option<[f32; 3]>> = self.texels().map(known).collect();
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

    fn square() -> Mesh {
        Mesh {
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
        assert_eq!(atlas.texels().flatten().count(), 16);
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
        assert_eq!(Atlas::new(&mesh, 8), Err(Error::NoTextureCoordinates));
        mesh.uvs = vec![[7.0, 7.0], [7.5, 7.0], [7.5, 7.5], [7.0, 7.5]];
        assert_eq!(Atlas::new(&mesh, 8), Err(Error::NoTexels));
    }
}
