//! Meshes in files of their own: read together, in parallel, when the whole scene is known.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use antumbra_scene::TriangleMesh;
use glam::DMat4;
use rayon::prelude::*;

use crate::Error;
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

/// The meshes, moved to where they stand, in the order of the files; `None`: something was reported. Files
/// that are named again under the same transformation are read once and share their mesh.
pub(crate) fn read_all(files: &[&MeshFile], report: &mut Report) -> Vec<Option<Arc<TriangleMesh>>> {
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
    let read: Vec<_> = unique
        .par_iter()
        .with_max_len(1)
        .map(|file| {
            let mut mesh = load_ply(&file.path)?;
            mesh.transform(&file.to_world);
            Ok(Arc::new(mesh))
        })
        .collect();
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
