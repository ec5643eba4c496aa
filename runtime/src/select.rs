//! Walks the Gaussians of a plan, in the order of the file.

use dermis_format::order::{self, GROUP_LEN};
use dermis_format::quant::opacity_value;
use dermis_format::{Avatar, Block, Disc, Full, Fulls, Records};

use crate::math::Real;
use crate::mix::{between, mixed};
use crate::plan::{Plan, RegionPlan};

/// Gaussians of less opacity are not in a level's occupancy (LapisGS, 3.1).
pub const LEAST_OPACITY: f32 = 0.005;

/// Where a Gaussian of the plan stands in the file.
#[derive(Clone, Copy, Debug)]
pub struct Place<'a, 'b> {
    /// Its block.
    pub block: &'b Block<'a>,
    /// Its index in the block.
    pub index: usize,
    /// Its triangle; none without a mesh.
    pub triangle: Option<u32>,
    /// At the plan's level; at least [`LEAST_OPACITY`].
    pub opacity: f32,
    /// Added to log₂ of its scales.
    pub log2_factor: f32,
    /// How far it has gone to the level below, in [0, 1], if its block is between two.
    pub share: f32,
}

/// A Gaussian of the plan, its scales and opacity those of the plan's level.
#[derive(Clone, Copy, Debug)]
pub struct Selected<'a> {
    /// In the frame of its triangle.
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

impl Harmonics<'_> {
    /// (r, g, b) of one coefficient after the other, numbers like `number`.
    pub fn values<R: Real + 'static>(&self, number: R) -> impl Iterator<Item = [R; 3]> + '_ {
        let step = number.like(self.step);
        self.codes
            .as_chunks::<3>()
            .0
            .iter()
            .map(move |codes| codes.map(|code| number.like(f32::from(code)) * step))
    }
}

/// Calls `visit` for each block of the file that the plan draws from, as it is at the plan's levels, and how
/// many of its Gaussians: those of lower rank.
pub fn for_each_block<'a>(
    avatar: &Avatar<'a>,
    plan: &Plan,
    mut visit: impl FnMut(&Block<'a>, &RegionPlan, u32),
) {
    let levels = |region: u8| plan.regions().get(usize::from(region)).map(|region| region.levels);
    for block in avatar.blocks_at(|region| levels(region).unwrap_or_default()) {
        let Some(region) = plan.regions().get(usize::from(block.region)) else { continue };
        let drawn = region.count.saturating_sub(block.first).min(block.count);
        if drawn > 0 {
            visit(&block, region, drawn);
        }
    }
}

/// Calls `visit` with the Gaussians of a block that are drawn and whose triangle `shows`; without a
/// mesh, all that are drawn.
#[inline(always)]
pub fn for_each_of_block<'a, 'b>(
    block: &'b Block<'a>,
    region: &RegionPlan,
    drawn: u32,
    shows: impl Fn(u32) -> bool,
    mut visit: impl FnMut(Place<'a, 'b>),
) {
    let whole = drawn >= block.count;
    let (log2_factor, share) = (log2_factor(block, region), region.lower_share);
    let has_own_opacity = has_own_opacity(block, region);
    let is_free = block.triangles.is_empty();
    let mut triangles = block.triangles.iter();
    for start in (0..block.count as usize).step_by(GROUP_LEN) {
        let len = GROUP_LEN.min(block.count as usize - start);
        // First a list without branches: whether the next triangle shows is hard to foresee.
        let mut of_group = [0; GROUP_LEN];
        of_group.iter_mut().take(len).zip(&mut triangles).for_each(|(to, from)| *to = from);
        let mut chosen = [0u8; GROUP_LEN];
        let mut count = 0;
        for (at, &triangle) in of_group.iter().take(len).enumerate() {
            let index = (start + at) as u32;
            let shown = is_free || shows(triangle);
            let drawn = shown & (whole || order::rank(index, block.count) < drawn);
            chosen[count % GROUP_LEN] = at as u8;
            count += usize::from(drawn);
        }
        for &at in chosen.get(..count).unwrap_or(&[]) {
            let index = start + usize::from(at);
            let own = own_opacity(&block.records, index);
            let opacity = if has_own_opacity { own } else { opacity_at(block, index, region, own) };
            if opacity >= LEAST_OPACITY {
                let triangle = (!is_free).then(|| of_group[usize::from(at)]);
                visit(Place { block, index, triangle, opacity, log2_factor, share });
            }
        }
    }
}

