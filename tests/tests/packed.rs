//! The packed form: the same bytes again, whatever the file; of what arrived, a prefix; of damage, nothing.

use std::fs;
use std::sync::OnceLock;

use dermis_format::packed::{Unpacker, is_packed, pack, unpack, unpack_prefix, unpacked_len};
use dermis_format::source::{Gaussians, Joint, Mesh, Morph, Region, Rig, Source};
use dermis_format::writer::encode;
use dermis_format::{Avatar, Disc, Error, PerLevel};
use dermis_tests::command::run;
use dermis_tests::files;
use dermis_tests::small::{options, trained_demo};
use dermis_tests::splats::SplatPly;
use dermis_trainer::convert;
use dermis_trainer::options::Options;
use serde_json::Value;

/// All of them, made once.
fn files() -> Vec<(String, Vec<u8>)> {
    static FILES: OnceLock<Vec<(String, Vec<u8>)>> = OnceLock::new();
    FILES.get_or_init(made).clone()
}

/// Files of every kind: discs, with records per level and without; three scales, harmonics, opacities per level.
fn made() -> Vec<(String, Vec<u8>)> {
    let stored = files::workspace().join("tests/conformance/data");
    let mut files: Vec<(String, Vec<u8>)> = files::names(&stored)
        .into_iter()
        .filter(|name| name.ends_with(".dermis"))
        .map(|name| (name.clone(), fs::read(stored.join(name)).expect("it is there")))
        .collect();
    let folder = files::empty_folder("packed_sources");
    for degree in [0, 3] {
        let ply = SplatPly::random(700, degree, 5);
        let path = files::written(&folder, "a.ply", ply.bytes());
        let (splats, _) = convert::read(&path, None).expect("it can be read");
        let bytes = convert::pack(splats).expect("what can be read can be packed");
        files.push((format!("harmonics of degree {degree}"), bytes));
    }
    let narrow = Options { max_loss_db: 0.5, ..options(5000, 30) };
    files.push(("few bits".into(), trained_demo(&narrow).1.bytes));
    let many = Options { max_loss_db: 0.5, ..options(24_000, 4) };
    files.push(("blocks that take turns".into(), trained_demo(&many).1.bytes));
    files
}

#[test]
fn every_file_returns_and_its_prefixes_are_the_files() {
    let files = files();
    let kinds: Vec<_> = files
        .iter()
        .map(|(_, bytes)| Avatar::parse(bytes).expect("a valid file").header().per_level)
        .collect();
    assert!(
        [PerLevel::Nothing, PerLevel::Opacity, PerLevel::All].iter().all(|k| kinds.contains(k))
    );
    for (name, bytes) in files {
        let packed = pack(&bytes).expect("a valid file can be packed");
        assert!(is_packed(&packed) && !is_packed(&bytes));
        assert_eq!(unpacked_len(&packed), Ok(bytes.len()));
        assert_eq!(pack(&bytes).as_deref(), Ok(&packed[..]), "{name}: the same bytes each time");
        // Noise does not become less, nor much more.
        let sections = Avatar::parse(&bytes).expect("a valid file").sections().count();
        let lens = (packed.len(), bytes.len());
        assert!(lens.0 <= lens.1 + 18 + 4 * sections, "{name}: {lens:?}");
        let is_trained = ["figure.dermis", "leveled.dermis", "few bits", "blocks that take turns"]
            .contains(&&*name);
        assert!(lens.0 < lens.1 * 4 / 5 || !is_trained, "{name}: {lens:?}");
        assert!(unpack(&packed).as_deref() == Ok(&bytes[..]), "{name}");

        // Section by section, in memory that held something else.
        let mut memory = vec![0xa5; bytes.len() + 9];
        let mut unpacker = Unpacker::new(&packed, &mut memory).expect("it is packed");
        let mut pictures = 0;
        loop {
            assert!(unpacker.done() == &bytes[..unpacker.done().len()], "{name}");
            pictures += u32::from(Avatar::parse_prefix(unpacker.done()).is_ok());
            if !unpacker.next_section().expect("it is whole") {
                break;
            }
        }
        assert_eq!(unpacker.done().len(), bytes.len());
        assert!(size_of_val(&unpacker) <= 72_000, "what its documentation says");
        assert!(pictures > 1, "{name}");

        // Whatever arrives first.
        for share in 1..40 {
            let len = packed.len() * share / 40;
            assert!(unpack(&packed[..len]).is_err(), "{name}, {len} bytes");
            if let Ok(first) = unpack_prefix(&packed[..len]) {
                assert!(first.len() < bytes.len() && bytes.starts_with(&first), "{name}");
            }
        }
        assert_eq!(unpack_prefix(&packed), Ok(bytes));
    }
}

