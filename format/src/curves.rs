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
    /// Levels, nothing included.
    levels: usize,
    points: &'a [CurvePointRecord],
}

/// Octaves at most.
pub const MAX_OCTAVES: usize = 8;

impl<'a> Curves<'a> {
    /// `None` where the payload is not as long as its head and the header say, or holds numbers that no curve has.
    pub(crate) fn split(payload: &'a [u8], header: &Header) -> Option<Self> {
        let ([head], rest) = take_plane::<CurvesRecord>(payload, 1)? else { return None };
        let (octaves, levels) = (usize::from(head.octaves), usize::from(header.layers) + 1);
        let points: &[CurvePointRecord] = plane(rest)?;
        let density = head.density.get();
        let numbers = points.iter().flat_map(|point| [point.error.get(), point.blends.get()]);
        let valid = points.len() == usize::from(header.regions) * octaves * levels
            && (1..=MAX_OCTAVES).contains(&octaves)
            && density > 0.0
            && density <= 1e12
            && numbers.into_iter().all(|number| (0.0..=1e6).contains(&number));
        valid.then_some(Self { density, octaves, levels, points })
    }

    /// Pixels to a metre of octave 0; each octave has half as many as the one before.
    pub fn density(&self) -> f32 {
        self.density
    }

    /// How many octaves there are.
    pub fn octaves(&self) -> usize {
        self.octaves
    }

    /// Region `region` at an octave, with the first `layers` layers: nothing with 0.
    pub fn point(&self, region: usize, octave: usize, layers: usize) -> Option<CurvePoint> {
        if octave >= self.octaves || layers >= self.levels {
            return None;
        }
        let place = (region * self.octaves + octave) * self.levels + layers;
        let point = self.points.get(place)?;
        Some(CurvePoint { error: point.error.get(), blends: point.blends.get() })
    }
}
