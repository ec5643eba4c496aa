//! How near each region's picture is to the mesh, by how many of its Gaussians it has and how large it is: what a plan
//! weighs.

use crate::header::Header;
use crate::record::{CurvePointRecord, CurvesRecord, plane, take_plane};

/// A region at a level, seen from some distance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CurvePoint {
    /// Squared difference to the mesh, sRGB in [0, 1], mean over channels, for each px² of the region's footprint (SPEC,
    /// `CURV`).
    pub error: f32,
    /// Gaussians blended into pixels, for each px² of the footprint.
    pub blends: f32,
}

/// Points of all regions, in the file.
#[derive(Clone, Copy, Debug)]
pub struct Curves<'a> {
    density: f32,
    octaves: usize,
    /// Of each region and octave.
    stops: usize,
    points: &'a [CurvePointRecord],
}

/// Counts at which a region of so many layers is measured.
pub const fn stops(layers: usize) -> usize {
    2 * layers + 2
}

/// Gaussians of a region at each stop: none, a sixteenth and a quarter of the first layer that is not empty, rounded up, then
/// all of the layers up to each one, and before each but the first a third of it, rounded up: of levels of four times as many twice
/// as many as at the level below.
pub fn count_at(stop: usize, layer_len: impl Fn(usize) -> u32, layers: usize) -> u32 {
    let first = || (0..layers).map(&layer_len).find(|&len| len > 0).unwrap_or(0);
    match stop {
        0 => 0,
        1 => first().div_ceil(16),
        2 => first().div_ceil(4),
        _ => {
            let (whole, part) = ((stop - 1) / 2, stop.is_multiple_of(2));
            let part = if part && whole < layers { layer_len(whole).div_ceil(3) } else { 0 };
            (0..layers.min(whole)).map(layer_len).sum::<u32>() + part
        }
    }
}

/// Octaves at most.
pub const MAX_OCTAVES: usize = 8;

impl<'a> Curves<'a> {
    /// `None` where the payload is not as long as its head and the header say, or holds numbers that no curve has.
    pub(crate) fn split(payload: &'a [u8], header: &Header) -> Option<Self> {
        let ([head], rest) = take_plane::<CurvesRecord>(payload, 1)? else { return None };
        let (octaves, stops) = (usize::from(head.octaves), stops(header.layers.into()));
        let points: &[CurvePointRecord] = plane(rest)?;
        let density = head.density.get();
        let numbers = points.iter().flat_map(|point| [point.error.get(), point.blends.get()]);
        let valid = points.len() == usize::from(header.regions) * octaves * stops
            && (1..=MAX_OCTAVES).contains(&octaves)
            && density > 0.0
            && density <= 1e12
            && numbers.into_iter().all(|number| (0.0..=1e6).contains(&number));
        valid.then_some(Self { density, octaves, stops, points })
    }

    /// Pixels to a metre of octave 0; each octave has half as many as the one before.
    pub fn density(&self) -> f32 {
        self.density
    }

    /// How many octaves there are.
    pub fn octaves(&self) -> usize {
        self.octaves
    }

    /// Region `region` at an octave, with as many Gaussians as [`count_at`] says of `stop`.
    pub fn point(&self, region: usize, octave: usize, stop: usize) -> Option<CurvePoint> {
        if octave >= self.octaves || stop >= self.stops {
            return None;
        }
        let row = region.checked_mul(self.octaves)?.checked_add(octave)?;
        let point = self.points.get(row.checked_mul(self.stops)?.checked_add(stop)?)?;
        Some(CurvePoint { error: point.error.get(), blends: point.blends.get() })
    }
}
