//! Coarser meshes of the same vertices, on whose triangles the first Gaussians stand: an avatar that is far away skins few
//! vertices.

use core::ops::Range;

use crate::header::{Header, MAX_LAYERS};
use crate::record::{U32, plane};

/// Meshes of an avatar, from the surface itself to the coarsest. Their triangles stand one mesh after the other.
#[derive(Clone, Copy, Debug)]
pub struct MeshLevels<'a> {
    surface: u32,
    /// Triangles of each that is coarser.
    coarser: &'a [U32],
}

impl<'a> MeshLevels<'a> {
    /// The surface alone.
    pub(crate) fn of_one(triangles: u32) -> Self {
        Self { surface: triangles, coarser: &[] }
    }

    /// `None` where there are more levels than an avatar can have layers, one is empty, or nothing is left for the surface.
    pub(crate) fn split(payload: &'a [u8], header: &Header) -> Option<Self> {
        let coarser: &[U32] = plane(payload)?;
        let all: u64 = coarser.iter().map(|triangles| u64::from(triangles.get())).sum();
        let surface = u64::from(header.triangles).checked_sub(all).filter(|&left| left > 0)?;
        let fits =
            coarser.len() < MAX_LAYERS && coarser.iter().all(|triangles| triangles.get() > 0);
        fits.then_some(Self { surface: surface as u32, coarser })
    }

    /// How many there are, at least 1.
    pub fn count(&self) -> usize {
        1 + self.coarser.len()
    }

    /// Triangles of the surface: the first ones of the avatar. All that a picture covers is theirs; those behind them carry
    /// Gaussians alone.
    pub fn surface(&self) -> u32 {
        self.surface
    }

    /// Triangles of each, the surface's first.
    pub fn ranges(&self) -> impl Iterator<Item = Range<u32>> + use<'a> {
        let mut end = 0u32;
        core::iter::once(self.surface).chain(self.coarser.iter().map(|n| n.get())).map(move |n| {
            let start = end;
            // Their sum is the header's triangles.
            end = end.wrapping_add(n);
            start..end
        })
    }
}
