//! Rasters of many files: what is read is what the whole has, and what is wrong is said.

use std::fs;
use std::path::{Path, PathBuf};

use antumbra_raster::{Grid, Purpose, Quantity, read_all, write};
use antumbra_terrain::{HeightField, Peaks, Tile, Tiles};
use antumbra_tiles::{Index, Indexed};

const HEIGHT: Quantity<'_> = Quantity {
    name: "height",
    unit: "m",
};

/// A number from 0 to 1 for each number.
fn noise(number: usize) -> f64 {
    let mut state = number as u64 ^ 0x9e37_79b9_7f4a_7c15;
    for _ in 0..3 {
        state = (state ^ (state >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    }
    (state >> 11) as f64 / (1_u64 << 53) as f64
}

/// Files of different formats and sizes that overlap with other heights, with gaps and holes.
fn files(folder: &Path) -> Vec<PathBuf> {
    let places = [
        ("a.tif", [0, 0], [700, 300]),
        ("b.tif", [650, 100], [400, 550]),
        ("c.asc", [0, 280], [300, 90]),
        ("d.tif", [320, 310], [120, 340]),
    ];
    let all = places
        .iter()
        .enumerate()
        .map(|(number, (name, [column, row], [width, height]))| {
            let corner = [6e5 + 2.0 * f64::from(*column), 5e6 - 2.0 * f64::from(*row)];
            let grid = Grid::north_up([*width, *height], corner, 2.0);
            let height = |cell: usize| match noise(cell + 7_919 * number) {
                x if x < 0.03 => f32::NAN,
                x => (40.0 * x) as f32,
            };
            let heights: Vec<f32> = (0..width * grid.height).map(height).collect();
            let path = folder.join(name);
            fs::write(
                &path,
                write(&path, &grid, &heights, &[HEIGHT]).expect("bytes"),
            )
            .expect("a file");
            path
        });
    all.collect()
}

#[test]
fn parts_are_those_of_the_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = files(folder.path());
    let whole = read_all(&files, 1 << 30, Purpose::Values).expect("a raster");
    let path = folder.path().join("all.index");
    let index = Index::make(&files, &path, &()).expect("an index");
    let (grid, tiles) = (&whole.raster.grid, whole.tiles.expect("files"));
    assert_eq!([index.columns, index.rows], [grid.width, grid.height]);
    let known = whole
        .raster
        .values
        .iter()
        .filter(|height| height.is_finite());
    assert_eq!(index.cells, known.clone().count() as u64);
    assert_eq!(index.differing, tiles.differing);
    let (low, high) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| {
        (x.min(low), x.max(high))
    });
    assert_eq!([index.low[2], index.high[2]], [low, high]);
    assert_eq!(Index::read(&path).expect("an index"), index);
    // With room for much, for little, and for nothing.
    for room in [1 << 30, 1 << 20, 0] {
        let indexed = Indexed::open(&path, room).expect("a raster");
        for number in 0..60 {
            let at = [0, 1].map(|axis| {
                (noise(5 * number + axis) * 0.95 * index.whole().size[axis] as f64) as i64
            });
            let end = [0, 1].map(|axis| index.whole().size[axis] as i64 - at[axis]);
            let size = [0, 1]
                .map(|axis| 1 + (noise(5 * number + 2 + axis) * (end[axis] as f64 - 1.0)) as usize);
            let found = indexed.read(Tile { at, size }).expect("heights");
            let rows = whole
                .raster
                .values
                .chunks_exact(grid.width)
                .skip(at[1] as usize)
                .take(size[1]);
            let wanted = rows.flat_map(|row| &row[at[0] as usize..][..size[0]]);
            let bits = |x: &f64| if x.is_nan() { 0 } else { x.to_bits() };
            assert!(
                found.iter().map(bits).eq(wanted.map(bits)),
                "{at:?} {size:?} {room}"
            );
        }
    }
}

