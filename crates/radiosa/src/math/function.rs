//! Elementary functions whose bits do not depend on the operating system's mathematical library.
//!
//! The standard library forwards `sin`, `exp`, `powf` and the like to whatever the platform has; pictures must have
//! the same bits everywhere, so everything that reaches a pixel calls these instead (the crate `libm`). `sqrt`, `abs`,
//! `floor` and comparisons are exact by IEEE 754 and need no twin.

macro_rules! forward {
    ($($name:ident, $single:path, $double_name:ident, $double:path;)*) => { $(
        #[doc = concat!("`", stringify!($name), "` in f32.")]
        pub fn $name(x: f32) -> f32 { $single(x) }
        #[doc = concat!("`", stringify!($name), "` in f64.")]
        pub fn $double_name(x: f64) -> f64 { $double(x) }
    )* };
}

forward! {
    sin, libm::sinf, sin_f64, libm::sin;
    cos, libm::cosf, cos_f64, libm::cos;
    tan, libm::tanf, tan_f64, libm::tan;
    asin, libm::asinf, asin_f64, libm::asin;
    acos, libm::acosf, acos_f64, libm::acos;
    atan, libm::atanf, atan_f64, libm::atan;
    exp, libm::expf, exp_f64, libm::exp;
    ln, libm::logf, ln_f64, libm::log;
}

/// `(sin x, cos x)` in f32.
pub fn sin_cos(x: f32) -> (f32, f32) {
    libm::sincosf(x)
}

/// `atan2(y, x)` in f32.
pub fn atan2(y: f32, x: f32) -> f32 {
    libm::atan2f(y, x)
}

/// `atan2(y, x)` in f64.
pub fn atan2_f64(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// `x` to the power `y` in f32; 1 when `y` is 0.
pub fn pow(x: f32, y: f32) -> f32 {
    libm::powf(x, y)
}

/// `x` to the power `y` in f64; 1 when `y` is 0.
pub fn pow_f64(x: f64, y: f64) -> f64 {
    libm::pow(x, y)
}
