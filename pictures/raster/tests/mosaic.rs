//! Several files as one raster: made-up tiles against the raster that they were cut from, and mosaics of GDAL where it is installed.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use antumbra_raster::{
    Crs, Error, Grid, Mosaic, Purpose, Quantity, Raster, neighbours, read, read_all, write,
};

const SIZE: [usize; 2] = [23, 17];

/// Cells of half a metre, each with its own height, and a hole.
fn whole() -> Raster {
    let mut grid = Grid::north_up(SIZE, [600_000.25, 5_340_000.75], 0.5);
    grid.crs = Some(Crs::from_epsg(25_832).expect("a code"));
    let height = |cell: usize| match cell {
        100..103 => f64::NAN,
        _ => 100.0 + cell as f64 / 8.0,
    };
    Raster {
        grid,
        values: (0..SIZE[0] * SIZE[1]).map(height).collect(),
        height_factor: None,
    }
}

/// Cells of columns and rows from a first one on.
fn cut(all: &Raster, [column, row]: [usize; 2], [width, height]: [usize; 2]) -> Raster {
    let mut grid = all.grid.clone();
    let [x, y] = grid.corner(column as f64, row as f64);
    (
        grid.transform[0],
        grid.transform[3],
        grid.width,
        grid.height,
    ) = (x, y, width, height);
    let cells = (0..height).flat_map(|y| (0..width).map(move |x| (row + y, column + x)));
    Raster {
        values: cells
            .map(|(y, x)| all.values[y * all.grid.width + x])
            .collect(),
        grid,
        height_factor: None,
    }
}

fn save(path: &Path, raster: &Raster) {
    let values: Vec<f32> = raster.values.iter().map(|&value| value as f32).collect();
    let quantity = Quantity { name: "", unit: "" };
    let bytes = write(path, &raster.grid, &values, &[quantity]).expect("a raster");
    fs::write(path, bytes).expect("a file");
}

/// Writes six tiles, one of which is stored from the south and one from the east.
fn tiles(folder: &Path) -> Vec<PathBuf> {
    let all = whole();
    let mut paths = Vec::new();
    for (row, rows) in [(0, 6), (6, 11)] {
        for (column, columns) in [(0, 7), (7, 9), (16, 7)] {
            let mut tile = cut(&all, [column, row], [columns, rows]);
            let t = &mut tile.grid.transform;
            if column == 7 && row == 0 {
                (t[3], t[5]) = (t[3] + t[5] * rows as f64, -t[5]);
                let lines: Vec<&[f64]> = tile.values.chunks(columns).rev().collect();
                tile.values = lines.concat();
            } else if column == 16 {
                (t[0], t[1]) = (t[0] + t[1] * columns as f64, -t[1]);
                tile.values.chunks_mut(columns).for_each(<[f64]>::reverse);
            }
            let path = folder.join(format!("tile_{row}_{column:02}.tif"));
            save(&path, &tile);
            paths.push(path);
        }
    }
    paths
}

fn join(paths: &[PathBuf]) -> Result<Mosaic, Error> {
    read_all(paths, 1 << 30, Purpose::Values)
}

fn same(found: &Raster, wanted: &Raster) {
    assert_eq!(found.grid, wanted.grid);
    let bits =
        |raster: &Raster| -> Vec<u64> { raster.values.iter().map(|x| x.to_bits()).collect() };
    assert_eq!(bits(found), bits(wanted));
}

#[test]
fn tiles_are_the_raster_that_they_were_cut_from() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut paths = tiles(folder.path());
    // Neither a result nor a hidden file is a tile.
    fs::write(folder.path().join("result.npy"), "no tile").expect("a file");
    fs::write(folder.path().join("._tile.tif"), "no tile").expect("a file");
    let found = join(&[folder.path().to_path_buf()]).expect("a mosaic");
    same(&found.raster, &whole());
    let tiles = found.tiles.expect("tiles");
    assert_eq!(tiles.files, 6);
    assert_eq!((tiles.differing, tiles.empty), (0, 3));
    assert_eq!(found.inputs, paths);
    for _ in 0..6 {
        paths.rotate_left(1);
        paths.swap(0, 3);
        same(&join(&paths).expect("a mosaic").raster, &whole());
    }
    same(
        &read(&paths[0], 1 << 30, Purpose::Values).expect("a tile"),
        &join(&paths[..1]).expect("a tile").raster,
    );
    assert!(join(&paths[..1]).expect("a tile").tiles.is_none());
    // As text, whose numbers are decimal, and as an array with a world file.
    let text = tempfile::tempdir().expect("a folder");
    let mut all = whole();
    all.grid.crs = None;
    for (name, column, columns) in [("a.asc", 0, 12), ("b.asc", 12, 6), ("c.npy", 18, 5)] {
        let tile = cut(&all, [column, 0], [columns, 17]);
        save(&text.path().join(name), &tile);
        let [x, y] = tile.grid.centre(0, 0);
        fs::write(
            text.path().join("c.wld"),
            format!("0.5\n0\n0\n-0.5\n{x}\n{y}\n"),
        )
        .expect("a file");
    }
    same(
        &join(&[text.path().to_path_buf()]).expect("a mosaic").raster,
        &all,
    );
}

