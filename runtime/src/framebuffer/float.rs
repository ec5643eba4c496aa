//! Four numbers a pixel.

use super::encoding::Encoding;
use crate::lanes::Lanes;
use crate::math::Real;
use crate::tiles::TILE;

/// Red, green, blue and alpha of a tile's row.
type Planes = [[f32; TILE as usize]; 4];

/// Red, green, blue, alpha.
pub(super) struct RgbaF32;

impl Encoding for RgbaF32 {
    type Element = f32;
    const ELEMENTS: usize = 4;
    const PERIOD: usize = 1;
    type Row = Planes;
    const ROW: Planes = [[0.0; TILE as usize]; 4];

    #[inline(always)]
    fn read(pixels: &[f32], row: &mut Planes) {
        let [red, green, blue, alpha] = row;
        let slots = red.iter_mut().zip(green).zip(blue).zip(alpha);
        for ((((red, green), blue), alpha), pixel) in slots.zip(pixels.as_chunks::<4>().0) {
            [*red, *green, *blue, *alpha] = *pixel;
        }
    }

    #[inline(always)]
    fn write(row: &Planes, pixels: &mut [f32]) {
        let [red, green, blue, alpha] = row;
        let values = red.iter().zip(green).zip(blue).zip(alpha);
        for ((((red, green), blue), alpha), pixel) in values.zip(pixels.as_chunks_mut::<4>().0) {
            *pixel = [*red, *green, *blue, *alpha];
        }
    }

    #[inline(always)]
    fn load<V: Lanes>(token: V::Token, row: &Planes, at: usize) -> [V; 4] {
        let [red, green, blue, alpha] = row;
        [
            V::load(token, red.get(at..).unwrap_or(&[])),
            V::load(token, green.get(at..).unwrap_or(&[])),
            V::load(token, blue.get(at..).unwrap_or(&[])),
            V::load(token, alpha.get(at..).unwrap_or(&[])),
        ]
    }

    /// A NaN, which is not even as great as −∞, becomes 0.
    #[inline(always)]
    fn bounded<R: Real>(value: R) -> R {
        let number = value.reaches(value.like(f32::NEG_INFINITY));
        let finite = value.at_least(value.like(f32::MIN)).at_most(value.like(f32::MAX));
        R::select(number, finite, value.like(0.0))
    }

    #[inline(always)]
    fn store<V: Lanes>(_: V::Token, rgba: [V; 4], _: u32, row: &mut Planes, at: usize) {
        let [r, g, b, a] = rgba;
        let [red, green, blue, alpha] = row;
        r.store(red.get_mut(at..).unwrap_or(&mut []));
        g.store(green.get_mut(at..).unwrap_or(&mut []));
        b.store(blue.get_mut(at..).unwrap_or(&mut []));
        a.store(alpha.get_mut(at..).unwrap_or(&mut []));
    }
}
