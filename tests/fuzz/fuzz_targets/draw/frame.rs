//! A frame, drawn in every way that there is.

use dermis_fuzz::Parameters;
use dermis_runtime::draw::DEPTH_SCRATCH_LEN;
use dermis_runtime::pose::carried;
use dermis_runtime::{
    Background, Depth, Error, Framebuffer, Kernel, Part, Pixels, Pose, Posed, PosedGaussian,
    Prepared, Sides, Statistics, render, scratch_len,
};

use super::scene::Scene;

/// What was in memory before.
const STALE: u32 = 0x7fc0_1234;

/// Into what a frame is drawn, and how.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    width: usize,
    height: usize,
    /// Of five.
    format: u8,
    padding: usize,
    background: Background,
    has_depth: bool,
    parts: usize,
    bands: u32,
    eye: [f32; 3],
}

/// Memory that a frame was drawn into.
#[derive(Clone, Debug)]
struct Drawn {
    bytes: Vec<u8>,
    numbers: Vec<f32>,
    depths: Vec<f32>,
}

impl Frame {
    pub(crate) fn new(scene: &Scene<'_, '_>, parameters: &mut Parameters<'_>) -> Self {
        let [width, height] = [scene.camera.width, scene.camera.height].map(|side| side as usize);
        let kind = parameters.byte();
        let color = [0; 3].map(|_| {
            let usual = 0.5 + parameters.signed();
            parameters.or_odd(usual)
        });
        Self {
            width,
            height,
            format: kind % 5,
            padding: usize::from(parameters.byte() % 8),
            background: if kind < 128 { Background::Color(color) } else { Background::Existing },
            has_depth: kind % 2 == 1,
            parts: 1 + usize::from(parameters.byte() % 5),
            bands: 1 + u32::from(parameters.byte() % 4),
            eye: [0; 3].map(|_| {
                let usual = 2.0 * parameters.signed();
                parameters.or_odd(usual)
            }),
        }
    }

    /// Draws it by the scalar kernel and by the best one, whole and in bands.
    pub(crate) fn check(&self, scene: &Scene<'_, '_>, pose: &Pose<'_>) {
        let Scene { plan, budget, camera, avatar } = scene;
        assert!(plan.gaussians() <= *budget, "{} of {budget}", plan.gaussians());
        let level = plan.level(avatar);
        assert!((-1.0..16.0).contains(&level), "level {level}");
        let mut expected: Option<(Drawn, Statistics)> = None;
        for kernel in [Kernel::Scalar, Kernel::detect()] {
            let Some((drawn, mut statistics)) = self.render(scene, pose, kernel) else { return };
            drawn.check();
            assert_eq!(statistics.gaussians_selected, plan.gaussians());
            assert!(statistics.gaussians_visible <= plan.gaussians());
            assert!(statistics.counts.evaluations >= statistics.counts.blends);
            // Lanes that a vector has and nothing needs are counted, too.
            statistics.counts.evaluations = 0;
            match &expected {
                Some((scalar, same)) => {
                    assert!(drawn.is(scalar), "{} draws another frame", kernel.name());
                    assert_eq!(&statistics, same);
                }
                None => expected = Some((drawn, statistics)),
            }
        }
        let Some((expected, _)) = expected else { return };
        let mut posing = vec![STALE; Posed::scratch_len(avatar)];
        let posed = Posed::new(avatar, pose, Kernel::detect(), &mut posing).expect("as promised");
        let words = Prepared::scratch_len(avatar, plan.gaussians(), camera.width, camera.height);
        let mut preparing = vec![STALE; words];
        let run = |parts: &mut [Part<'_, '_>]| parts.iter_mut().rev().for_each(Part::project);
        let prepared = Prepared::in_parts(&posed, plan, camera, &mut preparing, self.parts, run);
        let prepared = prepared.expect("as promised");
        let in_bands = self.in_bands(&prepared);
        assert!(in_bands.is(&expected), "bands draw another frame");
        self.check_eyes(scene, pose, &expected);
        self.check_tiles(&prepared);
        self.check_export(scene, &posed);
    }

    /// Posed for the plan alone and seen by two eyes at once, the second one draws the same; what stays still is no panic.
    fn check_eyes(&self, scene: &Scene<'_, '_>, pose: &Pose<'_>, expected: &Drawn) {
        let Scene { plan, camera, avatar, .. } = scene;
        let mut posing = vec![STALE; Posed::scratch_len_for_plan(avatar)];
        let posed = Posed::for_plan(avatar, pose, plan, Kernel::detect(), &mut posing);
        let posed = posed.expect("as promised");
        let words = Prepared::scratch_len(avatar, plan.gaussians(), camera.width, camera.height);
        let (mut left, mut right) = (vec![STALE; words], vec![STALE; words]);
        let run = |parts: &mut [Part<'_, '_, 2>]| parts.iter_mut().rev().for_each(Part::project);
        let (cameras, scratch) = ([camera; 2], [&mut left[..], &mut right[..]]);
        let eyes = Prepared::of_eyes(&posed, plan, cameras, scratch, self.parts, run);
        let [_, right] = eyes.expect("as promised");
        assert!(self.in_bands(&right).is(expected), "a second eye draws another frame");
        for still_below in [self.eye[0], f32::INFINITY] {
            let plan = plan.clone().with_still_below(still_below);
            let mut posing = vec![STALE; Posed::scratch_len_for_plan(avatar)];
            Posed::for_plan(avatar, pose, &plan, Kernel::Scalar, &mut posing).expect("as promised");
        }
        let _ = carried(avatar, pose);
    }

