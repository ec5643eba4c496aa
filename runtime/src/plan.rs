//! What a frame draws: a prefix of each region's nested order, under a budget.

use dermis_format::header::MAX_REGIONS;
use dermis_format::{Avatar, Levels, PerLevel, ScaleLaw};

use crate::error::Error;

/// How much of one region is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RegionPlan {
    /// Gaussians: the first `count` of the region's order.
    pub count: u32,
    /// The last layer that is drawn whole; −1: none.
    pub level: i32,
    /// Share of the next layer that is drawn, in [0, 1).
    pub fraction: f32,
    /// Added to log₂ of every scale: ½ log₂(N / k) or 0. With parameters per level: at the first level, N being its
    /// Gaussians; later of those that arrive, [`arrival_log2_scale`].
    pub log2_scale: f32,
    /// With parameters per level the first level that holds `count` Gaussians, and the one below where
    /// that matters.
    pub levels: Levels,
    /// How far the Gaussians of the level below have gone there, in [0, 1].
    pub lower_share: f32,
}

/// The result of level-of-detail selection for one avatar.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    regions: heapless::Vec<RegionPlan, MAX_REGIONS>,
    still_below: f32,
}

impl Plan {
    /// The greatest plan of at most `budget` Gaussians: every region gets the same share of its
    /// order, rounded down, and what is left goes one by one to the region whose share is then the
    /// smallest (Jefferson's apportionment). No region ever loses a Gaussian as the budget grows.
    pub fn with_budget(avatar: &Avatar<'_>, budget: u32) -> Self {
        let lens = (0..usize::from(avatar.header().regions)).map(|r| avatar.present(r));
        let total = lens.clone().map(u64::from).sum();
        let budget = u64::from(budget).min(total);
        let share = |len: u32| (u64::from(len) * budget).checked_div(total).unwrap_or(0) as u32;
        let mut regions = collected(lens.map(|len| (share(len), len)));
        let used: u64 = regions.iter().map(|&(count, _)| u64::from(count)).sum();
        // Rounding leaves fewer Gaussians than there are regions.
        for _ in used..budget {
            let mut least: Option<&mut (u32, u32)> = None;
            for region in regions.iter_mut().filter(|(count, len)| count < len) {
                // (a + 1) / m < (b + 1) / n
                let smaller = |other: &(u32, u32)| {
                    u64::from(region.0 + 1) * u64::from(other.1)
                        < u64::from(other.0 + 1) * u64::from(region.1)
                };
                if least.as_deref().is_none_or(smaller) {
                    least = Some(region);
                }
            }
            if let Some((count, _)) = least {
                *count += 1;
            }
        }
        Self::of_counts(avatar, regions.iter().map(|&(count, _)| count))
    }

    /// Level λ of every region: layers 0..=⌊λ⌋ whole, and that share of the next one.
    pub fn at_level(avatar: &Avatar<'_>, level: f32) -> Self {
        let layers = usize::from(avatar.header().layers);
        let counts = (0..usize::from(avatar.header().regions)).map(|region| {
            let mut count = 0;
            for layer in 0..layers {
                // At λ = i + t layer i + 1 has share t, earlier ones are whole.
                let share = (level - layer as f32 + 1.0).clamp(0.0, 1.0);
                // In f64: f32 cannot hold the length of a layer of more than 2²⁴.
                count += (f64::from(avatar.layer_len(region, layer)) * f64::from(share)) as u32;
            }
            count
        });
        Self::of_counts(avatar, counts)
    }

    /// The first `counts` Gaussians of each region; no more than are there.
    pub fn of_counts(avatar: &Avatar<'_>, counts: impl Iterator<Item = u32>) -> Self {
        let regions = (0..usize::from(avatar.header().regions)).zip(counts);
        let regions = regions.map(|(region, count)| RegionPlan::new(avatar, region, count));
        Self { regions: collected(regions), still_below: 0.0 }
    }

    /// This plan, but what moves the surface less than so many metres stays as it rests: joints of clips with all below them,
    /// and morph targets, as far as the file says how far they move it ([`dermis_format::Movements`]). At 0 everything moves.
    /// Joints that the caller poses ([`Pose::Joints`](crate::Pose::Joints)) all move. [`Posed::for_plan`](crate::Posed::for_plan) and
    /// [`render`](crate::render) obey; [`Posed::new`](crate::Posed::new), which knows no plan, moves everything.
    pub fn with_still_below(self, metres: f32) -> Self {
        Self { still_below: metres, ..self }
    }

