//! LapisGS' levels, converted: level i of the one file is the picture of the i-th PLY.

use std::fs;
use std::path::PathBuf;

use dermis_format::{FrameKind, PerLevel, ScaleLaw};
use dermis_runtime::{Avatar, Plan, Pose};
use dermis_tests::converted::{exact, orbit, psnr};
use dermis_tests::files::{self, SmallMesh};
use dermis_tests::splats::SplatPly;
use dermis_trainer::convert::{self, LeftOut, Taken};

/// A series as LapisGS trains it: each file holds the Gaussians of the one before it, dimmed or
/// brightened, then its own.
fn series(counts: &[usize], degree: usize) -> Vec<SplatPly> {
    let all = SplatPly::random(counts[counts.len() - 1] as u32, degree, 21);
    let opacity = all.names.iter().position(|name| name == "opacity").expect("it has one");
    let level = |(level, &count): (usize, &usize)| {
        let mut ply = SplatPly { rows: all.rows[..count].to_vec(), ..all.clone() };
        for (index, row) in ply.rows.iter_mut().enumerate() {
            let own = counts.iter().filter(|&&count| count <= index).count();
            // Some vanish as others come.
            row[opacity] += (level - own) as f32 * [0.5, -0.7, -4.0][index % 3];
        }
        ply
    };
    counts.iter().enumerate().map(level).collect()
}

/// Writes them as `0.ply`, `1.ply`, …
fn written(folder: &str, series: &[SplatPly]) -> Vec<PathBuf> {
    let folder = files::empty_folder(folder);
    let write = |(index, ply): (usize, &SplatPly)| {
        let path = folder.join(format!("{index}.ply"));
        fs::write(&path, ply.bytes()).expect("it can be written");
        path
    };
    series.iter().enumerate().map(write).collect()
}

fn levels_are_the_files(bytes: &[u8], series: &[SplatPly]) {
    let avatar = Avatar::parse(bytes).expect("what was packed is valid");
    for (level, ply) in series.iter().enumerate() {
        let plan = Plan::at_level(&avatar, level as f32);
        for (yaw, pitch) in [(20.0, 10.0), (200.0, -30.0)] {
            let camera = orbit(&avatar, &Pose::Rest, yaw, pitch, None, 160);
            let db = psnr(&avatar, &Pose::Rest, &plan, &exact(ply, &camera), &camera);
            println!("level {level} from {yaw}°: {db:.2} dB");
            assert!(db > 45.0, "level {level}: {db:.2} dB");
        }
    }
}

#[test]
fn each_level_is_the_picture_of_its_file() {
    for degree in [0, 2] {
        let series = series(&[300, 900, 2500, 6000], degree);
        let paths = written("convert_lapisgs", &series);
        let (assembly, left_out) =
            convert::assemble(&paths, &Taken::default()).expect("it is a series");
        assert_eq!(left_out, LeftOut::default());
        let bytes = convert::pack(assembly).expect("what can be read can be packed");
        let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
        let header = avatar.header();
        assert_eq!((header.layers, header.gaussians), (4, 6000));
        assert_eq!((header.per_level, header.scale_law), (PerLevel::Opacity, ScaleLaw::Constant));
        levels_are_the_files(&bytes, &series);
    }
}

#[test]
fn what_no_level_shows_is_left_out() {
    let mut series = series(&[300, 900], 1);
    for (row, [first, second]) in [(5, [-9.0, -9.0]), (6, [-9.0, 3.0]), (7, [3.0, -9.0])] {
        series[0] = series[0].with(row, "opacity", first);
        series[1] = series[1].with(row, "opacity", second);
    }
    for ply in &mut series {
        *ply = ply.with(11, "scale_2", f32::NAN);
    }
    let paths = written("convert_lapisgs_left_out", &series);
    let (assembly, left_out) =
        convert::assemble(&paths, &Taken::default()).expect("it is a series");
    assert_eq!(left_out, LeftOut { faint: 1, wild: 1 });
    for ply in &mut series {
        ply.rows.remove(11);
    }
    levels_are_the_files(&convert::pack(assembly).expect("it can be packed"), &series);
}

#[test]
fn a_mesh_carries_levels_too() {
    let series = series(&[300, 900], 0);
    let mut paths = written("convert_lapisgs_mesh", &series);
    let mesh = paths[0].with_file_name("mesh.glb");
    fs::write(&mesh, SmallMesh::pyramid().glb()).expect("it can be written");
    let assembled = convert::assemble(&paths, &Taken { mesh: Some(&mesh), ..Taken::default() });
    let bytes = convert::pack(assembled.expect("it is a series").0).expect("it can be packed");
    let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
    assert_eq!((avatar.header().frame, avatar.header().triangles), (FrameKind::Affine, 6));
    levels_are_the_files(&bytes, &series);

    // Another order is none of this series.
    paths.reverse();
    let error = convert::assemble(&paths, &Taken::default()).expect_err("fine before coarse");
    let error = format!("{error:#}");
    assert!(error.contains("0.ply: has 300 Gaussians, the file before it 900"), "{error}");
}