#[test]
fn the_first_file_with_data_has_a_cell_and_gaps_are_holes() {
    let folder = tempfile::tempdir().expect("a folder");
    let all = whole();
    let [a, b] = ["a.tif", "b.tif"].map(|name| folder.path().join(name));
    // Columns 0 to 9 with a hole, and columns 8 to 19 of fewer rows and with other heights.
    save(&a, &cut(&all, [0, 0], [10, 17]));
    let mut second = cut(&all, [8, 2], [12, 10]);
    second.values.iter_mut().for_each(|height| *height += 1.0);
    save(&b, &second);
    for (paths, is_first) in [([a.clone(), b.clone()], true), ([b, a], false)] {
        let found = join(&paths).expect("a mosaic");
        let tiles = found.tiles.expect("tiles");
        let grid = &found.raster.grid;
        assert_eq!([grid.width, grid.height], [20, 17]);
        let (mut differing, mut empty) = (0, 0);
        for row in 0..17 {
            for column in 0..20 {
                let value = all.values[row * SIZE[0] + column];
                let in_a = column < 10 && !value.is_nan();
                let in_b = column >= 8 && (2..12).contains(&row) && !value.is_nan();
                let wanted = match (in_a, in_b) {
                    (true, true) if is_first => value,
                    (_, true) => value + 1.0,
                    (true, false) => value,
                    (false, false) => f64::NAN,
                };
                differing += u64::from(in_a && in_b);
                empty += u64::from(!in_a && !in_b);
                let cell = found.raster.values[row * 20 + column];
                assert_eq!(cell.to_bits(), wanted.to_bits(), "{column} {row}");
            }
        }
        assert_eq!((tiles.differing, tiles.empty), (differing, empty));
    }
}

#[test]
fn files_that_are_not_one_raster_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let all = whole();
    save(&path("a.tif"), &cut(&all, [0, 0], [10, 10]));
    let beside = cut(&all, [10, 0], [10, 10]);
    let change = |name: &str, change: &dyn Fn(&mut Grid)| {
        let mut other = beside.clone();
        change(&mut other.grid);
        save(&path(name), &other);
        path(name)
    };
    let wide = change("wide.tif", &|grid| grid.transform[1] = 1.0);
    let shifted = change("shifted.tif", &|grid| grid.transform[0] += 0.25);
    let turned = change("turned.tif", &|grid| {
        (grid.transform[2], grid.transform[4]) = (0.1, 0.1)
    });
    let near = change("near.tif", &|grid| grid.transform[3] += 0.5e-6 * 0.5);
    let far = change("far.tif", &|grid| grid.transform[0] += 1e9);
    let zone = change("zone.tif", &|grid| {
        grid.crs = Some(Crs::from_epsg(25_833).expect("a code"))
    });
    let none = change("none.tif", &|grid| grid.crs = None);
    fs::write(path("mosaic.vrt"), "").expect("a file");
    assert!(
        join(&[path("a.tif"), near]).is_ok(),
        "within a millionth of a cell"
    );
    for (other, words) in [
        (
            wide,
            "wide.tif has cells of 1 x 0.5 from 600005.25 5340000.75 on in EPSG:25832, and a.tif has cells of 0.5 x 0.5 from 600000.25 5340000.75 on",
        ),
        (
            shifted,
            "shifted.tif has cells of 0.5 x 0.5 from 600005.5 5340000.75 on",
        ),
        (
            turned,
            "turned.tif has cells of 0.5 x 0.5 turned by 0.1 and 0.1 from",
        ),
        (zone, "on in EPSG:25833, and a.tif has"),
        (none, "on in no coordinate system, and a.tif has"),
        (far, "cells are more than the"),
        (path("mosaic.vrt"), "give any other by itself"),
        (path("missing.tif"), "missing.tif"),
    ] {
        let error = join(&[path("a.tif"), other]).expect_err(words).to_string();
        assert!(error.contains(words), "{error}");
    }
    let empty = tempfile::tempdir().expect("a folder");
    let error = join(&[empty.path().to_path_buf()])
        .expect_err("nothing")
        .to_string();
    assert!(error.contains("without a height raster"), "{error}");
    assert!(join(&[]).is_err());
    // Refused by headers, before any cell is read.
    let error = read_all(
        &[path("a.tif"), path("near.tif")],
        16 * 199,
        Purpose::Values,
    );
    let error = error.expect_err("no room").to_string();
    assert!(
        error.contains("20 x 10 cells are more than the 199"),
        "{error}"
    );
}

