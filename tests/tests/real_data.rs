//! Every real mesh goes the whole path, small.

use std::path::{Path, PathBuf};

use dermis_runtime::{Avatar, Plan, Pose};
use dermis_tests::compare::{cost_of_packing, to_reference};
use dermis_tests::files;
use dermis_tests::small::WHITE;
use dermis_trainer::describe::Info;
use dermis_trainer::draw::draw;
use dermis_trainer::eval::{EvalOptions, Split, evaluate};
use dermis_trainer::import;
use dermis_trainer::methods::Method;
use dermis_trainer::options::{Options, Preset};
use dermis_trainer::orbit::Orbit;
use dermis_trainer::train::train;

/// Foreground PSNR in dB that so few Gaussians and steps must reach on novel views, about 2 dB below
/// what was measured when the bounds were set; a mesh that is not listed must reach 14.
const BOUNDS: [(&str, f64); 6] = [
    ("hand_left.glb", 25.5),
    ("valid_hand_left.glb", 21.0),
    ("greenman.glb", 20.0),
    ("kaykit_knight.glb", 17.5),
    ("valid_head_female.glb", 17.5),
    ("SimpleSkin.gltf", 19.5),
];

/// Few Gaussians, evenly spread, one pose, few small pictures.
fn tiny(steps: u32) -> Options {
    Options {
        gaussians: 600,
        levels: 2,
        views: 6,
        key_frames: 1,
        size: 96,
        steps,
        survey_steps: 0,
        ..Options::preset(Preset::Draft)
    }
}

fn meshes(folder: &Path) -> Vec<PathBuf> {
    let list = |folder: &Path| -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).collect()
    };
    let mut meshes = [list(folder), list(&folder.join("obj"))].concat();
    let known = ["glb", "gltf", "obj"];
    meshes.retain(|path| {
        path.is_file() && path.extension().is_some_and(|e| known.iter().any(|k| e == *k))
    });
    meshes.sort();
    meshes
}

#[test]
fn every_mesh_trains_parses_and_renders() {
    let Some(folder) = files::data("every_mesh_trains_parses_and_renders") else { return };
    let meshes = meshes(&folder);
    assert!(!meshes.is_empty(), "no mesh in {}", folder.display());
    for path in meshes {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let psnr = whole_path(&path);
        let bound = BOUNDS.iter().find(|(of, _)| *of == name).map_or(14.0, |(_, bound)| *bound);
        println!("{name}: {psnr:.2} dB over the foreground");
        assert!(psnr >= bound, "{name}: {psnr:.2} dB, not {bound}");
    }
}

/// White, but black behind the mesh that is white itself: before white it could be lost unnoticed.
fn background(path: &Path) -> [f32; 3] {
    if path.ends_with("SimpleSkin.gltf") { [0.0; 3] } else { WHITE }
}

/// Trains, draws and measures a mesh; returns its foreground PSNR on novel views.
fn whole_path(path: &Path) -> f64 {
    let model = import::load(path).unwrap_or_else(|error| panic!("{error:#}"));
    let named = |error: &dyn std::fmt::Display| -> ! { panic!("{}: {error:#}", path.display()) };
    let background = background(path);
    let options = Options { background, ..tiny(20) };
    let trained = train(&model, &options).unwrap_or_else(|error| named(&error));
    let avatar = Avatar::parse(&trained.bytes).unwrap_or_else(|error| named(&error));
    assert_eq!(avatar.header().gaussians, 600, "{}", path.display());
    let clips = usize::from(avatar.header().clips);
    assert_eq!(clips, model.clips.len(), "{}", path.display());
    let clip = clips.checked_sub(1).map(|clip| Pose::Clip { clip, seconds: 0.3 });
    for pose in [Pose::Rest].into_iter().chain(clip) {
        let plan = Plan::with_budget(&avatar, 300);
        let orbit = Orbit { yaw: 20.0, pitch: 5.0, distance: None };
        let camera = orbit.camera(&avatar, &pose, 96, 96);
        let camera = camera.unwrap_or_else(|error| named(&error));
        let drawn = draw(&avatar, &pose, &plan, &camera, background);
        let drawn = drawn.unwrap_or_else(|error| named(&error));
        assert!(drawn.statistics.gaussians_selected <= 300);
        let pixels = drawn.rgba.as_chunks::<4>().0;
        let [empty, ..] = background.map(|x| (x * 255.0) as u8);
        let seen = pixels.iter().filter(|pixel| **pixel != [empty, empty, empty, 255]).count();
        assert!(seen > 100, "{}: {seen} pixels of it in {pose:?}", path.display());
    }
    let options = EvalOptions {
        key_frames: 1,
        views: 4,
        size: 96,
        background,
        budgets: Vec::new(),
        prefixes: Vec::new(),
        packed: None,
        planned: false,
        distance: None,
    };
    let evaluation = evaluate(&avatar, &model, &options).unwrap_or_else(|error| named(&error));
    let mut novel = evaluation.rows.iter().filter(|row| row.split == Split::NovelView);
    novel.next_back().expect("a split has rows").psnr_foreground_db
}

