//! Files that somebody made, with the right sums and wrong contents.

use std::fs;
use std::ops::Range;
use std::path::Path;

use super::{Checkpoint, Every};
use crate::demo::demo_avatar;
use crate::model::Model;
use crate::options::{Options, Preset};
use crate::train::train_resumably;

/// Where the sum stands, of all behind it, and where the content begins.
const SUM: Range<usize> = 8..12;
const HEAD: usize = 24;

fn tiny() -> Options {
    Options {
        gaussians: 60,
        levels: 2,
        views: 2,
        key_frames: 1,
        size: 16,
        steps: 8,
        survey_steps: 3,
        ..Options::preset(Preset::Draft)
    }
}

fn left_by(model: &Model, folder: &Path) -> Checkpoint {
    let folder = folder.to_owned();
    let checkpoint = Checkpoint { folder, every: Every::Steps(1), at_most: Some(6) };
    train_resumably(model, &tiny(), &checkpoint).expect_err("it stops");
    checkpoint
}

#[test]
fn forged_files_cause_no_panic() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = demo_avatar();
    let checkpoint = left_by(&model, folder.path());
    let (mut refused, mut taken) = (0, 0);
    for name in ["finished.0", "running"] {
        let path = folder.path().join(name);
        let whole = fs::read(&path).expect("it is there");
        let mut forge = |mut bytes: Vec<u8>| {
            let sum = crc32fast::hash(&bytes[SUM.end..]);
            bytes[SUM].copy_from_slice(&sum.to_le_bytes());
            fs::write(&path, bytes).expect("it can be written");
            let checkpoint = Checkpoint { every: Every::Steps(100), ..checkpoint.clone() };
            match train_resumably(&model, &tiny(), &Checkpoint { at_most: Some(1), ..checkpoint }) {
                Err(error) if format!("{error:#}").contains("is damaged") => refused += 1,
                _ => taken += 1,
            }
        };
        // Counts and indices stand at the front: all of them, with small and great values.
        for place in HEAD..HEAD + 24 {
            for value in [0, 1, 0x7f, 0xff] {
                let mut bytes = whole.clone();
                bytes[place] = value;
                forge(bytes);
            }
        }
        // Parameters and moments that are infinite, or no numbers.
        for place in (HEAD + 24..whole.len() - 4).step_by(whole.len() / 24) {
            let mut bytes = whole.clone();
            bytes[place..place + 4].fill(0xff);
            forge(bytes);
        }
        forge(whole[..whole.len() / 2].to_vec());
        forge([&whole[..], &[0]].concat());
        fs::write(&path, whole).expect("it can be written");
    }
    println!("{refused} refused, {taken} taken");
    assert!(refused > 60, "{refused}");
}
