//! `sun --terrain`: a house in front of a ridge, with hours by hand.

use antumbra_raster::{Crs, Grid};

use crate::sunlight::{VIENNA, hours};
use crate::support::{Place, Run};

/// Two months of low suns.
const WINTER: [&str; 4] = ["--from", "2025-01-01", "--to", "2025-02-28"];

/// A plain of 610 m with a ridge of 80 m, 200 m south of the middle, which is at this place.
fn ridge([x, y]: [f64; 2]) -> (Grid, Vec<f32>) {
    let grid = Grid::north_up([61, 61], [x - 305.0, y + 305.0], 10.0);
    let heights = (0..61 * 61).map(|cell| if cell / 61 == 50 { 80.0 } else { 0.0 });
    (grid, heights.collect())
}

/// A box of 10 m on the ground around a place.
fn house([x, y]: [f64; 2], up: char) -> String {
    let mut text = String::new();
    for corner in 0..8 {
        let at = |bit: u32| if corner >> bit & 1 == 1 { 5.0 } else { -5.0 };
        let [x, y, z] = [x + at(0), y + at(1), 5.0 + at(2)];
        text += &match up {
            'z' => format!("v {x} {y} {z}\n"),
            _ => format!("v {x} {z} {}\n", -y),
        };
    }
    text + "f 1 2 6 5\nf 2 4 8 6\nf 4 3 7 8\nf 3 1 5 7\nf 5 6 8 7\n"
}

/// Both around the origin, as dem.asc and house.obj, and sensors on the south, the north, the roof, and below ground.
fn place() -> Place {
    let place = Place::empty();
    let (grid, heights) = ridge([0.0; 2]);
    place.write_raster("dem.asc", &grid, &heights, "m");
    place.write("house.obj", house([0.0; 2], 'z'));
    let points = [
        "0,-5,5,0,-1,0",
        "0,5,5,0,1,0",
        "0,0,10,0,0,1",
        "0,-40,-1,0,0,1",
    ];
    place.write(
        "points.csv",
        format!("x,y,z,nx,ny,nz\n{}\n", points.join("\n")),
    );
    place
}

impl Place {
    fn around(&self, scene: &str, more: &[&str]) -> Run {
        let args = ["sun", scene, "--json", "about.json", "-o", "sun.csv"];
        self.run(&[&args[..], &WINTER, more].concat())
    }

    fn hours(&self) -> Vec<f64> {
        self.table("sun.csv").column("hours")
    }
}

/// Whether the ridge hides a sun at a place in its north.
fn is_behind([x, y, z]: [f64; 3], azimuth: f64, elevation: f64) -> bool {
    let (sin, cos) = azimuth.to_radians().sin_cos();
    let reach = (y + 200.0) / -cos;
    let is_wide = (x + reach * sin).abs() < 300.0;
    cos < 0.0 && is_wide && z + reach * elevation.to_radians().tan() < 80.0
}

fn winter(counts: impl Fn(f64, f64) -> bool) -> f64 {
    hours(("2025-01-01", 59), counts)
}

#[test]
fn a_ridge_takes_the_suns_behind_it() {
    let place = place();
    let sensors = [&VIENNA[..], &["--sensors", "points.csv"]].concat();
    place
        .around("house.obj", &[&sensors[..], &["--up", "z"]].concat())
        .expect(0);
    let alone = place.hours();
    let run = [&sensors[..], &["--up", "z", "--terrain", "dem.asc"]].concat();
    let run = place.around("house.obj", &run).expect(0);
    let south = |azimuth: f64| azimuth.to_radians().cos() < 0.0;
    let sees = |place: [f64; 3]| move |a: f64, e: f64| !is_behind(place, a, e);
    let expected = [
        winter(|a, e| south(a) && sees([0.0, -5.0, 5.0])(a, e)),
        winter(|a, _| !south(a)),
        winter(sees([0.0, 0.0, 10.0])),
        0.0,
    ];
    assert_eq!(place.hours(), expected);
    assert!(expected[0] + 100.0 < alone[0], "{alone:?}");
    for words in [
        "note: 1 of 4 sensors are below the surface of dem and see nothing",
        "for the tree of 10 triangles, 29.6 KiB for 3 721 cells of terrain",
    ] {
        assert!(run.stderr.contains(words), "{}", run.stderr);
    }
    assert!(!run.stderr.contains("warning"), "{}", run.stderr);
    let about = place.json("about.json");
    let terrain = &about["terrain"];
    assert!(about["triangles"] == 10 && terrain["cells"] == 3721 && terrain["sensors_below"] == 1);
    assert!(
        terrain["bytes"].as_u64() >= Some(8 * 3721) && terrain["tree_bytes"].as_u64() > Some(0)
    );
    // With y up, and from shards.
    place.write("y.obj", house([0.0; 2], 'y'));
    place.write(
        "y.csv",
        "x,y,z,nx,ny,nz\n0,5,5,0,0,1\n0,5,-5,0,0,-1\n0,10,0,0,1,0\n0,-1,40,0,1,0\n",
    );
    let flags = ["--sensors", "y.csv", "--up", "y", "--terrain", "dem.asc"];
    place
        .around("y.obj", &[&VIENNA[..], &flags].concat())
        .expect(0);
    assert_eq!(place.hours(), expected);
    shards(
        &place,
        "house.obj",
        &[&sensors[..], &["--up", "z"]].concat(),
        "npz",
    );
}

