//! Several f32 at once: the one vocabulary all kernels are written in, spoken by two processors.
//!
//! [`Portable`] is plain arrays: the compiler turns them into whatever the target's baseline has, each operation rounds once,
//! nothing is ever fused, so the bits are the same on any processor. [`Avx2`] is 256-bit registers with fused multiply–add.
//! `mul_add` is the only operation whose rounding differs between the two, and kernels use it only where the result is a bound
//! with slack (the slab test), never where it reaches a hit: both processors give the same hits.

/// `N` values of f32.
///
/// `min` and `max` return the second operand when the comparison fails, as the SSE instructions do: `x.max(zero)` is never −0 or NaN.
pub(super) trait Lanes<const N: usize>: Copy {
    /// One truth value a lane.
    type Mask: Copy;
    fn splat(x: f32) -> Self;
    fn load(row: &[f32; N]) -> Self;
    fn store(self) -> [f32; N];
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
    /// False where either is NaN, like all comparisons here.
    fn le(self, b: Self) -> Self::Mask;
    fn lt(self, b: Self) -> Self::Mask;
    #[expect(dead_code, reason = "for packets")]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    fn either(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Lane `i` in bit `i`.
    fn bits(mask: Self::Mask) -> u32;
    /// Bit `i` in lane `i`.
    #[expect(dead_code, reason = "for packets")]
    fn mask(bits: u32) -> Self::Mask;
}

/// Triangles in a block.
pub(super) const BLOCK: usize = 4;

/// A processor: how wide its node and triangle kernels are is fixed, what they are made of is not.
pub(super) trait Cpu {
    type Wide: Lanes<8>;
    type Narrow: Lanes<BLOCK>;
    /// Asks for the first cache lines at this place.
    fn prefetch<T>(place: &T);
}

/// Any processor.
pub(super) struct Portable;

impl Cpu for Portable {
    type Wide = Plain<8>;
    type Narrow = Plain<BLOCK>;
    #[inline(always)]
    fn prefetch<T>(_place: &T) {}
}

/// An array that the compiler may vectorise.
#[derive(Clone, Copy)]
#[repr(align(16))]
pub(super) struct Plain<const N: usize>([f32; N]);

#[inline(always)]
fn zip<A: Copy, R, const N: usize>(a: [A; N], b: [A; N], f: impl Fn(A, A) -> R) -> [R; N] {
    std::array::from_fn(|i| f(a[i], b[i]))
}

