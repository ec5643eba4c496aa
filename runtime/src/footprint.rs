//! What the regions of an avatar cover of a picture: what a plan for several avatars weighs.
//!
//! A triangle of area A with unit normal n, whose centre the camera sees along v at depth z, covers
//!
//! ```text
//! fₓ f_y A |n · v| / z³  px²
//! ```
//!
//! which is exact where it is small beside its depth, and ends at the whole frame where it is not; a triangle that stands for
//! others (section `SAMP`) counts as many times as the file says. At a border of the frame it is as if that were a square around
//! its middle.

use bytemuck::Zeroable;
use dermis_format::header::MAX_REGIONS;
use dermis_format::{Avatar, FrameKind, Sample};

use crate::camera::Camera;
use crate::extent::Extent;
use crate::frame::Frame;
use crate::frames::{FrameBlock, Frames};
use crate::frustum::{BLUR, Frustum, REACH};
use crate::kernel::Work;
use crate::lanes::{Lanes, MAX_LANES};
use crate::math::{Real, dot, sub};
use crate::plan::{Plan, collected};
use crate::posed::Posed;
use crate::project::{NEAR, View};

/// A region on the screen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Footprint {
    /// Pixels that its triangles cover which show something, each as if it were alone: px². 0 where none does.
    pub area: f32,
    /// The same, each px² weighted by how many Gaussians are blended there, to the mean over the region: by what blends are
    /// foretold. Where the file does not say how they differ (section `SAMP`) it is the area; where it
    /// does, and no triangle that it names stands for one in the frame, 0.
    pub fill: f32,
    /// Pixels to a metre: the root of the mean square over that area.
    pub density: f32,
    /// The middle of that area, px.
    pub center: [f32; 2],
}

impl Footprint {
    fn without_fill(self) -> Self {
        Self { fill: 0.0, ..self }
    }
}

/// Of each region.
pub type Footprints = heapless::Vec<Footprint, MAX_REGIONS>;

impl Posed<'_, '_> {
    /// What each region covers of a camera's picture. A region of which nothing can be seen, as it is out of the frame or
    /// looks away, covers nothing.
    ///
    /// Of an avatar posed by [`Posed::new`] alone: of one that was posed for a plan most triangles may be missing.
    ///
    /// Some triangles are looked at, which stand for the others: those that the file names, which training has chosen. Of a
    /// figure of 3,000 triangles, from 24 places and 1.5 to 6 m, as a whole or as it leaves the frame on any side, areas come out
    /// within 7 % of the whole sum, of either sign. Where the file names none, of a large mesh runs of sixteen triangles, evenly
    /// spread, about 500 triangles a region: that is within 10 % where sizes and slopes change smoothly along the mesh and all of
    /// it is in the frame. Of a region that would be found to cover nothing all are looked at; with how far their Gaussians
    /// reach, too, where the file names none or that finds nothing.
    pub fn footprints(&self, camera: &Camera) -> Footprints {
        let view = View::new(camera);
        let regions = usize::from(self.avatar().header().regions);
        let triangles = self.avatar().mesh_levels().surface();
        if triangles == 0 {
            let all = of_box(self.avatar(), &view);
            return collected((0..regions).map(|_| all));
        }
        let all = |extent: Extent| self.sum_up(&view, extent, 1.0, in_runs(triangles, 1));
        let reaching = || all(widest_extent(self.avatar()));
        let Some(samples) = self.avatar().samples() else {
            let runs = FrameBlock::count(triangles);
            let stride = (runs / RUNS / regions.max(1)).max(1);
            let share = runs.div_ceil(stride) as f32 / runs as f32;
            let some = in_runs(triangles, stride);
            let footprints = self.sum_up(&view, Extent::default(), share, some);
            return completed(footprints, reaching);
        };
        let footprints = self.sum_up(&view, Extent::default(), 1.0, samples.iter());
        let footprints = completed(footprints, || all(Extent::default()));
        // What stands out of the frame, and only reaches into it, blends next to nothing.
        completed(footprints, || collected(reaching().into_iter().map(Footprint::without_fill)))
    }

    /// Footprints by triangles that stand for such a share of what they name.
    fn sum_up(
        &self,
        view: &View<f32>,
        extent: Extent,
        share: f32,
        samples: impl Iterator<Item = Sample>,
    ) -> Footprints {
        let regions = usize::from(self.avatar().header().regions);
        let mut sums = RegionSums::new(regions);
        self.add_footprints(view, extent, samples, &mut sums);
        collected((0..regions).map(|region| sums.footprint(region, share, view)))
    }
}

