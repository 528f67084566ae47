//! Every operation on every level that this CPU has, compared lane by lane with plain Rust.
//!
//! Inputs come from a table of floats in which every pair of special values (zeros, NaNs, infinities) meets.

use antumbra_simd::{Dispatch, Doubles, Isa, Lanes, Level, Mask, Simd, Width, WithSimd};

const NASTY: [f32; 20] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    1.5,
    -2.75,
    1e-20,
    3.0e38,
    -3.0e38,
    f32::MAX,
    f32::MIN,
    f32::MIN_POSITIVE,
    1.0e-45,
    -1.0e-45,
    2.0e-39,
    f32::EPSILON,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
    16_777_217.0,
];

/// Results of all operations for one pair of vectors.
#[derive(Debug)]
struct Results<const N: usize> {
    floats: Vec<(&'static str, [f32; N])>,
    mul_sub: [f32; N],
    masks: Vec<(&'static str, u32, bool)>,
    compressed: Vec<(u32, Vec<u32>)>,
}

/// Every operation in double precision, so that each decides some of the result's bits.
fn doubles<const N: usize, V: Lanes<N>>(a: V, b: V, c: V) -> V {
    let [a, b, c] = [a.widen(), b.widen(), c.widen()];
    let difference = (a * b - b * c).times(1e-30);
    V::narrow((difference.min(a) + difference.max(c)) / (c - a))
}

struct AllOps<'a, const N: usize>(&'a [f32; N], &'a [f32; N], &'a [f32; N]);

impl<const N: usize> WithSimd<N> for AllOps<'_, N> {
    type Output = (Level, Results<N>);

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) -> Self::Output {
        type L<S, const N: usize> = <S as Width<N>>::Lanes;
        let a = L::<S, N>::load(simd, self.0);
        let b = L::<S, N>::load(simd, self.1);
        let c = L::<S, N>::load(simd, self.2);
        let store = |lanes: L<S, N>| {
            let mut out = [0.0; N];
            lanes.store(&mut out);
            out
        };
        let rows = [self.0, self.1, self.2].map(|row| [row[0], row[1], row[2], row[3]]);
        let [_, [_, splat, _], _] = L::<S, N>::splat_rows(simd, &rows);
        let floats = vec![
            ("splat_rows", store(splat)),
            ("splat", store(L::<S, N>::splat(simd, self.0[0]))),
            ("load", store(a)),
            ("add", store(a + b)),
            ("sub", store(a - b)),
            ("mul", store(a * b)),
            ("div", store(a / b)),
            ("min", store(a.min(b))),
            ("max", store(a.max(b))),
            (
                "max_size",
                without_nans(store(a.max_size(b)), self.0, self.1),
            ),
            ("copysign", store(a.copysign(b))),
            ("flip_sign", store(a.flip_sign(b))),
            ("select", store(L::<S, N>::select(a.lt(b), b, c))),
            ("narrow", store(L::<S, N>::narrow(a.widen()))),
            ("doubles", store(doubles::<N, L<S, N>>(a, b, c))),
        ];
        let masks = [
            ("lt", a.lt(b)),
            ("le", a.le(b)),
            ("eq", a.eq(b)),
            ("not lt", !a.lt(b)),
            ("lt and le", a.lt(b) & b.le(c)),
            ("lt or eq", a.lt(b) | a.eq(b)),
        ];
        let values = core::array::from_fn(|lane| 100 + lane as u32);
        let compressed = masks
            .iter()
            .map(|(_, mask)| {
                let mut out = [0; N];
                let count = mask.compress(&values, &mut out);
                (mask.bits(), out[..count].to_vec())
            })
            .collect();
        let masks = masks
            .iter()
            .map(|(name, mask)| (*name, mask.bits(), mask.any()))
            .collect();
        (
            S::LEVEL,
            Results {
                floats,
                mul_sub: store(a.mul_sub(b, c)),
                masks,
                compressed,
            },
        )
    }
}

/// Returns true for equal bits or two NaNs, whose payloads are unspecified.
fn same(a: f32, b: f32) -> bool {
    a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()
}

/// `values`, with 0 where `a` or `b` is NaN.
fn without_nans<const N: usize>(values: [f32; N], a: &[f32; N], b: &[f32; N]) -> [f32; N] {
    core::array::from_fn(|i| {
        if a[i].is_nan() || b[i].is_nan() {
            0.0
        } else {
            values[i]
        }
    })
}

