//! A self-contained page of results: pictures side by side, a plot, a table.

use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use crate::describe::Info;
use crate::eval::{Evaluation, Row, Split};

/// A picture and what stands under it.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Its file.
    pub png: Vec<u8>,
    /// A few words.
    pub caption: String,
}

/// Pictures that belong together.
#[derive(Clone, Debug)]
pub struct Gallery {
    /// What they show.
    pub title: String,
    /// Side by side.
    pub figures: Vec<Figure>,
}

const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;max-width:72rem;margin:2rem auto;padding:0 1rem;color:#222}\
figure{display:inline-block;margin:0 .5rem 1rem 0;vertical-align:top}figure img{width:12.6rem;border:1px solid #ddd}\
figcaption{font-size:.85rem;color:#555;max-width:12.6rem}table{border-collapse:collapse;font-variant-numeric:tabular-nums}\
td,th{padding:.2rem .8rem;text-align:right;border-bottom:1px solid #ddd}svg{background:#fafafa;border:1px solid #ddd}";

/// The page.
pub fn html(
    title: &str,
    intro: &str,
    galleries: &[Gallery],
    evaluation: &Evaluation,
    info: &Info,
) -> String {
    let mut out = String::new();
    // Writing to a string does not fail.
    let _ = write!(
        out,
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>{title}</title><style>{STYLE}</style>\
         <h1>{title}</h1><p>{intro}</p>",
        title = escaped(title),
        intro = escaped(intro)
    );
    for gallery in galleries {
        let _ = write!(out, "<h2>{}</h2>", escaped(&gallery.title));
        for figure in &gallery.figures {
            let caption = escaped(&figure.caption);
            let data = STANDARD.encode(&figure.png);
            let _ = write!(
                out,
                "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{data}\"><figcaption>{caption}</figcaption></figure>"
            );
        }
    }
    let _ =
        write!(out, "<h2>Quality against size</h2>{}{}", plot(&evaluation.rows), table(evaluation));
    let _ = write!(out, "<h2>The file</h2>{}</html>", contents(info));
    out
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn table(evaluation: &Evaluation) -> String {
    let headings: String = Row::HEADINGS.iter().map(|heading| format!("<th>{heading}")).collect();
    let mut out = format!("<p>Means over so many views:</p><table><tr>{headings}</tr>");
    for row in &evaluation.rows {
        let cells: String = row.cells().iter().map(|cell| format!("<td>{cell}")).collect();
        out += &format!("<tr>{cells}</tr>");
    }
    out + "</table>"
}

fn contents(info: &Info) -> String {
    let mut out = format!(
        "<p>{} bytes: {} Gaussians of {:.2} bytes, {} vertices, {} triangles, {} joints, {} morph targets, {} clips.</p>\
         <table><tr><th>section<th>count<th>bytes</tr>",
        info.bytes,
        info.gaussians,
        info.bytes_per_gaussian,
        info.mesh.vertices,
        info.mesh.triangles,
        info.mesh.joints,
        info.mesh.morph_targets,
        info.clips.len()
    );
    for part in &info.sections {
        let _ =
            write!(out, "<tr><td>{}<td>{}<td>{}</tr>", escaped(&part.name), part.count, part.bytes);
    }
    out + "</table>"
}

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 320.0;
const MARGIN: f64 = 48.0;

/// Foreground PSNR over the count of Gaussians (logarithmic), a line for each split.
fn plot(rows: &[Row]) -> String {
    let counts = rows.iter().map(|row| f64::from(row.gaussians.max(1)).ln());
    let (low_x, high_x) = extent(counts);
    let (low_y, high_y) = extent(rows.iter().map(|row| row.psnr_foreground_db));
    let x = |count: u32| {
        MARGIN + (f64::from(count.max(1)).ln() - low_x) / (high_x - low_x) * (WIDTH - 2.0 * MARGIN)
    };
    let y = |db: f64| HEIGHT - MARGIN - (db - low_y) / (high_y - low_y) * (HEIGHT - 2.0 * MARGIN);
    let mut out = format!(
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" font-size=\"12\">"
    );
    for (split, color, dy) in
        [(Split::NovelView, "#1f6feb", -8.0), (Split::Reenactment, "#d1570b", 18.0)]
    {
        let of_split: Vec<&Row> = rows.iter().filter(|row| row.split == split).collect();
        let Some(last) = of_split.last() else { continue };
        let points: Vec<String> = of_split
            .iter()
            .map(|row| format!("{:.1},{:.1}", x(row.gaussians), y(row.psnr_foreground_db)))
            .collect();
        let _ = write!(
            out,
            "<polyline fill=\"none\" stroke=\"{color}\" stroke-width=\"2\" points=\"{}\"/>",
            points.join(" ")
        );
        for row in &of_split {
            let (cx, cy) = (x(row.gaussians), y(row.psnr_foreground_db));
            let _ = write!(
                out,
                "<circle cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"3\" fill=\"{color}\"/>\
                 <text x=\"{cx:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"{color}\">{:.1}</text>",
                cy + dy,
                row.psnr_foreground_db
            );
        }
        let _ = write!(
            out,
            "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"{color}\">{}</text>",
            WIDTH - 4.0,
            y(last.psnr_foreground_db) + 2.6 * dy,
            split.name()
        );
    }
    let mut counts: Vec<u32> = rows.iter().map(|row| row.gaussians).collect();
    counts.sort_unstable();
    counts.dedup();
    for count in counts {
        let _ = write!(
            out,
            "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\" fill=\"#555\">{count}</text>",
            x(count),
            HEIGHT - MARGIN / 2.0
        );
    }
    let _ = write!(
        out,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\" fill=\"#555\">Gaussians</text>\
         <text x=\"8\" y=\"16\" fill=\"#555\">PSNR over the foreground, dB</text></svg>",
        WIDTH / 2.0,
        HEIGHT - 6.0
    );
    out
}

/// Least and greatest, apart by at least a little.
fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    if low < high { (low, high) } else { (low - 0.5, low + 0.5) }
}
