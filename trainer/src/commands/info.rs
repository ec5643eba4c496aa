//! `dermis info`.

use std::fmt::Write;
use std::path::PathBuf;

use anyhow::{Context, Result};
use dermis_format::packed;
use dermis_runtime::Avatar;
use dermis_trainer::describe::Info;
use dermis_trainer::output;
use serde::Serialize;

use crate::Common;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// An avatar.
    file: PathBuf,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    /// Of a packed file; what follows is of the avatar in it.
    #[serde(skip_serializing_if = "Option::is_none")]
    packed_bytes: Option<usize>,
    #[serde(flatten)]
    info: Info,
}

pub(crate) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let file = output::read(&arguments.file)?;
    let packed_bytes = packed::is_packed(&file).then_some(file.len());
    let bytes = super::unpacked(&arguments.file, file)?;
    let avatar = Avatar::parse(&bytes).with_context(|| arguments.file.display().to_string())?;
    let info = Info::of(&avatar);
    super::print(common, &Report { packed_bytes, info }, |report| {
        let packed =
            report.packed_bytes.map_or(String::new(), |n| format!("packed in {n} bytes: "));
        packed + &text(&report.info)
    })
}

/// Joints and morph targets whose movement is shown, at most.
const MOVEMENTS: usize = 8;

pub(crate) fn text(info: &Info) -> String {
    let mut out = String::new();
    let mesh = &info.mesh;
    // Writing to a string does not fail.
    let _ = writeln!(
        out,
        "{} bytes, {} Gaussians, {:.2} bytes each",
        info.bytes, info.gaussians, info.bytes_per_gaussian
    );
    let _ = writeln!(
        out,
        "mesh    {} vertices, {} triangles ({} two-sided), {} joints, {} morph targets",
        mesh.vertices, mesh.triangles, mesh.two_sided, mesh.joints, mesh.morph_targets
    );
    for coarser in &mesh.coarser {
        let _ = writeln!(
            out,
            "coarser {} vertices, {} triangles, {} Gaussians",
            coarser.vertices, coarser.triangles, coarser.gaussians
        );
    }
    for (level, layer) in info.layers.iter().enumerate() {
        let bits =
            layer.bits_per_disc.map_or(String::new(), |bits| format!(", {bits} bits a disc"));
        let (gaussians, bytes) = (layer.gaussians, layer.bytes);
        let _ = writeln!(out, "layer   {level}: {gaussians} Gaussians, {bytes} bytes{bits}");
    }
    for region in &info.regions {
        let _ = write!(
            out,
            "region  {}: {} triangles, {} Gaussians",
            region.name, region.triangles, region.gaussians
        );
        if let Some(measured) = region.measured {
            let _ = write!(
                out,
                ", weight {:.2}; {:.3} m/s, {:.1}% of what is seen, {:.1}% of the error",
                region.weight,
                measured.mobility_m_per_s,
                100.0 * measured.visible_share,
                100.0 * measured.residual_share
            );
        }
        out.push('\n');
    }
    if !info.movements.is_empty() {
        let most = info.movements.iter().take(MOVEMENTS).filter(|moved| moved.metres > 0.0);
        let most: Vec<String> =
            most.map(|moved| format!("{} {:.1} cm", moved.name, 100.0 * moved.metres)).collect();
        let still = info.movements.iter().filter(|moved| moved.metres == 0.0).count();
        let others = info.movements.len() - most.len() - still;
        let _ =
            writeln!(out, "moves   {}; {others} more less, {still} not at all", most.join(", "));
    }
    for clip in &info.clips {
        let speed = clip.speed_m_per_s.map_or(String::new(), |speed| format!(", {speed:.1} m/s"));
        let _ = writeln!(out, "clip    {}: {:.2} s{speed}", clip.name, clip.seconds);
    }
    for part in &info.sections {
        let _ =
            writeln!(out, "section {:6} × {:<3} {:>9} bytes", part.name, part.count, part.bytes);
    }
    out
}
