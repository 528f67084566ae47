//! Mappings and the textures that are no images, against closed forms.

use std::f32::consts::PI;

use antumbra_scene::{Mapping, Param, Pixels, Texture as Scene};
use glam::DMat4;

use super::*;

fn lower<T: Value>(texture: Scene<T>) -> Input<T> {
    Textures::default().input(&Param::Texture(Arc::new(texture)))
}

fn at(u: f32, v: f32) -> Place {
    Place {
        uv: Vec2::new(u, v),
        ..Place::default()
    }
}

fn board(smooth: bool) -> Input<f32> {
    lower(Scene::Checkerboard {
        squares: [0.0.into(), 1.0.into()],
        mapping: Mapping::default(),
        smooth,
    })
}

#[test]
fn squares_alternate_also_below_zero() {
    for smooth in [false, true] {
        for (u, v, second) in [
            (0.5, 0.5, 0.0),
            (1.5, 0.5, 1.0),
            (0.5, 1.5, 1.0),
            (1.5, 1.5, 0.0),
            (-0.5, 0.5, 1.0),
            (-0.5, -0.5, 0.0),
            (-1.5, 0.5, 0.0),
        ] {
            assert_eq!(board(smooth).at(&at(u, v)), second, "{u} {v}");
        }
    }
    let cubes = lower(Scene::Checkerboard3 {
        cubes: [2.0.into(), 3.0.into()],
        texture_from_world: DMat4::from_scale(glam::DVec3::splat(0.5)),
    });
    for (point, value) in [
        (Vec3::ONE, 2.0),
        (Vec3::new(3.0, 1.0, 1.0), 3.0),
        (Vec3::new(3.0, 1.0, -1.0), 2.0),
        (Vec3::splat(3.0), 3.0),
    ] {
        let place = Place {
            point,
            ..Place::default()
        };
        assert_eq!(cubes.at(&place), value);
    }
}

/// The smooth board is the mean of the sharp one over the box of the neighbouring samples.
#[test]
fn smooth_squares_are_means_over_a_box() {
    let steps = [Vec2::new(0.3, -0.1), Vec2::new(0.2, 0.45)];
    for (u, v) in [(0.1, 0.2), (0.95, 0.9), (-0.3, 2.2), (3.02, -1.9)] {
        let mut place = at(u, v);
        place.uv_steps = steps;
        let count = 400;
        let mut sum = 0.0;
        for i in 0..count {
            for j in 0..count {
                let part = |k: i32| (k as f32 + 0.5) / count as f32 * 2.0 - 1.0;
                sum += board(false).at(&at(u + 0.3 * part(i), v + 0.45 * part(j)));
            }
        }
        let mean = sum / (count * count) as f32;
        let found = board(true).at(&place);
        assert!((found - mean).abs() < 0.005, "{u} {v}: {found} {mean}");
    }
    let mut place = at(0.5, 0.999);
    place.uv_steps = [Vec2::Y * 0.1, Vec2::ZERO];
    let found = board(true).at(&place);
    assert!((found - 0.495).abs() < 1e-3, "a box without width: {found}");
    place.uv_steps = [Vec2::Y * 7.0, Vec2::ZERO];
    assert_eq!(board(true).at(&place), 0.5);
}

#[test]
fn products_mixtures_and_interpolation() {
    let uv = |corners| Scene::Bilerp {
        corners,
        mapping: Mapping::default(),
    };
    let u = || Param::Texture(Arc::new(uv([0.0, 0.0, 1.0, 1.0])));
    let v = || Param::Texture(Arc::new(uv([0.0, 1.0, 0.0, 1.0])));
    let place = at(0.25, 0.75);
    assert_eq!(lower(uv([1.0, 2.0, 3.0, 4.0])).at(&place), 2.25);
    assert_eq!(lower(Scene::Scale([u(), v()])).at(&place), 0.1875);
    let mix = Scene::Mix {
        ends: [Param::Constant(4.0), u()],
        amount: v(),
    };
    assert_eq!(lower(mix).at(&place), 4.0 * 0.25 + 0.25 * 0.75);
}

