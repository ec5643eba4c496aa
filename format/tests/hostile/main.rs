//! Bytes that are cut short, damaged or made up: an error, or an avatar that is safe to read.

mod avatars;
mod corpus;
mod levels;
mod round_trip;
mod steps;
mod walk;

use std::time::{Duration, Instant};

use avatars::all;
use dermis_format::section::{Section, Sections, head, preamble, preamble_crc, section_crc};
use dermis_format::writer::encode;
use dermis_format::{Avatar, Error, FrameKind, Header, LowPass, PerLevel, RecordKind, ScaleLaw};
use proptest::prelude::*;
use walk::walk;

/// Makes every CRC right, so that the checks behind them are reached.
fn fix_crcs(bytes: &mut [u8]) {
    let Some((fixed, rest)) = bytes.split_at_mut_checked(preamble::LEN) else { return };
    let len = usize::from(u16::from_le_bytes([fixed[10], fixed[11]]));
    let Some((header, mut rest)) = rest.split_at_mut_checked(len) else { return };
    let crc = preamble_crc(fixed, header);
    fixed[preamble::CRC].copy_from_slice(&crc.to_le_bytes());
    while let Some((fixed, after)) = rest.split_at_mut_checked(head::LEN) {
        let tag = [fixed[0], fixed[1], fixed[2], fixed[3]];
        let len = u32::from_le_bytes([fixed[4], fixed[5], fixed[6], fixed[7]]) as usize;
        let Some((payload, after)) = after.split_at_mut_checked(len) else { return };
        let crc = section_crc(&Section { tag, payload });
        fixed[head::CRC].copy_from_slice(&crc.to_le_bytes());
        rest = after;
    }
}

/// A preamble and a header in front of `sections`, with right CRCs.
fn file(header: &[u8], sections: &[([u8; 4], &[u8])]) -> Vec<u8> {
    let mut bytes = b"DERMIS\r\n\x03\0".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend([0; 4]);
    bytes.extend(header);
    for (tag, payload) in sections {
        bytes.extend(tag);
        bytes.extend((payload.len() as u32).to_le_bytes());
        bytes.extend([0; 4]);
        bytes.extend(*payload);
    }
    fix_crcs(&mut bytes);
    bytes
}

/// Parses; what passes is walked. Says whether it passed.
fn parse_and_walk(bytes: &[u8]) -> bool {
    Avatar::parse(bytes).map(|avatar| walk(&avatar)).is_ok()
}

#[test]
fn every_avatar_can_be_walked_at_any_address() {
    for (name, source) in all() {
        let bytes = encode(&source).unwrap_or_else(|error| panic!("{name}: {error}"));
        let mut shifted = vec![0xaa];
        for _ in 0..8 {
            shifted.extend(&bytes);
            let avatar = Avatar::parse(&shifted[shifted.len() - bytes.len()..]).unwrap();
            if bytes.len() < 100_000 {
                walk(&avatar);
            }
            shifted.truncate(shifted.len() - bytes.len());
            shifted.push(0xaa);
        }
        walk(&Avatar::parse(&bytes).unwrap());
    }
}

#[test]
fn a_file_cut_short_is_an_error_at_every_length() {
    for (name, source) in all() {
        let bytes = encode(&source).unwrap();
        let whole = bytes.len() < 20_000;
        // A large one near the borders of its sections, and sparsely between.
        let mut lengths: Vec<usize> =
            (0..bytes.len()).step_by(if whole { 1 } else { 49_999 }).collect();
        let sections = Avatar::parse(&bytes).unwrap().sections();
        let mut rest = bytes.len() - sections.map(|s| head::LEN + s.payload.len()).sum::<usize>();
        for section in sections {
            lengths.extend([rest - 1, rest, rest + 1, rest + head::LEN, rest + head::LEN + 1]);
            rest += head::LEN + section.payload.len();
        }
        for length in lengths {
            assert!(Avatar::parse(&bytes[..length]).is_err(), "{name} cut to {length} bytes");
        }
    }
}

