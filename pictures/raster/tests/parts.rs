//! Windows of files against the same cells of the whole: files of GDAL, and written ones in every format and order of rows.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use antumbra_raster::{Crs, Grid, Parts, Purpose, Quantity, Raster, read, write};
use tempfile::{TempDir, tempdir};
use tiff::decoder::Decoder;
use tiff::tags::Tag;

/// Numbers below others, always the same ones.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % end
    }

    /// A window of a raster: often small, at times empty or all of it.
    fn window(&mut self, [width, height]: [usize; 2]) -> [usize; 4] {
        let mut side = |size: usize| {
            let first = self.below(size + 1);
            let most = (size - first).min([0, 1, 3, 70, size, size][self.below(6)]);
            (first, self.below(most + 1))
        };
        let ((left, columns), (top, rows)) = (side(width), side(height));
        match self.below(20) {
            0 => [0, 0, width, height],
            _ => [left, top, columns, rows],
        }
    }
}

fn bits(values: impl IntoIterator<Item = f64>) -> Vec<u64> {
    values.into_iter().map(f64::to_bits).collect()
}

fn cut(all: &Raster, [left, top, columns, rows]: [usize; 4]) -> Vec<u64> {
    let lines = all.values.chunks(all.grid.width).skip(top).take(rows);
    bits(lines.flat_map(|line| line[left..][..columns].iter().copied()))
}

/// Compares windows of a file with the whole. The error of both, if there is one.
fn compare(path: &Path, numbers: &mut Numbers, windows: usize) -> Option<String> {
    let name = path.display();
    let whole = read(path, 1 << 30, Purpose::Values);
    let parts = match (&whole, Parts::open(path)) {
        (_, Ok(parts)) => parts,
        (Err(whole), Err(part)) => {
            assert_eq!(whole.to_string(), part.to_string());
            return Some(part.to_string());
        }
        (Ok(_), Err(part)) => panic!("{name}: {part}"),
    };
    let size = [parts.grid().width, parts.grid().height];
    let whole = match whole {
        Ok(whole) => whole,
        Err(whole) => {
            let part = parts.read([0, 0, size[0], size[1]]).expect_err("damaged");
            assert_eq!(whole.to_string(), part.to_string());
            return Some(part.to_string());
        }
    };
    assert_eq!(*parts.grid(), whole.grid, "{name}");
    assert_eq!(parts.height_factor(), whole.height_factor, "{name}");
    for _ in 0..windows {
        let window = numbers.window(size);
        let part = parts
            .read(window)
            .unwrap_or_else(|error| panic!("{name} {window:?}: {error}"));
        assert_eq!(bits(part), cut(&whole, window), "{name} {window:?}");
    }
    for beyond in [
        [0, 0, size[0] + 1, 1],
        [0, size[1], 1, 1],
        [1, 0, usize::MAX, 1],
        [usize::MAX, 0, 2, 0],
    ] {
        let error = parts.read(beyond).expect_err("a window beyond").to_string();
        assert!(error.contains("is not inside of its"), "{error}");
    }
    None
}

#[test]
fn windows_of_files_of_gdal_are_parts_of_the_whole() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/rasters");
    let (mut numbers, mut counts) = (Numbers(1), [0; 2]);
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("a file").path();
        if path.extension().is_some_and(|extension| extension == "tif") {
            counts[usize::from(compare(&path, &mut numbers, 200).is_some())] += 1;
        }
    }
    assert_eq!(counts, [47, 9], "files that are read, and refused");
}

const TRANSFORMS: [[f64; 6]; 5] = [
    [600_000.0, 2.0, 0.0, 5_340_000.0, 0.0, -2.0],
    [600_000.0, 2.0, 0.0, 5_340_000.0, 0.0, 2.0],
    [600_000.0, -2.0, 0.0, 5_340_000.0, 0.0, -2.0],
    [600_000.0, -2.0, 0.0, 5_340_000.0, 0.0, 2.0],
    [600_000.0, 1.5, 0.5, 5_340_000.0, 0.5, -1.5],
];