fn expected<const N: usize>(a: &[f32; N], b: &[f32; N], c: &[f32; N]) -> Results<N> {
    let zip = |f: fn(f32, f32) -> f32| core::array::from_fn(|i| f(a[i], b[i]));
    let bits = |f: &dyn Fn(usize) -> bool| (0..N).map(|i| u32::from(f(i)) << i).sum::<u32>();
    let masks = [
        ("lt", bits(&|i| a[i] < b[i])),
        ("le", bits(&|i| a[i] <= b[i])),
        ("eq", bits(&|i| a[i] == b[i])),
        (
            "not lt",
            bits(&|i| !matches!(a[i].partial_cmp(&b[i]), Some(core::cmp::Ordering::Less))),
        ),
        ("lt and le", bits(&|i| a[i] < b[i] && b[i] <= c[i])),
        ("lt or eq", bits(&|i| a[i] <= b[i])),
    ];
    Results {
        floats: vec![
            ("splat_rows", [b[1]; N]),
            ("splat", [a[0]; N]),
            ("load", *a),
            ("add", zip(|a, b| a + b)),
            ("sub", zip(|a, b| a - b)),
            ("mul", zip(|a, b| a * b)),
            ("div", zip(|a, b| a / b)),
            ("min", zip(|a, b| if a < b { a } else { b })),
            ("max", zip(|a, b| if a > b { a } else { b })),
            (
                "max_size",
                without_nans(zip(|a, b| a.abs().max(b.abs())), a, b),
            ),
            ("copysign", zip(f32::copysign)),
            (
                "flip_sign",
                zip(|a, b| if b.is_sign_negative() { -a } else { a }),
            ),
            (
                "select",
                core::array::from_fn(|i| if a[i] < b[i] { b[i] } else { c[i] }),
            ),
            ("narrow", *a),
            (
                "doubles",
                core::array::from_fn(|i| {
                    let [a, b, c] = [a[i], b[i], c[i]].map(f64::from);
                    let difference = (a * b - b * c) * 1e-30;
                    let less = if difference < a { difference } else { a };
                    let more = if difference > c { difference } else { c };
                    ((less + more) / (c - a)) as f32
                }),
            ),
        ],
        mul_sub: core::array::from_fn(|i| a[i] * b[i] - c[i]),
        masks: masks
            .iter()
            .map(|(name, bits)| (*name, *bits, *bits != 0))
            .collect(),
        compressed: masks
            .iter()
            .map(|&(_, bits)| {
                (
                    bits,
                    (0..N as u32)
                        .filter(|i| bits >> i & 1 == 1)
                        .map(|i| 100 + i)
                        .collect(),
                )
            })
            .collect(),
    }
}

fn check<const N: usize>(isa: Isa)
where
    Isa: Dispatch<N>,
{
    let mut checked = 0;
    for shift_b in 0..NASTY.len() {
        for shift_a in 0..NASTY.len() {
            let pick = |shift: usize| core::array::from_fn(|i| NASTY[(i + shift) % NASTY.len()]);
            let (a, b, c) = (
                pick(shift_a),
                pick(shift_b),
                pick(shift_a * 7 + shift_b * 3 + 1),
            );
            let (level, found) = isa.dispatch(AllOps::<N>(&a, &b, &c));
            assert_eq!(level, isa.level());
            let wanted = expected(&a, &b, &c);
            for ((name, found), (_, wanted)) in found.floats.iter().zip(&wanted.floats) {
                for lane in 0..N {
                    assert!(
                        same(found[lane], wanted[lane]),
                        "{level} x{N} {name}({}, {}): {} instead of {}",
                        a[lane],
                        b[lane],
                        found[lane],
                        wanted[lane]
                    );
                }
            }
            for lane in 0..N {
                // Fused or not, as the level chooses; no other result is right.
                let fused = a[lane].mul_add(b[lane], -c[lane]);
                assert!(
                    same(found.mul_sub[lane], wanted.mul_sub[lane])
                        || same(found.mul_sub[lane], fused),
                    "{level} x{N} mul_sub({}, {}, {}): {}",
                    a[lane],
                    b[lane],
                    c[lane],
                    found.mul_sub[lane]
                );
            }
            assert_eq!(
                found.masks, wanted.masks,
                "{level} x{N} masks of {a:?} and {b:?}"
            );
            assert_eq!(found.compressed, wanted.compressed, "{level} x{N} compress");
            checked += N;
        }
    }
    println!("{} x{N}: {checked} lanes checked", isa.level());
}

