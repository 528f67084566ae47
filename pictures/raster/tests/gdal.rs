//! Files that GDAL wrote with its creation options, cell by cell against what rasterio reads: `rasters/make.py` makes both.

use std::path::PathBuf;

use antumbra_raster::{Purpose, read};

#[test]
fn files_of_gdal_are_read_as_gdal_reads_them() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/rasters");
    let text = std::fs::read_to_string(folder.join("expected.txt")).expect("a table");
    let mut counts = [0; 2];
    for line in text.lines() {
        let (name, rest) = line.split_once(' ').expect("a name");
        let found = read(&folder.join(name), 1 << 22, Purpose::Mesh);
        if let Some(words) = rest.strip_prefix("! ") {
            let error = found.expect_err(name).to_string();
            assert!(error.contains(words), "{name}: {error}");
            counts[1] += 1;
            continue;
        }
        let raster = found.unwrap_or_else(|error| panic!("{name}: {error}"));
        let number = |word: &str| word.parse().unwrap_or(f64::NAN);
        let numbers: Vec<f64> = rest.split(' ').map(number).collect();
        let (place, cells) = numbers.split_at(8);
        let grid = &raster.grid;
        assert_eq!(
            [grid.width as f64, grid.height as f64],
            place[..2],
            "{name}"
        );
        assert_eq!(grid.transform, place[2..], "{name}");
        let same = |a: f64, b: f64| a == b || a.is_nan() && b.is_nan();
        assert_eq!(raster.values.len(), cells.len(), "{name}");
        for (index, (&found, &wanted)) in raster.values.iter().zip(cells).enumerate() {
            assert!(
                same(found, wanted),
                "{name}, cell {index}: {found}, not {wanted}"
            );
        }
        counts[0] += 1;
    }
    assert_eq!(counts, [47, 9], "files that are read, and refused");
}
