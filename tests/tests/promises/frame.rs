//! Whole frames, bit by bit.

use dermis_runtime::raster::Counts;
use dermis_runtime::{Camera, Error, Plan, Posed, Prepared};

/// A frame before it is rounded: bits of every tile's red, green, blue and transmittance, and what
/// drawing took.
pub(crate) type Bits = (Vec<u32>, Counts);

/// Draws a frame in `scratch` of this band.
pub(crate) fn bits(prepared: &Prepared<'_>, scratch: &mut [u32]) -> Result<Bits, Error> {
    let mut bits = Vec::new();
    let counts = prepared.for_each_tile(0..prepared.tile_rows(), scratch, |_, _, pixels| {
        bits.extend(pixels.0.as_flattened().as_flattened().iter().map(|x| x.to_bits()));
    })?;
    Ok((bits, counts))
}

/// Draws a frame of a posed avatar in fresh memory.
pub(crate) fn fresh(posed: &Posed<'_, '_>, plan: &Plan, camera: &Camera) -> Bits {
    let (width, height, budget) = (camera.width, camera.height, plan.gaussians());
    let mut preparing = vec![0; Prepared::scratch_len(posed.avatar(), budget, width, height)];
    let prepared = Prepared::new(posed, plan, camera, &mut preparing).expect("it fits");
    let mut drawing = vec![0; Prepared::band_scratch_len(budget, width, height)];
    bits(&prepared, &mut drawing).expect("it fits")
}
