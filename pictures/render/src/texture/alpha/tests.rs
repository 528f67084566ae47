//! Quick answers against the value itself, and classes against many points of a triangle.

use antumbra_scene::{ImageTexture, TextureFilter};

use super::*;

const WHOLE: [[f32; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
use crate::sampler::{Method, Sampler};

/// Numbers in [0, 1), the same for the same seed.
fn numbers(seed: u64, count: u32) -> impl Iterator<Item = [f32; 2]> {
    let sampler = Sampler::new(Method::Independent, seed);
    (0..count).map(move |i| sampler.stream(0, 0, i).pair(0))
}

/// A mesh of triangles anywhere in texture space, small and large. Every fourth has its vertices on texels.
fn mesh(seed: u64, triangles: u32, size: IVec2) -> Arc<TriangleMesh> {
    let points: Vec<[f32; 2]> = numbers(seed, 4 * triangles).collect();
    let mut uvs = Vec::new();
    for (index, points) in points.chunks(4).enumerate() {
        let extent = [0.02, 0.3, 3.0][index % 3];
        for &corner in &points[..3] {
            let at = Vec2::from(points[3]) * 3.0 - 1.0 + Vec2::from(corner) * extent;
            let on_texels = ((at * size.as_vec2()).floor() + 0.5) / size.as_vec2();
            uvs.push(if index % 4 == 0 { on_texels } else { at });
        }
    }
    Arc::new(TriangleMesh {
        positions: vec![[0.0; 3]; uvs.len()],
        indices: (0..triangles)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect(),
        normals: Vec::new(),
        uvs,
        colors: Vec::new(),
    })
}

fn shape(mesh: Arc<TriangleMesh>) -> Shape {
    Shape {
        geometry: Geometry::Mesh(mesh),
        material: 0,
        area_light: None,
        media: None,
        alpha: None,
        shadow_alpha: None,
        reverse_orientation: false,
        transform_swaps_handedness: false,
    }
}

/// Blobs of opaque texels, a quarter of all or so.
fn image(size: IVec2, kind: u32) -> Arc<Image> {
    let there = |i: i32| {
        let (x, y) = (i % size.x, i / size.x);
        let wave = libm::sinf(x as f32 * 0.7) + libm::cosf(y as f32 * 0.5 + 0.3 * x as f32);
        (wave > 0.8, 1 + (i % 255) as u8)
    };
    let texels = 0..size.x * size.y;
    let pixels = match kind {
        0 => Pixels::Grey8(
            texels
                .map(|i| if there(i).0 { there(i).1 } else { 0 })
                .collect(),
        ),
        1 => Pixels::Rgb8(
            texels
                .map(|i| {
                    if there(i).0 {
                        [0, 0, there(i).1]
                    } else {
                        [0; 3]
                    }
                })
                .collect(),
        ),
        _ => Pixels::Rgb32(
            texels
                .map(|i| {
                    if there(i).0 {
                        [1e-9, 0.0, 0.0]
                    } else {
                        [0.0; 3]
                    }
                })
                .collect(),
        ),
    };
    Arc::new(Image {
        name: "mask".into(),
        width: size.x as u32,
        height: size.y as u32,
        pixels,
    })
}

fn texture(image: Arc<Image>, wrap: Wrap) -> Param<f32> {
    Param::Texture(Arc::new(antumbra_scene::Texture::Image(ImageTexture {
        image,
        mapping: antumbra_scene::Mapping::Uv {
            scale: Vec2::new(1.5, -0.75),
            offset: Vec2::new(0.125, 0.3),
        },
        wrap,
        filter: TextureFilter::Ewa {
            max_anisotropy: 8.0,
        },
        gamma: true,
        scale: 0.5,
    })))
}

#[test]
fn quick_answers_and_classes_are_right() {
    let seed = 3;
    println!("seed {seed}");
    let mut found = [0; 3];
    for (kind, size) in [
        (0, IVec2::new(32, 16)),
        (1, IVec2::new(13, 21)),
        (2, IVec2::ONE * 8),
    ] {
        for wrap in [Wrap::Repeat, Wrap::Clamp, Wrap::Black] {
            let triangles = 600;
            let shape = shape(mesh(seed + u64::from(kind), triangles, size));
            let mut textures = Textures::default();
            let mask = AlphaMask::new(&shape, &texture(image(size, kind), wrap), &mut textures)
                .expect("a mask");
            assert!(mask.stencil.is_some());

            for triangle in 0..triangles {
                let mut seen = [false; 2];
                let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.5]];
                let inside = numbers(u64::from(triangle), 60).map(|[u, v]| [u * (1.0 - v), v]);
                for [u, v] in corners.into_iter().chain(inside) {
                    let alpha = mask.alpha_at(triangle, u, v);
                    let opaque = mask.is_opaque_at(triangle, u, v);
                    assert_eq!(opaque, alpha != 0.0, "{kind} {wrap:?} {triangle} {u} {v}");
                    seen[usize::from(opaque)] = true;
                }
                let class = mask.coverage(triangle, &WHOLE);
                match class {
                    Coverage::Opaque => assert!(!seen[0], "{kind} {wrap:?} {triangle}"),
                    Coverage::Clear => assert!(!seen[1], "{kind} {wrap:?} {triangle}"),
                    Coverage::Mixed | Coverage::Unknown => {}
                }
                found[class as usize] += 1;
            }
        }
    }
    assert!(found.iter().all(|&count| count > 100), "{found:?}");
}

