//! Gradient noise (Perlin 2002, "Improving Noise") and what is made of it, with the constants of pbrt-v3.

use antumbra_scene::Octaves;
use glam::{Vec2, Vec3};

/// Perlin's permutation of the numbers from 0 to 255.
const PERMUTATION: [u8; 256] = [
    151, 160, 137, 91, 90, 15, 131, 13, 201, 95, 96, 53, 194, 233, 7, 225, 140, 36, 103, 30, 69,
    142, 8, 99, 37, 240, 21, 10, 23, 190, 6, 148, 247, 120, 234, 75, 0, 26, 197, 62, 94, 252, 219,
    203, 117, 35, 11, 32, 57, 177, 33, 88, 237, 149, 56, 87, 174, 20, 125, 136, 171, 168, 68, 175,
    74, 165, 71, 134, 139, 48, 27, 166, 77, 146, 158, 231, 83, 111, 229, 122, 60, 211, 133, 230,
    220, 105, 92, 41, 55, 46, 245, 40, 244, 102, 143, 54, 65, 25, 63, 161, 1, 216, 80, 73, 209, 76,
    132, 187, 208, 89, 18, 169, 200, 196, 135, 130, 116, 188, 159, 86, 164, 100, 109, 198, 173,
    186, 3, 64, 52, 217, 226, 250, 124, 123, 5, 202, 38, 147, 118, 126, 255, 82, 85, 212, 207, 206,
    59, 227, 47, 16, 58, 17, 182, 189, 28, 42, 223, 183, 170, 213, 119, 248, 152, 2, 44, 154, 163,
    70, 221, 153, 101, 155, 167, 43, 172, 9, 129, 22, 39, 253, 19, 98, 108, 110, 79, 113, 224, 232,
    178, 185, 112, 104, 218, 246, 97, 228, 251, 34, 242, 193, 238, 210, 144, 12, 191, 179, 162,
    241, 81, 51, 145, 235, 249, 14, 239, 107, 49, 192, 214, 31, 181, 199, 106, 157, 184, 84, 204,
    176, 115, 121, 50, 45, 127, 4, 150, 254, 138, 236, 205, 93, 222, 114, 67, 29, 24, 72, 243, 141,
    128, 195, 78, 66, 215, 61, 156, 180,
];

/// Frequency of an octave over the frequency of the octave below.
const STEP: f32 = 1.99;

/// A point in the space of a texture, with its change from one sample of the picture to the next.
#[derive(Clone, Copy, Debug)]
pub struct Footprint {
    pub point: Vec3,
    pub steps: [Vec3; 2],
}

impl Footprint {
    /// Footprint in a space of another scale.
    pub fn scaled(&self, by: f32) -> Self {
        Self {
            point: self.point * by,
            steps: self.steps.map(|step| step * by),
        }
    }

    /// Octaves of noise that samples can resolve: the number of whole ones, and the weight of the next.
    fn octaves(&self, most: u32) -> (u32, f32) {
        let [x, y] = self.steps.map(Vec3::length_squared);
        let count = (-1.0 - 0.5 * libm::log2f(x.max(y))).clamp(0.0, most as f32);
        let whole = count.floor();
        let rest = ((count - whole - 0.3) / 0.4).clamp(0.0, 1.0);
        (whole as u32, rest * rest * (3.0 - 2.0 * rest))
    }
}

/// Noise from about -1 to 1, 0 at points of whole coordinates.
pub fn noise(point: Vec3) -> f32 {
    let cell = point.floor();
    let inside = point - cell;
    let first = cell.to_array().map(|x| (x as i64 & 255) as usize);
    let corner = |corner: usize| {
        let step = [corner & 1, corner >> 1 & 1, corner >> 2];
        let offset = inside - Vec3::from(step.map(|x| x as f32));
        gradient([0, 1, 2].map(|axis| first[axis] + step[axis]), offset)
    };
    let [wx, wy, wz] = inside.to_array().map(weight);
    let along_x = |y: usize| lerp(wx, corner(y), corner(y + 1));
    let along_y = |z: usize| lerp(wy, along_x(z), along_x(z + 2));
    lerp(wz, along_y(0), along_y(4))
}

