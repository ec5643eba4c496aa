//! Plans: budgets, levels, prefixes and opacities per level.

use dermis_format::source::{Gaussians, Source};
use dermis_format::{Disc, ScaleLaw, order};
use dermis_runtime::select::{self, Local};
use dermis_runtime::{Avatar, Plan};
use proptest::prelude::*;

use crate::scenes::{DOT, bytes, sheet};

/// Regions with these layers.
fn layered(layers: &[Vec<u32>], law: ScaleLaw) -> Source {
    let mut source = sheet(&[]);
    let region = source.regions.remove(0);
    source.regions = layers
        .iter()
        .map(|layers| {
            let n = layers.iter().sum::<u32>() as usize;
            let mut region = region.clone();
            region.layers = layers.clone();
            region.gaussians = Gaussians::Disc(vec![DOT; n]);
            region.triangles = vec![0; n];
            region
        })
        .collect();
    source.mesh.triangle_regions = vec![0];
    source.mathematics.scale_law = law;
    source
}

fn counts(plan: &Plan) -> Vec<u32> {
    plan.regions().iter().map(|region| region.count).collect()
}

pub(crate) fn selected(avatar: &Avatar<'_>, plan: &Plan) -> Vec<Disc> {
    let mut discs = Vec::new();
    select::for_each_block(avatar, plan, |block, region, drawn| {
        select::for_each_of_block(
            block,
            region,
            drawn,
            |_| true,
            |place| {
                let Some(Local::Disc(disc)) = place.decode().map(|s| s.gaussian) else {
                    panic!("a disc")
                };
                discs.push(disc);
            },
        );
    });
    discs
}

