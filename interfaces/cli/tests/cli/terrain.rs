//! Height rasters: read as meshes, results with the same georeference, viewsheds over a round earth.

use std::fs;

use antumbra_raster::{Crs, Grid, Purpose, Quantity, Raster, read, write};

use crate::support::Place;

/// A plain of 40 x 30 cells of 10 m in map coordinates, with a wall along column 20 and a hole in a corner.
fn plain() -> (Grid, Vec<f32>) {
    let mut grid = Grid::north_up([40, 30], [600_000.0, 5_340_000.0], 10.0);
    grid.crs = Some(Crs::from_epsg(25_832).expect("a code"));
    let height = |cell: usize| match (cell % 40, cell / 40) {
        (0, 0) => f32::NAN,
        (20, _) => 30.0,
        _ => 5.0,
    };
    let heights = (0..40 * 30).map(height).collect();
    (grid, heights)
}

fn place() -> Place {
    let place = Place::empty();
    let (grid, heights) = plain();
    let quantity = Quantity {
        name: "height",
        unit: "m",
    };
    let bytes = write("dem.tif".as_ref(), &grid, &heights, &[quantity]).expect("a raster");
    place.write("dem.tif", bytes);
    let bytes = write("dem.asc".as_ref(), &grid, &heights, &[quantity]).expect("a raster");
    place.write("dem.asc", bytes);
    place
}

impl Place {
    pub fn raster(&self, name: &str) -> Raster {
        read(&self.path(name), u64::MAX, Purpose::Values).expect("a raster")
    }
}

const SUN: [&str; 8] = [
    "--lat",
    "48.2",
    "--lon",
    "10.3",
    "--from",
    "2025-06-21",
    "--to",
    "2025-06-21",
];

#[test]
fn results_are_where_the_heights_were() {
    let place = place();
    let args = [
        "sun", "dem.tif", "--cells", "-o", "sun.tif", "-o", "sun.asc", "-o", "sun.csv",
    ];
    place.run(&[&args[..], &SUN].concat()).expect(0);
    let found = place.raster("sun.tif");
    assert_eq!(found.grid, plain().0);
    assert!(found.values[0].is_nan());
    let at = |column: usize, row: usize| found.values[40 * row + column];
    assert!(
        at(19, 15) < at(10, 15) && at(21, 15) < at(35, 15),
        "the wall takes sun"
    );
    assert!((at(2, 15) - at(37, 15)).abs() <= 4.0);
    assert_eq!(place.raster("sun.asc").values.len(), found.values.len());
    // The same places in a table.
    let table = fs::read_to_string(place.path("sun.csv")).expect("a table");
    let first: Vec<f64> = (table.lines().nth(1).expect("a line").split(','))
        .map(|x| x.parse().expect("a number"))
        .collect();
    assert_eq!(first[..3], [600_015.0, 5_339_995.0, 5.0]);
    assert!((first[6] - found.values[1]).abs() < 1e-6);
    place
        .run(&["ao", "dem.asc", "-o", "ao.tif", "--samples", "16"])
        .expect(0);
    let open = place.raster("ao.tif");
    assert!(open.grid.crs.is_none() && open.grid.transform == found.grid.transform);
    assert!(open.values[40 * 15 + 20] > open.values[40 * 15 + 19]);
}

/// Angles of cells in 32 azimuths, plane by plane.
fn angles(place: &Place, scene: &str) -> (Vec<f32>, String) {
    let args = ["horizon", scene, "--cells", "--azimuths", "32", "-o"];
    let said = place.run(&[&args[..], &["angles.npy"]].concat()).expect(0);
    let bytes = fs::read(place.path("angles.npy")).expect("a file");
    let head = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let number = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().expect("4 bytes"));
    let angles = bytes[head..].chunks_exact(4).map(number);
    (angles.collect(), said.stderr)
}