#[test]
fn neighbours_continue_a_tile_on_its_lattice() {
    let folder = tempfile::tempdir().expect("a folder");
    let paths = tiles(folder.path());
    let all = whole();
    save(
        &folder.path().join("result.tif"),
        &cut(&all, [0, 0], [7, 6]),
    );
    save(&folder.path().join("away.tif"), &cut(&all, [9, 0], [5, 6]));
    let mut shifted = cut(&all, [7, 0], [9, 6]);
    shifted.grid.transform[0] += 0.2;
    save(&folder.path().join("shifted.tif"), &shifted);
    fs::write(folder.path().join("damaged.tif"), "II").expect("a file");
    let wanted = [1, 3, 4].map(|index| paths[index].clone());
    assert_eq!(neighbours(&paths[0]), wanted);
}

/// A virtual raster as `gdalbuildvrt` writes it, with these sources, of columns 0 to 9 and 8 to 19 of a raster.
fn virtual_raster(sources: &str) -> String {
    format!(
        "<VRTDataset rasterXSize=\"20\" rasterYSize=\"17\">\n  <SRS dataAxisToSRSAxisMapping=\"1,2\">PROJCS[\"ETRS89 / UTM zone 32N\",\
         GEOGCS[\"ETRS89\",DATUM[\"European_Terrestrial_Reference_System_1989\",SPHEROID[\"GRS 1980\",6378137,298.257222101]],\
         PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]],PROJECTION[\"Transverse_Mercator\"],\
         PARAMETER[\"latitude_of_origin\",0],PARAMETER[\"central_meridian\",9],PARAMETER[\"scale_factor\",0.9996],\
         PARAMETER[\"false_easting\",500000],PARAMETER[\"false_northing\",0],UNIT[\"metre\",1],AUTHORITY[\"EPSG\",\"25832\"]]</SRS>\n  \
         <GeoTransform>  6.0000025e+05,  5.0e-01,  0.0e+00,  5.34000075e+06,  0.0e+00, -5.0e-01</GeoTransform>\n  \
         <VRTRasterBand dataType=\"Float32\" band=\"1\">\n    <NoDataValue>-9999</NoDataValue>\n    <ColorInterp>Gray</ColorInterp>\n\
         {sources}  </VRTRasterBand>\n</VRTDataset>\n"
    )
}

const SOURCES: &str = "    <ComplexSource>\n      <SourceFilename relativeToVRT=\"1\">a.tif</SourceFilename>\n      <SourceBand>1</SourceBand>\n      \
    <SourceProperties RasterXSize=\"10\" RasterYSize=\"17\" DataType=\"Float32\" BlockXSize=\"10\" BlockYSize=\"17\" />\n      \
    <SrcRect xOff=\"0\" yOff=\"0\" xSize=\"10\" ySize=\"17\" />\n      <DstRect xOff=\"0\" yOff=\"0\" xSize=\"10\" ySize=\"17\" />\n      \
    <NODATA>nan</NODATA>\n    </ComplexSource>\n    <SimpleSource>\n      <SourceFilename relativeToVRT=\"1\">b.tif</SourceFilename>\n      \
    <SourceBand>1</SourceBand>\n      <SrcRect xOff=\"1\" yOff=\"0\" xSize=\"11\" ySize=\"10\" />\n      \
    <DstRect xOff=\"9\" yOff=\"2\" xSize=\"11\" ySize=\"10\" />\n    </SimpleSource>\n";

