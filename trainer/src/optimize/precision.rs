//! How many bits each number of a disc gets: as few as a wanted loss allows, level by level.
//!
//! Rounding errors of different numbers are independent, and small: the squared difference that each makes in a picture
//! adds to the others', and falls by four for each bit. So each number's is measured once, at few bits, and bits go
//! one by one to where they lessen the sum most, until it is small beside the squared error that the level has anyway.
//! This is the allocation of bits of transform coding (Huang and Schultheiss 1963, whole bits as Fox 1966), with the
//! picture as the judge: the rule says in which order bits come, and the level is drawn to see how many of them it
//! takes. Ranges end where [`Limits`] puts them for so many bits.

use anyhow::Result;
use dermis_format::DiscWidths;
use dermis_format::discs::MOST_BITS;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::adam::Moments;
use super::cloud::{Cloud, Parameters, Prefix};
use super::descend::Problem;
use super::forward::{Stage, draw};
use super::limits::Limits;
use super::rounding::level_as_stored;
use crate::picture::{Picture, mean_square};
use crate::truth::{Scratch, TrainingView};

/// Views that decide, evenly spread over all: they are seen of a dozen pictures each at every level.
const VIEWS: usize = 4;

/// Bits of the number that is measured; enough for its error to be small, few enough for it to be far above that of 8.
const PROBE: u8 = 5;

/// Of what a level may lose, the share of one whose numbers the next one takes over: bits of the many that arrive there are
/// dearer. Half of it makes the smallest files (a quarter 0.8 % larger ones, all 0.8 %).
const BASE_SHARE: f64 = 0.5;

/// How exact a file's numbers are.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Precision {
    /// Bits, layer by layer.
    pub widths: Vec<DiscWidths>,
    /// Ends of ranges of each region, level by level.
    limits: Vec<Vec<Limits>>,
}

impl Precision {
    /// Bits of each number of discs at each layer of the file that ends a level, so that a level's PSNR falls by
    /// `max_loss_db` at most on the training views. Clouds of one level have one choice for all layers. `moments` are those
    /// of each region's Gaussians, level by level.
    ///
    /// # Errors
    ///
    /// Where a picture cannot be read, or a number is not finite.
    pub fn choose(
        clouds: &[Cloud],
        moments: &[&[Vec<Moments>]],
        problem: &Problem<'_>,
        max_loss_db: f32,
    ) -> Result<Self> {
        let widths = widths(clouds, moments, problem, max_loss_db)?;
        let of_cloud = |(cloud, moments): (&Cloud, &&[Vec<Moments>])| {
            let levels = cloud.levels.iter().zip(*moments);
            levels.map(|(level, moments)| Limits::choose(cloud, level, moments, &widths)).collect()
        };
        let limits = clouds.iter().zip(moments).map(of_cloud).collect();
        Ok(Self { widths, limits })
    }

    /// What a file takes of clouds: numbers beyond the ends of their ranges stand at the ends.
    pub fn within_limits(&self, clouds: &[Cloud]) -> Vec<Cloud> {
        let of_cloud = |(cloud, limits): (&Cloud, &Vec<Limits>)| {
            let mut within = cloud.clone();
            for (number, limits) in limits.iter().enumerate() {
                limits.keep(cloud, &mut within.levels[number]);
                within.share_base(number);
            }
            within
        };
        clouds.iter().zip(&self.limits).map(of_cloud).collect()
    }

    /// What a reader gets of clouds, opacities within 10⁻⁴.
    ///
    /// # Errors
    ///
    /// Where a number is not finite.
    pub fn stored(&self, clouds: &[Cloud]) -> Result<Vec<Cloud>> {
        self.stored_where(clouds, |_, _| true)
    }

    /// The same of the levels that pictures of `drawn` show: the prefix of each region, picture by picture. Other levels stay
    /// as they are.
    ///
    /// # Errors
    ///
    /// Where a number is not finite.
    pub fn stored_as_drawn(&self, clouds: &[Cloud], drawn: &[&[Prefix]]) -> Result<Vec<Cloud>> {
        self.stored_where(clouds, |region, level| {
            drawn.iter().any(|prefixes| prefixes[region].shows(level))
        })
    }

    fn stored_where(
        &self,
        clouds: &[Cloud],
        wanted: impl Fn(usize, usize) -> bool,
    ) -> Result<Vec<Cloud>> {
        let mut all = clouds.to_vec();
        let regions = clouds.iter().zip(&mut all).zip(&self.limits).enumerate();
        for (region, ((cloud, stored), limits)) in regions {
            for (number, limits) in limits.iter().enumerate() {
                let is_base = || cloud.base_of(number + 1).is_some() && wanted(region, number + 1);
                if wanted(region, number) || is_base() {
                    let level = &mut stored.levels[number];
                    limits.keep(cloud, level);
                    *level = level_as_stored(cloud, level, &self.widths)?;
                    stored.share_base(number);
                }
            }
        }
        Ok(all)
    }
}