impl<const N: usize> Lanes<N> for Plain<N> {
    type Mask = [bool; N];
    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self([x; N])
    }
    #[inline(always)]
    fn load(row: &[f32; N]) -> Self {
        Self(*row)
    }
    #[inline(always)]
    fn store(self) -> [f32; N] {
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
        (0..N).fold(0, |bits, i| bits | u32::from(mask[i]) << i)
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

    use super::{BLOCK, Cpu, Lanes};

    /// 256-bit vectors with fused multiply–add.
    pub(in super::super) struct Avx2;

    impl Cpu for Avx2 {
        type Wide = F8;
        type Narrow = F4;
        #[inline(always)]
        fn prefetch<T>(place: &T) {
            let p = std::ptr::from_ref(place).cast::<i8>();
            unsafe {
                _mm_prefetch::<_MM_HINT_T0>(p);
                _mm_prefetch::<_MM_HINT_T0>(p.wrapping_add(64));
                _mm_prefetch::<_MM_HINT_T0>(p.wrapping_add(128));
                if size_of::<T>() > 192 {
                    _mm_prefetch::<_MM_HINT_T0>(p.wrapping_add(192));
                }
            }
        }
    }

    macro_rules! lanes {
        ($name:ident, $raw:ident, $n:expr, $load:ident, $store:ident, $splat:ident, $add:ident, $sub:ident, $mul:ident, $div:ident, $fma:ident,
         $min:ident, $max:ident, $and:ident, $andnot:ident, $or:ident, $xor:ident, $cmp:ident, $blend:ident, $movemask:ident, $from_bits:expr) => {
            #[derive(Clone, Copy)]
            pub(in super::super) struct $name($raw);

            impl Lanes<$n> for $name {
                type Mask = $raw;
                #[inline(always)]
                fn splat(x: f32) -> Self {
                    unsafe { Self($splat(x)) }
                }
                #[inline(always)]
                fn load(row: &[f32; $n]) -> Self {
                    unsafe { Self($load(row.as_ptr())) }
                }
                #[inline(always)]
                fn store(self) -> [f32; $n] {
                    let mut out = [0.0; $n];
                    unsafe { $store(out.as_mut_ptr(), self.0) };
                    out
                }
                #[inline(always)]
                fn add(self, b: Self) -> Self {
                    unsafe { Self($add(self.0, b.0)) }
                }
                #[inline(always)]
                fn sub(self, b: Self) -> Self {
                    unsafe { Self($sub(self.0, b.0)) }
                }
                #[inline(always)]
                fn mul(self, b: Self) -> Self {
                    unsafe { Self($mul(self.0, b.0)) }
                }
                #[inline(always)]
                fn div(self, b: Self) -> Self {
                    unsafe { Self($div(self.0, b.0)) }
                }
                #[inline(always)]
                fn mul_add(self, b: Self, c: Self) -> Self {
                    unsafe { Self($fma(self.0, b.0, c.0)) }
                }
                #[inline(always)]
                fn min(self, b: Self) -> Self {
                    unsafe { Self($min(self.0, b.0)) }
                }
                #[inline(always)]
                fn max(self, b: Self) -> Self {
                    unsafe { Self($max(self.0, b.0)) }
                }
                #[inline(always)]
                fn abs(self) -> Self {
                    unsafe { Self($andnot($splat(-0.0), self.0)) }
                }
                #[inline(always)]
                fn neg(self) -> Self {
                    unsafe { Self($xor($splat(-0.0), self.0)) }
                }
                #[inline(always)]
                fn le(self, b: Self) -> Self::Mask {
                    unsafe { $cmp::<_CMP_LE_OQ>(self.0, b.0) }
                }
                #[inline(always)]
                fn lt(self, b: Self) -> Self::Mask {
                    unsafe { $cmp::<_CMP_LT_OQ>(self.0, b.0) }
                }
                #[inline(always)]
                fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
                    unsafe { Self($blend(no.0, yes.0, mask)) }
                }
                #[inline(always)]
                fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask {
                    unsafe { $and(a, b) }
                }
                #[inline(always)]
                fn either(a: Self::Mask, b: Self::Mask) -> Self::Mask {
                    unsafe { $or(a, b) }
                }
                #[inline(always)]
                fn bits(mask: Self::Mask) -> u32 {
                    unsafe { $movemask(mask) as u32 }
                }
                #[inline(always)]
                fn mask(bits: u32) -> Self::Mask {
                    unsafe { $from_bits(bits as i32) }
                }
            }
        };
    }

    #[inline(always)]
    unsafe fn mask8(bits: i32) -> __m256 {
        unsafe {
            let lane = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(bits), lane), lane))
        }
    }

    #[inline(always)]
    unsafe fn mask4(bits: i32) -> __m128 {
        unsafe {
            let lane = _mm_setr_epi32(1, 2, 4, 8);
            _mm_castsi128_ps(_mm_cmpeq_epi32(_mm_and_si128(_mm_set1_epi32(bits), lane), lane))
        }
    }

    lanes!(
        F8,
        __m256,
        8,
        _mm256_loadu_ps,
        _mm256_storeu_ps,
        _mm256_set1_ps,
        _mm256_add_ps,
        _mm256_sub_ps,
        _mm256_mul_ps,
        _mm256_div_ps,
        _mm256_fmadd_ps,
        _mm256_min_ps,
        _mm256_max_ps,
        _mm256_and_ps,
        _mm256_andnot_ps,
        _mm256_or_ps,
        _mm256_xor_ps,
        _mm256_cmp_ps,
        _mm256_blendv_ps,
        _mm256_movemask_ps,
        mask8
    );
    lanes!(
        F4,
        __m128,
        4,
        _mm_loadu_ps,
        _mm_storeu_ps,
        _mm_set1_ps,
        _mm_add_ps,
        _mm_sub_ps,
        _mm_mul_ps,
        _mm_div_ps,
        _mm_fmadd_ps,
        _mm_min_ps,
        _mm_max_ps,
        _mm_and_ps,
        _mm_andnot_ps,
        _mm_or_ps,
        _mm_xor_ps,
        _mm_cmp_ps,
        _mm_blendv_ps,
        _mm_movemask_ps,
        mask4
    );

    const _: () = assert!(BLOCK == 4 || BLOCK == 8, "one of the two widths above");
}