/// With those of `others` in the place of footprints that cover nothing.
fn completed(mut footprints: Footprints, others: impl FnOnce() -> Footprints) -> Footprints {
    if footprints.iter().any(|footprint| footprint.area == 0.0) {
        let pairs = footprints.iter_mut().zip(others()).filter(|(own, _)| own.area == 0.0);
        pairs.for_each(|(own, other)| *own = other);
    }
    footprints
}

/// Runs of sixteen triangles that are looked at where the file names none, for each region.
const RUNS: usize = 32;

/// The first ones, those of one run of sixteen in every `stride`, each for itself.
fn in_runs(triangles: u32, stride: usize) -> impl Iterator<Item = Sample> {
    let step = stride.max(1) * MAX_LANES;
    let firsts = (0usize..).map(move |run| (run * step) as u32);
    let runs = firsts.take_while(move |&first| first < triangles);
    let itself = |triangle| Sample { triangle, area: 1.0, fill: 1.0 };
    runs.flat_map(move |first| first..triangles.min(first + MAX_LANES as u32)).map(itself)
}

/// How far Gaussians reach at the first level, where they are widest, and at the last.
fn widest_extent(avatar: &Avatar<'_>) -> Extent {
    let [first, last] =
        [0.0, f32::from(avatar.header().layers)].map(|level| Plan::at_level(avatar, level));
    let [first, last] = [first, last].map(|plan| Extent::of_plan(avatar, &plan));
    Extent { offset: first.offset.at_least(last.offset), sigma: first.sigma.at_least(last.sigma) }
}

/// Sums over triangles: px², times square of px / m, times x, y and z in camera axes; px² by which blends are foretold.
type Sums = [f32; SUMS];
const SUMS: usize = 6;

/// Sixteen triangles, and what each stands for.
type Sixteen = [Sample; MAX_LANES];

/// Sums over the triangles of each region, those of each lane apart.
pub(crate) struct RegionSums {
    /// With one region all are its own.
    regions: usize,
    sums: [[[f32; MAX_LANES]; SUMS]; MAX_REGIONS],
}

impl RegionSums {
    fn new(regions: usize) -> Self {
        Self { regions, sums: [[[0.0; MAX_LANES]; SUMS]; MAX_REGIONS] }
    }

    /// Adds the numbers of sixteen triangles.
    #[inline(always)]
    fn add(&mut self, avatar: &Avatar<'_>, of: &Sixteen, numbers: &[[f32; MAX_LANES]; SUMS]) {
        let triangle = |lane: usize| of.get(lane).map_or(0, |sample| sample.triangle as usize);
        let region = |lane: usize| usize::from(avatar.triangle_region(triangle(lane)));
        let together = self.regions == 1 || (1..MAX_LANES).all(|lane| region(lane) == region(0));
        if together {
            if let Some(sums) = self.sums.get_mut(region(0)) {
                for (sums, numbers) in sums.iter_mut().zip(numbers) {
                    sums.iter_mut().zip(numbers).for_each(|(sum, number)| *sum += number);
                }
            }
            return;
        }
        for lane in 0..MAX_LANES {
            if let Some(sums) = self.sums.get_mut(region(lane)) {
                for (sums, numbers) in sums.iter_mut().zip(numbers) {
                    sums[lane] += numbers[lane];
                }
            }
        }
    }

