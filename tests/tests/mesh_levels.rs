//! The first Gaussians on a coarser mesh: few vertices are posed, and the picture is as good.

use dermis_format::section::tag;
use dermis_runtime::{Avatar, Kernel, Plan, Pose, Posed};
use dermis_tests::files::data;
use dermis_tests::small::{options, trained_demo};
use dermis_trainer::describe::Info;
use dermis_trainer::embed::choice::Choice;
use dermis_trainer::embed::regions::Region;
use dermis_trainer::eval::{EvalOptions, evaluate};
use dermis_trainer::import;
use dermis_trainer::methods::MeshTrial;
use dermis_trainer::options::Options;
use dermis_trainer::train::train;

/// Of training at half the size: there a quarter of the Gaussians belongs.
const SIZE: u32 = 48;

/// Vertices that posing for the first layer takes.
fn posed_vertices(avatar: &Avatar<'_>) -> usize {
    let plan = Plan::at_level(avatar, 0.0);
    let mut scratch = vec![0; Posed::scratch_len_for_plan(avatar)];
    let pose = Pose::Clip { clip: 0, seconds: 0.4 };
    let posed = Posed::for_plan(avatar, &pose, &plan, Kernel::detect(), &mut scratch);
    let vertices = posed.expect("it can be posed").vertices();
    vertices.iter().filter(|vertex| vertex[0].is_finite()).count()
}

#[test]
fn a_level_on_its_coarse_mesh_is_as_good_as_on_the_surface() {
    let usual = options(3200, 900);
    let mut figures = Vec::new();
    for mesh_levels in [1, 2] {
        let (model, trained) = trained_demo(&Options { mesh_levels, ..usual.clone() });
        let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
        let mesh = Info::of(&avatar).mesh;
        assert_eq!(mesh.coarser.len() as u32, mesh_levels - 1, "{:?}", trained.mesh_trials);
        assert_eq!(mesh.triangles as usize, model.triangles.len());
        if let [coarser] = mesh.coarser[..] {
            assert!(coarser.gaussians >= 190 && coarser.triangles <= 130, "{coarser:?}");
        }
        let measure = EvalOptions {
            key_frames: 2,
            views: 8,
            size: SIZE / 2,
            background: [1.0; 3],
            budgets: Vec::new(),
            prefixes: Vec::new(),
            packed: None,
            planned: false,
            distance: None,
        };
        let rows = evaluate(&avatar, &model, &measure).expect("it can be measured").rows;
        let first = rows.iter().find(|row| row.gaussians == 200).expect("the first level");
        let vertices = posed_vertices(&avatar);
        println!("{mesh_levels}: {:.2} dB, {vertices} vertices", first.psnr_foreground_db);
        figures.push((first.psnr_foreground_db, vertices));
    }
    let [(fine, many), (coarse, few)] = figures[..] else { panic!("two trainings") };
    assert!(coarse > fine - 0.3, "{coarse} dB on its coarse mesh, {fine} on the surface");
    assert!(3 * few < many, "{few} vertices on the coarse mesh, {many} on the surface");
}

/// Frames of coarse triangles are large: at later levels positions on them have all bits, and the writer and training agree.
#[test]
fn positions_on_coarse_triangles_are_as_exact_as_training_drew_them() {
    let options = Options { mesh_levels: 2, levels: 4, max_loss_db: 0.5, ..options(1600, 200) };
    let (_, trained) = trained_demo(&options);
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    let [stored] = &trained.precision.stored(&trained.clouds).expect("it can be written")[..]
    else {
        panic!("one region")
    };
    let (mut whole, mut fewer) = (0, 0);
    for level in avatar.levels() {
        let widths = level.discs.layout().widths();
        let first_layer = level.first < avatar.layer_len(0, 0);
        let is_shape = level.tag == tag::SHAPE;
        if is_shape {
            assert_eq!(usize::from(level.level), stored.levels.len() - 1);
        } else if first_layer {
            assert_eq!(widths.position, [8; 3]);
            whole += 1;
        } else {
            fewer += usize::from(widths.position != [8; 3]);
        }
        for index in 0..level.count {
            let disc = level.discs.get(index as usize).expect("it is there");
            let drawn = &stored.levels[usize::from(level.level)][(level.first + index) as usize];
            assert!(is_shape || disc.position == drawn.position);
            assert_eq!(disc.log2_scale, drawn.log2_scale);
        }
    }
    assert!(whole > 0 && fewer > 0, "{whole} {fewer}");
}

/// Gaussians of a region stand on its own triangles, of whatever mesh.
#[test]
fn regions_keep_their_gaussians() {
    let choice = Choice { joints: vec!["head".into()], ..Choice::default() };
    let head = Region { name: "head".into(), choice, weight: None };
    let options = Options { mesh_levels: 2, regions: vec![head], ..options(1600, 60) };
    let (_, trained) = trained_demo(&options);
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    assert_eq!(avatar.mesh_levels().count(), 2);
    for block in avatar.blocks() {
        for triangle in block.triangles.iter() {
            assert_eq!(avatar.triangle_region(triangle as usize), block.region);
        }
    }
}

/// More Gaussians than triangles: there is no coarser mesh.
#[test]
fn a_small_mesh_is_its_own() {
    let options = Options { mesh_levels: 3, levels: 3, ..options(200_000, 2) };
    let (model, trained) = trained_demo(&options);
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    assert_eq!(avatar.mesh_levels().count(), 1);
    assert_eq!(avatar.header().triangles as usize, model.triangles.len());
}

/// White with stripes: no coarse mesh carries it before white and before black as its surface does, and none is taken.
#[test]
fn where_no_coarse_mesh_is_as_good_the_file_is_as_if_none_was_asked_for() {
    let Some(folder) = data("mesh_levels") else { return };
    let model = import::load(&folder.join("CesiumMan.glb")).expect("it can be read");
    let usual = Options { survey_steps: 100, ..options(18_000, 60) };
    let train = |mesh_levels| {
        train(&model, &Options { mesh_levels, ..usual.clone() }).expect("it can be trained")
    };
    let (asked, not_asked) = (train(2), train(1));
    let [MeshTrial { tried, is_taken: false, .. }] = &asked.mesh_trials[..] else {
        panic!("{:?}", asked.mesh_trials)
    };
    assert!(!tried.is_empty() && tried.iter().all(|mesh| mesh.loss_db > 0.1), "{tried:?}");
    assert!(not_asked.mesh_trials.is_empty());
    assert!(asked.bytes == not_asked.bytes);
}
