//! Training: the same bytes from the same options, exact counts, quality that rises.

use dermis_format::section::tag;
use dermis_runtime::Avatar;
use dermis_tests::small::{WHITE, options, trained_demo};
use dermis_trainer::demo::demo_avatar;
use dermis_trainer::embed::hierarchy::gaussians_at_level;
use dermis_trainer::eval::{EvalOptions, Evaluation, Split, evaluate};
use dermis_trainer::methods::Method;
use dermis_trainer::model::{Material, Model, Triangle, Vertex};
use dermis_trainer::optimize::cloud::Freedom;
use dermis_trainer::options::Options;
use dermis_trainer::train::{Trained, train};
use glam::{Vec2, Vec3, Vec4};

fn trained_by(threads: usize, options: &Options) -> Vec<u8> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
    pool.install(|| trained_demo(options)).1.bytes
}

#[test]
fn bytes_depend_on_the_seed_and_on_nothing_else() {
    // More than one chunk of 4096 Gaussians, or there would be nothing to share out.
    let options = Options { size: 64, ..options(5000, 12) };
    let one = trained_by(1, &options);
    assert!(one == trained_by(1, &options), "twice the same");
    for threads in [2, 3] {
        assert!(one == trained_by(threads, &options), "{threads} threads");
    }
    for memory_bytes in [0, 5_000] {
        let options = Options { memory_bytes, ..options.clone() };
        assert!(one == trained_by(2, &options), "{memory_bytes} bytes of truth in memory");
    }
    let other = Options { seed: options.seed + 1, ..options };
    assert!(one != trained_by(2, &other), "another seed is another avatar");
}

#[test]
fn lodavatar_has_exactly_the_counts_of_the_paper() {
    let options = Options {
        method: Method::Lodavatar,
        levels: 3,
        steps: 6,
        size: 48,
        views: 6,
        key_frames: 1,
        ..options(0, 0)
    };
    let (model, Trained { bytes, clouds, .. }) = trained_demo(&options);
    let (vertices, triangles) = (model.vertices.len() as u64, model.triangles.len() as u64);
    let avatar = Avatar::parse(&bytes).expect("what was trained is valid");
    assert_eq!(avatar.header().layers, 3);
    let mut count = 0;
    for (level, factor) in [1, 5, 21].into_iter().enumerate() {
        count += u64::from(avatar.layer_len(0, level));
        assert_eq!(count, vertices + triangles * factor, "level {level}");
        assert_eq!(count, gaussians_at_level(vertices, triangles, level as u32));
    }
    assert_eq!(u64::from(avatar.header().gaussians), count);
    let fixed =
        clouds[0].freedoms.iter().filter(|&&freedom| freedom == Freedom::Fixed).count() as u64;
    assert_eq!(fixed, vertices + triangles * 5, "earlier levels do not move");
}

fn measured(model: &Model, trained: &Trained, budgets: &[u32]) -> Evaluation {
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    let options = EvalOptions {
        key_frames: 2,
        views: 6,
        size: 96,
        background: WHITE,
        budgets: budgets.to_vec(),
        prefixes: Vec::new(),
        packed: None,
        planned: false,
        distance: None,
    };
    evaluate(&avatar, model, &options).expect("it can be measured")
}

#[test]
fn quality_rises_with_training_and_with_the_count() {
    let budgets = [50, 100, 200, 400, 800, 1600, 3200];
    let (model, trained) = trained_demo(&options(3200, 150));
    let after = measured(&model, &trained, &budgets);
    for split in [Split::NovelView, Split::Reenactment] {
        let rows: Vec<_> = after.rows.iter().filter(|row| row.split == split).collect();
        assert!(rows.len() >= budgets.len(), "each count has its row");
        for pair in rows.windows(2) {
            let [few, many] = [pair[0], pair[1]];
            println!("{split:?} {} {:.2} dB", many.gaussians, many.psnr_foreground_db);
            assert!(few.gaussians < many.gaussians && few.bytes <= many.bytes);
            assert!(
                few.psnr_foreground_db <= many.psnr_foreground_db && few.psnr_db <= many.psnr_db,
                "{split:?}: {} Gaussians are worse than {}",
                many.gaussians,
                few.gaussians
            );
        }
    }
    let (model, untrained) = trained_demo(&options(3200, 1));
    let before = measured(&model, &untrained, &budgets);
    for (before, after) in before.rows.iter().zip(&after.rows) {
        assert_eq!((before.split, before.gaussians), (after.split, after.gaussians));
        let gain = after.psnr_foreground_db - before.psnr_foreground_db;
        println!("{:?} {}: {gain:+.2} dB by training", after.split, after.gaussians);
        // Few steps draw the smallest prefixes, which pay for the greater ones at first.
        assert!(after.gaussians < 800 || gain > 1.5, "{gain:.2} dB at {}", after.gaussians);
    }
}

/// A sheet of 4 × 4 squares in the plane z = 0 that looks along +z.
fn sheet(double_sided: bool) -> Model {
    let vertex = |i: u32| Vertex {
        position: Vec3::new((i % 5) as f32, (i / 5) as f32, 0.0) * 0.25,
        uv: Vec2::ZERO,
        color: Vec4::new(0.8, 0.2, 0.1, 1.0),
        influences: [(0, 0.0); 4],
    };
    let squares = (0..16).map(|i| i / 4 * 5 + i % 4);
    let triangles = squares.flat_map(|a| [[a, a + 1, a + 6], [a, a + 6, a + 5]]);
    Model {
        vertices: (0..25).map(vertex).collect(),
        triangles: triangles.map(|corners| Triangle { corners, material: 0 }).collect(),
        materials: vec![Material { double_sided, ..Material::default() }],
        ..Model::default()
    }
}

fn two_sided(model: &Model, options: &Options) -> usize {
    let trained = train(model, options).expect("it trains");
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    (0..model.triangles.len()).filter(|&triangle| avatar.is_two_sided(triangle)).count()
}

#[test]
fn backs_that_are_seen_have_their_bit() {
    let options = Options { size: 48, ..options(200, 3) };
    assert_eq!(two_sided(&sheet(true), &options), 32, "both sides of the sheet are drawn");
    assert_eq!(two_sided(&sheet(false), &options), 0, "its material hides its back");
    assert_eq!(two_sided(&demo_avatar(), &options), 0, "closed parts show no back");
}

/// At the last level Gaussians of earlier layers have another shape and share the rest with the level before, in training and in
/// the file.
#[test]
fn the_last_level_has_shapes_of_its_own_alone() {
    let (_, trained) = trained_demo(&options(1600, 200));
    let [cloud] = &trained.clouds[..] else { panic!("one region") };
    let last = cloud.levels.len() - 1;
    assert_eq!((0..=last).filter_map(|level| cloud.base_of(level)).collect::<Vec<_>>(), [last - 1]);
    let before = &cloud.levels[last - 1];
    for (base, shape) in before.iter().zip(&cloud.levels[last]) {
        assert_eq!(base.shaped(shape), *shape);
    }
    let seeds = cloud.levels[last].iter().zip(before).filter(|(shape, base)| shape != base);
    assert_eq!(seeds.count(), before.len(), "other scales at least");
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    for level in avatar.levels() {
        assert_eq!(level.tag == tag::SHAPE, usize::from(level.level) == last);
    }
}
