//! Pixels, standard errors and dropped samples, whatever the order of tiles.

use antumbra_image::Window;
use antumbra_scene::Filter;
use glam::Vec3;

use super::*;

fn film(filter: Filter) -> antumbra_scene::Film {
    antumbra_scene::Film {
        resolution: [4, 4],
        filter,
        ..Default::default()
    }
}

const FULL: Window = Window {
    x0: 0,
    y0: 0,
    x1: 4,
    y1: 4,
};

#[test]
fn a_box_of_one_pixel_holds_each_sample_once() {
    let rules = Rules::new(&film(Filter::default()), true);
    assert_eq!(rules.sampled(), FULL);
    let mut tile = TileFilm::new(rules, FULL);
    for inside in [[0.0, 0.0], [0.5, 0.5], [1.0 - f32::EPSILON, 0.0]] {
        tile.add([1, 2], inside, Vec3::new(1.0, 2.0, 3.0));
    }
    let mut film = Film::new(rules);
    film.finish(0, tile);
    let weights: Vec<f64> = (0..16).map(|i| film.sums.weight(i)).collect();
    let mut expected = vec![0.0; 16];
    expected[2 * 4 + 1] = 3.0;
    assert_eq!(weights, expected);
    let image = film.image([4, 4]).unwrap();
    assert_eq!(image.pixels()[9], [1.0, 2.0, 3.0]);
    assert_eq!(image.pixels()[0], [0.0; 3]);
    let errors = film.standard_error([4, 4]).unwrap().unwrap();
    assert_eq!(errors.pixels()[9], [0.0; 3]);
    assert_eq!(errors.pixels()[0], [f32::INFINITY; 3]);
}