/// Product of the gradient at a corner of the lattice and the way from there.
fn gradient(corner: [usize; 3], offset: Vec3) -> f32 {
    let hashed = corner.iter().fold(0, |hash, x| {
        usize::from(PERMUTATION[(hash + x) % PERMUTATION.len()])
    });
    let hash = hashed % 16;
    let (u, v) = match hash {
        12 | 13 => (offset.x, offset.y),
        0..4 => (offset.x, offset.y),
        4..8 => (offset.x, offset.z),
        _ => (offset.y, offset.z),
    };
    let signed = |x: f32, bit: usize| if hash & bit == 0 { x } else { -x };
    signed(u, 1) + signed(v, 2)
}

/// The quintic that has no slope and no curvature at 0 and 1.
fn weight(t: f32) -> f32 {
    let t3 = t * t * t;
    let t4 = t3 * t;
    6.0 * t4 * t - 15.0 * t4 + 10.0 * t3
}

fn lerp(t: f32, a: f32, b: f32) -> f32 {
    (1.0 - t) * a + t * b
}

/// Sum of noise over octaves: fractional Brownian motion.
pub fn fbm(at: &Footprint, octaves: Octaves) -> f32 {
    let (whole, rest) = at.octaves(octaves.count);
    let (mut sum, mut frequency, mut amplitude) = (0.0, 1.0, 1.0);
    for _ in 0..whole {
        sum += amplitude * noise(frequency * at.point);
        frequency *= STEP;
        amplitude *= octaves.roughness;
    }
    sum + amplitude * rest * noise(frequency * at.point)
}

/// Sum of the magnitude of noise over octaves. Octaves that samples cannot resolve count by their mean.
pub fn turbulence(at: &Footprint, octaves: Octaves) -> f32 {
    const MEAN: f32 = 0.2;
    let (whole, rest) = at.octaves(octaves.count);
    let (mut sum, mut frequency, mut amplitude) = (0.0, 1.0, 1.0);
    for _ in 0..whole {
        sum += amplitude * noise(frequency * at.point).abs();
        frequency *= STEP;
        amplitude *= octaves.roughness;
    }
    sum += amplitude * lerp(rest, MEAN, noise(frequency * at.point).abs());
    for _ in whole..octaves.count {
        sum += amplitude * MEAN;
        amplitude *= octaves.roughness;
    }
    sum
}

/// Waves on water, higher where the wind is strong.
pub fn windy(at: &Footprint) -> f32 {
    let octaves = |count| Octaves {
        count,
        roughness: 0.5,
    };
    let wind = fbm(&at.scaled(0.1), octaves(3));
    wind.abs() * fbm(at, octaves(6))
}

/// Colours of marble in layers across y.
///
/// The spline has six segments, as in pbrt-v4 and in most versions of pbrt-v3. The last versions of pbrt-v3 go on beyond the end
/// of the second one, where albedos reach 40.
pub fn marble(at: &Footprint, octaves: Octaves, variation: f32) -> Vec3 {
    const LIGHT: Vec3 = Vec3::new(0.58, 0.58, 0.6);
    const COLORS: [Vec3; 9] = [
        LIGHT,
        LIGHT,
        LIGHT,
        Vec3::new(0.5, 0.5, 0.5),
        Vec3::new(0.6, 0.59, 0.58),
        LIGHT,
        LIGHT,
        Vec3::new(0.2, 0.2, 0.33),
        LIGHT,
    ];
    const SEGMENTS: usize = COLORS.len() - 3;
    let layer = at.point.y + variation * fbm(at, octaves);
    let t = (0.5 + 0.5 * libm::sinf(layer)) * SEGMENTS as f32;
    let first = (t as usize).min(SEGMENTS - 1);
    let t = t - first as f32;
    // De Casteljau's algorithm, of which the last step is left to the sum.
    let [a, b, c, d] = [0, 1, 2, 3].map(|next| COLORS[first + next]);
    let between = |a: Vec3, b: Vec3| a * (1.0 - t) + b * t;
    let [ab, bc, cd] = [between(a, b), between(b, c), between(c, d)];
    between(between(ab, bc), between(bc, cd)) * 1.5
}

