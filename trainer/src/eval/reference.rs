//! The reference renderer: the runtime's definitions in f64.
//!
//! It starts from the runtime's posed vertices and decoded Gaussians. Discrete decisions (what is
//! culled, in which order splats stand, which pixels skip a splat, which are finished) are the
//! runtime's own f32 ones, so that the difference is rounding and nothing else. [`draw_own_reference`]
//! decides all of it by itself, and so does [`draw_free_reference`], of Gaussians that are in no file of ours.

mod own;

use anyhow::{Result, ensure};
use dermis_format::FrameKind;
use dermis_runtime::batch::OnScreen;
use dermis_runtime::frame::Frame;
use dermis_runtime::lists::Pair;
use dermis_runtime::math::Real;
use dermis_runtime::project::{Splat, View, footprint};
use dermis_runtime::raster::{
    CLEAR, GREATEST_ALPHA, LEAST_TRANSMITTANCE, alpha, blend, log2_alpha,
};
use dermis_runtime::screen::SplatCamera;
use dermis_runtime::select::{Selected, for_each_block, for_each_of_block};
use dermis_runtime::tiles::TileGrid;
use dermis_runtime::{Avatar, Camera, Kernel, Plan, Pose, Posed, Prepared};

pub use own::{draw_free_reference, draw_own_reference};

/// A splat in f64.
#[derive(Clone, Copy, Debug)]
struct Exact {
    mean: [f64; 2],
    falloff: [f64; 3],
    log2_opacity: f64,
    color: [f64; 3],
    /// z in camera axes, metres.
    depth: f64,
    /// Pixels that it may touch: first column and row, then one past the last ones.
    bounds: [f64; 4],
    /// Whether it touches any.
    is_seen: bool,
}

/// Pixels of a frame at most: in f64 they take 400 MB.
const MOST_PIXELS: u64 = 1 << 24;

/// Draws one frame over `background`: (r, g, b) of each pixel, row-major, not rounded.
pub fn draw_reference(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    plan: &Plan,
    camera: &Camera,
    background: [f32; 3],
) -> Result<Vec<[f64; 3]>> {
    let (width, height) = (camera.width, camera.height);
    ensure!(
        u64::from(width) * u64::from(height) <= MOST_PIXELS,
        "{width}×{height} pixels are too many for the f64 reference; choose 4096×4096 at most"
    );
    let budget = plan.gaussians();
    let mut posing = vec![0; Posed::scratch_len(avatar)];
    let mut preparing = vec![0; Prepared::scratch_len(avatar, budget, width, height)];
    let mut drawing = vec![0; Prepared::band_scratch_len(budget, width, height)];
    let posed = Posed::new(avatar, pose, Kernel::detect(), &mut posing)?;
    let prepared = Prepared::new(&posed, plan, camera, &mut preparing)?;
    let exact = exact_splats(&posed, plan, camera);
    ensure!(
        exact.len() == prepared.splats().len(),
        "the reference sees {} splats but the runtime draws {}; this is a fault of the program",
        exact.len(),
        prepared.splats().len()
    );
    let grid = TileGrid::new(width, height);
    let background = background.map(f64::from);
    let mut picture = vec![background; width as usize * height as usize];
    prepared.for_each_tile(0..prepared.tile_rows(), &mut drawing, |tile, order, _| {
        draw_tile(&grid, tile, prepared.splats(), &exact, order, background, &mut picture);
    })?;
    Ok(picture)
}

/// One for each splat that the runtime draws, in the same order.
fn exact_splats(posed: &Posed<'_, '_>, plan: &Plan, camera: &Camera) -> Vec<Exact> {
    let low_pass = posed.avatar().header().low_pass;
    let screen = SplatCamera { view: View::new(camera), low_pass };
    let exact_screen = SplatCamera::<f64> { view: View::new(camera), low_pass };
    let mut exact = Vec::new();
    let shows = |triangle| posed.shows(triangle, screen.view.eye);
    for_each_block(posed.avatar(), plan, |block, region, drawn| {
        for_each_of_block(block, region, drawn, shows, |place| {
            let frame = place.triangle.map_or(Some(Frame::world()), |t| posed.frame(t));
            let Some((selected, frame)) = place.decode().zip(frame) else { return };
            if screen.splat(&selected, &frame).is_some() {
                let frame = place.triangle.and_then(|triangle| exact_frame(posed, triangle));
                let frame = frame.unwrap_or_else(Frame::world);
                let splat = exact_splat(&exact_screen, &selected, &frame);
                exact.push(splat.unwrap_or(Exact::INVISIBLE));
            }
        });
    });
    exact
}

