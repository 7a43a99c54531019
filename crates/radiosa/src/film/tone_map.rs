//! From linear light to what a screen shows.
//!
//! `displayed = encode(curve(exposure · L))`, with the sRGB transfer function as `encode`. Everything before `encode` is
//! decided once for the whole picture by [`ToneMap::prepare`], so the factor that was used can be written down.
//!
//! NaN shows as black, infinity as white, negative light as black.

use std::fmt;

use rayon::prelude::*;

use super::{Film, Layer, srgb};
use crate::math::function;
use crate::spectrum::Spectrum;

/// How to make a picture fit for a screen. The default, [`Exposure::NONE`] and [`Curve::Clamp`], shows radiance 1 as white.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToneMap {
    /// What light is multiplied with first.
    pub exposure: Exposure,
    /// What happens to what is then too bright.
    pub curve: Curve,
}

/// The factor before the curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exposure {
    /// Light times `2^stops`.
    Stops(f32),
    /// Light times this.
    Factor(f32),
    /// The factor that brings the logarithmic mean of the luminance to [`KEY`], see [`automatic_exposure`].
    Automatic,
}

impl Exposure {
    /// Light as it is.
    pub const NONE: Self = Self::Factor(1.0);
}

impl Default for Exposure {
    fn default() -> Self {
        Self::NONE
    }
}

/// What happens to light brighter than white.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Curve {
    /// Linear, each channel cut off at 1: the first way of the classic local models.
    #[default]
    Clamp,
    /// Linear, divided by the largest channel in the picture: the second way of the classic local models. Nothing is cut
    /// off; exposure has no effect. A few very bright pixels make the rest dark.
    Renormalise,
    /// Reinhard et al. 2002, equation 4, on luminance `Y`: `Y′ = Y (1 + Y/white²) / (1 + Y)`, the colour scaled alike and cut off
    /// at 1. `white` is the exposed luminance that becomes 1; infinity gives their equation 3; `None` takes the picture's
    /// largest exposed luminance, at least 1.
    Reinhard {
        /// The exposed luminance that becomes white.
        white: Option<f32>,
    },
}

/// The luminance that automatic exposure makes the middle of the picture: the reflectance of a photographer's grey card.
pub const KEY: f32 = 0.18;

/// A tone map decided for one picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prepared {
    /// What light is multiplied with, all told.
    pub factor: f32,
    curve: PreparedCurve,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum PreparedCurve {
    Linear,
    /// `1/white²`.
    Reinhard(f32),
}

impl ToneMap {
    /// Decides everything that depends on the picture as a whole.
    pub fn prepare(&self, film: &Film) -> Prepared {
        let exposure = match self.exposure {
            Exposure::Stops(stops) => function::pow(2.0, stops),
            Exposure::Factor(factor) => factor,
            Exposure::Automatic => automatic_exposure(film),
        };
        let factor = match self.curve {
            Curve::Renormalise => {
                let largest = largest(film, Spectrum::max_channel);
                if largest > 0.0 { largest.recip().min(f32::MAX) } else { 1.0 }
            }
            Curve::Clamp | Curve::Reinhard { .. } => exposure,
        };
        let factor = if factor.is_finite() && factor >= 0.0 { factor } else { 1.0 };
        let curve = match self.curve {
            Curve::Clamp | Curve::Renormalise => PreparedCurve::Linear,
            Curve::Reinhard { white } => {
                let white = white.unwrap_or_else(|| (largest(film, Spectrum::luminance) * factor).max(1.0));
                let w = (white * white).recip();
                PreparedCurve::Reinhard(if w.is_finite() { w } else { 0.0 })
            }
        };
        Prepared { factor, curve }
    }
}

/// The largest finite value of `f` over the picture's colours; 0 when there is none above it.
fn largest(film: &Film, f: impl Fn(Spectrum) -> f32) -> f32 {
    let Some(color) = film.triple(Layer::Color) else { return 0.0 };
    (0..film.n_pixels()).map(|i| f(color.at(i))).filter(|v| v.is_finite()).fold(0.0, f32::max)
}

