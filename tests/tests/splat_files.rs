//! Trained Gaussians in `.splat`, SPZ and compressed PLYs, converted: what the files say, and nothing of what broken
//! ones claim.

use std::fs;
use std::path::Path;

use dermis_runtime::Avatar;
use dermis_tests::command::run;
use dermis_tests::converted::{
    ALL, exact, orbit_at_rest, psnr_at_rest, real_file_keeps_its_pictures,
};
use dermis_tests::files::{self, written};
use dermis_tests::splat_files::{compressed_ply, in_every_format, splat};
use dermis_tests::splats::SplatPly;
use dermis_tests::spz::{Spz, gzip};
use dermis_trainer::convert::{self, Kind, LeftOut, Splats};

fn read(path: &Path) -> Splats {
    let (splats, left_out) = convert::read(path, None).unwrap_or_else(|error| panic!("{error:#}"));
    assert_eq!(left_out, LeftOut::default(), "{path:?}");
    splats
}

#[test]
fn every_format_and_degree_keeps_its_pictures() {
    let folder = files::empty_folder("splat_files");
    for degree in 0..=3 {
        for (name, bytes, said) in in_every_format(&SplatPly::random(700, degree, 5)) {
            let splats = read(&written(&folder, name, bytes));
            assert_eq!((usize::from(splats.degree), splats.cut_from), (degree, None), "{name}");
            let bytes = convert::pack(splats).expect("what can be read can be packed");
            let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
            for (yaw, pitch, distance) in [(140.0, -35.0, None), (70.0, 20.0, Some(0.2))] {
                let camera = orbit_at_rest(&avatar, yaw, pitch, distance, 160);
                let db = psnr_at_rest(&avatar, ALL, &exact(&said, &camera), &camera);
                assert!(db > 45.0, "{name}, degree {degree} from {yaw}°: {db:.2} dB");
            }
        }
    }
}

#[test]
fn numbers_are_those_of_the_file() {
    let folder = files::empty_folder("splat_numbers");
    for (name, bytes, said) in in_every_format(&SplatPly::random(300, 2, 3)) {
        let path = written(&folder, name, bytes);
        let plain = read(&written(&folder, "said.ply", said.bytes()));
        let splats = read(&path);
        assert_eq!(splats.gaussians.len(), plain.gaussians.len());
        for (index, (a, b)) in splats.gaussians.iter().zip(&plain.gaussians).enumerate() {
            let off = |a: &[f32], b: &[f32]| {
                a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
            };
            assert!(off(&a.position, &b.position) < 1e-6, "{name} {index}: {a:?} {b:?}");
            assert!(off(&a.rotation, &b.rotation) < 1e-5, "{name} {index}: {a:?} {b:?}");
            assert!(off(&a.log2_scale, &b.log2_scale) < 1e-5, "{name} {index}: {a:?} {b:?}");
            assert!(off(&a.color, &b.color) < 1e-6, "{name} {index}: {a:?} {b:?}");
            assert!((a.opacity - b.opacity).abs() < 1e-6, "{name} {index}: {a:?} {b:?}");
            let (a, b) = (&splats.harmonics[index], &plain.harmonics[index]);
            assert!(off(a, b) < 1e-6, "{name} {index}: {a:?} {b:?}");
        }
    }
}

#[test]
fn a_kind_that_is_said_is_not_guessed() {
    let folder = files::empty_folder("splat_kinds");
    let ply = SplatPly::random(8, 0, 3);
    let (bytes, _) = splat(&ply);
    // Without its extension it has no mark.
    let path = written(&folder, "scene.bin", bytes);
    let error = convert::read(&path, None).expect_err("nothing says what it is");
    assert!(format!("{error:#}").contains("--from"), "{error:#}");
    let (splats, _) = convert::read(&path, Some(Kind::Splat)).expect("it is one");
    assert_eq!(splats.gaussians.len(), 8);
    // Content goes before names.
    let path = written(&folder, "scene.splat", Spz::new(&ply, 3).0.bytes());
    assert_eq!(read(&path).gaussians.len(), 8);
    for kind in [Kind::Ply, Kind::CompressedPly, Kind::Splat] {
        assert!(convert::read(&path, Some(kind)).is_err(), "{kind:?}");
    }
    // What a PLY says of its low-pass.
    for (bytes, compensated) in [
        (ply.ascii(), false),
        (ply.ascii().replace("element", "comment SplatRenderMode: mip\nelement"), true),
    ] {
        assert_eq!(read(&written(&folder, "a.ply", bytes)).compensated, compensated);
    }
}