#[test]
fn wide_filters_reach_neighbours_and_samples_outside_count() {
    let rules = Rules::new(&film(Filter::Box { radius: [1.5, 0.5] }), false);
    let sampled = rules.sampled();
    assert_eq!(
        (sampled.x0, sampled.x1, sampled.y0, sampled.y1),
        (-1, 5, 0, 4)
    );
    let mut tile = TileFilm::new(rules, sampled);
    tile.add([-1, 0], [0.5, 0.5], Vec3::ONE);
    tile.add([2, 1], [0.5, 0.5], Vec3::ONE);
    let mut film = Film::new(rules);
    film.finish(0, tile);
    let weights: Vec<f64> = (0..8).map(|i| film.sums.weight(i)).collect();
    assert_eq!(weights, [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
}

#[test]
fn tiles_are_added_in_order_whatever_order_they_come_in() {
    let rules = Rules::new(
        &film(Filter::Gaussian {
            radius: [2.0, 2.0],
            alpha: 1.0,
        }),
        false,
    );
    let tile = |index: usize| {
        let x = index as i32 * 2;
        let mut tile = TileFilm::new(
            rules,
            Window {
                x0: x,
                x1: x + 2,
                ..FULL
            },
        );
        tile.add([x, 1], [0.3, 0.9], Vec3::splat(0.1 + index as f32 * 0.7));
        tile.add([x + 1, 1], [0.1, 0.2], Vec3::splat(1e-3));
        tile
    };
    let (mut one, mut other) = (Film::new(rules), Film::new(rules));
    [0, 1].into_iter().for_each(|i| one.finish(i, tile(i)));
    [1, 0].into_iter().for_each(|i| other.finish(i, tile(i)));
    assert_eq!(one.image([4, 4]).unwrap(), other.image([4, 4]).unwrap());
    assert!(one.image([4, 4]).unwrap().pixels()[5][0] > 0.0);
}

#[test]
fn films_are_joined_in_the_order_of_tiles() {
    let rules = Rules::new(&film(Filter::Box { radius: [1.5, 0.5] }), false);
    // 2⁵³ + 1 + 1 is another number than 1 + 1 + 2⁵³.
    let tile = |index: usize| {
        let x = index as i32;
        let window = Window {
            x0: x,
            x1: x + 1,
            ..FULL
        };
        let mut tile = TileFilm::new(rules, window);
        let value = if index == 0 { 2.0_f32.powi(53) } else { 1.0 };
        tile.add([x, 1], [0.5, 0.5], Vec3::splat(value));
        tile.add([x, 1], [0.5, 0.5], Vec3::NAN);
        tile
    };
    let mut whole = Film::new(rules);
    (0..3).for_each(|index| whole.finish(index, tile(index)));
    let (mut one, mut other) = (Film::apart(rules), Film::apart(rules));
    [1, 2].into_iter().for_each(|i| one.finish(i, tile(i)));
    other.finish(0, tile(0));
    let joined = Film::join(rules, [one, other]);
    assert_eq!(joined.sums, whole.sums);
    assert_eq!(joined.dropped(), 3);
}

#[test]
fn the_standard_error_is_that_of_the_textbook() {
    let mut scene = film(Filter::default());
    scene.scale = 2.0;
    let rules = Rules::new(&scene, true);
    let mut tile = TileFilm::new(rules, FULL);
    for value in [1.0, 2.0, 4.0, 5.0] {
        tile.add([0, 0], [0.5, 0.5], Vec3::splat(value));
    }
    let mut film = Film::new(rules);
    film.finish(0, tile);
    // Variance 10 / 3 of four samples, scaled by 2.
    let expected = 2.0 * (10.0_f32 / 3.0 / 4.0).sqrt();
    let found = film.standard_error([4, 4]).unwrap().unwrap().pixels()[0][0];
    assert!((found - expected).abs() < 1e-6);
    assert_eq!(film.image([4, 4]).unwrap().pixels()[0], [6.0; 3]);
}

#[test]
fn weights_that_cancel_leave_the_standard_error_unknown() {
    // The triangle is 0 at its edge: two samples there weigh nothing.
    let triangle = Filter::Triangle { radius: [0.5, 0.5] };
    let rules = Rules::new(&film(triangle), true);
    let mut tile = TileFilm::new(rules, FULL);
    for value in [1.0, 2.0] {
        tile.add([0, 0], [0.0, 0.5], Vec3::splat(value));
    }
    let mut film = Film::new(rules);
    film.finish(0, tile);
    let sums = &film.sums;
    let weightless = (0..16).filter(|&i| sums.weight(i) == 0.0 && sums.samples(i) == 2);
    assert_eq!(weightless.count(), 1);
    let errors = film.standard_error([4, 4]).unwrap().unwrap();
    assert!(errors.pixels().iter().all(|e| *e == [f32::INFINITY; 3]));
}

#[test]
fn a_negative_scale_makes_negative_pixels_of_positive_means_only() {
    let mut scene = film(Filter::default());
    scene.scale = -2.0;
    let rules = Rules::new(&scene, true);
    let mut tile = TileFilm::new(rules, FULL);
    tile.add([0, 0], [0.5, 0.5], Vec3::new(5.0, -1.0, 0.0));
    let mut film = Film::new(rules);
    film.finish(0, tile);
    assert_eq!(film.image([4, 4]).unwrap().pixels()[0], [-10.0, 0.0, 0.0]);
}

#[test]
fn bad_samples_are_dropped_and_bright_ones_dimmed() {
    let mut scene = film(Filter::default());
    scene.max_sample_luminance = 1.0;
    let rules = Rules::new(&scene, false);
    let mut tile = TileFilm::new(rules, FULL);
    for bad in [Vec3::NAN, Vec3::INFINITY, Vec3::splat(-1.0)] {
        tile.add([0, 0], [0.5, 0.5], bad);
    }
    tile.add([0, 0], [0.5, 0.5], Vec3::splat(8.0));
    let mut film = Film::new(rules);
    film.finish(0, tile);
    assert_eq!(film.dropped(), 3);
    assert_eq!(film.dropped_at(), Some([0, 0]));
    let pixel = film.image([4, 4]).unwrap().pixels()[0];
    assert!((pixel[0] - 1.0).abs() < 1e-5, "{pixel:?}");
}

/// The sums that the default filter leaves out are those that another filter keeps.
#[test]
fn samples_of_weight_one_need_no_sums_of_weights() {
    let rules = Rules::new(&film(Filter::default()), true);
    // Just as wide, by the next number: every sample weighs 1, too.
    let radius = [0.5, 0.5_f32.next_down()];
    let written_out = Rules::new(&film(Filter::Box { radius }), true);
    let [one, other] = [rules, written_out].map(|rules| {
        let mut tile = TileFilm::new(rules, FULL);
        for sample in 0..200 {
            let [a, b, c] = [7, 11, 13].map(|step| (sample * step % 17) as f32 / 17.0);
            let place = [sample % 4, sample / 4 % 4];
            tile.add(
                place,
                [0.9 * a, 0.1 + 0.8 * b],
                Vec3::new(a, 3.0 * b * c, 1e3 * c),
            );
        }
        let mut film = Film::new(rules);
        film.finish(0, tile);
        film
    });
    assert_ne!(one.sums, other.sums);
    assert_eq!(one.image([4, 4]).unwrap(), other.image([4, 4]).unwrap());
    let errors = |film: &Film| film.standard_error([4, 4]).unwrap();
    assert_eq!(errors(&one), errors(&other));
}

#[test]
fn pixels_take_as_many_bytes_as_is_said() {
    let triangle = Filter::Triangle { radius: [1.0, 1.0] };
    for (filter, squares, bytes) in [
        (Filter::default(), false, 26),
        (Filter::default(), true, 50),
        (triangle, false, 34),
        (triangle, true, 90),
    ] {
        let film = Film::new(Rules::new(&film(filter), squares));
        assert_eq!(film.sums.bytes(), bytes * 16, "{filter:?} {squares}");
    }
}
