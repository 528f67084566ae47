//! [`MemorySize`], and the memory of the machine.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

/// A number of bytes: `512M`, `8G`, `1.5G` or a plain number; K, M, G and T are powers of 1024.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct MemorySize(u64);

impl MemorySize {
    /// A size of this many bytes.
    pub const fn new(bytes: u64) -> Self {
        Self(bytes)
    }

    /// The number of bytes.
    pub const fn bytes(self) -> u64 {
        self.0
    }

    /// Physical memory, or the least limit of the process's control groups if that is less. Known on Linux only;
    /// elsewhere without a limit.
    ///
    /// Control groups of version 2 and of version 1 count, with all groups that they are in.
    pub fn of_machine() -> Self {
        let confined = confined(
            &read(Path::new("/proc/self/cgroup")),
            Path::new("/sys/fs/cgroup"),
        );
        Self(physical().unwrap_or(u64::MAX).min(confined))
    }
}

/// Contents of a file of the system; empty if there is none.
fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_default()
}

fn physical() -> Option<u64> {
    let text = read(Path::new("/proc/meminfo"));
    let line = text.lines().find(|line| line.starts_with("MemTotal:"))?;
    let kibibytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kibibytes << 10)
}

/// Least memory limit of the control groups in `groups`, the text of `/proc/self/cgroup`, whose files are in `root`.
///
/// A line is `number:controllers:path`; version 2 has no controllers. In a container the files of the group itself may
/// lie in the root, whatever the path says.
fn confined(groups: &str, root: &Path) -> u64 {
    let mut least = u64::MAX;
    for line in groups.lines() {
        let mut fields = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(group)) = (fields.next(), fields.next()) else {
            continue;
        };
        let (folder, file) = match controllers {
            "" => (root.to_path_buf(), "memory.max"),
            list if list.split(',').any(|name| name == "memory") => {
                (root.join("memory"), "memory.limit_in_bytes")
            }
            _ => continue,
        };
        for group in Path::new(group.trim_start_matches('/')).ancestors() {
            // Version 2 says `max` where there is no limit; version 1 says a number beyond all memory.
            let limit = read(&folder.join(group).join(file)).trim().parse();
            least = least.min(limit.unwrap_or(u64::MAX));
        }
    }
    least
}

/// A text that is no [`MemorySize`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a size like 512M or 8G")]
pub struct BadSize(pub String);

impl FromStr for MemorySize {
    type Err = BadSize;

    fn from_str(text: &str) -> Result<Self, BadSize> {
        let wrong = || BadSize(text.to_owned());
        let (number, shift) = match text.char_indices().next_back() {
            Some((end, unit)) if unit.is_ascii_alphabetic() => {
                let power = "KMGT".find(unit.to_ascii_uppercase()).ok_or_else(wrong)?;
                (&text[..end], 10 * (power as u32 + 1))
            }
            _ => (text, 0),
        };
        let number: f64 = number.parse().map_err(|_| wrong())?;
        let bytes = number * (1_u64 << shift) as f64;
        if bytes >= 1.0 && bytes < u64::MAX as f64 {
            Ok(Self(bytes as u64))
        } else {
            Err(wrong())
        }
    }
}

impl fmt::Display for MemorySize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bytes = self.0 as f64;
        match ((bytes.max(1.0).log2() / 10.0) as usize).min(4) {
            0 => write!(f, "{} bytes", self.0),
            power => {
                let unit = ["KiB", "MiB", "GiB", "TiB"][power - 1];
                write!(f, "{:.1} {unit}", bytes / (1_u64 << (10 * power)) as f64)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_numbers_with_units() {
        let known = [
            ("1", 1),
            ("512", 512),
            ("2k", 2 << 10),
            ("512M", 512 << 20),
            ("8G", 8 << 30),
            ("1.5G", 3 << 29),
            ("16T", 16 << 40),
        ];
        for (text, bytes) in known {
            assert_eq!(text.parse(), Ok(MemorySize(bytes)), "{text}");
        }
        for text in [
            "", "G", "8P", "8GB", "-1", "0", "nan", "inf", "1e30T", "8 G", "é",
        ] {
            assert!(text.parse::<MemorySize>().is_err(), "{text}");
        }
    }

    #[test]
    fn limits_of_control_groups_count() {
        let folder = tempfile::tempdir().expect("a folder");
        let limit = |path: &str, text: &str| {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
            std::fs::write(path, text).expect("a file");
        };
        let of = |groups: &str| confined(groups, folder.path());
        assert_eq!(of("0::/a/b\n"), u64::MAX);
        limit("a/b/memory.max", "max\n");
        limit("a/memory.max", "4096\n");
        limit(
            "memory/jobs/7/memory.limit_in_bytes",
            "9223372036854771712\n",
        );
        limit("memory/jobs/memory.limit_in_bytes", "2048\n");
        // The limit of a group holds for the groups in it.
        assert_eq!(of("0::/a/b\n"), 4096);
        assert_eq!(of("0::/a\n"), 4096);
        assert_eq!(of("0::/other\n"), u64::MAX);
        let first = "12:cpu,cpuacct:/\n5:hugetlb,memory:/jobs/7\n1:name=systemd:/a\n";
        assert_eq!(of(first), 2048);
        assert_eq!(of("broken\n\n0:\n"), u64::MAX);
        // In a container.
        limit("memory.max", "1024\n");
        assert_eq!(of("0::/\n"), 1024);
        assert_eq!(of("0::/../outside\n"), 1024);
    }

    #[test]
    fn sizes_are_told_in_their_unit() {
        for (bytes, text) in [(0, "0 bytes"), (1023, "1023 bytes"), (1 << 10, "1.0 KiB")] {
            assert_eq!(MemorySize(bytes).to_string(), text);
        }
        assert_eq!(MemorySize(3 << 29).to_string(), "1.5 GiB");
        assert_eq!(MemorySize(u64::MAX).to_string(), "16777216.0 TiB");
    }
}
