//! One budget for all avatars of a frame, spent where it is seen.
//!
//! A region's error on the screen is what its curve says of the error in a pixel at a count and a distance (section `CURV`
//! of the file, measured in training), times the pixels of its [`Footprint`], times its weights. Of error over Gaussians
//! only the lower convex hull is worth drawing. The steps of all hulls, those first that save the most error for each
//! Gaussian, are taken until the budget is spent (Fox 1966; hulls as Shoham and Gersho 1988), the last one in part. So no
//! Gaussian could be spent better by the curves, more Gaussians are never worse, and steps that save nothing, because a
//! layer is finer than the pixels, are not taken at all.
//!
//! A bound on blends is kept, not spent as well as can be: steps still come by error for each Gaussian, and a region's first
//! Gaussians, which cover all of it however few they are, come with all of their blends or not at all. Where that bound
//! alone holds a plan back, a little more of it may let a large region in that takes what several small ones had, and the sum
//! of errors may grow (by a half in the worst case seen, four avatars at 500 to 2,000 Gaussians).

mod curve;

use bytemuck::{Pod, Zeroable};
use dermis_format::Avatar;
use dermis_format::curves::stops;

use crate::error::Error;
use crate::footprint::{Footprint, Footprints};
use crate::lists::Pair;
use crate::math::Real;
use crate::plan::Plan;
use crate::scratch::{Scratch, words};
use crate::sort;
use curve::Curve;

/// What a frame may cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget {
    /// Gaussians of all plans together.
    pub gaussians: u32,
    /// Gaussians blended into pixels, as the curves predict it: of a human, trained, within 10 % from 8 to 1 m from in front,
    /// up to 18 % too many from other sides; of a head that hides most of itself up to 16 % too few; with the camera at an arm's
    /// length or inside the mesh between half and twice as many. Of files without the
    /// section `SAMP` up to three times too few or 1.4 times too many. Of one camera: for two eyes half of what both may take.
    /// Infinite: as many as there are.
    pub blends: f32,
    /// What moves less than so many pixels (root of the mean square over its surface, where the avatar is largest on the screen)
    /// stays as it rests: [`Plan::still_below`]. 0: everything moves.
    pub movement: f32,
}

impl Budget {
    /// So many Gaussians, however large; everything moves.
    pub fn of_gaussians(gaussians: u32) -> Self {
        Self { gaussians, blends: f32::INFINITY, movement: 0.0 }
    }
}

/// An avatar in a pose and a place, as a camera sees it.
#[derive(Clone, Debug)]
pub struct Instance<'s, 'a> {
    /// The avatar.
    pub avatar: &'s Avatar<'a>,
    /// What its regions cover: [`crate::Posed::footprints`] of all of it, posed or at rest where [`crate::pose::carried`] takes it;
    /// of the two eyes of a headset, either one's.
    pub footprints: Footprints,
    /// How much its error matters beside that of the others, from 0 on; 1 is usual.
    pub weight: f32,
}

/// Where the eye looks: error there matters most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaze {
    /// px.
    pub point: [f32; 2],
    /// Distance at which error matters half as much, px.
    pub falloff: f32,
}

impl Gaze {
    /// How much error matters at a point, in (0, 1]: 1 / (1 + (distance / falloff)²).
    pub fn weight(&self, [x, y]: [f32; 2]) -> f32 {
        let (dx, dy) = ((x - self.point[0]) / self.falloff, (y - self.point[1]) / self.falloff);
        let weight = 1.0 / (1.0 + (dx * dx + dy * dy));
        if weight > 0.0 { weight } else { 0.0 }
    }
}

/// What all plans of a frame come to, as the curves predict it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spent {
    /// Never more than the budget's.
    pub gaussians: u32,
    /// Never more than the budget's.
    pub blends: f32,
    /// Squared differences to the meshes, weighted, summed over pixels.
    pub error: f32,
}

/// A step of a region's hull.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
struct Step {
    instance: u32,
    region: u32,
    /// Gaussians before and after.
    from: u32,
    to: u32,
    /// That it adds.
    blends: f32,
    /// That it saves.
    error: f32,
}

/// Words of scratch that [`plan`] needs.
pub fn scratch_len(instances: &[Instance<'_, '_>]) -> usize {
    let steps = most_steps(instances);
    let regions = instances.len().saturating_mul(MAX_REGIONS);
    words::<Step>(steps)
        .saturating_add(words::<Pair>(steps).saturating_mul(2))
        .saturating_add(words::<u32>(regions))
}

const MAX_REGIONS: usize = dermis_format::header::MAX_REGIONS;

