//! Works on the same questions, measured interleaved, and the record of all of them.

use std::fmt;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use antumbra::{Isa, Recipe, Width};
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::Serialize;

use super::{Answer, Measured, Work, measure, ratios, spread, work};
use crate::embree::{Device, Embree};
use crate::{Caller, Error, Machine, write_json};

/// Rays of each kind.
const RAYS: usize = 1 << 16;

/// What all cases share, and what they have found.
pub struct Bench {
    /// Rounds in which every work is timed once.
    pub rounds: usize,
    /// Every so many-th question is put, to try a case.
    pub part: usize,
    pool: ThreadPool,
    device: Option<Arc<Device>>,
    record: Record,
    show: fn(&Row),
}

/// Rows with the machine, the commit and the tree that they are of: schema `antumbra.cases/1`.
#[derive(Serialize)]
struct Record {
    schema: &'static str,
    #[serde(flatten)]
    machine: Machine,
    commit: Option<String>,
    embree: Option<String>,
    tree: Tree,
    rounds: usize,
    /// Every so many-th question was put.
    part: usize,
    rows: Vec<Row>,
}

/// The default tree, which is measured unless a row says otherwise.
#[derive(Serialize)]
struct Tree {
    builder: &'static str,
    collapse: &'static str,
    order: &'static str,
    width: usize,
}

/// One work of a case.
#[derive(Serialize)]
pub struct Row {
    /// The questions.
    pub case: String,
    /// Who answers, and how.
    pub work: String,
    /// Number of questions.
    pub count: usize,
    /// Median, least and most of the rounds.
    pub seconds: [f64; 3],
    /// The work that the speedup is over.
    pub over: String,
    /// Median, least and most of the rounds.
    pub speedup: [f64; 3],
    /// Answers that differ from the answers of that work.
    pub differ: usize,
    /// Part of the time that went into building; null for a call.
    pub build_seconds: Option<f64>,
    /// Lines of the program's text; null unless texts are compared.
    pub lines: Option<usize>,
}

impl Bench {
    /// Cases of the program in a checkout, of which `folder` is a part; `show` is given every row as soon as it is measured.
    ///
    /// # Errors
    /// A library that is not Embree 4, or no thread.
    pub fn new(
        folder: &Path,
        library: Option<&Path>,
        (rounds, part): (usize, usize),
        show: fn(&Row),
    ) -> Result<Self, Error> {
        let embree = library.map(Embree::load).transpose()?;
        let device = embree.map(|embree| Device::new(embree, None, 1));
        let pool = ThreadPoolBuilder::new().num_threads(1).build();
        let (recipe, isa) = (Recipe::default(), Isa::best());
        let caller = Caller {
            command_line: std::env::args().collect(),
            ..Caller::default()
        };
        Ok(Self {
            rounds,
            part,
            pool: pool.map_err(|source| Error::Threads { threads: 1, source })?,
            device: device.transpose()?,
            record: Record {
                schema: "antumbra.cases/1",
                machine: Machine::new(isa, &caller),
                commit: commit(folder),
                embree: embree.map(Embree::version),
                tree: Tree {
                    builder: recipe.builder.name(),
                    collapse: recipe.collapse.name(),
                    order: recipe.order.name(),
                    width: Width::auto(isa.level()).lanes(),
                },
                rounds,
                part,
                rows: Vec::new(),
            },
            show,
        })
    }

    /// Embree's device, of one thread.
    ///
    /// # Errors
    /// Advice, if there is no library.
    pub fn device(&self) -> Result<Arc<Device>, &'static str> {
        let device = self.device.clone();
        device.ok_or("name Embree's library with --embree")
    }

    /// Number of rays of a kind.
    pub fn rays(&self) -> usize {
        RAYS / self.part
    }

    /// Shows and keeps a row.
    pub fn add(&mut self, row: Row) {
        (self.show)(&row);
        self.record.rows.push(row);
    }

    /// The rows so far.
    pub fn rows(&self) -> &[Row] {
        &self.record.rows
    }

    /// Writes the record.
    ///
    /// # Errors
    /// [`Error::Image`] if the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        write_json(&self.record, path)
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            case,
            work,
            count,
            differ,
            ..
        } = self;
        let ([seconds, ..], [speedup, least, most]) = (self.seconds, self.speedup);
        let each = seconds / *count as f64;
        let time = match each < 1e-4 {
            true => format!("{:9.1} ns", 1e9 * each),
            false => format!("{:9.4} ms", 1e3 * each),
        };
        write!(
            f,
            "{case:24} {work:34} {time} {speedup:6.2} ({least:.2} to {most:.2})  {differ} of {count} differ"
        )?;
        if let Some(build) = self.build_seconds {
            write!(f, ", {seconds:.3} s, {build:.3} s of them to build")?;
        }
        self.lines
            .map_or(Ok(()), |lines| write!(f, ", {lines} lines"))
    }
}

/// The commit of a checkout, with a mark if files have changed.
fn commit(folder: &Path) -> Option<String> {
    let describe = ["describe", "--always", "--abbrev=40", "--dirty"];
    let git = Command::new("git")
        .arg("-C")
        .arg(folder)
        .args(describe)
        .output();
    let text = String::from_utf8(git.ok()?.stdout).ok()?;
    Some(text.trim().to_owned()).filter(|text| !text.is_empty())
}

/// Works on the same questions.
pub struct Case<'a> {
    name: String,
    count: usize,
    /// Each with its name and the place of the work that it is relative to.
    works: Vec<(String, usize, Box<dyn Work + 'a>)>,
}

impl<'a> Case<'a> {
    /// A case of so many questions.
    pub fn new(name: impl Into<String>, count: usize) -> Self {
        Self {
            name: name.into(),
            count,
            works: Vec::new(),
        }
    }

    /// Adds a work that all further ones are relative to. Answers begin as `fresh` in each round.
    pub fn base<A: Answer + 'a>(
        &mut self,
        name: impl Into<String>,
        fresh: Vec<A>,
        run: impl FnMut(&mut [A]) + Send + 'a,
    ) {
        self.works
            .push((name.into(), self.works.len(), work(fresh, run)));
    }

    /// Adds a work.
    pub fn add<A: Answer + 'a>(
        &mut self,
        name: impl Into<String>,
        fresh: Vec<A>,
        run: impl FnMut(&mut [A]) + Send + 'a,
    ) {
        let base = self.works.last().map_or(0, |(_, base, _)| *base);
        self.works.push((name.into(), base, work(fresh, run)));
    }

    /// Measures all works. Distances may differ by so much of themselves, and absolutely.
    ///
    /// # Errors
    /// A failure of the harness.
    pub fn run(self, bench: &mut Bench, tolerance: [f32; 2]) -> Result<(), Error> {
        let (names, teams): (Vec<_>, Vec<_>) = self
            .works
            .into_iter()
            .map(|(name, base, work)| ((name, base), vec![work]))
            .unzip();
        let measured = measure(teams, &bench.pool, bench.rounds, &())?;
        for ((name, base), Measured { seconds, answers }) in names.iter().zip(&measured) {
            let other = &measured[*base];
            bench.add(Row {
                case: self.name.clone(),
                work: name.clone(),
                count: self.count,
                seconds: spread(seconds.iter().copied()),
                over: names[*base].0.clone(),
                speedup: spread(ratios(seconds, &other.seconds)),
                differ: answers.differing_by(&other.answers, tolerance),
                build_seconds: None,
                lines: None,
            });
        }
        Ok(())
    }
}