#[test]
fn virtual_rasters_are_windows_of_which_the_last_has_a_cell() {
    let folder = tempfile::tempdir().expect("a folder");
    let all = whole();
    save(&folder.path().join("a.tif"), &cut(&all, [0, 0], [10, 17]));
    let mut second = cut(&all, [8, 2], [12, 10]);
    second.values.iter_mut().for_each(|height| *height += 1.0);
    // A mark of the whole, which a simple source copies.
    second.values[12 * 3 + 1] = -9999.0;
    save(&folder.path().join("b.tif"), &second);
    let path = folder.path().join("mosaic.vrt");
    let open = |text: &str| {
        fs::write(&path, text).expect("a file");
        join(std::slice::from_ref(&path))
    };
    let found = open(&virtual_raster(SOURCES)).expect("a mosaic");
    let mut wanted = cut(&all, [0, 0], [20, 17]);
    for row in 0..17 {
        for column in 9..20 {
            let in_b = (2..12).contains(&row);
            let cell = &mut wanted.values[20 * row + column];
            match in_b {
                true => *cell = second.values[12 * (row - 2) + column - 8],
                false if column > 9 => *cell = f64::NAN,
                false => {}
            }
            if *cell == -9999.0 {
                *cell = f64::NAN;
            }
        }
    }
    same(&found.raster, &wanted);
    let tiles = found.tiles.expect("tiles");
    assert_eq!(
        (tiles.files, tiles.differing, tiles.is_last_above),
        (2, 8, true)
    );
    assert_eq!(found.inputs.len(), 3);
    // Scales of the band, and cells that are marked by the source.
    let scaled = virtual_raster(SOURCES).replace(
        "<ColorInterp>",
        "<Offset>5</Offset><Scale>2</Scale><ColorInterp>",
    );
    let scaled = open(&scaled.replace(">nan<", ">100.125<"))
        .expect("a mosaic")
        .raster;
    assert!(scaled.values[1].is_nan() && scaled.values[2] == 5.0 + 2.0 * all.values[2]);
    for (old, new, words) in [
        (
            "xSize=\"11\" ySize=\"10\" />\n    </Simple",
            "xSize=\"22\" ySize=\"10\" />\n    </Simple",
            "resampling of 11 x 10 to 22 x 10 cells",
        ),
        ("xOff=\"9\"", "xOff=\"9.5\"", "xOff 9.5 of <DstRect>"),
        (
            "<VRTDataset ",
            "<VRTDataset subClass=\"VRTWarpedDataset\" ",
            "subClass=\"VRTWarpedDataset\" of <VRTDataset>",
        ),
        (
            "<NODATA>nan</NODATA>",
            "<LUT>0:1</LUT>",
            "<LUT>0:1 is not read in a .vrt",
        ),
        (
            "<SourceBand>1<",
            "<SourceBand>mask,1<",
            "<SourceBand>mask,1",
        ),
        (
            "  </VRTRasterBand>",
            "  </VRTRasterBand><VRTRasterBand/>",
            "found 2 bands",
        ),
        (
            "SimpleSource>",
            "KernelFilteredSource>",
            "<KernelFilteredSource> is not read",
        ),
        (
            "dataType=\"Float32\"",
            "dataType=\"CFloat32\"",
            "a cell of 100 in a band of CFloat32",
        ),
        (
            "dataType=\"Float32\"",
            "dataType=\"Int16\"",
            "a cell of 100.125 in a band of Int16",
        ),
        ("b.tif", "mosaic.vrt", "another .vrt"),
    ] {
        let error = open(&virtual_raster(SOURCES).replace(old, new))
            .expect_err(words)
            .to_string();
        assert!(error.contains(words), "{error}");
        assert!(error.contains("gdal_translate"), "{error}");
    }
    for (old, new, words) in [
        (
            "xOff=\"1\"",
            "xOff=\"2\"",
            "b.tif: the window [2, 0, 11, 10] (SrcRect) is not inside of its [12, 10] cells",
        ),
        (
            "\"EPSG\",\"25832\"",
            "\"EPSG\",\"25833\"",
            "a.tif: it is in EPSG:25832, and the .vrt in EPSG:25833",
        ),
        (
            "rasterXSize=\"20\"",
            "rasterXSize=\"4000000000000\"",
            "cells are more than",
        ),
        ("<GeoTransform>", "<GeoTransform>1,", "six numbers"),
        ("a.tif", "missing.tif", "missing.tif"),
        ("VRTDataset", "Dataset", "<Dataset> is not read"),
    ] {
        let error = open(&virtual_raster(SOURCES).replace(old, new))
            .expect_err(words)
            .to_string();
        assert!(error.contains(words), "{error}");
    }
    for cut in 0..virtual_raster(SOURCES).len() {
        let _ = open(&virtual_raster(SOURCES)[..cut]);
    }
}

/// Runs a program of GDAL; false if it is not installed.
fn gdal(program: &str, args: &[&Path]) -> bool {
    match Command::new(program).arg("-q").args(args).status() {
        Ok(status) => status.success(),
        Err(_) => {
            let _ = std::io::stderr().write_all(b"skipped: no GDAL\n");
            false
        }
    }
}