#[test]
fn other_versions_are_refused_with_a_remedy() {
    let (_, bytes) = files().swap_remove(0);
    let packed = pack(&bytes).expect("a valid file can be packed");
    for (version, remedy) in [(1u16, "pack the file again"), (9, "update Dermis")] {
        let mut other = packed.clone();
        other[8..10].copy_from_slice(&version.to_le_bytes());
        let crc = crc32fast::hash(&other[..14]);
        other[14..18].copy_from_slice(&crc.to_le_bytes());
        let error = unpack(&other).expect_err("it is of another version").to_string();
        assert!(error.contains(remedy), "{version}: {error}");
    }
}

/// Discs in three blocks: a disc's size and colour are those of its triangle, which `turn` gives it, and noise.
fn in_three_blocks(turn: impl Fn(u32) -> u32) -> Vec<u8> {
    let (count, triangles) = (12_000u32, 3_000u32);
    let noise = |i: u32| (i.wrapping_mul(0x9e37_79b1) >> 16) as f32 / 65_536.0;
    let mut turns: Vec<u32> = (0..count).collect();
    // Ascending in each block.
    turns.sort_by_key(|&i| (turn(i), i));
    let disc = |i: u32| Disc {
        position: [noise(i), noise(7 * i), 0.0],
        angle: noise(3 * i),
        log2_scale: [0.1 * noise(5 * i) - (i as f32 * 0.01).sin(), -2.0],
        color: [0.1 * noise(11 * i) + 0.5 + 0.4 * (i as f32 * 0.02).cos(), 0.5, 0.3],
        opacity: 1.0,
    };
    let source = Source {
        mesh: Mesh {
            positions: (0..triangles + 2).map(|i| [(i % 2) as f32, i as f32, 0.0]).collect(),
            triangles: (0..triangles).map(|i| [i, i + 1, i + 2]).collect(),
            ..Mesh::default()
        },
        regions: vec![Region {
            layers: vec![count],
            gaussians: Gaussians::Disc(turns.iter().map(|&i| disc(i)).collect()),
            triangles: turns.iter().map(|&i| i * triangles / count).collect(),
            ..Region::default()
        }],
        bounds: [[0.0; 3], [1.0, triangles as f32, 1.0]],
        ..Source::default()
    };
    encode(&source).expect("it can be written")
}

/// Each disc between two of other blocks: its triangle is mostly theirs, and its size and colour almost.
#[test]
fn blocks_that_take_turns_take_fewer_bytes() {
    let by_chance = |i: u32| i.wrapping_mul(0x85eb_ca6b) >> 3;
    let mut chance: Vec<u32> = (0..12_000).collect();
    chance.sort_by_key(|&i| by_chance(i));
    let mut blocks = vec![0; 12_000];
    (0..).zip(&chance).for_each(|(place, &i): (u32, _)| blocks[i as usize] = place / 4_000);
    let dealt = in_three_blocks(|i| [0, 2, 1][i as usize % 3]);
    let drawn = in_three_blocks(|i| blocks[i as usize]);
    assert_eq!(Avatar::parse(&dealt).expect("valid").blocks().count(), 3);
    let [dealt, drawn] = [dealt, drawn].map(|bytes| {
        let packed = pack(&bytes).expect("a valid file can be packed");
        assert!(unpack(&packed).as_deref() == Ok(&bytes[..]));
        packed.len()
    });
    assert!(dealt + 12_000 / 4 < drawn, "{dealt} and {drawn} bytes");
}