#[test]
fn every_operation_on_every_level_equals_plain_rust() {
    for level in Level::ALL {
        match Isa::new(level) {
            Ok(isa) => {
                check::<4>(isa);
                check::<8>(isa);
                check::<16>(isa);
            }
            Err(reason) => println!("{level}: not run ({reason})"),
        }
    }
}

/// Compresses by masks that come from comparisons; every possible mask occurs.
struct Compress<'a, const N: usize>(u32, &'a [u32; N]);

impl<const N: usize> WithSimd<N> for Compress<'_, N> {
    type Output = (u32, Vec<u32>);

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) -> Self::Output {
        let truths: [f32; N] = core::array::from_fn(|lane| (self.0 >> lane & 1) as f32);
        let ones = <S as Width<N>>::Lanes::splat(simd, 1.0);
        let mask = <S as Width<N>>::Lanes::load(simd, &truths).eq(ones);
        let mut out = [u32::MAX; N];
        let count = mask.compress(self.1, &mut out);
        (mask.bits(), out[..count].to_vec())
    }
}

fn check_compress<const N: usize>(isa: Isa)
where
    Isa: Dispatch<N>,
{
    let values: [u32; N] = core::array::from_fn(|lane| 0xdead_0000 + lane as u32);
    // Miri is slow.
    let step = if cfg!(miri) && N == 16 { 251 } else { 1 };
    for mask in (0..1u32 << N).step_by(step) {
        let wanted: Vec<u32> = values
            .iter()
            .enumerate()
            .filter(|(lane, _)| mask >> lane & 1 == 1)
            .map(|(_, v)| *v)
            .collect();
        let found = isa.dispatch(Compress::<N>(mask, &values));
        assert_eq!(found, (mask, wanted), "{} x{N}", isa.level());
    }
}

#[test]
fn every_mask_compresses_on_every_level() {
    for isa in Isa::available() {
        check_compress::<4>(isa);
        check_compress::<8>(isa);
        check_compress::<16>(isa);
    }
}

/// Runs the operations on words, and sorting while compressing.
struct Words<'a, const N: usize> {
    words: &'a [u32; N],
    least: u32,
    mask: u32,
    distances: &'a [f32; N],
    entries: &'a [u64; 8],
    limit: u32,
    count: usize,
}

impl<const N: usize> WithSimd<N> for Words<'_, N> {
    type Output = (u32, Vec<u64>, Vec<u64>);

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) -> Self::Output {
        type L<S, const N: usize> = <S as Width<N>>::Lanes;
        let truths: [f32; N] = core::array::from_fn(|lane| (self.mask >> lane & 1) as f32);
        let mask = L::<S, N>::load(simd, &truths).eq(L::<S, N>::splat(simd, 1.0));
        let mut out = [u64::MAX; N];
        let distances = L::<S, N>::load(simd, self.distances);
        let count = distances.compress_sorted(mask, self.words, &mut out);
        let mut within = [u64::MAX; 8];
        let kept = simd.compress_within(self.entries, self.limit, self.count, &mut within);
        simd.prefetch(self.words);
        (
            L::<S, N>::words_at_least(simd, self.words, self.least).bits(),
            out[..count].to_vec(),
            within[..kept].to_vec(),
        )
    }
}

/// Runs the transposition of rows into columns.
struct Columns<'a>(&'a [[f32; 8]; 16]);

impl WithSimd<16> for Columns<'_> {
    type Output = [[f32; 16]; 8];

    #[inline(always)]
    fn with_simd<S: Simd + Width<16>>(self, simd: S) -> Self::Output {
        let mut columns = [[0.0; 16]; 8];
        for (column, lanes) in columns.iter_mut().zip(simd.columns(self.0)) {
            lanes.store(column);
        }
        columns
    }
}

/// Runs the transposition of eight rows.
struct Transposed<'a>(&'a [[f32; 8]; 8]);

impl WithSimd<8> for Transposed<'_> {
    type Output = [[f32; 8]; 8];

    #[inline(always)]
    fn with_simd<S: Simd + Width<8>>(self, simd: S) -> Self::Output {
        assert_eq!(Isa::of(simd).level(), S::LEVEL);
        let mut columns = [[0.0; 8]; 8];
        for (column, lanes) in columns.iter_mut().zip(simd.transpose(self.0)) {
            lanes.store(column);
        }
        columns
    }
}

