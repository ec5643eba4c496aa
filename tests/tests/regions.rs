//! Regions: parts of the mesh with orders of their own, weights by hand, and what is measured of each.

use dermis_format::LowPass;
use dermis_runtime::{Avatar, Plan, Pose};
use dermis_tests::small::{WHITE, options, trained_demo};
use dermis_trainer::demo::demo_avatar;
use dermis_trainer::draw::{draw, rgb_of};
use dermis_trainer::embed::choice::Choice;
use dermis_trainer::embed::regions::Region;
use dermis_trainer::metrics::psnr::psnr_db;
use dermis_trainer::model::Model;
use dermis_trainer::optimize::cloud::Prefix;
use dermis_trainer::optimize::forward::{self, Stage};
use dermis_trainer::options::Options;
use dermis_trainer::orbit::Orbit;
use dermis_trainer::train::{Trained, train};

const POSE: Pose<'_> = Pose::Clip { clip: 0, seconds: 0.6 };

fn by_joints(name: &str, joints: &[&str], weight: Option<f32>) -> Region {
    let joints = joints.iter().map(|&joint| joint.to_owned()).collect();
    Region { name: name.into(), choice: Choice { joints, ..Choice::default() }, weight }
}

fn head_and_hands(weight: Option<f32>) -> Vec<Region> {
    let hands = by_joints("hands", &["hand_left", "hand_right"], None);
    vec![by_joints("head", &["head"], weight), hands]
}

/// With a survey, and more than one chunk of Gaussians in the body.
fn small(regions: Vec<Region>) -> Options {
    Options { regions, survey_steps: 10, size: 64, ..options(6000, 30) }
}

/// The built-in avatar, its head of a material of its own.
fn with_painted_head() -> Model {
    let mut model = demo_avatar();
    let head = by_joints("head", &["head"], None).choice.select(&model).expect("it has a head");
    let material = model.materials[0].clone();
    model.materials.push(dermis_trainer::model::Material { name: "skin".into(), ..material });
    for (triangle, _) in model.triangles.iter_mut().zip(&head).filter(|(_, head)| **head) {
        triangle.material = 1;
    }
    model
}

/// Names of the regions, and Gaussians of each; where everything stands is checked.
fn regions_of(trained: &Trained, options: &Options) -> Vec<(String, u32)> {
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    for block in avatar.blocks() {
        for triangle in block.triangles.iter() {
            assert_eq!(avatar.triangle_region(triangle as usize), block.region);
        }
    }
    assert_eq!(avatar.header().gaussians, options.gaussians);
    let names = avatar.region_names().map(String::from);
    let regions: Vec<(String, u32)> =
        names.enumerate().map(|(r, n)| (n, avatar.region_len(r))).collect();
    for (region, (name, len)) in regions.iter().enumerate() {
        let layers: Vec<u32> =
            (0..options.levels as usize).map(|l| avatar.layer_len(region, l)).collect();
        assert_eq!(
            layers,
            options.layers(*len),
            "{name}: a share of it is the same of all its layers"
        );
        assert_eq!(trained.clouds[region].len() as u32, *len);
    }
    regions
}

#[test]
fn every_gaussian_stands_in_its_region() {
    let options = small(head_and_hands(None));
    let (_, trained) = trained_demo(&options);
    let regions = regions_of(&trained, &options);
    println!("{regions:?}");
    let names: Vec<&str> = regions.iter().map(|(name, _)| &**name).collect();
    assert_eq!(names, ["head", "hands", "body"]);
    assert!(regions.iter().all(|(_, len)| *len > 50));

    let skin = Choice { materials: vec!["skin".into()], ..Choice::default() };
    let painted = Region { name: "head".into(), choice: skin, weight: None };
    let options = Options { regions: vec![painted], ..options };
    let trained = train(&with_painted_head(), &options).expect("it trains");
    let by_material = regions_of(&trained, &options);
    assert_eq!((by_material.len(), &by_material[0]), (2, &regions[0]), "the same triangles");
}

#[test]
fn bytes_do_not_depend_on_threads() {
    let options = small(head_and_hands(Some(2.0)));
    let by = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| trained_demo(&options)).1.bytes
    };
    let one = by(1);
    assert!(one == by(2) && one == by(3));
}

#[test]
fn a_weight_moves_gaussians() {
    let heads = [None, Some(4.0)].map(|weight| {
        let options = small(head_and_hands(weight));
        let (_, trained) = trained_demo(&options);
        let head = f64::from(regions_of(&trained, &options)[0].1);
        let avatar = Avatar::parse(&trained.bytes).expect("a valid file");
        assert_eq!(avatar.region_weight(0) == 4.0, weight.is_some(), "it is told");
        head / (f64::from(options.gaussians) - head)
    });
    let ratio = heads[1] / heads[0];
    println!("{ratio:.2} times the density");
    assert!((3.2..=4.8).contains(&ratio), "{ratio:.2} times the density");
}

