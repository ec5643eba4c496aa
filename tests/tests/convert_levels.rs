//! LapisGS' levels, converted: level i of the one file is the picture of the i-th PLY.

use std::fs;
use std::path::PathBuf;

use dermis_format::{FrameKind, PerLevel, ScaleLaw};
use dermis_runtime::{Avatar, Level, Plan, Pose};
use dermis_tests::converted::{exact, orbit, psnr};
use dermis_tests::files::{self, SmallMesh};
use dermis_tests::splats::SplatPly;
use dermis_trainer::convert::{self, LeftOut};

/// A series as LapisGS trains it: each file holds the Gaussians of the one before it, dimmed or
/// brightened, then its own.
fn series(counts: &[usize], degree: usize) -> Vec<SplatPly> {
    let all = SplatPly::random(counts[counts.len() - 1] as u32, degree, 21);
    let opacity = all.names.iter().position(|name| name == "opacity").expect("it has one");
    let level = |(level, &count): (usize, &usize)| {
        let mut ply = SplatPly { rows: all.rows[..count].to_vec(), ..all.clone() };
        for (index, row) in ply.rows.iter_mut().enumerate() {
            // Some vanish as others come.
            row[opacity] += level as f32 * [0.5, -0.7, -4.0][index % 3];
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
        let plan = Plan::with_level(&avatar, Level::from(level as f32));
        for (yaw, pitch) in [(20.0, 10.0), (200.0, -30.0)] {
            let camera = orbit(&avatar, &Pose::Rest, yaw, pitch, None, 160);
            let db = psnr(&avatar, &Pose::Rest, &plan, &exact(ply, &camera), &camera);
            println!("level {level} from {yaw}°: {db:.2} dB");
            assert!(db > 45.0, "level {level}: {db:.2} dB");
        }
    }
}
