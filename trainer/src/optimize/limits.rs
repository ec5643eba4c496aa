//! Where the ranges of a file's numbers end.
//!
//! A group's numbers share a range, and its codes are as far apart as its ends let them be: one Gaussian far out coarsens
//! the numbers of 255 others. So a range ends where the squared error, weighted by what each number is worth, is least: what
//! lies beyond is moved to its end, all the rest is rounded finer. What a number is worth Adam knows already, from the
//! squares of its gradients.
//!
//! With step h of 2ᵇ codes between ends l and u, numbers v and their worth w, that error is
//!
//! ```text
//! h² / 12 · Σ w + Σ w (l − v)² + Σ w (v − u)²        h = (u − l) / (2ᵇ − 1)
//! ```
//!
//! the last two sums over v < l and v > u. Ends move inwards, a few numbers at a time, as long as it falls.

use core::ops::Range;

use dermis_format::quant::{last_code, rgb_of_ycocg, rooted, ycocg_of_rgb};
use dermis_format::{DiscWidths, order};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::adam::Moments;
use super::cloud::{Cloud, Parameters};
use super::rounding::{blocks, widths_of};

/// Ranges of a group: x, y, ∛z; both scales; Y, Co, Cg; opacity.
const RANGES: usize = 8;
/// Views that come may see what those of training did not: what was seen less than this, of the group's mean, is worth as
/// much as if it had been.
const LEAST_SEEN: f32 = 0.1;
/// The number whose gradient says how much of a disc is seen.
const LUMA: usize = 5;
/// How many numbers at either end are moved inwards at once.
const MOVES: [[usize; 2]; 7] = [[1, 0], [0, 1], [1, 1], [2, 0], [0, 2], [4, 0], [0, 4]];

/// Ends of the ranges of each group of a level.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Limits(Vec<[[f32; 2]; RANGES]>);

impl Limits {
    /// Of a level of `cloud`, numbers of the file's levels having `widths` bits, and whose gradients have had `moments`. It costs a sort of
    /// all numbers.
    pub fn choose(
        cloud: &Cloud,
        level: &[Parameters],
        moments: &[Moments],
        widths: &[DiscWidths],
    ) -> Self {
        let groups: Vec<_> = groups(cloud, level.len()).collect();
        let widths = widths_of(cloud, level.len(), widths);
        let limits = |(layer, places): (u8, Range<usize>)| {
            let widths = widths(layer);
            let (discs, moments) = (&level[places.clone()], &moments[places]);
            let numbers: Vec<Numbers> = discs.iter().map(Numbers::of).collect();
            let worths = worths(discs, moments);
            let [x, y, z] = widths.position;
            let [luma, orange, green] = widths.color;
            let widths = [x, y, z, widths.scale, luma, orange, green, widths.opacity];
            core::array::from_fn(|range| {
                let members = numbers.iter().zip(&worths).flat_map(|(numbers, worths)| {
                    numbers.members(range).map(|member| (numbers.0[member], worths[member]))
                });
                ends(members.collect(), last_code(widths[range]))
            })
        };
        Self(groups.into_par_iter().map(limits).collect())
    }

    /// Moves what lies beyond the ends to them.
    pub fn keep(&self, cloud: &Cloud, level: &mut [Parameters]) {
        for ((_, places), limits) in groups(cloud, level.len()).zip(&self.0) {
            level[places].iter_mut().for_each(|parameters| Numbers::keep(parameters, limits));
        }
    }
}

/// Layer and places of each group of a level of so many.
fn groups(cloud: &Cloud, len: usize) -> impl Iterator<Item = (u8, Range<usize>)> {
    blocks(cloud, len).flat_map(|(layer, first, count)| {
        let block = first as usize..(first + count) as usize;
        let end = block.end;
        let starts = block.step_by(order::GROUP_LEN);
        starts.map(move |start| (layer, start..end.min(start + order::GROUP_LEN)))
    })
}

/// The numbers of a disc that have ranges, as the file has them: x, y, ∛z, both scales, Y, Co, Cg, opacity.
struct Numbers([f32; RANGES + 1]);

impl Numbers {
    fn of(parameters: &Parameters) -> Self {
        let ([x, y, root], [s, t]) = (rooted(parameters.position), parameters.log2_scale);
        let [luma, orange, green] = ycocg_of_rgb(parameters.color);
        Self([x, y, root, s, t, luma, orange, green, parameters.opacity()])
    }

    /// Which of them share a range.
    fn members(&self, range: usize) -> Range<usize> {
        match range {
            0..3 => range..range + 1,
            3 => 3..5,
            _ => range + 1..range + 2,
        }
    }

