//! SSE4.1: 4 lanes.

use core::arch::x86_64::*;

use super::pair::Pair;
use crate::level::{Level, Simd, Width, WithSimd};

/// Token of [`Level::Sse41`].
#[derive(Clone, Copy)]
pub struct Sse41(());

impl Simd for Sse41 {
    const LEVEL: Level = Level::Sse41;
}

impl Width<4> for Sse41 {
    type Lanes = F32x4;
}

impl Width<8> for Sse41 {
    type Lanes = Pair<F32x4>;
}

impl Width<16> for Sse41 {
    type Lanes = Pair<Pair<F32x4>>;
}

/// Runs `op` compiled for SSE4.1.
///
/// # Safety
/// The CPU must have SSE4.1.
#[target_feature(enable = "sse4.1")]
pub unsafe fn run<const N: usize, Op: WithSimd<N>>(op: Op) -> Op::Output
where
    Sse41: Width<N>,
{
    op.with_simd(Sse41(()))
}

x86_xmm_lanes!(Sse41, |a, b, c| _mm_sub_ps(_mm_mul_ps(a, b), c));
