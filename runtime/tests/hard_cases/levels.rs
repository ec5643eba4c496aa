//! Parameters per level: what a plan makes of them at, near and between counts of levels.

use dermis_format::source::{Gaussians, Source};
use dermis_format::{Disc, Levels, Records, ScaleLaw};
use dermis_runtime::{Avatar, Kernel, Part, Plan, Pose, Posed, Prepared};

use crate::plans::selected;
use crate::scenes::{DOT, Picture, bytes, camera, leveled_crowd, random, sheet, tiles};

/// One region of these layers on one triangle, each Gaussian another one at each level.
fn leveled(layers: &[u32]) -> Source {
    let disc = |i: u32, salt: u32| {
        let r = |number| random(i, 16 * salt + number);
        Disc {
            position: [r(0) - 0.5, r(1) - 0.5, 0.1 * r(2)],
            angle: 3.0 * r(3),
            log2_scale: [-3.0 - r(4), -3.0 - r(5)],
            color: [r(6), r(7), r(8)],
            opacity: 0.05 + 0.9 * r(9),
        }
    };
    let n = layers.iter().sum();
    let mut source = sheet(&(0..n).map(|i| disc(i, 0)).collect::<Vec<_>>());
    source.mathematics.scale_law = ScaleLaw::SquareRoot;
    let region = &mut source.regions[0];
    region.layers = layers.to_vec();
    let mut earlier = 0;
    for (salt, &len) in (0..).zip(layers) {
        if salt > 0 {
            let needed = if len > 0 { earlier } else { 0 };
            region.levels.push((0..needed).map(|i| disc(i, salt)).collect());
        }
        earlier += len;
    }
    source
}

/// The same with the last level a shape of the one before.
fn shaped(layers: &[u32]) -> Source {
    let mut source = leveled(layers);
    let region = &mut source.regions[0];
    let Gaussians::Disc(own) = &region.gaussians else { panic!("discs") };
    let (last, before) = region.levels.split_last_mut().unwrap();
    let before = before.last().unwrap();
    let before = before.iter().chain(&own[before.len()..]);
    for (here, before) in last.iter_mut().zip(before) {
        *here = Disc { log2_scale: here.log2_scale, opacity: here.opacity, ..*before };
    }
    source
}

/// Files of both kinds.
fn files() -> [Vec<u8>; 2] {
    let files = [leveled(&LAYERS), shaped(&LAYERS)].map(|source| bytes(&source));
    assert!(files[1].len() < files[0].len());
    files
}

/// The discs of layers up to `level` as the file has them there, and the layer of each.
fn at_level(avatar: &Avatar<'_>, level: u8) -> Vec<(u8, Disc)> {
    let mut discs = Vec::new();
    for block in avatar.blocks_at(|_| Levels { upper: level, lower: None }) {
        let Records::Disc(records) = block.records else { panic!("discs") };
        if block.layer <= level {
            discs.extend(records.iter().map(|disc| (block.layer, disc)));
        }
    }
    discs
}

fn numbers(disc: &Disc) -> [f64; 10] {
    let ([x, y, z], [s, t], [r, g, b]) = (disc.position, disc.log2_scale, disc.color);
    [x, y, z, disc.angle, s, t, r, g, b, disc.opacity].map(f64::from)
}

/// Levels of 600, 1800 and 4800, blocks of several groups, with an empty layer between.
const LAYERS: [u32; 4] = [600, 0, 1200, 3000];
/// Layers that end levels, and Gaussians up to there.
const LEVELS: [(u8, u32); 3] = [(0, 600), (2, 1800), (3, 4800)];

#[test]
fn at_the_count_of_a_level_its_records_are_drawn_as_they_are() {
    for file in files() {
        let avatar = Avatar::parse(&file).unwrap();
        for (level, count) in LEVELS {
            let plan = Plan::with_budget(&avatar, count);
            let region = plan.regions()[0];
            assert_eq!(
                (region.levels, region.log2_scale),
                (Levels { upper: level, lower: None }, 0.0)
            );
            let expected: Vec<Disc> =
                at_level(&avatar, level).iter().map(|&(_, disc)| disc).collect();
            assert_eq!(selected(&avatar, &plan), expected, "level {level}");
        }
        // Level 1 of the file is level 0: layer 1 is empty.
        assert_eq!(Plan::at_level(&avatar, 1.0).gaussians(), 600);
    }
}