/// Whether a point of texture coordinates lies in a dot. Squares of side 1 have one or none, moved a little.
pub fn is_in_dot(st: Vec2) -> bool {
    const RADIUS: f32 = 0.35;
    let cell = (st + 0.5).floor();
    let noise = |s: f32, t: f32| noise(Vec3::new(cell.x + s, cell.y + t, 0.5));
    if !(noise(0.5, 0.5) > 0.0) {
        return false;
    }
    let shift = Vec2::new(noise(1.5, 2.8), noise(4.5, 9.8)) * (0.5 - RADIUS);
    (st - cell - shift).length_squared() < RADIUS * RADIUS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_a_lattice_of_zeros_and_smooth_between() {
        let mut sum = 0.0;
        for index in 0..1000 {
            let whole = Vec3::new(
                (index % 10) as f32,
                (index / 10 % 10) as f32,
                -(index / 100) as f32,
            );
            assert_eq!(noise(whole), 0.0, "{whole}");
            let point = whole + Vec3::new(0.31, 0.72, 0.45);
            let value = noise(point);
            assert!(value.abs() < 1.05, "{value}");
            for step in [Vec3::X, Vec3::Y, Vec3::Z] {
                let near = noise(point + step * 1e-3);
                assert!((near - value).abs() < 4e-3, "{near} {value}");
            }
            // It repeats, and the other side of a cell's wall is the same.
            assert!((noise(point + 256.0) - value).abs() < 1e-3);
            let wall = whole + Vec3::new(0.0, 0.4, 0.6);
            let jump = noise(wall + Vec3::X * 1e-4) - noise(wall - Vec3::X * 1e-4);
            assert!(jump.abs() < 1e-3, "{jump}");
            sum += value;
        }
        assert!(sum.abs() / 1000.0 < 0.05, "{sum}");
    }

    /// In a cell whose corners are known, by hand: the value half way along an edge depends on two gradients.
    #[test]
    fn noise_by_hand() {
        // Corner (0, 0, 0) has the hash P[P[P[0]]] = P[P[151]] = P[17] = 10 modulo 16: gradient (0, 1, -1).
        // Corner (1, 0, 0) has P[P[P[1]]] = P[P[160]] = P[223] modulo 16.
        let hash =
            |x: usize| PERMUTATION[usize::from(PERMUTATION[usize::from(PERMUTATION[x])])] % 16;
        let along_x = |hash: u8, dx: f32| match hash {
            0 | 2 | 4 | 6 | 12 => dx,
            1 | 3 | 5 | 7 | 13 => -dx,
            _ => 0.0,
        };
        let expected = 0.5 * along_x(hash(0), 0.5) + 0.5 * along_x(hash(1), -0.5);
        assert_eq!(noise(Vec3::new(0.5, 0.0, 0.0)), expected);
    }

    #[test]
    fn wide_footprints_have_no_octaves() {
        let octaves = Octaves {
            count: 8,
            roughness: 0.5,
        };
        let at = |step: f32| Footprint {
            point: Vec3::new(0.3, 1.7, 2.2),
            steps: [Vec3::X * step, Vec3::ZERO],
        };
        assert_eq!(at(10.0).octaves(8), (0, 0.0));
        assert_eq!(at(0.0).octaves(8), (8, 0.0));
        assert_eq!(fbm(&at(10.0), octaves), 0.0);
        // The mean of all octaves: 0.2 (1 + 1 + 1/2 + ...), for pbrt counts the first one twice.
        let mean = turbulence(&at(10.0), octaves);
        assert!(
            (mean - 0.2 * (1.0 + 2.0 * (1.0 - 0.5f32.powi(8)))).abs() < 1e-6,
            "{mean}"
        );
        assert!(fbm(&at(1e-4), octaves) != fbm(&at(0.2), octaves));
    }

    #[test]
    fn marble_keeps_to_its_colours() {
        for index in 0..2000 {
            let point = Vec3::new(0.1, 0.01, 0.07) * index as f32;
            let at = Footprint {
                point,
                steps: [Vec3::ZERO; 2],
            };
            let octaves = Octaves {
                count: 8,
                roughness: 0.5,
            };
            let color = marble(&at, octaves, 0.2);
            assert!(
                color.min_element() > 0.29 && color.max_element() < 0.91,
                "{color}"
            );
        }
    }

    #[test]
    fn squares_have_one_dot_or_none() {
        let mut dots = 0;
        for square in 0..400 {
            let corner = Vec2::new((square % 20) as f32, (square / 20) as f32) - 0.5;
            let inside = (0..10_000).filter(|point| {
                let place = Vec2::new((point % 100) as f32, (point / 100) as f32);
                is_in_dot(corner + (place + 0.5) / 100.0)
            });
            // The area of a circle, which is wholly within its square.
            match inside.count() {
                0 => {}
                count => {
                    assert!((count as f64 / 1e4 - 0.35 * 0.35 * std::f64::consts::PI).abs() < 2e-3);
                    dots += 1;
                }
            }
        }
        assert!((100..250).contains(&dots), "{dots}");
    }
}
