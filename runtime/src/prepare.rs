//! A frame before its pixels: the splats of a plan, and how many each tile will draw.

use dermis_format::{Avatar, LowPass};

use crate::camera::Camera;
use crate::error::Error;
use crate::frame::Frame;
use crate::gaussian::{Ellipsoid, disc_on, full_on};
use crate::harmonics;
use crate::math::{dot, scale, sub};
use crate::plan::Plan;
use crate::posed::Posed;
use crate::project::{Splat, View, project};
use crate::scratch::{Scratch, words};
use crate::select::{self, Harmonics, Local, Selected};
use crate::tiles::{TileGrid, count_tiles};

/// Greatest width and height of a frame, px.
pub const MAX_SIZE: u32 = 16_384;

/// A frame ready to be drawn, band by band, by any number of threads.
#[derive(Debug)]
pub struct Prepared<'s> {
    pub(crate) splats: &'s [Splat],
    pub(crate) tile_counts: &'s [u32],
    pub(crate) grid: TileGrid,
    selected: u32,
}

impl<'s> Prepared<'s> {
    /// Words of scratch for at most `budget` Gaussians on `width × height` pixels.
    pub fn scratch_len(budget: u32, width: u32, height: u32) -> usize {
        words::<Splat>(budget as usize).saturating_add(TileGrid::new(width, height).tiles())
    }

    /// Projects the Gaussians of `plan` that can be seen. Dropped are: Gaussians on a triangle
    /// that faces away and is not two-sided, or that has no frame; nearer than
    /// [`NEAR`](crate::project::NEAR); off screen; fainter than 1/255 everywhere.
    pub fn new(
        posed: &Posed<'_, '_>,
        plan: &Plan,
        camera: &Camera,
        scratch: &'s mut [u32],
    ) -> Result<Self, Error> {
        let (width, height) = (camera.width, camera.height);
        check(posed.avatar(), plan, camera)?;
        let avatar = posed.avatar();
        let grid = TileGrid::new(width, height);
        let mut scratch =
            Scratch::new(scratch, Self::scratch_len(plan.gaussians(), width, height))?;
        let tile_counts = scratch.take::<u32>(grid.tiles())?;
        let slots = scratch.take::<Splat>(plan.gaussians() as usize)?;
        let camera = SplatCamera {
            view: View::new(camera),
            low_pass: avatar.header().low_pass,
            width,
            height,
        };
        let mut filled = 0;
        for_each_visible(posed, plan, camera.view.eye, |selected, frame| {
            if let (Some(splat), Some(slot)) =
                (camera.splat(selected, frame), slots.get_mut(filled))
            {
                *slot = splat;
                filled += 1;
            }
        });
        let splats: &[Splat] = slots.get(..filled).unwrap_or(&[]);
        count_tiles(&grid, splats, tile_counts);
        Ok(Self { splats, tile_counts, grid, selected: plan.gaussians() })
    }

    /// Splats in the order of the file, which breaks ties of depth.
    pub fn splats(&self) -> &'s [Splat] {
        self.splats
    }

    /// Gaussians of the plan.
    pub fn gaussians_selected(&self) -> u32 {
        self.selected
    }
}

/// Whether a plan is one for this avatar, and the frame has a size that can be drawn.
pub(crate) fn check(avatar: &Avatar<'_>, plan: &Plan, camera: &Camera) -> Result<(), Error> {
    let (width, height) = (camera.width, camera.height);
    if !(1..=MAX_SIZE).contains(&width) || !(1..=MAX_SIZE).contains(&height) {
        return Err(Error::Size { width, height });
    }
    let mut regions = plan.regions().iter().enumerate();
    if plan.regions().len() != usize::from(avatar.header().regions)
        || regions.any(|(index, region)| region.count > avatar.region_len(index))
    {
        return Err(Error::Plan);
    }
    Ok(())
}

/// Calls `visit` with each Gaussian of the plan whose triangle has a frame and can be seen from `eye`.
pub fn for_each_visible<'a>(
    posed: &Posed<'_, 'a>,
    plan: &Plan,
    eye: [f32; 3],
    mut visit: impl FnMut(&Selected<'a>, &Frame<f32>),
) {
    let mut last = None;
    let mut frame = Some(Frame::world());
    select::for_each(posed.avatar(), plan, |selected| {
        // Gaussians of a block stand by triangle, so a frame is looked up once for a run of them.
        if let Some(triangle) = selected.triangle.filter(|_| last != selected.triangle) {
            last = Some(triangle);
            frame = posed.frame(triangle).filter(|frame| posed.shows(triangle, frame, eye));
        }
        if let Some(frame) = &frame {
            visit(&selected, frame);
        }
    });
}

/// What turns a Gaussian on a frame into a splat.
#[derive(Clone, Copy, Debug)]
pub struct SplatCamera {
    /// The camera.
    pub view: View<f32>,
    /// How its low-pass acts.
    pub low_pass: LowPass,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl SplatCamera {
    /// The splat of a Gaussian on its frame; `None` if it touches no pixel.
    #[inline]
    pub fn splat(&self, selected: &Selected<'_>, frame: &Frame<f32>) -> Option<Splat> {
        match &selected.gaussian {
            Local::Disc(disc) => {
                let color = harmonics::not_below_zero(disc.color);
                let ellipsoid = disc_on(frame, disc.position, disc.angle, disc.log2_scale);
                self.pack(&ellipsoid, disc.opacity, color)
            }
            Local::Full(full) => {
                let ellipsoid = full_on(frame, full.position, full.rotation, full.log2_scale);
                let color =
                    view_color(full.color, selected.harmonics, ellipsoid.center, self.view.eye);
                self.pack(&ellipsoid, full.opacity, color)
            }
        }
    }

    /// The splat of a Gaussian in the world.
    #[inline]
    pub fn pack<const N: usize>(
        &self,
        ellipsoid: &Ellipsoid<f32, N>,
        opacity: f32,
        color: [f32; 3],
    ) -> Option<Splat> {
        let projected = project(&self.view, self.low_pass, ellipsoid)?;
        Splat::pack(&projected, opacity, color, self.width, self.height)
    }
}

/// Colour seen from `eye`; harmonics look along the ray from the eye, in world axes.
fn view_color(
    constant: [f32; 3],
    harmonics: Harmonics<'_>,
    center: [f32; 3],
    eye: [f32; 3],
) -> [f32; 3] {
    if harmonics.codes.is_empty() {
        return harmonics::not_below_zero(constant);
    }
    let ray = sub(center, eye);
    let length = libm::sqrtf(dot(ray, ray));
    let direction = if length > 0.0 { scale(ray, 1.0 / length) } else { [0.0; 3] };
    harmonics::color(constant, harmonics, direction)
}