#[test]
fn a_tile_alone_knows_how_many_of_its_cells_see_more() {
    let place = place();
    let [a, b, ..] = tiles(&place);
    let (whole, said) = angles(&place, "tiles");
    assert!(!said.contains("beside it"), "{said}");
    // Of the north-western tile, 25 x 11 cells.
    let (own, said) = angles(&place, a);
    let is_higher = |cell: &usize| {
        let (column, row) = (cell % 25, cell / 25);
        (0..32).any(|azimuth| {
            let [all, own] = [
                whole[(30 * azimuth + row) * 40 + column],
                own[(11 * azimuth + row) * 25 + column],
            ];
            all.max(0.0) >= own.max(0.0) + 0.1
        })
    };
    let higher = (1..25 * 11).filter(is_higher).count() as f64 / 274.0;
    let (_, part) = said.split_once("of its 274 cells (").expect(&said);
    let part: f64 = part
        .split_once(" %")
        .and_then(|(part, _)| part.parse().ok())
        .expect(&said);
    assert!(
        (1.0..99.0).contains(&part) && (part - 100.0 * higher).abs() < 8.0,
        "{part} % of {higher}"
    );
    // All cells east of the wall see it, and no line between two cells leaves a raster.
    let (_, said) = angles(&place, b);
    assert!(
        said.contains("About 165 of its 165 cells (100 %)"),
        "{said}"
    );
    place.write("eyes.csv", "x,y\n600055,5339955\n");
    let args = ["visible", a, "eyes.csv", "--viewshed", "-o", "seen.tif"];
    let said = place.run(&args).expect(0).stderr;
    assert!(!said.contains("beside it"), "{said}");
}

/// Cuts the plain into four tiles, and names them from the north west to the south east.
fn tiles(place: &Place) -> [&'static str; 4] {
    let (all, heights) = plain();
    fs::create_dir(place.path("tiles")).expect("a folder");
    let names = ["tiles/a.tif", "tiles/b.tif", "tiles/c.tif", "tiles/d.tif"];
    let corners = [[0, 0], [25, 0], [0, 11], [25, 11]];
    for (name, [column, row]) in names.into_iter().zip(corners) {
        let width = if column == 0 { 25 } else { 15 };
        let height = if row == 0 { 11 } else { 19 };
        let [x, y] = all.corner(column as f64, row as f64);
        let mut grid = Grid::north_up([width, height], [x, y], 10.0);
        grid.crs = all.crs.clone();
        let lines = (row..row + height).map(|y| &heights[40 * y + column..40 * y + column + width]);
        let values: Vec<f32> = lines.flatten().copied().collect();
        let quantity = Quantity { name: "", unit: "" };
        let bytes = write(name.as_ref(), &grid, &values, &[quantity]).expect("a raster");
        place.write(name, bytes);
    }
    names
}

#[test]
fn tiles_are_one_raster() {
    let place = place();
    let [a, b, c, d] = tiles(&place);
    place.write("eyes.csv", "x,y\n600055,5339855\n");
    let same = |scene: &[&str], command: &[&str], output: &str| {
        let [whole, parts] = ["whole", "parts"].map(|name| format!("{name}.{output}"));
        let run = |scene: &[&str], output: &str| {
            let args = [&command[..1], scene, &command[1..], &["-o", output]];
            place.run(&args.concat()).expect(0).stderr
        };
        run(&["dem.tif"], &whole);
        let said = run(scene, &parts);
        let line = "4 files are one raster of 40 x 30 cells; in 1 of them no file has data";
        assert!(said.contains(line) && !said.contains("beside it"), "{said}");
        let read = |name: &str| fs::read(place.path(name)).expect("a file");
        assert!(read(&whole) == read(&parts), "{scene:?} {command:?}");
    };
    let day = [&["sun"][..], &["--cells"], &SUN].concat();
    same(&["tiles"], &["horizon", "--cells"], "npy");
    same(&[c, a, d, b], &["horizon", "--cells"], "npz");
    same(&["tiles"], &day, "tif");
    same(&[a, b, c, d], &day, "asc");
    same(&["tiles"], &["ao", "--samples", "16"], "tif");
    same(
        &["tiles"],
        &["visible", "eyes.csv", "--viewshed", "--eye", "1.7"],
        "tif",
    );
    // Shares know all files again.
    for share in ["0/2", "1/2"] {
        let part = format!("{}.part", &share[..1]);
        place
            .run(&[
                "horizon", b, a, d, c, "--cells", "--shard", share, "-o", &part,
            ])
            .expect(0);
    }
    place
        .run(&["merge", "0.part", "1.part", "-o", "merged.npz"])
        .expect(0);
    let read = |name: &str| fs::read(place.path(name)).expect("a file");
    assert!(read("merged.npz") == read("parts.npz"));
    // A tile alone, an output in place of a tile, a file that is no raster, and a folder without any.
    let alone = place
        .run(&["horizon", a, "--cells", "-o", "a.npy"])
        .expect(0);
    let line = "tiles/a.tif: cells go on in 3 files beside it, such as b.tif. About ";
    assert!(alone.stderr.contains(line), "{}", alone.stderr);
    fs::create_dir(place.path("empty")).expect("a folder");
    for (args, code, words) in [
        (
            &[
                "horizon",
                "tiles",
                "--cells",
                "--azimuths",
                "1",
                "-o",
                "tiles/c.tif",
            ][..],
            2,
            "would destroy",
        ),
        (
            &["horizon", a, "eyes.csv", "--cells", "-o", "h.npy"],
            2,
            "eyes.csv: it is no height raster",
        ),
        (
            &["horizon", "empty", "--cells", "-o", "h.npy"],
            65,
            "without a height raster",
        ),
        (
            &["horizon", a, a, "missing.tif", "--cells", "-o", "h.npy"],
            65,
            "missing.tif",
        ),
    ] {
        let run = place.run(args).expect(code);
        assert!(run.stderr.contains(words), "{}", run.stderr);
    }
}