#[test]
fn coordinates_that_are_no_numbers_are_asked_one_by_one() {
    let image = image(IVec2::ONE * 8, 0);
    for bad in [f32::NAN, f32::INFINITY] {
        let mut mesh = TriangleMesh::clone(&mesh(5, 4, IVec2::ONE * 8));
        mesh.uvs[7].y = bad;
        let alpha = texture(Arc::clone(&image), Wrap::Repeat);
        let mask = AlphaMask::new(&shape(Arc::new(mesh)), &alpha, &mut Textures::default());
        let mask = mask.expect("a mask");
        assert!(mask.stencil.is_none());
        for (triangle, [u, v]) in (0..4).zip(numbers(2, 4)) {
            let [u, v] = [u * (1.0 - v), v];
            let expected = mask.alpha_at(triangle, u, v) != 0.0;
            assert_eq!(mask.is_opaque_at(triangle, u, v), expected);
        }
    }
}

#[test]
fn the_first_row_of_an_image_is_at_the_top() {
    let image = Arc::new(Image {
        name: "mask".into(),
        width: 1,
        height: 2,
        pixels: Pixels::Grey8(vec![255, 0]),
    });
    let texture = antumbra_scene::Texture::Image(ImageTexture {
        image,
        mapping: Default::default(),
        wrap: Wrap::Clamp,
        filter: TextureFilter::Trilinear,
        gamma: true,
        scale: 1.0,
    });
    let shape = shape(Arc::new(TriangleMesh {
        positions: vec![[0.0; 3]; 3],
        indices: vec![[0, 1, 2]],
        ..TriangleMesh::default()
    }));
    let alpha = Param::Texture(Arc::new(texture));
    let mask = AlphaMask::new(&shape, &alpha, &mut Textures::default()).expect("a mask");
    // The mesh has no coordinates of its own: its vertices are at (0, 0), (1, 0) and (1, 1).
    for (u, v, expected) in [(0.5, 0.125, 0.0), (0.25, 0.5, 0.5), (0.0, 0.875, 1.0)] {
        assert_eq!(mask.alpha_at(0, u, v), expected);
        assert_eq!(mask.is_opaque_at(0, u, v), expected != 0.0);
    }
    assert_eq!(mask.coverage(0, &WHOLE), Coverage::Mixed);
}

#[test]
fn constants_cut_out_all_or_nothing() {
    let shape = shape(mesh(1, 2, IVec2::ONE));
    let mut textures = Textures::default();
    assert!(AlphaMask::new(&shape, &Param::Constant(0.5), &mut textures).is_none());
    let clear = AlphaMask::new(&shape, &Param::Constant(0.0), &mut textures).expect("a mask");
    assert!(!clear.is_opaque_at(1, 0.2, 0.2));
    assert_eq!(clear.coverage(1, &WHOLE), Coverage::Clear);
    // More than an image has unknown coverage, but every point has a value.
    let half = Param::Texture(Arc::new(antumbra_scene::Texture::Scale([
        Param::Constant(0.0),
        texture(image(IVec2::ONE * 4, 0), Wrap::Repeat),
    ])));
    let mask = AlphaMask::new(&shape, &half, &mut textures).expect("a mask");
    assert_eq!(mask.coverage(0, &WHOLE), Coverage::Unknown);
    assert!(!mask.is_opaque_at(0, 0.2, 0.2));
}
