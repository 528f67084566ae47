//! Names of the triangles of a scene, objects and materials, and groups by them.

use std::collections::{BTreeSet, HashMap};

use antumbra_bake::{Groups, Mesh, Orientation};
use antumbra_load::{Names, Part};
use antumbra_scene::{Geometry, Scene};
use clap::ValueEnum;

use super::ground::Ground;
use crate::exit::Failure;

/// Names of all triangles of a scene without instances, in the order of its mesh.
pub struct Parts {
    /// Names, with the end of the run of triangles that have them.
    runs: Vec<(usize, Part)>,
    /// First triangle of each shape, and its number of triangles.
    shapes: Vec<[u32; 2]>,
}

impl Parts {
    /// Names of the shapes of a flattened scene, as far as the file has any.
    pub fn new(scene: &Scene, names: &Names) -> Self {
        let named = names.flattened();
        let has_names = named.len() == scene.shapes.len();
        let (mut runs, mut shapes, mut end) = (Vec::new(), Vec::new(), 0);
        for (index, shape) in scene.shapes.iter().enumerate() {
            let count = match &shape.geometry {
                Geometry::Mesh(mesh) => mesh.indices.len(),
                Geometry::Sphere(_) | Geometry::Curves(_) => 0,
            };
            shapes.push([end as u32, count as u32]);
            let of_shape = named.get(index).filter(|_| has_names).into_iter().flatten();
            let of_shape: Vec<&Part> = of_shape.collect();
            if of_shape.iter().map(|part| part.triangles).sum::<usize>() == count {
                for part in of_shape {
                    end += part.triangles;
                    runs.push((end, part.clone()));
                }
            } else {
                end += count;
                runs.push((end, Part::default()));
            }
        }
        Self { runs, shapes }
    }

    /// Adds a shape whose triangles come last and have no names.
    pub fn push_unnamed(&mut self, triangles: usize) {
        let first = self.shapes.last().map_or(0, |[first, count]| first + count);
        self.shapes.push([first, triangles as u32]);
    }

    /// Names of a triangle.
    pub fn part(&self, triangle: usize) -> Option<&Part> {
        let run = self.runs.partition_point(|(end, _)| *end <= triangle);
        self.runs.get(run).map(|(_, part)| part)
    }

    /// Triangle of the mesh from its shape and its number there.
    pub fn flat(&self, [shape, triangle]: [u32; 2]) -> Option<u32> {
        let [first, count] = *self.shapes.get(shape as usize)?;
        (triangle < count).then_some(first + triangle)
    }

    /// Whether a triangle has the name of a material.
    pub fn has_materials(&self) -> bool {
        self.runs.iter().any(|(_, part)| !part.material.is_empty())
    }

    /// Names of the objects of all triangles. Without names in the file, connected bodies are objects.
    pub fn objects<'a>(&'a self, mesh: &Mesh) -> Objects<'a> {
        let has_names = self.runs.iter().any(|(_, part)| !part.object.is_empty());
        Objects {
            parts: self,
            bodies: (!has_names).then(|| mesh.bodies()),
        }
    }
}

/// Names of objects.
pub struct Objects<'a> {
    parts: &'a Parts,
    /// Number of the body of each triangle, where nothing has a name.
    bodies: Option<Vec<u32>>,
}

impl Objects<'_> {
    /// Name of the object of a triangle: `body 1` and so on where the file has no names, and empty for the rest of those that have.
    pub fn name(&self, triangle: usize) -> String {
        match &self.bodies {
            Some(bodies) => format!("body {}", bodies[triangle] + 1),
            None => {
                let part = self.parts.part(triangle);
                part.map_or_else(String::new, |part| part.object.clone())
            }
        }
    }

    /// A number of the object of each triangle.
    pub fn numbers(self) -> Vec<u32> {
        if let Some(bodies) = self.bodies {
            return bodies;
        }
        let (mut known, mut numbers, mut start) = (HashMap::new(), Vec::new(), 0);
        for (end, part) in &self.parts.runs {
            let next = known.len() as u32;
            let number = *known.entry(&part.object).or_insert(next);
            numbers.extend(std::iter::repeat_n(number, end - start));
            start = *end;
        }
        numbers
    }

    /// Some of the names.
    pub fn some(&self, count: usize) -> Vec<String> {
        if let Some(bodies) = &self.bodies {
            let all = bodies.iter().max().map_or(0, |&last| last as usize + 1);
            return (1..=all.min(count)).map(|i| format!("body {i}")).collect();
        }
        let names = self.parts.runs.iter().map(|(_, part)| &part.object);
        let names: BTreeSet<&String> = names.filter(|name| !name.is_empty()).collect();
        names.into_iter().take(count).cloned().collect()
    }
}

/// What groups of sensors have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum By {
    /// Objects, or bodies that touch
    Object,
    /// Materials
    Material,
    /// Sides of objects
    Facade,
}

impl By {
    /// Groups of the triangles of a scene whose surfaces are known. `compass` says where its north is.
    pub fn groups(self, ground: &Ground, compass: &Orientation) -> Result<Groups, Failure> {
        let (mesh, parts) = (&ground.mesh, &ground.parts);
        match self {
            Self::Material if !parts.has_materials() => {
                let reason = "--by material: no material of the scene has a name";
                Err(Failure::scene(&ground.loaded.scene.name, reason))
            }
            Self::Material => Ok(Groups::new(mesh, vec!["material"], |triangle| {
                let part = parts.part(triangle);
                vec![part.map_or_else(String::new, |part| part.material.clone())]
            })),
            Self::Object => {
                let objects = parts.objects(mesh);
                let name = |triangle| vec![objects.name(triangle)];
                Ok(Groups::new(mesh, vec!["object"], name))
            }
            Self::Facade => {
                let objects = parts.objects(mesh);
                let sides = mesh.sides(ground.kinds(), compass);
                let name =
                    |triangle: usize| vec![objects.name(triangle), sides[triangle].to_owned()];
                Ok(Groups::new(mesh, vec!["object", "facade"], name))
            }
        }
    }
}
