//! What is encoded returns within half a step of its range.

use dermis_format::movement::MOST;
use dermis_format::quant::{Linear, last_code, quaternion_code, quaternion_value, rooted};
use dermis_format::record::{F32, ImportanceRecord, Range, ShortRange};
use dermis_format::rig::Property;
use dermis_format::source::{
    Channel, Clip, Gaussians, Importance, MeasuredCurves, MeasuredMovements, Source,
};
use dermis_format::writer::encode;
use dermis_format::{Avatar, Disc, Full, Records, Sample, order};
use proptest::prelude::*;

use crate::avatars::{self, discs_on};

/// Greatest allowed difference: half a step, and the rounding of values as large as these.
fn half_step(values: impl Iterator<Item = f32> + Clone, last: f32) -> f32 {
    let low = values.clone().fold(f32::INFINITY, f32::min);
    let high = values.clone().fold(f32::NEG_INFINITY, f32::max);
    0.501 * (high - low) / last + 4.0 * f32::EPSILON * low.abs().max(high.abs())
}

/// The same of 8 bits in a range of bf16, whose offset may lie a 128th of itself lower, and whose step may be a 128th longer.
fn short_half_step(values: impl IntoIterator<Item = f32>) -> f32 {
    let values: Vec<f32> = values.into_iter().collect();
    let low = values.iter().copied().fold(f32::INFINITY, f32::min);
    half_step(values.iter().copied().chain([low - low.abs() / 127.0]), 255.0) * (1.0 + 1.0 / 64.0)
}

fn near(found: f32, expected: f32, bound: f32) {
    assert!((found - expected).abs() <= bound, "{found} {expected} {bound}");
}

/// Every record of `source`'s first region with the Gaussians of its group.
fn for_each_group(source: &Source, mut visit: impl FnMut(std::ops::Range<usize>, &Decoded)) {
    let bytes = encode(source).unwrap();
    let avatar = Avatar::parse(&bytes).unwrap();
    for block in avatar.blocks().filter(|block| block.region == 0) {
        let all: Vec<usize> = (0..block.count as usize).collect();
        for places in all.chunks(256) {
            let decoded = match block.records {
                Records::Disc(discs) => {
                    Decoded::Disc(places.iter().map(|&i| discs.get(i).unwrap()).collect())
                }
                Records::Full(fulls) => {
                    Decoded::Full(places.iter().map(|&i| fulls.get(i).unwrap()).collect())
                }
            };
            let first = block.first as usize + places[0];
            visit(first..first + places.len(), &decoded);
        }
    }
}

enum Decoded {
    Disc(Vec<Disc>),
    Full(Vec<Full>),
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn codes_return_within_half_a_step(
        low in -1e6f32..1e6, span in prop::sample::select(vec![0.0f32, 1e-30, 1e-3, 1.0, 300.0, 1e6]),
        share in 0.0f32..=1.0, last in prop::sample::select(vec![255u16, u16::MAX]),
    ) {
        let value = low + span * share;
        let range = Range::spanning(low, low + span, last);
        let back = range.value(range.code(value, last));
        near(back, value, half_step([low, low + span].into_iter(), last.into()));
    }

    #[test]
    fn rotations_return_within_their_codes(w in -1f32..1.0, x in -1f32..1.0, y in -1f32..1.0, z in -1f32..1.0) {
        let length = (w * w + x * x + y * y + z * z).sqrt();
        prop_assume!(length > 0.01);
        let unit = [w, x, y, z].map(|c| c / length);
        let code = quaternion_code(unit);
        let back = quaternion_value(code);
        let dot: f32 = unit.iter().zip(back).map(|(a, b)| a * b).sum();
        // 0.333° is twice the arc cosine of this.
        prop_assert!(dot.abs() > 0.999_995_7, "{unit:?} {back:?}");
        let length2: f32 = back.iter().map(|x| x * x).sum();
        prop_assert!((length2 - 1.0).abs() < 1e-5);
    }

