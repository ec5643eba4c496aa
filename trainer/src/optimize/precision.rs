//! How many bits each number of a disc gets: as few as a wanted loss allows, level by level.
//!
//! Rounding errors of different numbers are independent, and small: the squared difference that each makes in a picture
//! adds to the others', and falls by four for each bit. So each number's is measured once, at few bits, and bits go
//! one by one to where they lessen the sum most, until it is small beside the squared error that the level has anyway. This
//! is the allocation of bits of transform coding (Huang and Schultheiss 1963, whole bits as Fox 1966), with the picture
//! as the judge. What was chosen is then drawn, and corrected where the rule was wrong.

use anyhow::Result;
use dermis_format::DiscWidths;
use rayon::prelude::*;

use super::cloud::{Cloud, Prefix};
use super::descend::Problem;
use super::forward::{Stage, draw};
use super::rounding::level_as_stored;
use crate::picture::Picture;
use crate::truth::{Scratch, TrainingView};

/// Views that decide, evenly spread over all: they are seen of a dozen pictures each at every level.
const VIEWS: usize = 4;

/// Bits of the number that is measured; enough for its error to be small, few enough for it to be far above that of 8.
const PROBE: u8 = 5;

/// Bits of each number of discs at each layer of the file that ends a level, so that a level's PSNR falls by `max_loss_db` at
/// most on the training views. Clouds of one level have one choice for all layers.
///
/// # Errors
///
/// Where a picture cannot be read, or a number is not finite.
pub fn choose(
    clouds: &[Cloud],
    problem: &Problem<'_>,
    max_loss_db: f32,
) -> Result<Vec<DiscWidths>> {
    let layers = clouds.iter().map(|cloud| cloud.layers.len()).max().unwrap_or(0);
    let of_layer = |layer: usize| {
        // An empty layer is no level.
        if problem.views.is_empty() || clouds.iter().all(|cloud| cloud.layers[layer] == 0) {
            return Ok(DiscWidths::default());
        }
        let count = |cloud: &Cloud| cloud.layers[..=layer].iter().sum::<u32>();
        let prefixes = clouds.iter().map(|cloud| Prefix::of(count(cloud), cloud)).collect();
        Level { clouds, problem, prefixes, layers }.choose(f64::from(max_loss_db))
    };
    let mut chosen: Vec<DiscWidths> = (0..layers).map(of_layer).collect::<Result<_>>()?;
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
    problem: &'a Problem<'a>,
    prefixes: Vec<Prefix>,
    layers: usize,
}

