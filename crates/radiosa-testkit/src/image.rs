//! Comparing pictures: relative mean square error for linear light, ꟻLIP for what a person sees; and reading EXR files.
//!
//! Pictures are slices of red, green, blue, row-major from the top left.

mod exr_file;
mod flip;

pub use exr_file::ExrFile;
pub use flip::{Flip, PIXELS_PER_DEGREE, flip};

/// The regulariser of relative errors: half the square of the mean luminance of the picture (0.01 for the Cornell box of the
/// reference data). It makes errors independent of exposure.
///
/// # Panics
/// When the length is no multiple of three.
pub fn epsilon(picture: &[f32]) -> f64 {
    let mean =
        mean(pixels(picture).iter().map(|[r, g, b]| 0.2126 * f64::from(*r) + 0.7152 * f64::from(*g) + 0.0722 * f64::from(*b)));
    0.5 * mean * mean
}

/// Relative mean square error: the mean over pixels and channels of `(L − L_ref)² / (L_ref² + ε)`, ε being [`epsilon`] of the
/// reference.
///
/// # Panics
/// When the lengths differ or are no multiple of three.
pub fn rel_mse(picture: &[f32], reference: &[f32]) -> f64 {
    RelMse { picture, reference, reference_variance: None, mask: None }.value()
}

/// [`rel_mse`] with what a noisy reference needs.
#[derive(Clone, Copy, Debug)]
pub struct RelMse<'a> {
    /// What is judged.
    pub picture: &'a [f32],
    /// What it is held against.
    pub reference: &'a [f32],
    /// Variance of the reference's own values; it is subtracted from the squared differences, whose expectation contains it.
    pub reference_variance: Option<&'a [f32]>,
    /// One entry a pixel, false where it is left out.
    pub mask: Option<&'a [bool]>,
}

impl RelMse<'_> {
    /// The error; with a variance it can come out slightly negative by chance. ε is that of the whole reference, masked or not.
    ///
    /// # Panics
    /// When lengths do not match, or the mask leaves nothing.
    pub fn value(&self) -> f64 {
        let eps = epsilon(self.reference);
        assert_eq!(self.picture.len(), self.reference.len(), "pictures of different sizes");
        assert!(self.reference_variance.is_none_or(|v| v.len() == self.reference.len()), "a variance of another size");
        assert!(self.mask.is_none_or(|m| 3 * m.len() == self.reference.len()), "a mask of another size");
        let terms = (0..self.picture.len()).filter(|i| self.mask.is_none_or(|m| m[i / 3])).map(|i| {
            let (l, l_ref) = (f64::from(self.picture[i]), f64::from(self.reference[i]));
            let variance = self.reference_variance.map_or(0.0, |v| f64::from(v[i]));
            ((l - l_ref) * (l - l_ref) - variance) / (l_ref * l_ref + eps)
        });
        mean(terms)
    }
}

/// Noise: `sqrt(mean of Var / (L² + ε))` over pixels and channels, `variance` being that of the picture's values.
///
/// # Panics
/// When the lengths differ or are no multiple of three.
pub fn noise(picture: &[f32], variance: &[f32]) -> f64 {
    assert_eq!(picture.len(), variance.len(), "a variance of another size");
    let eps = epsilon(picture);
    mean(picture.iter().zip(variance).map(|(l, v)| f64::from(*v) / (f64::from(*l) * f64::from(*l) + eps))).sqrt()
}

/// The triples of a picture.
fn pixels(picture: &[f32]) -> &[[f32; 3]] {
    let (triples, rest) = picture.as_chunks();
    assert!(rest.is_empty(), "three values a pixel");
    triples
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0u64), |(sum, n), v| (sum + v, n + 1));
    assert!(n > 0, "nothing to compare");
    sum / n as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_have_the_values_found_by_hand() {
        // Grey 0.2: ε = 0.02. Each channel off by 0.1: 0.01/(0.04 + 0.02) = 1/6.
        let reference = [0.2f32; 12];
        assert!((epsilon(&reference) - 0.02).abs() < 1e-8);
        assert!((rel_mse(&[0.3; 12], &reference) - 1.0 / 6.0).abs() < 1e-6);
        assert_eq!(rel_mse(&reference, &reference), 0.0);
        // One channel of twelve off: a twelfth of that.
        let mut one = reference;
        one[4] = 0.3;
        assert!((rel_mse(&one, &reference) - 1.0 / 72.0).abs() < 1e-6);
        assert!((noise(&reference, &[0.006; 12]) - 0.1f64.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn exposure_does_not_change_the_error() {
        let reference: Vec<f32> = (0..300u16).map(|i| f32::from(i % 17) * 0.1).collect();
        let picture: Vec<f32> = reference.iter().enumerate().map(|(i, v)| v + (i % 5) as f32 * 0.01).collect();
        let times = |v: &[f32]| v.iter().map(|x| x * 64.0).collect::<Vec<_>>();
        let (a, b) = (rel_mse(&picture, &reference), rel_mse(&times(&picture), &times(&reference)));
        assert!(a > 1e-6 && (a / b - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_variance_of_the_reference_and_masked_pixels_do_not_count() {
        let reference = [0.2f32; 6];
        let picture = [0.3, 0.3, 0.3, 9.0, 9.0, 9.0];
        let variance = [0.01f32; 6];
        let with = RelMse { picture: &picture, reference: &reference, reference_variance: None, mask: Some(&[true, false]) };
        assert!((with.value() - 1.0 / 6.0).abs() < 1e-6);
        let less = RelMse { reference_variance: Some(&variance), ..with };
        assert!(less.value().abs() < 1e-6);
    }

    #[test]
    #[should_panic(expected = "different sizes")]
    fn pictures_of_different_sizes_are_not_compared() {
        rel_mse(&[0.0; 3], &[0.0; 6]);
    }
}
