//! Meshes with a value at every vertex as PLY files.

use std::io::{self, Write};

use antumbra::LocalOrigin;

/// A mesh with a value at every vertex.
#[derive(Clone, Copy, Debug)]
pub struct ShadedMesh<'a> {
    /// Vertex positions, `[n, 3]`, measured from `local`.
    pub positions: &'a [[f32; 3]],
    /// Origin of the positions. Files have positions of the world: .ply files as doubles unless it is zero, .glb files as the
    /// place of a node.
    pub local: LocalOrigin,
    /// Vertex normals, `[n, 3]`.
    pub normals: &'a [[f32; 3]],
    /// Value of each vertex; 0 is black and 1 white.
    pub values: &'a [f32],
    /// Colour of each vertex, or empty: grey by the value.
    pub colours: &'a [[u8; 3]],
    /// Bent normal of each vertex, `[n, 3]`, or empty.
    pub bent_normals: &'a [[f32; 3]],
    /// Three indices into `positions` per triangle, `[m, 3]`.
    pub indices: &'a [[u32; 3]],
}

impl ShadedMesh<'_> {
    /// Whether all lists have the length that they should have.
    pub(crate) fn is_whole(&self) -> bool {
        let vertices = self.positions.len();
        [self.normals.len(), self.values.len()] == [vertices; 2]
            && [0, vertices].contains(&self.colours.len())
            && [0, vertices].contains(&self.bent_normals.len())
    }

    fn is_local(&self) -> bool {
        self.local != LocalOrigin::default()
    }

    /// Size of the file in bytes, without its header of less than 500 bytes.
    pub fn bytes(&self) -> u64 {
        let mut vertex = if self.bent_normals.is_empty() { 31 } else { 43 };
        vertex += if self.is_local() { 12 } else { 0 };
        vertex * self.positions.len() as u64 + 13 * self.indices.len() as u64
    }

    /// Writes a PLY file, binary and little endian.
    ///
    /// Vertices have `x y z nx ny nz`, the value as a float property called `name`, and `red green blue`: the colour, or 255
    /// times the value, rounded, without a display curve. Values beyond 0 and 1 have the colour of the nearer one, NaN is
    /// black. Bent normals, where there are any, are `bent_x bent_y bent_z` and come last. Faces have `vertex_indices`.
    ///
    /// `name` must be one word of ASCII letters, digits and underscores.
    ///
    /// # Errors
    /// [`io::ErrorKind::InvalidInput`] if the lists differ in length, if `name` is no such word, or if there are more than 2³¹
    /// vertices, which is beyond the indices of PLY files. Otherwise errors of the writer.
    pub fn write(&self, name: &str, file: &mut dyn Write) -> io::Result<()> {
        let vertices = self.positions.len();
        let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if !self.is_whole()
            || vertices > i32::MAX as usize
            || name.is_empty()
            || !name.chars().all(is_word)
        {
            let reason = "a mesh or a name that PLY files cannot hold";
            return Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
        }
        let bent = match self.bent_normals {
            [] => "",
            _ => "property float bent_x\nproperty float bent_y\nproperty float bent_z\n",
        };
        let real = if self.is_local() { "double" } else { "float" };
        write!(
            file,
            "ply\nformat binary_little_endian 1.0\ncomment written by antumbra\n\
             element vertex {vertices}\n\
             property {real} x\nproperty {real} y\nproperty {real} z\n\
             property float nx\nproperty float ny\nproperty float nz\n\
             property float {name}\n\
             property uchar red\nproperty uchar green\nproperty uchar blue\n{bent}\
             element face {}\nproperty list uchar int vertex_indices\nend_header\n",
            self.indices.len()
        )?;
        for (index, value) in self.values.iter().enumerate() {
            let position = self.positions[index];
            match self.is_local() {
                true => put(file, self.local.world(position).map(f64::to_le_bytes))?,
                false => put(file, position.map(f32::to_le_bytes))?,
            }
            for x in self.normals[index].iter().chain([value]) {
                file.write_all(&x.to_le_bytes())?;
            }
            // A conversion that saturates, and takes NaN to 0.
            let grey = [(value * 255.0).round() as u8; 3];
            file.write_all(self.colours.get(index).unwrap_or(&grey))?;
            for x in self.bent_normals.get(index).into_iter().flatten() {
                file.write_all(&x.to_le_bytes())?;
            }
        }
        for corners in self.indices {
            file.write_all(&[3])?;
            for corner in corners {
                file.write_all(&corner.to_le_bytes())?;
            }
        }
        Ok(())
    }
}

