//! Meshes in separate files, which are read together and in parallel when the whole scene is known.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use antumbra_scene::{Geometry, Object, Shape, TriangleMesh};
use glam::{DMat4, DVec3};
use rayon::prelude::*;

use crate::Error;
use crate::budget::Budget;
use crate::ply::load_ply_from;
use crate::report::Report;
use crate::source::Span;

/// Mesh file that a scene names.
pub(crate) struct MeshFile {
    /// Name as the scene spells it.
    pub name: String,
    pub path: PathBuf,
    /// Place of the name.
    pub at: Span,
    /// From the space of the file, measured from `middle`.
    pub to_world: DMat4,
    pub middle: DVec3,
}

/// Mesh files that are not read yet, and the shapes that need them.
#[derive(Default)]
pub(crate) struct PendingMeshes(Vec<Pending>);

struct Pending {
    /// Object of the shape; `None` for shapes of the world.
    object: Option<usize>,
    /// Index in the list of shapes of the object or the scene.
    shape: usize,
    file: MeshFile,
}

impl PendingMeshes {
    /// Adds a shape whose mesh is to be read.
    pub fn push(&mut self, object: Option<usize>, shape: usize, file: MeshFile) {
        self.0.push(Pending {
            object,
            shape,
            file,
        });
    }

    /// Reads the meshes of all shapes, and reports broken ones. Returns the time spent.
    ///
    /// Shapes of objects without instances are skipped. A file that is named several times under equal transformations
    /// is read once, and its mesh is shared.
    pub fn read(
        mut self,
        shapes: &mut [Shape],
        objects: &mut [Object],
        budget: &mut Budget,
        report: &mut Report,
    ) -> Duration {
        let start = Instant::now();
        self.0.retain(|pending| {
            let object = pending.object;
            object.is_none_or(|object| !objects[object].shapes.is_empty())
        });
        let files: Vec<&MeshFile> = self.0.iter().map(|pending| &pending.file).collect();
        let meshes = read_all(&files, budget, report);
        for (pending, mesh) in self.0.iter().zip(meshes) {
            let shapes = match pending.object {
                Some(object) => &mut objects[object].shapes,
                None => &mut *shapes,
            };
            if let Some(mesh) = mesh {
                shapes[pending.shape].geometry = Geometry::Mesh(mesh);
            }
        }
        start.elapsed()
    }
}

/// Transformed meshes in the order of the files. `None`: a mistake was reported.
fn read_all(
    files: &[&MeshFile],
    budget: &mut Budget,
    report: &mut Report,
) -> Vec<Option<Arc<TriangleMesh>>> {
    let mut firsts = HashMap::new();
    let mut unique: Vec<&MeshFile> = Vec::new();
    let indices: Vec<usize> = files
        .iter()
        .map(|file| {
            let bits = file.to_world.to_cols_array().map(f64::to_bits);
            *firsts.entry((&file.path, bits)).or_insert_with(|| {
                unique.push(file);
                unique.len() - 1
            })
        })
        .collect();
    // Sizes on disk are taken from the budget first, so that nothing too large is read. Sizes in memory follow.
    let size = |file: &MeshFile| std::fs::metadata(&file.path).map_or(0, |metadata| metadata.len());
    let sizes: Vec<_> = unique.iter().map(|file| size(file)).collect();
    if report.is_over() {
        return vec![None; files.len()];
    }
    for (file, size) in unique.iter().zip(&sizes) {
        if !budget.take(*size, file.at, report) {
            return vec![None; files.len()];
        }
    }
    let left = budget.left(report);
    let read: Vec<_> = unique
        .par_iter()
        .with_max_len(1)
        .map(|file| {
            let mut mesh = load_ply_from(&file.path, left, file.middle)?;
            mesh.transform(&file.to_world);
            Ok(Arc::new(mesh))
        })
        .collect();
    for file in &unique {
        report.sources.note(file.path.clone());
    }
    for ((file, size), mesh) in unique.iter().zip(sizes).zip(&read) {
        if let Ok(mesh) = mesh {
            budget.take(mesh.bytes().saturating_sub(size), file.at, report);
        }
    }
    let meshes = files.iter().zip(indices);
    meshes
        .map(|(file, index)| match &read[index] {
            Ok(mesh) => Some(Arc::clone(mesh)),
            Err(error) => {
                report_error(file, error, report);
                None
            }
        })
        .collect()
}

fn report_error(file: &MeshFile, error: &Error, report: &mut Report) {
    let (problem, help) = match error {
        Error::Ply(error) => (error.located(), error.help.clone()),
        Error::Io { source, .. } => {
            let help = "paths start at the folder of the main scene file";
            (source.to_string(), Some(help.to_owned()))
        }
        error => (error.to_string(), None),
    };
    let message = format!("cannot read mesh {:?}: {problem}", file.name);
    report.add_error(file.at, message, help);
}