/// SPEC.md, section 8, in f64.
#[test]
fn between_levels_every_number_is_mixed() {
    for file in files() {
        let avatar = Avatar::parse(&file).unwrap();
        for pair in LEVELS.windows(2) {
            let [(lower, below), (upper, above)] = [pair[0], pair[1]];
            for count in [below + 1, below + 7, (below + above) / 2, above - 1] {
                let [below_k, k, all] = [below, count, above].map(f64::from);
                let wider = 0.5 * (all / k).log2();
                let rest = all - (0.4 * wider).exp2() * (k - below_k);
                let share = (rest / below_k).log2() / (all / below_k).log2();
                let plan = Plan::with_budget(&avatar, count);
                let region = plan.regions()[0];
                assert_eq!(region.levels, Levels { upper, lower: Some(lower) });
                assert!((f64::from(region.lower_share) - share).abs() < 1e-5);
                let found = selected(&avatar, &plan);
                assert_eq!(found.len(), count as usize, "none is faint");
                let (at, before) = (at_level(&avatar, upper), at_level(&avatar, lower));
                // Those that stay stand first; of those that arrive only some are there.
                for ((found, (_, at)), (_, before)) in found.iter().zip(&at).zip(&before) {
                    let (found, at, mut before) = (numbers(found), numbers(at), numbers(before));
                    let quarter = std::f64::consts::FRAC_PI_2;
                    let quarters = ((before[3] - at[3]) / quarter - 1.0 / 2048.0).round();
                    before[3] -= quarters * quarter;
                    if quarters % 2.0 != 0.0 {
                        before.swap(4, 5);
                    }
                    for i in 0..10 {
                        let expected = at[i] + share * (before[i] - at[i]);
                        assert!((found[i] - expected).abs() < 2e-5, "{i}: {} {expected}", found[i]);
                    }
                }
                assert!((f64::from(region.log2_scale) - 0.2 * wider).abs() < 1e-6);
                let arrived = |disc: &Disc| {
                    let log2_scale = disc.log2_scale.map(|scale| scale + region.log2_scale);
                    Disc { log2_scale, ..*disc }
                };
                let mut arriving = at.iter().skip(below as usize);
                for found in &found[below as usize..] {
                    assert!(arriving.any(|(_, disc)| arrived(disc) == *found), "in their order");
                }
            }
        }
    }
}

/// With one Gaussian more than at a level nothing jumps: what was there moves by a thousandth of the way.
#[test]
fn the_first_that_arrives_moves_the_others_little() {
    for file in files() {
        let avatar = Avatar::parse(&file).unwrap();
        for pair in LEVELS.windows(2) {
            let [(_, below), (upper, _)] = [pair[0], pair[1]];
            let [before, after] = [below, below + 1]
                .map(|count| selected(&avatar, &Plan::with_budget(&avatar, count)));
            let way = at_level(&avatar, upper);
            for ((before, after), (_, end)) in before.iter().zip(&after).zip(&way) {
                let (mut before, after, mut end) = (numbers(before), numbers(after), numbers(end));
                let quarters =
                    |from: f64, to: f64| ((to - from) / std::f64::consts::FRAC_PI_2).round();
                // By the axes of the one after it.
                for disc in [&mut before, &mut end] {
                    if quarters(disc[3], after[3]) % 2.0 != 0.0 {
                        disc.swap(4, 5);
                    }
                }
                for i in (0..10).filter(|&i| i != 3) {
                    let (moved, way) = ((after[i] - before[i]).abs(), (end[i] - before[i]).abs());
                    assert!(moved <= 0.0016 * way + 1e-5, "{i}: {moved} of {way}");
                }
                let turned = (after[3] - before[3]) / std::f64::consts::FRAC_PI_2;
                assert!((turned - turned.round()).abs() < 0.001, "{turned} quarter turns");
            }
        }
    }
}

