//! What the regions of an avatar cover of a picture: what a plan for several avatars weighs.
//!
//! A triangle of area A with unit normal n, whose centre the camera sees along v at depth z, covers
//!
//! ```text
//! fₓ f_y A |n · v| / z³  px²
//! ```
//!
//! for it is as small as the solid angle that it takes. That is exact for a triangle that is small beside its depth, and ends
//! at the whole frame for one that is not.

use dermis_format::header::MAX_REGIONS;
use dermis_format::{Avatar, FrameKind};

use crate::camera::Camera;
use crate::extent::Extent;
use crate::frame::Frame;
use crate::frames::FrameBlock;
use crate::frustum::Frustum;
use crate::kernel::Work;
use crate::lanes::{Lanes, MAX_LANES};
use crate::math::{Real, dot, sub};
use crate::plan::Plan;
use crate::posed::Posed;
use crate::project::{NEAR, View};

/// A region on the screen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Footprint {
    /// Pixels that its triangles cover which show something, each as if it were alone: px². 0 where none does.
    pub area: f32,
    /// Pixels to a metre: the root of the mean square over that area.
    pub density: f32,
    /// The middle of that area, px.
    pub center: [f32; 2],
}

/// Of each region.
pub type Footprints = heapless::Vec<Footprint, MAX_REGIONS>;

impl Posed<'_, '_> {
    /// What each region covers of a camera's picture. A region of which nothing can be seen, as it is out of the frame or
    /// looks away, covers nothing. Costs a look at every triangle: 3 ns each with vectors of 8.
    pub fn footprints(&self, camera: &Camera) -> Footprints {
        let view = View::new(camera);
        let regions = usize::from(self.avatar().header().regions);
        let mut sums = [Sums::default(); MAX_REGIONS];
        if self.avatar().header().triangles == 0 {
            let all = of_box(self.avatar(), &view);
            return sums.iter().take(regions).map(|_| all).collect();
        }
        self.add_footprints(&view, widest_extent(self.avatar()), &mut sums);
        sums.iter().take(regions).map(|sums| sums.footprint(&view)).collect()
    }
}

/// How far Gaussians reach at the first level, where they are widest, and at the last.
fn widest_extent(avatar: &Avatar<'_>) -> Extent {
    let [first, last] =
        [0.0, f32::from(avatar.header().layers)].map(|level| Plan::at_level(avatar, level));
    let [first, last] = [first, last].map(|plan| Extent::of_plan(avatar, &plan));
    Extent { offset: first.offset.at_least(last.offset), sigma: first.sigma.at_least(last.sigma) }
}

/// Sums over a region's triangles, each weighted by the pixels that it covers.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sums {
    area: f32,
    square_density: f32,
    /// In camera axes.
    center: [f32; 3],
}

impl Sums {
    fn add(&mut self, area: f32, square_density: f32, center: [f32; 3]) {
        self.area += area;
        self.square_density += area * square_density;
        self.center.iter_mut().zip(center).for_each(|(sum, x)| *sum += area * x);
    }

    fn footprint(&self, view: &View<f32>) -> Footprint {
        let Self { area, square_density, center: [x, y, z] } = *self;
        if !(area > 0.0) || !area.is_finite() || !square_density.is_finite() {
            return Footprint::default();
        }
        let ([fx, fy], [cx, cy]) = (view.focal(), view.center());
        Footprint {
            area,
            density: (square_density / area).sqrt(),
            center: [cx + fx * x / z, cy + fy * y / z],
        }
    }
}

/// The bounding box of a cloud that stands on no mesh: the pixels of the rectangle that holds it, all regions alike.
fn of_box(avatar: &Avatar<'_>, view: &View<f32>) -> Footprint {
    let (low, high) = (avatar.header().box_min, avatar.header().box_max);
    let middle: [f32; 3] = core::array::from_fn(|i| 0.5 * (low[i] + high[i]));
    let [_, _, depth] = view.point(middle);
    let ([fx, fy], [cx, cy], [width, height]) = (view.focal(), view.center(), view.size());
    let (mut least, mut greatest) = ([f32::MAX; 2], [f32::MIN; 2]);
    for corner in 0..8 {
        let pick = |i: usize| if corner >> i & 1 == 0 { low[i] } else { high[i] };
        let [x, y, z] = view.point([pick(0), pick(1), pick(2)]);
        let z = z.at_least(NEAR);
        for (i, at) in [cx + fx * x / z, cy + fy * y / z].into_iter().enumerate() {
            least[i] = least[i].at_most(at);
            greatest[i] = greatest[i].at_least(at);
        }
    }
    let side =
        |i: usize, size: f32| (greatest[i].at_most(size) - least[i].at_least(0.0)).at_least(0.0);
    let area = side(0, width) * side(1, height);
    let depth = depth.at_least(NEAR);
    Footprint {
        area: if area.is_finite() { area } else { 0.0 },
        density: (fx * fy).abs().sqrt() / depth,
        center: core::array::from_fn(|i| 0.5 * (least[i] + greatest[i])),
    }
}

