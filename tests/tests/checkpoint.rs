//! Training that is interrupted, by an error or a kill, and goes on to the same bytes.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use dermis_tests::command::{dermis, run};
use dermis_tests::files::{SmallMesh, empty_folder, names};
use dermis_tests::small::{options, trained_demo};
use dermis_trainer::checkpoint::{Checkpoint, Every};
use dermis_trainer::demo::demo_avatar;
use dermis_trainer::embed::choice::Choice;
use dermis_trainer::embed::regions::Region;
use dermis_trainer::methods::Method;
use dermis_trainer::model::Model;
use dermis_trainer::optimize::cloud::Parameters;
use dermis_trainer::options::Options;
use dermis_trainer::train::{Trained, train_resumably};

/// More than one chunk of Gaussians, or there would be nothing for threads to share out.
fn small(method: Method) -> Options {
    let survey_steps = if method == Method::Lodavatar { 0 } else { 5 };
    let (levels, size, views, key_frames) = (2, 32, 4, 1);
    Options { method, survey_steps, levels, size, views, key_frames, ..options(2500, 14) }
}

fn head(weight: Option<f32>) -> Region {
    let choice = Choice { joints: vec!["head".into()], ..Choice::default() };
    Region { name: "head".into(), choice, weight }
}

/// All parameters of all regions.
fn levels(trained: &Trained) -> Vec<&Vec<Vec<Parameters>>> {
    trained.clouds.iter().map(|cloud| &cloud.levels).collect()
}

fn with_threads<T: Send>(threads: usize, act: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
    pool.install(act)
}

/// Runs of `at_most` steps each, by 1 and 2 threads in turn, until one comes to the end. Also how many there were.
fn trained_in_pieces(
    model: &Model,
    options: &Options,
    checkpoint: &Checkpoint,
) -> (Trained, usize) {
    for runs in 1..100 {
        let run = || train_resumably(model, options, checkpoint);
        match with_threads(1 + runs % 2, run) {
            Ok(trained) => return (trained, runs),
            Err(error) => {
                assert!(format!("{error:#}").contains("as asked; run again"), "{error:#}")
            }
        }
    }
    panic!("no run comes to the end");
}

fn survives_interruptions(name: &str, options: &Options) {
    let (model, whole) = trained_demo(options);
    // A checkpoint at every step; steps that are done twice; nothing kept but the ends of descents, the longest of
    // which one run is just long enough for.
    let parts = if matches!(options.method, Method::Lodavatar | Method::Lapisgs) { 2 } else { 1 };
    let always = Every::Time(Duration::ZERO);
    for (every, at_most) in [
        (always, 1),
        (Every::Steps(3), 4),
        (Every::Steps(4), 9),
        (Every::Steps(100), options.steps / parts),
    ] {
        let folder = empty_folder(name);
        let checkpoint = Checkpoint { folder: folder.clone(), every, at_most: Some(at_most) };
        let (trained, runs) = trained_in_pieces(&model, options, &checkpoint);
        assert!(trained.bytes == whole.bytes, "{name}, {checkpoint:?}: other bytes");
        assert_eq!(trained.steps, whole.steps);
        assert!(runs > 1, "{name}, {checkpoint:?}: never interrupted");
        println!("{name}, {every:?}, {at_most} steps at most: {runs} runs");
        assert_eq!(names(&folder), ["lock", "result"]);
        // At once: without any step.
        let checkpoint = Checkpoint { at_most: Some(0), ..checkpoint };
        let again = train_resumably(&model, options, &checkpoint).expect("the result is there");
        assert!(again.bytes == whole.bytes && levels(&again) == levels(&whole));
    }
}

#[test]
fn dermis_goes_on_after_interruptions() {
    survives_interruptions("pieces_dermis", &small(Method::Dermis));
}

/// The split into levels happens between two steps of a descent.
#[test]
fn levels_of_their_own_go_on_after_interruptions() {
    let options = Options { per_level: true, ..small(Method::Dermis) };
    survives_interruptions("pieces_per_level", &options);
}

