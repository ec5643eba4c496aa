//! Parameters per level: a packed cloud is drawn as training draws it, at and between its levels.

use std::slice;

use dermis_format::{LowPass, PerLevel, ScaleLaw, section};
use dermis_runtime::plan::prefix_log2_scale;
use dermis_runtime::{Avatar, Camera, Plan, Pose};
use dermis_tests::compare::to_reference;
use dermis_tests::small::{WHITE, options, trained_demo};
use dermis_trainer::demo::demo_avatar;
use dermis_trainer::describe::Info;
use dermis_trainer::draw::{draw, rgb_of};
use dermis_trainer::eval::bytes_of;
use dermis_trainer::methods::Method;
use dermis_trainer::metrics::psnr::psnr_db;
use dermis_trainer::optimize::cloud::{Cloud, Freedom, Parameters, Prefix, Seed};
use dermis_trainer::optimize::forward::{self, Stage};
use dermis_trainer::options::Options;
use dermis_trainer::orbit::Orbit;
use dermis_trainer::package;

const POSE: Pose<'_> = Pose::Clip { clip: 0, seconds: 0.6 };

/// A trained cloud of three levels, each with parameters of its own, and an empty layer.
fn leveled_cloud() -> Cloud {
    let (_, mut trained) = trained_demo(&Options { per_level: false, ..options(2000, 150) });
    let mut cloud = trained.clouds.swap_remove(0);
    assert_eq!((cloud.layers.len(), cloud.levels.len()), (3, 1));
    cloud.layers.insert(1, 0);
    cloud.split_into_levels(|[count, all]| prefix_log2_scale(count, all));
    let mut seed = 1u32;
    let mut random = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 8) as f32 / 8_388_608.0 - 1.0
    };
    let last = cloud.levels.len() - 1;
    for p in cloud.levels[..last].iter_mut().flatten() {
        p.position[..2].iter_mut().for_each(|x| *x += 0.1 * random());
        p.angle += 1.5 * random();
        p.log2_scale.iter_mut().for_each(|scale| *scale += 0.3 * random());
        p.color.iter_mut().for_each(|c| *c += 0.1 * random());
        p.logit += random();
    }
    cloud.last_is_shape = true;
    cloud.share_base(last);
    cloud
}

fn packed(cloud: &Cloud, scale_law: ScaleLaw) -> Vec<u8> {
    let mut source = package::rigged_mesh(&demo_avatar());
    source.mathematics.scale_law = scale_law;
    package::encode(&package::with_gaussians(source, slice::from_ref(cloud)))
        .expect("a valid cloud")
}

fn view(avatar: &Avatar<'_>) -> Camera {
    let orbit = Orbit { yaw: 30.0, pitch: 10.0, distance: None };
    orbit.camera(avatar, &POSE, 150, 150).expect("it has a box")
}

fn drawn(avatar: &Avatar<'_>, count: u32) -> Vec<u8> {
    let plan = Plan::with_budget(avatar, count);
    assert_eq!(plan.gaussians(), count);
    rgb_of(&draw(avatar, &POSE, &plan, &view(avatar), WHITE).expect("it can be drawn").rgba)
}

fn drawn_by_training(avatar: &Avatar<'_>, cloud: &Cloud, count: u32) -> Vec<u8> {
    let stage = Stage::of(avatar, &POSE).expect("it can be posed");
    let camera = view(avatar);
    let prefix = Prefix::of(count, cloud);
    let clouds = slice::from_ref(cloud);
    let drawn = forward::draw(clouds, &[prefix], &stage, &camera, LowPass::Pixel, WHITE);
    drawn.picture.to_bytes()
}

/// PSNR in dB where either picture is not background.
fn between(a: &[u8], b: &[u8]) -> f64 {
    let mask: Vec<bool> = a
        .chunks_exact(3)
        .zip(b.chunks_exact(3))
        .map(|(a, b)| a != [255; 3] || b != [255; 3])
        .collect();
    assert!(mask.iter().filter(|&&touched| touched).count() > 500, "there is something");
    psnr_db(a, b, Some(&mask)).expect("it is seen")
}

/// Counts of the levels, and counts near and between them.
fn counts(cloud: &Cloud) -> Vec<u32> {
    let ends: Vec<u32> = cloud.levels.iter().map(|level| level.len() as u32).collect();
    let mut counts = vec![ends[0] / 2];
    for pair in ends.windows(2) {
        counts.extend([pair[0], pair[0] + 1, (pair[0] + pair[1]) / 2, pair[1] - 1]);
    }
    counts.extend(ends.last());
    counts
}

#[test]
fn a_packed_cloud_is_drawn_as_training_draws_it() {
    let cloud = leveled_cloud();
    let bytes = packed(&cloud, ScaleLaw::SquareRoot);
    let avatar = Avatar::parse(&bytes).expect("a valid file");
    assert_eq!(avatar.header().per_level, PerLevel::All);
    for count in counts(&cloud) {
        let psnr = between(&drawn(&avatar, count), &drawn_by_training(&avatar, &cloud, count));
        let off = to_reference(&avatar, &POSE, &Plan::with_budget(&avatar, count), &view(&avatar));
        println!("{count} Gaussians: {psnr:.1} dB to training, {off:?} to the reference");
        assert!(psnr > 45.0, "{count} Gaussians: {psnr:.1} dB");
        assert!(off.steps <= 1, "{off:?}");
    }
    // Whatever law was asked for: a constant one cannot draw levels that differ in more than opacity.
    assert_eq!(bytes, packed(&cloud, ScaleLaw::Constant));
}