#[test]
fn spz_says_its_low_pass_and_its_axes() {
    let folder = files::empty_folder("spz_flags");
    for version in [2, 3, 4] {
        let (mut spz, _) = Spz::new(&SplatPly::random(8, 1, 3), version);
        let path = folder.join("a.spz");
        let converted = |spz: &Spz| {
            fs::write(&path, spz.bytes()).expect("it can be written");
            convert::read(&path, None).map(|(splats, _)| splats)
        };
        assert!(!converted(&spz).expect("plain").compensated);
        *spz.flags() = 1;
        let splats = converted(&spz).expect("with a flag");
        assert!(splats.compensated);
        let bytes = convert::pack(splats).expect("it can be packed");
        let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
        assert_eq!(avatar.header().low_pass, dermis_format::LowPass::Compensated);
        // An extension that nobody knows, then axes: x right, y up, z back.
        *spz.flags() = 3;
        spz.extensions = [0x1234_0001u32, 3].map(u32::to_le_bytes).concat();
        spz.extensions.extend([7, 7, 7]);
        spz.extensions.extend([0xadbe_0003u32, 4, 4].map(u32::to_le_bytes).concat());
        converted(&spz).expect("its own axes");
        *spz.extensions.iter_mut().rev().nth(3).expect("it is there") = 6;
        let error = converted(&spz).expect_err("axes of others");
        assert!(format!("{error:#}").contains("axes"), "{error:#}");
    }
}

#[test]
fn degrees_are_cut_and_it_is_said() {
    let folder = files::empty_folder("splat_degrees");
    // Degree 4 is one plane of 72 bytes.
    let (mut spz, _) = Spz::new(&SplatPly::random(30, 3, 3), 4);
    spz.header[12] = 4;
    let kept = spz.planes[5].as_chunks::<45>().0.iter();
    spz.planes[5] = kept.flat_map(|codes| [&codes[..], &[200; 27]].concat()).collect();
    fs::write(folder.join("a.spz"), spz.bytes()).expect("it can be written");
    for (more, degree, from) in [("", 3, Some(4)), ("--sh-degree 1", 1, Some(4))] {
        let report = run(&folder, &format!("convert a.spz -o a.dermis --json {more}"));
        assert_eq!(report.code, Some(0), "{report:?}");
        let said =
            format!("a.spz: cut harmonics of degree {} to {degree}\n", from.expect("it was cut"));
        assert_eq!(report.stderr, said);
        let json: serde_json::Value = serde_json::from_str(&report.stdout).expect("it is JSON");
        assert_eq!(json["sh_degree"], degree);
        assert_eq!(json["sh_degree_cut_from"], 4);
    }
    let ply = SplatPly::random(30, 2, 3);
    fs::write(folder.join("a.ply"), ply.bytes()).expect("it can be written");
    for (degree, stderr) in [(2, ""), (3, ""), (0, "a.ply: cut harmonics of degree 2 to 0\n")] {
        let report = run(&folder, &format!("convert a.ply -o a.dermis --sh-degree {degree}"));
        assert_eq!((report.code, report.stderr.as_str()), (Some(0), stderr));
    }
    assert_eq!(run(&folder, "convert a.ply -o a.dermis --sh-degree 4").code, Some(2));
}

