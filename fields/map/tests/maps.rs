//! Maps as files: what is where, in all three formats.

use antumbra_map::{Error, Map, Relief, Steps, Symbols, Theme};

const DARK: [u8; 3] = [68, 1, 84];
const LIGHT: [u8; 3] = [253, 231, 37];

fn map(values: &[f32], width: usize) -> Map<'_> {
    Map {
        values,
        width,
        height: values.len() / width,
        cell: [2.0; 2],
        metres: Some(1.0),
        north: 0.0,
        title: "Sun & shade <of> \"a\" court",
        subtitle: "21 June 2025 · 48.2° N",
        quantity: "Direct sun",
        unit: "h",
        steps: Steps::between(0.0, 1.0, false),
        source: "court.obj",
        relief: None,
        symbols: None,
        theme: Theme::Light,
    }
}

/// One cell of a grid of 40 x 20 has the value 1, all others 0.
fn spot() -> Vec<f32> {
    let mut values = vec![0.0; 800];
    values[5 * 40 + 10] = 1.0;
    values
}

#[test]
fn the_world_file_says_where_cells_are() {
    let values = spot();
    let mut map = map(&values, 40);
    // Rows of cells that run as the axes do, or 30 degrees to the south of east, and cells that are twice as wide as high.
    let (sin, cos) = 30f64.to_radians().sin_cos();
    let ways = [
        ([1.0, 0.0], [0.0, 1.0], 2.0),
        ([cos, -sin], [sin, cos], 2.0),
        ([cos, -sin], [sin, cos], 1.0),
    ];
    for (east, north, high) in ways {
        map.cell = [2.0, high];
        for size in [[1600, 1200], [900, 1300], [641, 480]] {
            let corner = [610_000.0, 5_330_000.0];
            let transform = [
                corner[0],
                2.0 * east[0],
                -high * north[0],
                corner[1],
                2.0 * east[1],
                -high * north[1],
            ];
            let text = map.world_file(size, transform).unwrap();
            let lines: Vec<f64> = text.lines().map(|line| line.parse().unwrap()).collect();
            let [a, d, b, e, c, f] = lines[..] else {
                panic!("{text}")
            };
            let picture = map.draw(size).unwrap().pixels().unwrap();
            // Middle of the light spot. The legend is to the right of the map or below it.
            let (mut sum, mut count) = ([0.0; 2], 0.0);
            for (index, pixel) in picture.pixels().iter().enumerate() {
                let (x, y) = (index % picture.width(), index / picture.width());
                if *pixel == LIGHT && x < size[0] as usize / 2 && y < size[1] as usize / 2 {
                    sum = [sum[0] + x as f64, sum[1] + y as f64];
                    count += 1.0;
                }
            }
            assert!(count > 100.0, "{size:?}: {count} light pixels");
            let [x, y] = sum.map(|x| x / count);
            let found = [a * x + b * y + c, d * x + e * y + f];
            // The spot is in the middle of column 10 and row 5.
            let wanted = [0, 1].map(|i| corner[i] + 21.0 * east[i] - 5.5 * high * north[i]);
            // The frame is at whole pixels in both directions.
            for pixels in [80.0 / a.hypot(d), 20.0 * high / b.hypot(e)] {
                assert!((pixels - pixels.round()).abs() < 1e-4, "{size:?}: {pixels}");
            }
            let pixel = a.hypot(d);
            for axis in 0..2 {
                let apart = (found[axis] - wanted[axis]).abs();
                assert!(
                    apart < 0.6 * pixel,
                    "{size:?}: {found:?}, not {wanted:?}; a pixel is {pixel}"
                );
            }
        }
    }
}

#[test]
fn level_ground_has_the_colours_of_the_legend() {
    let values = spot();
    let mut map = map(&values, 40);
    let size = [800, 600];
    let [width, height] = map.relief_size(size).unwrap();
    let heights = vec![3.0; width * height];
    let normals = vec![[0.0, 0.0, 1.0]; width * height];
    let plain = map.draw(size).unwrap().pixels().unwrap();
    let relief = Relief {
        width,
        height,
        pixel: map.relief_pixel(size).unwrap(),
        heights,
        normals,
        has_edges: true,
    };
    map.relief = Some(&relief);
    let relief = map.draw(size).unwrap().pixels().unwrap();
    let count = |colour| {
        plain
            .pixels()
            .iter()
            .filter(|&&pixel| pixel == colour)
            .count()
    };
    assert!(count(DARK) > 100_000 && count(LIGHT) > 100);
    assert_eq!(plain, relief);
}

#[test]
fn triangles_say_that_values_lie_beyond_the_legend() {
    let triangles = |values: &[f32]| {
        let drawing = map(values, 2).draw([640, 480]).unwrap();
        let svg = drawing.svg().unwrap();
        let filled = |colour: &str| svg.contains(&format!("fill=\"{colour}\""));
        [filled("#440154"), filled("#fde725")]
    };
    assert_eq!(triangles(&[0.0, 1.0]), [false, false]);
    assert_eq!(triangles(&[0.0, 1.1]), [false, true]);
    assert_eq!(triangles(&[-0.1, 1.1]), [true, true]);
}

#[test]
fn svg_is_escaped_and_complete() {
    let values = spot();
    let svg = map(&values, 40).draw([640, 480]).unwrap().svg().unwrap();
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
    assert!(svg.contains("<title>Sun &amp; shade &lt;of&gt; &quot;a&quot; court</title>"));
    for text in [
        "Direct sun in h",
        "0.4",
        "21 June 2025 · 48.2° N",
        ">N</text>",
        " m</text>",
        "court.obj",
    ] {
        assert!(svg.contains(text), "{text}");
    }
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
}

