//! Outputs: atomic replacement of files, and the rule for links, devices and temporary files.
//!
//! # Links, devices, pipes
//!
//! An output name is followed as a shell follows the name behind `>`, see [`Target`]. A symbolic link stays, and the
//! file that it leads to is replaced, or made if there is none. Devices and pipes are written to as they are.
//!
//! # Temporary files
//!
//! A temporary file is named `.antumbra-RANDOM-CHECK.tmp`. `CHECK` is computed from `RANDOM`, so a file of the user
//! has no such name by accident. The writer holds an advisory lock on the file. A file of such a name that nobody has
//! locked was left behind by a process that was killed, and [`remove_leftovers`] removes it.

use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::hash::{BuildHasher, RandomState};
use std::io::{self, BufWriter, Cursor, ErrorKind, Seek, Write};
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, TempPath};

/// Replaces a file as a whole or not at all.
///
/// `write` fills a buffered temporary file in the directory of `path`. The temporary file is synced to the disk and
/// renamed to `path`, and the directory is synced too. At every moment, even across a crash, `path` is the old file
/// or the complete new one. On failure, the old file is untouched and the temporary file is removed.
///
/// Symbolic links are followed and stay. Permissions of an existing file are kept. A write-protected file and a
/// directory are refused. Devices, pipes and standard streams are written to directly.
///
/// # Errors
/// Of the system, or of `write` itself.
pub fn write_file(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    match Target::of(path)? {
        Target::File(file) => replace(&file, |file| write(file)),
        stream => write_to_stream(&stream, write),
    }
}

/// Output in which a writer can go back, as formats with tables at the front need.
pub trait Output: Write + Seek {}

impl<T: Write + Seek + ?Sized> Output for T {}

/// As [`write_file`], for writers that go back. The contents of a stream are kept in memory until they are complete.
///
/// # Errors
/// As [`write_file`].
pub fn write_file_seeking(
    path: &Path,
    write: impl FnOnce(&mut dyn Output) -> io::Result<()>,
) -> io::Result<()> {
    match Target::of(path)? {
        Target::File(file) => replace(&file, write),
        stream => {
            let mut bytes = Cursor::new(Vec::new());
            write(&mut bytes)?;
            write_to_stream(&stream, |stream| stream.write_all(bytes.get_ref()))
        }
    }
}

/// Writes to a target that is no regular file, or appends to one.
fn write_to_stream(
    target: &Target,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    match target {
        Target::File(path) | Target::Stream(path) => {
            write_through(OpenOptions::new().append(true).open(path)?, write)
        }
        Target::Stdout => write_through(io::stdout().lock(), write),
        Target::Stderr => write_through(io::stderr().lock(), write),
    }
}

fn write_through(
    stream: impl Write,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let mut buffered = BufWriter::new(stream);
    write(&mut buffered)?;
    buffered.flush()
}

/// Place that an output name leads to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// Regular file, or a free name. No symbolic link.
    File(PathBuf),
    /// Device, pipe or open file descriptor.
    Stream(PathBuf),
    /// Standard output of this process.
    Stdout,
    /// Standard error output of this process.
    Stderr,
}

/// Largest number of symbolic links that are followed for one name, as on Linux.
const MOST_LINKS: u32 = 40;

impl Target {
    /// Follows an output name. A link that leads nowhere ends at the free name in it.
    ///
    /// # Errors
    /// The name belongs to a directory or is no file name, or the system fails.
    pub fn of(path: &Path) -> io::Result<Self> {
        let mut place = path.to_path_buf();
        for _ in 0..MOST_LINKS {
            if let Some(stream) = descriptor(&place) {
                return Ok(stream);
            }
            match fs::symlink_metadata(&place) {
                Ok(found) if found.is_symlink() => {
                    let link = fs::read_link(&place)?;
                    place = directory(&place).join(link);
                }
                Ok(found) if found.is_file() => return Ok(Self::File(place)),
                Ok(found) if found.is_dir() => return Err(ErrorKind::IsADirectory.into()),
                Ok(_) => return Ok(Self::Stream(place)),
                Err(error) if error.kind() == ErrorKind::NotFound => {
                    let named = place.file_name().is_some();
                    return if named {
                        Ok(Self::File(place))
                    } else {
                        Err(io::Error::new(ErrorKind::InvalidInput, "not a file name"))
                    };
                }
                Err(error) => return Err(error),
            }
        }
        Err(io::Error::new(
            ErrorKind::InvalidInput,
            "too many symbolic links",
        ))
    }