/// Whatever its length, a prefix is an avatar of the Gaussians whose blocks are whole, or too short to have mesh and rig.
#[test]
fn every_prefix_behind_the_rig_is_an_avatar() {
    for (name, source) in all() {
        let bytes = encode(&source).unwrap();
        let whole = Avatar::parse(&bytes).unwrap();
        assert_eq!(Avatar::parse_prefix(&bytes).unwrap().bytes(), whole.bytes(), "{name}");
        let step = if bytes.len() < 20_000 { 1 } else { 997 };
        let (mut before, mut passed) = (0, false);
        for length in (0..bytes.len()).step_by(step) {
            let avatar = match Avatar::parse_prefix(&bytes[..length]) {
                Ok(avatar) => avatar,
                Err(error) => {
                    assert!(!passed, "{name} cut to {length} bytes: {error}");
                    continue;
                }
            };
            passed = true;
            walk(&avatar);
            let present =
                (0..usize::from(avatar.header().regions)).map(|r| avatar.present(r)).sum();
            assert!((before..=avatar.header().gaussians).contains(&present), "{name}");
            before = present;
            assert!(avatar.bytes().len() <= length && whole.bytes().starts_with(avatar.bytes()));
            assert!(avatar.clips().count() <= whole.clips().count());
        }
        let blocks = whole.blocks().count();
        assert!(passed && (before > 0 || blocks == 1), "{name}: {before} Gaussians in a prefix");
    }
}

#[test]
fn a_damaged_prefix_is_an_error() {
    let bytes = encode(&avatars::many_levels()).unwrap();
    let cut = &bytes[..bytes.len() * 3 / 4];
    let end = Avatar::parse_prefix(cut).unwrap().bytes().len();
    for place in (0..end).step_by(101) {
        let mut cut = cut.to_vec();
        cut[place] ^= 16;
        // A length that is damaged may reach beyond the cut: the prefix ends before.
        let shorter = Avatar::parse_prefix(&cut).is_ok_and(|avatar| avatar.bytes().len() <= place);
        assert!(shorter || Avatar::parse_prefix(&cut).is_err(), "byte {place}");
    }
}

#[test]
fn a_byte_too_many_is_an_error() {
    for (name, source) in all() {
        let mut bytes = encode(&source).unwrap();
        bytes.push(0);
        let error = Avatar::parse(&bytes).unwrap_err();
        assert!(matches!(error, Error::Truncated { place: "section head", .. }), "{name}: {error}");
    }
}

