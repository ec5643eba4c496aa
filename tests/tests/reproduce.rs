//! The papers' tables: every row is there, at the counts and sizes that it is said to have.

use dermis_tests::small::options;
use dermis_trainer::demo::demo_avatar;
use dermis_trainer::embed::choice::Choice;
use dermis_trainer::embed::detail::Detail;
use dermis_trainer::embed::hierarchy::gaussians_at_level;
use dermis_trainer::options::Options;
use dermis_trainer::reproduce::{Measure, lapisgs, lodavatar};

const MEASURE: Measure = Measure { key_frames: 1, views: 2 };

fn tiny(gaussians: u32) -> Options {
    Options { size: 128, views: 6, key_frames: 1, ..options(gaussians, 8) }
}

#[test]
fn lapisgs_has_all_methods_at_four_scales() {
    let model = demo_avatar();
    let mut announced = Vec::new();
    let entries = lapisgs::table(&model, &tiny(640), MEASURE, |entry| announced.push(entry.method))
        .expect("it can be trained and measured");
    let methods: Vec<_> = entries.iter().map(|entry| entry.method).collect();
    let papers = ["Downsample", "Single", "Multiscale", "Freeze", "LapisGS"];
    assert_eq!(methods[..5], papers);
    assert_eq!(methods[5..], [lapisgs::OURS, lapisgs::OURS_AS_LONG]);
    assert_eq!(methods, announced);
    for entry in &entries {
        let of = |scale: &lapisgs::Scale| (scale.size, scale.row.gaussians);
        let scales: Vec<_> = entry.scales.iter().map(of).collect();
        let expected = match entry.method {
            "Single" => [(16, 640), (32, 640), (64, 640), (128, 640)],
            _ => [(16, 10), (32, 40), (64, 160), (128, 640)],
        };
        assert_eq!(scales, expected, "{}", entry.method);
        assert!(entry.scales.iter().all(|scale| scale.gaussian_bytes > 0));
    }
    let sizes = entries.iter().flat_map(|entry| &entry.scales).map(|scale| scale.normalised_size);
    assert_eq!(sizes.fold(0.0, f64::max), 1.0, "the greatest is 1");
    assert!(lapisgs::table(&model, &Options { size: 64, ..tiny(640) }, MEASURE, |_| ()).is_err());
}

#[test]
fn lodavatar_has_ours_at_the_counts_of_its_own() {
    let model = demo_avatar();
    let detail = Detail {
        choice: Choice { joints: vec!["head".into()], ..Choice::default() },
        ..Detail::default()
    };
    let (vertices, triangles) = (model.vertices.len() as u64, model.triangles.len() as u64);
    let level = |level| gaussians_at_level(vertices, triangles, level) as u32;
    // Level 1 and whatever detail on top of it stays under level 2.
    let entries = lodavatar::tables(&model, &tiny(0), &detail, MEASURE, level(2) - 1, |_| ())
        .expect("it can be trained and measured");
    let (theirs, ours): (Vec<_>, Vec<_>) = entries.iter().partition(|entry| entry.avatar != "ours");
    assert_eq!(theirs[0].avatar, "LoD1");
    let counts = |entries: &[&lodavatar::Entry]| -> Vec<u32> {
        let rows = entries.iter().map(|entry| entry.novel_view.as_ref().expect("it was measured"));
        rows.map(|row| row.gaussians).collect()
    };
    assert_eq!(counts(&theirs)[0], level(1));
    assert!(theirs.len() > 1, "some detail fits");
    assert_eq!(counts(&theirs), counts(&ours));
}