    /// Of a region, if that `share` of its triangles was added.
    fn footprint(&self, region: usize, share: f32, view: &View<f32>) -> Footprint {
        let lanes = self.sums.get(region).copied().unwrap_or_default();
        let [area, square_density, x, y, z, fill]: Sums =
            lanes.map(|lanes| lanes.into_iter().sum());
        let finite = area.is_finite() && fill.is_finite() && square_density.is_finite();
        if !(area > 0.0) || !finite {
            return Footprint::default();
        }
        let ([fx, fy], [cx, cy]) = (view.focal(), view.center());
        Footprint {
            area: area / share,
            fill: fill / share,
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
    let area = if area.is_finite() { area } else { 0.0 };
    let depth = depth.at_least(NEAR);
    Footprint {
        area,
        fill: area,
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
    // A frame's size is the root of the area. Edge's is 0.93 of an equilateral triangle's side: its square is twice the
    // area.
    let size = dot(normal, normal).sqrt();
    let towards = dot(normal, sub(view.eye, frame.origin));
    let [x, y, z] = view.point(frame.origin);
    let z = z.at_least(z.like(NEAR));
    let [fx, fy] = view.focal();
    let share = z.like(if kind == FrameKind::Edge { 0.5 } else { 1.0 });
    let area = (fx * fy).abs() * share * size * towards / (z * z * z);
    Covered { area, center: [x, y, z] }
}

/// Of a square that reaches `around` metres from a point in camera axes, and as far as the low-pass blurs at least, the share
/// in the frame. It stands for triangles that are together as large: what they cover of the frame is found to be too little or too
/// much by 7 % of all that they cover at most, for a figure of 3,000 triangles and 256 samples (`tests/tests/budgets.rs`).
#[inline(always)]
fn share_in_frame<R: Real>(view: &View<R>, [x, y, z]: [R; 3], around: R) -> R {
    let share = |axis: usize, at: R| {
        let (focal, center, size) = (view.focal()[axis], view.center()[axis], view.size()[axis]);
        let middle = focal * at / z + center;
        let half = (focal * around / z).abs().at_least(z.like(BLUR));
        let (start, end) = (middle - half, middle + half);
        let inside = end.at_most(size) - start.at_least(z.like(0.0));
        inside.at_least(z.like(0.0)) / (end - start)
    };
    share(0, x) * share(1, y)
}

/// Adds up what the triangles cover that show something.
pub(crate) struct AddFootprints<'s, 'a, S> {
    pub(crate) avatar: &'s Avatar<'a>,
    pub(crate) frames: Frames<'s>,
    pub(crate) view: &'s View<f32>,
    pub(crate) extent: Extent,
    /// Triangles that are looked at.
    pub(crate) samples: S,
    pub(crate) sums: &'s mut RegionSums,
}

impl<S: Iterator<Item = Sample>> Work for AddFootprints<'_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self, token: V::Token) {
        let Self { avatar, frames, view, extent, mut samples, sums } = self;
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
        let half = V::splat(token, 0.5);
        let deviations = V::splat(token, REACH);
        // Beside the middle of the frame what is nearer or further away stands elsewhere.
        let [u, v] = view.limit();
        let slope = V::splat(token, 1.0 + u.at_least(v));
        let [fx, fy] = view.focal();
        let square_focal = V::splat(token, (fx * fy).abs());
        let focal = V::splat(token, (fx * fy).abs().sqrt());
        let [width, height] = view.size();
        let (zero, whole) = (V::splat(token, 0.0), V::splat(token, width * height));
        loop {
            let mut of = [Sample::default(); MAX_LANES];
            // A triangle without a frame stays one of zeros.
            let mut block = FrameBlock::zeroed();
            let (mut filled, mut two_sided) = (0, 0);
            for (slot, sample) in of.iter_mut().zip(&mut samples) {
                if let Some(rows) = frames.rows(sample.triangle) {
                    block.set_rows(filled, rows);
                }
                let shows_back = avatar.is_two_sided(sample.triangle as usize);
                two_sided |= u32::from(shows_back) << filled;
                *slot = sample;
                filled += 1;
            }
            if filled == 0 {
                return;
            }
            let (areas, fills) = (of.map(|sample| sample.area), of.map(|sample| sample.fill));
            // Each lane of the sixteen has sums of its own, so that they do not depend on how many are added at once.
            let mut numbers = [[0.0; MAX_LANES]; SUMS];
            let mut at = 0;
            while at < MAX_LANES {
                let (frame, exists) = block.load::<V>(token, at);
                let reach = frame.reach(kind);
                let Covered { area, center: center @ [x, y, z] } = covered(&frame, kind, &vectors);
                let back = of_lanes::<V>(token, two_sided >> at);
                let [areas, fills] = [&areas, &fills].map(
                    #[inline(always)]
                    |numbers| V::load(token, numbers.get(at..at + V::LEN).unwrap_or(&[])),
                );
                let own = area.abs().at_most(whole);
                let metres = half * (own * areas).sqrt() * z / focal;
                let misses = frustum.misses(frame.origin, reach * offset + metres, reach * sigma)
                    | frustum.is_behind(frame.origin, reach * offset);
                let shows = exists & !misses & (zero.below(area) | zero.below(back));
                let around = metres + reach * (offset + deviations * sigma) * slope;
                let share = share_in_frame(&vectors, center, around);
                let in_frame = V::select(shows, own * share, zero);
                let (area, fill) = (in_frame * areas, in_frame * fills);
                let square_density = square_focal / (z * z);
                let all = [area, area * square_density, area * x, area * y, area * z, fill];
                for (to, number) in numbers.iter_mut().zip(all) {
                    // Where nothing shows a product may still be no number.
                    let number = V::select(shows, number, zero);
                    number.store(to.get_mut(at..at + V::LEN).unwrap_or(&mut []));
                }
                at += V::LEN;
            }
            sums.add(avatar, &of, &numbers);
        }
    }
}

/// 1 in the lanes whose bit is set, else 0.
#[inline(always)]
fn of_lanes<V: Lanes>(token: V::Token, bits: u32) -> V {
    let lanes: [f32; MAX_LANES] = core::array::from_fn(|lane| (bits >> lane & 1) as f32);
    V::load(token, lanes.get(..V::LEN).unwrap_or(&[]))
}