#[test]
fn faint_between_two_levels_is_not_drawn() {
    // 4 stay; at the level of 8 their opacity is 0, at that of 4 it is 3/255.
    let mut source = sheet(&[Disc { opacity: 3.0 / 255.0, ..DOT }; 8]);
    source.mathematics.scale_law = ScaleLaw::SquareRoot;
    source.regions[0].layers = vec![4, 4];
    source.regions[0].levels = vec![vec![Disc { opacity: 0.0, ..DOT }; 4]];
    let Gaussians::Disc(discs) = &mut source.regions[0].gaussians else { panic!("discs") };
    discs[4..].fill(DOT);
    let file = bytes(&source);
    let avatar = Avatar::parse(&file).unwrap();
    let drawn = |count| selected(&avatar, &Plan::with_budget(&avatar, count)).len();
    // Shares at 5 to 8: 0.79, 0.56, 0.30, 0; of 0.0118 that is over 0.005 twice.
    assert_eq!([4, 5, 6, 7, 8].map(drawn), [4, 5, 6, 3, 4]);
}

/// A shape may be wider than its base: beside the frame its triangle is looked at as far as the shape reaches.
#[test]
fn a_wide_shape_reaches_into_the_frame_from_beside_it() {
    let narrow = Disc { log2_scale: [-8.0; 2], ..DOT };
    let mut source = sheet(&[narrow; 2]);
    source.mathematics.scale_law = ScaleLaw::SquareRoot;
    source.regions[0].layers = vec![1, 1];
    source.regions[0].levels = vec![vec![Disc { log2_scale: [0.0; 2], ..narrow }]];
    let file = bytes(&source);
    let avatar = Avatar::parse(&file).unwrap();
    assert_eq!(avatar.levels().map(|level| level.tag).collect::<Vec<_>>(), [*b"SHAP"]);
    let mut camera = camera(32, 32, 40.0, 2.0);
    // Its triangle of 1 m stands 2 m to the right of a frame that is 1.6 m wide there.
    camera.world_to_camera[0][3] += 2.0;
    let visible = |count| {
        let plan = Plan::with_budget(&avatar, count);
        Picture::of(&avatar, &Pose::Rest, &plan, &camera).statistics.gaussians_visible
    };
    assert_eq!([1, 2].map(visible), [0, 1]);
}

/// Every kernel draws the same bits at every count, and any number of parts makes the same splats.
#[test]
fn pictures_between_levels_are_the_same_by_every_kernel_and_in_parts() {
    let file = bytes(&leveled_crowd());
    let avatar = Avatar::parse(&file).unwrap();
    let camera = camera(80, 60, 40.0, 1.5);
    let mut posing = vec![0; Posed::scratch_len(&avatar)];
    let posed = Posed::new(&avatar, &Pose::Rest, Kernel::detect(), &mut posing).unwrap();
    for budget in [1, 60, 61, 120, 180, 181, 300, 399, 400] {
        let plan = Plan::with_budget(&avatar, budget);
        tiles(&avatar, &Pose::Rest, &plan, &camera);
        let picture = Picture::of(&avatar, &Pose::Rest, &plan, &camera);
        assert!(picture.statistics.gaussians_visible > budget / 4, "{budget}");
        let splats = |parts: usize| {
            let mut scratch = vec![0; Prepared::scratch_len(&avatar, budget, 80, 60)];
            let run = |parts: &mut [Part<'_, '_>]| parts.iter_mut().rev().for_each(Part::project);
            let prepared = Prepared::in_parts(&posed, &plan, &camera, &mut scratch, parts, run);
            prepared.unwrap().splats().to_vec()
        };
        let one = splats(1);
        assert!([2, 3, 7, 64].into_iter().all(|parts| splats(parts) == one), "{budget}");
    }
}

/// Each region is at a level of its own.
#[test]
fn regions_have_levels_of_their_own() {
    let file = bytes(&leveled_crowd());
    let avatar = Avatar::parse(&file).unwrap();
    let plan = Plan::of_counts(&avatar, [90, 100].into_iter());
    let found = selected(&avatar, &plan);
    let [first, second] = [0, 1].map(|region| plan.regions()[region]);
    assert_eq!(first.levels, Levels { upper: 2, lower: None });
    assert_eq!(second.levels, Levels { upper: 3, lower: Some(2) });
    let alone = |counts: [u32; 2]| selected(&avatar, &Plan::of_counts(&avatar, counts.into_iter()));
    let (one, other) = (alone([90, 0]), alone([0, 100]));
    assert_eq!(found.len(), one.len() + other.len());
    assert!(found.iter().all(|disc| one.contains(disc) || other.contains(disc)));
}
