//! Eight f32 at once: the one vocabulary all kernels are written in, spoken by two processors.
//!
//! [`Portable`] is plain arrays: the compiler turns them into whatever the target's baseline has, each operation rounds once,
//! nothing is ever fused, so the bits are the same on any processor. [`Avx2`] is 256-bit registers with fused multiply–add.
//! `mul_add` is the only operation whose rounding differs between the two. Ray queries use it only where the result is a bound
//! with slack (the slab test), never where it reaches a hit: both processors give the same hits. Scan conversion decides in integers.

/// Eight values of f32.
///
/// `min` and `max` return the second operand when the comparison fails, as the SSE instructions do: `x.max(zero)` is never −0 or NaN.
pub(crate) trait Lanes: Copy {
    /// One truth value a lane.
    type Mask: Copy;
    /// Eight i32.
    type Int: Ints<Mask = Self::Mask>;
    fn splat(x: f32) -> Self;
    fn load(row: &[f32; 8]) -> Self;
    fn store(self) -> [f32; 8];
    fn add(self, b: Self) -> Self;
    fn sub(self, b: Self) -> Self;
    fn mul(self, b: Self) -> Self;
    fn div(self, b: Self) -> Self;
    /// `self·b + c`; one rounding or two.
    fn mul_add(self, b: Self, c: Self) -> Self;
    fn min(self, b: Self) -> Self;
    fn max(self, b: Self) -> Self;
    fn abs(self) -> Self;
    fn neg(self) -> Self;
    fn sqrt(self) -> Self;
    /// The nearest whole number, halves to even; within ±2³¹.
    fn round(self) -> Self::Int;
    /// As whole floats.
    fn of_ints(ints: Self::Int) -> Self;
    /// The bits as they are.
    fn to_bits(self) -> Self::Int;
    /// The bits as they are.
    fn from_bits(bits: Self::Int) -> Self;
    /// The smallest lane; NaN is passed over or not.
    fn least(self) -> f32;
    /// The largest lane; NaN is passed over or not.
    fn greatest(self) -> f32;
    /// False where either is NaN, like all comparisons here.
    fn le(self, b: Self) -> Self::Mask;
    fn lt(self, b: Self) -> Self::Mask;
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    fn either(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Lane `i` in bit `i`.
    fn bits(mask: Self::Mask) -> u32;
    /// Bit `i` in lane `i`.
    fn mask(bits: u32) -> Self::Mask;
}

/// Eight values of i32; sums wrap.
pub(crate) trait Ints: Copy {
    /// As the floats beside it have it.
    type Mask: Copy;
    fn splat(x: i32) -> Self;
    fn load(row: &[i32; 8]) -> Self;
    fn store(self) -> [i32; 8];
    fn add(self, b: Self) -> Self;
    fn sub(self, b: Self) -> Self;
    fn or(self, b: Self) -> Self;
    fn shift_left<const N: i32>(self) -> Self;
    fn shift_right<const N: i32>(self) -> Self;
    /// True where the number is zero or above.
    fn is_non_negative(self) -> Self::Mask;
}

/// `[f(0), f(1), f(2)]`, written out: `array::from_fn` and closures are functions compiled for the baseline, and whatever of them is not inlined into a
/// kernel drags its vectors through memory and calls.
macro_rules! xyz {
    ($k:ident => $f:expr) => {
        [
            {
                let $k = 0;
                $f
            },
            {
                let $k = 1;
                $f
            },
            {
                let $k = 2;
                $f
            },
        ]
    };
}
pub(crate) use xyz;

/// Values in a lane.
pub(crate) const LANES: usize = 8;

/// Columns of three: coordinates or channels, one row a point. They are as long as kernels need that read and write eight rows at once.
pub(crate) type Columns = [Vec<f32>; 3];

/// Eight rows of a column from row `i` on.
#[inline(always)]
pub(crate) fn eight(column: &[f32], i: usize) -> &[f32; 8] {
    column[i..].first_chunk().expect("columns have room for the lanes behind their last row")
}

/// Eight rows of a column from row `i` on, to be written.
#[inline(always)]
pub(crate) fn eight_mut(column: &mut [f32], i: usize) -> &mut [f32; 8] {
    column[i..].first_chunk_mut().expect("columns have room for the lanes behind their last row")
}

/// Eight vectors or colours.
pub(crate) type V3<L> = [L; 3];

/// `a · b`, a row each.
#[inline(always)]
pub(crate) fn dot<L: Lanes>(a: V3<L>, b: V3<L>) -> L {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}

/// The same in every lane.
#[inline(always)]
pub(crate) fn splat3<L: Lanes>(v: super::Vec3) -> V3<L> {
    [L::splat(v.x), L::splat(v.y), L::splat(v.z)]
}

/// Eight rows from row `i` on.
#[inline(always)]
pub(crate) fn load3<L: Lanes>(v: &Columns, i: usize) -> V3<L> {
    xyz!(k => L::load(eight(&v[k], i)))
}

/// Defines functions that run a generic kernel compiled for a processor: the first argument says for which, and is checked.
macro_rules! for_each_cpu {
    ($($(#[$doc:meta])* $vis:vis fn $name:ident($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? = $generic:ident;)*) => { $(
        $(#[$doc])*
        $vis fn $name(path: crate::math::CpuPath, $($arg: $ty),*) $(-> $ret)? {
            match path.available() {
                #[cfg(target_arch = "x86_64")]
                crate::math::CpuPath::Avx2 => {
                    #[target_feature(enable = "avx2,fma")]
                    fn compiled($($arg: $ty),*) $(-> $ret)? {
                        $generic::<crate::math::lanes::Avx2>($($arg),*)
                    }
                    #[expect(unsafe_code, reason = "calling code compiled for more than the baseline")]
                    // SAFETY: `available` gives this path only on a processor that has both features.
                    unsafe {
                        compiled($($arg),*)
                    }
                }
                _ => $generic::<crate::math::lanes::Portable>($($arg),*),
            }
        }
    )* };
}
pub(crate) use for_each_cpu;

/// A processor: what its lanes are made of.
pub(crate) trait Cpu {
    type Wide: Lanes;
    /// Asks for four cache lines at a place, which need not be anything.
    fn prefetch(place: *const u8);
}

/// Any processor.
pub(crate) struct Portable;

impl Cpu for Portable {
    type Wide = Plain;
    #[inline(always)]
    fn prefetch(_place: *const u8) {}
}

/// An array that the compiler may vectorise.
#[derive(Clone, Copy)]
#[repr(align(16))]
pub(crate) struct Plain([f32; 8]);

#[inline(always)]
fn zip<A: Copy, R>(a: [A; 8], b: [A; 8], f: impl Fn(A, A) -> R) -> [R; 8] {
    std::array::from_fn(|i| f(a[i], b[i]))
}

/// Its integers.
#[derive(Clone, Copy)]
#[repr(align(16))]
pub(crate) struct PlainInts([i32; 8]);

impl Ints for PlainInts {
    type Mask = [bool; 8];
    #[inline(always)]
    fn splat(x: i32) -> Self {
        Self([x; 8])
    }
    #[inline(always)]
    fn load(row: &[i32; 8]) -> Self {
        Self(*row)
    }
    #[inline(always)]
    fn store(self) -> [i32; 8] {
        self.0
    }
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self(zip(self.0, b.0, i32::wrapping_add))
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self(zip(self.0, b.0, i32::wrapping_sub))
    }
    #[inline(always)]
    fn or(self, b: Self) -> Self {
        Self(zip(self.0, b.0, |a, b| a | b))
    }
    #[inline(always)]
    fn shift_left<const N: i32>(self) -> Self {
        Self(self.0.map(|a| a << N))
    }
    #[inline(always)]
    fn shift_right<const N: i32>(self) -> Self {
        Self(self.0.map(|a| a >> N))
    }
    #[inline(always)]
    fn is_non_negative(self) -> [bool; 8] {
        self.0.map(|a| a >= 0)
    }
}

impl Lanes for Plain {
    type Mask = [bool; 8];
    type Int = PlainInts;
    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self([x; 8])
    }
    #[inline(always)]
    fn load(row: &[f32; 8]) -> Self {
        Self(*row)
    }
    #[inline(always)]
    fn store(self) -> [f32; 8] {
        self.0
    }
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self(zip(self.0, b.0, |a, b| a + b))
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self(zip(self.0, b.0, |a, b| a - b))
    }
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        Self(zip(self.0, b.0, |a, b| a * b))
    }
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        Self(zip(self.0, b.0, |a, b| a / b))
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        self.mul(b).add(c)
    }
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        Self(zip(self.0, b.0, |a, b| if a < b { a } else { b }))
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        Self(zip(self.0, b.0, |a, b| if a > b { a } else { b }))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f32::abs))
    }
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|a| -a))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }
    #[inline(always)]
    fn round(self) -> PlainInts {
        PlainInts(self.0.map(|a| a.round_ties_even() as i32))
    }
    #[inline(always)]
    fn of_ints(ints: PlainInts) -> Self {
        Self(ints.0.map(|a| a as f32))
    }
    #[inline(always)]
    fn to_bits(self) -> PlainInts {
        PlainInts(self.0.map(|a| a.to_bits() as i32))
    }
    #[inline(always)]
    fn from_bits(bits: PlainInts) -> Self {
        Self(bits.0.map(|a| f32::from_bits(a as u32)))
    }
    #[inline(always)]
    fn least(self) -> f32 {
        self.0.into_iter().fold(f32::INFINITY, f32::min)
    }
    #[inline(always)]
    fn greatest(self) -> f32 {
        self.0.into_iter().fold(f32::NEG_INFINITY, f32::max)
    }
    #[inline(always)]
    fn le(self, b: Self) -> Self::Mask {
        zip(self.0, b.0, |a, b| a <= b)
    }
    #[inline(always)]
    fn lt(self, b: Self) -> Self::Mask {
        zip(self.0, b.0, |a, b| a < b)
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Self(std::array::from_fn(|i| if mask[i] { yes.0[i] } else { no.0[i] }))
    }
    #[inline(always)]
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        zip(a, b, |a, b| a & b)
    }
    #[inline(always)]
    fn either(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        zip(a, b, |a, b| a | b)
    }
    #[inline(always)]
    fn bits(mask: Self::Mask) -> u32 {
        (0..8).fold(0, |bits, i| bits | u32::from(mask[i]) << i)
    }
    #[inline(always)]
    fn mask(bits: u32) -> Self::Mask {
        std::array::from_fn(|i| bits >> i & 1 != 0)
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;

#[cfg(target_arch = "x86_64")]
mod avx2 {
    #![expect(unsafe_code, reason = "processor intrinsics")]
    // SAFETY, for every block of this module: the intrinsics need AVX2 and FMA. The only code that names these types runs inside
    // functions marked `#[target_feature(enable = "avx2,fma")]`: those of `accel::dispatch`, entered only by an `Accel` whose `CpuPath` was
    // checked against the running processor when it was built, and those of `for_each_cpu!`, which checks it itself. Loads and stores go through references to arrays of
    // exactly the register's size.
    #![expect(clippy::undocumented_unsafe_blocks, reason = "one invariant for all of them, stated above")]

    use std::arch::x86_64::*;

    use super::{Cpu, Ints, Lanes};

    /// 256-bit vectors with fused multiply–add.
    pub(crate) struct Avx2;

    impl Cpu for Avx2 {
        type Wide = F8;
        #[inline(always)]
        fn prefetch(place: *const u8) {
            let p = place.cast::<i8>();
            unsafe {
                _mm_prefetch::<_MM_HINT_T0>(p);
                _mm_prefetch::<_MM_HINT_T0>(p.wrapping_add(64));
                _mm_prefetch::<_MM_HINT_T0>(p.wrapping_add(128));
                _mm_prefetch::<_MM_HINT_T0>(p.wrapping_add(192));
            }
        }
    }

    /// All lanes by an associative operation: halves, quarters, pairs.
    macro_rules! reduce {
        ($v:expr, $f:ident) => {{
            let v = $v;
            let v = $f(_mm256_castps256_ps128(v), _mm256_extractf128_ps::<1>(v));
            let v = $f(v, _mm_movehl_ps(v, v));
            _mm_cvtss_f32($f(v, _mm_shuffle_ps::<1>(v, v)))
        }};
    }

    #[derive(Clone, Copy)]
    pub(crate) struct F8(__m256);

    #[derive(Clone, Copy)]
    pub(crate) struct I8(__m256i);

    impl Ints for I8 {
        type Mask = __m256;
        #[inline(always)]
        fn splat(x: i32) -> Self {
            unsafe { Self(_mm256_set1_epi32(x)) }
        }
        #[inline(always)]
        fn load(row: &[i32; 8]) -> Self {
            unsafe { Self(_mm256_loadu_si256(row.as_ptr().cast())) }
        }
        #[inline(always)]
        fn store(self) -> [i32; 8] {
            let mut out = [0; 8];
            unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), self.0) };
            out
        }
        #[inline(always)]
        fn add(self, b: Self) -> Self {
            unsafe { Self(_mm256_add_epi32(self.0, b.0)) }
        }
        #[inline(always)]
        fn sub(self, b: Self) -> Self {
            unsafe { Self(_mm256_sub_epi32(self.0, b.0)) }
        }
        #[inline(always)]
        fn or(self, b: Self) -> Self {
            unsafe { Self(_mm256_or_si256(self.0, b.0)) }
        }
        #[inline(always)]
        fn shift_left<const N: i32>(self) -> Self {
            unsafe { Self(_mm256_slli_epi32::<N>(self.0)) }
        }
        #[inline(always)]
        fn shift_right<const N: i32>(self) -> Self {
            unsafe { Self(_mm256_srai_epi32::<N>(self.0)) }
        }
        #[inline(always)]
        fn is_non_negative(self) -> __m256 {
            unsafe { _mm256_castsi256_ps(_mm256_cmpgt_epi32(self.0, _mm256_set1_epi32(-1))) }
        }
    }

    impl Lanes for F8 {
        type Mask = __m256;
        type Int = I8;
        #[inline(always)]
        fn splat(x: f32) -> Self {
            unsafe { Self(_mm256_set1_ps(x)) }
        }
        #[inline(always)]
        fn load(row: &[f32; 8]) -> Self {
            unsafe { Self(_mm256_loadu_ps(row.as_ptr())) }
        }
        #[inline(always)]
        fn store(self) -> [f32; 8] {
            let mut out = [0.0; 8];
            unsafe { _mm256_storeu_ps(out.as_mut_ptr(), self.0) };
            out
        }
        #[inline(always)]
        fn add(self, b: Self) -> Self {
            unsafe { Self(_mm256_add_ps(self.0, b.0)) }
        }
        #[inline(always)]
        fn sub(self, b: Self) -> Self {
            unsafe { Self(_mm256_sub_ps(self.0, b.0)) }
        }
        #[inline(always)]
        fn mul(self, b: Self) -> Self {
            unsafe { Self(_mm256_mul_ps(self.0, b.0)) }
        }
        #[inline(always)]
        fn div(self, b: Self) -> Self {
            unsafe { Self(_mm256_div_ps(self.0, b.0)) }
        }
        #[inline(always)]
        fn mul_add(self, b: Self, c: Self) -> Self {
            unsafe { Self(_mm256_fmadd_ps(self.0, b.0, c.0)) }
        }
        #[inline(always)]
        fn min(self, b: Self) -> Self {
            unsafe { Self(_mm256_min_ps(self.0, b.0)) }
        }
        #[inline(always)]
        fn max(self, b: Self) -> Self {
            unsafe { Self(_mm256_max_ps(self.0, b.0)) }
        }
        #[inline(always)]
        fn abs(self) -> Self {
            unsafe { Self(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0)) }
        }
        #[inline(always)]
        fn neg(self) -> Self {
            unsafe { Self(_mm256_xor_ps(_mm256_set1_ps(-0.0), self.0)) }
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            unsafe { Self(_mm256_sqrt_ps(self.0)) }
        }
        #[inline(always)]
        fn round(self) -> I8 {
            unsafe { I8(_mm256_cvtps_epi32(self.0)) }
        }
        #[inline(always)]
        fn of_ints(ints: I8) -> Self {
            unsafe { Self(_mm256_cvtepi32_ps(ints.0)) }
        }
        #[inline(always)]
        fn to_bits(self) -> I8 {
            unsafe { I8(_mm256_castps_si256(self.0)) }
        }
        #[inline(always)]
        fn from_bits(bits: I8) -> Self {
            unsafe { Self(_mm256_castsi256_ps(bits.0)) }
        }
        #[inline(always)]
        fn least(self) -> f32 {
            unsafe { reduce!(self.0, _mm_min_ps) }
        }
        #[inline(always)]
        fn greatest(self) -> f32 {
            unsafe { reduce!(self.0, _mm_max_ps) }
        }
        #[inline(always)]
        fn le(self, b: Self) -> Self::Mask {
            unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, b.0) }
        }
        #[inline(always)]
        fn lt(self, b: Self) -> Self::Mask {
            unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, b.0) }
        }
        #[inline(always)]
        fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
            unsafe { Self(_mm256_blendv_ps(no.0, yes.0, mask)) }
        }
        #[inline(always)]
        fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask {
            unsafe { _mm256_and_ps(a, b) }
        }
        #[inline(always)]
        fn either(a: Self::Mask, b: Self::Mask) -> Self::Mask {
            unsafe { _mm256_or_ps(a, b) }
        }
        #[inline(always)]
        fn bits(mask: Self::Mask) -> u32 {
            unsafe { _mm256_movemask_ps(mask) as u32 }
        }
        #[inline(always)]
        fn mask(bits: u32) -> Self::Mask {
            unsafe { mask8(bits as i32) }
        }
    }

    #[inline(always)]
    unsafe fn mask8(bits: i32) -> __m256 {
        unsafe {
            let lane = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(bits), lane), lane))
        }
    }
}