#[test]
fn regions_go_on_after_interruptions() {
    let options = Options { regions: vec![head(Some(2.0))], ..small(Method::Dermis) };
    survives_interruptions("pieces_regions", &options);
}

/// Trials of coarser meshes are done again by each run, by other threads, and must come to the same.
#[test]
fn coarser_meshes_go_on_after_interruptions() {
    let options = Options { mesh_levels: 2, levels: 3, ..small(Method::Dermis) };
    survives_interruptions("pieces_coarser", &options);
    let (_, trained) = trained_demo(&options);
    assert!(trained.mesh_trials[0].is_taken, "{:?}", trained.mesh_trials);
}

#[test]
fn lodavatar_goes_on_after_interruptions() {
    survives_interruptions("pieces_lodavatar", &small(Method::Lodavatar));
}

#[test]
fn lapisgs_goes_on_after_interruptions() {
    survives_interruptions("pieces_lapisgs", &small(Method::Lapisgs));
}

#[test]
fn downsample_goes_on_after_interruptions() {
    survives_interruptions("pieces_downsample", &small(Method::Downsample));
}

/// Left in the middle of the second descent: `finished.0` and `running`.
fn left_half_way(name: &str, options: &Options) -> Checkpoint {
    let folder = empty_folder(name);
    let checkpoint = Checkpoint { folder, every: Every::Steps(1), at_most: Some(12) };
    train_resumably(&demo_avatar(), options, &checkpoint).expect_err("it stops");
    assert_eq!(names(&checkpoint.folder), ["finished.0", "lock", "running"]);
    Checkpoint { at_most: None, ..checkpoint }
}

/// One line that names the file and says what to do.
fn refused(model: &Model, options: &Options, checkpoint: &Checkpoint, parts: &[&str]) {
    let before = names(&checkpoint.folder);
    let error = train_resumably(model, options, checkpoint).expect_err("it is refused");
    let error = format!("{error:#}");
    assert!(!error.contains('\n') && error.contains("; "), "{error}");
    for part in parts {
        assert!(error.contains(part), "{part:?} is not in {error:?}");
    }
    println!("{error}");
    assert_eq!(names(&checkpoint.folder), before, "nothing is made or removed");
}

#[test]
fn other_trainings_are_refused() {
    let (options, model) = (small(Method::Dermis), demo_avatar());
    let checkpoint = left_half_way("other_trainings", &options);
    let parts = ["another training", "another folder"];
    let mut moved = model.clone();
    moved.vertices[0].position.x += 0.001;
    refused(&moved, &options, &checkpoint, &[parts[0], parts[1], "another mesh"]);
    for other in [
        Options { seed: 2, ..options.clone() },
        Options { steps: options.steps + 1, ..options.clone() },
        Options { method: Method::Lapisgs, ..options.clone() },
        Options { regions: vec![head(None)], ..options.clone() },
    ] {
        refused(&model, &other, &checkpoint, &[parts[0], parts[1], "other options"]);
    }
    // Neither the bound of memory nor the name of the file is anything to the result.
    let same = Options { memory_bytes: 1000, ..options.clone() };
    let renamed = Model { name: "renamed".into(), ..model };
    let trained = train_resumably(&renamed, &same, &checkpoint).expect("it goes on");
    assert!(trained.bytes == trained_demo(&options).1.bytes);
    refused(&moved, &options, &checkpoint, &["result: belongs to another training"]);
}