/// Levels that are nothing but wider: whole levels, and prefixes of the first, are those of one level.
#[test]
fn levels_that_are_only_wider_change_no_level() {
    let (_, trained) = trained_demo(&Options { per_level: false, ..options(2000, 150) });
    let one = Avatar::parse(&trained.bytes).expect("a valid file");
    assert_eq!(one.header().per_level, PerLevel::Nothing);
    let mut cloud = trained.clouds[0].clone();
    cloud.split_into_levels(|[count, all]| prefix_log2_scale(count, all));
    let bytes = packed(&cloud, ScaleLaw::SquareRoot);
    let avatar = Avatar::parse(&bytes).expect("a valid file");
    let levels = cloud.levels.iter().map(|level| level.len() as u32);
    for count in levels.chain([cloud.levels[0].len() as u32 / 2]) {
        let psnr =
            between(&drawn(&avatar, count), &drawn_by_training(&one, &trained.clouds[0], count));
        println!("{count} Gaussians: {psnr:.1} dB");
        assert!(psnr > 45.0, "{count} Gaussians: {psnr:.1} dB");
    }
}

/// Between such levels the areas of all Gaussians add up to the same surface at every count.
#[test]
fn every_prefix_covers_the_surface() {
    let seed = Seed { triangle: 0, parameters: Parameters::default(), freedom: Freedom::Free };
    let mut cloud = Cloud::arrange(vec![60, 0, 140, 600], &[seed; 800]);
    cloud.split_into_levels(|[count, all]| prefix_log2_scale(count, all));
    for count in 1..=800 {
        let prefix = Prefix::of(count, &cloud);
        let drawn = (0..cloud.len()).filter(|&index| cloud.ranks[index] < count);
        let area = |index| {
            let [s, t] = cloud.disc(&prefix, index).log2_scale;
            f64::from(s + t).exp2()
        };
        let covered: f64 = drawn.map(area).sum();
        assert!((covered / 800.0 - 1.0).abs() < 1e-4, "{count}: {covered}");
    }
}

/// LapisGS' levels differ in opacity alone: a byte for each, and no record.
#[test]
fn levels_that_differ_in_opacity_alone_are_packed_as_opacities() {
    let options = Options { method: Method::Lapisgs, ..options(1500, 90) };
    let (_, trained) = trained_demo(&options);
    let avatar = Avatar::parse(&trained.bytes).expect("a valid file");
    assert_eq!(avatar.header().per_level, PerLevel::Opacity);
    let cloud = &trained.clouds[0];
    assert_eq!(cloud.levels.len(), 3);
    for level in &cloud.levels {
        let count = level.len() as u32;
        let psnr = between(&drawn(&avatar, count), &drawn_by_training(&avatar, cloud, count));
        println!("{count} Gaussians: {psnr:.1} dB");
        assert!(psnr > 45.0, "{count} Gaussians: {psnr:.1} dB");
    }
    // With an empty layer, which is a level of the file but not of the cloud.
    let [mut cloud]: [Cloud; 1] =
        trained.precision.within_limits(&trained.clouds).try_into().unwrap();
    cloud.layers.insert(1, 0);
    let bytes = packed(&cloud, ScaleLaw::Constant);
    let padded = Avatar::parse(&bytes).expect("a valid file");
    for level in &cloud.levels {
        let count = level.len() as u32;
        let (padded, plain) = (drawn(&padded, count), drawn(&avatar, count));
        if level.len() == cloud.levels[0].len() {
            // The empty layer's level takes opacities in 1/255, the record has a range of its own.
            let psnr = between(&padded, &plain);
            assert!(psnr > 50.0, "{count} Gaussians: {psnr:.1} dB");
        } else {
            assert_eq!(padded, plain);
        }
    }
}

#[test]
fn levels_are_counted_where_they_are_needed() {
    let cloud = leveled_cloud();
    let bytes = packed(&cloud, ScaleLaw::SquareRoot);
    let avatar = Avatar::parse(&bytes).expect("a valid file");
    let info = Info::of(&avatar);
    let of = |name| info.sections.iter().find(|part| part.name == name).expect("it is there").bytes;
    let all = of("BLCK") + of("LEVL") + of("SHAP");
    assert_eq!(info.layers.iter().map(|layer| layer.bytes).sum::<usize>(), all);
    assert_eq!(info.layers[1].bytes, 0, "an empty layer");
    let each = all as f64 / f64::from(avatar.header().gaussians);
    assert!((info.bytes_per_gaussian - each).abs() < 1e-9);
    // Where each section ends.
    let mut end = bytes.len()
        - avatar.sections().map(|s| section::head::LEN + s.payload.len()).sum::<usize>();
    let mut ends = Vec::new();
    for s in avatar.sections() {
        end += section::head::LEN + s.payload.len();
        ends.push((s.tag, s.payload.get(1).copied().unwrap_or(0), end));
    }
    let ends_at = |layer: u8| {
        let of_layer = |e: &&([u8; 4], u8, usize)| e.0 == section::tag::BLOCK && e.1 == layer;
        ends.iter().filter(of_layer).map(|e| e.2).max().expect("a block")
    };
    for (level, layer) in [(0, 0), (1, 2), (2, 3)] {
        let count = cloud.levels[level].len() as u32;
        assert_eq!(bytes_of(&avatar, &Plan::with_budget(&avatar, count)), ends_at(layer));
    }
    assert_eq!(bytes_of(&avatar, &Plan::with_budget(&avatar, u32::MAX)), ends_at(3));
}
