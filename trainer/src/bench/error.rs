//! How far a picture is from what it should be.

use serde::Serialize;

use crate::metrics::psnr::{mse, psnr_db};

/// How far a picture is from a reference. Steps of 8 bits: 1/255.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Greatest difference of bytes.
    pub max_error_8bit: u8,
    /// Root mean square of the differences of bytes.
    pub rms_error_8bit: f64,
    /// Of bytes; at most 100.
    pub psnr_to_reference_db: f64,
    /// Greatest difference before rounding to bytes, in steps of 8 bits.
    pub max_error_unrounded_8bit: f64,
    /// Root mean square before rounding, in steps of 8 bits.
    pub rms_error_unrounded_8bit: f64,
}

impl Difference {
    /// Of a picture, its bytes and what they were rounded from, to a reference.
    ///
    /// # Panics
    ///
    /// Where the pictures differ in size.
    pub fn new(rgb: &[u8], unrounded: &[[f32; 3]], reference: &[[f64; 3]]) -> Self {
        let exact = bytes_of(reference);
        let (greatest, rms) = unrounded_errors(
            unrounded.as_flattened().iter().map(|&x| f64::from(x)),
            reference.as_flattened().iter().copied(),
        );
        Self {
            max_error_8bit: rgb.iter().zip(&exact).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0),
            rms_error_8bit: mse(rgb, &exact, None).unwrap_or(0.0).sqrt(),
            psnr_to_reference_db: psnr_db(rgb, &exact, None).unwrap_or(0.0),
            max_error_unrounded_8bit: greatest,
            rms_error_unrounded_8bit: rms,
        }
    }
}

/// Nearest bytes, halves up as in the runtime.
pub fn bytes_of(reference: &[[f64; 3]]) -> Vec<u8> {
    let byte = |x: f64| (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    reference.iter().flat_map(|rgb| rgb.map(byte)).collect()
}

/// Greatest difference and its root mean square, in 1/255.
pub fn unrounded_errors(a: impl Iterator<Item = f64>, b: impl Iterator<Item = f64>) -> (f64, f64) {
    let (mut greatest, mut sum, mut count) = (0.0f64, 0.0, 0u64);
    for (a, b) in a.zip(b) {
        let off = 255.0 * (a - b).abs();
        greatest = greatest.max(off);
        sum += off * off;
        count += 1;
    }
    (greatest, (sum / count.max(1) as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_in_steps() {
        let reference = [[0.0, 0.5, 1.0]; 4];
        let exact: Vec<u8> = [0, 128, 255].repeat(4);
        assert_eq!(bytes_of(&reference), exact);
        let unrounded = [[0.0f32, 0.5, 1.0]; 4];
        let none = Difference::new(&exact, &unrounded, &reference);
        assert_eq!([none.rms_error_8bit, none.max_error_unrounded_8bit], [0.0; 2]);
        let off: Vec<u8> = [0, 130, 255].repeat(4);
        let two = Difference::new(&off, &[[0.0, 0.5 + 2.0 / 255.0, 1.0]; 4], &reference);
        assert_eq!(two.max_error_8bit, 2);
        assert!((two.rms_error_8bit - (4.0f64 / 3.0).sqrt()).abs() < 1e-9);
        assert!((two.max_error_unrounded_8bit - 2.0).abs() < 1e-4, "{two:?}");
        assert!((two.rms_error_unrounded_8bit - two.rms_error_8bit).abs() < 1e-4);
    }
}
