//! Gaussians in files of other programs, by code that shares nothing with the trainer's: `.splat` and PlayCanvas'
//! compressed PLY; [`spz`](crate::spz) stands apart. Each writer returns the file and what it says, as the PLY
//! of the numbers that its codes stand for.

use crate::splats::SplatPly;
use crate::spz::Spz;

/// √(1/4π).
const CONSTANT_HARMONIC: f64 = 0.282_094_791_773_878_14;

/// Places of properties in a row.
pub(crate) struct Columns {
    pub(crate) center: [usize; 3],
    pub(crate) dc: [usize; 3],
    pub(crate) rest: Vec<usize>,
    pub(crate) opacity: usize,
    pub(crate) scale: [usize; 3],
    pub(crate) turn: [usize; 4],
}

impl Columns {
    pub(crate) fn of(ply: &SplatPly) -> Self {
        let at =
            |name: &str| ply.names.iter().position(|n| n == name).expect("it has this property");
        let rest = 3 * ((ply.degree() + 1).pow(2) - 1);
        Self {
            center: ["x", "y", "z"].map(at),
            dc: ["f_dc_0", "f_dc_1", "f_dc_2"].map(at),
            rest: (0..rest).map(|i| at(&format!("f_rest_{i}"))).collect(),
            opacity: at("opacity"),
            scale: ["scale_0", "scale_1", "scale_2"].map(at),
            turn: ["rot_0", "rot_1", "rot_2", "rot_3"].map(at),
        }
    }

    /// w, x, y, z, of length 1.
    pub(crate) fn rotation(&self, row: &[f32]) -> [f64; 4] {
        let q = self.turn.map(|c| f64::from(row[c]));
        let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        q.map(|x| x / length)
    }

    pub(crate) fn opacity(&self, row: &[f32]) -> f64 {
        1.0 / (1.0 + (-f64::from(row[self.opacity])).exp())
    }

    fn color(&self, row: &[f32], channel: usize) -> f64 {
        0.5 + CONSTANT_HARMONIC * f64::from(row[self.dc[channel]])
    }

    pub(crate) fn set_opacity(&self, row: &mut [f32], opacity: f64) {
        row[self.opacity] = (opacity / (1.0 - opacity)).ln() as f32;
    }

    fn set_color(&self, row: &mut [f32], channel: usize, color: f64) {
        row[self.dc[channel]] = ((color - 0.5) / CONSTANT_HARMONIC) as f32;
    }
}