#[test]
fn cells_have_the_same_sun_in_all_files_and_from_shards() {
    let place = place();
    let sun = |args: &[&str]| {
        let all = [
            &["sun", "dem.tif", "--cells", "--step", "20"],
            args,
            &SUN[..],
        ]
        .concat();
        place.run(&all).expect(0);
    };
    sun(&[
        "-o",
        "a.npy",
        "-o",
        "a.csv",
        "-o",
        "a.npz",
        "-o",
        "a.ply",
        "--hourly",
        "steps.csv",
        "--groups",
        "groups.csv",
    ]);
    sun(&["-o", "0.part", "--shard", "0/2"]);
    sun(&["-o", "1.part", "--shard", "1/2"]);
    place
        .run(&["merge", "0.part", "1.part", "-o", "b.npy"])
        .expect(0);
    let bytes = |name: &str| fs::read(place.path(name)).expect("a file");
    assert_eq!(bytes("a.npy"), bytes("b.npy"));
    let text = |name: &str| fs::read_to_string(place.path(name)).expect("a file");
    let table = text("a.csv");
    let column = |text: &str, name: &str| -> Vec<f64> {
        let mut lines = text.lines();
        let head = lines.next().expect("a head");
        let at = head
            .split(',')
            .position(|own| own == name)
            .expect("a column");
        let number = |line: &str| line.split(',').nth(at).and_then(|x| x.parse().ok());
        lines.map(|line| number(line).expect("a number")).collect()
    };
    let hours = column(&table, "hours");
    assert_eq!(hours.len(), 40 * 30 - 1);
    assert_eq!(hours, column(&table, "hours_06"));
    // Steps of time add up to the hours of each sensor.
    let steps = text("steps.csv");
    for sensor in [1, 500, 1199] {
        let sum: f64 = column(&steps, &sensor.to_string()).iter().sum();
        assert!((sum - hours[sensor - 1]).abs() < 1e-4, "{sensor}: {sum}");
    }
    let means = column(&text("groups.csv"), "hours_mean");
    let mean = hours.iter().sum::<f64>() / hours.len() as f64;
    assert!((means[0] - mean).abs() < 1e-3, "{means:?} {mean}");
}

#[test]
fn a_grid_on_a_mesh_is_a_raster() {
    let place = place();
    place.write(
        "square.obj",
        "v 600000 5340000 0\nv 600040 5340000 0\nv 600040 5340030 0\nv 600000 5340030 0\nf 1 2 3 4\n",
    );
    let args = [
        "sun",
        "square.obj",
        "--grid",
        "10",
        "-o",
        "sun.tif",
        "--crs",
        "EPSG:25832",
    ];
    place.run(&[&args[..], &SUN].concat()).expect(0);
    let found = place.raster("sun.tif");
    let mut wanted = Grid::north_up([4, 3], [600_000.0, 5_340_030.0], 10.0);
    wanted.crs = Some(Crs::from_epsg(25_832).expect("a code"));
    assert_eq!(found.grid, wanted);
    assert!(found.values.iter().all(|x| *x > 10.0));
}

