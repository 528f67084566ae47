//! Maps of the cells of height rasters.

use antumbra_image::palette;
use antumbra_raster::{Crs, Grid, Quantity, write};

use crate::support::Place;

/// Oblong cells, along the axes of the map or turned by 25 degrees.
fn grid(is_turned: bool) -> Grid {
    let mut grid = Grid::north_up([40, 30], [600_000.0, 5_340_000.0], 10.0);
    let (sin, cos) = (if is_turned { 25.0_f64 } else { 0.0 })
        .to_radians()
        .sin_cos();
    grid.transform = [
        600_000.0,
        10.0 * cos,
        20.0 * sin,
        5_340_000.0,
        10.0 * sin,
        -20.0 * cos,
    ];
    grid.crs = Some(Crs::from_epsg(25_832).expect("a code"));
    grid
}

/// A plain with a wall along column 20 and a hole, and three observers.
fn place(grid: &Grid) -> Place {
    let place = Place::empty();
    let height = |cell: usize| match (cell % 40, cell / 40) {
        (4..8, 20..25) => f32::NAN,
        (20, _) => 30.0,
        _ => 5.0,
    };
    let heights: Vec<f32> = (0..40 * 30).map(height).collect();
    let quantity = Quantity {
        name: "height",
        unit: "m",
    };
    let bytes = write("dem.tif".as_ref(), grid, &heights, &[quantity]).expect("a raster");
    place.write("dem.tif", bytes);
    let mut eyes = "x,y\n".to_owned();
    for [column, row] in EYES {
        let [x, y] = grid.centre(column, row);
        eyes += &format!("{x},{y}\n");
    }
    place.write("eyes.csv", eyes);
    place
}

impl Place {
    fn text(&self, name: &str) -> String {
        String::from_utf8(self.read(name)).expect("text")
    }
}

/// Cells of the observers.
const EYES: [[usize; 2]; 3] = [[5, 5], [10, 20], [30, 15]];

const SEEN: [&str; 6] = ["visible", "dem.tif", "eyes.csv", "--viewshed", "--eye", "2"];
const DAY: [&str; 6] = [
    "--timezone",
    "1",
    "--from",
    "2025-06-21",
    "--to",
    "2025-06-21",
];

#[test]
fn pixels_are_in_the_cells_that_the_world_file_says() {
    // Colours of none, and of one, two and three of three observers.
    let class = |count: u8| palette::colour(f32::from(count) / 3.0);
    let classes = [[206, 207, 211], class(1), class(2), class(3)];
    for is_turned in [false, true] {
        let grid = grid(is_turned);
        let place = place(&grid);
        let outputs = [
            "-o",
            "seen.png",
            "-o",
            "seen.tif",
            "--resolution",
            "700x600",
        ];
        place.run(&[&SEEN[..], &outputs].concat()).expect(0);
        let counts = place.raster("seen.tif").values;
        let lines = place.text("seen.pgw");
        let lines: Vec<f64> = lines
            .lines()
            .map(|x| x.parse().expect("a number"))
            .collect();
        let [a, d, b, e, x, y] = lines[..] else {
            panic!("{lines:?}")
        };
        let [x0, ga, gb, y0, gd, ge] = grid.transform;
        let picture = place.image("seen.png").to_srgb8();
        let (mut checked, mut paper) = (0, 0);
        let mut red = [0; 3];
        for index in 0..picture.width() * picture.height() {
            let at = [index % picture.width(), index / picture.width()].map(|i| i as f64);
            let at = [
                a * at[0] + b * at[1] + x - x0,
                d * at[0] + e * at[1] + y - y0,
            ];
            let area = ga * ge - gb * gd;
            let column = (ge * at[0] - gb * at[1]) / area;
            let row = (ga * at[1] - gd * at[0]) / area;
            // Discs of observers are in the middle of their cells, or beside them.
            if picture.pixels()[index] == [206, 17, 38] && column < 40.0 && row < 30.0 {
                let is_near = |[c, r]: &[usize; 2]| {
                    let apart = [column - *c as f64 - 0.5, row - *r as f64 - 0.5];
                    apart[0].abs() < 0.6 && apart[1].abs() < 0.6
                };
                let eye = EYES.iter().position(is_near);
                red[eye.expect("an observer there")] += 1;
            }
            let is_inside =
                |x: f64, most: f64| x > 0.0 && x < most && (0.2..0.8).contains(&x.fract());
            if !is_inside(column, 40.0) || !is_inside(row, 30.0) {
                continue;
            }
            let count = counts[row as usize * 40 + column as usize];
            let found = picture.pixels()[index];
            if count.is_nan() {
                assert_eq!(found, [255; 3], "{column}, {row}");
                paper += 1;
            } else if let Some(class) = classes.iter().position(|&class| class == found) {
                // The wall is shaded, and observers have symbols.
                assert_eq!(class as f64, count, "{column}, {row}");
                checked += 1;
            }
        }
        assert!(red.into_iter().all(|pixels| pixels > 10), "{red:?}");
        assert!(checked > 60_000 && paper > 1000, "{checked} {paper}");
    }
}