fn widths(
    clouds: &[Cloud],
    moments: &[&[Vec<Moments>]],
    problem: &Problem<'_>,
    max_loss_db: f32,
) -> Result<Vec<DiscWidths>> {
    let layers = clouds.iter().map(|cloud| cloud.layers.len()).max().unwrap_or(0);
    // A shape is drawn on what its level before has in the file.
    let mut rounded = clouds.to_vec();
    let mut chosen = Vec::with_capacity(layers);
    for layer in 0..layers {
        // An empty layer is no level.
        if problem.views.is_empty() || clouds.iter().all(|cloud| cloud.layers[layer] == 0) {
            chosen.push(DiscWidths::default());
            continue;
        }
        let count = |cloud: &Cloud| cloud.layers[..=layer].iter().sum::<u32>();
        let prefixes = clouds.iter().map(|cloud| Prefix::of(count(cloud), cloud)).collect();
        let level = Level { clouds, moments, problem, prefixes, layers };
        let is_base =
            |(cloud, prefix): (&Cloud, &Prefix)| cloud.base_of(prefix.level + 1).is_some();
        let share = if clouds.iter().zip(&level.prefixes).any(is_base) { BASE_SHARE } else { 1.0 };
        let allowed = share * f64::from(max_loss_db);
        chosen.push(level.choose(allowed, &mut rounded)?);
    }
    if clouds.iter().all(|cloud| cloud.levels.len() < 2)
        && let Some(&last) = chosen.last()
    {
        chosen.fill(last);
    }
    Ok(chosen)
}

/// A level and what it is to look like.
struct Level<'a> {
    clouds: &'a [Cloud],
    moments: &'a [&'a [Vec<Moments>]],
    problem: &'a Problem<'a>,
    prefixes: Vec<Prefix>,
    layers: usize,
}

