//! Scenes in files and in pickles: meshes, and behind them the tree in the format of the kernel.
//!
//! All numbers are little-endian. A file is a signature, the length of the meshes and their checksum (XXH3), the meshes, and
//! the tree. Files are not trusted: lengths are checked before memory is taken, and the kernel checks its tree.

use std::io::{Error, ErrorKind, Read};
use std::path::Path;
use std::sync::Arc;

use antumbra::shapes::Sphere;
use antumbra::{Bvh, Instance, LocalOrigin, World};
use antumbra_image::atomic_write;
use numpy::PyReadonlyArray1;
use pyo3::exceptions::{PyFileNotFoundError, PyOSError, PyValueError};
use pyo3::prelude::*;
use xxhash_rust::xxh3::xxh3_64;

use super::curves::{Place, Segments};
use super::parts::{Part, Parts};
use super::{Quality, SceneData, Tree};
use crate::errors::raised;

/// What pickle keeps of an object: a function that makes it again, and arguments of that function.
pub type Reduced<'py, A> = PyResult<(Bound<'py, PyAny>, A)>;

/// First bytes of a file. The last one is the version: 2 if there are masks, or a world; 3 if there are curves or
/// assemblies.
const SIGNATURE: [u8; 8] = *b"AntumPy\x01";

/// Version of files that say what kind of tree follows, and have masks.
const SECOND: u8 = 2;

/// Version of files with curves or paths to instances, as the second otherwise.
const THIRD: u8 = 3;

/// Bytes of signature, length and checksum.
const HEAD: usize = 24;

pub fn save(scene: &SceneData, path: &Path) -> PyResult<()> {
    let bytes = to_bytes(scene)?;
    let written = atomic_write(path, |file| file.write_all(&bytes));
    written.map_err(|error: antumbra_image::Error| PyOSError::new_err(error.to_string()))
}

