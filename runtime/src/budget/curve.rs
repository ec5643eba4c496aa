//! What a region's picture costs and what it lacks, by how many of its Gaussians are drawn.

use dermis_format::CurvePoint;
use dermis_format::curves::{count_at, stops};

use super::Instance;
use crate::footprint::Footprint;
use crate::math::Real;

/// Error and blends of one region in a picture, by how many Gaussians are drawn.
pub(super) struct Curve<'i, 's, 'a> {
    pub(super) instance: &'i Instance<'s, 'a>,
    pub(super) region: usize,
    pub(super) footprint: &'i Footprint,
    /// How much its error matters.
    pub(super) weight: f32,
}

impl Curve<'_, '_, '_> {
    /// Error where nothing is drawn.
    pub(super) fn error_of_nothing(&self) -> f32 {
        self.at(0).1.error
    }

    /// Gaussians at a stop, as far as they are there, and what they make of the region's pixels.
    fn at(&self, stop: usize) -> (u32, CurvePoint) {
        let avatar = self.instance.avatar;
        let layer_len = |layer| avatar.layer_len(self.region, layer);
        let count = count_at(stop, layer_len, avatar.header().layers.into());
        let CurvePoint { error, blends } = match avatar.curves() {
            Some(_) => self.measured(stop),
            None => unmeasured(count),
        };
        let Footprint { area, fill, .. } = *self.footprint;
        let error = (error * area * self.weight).at_least(0.0);
        let error = if error.is_finite() { error } else { f32::MAX };
        (count.min(avatar.present(self.region)), CurvePoint { error, blends: blends * fill })
    }

    /// Of one pixel, between two octaves as a straight line: beyond the last as at the last, nearer than the first as at
    /// the first.
    fn measured(&self, stop: usize) -> CurvePoint {
        let Some(curves) = self.instance.avatar.curves() else { return CurvePoint::default() };
        let last = curves.octaves().saturating_sub(1);
        let further = (curves.density() / self.footprint.density).log2();
        let octave = further.at_least(0.0).at_most(last as f32);
        let (before, share) = (octave as usize, octave - (octave as usize) as f32);
        let point =
            |octave: usize| curves.point(self.region, octave.min(last), stop).unwrap_or_default();
        let (a, b) = (point(before), point(before + 1));
        let mixed = |a: f32, b: f32| a + share * (b - a);
        CurvePoint { error: mixed(a.error, b.error), blends: mixed(a.blends, b.blends) }
    }

    /// Calls `visit` with the steps of the lower convex hull of error over Gaussians that save some, in order: Gaussians
    /// before and after, blends added and error saved.
    pub(super) fn hull(&self, mut visit: impl FnMut(u32, u32, f32, f32)) {
        let stops = stops(self.instance.avatar.header().layers.into());
        let (mut at, (mut count, mut point)) = (0, self.at(0));
        loop {
            let mut best: Option<(usize, u32, CurvePoint, f32)> = None;
            for later in at + 1..stops {
                let (more, there) = self.at(later);
                let saved = (point.error - there.error) / (more.saturating_sub(count)) as f32;
                // The furthest of equals: fewer steps.
                let better = best.is_none_or(|(.., least)| saved >= least);
                if more > count && saved > 0.0 && better {
                    best = Some((later, more, there, saved));
                }
            }
            let Some((later, more, there, _)) = best else { return };
            let blends = (there.blends - point.blends).at_least(0.0);
            visit(count, more, blends, point.error - there.error);
            (at, count, point) = (later, more, there);
        }
    }
}

/// Of avatars that nobody measured: 40 Gaussians or less are as bad as none, and four times as many have a quarter of
/// the error, as trained ones do; a pixel blends 25.
fn unmeasured(count: u32) -> CurvePoint {
    let error = if count <= 40 { 0.25 } else { 10.0 / count as f32 };
    CurvePoint { error, blends: if count > 0 { 25.0 } else { 0.0 } }
}
