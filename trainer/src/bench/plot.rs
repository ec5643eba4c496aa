//! Speed against error, as an SVG.

use std::ops::Range;

use anyhow::{Result, anyhow};
use plotters::coord::Shift;
use plotters::prelude::*;

use super::Bench;
use super::row::Row;

/// Width and height of a panel, px.
const PANEL: [u32; 2] = [640, 460];
/// Errors below this stand on the axis, 1/255.
const LEAST_ERROR: f64 = 1e-5;

/// A point with its name.
struct Mark {
    x: f64,
    y: f64,
    series: usize,
    label: String,
}

/// A diagram of errors over milliseconds, both axes logarithmic.
struct Panel {
    title: String,
    error: &'static str,
    series: Vec<String>,
    marks: Vec<Mark>,
}

/// Panels in two columns: the error of arithmetic and that of the budget over kernels, budgets, sizes and
/// threads; and one for each set of approximations.
///
/// # Errors
///
/// Where it cannot be drawn.
pub fn svg(bench: &Bench, what: &str) -> Result<String> {
    let mut panels = vec![
        rows(
            bench,
            format!("{what}, {}: arithmetic", bench.cpu),
            "RMS error to f64 with its own decisions, 1/255",
            |row| row.own_decisions.rms_error_unrounded_8bit,
        ),
        rows(
            bench,
            format!("{what}, {}: budget", bench.cpu),
            "RMS error to all Gaussians in f64, 1/255",
            |row| row.rms_error_to_all_gaussians_8bit,
        ),
    ];
    panels.extend(bench.approximations.iter().map(|set| {
        let mark = |(series, row): (usize, &super::approximations::Approximation)| Mark {
            x: row.ms,
            y: row.rms_error_unrounded_8bit,
            series,
            label: String::new(),
        };
        Panel {
            title: format!(
                "{}×{}, budget {}: exact forms; unchanged {:.1} ms",
                set.width, set.height, set.budget, set.ms
            ),
            error: "RMS error that the approximation costs, 1/255",
            series: set.rows.iter().map(|row| row.name.to_owned()).collect(),
            marks: set.rows.iter().enumerate().map(mark).collect(),
        }
    }));
    let mut text = String::new();
    {
        let rows = panels.len().div_ceil(2);
        let size = (2 * PANEL[0], rows as u32 * PANEL[1]);
        let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
        root.fill(&WHITE).map_err(failed)?;
        for (panel, area) in panels.iter().zip(root.split_evenly((rows, 2))) {
            panel.draw(&area)?;
        }
        root.present().map_err(failed)?;
    }
    Ok(text)
}

/// A mark for each row of the table, a series for each kernel and number of threads.
fn rows(bench: &Bench, title: String, error: &'static str, of: impl Fn(&Row) -> f64) -> Panel {
    let name = |row: &Row| match row.threads {
        1 => row.kernel.to_owned(),
        threads => format!("{}, {threads} threads", row.kernel),
    };
    let mut series: Vec<String> = Vec::new();
    let mut marks = Vec::new();
    for row in &bench.rows {
        let name = name(row);
        let index = series.iter().position(|other| *other == name).unwrap_or(series.len());
        if index == series.len() {
            series.push(name);
        }
        // All kernels give the same picture: one label serves them all.
        let label = format!("{} at {}×{}", row.gaussians_selected, row.width, row.height);
        let label = if index == 0 { label } else { String::new() };
        marks.push(Mark { x: row.ms.total, y: of(row), series: index, label });
    }
    Panel { title, error, series, marks }
}

impl Panel {
    fn draw(&self, area: &DrawingArea<SVGBackend<'_>, Shift>) -> Result<()> {
        let x = around(self.marks.iter().map(|mark| mark.x));
        // Room for the legend.
        let x = x.start..x.end * 3.0;
        let y = around(self.marks.iter().map(|mark| mark.y.max(LEAST_ERROR)));
        // Whole decades, so that the axis has numbers.
        let y = 10f64.powf(y.start.log10().floor())..10f64.powf(y.end.log10().ceil());
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, ("sans-serif", 16))
            .margin(14)
            .x_label_area_size(42)
            .y_label_area_size(72)
            .build_cartesian_2d(x.log_scale(), y.log_scale())
            .map_err(failed)?;
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .x_desc("ms a frame")
            .y_desc(self.error)
            .x_label_formatter(&|x| short(*x))
            .y_label_formatter(&|y| short(*y))
            .draw()
            .map_err(failed)?;
        for (index, name) in self.series.iter().enumerate() {
            let color = Palette99::pick(index).to_rgba();
            let marks = self.marks.iter().filter(|mark| mark.series == index);
            let points = marks.clone().map(|mark| (mark.x, mark.y.max(LEAST_ERROR)));
            chart
                .draw_series(points.map(|at| Circle::new(at, 4, color.filled())))
                .map_err(failed)?
                .label(name)
                .legend(move |(x, y)| Circle::new((x + 8, y), 4, color.filled()));
            let labels = marks.filter(|mark| !mark.label.is_empty()).map(|mark| {
                let text = Text::new(mark.label.clone(), (6, -12), ("sans-serif", 12));
                EmptyElement::at((mark.x, mark.y.max(LEAST_ERROR))) + text
            });
            chart.draw_series(labels).map_err(failed)?;
        }
        chart
            .configure_series_labels()
            .background_style(WHITE.mix(0.8))
            .border_style(BLACK.mix(0.3))
            .draw()
            .map_err(failed)?;
        Ok(())
    }
}

/// A range with room around all numbers, and no end at or below 0.
fn around(numbers: impl Iterator<Item = f64>) -> Range<f64> {
    let positive = numbers.filter(|x| x.is_finite() && *x > 0.0);
    let (low, high) =
        positive.fold((f64::INFINITY, 0.0f64), |(low, high), x| (low.min(x), high.max(x)));
    if low <= high { low / 2.0..high * 2.0 } else { 0.1..10.0 }
}

/// Few digits.
fn short(x: f64) -> String {
    if (0.01..1e4).contains(&x) { format!("{}", (x * 1e4).round() / 1e4) } else { format!("{x:e}") }
}

fn failed(error: impl std::fmt::Display) -> anyhow::Error {
    anyhow!("the plot cannot be drawn: {error}")
}
