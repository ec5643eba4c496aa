//! Tiles over what is behind them, pixels of a row side by side.

use super::encoding::Encoding;
use super::{Area, Background};
use crate::kernel::Work;
use crate::lanes::Lanes;
use crate::math::{Real, each};
use crate::raster::{CLEAR, TilePixels, TileRow};
use crate::tiles::TILE;

/// The rows of a tile in the caller's memory.
pub(super) struct Window<'a, T> {
    elements: &'a mut [T],
    stride: usize,
    /// Of the first row.
    start: usize,
    /// Elements of a row.
    len: usize,
}

impl<'a, T> Window<'a, T> {
    /// Of an area of pixels of `elements_each`.
    pub(super) fn new(
        elements: &'a mut [T],
        stride: usize,
        elements_each: usize,
        area: &Area,
    ) -> Self {
        let top = (area.rows.start - area.first_row) as usize;
        let start = top * stride + area.columns.start as usize * elements_each;
        Self { elements, stride, start, len: area.columns.len() * elements_each }
    }

    /// Row `y` of the tile; none where there is no memory for it.
    #[inline(always)]
    pub(super) fn row(&mut self, y: usize) -> &mut [T] {
        let start = self.start + y * self.stride;
        self.elements.get_mut(start..start + self.len).unwrap_or(&mut [])
    }
}

/// Writes a tile that was drawn.
pub(super) struct Compose<'a, E: Encoding> {
    pub(super) window: Window<'a, E::Element>,
    pub(super) area: &'a Area,
    pub(super) source: &'a TilePixels,
    pub(super) background: Background,
}

impl<E: Encoding> Work for Compose<'_, E> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self, token: V::Token) {
        let Self { mut window, area, source, background } = self;
        let vectors = area.columns.len().div_ceil(V::LEN).min(TILE as usize / V::LEN);
        let mut encoded = E::ROW;
        for ((y, source), at_y) in area.rows.clone().zip(&source.0).zip(0..) {
            let row = window.row(at_y);
            match background {
                Background::Color(color) => {
                    let color = each(
                        color,
                        #[inline(always)]
                        |x| V::splat(token, x),
                    );
                    for i in 0..vectors {
                        let at = i * V::LEN;
                        let rgba = over_color::<E, V>(load(token, source, at), color);
                        E::store(token, rgba, y, &mut encoded, at);
                    }
                }
                Background::Existing => {
                    if !touched::<V>(token, source, vectors) {
                        continue;
                    }
                    E::read(row, &mut encoded);
                    for i in 0..vectors {
                        let at = i * V::LEN;
                        let there = E::load(token, &encoded, at);
                        let rgba = over_pixels::<E, V>(load(token, source, at), there);
                        E::store(token, rgba, y, &mut encoded, at);
                    }
                }
            }
            E::write(&encoded, row);
        }
    }
}

/// Writes a tile that nothing touches, over a colour: each of the rows that repeat is encoded once.
pub(super) struct Fill<'a, E: Encoding> {
    pub(super) window: Window<'a, E::Element>,
    pub(super) area: &'a Area,
    pub(super) color: [f32; 3],
}

impl<E: Encoding> Work for Fill<'_, E> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self, token: V::Token) {
        let Self { mut window, area, color } = self;
        let untouched = each(
            CLEAR,
            #[inline(always)]
            |x| V::splat(token, x),
        );
        let color = each(
            color,
            #[inline(always)]
            |x| V::splat(token, x),
        );
        let rgba = over_color::<E, V>(untouched, color);
        let mut encoded = E::ROW;
        for (y, phase) in area.rows.clone().zip(0..E::PERIOD) {
            for i in 0..TILE as usize / V::LEN {
                E::store(token, rgba, y, &mut encoded, i * V::LEN);
            }
            let mut at_y = phase;
            while at_y < area.rows.len() {
                E::write(&encoded, window.row(at_y));
                at_y += E::PERIOD;
            }
        }
    }
}

/// Red, green, blue and T of pixels `at..at + V::LEN`.
#[inline(always)]
fn load<V: Lanes>(token: V::Token, [red, green, blue, t]: &TileRow, at: usize) -> [V; 4] {
    [
        V::load(token, red.get(at..).unwrap_or(&[])),
        V::load(token, green.get(at..).unwrap_or(&[])),
        V::load(token, blue.get(at..).unwrap_or(&[])),
        V::load(token, t.get(at..).unwrap_or(&[])),
    ]
}

/// Whether a splat touches any pixel of a row.
#[inline(always)]
fn touched<V: Lanes>(token: V::Token, [.., t]: &TileRow, vectors: usize) -> bool {
    let mut any = 0;
    for i in 0..vectors {
        let t = V::load(token, t.get(i * V::LEN..).unwrap_or(&[]));
        any |= V::bits(t.below(t.like(1.0)));
    }
    any != 0
}

/// C + T · colour, opaque.
#[inline(always)]
fn over_color<E: Encoding, R: Real>([r, g, b, t]: [R; 4], color: [R; 3]) -> [R; 4] {
    [
        E::bounded(r + t * color[0]),
        E::bounded(g + t * color[1]),
        E::bounded(b + t * color[2]),
        t.like(1.0),
    ]
}

/// C + T · what is there, alpha (1 − T) + T · its alpha. Alpha of a splat is at least 1/255 where it
/// touches, so T is below 1 there, and 1 elsewhere.
#[inline(always)]
fn over_pixels<E: Encoding, R: Real>([r, g, b, t]: [R; 4], there: [R; 4]) -> [R; 4] {
    let one = t.like(1.0);
    let touched = t.below(one);
    let over = |c: R, there: R| R::select(touched, E::bounded(c + t * there), there);
    [over(r, there[0]), over(g, there[1]), over(b, there[2]), over(one - t, there[3])]
}