#[test]
fn every_flipped_bit_is_found() {
    for (name, source) in all() {
        let mut bytes = encode(&source).unwrap();
        if bytes.len() > 20_000 {
            continue;
        }
        for bit in 0..bytes.len() * 8 {
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert!(Avatar::parse(&bytes).is_err(), "{name}: bit {bit}");
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
    }
}

/// With right CRCs a flipped bit may go unnoticed, but then it does no harm.
#[test]
fn every_flipped_bit_behind_its_crc_is_found_or_harmless() {
    for (_, source) in all() {
        let bytes = encode(&source).unwrap();
        if bytes.len() > 5_000 {
            continue;
        }
        let mut passed = 0;
        for bit in 0..bytes.len() * 8 {
            let mut bytes = bytes.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            fix_crcs(&mut bytes);
            passed += usize::from(parse_and_walk(&bytes));
        }
        // Codes may be anything, so some do pass: the checks behind the CRC are reached.
        assert!(passed > bytes.len() && passed < bytes.len() * 8, "{passed}");
    }
}

fn header() -> Header {
    let bytes = encode(&avatars::rigged()).unwrap();
    *Avatar::parse(&bytes).unwrap().header()
}

fn header_bytes(header: &Header) -> Vec<u8> {
    let Header { frame, record, low_pass, scale_law, .. } = *header;
    let mut bytes = Vec::new();
    let mut varint = |mut x: u32| {
        while x >= 128 {
            bytes.push(x as u8 | 128);
            x >>= 7;
        }
        bytes.push(x as u8);
    };
    varint(header.vertices);
    varint(header.triangles);
    for count in [header.joints, header.binds, header.morph_targets, header.clips] {
        varint(count.into());
    }
    bytes.extend([header.regions, header.layers]);
    let mut gaussians = header.gaussians;
    while gaussians >= 128 {
        bytes.push(gaussians as u8 | 128);
        gaussians >>= 7;
    }
    bytes.push(gaussians as u8);
    bytes.extend([
        match frame {
            FrameKind::World => 0,
            FrameKind::Area => 1,
            FrameKind::Edge => 2,
            FrameKind::Affine => 3,
        },
        u8::from(record == RecordKind::Full),
        match low_pass {
            LowPass::Classic => 0,
            LowPass::Compensated => 1,
            LowPass::Pixel => 2,
        },
        u8::from(scale_law == ScaleLaw::SquareRoot),
        header.harmonics_degree,
        match header.per_level {
            PerLevel::Nothing => 0,
            PerLevel::Opacity => 1,
            PerLevel::All => 2,
        },
    ]);
    let numbers = [header.box_min, header.box_max, header.position_min, header.position_step];
    bytes.extend(numbers.iter().flatten().flat_map(|x| x.to_le_bytes()));
    bytes
}

/// The header as SPEC.md tells it is the header as the encoder writes it.
#[test]
fn the_header_is_as_the_specification_says() {
    for (name, source) in all() {
        let bytes = encode(&source).unwrap();
        let expected = header_bytes(Avatar::parse(&bytes).unwrap().header());
        assert_eq!(&bytes[preamble::LEN..][..expected.len()], expected, "{name}");
        assert_eq!(usize::from(bytes[10]), expected.len());
    }
}

#[test]
fn a_header_that_claims_billions_costs_an_error() {
    let bytes = encode(&avatars::rigged()).unwrap();
    let all: Vec<Section> = Avatar::parse(&bytes).unwrap().sections().collect();
    let sections: Vec<_> = all.iter().map(|s| (s.tag, s.payload)).collect();
    let lie = |change: fn(&mut Header)| {
        let mut header = header();
        change(&mut header);
        header_bytes(&header)
    };
    assert!(parse_and_walk(&file(&lie(|_| ()), &sections)));
    let lies: [fn(&mut Header); 13] = [
        |h| h.vertices = u32::MAX,
        |h| h.triangles = u32::MAX,
        |h| h.gaussians = u32::MAX,
        |h| (h.vertices, h.triangles, h.gaussians) = (u32::MAX, u32::MAX, u32::MAX),
        |h| h.joints = u16::MAX - 1,
        |h| h.binds = u16::MAX,
        |h| h.morph_targets = u16::MAX,
        |h| h.clips = u16::MAX,
        |h| h.regions = 32,
        |h| h.layers = 16,
        |h| h.per_level = PerLevel::Opacity,
        |h| h.per_level = PerLevel::All,
        |h| h.record = RecordKind::Full,
    ];
    let start = Instant::now();
    for (index, lie_of) in lies.into_iter().enumerate() {
        let header = lie(lie_of);
        assert!(Avatar::parse(&file(&header, &sections)).is_err(), "lie {index}");
        assert!(Avatar::parse(&file(&header, &[])).is_err(), "lie {index} without sections");
    }
    assert!(start.elapsed() < Duration::from_secs(1));
}

#[test]
fn a_header_out_of_its_limits_is_refused() {
    let lies: [fn(&mut Header); 11] = [
        |h| h.regions = 0,
        |h| h.regions = 33,
        |h| h.layers = 0,
        |h| h.layers = 17,
        |h| h.harmonics_degree = 4,
        |h| h.harmonics_degree = 1,
        |h| h.frame = FrameKind::World,
        |h| (h.per_level, h.scale_law) = (PerLevel::All, ScaleLaw::Constant),
        |h| (h.per_level, h.record) = (PerLevel::All, RecordKind::Full),
        |h| h.box_max[1] = f32::NAN,
        |h| h.position_step[2] = f32::INFINITY,
    ];
    for (index, lie) in lies.into_iter().enumerate() {
        let mut header = header();
        lie(&mut header);
        let error = Avatar::parse(&file(&header_bytes(&header), &[])).unwrap_err();
        assert!(matches!(error, Error::Malformed { place: "header", .. }), "{index}: {error}");
    }
}

#[test]
fn unknown_versions_are_refused_and_unknown_sections_skipped() {
    let mut bytes = encode(&avatars::discs()).unwrap();
    bytes.extend(*b"NEWS\x03\0\0\0\0\0\0\0abc");
    fix_crcs(&mut bytes);
    assert!(parse_and_walk(&bytes));
    bytes.pop();
    bytes.push(b'!');
    assert_eq!(Avatar::parse(&bytes).unwrap_err(), Error::Damaged { place: "unknown section" });
    for found in [0, 1, 2, 4] {
        bytes[8] = found;
        let error = Avatar::parse(&bytes).unwrap_err();
        assert_eq!(error, Error::Version { found: found.into() });
    }
    bytes[0] = b'd';
    assert!(matches!(Avatar::parse(&bytes), Err(Error::Malformed { place: "preamble", .. })));
}

#[test]
fn sections_that_are_missing_or_in_disorder_are_errors() {
    let bytes = encode(&avatars::rigged()).unwrap();
    let all: Vec<Section> = Avatar::parse(&bytes).unwrap().sections().collect();
    let header = header_bytes(&header());
    let optional =
        [b"SIDE", b"TREG", b"JNAM", b"KEYF", b"IMPO", b"CURV", b"SAMP", b"MOVE", b"MLEV"];
    for left_out in 0..all.len() {
        let mut sections: Vec<_> = all.iter().map(|s| (s.tag, s.payload)).collect();
        let (tag, _) = sections.remove(left_out);
        let passed = parse_and_walk(&file(&header, &sections));
        assert_eq!(passed, optional.contains(&&tag), "{}", String::from_utf8_lossy(&tag));
    }
    // The two blocks the other way round: the second does not follow the first.
    let mut sections: Vec<_> = all.iter().map(|s| (s.tag, s.payload)).collect();
    let last = sections.iter().rposition(|section| section.0 == *b"BLCK").unwrap();
    sections.swap(last - 1, last);
    assert!(Avatar::parse(&file(&header, &sections)).is_err());
}

/// A file with another payload of a section that is there once.
fn with_payload(avatar: &Avatar<'_>, tag: [u8; 4], payload: &[u8]) -> Vec<u8> {
    let part = |s: Section<'_>| (s.tag, if s.tag == tag { payload } else { s.payload }.to_vec());
    let sections: Vec<_> = avatar.sections().map(part).collect();
    let sections: Vec<_> = sections.iter().map(|(tag, payload)| (*tag, &payload[..])).collect();
    file(&header_bytes(avatar.header()), &sections)
}

#[test]
fn curves_out_of_their_limits_are_refused() {
    let bytes = encode(&avatars::regions()).unwrap();
    let avatar = Avatar::parse(&bytes).unwrap();
    let usual =
        avatar.sections().find(|s| s.tag == *b"CURV").expect("it is there").payload.to_vec();
    let with = |payload: &[u8]| with_payload(&avatar, *b"CURV", payload);
    assert!(parse_and_walk(&with(&usual)));
    for len in (0..usual.len()).chain([usual.len() + 4]) {
        let mut payload = usual.clone();
        payload.resize(len, 0);
        assert!(!parse_and_walk(&with(&payload)), "{len} bytes");
    }
    let replaced = |at: usize, bytes: &[u8]| {
        let mut payload = usual.clone();
        payload[at..at + bytes.len()].copy_from_slice(bytes);
        with(&payload)
    };
    for density in [0.0, -1.0, 2e12, f32::NAN, f32::INFINITY] {
        assert!(!parse_and_walk(&replaced(0, &density.to_le_bytes())), "{density}");
    }
    for octaves in [0, 1, 3, 9, 255] {
        assert!(!parse_and_walk(&replaced(4, &[octaves])), "{octaves} octaves");
    }
    for number in [-0.001, 1.1e6, f32::NAN, f32::INFINITY] {
        let half = &number.to_le_bytes()[2..];
        for at in [5, 7, usual.len() - 2] {
            assert!(!parse_and_walk(&replaced(at, half)), "{number} at {at}");
        }
    }
}

#[test]
fn samples_out_of_their_limits_are_refused() {
    let bytes = encode(&avatars::rigged()).unwrap();
    let avatar = Avatar::parse(&bytes).unwrap();
    let usual =
        avatar.sections().find(|s| s.tag == *b"SAMP").expect("it is there").payload.to_vec();
    let with = |payload: &[u8]| with_payload(&avatar, *b"SAMP", payload);
    for len in 0..usual.len() + 2 {
        let mut payload = usual.clone();
        payload.resize(len, 0);
        // A part of the records, or none, is a choice of fewer.
        assert_eq!(parse_and_walk(&with(&payload)), len % 8 == 0, "{len} bytes");
    }
    let replaced = |at: usize, bytes: &[u8]| {
        let mut payload = usual.clone();
        payload[at..at + bytes.len()].copy_from_slice(bytes);
        with(&payload)
    };
    let triangles = avatar.header().triangles;
    for first in [1, triangles, u32::MAX] {
        assert!(!parse_and_walk(&replaced(0, &first.to_le_bytes())), "{first}, then 1");
    }
    for second in [0, triangles, u32::MAX] {
        assert!(!parse_and_walk(&replaced(8, &second.to_le_bytes())), "0, then {second}");
    }
    for number in [-0.001, 1.1e6, f32::NAN, f32::INFINITY] {
        for at in [4, 6, 12, 14] {
            let half = &number.to_le_bytes()[2..];
            assert!(!parse_and_walk(&replaced(at, half)), "{number} at {at}");
        }
    }
}

#[test]
fn movements_out_of_their_limits_are_refused() {
    let bytes = encode(&avatars::rigged()).unwrap();
    let avatar = Avatar::parse(&bytes).unwrap();
    let usual =
        avatar.sections().find(|s| s.tag == *b"MOVE").expect("it is there").payload.to_vec();
    let with = |payload: &[u8]| with_payload(&avatar, *b"MOVE", payload);
    assert!(parse_and_walk(&with(&usual)));
    for len in (0..usual.len()).chain([usual.len() + 1, usual.len() + 2]) {
        let mut payload = usual.clone();
        payload.resize(len, 0);
        assert!(!parse_and_walk(&with(&payload)), "{len} bytes");
    }
    for number in [-0.001, 1.1e6, f32::NAN, f32::INFINITY] {
        for at in (0..usual.len()).step_by(2) {
            let mut payload = usual.clone();
            payload[at..at + 2].copy_from_slice(&number.to_le_bytes()[2..]);
            assert!(!parse_and_walk(&with(&payload)), "{number} at {at}");
        }
    }
}

#[test]
fn meshes_that_leave_no_surface_are_refused() {
    let bytes = encode(&avatars::rigged()).unwrap();
    let avatar = Avatar::parse(&bytes).unwrap();
    let triangles = avatar.header().triangles;
    let meshes: Vec<_> = avatar.mesh_levels().ranges().collect();
    assert_eq!(meshes, [0..triangles - 1, triangles - 1..triangles]);
    let with = |counts: &[u32]| {
        let payload: Vec<u8> = counts.iter().flat_map(|n| n.to_le_bytes()).collect();
        with_payload(&avatar, *b"MLEV", &payload)
    };
    assert!(parse_and_walk(&with(&[])) && parse_and_walk(&with(&[triangles - 1])));
    for counts in [&[0][..], &[triangles], &[1, 0], &[1, u32::MAX], &[u32::MAX, 2], &[1; 16]] {
        assert!(!parse_and_walk(&with(counts)), "{counts:?}");
    }
    for len in [1, 3, 5] {
        assert!(!parse_and_walk(&with_payload(&avatar, *b"MLEV", &[1; 5][..len])), "{len} bytes");
    }
}

#[test]
fn importances_out_of_their_limits_are_refused() {
    let bytes = encode(&avatars::regions()).unwrap();
    let avatar = Avatar::parse(&bytes).unwrap();
    let with = |numbers: &[f32]| {
        let payload: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        with_payload(&avatar, *b"IMPO", &payload)
    };
    let usual = [1.0, 0.0, 0.5, 0.5].repeat(3);
    assert!(parse_and_walk(&with(&usual)));
    for len in [0, 4, 8, 11, 13, 16] {
        assert!(!parse_and_walk(&with(&usual.repeat(2)[..len])), "{len} numbers");
    }
    for (place, greatest) in [1e3, 1e6, 1.0, 1.0].into_iter().enumerate() {
        let of = |number: f32| {
            let mut numbers = usual.clone();
            numbers[8 + place] = number;
            with(&numbers)
        };
        assert!(parse_and_walk(&of(greatest)) && parse_and_walk(&of(0.0)), "number {place}");
        for bad in [greatest * 1.001, -0.001, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let error = Avatar::parse(&of(bad)).unwrap_err();
            assert!(matches!(error, Error::Malformed { place: "IMPO", .. }), "{bad}: {error}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn soup_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        parse_and_walk(&bytes);
        let mut led = b"DERMIS\r\n\x03\0".to_vec();
        led.extend(&bytes);
        parse_and_walk(&led);
        fix_crcs(&mut led);
        parse_and_walk(&led);
    }

    #[test]
    fn soup_in_sections_never_panics(
        payloads in prop::collection::vec((0usize..17, prop::collection::vec(any::<u8>(), 0..200)), 0..12),
        kind in 0usize..8,
    ) {
        const TAGS: [&[u8; 4]; 17] = [
            b"VERT", b"SKIN", b"TRIS", b"SIDE", b"TREG", b"REGN", b"LAYR", b"JNTS", b"JNAM",
            b"BIND", b"MRPH", b"CLIP", b"KEYF", b"BLCK", b"LEVL", b"IMPO", b"????",
        ];
        let bytes = encode(&all_small(kind)).unwrap();
        let avatar = Avatar::parse(&bytes).unwrap();
        let mut sections: Vec<_> = avatar.sections().map(|s| (s.tag, s.payload)).collect();
        for (tag, payload) in &payloads {
            sections.insert(*tag * sections.len() / 17, (*TAGS[*tag], payload));
        }
        parse_and_walk(&file(&header_bytes(avatar.header()), &sections));
    }

    #[test]
    fn changed_bytes_are_found_or_harmless(
        kind in 0usize..8,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in prop::option::weighted(0.2, any::<prop::sample::Index>()),
    ) {
        let mut bytes = encode(&all_small(kind)).unwrap();
        for (index, value) in changes {
            let index = index.index(bytes.len());
            bytes[index] = value;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        fix_crcs(&mut bytes);
        parse_and_walk(&bytes);
    }

    /// Numbers of the payload become NaN, infinities, and the greatest of their kind.
    #[test]
    fn odd_numbers_are_found_or_harmless(
        kind in 0usize..8,
        at in any::<prop::sample::Index>(),
        number in prop::sample::select(vec![
            f32::NAN.to_bits(), f32::INFINITY.to_bits(), f32::NEG_INFINITY.to_bits(),
            f32::MAX.to_bits(), f32::MIN.to_bits(), 1, 0x8000_0000, u32::MAX, 0xffff, 0xffff_0000,
            1e12f32.to_bits(), 1e30f32.to_bits(), (-1e12f32).to_bits(),
        ]),
    ) {
        let mut bytes = encode(&all_small(kind)).unwrap();
        let at = at.index(bytes.len() - 20) + 16;
        bytes[at..at + 4].copy_from_slice(&number.to_le_bytes());
        fix_crcs(&mut bytes);
        parse_and_walk(&bytes);
    }
}

/// One of the avatars, without the one that is large.
fn all_small(kind: usize) -> dermis_format::source::Source {
    match kind {
        0 => avatars::harmonics(),
        1 => avatars::opacities(),
        2 => avatars::regions(),
        3 => avatars::cloud(),
        4 => avatars::discs(),
        5 => avatars::levels(),
        6 => avatars::narrow(),
        _ => avatars::rigged(),
    }
}

/// `Sections` alone, which does not check CRCs, ends on any bytes.
#[test]
fn sections_end_on_any_bytes() {
    let bytes = encode(&avatars::rigged()).unwrap();
    for start in 0..bytes.len() {
        assert!(Sections::new(&bytes[start..]).count() <= bytes.len() / head::LEN);
    }
}