    /// Whatever the width, and never by more than half a step beyond what the range would be in exact numbers.
    #[test]
    fn short_codes_return_within_half_a_step(
        low in -1e4f32..1e4, span in prop::sample::select(vec![0.0f32, 1e-30, 1e-3, 1.0, 300.0, 1e6]),
        share in 0.0f32..=1.0, bits in 0u8..=8,
    ) {
        let (high, last) = (low + span, last_code(bits));
        let value = low + (high - low) * share;
        let range = ShortRange::spanning(low, high, last);
        let back = range.value(range.code(value, last));
        // The offset is at most a 128th of its magnitude below, the step a 128th longer.
        let step = range.step.get();
        let bound = if last == 0 { span / 2.0 + low.abs().max(high.abs()) / 256.0 } else { 0.501 * step };
        near(back, value, bound + 4.0 * f32::EPSILON * low.abs().max(high.abs()));
        if last > 0 {
            prop_assert!(range.value(0) <= low && range.value(last) >= high);
            let most = (high - low + low.abs() / 127.0) / f32::from(last) * (1.0 + 1.0 / 64.0);
            prop_assert!(step <= most + 1e-37, "{step} {most}");
        }
    }

    #[test]
    fn triangles_return(mut triangles in prop::collection::vec(0u32..70_000, 1..600), narrow in 1u32..5) {
        triangles.iter_mut().for_each(|t| *t /= 10u32.pow(narrow - 1));
        triangles.sort_unstable();
        let mut source = avatars::discs();
        source.mesh = avatars::strip(70_000);
        source.regions = vec![discs_on("all", &[triangles.len() as u32], 1)];
        source.regions[0].triangles = triangles.clone();
        let bytes = encode(&source).unwrap();
        let block = Avatar::parse(&bytes).unwrap().blocks().next().unwrap();
        prop_assert_eq!(block.triangles.iter().collect::<Vec<_>>(), triangles);
    }

    #[test]
    fn discs_return(seed in 0u64..1_000_000, layers in prop::collection::vec(0u32..700, 1..4), triangles in 1usize..40) {
        prop_assume!(layers.iter().sum::<u32>() > 0);
        let mut source = avatars::discs();
        source.mesh = avatars::strip(triangles);
        source.regions = vec![discs_on("all", &layers, triangles)];
        let n = layers.iter().sum::<u32>().into();
        let discs: Vec<Disc> = (0..n).map(|i| avatars::disc(seed + i)).collect();
        source.regions[0].gaussians = Gaussians::Disc(discs.clone());
        for_each_group(&source, |places, decoded| {
            let Decoded::Disc(found) = decoded else { panic!("discs") };
            let group = &discs[places];
            let upright = group.iter().map(|disc| disc.upright());
            for (found, expected) in found.iter().zip(upright) {
                for i in 0..3 {
                    let bound = short_half_step(group.iter().map(|d| rooted(d.position)[i]));
                    near(rooted(found.position)[i], rooted(expected.position)[i], bound + 1e-6);
                }
                let bound = short_half_step(group.iter().flat_map(|d| d.log2_scale));
                for i in 0..2 {
                    near(found.log2_scale[i], expected.log2_scale[i], bound);
                }
                near(found.opacity, expected.opacity, short_half_step(group.iter().map(|d| d.opacity)));
                near(found.angle, expected.angle, 0.501 * core::f32::consts::FRAC_PI_2 / 256.0);
                color_is_near(found.color, expected.color, group.iter().map(|d| d.color), short_half_step);
            }
        });
    }