fn any_layers() -> impl Strategy<Value = Vec<Vec<u32>>> {
    (1usize..5, 1usize..7).prop_flat_map(|(layers, regions)| {
        let layer = prop_oneof![2 => 0u32..4, 1 => 0u32..60];
        prop::collection::vec(prop::collection::vec(layer, layers), regions)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn budgets_are_spent_whole_and_never_exceeded(layers in any_layers()) {
        let bytes = bytes(&layered(&layers, ScaleLaw::SquareRoot));
        let avatar = Avatar::parse(&bytes).unwrap();
        let total = avatar.header().gaussians;
        let mut last = vec![0; layers.len()];
        for budget in (0..total + 3).chain([u32::MAX]) {
            let plan = Plan::with_budget(&avatar, budget);
            prop_assert_eq!(plan.gaussians(), budget.min(total));
            prop_assert_eq!(selected(&avatar, &plan).len() as u32, budget.min(total));
            let now = counts(&plan);
            // No region gives back what it had: nothing vanishes as the budget grows.
            prop_assert!(now.iter().zip(&last).all(|(now, last)| now >= last), "{now:?} {last:?}");
            last = now;
            // Nor is any region short of its share.
            for (region, plan) in plan.regions().iter().enumerate() {
                let share = u64::from(avatar.region_len(region)) * u64::from(budget.min(total));
                prop_assert!(u64::from(plan.count) >= share.checked_div(total.into()).unwrap_or(0));
            }
            let level = plan.level(&avatar);
            prop_assert!((-1.0..layers[0].len() as f32).contains(&level), "{level}");
        }
    }

    #[test]
    fn level_and_fraction_say_the_count(layers in any_layers()) {
        let bytes = bytes(&layered(&layers, ScaleLaw::SquareRoot));
        let avatar = Avatar::parse(&bytes).unwrap();
        for budget in 0..=avatar.header().gaussians {
            let plan = Plan::with_budget(&avatar, budget);
            for (layers, region) in layers.iter().zip(plan.regions()) {
                let whole = (region.level + 1) as usize;
                let before: u32 = layers[..whole].iter().sum();
                let next = layers.get(whole).copied().unwrap_or(0) as f32;
                prop_assert!((0.0..1.0).contains(&region.fraction));
                prop_assert_eq!((before as f32 + region.fraction * next).round() as u32, region.count);
                // With the last layer whole there is no next one.
                prop_assert!(whole < layers.len() || region.fraction == 0.0);
                let len: u32 = layers.iter().sum();
                let widening = if region.count == 0 { 1.0 } else { (len as f32 / region.count as f32).sqrt() };
                prop_assert!((region.log2_scale.exp2() / widening - 1.0).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn whole_levels_are_their_layers(layers in any_layers()) {
        let bytes = bytes(&layered(&layers, ScaleLaw::Constant));
        let avatar = Avatar::parse(&bytes).unwrap();
        let sums = |n: usize| layers.iter().map(|l| l[..n].iter().sum()).collect::<Vec<u32>>();
        let last = layers[0].len();
        for level in 0..=last {
            let plan = Plan::at_level(&avatar, level as f32 - 1.0);
            prop_assert_eq!(counts(&plan), sums(level));
            prop_assert!(plan.regions().iter().all(|region| region.log2_scale == 0.0));
        }
        let level = |level| counts(&Plan::at_level(&avatar, level));
        for none in [f32::NAN, f32::NEG_INFINITY, -7.0] {
            prop_assert_eq!(level(none), sums(0));
        }
        for all in [f32::INFINITY, 1e30, last as f32] {
            prop_assert_eq!(level(all), sums(last));
        }
        let mut before = sums(0);
        for step in 0..=20 {
            let now = level(step as f32 / 20.0 * last as f32 - 1.0);
            prop_assert!(now.iter().zip(&before).all(|(a, b)| a >= b));
            before = now;
        }
    }
}

/// With largest remainders or first come, first served, the second region would shrink from 1 to 0
/// between budgets of 2 and 3.
#[test]
fn small_regions_do_not_flicker() {
    let bytes = bytes(&layered(&[vec![1], vec![1], vec![2], vec![2]], ScaleLaw::Constant));
    let avatar = Avatar::parse(&bytes).unwrap();
    let plans: Vec<_> = (0..7).map(|b| counts(&Plan::with_budget(&avatar, b))).collect();
    assert_eq!(plans[2..4], [[0, 0, 1, 1], [1, 0, 1, 1]]);
    assert_eq!(plans[6], [1, 1, 2, 2]);
}

#[test]
fn a_plan_of_counts_takes_no_more_than_there_is() {
    let bytes = bytes(&layered(&[vec![3], vec![2]], ScaleLaw::Constant));
    let avatar = Avatar::parse(&bytes).unwrap();
    assert_eq!(counts(&Plan::of_counts(&avatar, [9, 1].into_iter())), [3, 1]);
    assert_eq!(counts(&Plan::of_counts(&avatar, [u32::MAX, u32::MAX, 5].into_iter())), [3, 2]);
}

/// k Gaussians are those of ranks 0..k, whatever block they stand in, and their scales are √(N / k) wider.
#[test]
fn a_prefix_is_the_lowest_ranks() {
    // Block and group as the place along x, place in the group along y: both are exact codes.
    let layers = [90, 4200];
    let mut discs = Vec::new();
    let mut ranks = Vec::new();
    for (block, (_, first, count)) in order::blocks(&layers).enumerate() {
        for place in 0..count {
            let (x, y) = (block as u32 * 32 + place / 256, place % 256);
            discs.push(Disc { position: [x as f32, y as f32, 0.0], ..DOT });
            ranks.push((first + order::rank(place, count), x, y));
        }
    }
    let mut source = sheet(&discs);
    source.regions[0].layers = layers.to_vec();
    source.mathematics.scale_law = ScaleLaw::SquareRoot;
    let bytes = bytes(&source);
    let avatar = Avatar::parse(&bytes).unwrap();
    for count in [1, 2, 89, 90, 91, 1000, 2190, 2191, 4289, 4290] {
        let found = selected(&avatar, &Plan::with_budget(&avatar, count));
        let places: Vec<_> = found
            .iter()
            .map(|disc| (disc.position[0].round() as u32, disc.position[1].round() as u32))
            .collect();
        let expected: Vec<_> =
            ranks.iter().filter(|(rank, ..)| *rank < count).map(|&(_, x, y)| (x, y)).collect();
        assert_eq!(places, expected, "the first {count}");
        let widening = (4290.0 / count as f32).sqrt();
        assert!(found.iter().all(|d| (d.log2_scale[0].exp2() * 8.0 / widening - 1.0).abs() < 1e-5));
    }
}

/// Three layers of four Gaussians; own opacities 0.2, later ones 0.4 and 0.8 for the first layer, 0.6 for the second.
fn fading() -> Source {
    let mut source = sheet(&[Disc { opacity: 0.2, ..DOT }; 12]);
    source.regions[0].layers = vec![4, 4, 4];
    source.regions[0].later_opacities =
        [vec![0.4, 0.8], vec![0.6], vec![]].into_iter().flat_map(|o| vec![o; 4]).collect();
    source
}

#[test]
fn opacities_follow_the_level() {
    let bytes = bytes(&fading());
    let avatar = Avatar::parse(&bytes).unwrap();
    for eighth in -8i32..=16 {
        let level = eighth as f32 / 8.0;
        let found: Vec<f32> =
            selected(&avatar, &Plan::at_level(&avatar, level)).iter().map(|d| d.opacity).collect();
        // A level is counts, so quarters of a layer's four Gaussians: λ = i + t with t in quarters.
        let quarters = (4.0 * (level + 1.0)).floor() as usize;
        let (i, t) = (quarters as i32 / 4 - 1, (quarters % 4) as f32 / 4.0);
        let o = [[0.2, 0.4, 0.8], [0.0, 0.2, 0.6], [0.0, 0.0, 0.2]];
        let mut expected = Vec::new();
        for place in 0..quarters {
            let (layer, at) = (place / 4, i.max(0) as usize);
            let arriving = layer as i32 > i;
            let later = o[layer][(at + 1).min(2)];
            expected.push(if arriving { 0.2 } else { (1.0 - t) * o[layer][at] + t * later });
        }
        assert_eq!(found.len(), expected.len(), "level {level}");
        let near = found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 2e-6);
        assert!(near, "level {level}: {found:?}, expected {expected:?}");
    }
}

/// Under 0.005 a Gaussian is not in a level's occupancy: code 1 is 0.0039, code 2 is 0.0078.
#[test]
fn faint_gaussians_are_left_out_of_their_level() {
    let mut source = fading();
    for (code, expected) in [(0.0, 4), (1.0, 4), (2.0, 8)] {
        source.regions[0].later_opacities[..4].fill(vec![code / 255.0, 1.0]);
        let bytes = bytes(&source);
        let avatar = Avatar::parse(&bytes).unwrap();
        let drawn = |level| selected(&avatar, &Plan::at_level(&avatar, level)).len();
        assert_eq!([drawn(0.0), drawn(1.0), drawn(2.0)], [4, expected, 12], "code {code}");
    }
}
