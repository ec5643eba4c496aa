//! A standing figure of any number of Gaussians, made without input: the scene that speed is
//! measured on where there is no mesh to cull by (flat discs on capsules, 1.7 m high).
//!
//! Discs lie on the surface by a low-discrepancy sequence; their tangential σ is the mean spacing
//! times a lognormal number, so that the figure is closed at every count. It stands on y = 0 and faces
//! +Z, +Y up. The same count gives the same bytes on every platform (libm's functions alone).

mod body;

use anyhow::{Result, ensure};
use dermis_runtime::Camera;
use glam::{DMat3, DQuat, DVec3};

use crate::camera_file::Shot;
use crate::convert::splats::Splat;
use crate::convert::{LeftOut, Splats, pack};
use crate::optimize::schedule::Random;
use body::Point;

/// Sum of a count and this is the seed.
const SEED: u64 = 7;
/// Standard deviation of ln σ.
const SCALE_SPREAD: f64 = 0.25;
/// Thickness of a disc, in its lesser σ.
const THICKNESS: f64 = 0.1;
/// Standard deviation of the distance to the surface, in mean spacings.
const ROUGHNESS: f64 = 0.15;
/// Standard deviation of each colour channel.
const COLOR_NOISE: f64 = 0.02;
/// Least and greatest opacity.
const OPACITY: [f64; 2] = [0.6, 0.99];
/// Where cameras look, metres.
const TARGET: [f32; 3] = [0.0, 0.85, 0.0];

/// A `.dermis` file of `count` Gaussians: no mesh, full records, classic low-pass.
///
/// # Errors
///
/// Where `count` is 0.
pub fn avatar(count: u32) -> Result<Vec<u8>> {
    ensure!(count > 0, "a mannequin needs at least one Gaussian; give a greater count");
    pack(gaussians(count))
}

/// A camera in front of the figure, `distance` metres from its middle, that sees `size × size` pixels
/// with a focal length of `size` pixels, before white. Measurements use 2 m and 540, or 8 m and 1080.
pub fn camera(distance: f32, size: u32) -> Shot {
    let [x, y, z] = TARGET;
    let (focal, center) = (size as f32, size as f32 / 2.0);
    // At the target + (0, 0, distance): x to the right as the world's, y down, z against the world's.
    let world_to_camera =
        [[1.0, 0.0, 0.0, -x], [0.0, -1.0, 0.0, y], [0.0, 0.0, -1.0, z + distance]];
    let (width, height) = (size, size);
    let camera =
        Camera { width, height, fx: focal, fy: focal, cx: center, cy: center, world_to_camera };
    Shot { camera, background: [1.0; 3] }
}

/// The figure in `count` Gaussians.
pub fn gaussians(count: u32) -> Splats {
    let mut random = Random::new(SEED + u64::from(count));
    let (points, area) = body::points(count, &mut random);
    let spacing = (area / f64::from(count)).sqrt();
    let (mut splats, mut left_out) = (Splats::default(), LeftOut::default());
    for point in &points {
        splats.push(&disc(point, spacing, &mut random), &mut left_out);
    }
    debug_assert_eq!(left_out, LeftOut::default(), "all can be seen");
    splats
}

/// A disc on the surface, turned about its normal at random.
fn disc(point: &Point, spacing: f64, random: &mut Random) -> Splat<'static> {
    let normal = point.normal;
    let (u, v) = body::around(normal);
    let (sin, cos) = libm::sincos(std::f64::consts::TAU * f64::from(random.unit()));
    let first = u * cos + v * sin;
    let rotation = DQuat::from_mat3(&DMat3::from_cols(first, normal.cross(first), normal));
    let mut sigma = || spacing * libm::exp(SCALE_SPREAD * gauss(random));
    let (a, b) = (sigma(), sigma());
    let noise = DVec3::new(gauss(random), gauss(random), gauss(random)) * COLOR_NOISE;
    let [least, greatest] = OPACITY;
    Splat {
        position: (point.position + normal * (ROUGHNESS * spacing * gauss(random))).to_array(),
        rotation: [rotation.w, rotation.x, rotation.y, rotation.z],
        log2_scale: [a, b, THICKNESS * a.min(b)].map(libm::log2),
        color: (body::color(point) + noise)
            .clamp(DVec3::splat(0.02), DVec3::splat(0.98))
            .to_array(),
        opacity: least + (greatest - least) * f64::from(random.unit()),
        harmonics: &[],
    }
}

/// Standard normal (Box and Muller).
fn gauss(random: &mut Random) -> f64 {
    // In (0, 1], which has a logarithm.
    let distance = 1.0 - f64::from(random.unit());
    let angle = std::f64::consts::TAU * f64::from(random.unit());
    (-2.0 * libm::log(distance)).sqrt() * libm::cos(angle)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_gaussians_are_there_and_stand_in_the_figure() {
        for count in [1, 50, 3000] {
            let splats = gaussians(count);
            assert_eq!(splats.gaussians.len(), count as usize);
            for g in &splats.gaussians {
                let [x, y, z] = g.position;
                assert!(x.abs() < 0.8 && (-0.3..2.0).contains(&y) && z.abs() < 0.5, "{g:?}");
                assert!((0.6..=0.99).contains(&g.opacity));
                assert!(g.log2_scale[2] < g.log2_scale[0].min(g.log2_scale[1]) - 3.0, "flat");
            }
        }
        assert!(avatar(0).is_err());
    }

    #[test]
    fn gauss_is_standard_normal() {
        let mut random = Random::new(1);
        let numbers: Vec<f64> = (0..20_000).map(|_| gauss(&mut random)).collect();
        let mean = numbers.iter().sum::<f64>() / 20_000.0;
        let variance = numbers.iter().map(|x| x * x).sum::<f64>() / 20_000.0 - mean * mean;
        assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.05, "{mean} {variance}");
    }
}
