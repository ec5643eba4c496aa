//! What `dermis bench` prints for people.

use dermis_trainer::bench::Bench;
use dermis_trainer::bench::approach::Way;
use dermis_trainer::bench::approximations::Approximations;
use dermis_trainer::bench::clock::Clock;
use dermis_trainer::bench::row::Row;
use dermis_trainer::bench::stereo;
use dermis_trainer::bench::table::aligned;

use super::{ApproachReport, Report, StereoReport, TrainingReport, UnpackingReport};

/// Every tenth of the way, and the greatest change of all pictures.
pub(super) fn approach(report: &ApproachReport) -> String {
    let ApproachReport { avatar, cpu, width, height, approaches } = report;
    let mut out = format!(
        "{avatar}, {cpu}, {width}x{height}: change from picture to picture, root mean square in 1/255\n"
    );
    let headings = ["budget", "metres", "Gaussians", "change", "of all", "blends foretold/done"];
    let mut rows = Vec::new();
    for approach in approaches {
        let steps = &approach.steps;
        for step in steps.iter().step_by(steps.len().div_ceil(10).max(1)) {
            rows.push(vec![
                budget(&approach.way),
                format!("{:.2}", step.distance_m),
                step.gaussians.to_string(),
                format!("{:.2}", step.change_8bit),
                format!("{:.2}", step.change_of_all_8bit),
                step.blends_foretold.map_or_else(String::new, |foretold| format!("{foretold:.2}")),
            ]);
        }
    }
    out += &aligned(&headings, &rows);
    for approach in approaches {
        let (way, ratio) = (&approach.way, approach.greatest_change_to_all());
        out += &format!("{}: greatest change to that of all {ratio:.3}", budget(way));
        if way.budget != way.later_budget {
            out += &format!(", {} pictures until it is spent", approach.pictures_to_rise());
        }
        let [least, greatest] = approach.blends_foretold();
        out += &format!("; blends foretold {least:.2} to {greatest:.2} times\n");
    }
    out
}

/// What a way is called.
fn budget(&Way { budget, later_budget, rising }: &Way) -> String {
    match rising {
        _ if budget == later_budget => budget.to_string(),
        None => format!("{budget}→{later_budget}"),
        Some(factor) => format!("{budget}→{later_budget}, ×{factor}"),
    }
}

/// Both eyes.
pub(super) fn stereo(report: &StereoReport) -> String {
    let StereoReport { avatar, cpu, rows } = report;
    let headings = [
        "kernel",
        "size",
        "Gaussians",
        "pose",
        "project one",
        "both",
        "draw left",
        "right",
        "repeated",
        "second/first",
    ];
    let row = |row: &stereo::Row| {
        let mut cells = vec![
            row.kernel.into(),
            format!("{}x{}", row.width, row.height),
            row.gaussians.to_string(),
        ];
        let ms = [row.pose, row.project_one, row.project_both, row.draw_left, row.draw_right];
        cells.extend(ms.map(|ms| format!("{ms:.2}")));
        cells.extend(
            [row.repeated(), row.second_to_first()].map(|share| format!("{:.0} %", share * 100.0)),
        );
        cells
    };
    let rows: Vec<Vec<String>> = rows.iter().map(row).collect();
    format!(
        "{avatar}, {cpu}, both eyes: medians, ms of {}\n{}",
        Clock::ONE_THREAD.measures(),
        aligned(&headings, &rows)
    )
}

/// What unpacking takes.
pub(super) fn unpacking(report: &UnpackingReport) -> String {
    let UnpackingReport { avatar, cpu, unpacking } = report;
    format!(
        "{avatar}, {cpu}, one thread, medians: {} bytes of {} packed, in {:.2} ms of CPU time; {} Gaussians in {:.2} of them, {:.1} million a second\n",
        unpacking.bytes,
        unpacking.packed_bytes,
        unpacking.ms,
        unpacking.gaussians,
        unpacking.gaussians_ms,
        unpacking.gaussians_per_second / 1e6
    )
}

