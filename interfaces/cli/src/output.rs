//! Files of a command: no output destroys an input or another output, and outputs that cannot be written are found
//! early.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use antumbra_image::{Target, is_our_picture};

use crate::archive;
use crate::exit::Failure;

/// The files that one command reads and writes, each known by its identity, not by its name.
#[derive(Default)]
pub struct Files {
    read: Vec<Named>,
    written: Vec<Named>,
}

/// A file and its purpose.
struct Named {
    purpose: String,
    path: PathBuf,
    identity: Identity,
}

/// Identity of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Identity {
    /// Device and inode of a file.
    #[cfg(unix)]
    File(u64, u64),
    /// Device and inode of a directory, and a name that is free in it.
    #[cfg(unix)]
    Free(u64, u64, std::ffi::OsString),
    /// Canonical path, where there are no inodes.
    #[cfg(not(unix))]
    Path(PathBuf),
    /// Standard output, which takes one output only.
    Stdout,
    /// Anything that several outputs may share, such as /dev/null.
    Shared,
}

impl Files {
    /// Notes an input. Names that lead to no file, such as the names of built-in scenes, are ignored.
    ///
    /// # Errors
    /// An output is the same file.
    pub fn reads(&mut self, purpose: &str, path: &Path) -> Result<(), Failure> {
        let Some(identity) = Identity::of_input(path) else {
            return Ok(());
        };
        let input = Named::new(purpose, path, identity);
        if let Some(output) = input.find_in(&self.written) {
            return Err(destroys(output, &input));
        }
        self.read.push(input);
        Ok(())
    }

    /// Notes every file that a scene was read from.
    ///
    /// # Errors
    /// An output is the same file.
    pub fn reads_all(&mut self, paths: &[PathBuf]) -> Result<(), Failure> {
        paths
            .iter()
            .try_for_each(|path| self.reads("an input", path))
    }

    /// Notes an output; `purpose` is its flag.
    ///
    /// # Errors
    /// An input or another output is the same file.
    pub fn writes(&mut self, purpose: &str, path: &Path) -> Result<(), Failure> {
        let output = Named::new(purpose, path, Identity::of_output(path));
        if let Some(input) = output.find_in(&self.read) {
            return Err(destroys(&output, input));
        }
        if let Some(other) = output.find_in(&self.written) {
            return Err(Failure::Usage(format!(
                "{} is meant for two outputs: {} and {} {}",
                path.display(),
                output.purpose,
                other.purpose,
                other.path.display()
            )));
        }
        self.written.push(output);
        Ok(())
    }

    /// Notes outputs by their flags, as far as they are given.
    ///
    /// # Errors
    /// As [`Files::writes`].
    pub fn writes_some<'a>(
        &mut self,
        outputs: impl IntoIterator<Item = (&'a str, Option<&'a Path>)>,
    ) -> Result<(), Failure> {
        let mut outputs = outputs.into_iter();
        outputs
            .try_for_each(|(purpose, path)| path.map_or(Ok(()), |path| self.writes(purpose, path)))
    }

    /// Notes inputs by their purposes, as far as they are given.
    ///
    /// # Errors
    /// As [`Files::reads`].
    pub fn reads_some<'a>(
        &mut self,
        inputs: impl IntoIterator<Item = (&'a str, Option<&'a Path>)>,
    ) -> Result<(), Failure> {
        let mut inputs = inputs.into_iter();
        inputs.try_for_each(|(purpose, path)| path.map_or(Ok(()), |path| self.reads(purpose, path)))
    }

    /// Notes that files may be written in a directory, under names that `ours` accepts.
    ///
    /// # Errors
    /// An input lies there under such a name.
    pub fn writes_into(
        &mut self,
        purpose: &str,
        directory: &Path,
        ours: impl Fn(&str) -> bool,
    ) -> Result<(), Failure> {
        let Ok(entries) = fs::read_dir(directory) else {
            return Ok(());
        };
        for entry in entries.flatten() {
            if entry.file_name().to_str().is_some_and(&ours) {
                self.writes(purpose, &entry.path())?;
            }
        }
        Ok(())
    }

    /// Checks that all outputs can be written, long before there is anything to write. Leaves nothing behind.
    ///
    /// # Errors
    /// An output cannot be written. One can still fail later; the check only spares people a wait in vain.
    pub fn check(&self) -> Result<(), Failure> {
        let mut outputs = self.written.iter();
        outputs.try_for_each(|output| check_file(&output.path))
    }
}

