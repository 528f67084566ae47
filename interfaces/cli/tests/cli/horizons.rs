//! Horizons by rays and of the cells of rasters.

use std::fs;

use antumbra_raster::Quantity;

use crate::support::Place;

#[test]
fn horizons_by_rays_and_of_cells_agree_and_shares_change_no_byte() {
    let place = Place::empty();
    // A wall of 9 m along the east of a plain of 40 x 40 cells of 1 m.
    let mut asc =
        String::from("ncols 40\nnrows 40\nxllcorner 600000\nyllcorner 5340000\ncellsize 1\n");
    for _ in 0..40 {
        let row: Vec<&str> = (0..40)
            .map(|column| if column == 35 { "9" } else { "0" })
            .collect();
        asc += &(row.join(" ") + "\n");
    }
    place.write("wall.asc", asc);
    let flags = ["horizon", "wall.asc", "--azimuths", "8"];
    let cells = [&flags[..], &["--cells"]].concat();
    place
        .run(&[&cells[..], &["-o", "cells.csv", "-o", "cells.npz"]].concat())
        .expect(0);
    let rows = place.rows("cells.csv");
    let names = "x,y,z,horizon_000,horizon_045,horizon_090,horizon_135,horizon_180,horizon_225,horizon_270,horizon_315";
    assert_eq!(rows[0].join(","), names);
    let row = &rows[1 + 20 * 40 + 20];
    let number = |column: usize| row[column].parse::<f64>().expect("a number");
    assert_eq!([number(0), number(1)], [600_020.5, 5_340_019.5]);
    // The crest is 15 m away.
    for (column, distance) in [(5, 15.0), (4, 15.0 * 2_f64.sqrt())] {
        let wanted = (9.0 / distance).atan().to_degrees();
        assert!(
            (number(column) - wanted).abs() < 1e-3,
            "{} for {wanted}",
            number(column)
        );
    }
    assert_eq!([number(3), number(9)], [0.0, 0.0]);
    place.write("eye.csv", "x,y,z,nx,ny,nz\n600020.5,5340019.5,0,0,0,1\n");
    let sensors = [&flags[..], &["--sensors", "eye.csv", "-o", "eye.csv.csv"]].concat();
    place.run(&sensors).expect(0);
    let by_rays = &place.rows("eye.csv.csv")[1];
    for column in 3..11 {
        let own = by_rays[column + 3].parse::<f64>().expect("a number");
        assert!(
            (own - number(column)).abs() < 2e-3,
            "{own} {}",
            number(column)
        );
    }
    for share in ["0/3", "1/3", "2/3"] {
        let part = format!("{}.part", &share[..1]);
        place
            .run(&[&cells[..], &["--shard", share, "-o", &part]].concat())
            .expect(0);
    }
    place
        .run(&["merge", "0.part", "1.part", "2.part", "-o", "merged.npz"])
        .expect(0);
    let read = |name: &str| fs::read(place.path(name)).expect("a file");
    assert!(read("merged.npz") == read("cells.npz"));
    // By default, cells have the azimuths of steps of at most two cells.
    let lattice = ["horizon", "wall.asc", "--cells"];
    let outputs = ["-o", "all.csv", "-o", "all.npy"];
    place.run(&[&lattice[..], &outputs].concat()).expect(0);
    let all = place.rows("all.csv");
    assert_eq!(all[0].len(), 3 + 16);
    assert_eq!(
        all[0][3..6].join(","),
        "horizon_000,horizon_026.57,horizon_045"
    );
    for (own, even) in [(5, 4), (7, 5)] {
        assert_eq!(all[1 + 20 * 40 + 20][own], row[even], "{}", all[0][own]);
    }
    let planes = fs::read(place.path("all.npy")).expect("planes");
    assert!(String::from_utf8_lossy(&planes[..128]).contains("(16, 40, 40)"));
    assert_eq!(planes.len(), 128 + 4 * 16 * 40 * 40);
    for (flags, words) in [
        (
            &["--first", "3"][..],
            "--first is for azimuths that are evenly spread",
        ),
        (
            &["--azimuths", "lattice:9"],
            "azimuths of a lattice: found 9, wanted 8, 16, 32",
        ),
        (
            &["--azimuths", "lattice:8", "--grid", "2"],
            "a lattice of azimuths is for --cells",
        ),
        (&["--azimuths", "0"], "wanted 1 to 3600, or lattice:8"),
    ] {
        let base = if flags.contains(&"--grid") {
            &lattice[..2]
        } else {
            &lattice[..]
        };
        let run = place.run(&[base, flags, &["-o", "b.csv"]].concat());
        let said = run.expect(2).stderr;
        assert!(said.contains(words), "{said}");
    }
    // An .asc has one azimuth, and so has a raster of sensors that rays answer.
    let on_its_side = ["--up", "y", "-o", "a.npy"];
    for more in [&["-o", "a.asc"][..], &on_its_side] {
        let said = place.run(&[&cells[..], more].concat()).expect(2).stderr;
        let words =
            "has one azimuth: --azimuths 1 with --first; .tif, .npy and .npz of --cells have all";
        assert!(said.contains(words), "{said}");
    }
    // Bands are planes, with the names of columns: written as they come, or beside other files.
    let values: Vec<f32> = planes[128..]
        .as_chunks()
        .0
        .iter()
        .copied()
        .map(f32::from_le_bytes)
        .collect();
    let band = |name| Quantity {
        name,
        unit: "degrees",
    };
    let bands: Vec<Quantity<'_>> = all[0][3..].iter().map(|name| band(name)).collect();
    let grid = place.raster("wall.asc").grid;
    let wanted = antumbra_raster::write("a.tif".as_ref(), &grid, &values, &bands);
    let wanted = wanted.expect("a raster");
    for outputs in [&["-o", "a.tif"][..], &["-o", "a.tiff", "-o", "a.csv"]] {
        place.run(&[&lattice[..], outputs].concat()).expect(0);
        assert!(read(outputs[1]) == wanted, "{outputs:?}");
    }
    let one = [
        "horizon",
        "wall.asc",
        "--cells",
        "--azimuths",
        "1",
        "--first",
        "90",
        "-o",
        "east.tif",
    ];
    place.run(&one).expect(0);
}

