//! Eight f32 at once: the one vocabulary all kernels are written in, spoken by two processors.
//!
//! [`Portable`] is plain arrays: the compiler turns them into whatever the target's baseline has, each operation rounds once,
//! nothing is ever fused, so the bits are the same on any processor. [`Avx2`] is 256-bit registers with fused multiply–add.
//! `mul_add` is the only operation whose rounding differs between the two, and kernels use it only where the result is a bound
//! with slack (the slab test), never where it reaches a hit: both processors give the same hits.

/// Eight values of f32.
///
/// `min` and `max` return the second operand when the comparison fails, as the SSE instructions do: `x.max(zero)` is never −0 or NaN.
pub(super) trait Lanes: Copy {
    /// One truth value a lane.
    type Mask: Copy;
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
pub(super) use xyz;

/// A processor: what its lanes are made of.
pub(super) trait Cpu {
    type Wide: Lanes;
    /// Asks for four cache lines at a place, which need not be anything.
    fn prefetch(place: *const u8);
}

/// Any processor.
pub(super) struct Portable;

impl Cpu for Portable {
    type Wide = Plain;
    #[inline(always)]
    fn prefetch(_place: *const u8) {}
}

/// An array that the compiler may vectorise.
#[derive(Clone, Copy)]
#[repr(align(16))]
pub(super) struct Plain([f32; 8]);

#[inline(always)]
fn zip<A: Copy, R>(a: [A; 8], b: [A; 8], f: impl Fn(A, A) -> R) -> [R; 8] {
    std::array::from_fn(|i| f(a[i], b[i]))
}

impl Lanes for Plain {
    type Mask = [bool; 8];
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
pub(super) use avx2::Avx2;

#[cfg(target_arch = "x86_64")]
mod avx2 {
    #![expect(unsafe_code, reason = "processor intrinsics")]
    // SAFETY, for every block of this module: the intrinsics need AVX2 and FMA. The only code that names these types runs inside
    // the functions that `accel::dispatch` marks `#[target_feature(enable = "avx2,fma")]`, and those are entered only by an `Accel` whose
    // `CpuPath` was checked against the running processor when it was built. Loads and stores go through references to arrays of
    // exactly the register's size.
    #![expect(clippy::undocumented_unsafe_blocks, reason = "one invariant for all of them, stated above")]

    use std::arch::x86_64::*;

    use super::{Cpu, Lanes};

    /// 256-bit vectors with fused multiply–add.
    pub(in super::super) struct Avx2;

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
    pub(in super::super) struct F8(__m256);

    impl Lanes for F8 {
        type Mask = __m256;
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
