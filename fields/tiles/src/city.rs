//! The index of a scene in many mesh files, as text.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::Error;
use crate::index::{hex, read_lines, write_lines};

/// Most boxes of a file.
const MOST: usize = 64;

/// A box: its least coordinates, and its largest.
pub type Box3 = [[f32; 3]; 2];

/// A scene of many mesh files, such as a city in tiles, with boxes that say where each of them may be in the way.
///
/// Its text is like an [`Index`](crate::Index), with `"schema": "antumbra.city/1"`. All positions are measured from one origin
/// before they are rounded to single precision, so that a file has the same triangles whichever others are read with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct City {
    /// Where positions are measured from, as the scene would be if it were one file.
    pub origin: [f64; 3],
    /// Box around all files, from the origin.
    pub bounds: Box3,
    /// Name of the axis that is up, as `z`, if it is the same in all files.
    pub up: Option<String>,
    /// Number of triangles.
    pub triangles: u64,
    /// Files in the order in which they were given.
    #[serde(skip)]
    pub files: Vec<Piece>,
}

/// A file of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Piece {
    /// Name of the file.
    pub path: PathBuf,
    /// Length in bytes.
    pub bytes: u64,
    /// Checksum of its bytes: XXH3, 64 bits, hexadecimal, as `xxhsum -H3` prints it.
    #[serde(with = "hex")]
    pub xxh3: u64,
    /// Number of triangles.
    pub triangles: u64,
    /// Boxes that hold all triangles, 64 at most: where a ray misses them, the file does not matter.
    pub boxes: Vec<Box3>,
}

impl City {
    /// First words of an index of meshes.
    pub const SCHEMA: &str = "antumbra.city/1";

    /// Reads an index.
    ///
    /// # Errors
    /// There is no such file, or it is no index of meshes.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let check = |city: &Self, file: &mut Piece, folder: &Path| {
            file.path = folder.join(&file.path);
            match !file.boxes.is_empty() && file.boxes.iter().all(|own| holds(&city.bounds, own)) {
                true => Ok(()),
                false => Err("wanted boxes inside of the whole"),
            }
        };
        let (mut city, files) = read_lines(path, Self::SCHEMA, check)?;
        city.files = files;
        Ok(city)
    }

    /// Writes the text. Names of files are to be absolute; those in the folder of the index, or below it, are written as they are from
    /// there.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        let named = |file: &Piece, name: &Path| Piece {
            path: name.to_path_buf(),
            ..file.clone()
        };
        let files = (
            &self.files[..],
            (|file| &file.path) as fn(&Piece) -> &PathBuf,
        );
        write_lines(path, (Self::SCHEMA, self), files, named)
    }
}

/// Whether a box is in another one. Not if a number is NaN.
fn holds(whole: &Box3, part: &Box3) -> bool {
    (0..3).all(|axis| {
        let [low, high] = [0, 1].map(|end| part[end][axis]);
        whole[0][axis] <= low && low <= high && high <= whole[1][axis]
    })
}

/// Boxes that hold all triangles, 64 at most, from corners that are finite. Triangles that are near each other share a box.
///
/// ```
/// use antumbra_tiles::boxes_around;
///
/// let at = |x: f32| [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 2.0]];
/// let apart = boxes_around(&mut [at(0.0), at(90.0)]);
/// assert_eq!(apart, [[[0.0; 3], [1.0, 1.0, 2.0]], [[90.0, 0.0, 0.0], [91.0, 1.0, 2.0]]]);
/// assert_eq!(boxes_around(&mut (0..1000).map(|x| at(x as f32)).collect::<Vec<_>>()).len(), 64);
/// ```
pub fn boxes_around(triangles: &mut [[[f32; 3]; 3]]) -> Vec<Box3> {
    let mut boxes = Vec::new();
    split(triangles, MOST, &mut boxes);
    boxes
}

/// Splits triangles in the middle of their longest side, until there is a box for each part.
fn split(triangles: &mut [[[f32; 3]; 3]], most: usize, boxes: &mut Vec<Box3>) {
    let mut around = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for corner in triangles.as_flattened() {
        for axis in 0..3 {
            around[0][axis] = around[0][axis].min(corner[axis]);
            around[1][axis] = around[1][axis].max(corner[axis]);
        }
    }
    if most == 1 || triangles.len() < 2 {
        if !triangles.is_empty() {
            boxes.push(around);
        }
        return;
    }
    let side = |axis: &usize| around[1][*axis] - around[0][*axis];
    let longest = (0..3).max_by(|a, b| side(a).total_cmp(&side(b)));
    let axis = longest.unwrap_or_default();
    let middle = |triangle: &[[f32; 3]; 3]| triangle.iter().map(|corner| corner[axis]).sum::<f32>();
    let half = triangles.len() / 2;
    triangles.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)));
    let (near, far) = triangles.split_at_mut(half);
    split(near, most / 2, boxes);
    split(far, most / 2, boxes);
}