#[test]
fn pdf_is_whole_and_the_same_each_time() {
    let values = spot();
    let map = map(&values, 40);
    let pdf = map.draw([1123, 794]).unwrap().pdf().unwrap();
    assert_eq!(pdf, map.draw([1123, 794]).unwrap().pdf().unwrap());
    let text = String::from_utf8_lossy(&pdf);
    // A4 in points, and both fonts with their letters.
    for part in [
        "/MediaBox [0 0 842.25 595.5]",
        "MAPREG+NotoSans-Regular",
        "MAPBLD+NotoSans-Bold",
        "/ToUnicode",
    ] {
        assert!(text.contains(part), "{part}");
    }
    let end = text.rsplit("startxref").next().unwrap();
    let table: usize = end.trim().lines().next().unwrap().parse().unwrap();
    assert!(pdf[table..].starts_with(b"xref"));
    assert!(
        pdf.len() < 60_000,
        "{} bytes: the fonts are whole",
        pdf.len()
    );
}

#[test]
fn what_cannot_be_drawn_is_an_error() {
    let values = [0.0; 4];
    let good = map(&values, 2);
    assert!(matches!(good.draw([100, 480]), Err(Error::Size { .. })));
    assert!(matches!(
        good.draw([20_000, 20_000]),
        Err(Error::Size { .. })
    ));
    let bad = Map {
        width: 3,
        ..good.clone()
    };
    assert!(matches!(
        bad.draw([640, 480]),
        Err(Error::Length { what: "values", .. })
    ));
    for cell in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let bad = Map {
            cell: [1.0, cell],
            ..good.clone()
        };
        assert!(
            matches!(bad.draw([640, 480]), Err(Error::Grid { .. })),
            "{cell}"
        );
    }
    let bad = Map {
        width: 0,
        height: 0,
        values: &[],
        ..good.clone()
    };
    assert!(matches!(bad.draw([640, 480]), Err(Error::Grid { .. })));
    let mut bad = good.clone();
    (bad.steps.low, bad.steps.high) = (1.0, 1.0);
    assert!(matches!(bad.draw([640, 480]), Err(Error::Range(..))));
}

#[test]
fn every_shape_is_drawn() {
    for [columns, rows] in [[1, 1], [300, 1], [1, 300], [2000, 2000]] {
        let values: Vec<f32> = (0..columns * rows).map(|i| i as f32).collect();
        let mut map = map(&values, columns);
        map.steps = Steps::around(&values, false);
        for size in [map.usual_size(), [320, 320], [1200, 400]] {
            let picture = map.draw(size).unwrap().pixels().unwrap();
            assert_eq!([picture.width() as u32, picture.height() as u32], size);
        }
    }
}

#[test]
fn symbols_are_at_their_places_in_all_formats() {
    let values = vec![0.0; 800];
    let mut map = map(&values, 40);
    map.cell = [2.0, 3.0];
    // One of them is beyond the map.
    let places = [[10.5, 5.5], [40.1, 3.0]];
    map.symbols = Some(Symbols {
        name: "observer",
        places: &places,
    });
    let red = [206, 17, 38];
    for size in [[1600, 1200], [700, 900]] {
        let picture = map.draw(size).unwrap().pixels().unwrap();
        let transform = [0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let text = map.world_file(size, transform).unwrap();
        let lines: Vec<f64> = text.lines().map(|line| line.parse().unwrap()).collect();
        // Pixels whose place in columns and rows is on the map, and not on the legend.
        let mut found = Vec::new();
        for (index, pixel) in picture.pixels().iter().enumerate() {
            let at = [index % picture.width(), index / picture.width()].map(|i| i as f64);
            let at = [lines[0] * at[0] + lines[4], lines[3] * at[1] + lines[5]];
            if *pixel == red && at[0] < 40.0 && at[1] < 20.0 {
                found.push(at);
            }
        }
        assert!(found.len() > 15, "{size:?}: {}", found.len());
        for axis in 0..2 {
            let mean = found.iter().map(|at| at[axis]).sum::<f64>() / found.len() as f64;
            let pixel = lines[3 * axis];
            assert!(
                (mean - places[0][axis]).abs() < 0.2 * pixel,
                "{size:?}: {mean}"
            );
        }
    }
    let drawing = map.draw([640, 480]).unwrap();
    let svg = drawing.svg().unwrap();
    // One on the map and one in the legend.
    assert_eq!(svg.matches("fill=\"#ce1126\"").count(), 2);
    assert!(svg.contains(">observer</text>"));
    map.symbols = None;
    let plain = map.draw([640, 480]).unwrap();
    assert!(!plain.svg().unwrap().contains("#ce1126"));
    assert!(drawing.pdf().unwrap().len() > plain.pdf().unwrap().len());
}

#[test]
fn classes_have_a_legend_with_shares() {
    for (most, names) in [
        (
            3.0,
            &["not seen", "99.8 %", ">1<", "0.1 %", ">2<", "0.0 %", ">3<"][..],
        ),
        (30.0, &["not seen, 99.8 %", ">10<", ">30<"]),
    ] {
        let mut values = vec![0.0; 800];
        (values[3], values[4]) = (1.0, most);
        let mut map = map(&values, 40);
        map.steps = Steps::around(&values, true).with_zero("not seen", &values);
        for size in [[1600, 1200], [700, 900]] {
            let svg = map.draw(size).unwrap().svg().unwrap();
            for name in names {
                assert!(svg.contains(name), "{size:?}: {name}");
            }
        }
    }
}
