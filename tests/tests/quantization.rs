//! What writing an avatar to a file costs, and how training makes up for it.

use std::f32::consts::FRAC_PI_2;

use dermis_format::walk::Levels;
use dermis_format::{Disc, FrameKind, LowPass, Records};
use dermis_runtime::frame::Frame;
use dermis_runtime::{Avatar, Camera};
use dermis_tests::compare::cost_of_packing;
use dermis_tests::small::{WHITE, options, trained_demo};
use dermis_trainer::optimize::cloud::{Cloud, Freedom, Parameters, Prefix, Seed};
use dermis_trainer::optimize::descend::{Descent, Problem};
use dermis_trainer::optimize::forward::{Stage, draw};
use dermis_trainer::optimize::loss::Loss;
use dermis_trainer::optimize::schedule::{Nested, Prefixes, Random, Schedule};
use dermis_trainer::options::Options;
use dermis_trainer::scene::Truth;
use dermis_trainer::truth::{Crop, Store, TrainingView};

/// The float cloud and the file, both against the mesh, from directions that training did not see.
#[test]
fn the_file_costs_at_most_three_tenths_of_a_decibel() {
    let options = options(2000, 200);
    let (model, trained) = trained_demo(&options);
    let len = trained.clouds[0].len() as u32;
    for count in [len, len / 4] {
        let cost = cost_of_packing(&model, &trained, &options, count, 6);
        println!("{count} Gaussians: {cost:.3?}");
        assert!(cost.cloud > 15.0, "{} dB is no picture of it", cost.cloud);
        assert!(cost.between > 50.0, "the pictures differ by {:.1} dB", cost.between);
        assert!(cost.cloud - cost.file <= 0.3, "{cost:?}");
    }
}

/// What is asked of the training views is about what views that training did not see lose.
#[test]
fn bits_are_as_few_as_the_wanted_loss_allows() {
    let widths = |bytes: &[u8]| {
        let avatar = Avatar::parse(bytes).expect("what was trained is valid");
        let block = avatar.blocks().last().expect("it has blocks");
        let Records::Disc(discs) = block.records else { panic!("training makes discs") };
        discs.layout()
    };
    let mut before = u32::MAX;
    for max_loss_db in [0.0, 0.05, 0.3] {
        let options = Options { max_loss_db, ..options(2000, 100) };
        let (model, trained) = trained_demo(&options);
        let bits = widths(&trained.bytes).bits();
        let cost = cost_of_packing(&model, &trained, &options, 2000, 6);
        println!("{max_loss_db} dB: {bits} bits, {cost:.3?}");
        assert!(bits < before, "{bits} bits for {max_loss_db} dB, {before} before");
        assert!(max_loss_db > 0.0 || bits == 80, "{bits}");
        let lost = cost.cloud - cost.file;
        assert!(lost <= f64::from(max_loss_db) * 1.5 + 0.02, "{max_loss_db}: {cost:?}");
        before = bits;
    }
}

#[test]
fn the_last_steps_draw_what_is_read() {
    let (_, trained) = trained_demo(&options(2000, 20));
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    let drawn = &trained.precision.stored(&trained.clouds).expect("it can be written")[0];
    for (level, drawn) in (0..).zip(&drawn.levels) {
        let blocks = avatar.blocks_at(|_| Levels { upper: level, lower: None });
        let read: Vec<Disc> = (blocks.take_while(|block| block.layer <= level))
            .flat_map(|block| {
                let Records::Disc(records) = block.records else { panic!("training makes discs") };
                records.iter().collect::<Vec<_>>()
            })
            .collect();
        assert_eq!(read.len(), drawn.len(), "level {level}");
        for (read, drawn) in read.iter().zip(drawn) {
            let drawn = drawn.disc();
            assert!((read.opacity - drawn.opacity).abs() < 1.1e-4, "{read:?} {drawn:?}");
            assert_eq!(*read, Disc { opacity: read.opacity, ..drawn }, "level {level}");
        }
    }
}

/// Gaussians on one triangle, and a camera that sees it.
struct Scene {
    clouds: [Cloud; 1],
    stage: Stage,
    camera: Camera,
}

impl Scene {
    const LOW_PASS: LowPass = LowPass::Compensated;

    fn of(all: Vec<Parameters>, layers: Vec<u32>) -> Self {
        let seed = |parameters| Seed { triangle: 0, parameters, freedom: Freedom::Free };
        let seeds: Vec<Seed> = all.into_iter().map(seed).collect();
        let corners = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
        let stage = Stage {
            frames: vec![Frame::of_triangle(FrameKind::Affine, corners)],
            two_sided: Box::new([false]),
        };
        let camera = Camera {
            width: 64,
            height: 64,
            fx: 60.0,
            fy: 60.0,
            cx: 32.0,
            cy: 32.0,
            world_to_camera: [[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 2.0]],
        };
        Self { clouds: [Cloud::arrange(layers, &seeds)], stage, camera }
    }

    fn truth(&self) -> Truth {
        let prefixes = Prefix::whole(&self.clouds);
        let Self { clouds, stage, camera } = self;
        let over = |behind| draw(clouds, &prefixes, stage, camera, Self::LOW_PASS, behind).picture;
        let (white, black) = (over(WHITE), over([0.0; 3]));
        let coverage = white.rgb.iter().zip(&black.rgb).map(|(w, b)| 1.0 - (w[0] - b[0])).collect();
        Truth { picture: white, coverage, seen: Vec::new() }
    }