/// What a triangle covers.
#[derive(Clone, Copy, Debug)]
pub struct Covered<R> {
    /// Pixels, px²; negative where it looks away.
    pub area: R,
    /// Its middle in camera axes, no nearer than [`NEAR`].
    pub center: [R; 3],
}

/// What the triangle of a frame covers of a picture, its sides apart: fₓ f_y A n · v / z³.
#[inline(always)]
pub fn covered<R: Real>(frame: &Frame<R>, kind: FrameKind, view: &View<R>) -> Covered<R> {
    let normal = frame.normal(kind);
    // A frame's size is the root of the area, but for Edge: there of an equilateral triangle 1.07 sides' mean, which
    // makes twice the area.
    let size = dot(normal, normal).sqrt();
    let towards = dot(normal, sub(view.eye, frame.origin));
    let [x, y, z] = view.point(frame.origin);
    let z = z.at_least(z.like(NEAR));
    let [fx, fy] = view.focal();
    let share = z.like(if kind == FrameKind::Edge { 0.5 } else { 1.0 });
    let area = (fx * fy).abs() * share * size * towards / (z * z * z);
    Covered { area, center: [x, y, z] }
}

/// Adds up what the triangles cover that show something.
pub(crate) struct AddFootprints<'s, 'a> {
    pub(crate) avatar: &'s Avatar<'a>,
    pub(crate) blocks: &'s [FrameBlock],
    pub(crate) view: &'s View<f32>,
    pub(crate) extent: Extent,
    pub(crate) sums: &'s mut [Sums; MAX_REGIONS],
}

impl Work for AddFootprints<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self, token: V::Token) {
        let Self { avatar, blocks, view, extent, sums } = self;
        let kind = avatar.header().frame;
        let frustum = Frustum::of(view).map(
            #[inline(always)]
            |x| V::splat(token, x),
        );
        let vectors = view.map(
            #[inline(always)]
            |x| V::splat(token, x),
        );
        let (offset, sigma) = (V::splat(token, extent.offset), V::splat(token, extent.sigma));
        let [fx, fy] = view.focal();
        let square_focal = (fx * fy).abs();
        let [width, height] = view.size();
        // Of one triangle after the other, so that sums do not depend on the lanes.
        let mut numbers = [[0.0; MAX_LANES]; 4];
        for (block, index) in blocks.iter().zip(0..) {
            let mut exist = 0;
            let mut at = 0;
            while at < MAX_LANES {
                let (frame, exists) = block.load::<V>(token, at);
                let reach = frame.reach(kind);
                let misses = frustum.misses(frame.origin, reach * offset, reach * sigma);
                let Covered { area, center: [x, y, z] } = covered(&frame, kind, &vectors);
                exist |= (V::bits(exists) & !V::bits(misses)) << at;
                for (to, number) in numbers.iter_mut().zip([area, x, y, z]) {
                    number.store(to.get_mut(at..at + V::LEN).unwrap_or(&mut []));
                }
                at += V::LEN;
            }
            let two_sided = u32::from(avatar.two_sided_of_sixteen(index));
            let [areas, xs, ys, zs] = &numbers;
            for lane in 0..MAX_LANES {
                let towards = areas[lane];
                let shows = exist >> lane & 1 == 1 && (towards > 0.0 || two_sided >> lane & 1 == 1);
                if !shows {
                    continue;
                }
                let region = avatar.triangle_region(MAX_LANES * index + lane);
                if let Some(sums) = sums.get_mut(usize::from(region)) {
                    let area = towards.abs().at_most(width * height);
                    let z = zs[lane];
                    sums.add(area, square_focal / (z * z), [xs[lane], ys[lane], z]);
                }
            }
        }
    }
}
