//! How long, how fast, and which prefix.

use core::{iter, slice};

use serde::{Deserialize, Serialize};

use super::adam::Rates;
use super::cloud::{Cloud, Prefix};

/// A small generator of random numbers whose sequence the seed fixes (PCG32, O'Neill 2014).
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Random {
    state: u64,
}

impl Random {
    /// A sequence of its own for each seed.
    pub fn new(seed: u64) -> Self {
        let mut random = Self { state: seed.wrapping_add(1_442_695_040_888_963_407) };
        random.bits();
        random
    }

    /// 32 random bits.
    pub fn bits(&mut self) -> u32 {
        let old = self.state;
        self.state =
            old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let mixed = (((old >> 18) ^ old) >> 27) as u32;
        mixed.rotate_right((old >> 59) as u32)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / 16_777_216.0
    }

    /// Uniform in 0..n.
    pub fn below(&mut self, n: u32) -> u32 {
        ((u64::from(self.bits()) * u64::from(n)) >> 32) as u32
    }

    /// Uniform order (Fisher and Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i as u32 + 1) as usize);
        }
    }
}

/// How a set of Gaussians is trained.
#[derive(Clone, Debug)]
pub struct Schedule {
    /// Steps of one picture each.
    pub steps: u32,
    /// At the start.
    pub rates: Rates,
    /// The last step's rates, relative to the first one's.
    pub last_rate: f32,
    /// What the steps draw.
    pub prefixes: Prefixes,
    /// Pictures are matched at 1/2^shift of their size.
    pub shift: u32,
    /// Share of the steps, the first ones, that match them at half of that.
    pub warm_up: f32,
    /// Share of the steps, the last ones, that draw what a file would hold ([`super::rounding`]).
    pub finish: f32,
    /// PSNR that a level may lose to the few bits of the file's numbers, dB ([`super::precision`]).
    pub max_loss_db: f32,
    /// Share of the steps before a background of a random colour, without which an avatar's white
    /// parts would be free to be transparent before white.
    pub random_background: f32,
}

/// What steps draw of a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Prefixes {
    /// All of it.
    All,
    /// A level.
    Level(usize),
    /// Prefixes of many lengths.
    Nested(Nested),
}

/// How prefixes are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nested {
    /// Share of the steps that draw all.
    pub whole: f32,
    /// Share of the steps that draw exactly a level before the last, where levels have parameters of their own.
    pub level: f32,
    /// The least prefix, as a share of all; others are log-uniform between it and all.
    pub least: f32,
    /// Of the steps that draw exactly a level of a quarter, a sixteenth, a 64th of all (or fewer), the share that match
    /// pictures of 1/2, 1/4, 1/8 of the size: few Gaussians are looked at from afar, and sometimes from nearby.
    pub afar: [f32; 3],
    /// Share of the steps in which each region draws what it draws by itself; in the others all have the same share.
    pub apart: f32,
    /// A price on the distance from the triangle, for the last level, the one before, and all others: of the step that Adam
    /// makes where gradients agree, so much goes to the plane, by a proximal step of |z| (Parikh & Boyd 2014, 6.5.2). Views
    /// say little of that distance, and those of few steps the least: without a price it is noise (notes/training.md).
    pub flatness_price: [f32; 3],
}

impl Schedule {
    /// Rates of a step: they fall exponentially.
    pub fn rates_at(&self, step: u32) -> Rates {
        self.rates.times(libm::powf(self.last_rate, self.progress(step)))
    }

    /// Rates of each level of `cloud` in a step. Of a nested order those before the last, which are drawn more seldom, stay
    /// fast for longer: their rates fall in a straight line to nothing.
    pub fn rates_of_levels(&self, step: u32, cloud: &Cloud) -> Vec<Rates> {
        let mut rates = vec![self.rates_at(step); cloud.levels.len()];
        let Prefixes::Nested(nested) = self.prefixes else { return rates };
        if let [earlier @ .., _] = &mut rates[..] {
            earlier.fill(self.rates.times(1.0 - self.progress(step)));
        }
        let [last, base, coarser] = nested.flatness_price;
        let prices = [last, base].into_iter().chain(iter::repeat(coarser));
        for (rates, price) in rates.iter_mut().rev().zip(prices) {
            rates.flatten_step = price * rates.position;
        }
        rates
    }

    /// Share of the steps that are done.
    fn progress(&self, step: u32) -> f32 {
        step as f32 / self.steps.max(1) as f32
    }

    /// Pictures of a step that draws `prefixes` of `clouds` are matched at 1/2^shift of their size.
    pub fn shift_at(
        &self,
        step: u32,
        clouds: &[Cloud],
        prefixes: &[Prefix],
        random: &mut Random,
    ) -> u32 {
        let warm = (step as f32) < self.warm_up * self.steps as f32;
        let shift = self.shift + u32::from(warm);
        match self.prefixes {
            Prefixes::Nested(nested) => shift.max(nested.halvings(clouds, prefixes, random)),
            Prefixes::All | Prefixes::Level(_) => shift,
        }
    }

    /// Whether a step draws what a file would hold.
    pub fn finishes_at(&self, step: u32) -> bool {
        ((self.steps - step) as f32) <= self.finish * self.steps as f32
    }

    /// What stands behind the avatar in a step: mostly `usual`.
    pub fn background(&self, usual: [f32; 3], random: &mut Random) -> [f32; 3] {
        if random.unit() < self.random_background {
            [random.unit(), random.unit(), random.unit()]
        } else {
            usual
        }
    }

