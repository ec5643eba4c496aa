//! Bayer's ordered dither, 8 × 8.

use crate::lanes::MAX_LANES;

/// Columns and rows after which it repeats; divides the side of a tile.
pub(super) const PERIOD: usize = 8;

/// (2 M + 1) / 128 of each row, as many columns as the longest vector beginning anywhere in the
/// period takes.
const BIASES: [[f32; PERIOD + MAX_LANES]; PERIOD] = {
    let mut biases = [[0.0; PERIOD + MAX_LANES]; PERIOD];
    let mut y = 0;
    while y < PERIOD {
        let mut x = 0;
        while x < PERIOD + MAX_LANES {
            biases[y][x] = (2 * matrix(x % PERIOD, y) + 1) as f32 / 128.0;
            x += 1;
        }
        y += 1;
    }
    biases
};

/// Bayer's matrix, 0..=63: the bits of x ⊕ y and of y by turns, the lowest bits first and highest.
const fn matrix(x: usize, y: usize) -> usize {
    let (mixed, mut value, mut bit) = (x ^ y, 0, 0);
    while bit < 3 {
        value = value << 2 | (mixed >> bit & 1) << 1 | y >> bit & 1;
        bit += 1;
    }
    value
}

/// Of the frame's row `y` from column `at` of a tile on; at least [`MAX_LANES`] of them.
#[inline(always)]
pub(super) fn biases(y: u32, at: usize) -> &'static [f32] {
    BIASES[y as usize % PERIOD].get(at % PERIOD..).unwrap_or(&[])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The matrix as it is printed in textbooks.
    #[test]
    fn first_rows_are_bayers() {
        let row = |y: usize| core::array::from_fn::<usize, 8, _>(|x| matrix(x, y));
        assert_eq!(row(0), [0, 32, 8, 40, 2, 34, 10, 42]);
        assert_eq!(row(1), [48, 16, 56, 24, 50, 18, 58, 26]);
        assert_eq!(row(7), [63, 31, 55, 23, 61, 29, 53, 21]);
    }

    #[test]
    fn every_step_is_there_once_in_any_window() {
        for at in 0..PERIOD {
            let mut seen = [0; 64];
            for y in 0..PERIOD as u32 {
                for bias in &biases(y, at)[..PERIOD] {
                    seen[(bias * 64.0) as usize] += 1;
                }
                assert!(biases(y, at).len() >= MAX_LANES);
            }
            assert_eq!(seen, [1; 64]);
        }
    }
}
