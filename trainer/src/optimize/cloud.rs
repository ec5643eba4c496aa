//! The Gaussians in training: parameters in the order of the file.

use dermis_format::{Disc, order};
use dermis_runtime::mix::{between, mixed};
use dermis_runtime::plan::{arrival_log2_scale, lower_share, prefix_log2_scale};
use serde::{Deserialize, Serialize};

use super::turns::turns;

/// Numbers that describe one disc.
pub const PARAMETERS: usize = 10;

/// Parameters of one disc, in the frame of its triangle, lengths in units of the frame's size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Parameters {
    /// x, y in the triangle's plane, z along its normal.
    pub position: [f32; 3],
    /// From the frame's x to the first axis, radians.
    pub angle: f32,
    /// log₂ of the standard deviations.
    pub log2_scale: [f32; 2],
    /// log(o / (1 − o)) of the opacity o.
    pub logit: f32,
    /// Display-referred sRGB.
    pub color: [f32; 3],
}

impl Parameters {
    /// In the order of the fields.
    pub fn to_array(self) -> [f32; PARAMETERS] {
        let ([x, y, z], [s, t], [r, g, b]) = (self.position, self.log2_scale, self.color);
        [x, y, z, self.angle, s, t, self.logit, r, g, b]
    }

    /// The inverse of [`Self::to_array`].
    pub fn from_array([x, y, z, angle, s, t, logit, r, g, b]: [f32; PARAMETERS]) -> Self {
        Self { position: [x, y, z], angle, log2_scale: [s, t], logit, color: [r, g, b] }
    }

    /// In [0, 1].
    pub fn opacity(&self) -> f32 {
        1.0 / (1.0 + libm::expf(-self.logit))
    }

    /// The inverse of [`Self::disc`], for opacities that a logit can have.
    pub fn of_disc(disc: &Disc) -> Self {
        let opacity = disc.opacity.clamp(1e-4, 1.0 - 1e-4);
        Self {
            position: disc.position,
            angle: disc.angle,
            log2_scale: disc.log2_scale,
            logit: libm::logf(opacity / (1.0 - opacity)),
            color: disc.color,
        }
    }

    /// The same disc in another shape: with scales and opacity of `shape`.
    pub fn shaped(&self, shape: &Self) -> Self {
        Self { log2_scale: shape.log2_scale, logit: shape.logit, ..*self }
    }

    /// Moves all but the shape by `share` of the way from one disc to another.
    pub fn pull(&mut self, [from, to]: [&Self; 2], share: f32) {
        let pull = |number: &mut f32, from: f32, to: f32| *number += share * (to - from);
        for i in 0..3 {
            pull(&mut self.position[i], from.position[i], to.position[i]);
            pull(&mut self.color[i], from.color[i], to.color[i]);
        }
        pull(&mut self.angle, from.angle, to.angle);
    }

    /// Moves it to the plane of its triangle, by so much at most.
    pub fn flatten(&mut self, by: f32) {
        let [.., z] = &mut self.position;
        *z = (z.abs() - by).max(0.0).copysign(*z);
    }

    /// As the file stores it.
    pub fn disc(&self) -> Disc {
        Disc {
            position: self.position,
            angle: self.angle,
            log2_scale: self.log2_scale,
            color: self.color,
            opacity: self.opacity(),
        }
    }

    /// The gradient by these parameters, given that by their [`Self::disc`].
    #[inline(always)]
    pub fn gradient(&self, by: &Disc) -> Self {
        let opacity = self.opacity();
        Self {
            position: by.position,
            angle: by.angle,
            log2_scale: by.log2_scale,
            // d o / d logit = o (1 − o).
            logit: by.opacity * opacity * (1.0 - opacity),
            color: by.color,
        }
    }
}

/// What training may move.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Freedom {
    /// Nothing: a Gaussian of an earlier layer.
    Fixed,
    /// The opacity alone: a Gaussian of an earlier layer of LapisGS.
    Opacity,
    /// All but the position: a Gaussian on a vertex (LoDAvatar, 3.5).
    Anchored,
    /// Everything.
    Free,
}

/// A Gaussian before it has a place in the file.
#[derive(Clone, Copy, Debug)]
pub struct Seed {
    /// Its triangle.
    pub triangle: u32,
    /// What it is.
    pub parameters: Parameters,
    /// What training may move.
    pub freedom: Freedom,
}

