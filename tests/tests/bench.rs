//! `dermis bench` from outside: what it prints, and that all of it but time is the same again.

use std::fs;
use std::path::{Path, PathBuf};

use dermis_tests::command::run;
use dermis_tests::files::{empty_folder, names, workspace};
use dermis_tests::small::{options, trained_demo};
use serde_json::Value;

/// A folder with `a.dermis`, a trained figure with a mesh, a clip and 5,000 Gaussians.
fn folder(name: &str) -> PathBuf {
    let folder = empty_folder(name);
    let figure = workspace().join("tests/conformance/data/figure.dermis");
    fs::copy(figure, folder.join("a.dermis")).expect("it can be copied");
    folder
}

/// The JSON that a run prints.
fn json(folder: &Path, arguments: &str) -> Value {
    let run = run(folder, &format!("bench {arguments} --runs 1 --json"));
    assert_eq!(run.code, Some(0), "{arguments}: {run:?}");
    assert_eq!(run.stdout.lines().count(), 1, "{arguments}: one line");
    serde_json::from_str(&run.stdout).expect("stdout is JSON")
}

fn rows(report: &Value) -> &Vec<Value> {
    report["rows"].as_array().expect("rows are a list")
}

/// A number of a row or of an object in it.
fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("no number {key} in {value}"))
}

const ERRORS: &str = "max_error_8bit rms_error_8bit psnr_to_reference_db \
    max_error_unrounded_8bit rms_error_unrounded_8bit";

/// All of a report that does not depend on the clock.
fn without_times(report: &Value) -> Value {
    let mut report = report.clone();
    let timed = "ms ms_least front_end_ns_per_gaussian blends_per_s evaluations_per_s \
        roofline_fraction speed_up least_total_ms plenty_total_ms least_over_plenty raster_ms \
        saved_ms rooflines";
    fn strip(value: &mut Value, timed: &str) {
        match value {
            Value::Object(fields) => {
                fields.retain(|key, _| timed.split_whitespace().all(|other| other != key));
                fields.values_mut().for_each(|value| strip(value, timed));
            }
            Value::Array(values) => values.iter_mut().for_each(|value| strip(value, timed)),
            _ => (),
        }
    }
    strip(&mut report, timed);
    report
}

#[test]
fn rows_have_the_keys_of_the_design_and_sane_values() {
    let folder = folder("bench_rows");
    let options = "a.dermis --clip wave --time 0.5 --distance 2.5 --size 96x64,33x65 --budget 500,5000 --threads 1,2";
    let report = json(&folder, options);
    assert!(!report["cpu"].as_str().expect("it has a name").is_empty());
    assert_eq!([&report["gaussians"], &report["runs"]], [5000, 1]);
    assert_eq!(report["avatar"], "a.dermis");
    let kernels = dermis_runtime::Kernel::available();
    assert_eq!(rows(&report).len(), kernels.len() * 2 * 2 * 2, "kernels, sizes, budgets, threads");
    for row in rows(&report) {
        let of = |key| number(row, key);
        assert!([[96.0, 64.0], [33.0, 65.0]].contains(&[of("width"), of("height")]));
        assert_eq!(of("gaussians_selected"), of("budget"));
        assert!(of("gaussians_visible") > 100.0 && of("gaussians_visible") <= of("budget"));
        assert!(of("pairs") >= of("gaussians_visible"));
        assert!(of("blends") > 1000.0 && of("evaluations") >= of("blends"));
        assert!((of("useful_lanes") - of("blends") / of("evaluations")).abs() < 1e-9);
        assert!(of("scratch_bytes") > of("budget") * 48.0);
        let ms = &row["ms"];
        let stages = ["pose", "select", "project", "sort", "raster"].map(|key| number(ms, key));
        assert!(stages.iter().all(|&ms| ms >= 0.0) && number(ms, "total") > 0.0);
        assert!(number(&row["ms_least"], "total") <= number(ms, "total"));
        assert!(of("front_end_ns_per_gaussian") > 0.0);
        for errors in [row, &row["own_decisions"]] {
            let errors: Vec<f64> =
                ERRORS.split_whitespace().map(|key| number(errors, key)).collect();
            let [max, rms, psnr, max_unrounded, rms_unrounded] = errors[..] else { panic!() };
            assert!(rms <= max && psnr > 60.0, "{row}");
            assert!(rms_unrounded <= max_unrounded && rms_unrounded > 0.0, "{row}");
        }
        assert!(of("max_error_8bit") <= 1.0, "rounding alone: {row}");
        assert!(of("max_error_unrounded_8bit") < 0.1, "{row}");
        let to_all = of("rms_error_to_all_gaussians_8bit");
        assert!(if of("budget") < 5000.0 { to_all > 0.5 } else { to_all < 0.1 }, "{row}");
        let one_thread = row["threads"] == 1;
        assert_eq!(row["scratch"].is_object(), one_thread);
        assert_eq!(row["speed_up"].is_object(), !one_thread);
        if one_thread {
            let bytes = |key| number(&row["scratch"], key);
            assert!(bytes("least_bytes") <= of("scratch_bytes"));
            assert!(bytes("least_bytes") < bytes("plenty_bytes"));
        } else {
            assert_eq!(row["clock"], "wall");
            for key in ["bands", "frame", "bands_of_least", "frame_of_least"] {
                assert!(number(&row["speed_up"], key) > 0.0, "{row}");
            }
        }
    }
    let names: Vec<&str> = kernels.iter().map(|kernel| kernel.name()).collect();
    let roofs = report["rooflines"].as_array().expect("they are a list");
    let measured: Vec<&str> = roofs.iter().filter_map(|roof| roof["kernel"].as_str()).collect();
    assert_eq!(measured, names);
    assert!(roofs.iter().all(|roof| number(roof, "evaluations_per_s") > 0.0));
}

