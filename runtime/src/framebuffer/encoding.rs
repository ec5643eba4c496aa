//! What a pixel format is to the code that composites.

use crate::lanes::Lanes;
use crate::math::Real;

/// How a format's pixels become lanes and lanes its pixels, by way of a row of a tile in words that
/// vectors load and store.
pub(super) trait Encoding {
    /// What the caller's slice is of.
    type Element: Copy;
    /// Elements of a pixel.
    const ELEMENTS: usize;
    /// Rows after which a colour's elements repeat.
    const PERIOD: usize;
    /// A row of a tile.
    type Row: Copy;
    /// Any.
    const ROW: Self::Row;

    /// Copies the caller's pixels into the front of a row.
    fn read(pixels: &[Self::Element], row: &mut Self::Row);

    /// Copies the front of a row to the caller's pixels.
    fn write(row: &Self::Row, pixels: &mut [Self::Element]);

    /// Values of pixels `at..at + V::LEN`: red, green, blue, alpha. What [`Encoding::store`] makes of
    /// them is what they were.
    fn load<V: Lanes>(token: V::Token, row: &Self::Row, at: usize) -> [V; 4];

    /// The nearest value that the format has room for.
    fn bounded<R: Real>(value: R) -> R;

    /// Encodes pixels `at..at + V::LEN` of the frame's row `y` from bounded values.
    fn store<V: Lanes>(token: V::Token, rgba: [V; 4], y: u32, row: &mut Self::Row, at: usize);
}