/// Steps of training.
pub(super) fn training(report: &TrainingReport) -> String {
    let headings = [
        "threads",
        "size",
        "Gaussians",
        "seen",
        "forward",
        "loss",
        "backward",
        "update",
        "step",
        "max",
        "rms",
    ];
    let rows: Vec<Vec<String>> = report
        .rows
        .iter()
        .map(|row| {
            let ms = &row.ms;
            let times = [ms.forward, ms.loss, ms.backward, ms.update, row.step_ms];
            let mut cells = vec![
                row.threads.to_string(),
                format!("{}x{}", row.width, row.height),
                row.gaussians.to_string(),
                row.gaussians_visible.to_string(),
            ];
            cells.extend(times.map(|ms| format!("{ms:.2}")));
            cells.push(row.error.max_error_8bit.to_string());
            cells.push(format!("{:.4}", row.error.rms_error_8bit));
            cells
        })
        .collect();
    format!(
        "{}, {}: a training step, ms, medians. Two pictures are on their way at once: parts are each picture's, step \
         is the time that passes. Error of the picture to f64 in 1/255\n{}",
        report.avatar,
        report.cpu,
        aligned(&headings, &rows)
    )
}

pub(super) fn text(report: &Report) -> String {
    let bench = &report.bench;
    let mut out = format!(
        "{}: {} Gaussians, {} ({} cores), {} frames a row\n",
        report.avatar, bench.gaussians, bench.cpu, bench.cores, bench.runs
    );
    let roofs = bench
        .rooflines
        .iter()
        .map(|roof| format!("{} {:.2}", roof.kernel, roof.evaluations_per_s * 1e-9));
    let roofs: Vec<String> = roofs.collect();
    out += &format!("blend loop in the nearest cache, 1e9 evaluations/s: {}\n", roofs.join(", "));
    let (one, several) = (Clock::ONE_THREAD.measures(), Clock::Wall.measures());
    out += &format!(
        "\nms, medians; one thread: {one}, several: {several}; front: pose, project and sort, ns a Gaussian of the plan\n"
    );
    out += &table(bench, "pose plan project sort raster total least front", times);
    out += "\nwork; roof: raster evaluations/s, and their share of what the blend loop can do; KB of scratch\n";
    out += &table(bench, "seen pairs evals blends useful blends/s evals/s roof KB", work);
    out += "\nerror in 1/255 to f64: of bytes, before rounding; own: to a reference that decides culling, order,\n\
            skip and stop by itself; all: RMS to the picture of all Gaussians\n";
    out += &table(bench, "max rms PSNR max(f) rms(f) own_max own_rms own_PSNR all", errors);
    if bench.rows.iter().any(|row| row.scratch.is_some()) {
        out += "\nscratch of one thread: a whole frame with the least that is legal, and with room for all lists\n";
        out += &table(bench, "least_KB least_ms plenty_KB plenty_ms ratio", scratch);
    }
    if bench.rows.iter().any(|row| row.speed_up.is_some()) {
        out += "\nspeed-up over one thread, time that passes\n";
        out += &table(bench, "one_thread_ms bands frame bands_of_least frame_of_least", speed_up);
    }
    for set in &bench.approximations {
        out += &approximations(set);
    }
    out
}

/// One line a row; rows that have none are left out.
fn table(bench: &Bench, headings: &str, cells: impl Fn(&Row) -> Option<Vec<String>>) -> String {
    let mut all = vec!["kernel", "size", "budget", "threads"];
    all.extend(headings.split_whitespace());
    let rows = bench.rows.iter().filter_map(|row| {
        let size = format!("{}x{}", row.width, row.height);
        let mut line =
            vec![row.kernel.into(), size, row.budget.to_string(), row.threads.to_string()];
        line.extend(cells(row)?);
        Some(line)
    });
    aligned(&all, &rows.collect::<Vec<_>>())
}