#[test]
fn all_but_time_is_the_same_again_and_by_every_kernel() {
    let folder = folder("bench_again");
    let options = "a.dermis --size 64x64 --budget 700 --threads 1,2 --approximations";
    let [first, second] = [0, 1].map(|_| without_times(&json(&folder, options)));
    assert_eq!(first, second);
    for row in rows(&first) {
        for key in ["gaussians_visible", "pairs", "blends", "own_decisions"] {
            assert_eq!(row[key], rows(&first)[0][key], "{row}");
        }
    }
}

#[test]
fn approximations_and_a_plot() {
    let folder = folder("bench_approximations");
    let options = "--size 64x64 --kernel scalar --approximations --svg plot.svg";
    let of_file = json(&folder, &format!("a.dermis {options}"));
    let made = json(&folder, &format!("--scene avatar:2000 {options}"));
    let switched = |report: &Value| -> Vec<String> {
        let rows = report["approximations"][0]["rows"].as_array().expect("rows are a list");
        for row in rows {
            number(row, "saved_ms");
            let error = number(row, "max_error_unrounded_8bit");
            assert!(error >= number(row, "rms_error_unrounded_8bit") && error < 255.0, "{row}");
        }
        rows.iter().map(|row| row["name"].as_str().unwrap_or_default().to_owned()).collect()
    };
    let common = [
        "polynomial of pixels",
        "polynomials of the front end",
        "stop at T < 1e-4",
        "skip of alpha < 1/255",
    ];
    assert_eq!(
        switched(&of_file),
        [&common[..], &["culling of back faces", "all of these"]].concat()
    );
    assert_eq!(switched(&made), [&common[..], &["quantized Gaussians", "all of these"]].concat());
    let plot = fs::read_to_string(folder.join("plot.svg")).expect("it was written");
    assert!(plot.starts_with("<svg") && plot.trim_end().ends_with("</svg>"));
    for text in ["avatar:2000", "scalar", "quantized Gaussians", "ms a frame"] {
        assert!(plot.contains(text), "no {text}");
    }
}

#[test]
fn tables_for_people() {
    let folder = folder("bench_tables");
    let run = run(
        &folder,
        "bench a.dermis --size 48x48 --budget 0,1 --runs 1 --threads 1,2 --kernel scalar",
    );
    assert_eq!(run.code, Some(0), "{run:?}");
    let headings = run.stdout.lines().filter(|line| line.starts_with("kernel"));
    assert_eq!(headings.count(), 5, "time, work, error, scratch, speed-up: {}", run.stdout);
    let lines = run.stdout.lines().filter(|line| line.starts_with("scalar"));
    assert_eq!(lines.count(), 3 * 4 + 2 + 2, "{}", run.stdout);
    assert!(!run.stdout.contains("NaN") && !run.stdout.contains("inf"), "{}", run.stdout);
}

#[test]
fn frames_for_counters_say_nothing() {
    let folder = folder("bench_once");
    let run = run(&folder, "bench a.dermis --size 48x48 --once");
    assert_eq!((run.code, run.stdout.as_str()), (Some(0), ""), "{run:?}");
}

