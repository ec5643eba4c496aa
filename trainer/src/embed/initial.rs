//! The first colour, scale and opacity of a Gaussian, from the texture and the spacing.

use super::surface::{Surface, SurfacePoint};
use crate::optimize::cloud::{Freedom, Parameters, Seed};
use crate::scene::Painter;

/// Standard deviation in units of the spacing √(area / Gaussians).
const SIGMA_PER_SPACING: f32 = 0.6;
/// Opacity of an opaque surface.
const OPACITY: f32 = 0.985;

/// A disc flat on its triangle that stands for `area` m² of the surface.
pub fn seed(
    surface: &Surface,
    painter: &Painter<'_>,
    point: &SurfacePoint,
    area: f32,
    freedom: Freedom,
) -> Seed {
    let triangle_area = surface.area(point.triangle).max(f32::MIN_POSITIVE);
    let share = area / triangle_area;
    let triangle = point.triangle as usize;
    let footprint = painter.footprint_of_share(triangle, share);
    let (color, coverage) = painter.surface_color(triangle, point.barycentrics, &footprint);
    let opacity = (OPACITY * coverage).clamp(0.01, OPACITY);
    // In units of √(triangle area) the spacing is √share.
    let log2_sigma = libm::log2f(SIGMA_PER_SPACING) + 0.5 * libm::log2f(share);
    let (angle, round) = surface.round_disc(point.triangle);
    let parameters = Parameters {
        position: surface.local(point.triangle, surface.position(point)),
        angle,
        log2_scale: round.map(|scale| (log2_sigma + scale).clamp(-30.0, 30.0)),
        logit: libm::logf(opacity / (1.0 - opacity)),
        color,
    };
    Seed { triangle: point.triangle, parameters, freedom }
}
