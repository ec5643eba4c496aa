//! The reference with decisions of its own: what the definitions give in exact arithmetic.
//!
//! Culling, order, skip and stop are decided in f64. Where the runtime's f32 decides otherwise (a
//! Gaussian at an alpha of 1/255, two at nearly one depth), the pictures differ by more than rounding.

use anyhow::Result;
use dermis_format::LowPass;
use dermis_runtime::frame::Frame;
use dermis_runtime::harmonics::{color, direction};
use dermis_runtime::project::View;
use dermis_runtime::raster::LEAST_TRANSMITTANCE;
use dermis_runtime::screen::SplatCamera;
use dermis_runtime::select::{Harmonics, Local, Selected, for_each_block, for_each_of_block};
use dermis_runtime::tiles::{TILE, TileGrid};
use dermis_runtime::{Avatar, Camera, Kernel, Plan, Pose, Posed};
use rayon::prelude::*;

use super::{Exact, exact_alpha, exact_frame, exact_splat};
use crate::convert::Splats;

/// The least alpha that touches a pixel.
const LEAST_ALPHA: f64 = 1.0 / 255.0;

/// As [`draw_reference`](super::draw_reference), but nothing is decided by the runtime: it gives the
/// posed vertices and the decoded Gaussians of the plan, no more.
///
/// # Errors
///
/// Where the pose does not fit the avatar.
pub fn draw_own_reference(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    plan: &Plan,
    camera: &Camera,
    background: [f32; 3],
) -> Result<Vec<[f64; 3]>> {
    let mut posing = vec![0; Posed::scratch_len(avatar)];
    let posed = Posed::new(avatar, pose, Kernel::detect(), &mut posing)?;
    Ok(paint(&visible(&posed, plan, camera), camera, background))
}

/// The same of free Gaussians that no file of ours holds, at the numbers that they have: those of an index that
/// `is_shown`, in their order.
pub fn draw_free_reference(
    splats: &Splats,
    is_shown: impl Fn(usize) -> bool,
    low_pass: LowPass,
    camera: &Camera,
    background: [f32; 3],
) -> Vec<[f64; 3]> {
    let screen = SplatCamera::<f64> { view: View::new(camera), low_pass };
    let shown = splats.gaussians.iter().enumerate().filter(|(index, _)| is_shown(*index));
    let exact = shown.filter_map(|(index, full)| {
        let selected = Selected { gaussian: Local::Full(*full), harmonics: Harmonics::default() };
        let mut splat = exact_splat(&screen, &selected, &Frame::world())?;
        let coefficients = splats.harmonics.get(index).map_or(&[][..], Vec::as_slice);
        let coefficients = coefficients.as_chunks::<3>().0.iter().map(|rgb| rgb.map(f64::from));
        let direction = direction(full.position.map(f64::from), screen.view.eye);
        splat.color = color(full.color.map(f64::from), coefficients, direction);
        splat.is_seen.then_some(splat)
    });
    paint(&exact.collect::<Vec<_>>(), camera, background)
}

/// Splats in the order that breaks ties of depth.
fn paint(splats: &[Exact], camera: &Camera, background: [f32; 3]) -> Vec<[f64; 3]> {
    let grid = TileGrid::new(camera.width, camera.height);
    let lists = lists(&grid, splats);
    let background = background.map(f64::from);
    let row_len = camera.width as usize;
    let mut picture = vec![background; row_len * camera.height as usize];
    // A row of tiles after the other, each by a thread of its own.
    let bands = picture.par_chunks_mut(row_len * TILE as usize);
    bands.zip(lists.par_chunks(grid.columns as usize)).enumerate().for_each(
        |(tile_row, (band, lists))| {
            for (index, pixel) in band.iter_mut().enumerate() {
                let (x, y) = (index % row_len, index / row_len);
                let list = &lists[x / TILE as usize];
                let center = [x as f64 + 0.5, (y + tile_row * TILE as usize) as f64 + 0.5];
                *pixel = blended(list, center, background);
            }
        },
    );
    picture
}

/// The Gaussians of the plan that can be seen, in the order of the file.
fn visible(posed: &Posed<'_, '_>, plan: &Plan, camera: &Camera) -> Vec<Exact> {
    let avatar = posed.avatar();
    let low_pass = avatar.header().low_pass;
    let screen = SplatCamera::<f64> { view: View::new(camera), low_pass };
    let mut splats = Vec::new();
    let frame_of = |triangle: Option<u32>| {
        triangle.map_or(Some(Frame::world()), |triangle| exact_frame(posed, triangle))
    };
    let shows = |triangle| {
        let kind = avatar.header().frame;
        let two_sided = avatar.is_two_sided(triangle as usize);
        frame_of(Some(triangle)).is_some_and(|frame| frame.shows(kind, two_sided, screen.view.eye))
    };
    for_each_block(avatar, plan, |block, region, drawn| {
        for_each_of_block(block, region, drawn, shows, |place| {
            let Some((selected, frame)) = place.decode().zip(frame_of(place.triangle)) else {
                return;
            };
            let splat = exact_splat(&screen, &selected, &frame);
            splats.extend(splat.filter(|splat| splat.is_seen));
        });
    });
    splats
}

/// The splats that each tile's pixels may see, front to back, ties as they stand.
fn lists(grid: &TileGrid, splats: &[Exact]) -> Vec<Vec<Exact>> {
    let mut order: Vec<&Exact> = splats.iter().collect();
    order.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    let mut lists = vec![Vec::new(); grid.tiles()];
    for splat in order {
        let bounds = splat.bounds.map(|edge| edge as u32);
        grid.for_each_tile(bounds, |tile| lists[tile as usize].push(*splat));
    }
    lists
}

/// A pixel's colour.
fn blended(list: &[Exact], [px, py]: [f64; 2], background: [f64; 3]) -> [f64; 3] {
    let (mut color, mut transmittance) = ([0.0; 3], 1.0);
    for splat in list {
        if transmittance < f64::from(LEAST_TRANSMITTANCE) {
            break;
        }
        let [x0, y0, x1, y1] = splat.bounds;
        if px < x0 || px > x1 || py < y0 || py > y1 {
            continue;
        }
        let alpha = exact_alpha(splat, px, py);
        if alpha < LEAST_ALPHA {
            continue;
        }
        let weight = transmittance * alpha;
        color.iter_mut().zip(splat.color).for_each(|(sum, c)| *sum += weight * c);
        transmittance -= weight;
    }
    std::array::from_fn(|i| color[i] + transmittance * background[i])
}