impl Named {
    fn new(purpose: &str, path: &Path, identity: Identity) -> Self {
        Self {
            purpose: purpose.to_owned(),
            path: path.to_path_buf(),
            identity,
        }
    }

    fn find_in<'a>(&self, others: &'a [Self]) -> Option<&'a Self> {
        let exclusive = self.identity != Identity::Shared;
        let mut others = others.iter();
        others.find(|other| exclusive && other.identity == self.identity)
    }
}

fn destroys(output: &Named, input: &Named) -> Failure {
    Failure::Usage(format!(
        "{} {} would destroy {} {}; nothing was written",
        output.purpose,
        output.path.display(),
        input.purpose,
        input.path.display()
    ))
}

impl Identity {
    fn of_input(path: &Path) -> Option<Self> {
        let found = fs::metadata(path).ok()?;
        found.is_file().then(|| Self::of_file(path, &found))
    }

    fn of_output(path: &Path) -> Self {
        let file = match Target::of(path) {
            Ok(Target::File(file)) => file,
            Ok(Target::Stdout) => return Self::Stdout,
            // What cannot be written is found by `check`.
            Ok(Target::Stream(_) | Target::Stderr) | Err(_) => return Self::Shared,
        };
        match fs::metadata(&file) {
            Ok(found) => Self::of_file(&file, &found),
            Err(_) => Self::of_free(&file),
        }
    }

    #[cfg(unix)]
    fn of_file(_path: &Path, found: &fs::Metadata) -> Self {
        use std::os::unix::fs::MetadataExt;
        Self::File(found.dev(), found.ino())
    }

    #[cfg(unix)]
    fn of_free(path: &Path) -> Self {
        use std::os::unix::fs::MetadataExt;
        match (fs::metadata(directory(path)), path.file_name()) {
            (Ok(found), Some(name)) => Self::Free(found.dev(), found.ino(), name.to_owned()),
            _ => Self::Shared,
        }
    }

    #[cfg(not(unix))]
    fn of_file(path: &Path, _found: &fs::Metadata) -> Self {
        Self::Path(path.canonicalize().unwrap_or_else(|_| path.to_path_buf()))
    }

    #[cfg(not(unix))]
    fn of_free(path: &Path) -> Self {
        match (directory(path).canonicalize(), path.file_name()) {
            (Ok(directory), Some(name)) => Self::Path(directory.join(name)),
            _ => Self::Shared,
        }
    }
}

/// Checks that a file can be put at `path`, long before there is anything to put there. Leaves nothing behind.
pub fn check_file(path: &Path) -> Result<(), Failure> {
    match Target::check(path) {
        Ok(_) => Ok(()),
        Err(error) => {
            let reason = match error.kind() {
                ErrorKind::IsADirectory => "that is a directory".to_owned(),
                _ => error.to_string(),
            };
            let path = path.display();
            Err(Failure::Work(format!("cannot write {path}: {reason}")))
        }
    }
}

/// Whether an output goes to a device, pipe or standard stream.
pub fn is_stream(path: &Path) -> bool {
    !matches!(Target::of(path), Ok(Target::File(_)) | Err(_))
}

/// Whether a path has one of some extensions, in letters of any case.
pub fn is_one_of(path: &Path, known: &[&str]) -> bool {
    let extension = path.extension().unwrap_or_default();
    let mut known = known.iter();
    known.any(|known| extension.eq_ignore_ascii_case(known))
}

/// A path as text.
pub fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