#[test]
fn level_0_of_the_standard_avatar_has_the_papers_count() {
    let Some(folder) = files::data("level_0_of_the_standard_avatar") else { return };
    let model = import::load(&folder.join("valid_male.glb")).expect("it can be read");
    let options = Options { method: Method::Lodavatar, levels: 1, ..tiny(2) };
    let trained = train(&model, &options).expect("it trains");
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    // V + F: 7505 vertices as stored and 13,605 triangles.
    assert_eq!(avatar.header().gaussians, 21_110);
}

#[test]
fn the_standard_avatar_is_drawn_and_packed_exactly_enough() {
    let Some(folder) = files::data("the_standard_avatar_is_drawn") else { return };
    let model = import::load(&folder.join("valid_male.glb")).expect("it can be read");
    // By numbers of 8 bits; what fewer cost stands below.
    let options = Options { gaussians: 20_000, size: 270, max_loss_db: 0.0, ..tiny(60) };
    let trained = train(&model, &options).expect("it trains");
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    let pose = Pose::Clip { clip: 1, seconds: 1.5 };
    for (budget, distance) in
        [(20_000, None), (20_000, Some(0.6)), (20_000, Some(9.0)), (2_000, None)]
    {
        let plan = Plan::with_budget(&avatar, budget);
        let orbit = Orbit { yaw: 20.0, pitch: 5.0, distance };
        let camera = orbit.camera(&avatar, &pose, 270, 270).expect("it has a box");
        let off = to_reference(&avatar, &pose, &plan, &camera);
        println!("{budget} Gaussians from {distance:?} m: {off:?}");
        assert!(off.steps <= 1 && off.unrounded < 0.1, "{off:?}");
    }
    let narrow = Options { max_loss_db: 0.1, ..options.clone() };
    let packed = train(&model, &narrow).expect("it trains");
    for count in [20_000, 5_000] {
        let cost = cost_of_packing(&model, &trained, &options, count, 4);
        println!("{count} Gaussians: {cost:.3?}");
        assert!(cost.cloud - cost.file <= 0.3 && cost.between > 45.0, "{cost:?}");
        let cost = cost_of_packing(&model, &packed, &narrow, count, 4);
        println!("{count} Gaussians of few bits: {cost:.3?}");
        assert!(cost.cloud - cost.file <= 0.15, "{cost:?}");
    }
    let bytes_of_gaussians = |bytes: &[u8]| -> usize {
        let avatar = Avatar::parse(bytes).expect("what was trained is valid");
        Info::of(&avatar).layers.iter().map(|layer| layer.bytes).sum()
    };
    let [few, all] = [&packed.bytes, &trained.bytes].map(|bytes| bytes_of_gaussians(bytes));
    assert!(few < all * 3 / 4, "{few} bytes of Gaussians, {all} with 8 bits a number");
}