#[test]
fn a_viewshed_ends_at_the_wall_and_at_the_radius() {
    let place = place();
    // Without heights: on the surface. Two observers west of the wall, one east of it.
    place.write(
        "eyes.csv",
        "name,x,y\na,600055,5339855\nb,600105,5339855\nc,600305,5339855\n",
    );
    let args = [
        "visible",
        "dem.tif",
        "eyes.csv",
        "--viewshed",
        "--eye",
        "2",
        "-o",
        "seen.tif",
    ];
    place.run(&args).expect(0);
    let seen = place.raster("seen.tif");
    let at = |column: usize| seen.values[40 * 14 + column];
    assert_eq!(
        [at(2), at(12), at(20), at(21), at(38)],
        [2.0, 2.0, 3.0, 1.0, 1.0]
    );
    place
        .run(&[&args[..], &["--radius", "60", "--curvature"]].concat())
        .expect(0);
    let near = place.raster("seen.tif");
    let at = |column: usize| near.values[40 * 14 + column];
    assert_eq!(
        [at(0), at(8), at(15), at(17), at(25), at(37)],
        [1.0, 2.0, 1.0, 0.0, 1.0, 0.0]
    );
}

#[test]
fn heights_and_angles_of_a_wall_are_those_of_its_shadow() {
    let place = place();
    place.write("eyes.csv", "x,y\n600055,5339855\n600105,5339855\n");
    let args = ["visible", "dem.tif", "eyes.csv", "--viewshed", "--eye", "2"];
    let show = |more: &[&str]| place.run(&[&args[..], more].concat());
    let run = show(&[
        "--show", "height", "-o", "high.tif", "-o", "high.csv", "--json", "-",
    ])
    .expect(0);
    let high = place.raster("high.tif");
    let at = |values: &[f64], column: usize| values[40 * 14 + column];
    let levels = place.raster("dem.tif").values;
    let wall = (0..40)
        .find(|&column| at(&levels, column) > at(&levels, 0))
        .expect("a wall");
    for column in 0..40 {
        // The least of both lines over the eastern edge of the wall, or 0.
        let least = [5, 10].map(|eye: usize| {
            let edges = (wall..column).filter(|&edge| edge > eye);
            let line = |edge: usize| {
                let rise = at(&levels, edge) - (at(&levels, eye) + 2.0);
                let share = (column - eye) as f64 / (edge - eye) as f64;
                at(&levels, eye) + 2.0 + rise * share - at(&levels, column)
            };
            edges.map(line).fold(0.0, f64::max)
        });
        let [wanted, found] = [least[0].min(least[1]), at(&high.values, column)];
        assert!(
            (found - wanted).abs() < 1e-4,
            "{column}: {found}, not {wanted}"
        );
    }
    let about = run.json();
    assert_eq!(about["show"], "height");
    assert!(about["visible_pairs"].is_null());
    assert!(!run.stderr.contains("see each other"), "{}", run.stderr);
    let table = fs::read_to_string(place.path("high.csv")).expect("a table");
    assert!(
        table.starts_with("x,y,z,height\n600015,5339995,5,"),
        "{table}"
    );
    // Cells of height 0 are those that somebody sees, and have an angle.
    show(&["-o", "seen.tif"]).expect(0);
    show(&["--show", "angle", "-o", "angle.tif"]).expect(0);
    let (seen, angle) = (place.raster("seen.tif"), place.raster("angle.tif"));
    for (cell, &height) in high.values.iter().enumerate() {
        assert_eq!(height == 0.0, seen.values[cell] > 0.0, "{cell}");
        assert_eq!(height == 0.0, !angle.values[cell].is_nan(), "{cell}");
    }
    // Five columns of 10 m to the east of the nearer eye, and the other one looks flatter.
    let wanted = (-2.0_f64 / 50.0).atan().to_degrees();
    assert!((at(&angle.values, 15) - wanted).abs() < 1e-5);
    for index in ["0/2", "1/2"] {
        let name = format!("{}.part", &index[..1]);
        show(&["--show", "height", "--shard", index, "-o", &name]).expect(0);
    }
    place
        .run(&["merge", "0.part", "1.part", "-o", "merged.tif"])
        .expect(0);
    let read = |name: &str| fs::read(place.path(name)).expect("a file");
    assert_eq!(read("merged.tif"), read("high.tif"));
    for (more, word) in [
        (
            &["--show", "height", "-o", "a.npz"][..],
            "a.npz: --show height is written as tif, asc, npy, csv, png, svg or pdf",
        ),
        (
            &["--show", "angle", "-o", "a.tif", "--grid", "20"],
            "--show angle is for the cells of a height raster",
        ),
        (
            &["--show", "height", "-o", "a.tif", "--target", "2"],
            "leave out --target",
        ),
        (
            &["--show", "angle", "-o", "a.tif", "--lines", "l.csv"],
            "--lines are of pairs",
        ),
    ] {
        let run = show(more);
        assert!(
            run.code == 2 && run.stderr.contains(word),
            "{more:?}: {}",
            run.stderr
        );
    }
}