    /// The prefix of each region in a step.
    pub fn prefixes(&self, clouds: &[Cloud], random: &mut Random) -> Vec<Prefix> {
        let counts = match self.prefixes {
            Prefixes::All => return Prefix::whole(clouds),
            Prefixes::Level(level) => {
                clouds.iter().map(|cloud| cloud.levels[level].len() as u32).collect()
            }
            Prefixes::Nested(nested) => nested.counts(clouds, random),
        };
        counts.into_iter().zip(clouds).map(|(count, cloud)| Prefix::of(count, cloud)).collect()
    }
}

impl Nested {
    /// How often the sides of a picture of `prefixes` are halved: if they are levels, as often as all are quartered, or
    /// not at all.
    fn halvings(&self, clouds: &[Cloud], prefixes: &[Prefix], random: &mut Random) -> u32 {
        if !prefixes.iter().zip(clouds).all(|(prefix, cloud)| prefix.is_level_of(cloud)) {
            return 0;
        }
        let all: u32 = clouds.iter().map(|cloud| cloud.len() as u32).sum();
        let drawn: u32 = prefixes.iter().map(|prefix| prefix.count).sum();
        let quarterings = (all / drawn.max(1)).max(1).ilog2() / 2;
        let halvings = quarterings.min(self.afar.len() as u32);
        let afar = halvings.checked_sub(1).map_or(0.0, |at| self.afar[at as usize]);
        if random.unit() < afar { halvings } else { 0 }
    }

    fn counts(&self, clouds: &[Cloud], random: &mut Random) -> Vec<u32> {
        if clouds.len() > 1 && random.unit() < self.apart {
            let alone = |cloud| self.common_counts(slice::from_ref(cloud), random);
            clouds.iter().flat_map(alone).collect()
        } else {
            self.common_counts(clouds, random)
        }
    }

    /// The same level or share of all.
    fn common_counts(&self, clouds: &[Cloud], random: &mut Random) -> Vec<u32> {
        let levels = clouds.iter().map(|cloud| cloud.levels.len()).max().unwrap_or(0);
        let earlier = levels.saturating_sub(1) as u32;
        let draw = random.unit();
        if draw < self.whole {
            clouds.iter().map(|cloud| cloud.len() as u32).collect()
        } else if draw < self.whole + self.level && earlier > 0 {
            let level = earlier_level(earlier, random);
            // Regions too small for the first levels come later.
            let from_last = levels - level;
            let count = |cloud: &Cloud| {
                let level = cloud.levels.len().checked_sub(from_last);
                level.map_or(0, |level| cloud.levels[level].len() as u32)
            };
            clouds.iter().map(count).collect()
        } else {
            let share = libm::powf(self.least, random.unit());
            let count = |len: u32| ((len as f32 * share) as u32).clamp(len.min(1), len);
            clouds.iter().map(|cloud| count(cloud.len() as u32)).collect()
        }
    }
}

/// One of the n levels before the last, of weights n + 1, n, … 2: the coarser, the less its steps cost.
fn earlier_level(n: u32, random: &mut Random) -> usize {
    let mut ticket = random.below(n * (n + 3) / 2);
    let mut level = 0;
    while ticket >= n + 1 - level {
        ticket -= n + 1 - level;
        level += 1;
    }
    level as usize
}

impl Default for Rates {
    /// Found by trial on `valid_male.glb`.
    fn default() -> Self {
        Self {
            position: 0.05,
            angle: 0.03,
            log2_scale: 0.115,
            logit: 0.05,
            color: 0.01,
            flatten_step: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{Options, Preset};

    #[test]
    fn of_a_nested_order_alone_levels_before_the_last_have_rates_of_their_own() {
        let options = Options::preset(Preset::Draft);
        let cloud = Cloud { levels: vec![Vec::new(); 3], ..Cloud::default() };
        let all = [Prefixes::All, Prefixes::Level(1), Prefixes::Nested(options.nested)];
        let [alone, level, nested] = all.map(|prefixes| options.schedule(prefixes));
        for tenth in 1..10 {
            let step = options.steps * tenth / 10;
            let rate = alone.rates_at(step);
            assert_eq!(alone.rates_of_levels(step, &cloud), [rate; 3]);
            assert_eq!(level.rates_of_levels(step, &cloud), [rate; 3]);
            let rates = nested.rates_of_levels(step, &cloud);
            let prices = rates.iter().map(|rates| rates.flatten_step / rates.position).rev();
            assert!(prices.zip(options.nested.flatness_price).all(|(a, b)| (a - b).abs() < 1e-6));
            let free = rates.iter().map(|rates| Rates { flatten_step: 0.0, ..*rates });
            let [first, second, last] = free.collect::<Vec<_>>()[..] else {
                panic!("a rate for each level")
            };
            assert_eq!((first, last), (second, rate));
            let faster = [first, last].map(|rates| rates.color / alone.rates.color);
            assert!((faster[0] - (1.0 - tenth as f32 / 10.0)).abs() < 1e-6);
            assert_eq!(faster[0] > faster[1], tenth < 9);
        }
    }

    #[test]
    fn coarser_levels_are_drawn_more_often() {
        for n in 1..=8u32 {
            let mut times = vec![0u32; n as usize];
            let mut random = Random::new(3);
            let draws = 20_000 * n;
            (0..draws).for_each(|_| times[earlier_level(n, &mut random)] += 1);
            for (level, &times) in (0..n).zip(&times) {
                let share = f64::from(n + 1 - level) / f64::from(n * (n + 3) / 2);
                let expected = share * f64::from(draws);
                let deviation = (expected * (1.0 - share)).sqrt();
                assert!(
                    (f64::from(times) - expected).abs() <= 4.0 * deviation,
                    "{level} of {n}: {times}, not {expected}"
                );
            }
        }
    }
}