/// Writes a raster with a hole in some of its cells.
fn save(folder: &TempDir, name: &str, [width, height]: [usize; 2], transform: [f64; 6]) -> PathBuf {
    let path = folder.path().join(name);
    let crs = Some(Crs::from_epsg(25_832).expect("a code"));
    let grid = Grid {
        width,
        height,
        transform,
        crs,
    };
    let value = |cell: usize| match cell % 11 {
        3 => f32::NAN,
        _ => (cell.wrapping_mul(2_654_435_761) % 10_007) as f32 / 8.0,
    };
    let values: Vec<f32> = (0..width * height).map(value).collect();
    let bytes = write(&path, &grid, &values, &[Quantity { name: "", unit: "" }]);
    fs::write(&path, bytes.expect("a raster")).expect("a file");
    let [x, a, b, y, d, e] = transform;
    let world = [a, d, b, e, x + 0.5 * (a + b), y + 0.5 * (d + e)];
    fs::write(
        path.with_extension("wld"),
        world.map(|x| x.to_string()).join("\n"),
    )
    .expect("a file");
    path
}

#[test]
fn windows_of_written_files_are_parts_of_the_whole() {
    let (folder, mut numbers) = (tempdir().expect("a folder"), Numbers(2));
    for round in 0..40 {
        let size = [2, 2].map(|least| least + numbers.below([9, 600, 1200][round % 3]));
        let transform = TRANSFORMS[round % 5];
        for name in ["a.tif", "a.npy", "a.asc"] {
            if name == "a.asc" && (transform != TRANSFORMS[0] || round > 9) {
                continue;
            }
            let path = save(&folder, name, size, transform);
            assert_eq!(compare(&path, &mut numbers, 20), None);
        }
        // Columns one after the other, of numbers with their highest byte first.
        let head = format!(
            "{{'descr': '>i2', 'fortran_order': True, 'shape': ({}, {}), }}\n",
            size[1], size[0]
        );
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((head.len() as u16).to_le_bytes());
        bytes.extend(head.as_bytes());
        bytes.extend((0..size[0] * size[1]).flat_map(|cell| (cell as i16).to_be_bytes()));
        let path = folder.path().join("a.npy");
        fs::write(&path, bytes).expect("a file");
        assert_eq!(compare(&path, &mut numbers, 20), None);
        assert_eq!(Parts::open(&path).expect("a file").chunk(), [1, size[1]]);
    }
}

/// Offsets and lengths of the tiles of a COG.
fn tiles(bytes: &[u8]) -> Vec<[usize; 2]> {
    let mut decoder = Decoder::new(std::io::Cursor::new(bytes)).expect("a file");
    let mut list = |tag| decoder.get_tag_u64_vec(tag).expect("a list");
    let (offsets, counts) = (list(Tag::TileOffsets), list(Tag::TileByteCounts));
    offsets
        .iter()
        .zip(&counts)
        .map(|(&offset, &count)| [offset as usize, count as usize])
        .collect()
}

/// Spoils all pixels of a COG but those of some tiles, which need no others then.
#[test]
fn tiles_beside_a_window_are_not_read() {
    let folder = tempdir().expect("a folder");
    for transform in TRANSFORMS {
        let size = [1300, 1100];
        let path = save(&folder, "a.tif", size, transform);
        let whole = read(&path, 1 << 30, Purpose::Values).expect("a raster");
        let mut bytes = fs::read(&path).expect("a file");
        // Columns and rows of the stored tiles that the window touches.
        let window = [500, 100, 300, 200];
        let row = usize::from(transform[5] > 0.0);
        for (index, [offset, count]) in tiles(&bytes).into_iter().enumerate() {
            if index % 3 == 2 || index / 3 != row {
                bytes[offset..][..count].fill(0xff);
            }
        }
        fs::write(&path, &bytes).expect("a file");
        let parts = Parts::open(&path).expect("a file");
        assert_eq!(parts.chunk(), [512, 512]);
        assert_eq!(
            bits(parts.read(window).expect("tiles")),
            cut(&whole, window)
        );
        let beside = parts
            .read([500, 700, 300, 200])
            .expect_err("spoiled")
            .to_string();
        assert!(beside.contains("tile "), "{beside}");
    }
}