#[test]
fn damaged_files_neither_panic_nor_hang() {
    let folder = files::empty_folder("splat_damaged");
    let path_of = |name: &str| folder.join(name);
    let packs = |path: &Path| {
        if let Ok((splats, _)) = convert::read(path, None) {
            convert::pack(splats).expect("what can be read can be packed");
        }
    };
    for (name, whole, _) in in_every_format(&SplatPly::random(4, 0, 1)) {
        let path = path_of(name);
        for len in 0..whole.len() {
            fs::write(&path, &whole[..len]).expect("it can be written");
            let whole_records = name.ends_with("splat") && len > 0 && len % 32 == 0;
            assert_eq!(convert::read(&path, None).is_ok(), whole_records, "{name}: {len} bytes");
        }
        for place in 0..whole.len() {
            let mut flipped = whole.clone();
            flipped[place] ^= 1 << (place % 8);
            fs::write(&path, flipped).expect("it can be written");
            packs(&path);
        }
    }
    // Below the compression, whose checksum would find it.
    for version in [2, 3] {
        let mut spz = Spz::new(&SplatPly::random(4, 1, 1), version).0;
        *spz.flags() = 3;
        spz.extensions = [0xadbe_0003u32, 4, 4].map(u32::to_le_bytes).concat();
        let (plain, path) = (spz.plain(), path_of("plain.spz"));
        for place in 0..plain.len() {
            let mut flipped = plain.clone();
            flipped[place] ^= 1 << (place % 8);
            fs::write(&path, gzip(&flipped)).expect("it can be written");
            packs(&path);
            fs::write(&path, gzip(&plain[..place])).expect("it can be written");
            // Extensions may end anywhere.
            let whole = place >= plain.len() - spz.extensions.len();
            assert_eq!(
                convert::read(&path, None).is_ok(),
                whole,
                "version {version}: {place} bytes"
            );
        }
    }
}