    /// In exactly the memory that is promised, and in a word less. `None` if the pose is none of this avatar.
    fn render(
        &self,
        scene: &Scene<'_, '_>,
        pose: &Pose<'_>,
        kernel: Kernel,
    ) -> Option<(Drawn, Statistics)> {
        let Scene { avatar, plan, camera, .. } = scene;
        let needed = scratch_len(avatar, plan.gaussians(), camera.width, camera.height)
            + if self.has_depth { DEPTH_SCRATCH_LEN } else { 0 };
        let mut scratch = vec![STALE; needed];
        let mut drawn = self.memory();
        let stale = drawn.clone();
        let draw = |scratch: &mut [u32], drawn: &mut Drawn| {
            let mut framebuffer = self.framebuffer(drawn, 0);
            render(avatar, pose, plan, camera, kernel, scratch, &mut framebuffer)
        };
        let missing = Err(Error::Scratch { needed, lent: needed - 1 });
        assert_eq!(draw(&mut scratch[1..], &mut drawn), missing);
        assert!(drawn.is(&stale), "nothing is drawn");
        match draw(&mut scratch, &mut drawn) {
            Ok(statistics) => Some((drawn, statistics)),
            Err(Error::Pose { .. } | Error::Clip { .. }) => None,
            Err(error) => panic!("{error}"),
        }
    }

    fn in_bands(&self, prepared: &Prepared<'_>) -> Drawn {
        let mut drawn = self.memory();
        let words = Prepared::band_scratch_len(
            prepared.gaussians_selected(),
            self.width as u32,
            self.height as u32,
        );
        let mut scratch = vec![STALE; words + DEPTH_SCRATCH_LEN];
        let mut next = 0;
        for band in prepared.bands(self.bands) {
            assert_eq!(band.start, next);
            next = band.end;
            let first_row = (band.start * dermis_runtime::tiles::TILE) as usize;
            let mut framebuffer = self.framebuffer(&mut drawn, first_row);
            prepared.draw_band(band, &mut scratch, &mut framebuffer).expect("as promised");
        }
        assert_eq!(next, prepared.tile_rows());
        drawn
    }

    fn check_tiles(&self, prepared: &Prepared<'_>) {
        let words = Prepared::band_scratch_len(
            prepared.gaussians_selected(),
            self.width as u32,
            self.height as u32,
        );
        let drawn = prepared.for_each_tile(
            0..prepared.tile_rows(),
            &mut vec![STALE; words],
            |_, _, pixels| {
                for [r, g, b, t] in &pixels.0 {
                    let mut colors = [r, g, b].into_iter().flatten();
                    assert!(colors.all(|c| c.is_finite() && *c >= 0.0), "{r:?} {g:?} {b:?}");
                    assert!(t.iter().all(|t| (0.0..=1.0).contains(t)), "{t:?}");
                }
            },
        );
        drawn.expect("as promised");
    }

    fn check_export(&self, scene: &Scene<'_, '_>, posed: &Posed<'_, '_>) {
        let mut to = vec![PosedGaussian::default(); scene.plan.gaussians() as usize];
        for sides in [Sides::Seen, Sides::All] {
            let n = posed.export(&scene.plan, self.eye, sides, &mut to).expect("as promised");
            for gaussian in &to[..n] {
                assert!(gaussian.center.iter().all(|x| x.is_finite()));
                assert!((0.0..=1.0).contains(&gaussian.opacity), "{gaussian:?}");
                let colors = [gaussian.red, gaussian.green, gaussian.blue];
                assert!(colors.iter().all(|c| c.is_finite() && *c >= 0.0), "{gaussian:?}");
                let axes = [gaussian.axis_0, gaussian.axis_1, gaussian.axis_2];
                assert!(axes.iter().flatten().all(|x| x.is_finite()));
            }
        }
    }

    /// Elements of a row and from one to the next.
    fn row(&self) -> [usize; 2] {
        let row = self.width * if [2, 3].contains(&self.format) { 2 } else { 4 };
        [row, row + self.padding]
    }

    fn memory(&self) -> Drawn {
        let [row, stride] = self.row();
        let len = stride * (self.height - 1) + row;
        let is_float = self.format == 4;
        let depths = if self.has_depth { self.width * self.height } else { 0 };
        Drawn {
            bytes: vec![0x5a; if is_float { 0 } else { len }],
            numbers: vec![0.25; if is_float { len } else { 0 }],
            depths: vec![f32::from_bits(STALE); depths],
        }
    }

    /// From a row of the frame on.
    fn framebuffer<'p>(&self, drawn: &'p mut Drawn, first_row: usize) -> Framebuffer<'p> {
        let [_, stride] = self.row();
        let bytes = drawn.bytes.get_mut(stride * first_row..).unwrap_or_default();
        let pixels = match self.format {
            0 => Pixels::Rgba8(bytes),
            1 => Pixels::Bgra8(bytes),
            2 => Pixels::Rgb565(bytes),
            3 => Pixels::Rgb565Dithered(bytes),
            _ => Pixels::RgbaF32(&mut drawn.numbers[stride * first_row..]),
        };
        let metres = drawn.depths.get_mut(self.width * first_row..).unwrap_or_default();
        let depth = self.has_depth.then_some(Depth { metres, stride: self.width });
        Framebuffer { pixels, stride, background: self.background, depth }
    }
}

impl Drawn {
    fn check(&self) {
        assert!(self.numbers.iter().all(|x| x.is_finite()));
        assert!(self.depths.iter().all(|depth| *depth > 0.0), "{:?}", self.depths);
    }

    /// Whether both have the same bits.
    fn is(&self, other: &Self) -> bool {
        let same =
            |a: &[f32], b: &[f32]| a.iter().map(|x| x.to_bits()).eq(b.iter().map(|x| x.to_bits()));
        self.bytes == other.bytes
            && same(&self.numbers, &other.numbers)
            && same(&self.depths, &other.depths)
    }
}