#[test]
fn cells_that_are_seen_are_the_same_in_all_files() {
    let place = place();
    // The last eye is below the surface.
    place.write(
        "eyes.csv",
        "x,y,z\n600055,5339855,7\n600305,5339855,7\n600105,5339855,1\n",
    );
    let args = [
        "visible",
        "dem.tif",
        "eyes.csv",
        "--viewshed",
        "--json",
        "-",
    ];
    let files = [
        "-o",
        "seen.asc",
        "-o",
        "seen.csv",
        "-o",
        "seen.npz",
        "-o",
        "seen.ply",
        "--lines",
        "seen_lines.csv",
    ];
    let run = place.run(&[&args[..], &files].concat()).expect(0);
    assert!(
        run.stderr.contains("1 of 3 eyes are below the surface"),
        "{}",
        run.stderr
    );
    let raster = place.raster("seen.asc");
    let cells: Vec<f64> = raster.values.into_iter().filter(|x| !x.is_nan()).collect();
    assert_eq!(cells.len(), 1199, "one cell has no data");
    let table = fs::read_to_string(place.path("seen.csv")).expect("a table");
    assert!(
        table.starts_with("x,y,z,seen_by\n600015,5339995,5,"),
        "{table}"
    );
    let counts = table.lines().skip(1).map(|line| line.rsplit(',').next());
    let counts: Vec<f64> = counts
        .map(|count| count.expect("a count").parse().expect("a number"))
        .collect();
    assert_eq!(counts, cells);
    let lines = fs::read_to_string(place.path("seen_lines.csv")).expect("a table");
    assert_eq!(
        (lines.lines().count() - 1) as f64,
        cells.iter().sum::<f64>()
    );
    assert!(lines.lines().skip(1).all(|line| !line.starts_with('2')));
    // Rays, which --margin takes, see the same from above the surface.
    place.write("above.csv", "x,y,z\n600055,5339855,7\n600305,5339855,7\n");
    let rays = [
        "visible",
        "dem.tif",
        "above.csv",
        "--viewshed",
        "--margin",
        "0.01",
        "-o",
        "rays.asc",
    ];
    place.run(&rays).expect(0);
    let rays = place
        .raster("rays.asc")
        .values
        .into_iter()
        .filter(|x| !x.is_nan());
    let differ = rays.zip(&cells).filter(|(a, b)| a != *b).count();
    assert!(differ < 20, "{differ} cells differ");
    for name in ["eyes.csv", "dem.asc"] {
        let bad = ["visible", "dem.asc", "eyes.csv", "--viewshed", "-o", name];
        assert_eq!(place.run(&bad).code, 2, "{name} would be lost");
    }
}

#[test]
fn what_cannot_be_placed_is_refused() {
    let place = place();
    place.write("off.csv", "x,y\n0,0\n");
    place.write("plain.npy", b"\x93NUMPY\x01\x00");
    for (args, word) in [
        (
            &["visible", "dem.tif", "off.csv", "--viewshed", "-o", "a.csv"][..],
            "point 1",
        ),
        (&["ao", "plain.npy", "-o", "a.ply"], "no .npy"),
        // Before a scene is read, or found.
        (
            &["sun", "none.obj", "--grid", "9", "-o", "a.csv"],
            "the sun needs a place: give --lat",
        ),
        (
            &["ao", "builtin:city", "-o", "a.tif"],
            "needs a scene that is one",
        ),
        (
            &[
                "sun",
                "dem.tif",
                "--cells",
                "-o",
                "a.tif",
                "--crs",
                "EPSG:4326",
                "--lat",
                "1",
                "--lon",
                "1",
            ],
            "degrees",
        ),
    ] {
        let run = place.run(args);
        assert!(
            run.code != 0 && run.stderr.contains(word),
            "{args:?}: {}",
            run.stderr
        );
    }
}