/// Coordinates come from where the texture says, and change as differences say.
#[test]
fn mappings() {
    let map = |mapping: &Mapping, place: &Place| mapping::Mapping::new(mapping).at(place);
    let uv = Mapping::Uv {
        scale: Vec2::new(2.0, 3.0),
        offset: Vec2::new(0.5, -1.0),
    };
    let mut place = at(0.25, 0.5);
    place.uv_steps = [Vec2::X, Vec2::Y];
    let found = map(&uv, &place);
    assert_eq!(found.st, Vec2::new(1.0, 0.5));
    assert_eq!(found.steps, [Vec2::X * 2.0, Vec2::Y * 3.0]);

    // The texture's space is the world's, moved: its origin is at (1, 2, 3).
    let moved = DMat4::from_translation(glam::DVec3::new(-1.0, -2.0, -3.0));
    let origin = Vec3::new(1.0, 2.0, 3.0);
    let spherical = Mapping::Spherical {
        texture_from_world: moved,
    };
    let cylindrical = Mapping::Cylindrical {
        texture_from_world: moved,
    };
    let (sin, cos) = libm::sincosf(0.25);
    for (point, sphere, cylinder) in [
        (Vec3::Z * 5.0, Vec2::ZERO, Vec2::new(0.5, 1.0)),
        (Vec3::X, Vec2::new(0.5, 0.0), Vec2::new(0.5, 0.0)),
        (-Vec3::Y, Vec2::new(0.5, 0.75), Vec2::new(0.25, 0.0)),
        (
            Vec3::new(cos, sin, 1.0),
            Vec2::new(0.25, 0.125 / PI),
            Vec2::new(0.5 + 0.125 / PI, 0.5_f32.sqrt()),
        ),
    ] {
        place.point = origin + point;
        assert!(
            (map(&spherical, &place).st - sphere).length() < 1e-5,
            "{point}"
        );
        assert!(
            (map(&cylindrical, &place).st - cylinder).length() < 1e-5,
            "{point}"
        );
    }
    // One step along the equator, across the line where the azimuth starts again.
    for (mapping, expected, seam) in [
        (spherical, Vec2::new(0.0, 0.01 / (2.0 * PI)), Vec3::X),
        (cylindrical, Vec2::new(0.01 / (2.0 * PI), 0.0), -Vec3::X),
    ] {
        let along = Vec3::new(-seam.y, seam.x, 0.0);
        place.point = origin + seam - along * 1e-4;
        place.point_steps = [along * 0.01, Vec3::ZERO];
        let steps = map(&mapping, &place).steps;
        assert!((steps[0] - expected).length() < 3e-4, "{steps:?}");
        assert_eq!(steps[1], Vec2::ZERO);
    }
    let planar = Mapping::Planar {
        axes: [Vec3::new(0.0, 2.0, 0.0), Vec3::Z],
        offset: Vec2::new(0.5, 0.0),
    };
    place.point = origin;
    place.point_steps = [Vec3::Y, Vec3::ONE];
    let found = map(&planar, &place);
    assert_eq!(found.st, Vec2::new(4.5, 3.0));
    assert_eq!(found.steps, [Vec2::new(2.0, 0.0), Vec2::new(2.0, 1.0)]);
}

#[test]
fn textures_of_one_image_share_its_pyramid() {
    let image = Arc::new(Image {
        name: "shared".into(),
        width: 2,
        height: 1,
        pixels: Pixels::Rgb8(vec![[255, 0, 0], [0, 0, 255]]),
    });
    let texture = |wrap, scale| ImageTexture {
        image: Arc::clone(&image),
        mapping: Mapping::default(),
        wrap,
        filter: TextureFilter::Trilinear,
        gamma: false,
        scale,
    };
    let mut textures = Textures::default();
    let mut color = |wrap, scale| {
        let texture = Scene::<Vec3>::Image(texture(wrap, scale));
        textures.input(&Param::Texture(Arc::new(texture)))
    };
    let (one, two, three) = (
        color(Wrap::Repeat, 1.0),
        color(Wrap::Repeat, 2.0),
        color(Wrap::Clamp, 1.0),
    );
    assert_eq!(one.at(&at(0.25, 0.5)), Vec3::X);
    assert_eq!(two.at(&at(0.75, 0.5)), Vec3::Z * 2.0);
    assert_eq!(three.at(&at(9.0, 0.5)), Vec3::Z);
    assert_eq!(textures.colors.len(), 2);
    // A number is the luminance.
    let number = Scene::<f32>::Image(texture(Wrap::Repeat, 1.0));
    let number = textures.input(&Param::Texture(Arc::new(number)));
    assert!((number.at(&at(0.25, 0.5)) - 0.212_671).abs() < 1e-6);
}

/// A dithered value of one half is solid at half of the places, an edge everywhere above it, and colours of vertices are
/// interpolated.
#[test]
fn edges_dither_and_vertex_colours() {
    for share in [0.0_f32, 0.25, 0.5, 1.0] {
        let dither: Input<f32> = lower(Scene::Dither(share.into()));
        let count = 10_000;
        let solid: f32 = (0..count)
            .map(|i| {
                let x = i as f32 * 1e-3;
                let place = Place {
                    point: Vec3::new(x, 1.0, -x),
                    ..Place::default()
                };
                dither.at(&place)
            })
            .sum();
        assert!(
            (solid / count as f32 - share).abs() < 0.02,
            "{share}: {solid}"
        );
    }
    for (value, least, expected) in [(0.5, 0.5, 1.0), (0.4, 0.5, 0.0)] {
        let value = Param::Constant(value);
        let edge: Input<f32> = lower(Scene::AtLeast { value, least });
        assert_eq!(edge.at(&Place::default()), expected);
    }
    let color: Input<Vec3> = lower(Scene::VertexColor);
    assert_eq!(color.at(&Place::default()), Vec3::ONE);
    let place = Place {
        color: Some(Vec3::new(0.1, 0.2, 0.3)),
        ..Place::default()
    };
    assert_eq!(color.at(&place), Vec3::new(0.1, 0.2, 0.3));
}
