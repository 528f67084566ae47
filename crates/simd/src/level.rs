//! The instruction sets: names, detection, and running generic code on one of them.

use core::fmt;
use core::str::FromStr;

use crate::arch;
use crate::lanes::Lanes;

/// An instruction set that the kernel can use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Level {
    /// Plain Rust, on every CPU; the reference for the others.
    Scalar,
    /// x86-64 with SSE4.1: 4 lanes.
    Sse41,
    /// x86-64 with AVX2, FMA, BMI1 and BMI2: 8 lanes.
    Avx2,
    /// x86-64 with AVX-512 F, VL, BW and DQ: 16 lanes.
    Avx512,
    /// AArch64 Advanced SIMD: 4 lanes.
    Neon,
}

impl Level {
    /// Every level there is, on this CPU or not, narrow ones first.
    pub const ALL: [Self; 5] = [
        Self::Scalar,
        Self::Sse41,
        Self::Avx2,
        Self::Avx512,
        Self::Neon,
    ];

    /// The name used on the command line and in results.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Sse41 => "sse41",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
            Self::Neon => "neon",
        }
    }

    /// Whether this CPU (and its operating system) can run the level.
    pub fn is_available(self) -> bool {
        match self {
            Self::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Self::Sse41 => std::arch::is_x86_feature_detected!("sse4.1"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => {
                std::arch::is_x86_feature_detected!("avx2")
                    && std::arch::is_x86_feature_detected!("fma")
                    && std::arch::is_x86_feature_detected!("bmi1")
                    && std::arch::is_x86_feature_detected!("bmi2")
                    && std::arch::is_x86_feature_detected!("lzcnt")
                    && std::arch::is_x86_feature_detected!("popcnt")
            }
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.is_available()
                    && std::arch::is_x86_feature_detected!("avx512f")
                    && std::arch::is_x86_feature_detected!("avx512vl")
                    && std::arch::is_x86_feature_detected!("avx512bw")
                    && std::arch::is_x86_feature_detected!("avx512dq")
            }
            #[cfg(target_arch = "aarch64")]
            Self::Neon => true,
            #[allow(
                unreachable_patterns,
                reason = "which levels are left depends on the target"
            )]
            _ => false,
        }
    }

    /// The levels this CPU has, narrow ones first; never empty.
    pub fn available() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|level| level.is_available())
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A name that no [`Level`] has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownLevel(pub String);

impl fmt::Display for UnknownLevel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "unknown level `{}`; known are", self.0)?;
        Level::ALL
            .iter()
            .try_for_each(|level| write!(f, " {level}"))
    }
}

impl std::error::Error for UnknownLevel {}

impl FromStr for Level {
    type Err = UnknownLevel;

    fn from_str(name: &str) -> Result<Self, UnknownLevel> {
        Self::ALL
            .into_iter()
            .find(|level| level.name() == name)
            .ok_or_else(|| UnknownLevel(name.to_owned()))
    }
}

/// A level that this CPU lacks was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unavailable(pub Level);

impl fmt::Display for Unavailable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "this CPU cannot run level `{}`; it has", self.0)?;
        Level::available().try_for_each(|level| write!(f, " {level}"))
    }
}

impl std::error::Error for Unavailable {}

/// A level that this CPU is known to have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Isa(Level);

impl Isa {
    /// Checks that the CPU has `level`.
    pub fn new(level: Level) -> Result<Self, Unavailable> {
        if level.is_available() {
            Ok(Self(level))
        } else {
            Err(Unavailable(level))
        }
    }

    /// The widest level this CPU has.
    pub fn best() -> Self {
        Self(Level::available().last().unwrap_or(Level::Scalar))
    }

    /// Every level this CPU has, narrow ones first.
    pub fn available() -> impl Iterator<Item = Self> {
        Level::available().map(Self)
    }

    /// Which level it is.
    pub fn level(self) -> Level {
        self.0
    }
}