/// A file with its name, and what it says.
pub type Said = (&'static str, Vec<u8>, SplatPly);

/// The same Gaussians in every format that holds their degree.
pub fn in_every_format(ply: &SplatPly) -> Vec<Said> {
    let spz = |name, version| {
        let (spz, said) = Spz::new(ply, version);
        (name, spz.bytes(), said)
    };
    let compressed = |name, color_ranges| {
        let (bytes, said) = compressed_ply(ply, color_ranges);
        (name, bytes, said)
    };
    let mut files = vec![
        spz("2.spz", 2),
        spz("3.spz", 3),
        spz("4.spz", 4),
        compressed("compressed.ply", true),
        compressed("old_compressed.ply", false),
    ];
    if ply.degree() == 0 {
        let (bytes, said) = splat(ply);
        files.push(("a.splat", bytes, said));
    }
    files
}

pub(crate) fn byte(x: f64) -> u8 {
    x.round().clamp(0.0, 255.0) as u8
}

/// `.splat`.
pub fn splat(ply: &SplatPly) -> (Vec<u8>, SplatPly) {
    let columns = Columns::of(ply);
    let mut bytes = Vec::new();
    for row in &ply.rows {
        bytes.extend(columns.center.iter().flat_map(|&c| row[c].to_le_bytes()));
        bytes.extend(columns.scale.iter().flat_map(|&c| row[c].exp().to_le_bytes()));
        bytes.extend([0, 1, 2].map(|channel| byte(255.0 * columns.color(row, channel))));
        bytes.push(byte(255.0 * columns.opacity(row)));
        bytes.extend(columns.rotation(row).map(|x| byte(128.0 * x + 128.0)));
    }
    let said = SplatPly::of_splat_file(&bytes);
    (bytes, said)
}

/// PlayCanvas' compressed PLY, with ranges of colours or without.
pub fn compressed_ply(ply: &SplatPly, color_ranges: bool) -> (Vec<u8>, SplatPly) {
    let columns = Columns::of(ply);
    let mut said = ply.clone();
    let (mut chunks, mut vertices, mut rests) = (Vec::new(), Vec::new(), Vec::new());
    for chunk in said.rows.chunks_mut(256) {
        let position = columns.center.map(|c| range(chunk, |row| row[c]));
        let scale = columns.scale.map(|c| range(chunk, |row| row[c]));
        let colors = |channel| range(chunk, |row| columns.color(row, channel) as f32);
        let color = if color_ranges { [0, 1, 2].map(colors) } else { [[0.0, 1.0]; 3] };
        let ranges: &[[[f32; 2]; 3]] =
            if color_ranges { &[position, scale, color] } else { &[position, scale] };
        for three in ranges {
            let ends = [0, 1].map(|end| three.map(|range| range[end]));
            chunks.extend(ends.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        }
        for row in chunk {
            let mut place = 0;
            let mut size = 0;
            for (i, bits) in [11, 10, 11].into_iter().enumerate() {
                let c = columns.center[i];
                let (code, x) = quantized(f64::from(row[c]), position[i], bits);
                (place, row[c]) = (place << bits | code, x as f32);
                let c = columns.scale[i];
                let (code, x) = quantized(f64::from(row[c]), scale[i], bits);
                (size, row[c]) = (size << bits | code, x as f32);
            }
            let (turn, said) = largest_and_others(columns.rotation(row));
            columns.turn.iter().zip(said).for_each(|(&c, x)| row[c] = x as f32);
            let mut paint = 0;
            for (channel, range) in color.into_iter().enumerate() {
                let (code, x) = quantized(columns.color(row, channel), range, 8);
                paint = paint << 8 | code;
                columns.set_color(row, channel, x);
            }
            let (code, opacity) = quantized(columns.opacity(row), [0.0, 1.0], 8);
            columns.set_opacity(row, opacity);
            vertices.extend([place, turn, size, paint << 8 | code].map(u32::to_le_bytes).concat());
            for &c in &columns.rest {
                let code = ((f64::from(row[c]) / 8.0 + 0.5) * 256.0).clamp(0.0, 255.0) as u8;
                rests.push(code);
                // The middle of what a code stands for, but the first and the last stand for the ends.
                let middle = [0.0, f64::from(code) + 0.5, 256.0]
                    [usize::from(code.min(1)) + usize::from(code == 255)];
                row[c] = (8.0 * (middle / 256.0 - 0.5)) as f32;
            }
        }
    }
    let ends = |of: &[&str]| {
        let line = |end: &str| {
            of.iter().map(|axis| format!("property float {end}_{axis}\n")).collect::<String>()
        };
        line("min") + &line("max")
    };
    let mut header = format!(
        "ply\nformat binary_little_endian 1.0\nelement chunk {}\n{}{}",
        ply.rows.len().div_ceil(256),
        ends(&["x", "y", "z"]),
        ends(&["scale_x", "scale_y", "scale_z"])
    );
    if color_ranges {
        header += &ends(&["r", "g", "b"]);
    }
    header += &format!("element vertex {}\n", ply.rows.len());
    for name in ["position", "rotation", "scale", "color"] {
        header += &format!("property uint packed_{name}\n");
    }
    if !columns.rest.is_empty() {
        header += &format!("element sh {}\n", ply.rows.len());
        (0..columns.rest.len()).for_each(|i| header += &format!("property uchar f_rest_{i}\n"));
    }
    header += "end_header\n";
    ([header.into_bytes(), chunks, vertices, rests].concat(), said)
}

/// Least and greatest.
fn range(rows: &[Vec<f32>], of: impl Fn(&[f32]) -> f32) -> [f32; 2] {
    let numbers = || rows.iter().map(|row| of(row));
    [numbers().fold(f32::INFINITY, f32::min), numbers().fold(f32::NEG_INFINITY, f32::max)]
}

/// The nearest code of so many bits, and its number.
fn quantized(x: f64, [least, greatest]: [f32; 2], bits: u32) -> (u32, f64) {
    let (least, extent) = (f64::from(least), f64::from(greatest) - f64::from(least));
    let last = f64::from((1 << bits) - 1);
    let share = if extent > 0.0 { ((x - least) / extent).clamp(0.0, 1.0) } else { 0.0 };
    let code = (share * last).round();
    (code as u32, least + extent * code / last)
}

/// Two bits for the greatest of w, x, y, z; ten for each of the others, in [−√½, √½].
fn largest_and_others(q: [f64; 4]) -> (u32, [f64; 4]) {
    let greatest =
        (0..4).max_by(|&a, &b| q[a].abs().total_cmp(&q[b].abs())).expect("there are four");
    let mut said = [0.0f64; 4];
    let mut code = greatest as u32;
    let half = std::f32::consts::FRAC_1_SQRT_2;
    for i in (0..4).filter(|&i| i != greatest) {
        let (bits, _) = quantized(q[i] * q[greatest].signum(), [-half, half], 10);
        code = code << 10 | bits;
        said[i] = (f64::from(bits) / 1023.0 - 0.5) * 2f64.sqrt();
    }
    said[greatest] = (1.0 - said.iter().map(|x| x * x).sum::<f64>()).max(0.0).sqrt();
    (code, said)
}