impl Place {
    pub fn write_raster(&self, name: &str, grid: &Grid, heights: &[f32], unit: &str) {
        let quantity = Quantity {
            name: "height",
            unit,
        };
        let bytes = write(name.as_ref(), grid, heights, &[quantity]);
        self.write(name, bytes.expect("a raster"));
    }
}

const DAY: [&str; 4] = ["--from", "2025-03-21", "--to", "2025-03-21"];

#[test]
fn the_place_on_the_earth_comes_from_the_coordinate_system() {
    let place = place();
    let sun = |more: &[&str], name: &str| {
        let args = [
            "sun", "dem.tif", "--cells", "--step", "10", "--json", "-", "-o", name,
        ];
        place.run(&[&args[..], &DAY, more].concat()).expect(0)
    };
    let derived = sun(&[], "derived.csv");
    let about = derived.json();
    // By pyproj: the middle is at 600 200, 5 339 850 in EPSG:25832.
    for (key, wanted) in [("latitude", 48.203_97), ("longitude", 10.348_59)] {
        let found = about[key].as_f64().expect("a number");
        assert!((found - wanted).abs() < 1e-4, "{key} {found}");
    }
    let line = "by EPSG:25832; true north is 1.01 degrees west of grid north";
    assert!(derived.stderr.contains(line), "{}", derived.stderr);
    assert!(!derived.stderr.contains("warning"), "{}", derived.stderr);
    let given = ["--lat", "48.204", "--lon", "10.3486", "--north", "-1.0055"];
    let given = sun(&given, "given.csv");
    assert!(!given.stderr.contains("warning"), "{}", given.stderr);
    // As another computation has it to a few units of the last digit; grid north makes other hours.
    let table = |name: &str| {
        let text = fs::read_to_string(place.path(name)).expect("a table");
        let last = |line: &str| {
            line.split(',')
                .nth(6)
                .map(|x| x.parse::<f64>().expect("hours"))
        };
        text.lines().skip(1).filter_map(last).collect::<Vec<f64>>()
    };
    let differ = |a: &str, b: &str| {
        let pairs = table(a).into_iter().zip(table(b));
        pairs.filter(|(a, b)| a != b).count()
    };
    assert!(differ("derived.csv", "given.csv") <= 12);
    let grid_north = sun(
        &["--north", "0", "--lat", "10", "--lon", "10.3"],
        "grid.csv",
    );
    for words in [
        "true north is -1.01 degrees from grid north in EPSG:25832, and --north says 0, which is taken",
        "warning: --lat and --lon are 10.0000° N, 10.3000° E, 4248 km from the scene",
    ] {
        assert!(grid_north.stderr.contains(words), "{}", grid_north.stderr);
    }
    sun(&["--north", "0"], "north.csv");
    assert!(differ("derived.csv", "north.csv") > 30);
    // Horizons turn with it, too.
    let horizon = |more: &[&str], name: &str| {
        let args = [
            "horizon",
            "dem.tif",
            "--cells",
            "--azimuths",
            "8",
            "-o",
            name,
        ];
        place.run(&[&args[..], more].concat()).expect(0);
        fs::read_to_string(place.path(name)).expect("a table")
    };
    let turned = horizon(&[], "a.csv");
    assert_ne!(turned, horizon(&["--north", "0"], "b.csv"));
    assert_eq!(turned, horizon(&["--crs", "EPSG:25832"], "c.csv"));
}

#[test]
fn models_have_a_place_only_in_map_coordinates() {
    let place = place();
    let square = |x: u32, y: u32| {
        let corners = [[x, y], [x + 40, y], [x + 40, y + 30], [x, y + 30]];
        let lines = corners.map(|[x, y]| format!("v {x} {y} 0\n"));
        format!("{}f 1 2 3 4\n", lines.concat())
    };
    place.write("map.obj", square(600_000, 5_340_000));
    place.write("drawing.obj", square(0, 0));
    place.write("web.obj", square(1_288_000, 6_130_000));
    let run = |scene: &str, crs: &str| {
        let args = [
            "sun", scene, "--grid", "10", "--up", "z", "-o", "a.csv", "--crs", crs,
        ];
        place.run(&[&args[..], &DAY].concat())
    };
    let found = run("map.obj", "EPSG:25832").expect(0);
    assert!(
        found
            .stderr
            .contains("at 48.2055° N, 10.3462° E by EPSG:25832"),
        "{}",
        found.stderr
    );
    for (scene, crs, words) in [
        (
            "drawing.obj",
            "EPSG:25832",
            "its coordinates are near 0 0, which is no place in EPSG:25832",
        ),
        ("drawing.obj", "EPSG:25832", "give --lat and --lon"),
        (
            "map.obj",
            "EPSG:30000",
            "the place on the earth is not known in EPSG:30000",
        ),
        (
            "web.obj",
            "EPSG:3857",
            "lengths in EPSG:3857 are 1.500 times as long as on the ground",
        ),
    ] {
        let refused = run(scene, crs).expect(2);
        assert!(
            refused.stderr.contains(words),
            "{words}: {}",
            refused.stderr
        );
    }
}

