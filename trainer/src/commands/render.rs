//! `dermis render`.

use std::path::{Path, PathBuf};

use anyhow::Result;
use dermis_runtime::{Avatar, Pose};
use dermis_trainer::camera_file::{self, Shot};
use dermis_trainer::draw::{Milliseconds, draw_timed};
use dermis_trainer::eval::reference::draw_reference;
use dermis_trainer::orbit::Orbit;
use dermis_trainer::output;
use serde::Serialize;

use super::options::{Detail, Posing, Size};
use crate::Common;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// An avatar.
    file: PathBuf,
    /// The PNG to write.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// A camera file; otherwise the camera circles the avatar.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["yaw", "pitch", "distance", "size", "background"])]
    camera: Option<PathBuf>,
    /// Degrees around the avatar; 0 looks at its front.
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true, value_name = "DEGREES", value_parser = super::finite)]
    yaw: f32,
    /// Degrees above the horizon.
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true, value_name = "DEGREES", value_parser = super::finite)]
    pitch: f32,
    /// Metres from the middle of the avatar [default: all of it is seen].
    #[arg(long, value_name = "METRES", value_parser = super::positive)]
    distance: Option<f32>,
    /// Pixels.
    #[arg(long, default_value = "540x540", value_name = "WxH")]
    size: Size,
    /// Behind the avatar, 0 to 1.
    #[arg(long, default_value = "1,1,1", value_name = "R,G,B", value_parser = super::color)]
    background: [f32; 3],
    #[command(flatten)]
    posing: Posing,
    #[command(flatten)]
    detail: Detail,
    /// Which arithmetic draws.
    #[arg(long, value_enum, default_value_t = Kernel::Simd)]
    kernel: Kernel,
}

/// Which arithmetic draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Kernel {
    /// The runtime's specification.
    Scalar,
    /// Vectors as wide as this CPU has them; the same picture.
    Simd,
    /// f64, with the runtime's discrete decisions.
    Reference,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    gaussians_selected: u32,
    gaussians_visible: u32,
    blends: u64,
    scratch_bytes: usize,
    level: f32,
    /// Of the runtime; the reference is not timed.
    #[serde(skip_serializing_if = "Option::is_none")]
    ms: Option<Milliseconds>,
    frame_crc32: u32,
}

pub(crate) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let is_png = arguments.output.extension().is_some_and(|name| name.eq_ignore_ascii_case("png"));
    if !is_png {
        super::misuse("--output: a picture is a PNG; give it a name that ends in .png");
    }
    let read: Vec<&Path> =
        [&arguments.file].into_iter().chain(&arguments.camera).map(PathBuf::as_path).collect();
    let output = output::Output::create(&arguments.output, &read)?;
    let (report, png) = super::with_avatar(&arguments.file, |avatar| picture(avatar, arguments))?;
    output.finish(&png)?;
    super::print(common, &report, |r| {
        let time = r.ms.map_or(String::new(), |ms| format!(", {:.2} ms on one thread", ms.total));
        format!(
            "{} of {} Gaussians seen, {} blends, level {:.2}{time}\n",
            r.gaussians_visible, r.gaussians_selected, r.blends, r.level
        )
    })
}

fn picture(avatar: &Avatar<'_>, arguments: &Arguments) -> Result<(Report, Vec<u8>)> {
    let pose = arguments.posing.pose(avatar)?;
    let shot = shot(avatar, &pose, arguments)?;
    let plan = || arguments.detail.plan(avatar);
    let kernel = match arguments.kernel {
        Kernel::Scalar => dermis_runtime::Kernel::Scalar,
        Kernel::Simd | Kernel::Reference => dermis_runtime::Kernel::detect(),
    };
    let (mut drawn, plan, ms) =
        draw_timed(avatar, &pose, plan, kernel, &shot.camera, shot.background)?;
    if arguments.kernel == Kernel::Reference {
        let exact = draw_reference(avatar, &pose, &plan, &shot.camera, shot.background)?;
        let byte = |x: f64| (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
        drawn.rgba =
            exact.iter().flat_map(|rgb| [byte(rgb[0]), byte(rgb[1]), byte(rgb[2]), 255]).collect();
    }
    let report = Report {
        gaussians_selected: drawn.statistics.gaussians_selected,
        gaussians_visible: drawn.statistics.gaussians_visible,
        blends: drawn.statistics.counts.blends,
        scratch_bytes: drawn.scratch_bytes,
        level: plan.level(avatar),
        ms: (arguments.kernel != Kernel::Reference).then_some(ms),
        frame_crc32: crc32fast::hash(&drawn.rgba),
    };
    Ok((report, output::png(&drawn.rgba, shot.camera.width, shot.camera.height)?))
}

fn shot(avatar: &Avatar<'_>, pose: &Pose<'_>, arguments: &Arguments) -> Result<Shot> {
    if let Some(path) = &arguments.camera {
        return camera_file::read(path);
    }
    let Size(width, height) = arguments.size;
    let &Arguments { yaw, pitch, distance, .. } = arguments;
    let camera = Orbit { yaw, pitch, distance }.camera(avatar, pose, width, height)?;
    Ok(Shot { camera, background: arguments.background })
}