#[test]
fn three_commands_draw_cells_in_three_formats() {
    let place = place(&grid(true));
    let horizon = ["horizon", "dem.tif", "--cells"];
    let sun = [&["sun", "dem.tif", "--cells"][..], &DAY].concat();
    let jobs: [(Vec<&str>, &[&str]); 5] = [
        (
            sun,
            &["Direct sun, dem", "Direct sun in h", "21 June 2025", "48.2"],
        ),
        (
            SEEN.to_vec(),
            &[
                "Viewshed, dem",
                ">not seen<",
                ">observer<",
                "3 observers, eyes 2 m and targets 0 m above",
            ],
        ),
        (
            [&SEEN[..], &["--show", "height", "--range", "0", "10"]].concat(),
            &["Height that is seen, dem", ">Least height", ">10<"],
        ),
        (
            [
                &horizon[..],
                &["--show", "sky-view", "--title", "Sky & wall"],
            ]
            .concat(),
            &["Sky &amp; wall", ">Sky view factor<", "16 azimuths"],
        ),
        (
            [
                &horizon[..],
                &["--azimuths", "1", "--first", "90", "--dark"],
            ]
            .concat(),
            &[">Elevation of the", "azimuth 90", "fill=\"#16181d\""],
        ),
    ];
    for (job, words) in jobs {
        let outputs = ["-o", "m.png", "-o", "m.svg", "-o", "m.pdf"];
        let size = ["--resolution", "640x500"];
        place.run(&[&job[..], &outputs, &size].concat()).expect(0);
        let picture = place.image("m.png");
        assert_eq!((picture.width(), picture.height()), (640, 500));
        let svg = place.text("m.svg");
        for word in words
            .iter()
            .chain(&["dem.tif", "cells of 10 x 20 m", "width=\"640\""])
        {
            assert!(svg.contains(word), "{job:?}: {word}");
        }
        assert!(place.read("m.pdf").starts_with(b"%PDF-"));
        // Turned cells have a turned world file.
        let lines = place.text("m.pgw");
        let numbers: Vec<f64> = lines
            .lines()
            .map(|x| x.parse().expect("a number"))
            .collect();
        let tangent = 25.0_f64.to_radians().tan();
        assert!((numbers[1] / numbers[0] - tangent).abs() < 1e-6, "{lines}");
        assert!((numbers[2] / -numbers[3] - tangent).abs() < 1e-6, "{lines}");
    }
}

