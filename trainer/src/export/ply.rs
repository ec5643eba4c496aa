//! The PLY of 3D Gaussian Splatting, as its reference program writes it.

use std::f64::consts::LN_2;

use crate::convert::Splats;
use crate::convert::splat_ply::{COMPENSATED, CONSTANT_HARMONIC};

/// Opacities go by their logit, and that of 1 is infinite: not all programs read it. Rounded to 1/255 this is 1.
const GREATEST_OPACITY: f64 = 1.0 - 1.0 / 65_536.0;

/// Bytes of a binary PLY, little-endian, all properties `float`: centre, normal (zero), `f_dc`, `f_rest` (all of
/// red, then green, then blue), logit of the opacity, natural logarithms of the scales, quaternion w, x, y, z.
pub fn ply(splats: &Splats) -> Vec<u8> {
    let rest = Splats::harmonics_len(splats.degree);
    let mut bytes = header(splats, rest).into_bytes();
    let mut put = |number: f64| bytes.extend((number as f32).to_le_bytes());
    for (index, g) in splats.gaussians.iter().enumerate() {
        g.position.iter().for_each(|&x| put(x.into()));
        [0.0; 3].into_iter().for_each(&mut put);
        g.color.iter().for_each(|&c| put((f64::from(c) - 0.5) / CONSTANT_HARMONIC));
        if let Some(harmonics) = splats.harmonics.get(index) {
            let bands = rest / 3;
            (0..rest).for_each(|i| put(harmonics[i % bands * 3 + i / bands].into()));
        }
        let opacity = f64::from(g.opacity).min(GREATEST_OPACITY);
        put(libm::log(opacity / (1.0 - opacity)));
        g.log2_scale.iter().for_each(|&s| put(f64::from(s) * LN_2));
        g.rotation.iter().for_each(|&q| put(q.into()));
    }
    bytes
}

fn header(splats: &Splats, rest: usize) -> String {
    let names = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2".split(' ').map(str::to_owned);
    let rests = (0..rest).map(|i| format!("f_rest_{i}"));
    let last =
        "opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3".split(' ').map(str::to_owned);
    let names = names.chain(rests).chain(last);
    let properties: String = names.map(|name| format!("property float {name}\n")).collect();
    let comment =
        if splats.compensated { format!("comment {COMPENSATED}\n") } else { String::new() };
    let count = splats.gaussians.len();
    format!(
        "ply\nformat binary_little_endian 1.0\n{comment}element vertex {count}\n{properties}end_header\n"
    )
}
