//! From other primaries to Rec. 709.

use crate::math::{DMat3, DVec3, Vec3};
use crate::spectrum::Spectrum;

/// CIE xy of red, green, blue and white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Primaries {
    pub(super) red: [f64; 2],
    pub(super) green: [f64; 2],
    pub(super) blue: [f64; 2],
    pub(super) white: [f64; 2],
}

impl Primaries {
    /// Rec. 709 with D65, what all light here is in.
    pub(super) const REC_709: Self = Self { red: [0.64, 0.33], green: [0.30, 0.60], blue: [0.15, 0.06], white: [0.3127, 0.3290] };

    /// CIE XYZ with the equal-energy white.
    pub(super) const XYZ: Self = Self { red: [1.0, 0.0], green: [0.0, 1.0], blue: [0.0, 0.0], white: [1.0 / 3.0, 1.0 / 3.0] };

    /// The matrix to CIE XYZ that makes (1, 1, 1) the white point with Y = 1. `None` when the primaries span no triangle.
    fn to_xyz(self) -> Option<DMat3> {
        let xyz = |[x, y]: [f64; 2]| DVec3::new(x, y, 1.0 - x - y);
        let m = DMat3::from_cols(xyz(self.red), xyz(self.green), xyz(self.blue));
        let white = xyz(self.white) / self.white[1];
        let scales = m.inverse() * white;
        let usable = m.determinant().abs() > 1e-6 && self.white[1] > 1e-6 && scales.is_finite();
        usable.then(|| m * DMat3::from_diagonal(scales))
    }

    /// The matrix to Rec. 709, white to white (Bradford's adaptation). `None` when the primaries span no triangle, or are
    /// those of Rec. 709 already.
    pub(super) fn to_rec_709(self) -> Option<Conversion> {
        let near = |[a, b]: [f64; 2], [c, d]: [f64; 2]| (a - c).abs() < 2e-3 && (b - d).abs() < 2e-3;
        let ours = Self::REC_709;
        if near(self.red, ours.red) && near(self.green, ours.green) && near(self.blue, ours.blue) && near(self.white, ours.white)
        {
            return None;
        }
        // Lam 1985; columns of the matrix are what X, Y and Z give to the three cone responses.
        let bradford = DMat3::from_cols_array(&[0.8951, -0.7502, 0.0389, 0.2664, 1.7135, -0.0685, -0.1614, 0.0367, 1.0296]);
        let (from, to) = (self.to_xyz()?, ours.to_xyz()?);
        let gain = (bradford * to * DVec3::ONE) / (bradford * from * DVec3::ONE);
        let matrix = to.inverse() * bradford.inverse() * DMat3::from_diagonal(gain) * bradford * from;
        matrix.is_finite().then(|| {
            let row = |i: usize| matrix.row(i).as_vec3();
            Conversion { rows: [row(0), row(1), row(2)] }
        })
    }

    /// What red, green and blue add to the luminance; sums to 1.
    pub(super) fn luminance_weights(self) -> Option<[f32; 3]> {
        Some(self.to_xyz()?.row(1).as_vec3().to_array())
    }
}

/// A change of primaries.
#[derive(Clone, Copy, Debug)]
pub(super) struct Conversion {
    rows: [Vec3; 3],
}

impl Conversion {
    /// The colour in the new primaries.
    pub(super) fn apply(&self, color: Spectrum) -> Spectrum {
        let v = Vec3::from_array(color.to_array());
        Spectrum::from(self.rows.map(|row| row.dot(v)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_stays_white_and_luminance_weights_are_those_of_the_standard() {
        let [r, g, b] = Primaries::REC_709.luminance_weights().unwrap();
        assert!((r - 0.2126).abs() < 1e-4 && (g - 0.7152).abs() < 1e-4 && (b - 0.0722).abs() < 1e-4);
        let xyz = Primaries::XYZ.to_rec_709().unwrap();
        for c in xyz.apply(Spectrum::WHITE).to_array() {
            assert!((c - 1.0).abs() < 1e-6);
        }
        assert!(Primaries::REC_709.to_rec_709().is_none());
        let degenerate = Primaries { green: [0.64, 0.33], ..Primaries::REC_709 };
        assert!(degenerate.to_rec_709().is_none());
    }

    #[test]
    fn the_primaries_of_dci_p3_have_their_known_coordinates() {
        // Display P3, same white: red is (1.2249, −0.0420, −0.0197) in sRGB's primaries.
        let p3 = Primaries { red: [0.680, 0.320], green: [0.265, 0.690], blue: [0.150, 0.060], ..Primaries::REC_709 };
        let red = p3.to_rec_709().unwrap().apply(Spectrum::new(1.0, 0.0, 0.0));
        assert!((red.r - 1.2249).abs() < 2e-3 && (red.g + 0.0420).abs() < 2e-3 && (red.b + 0.0197).abs() < 2e-3, "{red:?}");
    }
}