/// The exposure factor `KEY / exp(mean of ln Y)`, the mean taken over the pixels whose luminance Y is above zero and finite,
/// without the darkest and the brightest twentieth of them. Black surroundings and a few lamps or fireflies in the picture
/// therefore do not matter. 1 for a picture without light.
pub fn automatic_exposure(film: &Film) -> f32 {
    let Some(color) = film.triple(Layer::Color) else { return 1.0 };
    automatic_exposure_of((0..film.n_pixels()).map(|i| color.at(i).luminance()).collect())
}

/// The same of luminances that are no picture's.
pub fn automatic_exposure_of(mut luminances: Vec<f32>) -> f32 {
    luminances.retain(|y| *y > 0.0 && y.is_finite());
    let n = luminances.len();
    if n == 0 {
        return 1.0;
    }
    // Sorted as a whole, so that the sum below has one order and one result.
    luminances.par_sort_unstable_by(f32::total_cmp);
    let kept = &luminances[n / 20..n - n / 20];
    let mean = kept.iter().map(|&y| function::ln_f64(f64::from(y))).sum::<f64>() / kept.len() as f64;
    let factor = (f64::from(KEY) / function::exp_f64(mean)) as f32;
    if factor.is_finite() && factor > 0.0 { factor } else { 1.0 }
}

impl Prepared {
    /// The displayed light, linear, each channel in `[0, 1]`.
    pub fn apply(&self, light: Spectrum) -> Spectrum {
        let mut exposed = light.map(|v| if v > 0.0 { v * self.factor } else { 0.0 });
        if let PreparedCurve::Reinhard(inverse_white_2) = self.curve {
            let y = exposed.luminance();
            if y > 0.0 && y.is_finite() {
                exposed *= (1.0 + y * inverse_white_2) / (1.0 + y);
            }
        }
        // `min` and `max` with NaN give the other operand: infinity times zero ends as black.
        exposed.map(|v| if v.is_nan() { 0.0 } else { v.clamp(0.0, 1.0) })
    }

    /// The whole picture as RGB bytes, sRGB-encoded, row-major from the top left.
    pub fn to_srgb8(&self, film: &Film) -> Vec<u8> {
        self.encode(film, srgb::encode_u8)
    }

    /// The whole picture as 16-bit RGB, sRGB-encoded, row-major from the top left.
    pub fn to_srgb16(&self, film: &Film) -> Vec<u16> {
        self.encode(film, |v| (srgb::encode(v) * 65_535.0 + 0.5) as u16)
    }

    fn encode<T: Send + Copy + Default>(&self, film: &Film, quantise: impl Fn(f32) -> T + Sync) -> Vec<T> {
        let mut out = vec![T::default(); 3 * film.n_pixels()];
        if let Some(color) = film.triple(Layer::Color) {
            let row = 3 * film.width() as usize;
            out.par_chunks_mut(row).enumerate().for_each(|(y, values)| {
                for (x, rgb) in values.chunks_exact_mut(3).enumerate() {
                    let shown = self.apply(color.at(y * film.width() as usize + x)).to_array();
                    for (value, v) in rgb.iter_mut().zip(shown) {
                        *value = quantise(v);
                    }
                }
            });
        }
        out
    }
}