/// A mesh of so many vertices, each in a triangle, with skin.
fn meshed(vertices: u32) -> Source {
    let triangles = (0..vertices - 2).step_by(2).map(|i| [i, i + 1, i + 2]);
    Source {
        mesh: Mesh {
            positions: (0..vertices).map(|i| [(i % 7) as f32, (i % 5) as f32, i as f32]).collect(),
            influences: vec![[(0, 0.75), (1, 0.25), (0, 0.0), (0, 0.0)]; vertices as usize],
            triangles: triangles.collect(),
            ..Mesh::default()
        },
        rig: Rig {
            joints: vec![Joint::default(); 2],
            binds: [0, 1].map(|joint| (joint, IDENTITY)).to_vec(),
            clips: Vec::new(),
        },
        regions: vec![Region { layers: vec![0], ..Region::default() }],
        bounds: [[0.0; 3], [7.0, 5.0, vertices as f32]],
        ..Source::default()
    }
}

const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// 65,279 vertices are the most whose triangles are told by codes, 65,536 the most of u16.
#[test]
fn meshes_of_any_size_return() {
    for vertices in [3, 5_000, 65_279, 65_280, 65_536, 65_537] {
        let bytes = encode(&meshed(vertices)).expect("it can be written");
        let packed = pack(&bytes).expect("a valid file can be packed");
        assert_eq!(unpack(&packed).as_deref(), Ok(&bytes[..]), "{vertices} vertices");
        if vertices == 5_000 {
            // Triangles that share no edge and weights that are alike take all that is allowed, no more.
            let [tris, skin] = [*b"TRIS", *b"SKIN"].map(|tag| packed_section(&packed, tag));
            assert!(tris[1] < tris[0] / 16 && skin[1] < skin[0] / 32, "{tris:?}, {skin:?}");
        }
    }
}

/// Bytes of a section's payload, and of its coded form.
fn packed_section(packed: &[u8], tag: [u8; 4]) -> [usize; 2] {
    let at = packed.windows(4).position(|bytes| bytes == tag).expect("it is there");
    [4, 8].map(|offset| {
        let bytes = packed[at + offset..].first_chunk().expect("a head");
        u32::from_le_bytes(*bytes) as usize
    })
}

#[test]
fn a_changed_bit_is_found_or_harmless() {
    let mut seed = 1u32;
    for (name, bytes) in files() {
        let packed = pack(&bytes).expect("a valid file can be packed");
        let mut damaged = packed.clone();
        for _ in 0..200 {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let bit = ((u64::from(seed) * 8 * packed.len() as u64) >> 32) as usize;
            damaged[bit / 8] ^= 1 << (bit % 8);
            if let Ok(found) = unpack(&damaged) {
                assert!(found == bytes, "{name}: bit {bit}");
            }
            damaged[bit / 8] ^= 1 << (bit % 8);
        }
    }
}

#[test]
fn claims_cost_no_memory() {
    let (name, bytes) = files().swap_remove(0);
    let packed = pack(&bytes).expect("a valid file can be packed");
    // Four gigabytes in a few.
    let mut claims = packed.clone();
    claims[10..14].fill(0xff);
    let crc = crc32fast::hash(&claims[..14]);
    claims[14..18].copy_from_slice(&crc.to_le_bytes());
    assert!(matches!(unpack(&claims), Err(Error::Truncated { .. })), "{name}");
    // A section that would be so long.
    let head = 18 + bytes_before_sections(&packed[18..]);
    let mut claims = packed.clone();
    claims[head + 4..head + 8].fill(0xff);
    assert!(matches!(unpack(&claims), Err(Error::Malformed { .. })), "{name}");
    let mut claims = packed;
    claims[head + 8..head + 12].fill(0xff);
    assert!(matches!(unpack(&claims), Err(Error::Truncated { .. })), "{name}");
    assert!(matches!(pack(&claims), Err(Error::Malformed { .. })));
    let mut short = vec![0; bytes.len() - 1];
    let packed = pack(&bytes).expect("a valid file can be packed");
    assert!(matches!(Unpacker::new(&packed, &mut short), Err(Error::Room { .. })));
}