/// All Gaussians of a region, in the order of the file. An avatar is a list of them.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Cloud {
    /// Gaussians of each layer.
    pub layers: Vec<u32>,
    /// How many of these, the first ones, stand on coarser meshes.
    pub coarser_layers: usize,
    /// Triangle of each Gaussian.
    pub triangles: Vec<u32>,
    /// What training may move of each.
    pub freedoms: Vec<Freedom>,
    /// Rank of each in the nested order.
    pub ranks: Vec<u32>,
    /// Index of each among the seeds it was arranged from.
    pub origins: Vec<u32>,
    /// What the Gaussians are, level by level: a level holds those of its layer and of all layers before.
    /// A single level holds all, and is theirs at every count.
    pub levels: Vec<Vec<Parameters>>,
    /// Whether the last level's Gaussians of earlier layers have a shape of their own alone: position, angle and colour are
    /// those of the level before.
    pub last_is_shape: bool,
}

impl Cloud {
    /// How many.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Puts Gaussians that stand coarse to fine into the order of the file: layer by layer, in each by triangle, dealt to
    /// blocks by [`turns`]. Inside a layer the format's rule takes the place of the rank they came with.
    pub fn arrange(layers: Vec<u32>, coarse_to_fine: &[Seed]) -> Self {
        let triangle = |origin: u32| coarse_to_fine[origin as usize].triangle;
        let mut places = turns(&layers);
        let mut origins = vec![0; places.len()];
        let (mut rest, mut first) = (&mut places[..], 0);
        for &layer in &layers {
            let mut by_triangle: Vec<u32> = (first..first + layer).collect();
            by_triangle.sort_by_key(|&origin| triangle(origin));
            for run in by_triangle.chunk_by(|&a, &b| triangle(a) == triangle(b)) {
                // Which of a triangle's Gaussians takes which turn is free: coarser ones come first.
                let (places, later) = rest.split_at_mut(run.len());
                places.sort_unstable();
                places
                    .iter()
                    .zip(run)
                    .for_each(|(&place, &origin)| origins[place as usize] = origin);
                rest = later;
            }
            first += layer;
        }
        let seeds = || origins.iter().map(|&origin| &coarse_to_fine[origin as usize]);
        let ranks = order::blocks(&layers).flat_map(|(_, first, count)| {
            (0..count).map(move |place| first + order::rank(place, count))
        });
        Self {
            coarser_layers: 0,
            triangles: seeds().map(|seed| seed.triangle).collect(),
            freedoms: seeds().map(|seed| seed.freedom).collect(),
            ranks: ranks.collect(),
            levels: vec![seeds().map(|seed| seed.parameters).collect()],
            last_is_shape: false,
            origins,
            layers,
        }
    }

    /// Gives every level parameters of its own, `wider` added to log₂ of their scales: of how many Gaussians the
    /// level has and how many there are.
    pub fn split_into_levels(&mut self, wider: impl Fn([u32; 2]) -> f32) {
        let all = self.full().to_vec();
        let mut count = 0;
        let counts = self.layers.iter().map(|layer| {
            count += layer;
            count
        });
        // Layers without Gaussians are no levels of their own.
        let mut counts: Vec<u32> = counts.filter(|&count| count > 0).collect();
        counts.dedup();
        self.levels = counts
            .iter()
            .map(|&count| {
                let wider = wider([count, all.len() as u32]);
                let widened = |p: &Parameters| {
                    let mut p = *p;
                    p.log2_scale.iter_mut().for_each(|scale| *scale += wider);
                    p
                };
                all[..count as usize].iter().map(widened).collect()
            })
            .collect();
    }

    /// The level with which Gaussians of a level share all but their shape, if there is one.
    pub fn base_of(&self, level: usize) -> Option<usize> {
        let is_shape = self.last_is_shape && level + 1 == self.levels.len();
        level.checked_sub(1).filter(|_| is_shape)
    }

    /// Lets a level share what it has to with the level before.
    pub fn share_base(&mut self, level: usize) {
        if let Some(base) = self.base_of(level)
            && let [.., base, shapes] = &mut self.levels[..=base + 1]
        {
            shapes.iter_mut().zip(base).for_each(|(shape, base)| *shape = base.shaped(shape));
        }
    }

    /// Parameters of all Gaussians at the last level.
    pub fn full(&self) -> &[Parameters] {
        self.levels.last().map_or(&[], Vec::as_slice)
    }

    /// What Gaussian `index` is in a picture of `prefix`.
    #[inline]
    pub fn disc(&self, prefix: &Prefix, index: usize) -> Disc {
        let mut disc = self.levels[prefix.level][index].disc();
        match prefix.lower(self, index) {
            Some(lower) => {
                let (lower, share) = (lower.disc(), prefix.lower_share);
                let opacity = between(disc.opacity, lower.opacity, share);
                Disc { opacity, ..mixed(&disc, &lower, share) }
            }
            None => {
                disc.log2_scale.iter_mut().for_each(|scale| *scale += prefix.log2_scale);
                disc
            }
        }
    }
}