    /// Moves those of a disc to the ends that they lie beyond, and leaves all bits of the others.
    fn keep(parameters: &mut Parameters, limits: &[[f32; 2]; RANGES]) {
        let [x, y, z, scale, luma, orange, green, opacity] = *limits;
        let root = libm::cbrtf(parameters.position[2]);
        if let Some(root) = beyond(root, z) {
            parameters.position[2] = (root * root) * root;
        }
        let [px, py, _] = &mut parameters.position;
        let [s, t] = &mut parameters.log2_scale;
        for (number, limits) in [(px, x), (py, y), (s, scale), (t, scale)] {
            *number = beyond(*number, limits).unwrap_or(*number);
        }
        let color = ycocg_of_rgb(parameters.color);
        let ends = [luma, orange, green];
        let kept: [_; 3] = core::array::from_fn(|i| beyond(color[i], ends[i]));
        if kept.iter().any(Option::is_some) {
            let kept = core::array::from_fn(|i| kept[i].unwrap_or(color[i]));
            parameters.color = rgb_of_ycocg(kept);
        }
        if let Some(opacity) = beyond(parameters.opacity(), opacity) {
            parameters.logit = libm::logf(opacity / (1.0 - opacity));
        }
    }
}

/// The end that a number lies beyond. What is no number lies nowhere: the writer refuses it.
fn beyond(number: f32, [low, high]: [f32; 2]) -> Option<f32> {
    if number < low {
        Some(low)
    } else if number > high {
        Some(high)
    } else {
        None
    }
}

/// What each number of each disc is worth: the mean square of the gradient by it. Who took no step is worth the mean.
fn worths(discs: &[Parameters], moments: &[Moments]) -> Vec<[f32; RANGES + 1]> {
    let squares = discs.iter().zip(moments).map(|(disc, moments)| {
        let [x, y, z, _, s, t, logit, r, g, b] = moments.mean_square()?;
        let root = libm::cbrtf(disc.position[2]);
        // dz / d∛z, and d logit / d o; Y, Co and Cg are sums of colours, taken for independent.
        let by_root = 3.0 * root * root;
        let by_opacity = 1.0 / (disc.opacity() * (1.0 - disc.opacity()));
        let opacity = logit * by_opacity * by_opacity;
        let all = [x, y, z * by_root * by_root, s, t, r + g + b, r + b, r + g + b, opacity];
        (all[LUMA] > 0.0).then(|| all.map(|square| if square.is_finite() { square } else { 0.0 }))
    });
    let squares: Vec<Option<[f32; RANGES + 1]>> = squares.collect();
    let known: Vec<&[f32; RANGES + 1]> = squares.iter().flatten().collect();
    if known.is_empty() {
        return vec![[1.0; RANGES + 1]; discs.len()];
    }
    let mean = |number: usize| {
        known.iter().map(|squares| squares[number]).sum::<f32>() / known.len() as f32
    };
    let means: [f32; RANGES + 1] = core::array::from_fn(mean);
    let of_disc = |squares: &Option<[f32; RANGES + 1]>| match squares {
        Some(squares) => {
            let hidden = (LEAST_SEEN * means[LUMA] / squares[LUMA]).max(1.0);
            core::array::from_fn(|number| hidden * squares[number])
        }
        None => means,
    };
    squares.iter().map(of_disc).collect()
}