    #[test]
    fn fulls_return(seed in 0u64..1_000_000, n in 1u64..600) {
        let mut source = avatars::cloud();
        let fulls: Vec<Full> = (0..n).map(|i| avatars::full(seed + i)).collect();
        source.regions[0].layers = vec![n as u32];
        source.regions[0].gaussians = Gaussians::Full(fulls.clone());
        for_each_group(&source, |places, decoded| {
            let Decoded::Full(found) = decoded else { panic!("full records") };
            let group = &fulls[places];
            for (found, expected) in found.iter().zip(group) {
                for i in 0..3 {
                    let bound = half_step(group.iter().map(|f| f.position[i]), 65_535.0);
                    near(found.position[i], expected.position[i], bound);
                    let bound = half_step(group.iter().flat_map(|f| f.log2_scale), 255.0);
                    near(found.log2_scale[i], expected.log2_scale[i], bound);
                }
                near(found.opacity, expected.opacity, 0.501 / 255.0);
                color_is_near(found.color, expected.color, group.iter().map(|f| f.color), |values| half_step(values.into_iter(), 255.0));
            }
        });
    }

    #[test]
    fn keys_return(values in prop::collection::vec(-10f32..10.0, 4..80)) {
        let mut source = avatars::rigged();
        let values = values[..values.len() / 4 * 4].to_vec();
        let channel = Channel { property: Property::Rotation(1), holds: false, values: values.clone(), step: 0.0 };
        source.rig.clips = vec![Clip { name: "c".into(), seconds: 1.0, channels: vec![channel] }];
        source.key_frames.clear();
        source.movements = None;
        let bytes = encode(&source).unwrap();
        let avatar = Avatar::parse(&bytes).unwrap();
        let channel = avatar.clips().next().unwrap().channels().next().unwrap();
        let bound = half_step(values.iter().copied(), 65_535.0);
        for (at, &value) in values.iter().enumerate() {
            near(channel.value(at / 4, at % 4), value, bound);
        }
    }
}

/// Half a step of Y, Co and Cg each moves r by no more than their sum.
fn color_is_near(
    found: [f32; 3],
    expected: [f32; 3],
    group: impl Iterator<Item = [f32; 3]> + Clone,
    half_step: impl Fn(Vec<f32>) -> f32,
) {
    let channel = |i: usize| group.clone().map(move |c| dermis_format::quant::ycocg_of_rgb(c)[i]);
    let bound: f32 = (0..3).map(|i| half_step(channel(i).collect())).sum();
    for (found, expected) in found.into_iter().zip(expected) {
        near(found, expected, bound + 1e-6);
    }
}

#[test]
fn the_mesh_and_its_rig_return() {
    let source = avatars::rigged();
    let bytes = encode(&source).unwrap();
    let avatar = Avatar::parse(&bytes).unwrap();
    for axis in 0..3 {
        let bound = half_step(source.mesh.positions.iter().map(|p| p[axis]), 65_535.0);
        for (index, position) in source.mesh.positions.iter().enumerate() {
            near(avatar.vertex_position(index)[axis], position[axis], bound);
        }
    }
    for (index, triangle) in source.mesh.triangles.iter().enumerate() {
        assert_eq!(avatar.triangle(index), *triangle);
        assert_eq!(avatar.is_two_sided(index), source.mesh.two_sided[index]);
    }
    for (index, expected) in source.mesh.influences.iter().enumerate() {
        let found = avatar.influences(index);
        assert_eq!(found.iter().map(|(_, w)| u32::from(*w)).sum::<u32>(), 255);
        for ((bind, weight), expected) in found.into_iter().zip(expected) {
            assert_eq!(bind, if weight > 0 { u32::from(expected.0) } else { 0 });
            near(f32::from(weight) / 255.0, expected.1, 1.0 / 255.0);
        }
    }
    assert_eq!(avatar.joint_names().collect::<Vec<_>>(), ["root", "头"]);
    assert_eq!(avatar.joints()[0].parent.get(), u16::MAX);
    assert_eq!(avatar.joints()[1].parent.get(), 0);
    assert_eq!(avatar.binds()[1].inverse[1][3].get(), 0.5);
    let target = avatar.morph_targets().next().unwrap();
    assert_eq!((target.name, target.default_weight), ("smile", 0.5));
    assert_eq!(target.vertices.iter().collect::<Vec<_>>(), [1, 4]);
    near(f32::from(target.deltas[0][2].get()) * target.step, -0.2, 0.5 * target.step);
    let clips: Vec<_> = avatar.clips().map(|clip| (clip.name, clip.seconds)).collect();
    assert_eq!(clips, [("nod", 2.0), ("still", 0.0)]);
    let keys: Vec<_> =
        avatar.clips().next().unwrap().channels().map(|c| (c.keys, c.holds)).collect();
    assert_eq!(keys, [(2, false), (2, false), (1, true), (3, true)]);
    assert_eq!(avatar.key_frames()[1].seconds.get(), 1.5);
}

