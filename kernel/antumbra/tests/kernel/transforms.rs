//! Affine transforms, to place instances by.

use antumbra_testkit::Rng;

/// Rows of a 3 x 4 matrix.
pub type Transform = [[f32; 4]; 3];

pub const IDENTITY: Transform = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
];

/// `a` after `b`.
pub fn product(a: &Transform, b: &Transform) -> Transform {
    core::array::from_fn(|row| {
        core::array::from_fn(|column| {
            let moved = if column == 3 { a[row][3] } else { 0.0 };
            (0..3).fold(moved, |sum, k| sum + a[row][k] * b[k][column])
        })
    })
}

pub fn scale(by: [f32; 3]) -> Transform {
    let mut transform = IDENTITY;
    for axis in 0..3 {
        transform[axis][axis] = by[axis];
    }
    transform
}

pub fn translation(by: [f32; 3]) -> Transform {
    let mut transform = IDENTITY;
    for axis in 0..3 {
        transform[axis][3] = by[axis];
    }
    transform
}

/// About a random axis by any angle.
pub fn rotation(rng: &mut Rng) -> Transform {
    let [x, y, z] = rng.direction();
    let length = (x * x + y * y + z * z).sqrt();
    let [x, y, z] = [x, y, z].map(|x| x / length);
    let (s, c) = rng.range(-4.0, 4.0).sin_cos();
    let d = 1.0 - c;
    [
        [c + x * x * d, x * y * d - z * s, x * z * d + y * s, 0.0],
        [y * x * d + z * s, c + y * y * d, y * z * d - x * s, 0.0],
        [z * x * d - y * s, z * y * d + x * s, c + z * z * d, 0.0],
    ]
}

/// Nested rotations, mirrors, shears, scales good and bad.
pub fn transform(rng: &mut Rng) -> Transform {
    let mut transform = translation(rng.point(1.5));
    for _ in 0..1 + rng.below(3) {
        let next = match rng.below(7) {
            0..3 => rotation(rng),
            // Mirrors.
            3 => {
                let mut by = [1.0; 3];
                by[rng.below(3)] = -1.0;
                scale(by)
            }
            4 => {
                let mut shear = IDENTITY;
                let row = rng.below(3);
                shear[row][(row + 1 + rng.below(2)) % 3] = rng.range(-2.0, 2.0);
                shear
            }
            5 => scale([rng.range(0.3, 1.5); 3]),
            _ => {
                let spread = if rng.below(2) == 0 { 0.5 } else { 3.0 };
                scale([(); 3].map(|()| 10f32.powf(rng.range(-spread, spread))))
            }
        };
        transform = product(&transform, &next);
    }
    transform
}