/// How many Gaussians a picture has, and what that makes of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prefix {
    /// Gaussians of lower rank are drawn.
    pub count: u32,
    /// Their level: the first one that holds them all.
    pub level: usize,
    /// How far Gaussians of the level below have gone there, in [0, 1).
    pub lower_share: f32,
    /// Added to log₂ of the scales of Gaussians that have no level below: of all at the first one, else of those that arrive.
    pub log2_scale: f32,
}

impl Prefix {
    /// All of each region.
    pub fn whole(clouds: &[Cloud]) -> Vec<Self> {
        clouds.iter().map(|cloud| Self::of(cloud.len() as u32, cloud)).collect()
    }

    /// The first `count` of a cloud, all of it at most. Those that arrive are as at their level, but wider, the others
    /// [`lower_share`] of the way to the level below; at the first level all arrive.
    pub fn of(count: u32, cloud: &Cloud) -> Self {
        let level = cloud.levels.iter().position(|level| level.len() >= count as usize);
        let level = level.unwrap_or(cloud.levels.len().saturating_sub(1));
        let len_of = |level: usize| cloud.levels.get(level).map_or(0, |level| level.len() as u32);
        let (lower_share, log2_scale) = match level.checked_sub(1) {
            Some(lower) => {
                let [lower, upper] = [len_of(lower), len_of(level)];
                (lower_share(count, [lower, upper]), arrival_log2_scale(count, upper))
            }
            None => (0.0, prefix_log2_scale(count, len_of(level))),
        };
        Self { count, level, lower_share, log2_scale }
    }

    /// Whether it is a whole level, each Gaussian as at that, or nothing.
    pub fn is_level_of(&self, cloud: &Cloud) -> bool {
        let whole = |level: &Vec<_>| level.len() == self.count as usize;
        self.count == 0 || cloud.levels.get(self.level).is_none_or(whole)
    }

    /// Whether a picture of it takes anything from parameters of a level.
    pub fn shows(&self, level: usize) -> bool {
        level == self.level || (level + 1 == self.level && self.lower_share > 0.0)
    }

    /// What Gaussian `index` is at the level below, where that matters.
    #[inline]
    pub fn lower<'a>(&self, cloud: &'a Cloud, index: usize) -> Option<&'a Parameters> {
        let lower = self.level.checked_sub(1).filter(|_| self.lower_share > 0.0)?;
        cloud.levels[lower].get(index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_stand_by_triangle_and_the_coarser_of_a_triangle_come_first() {
        let layers = vec![700, 0, 14_000];
        let seed = |i: u32| Seed {
            triangle: (i.wrapping_mul(0x9e37_79b1) >> 8) % 900,
            parameters: Parameters { angle: i as f32, ..Parameters::default() },
            freedom: Freedom::Free,
        };
        let seeds: Vec<Seed> = (0..layers.iter().sum()).map(seed).collect();
        let cloud = Cloud::arrange(layers.clone(), &seeds);
        let mut ranks = cloud.ranks.clone();
        ranks.sort_unstable();
        assert!(ranks.into_iter().eq(0..14_700));
        for (_, first, count) in order::blocks(&layers) {
            assert!(cloud.triangles[first as usize..][..count as usize].is_sorted());
        }
        let mut last = std::collections::BTreeMap::new();
        for (place, (&origin, &triangle)) in cloud.origins.iter().zip(&cloud.triangles).enumerate()
        {
            let seed = &seeds[origin as usize];
            assert_eq!((triangle, cloud.full()[place].angle), (seed.triangle, origin as f32));
            let layer = place >= 700;
            assert_eq!(layer, origin >= 700, "it stays in its layer");
            assert!(last.insert((layer, triangle), origin).is_none_or(|before| before < origin));
        }
    }

    #[test]
    fn flattening_ends_at_the_plane() {
        for (z, by, expected) in
            [(0.5, 0.2, 0.3), (-0.5, 0.2, -0.3), (0.1, 0.2, 0.0), (-0.1, 0.2, 0.0), (0.5, 0.0, 0.5)]
        {
            let mut parameters = Parameters { position: [1.0, -2.0, z], ..Parameters::default() };
            parameters.flatten(by);
            let expected = Parameters { position: [1.0, -2.0, expected], ..Parameters::default() };
            assert_eq!(parameters, expected);
        }
    }
}
