//! Transforms of instances in the formats of Embree.

use std::ffi::c_void;

use crate::abi::{Quaternion, format};
use crate::failure::{Failure, Outcome};

/// Three rows of an affine matrix, translation last.
pub type Rows = [[f32; 4]; 3];

pub const IDENTITY: Rows = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
];

/// From numbers in one of the formats, which has as many.
pub fn from_numbers(which: u32, numbers: &[f32]) -> Outcome<Rows> {
    Ok(match which {
        format::FLOAT3X4_ROW_MAJOR | format::FLOAT4X4_ROW_MAJOR => {
            std::array::from_fn(|row| std::array::from_fn(|column| numbers[4 * row + column]))
        }
        format::FLOAT3X4_COLUMN_MAJOR => {
            std::array::from_fn(|row| std::array::from_fn(|column| numbers[3 * column + row]))
        }
        format::FLOAT4X4_COLUMN_MAJOR => {
            std::array::from_fn(|row| std::array::from_fn(|column| numbers[4 * column + row]))
        }
        format::QUATERNION => from_quaternion(&Quaternion {
            scale: [numbers[0], numbers[1], numbers[2]],
            skew: [numbers[3], numbers[4], numbers[5]],
            shift: [numbers[6], numbers[7], numbers[8]],
            rotation: [numbers[9], numbers[10], numbers[11], numbers[12]],
            translation: [numbers[13], numbers[14], numbers[15]],
        }),
        _ => return Err(unknown(which)),
    })
}

/// From memory of the client.
///
/// # Safety
/// The memory holds a transform in this format.
pub unsafe fn read(which: u32, memory: *const c_void) -> Outcome<Rows> {
    let count = format::size(which).filter(|_| which >= format::FLOAT3X4_ROW_MAJOR);
    let count = count.ok_or_else(|| unknown(which))? / 4;
    if memory.is_null() {
        return Err(Failure::argument("a transform is null"));
    }
    let place = memory.cast::<f32>();
    // SAFETY: the caller vouches for so many numbers.
    let read = |index: usize| unsafe { place.wrapping_add(index).read_unaligned() };
    let numbers: Vec<f32> = (0..count).map(read).collect();
    from_numbers(which, &numbers)
}

/// Writes a transform to memory of the client.
///
/// # Safety
/// The memory has room for the format.
pub unsafe fn write(rows: &Rows, which: u32, memory: *mut c_void) -> Outcome {
    if memory.is_null() {
        return Err(Failure::argument("a transform is null"));
    }
    let last = [0.0, 0.0, 0.0, 1.0];
    let at = |row: usize, column: usize| rows.get(row).map_or(last[column], |row| row[column]);
    let numbers: Vec<f32> = match which {
        format::FLOAT3X4_ROW_MAJOR => (0..12).map(|n| at(n / 4, n % 4)).collect(),
        format::FLOAT4X4_ROW_MAJOR => (0..16).map(|n| at(n / 4, n % 4)).collect(),
        format::FLOAT3X4_COLUMN_MAJOR => (0..12).map(|n| at(n % 3, n / 3)).collect(),
        format::FLOAT4X4_COLUMN_MAJOR => (0..16).map(|n| at(n % 4, n / 4)).collect(),
        _ => return Err(unknown(which)),
    };
    for (index, number) in numbers.into_iter().enumerate() {
        let place = memory.cast::<f32>().wrapping_add(index);
        // SAFETY: the caller vouches for the room.
        unsafe { place.write_unaligned(number) };
    }
    Ok(())
}

fn unknown(which: u32) -> Failure {
    Failure::operation(format!("{which:#x} is no format of a transform"))
}

/// Translation after rotation after scale, skew and shift, as Embree documents them.
fn from_quaternion(parts: &Quaternion) -> Rows {
    let [sx, sy, sz] = parts.scale.map(f64::from);
    let [xy, xz, yz] = parts.skew.map(f64::from);
    let [x, y, z] = parts.shift.map(f64::from);
    let inner = [[sx, xy, xz, x], [0.0, sy, yz, y], [0.0, 0.0, sz, z]];
    let [r, i, j, k] = parts.rotation.map(f64::from);
    let rotation = [
        [
            r * r + i * i - j * j - k * k,
            2.0 * (i * j - r * k),
            2.0 * (i * k + r * j),
        ],
        [
            2.0 * (i * j + r * k),
            r * r - i * i + j * j - k * k,
            2.0 * (j * k - r * i),
        ],
        [
            2.0 * (i * k - r * j),
            2.0 * (j * k + r * i),
            r * r - i * i - j * j + k * k,
        ],
    ];
    std::array::from_fn(|row| {
        std::array::from_fn(|column| {
            let turned: f64 = (0..3).map(|n| rotation[row][n] * inner[n][column]).sum();
            let moved = if column == 3 {
                f64::from(parts.translation[row])
            } else {
                0.0
            };
            (turned + moved) as f32
        })
    })
}