#[test]
fn opacities_and_harmonics_return() {
    let source = avatars::opacities();
    let bytes = encode(&source).unwrap();
    for block in Avatar::parse(&bytes).unwrap().blocks() {
        assert_eq!(block.later_levels, 2 - usize::from(block.layer));
        for place in 0..block.count as usize {
            let expected = &source.regions[0].later_opacities[block.first as usize + place];
            assert_eq!(expected.len(), block.later_levels);
            for (level, &expected) in expected.iter().enumerate() {
                let code = block.opacities[place * block.later_levels + level];
                near(f32::from(code) / 255.0, expected, 0.501 / 255.0);
            }
        }
    }
    let source = avatars::harmonics();
    let bytes = encode(&source).unwrap();
    let avatar = Avatar::parse(&bytes).unwrap();
    let block = avatar.blocks().next().unwrap();
    let Records::Full(fulls) = block.records else { panic!("full records") };
    let step = fulls.groups[0].harmonics_step.get();
    let expected = source.regions[0].harmonics.concat();
    for (&code, expected) in block.harmonics.iter().zip(expected) {
        near(f32::from(code) * step, expected, 0.501 * step);
    }
}

/// A region whose opacity is the same at all levels keeps it beside one whose opacity changes.
#[test]
fn opacities_of_a_region_without_later_ones_stay() {
    let mut source = avatars::opacities();
    source.regions.push(discs_on("same", &[2, 3, 1], 3));
    source.mesh.triangle_regions = vec![0, 0, 1];
    let bytes = encode(&source).unwrap();
    let avatar = Avatar::parse(&bytes).unwrap();
    let mut levels = 0;
    for block in avatar.blocks().filter(|block| block.region == 1) {
        assert_eq!(block.later_levels, 2 - usize::from(block.layer));
        let Records::Disc(discs) = block.records else { panic!("discs") };
        for (place, disc) in discs.iter().enumerate() {
            for level in 0..block.later_levels {
                let code = block.opacities[place * block.later_levels + level];
                near(f32::from(code) / 255.0, disc.opacity, 1.01 / 255.0);
                levels += 1;
            }
        }
    }
    assert_eq!(levels, 2 * 2 + 3);
}

#[test]
fn later_opacities_of_the_wrong_length_are_refused() {
    for (place, len) in [(0, 1), (0, 3), (2, 0), (3, 2), (6, 1)] {
        let mut source = avatars::opacities();
        source.regions[0].later_opacities[place] = vec![0.5; len];
        let why = encode(&source).unwrap_err().to_string();
        assert!(why.contains("later opacities"), "{place} {len}: {why}");
    }
}

#[test]
fn weights_add_up_and_an_influence_that_is_not_used_is_0_0() {
    let mut source = avatars::rigged();
    source.mesh.influences = vec![
        [(1, 0.999), (1, 0.0), (1, 0.001), (1, 0.0)],
        [(1, 0.25); 4],
        [(1, 0.334), (0, 0.333), (1, 0.333), (1, 0.0)],
        [(0, 0.0), (1, 0.0), (1, 0.0), (1, 0.9995)],
        [(1, 0.499), (0, 0.499), (1, 0.001), (1, 0.001)],
    ];
    let bytes = encode(&source).unwrap();
    let avatar = Avatar::parse(&bytes).unwrap();
    for index in 0..5 {
        let found = avatar.influences(index);
        assert_eq!(found.iter().map(|(_, w)| u32::from(*w)).sum::<u32>(), 255, "vertex {index}");
        assert!(found.iter().all(|&(bind, weight)| weight > 0 || bind == 0), "{found:?}");
    }
    assert_eq!(avatar.influences(0), [(1, 255), (0, 0), (0, 0), (0, 0)]);
    assert_eq!(avatar.influences(3), [(0, 0), (0, 0), (0, 0), (1, 255)]);
}

