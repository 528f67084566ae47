//! Heat maps: range, colours and legend.

use antumbra_image::Error;
use antumbra_image::heatmap::{Options, Range, render, shared_range};

const DARK: [u8; 3] = [68, 1, 84];
const LIGHT: [u8; 3] = [253, 231, 37];
const GREY: [u8; 3] = [128; 3];

fn bare(range: Range) -> Options {
    Options {
        range,
        legend: false,
    }
}

#[test]
fn colours_follow_the_range() {
    let field = [0.0, 4.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let picture = render(&field, 3, 2, &bare(Range::Max)).unwrap();
    assert_eq!((picture.width(), picture.height()), (3, 2));
    assert_eq!(picture.pixels(), [DARK, LIGHT, DARK, GREY, LIGHT, DARK]);

    let fixed = Range::Fixed {
        min: -1.0,
        max: 9.0,
    };
    let picture = render(&field, 3, 2, &bare(fixed)).unwrap();
    let [zero, four, low, ..] = picture.pixels() else {
        unreachable!("six pixels")
    };
    assert_eq!(*low, DARK);
    assert!(*zero != DARK && *four != LIGHT && zero != four);
}

#[test]
fn ranges() {
    let hundred: Vec<f32> = (1..=100).rev().map(|i| i as f32).collect();
    let range = |range| shared_range(&[&hundred], range).unwrap();
    assert_eq!(range(Range::Max), (0.0, 100.0));
    assert_eq!(range(Range::Percentile(100.0)), (0.0, 100.0));
    assert_eq!(range(Range::Percentile(99.0)), (0.0, 99.0));
    assert_eq!(range(Range::Percentile(50.0)), (0.0, 50.0));
    assert_eq!(range(Range::Percentile(0.0)), (0.0, 1.0));
    let fixed = Range::Fixed {
        min: -2.0,
        max: 3.0,
    };
    assert_eq!(range(fixed), (-2.0, 3.0));

    let other = [250.0, f32::NAN, f32::INFINITY];
    assert_eq!(
        shared_range(&[&hundred, &other], Range::Max).unwrap(),
        (0.0, 250.0)
    );
    for useless in [&[][..], &[0.0, -5.0], &[f32::NAN], &[f32::INFINITY]] {
        for range in [Range::Max, Range::Percentile(90.0)] {
            assert_eq!(shared_range(&[useless], range).unwrap(), (0.0, 1.0));
        }
    }
}

#[test]
fn the_whole_of_f32_is_a_range() {
    let range = Range::Fixed {
        min: f32::MIN,
        max: f32::MAX,
    };
    let picture = render(&[f32::MIN, f32::MAX], 2, 1, &bare(range)).unwrap();
    assert_eq!(picture.pixels(), [DARK, LIGHT]);
    let picture = render(&[0.0, 1e-45], 2, 1, &bare(Range::Max)).unwrap();
    assert_eq!(picture.pixels(), [DARK, LIGHT]);
}

#[test]
fn bad_options_are_errors() {
    for (min, max) in [
        (1.0, 1.0),
        (2.0, 1.0),
        (f32::NAN, 1.0),
        (0.0, f32::INFINITY),
    ] {
        let error = render(&[0.0], 1, 1, &bare(Range::Fixed { min, max }));
        assert!(matches!(error, Err(Error::BadRange { .. })));
    }
    for percentage in [-1.0, 100.5, f64::NAN] {
        let error = render(&[0.0], 1, 1, &bare(Range::Percentile(percentage)));
        assert!(matches!(error, Err(Error::BadOption { .. })));
    }
    let error = render(&[0.0; 5], 2, 3, &Options::default());
    assert!(matches!(
        error,
        Err(Error::WrongCount {
            expected: 6,
            found: 5
        })
    ));
    let error = render(&[], 0, 3, &Options::default());
    assert!(matches!(error, Err(Error::BadSize { .. })));
}

#[test]
fn the_legend_is_below_and_leaves_the_picture_alone() {
    for (width, height) in [(1, 1), (3, 200), (40, 7), (300, 20), (640, 1)] {
        let field: Vec<f32> = (0..width * height).map(|i| i as f32 * 0.37).collect();
        let plain = render(&field, width, height, &bare(Range::Max)).unwrap();
        let picture = render(&field, width, height, &Options::default()).unwrap();
        assert!(picture.width() >= width && picture.height() > height);
        let rows = picture.pixels().chunks(picture.width());
        for (row, expected) in rows.clone().zip(plain.pixels().chunks(width)) {
            assert_eq!(&row[..width], expected);
            assert!(row[width..].iter().all(|pixel| *pixel == [0; 3]));
        }
        let legend: Vec<_> = rows.skip(height).collect();
        // The bar runs from one end of the map to the other.
        assert!(
            legend
                .iter()
                .any(|row| row[0] == DARK && row.last() == Some(&LIGHT))
        );
        // Numbers stand at both ends.
        let lit =
            |row: &&[[u8; 3]], columns: std::ops::Range<usize>| row[columns].contains(&[255; 3]);
        let end = picture.width();
        assert!(legend.iter().any(|row| lit(row, 0..6)));
        assert!(legend.iter().any(|row| lit(row, end - 6..end)));
        // A third number stands in the middle if there is room.
        let middle = end / 2 - 8..end / 2 + 8;
        assert!(width < 300 || legend.iter().any(|row| lit(row, middle.clone())));
    }
}