impl Level<'_> {
    /// Chooses, and leaves the level in `clouds` as rounded; those before are.
    fn choose(&self, max_loss_db: f64, clouds: &mut [Cloud]) -> Result<DiscWidths> {
        let exact = self.pictures(self.clouds);
        let allowed = self.error(&exact)? * (10f64.powf(max_loss_db / 10.0) - 1.0);
        let mut rounded = |widths: DiscWidths| -> Result<f64> {
            // A whole level: no other one is drawn.
            let all = self.clouds.iter().zip(self.moments).zip(&self.prefixes).zip(&mut *clouds);
            for (((cloud, moments), prefix), rounded) in all {
                let number = prefix.level;
                if let (Some(level), Some(moments)) =
                    (cloud.levels.get(number), moments.get(number))
                {
                    rounded.levels[number] = self.rounded(cloud, level, moments, widths)?;
                    rounded.share_base(number);
                }
            }
            Ok(mean_square(&exact, &self.pictures(clouds)))
        };
        let finest = rounded(DiscWidths::default())?;
        let costs = NUMBERS.iter().map(|number| {
            let mut widths = DiscWidths::default();
            *(number.width)(&mut widths) = PROBE;
            Ok((rounded(widths)? - finest).max(0.0) / (number.unit_error)(PROBE))
        });
        let path = by_gain(&costs.collect::<Result<Vec<f64>>>()?);
        // The rule says in which order bits come, pictures how many.
        let (mut low, mut high) = (0, path.len() - 1);
        while low < high {
            let middle = (low + high) / 2;
            if rounded(path[middle])? <= allowed {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        rounded(path[high])?;
        Ok(path[high])
    }

    /// A level of a cloud with numbers of so many bits.
    fn rounded(
        &self,
        cloud: &Cloud,
        level: &[Parameters],
        moments: &[Moments],
        widths: DiscWidths,
    ) -> Result<Vec<Parameters>> {
        let mut level = level.to_vec();
        let widths = vec![widths; self.layers];
        Limits::choose(cloud, &level, moments, &widths).keep(cloud, &mut level);
        level_as_stored(cloud, &level, &widths)
    }

    fn views(&self) -> impl Iterator<Item = &TrainingView> {
        let views = self.problem.views;
        let chosen = VIEWS.min(views.len());
        (0..chosen).map(move |i| &views[(2 * i + 1) * views.len() / (2 * chosen)])
    }

    fn pictures(&self, clouds: &[Cloud]) -> Vec<Picture> {
        let Problem { stages, low_pass, background, .. } = *self.problem;
        let picture = |view: &TrainingView| {
            let stage: &Stage = &stages[view.stage];
            draw(clouds, &self.prefixes, stage, &view.camera, low_pass, background).picture
        };
        self.views().collect::<Vec<_>>().into_par_iter().map(picture).collect()
    }

    /// Mean squared error of pictures.
    fn error(&self, pictures: &[Picture]) -> Result<f64> {
        let (mut scratch, mut truths) = (Scratch::default(), Vec::new());
        for view in self.views() {
            let mut truth = Picture::default();
            view.truth.draw(self.problem.background, 0, &mut scratch, &mut truth)?;
            truths.push(truth);
        }
        Ok(mean_square(pictures, &truths))
    }
}

/// A number of a record.
struct Number {
    /// How many of them a record has.
    times: u32,
    /// Its bits.
    width: fn(&mut DiscWidths) -> &mut u8,
    /// Squared error of one of so many bits, to that of a number whose codes are as far apart as its range is wide.
    unit_error: fn(u8) -> f64,
}

const NUMBERS: [Number; 9] = [
    Number { times: 1, width: |widths| &mut widths.position[0], unit_error: between_ends },
    Number { times: 1, width: |widths| &mut widths.position[1], unit_error: between_ends },
    Number { times: 1, width: |widths| &mut widths.position[2], unit_error: between_ends },
    Number { times: 1, width: |widths| &mut widths.angle, unit_error: around },
    Number { times: 2, width: |widths| &mut widths.scale, unit_error: between_ends },
    Number { times: 1, width: |widths| &mut widths.color[0], unit_error: between_ends },
    Number { times: 1, width: |widths| &mut widths.color[1], unit_error: between_ends },
    Number { times: 1, width: |widths| &mut widths.color[2], unit_error: between_ends },
    Number { times: 1, width: |widths| &mut widths.opacity, unit_error: between_ends },
];

/// Of codes from one end of a range to the other. In the middle of it stands the one code of no bits, which is nearly as
/// good as one at either end.
fn between_ends(bits: u8) -> f64 {
    let codes = f64::from((1u32 << bits) - 1).max(0.8);
    1.0 / (codes * codes)
}

/// Of codes in the middles of equal parts of a turn.
fn around(bits: u8) -> f64 {
    1.0 / f64::from(1u32 << (2 * bits))
}

/// No bits, then one more each time where it saves most of the error for its price, up to 8 each.
fn by_gain(costs: &[f64]) -> Vec<DiscWidths> {
    let widths = |bits: &[u8]| {
        let mut widths = DiscWidths::default();
        for (number, &bits) in NUMBERS.iter().zip(bits) {
            *(number.width)(&mut widths) = bits;
        }
        widths
    };
    let mut bits = [0; NUMBERS.len()];
    let mut path = vec![widths(&bits)];
    loop {
        let gain = |index: usize| {
            let Number { times, unit_error, .. } = NUMBERS[index];
            let saved = unit_error(bits[index]) - unit_error(bits[index] + 1);
            costs[index] * saved / f64::from(times)
        };
        let free = (0..bits.len()).filter(|&index| bits[index] < MOST_BITS);
        let Some(best) = free.max_by(|&a, &b| gain(a).total_cmp(&gain(b))) else { return path };
        bits[best] += 1;
        path.push(widths(&bits));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimize::schedule::Random;

    fn bits(mut widths: DiscWidths) -> [u8; NUMBERS.len()] {
        core::array::from_fn(|i| *(NUMBERS[i].width)(&mut widths))
    }

    fn squares(bits: [u8; NUMBERS.len()], costs: &[f64]) -> f64 {
        let numbers = NUMBERS.iter().zip(bits).zip(costs);
        numbers.map(|((number, bits), cost)| cost * (number.unit_error)(bits)).sum()
    }

    #[test]
    fn angles_are_off_by_what_is_counted() {
        for bits in 0..8 {
            let square = |bits: u8| {
                let step = dermis_format::quant::angle_step(bits);
                let off = |i: u16| {
                    let angle = f32::from(i) * (core::f32::consts::FRAC_PI_2 / 65_536.0);
                    let code = (angle / step).floor();
                    f64::from(angle - (code + 0.5) * step).powi(2)
                };
                (0..=u16::MAX).map(off).sum::<f64>()
            };
            let found = square(bits + 1) / square(bits);
            assert!(
                (found / (around(bits + 1) / around(bits)) - 1.0).abs() < 1e-3,
                "{bits}: {found}"
            );
        }
    }

    #[test]
    fn each_bit_goes_where_it_saves_most_for_its_price() {
        let mut random = Random::new(5);
        for _ in 0..200 {
            let costs = [(); NUMBERS.len()].map(|()| f64::from(libm::exp2f(-20.0 * random.unit())));
            let path: Vec<_> = by_gain(&costs).into_iter().map(bits).collect();
            assert_eq!((path[0], path[path.len() - 1]), ([0; 9], [MOST_BITS; 9]));
            for step in path.windows(2) {
                let per_bit = |to: [u8; NUMBERS.len()], number: usize| {
                    (squares(step[0], &costs) - squares(to, &costs))
                        / f64::from(NUMBERS[number].times)
                };
                let taken: Vec<_> = (0..9).filter(|&i| step[1][i] == step[0][i] + 1).collect();
                assert_eq!(taken.len(), 1);
                for other in (0..9).filter(|&i| step[0][i] < MOST_BITS) {
                    let mut there = step[0];
                    there[other] += 1;
                    assert!(per_bit(there, other) <= per_bit(step[1], taken[0]) * (1.0 + 1e-9));
                }
            }
        }
    }
}
