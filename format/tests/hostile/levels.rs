//! Parameters per level: they return, and whatever is out of its place is found.

use dermis_format::quant::rooted;
use dermis_format::record::DiscGroup;
use dermis_format::section::{Section, head, preamble};
use dermis_format::source::{Gaussians, Source};
use dermis_format::writer::encode;
use dermis_format::{Avatar, Disc, DiscWidths, Discs, Error, Levels, PerLevel, Records, ScaleLaw};

use crate::avatars::{
    add_levels, full, harmonics, levels, many_levels, many_shapes, narrow, opacities, shapes,
};
use crate::{file, parse_and_walk};

const LEVL: [u8; 4] = *b"LEVL";
const SHAP: [u8; 4] = *b"SHAP";
const BLCK: [u8; 4] = *b"BLCK";

fn is_level(tag: [u8; 4]) -> bool {
    [LEVL, SHAP].contains(&tag)
}

fn discs(records: Records<'_>) -> Discs<'_> {
    let Records::Disc(discs) = records else { panic!("discs") };
    discs
}

/// A disc of a file, and the ranges that it is of.
fn decoded(discs: Discs<'_>) -> Vec<(Disc, DiscGroup)> {
    let of_each = (0..discs.len()).map(|index| {
        let group = discs.groups()[index / 256];
        discs.shape().map_or(group, |shape| {
            let DiscGroup { log2_scale, opacity, .. } = shape.groups()[index / 256];
            DiscGroup { log2_scale, opacity, ..group }
        })
    });
    discs.iter().zip(of_each).collect()
}

/// Within half a step of each range.
fn assert_near(found: &[(Disc, DiscGroup)], expected: &[Disc]) {
    assert_eq!(found.len(), expected.len());
    let expected = expected.iter().map(|disc| disc.upright());
    for ((found, group), expected) in found.iter().zip(expected) {
        let near = |a: f32, b: f32, step: f32| (a - b).abs() <= 0.51 * step + 1e-6;
        let [found_position, expected_position] = [*found, expected].map(|d| rooted(d.position));
        for i in 0..3 {
            assert!(near(found_position[i], expected_position[i], group.position[i].step.get()));
        }
        for i in 0..2 {
            assert!(near(found.log2_scale[i], expected.log2_scale[i], group.log2_scale.step.get()));
        }
        assert!(near(found.angle, expected.angle, core::f32::consts::FRAC_PI_2 / 256.0));
        assert!(near(found.opacity, expected.opacity, group.opacity.step.get()));
    }
}

/// The discs of a region's first Gaussians at a level that has them.
fn expected(source: &Source, region: usize, level: usize) -> Vec<Disc> {
    let region = &source.regions[region];
    let Gaussians::Disc(own) = &region.gaussians else { panic!("discs") };
    let start: u32 = region.layers[..level].iter().sum();
    let end = start + region.layers[level];
    let earlier = level.checked_sub(1).map_or(&[][..], |index| &region.levels[index]);
    [earlier, &own[start as usize..end as usize]].concat()
}

/// The greatest scale that is said of a group is that of its widest disc, of the shape where there is one.
#[test]
fn greatest_scales_are_those_of_what_is_drawn() {
    for source in [levels(), shapes(), many_shapes()] {
        let bytes = encode(&source).unwrap();
        let avatar = Avatar::parse(&bytes).unwrap();
        for upper in 0..avatar.header().layers {
            for block in avatar.blocks_at(|_| Levels { upper, lower: None }) {
                let discs = discs(block.records);
                let all: Vec<Disc> = discs.iter().collect();
                let greatest: Vec<f32> = discs.greatest_log2_scales().collect();
                assert_eq!(greatest.len(), all.chunks(256).len());
                for (group, greatest) in all.chunks(256).zip(greatest) {
                    let widest =
                        group.iter().flat_map(|disc| disc.log2_scale).fold(f32::MIN, f32::max);
                    // Ranges reach a little further than what they hold.
                    assert!(widest <= greatest && greatest - widest < 0.05, "{widest} {greatest}");
                }
            }
        }
    }
}

#[test]
fn levels_return() {
    for source in [levels(), many_levels(), shapes(), many_shapes()] {
        let bytes = encode(&source).unwrap();
        let avatar = Avatar::parse(&bytes).unwrap();
        assert_eq!(avatar.header().per_level, PerLevel::All);
        for (index, region) in source.regions.iter().enumerate() {
            let whole: Vec<usize> =
                (0..region.layers.len()).filter(|&layer| region.layers[layer] > 0).collect();
            for &upper in &whole {
                for lower in
                    whole.iter().copied().filter(|&lower| lower < upper).map(Some).chain([None])
                {
                    let levels =
                        Levels { upper: upper as u8, lower: lower.map(|lower| lower as u8) };
                    let (mut at, mut below) = (Vec::new(), Vec::new());
                    let blocks = avatar.blocks_at(|_| levels);
                    for block in blocks.filter(|block| usize::from(block.region) == index) {
                        if usize::from(block.layer) <= upper {
                            at.extend(decoded(discs(block.records)));
                        }
                        below.extend(block.below.into_iter().flat_map(decoded));
                    }
                    assert_near(&at, &expected(&source, index, upper));
                    let lower = lower.map_or(Vec::new(), |lower| expected(&source, index, lower));
                    assert_near(&below, &lower);
                }
            }
        }
    }
}

/// (tag, region, layer or level, first rank) of blocks and levels.
fn order_of(bytes: &[u8]) -> Vec<([u8; 4], u8, u8, u32)> {
    let sections = Avatar::parse(bytes).unwrap().sections();
    sections
        .filter(|section| section.tag == BLCK || is_level(section.tag))
        .map(|Section { tag, payload }| {
            let first = u32::from_le_bytes([payload[4], payload[5], payload[6], payload[7]]);
            (tag, payload[0], payload[1], first)
        })
        .collect()
}

#[test]
fn levels_lead_the_first_block_of_their_layer() {
    let order = order_of(&encode(&many_levels()).unwrap());
    let of = |region: u8| -> Vec<_> {
        order
            .iter()
            .filter(|o| o.1 == region)
            .map(|&(tag, _, layer, first)| (tag, layer, first))
            .collect()
    };
    assert_eq!(
        of(0),
        [
            (BLCK, 0, 0),
            (LEVL, 1, 0),
            (BLCK, 1, 300),
            (BLCK, 1, 2800),
            (LEVL, 2, 0),
            (LEVL, 2, 300),
            (LEVL, 2, 2800),
            (BLCK, 2, 5300)
        ]
    );
    assert_eq!(of(2), [(BLCK, 0, 0), (LEVL, 2, 0), (BLCK, 2, 2), (BLCK, 2, 2102)]);
    // A layer that is empty is no level, nor is anything led in a file without levels.
    let order = order_of(&encode(&levels()).unwrap());
    assert_eq!(
        order.iter().filter(|o| o.0 == LEVL).map(|o| (o.1, o.2)).collect::<Vec<_>>(),
        [(0, 2), (0, 3), (0, 3), (1, 2)]
    );
    assert!(order_of(&encode(&opacities()).unwrap()).iter().all(|o| o.0 == BLCK));
}

/// What differs from the level before in scales and opacities alone has these alone, and the same numbers else.
#[test]
fn shapes_are_of_the_level_before() {
    let kinds = |source: &Source| -> Vec<_> {
        let order = order_of(&encode(source).unwrap());
        order.iter().filter(|o| o.0 != BLCK).map(|o| (o.0, o.1, o.2)).collect()
    };
    assert_eq!(kinds(&shapes()), [(LEVL, 0, 2), (SHAP, 0, 3), (SHAP, 0, 3), (SHAP, 1, 2)]);
    let bytes = encode(&many_shapes()).unwrap();
    let avatar = Avatar::parse(&bytes).unwrap();
    for (upper, lower) in [(2, 1), (1, 0)] {
        for block in avatar.blocks_at(|_| Levels { upper, lower: Some(lower) }) {
            let (Some(below), true) = (block.below, block.region == 0) else { continue };
            for (here, before) in discs(block.records).iter().zip(below.iter()) {
                let Disc { log2_scale, opacity, .. } = here;
                let alike = here == Disc { log2_scale, opacity, ..before };
                assert_eq!(alike, upper == 2, "level {upper}");
                assert_ne!(here, before);
            }
        }
    }
    // One number of one Gaussian is enough to need records.
    let mut source = shapes();
    source.regions[0].levels[2][4].color[1] += 0.1;
    assert_eq!(kinds(&source), [(LEVL, 0, 2), (LEVL, 0, 3), (LEVL, 0, 3), (SHAP, 1, 2)]);
}

/// Records of a level that happen to have no bits but for scales and opacity are no shape: other numbers are the middle of their group.
#[test]
fn records_without_bits_are_no_shapes() {
    let mut source = levels();
    source.widths = vec![DiscWidths::default().of_shape(); 4];
    let bytes = encode(&source).unwrap();
    let avatar = Avatar::parse(&bytes).unwrap();
    let levels: Vec<_> = avatar.levels().collect();
    assert_eq!(levels.len(), 4);
    for level in levels {
        assert_eq!(level.tag, LEVL);
        let places = level.first as usize..(level.first + level.count) as usize;
        let region = &source.regions[usize::from(level.region)];
        let written = &region.levels[usize::from(level.level) - 1][places];
        let x = |pick: fn(f32, f32) -> f32| written.iter().map(|d| d.position[0]).reduce(pick);
        let middle = (x(f32::min).unwrap() + x(f32::max).unwrap()) / 2.0;
        for disc in level.discs.iter() {
            assert!((disc.position[0] - middle).abs() <= 0.01 * middle.abs(), "{middle}: {disc:?}");
        }
    }
}

/// A run is of one kind, and a shape has no bits for other numbers.
#[test]
fn shapes_among_records_or_with_more_bits_are_errors() {
    for source in [shapes(), many_shapes()] {
        let (header, sections) = parts(&encode(&source).unwrap());
        for index in (0..sections.len()).filter(|&index| sections[index].0 == SHAP) {
            let mut changed = sections.clone();
            changed[index].0 = LEVL;
            let alone = [index - 1, index + 1].iter().all(|&beside| sections[beside].0 != SHAP);
            assert_eq!(Avatar::parse(&joined(&header, &changed)).is_ok(), alone, "{index}");
        }
        for index in (0..sections.len()).filter(|&index| sections[index].0 == LEVL) {
            let mut changed = sections.clone();
            changed[index].0 = SHAP;
            let bytes = joined(&header, &changed);
            let found = Avatar::parse(&bytes);
            assert!(matches!(found, Err(Error::Malformed { place: "SHAP", .. })), "{index}");
        }
    }
}

type Parts = Vec<([u8; 4], Vec<u8>)>;

/// A file's header and its sections.
fn parts(bytes: &[u8]) -> (Vec<u8>, Parts) {
    let avatar = Avatar::parse(bytes).unwrap();
    let all: usize = avatar.sections().map(|s| head::LEN + s.payload.len()).sum();
    let header = bytes[preamble::LEN..bytes.len() - all].to_vec();
    (header, avatar.sections().map(|s| (s.tag, s.payload.to_vec())).collect())
}

fn joined(header: &[u8], sections: &[([u8; 4], Vec<u8>)]) -> Vec<u8> {
    let sections: Vec<_> = sections.iter().map(|(tag, payload)| (*tag, &payload[..])).collect();
    file(header, &sections)
}

#[test]
fn levels_out_of_their_place_are_errors() {
    for source in [levels(), many_levels(), narrow(), shapes(), many_shapes()] {
        let (header, sections) = parts(&encode(&source).unwrap());
        assert!(parse_and_walk(&joined(&header, &sections)));
        let is_error = |sections: &[([u8; 4], Vec<u8>)], what: &str, index: usize| {
            assert!(Avatar::parse(&joined(&header, sections)).is_err(), "{what} {index}");
        };
        for index in 0..sections.len() {
            if !is_level(sections[index].0) {
                continue;
            }
            let mut changed = sections.clone();
            let taken = changed.remove(index);
            is_error(&changed, "missing", index);
            changed.push(taken.clone());
            is_error(&changed, "at the end", index);
            changed.pop();
            changed.insert(0, taken.clone());
            is_error(&changed, "at the start", index);
            changed[0].0 = *b"NEWS";
            is_error(&changed, "of an unknown tag", index);
            let mut changed = sections.clone();
            changed.insert(index, taken);
            is_error(&changed, "twice", index);
            let mut changed = sections.clone();
            changed.swap(index, index + 1);
            is_error(&changed, "one later", index);
            changed.swap(index, index + 1);
            changed.swap(index, index - 1);
            is_error(&changed, "one earlier", index);
            // Region, level, count, first rank; a width; the offsets and steps of ranges.
            for byte in [0, 1, 2, 3, 4, 7, 8, 12, 16, 17, 18, 20] {
                for by in [1, 255, 128, 64] {
                    let mut changed = sections.clone();
                    changed[index].1[byte] = changed[index].1[byte].wrapping_add(by);
                    let harmless = byte >= 8 && Avatar::parse(&joined(&header, &changed)).is_ok();
                    if harmless {
                        assert!(parse_and_walk(&joined(&header, &changed)));
                    } else {
                        is_error(&changed, "changed", byte);
                    }
                }
            }
            // A byte too few, and too many.
            let mut changed = sections.clone();
            let len = sections[index].1.len();
            changed[index].1.truncate(len - 1);
            is_error(&changed, "short", index);
            changed[index].1.extend([0; 2]);
            is_error(&changed, "long", index);
        }
        // Unknown sections may stand between them.
        let mut changed = sections.clone();
        for index in (0..sections.len()).rev() {
            changed.insert(index, (*b"NEWS", vec![index as u8]));
        }
        assert!(parse_and_walk(&joined(&header, &changed)));
    }
}

/// A prefix may end among the levels of the layer that would begin next, not of another one.
#[test]
fn the_last_levels_of_a_prefix_are_of_the_next_layer() {
    let (header, sections) = parts(&encode(&levels()).unwrap());
    let ends = (1..=sections.len()).filter(|&end| is_level(sections[end - 1].0));
    let mut later = 0;
    for end in ends {
        let mut cut = sections[..end].to_vec();
        let is_whole = |cut: &[_]| Avatar::parse_prefix(&joined(&header, cut)).is_ok();
        assert!(is_whole(&cut), "{end}");
        // Those before it in its row stay as they are: then it is among them, which is an error, too.
        for level in cut[end - 1].1[1] + 1..4 {
            cut[end - 1].1[1] = level;
            later += 1;
            assert!(!is_whole(&cut), "{end} of level {level}");
        }
    }
    assert!(later > 1);
}

#[test]
fn levels_in_a_file_without_them_are_an_error() {
    let (header, mut sections) = parts(&encode(&opacities()).unwrap());
    let (_, with) = parts(&encode(&levels()).unwrap());
    let level = with.into_iter().find(|section| section.0 == LEVL).unwrap();
    sections.insert(sections.len() - 1, level);
    let bytes = joined(&header, &sections);
    assert!(matches!(Avatar::parse(&bytes), Err(Error::Malformed { place: "LEVL", .. })));
}

/// Every file cut short lacks no level of what it still holds.
#[test]
fn a_file_cut_after_a_block_has_all_levels_of_its_blocks() {
    let order = order_of(&encode(&many_levels()).unwrap());
    for region in 0..3 {
        let mut blocks = Vec::new();
        let mut found = Vec::new();
        for &(tag, _, layer, first) in order.iter().filter(|o| o.1 == region) {
            if tag == LEVL {
                found.push((layer, first));
                continue;
            }
            for &(earlier, of) in blocks.iter().filter(|&&(earlier, _)| earlier < layer) {
                assert!(
                    found.contains(&(layer, of)),
                    "{region}: {of} of layer {earlier} at {layer}"
                );
            }
            blocks.push((layer, first));
        }
    }
}

#[test]
fn sources_with_other_levels_than_they_need_are_refused() {
    let refused = |why: &str, change: fn(&mut Source)| {
        let mut source = levels();
        change(&mut source);
        let error = encode(&source).unwrap_err().to_string();
        assert!(error.contains(why), "{why}: {error}");
    };
    refused("level 2 needs 2 discs of earlier layers, not 1", |s| {
        s.regions[0].levels[1].truncate(1)
    });
    refused("level 1 needs 0 discs of earlier layers, not 2", |s| {
        s.regions[0].levels[0] = s.regions[0].levels[1].clone();
    });
    refused("level 2 needs 3 discs of earlier layers, not 0", |s| s.regions[1].levels.clear());
    refused("levels without a layer", |s| s.regions[0].levels.push(Vec::new()));
    refused("later ones are too many", |s| s.regions[0].later_opacities = vec![vec![]; 9]);
    refused("SquareRoot", |s| s.mathematics.scale_law = ScaleLaw::Constant);
    refused("not finite", |s| s.regions[0].levels[1][0].angle = f32::NAN);
    refused("not finite", |s| s.regions[0].levels[1][0].position[1] = f32::INFINITY);
    let mut source = harmonics();
    source.regions[0].gaussians = Gaussians::Full((0..5).map(full).collect());
    source.regions[0].layers = vec![2, 3];
    add_levels(&mut source);
    assert!(encode(&source).unwrap_err().to_string().contains("only discs"));
}