#[test]
fn observers_are_drawn_unless_there_are_too_many() {
    let place = place(&grid(false));
    let symbols = |more: &[&str]| {
        place
            .run(&[&SEEN[..], &["-o", "m.svg"], more].concat())
            .expect(0);
        place.text("m.svg").matches("fill=\"#ce1126\"").count()
    };
    // One is in the legend.
    assert_eq!(symbols(&[]), 4);
    assert_eq!(symbols(&["--grid", "20"]), 4);
    let [x, y] = grid(false).centre(30, 15);
    place.write(
        "eyes.csv",
        format!("x,y\n{}", format!("{x},{y}\n").repeat(301)),
    );
    assert_eq!(symbols(&[]), 0);
    assert!(place.text("m.svg").contains("301 observers"));
    // Beyond the radius no height is seen, which is no large height.
    symbols(&["--radius", "60", "--show", "height", "--range", "0", "900"]);
    assert!(!place.text("m.svg").contains("fill=\"#fde725\""));
}

#[test]
fn shadows_of_cells_move() {
    let place = place(&grid(false));
    let job = [
        &["sun", "dem.tif", "--cells", "-o", "h.csv", "--step", "120"][..],
        &DAY,
    ]
    .concat();
    let size = ["--resolution", "640x500"];
    place
        .run(&[&job[..], &["--frames", "day.gif"], &size].concat())
        .expect(0);
    assert!(place.read("day.gif").starts_with(b"GIF89a"));
    place
        .run(&[&job[..], &["--frames", "f.png"], &size].concat())
        .expect(0);
    let files = place.files();
    let frames: Vec<_> = files.iter().filter(|name| name.starts_with("f-")).collect();
    assert!((6..=9).contains(&frames.len()), "{files:?}");
    // Mean column of the shadow, in pixels: west of the wall in the morning, and east of it in the evening.
    let shadow = |name: &str| {
        let picture = place.image(name).to_srgb8();
        let pixels = picture.pixels().iter().enumerate();
        let dark = pixels.filter(|(_, pixel)| **pixel == [88, 98, 128]);
        let columns: Vec<f64> = dark.map(|(i, _)| (i % picture.width()) as f64).collect();
        assert!(columns.len() > 500, "{name}: {}", columns.len());
        columns.iter().sum::<f64>() / columns.len() as f64
    };
    let (first, last) = (shadow(frames[0]), shadow(frames[frames.len() - 1]));
    assert!(first + 20.0 < last, "{first} {last}");
}

#[test]
fn what_no_map_can_show_is_refused() {
    let mut sheared = grid(true);
    sheared.transform[2] += 3.0;
    let place = place(&sheared);
    let horizon = ["horizon", "dem.tif", "--cells", "-o", "a.png"];
    let view = [&horizon[..], &["--show", "sky-view"]].concat();
    let sun = [&["sun", "dem.tif", "--cells"][..], &DAY].concat();
    let jobs: &[(&[&str], i32, &str)] = &[
        (
            &view,
            65,
            "sheared or mirrored cells; make upright ones: gdalwarp",
        ),
        (&[&SEEN[..], &["-o", "a.pdf"]].concat(), 65, "gdalwarp"),
        (&[&sun[..], &["-o", "a.svg"]].concat(), 65, "gdalwarp"),
        (
            &[&sun[..], &["-o", "a.csv", "--frames", "a.gif"]].concat(),
            65,
            "gdalwarp",
        ),
        (
            &horizon,
            2,
            "a map, an .asc, or a raster of a --grid has one azimuth",
        ),
        (
            &[
                "horizon",
                "dem.tif",
                "--grid",
                "9",
                "--azimuths",
                "1",
                "-o",
                "a.png",
            ],
            2,
            "--cells",
        ),
        (&[&view[..], &["--range", "2", "1"]].concat(), 2, "smaller"),
        (
            &[&SEEN[..], &["-o", "a.png", "--margin", "0"]].concat(),
            2,
            "--grid or of the cells",
        ),
        (
            &["sun", "builtin:city", "--vertices", "-o", "a.png"],
            2,
            "a map needs --grid, or --cells",
        ),
    ];
    let files = place.files();
    for (job, code, hint) in jobs {
        let run = place.run(job).expect(*code);
        assert!(run.stderr.contains(hint), "{job:?}: {}", run.stderr);
    }
    assert_eq!(place.files(), files);
}