/// A reader looks through what is before a section: without end, by so many, it would look for hours.
#[test]
fn sections_without_end_are_refused() {
    let (_, bytes) = files().swap_remove(0);
    let packed = pack(&bytes).expect("a valid file can be packed");
    let mut many = packed[..18 + bytes_before_sections(&packed[18..])].to_vec();
    let crc = crc32fast::hash(b"NONE\0\0\0\0").to_le_bytes();
    let none = [&b"NONE"[..], &[0; 8], &crc].concat();
    (0..20_000).for_each(|_| many.extend(&none));
    let len = many.len() as u32;
    many[10..14].copy_from_slice(&len.to_le_bytes());
    let crc = crc32fast::hash(&many[..14]);
    many[14..18].copy_from_slice(&crc.to_le_bytes());
    let error = unpack(&many).expect_err("it has too many sections").to_string();
    assert!(error.contains("16,384 sections"), "{error}");

    let mut source = meshed(3);
    source.mesh.morph_targets = vec![Morph::default(); 16_384];
    let bytes = encode(&source).expect("it can be written");
    let error = pack(&bytes).expect_err("it has too many sections").to_string();
    assert!(error.contains("16,384 sections"), "{error}");
}

fn bytes_before_sections(file: &[u8]) -> usize {
    16 + usize::from(u16::from_le_bytes([file[10], file[11]]))
}

#[test]
fn the_commands_pack_and_every_other_one_reads_what_they_packed() {
    let folder = files::empty_folder("packed_commands");
    let (name, bytes) = files().pop().expect("there are some");
    files::written(&folder, "a.dermis", &bytes);
    let json = |arguments: &str| -> Value {
        let output = run(&folder, &format!("{arguments} --json"));
        assert!(output.code == Some(0), "{arguments}: {}", output.stderr);
        serde_json::from_str(&output.stdout).expect("one JSON object")
    };
    let packed = json("pack a.dermis -o a.packed");
    let len = fs::metadata(folder.join("a.packed")).expect("it is there").len();
    assert_eq!((&packed["bytes"], &packed["unpacked_bytes"]), (&len.into(), &bytes.len().into()));
    assert!(packed["bytes_per_gaussian"].as_f64() > Some(1.0), "{name}");
    assert_eq!(json("unpack a.packed -o b.dermis")["bytes"], bytes.len());
    assert!(fs::read(folder.join("b.dermis")).expect("it is there") == bytes);
    let mut info = json("info a.packed");
    let packed_bytes = info.as_object_mut().and_then(|info| info.remove("packed_bytes"));
    assert_eq!((packed_bytes, info), (Some(len.into()), json("info a.dermis")));
    files::written(&folder, "cut", &bytes[..bytes.len() / 2]);
    for (command, says) in [
        ("pack a.packed -o c", "a.packed: "),
        ("pack cut -o c", "cut: "),
        ("unpack a.dermis -o c", "a.dermis: "),
        ("unpack none -o c", "none: "),
    ] {
        let output = run(&folder, command);
        let error = output.stderr;
        assert!(output.code != Some(0) && error.contains(says), "{command}: {error}");
        assert_eq!(error.lines().count(), 1, "{error}");
    }
    assert_eq!(files::names(&folder), ["a.dermis", "a.packed", "b.dermis", "cut"]);
}
