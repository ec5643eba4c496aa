//! Gaussians of the first layers, put on the triangles of a coarser mesh.

use glam::Vec3;
use rayon::prelude::*;

use super::surface::Surface;
use crate::nearest::Nearest;
use crate::optimize::cloud::Seed;
use crate::optimize::forward::Stage;

/// Triangles that are looked at, those first that are nearest at rest.
const CANDIDATES: usize = 16;

/// The triangles of a coarser mesh.
pub struct Carriers<'c> {
    surface: &'c Surface,
    stages: &'c [Stage],
    nearest: Nearest,
}

impl<'c> Carriers<'c> {
    /// Triangles of `surface`, the rest pose of all meshes, which stands in `stages` in the training poses.
    pub fn new(
        surface: &'c Surface,
        stages: &'c [Stage],
        triangles: impl Iterator<Item = u32>,
    ) -> Self {
        let places = triangles.filter(|&triangle| surface.area(triangle) > 0.0).map(|triangle| {
            (triangle, surface.corners(triangle).map(|corner| corner.as_dvec3().to_array()))
        });
        Self { surface, stages, nearest: Nearest::of(places) }
    }

    /// Puts Gaussians on the triangles that carry them best.
    pub fn carry(&self, seeds: &mut [Seed]) {
        seeds.par_iter_mut().for_each(|seed| {
            if let Some(triangle) = self.best(seed) {
                *seed = self.carried(seed, triangle);
            }
        });
    }

    /// Of the triangles near it that look the same way the one that leaves the rim of the disc nearest to where its own triangle
    /// has it, in all training poses; none if there is none.
    fn best(&self, seed: &Seed) -> Option<u32> {
        let place = self.place(seed).as_dvec3().to_array();
        let normal = self.surface.normal(seed.triangle);
        let alike = |&triangle: &u32| self.surface.normal(triangle).dot(normal) > 0.0;
        let candidates = self.nearest.by_distance(place).take(CANDIDATES).filter(alike);
        let candidates =
            candidates.filter_map(|triangle| Some((self.error(seed, triangle)?, triangle)));
        candidates.min_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, triangle)| triangle)
    }

    fn place(&self, seed: &Seed) -> Vec3 {
        self.surface.point(seed.triangle, seed.parameters.position)
    }

    /// log₂ of a round disc's standard deviation at rest, metres.
    fn log2_sigma(&self, seed: &Seed) -> f32 {
        let [a, b] = seed.parameters.log2_scale;
        0.5 * (a + b + libm::log2f(self.surface.area(seed.triangle)))
    }

    /// Sum over the training poses of the square of how far a triangle would leave a Gaussian from where its own has it, and
    /// of how far its rim, m²; `None` where one of the two has no frame.
    fn error(&self, seed: &Seed, triangle: u32) -> Option<f32> {
        let local = self.surface.local(triangle, self.place(seed));
        let sigma = libm::exp2f(self.log2_sigma(seed));
        let mut sum = 0.0;
        for stage in self.stages {
            let [own, other] = [seed.triangle, triangle].map(|t| stage.frames[t as usize].as_ref());
            let (own, other) = (own?, other?);
            let places = [own.point(seed.parameters.position), other.point(local)].map(Vec3::from);
            let normals = [own.z, other.z].map(|z| Vec3::from(z).normalize_or_zero());
            let rim = sigma * (normals[0] - normals[1]).length();
            sum += places[0].distance_squared(places[1]) + rim * rim;
        }
        sum.is_finite().then_some(sum)
    }

    /// The same round disc in the same place at rest, flat on another triangle.
    fn carried(&self, seed: &Seed, triangle: u32) -> Seed {
        // In units of √(triangle area).
        let log2_sigma = self.log2_sigma(seed) - 0.5 * libm::log2f(self.surface.area(triangle));
        let (angle, round) = self.surface.round_disc(triangle);
        let mut carried = *seed;
        carried.triangle = triangle;
        carried.parameters.position = self.surface.local(triangle, self.place(seed));
        carried.parameters.angle = angle;
        carried.parameters.log2_scale = round.map(|s| (log2_sigma + s).clamp(-30.0, 30.0));
        carried
    }
}