#[test]
fn wide_spans_of_triangles_return() {
    let source = avatars::wide();
    let bytes = encode(&source).unwrap();
    let avatar = Avatar::parse(&bytes).unwrap();
    assert_eq!(avatar.triangle(69_999), [69_999, 70_000, 70_001]);
    let found: Vec<u32> = avatar.blocks().flat_map(|block| block.triangles.iter()).collect();
    assert_eq!(found, source.regions[0].triangles);
    // 2,500 of 70,000: 2 + log2(28) = 6.8 bits each.
    let payload = avatar.sections().filter(|s| s.tag == *b"BLCK").last().unwrap().payload;
    let (others, n) = (8 + 7 + 9 + 10 * 32 + 10 * 2500, 2500);
    assert!((payload.len() - others) * 8 < n * 7, "{} bytes", payload.len() - others);
}

#[test]
fn importances_return_and_are_written_where_there_are_any() {
    let mut source = avatars::regions();
    let bytes = encode(&source).unwrap();
    let avatar = Avatar::parse(&bytes).unwrap();
    let numbers =
        |r: &ImportanceRecord| [r.weight, r.mobility, r.visible, r.residual].map(F32::get);
    let found: Vec<_> = avatar.importances().iter().map(numbers).collect();
    let none = [1.0, 0.0, 0.0, 0.0];
    assert_eq!(found, [none, none, [4.0, 0.25, 0.5, 1.0]]);
    assert_eq!([0, 2, 3].map(|region| avatar.region_weight(region)), [1.0, 4.0, 1.0]);
    source.regions[2].importance = None;
    let without = encode(&source).unwrap();
    assert_eq!(without.len(), bytes.len() - 12 - 3 * 16, "a section, and nothing else");
    let avatar = Avatar::parse(&without).unwrap();
    assert_eq!((avatar.importances().len(), avatar.region_weight(2)), (0, 1.0));
    source.regions[0].importance = Some(Importance { weight: f32::NAN, ..Importance::default() });
    assert!(encode(&source).unwrap_err().to_string().contains("IMPO"));
}

#[test]
fn movements_return_rounded_up_and_are_written_where_there_are_any() {
    let mut source = avatars::rigged();
    let bytes = encode(&source).unwrap();
    let found = Avatar::parse(&bytes).unwrap().movements().expect("they were written");
    let written = source.movements.take().expect("there are some");
    let found = [
        written.joints.iter().zip(0..).map(|(&x, i)| (x, found.of_joint(i))).collect::<Vec<_>>(),
        written.targets.iter().zip(0..).map(|(&x, i)| (x, found.of_target(i))).collect(),
        written.clips.iter().zip(0..).map(|(&x, i)| (x, found.of_clip(i))).collect(),
    ];
    for (written, found) in found.into_iter().flatten() {
        let found = found.expect("it is there");
        assert!(found >= written && found <= written * (1.0 + 1.0 / 128.0), "{found} {written}");
    }
    source.movements =
        Some(MeasuredMovements { joints: vec![MOST, MOST - 4000.0], ..written.clone() });
    let bytes_of_most = encode(&source).expect("the greatest can be written");
    let most = Avatar::parse(&bytes_of_most).unwrap().movements().and_then(|m| m.of_joint(0));
    assert_eq!(most, Some(MOST));
    source.movements = None;
    let without = encode(&source).unwrap();
    assert_eq!(without.len(), bytes.len() - 12 - 6 * 2);
    assert!(Avatar::parse(&without).unwrap().movements().is_none());
    for joints in [vec![], vec![1.0], vec![1.0, f32::NAN], vec![1.0, -1.0], vec![1.0, 1e6]] {
        source.movements = Some(MeasuredMovements { joints, ..written.clone() });
        assert!(encode(&source).unwrap_err().to_string().contains("movements"));
    }
}