#[test]
fn cells_have_the_sky_that_their_horizons_leave() {
    let place = Place::empty();
    // A step of 3 m from the west to the east.
    let row = "0 0 0 0 0 3 3 3 3 3\n";
    let asc = "ncols 10\nnrows 401\nxllcorner 600000\nyllcorner 5340000\ncellsize 1\n";
    place.write("step.asc", format!("{asc}{}", row.repeat(401)));
    let flags = ["horizon", "step.asc", "--cells", "--show", "sky-view"];
    let outputs = ["-o", "sky.csv", "-o", "sky.npy", "-o", "sky.npz"];
    let said = place.run(&[&flags[..], &outputs].concat()).expect(0).stderr;
    assert!(
        said.contains("4 010 cells, 16 azimuths; sky view is 0."),
        "{said}"
    );
    assert!(
        said.contains("the next coarser azimuths differ by 0.0"),
        "{said}"
    );
    let rows = place.rows("sky.csv");
    assert_eq!(rows[0].join(","), "x,y,z,sky_view");
    // A wall without an end leaves (1 + cos a) / 2 of the light of the sky, if it ends at the elevation a.
    for column in 0..4 {
        let tangent = 3.0 / f64::from(5 - column);
        let wanted = 0.5 * (1.0 + 1.0 / tangent.hypot(1.0));
        let found: f64 = rows[1 + 2000 + column as usize][3]
            .parse()
            .expect("a number");
        assert!(
            (found - wanted).abs() < 0.01,
            "{column}: {found} for {wanted}"
        );
    }
    let planes = fs::read(place.path("sky.npy")).expect("a plane");
    assert!(String::from_utf8_lossy(&planes[..128]).contains("(401, 10)"));
    for share in ["0/2", "1/2"] {
        let part = format!("{}.part", &share[..1]);
        let flags = [&flags[..], &["--shard", share, "-o", &part]].concat();
        place.run(&flags).expect(0);
    }
    place
        .run(&["merge", "0.part", "1.part", "-o", "merged.npz"])
        .expect(0);
    let read = |name: &str| fs::read(place.path(name)).expect("a file");
    assert!(read("merged.npz") == read("sky.npz"));
    let grid = [
        "horizon", "step.asc", "--grid", "2", "--show", "openness", "-o", "b.csv",
    ];
    let said = place.run(&grid).expect(2).stderr;
    assert!(
        said.contains("--show openness is for --cells of a height raster"),
        "{said}"
    );
}