#[test]
fn damaged_files_are_refused() {
    let (options, model) = (small(Method::Dermis), demo_avatar());
    let checkpoint = left_half_way("damaged_checkpoints", &options);
    let whole = trained_demo(&options).1.bytes;
    for name in ["finished.0", "running", "result"] {
        let path = checkpoint.folder.join(name);
        if name == "result" {
            // The files before it may be gone: it repeats what they held.
            train_resumably(&model, &options, &checkpoint).expect("it comes to the end");
        }
        let bytes = fs::read(&path).expect("it is there");
        let refuse = |bytes: &[u8]| {
            fs::write(&path, bytes).expect("it can be written");
            refused(&model, &options, &checkpoint, &[&format!("{name}: is damaged"), "delete it"]);
        };
        for len in [0, 7, 8, 23, 24, 25, bytes.len() / 2, bytes.len() - 1] {
            refuse(&bytes[..len]);
        }
        // Every bit of the head, and some of the rest.
        let step = bytes.len() / 40;
        for place in (0..24).chain((24..bytes.len()).step_by(step)) {
            let mut flipped = bytes.clone();
            flipped[place] ^= 1 << (place % 8);
            refuse(&flipped);
        }
        refuse(&[&bytes[..], &[0]].concat());
        fs::write(&path, &bytes).expect("it can be written");
    }
    // The remedy of the message works for each.
    for damaged in [&["finished.0"][..], &["running"], &["finished.0", "running"]] {
        let checkpoint = left_half_way("damaged_checkpoints", &options);
        for name in damaged {
            fs::remove_file(checkpoint.folder.join(name)).expect("it is there");
        }
        let trained = train_resumably(&model, &options, &checkpoint).expect("it trains");
        assert!(trained.bytes == whole, "{damaged:?}: other bytes");
    }
}

/// Whole files of this very training, but in each other's place.
#[test]
fn exchanged_files_are_refused() {
    let (options, model) = (small(Method::Lapisgs), demo_avatar());
    let folder = empty_folder("exchanged_checkpoints");
    let checkpoint = Checkpoint { folder, every: Every::Steps(1), at_most: Some(14) };
    train_resumably(&model, &options, &checkpoint).expect_err("it stops");
    assert_eq!(names(&checkpoint.folder), ["finished.0", "finished.1", "lock", "running"]);
    let place = |name: &str| checkpoint.folder.join(name);
    fs::copy(place("finished.0"), place("finished.1")).expect("it can be copied");
    refused(&model, &options, &checkpoint, &["finished.1: is damaged"]);
    fs::copy(place("running"), place("finished.1")).expect("it can be copied");
    refused(&model, &options, &checkpoint, &["finished.1: is damaged"]);
    fs::copy(place("running"), place("result")).expect("it can be copied");
    refused(&model, &options, &checkpoint, &["result: is damaged"]);
}

#[test]
fn leftovers_are_removed_and_files_of_others_are_not() {
    let options = small(Method::Dermis);
    let checkpoint = left_half_way("leftover_checkpoints", &options);
    for name in [".running.4711.tmp", ".finished.0.5.tmp", ".result.7.tmp", ".notes.7.tmp", "notes"]
    {
        fs::write(checkpoint.folder.join(name), "half").expect("it can be written");
    }
    fs::write(checkpoint.folder.join("lock"), "somebody's").expect("it can be written");
    let trained = train_resumably(&demo_avatar(), &options, &checkpoint).expect("it goes on");
    assert!(trained.bytes == trained_demo(&options).1.bytes);
    assert_eq!(names(&checkpoint.folder), [".notes.7.tmp", "lock", "notes", "result"]);
    let lock = fs::read(checkpoint.folder.join("lock")).expect("it is there");
    assert_eq!(lock, b"somebody's");
}