/// Name of a file beside an output: the output's own with something added. Streams have none.
pub fn beside(output: &Path, suffix: &str) -> Option<PathBuf> {
    if is_stream(output) {
        return None;
    }
    let mut name = output.as_os_str().to_owned();
    name.push(suffix);
    Some(name.into())
}

/// Where the checkpoint of an output lies. Streams have none.
pub fn checkpoint(output: &Path) -> Option<PathBuf> {
    beside(output, ".checkpoint")
}

/// Refuses to replace a file that the command line does not name, unless this program wrote it. `remedy` is what helps then.
pub fn check_own(path: &Path, remedy: &str) -> Result<(), Failure> {
    let ours = match fs::metadata(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Ok(found) if !found.is_file() => false,
        Ok(_) => is_our_picture(path).unwrap_or(false) || archive::is_own(path),
        Err(_) => false,
    };
    if ours {
        return Ok(());
    }
    Err(Failure::Usage(format!(
        "{} exists, and antumbra did not write it; {remedy}",
        path.display()
    )))
}

/// Refuses to replace a file beside a picture unless the picture is there, and of this program: then the file is, too.
pub fn check_beside(picture: &Path, path: &Path) -> Result<(), Failure> {
    match path.exists() && !is_our_picture(picture).unwrap_or(false) {
        true => Err(Failure::Usage(format!(
            "{} exists, and would be written beside {}; give the picture another name",
            path.display(),
            picture.display()
        ))),
        false => Ok(()),
    }
}

/// Checks that so many bytes have room beside `path`, as far as the system reports it.
pub fn check_room(path: &Path, bytes: u64) -> Result<(), Failure> {
    match fs4::available_space(directory(path)) {
        Ok(free) if free < bytes && !is_stream(path) => Err(Failure::Work(format!(
            "cannot write {}: it may take {}, and {} are free",
            path.display(),
            megabytes(bytes),
            megabytes(free)
        ))),
        _ => Ok(()),
    }
}

fn megabytes(bytes: u64) -> String {
    format!("{:.1} MB", bytes as f64 / 1e6)
}

/// The directory that a file is in.
fn directory(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two(a: &Path, b: &Path) -> Result<(), Failure> {
        let mut files = Files::default();
        files.writes("--a", a)?;
        files.writes("--b", b)
    }

    #[test]
    fn a_file_has_one_identity_however_it_is_written() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::create_dir(folder.path().join("sub")).expect("a folder");
        let at = |name: &str| folder.path().join(name);
        for same in ["./a", "sub/../a", ".//a", "sub/.././sub/../a"] {
            let failure = two(&at("a"), &at(same));
            assert!(matches!(failure, Err(Failure::Usage(_))), "{same}");
        }
        for other in ["b", "sub/a", "no/such/../a", ".."] {
            assert!(two(&at("a"), &at(other)).is_ok(), "{other}");
        }
        assert!(two(Path::new("a"), Path::new("./a")).is_err());
        assert!(two(Path::new("/dev/stdout"), Path::new("/dev/stdout")).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn links_have_the_identity_of_their_target() {
        use std::os::unix::fs::symlink;

        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| folder.path().join(name);
        fs::write(at("file"), "text").expect("a file");
        symlink("file", at("soft")).expect("a link");
        symlink("none", at("dangling")).expect("a link");
        fs::hard_link(at("file"), at("hard")).expect("a link");
        assert!(two(&at("file"), &at("soft")).is_err());
        assert!(two(&at("file"), &at("hard")).is_err());
        assert!(two(&at("none"), &at("dangling")).is_err());
        assert!(two(&at("file"), &at("dangling")).is_ok());
        assert!(two(Path::new("/dev/null"), Path::new("/dev/null")).is_ok());

        let mut files = Files::default();
        files.reads("the scene", &at("file")).expect("an input");
        let Err(Failure::Usage(text)) = files.writes("--json", &at("soft")) else {
            panic!("an input was to be destroyed");
        };
        assert!(text.contains("soft") && text.contains("file"), "{text}");
    }
}