/// Added to log₂ of the scales of a block's Gaussians: those that are on their way to the level below are as
/// wide as both say.
pub(crate) fn log2_factor(block: &Block<'_>, region: &RegionPlan) -> f32 {
    if block.below.is_some() { 0.0 } else { region.log2_scale }
}

#[inline]
fn own_opacity(records: &Records<'_>, index: usize) -> f32 {
    match records {
        Records::Disc(discs) => discs.opacity(index),
        Records::Full(fulls) => fulls.records.get(index).map_or(0.0, |g| opacity_value(g.opacity)),
    }
}

/// Whether the opacity of a block's Gaussians is that of their records.
fn has_own_opacity(block: &Block<'_>, region: &RegionPlan) -> bool {
    let arrives = region.level < i32::from(block.layer);
    block.below.is_none() && (block.later_levels == 0 || arrives)
}

/// Opacity at level λ = i + t of a Gaussian of layer m ≤ i whose record has `own`: (1 − t) · o[i] + t · o[i + 1]
/// (LapisGS, 3.2). Between two levels with parameters of their own: as all
/// other numbers.
#[inline]
fn opacity_at(block: &Block<'_>, index: usize, region: &RegionPlan, own: f32) -> f32 {
    if let Some(below) = &block.below {
        return between(own, below.opacity(index), region.lower_share);
    }
    let age = region.level - i32::from(block.layer);
    let later = block
        .opacities
        .get(index * block.later_levels..(index + 1) * block.later_levels)
        .unwrap_or(&[]);
    let at = |age: usize| {
        let code = age.checked_sub(1).and_then(|level| later.get(level));
        code.map_or(own, |&code| opacity_value(code))
    };
    let now = at(age as usize);
    if region.fraction > 0.0 { now + region.fraction * (at(age as usize + 1) - now) } else { now }
}

impl<'a> Place<'a, '_> {
    /// The Gaussian, decoded.
    pub fn decode(&self) -> Option<Selected<'a>> {
        let gaussian = match self.block.records {
            Records::Disc(discs) => {
                let mut disc = discs.get(self.index)?;
                if let Some(below) = &self.block.below {
                    disc = mixed(&disc, &below.get(self.index)?, self.share);
                }
                disc.opacity = self.opacity;
                disc.log2_scale.iter_mut().for_each(|scale| *scale += self.log2_factor);
                Local::Disc(disc)
            }
            Records::Full(fulls) => {
                let mut full = fulls.get(self.index)?;
                full.opacity = self.opacity;
                full.log2_scale.iter_mut().for_each(|scale| *scale += self.log2_factor);
                Local::Full(full)
            }
        };
        Some(Selected { gaussian, harmonics: self.harmonics() })
    }

    /// Its harmonics.
    #[inline]
    pub fn harmonics(&self) -> Harmonics<'a> {
        if self.block.harmonics.is_empty() {
            return Harmonics::default();
        }
        let len = self.block.harmonics.len() / (self.block.count as usize).max(1);
        let codes = self.block.harmonics.get(self.index * len..(self.index + 1) * len);
        let step = match self.block.records {
            Records::Full(Fulls { groups, .. }) => {
                groups.get(self.index / GROUP_LEN).map_or(0.0, |group| group.harmonics_step.get())
            }
            Records::Disc(_) => 0.0,
        };
        Harmonics { codes: codes.unwrap_or(&[]), step }
    }
}