fn times(row: &Row) -> Option<Vec<String>> {
    let ms = row.ms;
    let numbers =
        [ms.pose, ms.select, ms.project, ms.sort, ms.raster, ms.total, row.ms_least.total];
    let mut cells: Vec<String> = numbers.iter().map(|ms| format!("{ms:.3}")).collect();
    cells.push(row.front_end_ns_per_gaussian.map_or("-".into(), |ns| format!("{ns:.1}")));
    Some(cells)
}

fn work(row: &Row) -> Option<Vec<String>> {
    let mega = |rate: Option<f64>| rate.map_or("-".into(), |rate| format!("{:.0}M", rate * 1e-6));
    Some(vec![
        row.gaussians_visible.to_string(),
        row.pairs.to_string(),
        row.evaluations.to_string(),
        row.blends.to_string(),
        format!("{:.1}%", row.useful_lanes * 100.0),
        mega(row.blends_per_s),
        mega(row.evaluations_per_s),
        row.roofline_fraction.map_or("-".into(), |share| format!("{:.1}%", share * 100.0)),
        row.scratch_bytes.div_ceil(1024).to_string(),
    ])
}

fn errors(row: &Row) -> Option<Vec<String>> {
    let (follows, own) = (&row.error, &row.own_decisions);
    Some(vec![
        follows.max_error_8bit.to_string(),
        format!("{:.5}", follows.rms_error_8bit),
        format!("{:.2}", follows.psnr_to_reference_db),
        format!("{:.4}", follows.max_error_unrounded_8bit),
        format!("{:.6}", follows.rms_error_unrounded_8bit),
        own.max_error_8bit.to_string(),
        format!("{:.5}", own.rms_error_8bit),
        format!("{:.2}", own.psnr_to_reference_db),
        format!("{:.4}", row.rms_error_to_all_gaussians_8bit),
    ])
}

fn scratch(row: &Row) -> Option<Vec<String>> {
    let scratch = row.scratch.as_ref()?;
    Some(vec![
        scratch.least_bytes.div_ceil(1024).to_string(),
        format!("{:.3}", scratch.least_total_ms),
        scratch.plenty_bytes.div_ceil(1024).to_string(),
        format!("{:.3}", scratch.plenty_total_ms),
        format!("{:.3}", scratch.least_over_plenty),
    ])
}

fn speed_up(row: &Row) -> Option<Vec<String>> {
    let speed_up = row.speed_up.as_ref()?;
    Some(vec![
        format!("{:.3}", speed_up.one_thread_total_ms),
        format!("{:.2}", speed_up.bands),
        format!("{:.2}", speed_up.frame),
        format!("{:.2}", speed_up.bands_of_least),
        format!("{:.2}", speed_up.frame_of_least),
    ])
}

fn approximations(set: &Approximations) -> String {
    let mut out = format!(
        "\n{}x{}, budget {}: each approximation against its exact form, in a plain scalar rasterizer that takes \
         {:.3} ms ({:.3} of it for pixels); error in 1/255 before rounding\n",
        set.width, set.height, set.budget, set.ms, set.raster_ms
    );
    let headings =
        ["approximation", "exact form", "ms", "pixels", "saves ms", "saves", "max", "rms"];
    let rows = set.rows.iter().map(|row| {
        vec![
            row.name.to_owned(),
            row.exact_form.to_owned(),
            format!("{:.3}", row.ms),
            format!("{:.3}", row.raster_ms),
            format!("{:.3}", row.saved_ms),
            format!("{:.1}%", 100.0 * row.saved_ms / row.ms),
            format!("{:.4}", row.max_error_unrounded_8bit),
            format!("{:.5}", row.rms_error_unrounded_8bit),
        ]
    });
    out += &aligned(&headings, &rows.collect::<Vec<_>>());
    for left in &set.left_out {
        out += &format!("left out: {}: {}\n", left.name, left.reason);
    }
    out
}