/// The inverse, or `None` of a matrix that has none.
pub fn inverse(rows: &Rows) -> Option<Rows> {
    let m = rows.map(|row| row.map(f64::from));
    let cross = |a: usize, b: usize| {
        [
            m[a][1] * m[b][2] - m[a][2] * m[b][1],
            m[a][2] * m[b][0] - m[a][0] * m[b][2],
            m[a][0] * m[b][1] - m[a][1] * m[b][0],
        ]
    };
    let cofactors = [cross(1, 2), cross(2, 0), cross(0, 1)];
    let determinant: f64 = (0..3).map(|axis| m[0][axis] * cofactors[0][axis]).sum();
    if !(determinant.abs() > 0.0) {
        return None;
    }
    Some(std::array::from_fn(|row| {
        let linear: [f64; 3] = std::array::from_fn(|column| cofactors[column][row] / determinant);
        let moved: f64 = -(0..3).map(|n| linear[n] * m[n][3]).sum::<f64>();
        [
            linear[0] as f32,
            linear[1] as f32,
            linear[2] as f32,
            moved as f32,
        ]
    }))
}

/// A vector, or with `w` = 1 a point, through a transform.
pub fn apply(rows: &Rows, [x, y, z]: [f32; 3], w: f32) -> [f32; 3] {
    rows.map(|[a, b, c, d]| a * x + b * y + c * z + d * w)
}

/// A matrix of 4 × 4 in columns.
pub fn columns(rows: &Rows) -> [f32; 16] {
    std::array::from_fn(|n| {
        let (row, column) = (n % 4, n / 4);
        match rows.get(row) {
            Some(row) => row[column],
            None => f32::from(column == 3),
        }
    })
}

/// Scale of a similarity, and 0 of other transforms.
pub fn similarity(rows: &Rows) -> f32 {
    let column = |n: usize| rows.map(|row| f64::from(row[n]));
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let [x, y, z] = [0, 1, 2].map(column);
    let square = dot(x, x);
    let is_near = |a: f64, b: f64| (a - b).abs() <= 1e-5 * square;
    let is_similarity = is_near(dot(y, y), square)
        && is_near(dot(z, z), square)
        && is_near(dot(x, y), 0.0)
        && is_near(dot(x, z), 0.0)
        && is_near(dot(y, z), 0.0);
    if is_similarity {
        square.sqrt() as f32
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quarter of a turn around z, twice as large, moved.
    #[test]
    fn formats_say_the_same() {
        let rows = [
            [0.0, -2.0, 0.0, 5.0],
            [2.0, 0.0, 0.0, 6.0],
            [0.0, 0.0, 2.0, 7.0],
        ];
        let half = 0.5f32.sqrt();
        let quaternion = [
            2.0, 2.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, half, 0.0, 0.0, half, 5.0, 6.0, 7.0,
        ];
        let turned = from_numbers(format::QUATERNION, &quaternion).expect("a format");
        for (row, expected) in turned.iter().zip(&rows) {
            for (number, expected) in row.iter().zip(expected) {
                assert!((number - expected).abs() < 1e-6, "{turned:?}");
            }
        }
        for which in [
            format::FLOAT3X4_ROW_MAJOR,
            format::FLOAT4X4_ROW_MAJOR,
            format::FLOAT3X4_COLUMN_MAJOR,
            format::FLOAT4X4_COLUMN_MAJOR,
        ] {
            let mut memory = [0.0f32; 16];
            // SAFETY: room for 16 numbers.
            let back = unsafe {
                write(&rows, which, memory.as_mut_ptr().cast()).expect("a format");
                read(which, memory.as_ptr().cast()).expect("a format")
            };
            assert_eq!(back, rows);
        }
        assert_eq!(columns(&rows)[12..], [5.0, 6.0, 7.0, 1.0]);
        assert_eq!(similarity(&rows), 2.0);
        assert_eq!(similarity(&[[2.0, 0.0, 0.0, 0.0], rows[1], rows[2]]), 0.0);
        let inverse = inverse(&rows).expect("regular");
        assert_eq!(
            apply(&inverse, apply(&rows, [1.0, 2.0, 3.0], 1.0), 1.0),
            [1.0, 2.0, 3.0]
        );
    }
}
