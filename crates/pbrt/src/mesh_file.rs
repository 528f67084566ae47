//! Meshes in files of their own: read together, in parallel, when the whole scene is known.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use antumbra_scene::{Geometry, Object, Shape, TriangleMesh};
use glam::DMat4;
use rayon::prelude::*;

use crate::Error;
use crate::budget::Budget;
use crate::ply::load_ply;
use crate::report::Report;
use crate::source::Span;

/// A mesh that a scene names.
pub(crate) struct MeshFile {
    /// As the scene has it.
    pub name: String,
    pub path: PathBuf,
    /// Where it is named.
    pub at: Span,
    pub to_world: DMat4,
}

/// Meshes that are not read yet, and the shapes that wait for them.
#[derive(Default)]
pub(crate) struct WaitingMeshes(Vec<Waiting>);

struct Waiting {
    /// The object of the shape, if it has one.
    object: Option<usize>,
    /// Position in the list of shapes, of the object or of the scene.
    shape: usize,
    file: MeshFile,
}

impl WaitingMeshes {
    /// Has a shape wait for its mesh.
    pub fn push(&mut self, object: Option<usize>, shape: usize, file: MeshFile) {
        self.0.push(Waiting {
            object,
            shape,
            file,
        });
    }

    /// Gives all shapes that are still there their meshes, and reports the broken ones. Files that are named
    /// again under the same transformation are read once and share their mesh. Returns the time it took.
    pub fn read(
        mut self,
        shapes: &mut [Shape],
        objects: &mut [Object],
        budget: &mut Budget,
        report: &mut Report,
    ) -> Duration {
        let start = Instant::now();
        self.0.retain(|waiting| {
            let object = waiting.object;
            object.is_none_or(|object| !objects[object].shapes.is_empty())
        });
        let files: Vec<&MeshFile> = self.0.iter().map(|waiting| &waiting.file).collect();
        let meshes = read_all(&files, budget, report);
        for (waiting, mesh) in self.0.iter().zip(meshes) {
            let shapes = match waiting.object {
                Some(object) => &mut objects[object].shapes,
                None => &mut *shapes,
            };
            if let Some(mesh) = mesh {
                shapes[waiting.shape].geometry = Geometry::Mesh(mesh);
            }
        }
        start.elapsed()
    }
}

/// The meshes, moved to where they stand, in the order of the files; `None`: something was reported.
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
    // Their sizes on disk first, so that nothing is read of too much; then what they have become.
    let size = |file: &MeshFile| std::fs::metadata(&file.path).map_or(0, |metadata| metadata.len());
    let sizes: Vec<_> = unique.iter().map(|file| size(file)).collect();
    for (file, size) in unique.iter().zip(&sizes) {
        if !budget.take(*size, file.at, report) {
            return vec![None; files.len()];
        }
    }
    let read: Vec<_> = unique
        .par_iter()
        .with_max_len(1)
        .map(|file| {
            let mut mesh = load_ply(&file.path)?;
            mesh.transform(&file.to_world);
            Ok(Arc::new(mesh))
        })
        .collect();
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
    match help {
        Some(help) => report.error_help(file.at, message, help),
        None => report.error(file.at, message),
    }
}
