//! A city around a scene, in many files that are loaded when rays may reach them: `sun --city`.

use std::collections::{BTreeSet, HashSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use antumbra::{Aabb, Bvh, Geometry, Recipe};
use antumbra_bake::{Error, Mesh, Pieces};
use antumbra_load::{Extent, Loaded, MemorySize, Up, Upright};
use antumbra_scene::{Geometry as Surface, Shape, TriangleMesh};
use antumbra_tiles::{Box3, City, Piece, boxes_around, checksum};
use glam::DVec3;
use rayon::prelude::*;

use super::ground;
use super::parts::Parts;
use crate::archive;
use crate::exit::{Failure, tell};
use crate::scenes;

/// Part of the memory that other files may take, and most bytes of them, since many tasks may share a machine.
const KEPT: u64 = 2;
const MOST_KEPT: u64 = 1 << 30;

/// Bytes of a triangle and its part of a tree, at most.
const BYTES: u64 = 128;

/// Boxes touch if they are so near, in parts of the largest coordinate: more than a point on a surface is off it.
const NEAR: f32 = 4e-6;

/// A city, and the files of it that were read last.
pub struct Store {
    pub city: City,
    /// Checksum of the index.
    key: u64,
    memory: MemorySize,
    files: Mutex<Vec<(usize, Arc<Content>)>>,
}

/// A mesh, and the number of the object of each triangle.
#[derive(Default)]
pub struct Objects {
    pub mesh: Mesh,
    pub numbers: Vec<u32>,
}

/// What a file has.
struct Content {
    objects: Objects,
    /// A tree of it, once one is needed.
    tree: OnceLock<Arc<Bvh>>,
}

/// A city around a scene.
pub struct Around {
    store: Arc<Store>,
    /// Files that do not touch the scene.
    far: Vec<usize>,
    used: Mutex<BTreeSet<usize>>,
    failure: Mutex<Option<Failure>>,
}

/// What the tree of a scene has beside it: files that touch it, and a mark.
pub struct Beside {
    pub objects: Objects,
    pub mark: [[f32; 3]; 3],
}

impl Beside {
    /// A shape of the tree.
    pub fn shape(&self) -> Shape {
        let Mesh {
            positions, indices, ..
        } = &self.objects.mesh;
        let first = positions.len() as u32;
        let mesh = TriangleMesh {
            positions: [positions, &self.mark[..]].concat(),
            indices: [&indices[..], &[[first, first + 1, first + 2]]].concat(),
            ..TriangleMesh::default()
        };
        Shape {
            geometry: Surface::Mesh(Arc::new(mesh)),
            material: 0,
            area_light: None,
            media: None,
            alpha: None,
            shadow_alpha: None,
            reverse_orientation: false,
            transform_swaps_handedness: false,
        }
    }
}

/// Whether a file is the index of a city.
pub fn is_city(path: &Path) -> bool {
    archive::starts_with(
        path,
        format!("{{\"schema\":\"{}\"", City::SCHEMA).as_bytes(),
    )
}

/// Corners of all triangles that are finite.
fn triangles(mesh: &Mesh) -> Vec<[[f32; 3]; 3]> {
    let corners = mesh.indices.iter();
    let corners = corners.map(|corners| corners.map(|corner| mesh.positions[corner as usize]));
    let is_finite = |corners: &[[f32; 3]; 3]| corners.as_flattened().iter().all(|x| x.is_finite());
    corners.filter(is_finite).collect()
}

/// Reads a file, with positions from an origin, and which way is up in it.
fn load(path: &Path, origin: DVec3, memory: MemorySize) -> Result<(Objects, Up), Failure> {
    let Loaded {
        scene, names, up, ..
    } = scenes::load_from(path, origin, memory)?;
    let flat = scene.flattened();
    let flat = flat.map_err(|error| Failure::scene(&scene.name, error))?;
    let is_solid = |shape: &Shape| shape.alpha.is_none() && shape.shadow_alpha.is_none();
    let is_mesh = |shape: &Shape| matches!(shape.geometry, Surface::Mesh(_)) && is_solid(shape);
    if !flat.shapes.iter().all(is_mesh) {
        let reason =
            "a city is made of triangles, and it has spheres, curves or surfaces with holes";
        return Err(Failure::scene(&scene.name, reason));
    }
    let (mesh, _) = ground::mesh(&flat, false)?;
    let numbers = Parts::new(&flat, &names).objects(&mesh).numbers();
    Ok((Objects { mesh, numbers }, up.axis))
}

impl Store {
    /// Reads the index of a city, unless it is the one that was read last: tasks of a plan share what they read.
    pub fn open(index: &Path, memory: MemorySize) -> Result<Arc<Self>, Failure> {
        static LAST: Mutex<Option<Arc<Store>>> = Mutex::new(None);
        let (_, key) = checksum(index)?;
        let mut last = locked(&LAST);
        if let Some(store) = last.as_ref().filter(|store| store.key == key) {
            return Ok(store.clone());
        }
        let store = Arc::new(Self {
            city: City::read(index)?,
            key,
            memory,
            files: Mutex::default(),
        });
        *last = Some(store.clone());
        Ok(store)
    }

    /// A file, if it is as it was.
    fn file(&self, number: usize) -> Result<Arc<Content>, Failure> {
        let mut files = locked(&self.files);
        if let Some(place) = files.iter().position(|(known, _)| *known == number) {
            let found = files.remove(place);
            files.push(found.clone());
            return Ok(found.1);
        }
        let piece = &self.city.files[number];
        if checksum(&piece.path)? != (piece.bytes, piece.xxh3) {
            return Err(Failure::Data(format!(
                "{}: it is not as it was when the index was made; make the index again",
                piece.path.display()
            )));
        }
        let kept = (self.memory.bytes() / KEPT).min(MOST_KEPT);
        let mut bytes: u64 = files.iter().map(|(_, content)| content.bytes()).sum();
        while !files.is_empty() && bytes + BYTES * piece.triangles > kept {
            bytes -= files.remove(0).1.bytes();
        }
        let found = Arc::new(Content {
            objects: load(&piece.path, self.city.origin.into(), self.memory)?.0,
            tree: OnceLock::new(),
        });
        files.push((number, found.clone()));
        Ok(found)
    }
}

impl Content {
    fn bytes(&self) -> u64 {
        BYTES * self.objects.numbers.len() as u64
    }

    fn tree(&self) -> Result<Arc<Bvh>, Failure> {
        if let Some(tree) = self.tree.get() {
            return Ok(tree.clone());
        }
        let Mesh {
            positions, indices, ..
        } = &self.objects.mesh;
        let geometry = [Geometry::triangles(&positions[..], &indices[..])];
        // Little is asked of it.
        let tree = Bvh::build(&geometry, &Recipe::fast()).map_err(Failure::work)?;
        Ok(self.tree.get_or_init(|| Arc::new(tree)).clone())
    }
}

impl Objects {
    /// Adds others, as other objects.
    pub fn push(&mut self, other: &Self) {
        let Mesh {
            positions,
            indices,
            normals,
            uvs,
        } = &other.mesh;
        self.mesh.push((positions, indices), normals, uvs, false);
        let first = self.numbers.iter().max().map_or(0, |&last| last + 1);
        self.numbers
            .extend(other.numbers.iter().map(|number| first + number));
    }
}

impl Around {
    /// The city around a scene, which may be one of its files, and the files that touch it. With these, and with a
    /// [mark](Pieces::mark) of everything, a tree of the scene has the origin offsets of a tree of everything.
    pub fn new(store: Arc<Store>, (path, mesh): (&Path, &Mesh)) -> Result<(Self, Beside), Failure> {
        let city = &store.city;
        let path = real(path);
        let own = (city.files.iter()).position(|piece| real(&piece.path) == path);
        let boxes = boxes_around(&mut triangles(mesh));
        let around = |boxes: &[Box3]| Aabb::around(boxes.as_flattened());
        let bounds = around(&boxes).union(&around(&[city.bounds]));
        let slack = NEAR * bounds.reach();
        let is_near = |piece: &Piece| {
            let touches = |a: &Box3| boxes.iter().any(|b| touch(a, b, slack));
            piece.boxes.iter().any(touches)
        };
        let others = (0..city.files.len()).filter(|&number| Some(number) != own);
        let (near, far): (Vec<usize>, Vec<usize>) =
            others.partition(|&number| is_near(&city.files[number]));
        let mut objects = Objects::default();
        for &number in &near {
            objects.push(&store.file(number)?.objects);
        }
        let around = Self {
            store,
            far,
            used: Mutex::new(near.into_iter().collect()),
            failure: Mutex::default(),
        };
        Ok((
            around,
            Beside {
                objects,
                mark: Pieces::mark([bounds.min, bounds.max]),
            },
        ))
    }

    /// The box of the city in the world.
    pub fn extent(&self) -> Option<Extent> {
        let City { origin, bounds, .. } = &self.store.city;
        let corners =
            bounds.map(|corner| DVec3::from(*origin) + DVec3::from(corner.map(f64::from)));
        Extent::around(corners.into_iter().map(|corner| corner.to_array()))
    }

    /// Which way is up, if all files agree.
    pub fn up(&self) -> Option<Upright> {
        let name = self.store.city.up.as_deref();
        let known = Up::ALL.iter().find(|(known, _)| Some(*known) == name);
        known.map(|&(_, axis)| Upright {
            axis,
            reason: "as in all files of the city",
        })
    }

    /// Gives the tree of a file to a job. [`Around::failure`] says why there is none.
    pub fn loader(&self) -> impl Fn(usize) -> Result<Arc<Bvh>, Error> + Sync + '_ {
        |number| {
            let tree = self.store.file(number).and_then(|file| file.tree());
            locked(&self.used).insert(number);
            tree.map_err(|failure| {
                *locked(&self.failure) = Some(failure);
                Error::Cancelled
            })
        }
    }

    /// The other files, for a job.
    pub fn pieces<'a>(
        &'a self,
        load: &'a (dyn Fn(usize) -> Result<Arc<Bvh>, Error> + Sync),
    ) -> Result<Pieces<'a>, Failure> {
        let files = &self.store.city.files;
        let pieces = self
            .far
            .iter()
            .map(|&number| (number, &files[number].boxes[..]));
        Pieces::new(pieces, self.store.key, load).map_err(Failure::work)
    }

    /// The failure of a job, which may be one of a file.
    pub fn failure(&self, failure: Failure) -> Failure {
        locked(&self.failure).take().unwrap_or(failure)
    }

    /// Says how many files were read.
    pub fn tell(&self) {
        let (used, all) = (locked(&self.used).len(), self.store.city.files.len());
        tell(format_args!("read {used} other files of a city of {all}"));
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file by whatever name.
fn real(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_path_buf())
}