    /// Follows an output name, and checks that it can be written. Leaves nothing behind, and removes what killed
    /// processes left in the directory.
    ///
    /// # Errors
    /// As [`Target::of`]; the file is write-protected, or the directory is missing or cannot be written.
    pub fn check(path: &Path) -> io::Result<Self> {
        let target = Self::of(path)?;
        match &target {
            Self::File(file) => {
                check_writable(file)?;
                let directory = directory(file);
                if !directory.is_dir() {
                    let reason = format!("there is no directory {}", directory.display());
                    return Err(io::Error::new(ErrorKind::NotFound, reason));
                }
                probe(directory)?;
                remove_leftovers(directory);
            }
            // A pipe is not opened here, because that waits for its reader.
            Self::Stream(stream) if fs::metadata(stream)?.permissions().readonly() => {
                return Err(write_protected());
            }
            _ => {}
        }
        Ok(target)
    }
}

fn write_protected() -> io::Error {
    io::Error::new(
        ErrorKind::PermissionDenied,
        "the file there is write-protected",
    )
}

/// Checks that a file, if there is one, may be written. The superuser may write any, so permissions are read too.
fn check_writable(file: &Path) -> io::Result<()> {
    match fs::metadata(file) {
        Ok(found) if found.permissions().readonly() => Err(write_protected()),
        Ok(_) => OpenOptions::new().write(true).open(file).map(drop),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error),
    }
}

/// Stream behind the name of an open file descriptor of this process.
fn descriptor(path: &Path) -> Option<Target> {
    if !cfg!(unix) {
        return None;
    }
    let stream = |name: &OsStr| match name.to_str() {
        Some("1") => Target::Stdout,
        Some("2") => Target::Stderr,
        _ => Target::Stream(path.to_path_buf()),
    };
    match path.to_str()? {
        "/dev/stdout" => Some(Target::Stdout),
        "/dev/stderr" => Some(Target::Stderr),
        _ => {
            let folders = ["/dev/fd", "/proc/self/fd"].map(Path::new);
            let parent = path.parent()?;
            let name = path.file_name()?;
            folders.contains(&parent).then(|| stream(name))
        }
    }
}

fn replace(target: &Path, write: impl FnOnce(&mut dyn Output) -> io::Result<()>) -> io::Result<()> {
    let existing = match fs::metadata(target) {
        Ok(metadata) => Some(metadata.permissions()),
        Err(error) if error.kind() == ErrorKind::NotFound => None,
        Err(error) => return Err(error),
    };
    if existing.as_ref().is_some_and(fs::Permissions::readonly) {
        return Err(write_protected());
    }
    let directory = directory(target);
    // Dropping the temporary file before `persist` removes it.
    let mut temporary = temporary(directory)?;
    let mut buffered = BufWriter::new(temporary.as_file_mut());
    write(&mut buffered)?;
    buffered.flush()?;
    drop(buffered);
    if let Some(permissions) = existing {
        temporary.as_file().set_permissions(permissions)?;
    }
    temporary.as_file().sync_all()?;
    temporary.persist(target).map_err(|error| error.error)?;
    sync_directory(directory)
}

/// Whether files can be made in a directory, tried by making one and removing it. Permissions are not enough to know:
/// there are read-only file systems and access lists.
///
/// # Errors
/// An error of the system.
pub fn probe(directory: &Path) -> io::Result<()> {
    temporary(directory)?.close()
}

/// Removes the temporary files of killed processes from a directory.
///
/// A file is removed if its name is one of ours and nobody has locked it. Where the file system has no locks, nothing
/// is removed.
pub fn remove_leftovers(directory: &Path) {
    let Ok(entries) = fs::read_dir(directory) else {
        return;
    };
    for entry in entries.flatten() {
        if !is_temporary(&entry.file_name()) || !entry.file_type().is_ok_and(|kind| kind.is_file())
        {
            continue;
        }
        let path = entry.path();
        if let Ok(file) = OpenOptions::new().read(true).write(true).open(&path)
            && file.try_lock().is_ok()
        {
            // Whoever cannot remove it has no need to: it is in nobody's way.
            let _ = fs::remove_file(path);
        }
    }
}