#[test]
fn columns_hold_what_rows_hold() {
    let rows: [[f32; 8]; 16] =
        core::array::from_fn(|lane| core::array::from_fn(|column| (100 * lane + column) as f32));
    for isa in Isa::available() {
        let columns = isa.dispatch(Columns(&rows));
        for (column, lanes) in columns.iter().enumerate() {
            for (lane, &value) in lanes.iter().enumerate() {
                assert_eq!(value, rows[lane][column], "{}", isa.level());
            }
        }
        let (first, _) = rows.as_chunks::<8>();
        let columns = isa.dispatch(Transposed(&first[0]));
        for (column, lanes) in columns.iter().enumerate() {
            for (lane, &value) in lanes.iter().enumerate() {
                assert_eq!(value, rows[lane][column], "{}", isa.level());
            }
        }
    }
}

fn check_words<const N: usize>(isa: Isa)
where
    Isa: Dispatch<N>,
{
    let mut state = 2016u64;
    let mut random = |bound: u64| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) % bound
    };
    for round in 0..20_000 {
        // Few different values, so that ties occur.
        let words: [u32; N] = core::array::from_fn(|_| {
            [0, 1, 7, 1 << 30, 1 << 31, u32::MAX - 1, u32::MAX][random(7) as usize]
        });
        let distances: [f32; N] = core::array::from_fn(|_| {
            [-0.0, 0.0, -3.0, 1e-40, 0.5, 1.0, 2.0, f32::INFINITY][random(8) as usize]
        });
        let entries: [u64; 8] =
            core::array::from_fn(|_| random(5) << 32 | u64::from(u32::MAX - random(2) as u32));
        let count = random(9) as usize;
        let (least, limit) = (words[random(N as u64) as usize], random(6) as u32);
        // Few true lanes as well as many.
        let mask = (random(1 << N) & random(1 << N) & [u64::MAX, random(1 << N)][round % 2]) as u32;
        let bits = |f: &dyn Fn(usize) -> bool| (0..N).map(|i| u32::from(f(i)) << i).sum::<u32>();
        let mut sorted: Vec<u64> = (0..N)
            .filter(|lane| mask >> lane & 1 == 1)
            .map(|lane| {
                let distance = if distances[lane] > 0.0 {
                    distances[lane]
                } else {
                    0.0
                };
                u64::from(distance.to_bits()) << 32 | u64::from(words[lane])
            })
            .collect();
        sorted.sort_by_key(|pair| core::cmp::Reverse(pair >> 32));
        let wanted = (
            bits(&|i| words[i] >= least),
            sorted,
            entries[..count]
                .iter()
                .copied()
                .filter(|entry| entry >> 32 <= u64::from(limit))
                .collect(),
        );
        let found = isa.dispatch(Words::<N> {
            words: &words,
            least,
            mask,
            distances: &distances,
            entries: &entries,
            limit,
            count,
        });
        assert_eq!(found, wanted, "{} x{N} round {round}", isa.level());
    }
}

#[test]
fn words_are_compared_and_sorted_alike_on_every_level() {
    for isa in Isa::available() {
        check_words::<4>(isa);
        check_words::<8>(isa);
        check_words::<16>(isa);
    }
}

#[test]
fn names_read_back_and_unknown_ones_list_the_known() {
    for level in Level::ALL {
        assert_eq!(level.name().parse(), Ok(level));
    }
    let error = "avx3".parse::<Level>().expect_err("no such level");
    assert_eq!(
        error.to_string(),
        "unknown level `avx3`; known are scalar, avx2, avx512, neon, simd128"
    );
}

#[test]
fn a_level_the_cpu_lacks_is_refused() {
    assert!(Level::available().any(|level| level == Level::Scalar));
    for level in Level::ALL {
        assert_eq!(Isa::new(level).is_ok(), level.is_available());
    }
    // No CPU is x86-64 and AArch64 at once.
    let foreign = if cfg!(target_arch = "aarch64") {
        Level::Avx2
    } else {
        Level::Neon
    };
    let error = Isa::new(foreign).expect_err("a foreign level");
    assert!(error.to_string().contains("cannot run level"), "{error}");
}