    /// What moves the surface less than so many metres stays as it rests.
    pub fn still_below(&self) -> f32 {
        self.still_below
    }

    /// Whether no clip moves anything that this plan lets move, morph targets at weights within 1 of those at rest: a rest pose
    /// made once is the pose of every frame.
    pub fn is_still(&self, avatar: &Avatar<'_>) -> bool {
        let Some(movements) = avatar.movements() else { return false };
        let joints = (0..).map_while(|joint| movements.of_joint(joint));
        let targets = (0..).map_while(|target| movements.of_target(target));
        joints.chain(targets).all(|moved| moved < self.still_below)
    }

    /// This plan, but no region has more than `factor` times as many Gaussians as in the frame `before`, or as 64 where it had
    /// fewer: detail comes over some frames, so that nothing pops when a budget or a scene changes at once. What falls falls
    /// at once: it never has more than this plan, and so keeps its budget. A factor under 1 is 1.
    pub fn rising_from(&self, avatar: &Avatar<'_>, before: &Self, factor: f32) -> Self {
        const LEAST: u32 = 64;
        let of_before = |region: usize| before.regions.get(region).map_or(0, |plan| plan.count);
        let counts = self.regions.iter().enumerate().map(|(region, plan)| {
            let base = of_before(region).max(LEAST);
            // In f64: f32 cannot hold counts of more than 2²⁴. Saturates; NaN becomes 0.
            let most = (f64::from(base) * f64::from(factor)) as u32;
            plan.count.min(most.max(base))
        });
        Self::of_counts(avatar, counts).with_still_below(self.still_below)
    }

    /// This plan, but a region that had nearly as many Gaussians in the frame `before`, and no more, keeps those: where it has
    /// more by up to `share` of them. A count that trembles with its camera or its neighbours then stands still. It never has
    /// more than this plan, and so keeps its budget; a share that is not above 0 holds nothing.
    pub fn holding_from(&self, avatar: &Avatar<'_>, before: &Self, share: f32) -> Self {
        let counts = self.regions.iter().enumerate().map(|(region, plan)| {
            let held = before.regions.get(region).map_or(0, |plan| plan.count);
            // In f64: f32 cannot hold counts of more than 2²⁴.
            let more = f64::from(plan.count) - f64::from(held);
            let nearly = more >= 0.0 && more <= f64::from(share) * f64::from(held);
            if nearly { held } else { plan.count }
        });
        Self::of_counts(avatar, counts).with_still_below(self.still_below)
    }

    /// Gaussians of all regions. Those whose opacity at the plan's level is under 0.005 are counted
    /// though they are not drawn: a prefix is known by its length alone.
    pub fn gaussians(&self) -> u32 {
        self.regions.iter().map(|region| region.count).sum()
    }

    /// Level λ of the plan: the mean over regions, weighted by their Gaussians.
    pub fn level(&self, avatar: &Avatar<'_>) -> f32 {
        let weights = (0..self.regions.len()).map(|region| avatar.region_len(region) as f32);
        let (sum, weight) =
            self.regions.iter().zip(weights).fold((0.0, 0.0), |(sum, all), (region, weight)| {
                (sum + weight * (region.level as f32 + region.fraction), all + weight)
            });
        if weight > 0.0 { sum / weight } else { -1.0 }
    }

    /// Whether it is a plan for this avatar: as many regions, each with as many Gaussians.
    pub(crate) fn check(&self, avatar: &Avatar<'_>) -> Result<(), Error> {
        let mut regions = self.regions.iter().enumerate();
        if self.regions.len() != usize::from(avatar.header().regions)
            || regions.any(|(index, region)| region.count > avatar.present(index))
        {
            return Err(Error::Plan);
        }
        Ok(())
    }

    /// Gaussians of each region.
    pub(crate) fn counts(&self) -> heapless::Vec<u32, MAX_REGIONS> {
        collected(self.regions.iter().map(|region| region.count))
    }

    /// Each region's share.
    pub fn regions(&self) -> &[RegionPlan] {
        &self.regions
    }
}