/// Where the range of numbers and their worths ends, of which codes go to `last`.
fn ends(mut numbers: Vec<(f32, f32)>, last: u16) -> [f32; 2] {
    const EVERYWHERE: [f32; 2] = [f32::NEG_INFINITY, f32::INFINITY];
    // Without a bit there is no step; and what is no number has no place in an order.
    if last == 0 || !numbers.iter().all(|(number, _)| number.is_finite()) {
        return EVERYWHERE;
    }
    numbers.sort_by(|a, b| a.0.total_cmp(&b.0));
    let all: f64 = numbers.iter().map(|&(_, worth)| f64::from(worth)).sum();
    let range = |[below, above]: [usize; 2]| {
        let from_end = numbers.len().checked_sub(1 + above)?;
        (below < from_end).then(|| [numbers[below].0, numbers[from_end].0])
    };
    let error = |moved: [usize; 2], [low, high]: [f32; 2]| {
        let step = f64::from(high - low) / f64::from(last);
        let to = |end: f32| {
            move |&(number, worth): &(f32, f32)| f64::from(worth) * f64::from(number - end).powi(2)
        };
        let below = numbers[..moved[0]].iter().map(to(low)).sum::<f64>();
        let above = numbers[numbers.len() - moved[1]..].iter().map(to(high)).sum::<f64>();
        step * step / 12.0 * all + below + above
    };
    let mut moved = [0; 2];
    let Some(mut best) = range(moved) else { return EVERYWHERE };
    let mut least = error(moved, best);
    let better = |moved: [usize; 2], least: f64| {
        MOVES.iter().find_map(|more| {
            let moved = [moved[0] + more[0], moved[1] + more[1]];
            let range = range(moved)?;
            let error = error(moved, range);
            (error < least).then_some((moved, range, error))
        })
    };
    while let Some(found) = better(moved, least) {
        (moved, best, least) = found;
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimize::schedule::Random;

    fn error(numbers: &[(f32, f32)], [low, high]: [f32; 2], last: u16) -> f64 {
        let step = f64::from(high - low) / f64::from(last);
        let square = |&(number, worth): &(f32, f32)| {
            let clipped = f64::from(number - number.clamp(low, high));
            f64::from(worth) * (clipped * clipped + step * step / 12.0)
        };
        numbers.iter().map(square).sum()
    }

    #[test]
    fn no_range_is_worse_than_from_least_to_greatest() {
        let mut random = Random::new(11);
        for trial in 0..500u16 {
            let last = last_code(1 + (trial % 8) as u8);
            let count = 2 + (254.0 * random.unit()) as usize;
            // A few far out.
            let mut number = || 1.0 / (random.unit() - 0.5);
            let numbers: Vec<f32> = (0..count).map(|_| number()).collect();
            let numbers: Vec<(f32, f32)> =
                numbers.into_iter().map(|number| (number, 0.1 + 9.0 * random.unit())).collect();
            let least = numbers.iter().map(|n| n.0).fold(f32::MAX, f32::min);
            let greatest = numbers.iter().map(|n| n.0).fold(f32::MIN, f32::max);
            let [low, high] = ends(numbers.clone(), last);
            assert!(least <= low && low <= high && high <= greatest);
            let found = error(&numbers, [low, high], last);
            assert!(found <= error(&numbers, [least, greatest], last) * (1.0 + 1e-6));
        }
    }

    #[test]
    fn one_far_out_gives_way_unless_it_matters() {
        for (worth, end) in [(0.01, 1.0), (1e4, 9.0)] {
            let mut numbers: Vec<(f32, f32)> = (0..255).map(|i| (i as f32 / 254.0, 1.0)).collect();
            numbers.push((9.0, worth));
            let last = last_code(5);
            let found @ [low, high] = ends(numbers.clone(), last);
            assert!(high == end && (worth > 1.0 || low < 0.1), "{low} {high}");
            // The best of all ranges between two of the numbers.
            let places = || numbers.iter().map(|number| number.0);
            let ranges = places().flat_map(|low| places().map(move |high| [low, high]));
            let ranges = ranges.filter(|[low, high]| low < high);
            let errors = ranges.map(|range| error(&numbers, range, last));
            let least = errors.fold(f64::MAX, f64::min);
            let found = error(&numbers, found, last);
            assert!(found <= 1.01 * least, "{low} {high}: {found}, {least} at best");
        }
    }

    #[test]
    fn what_lies_within_keeps_its_bits() {
        let inside = Parameters {
            position: [0.1, -0.2, 0.003],
            angle: 1.0,
            log2_scale: [-3.0, -4.0],
            logit: 1.3,
            color: [0.3, 0.4, 0.5],
        };
        let far = Parameters {
            position: [7.0, -7.0, -8.0],
            log2_scale: [5.0, -9.0],
            logit: -3.0,
            color: [2.0, 2.0, 2.0],
            ..inside
        };
        let limits = Limits(vec![[
            [-1.0, 1.0],
            [-1.0, 1.0],
            [-1.0, 1.0],
            [-5.0, 0.0],
            [0.0, 1.0],
            [-0.5, 0.5],
            [-0.5, 0.5],
            [0.5, 0.9],
        ]]);
        let cloud = Cloud { layers: vec![2], ..Cloud::default() };
        let mut level = [inside, far];
        limits.keep(&cloud, &mut level);
        assert_eq!(level[0], inside);
        assert_eq!(level[1].position, [1.0, -1.0, -1.0]);
        assert_eq!(level[1].log2_scale, [0.0, -5.0]);
        assert_eq!(level[1].color, [1.0; 3]);
        assert!((level[1].opacity() - 0.5).abs() < 1e-6);
        let kept = level;
        limits.keep(&cloud, &mut level);
        assert_eq!(level, kept, "twice is once");
    }
}