/// Writes the bytes of three numbers.
fn put<const N: usize>(file: &mut dyn Write, numbers: [[u8; N]; 3]) -> io::Result<()> {
    file.write_all(numbers.as_flattened())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_of_a_small_file() {
        let mesh = ShadedMesh {
            positions: &[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]],
            local: LocalOrigin::default(),
            normals: &[[0.0, 0.0, 1.0]; 3],
            values: &[0.5, 1.0, f32::NAN],
            colours: &[],
            bent_normals: &[],
            indices: &[[0, 1, 2]],
        };
        let mut bytes = Vec::new();
        mesh.write("ao", &mut bytes).expect("written");
        let end = b"end_header\n";
        let header = bytes
            .windows(end.len())
            .position(|window| window == end)
            .expect("a header")
            + end.len();
        assert!(header < 500);
        let body = &bytes[header..];
        assert_eq!(body.len() as u64, mesh.bytes());
        assert_eq!(body[..4], 1.0_f32.to_le_bytes());
        assert_eq!(body[24..28], 0.5_f32.to_le_bytes());
        assert_eq!(body[28..31], [128; 3]);
        assert_eq!(body[59..62], [255; 3]);
        assert_eq!(body[90..93], [0; 3]);
        assert_eq!(body[93..], [3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]);

        let coloured = ShadedMesh {
            colours: &[[1, 2, 3]; 3],
            ..mesh
        };
        let mut other = Vec::new();
        coloured.write("ao", &mut other).expect("written");
        assert_eq!(other[header + 28..header + 31], [1, 2, 3]);

        let bent = ShadedMesh {
            bent_normals: &[[0.0, 1.0, 0.0]; 3],
            ..mesh
        };
        let without = bytes.len();
        bytes.clear();
        bent.write("ao", &mut bytes).expect("written");
        let more = "property float bent_x\n".len();
        assert_eq!(bytes.len(), without + 3 * (12 + more));
        assert_eq!(bent.bytes(), mesh.bytes() + 36);
        let first = &bytes[header + 3 * more..];
        assert_eq!(first[28..31], [128; 3]);
        assert_eq!(first[35..39], 1.0_f32.to_le_bytes());
    }

    #[test]
    fn what_does_not_fit_a_file_is_refused() {
        let mesh = ShadedMesh {
            positions: &[[0.0; 3]],
            local: LocalOrigin::default(),
            normals: &[[0.0; 3]],
            values: &[0.0],
            colours: &[],
            bent_normals: &[],
            indices: &[],
        };
        assert!(mesh.write("ao", &mut Vec::new()).is_ok());
        for name in ["", "a b", "a\nb"] {
            assert!(mesh.write(name, &mut Vec::new()).is_err(), "{name:?}");
        }
        let short = ShadedMesh {
            values: &[],
            ..mesh
        };
        let coloured = ShadedMesh {
            colours: &[[1, 2, 3]; 2],
            ..mesh
        };
        assert!(coloured.write("ao", &mut Vec::new()).is_err());
        assert!(short.write("ao", &mut Vec::new()).is_err());
        let long = ShadedMesh {
            bent_normals: &[[0.0; 3]; 2],
            ..mesh
        };
        assert!(long.write("ao", &mut Vec::new()).is_err());
    }
}
