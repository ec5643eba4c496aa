//! What each approximation saves, and what it costs: all are switched to their exact form one at a time.
//!
//! The runtime has no such switches. A plain rasterizer over its public formulas has them (`splats`
//! projects, with the runtime's functions or `libm`'s; `pixels` blends): unchanged it gives the runtime's picture bit for bit, and times are
//! held against itself unchanged, not against the runtime.

mod libm;
mod pixels;
mod splats;

use anyhow::Result;
use dermis_runtime::raster::Counts;
use dermis_runtime::{Kernel, Plan, Posed};
use serde::Serialize;

use self::libm::Libm;
use super::clock::{Clock, median};
use super::error::unrounded_errors;
use super::stages::Scene;
use crate::convert::Splats;
use splats::From;

/// Gaussians before they were quantized, in any order.
pub type Source = Splats;

/// Which approximations give way to their exact form.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Exact {
    /// 2ᵖ by libm in place of a polynomial.
    pub exponential: bool,
    /// 2ˣ, log₂, sine and cosine of the front end by libm.
    pub functions: bool,
    /// A pixel never stops.
    pub stop: bool,
    /// No alpha is too small down to 2⁻²⁴, which no f32 near 1 can tell from 0.
    pub skip: bool,
    /// Gaussians on triangles that face away are drawn, too.
    pub back_faces: bool,
    /// Gaussians as they were before they were quantized.
    pub quantized: bool,
}

impl Exact {
    /// The runtime's own way.
    pub const NONE: Self = Self {
        exponential: false,
        functions: false,
        stop: false,
        skip: false,
        back_faces: false,
        quantized: false,
    };
}

/// One size and budget.
#[derive(Debug, Serialize)]
pub struct Approximations {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Greatest number of Gaussians.
    pub budget: u32,
    /// What time is measured with.
    pub clock: Clock,
    /// The plain rasterizer unchanged: splats, lists and pixels, without the pose.
    pub ms: f64,
    /// Its pixels alone.
    pub raster_ms: f64,
    /// Each approximation.
    pub rows: Vec<Approximation>,
    /// What is not in `rows`.
    pub left_out: Vec<LeftOut>,
}

/// What an approximation saves and costs.
#[derive(Debug, Serialize)]
pub struct Approximation {
    /// Its name.
    pub name: &'static str,
    /// What stands in its place here.
    pub exact_form: &'static str,
    /// With the exact form; medians.
    pub ms: f64,
    /// The pixels alone.
    pub raster_ms: f64,
    /// What the approximation saves: median of frames in turn.
    pub saved_ms: f64,
    /// Gaussians blended into pixels with the exact form.
    pub blends: u64,
    /// Greatest difference of the pictures before rounding, in 1/255.
    pub max_error_unrounded_8bit: f64,
    /// Its root mean square.
    pub rms_error_unrounded_8bit: f64,
}

/// An approximation that cannot be switched off, or is none.
#[derive(Debug, Serialize)]
pub struct LeftOut {
    /// Its name.
    pub name: &'static str,
    /// Why.
    pub reason: &'static str,
}

/// A frame of the plain rasterizer.
struct Drawn {
    picture: Vec<[f32; 3]>,
    counts: Counts,
    ms: f64,
    raster_ms: f64,
}

/// What is switched, and what it is called.
struct Variant {
    name: &'static str,
    exact_form: &'static str,
    exact: Exact,
    ms: Vec<f64>,
    raster_ms: Vec<f64>,
    saved_ms: Vec<f64>,
}

/// Measures all of them on one scene, in rounds.
///
/// # Errors
///
/// Where the runtime refuses the pose.
pub fn measure(scene: &Scene<'_>, source: Option<&Source>, runs: u32) -> Result<Approximations> {
    let mut posing = vec![0; Posed::scratch_len(scene.avatar)];
    let posed = Posed::new(scene.avatar, scene.pose, Kernel::Scalar, &mut posing)?;
    let plan = scene.plan();
    let (mut variants, left_out) = variants(scene, &plan, source);
    let draw = |exact: Exact| frame(scene, &posed, &plan, source, exact);
    let unchanged = draw(Exact::NONE)?;
    let pictures = variants.iter().map(|v| draw(v.exact)).collect::<Result<Vec<_>>>()?;
    let (mut ms, mut raster_ms) = (Vec::new(), Vec::new());
    for _ in 0..runs {
        let unchanged = draw(Exact::NONE)?;
        ms.push(unchanged.ms);
        raster_ms.push(unchanged.raster_ms);
        for variant in &mut variants {
            let drawn = draw(variant.exact)?;
            variant.ms.push(drawn.ms);
            variant.raster_ms.push(drawn.raster_ms);
            variant.saved_ms.push(drawn.ms - unchanged.ms);
        }
    }
    let values = |drawn: &Drawn| -> Vec<f64> {
        drawn.picture.as_flattened().iter().map(|&x| f64::from(x)).collect()
    };
    let rows = variants.into_iter().zip(&pictures).map(|(variant, exact)| {
        let (greatest, rms) =
            unrounded_errors(values(&unchanged).into_iter(), values(exact).into_iter());
        Approximation {
            name: variant.name,
            exact_form: variant.exact_form,
            ms: median(variant.ms),
            raster_ms: median(variant.raster_ms),
            saved_ms: median(variant.saved_ms),
            blends: exact.counts.blends,
            max_error_unrounded_8bit: greatest,
            rms_error_unrounded_8bit: rms,
        }
    });
    Ok(Approximations {
        width: scene.shot.camera.width,
        height: scene.shot.camera.height,
        budget: scene.budget,
        clock: Clock::ONE_THREAD,
        ms: median(ms),
        raster_ms: median(raster_ms),
        rows: rows.collect(),
        left_out,
    })
}

