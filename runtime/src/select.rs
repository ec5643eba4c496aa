//! Walks the Gaussians of a plan, in the order of the file.

use dermis_format::{Avatar, Block, Disc, FrameKind, Full, Records, order};

use crate::plan::{Plan, RegionPlan};

/// Gaussians of less opacity are not in a level's occupancy (LapisGS, 3.1).
pub const LEAST_OPACITY: f32 = 0.005;

/// A Gaussian of the plan, its scales and opacity those of the plan's level.
#[derive(Clone, Copy, Debug)]
pub struct Selected<'a> {
    /// Its triangle; none without a mesh.
    pub triangle: Option<u32>,
    /// In the frame of that triangle.
    pub gaussian: Local,
    /// Its harmonics beyond the constant term; empty at degree 0.
    pub harmonics: Harmonics<'a>,
}

/// A Gaussian in the frame of its triangle.
#[derive(Clone, Copy, Debug)]
pub enum Local {
    /// Disc.
    Disc(Disc),
    /// With rotation and three scales.
    Full(Full),
}

/// Quantized harmonics of one Gaussian.
#[derive(Clone, Copy, Debug, Default)]
pub struct Harmonics<'a> {
    /// (r, g, b) after (r, g, b).
    pub codes: &'a [i8],
    /// Value of one code.
    pub step: f32,
}

/// Calls `visit` for each Gaussian of the plan.
pub fn for_each<'a>(avatar: &Avatar<'a>, plan: &Plan, mut visit: impl FnMut(Selected<'a>)) {
    let meshless = avatar.header().frame == FrameKind::World;
    let coefficients = avatar.header().harmonics() * 3;
    for block in avatar.blocks() {
        let Some(region) = plan.regions().get(usize::from(block.region)) else { continue };
        let drawn = region.count.saturating_sub(block.first).min(block.count);
        if drawn == 0 {
            continue;
        }
        for_each_of_block(&block, region, drawn, coefficients, meshless, &mut visit);
    }
}

fn for_each_of_block<'a>(
    block: &Block<'a>,
    region: &RegionPlan,
    drawn: u32,
    coefficients: usize,
    meshless: bool,
    visit: &mut impl FnMut(Selected<'a>),
) {
    let mut place = 0usize;
    for group in block.groups {
        for _ in 0..=group.count_less_one {
            let index = place;
            place += 1;
            if drawn < block.count && order::rank(index as u32, block.count) >= drawn {
                continue;
            }
            let Some(mut gaussian) = decode(block, group, index) else { continue };
            let opacity = gaussian.opacity_mut();
            *opacity = opacity_at(block, index, *opacity, region);
            if *opacity < LEAST_OPACITY {
                continue;
            }
            gaussian.widen(region.log2_scale);
            let base = group.base_triangle.get();
            let relative = block.triangles.get(index).map_or(0, |t| u32::from(t.get()));
            let codes = block.harmonics.get(index * coefficients..(index + 1) * coefficients);
            visit(Selected {
                triangle: (!meshless).then_some(base + relative),
                gaussian,
                harmonics: Harmonics {
                    codes: codes.unwrap_or(&[]),
                    step: group.harmonics_step.get(),
                },
            });
        }
    }
}

fn decode(
    block: &Block<'_>,
    group: &dermis_format::record::GroupRecord,
    index: usize,
) -> Option<Local> {
    match block.records {
        Records::Disc(discs) => discs.get(index).map(|record| Local::Disc(group.disc(record))),
        Records::Full(fulls) => fulls.get(index).map(|record| Local::Full(group.full(record))),
    }
}

/// Opacity at level λ = i + t: (1 − t) · o[i] + t · o[i + 1] for a Gaussian of layer m ≤ i, its own
/// opacity o[m] for an arriving one (LapisGS, 3.2).
fn opacity_at(block: &Block<'_>, index: usize, own: f32, region: &RegionPlan) -> f32 {
    let age = region.level - i32::from(block.layer);
    if block.later_levels == 0 || age < 0 {
        return own;
    }
    let later = block
        .opacities
        .get(index * block.later_levels..(index + 1) * block.later_levels)
        .unwrap_or(&[]);
    let at = |age: usize| {
        let code = age.checked_sub(1).and_then(|level| later.get(level));
        code.map_or(own, |&code| dermis_format::quant::opacity_value(code))
    };
    let now = at(age as usize);
    if region.fraction > 0.0 { now + region.fraction * (at(age as usize + 1) - now) } else { now }
}

impl Local {
    fn opacity_mut(&mut self) -> &mut f32 {
        match self {
            Self::Disc(disc) => &mut disc.opacity,
            Self::Full(full) => &mut full.opacity,
        }
    }

    fn widen(&mut self, log2_factor: f32) {
        match self {
            Self::Disc(disc) => disc.log2_scale.iter_mut().for_each(|s| *s += log2_factor),
            Self::Full(full) => full.log2_scale.iter_mut().for_each(|s| *s += log2_factor),
        }
    }
}
