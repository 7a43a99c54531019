//! Which of the two compiled code paths the kernels take.

use std::fmt;

/// The instruction set the ray-query kernels use, chosen once at run time.
///
/// The same inputs give the same bits on the same path; `Portable` gives the same bits on any x86-64.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CpuPath {
    /// 256-bit vectors with fused multiply–add.
    Avx2,
    /// Nothing beyond the compilation target's baseline.
    Portable,
}

impl CpuPath {
    /// The best path this processor can run.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            return Self::Avx2;
        }
        Self::Portable
    }

    /// Itself where this processor can run it, `Portable` elsewhere.
    pub fn available(self) -> Self {
        if Self::detect() == Self::Portable { Self::Portable } else { self }
    }
}

impl fmt::Display for CpuPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Avx2 => "avx2+fma",
            Self::Portable => "portable",
        })
    }
}