#[test]
fn what_is_wrong_is_said_in_one_line() {
    let folder = folder("bench_errors");
    fs::write(folder.join("notes.txt"), "no avatar").expect("it can be written");
    let before = names(&folder);
    for (arguments, code, part) in [
        ("absent.dermis", 1, "absent.dermis: "),
        ("notes.txt", 1, "notes.txt: "),
        ("a.dermis --clip hover", 1, "hover"),
        ("a.dermis --camera absent.json", 1, "absent.json: "),
        ("a.dermis --camera notes.txt", 1, "notes.txt: "),
        ("a.dermis --svg absent/plot.svg", 1, "absent/plot.svg: "),
        (
            if cfg!(target_arch = "x86_64") {
                "a.dermis --kernel neon"
            } else {
                "a.dermis --kernel avx2"
            },
            1,
            "this CPU has no",
        ),
        ("", 2, "FILE"),
        ("a.dermis --scene avatar:9", 2, "--scene"),
        ("--scene avatar:0", 2, "avatar:N"),
        ("--scene ball:9", 2, "avatar:N"),
        ("a.dermis --kernel fast", 2, "scalar"),
        ("a.dermis --size 5", 2, "--size"),
        ("a.dermis --size 5x5,0x5", 2, "--size"),
        ("a.dermis --budget x", 2, "--budget"),
        ("a.dermis --runs 0", 2, "--runs"),
        ("a.dermis --threads 1,x", 2, "--threads"),
        ("a.dermis --camera c.json --size 5x5", 2, "--camera"),
        ("a.dermis --once --approximations", 2, "--once"),
    ] {
        let run = run(&folder, &format!("bench {arguments}"));
        assert_eq!(run.code, Some(code), "{arguments}: {run:?}");
        assert_eq!(run.stdout, "", "{arguments}: nothing on stdout");
        assert!(run.stderr.contains(part), "{arguments}: {part:?} is not in {:?}", run.stderr);
        assert!(code == 2 || run.stderr.lines().count() == 1, "{arguments}: {run:?}");
    }
    assert_eq!(names(&folder), before, "no file made, none left");
}

/// A file whose levels have parameters of their own: the last level's are what a step draws.
#[test]
fn a_step_of_training_draws_what_the_file_shows() {
    let folder = empty_folder("bench_training");
    let (_, trained) = trained_demo(&options(800, 60));
    fs::write(folder.join("a.dermis"), &trained.bytes).expect("it can be written");
    let report = json(&folder, "a.dermis --training --size 96x96 --threads 1,2");
    assert_eq!(rows(&report).len(), 2, "a row for each number of threads");
    for row in rows(&report) {
        assert_eq!(number(row, "gaussians"), 800.0);
        assert!(number(row, "max_error_8bit") <= 1.0, "{row}");
        for part in ["forward", "loss", "backward", "update"] {
            assert!(number(&row["ms"], part) > 0.0, "{part}: {row}");
        }
    }
}

#[test]
fn a_second_eye_and_a_way_to_the_avatar_are_told() {
    let folder = folder("bench_eyes");
    let report = json(&folder, "a.dermis --stereo --size 40x30,64x48 --budget 50");
    assert_eq!(rows(&report).len() % 2, 0, "a row for each kernel and size");
    for row in rows(&report) {
        assert_eq!(number(row, "gaussians"), 50.0);
        assert!(number(row, "project_both") > 0.0 && number(row, "draw_right") > 0.0, "{row}");
    }
    let way = "bench a.dermis --approach --runs 5 --size 40x40 --budget 20,80";
    let report: Value = serde_json::from_str(&run(&folder, &format!("{way} --json")).stdout)
        .expect("stdout is JSON");
    let approaches = report["approaches"].as_array().expect("an array");
    let budgets: Vec<_> = approaches
        .iter()
        .map(|approach| ["budget", "later_budget"].map(|key| number(&approach["way"], key) as u32))
        .collect();
    assert_eq!(budgets, [[20, 20], [80, 80], [20, 80], [20, 80]]);
    for approach in approaches {
        let steps = approach["steps"].as_array().expect("an array");
        let [first, last] = [&steps[0], &steps[4]].map(|step| number(step, "distance_m"));
        assert!((first - 8.0).abs() < 1e-5 && (last - 1.0).abs() < 1e-5 && steps.len() == 5);
        assert!(steps.iter().all(|step| number(step, "gaussians") <= 80.0));
    }
    let text = run(&folder, way);
    assert!(text.stdout.contains("20→80, ×1.1: greatest change to that of all"), "{text:?}");
}