#[test]
fn a_round_earth_is_as_round_in_feet() {
    let place = Place::empty();
    let foot = 1200.0 / 3937.0;
    for (name, code, metres, unit) in [
        ("metres.tif", 32_611, 1.0, "m"),
        ("feet.tif", 2263, foot, "US survey foot"),
    ] {
        let cell = 1000.0 / metres;
        let mut grid = Grid::north_up([200, 200], [300_000.0, 380_000.0], cell);
        grid.crs = Some(Crs::from_epsg(code).expect("a code"));
        place.write_raster(name, &grid, &[0.0; 200 * 200], unit);
        let eye = format!(
            "x,y\n{},{}\n",
            300_000.0 + 0.5 * cell,
            380_000.0 - 0.5 * cell
        );
        place.write("eye.csv", eye);
        let height = (10.0 / metres).to_string();
        let args = [
            "visible",
            name,
            "eye.csv",
            "--viewshed",
            "--curvature",
            "--eye",
            &height,
        ];
        for (more, out) in [(&[][..], "seen.tif"), (&["--margin", "0.01"], "rays.tif")] {
            let run = place
                .run(&[&args[..], more, &["-o", out]].concat())
                .expect(0);
            let unit = if metres == 1.0 { "m" } else { "US survey ft" };
            assert!(
                run.stderr.contains(&format!(" {unit} (x, y, z)")),
                "{}",
                run.stderr
            );
            let seen = place.raster(out);
            let seen = seen.values.iter().filter(|&&count| count == 1.0).count();
            assert!(
                seen.abs_diff(142) <= if more.is_empty() { 0 } else { 6 },
                "{name}: {seen}"
            );
        }
    }
    let args = [
        "visible",
        "feet.tif",
        "eye.csv",
        "--viewshed",
        "--units",
        "m",
    ];
    let doubted = place.run(&[&args[..], &["-o", "a.tif"]].concat()).expect(0);
    let words = "coordinates in EPSG:2263 are in US survey ft, and --units says m, which is taken";
    assert!(doubted.stderr.contains(words), "{}", doubted.stderr);
}

#[test]
fn rasters_from_the_south_give_the_same_answers() {
    let place = Place::empty();
    let height = |cell: usize| (cell * 7919 % 101) as f32 / 10.0;
    let mut grid = Grid::north_up([20, 15], [600_000.0, 5_340_000.0], 10.0);
    grid.crs = Some(Crs::from_epsg(25_832).expect("a code"));
    let heights: Vec<f32> = (0..300).map(height).collect();
    place.write_raster("north.tif", &grid, &heights, "m");
    let rows = heights.chunks(20).rev().flatten().copied();
    grid.transform[3] -= 150.0;
    grid.transform[5] = 10.0;
    place.write_raster("south.tif", &grid, &rows.collect::<Vec<f32>>(), "m");
    place.write("eye.csv", "x,y\n600052,5339941\n600111,5339877\n");
    let all = |name: &str| {
        let files = ["seen", "horizon", "sun"].map(|job| format!("{name}-{job}.csv"));
        for (job, file) in [
            (
                &["visible", name, "eye.csv", "--viewshed", "--eye", "2"][..],
                &files[0],
            ),
            (&["horizon", name, "--cells", "--azimuths", "12"], &files[1]),
            (&[&["sun", name, "--cells"][..], &DAY].concat(), &files[2]),
        ] {
            place.run(&[job, &["-o", file]].concat()).expect(0);
        }
        files.map(|file| fs::read_to_string(place.path(&file)).expect("a table"))
    };
    assert_eq!(all("north.tif"), all("south.tif"));
}
