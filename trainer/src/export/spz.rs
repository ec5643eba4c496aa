//! SPZ, version 3: the newest one that programs commonly read (4 is of 2026). The layout stands in
//! [`convert::spz`](crate::convert).

use std::io::Write;

use anyhow::{Context, Result};
use flate2::Compression;
use flate2::write::GzEncoder;

use super::Packed;
use crate::convert::Splats;
use crate::convert::spz::{COMPENSATED, MAGIC};
use crate::convert::spz_codes::{
    Code, alpha_code, color_code, harmonic_code, position_bytes, rotation_bytes, scale_code,
};

const VERSION: u32 = 3;

/// Positions have at most so many bits after the binary point, 15 µm: what compresses worse than it shows.
const MOST_FRACTION_BITS: u8 = 16;

/// Packs Gaussians into SPZ: positions within half of 15 µm, or of what 2²² such steps cannot reach; scales within
/// 3.2 %, at least 45 µm; opacity within 1/510; constant colour within 1/270; coefficients within 1/256. Codes reach
/// constant colours of −0.44 to 1.44, coefficients of −1 to 0.992 and scales of 384 m.
///
/// # Errors
///
/// Where there are more Gaussians than 32 bits can count, or one stands over 8,388 km off.
pub fn spz(splats: &Splats) -> Result<Packed> {
    let count =
        u32::try_from(splats.gaussians.len()).context("too many Gaussians; lower the budget")?;
    let fraction_bits = fraction_bits(splats)?;
    let mut planes: [Vec<u8>; 6] = Default::default();
    let mut clamped = 0;
    for (index, g) in splats.gaussians.iter().enumerate() {
        let mut fits = true;
        let mut code = |(code, fit): Code| {
            fits &= fit;
            code
        };
        let [positions, alphas, colors, scales, rotations, harmonics] = &mut planes;
        positions.extend(g.position.iter().flat_map(|&x| position_bytes(x.into(), fraction_bits)));
        alphas.push(code(alpha_code(g.opacity.into())));
        colors.extend(g.color.map(|c| code(color_code(c.into()))));
        scales.extend(g.log2_scale.map(|s| code(scale_code(s.into()))));
        rotations.extend(rotation_bytes(g.rotation.map(f64::from)));
        let coefficients = splats.harmonics.get(index).into_iter().flatten();
        harmonics.extend(coefficients.map(|&x| code(harmonic_code(x.into()))));
        clamped += usize::from(!fits);
    }
    let flags = if splats.compensated { COMPENSATED } else { 0 };
    let mut stream = GzEncoder::new(Vec::new(), Compression::default());
    let written = [&MAGIC[..], &VERSION.to_le_bytes(), &count.to_le_bytes()]
        .into_iter()
        .chain([&[splats.degree, fraction_bits, flags, 0][..]])
        .chain(planes.iter().map(Vec::as_slice))
        .try_for_each(|bytes| stream.write_all(bytes));
    let bytes = written.and_then(|()| stream.finish()).context("cannot be compressed")?;
    Ok(Packed { bytes, clamped })
}

/// As many as let the furthest coordinate have 23 bits and a sign.
fn fraction_bits(splats: &Splats) -> Result<u8> {
    let coordinates = splats.gaussians.iter().flat_map(|g| g.position);
    let furthest = coordinates.fold(0.0, |furthest: f64, x| furthest.max(f64::from(x).abs()));
    let fits = |bits: &u8| furthest * libm::exp2(f64::from(*bits)) <= f64::from((1 << 23) - 1);
    (0..=MOST_FRACTION_BITS).rev().find(fits).with_context(|| {
        format!("a Gaussian stands {furthest:.0} m off, SPZ ends at 8,388,607 m; write a PLY")
    })
}