/// A token: a zero-sized value whose existence proves that the CPU has an instruction set.
pub trait Simd: Copy + Send + Sync + 'static + Width<4> + Width<8> + Width<16> {
    /// The level the token stands for.
    const LEVEL: Level;

    /// Writes those of the first `count` words whose upper half is at most `limit` to the front of `out` and
    /// returns how many there are. Upper halves and limit are below 2³¹. The rest of `out` is left with
    /// unspecified values.
    #[inline(always)]
    fn compress_within(
        self,
        words: &[u64; 8],
        limit: u32,
        count: usize,
        out: &mut [u64; 8],
    ) -> usize {
        let mut kept = 0;
        for &word in &words[..count] {
            out[kept] = word;
            kept += usize::from((word >> 32) as u32 <= limit);
        }
        kept
    }

    /// The columns of 16 rows: lane `i` of vector `j` is `rows[i][j]`.
    #[inline(always)]
    fn columns(self, rows: &[[f32; 8]; 16]) -> [<Self as Width<16>>::Lanes; 8] {
        let mut columns = [[0.0; 16]; 8];
        for (lane, row) in rows.iter().enumerate() {
            for (column, &value) in columns.iter_mut().zip(row) {
                column[lane] = value;
            }
        }
        let mut lanes = [<Self as Width<16>>::Lanes::splat(self, 0.0); 8];
        for (lanes, column) in lanes.iter_mut().zip(&columns) {
            *lanes = <Self as Width<16>>::Lanes::load(self, column);
        }
        lanes
    }

    /// Asks for a value to be brought into the cache, all lines of it. Does nothing where there is no
    /// instruction for that.
    #[inline(always)]
    fn prefetch<T>(self, value: &T) {
        arch::prefetch::<T>(value);
    }

    /// The same for a place where there may be a value or not: any address will do, and none is looked at.
    #[inline(always)]
    fn prefetch_at<T>(self, place: *const T) {
        arch::prefetch(place);
    }
}

/// The vector of `N` floats that a token gives access to.
pub trait Width<const N: usize>: Copy {
    /// The vector type.
    type Lanes: Lanes<N, Token = Self>;
}

/// Code generic over the instruction set, with vectors of `N` lanes besides those every level has.
pub trait WithSimd<const N: usize> {
    /// What it returns.
    type Output;
    /// The code. Mark it, and everything hot that it calls, `#[inline(always)]`: only what is inlined
    /// into the dispatcher is compiled for the level. Closures are not.
    fn with_simd<S: Simd + Width<N>>(self, simd: S) -> Self::Output;
}

/// Running [`WithSimd`] code for a width; implemented by [`Isa`] for 4, 8 and 16.
pub trait Dispatch<const N: usize> {
    /// Runs `op` on the level of `self`.
    fn dispatch<Op: WithSimd<N>>(self, op: Op) -> Op::Output;

    /// Runs `op` on the level of `self`, unless that is [`Level::Scalar`], for which `op` is not even compiled: for code
    /// that only pays with vectors.
    fn dispatch_vectors<Op: WithSimd<N>>(self, op: Op) -> Option<Op::Output>;
}

macro_rules! dispatch {
    // Runs `op` on a level with vectors and wraps what it returns; `else` for the scalar level.
    (@ $n:literal, $level:expr, $op:ident, $wrap:expr, else $scalar:expr) => {
        match $level {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: an `Isa` is only made for a level that `is_available`.
            Level::Sse41 => $wrap(unsafe { arch::sse41::run::<$n, Op>($op) }),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: an `Isa` is only made for a level that `is_available`.
            Level::Avx2 => $wrap(unsafe { arch::avx2::run::<$n, Op>($op) }),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: an `Isa` is only made for a level that `is_available`.
            Level::Avx512 => $wrap(unsafe { arch::avx512::run::<$n, Op>($op) }),
            #[cfg(target_arch = "aarch64")]
            // SAFETY: an `Isa` is only made for a level that `is_available`.
            Level::Neon => $wrap(unsafe { arch::neon::run::<$n, Op>($op) }),
            _ => $scalar,
        }
    };
    ($n:literal) => {
        impl Dispatch<$n> for Isa {
            #[inline]
            fn dispatch<Op: WithSimd<$n>>(self, op: Op) -> Op::Output {
                let scalar = arch::scalar::Scalar;
                dispatch!(@ $n, self.0, op, core::convert::identity, else op.with_simd(scalar))
            }

            #[inline]
            fn dispatch_vectors<Op: WithSimd<$n>>(self, op: Op) -> Option<Op::Output> {
                dispatch!(@ $n, self.0, op, Some, else None)
            }
        }
    };
}
dispatch!(4);
dispatch!(8);
dispatch!(16);