#[test]
fn peaks_are_above_all_cells() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = files(folder.path());
    let path = folder.path().join("all.index");
    let index = Index::make(&files, &path, &()).expect("an index");
    let indexed = Indexed::open(&path, 1 << 30).expect("a raster");
    let mut is_seen = vec![false; index.columns * index.rows];
    for (number, tile) in indexed.tiles().iter().enumerate() {
        let heights = indexed.read(*tile).expect("heights");
        let field = HeightField::new(tile.size, &heights, index.transform).expect("a field");
        let wanted = Peaks::new(&field, 8).expect("peaks").values();
        let found = indexed
            .peaks(number)
            .expect("peaks")
            .expect("known ones")
            .values();
        let most = indexed.peak(number);
        for (cell, height) in heights.iter().enumerate() {
            let [column, row] = [cell % tile.size[0], cell / tile.size[0]];
            let at = (tile.at[1] as usize + row) * index.columns + tile.at[0] as usize + column;
            let peak = found[row / 8 * tile.size[0].div_ceil(8) + column / 8];
            // A cell in several files is below a peak of one of them.
            is_seen[at] |= height.is_nan() || *height <= peak && *height <= most;
        }
        assert_eq!(found.len(), wanted.len());
    }
    let known = indexed.read(index.whole()).expect("heights");
    assert!(
        known
            .iter()
            .zip(is_seen)
            .all(|(height, is_seen)| height.is_nan() || is_seen)
    );
}

#[test]
fn indices_that_are_not_of_these_files_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = files(folder.path());
    let path = folder.path().join("all.index");
    Index::make(&files, &path, &()).expect("an index");
    let text = fs::read_to_string(&path).expect("a text");
    assert!(
        text.contains("\"path\":\"a.tif\""),
        "names are relative: {text}"
    );
    let refused = |text: &str, wanted: &str| {
        fs::write(&path, text).expect("a file");
        let error = Indexed::open(&path, 0).expect_err(wanted).to_string();
        assert!(error.contains(wanted), "{error}");
    };
    refused("", "line 1: wanted an index");
    refused(&text.replace("index/1", "index/9"), "found the schema");
    let short: Vec<&str> = text.lines().take(3).collect();
    refused(&short.join("\n"), "found 2 files, wanted 4");
    refused(
        &text.replace("[700,300]", "[700,3000]"),
        "line 2: wanted a file inside",
    );
    refused(
        &text.replace("\"at\":[650,100]", "\"at\":[651,100]"),
        "line 3: wanted a file inside",
    );
    refused(
        &text.replace("\"peaks\":[", "\"peaks\":[1.0,"),
        "a peak for each square",
    );
    // Records that are damaged, and a file that is cut short.
    fs::write(&path, &text).expect("a file");
    let peaks = folder.path().join("all.index.peaks");
    let whole = fs::read(&peaks).expect("bytes");
    let mut bytes = whole.clone();
    bytes[100] ^= 1;
    fs::write(&peaks, &bytes).expect("a file");
    let indexed = Indexed::open(&path, 0).expect("only records are damaged");
    let error = indexed.peaks(0).expect_err("damaged").to_string();
    assert!(error.contains("record 0 is damaged"), "{error}");
    assert!(indexed.peaks(1).is_ok());
    fs::write(&peaks, &whole[..whole.len() - 1]).expect("a file");
    let indexed = Indexed::open(&path, 0).expect("an index");
    let error = indexed.peaks(0).expect_err("short").to_string();
    assert!(error.contains("it is not of"), "{error}");
    // A file that is another one since then.
    fs::write(&peaks, &whole).expect("a file");
    let indexed = Indexed::open(&path, 0).expect("a raster");
    fs::copy(&files[3], &files[0]).expect("a copy");
    let error = indexed
        .read(Tile {
            at: [0, 0],
            size: [9, 9],
        })
        .expect_err("changed")
        .to_string();
    assert!(
        error.contains("a.tif") && error.contains("make the index again"),
        "{error}"
    );
}