/// Checks that two shares with terrain are the whole.
fn shards(place: &Place, scene: &str, flags: &[&str], kind: &str) {
    let [whole, merged] = ["whole", "merged"].map(|name| format!("{name}.{kind}"));
    let flags = [flags, &WINTER, &["--terrain", "dem.asc"]].concat();
    let run = |more: &[&str]| place.run(&[&["sun", scene], &flags[..], more].concat());
    run(&["-o", &whole]).expect(0);
    run(&["-o", "0.part", "--shard", "0/2"]).expect(0);
    run(&["-o", "1.part", "--shard", "1/2"]).expect(0);
    let parts = ["merge", "0.part", "1.part", "-o", &merged];
    place.run(&parts).expect(0);
    assert!(
        place.read(&whole) == place.read(&merged),
        "{scene} {flags:?}"
    );
    // Not of another terrain.
    let heights = place.read("dem.asc");
    place.write(
        "dem.asc",
        String::from_utf8_lossy(&heights).replacen("80", "81", 1),
    );
    let refused = place.run(&parts);
    assert!(
        refused.code != 0 && refused.stderr.contains("part"),
        "{}",
        refused.stderr
    );
    place.write("dem.asc", heights);
}

#[test]
fn a_house_takes_the_suns_of_cells_behind_it() {
    let place = place();
    let flags = [&VIENNA[..], &["--up", "z", "--cells"]].concat();
    let args = [&flags[..], &["-o", "sun.npy", "--terrain", "dem.asc"]].concat();
    let run = place.around("house.obj", &args).expect(0);
    assert!(run.stderr.contains("3 721 sensors") && !run.stderr.contains("warning"));
    let hours = place.hours();
    let at = |x: usize, y: usize| hours[61 * (30 - y) + 30 + x];
    let is_in_house = |azimuth: f64, elevation: f64| {
        let (sin, cos) = azimuth.to_radians().sin_cos();
        let reach = 5.0 / -cos;
        cos < 0.0 && (reach * sin).abs() < 5.0 && reach * elevation.to_radians().tan() < 10.0
    };
    let open = |a: f64, e: f64| !is_behind([0.0, 10.0, 0.0], a, e);
    assert_eq!(at(0, 1), winter(|a, e| open(a, e) && !is_in_house(a, e)));
    assert!(at(0, 1) + 50.0 < winter(open));
    assert_eq!(
        at(20, 25),
        winter(|a, e| !is_behind([200.0, 250.0, 0.0], a, e))
    );
    assert_eq!(at(0, 0), 0.0, "inside of the house");
    let about = place.json("about.json");
    assert!(
        about["triangles"] == 10 && about["terrain"]["cells"] == 3721,
        "{about}"
    );
    // The raster has the same values as the table, and a house with y up the same shadow.
    place.write("y.obj", house([0.0; 2], 'y'));
    let args = [
        &VIENNA[..],
        &["--up", "y", "--cells", "--terrain", "dem.asc"],
    ]
    .concat();
    place.around("y.obj", &args).expect(0);
    assert_eq!(place.hours(), hours);
    shards(&place, "house.obj", &flags, "npz");
    // Without terrain, --cells of a mesh are its vertices.
    place.around("house.obj", &flags).expect(0);
    assert_eq!(place.hours().len(), 8);
}