/// Those that can be switched on this scene, and why the others cannot.
fn variants(
    scene: &Scene<'_>,
    plan: &Plan,
    source: Option<&Source>,
) -> (Vec<Variant>, Vec<LeftOut>) {
    let header = scene.avatar.header();
    let exact = Exact::NONE;
    let mut left_out = Vec::new();
    let mut without = |name, reason| left_out.push(LeftOut { name, reason });
    without(
        "depth key",
        "none: the key is all bits of the f32 depth; ties of f32 show in own_decisions",
    );
    without("incremental exponential", "none: each pixel's exponent is computed by itself");
    let mut switched = vec![
        ("polynomial of pixels", "libm's exp2f", Exact { exponential: true, ..exact }),
        ("polynomials of the front end", "libm's functions", Exact { functions: true, ..exact }),
        ("stop at T < 1e-4", "no stop", Exact { stop: true, ..exact }),
        ("skip of alpha < 1/255", "down to 2^-24", Exact { skip: true, ..exact }),
    ];
    if header.triangles > 0 {
        let exact = Exact { back_faces: true, ..exact };
        switched.push(("culling of back faces", "all triangles", exact));
    } else {
        without("culling of back faces", "nothing is culled: the avatar has no mesh");
    }
    let whole = plan.gaussians() == header.gaussians;
    match source {
        Some(source) if whole && source.degree == 0 => {
            switched.push(("quantized Gaussians", "f32", Exact { quantized: true, ..exact }));
        }
        Some(_) => without(
            "quantized Gaussians",
            "their source is known for all Gaussians of one colour only, not for a part",
        ),
        None => without("quantized Gaussians", "a file does not hold what they were before"),
    }
    let all = switched.iter().fold(exact, |all, (_, _, one)| Exact {
        exponential: all.exponential | one.exponential,
        functions: all.functions | one.functions,
        stop: all.stop | one.stop,
        skip: all.skip | one.skip,
        back_faces: all.back_faces | one.back_faces,
        quantized: all.quantized | one.quantized,
    });
    switched.push(("all of these", "each exact", all));
    let variants = switched.into_iter().map(|(name, exact_form, exact)| Variant {
        name,
        exact_form,
        exact,
        ms: Vec::new(),
        raster_ms: Vec::new(),
        saved_ms: Vec::new(),
    });
    (variants.collect(), left_out)
}

/// Draws a frame by the plain rasterizer.
fn frame(
    scene: &Scene<'_>,
    posed: &Posed<'_, '_>,
    plan: &Plan,
    source: Option<&Source>,
    exact: Exact,
) -> Result<Drawn> {
    let camera = scene.shot.camera;
    let from = match source {
        Some(source) if exact.quantized => From::Source(source),
        _ => From::File { plan, back_faces: exact.back_faces },
    };
    let clock = Clock::ONE_THREAD;
    let splats = if exact.functions { splats::splats::<Libm> } else { splats::splats::<f32> };
    let (splats, project) =
        clock.time(|| Ok::<_, anyhow::Error>(splats(posed, &camera, from, exact.skip)))?;
    let (lists, sort) = clock.time(|| Ok::<_, anyhow::Error>(splats::lists(&camera, &splats)))?;
    let background = scene.shot.background;
    let ((picture, counts), raster_ms) = clock.time(|| {
        Ok::<_, anyhow::Error>(pixels::draw(&camera, &splats, &lists, background, exact))
    })?;
    Ok(Drawn { picture, counts, ms: project + sort + raster_ms, raster_ms })
}

#[cfg(test)]
mod tests;
