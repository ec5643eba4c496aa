//! The worked file of SPEC.md: what its bytes say, and that the encoder writes exactly them.

use dermis_format::record::SampleRecord;
use dermis_format::section::tag;
use dermis_format::source::{Gaussians, Mathematics, Mesh, Region, Source};
use dermis_format::writer::encode;
use dermis_format::{
    Avatar, Disc, DiscWidths, FrameKind, LowPass, PerLevel, RecordKind, Records, ScaleLaw, order,
};

/// Bytes of the fenced block of SPEC.md that starts with ```` ```hex ````: each line is an offset,
/// bytes, and a remark after a semicolon.
fn worked_bytes() -> Vec<u8> {
    let spec = include_str!("../SPEC.md");
    let (_, rest) = spec.split_once("```hex\n").expect("SPEC.md has a hex block");
    let (block, _) = rest.split_once("```").expect("the block ends");
    let mut bytes = Vec::new();
    for line in block.lines() {
        let line = line.split(';').next().unwrap_or("");
        let mut words = line.split_whitespace();
        let Some(offset) = words.next() else { continue };
        let offset = usize::from_str_radix(offset, 16).expect("an offset");
        assert_eq!(offset, bytes.len(), "offset of the line {line:?}");
        bytes.extend(words.map(|word| u8::from_str_radix(word, 16).expect("a byte")));
    }
    bytes
}

/// The avatar that SPEC.md describes.
fn described() -> Source {
    Source {
        mesh: Mesh {
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        },
        regions: vec![Region {
            name: "body".into(),
            layers: vec![2],
            gaussians: Gaussians::Disc(vec![
                Disc {
                    position: [0.0, 0.0, 0.0],
                    angle: 0.0,
                    log2_scale: [-1.0, -2.0],
                    color: [1.0, 0.0, 0.0],
                    opacity: 1.0,
                },
                Disc {
                    position: [0.5, -0.25, 0.0],
                    angle: 2.5,
                    log2_scale: [-1.5, -3.0],
                    color: [0.0, 1.0, 1.0],
                    opacity: 0.8,
                },
            ]),
            triangles: vec![0, 0],
            ..Region::default()
        }],
        mathematics: Mathematics::default(),
        widths: vec![DiscWidths {
            position: [7, 7, 6],
            angle: 6,
            scale: 5,
            color: [7, 5, 4],
            opacity: 2,
        }],
        bounds: [[0.0, 0.0, 0.0], [1.0, 2.0, 0.0]],
        ..Source::default()
    }
}

#[test]
fn the_encoder_writes_the_worked_bytes() {
    assert_eq!(encode(&described()).unwrap(), worked_bytes());
}