/// Steps at most: as many as there are stops behind the first.
fn most_steps(instances: &[Instance<'_, '_>]) -> usize {
    let of = |instance: &Instance<'_, '_>| {
        let header = instance.avatar.header();
        usize::from(header.regions) * (stops(header.layers.into()) - 1)
    };
    instances.iter().map(of).fold(0, usize::saturating_add)
}

/// Plans for all instances, each in its place in `plans`, that spend `budget` where it saves the most error on the screen.
/// `gaze` weighs the error of each region by where it is.
///
/// Regions without a footprint get nothing. Costs O(n log n) of n = Σ regions · (2 layers + 1).
///
/// # Errors
///
/// [`Error::Scratch`] for less than [`scratch_len`] words, [`Error::Plan`] for fewer plans than instances.
pub fn plan(
    instances: &[Instance<'_, '_>],
    budget: &Budget,
    gaze: Option<&Gaze>,
    scratch: &mut [u32],
    plans: &mut [Plan],
) -> Result<Spent, Error> {
    if plans.len() < instances.len() {
        return Err(Error::Plan);
    }
    let mut scratch = Scratch::new(scratch, scratch_len(instances))?;
    let most = most_steps(instances);
    let steps = scratch.take::<Step>(most)?;
    let (order, spare) = (scratch.take::<Pair>(most)?, scratch.take::<Pair>(most)?);
    let counts = scratch.take::<u32>(instances.len().saturating_mul(MAX_REGIONS))?;
    counts.fill(0);
    let mut spent = Spent::default();
    let mut filled = 0;
    for (index, instance) in (0..).zip(instances) {
        for (region, footprint) in (0..).zip(&instance.footprints) {
            let weight = weight(instance, region as usize, footprint, gaze);
            let curve = Curve { instance, region: region as usize, footprint, weight };
            spent.error += curve.error_of_nothing();
            curve.hull(|from, to, blends, error| {
                if let (Some(step), Some(pair)) = (steps.get_mut(filled), order.get_mut(filled)) {
                    *step = Step { instance: index, region, from, to, blends, error };
                    // Positive numbers are ordered as their bits are; those first that save most.
                    let saved = error / (to - from) as f32;
                    *pair = Pair { depth: u32::MAX - saved.to_bits(), splat: filled as u32 };
                    filled += 1;
                }
            });
        }
    }
    let order = order.get_mut(..filled).unwrap_or(&mut []);
    sort::by_depth(order, spare);
    for pair in &*order {
        if let Some(step) = steps.get(pair.splat as usize) {
            let place = step.instance as usize * MAX_REGIONS + step.region as usize;
            if let Some(count) = counts.get_mut(place) {
                take(step, budget, count, &mut spent);
            }
        }
    }
    let (of_instances, _) = counts.as_chunks::<MAX_REGIONS>();
    for ((instance, plan), counts) in instances.iter().zip(plans).zip(of_instances) {
        let densities = instance.footprints.iter().filter(|footprint| footprint.area > 0.0);
        let densest = densities.fold(0.0f32, |most, footprint| most.at_least(footprint.density));
        let still_below = if budget.movement > 0.0 { budget.movement / densest } else { 0.0 };
        *plan =
            Plan::of_counts(instance.avatar, counts.iter().copied()).with_still_below(still_below);
    }
    Ok(spent)
}

/// Takes as much of a step as the budget has left, if those before it of the same region were taken whole.
fn take(step: &Step, budget: &Budget, count: &mut u32, spent: &mut Spent) {
    if *count != step.from {
        return;
    }
    let (all, left) = (step.to - step.from, budget.gaussians - spent.gaussians);
    let blends = (budget.blends - spent.blends).at_least(0.0);
    let mut gaussians = all.min(left);
    let share = |gaussians: u32| gaussians as f32 / all as f32;
    if step.from == 0 {
        // A few Gaussians are wider, and blend as often as more would.
        if !(step.blends <= blends) || gaussians == 0 {
            return;
        }
        spent.blends += step.blends;
    } else {
        // As many as may be blended, and one less for rounding.
        if step.blends * share(gaussians) > blends {
            gaussians =
                gaussians.min((all as f32 * (blends / step.blends)) as u32).saturating_sub(1);
        }
        spent.blends += step.blends * share(gaussians);
    }
    spent.gaussians += gaussians;
    spent.error = (spent.error - step.error * share(gaussians)).at_least(0.0);
    *count += gaussians;
}

/// Of one region: those of its file, of its instance, and of where it is.
fn weight(
    instance: &Instance<'_, '_>,
    region: usize,
    footprint: &Footprint,
    gaze: Option<&Gaze>,
) -> f32 {
    let looked_at = gaze.map_or(1.0, |gaze| gaze.weight(footprint.center));
    instance.weight * instance.avatar.region_weight(region) * looked_at
}