pub fn load(py: Python<'_>, path: &Path, is_world: bool) -> PyResult<Arc<SceneData>> {
    let read = || {
        let mut bytes = Vec::new();
        antumbra_files::open(path)?.read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    let data = py.detach(|| {
        let bytes = read().map_err(|error: Error| {
            let text = format!("{}: {error}", path.display());
            match error.kind() {
                ErrorKind::NotFound => PyFileNotFoundError::new_err(text),
                _ => PyOSError::new_err(text),
            }
        })?;
        from_bytes(&bytes)
    })?;
    match (data.world().is_some(), is_world) {
        (true, false) => Err(PyValueError::new_err(
            "cannot read the scene: the file has a world, use World.load",
        )),
        (false, true) => Err(PyValueError::new_err(
            "cannot read the world: the file has a scene, use Scene.load",
        )),
        _ => Ok(data),
    }
}

/// What a pickle holds.
pub fn from_array(py: Python<'_>, bytes: &PyReadonlyArray1<'_, u8>) -> PyResult<Arc<SceneData>> {
    let bytes = bytes.as_slice()?;
    py.detach(|| from_bytes(bytes))
}

pub fn to_bytes(scene: &SceneData) -> PyResult<Vec<u8>> {
    let has_mask = |part: &Arc<Part>| {
        matches!(
            **part,
            Part::Mesh {
                opacity: Some(_),
                ..
            }
        )
    };
    if scene.parts.parts.iter().any(has_mask) {
        return Err(PyValueError::new_err(
            "scenes with alpha masks cannot be saved: keep the file that they were loaded from",
        ));
    }
    let mut out = Writer::default();
    out.parts(&scene.parts, scene.quality);
    let (masks, instance_masks) = (&scene.parts.masks, &scene.parts.instance_masks);
    let world = scene.world();
    let mut signature = SIGNATURE;
    let is_third = scene.parts.has_curves() || !scene.parts.paths.is_empty();
    if world.is_some() || !masks.is_empty() || !instance_masks.is_empty() || is_third {
        signature[7] = if is_third { THIRD } else { SECOND };
        out.list(masks);
        out.list(instance_masks);
        out.long(u64::from(world.is_some()));
        out.long(scene.parts.origins.len() as u64);
        for number in scene.parts.origins.as_flattened() {
            out.long(number.to_bits());
        }
    }
    if is_third {
        out.long(scene.parts.paths.len() as u64);
        out.words(scene.parts.paths.iter().map(|&place| place as u32));
    }
    let parts = out.bytes;
    let mut bytes = Vec::new();
    bytes.extend(signature);
    bytes.extend((parts.len() as u64).to_le_bytes());
    bytes.extend(xxh3_64(&parts).to_le_bytes());
    bytes.extend(parts);
    match world {
        Some(world) => world.write(&mut bytes),
        None => scene.bvh().write(&mut bytes),
    }
    .map_err(raised)?;
    Ok(bytes)
}

fn from_bytes(bytes: &[u8]) -> PyResult<Arc<SceneData>> {
    let damaged = || PyValueError::new_err("cannot read the scene: the file is damaged");
    if bytes.len() < HEAD || bytes[..7] != SIGNATURE[..7] {
        return Err(PyValueError::new_err(
            "cannot read the scene: the file was not written by Scene.save",
        ));
    }
    let version = bytes[7];
    if !(SIGNATURE[7]..=THIRD).contains(&version) {
        return Err(PyValueError::new_err(format!(
            "cannot read the scene: found version {version}, wanted 1 to {THIRD}"
        )));
    }
    let mut head = Reader { bytes: &bytes[8..] };
    let (Some(len), Some(sum)) = (head.long(), head.long()) else {
        return Err(damaged());
    };
    let rest = &bytes[HEAD..];
    let len = usize::try_from(len).ok().filter(|&len| len <= rest.len());
    let (parts, tree) = rest.split_at(len.ok_or_else(damaged)?);
    if xxh3_64(parts) != sum {
        return Err(damaged());
    }
    let mut reader = Reader { bytes: parts };
    let (mut parts, quality) = reader.parts().ok_or_else(damaged)?;
    let mut is_world = false;
    if version >= SECOND {
        parts.masks = reader.list().ok_or_else(damaged)?;
        parts.instance_masks = reader.list().ok_or_else(damaged)?;
        is_world = reader.long().ok_or_else(damaged)? != 0;
        for _ in 0..reader.count().ok_or_else(damaged)? {
            let mut origin = [0.0; 3];
            for number in &mut origin {
                *number = f64::from_bits(reader.long().ok_or_else(damaged)?);
            }
            parts.origins.push(origin);
        }
    }
    if version == THIRD {
        let paths = reader.list().ok_or_else(damaged)?;
        parts.paths = paths.into_iter().map(|place| place as i32).collect();
    }
    if !reader.bytes.is_empty() {
        return Err(damaged());
    }
    let tree = match is_world {
        true => Tree::World(Box::new(World::from_bytes(tree).map_err(raised)?)),
        false => Tree::Fixed(Box::new(Bvh::from_bytes(tree).map_err(raised)?)),
    };
    Ok(Arc::new(SceneData::new(tree, parts, quality)))
}

#[derive(Default)]
struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    fn long(&mut self, value: u64) {
        self.bytes.extend(value.to_le_bytes());
    }

    fn words(&mut self, words: impl Iterator<Item = u32>) {
        self.bytes.extend(words.flat_map(u32::to_le_bytes));
    }

    fn floats(&mut self, floats: &[f32]) {
        self.words(floats.iter().map(|float| float.to_bits()));
    }

    fn list(&mut self, list: &[u32]) {
        self.long(list.len() as u64);
        self.words(list.iter().copied());
    }

    fn parts(&mut self, parts: &Parts, quality: Quality) {
        self.long(u64::from(quality == Quality::Fast));
        for number in parts.local.origin {
            self.long(number.to_bits());
        }
        self.long(parts.parts.len() as u64);
        for part in &parts.parts {
            match &**part {
                Part::Mesh {
                    positions, indices, ..
                } => {
                    self.long(0);
                    self.long(positions.len() as u64);
                    self.floats(positions.as_flattened());
                    self.long(indices.len() as u64);
                    self.words(indices.as_flattened().iter().copied());
                }
                Part::Spheres(spheres) => {
                    self.long(1);
                    self.long(spheres.len() as u64);
                    for sphere in spheres {
                        self.floats(&sphere.center);
                        self.floats(&[sphere.radius]);
                    }
                }
                Part::Curves(segments) => {
                    self.long(2);
                    self.long(segments.points.len() as u64);
                    self.floats(segments.points.as_flattened());
                    self.list(&segments.firsts);
                    for place in &segments.places {
                        self.words([place.curve].into_iter());
                        self.floats(&place.along);
                    }
                }
            }
        }
        self.list(&parts.world);
        self.long(parts.objects.len() as u64);
        for object in &parts.objects {
            self.list(object);
        }
        self.long(parts.instances.len() as u64);
        for instance in &parts.instances {
            self.long(instance.object.into());
            self.floats(instance.transform.as_flattened());
        }
    }
}