impl fmt::Display for Curve {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Clamp => f.write_str("clamp"),
            Self::Renormalise => f.write_str("renormalise"),
            Self::Reinhard { white: None } => f.write_str("reinhard"),
            Self::Reinhard { white: Some(white) } => write!(f, "reinhard:{white}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Pixel;

    fn film(colors: &[[f32; 3]]) -> Film {
        let mut film = Film::new(colors.len() as u32, 1, &[Layer::Color]).unwrap();
        for (x, &c) in colors.iter().enumerate() {
            film.set_pixel(x as u32, 0, &Pixel { color: c.into(), ..Pixel::default() });
        }
        film
    }

    #[test]
    fn clamping_cuts_each_channel_by_itself() {
        let film = film(&[[0.0, 0.5, 3.0], [0.214_041_14, 1.0, 0.18]]);
        let shown = ToneMap::default().prepare(&film);
        assert_eq!(shown.apply(film.color(0, 0)), Spectrum::new(0.0, 0.5, 1.0));
        // By hand: 0.5 linear is 187.5 of 255 (187.516 rounds up to 188), 0.18 is 117.6.
        assert_eq!(shown.to_srgb8(&film), [0, 188, 255, 128, 255, 118]);
        assert_eq!(shown.to_srgb16(&film)[2], 65_535);
    }

    #[test]
    fn renormalising_divides_by_the_largest_channel_of_the_picture() {
        let film = film(&[[1.0, 2.0, 4.0], [0.5, f32::NAN, f32::INFINITY]]);
        let shown = ToneMap { exposure: Exposure::Stops(3.0), curve: Curve::Renormalise }.prepare(&film);
        assert_eq!(shown.factor, 0.25);
        assert_eq!(shown.apply(film.color(0, 0)), Spectrum::new(0.25, 0.5, 1.0));
        let black = self::film(&[[0.0; 3]]);
        assert_eq!(ToneMap { curve: Curve::Renormalise, ..ToneMap::default() }.prepare(&black).to_srgb8(&black), [0, 0, 0]);
    }

    #[test]
    fn reinhard_has_the_values_of_its_equations() {
        let film = film(&[[1.0; 3], [4.0; 3]]);
        let eq3 = ToneMap { exposure: Exposure::NONE, curve: Curve::Reinhard { white: Some(f32::INFINITY) } }.prepare(&film);
        assert!((eq3.apply(Spectrum::gray(1.0)).g - 0.5).abs() < 1e-6);
        assert!((eq3.apply(Spectrum::gray(4.0)).g - 0.8).abs() < 1e-6);
        // White at the maximum, 4: 1·(1 + 1/16)/2 = 0.53125; 4·(1 + 4/16)/5 = 1.
        let eq4 = ToneMap { exposure: Exposure::NONE, curve: Curve::Reinhard { white: None } }.prepare(&film);
        assert!((eq4.apply(Spectrum::gray(1.0)).g - 0.531_25).abs() < 1e-6);
        assert!((eq4.apply(Spectrum::gray(4.0)).g - 1.0).abs() < 1e-6);
        // Two stops more: 1 becomes 4 of at most 16, 4 (1 + 4/256)/5 = 0.8125.
        let up = ToneMap { exposure: Exposure::Stops(2.0), curve: Curve::Reinhard { white: None } }.prepare(&film);
        assert!((up.apply(Spectrum::gray(1.0)).g - 0.812_5).abs() < 1e-6);
    }

    #[test]
    fn reinhard_keeps_hue_where_nothing_is_cut_off() {
        let film = film(&[[0.2, 0.4, 0.1]]);
        let shown =
            ToneMap { exposure: Exposure::NONE, curve: Curve::Reinhard { white: None } }.prepare(&film).apply(film.color(0, 0));
        assert!((shown.r / shown.g - 0.5).abs() < 1e-6 && (shown.b / shown.g - 0.25).abs() < 1e-6);
    }

    #[test]
    fn automatic_exposure_makes_a_grey_picture_middle_grey() {
        let grey = film(&[[50.0; 3]; 40]);
        assert!((automatic_exposure(&grey) * 50.0 - KEY).abs() < 1e-5);
    }

    #[test]
    fn automatic_exposure_does_not_care_about_black_surroundings_or_a_firefly() {
        let mut colors = vec![[2.0; 3]; 60];
        let plain = automatic_exposure(&film(&colors));
        colors.extend([[0.0; 3]; 500]);
        colors.extend([[1e9; 3], [f32::INFINITY; 3], [f32::NAN; 3], [-1.0; 3]]);
        assert!((automatic_exposure(&film(&colors)) / plain - 1.0).abs() < 1e-5);
        assert_eq!(automatic_exposure(&film(&[[0.0; 3]; 4])), 1.0);
        assert!(automatic_exposure(&film(&[[1e-40; 3]; 4])).is_finite());
    }

    #[test]
    fn what_is_not_a_number_is_black_and_what_is_infinite_is_white() {
        let odd = [[f32::NAN, f32::INFINITY, f32::NEG_INFINITY], [-1.0, -0.0, f32::MAX]];
        let film = film(&odd);
        for curve in [Curve::Clamp, Curve::Reinhard { white: None }, Curve::Reinhard { white: Some(0.0) }] {
            for exposure in [Exposure::NONE, Exposure::Automatic, Exposure::Stops(f32::NAN), Exposure::Factor(f32::INFINITY)] {
                let bytes = ToneMap { exposure, curve }.prepare(&film).to_srgb8(&film);
                assert_eq!((bytes[0], bytes[1], bytes[2], bytes[3], bytes[4]), (0, 255, 0, 0, 0), "{curve:?} {exposure:?}");
            }
        }
    }
}