#[test]
fn samples_return_rounded_down_and_are_written_where_there_are_any() {
    let mut source = avatars::rigged();
    let bytes = encode(&source).unwrap();
    let found = Avatar::parse(&bytes).unwrap().samples().expect("they were written");
    let written = std::mem::take(&mut source.samples);
    assert_eq!(found.iter().count(), written.len());
    for (found, written) in found.iter().zip(&written) {
        assert_eq!(found.triangle, written.triangle);
        for (found, written) in [(found.area, written.area), (found.fill, written.fill)] {
            assert!(
                found <= written && found >= written * (1.0 - 1.0 / 128.0),
                "{found} {written}"
            );
        }
    }
    let without = encode(&source).unwrap();
    assert_eq!(without.len(), bytes.len() - 12 - 2 * 8);
    assert!(Avatar::parse(&without).unwrap().samples().is_none());
    let usual = written[0];
    for wrong in [
        Sample { triangle: 1, ..usual },
        Sample { triangle: u32::MAX, ..usual },
        Sample { area: -1.0, ..usual },
        Sample { area: 1e6, ..usual },
        Sample { fill: f32::NAN, ..usual },
    ] {
        source.samples = vec![wrong, written[1]];
        assert!(encode(&source).unwrap_err().to_string().contains("samples"), "{wrong:?}");
    }
}

#[test]
fn curves_return_rounded_down_and_are_written_where_there_are_any() {
    let mut source = avatars::regions();
    let bytes = encode(&source).unwrap();
    let curves = Avatar::parse(&bytes).unwrap().curves().expect("they were written");
    assert_eq!((curves.density(), curves.octaves()), (270.5, 2));
    let written = source.curves.take().expect("there are some");
    let places = (0..3).flat_map(|r| (0..2).flat_map(move |o| (0..6).map(move |s| (r, o, s))));
    for ((region, octave, stop), point) in places.zip(&written.points) {
        let found = curves.point(region, octave, stop).expect("it is there");
        for (found, written) in [(found.error, point.error), (found.blends, point.blends)] {
            assert!(
                found <= written && found >= written * (1.0 - 1.0 / 128.0),
                "{found} {written}"
            );
        }
    }
    let without = encode(&source).unwrap();
    assert_eq!(without.len(), bytes.len() - 12 - 5 - 3 * 2 * 6 * 4);
    assert!(Avatar::parse(&without).unwrap().curves().is_none());
    for short in [0, 1, 35] {
        let points = written.points[..short].to_vec();
        source.curves = Some(MeasuredCurves { points, ..written.clone() });
        assert!(encode(&source).unwrap_err().to_string().contains("curves"), "{short}");
    }
}

/// Blocks of all regions stand by the share of their region that is before them, so any number of
/// whole blocks holds nearly the same share of every region.
#[test]
fn blocks_of_regions_interleave() {
    let mut source = avatars::discs();
    source.regions = vec![discs_on("a", &[10_000, 30_000], 3), discs_on("b", &[9_000, 1_000], 3)];
    source.mesh.triangle_regions = vec![0, 0, 1];
    let bytes = encode(&source).unwrap();
    let mut shares = [0.0f64; 2];
    let mut last = 0.0;
    for block in Avatar::parse(&bytes).unwrap().blocks() {
        let total = [40_000.0, 10_000.0][usize::from(block.region)];
        let share = f64::from(block.first) / total;
        assert!(share >= last, "a block stands before a coarser one");
        last = share;
        shares[usize::from(block.region)] = f64::from(block.first + block.count) / total;
    }
    assert_eq!(shares, [1.0, 1.0]);
}