impl RegionPlan {
    fn new(avatar: &Avatar<'_>, region: usize, count: u32) -> Self {
        let len = avatar.region_len(region);
        let count = count.min(avatar.present(region));
        let mut plan = Self { count, level: -1, ..Self::default() };
        let mut before = 0;
        for layer in 0..usize::from(avatar.header().layers) {
            let layer_len = avatar.layer_len(region, layer);
            if count < before + layer_len {
                plan.fraction = (count - before) as f32 / layer_len as f32;
                break;
            }
            before += layer_len;
            plan.level = layer as i32;
        }
        if avatar.header().per_level == PerLevel::All {
            plan.find_levels(avatar, region);
        } else if avatar.header().scale_law == ScaleLaw::SquareRoot {
            plan.log2_scale = prefix_log2_scale(count, len);
        }
        plan
    }

    /// Of n(i) Gaussians at level i, j is the first with n(j) ≥ count: at count = n(j) all have their records
    /// of it, and they are at level j − 1 as count comes down to n(j − 1). Empty layers are no levels.
    fn find_levels(&mut self, avatar: &Avatar<'_>, region: usize) {
        let mut lower = None;
        let mut len = 0;
        for layer in 0..avatar.header().layers {
            let layer_len = avatar.layer_len(region, layer.into());
            if layer_len == 0 {
                continue;
            }
            len += layer_len;
            if self.count <= len {
                self.levels.upper = layer;
                break;
            }
            lower = Some((layer, len));
        }
        match lower {
            None => self.log2_scale = prefix_log2_scale(self.count, len),
            Some((lower, lower_len)) if self.count < len => {
                self.levels.lower = Some(lower);
                self.log2_scale = arrival_log2_scale(self.count, len);
                self.lower_share = lower_share(self.count, [lower_len, len]);
            }
            Some(_) => {}
        }
    }
}

/// As many as there can be regions. (heapless' own `collect` panics on more.)
pub(crate) fn collected<T>(items: impl Iterator<Item = T>) -> heapless::Vec<T, MAX_REGIONS> {
    let mut vec = heapless::Vec::new();
    for item in items.take(MAX_REGIONS) {
        let _ = vec.push(item);
    }
    vec
}

/// log₂ of √(N / k), by which a prefix of k out of N widens its Gaussians; 0 for an empty one.
pub fn prefix_log2_scale(count: u32, len: u32) -> f32 {
    if count == 0 || count >= len { 0.0 } else { 0.5 * libm::log2f(len as f32 / count as f32) }
}

/// How much of what a prefix would widen them by Gaussians that arrive are widened by: at 0 they leave holes below the middle of the
/// way between two levels, at 0.6 they hide what is left of the level before above it (trainer/notes/training.md).
const ARRIVAL: f32 = 0.2;

/// Added to log₂ of the scales of Gaussians that arrive, in a prefix of `count` of the `len` Gaussians of their level, as the others of
/// them are still missing.
pub fn arrival_log2_scale(count: u32, len: u32) -> f32 {
    ARRIVAL * prefix_log2_scale(count, len)
}

/// How far Gaussians of a level of n′ have gone there from the next one, of n, in a prefix of k, n′ ≤ k ≤ n: in [0, 1].
///
/// Who arrives stands for w / n of the surface, w being the square of what it is [widened](arrival_log2_scale) by; the others fill what is left:
/// were they √(n / n′) times wider at their own level, each would cover (n − w (k − n′)) / n′ times as much as at the
/// other one. Of log₂ of that factor the share is the part that is gone.
pub fn lower_share(count: u32, [lower, upper]: [u32; 2]) -> f32 {
    if count >= upper || lower >= upper || lower == 0 {
        return 0.0;
    }
    // In f64: f32 cannot hold counts of more than 2²⁴, nor tell neighbours among them apart.
    let [arrived, lower, all] = [count.saturating_sub(lower), lower, upper].map(f64::from);
    let wider = libm::exp2(2.0 * f64::from(arrival_log2_scale(count, upper)));
    let log2_times = |covered: f64| libm::log2(covered / lower);
    (log2_times(all - wider * arrived) / log2_times(all)).clamp(0.0, 1.0) as f32
}