/// Waits until `there`; whether the child still runs then.
fn runs_until(child: &mut Child, there: impl Fn() -> bool) -> bool {
    while child.try_wait().expect("it can be asked").is_none() {
        if there() {
            return true;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    false
}

fn kill(mut child: Child) {
    // SIGKILL on Unix.
    child.kill().expect("it can be killed");
    child.wait().expect("it ends");
}

/// Where the test below tells its children to train. They are this very program.
const FOLDER: &str = "DERMIS_TEST_CHECKPOINT";

fn killed_options() -> Options {
    Options { steps: 400, ..small(Method::Lapisgs) }
}

/// No test of its own: what the next one kills.
#[test]
#[ignore = "the next test starts it"]
fn train_to_be_killed() {
    let Some(folder) = std::env::var_os(FOLDER) else { return };
    // Most of the time goes into writing, so that most kills fall there.
    let checkpoint =
        Checkpoint { every: Every::Steps(1), ..Checkpoint::new(PathBuf::from(folder)) };
    train_resumably(&demo_avatar(), &killed_options(), &checkpoint).expect("it trains");
}

#[test]
fn kills_at_any_moment_change_nothing() {
    let folder = empty_folder("killed_at_any_moment");
    let start = || {
        let mut command = Command::new(std::env::current_exe().expect("a test has a path"));
        command.args(["--exact", "train_to_be_killed", "--ignored"]).env(FOLDER, &folder);
        command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("it starts")
    };
    let modified = |name: &str| folder.join(name).metadata().and_then(|m| m.modified()).ok();
    let mut kills = 0;
    for more in 0..12 {
        let before = modified("running");
        let mut child = start();
        // Some way into the run: what is caught differs from kill to kill, the verdict does not.
        let went_on = || modified("running") != before;
        if !runs_until(&mut child, went_on) {
            break;
        }
        std::thread::sleep(Duration::from_micros(3_700 * more));
        kill(child);
        kills += 1;
    }
    println!("{kills} kills; {:?} is left", names(&folder));
    let checkpoint = Checkpoint::new(folder.clone());
    let options = killed_options();
    let trained = train_resumably(&demo_avatar(), &options, &checkpoint).expect("it goes on");
    assert!(trained.bytes == trained_demo(&options).1.bytes, "other bytes after {kills} kills");
    assert_eq!(names(&folder), ["lock", "result"], "no leftovers");
}

const ARGUMENTS: &str =
    "train mesh.glb --preset draft --gaussians 3000 --views 6 --keyframes 1 --size 64";

fn spawn(folder: &Path, arguments: &str) -> Child {
    let mut command = Command::new(dermis());
    command.current_dir(folder).args(arguments.split_whitespace());
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("dermis starts")
}

#[test]
fn a_killed_command_goes_on_to_the_same_file() {
    let folder = empty_folder("killed_command");
    fs::write(folder.join("mesh.glb"), SmallMesh::pyramid().glb()).expect("it can be written");
    let whole = run(&folder, &format!("{ARGUMENTS} -o whole.dermis"));
    assert_eq!(whole.code, Some(0), "{whole:?}");

    let killed = format!("{ARGUMENTS} -o killed.dermis --checkpoint deep/kept");
    let mut child = spawn(&folder, &killed);
    // The survey's end: the long descent comes now.
    let runs = runs_until(&mut child, || folder.join("deep/kept/finished.0").exists());
    kill(child);
    println!("killed half way: {runs}");
    let arguments = format!("{killed} --threads 1 --json");
    for _ in ["it goes on", "it is done already"] {
        let again = run(&folder, &arguments);
        assert_eq!((again.code, again.stderr.as_str()), (Some(0), ""), "{again:?}");
        assert_eq!(again.stdout.lines().count(), 1);
        let bytes = |name: &str| fs::read(folder.join(name)).expect("it was written");
        assert!(bytes("killed.dermis") == bytes("whole.dermis"), "other bytes");
        fs::remove_file(folder.join("killed.dermis")).expect("it is there");
    }
    assert_eq!(names(&folder.join("deep/kept")), ["lock", "result"]);

    // Messages of the command.
    let fails = |arguments: &str, parts: &[&str]| {
        let run = run(&folder, arguments);
        assert_eq!((run.code, run.stdout.as_str()), (Some(1), ""), "{arguments}: {run:?}");
        assert_eq!(run.stderr.lines().count(), 1, "{arguments}: {run:?}");
        for part in parts {
            assert!(run.stderr.contains(part), "{arguments}: {part:?} is not in {run:?}");
        }
        println!("{}", run.stderr.trim_end());
    };
    let kept = Path::new("deep/kept/result").display().to_string();
    fails(&format!("{killed} --seed 2"), &[&kept, "other options or another seed", "; "]);
    let mut flat = SmallMesh::pyramid();
    flat.positions[4][1] = 0.5;
    fs::write(folder.join("mesh.glb"), flat.glb()).expect("it can be written");
    fails(&killed, &[&kept, "another mesh", "; "]);
    fs::write(folder.join("file"), "no folder").expect("it can be written");
    fails(&format!("{ARGUMENTS} -o a.dermis --checkpoint file"), &["file: ", "; give a folder"]);
}
