//! Tables: every row is there, at the counts and sizes that it is said to have.

use dermis_tests::files::{self, written};
use dermis_tests::small::{WHITE, options};
use dermis_tests::splats::SplatPly;
use dermis_trainer::demo::demo_avatar;
use dermis_trainer::embed::choice::Choice;
use dermis_trainer::embed::detail::Detail;
use dermis_trainer::embed::hierarchy::gaussians_at_level;
use dermis_trainer::options::Options;
use dermis_trainer::reproduce::{Measure, face_lod, formats, lapisgs, lodavatar};

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

#[test]
fn formats_hold_the_same_gaussians() {
    let options = Options { max_loss_db: 0.1, views: 4, ..tiny(640) };
    let table = formats::of_mesh(&demo_avatar(), &options).expect("it can be trained and measured");
    let floats = table.floats_foreground_db.expect("there is a mesh");
    let names: Vec<_> = table.rows.iter().map(|row| row.format).collect();
    assert_eq!(names, ["ply", "splat", "spz", "dermis", "dermis, packed"]);
    assert_eq!((table.gaussians, table.views, table.size), (640, 4, 128));
    for row in &table.rows {
        let (db, lost) = (row.psnr_foreground_db, row.lost_db);
        let (db, lost) = (db.expect("there is a mesh"), lost.expect("there is a mesh"));
        assert!((floats - db - lost).abs() < 1e-9 && lost.abs() < 0.5, "{row:?}");
        // A PLY loses nothing but bits of f32.
        let least = if row.format == "ply" { 60.0 } else { 30.0 };
        assert!(row.psnr_to_floats_db > least, "{row:?}");
        assert_eq!(row.bytes_per_gaussian, row.gaussian_bytes as f64 / 640.0);
    }
    let of = |name| table.rows.iter().find(|row| row.format == name).expect("it is there");
    assert!(of("ply").gaussian_bytes > 640 * 56 && of("splat").bytes == 640 * 32);
    assert!(of("dermis").gaussian_bytes < of("spz").bytes, "{table:?}");
    assert!(of("dermis").gaussian_bytes < of("dermis").bytes, "mesh and rig are in the file");
    let packed = of("dermis, packed");
    assert!(packed.bytes < of("dermis").bytes && packed.gaussian_bytes < packed.bytes);
    assert_eq!(packed.psnr_to_floats_db, of("dermis").psnr_to_floats_db);
}

#[test]
fn levels_of_a_face_go_from_all_to_nothing() {
    // Enough that far away the first level is as good as all.
    let options = Options { steps: 200, ..tiny(2000) };
    let table = face_lod::table(&demo_avatar(), &options).expect("it can be measured");
    assert_eq!(table.clips.len(), 2);
    let levels = &table.levels;
    let [first, .., last] = &levels[..] else { panic!("{table:?}") };
    assert!(levels.is_sorted_by(|near, far| {
        far.distance_m == 2.0 * near.distance_m
            && near.gaussians >= far.gaussians
            && near.joints >= far.joints
            && near.targets >= far.targets
            && near.frames_held.iter().zip(&far.frames_held).all(|(near, far)| near <= far)
    }));
    assert!(last.frames_held > first.frames_held, "{table:?}");
    let as_late = |level: &face_lod::Level| level.frames_held.iter().all(|&frames| frames == 1);
    let exact = levels.iter().filter(|level| as_late(level));
    assert!(exact.clone().all(|level| level.least_held_psnr_db == level.least_psnr_db));
    assert!(first.vertices > last.vertices && first.triangles > last.triangles, "{table:?}");
    assert!(first.animation_ms.iter().all(|&ms| ms > 0.0));
    assert!(first.least_psnr_db > 40.0, "{table:?}");
    assert_eq!((last.joints, last.targets, &last.animation_ms), (0, 0, &vec![0.0, 0.0]));
    let mut still = demo_avatar();
    still.clips.clear();
    assert!(face_lod::table(&still, &tiny(640)).is_err());
}

#[test]
fn formats_hold_what_another_program_trained() {
    let folder = files::empty_folder("reproduce_formats");
    let path = written(&folder, "a.ply", SplatPly::random(300, 1, 5).bytes());
    let table = formats::of_splats(&path, 3, 96, WHITE).expect("it can be measured");
    assert_eq!((table.gaussians, table.rows.len(), table.views), (300, 5, 3));
    let to_floats = |name| {
        let row = table.rows.iter().find(|row| row.format == name).expect("it is there");
        row.psnr_to_floats_db
    };
    assert!(to_floats("ply") > 60.0 && to_floats("spz") > 35.0 && to_floats("dermis") > 35.0);
    assert!(to_floats("splat") < to_floats("spz"), "harmonics are lost");
    assert!(formats::of_splats(&folder.join("absent.ply"), 3, 96, WHITE).is_err());
}