/// Each region with a count of its own, whole, at a level, between two, or empty.
#[test]
fn a_file_is_drawn_as_training_draws_it() {
    let options = small(head_and_hands(None));
    let (_, trained) = trained_demo(&options);
    let avatar = Avatar::parse(&trained.bytes).expect("a valid file");
    let camera = Orbit { yaw: 30.0, pitch: 10.0, distance: None };
    let camera = camera.camera(&avatar, &POSE, 150, 150).expect("it has a box");
    let stage = Stage::of(&avatar, &POSE).expect("it can be posed");
    let lens = [0, 1, 2].map(|region| avatar.region_len(region));
    for shares in [[1.0; 3], [0.25; 3], [1.0, 0.1, 0.4], [0.0, 1.0, 0.02], [0.3, 0.0, 1.0]] {
        let counts = [0, 1, 2].map(|region| (f64::from(lens[region]) * shares[region]) as u32);
        let plan = Plan::of_counts(&avatar, counts.into_iter());
        let file = draw(&avatar, &POSE, &plan, &camera, WHITE).expect("it can be drawn");
        let prefixes: Vec<Prefix> =
            counts.iter().zip(&trained.clouds).map(|(&n, cloud)| Prefix::of(n, cloud)).collect();
        let drawn =
            forward::draw(&trained.clouds, &prefixes, &stage, &camera, LowPass::Pixel, WHITE);
        let of_counts =
            drawn.regions.iter().zip(counts).all(|(drawn, count)| drawn.len() <= count as usize);
        assert!(
            of_counts && drawn.regions.last().is_some_and(|last| last.end == drawn.splats.len())
        );
        let (a, b) = (rgb_of(&file.rgba), drawn.picture.to_bytes());
        let touched = |(a, b): (&[u8], &[u8])| a != [255; 3] || b != [255; 3];
        let mask: Vec<bool> = a.chunks_exact(3).zip(b.chunks_exact(3)).map(touched).collect();
        let psnr = psnr_db(&a, &b, Some(&mask)).expect("it is seen");
        println!("{counts:?} Gaussians: {psnr:.1} dB");
        assert!(psnr > 45.0, "{counts:?} Gaussians: {psnr:.1} dB");
    }
}

#[test]
fn budgets_are_shares_of_all_regions() {
    let (_, trained) = trained_demo(&small(head_and_hands(None)));
    let avatar = Avatar::parse(&trained.bytes).expect("a valid file");
    let total = avatar.header().gaussians;
    for budget in (0..50).chain((50..total).step_by(613)).chain([total - 1, total, u32::MAX]) {
        let plan = Plan::with_budget(&avatar, budget);
        assert_eq!(plan.gaussians(), budget.min(total));
        let share = f64::from(budget.min(total)) / f64::from(total);
        for (region, planned) in plan.regions().iter().enumerate() {
            let exact = share * f64::from(avatar.region_len(region));
            assert!((f64::from(planned.count) - exact).abs() <= 3.0, "{budget}: {plan:?}");
        }
    }
}

#[test]
fn what_moves_weighs_more() {
    let (_, trained) = trained_demo(&small(head_and_hands(Some(0.5))));
    let avatar = Avatar::parse(&trained.bytes).expect("a valid file");
    let of = |number: fn(&dermis_format::record::ImportanceRecord) -> f32| -> Vec<f32> {
        avatar.importances().iter().map(number).collect()
    };
    let (weights, mobilities) = (of(|i| i.weight.get()), of(|i| i.mobility.get()));
    let (visible, residual) = (of(|i| i.visible.get()), of(|i| i.residual.get()));
    println!("weights {weights:?}, m/s {mobilities:?}, visible {visible:?}, residual {residual:?}");
    assert_eq!(weights[0], 0.5, "by hand");
    // The demo waves and walks: hands swing, the rest carries them.
    assert!(mobilities[1] > 2.0 * mobilities[2] && mobilities[2] > 0.0, "{mobilities:?}");
    assert!(weights[1] > 1.0 && weights[2] < weights[1], "{weights:?}");
    for shares in [visible, residual] {
        assert!((shares.iter().sum::<f32>() - 1.0).abs() < 1e-5, "{shares:?}");
        assert!(shares[2] > shares[1] && shares[1] > 0.0, "the body is larger: {shares:?}");
    }
    // Without regions a file says nothing of importance, and its one region is as ever.
    let (_, plain) = trained_demo(&small(Vec::new()));
    let avatar = Avatar::parse(&plain.bytes).expect("a valid file");
    assert!(avatar.importances().is_empty());
    assert_eq!(avatar.region_names().collect::<Vec<_>>(), ["body"]);
}