/// Whether boxes are this near to each other.
fn touch(a: &Box3, b: &Box3, slack: f32) -> bool {
    (0..3).all(|axis| a[0][axis] <= b[1][axis] + slack && b[0][axis] <= a[1][axis] + slack)
}

/// The index of mesh files, which are all read twice: their coordinates have one origin, which depends on all of them.
pub fn index(files: &[PathBuf], memory: MemorySize) -> Result<City, Failure> {
    let mut known = HashSet::new();
    if let Some(twice) = files.iter().find(|path| !known.insert(real(path))) {
        return Err(Failure::name(
            twice,
            "it is given twice, and would stand in its own light",
        ));
    }
    let extent = |path: &PathBuf| {
        let loaded = scenes::load_from(path, DVec3::ZERO, memory)?;
        loaded
            .warnings
            .iter()
            .for_each(|warning| tell(format_args!("{warning}")));
        Ok(Extent::of(&loaded.scene))
    };
    let extents: Vec<_> = files
        .par_iter()
        .map(extent)
        .collect::<Result<_, Failure>>()?;
    let corners = extents.into_iter().flatten();
    let corners = corners.flat_map(|own| [own.low, own.high].map(|corner| corner.to_array()));
    let origin = Extent::around(corners).map_or(DVec3::ZERO, |extent| extent.local_origin());
    let piece = |path: &PathBuf| {
        let (bytes, xxh3) = checksum(path)?;
        let (objects, up) = load(path, origin, memory)?;
        let mut found = triangles(&objects.mesh);
        if found.is_empty() {
            let reason = "it has no triangle with finite corners";
            return Err(Failure::scene(path.display().to_string(), reason));
        }
        let piece = Piece {
            path: std::path::absolute(path).map_err(Failure::work)?,
            bytes,
            xxh3,
            triangles: found.len() as u64,
            boxes: boxes_around(&mut found),
        };
        Ok((piece, up))
    };
    let pieces = files.par_iter().map(piece);
    let (files, ups): (Vec<Piece>, Vec<Up>) = pieces
        .collect::<Result<Vec<_>, Failure>>()?
        .into_iter()
        .unzip();
    let boxes: Vec<Box3> = files.iter().flat_map(|file| &file.boxes).copied().collect();
    let Aabb { min, max } = Aabb::around(boxes.as_flattened());
    Ok(City {
        origin: origin.to_array(),
        bounds: [min, max],
        up: ups
            .iter()
            .all(|up| *up == ups[0])
            .then(|| ups[0].to_string()),
        triangles: files.iter().map(|file| file.triangles).sum(),
        files,
    })
}
