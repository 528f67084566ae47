//! Results of a study.

use std::collections::HashMap;
use std::path::PathBuf;

use serde::Serialize;

use super::journal;
use super::plan::Plan;
use super::row::Row;
use crate::{Error, Machine};

/// The JSON document of a study, schema `antumbra.study/2`.
#[derive(Serialize)]
#[non_exhaustive]
pub struct Document<'a> {
    /// Name and version of the format.
    pub schema: &'static str,
    /// Where and how the study was made.
    #[serde(flatten)]
    pub machine: Machine,
    /// Seed of all random values.
    pub seed: u64,
    /// Whether there is a row for everything requested, timed as often; if not, the study was
    /// interrupted.
    pub complete: bool,
    /// The rows.
    pub rows: Vec<&'a Row>,
}

/// The finished work of a study.
pub struct Results<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) machine: Machine,
    /// Rows in the order of the plan, each with its scene's place.
    pub(crate) placed: Vec<(usize, Row)>,
    complete: bool,
}

impl<'a> Results<'a> {
    pub(super) fn new(plan: &'a Plan, placed: Vec<(usize, Row)>, complete: bool) -> Self {
        Self {
            plan,
            machine: Machine::new(plan.isa, &plan.caller),
            placed,
            complete,
        }
    }

    /// The rows, in the order of the plan.
    pub fn rows(&self) -> impl Iterator<Item = &Row> {
        self.placed.iter().map(|(_, row)| row)
    }

    /// Whether everything in the plan is finished; if not, the study was interrupted.
    pub fn is_complete(&self) -> bool {
        self.complete
    }

    /// The journal from which the same plan continues, if the study has a directory.
    pub fn journal(&self) -> Option<PathBuf> {
        let folder = self.plan.out.as_ref()?;
        Some(folder.join(journal::FILE))
    }

    /// Everything as a JSON document.
    pub fn document(&self) -> Document<'_> {
        Document {
            schema: "antumbra.study/2",
            machine: self.machine.clone(),
            seed: self.plan.seed,
            complete: self.complete,
            rows: self.rows().collect(),
        }
    }

    /// Fails unless all images of a scene are the same, bit for bit, and all answers to its rays.
    ///
    /// # Errors
    /// [`Error::Differ`] with the rows that differ.
    pub fn verdict(&self) -> Result<(), Error> {
        let mut first = HashMap::new();
        let mut found = Vec::new();
        for (place, row) in &self.placed {
            let image = row.image_hash.as_ref();
            let same = image.is_none_or(|hash| *first.entry(*place).or_insert(hash) == hash);
            if !same || row.equal_answers == Some(false) {
                found.push(format!(
                    "{}, width {}, {} {} {}, {:?} of {} rays",
                    row.scene,
                    row.width,
                    row.tree,
                    row.collapse,
                    row.order,
                    row.by,
                    row.rays.name()
                ));
            }
        }
        if found.is_empty() {
            return Ok(());
        }
        Err(Error::Differ {
            rule: "all images of a scene, and all answers to its rays, must be the same bit for bit",
            found,
        })
    }
}