#[test]
fn terrain_says_where_a_scene_is_and_must_be_there() {
    let place = place();
    let middle = [600_000.0, 5_340_000.0];
    let (mut grid, heights) = ridge(middle);
    grid.crs = Some(Crs::from_epsg(25_832).expect("a code"));
    place.write_raster("dem.tif", &grid, &heights, "m");
    place.write("map.obj", house(middle, 'z'));
    let run = place
        .around("map.obj", &["--surfaces", "2", "--terrain", "dem.tif"])
        .expect(0);
    let line = "map: at 48.2053° N, 10.3459° E by EPSG:25832";
    assert!(
        run.stderr.contains(line) && !run.stderr.contains("warning"),
        "{}",
        run.stderr
    );
    let whole = place.read("sun.csv");
    // The same from two files.
    std::fs::create_dir(place.path("tiles")).expect("a folder");
    for (name, first, width) in [("tiles/a.tif", 0, 25), ("tiles/b.tif", 25, 36)] {
        let [x, y] = grid.corner(first as f64, 0.0);
        let mut tile = Grid::north_up([width, 61], [x, y], 10.0);
        tile.crs = grid.crs.clone();
        let rows = heights.chunks(61).map(|row| &row[first..first + width]);
        place.write_raster(name, &tile, &rows.collect::<Vec<_>>().concat(), "m");
    }
    for tiles in [&["tiles"][..], &["tiles/b.tif", "tiles/a.tif"]] {
        let flags = [&["--surfaces", "2", "--terrain"], tiles].concat();
        place.around("map.obj", &flags).expect(0);
        assert!(place.read("sun.csv") == whole, "{tiles:?}");
    }
    // What does not fit together: elsewhere, above, and in another unit or system.
    let there = [&VIENNA[..], &["--up", "z", "--surfaces", "2"]].concat();
    let apart = |scene: &str, words: &str| {
        let run = place.around(scene, &[&there[..], &["--terrain", "dem.asc"]].concat());
        let stderr = run.expect(0).stderr;
        assert!(
            stderr.matches("warning").count() == 1 && stderr.contains(words),
            "{stderr}"
        );
    };
    apart(
        "map.obj",
        "warning: the scene is not in --terrain: x 599995 to 600005, y 5339995 to 5340005, z 0 to 10, and the terrain x -300 to 300, \
         y -300 to 300, z 0 to 80",
    );
    place.write(
        "high.obj",
        house([0.0; 2], 'z')
            .replace(" 10\n", " 200\n")
            .replace(" 0\n", " 190\n"),
    );
    apart("high.obj", "z 190 to 200, and the terrain");
    let refused: [(&[&str], &str); 7] = [
        (
            &["map.obj", "--surfaces", "2", "--crs", "EPSG:25833"],
            "gdalwarp -t_srs EPSG:25833",
        ),
        (
            &["map.obj", "--surfaces", "2", "--units", "ft"],
            "--units says ft",
        ),
        (&["dem.tif", "--cells"], "give all rasters as one scene"),
        (
            &["map.obj", "--cells", "--groups", "a.csv"],
            "--groups: not with --cells",
        ),
        (
            &["map.obj", "--cells", "-o", "a.ply"],
            "--output .ply: not with --cells",
        ),
        (&["map.obj", "--cells", "--vertices"], "cannot be used with"),
        (
            &["map.obj", "--surfaces", "2", "--terrain", "map.obj"],
            "it is no height raster",
        ),
    ];
    for (args, words) in refused {
        let terrain = ["--terrain", "dem.tif", "-o", "refused.csv"];
        let run = place.run(&[&["sun"], args, &WINTER, &terrain].concat());
        assert!(
            run.code != 0 && run.stderr.contains(words),
            "{args:?}: {}",
            run.stderr
        );
        assert!(
            !place.files().contains(&"refused.csv".to_owned()),
            "{args:?}"
        );
    }
    let slip = [
        "--sensors",
        "points.csv",
        "-o",
        "a.csv",
        "--terrain",
        "dem.tif",
        "map.obj",
    ];
    let run = place.run(&[&["sun"], &slip[..]].concat()).expect(2);
    let words = "the scene goes before `--terrain`";
    assert!(run.stderr.contains(words), "{}", run.stderr);
}
