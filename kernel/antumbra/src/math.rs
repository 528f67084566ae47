//! Roots and powers: `core` has none, and the mathematical library of a system rounds powers as it likes, so that trees would
//! differ between systems.

/// Square root, rounded correctly: the same bits everywhere.
#[cfg(feature = "std")]
#[inline(always)]
pub(crate) fn sqrt(x: f64) -> f64 {
    x.sqrt()
}

/// Square root, rounded correctly: the same bits everywhere.
#[cfg(not(feature = "std"))]
pub(crate) fn sqrt(x: f64) -> f64 {
    libm::sqrt(x)
}

/// [`sqrt`] in single precision. A root in double precision, rounded once more, is rounded correctly.
#[inline(always)]
pub(crate) fn sqrt_f32(x: f32) -> f32 {
    sqrt(f64::from(x)) as f32
}

/// `x` to the power of `y`.
pub(crate) fn powf(x: f32, y: f32) -> f32 {
    libm::powf(x, y)
}
