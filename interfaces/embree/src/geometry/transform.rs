//! Transforms of instances in the formats of Embree.

use std::ffi::c_void;

use crate::abi::format;
use crate::device::{Failure, Outcome};

/// Three rows of an affine matrix, translation last.
pub type Rows = [[f32; 4]; 3];

pub const IDENTITY: Rows = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
];

/// Distances between rows and between columns of a matrix in one of the formats.
fn strides(which: u32) -> Option<[usize; 2]> {
    Some(match which {
        format::FLOAT3X4_ROW_MAJOR | format::FLOAT4X4_ROW_MAJOR => [4, 1],
        format::FLOAT3X4_COLUMN_MAJOR => [1, 3],
        format::FLOAT4X4_COLUMN_MAJOR => [1, 4],
        _ => return None,
    })
}

/// From numbers in one of the formats, which has as many.
pub fn from_numbers(which: u32, numbers: &[f32]) -> Outcome<Rows> {
    let at = |place: usize| numbers[place];
    match strides(which) {
        Some([rows, columns]) => Ok(std::array::from_fn(|row| {
            std::array::from_fn(|column| at(row * rows + column * columns))
        })),
        None if which == format::QUATERNION => Ok(from_quaternion(std::array::from_fn(at))),
        None => Err(unknown(which)),
    }
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
pub unsafe fn write(matrix: &Rows, which: u32, memory: *mut c_void) -> Outcome {
    if memory.is_null() {
        return Err(Failure::argument("a transform is null"));
    }
    let [rows, columns] = strides(which).ok_or_else(|| unknown(which))?;
    let count = format::size(which).unwrap_or(0) / 4;
    for (place, number) in self::columns(matrix).into_iter().enumerate() {
        let (row, column) = (place % 4, place / 4);
        if row < count / 4 {
            let place = (memory.cast::<f32>()).wrapping_add(row * rows + column * columns);
            // SAFETY: the caller vouches for the room.
            unsafe { place.write_unaligned(number) };
        }
    }
    Ok(())
}

fn unknown(which: u32) -> Failure {
    Failure::operation(format!("{which:#x} is no format of a transform"))
}

/// Translation after rotation after scale, skew and shift, as Embree documents them.
///
/// The numbers are scale, skew (xy, xz, yz), shift, rotation (real part first) and translation.
fn from_quaternion(numbers: [f32; 16]) -> Rows {
    let [sx, sy, sz, xy, xz, yz, x, y, z, r, i, j, k, tx, ty, tz] = numbers.map(f64::from);
    let inner = [[sx, xy, xz, x], [0.0, sy, yz, y], [0.0, 0.0, sz, z]];
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
            let moved = if column == 3 { [tx, ty, tz][row] } else { 0.0 };
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