#[test]
fn hostile_files_are_refused() {
    let folder = files::empty_folder("hostile_splats");
    let ply = SplatPly::random(4, 0, 1);
    let spz = |version, edit: fn(&mut Spz)| {
        let mut spz = Spz::new(&ply, version).0;
        edit(&mut spz);
        spz.bytes()
    };
    let packed = compressed_ply(&ply, true).0;
    let edited = |from: &str, to: &str| {
        let end = packed.windows(11).position(|w| w == b"end_header\n").expect("it has a header");
        let head = std::str::from_utf8(&packed[..end]).expect("headers are text");
        assert!(head.contains(from), "{from}");
        [head.replacen(from, to, 1).as_bytes(), &packed[end..]].concat()
    };
    let zeros = |mib: usize| gzip(&vec![0; mib << 20]);
    let claim =
        |count: u32| move |spz: &mut Spz| spz.header[8..12].copy_from_slice(&count.to_le_bytes());
    let claimed = |version, count| {
        let mut spz = Spz::new(&ply, version).0;
        claim(count)(&mut spz);
        spz.bytes()
    };
    // 64 MiB of zeros behind a header, with a count that they would do for, and behind all Gaussians.
    let (bomb, mut trailing) = (Spz::new(&ply, 3).0, Spz::new(&ply, 3).0);
    let mut bomb = bomb.header;
    bomb[8..12].copy_from_slice(&3_000_000u32.to_le_bytes());
    bomb.resize(64 << 20, 0);
    trailing.extensions = vec![0; 64 << 20];
    let mut wide = Spz::new(&ply, 4).0;
    wide.planes[1] = vec![0; 64 << 20];
    let files: Vec<(&str, Vec<u8>, &str)> = vec![
        ("empty.splat", Vec::new(), "0 bytes"),
        ("cut.splat", vec![0; 33], "33 bytes"),
        ("faint.splat", vec![0; 64], "2 too faint"),
        ("zeros.spz", zeros(64), "NGSP"),
        ("bomb.spz", gzip(&bomb), "3000000 Gaussians"),
        ("trailing.spz", gzip(&trailing.plain()), "behind"),
        ("trailing_4.spz", trailing_zstd(&ply), "4 bytes"),
        ("wide_4.spz", wide.bytes(), "alphas"),
        ("claims_3.spz", claimed(3, 500_000_000), "10000000000 bytes"),
        ("claims_4.spz", claimed(4, 500_000_000), "10000000000 bytes"),
        ("claims_all.spz", claimed(3, u32::MAX), "4294967295 Gaussians"),
        ("one_more.spz", claimed(3, 5), "0 of 20 bytes of its rotations"),
        ("none.spz", claimed(4, 0), "no Gaussian"),
        ("version_1.spz", spz(3, |spz| spz.header[4] = 1), "version 1"),
        ("version_5.spz", spz(4, |spz| spz.header[4] = 5), "version 5"),
        ("degree.spz", spz(3, |spz| spz.header[12] = 5), "degree 5"),
        ("bits.spz", spz(3, |spz| spz.header[13] = 40), "40 fractional bits"),
        ("streams.spz", spz(4, |spz| spz.header[15] = 6), "6 streams"),
        ("no_chunk.ply", edited("element chunk", "element junk"), "chunk"),
        ("few_chunks.ply", edited("vertex 4", "vertex 1000"), "rows of vertex"),
        ("many_chunks.ply", edited("chunk 1", "chunk 4000000000"), "4000000000"),
        ("no_color.ply", edited("packed_color", "color"), "packed_color"),
        ("half_ranges.ply", edited("max_b", "max_c"), "max_b"),
        ("few_sh.ply", edited("element vertex", "element sh 1\nelement vertex"), "1 rows of sh"),
    ];
    for (name, bytes, part) in files {
        fs::write(folder.join(name), bytes).expect("it can be written");
        let run = run(&folder, &format!("convert {name} -o out.dermis"));
        assert_eq!((run.code, run.stdout.as_str()), (Some(1), ""), "{name}: {run:?}");
        assert_eq!(run.stderr.lines().count(), 1, "{name}: {}", run.stderr);
        for part in [name, "; ", part] {
            assert!(run.stderr.contains(part), "{name}: {part:?} is not in {}", run.stderr);
        }
        assert!(!files::names(&folder).iter().any(|name| name.contains("dermis")), "{name}");
    }
}

/// Version 4 whose alphas go on for 64 MiB while its table tells of four.
fn trailing_zstd(ply: &SplatPly) -> Vec<u8> {
    let mut spz = Spz::new(ply, 4).0;
    let table = 32 + 16;
    spz.planes[1].resize(64 << 20, 0);
    let mut bytes = spz.bytes();
    bytes[table + 8..table + 16].copy_from_slice(&4u64.to_le_bytes());
    bytes
}

#[test]
fn real_files_keep_their_pictures() {
    let Some(folder) = files::data("splat_files::real_files_keep_their_pictures") else { return };
    let folder = folder.join("splats");
    let plant = folder.join("plant.splat");
    let said = SplatPly::of_splat_file(&fs::read(&plant).expect("it is there"));
    real_file_keeps_its_pictures("plant.splat", &said, &plant, 1.3);
    let ours = files::empty_folder("real_splats");
    let source = SplatPly::parse(&fs::read(folder.join("playbot_lod4.ply")).expect("it is there"));
    for (name, bytes, said) in in_every_format(&source) {
        let path = written(&ours, name, bytes);
        real_file_keeps_its_pictures(name, &said, &path, 2.5);
    }
    let plain = written(&ours, "plain.ply", said.bytes());
    assert!(read_faint(&plain) == read_faint(&plant), "a .splat and its PLY are one");
}

/// Gaussians of a file, and how many were left out.
fn read_faint(path: &Path) -> (usize, usize) {
    let (splats, left_out) = convert::read(path, None).unwrap_or_else(|error| panic!("{error:#}"));
    (splats.gaussians.len(), left_out.faint)
}
