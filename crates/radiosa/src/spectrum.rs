//! Linear RGB light.

use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub};

/// Three linear channels, Rec. 709 primaries, white point D65. Which quantity it holds, and its unit, is said by the
/// name of whatever has this type. It is not a vector in space.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Spectrum {
    /// Red.
    pub r: f32,
    /// Green.
    pub g: f32,
    /// Blue.
    pub b: f32,
}

impl Spectrum {
    /// No light.
    pub const BLACK: Self = Self::gray(0.0);
    /// One in each channel.
    pub const WHITE: Self = Self::gray(1.0);

    /// From three channels.
    pub const fn new(r: f32, g: f32, b: f32) -> Self {
        Self { r, g, b }
    }

    /// The same value in each channel.
    pub const fn gray(v: f32) -> Self {
        Self { r: v, g: v, b: v }
    }

    /// The luminance weight of the channels: `Y = 0.2126 R + 0.7152 G + 0.0722 B`.
    pub fn luminance(self) -> f32 {
        0.2126 * self.r + 0.7152 * self.g + 0.0722 * self.b
    }

    /// The largest channel.
    pub fn max_channel(self) -> f32 {
        self.r.max(self.g).max(self.b)
    }

    /// True when every channel is zero.
    pub fn is_black(self) -> bool {
        self == Self::BLACK
    }

    /// True when every channel is finite.
    pub fn is_finite(self) -> bool {
        self.r.is_finite() && self.g.is_finite() && self.b.is_finite()
    }

    /// Applies `f` to each channel.
    pub fn map(self, f: impl Fn(f32) -> f32) -> Self {
        Self::new(f(self.r), f(self.g), f(self.b))
    }

    /// `self + t (other − self)`, channel by channel.
    pub fn lerp(self, other: Self, t: f32) -> Self {
        self * (1.0 - t) + other * t
    }

    /// As an array, in the order red, green, blue.
    pub const fn to_array(self) -> [f32; 3] {
        [self.r, self.g, self.b]
    }
}

/// Y of linear RGB, in f64: as [`Spectrum::luminance`], for values that accumulate.
pub fn luminance([r, g, b]: [f64; 3]) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

impl From<[f32; 3]> for Spectrum {
    fn from([r, g, b]: [f32; 3]) -> Self {
        Self { r, g, b }
    }
}

impl Add for Spectrum {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self::new(self.r + o.r, self.g + o.g, self.b + o.b)
    }
}

impl Sub for Spectrum {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self::new(self.r - o.r, self.g - o.g, self.b - o.b)
    }
}

impl Mul for Spectrum {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        Self::new(self.r * o.r, self.g * o.g, self.b * o.b)
    }
}

impl Mul<f32> for Spectrum {
    type Output = Self;
    fn mul(self, k: f32) -> Self {
        self.map(|v| v * k)
    }
}

impl Mul<Spectrum> for f32 {
    type Output = Spectrum;
    fn mul(self, s: Spectrum) -> Spectrum {
        s * self
    }
}

impl Div<f32> for Spectrum {
    type Output = Self;
    fn div(self, k: f32) -> Self {
        self.map(|v| v / k)
    }
}

impl Neg for Spectrum {
    type Output = Self;
    fn neg(self) -> Self {
        self.map(|v| -v)
    }
}

impl AddAssign for Spectrum {
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl MulAssign<f32> for Spectrum {
    fn mul_assign(&mut self, k: f32) {
        *self = *self * k;
    }
}

impl std::iter::Sum for Spectrum {
    fn sum<I: Iterator<Item = Self>>(iter: I) -> Self {
        iter.fold(Self::BLACK, Add::add)
    }
}