const PREFIX: &str = ".antumbra-";
const SUFFIX: &str = ".tmp";

/// Attempts to find a name that is free. One is enough but for an adversary.
const ATTEMPTS: u32 = 16;

/// A new temporary file in a directory, locked while it is open.
fn temporary(directory: &Path) -> io::Result<NamedTempFile> {
    let mut random = RandomState::new().hash_one(std::process::id());
    for _ in 0..ATTEMPTS {
        random = scramble(random);
        let path = directory.join(temporary_name(random));
        let file = match OpenOptions::new()
            .read(true)
            .write(true)
            .create_new(true)
            .open(&path)
        {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => continue,
            file => file?,
        };
        match file.try_lock() {
            // Another process has taken the new file for a leftover.
            Err(TryLockError::WouldBlock) => continue,
            // A file system without locks.
            Ok(()) | Err(TryLockError::Error(_)) => {}
        }
        if !is_there(&file, &path) {
            continue;
        }
        return Ok(NamedTempFile::from_parts(
            file,
            TempPath::try_from_path(path)?,
        ));
    }
    Err(ErrorKind::AlreadyExists.into())
}

/// Whether a file is still in its directory.
#[cfg(unix)]
fn is_there(file: &File, _path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    file.metadata().is_ok_and(|metadata| metadata.nlink() > 0)
}

#[cfg(not(unix))]
fn is_there(_file: &File, path: &Path) -> bool {
    path.exists()
}

fn temporary_name(random: u64) -> String {
    let check = check_of(random);
    format!("{PREFIX}{random:016x}-{check:016x}{SUFFIX}")
}

/// Whether a name is one of [`temporary_name`].
fn is_temporary(name: &OsStr) -> bool {
    let middle = name
        .to_str()
        .and_then(|name| name.strip_prefix(PREFIX)?.strip_suffix(SUFFIX));
    let random = middle.and_then(|middle| middle.split('-').next());
    let random = random.and_then(|digits| u64::from_str_radix(digits, 16).ok());
    random.is_some_and(|random| name == OsStr::new(&temporary_name(random)))
}

fn check_of(random: u64) -> u64 {
    scramble(random ^ u64::from_le_bytes(*b"antumbra"))
}

/// Output function of SplitMix64 (Steele, Lea and Flood 2014).
fn scramble(value: u64) -> u64 {
    let value = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    value ^ (value >> 31)
}

/// Directory that a file is in.
fn directory(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Syncs a directory, so that a new name survives a crash. Possible on Unix only.
fn sync_directory(directory: &Path) -> io::Result<()> {
    if !cfg!(unix) {
        return Ok(());
    }
    match File::open(directory)?.sync_all() {
        // Some file systems, most of them on networks, cannot sync directories and need not.
        Err(error) if error.kind() == ErrorKind::InvalidInput => Ok(()),
        outcome => outcome,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_our_names_are_ours() {
        let ours = temporary_name(0x1234);
        assert!(is_temporary(OsStr::new(&ours)));
        for other in [
            ".antumbra-27938.tmp",
            ".antumbra-backup.tmp",
            ".o.exr.backup.tmp",
            ".antumbra-0000000000001234-0000000000001234.tmp",
            &ours.replace(".tmp", ".bak"),
            &ours.to_uppercase(),
        ] {
            assert!(!is_temporary(OsStr::new(other)), "{other}");
        }
    }

    #[test]
    fn leftovers_go_and_files_in_work_stay() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        let dead = at(&temporary_name(7));
        fs::write(&dead, "half a pict").expect("a file");
        let users = [".antumbra-1.tmp", ".o.exr.backup.tmp", ".antumbra-00ff.tmp"];
        for name in users {
            fs::write(at(name), "mine").expect("a file");
        }
        let living = temporary(folder.path()).expect("a file");
        remove_leftovers(folder.path());
        assert!(!dead.exists());
        assert!(living.path().exists());
        assert!(users.iter().all(|name| at(name).exists()));
    }
}
