//! Instruction sets: their names, their detection, and how generic code runs on one of them.

use core::fmt;

use crate::arch;
use crate::lanes::Lanes;
use crate::named_list;

named_list! {
    /// An instruction set that the kernel can use.
    #[derive(PartialOrd, Ord)]
    pub enum Level("level"): () {
        Scalar = "scalar", "Plain Rust, on every CPU: the reference for the other levels", None, ();
        Avx2 = "avx2", "x86-64 with AVX2, FMA, BMI1 and BMI2: 8 lanes", None, ();
        Avx512 = "avx512", "x86-64 with AVX-512 F, VL, BW and DQ: 16 lanes", None, ();
        Neon = "neon", "AArch64 Advanced SIMD: 4 lanes", None, ();
        Simd128 = "simd128", "WebAssembly SIMD: 4 lanes, in programs compiled with `simd128`", None, ();
    }
}

/// Whether the CPU has all these features of x86-64. Only the standard library queries the CPU; without it, whether the program
/// was compiled for them.
#[cfg(target_arch = "x86_64")]
macro_rules! has {
    ($($feature:tt),*) => {{
        #[cfg(feature = "std")]
        let all = [$(std::arch::is_x86_feature_detected!($feature)),*];
        #[cfg(not(feature = "std"))]
        let all = [$(cfg!(target_feature = $feature)),*];
        !all.contains(&false)
    }};
}

impl Level {
    /// Returns true if this CPU and its operating system can run the level.
    pub fn is_available(self) -> bool {
        match self {
            Self::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => has!("avx2", "fma", "bmi1", "bmi2", "lzcnt", "popcnt"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.is_available() && has!("avx512f", "avx512vl", "avx512bw", "avx512dq")
            }
            #[cfg(target_arch = "aarch64")]
            Self::Neon => true,
            // A program with instructions that the engine lacks is not even loaded.
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Simd128 => true,
            #[allow(
                unreachable_patterns,
                reason = "which levels are left depends on the target"
            )]
            _ => false,
        }
    }

    /// Levels that this CPU has, from narrow to wide. [`Level::Scalar`] is always among them.
    pub fn available() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|level| level.is_available())
    }
}

/// Error for a level that this CPU lacks; holds the level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unavailable(pub Level);

impl fmt::Display for Unavailable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "this CPU cannot run level `{}`; it has", self.0)?;
        Level::available().try_for_each(|level| write!(f, " {level}"))
    }
}

impl core::error::Error for Unavailable {}

/// An instruction set that this CPU is known to have: a checked [`Level`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Isa(Level);

impl Isa {
    /// Checks that the CPU has `level`.
    ///
    /// # Errors
    /// [`Unavailable`] if this CPU lacks the level.
    pub fn new(level: Level) -> Result<Self, Unavailable> {
        if level.is_available() {
            Ok(Self(level))
        } else {
            Err(Unavailable(level))
        }
    }

    /// Widest level that this CPU has.
    pub fn best() -> Self {
        Self(Level::available().last().unwrap_or(Level::Scalar))
    }

    /// Every level that this CPU has, from narrow to wide.
    pub fn available() -> impl Iterator<Item = Self> {
        Level::available().map(Self)
    }

    /// The instruction set of a token, which proves that the CPU has it.
    #[inline(always)]
    pub fn of<S: Simd>(_: S) -> Self {
        Self(S::LEVEL)
    }

    /// The level that was checked.
    pub fn level(self) -> Level {
        self.0
    }
}

/// Token of an instruction set: a zero-sized value whose existence proves that the CPU has the instructions.
pub trait Simd: Copy + Send + Sync + 'static + Width<4> + Width<8> + Width<16> {
    /// Level that the token stands for.
    const LEVEL: Level;

    /// Floats in a register; 0 where there are no vectors.
    const LANES: usize;

    /// Runs code on the level of the token.
    fn run<const N: usize, Op: WithSimd<N>>(self, op: Op) -> Op::Output
    where
        Self: Width<N>;

    /// Keeps, of the first `count` words, the words whose upper half is at most `limit`, and returns their number.
    ///
    /// Kept words are written to the front of `out` in their order. The rest of `out` is unspecified.
    /// Callers guarantee that `count` is at most 8 and that upper halves and `limit` are below 2³¹.
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

    /// Transposes 16 rows into 8 columns: lane `i` of vector `j` is `rows[i][j]`.
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

    /// Transposes 8 rows into 8 columns: lane `i` of vector `j` is `rows[i][j]`.
    #[inline(always)]
    fn transpose(self, rows: &[[f32; 8]; 8]) -> [<Self as Width<8>>::Lanes; 8] {
        let mut columns = [[0.0; 8]; 8];
        for (lane, row) in rows.iter().enumerate() {
            for (column, &value) in columns.iter_mut().zip(row) {
                column[lane] = value;
            }
        }
        let mut lanes = [<Self as Width<8>>::Lanes::splat(self, 0.0); 8];
        for (lanes, column) in lanes.iter_mut().zip(&columns) {
            *lanes = <Self as Width<8>>::Lanes::load(self, column);
        }
        lanes
    }

    /// Prefetches every cache line of a value. Does nothing on CPUs without a prefetch instruction.
    #[inline(always)]
    fn prefetch<T>(self, value: &T) {
        arch::prefetch::<T>(value);
    }

    /// Prefetches the cache lines of a `T` at any address, valid or not. The memory is never read.
    #[inline(always)]
    fn prefetch_at<T>(self, place: *const T) {
        arch::prefetch(place);
    }
}

/// Vectors of `N` floats that a token gives access to.
pub trait Width<const N: usize>: Copy {
    /// Vector type.
    type Lanes: Lanes<N, Token = Self>;
}

/// Code that is generic over the instruction set and uses vectors of `N` lanes.
pub trait WithSimd<const N: usize> {
    /// Type of the result.
    type Output;
    /// Runs the code on the level of the token.
    ///
    /// Mark the function, and every hot function it calls, `#[inline(always)]`. Only code that is inlined into the
    /// dispatcher is compiled for the level. Closures are not.
    fn with_simd<S: Simd + Width<N>>(self, simd: S) -> Self::Output;
}

/// Runs [`WithSimd`] code of one width; implemented by [`Isa`] for the widths 4, 8 and 16.
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
            Level::Avx2 => $wrap(unsafe { arch::avx2::run::<$n, Op>($op) }),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: an `Isa` is only made for a level that `is_available`.
            Level::Avx512 => $wrap(unsafe { arch::avx512::run::<$n, Op>($op) }),
            #[cfg(target_arch = "aarch64")]
            // SAFETY: an `Isa` is only made for a level that `is_available`.
            Level::Neon => $wrap(unsafe { arch::neon::run::<$n, Op>($op) }),
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Level::Simd128 => $wrap($op.with_simd(arch::simd128::TOKEN)),
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
                dispatch!(@ $n, self.0, op, Some, else {
                    // Not run, and on CPUs without vectors not even named above.
                    let _ = op;
                    None
                })
            }
        }
    };
}
dispatch!(4);
dispatch!(8);
dispatch!(16);