/// Bytes that are not read yet. `None` if there are too few.
struct Reader<'a> {
    bytes: &'a [u8],
}

impl Reader<'_> {
    fn long(&mut self) -> Option<u64> {
        let (word, rest) = self.bytes.split_first_chunk::<8>()?;
        self.bytes = rest;
        Some(u64::from_le_bytes(*word))
    }

    fn words(&mut self, count: usize) -> Option<Vec<u32>> {
        let (words, rest) = self.bytes.split_at_checked(count.checked_mul(4)?)?;
        self.bytes = rest;
        let words = words.as_chunks::<4>().0.iter();
        Some(words.map(|&word| u32::from_le_bytes(word)).collect())
    }

    /// So many rows of numbers, after their count.
    fn rows<const N: usize>(&mut self) -> Option<Vec<[u32; N]>> {
        let count = usize::try_from(self.long()?).ok()?;
        let words = self.words(count.checked_mul(N)?)?;
        Some(words.as_chunks().0.to_vec())
    }

    fn list(&mut self) -> Option<Vec<u32>> {
        Some(self.rows::<1>()?.into_iter().map(|[word]| word).collect())
    }

    /// How many things follow, each of at least eight bytes.
    fn count(&mut self) -> Option<usize> {
        let count = usize::try_from(self.long()?).ok()?;
        (count <= self.bytes.len() / 8).then_some(count)
    }

    fn parts(&mut self) -> Option<(Parts, Quality)> {
        let quality = match self.long()? {
            0 => Quality::Default,
            _ => Quality::Fast,
        };
        let mut origin = [0.0; 3];
        for number in &mut origin {
            *number = f64::from_bits(self.long()?);
        }
        let mut parts = Parts {
            local: LocalOrigin { origin },
            ..Parts::default()
        };
        for _ in 0..self.count()? {
            let part = match self.long()? {
                0 => self.mesh()?,
                1 => self.spheres()?,
                2 => self.curves()?,
                _ => return None,
            };
            parts.parts.push(Arc::new(part));
        }
        parts.world = self.list()?;
        for _ in 0..self.count()? {
            parts.objects.push(self.list()?);
        }
        for _ in 0..self.count()? {
            let object = u32::try_from(self.long()?).ok()?;
            let rows = self.words(12)?;
            let rows: &[[u32; 4]; 3] = rows.as_chunks().0.try_into().ok()?;
            let transform = rows.map(|row| row.map(f32::from_bits));
            parts.instances.push(Instance::new(object, transform));
        }
        Some((parts, quality))
    }

    fn mesh(&mut self) -> Option<Part> {
        let positions = self.rows::<3>()?;
        let positions = positions
            .into_iter()
            .map(|row| row.map(f32::from_bits))
            .collect();
        let indices = self.rows::<3>()?;
        Some(Part::Mesh {
            positions,
            indices,
            opacity: None,
        })
    }

    fn spheres(&mut self) -> Option<Part> {
        let spheres = self.rows::<4>()?.into_iter();
        let spheres = spheres.map(|row| row.map(f32::from_bits));
        let spheres = spheres.map(|[x, y, z, radius]| Sphere {
            center: [x, y, z],
            radius,
        });
        Some(Part::Spheres(spheres.collect()))
    }

    fn curves(&mut self) -> Option<Part> {
        let points = self.rows::<4>()?.into_iter();
        let points = points.map(|row| row.map(f32::from_bits)).collect();
        let firsts = self.list()?;
        let places = self.words(firsts.len().checked_mul(3)?)?;
        let places = places.as_chunks().0.iter();
        let places = places.map(|&[curve, from, to]| Place {
            curve,
            along: [from, to].map(f32::from_bits),
        });
        Some(Part::Curves(Segments {
            points,
            firsts,
            places: places.collect(),
        }))
    }
}
