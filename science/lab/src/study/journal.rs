//! Finished work of a study, kept in its folder line by line, so that an interrupted study continues.
//!
//! The first line says what is studied: the version of the program, the plan and a fingerprint of every scene. Every
//! other line is a finished rendering or replay under its key. A study of something else is refused.

use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::row::Row;
use crate::Error;

/// Name of the file in the folder of a study.
pub const FILE: &str = "journal.jsonl";

/// Identity of a study.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    pub schema: String,
    pub version: String,
    /// The choices that decide the work, in words.
    pub plan: String,
    /// Name and fingerprint of every scene.
    pub scenes: Vec<(String, String)>,
}

#[derive(Serialize, Deserialize)]
struct Line {
    key: String,
    row: Row,
}

/// The finished work of a study.
pub struct Journal {
    file: Option<(File, PathBuf)>,
    finished: HashMap<String, Row>,
    /// How much of it was there before.
    pub found: usize,
}

impl Journal {
    /// A journal without a file.
    pub fn in_memory() -> Self {
        Self {
            file: None,
            finished: HashMap::new(),
            found: 0,
        }
    }

    /// The journal in a folder: continued if it is of the same study, begun if there is none or `restart` says so.
    /// A file that is no journal is refused even then.
    pub fn open(folder: &Path, header: &Header, restart: bool) -> Result<Self, Error> {
        let path = folder.join(FILE);
        let cannot = |source: std::io::Error| Error::write(&path)(source);
        match std::fs::metadata(&path) {
            // A pipe would have to be waited for.
            Ok(found) if !found.is_file() => return Err(refused(&path, "it is not a file")),
            Ok(_) if restart => {
                if !is_journal(&path).map_err(cannot)? {
                    let reason = "it is no journal of a study, and would be removed";
                    return Err(refused(&path, reason));
                }
                std::fs::remove_file(&path).map_err(cannot)?;
            }
            Err(source) if source.kind() != ErrorKind::NotFound => return Err(cannot(source)),
            _ => {}
        }
        let mut finished = HashMap::new();
        let mut length = 0;
        match File::open(&path) {
            Ok(file) => {
                let mut lines = BufReader::new(file);
                let mut text = Vec::new();
                // A line that is not whole was being written when the study ended: it is written again.
                while lines.read_until(b'\n', &mut text).map_err(cannot)? > 0 {
                    if text.last() != Some(&b'\n') {
                        break;
                    }
                    if length == 0 {
                        let found = serde_json::from_slice(&text).map_err(|error| {
                            let reason = format!("its first line is no header: {error}");
                            refused(&path, &reason)
                        })?;
                        header
                            .check(&found)
                            .map_err(|reason| refused(&path, &reason))?;
                    } else if let Ok(line) = serde_json::from_slice::<Line>(&text) {
                        finished.insert(line.key, line.row);
                    } else {
                        let reason = format!("line {} is damaged", finished.len() + 2);
                        return Err(refused(&path, &reason));
                    }
                    length += text.len() as u64;
                    text.clear();
                }
            }
            Err(source) if source.kind() == ErrorKind::NotFound => {}
            Err(source) => return Err(cannot(source)),
        }
        let open = OpenOptions::new().create(true).append(true).open(&path);
        let file = open.map_err(cannot)?;
        file.set_len(length).map_err(cannot)?;
        let mut journal = Self {
            file: Some((file, path)),
            found: finished.len(),
            finished,
        };
        if length == 0 {
            journal.write(header)?;
        }
        Ok(journal)
    }

    /// The row of a piece of work, if it is finished.
    pub fn get(&self, key: &str) -> Option<&Row> {
        self.finished.get(key)
    }

    /// Takes down a finished piece of work.
    pub fn add(&mut self, key: String, row: Row) -> Result<(), Error> {
        let line = Line { key, row };
        self.write(&line)?;
        self.finished.insert(line.key, line.row);
        Ok(())
    }

    fn write(&mut self, line: &impl Serialize) -> Result<(), Error> {
        let Some((file, path)) = &mut self.file else {
            return Ok(());
        };
        let mut text = serde_json::to_string(line).map_err(Error::report)?;
        text.push('\n');
        file.write_all(text.as_bytes()).map_err(Error::write(path))
    }
}

/// Whether a file begins like a journal, of whatever study and version. An empty file does.
fn is_journal(path: &Path) -> std::io::Result<bool> {
    const START: &[u8] = br#"{"schema":"antumbra.study.journal/"#;
    let mut head = Vec::new();
    let file = File::open(path)?.take(START.len() as u64);
    BufReader::new(file).read_to_end(&mut head)?;
    Ok(START.starts_with(&head))
}

fn refused(path: &Path, reason: &str) -> Error {
    Error::OtherStudy {
        path: path.to_path_buf(),
        reason: reason.to_owned(),
    }
}

/// Flags of a plan that another one has not.
fn beside(plan: &str, other: &str) -> String {
    let flags = |plan: &str| -> Vec<String> {
        let flags = plan.split("--").map(str::trim);
        let flags = flags.filter(|flag| !flag.is_empty());
        flags.map(|flag| format!("--{flag}")).collect()
    };
    let known = flags(other);
    let mut own = flags(plan);
    own.retain(|flag| !known.contains(flag));
    own.join(" ")
}

impl Header {
    /// Fails with the reason unless the journal that was found is of this study.
    fn check(&self, found: &Self) -> Result<(), String> {
        if found.schema != self.schema {
            return Err(format!(
                "its format is {}, not {}",
                found.schema, self.schema
            ));
        }
        if found.version != self.version {
            return Err(format!(
                "it was begun by version {}, this is {}",
                found.version, self.version
            ));
        }
        if found.plan != self.plan {
            let (found, wanted) = (&found.plan, &self.plan);
            return Err(format!(
                "it was begun with `{}`, not `{}`",
                beside(found, wanted),
                beside(wanted, found)
            ));
        }
        let names = |header: &Self| {
            let names: Vec<_> = header.scenes.iter().map(|scene| scene.0.clone()).collect();
            names.join(", ")
        };
        if names(found) != names(self) {
            return Err(format!(
                "its scenes are {}, not {}",
                names(found),
                names(self)
            ));
        }
        let changed = self.scenes.iter().zip(&found.scenes).find(|(a, b)| a != b);
        match changed {
            Some((scene, _)) => Err(format!("the scene {} has changed since", scene.0)),
            None => Ok(()),
        }
    }
}
