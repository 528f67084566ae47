//! Answers that stay the same over machines, versions and languages: a check sum of their bits, which the tests of the
//! Python package compare too (`interfaces/python/tests/test_known_answers.py` makes the same scene and rays).

use antumbra::recipe::Engine;
use antumbra::{Bvh, Geometry, INVALID_ID, Ray, Recipe};

/// Numbers in [0, 1) of 24 bits: the generator modulo 2³² of Numerical Recipes, upper bits.
struct Numbers(u32);

impl Numbers {
    fn unit(&mut self) -> f32 {
        self.0 = (self.0.wrapping_mul(1_664_525)).wrapping_add(1_013_904_223);
        (self.0 >> 8) as f32 / (1 << 24) as f32
    }

    fn point(&mut self) -> [f32; 3] {
        [self.unit(), self.unit(), self.unit()]
    }
}

/// Check sum FNV-1a of 64 bits.
fn check_sum(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes.into_iter().fold(0xcbf2_9ce4_8422_2325, |sum, byte| {
        (sum ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// Corners of a triangle each, a third of it inside the unit cube.
fn corners(numbers: &mut Numbers) -> [[f32; 3]; 3] {
    let first = numbers.point();
    let mut near = || {
        let offset = numbers.point();
        [0, 1, 2].map(|axis| first[axis] + (offset[axis] - 0.5) * 0.25)
    };
    [first, near(), near()]
}

/// Sums of whether segments are occluded, and of distances, triangles, `u` and `v` of closest hits.
const KNOWN: [u64; 4] = [
    0xc5f9_bc35_0380_14a6,
    0xa6de_b02c_d489_bb4d,
    0x80ed_3271_b9f4_aea7,
    0xa5fb_0f7d_7820_d4ff,
];

#[test]
fn answers_have_the_known_check_sums() {
    let mut numbers = Numbers(2016);
    let positions: Vec<[f32; 3]> = (0..300).flat_map(|_| corners(&mut numbers)).collect();
    let indices: Vec<[u32; 3]> = (0..300).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let rays: Vec<Ray> = (0..4000)
        .map(|_| {
            let (from, to) = (numbers.point(), numbers.point());
            Ray::new(from, [0, 1, 2].map(|axis| to[axis] - from[axis]))
        })
        .collect();
    let segments: Vec<Ray> = rays.iter().map(|ray| Ray { tfar: 1.0, ..*ray }).collect();
    let geometry = [Geometry::triangles(positions, indices)];
    for engine in Engine::all() {
        let recipe = Recipe::default().engine(engine);
        let bvh = Bvh::build(&geometry, &recipe).expect("in range");
        let mut occluded = vec![false; rays.len()];
        bvh.batch(&segments).closed().occluded_into(&mut occluded);
        let mut hits = vec![None; rays.len()];
        bvh.batch(&rays).closed().intersect_into(&mut hits);
        let sums = [
            check_sum(occluded.iter().map(|&occluded| u8::from(occluded))),
            check_sum(
                hits.iter()
                    .flat_map(|hit| hit.map_or(f32::INFINITY, |hit| hit.t).to_le_bytes()),
            ),
            check_sum(
                hits.iter()
                    .flat_map(|hit| hit.map_or(INVALID_ID, |hit| hit.prim_id).to_le_bytes()),
            ),
            check_sum(hits.iter().flat_map(|hit| {
                hit.map_or([0.0; 2], |hit| [hit.u, hit.v])
                    .into_iter()
                    .flat_map(f32::to_le_bytes)
            })),
        ];
        assert_eq!(sums, KNOWN, "{engine:?}: {sums:#x?}");
    }
}