#[test]
fn a_file_that_was_changed_is_an_error() {
    let folder = tempdir().expect("a folder");
    for (name, size) in [
        ("a.tif", [700, 600]),
        ("a.npy", [70, 60]),
        ("a.asc", [70, 60]),
    ] {
        let path = save(&folder, name, size, TRANSFORMS[0]);
        let parts = Parts::open(&path).expect("a file");
        let bytes = fs::read(&path).expect("a file");
        fs::write(&path, &bytes[..bytes.len() - 1]).expect("a file");
        let error = parts
            .read([0, 0, 1, 1])
            .expect_err("a shorter file")
            .to_string();
        assert!(
            error.contains("it was changed after its header was read"),
            "{error}"
        );
        // Of the same length, but later.
        fs::write(&path, &bytes).expect("a file");
        let parts = Parts::open(&path).expect("a file");
        assert!(parts.read([0, 0, 1, 1]).is_ok());
        let file = fs::File::options().write(true).open(&path).expect("a file");
        let later = file
            .metadata()
            .and_then(|data| data.modified())
            .expect("a time");
        file.set_modified(later + std::time::Duration::from_secs(2))
            .expect("a time");
        assert!(parts.read([0, 0, 1, 1]).is_err());
        fs::remove_file(&path).expect("a file");
        assert!(parts.read([0, 0, 1, 1]).is_err());
    }
}

#[test]
fn truncated_files_have_the_errors_of_the_whole() {
    let (folder, mut numbers, mut refused) = (tempdir().expect("a folder"), Numbers(3), 0);
    for name in ["a.tif", "a.npy", "a.asc"] {
        let path = save(&folder, name, [40, 30], TRANSFORMS[0]);
        let bytes = fs::read(&path).expect("a file");
        for end in (0..bytes.len()).step_by(7) {
            fs::write(&path, &bytes[..end]).expect("a file");
            refused += usize::from(compare(&path, &mut numbers, 1).is_some());
        }
    }
    assert!(refused > 1000, "{refused} files are refused");
}

#[test]
fn many_threads_read_from_one_file() {
    let folder = tempdir().expect("a folder");
    let path = save(&folder, "a.tif", [1300, 1100], TRANSFORMS[3]);
    let whole = read(&path, 1 << 30, Purpose::Values).expect("a raster");
    let parts = Parts::open(&path).expect("a file");
    let done = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for thread in 0..4 {
            let (parts, whole, done) = (&parts, &whole, &done);
            scope.spawn(move || {
                let mut numbers = Numbers(thread);
                for _ in 0..20 {
                    let window = numbers.window([1300, 1100]);
                    let part = parts.read(window).expect("a window");
                    assert_eq!(bits(part), cut(whole, window));
                    done.fetch_add(1, Ordering::Relaxed);
                }
            });
        }
    });
    assert_eq!(done.into_inner(), 80);
}

#[test]
fn other_files_are_refused() {
    let folder = tempdir().expect("a folder");
    for (name, words) in [
        (
            "a.vrt",
            "a part is not read in a .vrt; write its cells to a file first",
        ),
        ("a.png", "`png` is no extension of a raster"),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, "<VRTDataset/>").expect("a file");
        let error = Parts::open(&path).expect_err(name).to_string();
        assert!(error.contains(words), "{error}");
    }
    assert!(Parts::open(folder.path()).is_err());
    assert!(Parts::open(&folder.path().join("missing.tif")).is_err());
}
