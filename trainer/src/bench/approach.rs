//! A camera that comes nearer: whether the counts of a plan show as they rise, and how well it foretells blends.

use anyhow::Result;
use dermis_runtime::budget::Budget;
use dermis_runtime::{Avatar, Kernel, Plan, Pose, Posed};
use serde::Serialize;

use crate::draw::{draw, planned};
use crate::orbit::Orbit;
use crate::progress;

const WHITE: [f32; 3] = [1.0; 3];

/// A picture on the way.
#[derive(Clone, Debug, Serialize)]
pub struct Step {
    /// From the middle of the posed avatar, metres.
    pub distance_m: f32,
    /// Of the plan.
    pub gaussians: u32,
    /// Root mean square of the change since the picture before, in 1/255; 0 of the first one.
    pub change_8bit: f64,
    /// The same with all Gaussians drawn on the whole way.
    pub change_of_all_8bit: f64,
    /// Blends that the plan foretold, to those that were done; none where a bound on its rise left fewer Gaussians.
    pub blends_foretold: Option<f64>,
}

/// How plans are made on the way.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Way {
    /// Gaussians of a plan at most, in the first half.
    pub budget: u32,
    /// In the second half.
    pub later_budget: u32,
    /// No region has more than so many times as many as in the picture before ([`Plan::rising_from`]); none: what a plan alone
    /// has.
    pub rising: Option<f32>,
}

impl Way {
    /// One budget on the whole way, each plan for itself.
    pub fn of_budget(budget: u32) -> Self {
        Self { budget, later_budget: budget, rising: None }
    }
}

/// The pictures of one way.
#[derive(Clone, Debug, Serialize)]
pub struct Approach {
    /// Which.
    pub way: Way,
    /// From afar to near.
    pub steps: Vec<Step>,
}

impl Approach {
    /// The greatest change to the greatest one of all Gaussians.
    pub fn greatest_change_to_all(&self) -> f64 {
        let greatest = |of: fn(&Step) -> f64| self.steps.iter().map(of).fold(0.0, f64::max);
        greatest(|step| step.change_8bit) / greatest(|step| step.change_of_all_8bit).max(1e-9)
    }

    /// The least and the greatest of what was foretold of blends to what was done.
    pub fn blends_foretold(&self) -> [f64; 2] {
        let all = || self.steps.iter().filter_map(|step| step.blends_foretold);
        [all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max)]
    }

    /// Pictures, from where the budget changes on, until plans have as many Gaussians as their budget, or stop rising.
    pub fn pictures_to_rise(&self) -> usize {
        let later = &self.steps[self.steps.len().div_ceil(2)..];
        let most = later.iter().map(|step| step.gaussians).max().unwrap_or(0);
        later.iter().position(|step| step.gaussians == most).unwrap_or(0)
    }
}

/// The way of a camera that looks at the middle of an avatar.
#[derive(Clone, Copy, Debug)]
pub struct Track {
    /// Degrees around it; 0 looks at its front.
    pub yaw: f32,
    /// Where it begins, metres.
    pub far: f32,
    /// Where it ends, metres.
    pub near: f32,
    /// On the way, each nearer than the one before by the same share.
    pub pictures: u32,
}

/// Draws the pictures of a posed avatar on a track: by the plans of each way, and all Gaussians.
///
/// # Errors
///
/// Where the pose does not fit the avatar, or the size cannot be drawn.
pub fn measure(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    [width, height]: [u32; 2],
    ways: &[Way],
    &Track { yaw, far, near, pictures }: &Track,
) -> Result<Vec<Approach>> {
    let mut scratch = vec![0; Posed::scratch_len(avatar)];
    let posed = Posed::new(avatar, pose, Kernel::detect(), &mut scratch)?;
    let all = Plan::with_budget(avatar, u32::MAX);
    let mut approaches: Vec<Approach> =
        ways.iter().map(|&way| Approach { way, steps: Vec::new() }).collect();
    let mut plans: Vec<Option<Plan>> = vec![None; ways.len()];
    let mut before: Option<Vec<Vec<u8>>> = None;
    let bar = progress::bar("coming nearer", u64::from(pictures));
    for picture in 0..pictures {
        let share = picture as f32 / pictures.saturating_sub(1).max(1) as f32;
        let distance_m = far * (near / far).powf(share);
        let orbit = Orbit { yaw, pitch: 0.0, distance: Some(distance_m) };
        let camera = orbit.camera(avatar, pose, width, height)?;
        let pose = Pose::Vertices(posed.vertices());
        // All Gaussians come first.
        let mut now = vec![draw(avatar, &pose, &all, &camera, WHITE)?.rgba];
        for (approach, last) in approaches.iter_mut().zip(&mut plans) {
            let Way { budget, later_budget, rising } = approach.way;
            let budget = if 2 * picture < pictures { budget } else { later_budget };
            let (wanted, spent) = planned(&posed, &camera, &Budget::of_gaussians(budget))?;
            let plan = match (rising, last.as_ref()) {
                (Some(factor), Some(last)) => wanted.rising_from(avatar, last, factor),
                _ => wanted.clone(),
            };
            let drawn = draw(avatar, &pose, &plan, &camera, WHITE)?;
            now.push(drawn.rgba);
            let change = |of: usize| before.as_ref().map_or(0.0, |b| change(&b[of], &now[of]));
            approach.steps.push(Step {
                distance_m,
                gaussians: plan.gaussians(),
                change_8bit: change(now.len() - 1),
                change_of_all_8bit: change(0),
                blends_foretold: (plan.gaussians() == wanted.gaussians()).then(|| {
                    f64::from(spent.blends) / drawn.statistics.counts.blends.max(1) as f64
                }),
            });
            *last = Some(plan);
        }
        before = Some(now);
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(approaches)
}

/// Root of the mean square, in 1/255.
fn change(a: &[u8], b: &[u8]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2));
    (squares.sum::<f64>() / a.len().max(1) as f64).sqrt()
}