impl Exact {
    /// Adds nothing to any pixel.
    const INVISIBLE: Self = Self {
        mean: [0.0; 2],
        falloff: [0.0; 3],
        log2_opacity: f64::NEG_INFINITY,
        color: [0.0; 3],
        depth: 0.0,
        bounds: [0.0; 4],
        is_seen: false,
    };
}

/// None where the triangle has no frame.
pub(crate) fn exact_frame(posed: &Posed<'_, '_>, triangle: u32) -> Option<Frame<f64>> {
    let corner = |vertex: u32| posed.vertices()[vertex as usize].map(f64::from);
    let kind: FrameKind = posed.avatar().header().frame;
    Frame::of_triangle(kind, posed.avatar().triangle(triangle as usize).map(corner))
}

/// None where it cannot be drawn.
fn exact_splat(
    screen: &SplatCamera<f64>,
    selected: &Selected<'_>,
    frame: &Frame<f64>,
) -> Option<Exact> {
    let OnScreen { projected: p, drawable, opacity, color } = screen.on_screen(selected, frame);
    let (footprint, is_seen) = footprint(&screen.view, &p, opacity);
    drawable.then_some(Exact {
        mean: p.mean,
        falloff: p.falloff,
        log2_opacity: footprint.log2_opacity,
        color,
        depth: p.depth,
        bounds: footprint.bounds,
        is_seen,
    })
}

fn draw_tile(
    grid: &TileGrid,
    tile: u32,
    splats: &[Splat],
    exact: &[Exact],
    order: &[Pair],
    background: [f64; 3],
    picture: &mut [[f64; 3]],
) {
    let [columns, rows] = grid.pixels(tile);
    for y in rows {
        for x in columns.clone() {
            // The runtime's own pixel decides; the exact one follows.
            let mut decided = CLEAR;
            let (mut color, mut transmittance) = ([0.0; 3], 1.0);
            for pair in order {
                if decided[3] < LEAST_TRANSMITTANCE {
                    break;
                }
                let (splat, exact) = (&splats[pair.splat as usize], &exact[pair.splat as usize]);
                if !touches(splat, x, y) {
                    continue;
                }
                let (px, py) = (x as f32 + 0.5, y as f32 + 0.5);
                let exponent = log2_alpha(splat, px - splat.mean[0], py - splat.mean[1]);
                let (rounded, touches) = alpha(exponent);
                if !touches {
                    continue;
                }
                decided = blend(decided, rounded, splat.color);
                let weight = transmittance * exact_alpha(exact, f64::from(px), f64::from(py));
                color.iter_mut().zip(exact.color).for_each(|(sum, c)| *sum += weight * c);
                transmittance -= weight;
            }
            let over = core::array::from_fn(|i| color[i] + transmittance * background[i]);
            picture[(y * grid.width + x) as usize] = over;
        }
    }
}

fn touches(splat: &Splat, x: u32, y: u32) -> bool {
    let [x0, y0, x1, y1] = splat.bounds.map(u32::from);
    (x0..x1).contains(&x) && (y0..y1).contains(&y)
}

fn exact_alpha(splat: &Exact, px: f64, py: f64) -> f64 {
    let (dx, dy) = (px - splat.mean[0], py - splat.mean[1]);
    let [a, b, c] = splat.falloff;
    let (u, v) = (a * dx + b * dy, c * dy);
    let exponent = splat.log2_opacity - v * v - u * u;
    exponent.at_most(0.0).exp2().at_most(f64::from(GREATEST_ALPHA))
}