#[test]
fn the_worked_bytes_say_what_the_text_says() {
    let bytes = worked_bytes();
    assert_eq!(bytes.len(), 243);
    let avatar = Avatar::parse(&bytes).unwrap();
    let header = avatar.header();
    assert_eq!((header.vertices, header.triangles, header.gaussians), (3, 1, 2));
    assert_eq!((header.joints, header.binds, header.morph_targets, header.clips), (0, 0, 0, 0));
    assert_eq!((header.regions, header.layers, header.harmonics_degree), (1, 1, 0));
    assert_eq!((header.frame, header.record), (FrameKind::Affine, RecordKind::Disc));
    assert_eq!(header.low_pass, LowPass::Pixel);
    assert_eq!(header.scale_law, ScaleLaw::SquareRoot);
    assert_eq!(header.per_level, PerLevel::Nothing);
    assert_eq!((header.box_min, header.box_max), ([0.0; 3], [1.0, 2.0, 0.0]));
    for (index, position) in [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]].iter().enumerate()
    {
        let found = avatar.vertex_position(index);
        assert!(found.iter().zip(position).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}");
    }
    assert_eq!(avatar.triangle(0), [0, 1, 2]);
    assert!(!avatar.is_two_sided(0));
    assert_eq!(avatar.region_names().collect::<Vec<_>>(), ["body"]);
    assert_eq!(avatar.layer_len(0, 0), 2);
    let tags: Vec<_> = avatar.sections().map(|section| section.tag).collect();
    assert_eq!(tags, [*b"VERT", *b"TRIS", *b"REGN", *b"LAYR", *b"BLCK"]);

    let block = avatar.blocks().next().unwrap();
    assert_eq!((block.region, block.layer, block.first, block.count), (0, 0, 0, 2));
    assert_eq!([order::rank(0, 2), order::rank(1, 2)], [0, 1]);
    let Records::Disc(discs) = block.records else { panic!("the file holds discs") };
    let decoded: Vec<Disc> = discs.iter().collect();
    assert_eq!(block.triangles.iter().collect::<Vec<_>>(), [0, 0]);
    let Gaussians::Disc(expected) = described().regions.remove(0).gaussians else { panic!() };
    for (found, expected) in decoded.iter().zip(expected.into_iter().map(|disc| disc.upright())) {
        let near =
            |a: f32, b: f32, bound: f32| assert!((a - b).abs() <= bound, "{found:?} {expected:?}");
        // Half of the step that the worked bytes name.
        for (i, half_step) in [0.001_984, 0.000_992, 0.0].into_iter().enumerate() {
            near(found.position[i], expected.position[i], half_step + 1e-6);
            // Half steps of Y, Co and Cg add up.
            near(found.color[i], expected.color[i], 0.001_984 + 0.016_24 + 0.016_73);
        }
        near(found.angle, expected.angle, core::f32::consts::PI / 256.0);
        (0..2).for_each(|i| near(found.log2_scale[i], expected.log2_scale[i], 0.032_47));
        near(found.opacity, expected.opacity, 0.033_94);
    }
    // What the remarks say of the codes.
    let codes = |index: usize| {
        let words = discs.words(index);
        discs.layout().codes(|word, shift, mask| words[word] >> shift & mask)
    };
    let disc = |position, angle, log2_scale, color, opacity| Disc {
        position,
        angle,
        log2_scale,
        color,
        opacity,
    };
    assert_eq!(codes(0), disc([0, 126, 0], 0, [31, 15], [0, 31, 0], 3));
    assert_eq!(codes(1), disc([126, 0, 0], 37, [0, 23], [126, 0, 15], 0));
}

/// Every tag that SPEC.md's table names is a constant of `section::tag`, and the other way round.
#[test]
fn the_table_of_sections_is_complete() {
    let spec = include_str!("../SPEC.md");
    let source = include_str!("../src/section.rs");
    // The constants are in their module and nowhere else in that file.
    let constants = source.lines().filter_map(|line| {
        let (_, value) = line.trim().strip_prefix("pub const ")?.split_once(": [u8; 4] = *b\"")?;
        value.strip_suffix("\";")
    });
    let mut known: Vec<&str> = constants.collect();
    let mut named: Vec<&str> = spec
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split_once('`'))
        .map(|(tag, _)| tag)
        .filter(|tag| tag.len() == 4 && tag.chars().all(|c| c.is_ascii_uppercase()))
        .collect();
    known.sort_unstable();
    named.sort_unstable();
    assert_eq!(named, known);
    // What each constant is worth, so that the lines above were read rightly.
    for tag in [tag::VERTICES, tag::MORPH, tag::KEY_FRAMES, tag::BLOCK] {
        assert!(known.iter().any(|known| known.as_bytes() == tag));
    }
}

/// What SPEC.md says of the two samples whose bytes it shows.
#[test]
fn the_samples_of_the_text_are_those_of_its_bytes() {
    let spec = include_str!("../SPEC.md");
    let (_, text) = spec.split_once("**SAMP**").expect("it is there");
    let (_, rest) = text.split_once("```text\n").expect("its bytes follow");
    let (block, _) = rest.split_once("```").expect("they end");
    let bytes: Vec<u8> = block
        .split_whitespace()
        .map(|word| u8::from_str_radix(word, 16).expect("a byte"))
        .collect();
    let records: Vec<SampleRecord> =
        bytemuck::try_cast_slice(&bytes).expect("whole records").to_vec();
    let numbers =
        |record: &SampleRecord| (record.triangle.get(), record.area.get(), record.fill.get());
    let found: Vec<_> = records.iter().map(numbers).collect();
    assert_eq!(found, [(5, 40.0, 20.0), (300, 24.0, 36.0)]);
}
