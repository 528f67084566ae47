//! The memory budget, and estimates of what a scene and its picture take.
//!
//! A file of a few lines can ask for more memory than any machine has. Running out of it would end the program
//! without a word.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use antumbra_scene::{Geometry, Instance, Scene};

use crate::Error;

/// Bytes per stored triangle: its mesh, the kernel's geometry, the binary and the wide tree. Measured as the peak of
/// the whole program on the built-in city of 1 and 3 million triangles (245 to 256).
const PER_TRIANGLE: u64 = 256;
/// Bytes per instance in the scene, in the kernel and in the tree. Measured as the peak of the whole program on 400,000
/// instances of two triangles, spread out (1500), and on a million in one place (1250).
const PER_INSTANCE: u64 = 1440;
/// Bytes per pixel: sums, squares for the standard error, and the finished picture.
const PER_PIXEL: u64 = 128;
/// Bytes per pixel of layers beside that: 232 of a whole picture were measured, and a checkpoint's copy is 50.
const PER_PIXEL_OF_LAYERS: u64 = 160;
/// Samples of the pre-pass that learns are kept: bytes each, and their share of all samples.
const PER_LOGGED_SAMPLE: f64 = 12.0;
const LOGGED_SHARE: f64 = 0.01;

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

/// Refuses a scene that does not fit, before any tree is built over it. An estimate: scenes near the limit may be
/// misjudged by some tenths either way.
pub(crate) fn check(scene: &Scene, allowed: MemorySize) -> Result<(), Error> {
    let needed = MemorySize(geometry(scene));
    if needed <= allowed {
        return Ok(());
    }
    Err(Error::SceneTooLarge {
        scene: scene.name.clone(),
        triangles: scene.stored_triangle_count(),
        instances: scene.instances.len(),
        needed,
        allowed,
    })
}

/// Refuses a picture that does not fit beside its scene, with or without layers. `samples` is the number per pixel; `None`
/// is the scene's own.
///
/// # Errors
/// [`Error::PictureTooLarge`].
pub fn check_picture(
    scene: &Scene,
    samples: Option<u32>,
    layers: bool,
    allowed: MemorySize,
) -> Result<(), Error> {
    let per_pixel = match layers {
        true => PER_PIXEL + PER_PIXEL_OF_LAYERS,
        false => PER_PIXEL,
    };
    let [x0, x1, y0, y1] = scene.film.pixel_bounds().map(u64::from);
    let pixels = x1.saturating_sub(x0) * y1.saturating_sub(y0);
    let samples = samples.unwrap_or(scene.sampler.pixel_samples);
    let logged = pixels as f64 * f64::from(samples) * LOGGED_SHARE * PER_LOGGED_SAMPLE;
    let needed = pixels
        .saturating_mul(per_pixel)
        .saturating_add(logged as u64)
        .saturating_add(geometry(scene));
    let needed = MemorySize(needed);
    if needed <= allowed {
        return Ok(());
    }
    Err(Error::PictureTooLarge {
        scene: scene.name.clone(),
        pixels,
        samples,
        needed,
        allowed,
    })
}

fn geometry(scene: &Scene) -> u64 {
    let meshes = scene.stored_shapes().map(|shape| match &shape.geometry {
        Geometry::Mesh(mesh) => mesh.indices.len() as u64 * PER_TRIANGLE,
        Geometry::Sphere(_) => PER_TRIANGLE,
    });
    let instances = scene.instances.len() as u64 * (PER_INSTANCE + size_of::<Instance>() as u64);
    meshes.fold(instances, u64::saturating_add)
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
