//! What the fuzzer (`tests/fuzz`) starts from: small files of every kind, kept as bytes, so that no change of the encoder
//! changes them. `DERMIS_BLESS=1 cargo test -p dermis-format --test hostile corpus` makes them again.

use std::path::{Path, PathBuf};

use dermis_format::order::BLOCK_LEN;
use dermis_format::section::tag;
use dermis_format::source::Source;
use dermis_format::writer::encode;
use dermis_format::{Avatar, DiscWidths, PerLevel, RecordKind};

use crate::avatars::{all, discs_on, strip};
use crate::walk::walk;

/// A file, its flags and parameters before it: the fuzzer's limit.
const MOST_BYTES: usize = 8192;
/// The fuzzer's targets, and the bytes before a file: flags and parameters.
const TARGETS: [(&str, usize); 3] = [("parse", 1 + 2), ("draw", 1 + 96), ("pack", 1 + 22)];

fn folder(target: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/fuzz/corpus").join(target)
}

/// Parameters that mean something else in each file: a budget, a level, clips, joints, vertices.
fn parameters(index: usize, len: usize) -> Vec<u8> {
    (0..len).map(|i| if i == 0 { 0 } else { (index * 37 + i * (1 + 2 * index)) as u8 }).collect()
}

/// Two blocks that take turns, one disc each: in the packed form one stands between discs of the other.
fn turns() -> Source {
    let (count, triangles) = (BLOCK_LEN + 2, 8);
    let mut region = discs_on("all", &[count], triangles);
    let turns = (0..count).step_by(2).chain((1..count).step_by(2));
    region.triangles = turns.map(|turn| turn * triangles as u32 / count).collect();
    let widths = DiscWidths { position: [1; 3], angle: 1, scale: 1, color: [1; 3], opacity: 0 };
    Source {
        mesh: strip(triangles),
        regions: vec![region],
        widths: vec![widths],
        ..Source::default()
    }
}

#[test]
fn the_fuzzers_corpus_is_of_every_kind() {
    for (target, front) in TARGETS {
        let folder = folder(target);
        if std::env::var_os("DERMIS_BLESS").is_some_and(|value| value == "1") {
            std::fs::create_dir_all(&folder).unwrap();
            let kinds = all().into_iter().chain([("turns", turns())]);
            for (index, (name, source)) in kinds.enumerate() {
                let seed = [parameters(index, front), encode(&source).unwrap()].concat();
                if seed.len() <= MOST_BYTES {
                    let name = format!("{}.seed", name.replace(' ', "_"));
                    std::fs::write(folder.join(name), seed).unwrap();
                }
            }
        }
        let (mut discs, mut fulls, mut levels, mut opacities) = (0, 0, 0, 0);
        let (mut harmonics, mut clips, mut morphs, mut regions) = (0, 0, 0, 0);
        let (mut shapes, mut blocks) = (0, 0);
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|extension| extension != "seed") {
                continue;
            }
            let seed = std::fs::read(&path).unwrap();
            assert!(seed.len() <= MOST_BYTES, "{}", path.display());
            let avatar = Avatar::parse(&seed[front..]);
            let avatar = avatar.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            walk(&avatar);
            let header = avatar.header();
            let is_disc = header.record == RecordKind::Disc;
            discs += usize::from(is_disc);
            fulls += usize::from(!is_disc);
            levels += usize::from(header.per_level == PerLevel::All);
            shapes += usize::from(avatar.levels().any(|level| level.tag == tag::SHAPE));
            opacities += usize::from(header.per_level == PerLevel::Opacity);
            harmonics += usize::from(header.harmonics_degree == 3);
            clips += usize::from(header.clips > 0);
            morphs += usize::from(header.morph_targets > 0);
            regions += usize::from(header.regions > 1);
            let of_a_layer = |layer: u8| avatar.blocks().filter(move |block| block.layer == layer);
            blocks += usize::from((0..header.layers).any(|layer| of_a_layer(layer).count() > 1));
        }
        let kinds =
            [discs, fulls, levels, shapes, opacities, harmonics, clips, morphs, regions, blocks];
        assert!(kinds.iter().all(|&files| files > 0), "{target}: {kinds:?}");
    }
}