/// Checks a mosaic of GDAL against the file that GDAL makes of it, and returns it.
fn against_gdal(files: &[PathBuf]) -> Option<Raster> {
    let folder = tempfile::tempdir().expect("a folder");
    let [mosaic, file] = ["mosaic.vrt", "file.tif"].map(|name| folder.path().join(name));
    let mut args = vec![&*mosaic];
    args.extend(files.iter().map(PathBuf::as_path));
    if !gdal("gdalbuildvrt", &args) || !gdal("gdal_translate", &[&mosaic, &file]) {
        return None;
    }
    let [found, wanted] =
        [mosaic, file].map(|path| read(&path, 1 << 32, Purpose::Values).expect("a raster"));
    assert_eq!(found.grid.transform, wanted.grid.transform);
    let bits =
        |raster: &Raster| -> Vec<u64> { raster.values.iter().map(|x| x.to_bits()).collect() };
    assert!(bits(&found) == bits(&wanted), "cells of GDAL");
    Some(found)
}

#[test]
fn virtual_rasters_have_the_cells_of_gdal() {
    let folder = tempfile::tempdir().expect("a folder");
    let all = whole();
    let [a, b, c] = ["a.tif", "b.tif", "c.tif"].map(|name| folder.path().join(name));
    save(&a, &cut(&all, [0, 0], [10, 17]));
    let mut second = cut(&all, [8, 2], [12, 10]);
    second.values.iter_mut().for_each(|height| *height += 1.0);
    save(&b, &second);
    save(&c, &cut(&all, [18, 4], [5, 9]));
    against_gdal(&[a.clone(), b.clone(), c.clone()]);
    against_gdal(&[c, b, a.clone()]);
    // Whole numbers with a mark, a scale and an offset.
    let halves = ["0 0 6 17", "4 3 6 11"].map(|window| {
        let half = folder.path().join(format!("{}.tif", &window[..1]));
        let options = format!("-ot Int16 -a_nodata 110 -a_scale 0.5 -a_offset 3 -srcwin {window}");
        let mut args: Vec<&Path> = options.split(' ').map(Path::new).collect();
        args.extend([&*a, &*half]);
        gdal("gdal_translate", &args).then_some(half)
    });
    if let [Some(west), Some(east)] = halves {
        let found = against_gdal(&[west, east]).expect("a mosaic");
        assert!(found.values.contains(&(3.0 + 0.5 * 100.0)));
        assert!(!found.values.contains(&(3.0 + 0.5 * 110.0)));
    }
}

#[test]
fn a_real_model_in_tiles() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/terrain");
    if !folder.is_dir() {
        let _ = std::io::stderr().write_all(b"skipped: no shared scenes\n");
        return;
    }
    let found = join(std::slice::from_ref(&folder)).expect("a mosaic");
    let tiles = found.tiles.expect("tiles");
    assert_eq!(
        (
            tiles.files,
            found.raster.grid.width,
            found.raster.grid.height,
            tiles.differing
        ),
        (16, 2058, 1489, 0)
    );
    // Each tile is where it was.
    let corner = [
        found.raster.grid.transform[0],
        found.raster.grid.transform[3],
    ];
    for file in found
        .inputs
        .iter()
        .filter(|file| file.extension().is_some_and(|name| name == "tif"))
    {
        let tile = read(file, 1 << 30, Purpose::Values).expect("a tile");
        let t = tile.grid.transform;
        let [column, row] =
            [t[0] - corner[0], corner[1] - t[3]].map(|cells| cells.round() as usize);
        let own = cut(
            &found.raster,
            [column, row],
            [tile.grid.width, tile.grid.height],
        );
        let pairs = own.values.iter().zip(&tile.values);
        let is_same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits();
        assert!(pairs.into_iter().all(is_same), "{}", file.display());
        let beside = neighbours(file);
        assert!(
            (3..=8).contains(&beside.len()),
            "{}: {}",
            file.display(),
            beside.len()
        );
    }
    let files: Vec<PathBuf> = found
        .inputs
        .into_iter()
        .filter(|file| file.extension().is_some_and(|name| name == "tif"))
        .collect();
    if let Some(gdal) = against_gdal(&files) {
        let pairs = gdal
            .grid
            .transform
            .into_iter()
            .zip(found.raster.grid.transform);
        let apart = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-9, "{apart}");
        assert!(
            gdal.values
                .iter()
                .zip(&found.raster.values)
                .all(|(a, b)| a.to_bits() == b.to_bits())
        );
    }
}