impl Level<'_> {
    fn choose(&self, max_loss_db: f64) -> Result<DiscWidths> {
        let exact = self.pictures(self.clouds);
        let mut clouds = self.clouds.to_vec();
        let allowed = self.error(&exact)? * (10f64.powf(max_loss_db / 10.0) - 1.0);
        let mut rounded = |widths: DiscWidths| -> Result<f64> {
            // A whole level: no other one is drawn.
            let all = self.clouds.iter().zip(&self.prefixes).zip(&mut clouds);
            for ((cloud, prefix), rounded) in all {
                if let Some(level) = cloud.levels.get(prefix.level) {
                    let widths = vec![widths; self.layers];
                    rounded.levels[prefix.level] = level_as_stored(cloud, level, &widths)?;
                }
            }
            Ok(mean_square(&exact, &self.pictures(&clouds)))
        };
        let finest = rounded(DiscWidths::default())?;
        let costs: Vec<f64> = NUMBERS
            .iter()
            .map(|number| {
                let mut widths = DiscWidths::default();
                *(number.width)(&mut widths) = PROBE;
                Ok((rounded(widths)? - finest).max(0.0) / unit_error(PROBE))
            })
            .collect::<Result<_>>()?;
        // The rule's sum may be wrong by a little: what it allows is corrected twice by what it gave.
        let mut target = allowed;
        let mut widths = allocate(&costs, target);
        for _ in 0..2 {
            let found = rounded(widths)?;
            if found <= allowed {
                break;
            }
            target *= allowed / found * 0.95;
            widths = allocate(&costs, target);
        }
        Ok(widths)
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

fn mean_square(these: &[Picture], those: &[Picture]) -> f64 {
    let pixels = |pictures: &[Picture]| pictures.iter().map(|p| p.rgb.len()).sum::<usize>();
    let pairs = these.iter().zip(those).flat_map(|(a, b)| a.rgb.iter().zip(&b.rgb));
    let squares =
        pairs.flat_map(|(a, b)| a.iter().zip(b)).map(|(a, b)| f64::from((a - b) * (a - b)));
    squares.sum::<f64>() / pixels(these).max(1) as f64
}

/// A number of a record.
struct Number {
    /// How many of them a record has.
    times: u32,
    /// Its bits.
    width: fn(&mut DiscWidths) -> &mut u8,
}

const NUMBERS: [Number; 9] = [
    Number { times: 1, width: |widths| &mut widths.position[0] },
    Number { times: 1, width: |widths| &mut widths.position[1] },
    Number { times: 1, width: |widths| &mut widths.position[2] },
    Number { times: 1, width: |widths| &mut widths.angle },
    Number { times: 2, width: |widths| &mut widths.scale },
    Number { times: 1, width: |widths| &mut widths.color[0] },
    Number { times: 1, width: |widths| &mut widths.color[1] },
    Number { times: 1, width: |widths| &mut widths.color[2] },
    Number { times: 1, width: |widths| &mut widths.opacity },
];

/// Squared error of a number of so many bits, to that of a number whose codes are as far apart as its range is wide. In
/// the middle of it stands the one code of none, which is nearly as good as one at either end.
fn unit_error(bits: u8) -> f64 {
    let codes = f64::from((1u32 << bits) - 1).max(0.8);
    1.0 / (codes * codes)
}

/// The fewest bits for which the sum of the errors is at most `allowed`; 8 each if that is not to be had.
fn allocate(costs: &[f64], allowed: f64) -> DiscWidths {
    const MOST: u8 = dermis_format::discs::MOST_BITS;
    let mut bits = [0u8; NUMBERS.len()];
    let error = |index: usize, bits: u8| costs[index] * unit_error(bits);
    loop {
        let sum: f64 = bits.iter().enumerate().map(|(index, &bits)| error(index, bits)).sum();
        let gain = |index: usize| {
            let saved = error(index, bits[index]) - error(index, bits[index] + 1);
            saved / f64::from(NUMBERS[index].times)
        };
        let free = (0..bits.len()).filter(|&index| bits[index] < MOST);
        let best = free.max_by(|&a, &b| gain(a).total_cmp(&gain(b)));
        match best {
            Some(best) if sum > allowed => bits[best] += 1,
            _ => break,
        }
    }
    let mut widths = DiscWidths::default();
    for (number, bits) in NUMBERS.iter().zip(bits) {
        *(number.width)(&mut widths) = bits;
    }
    widths
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimize::schedule::Random;

    fn bits(mut widths: DiscWidths) -> [u8; NUMBERS.len()] {
        core::array::from_fn(|i| *(NUMBERS[i].width)(&mut widths))
    }

    #[test]
    fn bits_are_enough_and_a_bit_less_of_each_is_not() {
        let mut random = Random::new(5);
        for _ in 0..500 {
            let costs = [(); NUMBERS.len()].map(|()| f64::from(libm::exp2f(-20.0 * random.unit())));
            let allowed = f64::from(libm::exp2f(-18.0 * random.unit())) * 0.1;
            let error = |bits: [u8; NUMBERS.len()]| -> f64 {
                bits.iter().zip(costs).map(|(&bits, cost)| cost * unit_error(bits)).sum()
            };
            let chosen = bits(allocate(&costs, allowed));
            let most = [dermis_format::discs::MOST_BITS; NUMBERS.len()];
            assert!(error(chosen) <= allowed || chosen == most, "{chosen:?}");
            // A bit less of each would leave too much.
            let fewer = chosen.map(|bits| bits.saturating_sub(1));
            let none = [0; NUMBERS.len()];
            assert!(error(fewer) > allowed || chosen == none, "{chosen:?}");
        }
    }

    #[test]
    fn a_quarter_of_the_error_costs_about_a_bit_of_each_number() {
        let costs = [4e-3, 3e-3, 2e-3, 2e-3, 3e-3, 4e-3, 5e-4, 3e-5, 1e-6];
        let [more, fewer] = [1e-6, 4e-6].map(|allowed| bits(allocate(&costs, allowed)));
        for (number, (more, fewer)) in more.into_iter().zip(fewer).enumerate() {
            assert!(more >= fewer && more <= fewer + 2, "number {number}: {fewer} to {more}");
        }
        let sum = |bits: [u8; NUMBERS.len()]| bits.iter().map(|&b| i32::from(b)).sum::<i32>();
        assert!((7..=11).contains(&(sum(more) - sum(fewer))), "{fewer:?} to {more:?}");
    }
}