    /// The error to `truth` that the first steps of `schedule` find, and the cloud after all of them.
    fn trained(&self, truth: &Truth, schedule: &Schedule) -> (f64, Cloud) {
        let store = Store::new(u64::MAX, &std::env::temp_dir());
        let truth = store.keep(Crop::of(truth, WHITE)).expect("it is small");
        let views = [TrainingView { stage: 0, camera: self.camera, truth }];
        let problem = Problem {
            stages: std::slice::from_ref(&self.stage),
            views: &views,
            background: WHITE,
            low_pass: Self::LOW_PASS,
            loss: Loss::default(),
            blend_price: 0.0,
        };
        let mut descent = Descent::new(self.clouds.to_vec(), &problem, schedule, Random::new(1));
        let first = descent.advance().expect("its picture is in memory");
        while !descent.is_done() {
            descent.advance().expect("its picture is in memory");
        }
        (first.compared.mse, descent.finish().0.swap_remove(0))
    }
}

fn small_discs(count: usize, random: &mut Random) -> Vec<Parameters> {
    let mut between = |low: f32, high: f32| low + (high - low) * random.unit();
    let disc = |_| Parameters {
        position: [between(-0.5, 0.5), between(-0.5, 0.5), between(-0.01, 0.01)],
        angle: between(0.0, 3.0),
        log2_scale: [between(-4.5, -3.5), between(-4.5, -3.5)],
        logit: between(0.0, 2.0),
        color: [0; 3].map(|_| between(0.2, 0.8)),
    };
    (0..count).map(disc).collect()
}

/// Gaussians that match their picture exactly, and one nobody sees, of a colour so bright that the codes of all
/// colours are coarse: what a step finds wrong is rounding alone.
#[test]
fn a_finish_sees_the_rounding_and_moves_what_is_not_rounded() {
    let mut all = small_discs(150, &mut Random::new(7));
    all.push(Parameters { color: [60.0; 3], logit: -12.0, ..Parameters::default() });
    let scene = Scene::of(all, vec![151]);
    // The error that two steps find, and the cloud after them.
    let after = |finish: f32| {
        let schedule = Schedule { finish, warm_up: 0.0, ..options(0, 2).schedule(Prefixes::All) };
        scene.trained(&scene.truth(), &schedule)
    };
    let ((exact, _), (rounded, moved)) = (after(0.0), after(1.0));
    println!("{exact:.2e} before rounding, {rounded:.2e} after");
    assert!(rounded > 1e-4 && rounded > 20.0 * exact, "{exact:.2e} {rounded:.2e}");
    let code = 60.0 / 255.0;
    let pairs =
        moved.full().iter().zip(scene.clouds[0].full()).filter(|(_, before)| before.color[0] < 1.0);
    let steps = pairs.map(|(after, before)| (after.color[0] - before.color[0]).abs());
    let steps: Vec<f32> = steps.filter(|&step| step > 0.0).collect();
    assert!(steps.len() > 140, "{} of 150 colours move", steps.len());
    assert!(steps.iter().all(|&step| step < 0.25 * code), "from where they were, not from codes");
}

/// A disc is the same after a quarter turn with its scales exchanged, and moves as if it had not been turned: where it is drawn as
/// it is or as a file holds it, whole levels or what is between two.
#[test]
fn discs_move_alike_by_any_of_their_angles() {
    let mut random = Random::new(3);
    let target = Scene::of(small_discs(150, &mut random), vec![150]).truth();
    let mut scene = Scene::of(small_discs(150, &mut random), vec![50, 100]);
    scene.clouds[0].split_into_levels(|_| 0.3);
    let turned = |disc: &Parameters| {
        let turned = Disc { angle: disc.angle + FRAC_PI_2, ..disc.disc().exchanged() };
        Parameters { angle: turned.angle, log2_scale: turned.log2_scale, ..*disc }
    };
    for (finish, least) in [(0.0, 1.0), (0.0, 0.4), (1.0, 1.0), (1.0, 0.4)] {
        let nested = Nested { whole: 0.0, level: 0.0, least, ..options(0, 2).nested };
        let prefixes = Prefixes::Nested(nested);
        let schedule =
            Schedule { finish, warm_up: 0.0, max_loss_db: 0.0, ..options(0, 2).schedule(prefixes) };
        let (_, expected) = scene.trained(&target, &schedule);
        for level in 0..2 {
            let mut clouds = scene.clouds.clone();
            clouds[0].levels[level].iter_mut().step_by(2).for_each(|disc| *disc = turned(disc));
            let other = Scene { clouds, stage: scene.stage.clone(), ..scene };
            let (_, found) = other.trained(&target, &schedule);
            for (found, expected) in found.levels.iter().zip(&expected.levels) {
                for (found, expected) in found.iter().zip(expected) {
                    let [found, expected] = [found, expected].map(|disc| disc.disc().upright());
                    let off = |i: usize| (found.log2_scale[i] - expected.log2_scale[i]).abs();
                    assert!(off(0).max(off(1)) < 1e-3, "{finish} {least}: {found:?} {expected:?}");
                }
            }
        }
    }
}