#[test]
fn what_cannot_be_encoded_is_refused() {
    let refused = |change: fn(&mut Source)| {
        let mut source = avatars::rigged();
        change(&mut source);
        encode(&source).expect_err("a refusal").to_string()
    };
    type Change = (fn(&mut Source), &'static str);
    let changes: [Change; 25] = [
        (|s| s.regions.clear(), "region"),
        (|s| s.mesh.triangles[1][2] = 65_536 + 2, "corner"),
        (|s| s.mesh.morph_targets[0].deltas[0].0 = 65_536, "vertex"),
        (|s| s.mesh.influences[0][1].0 = 256, "bind"),
        (|s| s.mesh.influences[0][1].1 = f32::NAN, "weight"),
        (|s| s.mesh.influences[2] = [(0, 1.0), (1, 1.0), (0, 1.0), (0, 0.0)], "add up to 3"),
        (|s| s.mesh.influences[2] = [(0, 0.0); 4], "add up to 0"),
        (|s| s.mesh.influences[2][0].1 += 0.002, "add up to"),
        (|s| s.mesh.influences[2] = [(0, 1.5), (1, -0.5), (0, 0.0), (0, 0.0)], "negative"),
        (|s| s.mesh.morph_targets[0].deltas[1].0 = 1, "ascend"),
        (|s| s.mesh.morph_targets[0].deltas.reverse(), "ascend"),
        (|s| s.mesh.two_sided.push(true), "two-sided"),
        (|s| s.mesh.positions[1][0] = f32::NAN, "finite"),
        (|s| s.bounds[1][1] = f32::INFINITY, "finite"),
        (|s| s.regions[0].layers[0] += 1, "differ"),
        (|s| s.regions[0].triangles.reverse(), "by triangle"),
        (|s| s.rig.joints[0].parent = Some(1), "parent"),
        (|s| s.rig.clips[0].channels[0].values.clear(), "keys"),
        (|s| s.mathematics.harmonics_degree = 1, "harmonics"),
        (|s| s.mesh.step = f32::NAN, "the mesh: a step of NaN m"),
        (|s| s.mesh.step = -1.0, "the mesh: a step of -1 m"),
        (|s| s.mesh.morph_targets[0].step = 2e6, "a step of 2000000 m"),
        (|s| s.rig.clips[0].channels[1].step = f32::NAN, "channel 1: a step of NaN"),
        (|s| s.rig.clips[0].channels[1].step = -1e-9, "channel 1: a step of -"),
        (|s| s.rig.clips[0].channels[1].step = 2e6, "channel 1: a step of 2000000"),
    ];
    for (change, word) in changes {
        let why = refused(change);
        assert!(why.contains(word), "{word}: {why}");
    }
    for number in 0..5 {
        let mut source = avatars::rigged();
        let Gaussians::Disc(discs) = &mut source.regions[0].gaussians else { panic!("discs") };
        let field = match number {
            0 => &mut discs[3].position[1],
            1 => &mut discs[3].angle,
            2 => &mut discs[3].log2_scale[0],
            3 => &mut discs[3].color[2],
            _ => &mut discs[3].opacity,
        };
        *field = f32::NAN;
        assert!(encode(&source).unwrap_err().to_string().contains("finite"), "number {number}");
    }
}

#[test]
fn every_prefix_of_a_block_is_evenly_spread() {
    // Rank of each place as SPEC.md gives it for five places.
    let ranks: Vec<u32> = (0..5).map(|place| order::rank(place, 5)).collect();
    assert_eq!(ranks, [0, 3, 2, 4, 1]);
    for count in 1..200 {
        for prefix in 1..=count {
            let drawn: Vec<u32> =
                (0..count).filter(|&place| order::rank(place, count) < prefix).collect();
            // As many places as it says, the first at 0, none further from the next, nor the last
            // from the end, than twice the mean gap.
            assert_eq!((drawn.len(), drawn[0]), (prefix as usize, 0));
            let ends = drawn[1..].iter().chain([&count]);
            for (place, next) in drawn.iter().zip(ends) {
                assert!((next - place) * prefix <= 2 * count, "{prefix} of {count}: {place}");
            }
        }
    }
}
