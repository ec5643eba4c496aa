//! Sixteen avatars at mixed distances under one budget, swept from little to plenty, as an animated PNG:
//! `cargo run --release --example crowd -- IN.dermis OUT.png`.
//!
//! For each budget it prints what planning and posing cost beside the frame (and beside posing all of everyone), what each row of
//! the crowd got, and how near the front avatar is to itself with all its Gaussians, by the plan and by an even share.

use std::time::Instant;

use anyhow::{Context, Result};
use dermis_runtime::budget::{self, Budget, Instance};
use dermis_runtime::math::{Affine, compose};
use dermis_runtime::pose::carried;
use dermis_runtime::{
    Avatar, Background, Camera, Framebuffer, Kernel, Pixels, Plan, Pose, Posed, Prepared,
    Statistics,
};

const WIDTH: u32 = 960;
const HEIGHT: u32 = 540;
const BUDGETS: [u32; 7] = [2_500, 5_000, 10_000, 20_000, 40_000, 60_000, 120_000];
/// Rows of the crowd: distance to the camera, in heights of the avatar, and how many stand there.
const ROWS: [(f32, u32); 4] = [(1.3, 1), (3.0, 3), (6.0, 5), (10.0, 7)];
const SECONDS_PER_PICTURE: u16 = 1;
/// What moves less than so many pixels stays as it rests.
const UNSEEN: f32 = 0.25;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let (file, picture) =
        arguments.next().zip(arguments.next()).context("usage: crowd IN.dermis OUT.png")?;
    let bytes = std::fs::read(&file).context(file)?;
    let avatar = Avatar::parse(&bytes)?;
    // Made once: footprints of the crowd are taken of it, and who is still looks like it.
    let mut scratch = vec![0; Posed::scratch_len(&avatar)];
    let rest = Posed::new(&avatar, &Pose::Rest, Kernel::detect(), &mut scratch)?;
    let crowd = Crowd::new(&avatar, rest);
    let mut memories = vec![vec![0; Posed::scratch_len_for_plan(&avatar)]; crowd.places.len()];
    let all = Plan::with_budget(&avatar, u32::MAX);

    let output = std::fs::File::create(&picture).context(picture)?;
    let mut encoder = png::Encoder::new(output, WIDTH, HEIGHT);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_animated(BUDGETS.len() as u32, 0)?;
    encoder.set_frame_delay(SECONDS_PER_PICTURE, 1)?;
    let mut writer = encoder.write_header()?;

    println!(
        "budget  spent  ms: plan   pose  of all  frame  Gaussians by row           front avatar dB, plan / even"
    );
    for gaussians in BUDGETS {
        let start = Instant::now();
        let plans = crowd.plans(gaussians)?;
        let planned = start.elapsed();
        let posed = crowd.posed(&plans, &mut memories)?;
        let posing = start.elapsed() - planned;
        let mut pixels = vec![255; (WIDTH * HEIGHT * 4) as usize];
        for (index, plan) in plans.iter().enumerate().rev() {
            crowd.draw(&posed[index], index, plan, &mut pixels)?;
        }
        let frame = start.elapsed();
        writer.write_image_data(&pixels)?;

        let start = Instant::now();
        let whole = crowd.posed(&vec![all.clone(); plans.len()], &mut memories)?;
        let posing_all = start.elapsed();
        let even = Plan::with_budget(&avatar, gaussians / plans.len() as u32);
        let exact = crowd.front(&whole[0], &all)?;
        let by_even = decibels(&exact, &crowd.front(&whole[0], &even)?);
        let by_plan =
            decibels(&exact, &crowd.front(&crowd.posed(&plans, &mut memories)?[0], &plans[0])?);
        let spent: u32 = plans.iter().map(Plan::gaussians).sum();
        let [planned, posing, posing_all, frame] =
            [planned, posing, posing_all, frame].map(|time| time.as_secs_f64() * 1e3);
        println!(
            "{gaussians:6} {spent:6} {planned:9.2} {posing:6.2} {posing_all:7.2} {frame:6.1}  {:25}  {by_plan:.1} / {by_even:.1}",
            format!("{:?}", crowd.by_row(&plans)),
        );
    }
    writer.finish()?;
    Ok(())
}

/// PSNR over the pixels that `exact` covers.
fn decibels(exact: &[u8], drawn: &[u8]) -> f64 {
    let covered =
        exact.chunks_exact(4).zip(drawn.chunks_exact(4)).filter(|(exact, _)| exact[3] > 0);
    let (mut squares, mut numbers) = (0.0, 0.0f64);
    for (exact, drawn) in covered {
        for (a, b) in exact[..3].iter().zip(drawn) {
            squares += (f64::from(*a) - f64::from(*b)).powi(2);
            numbers += 1.0;
        }
    }
    10.0 * (255.0f64 * 255.0 * numbers / squares.max(1e-9)).log10()
}

/// Copies of one avatar, the nearest first.
struct Crowd<'a> {
    avatar: &'a Avatar<'a>,
    rest: Posed<'a, 'a>,
    camera: Camera,
    places: Vec<Affine>,
}

impl<'a> Crowd<'a> {
    fn new(avatar: &'a Avatar<'a>, rest: Posed<'a, 'a>) -> Self {
        let (min, max) = (avatar.header().box_min, avatar.header().box_max);
        let center: [f32; 3] = std::array::from_fn(|i| (min[i] + max[i]) / 2.0);
        let height = max[1] - min[1];
        let place = |(distance, count): (f32, u32)| {
            (0..count).map(move |i| {
                let aside = (i as f32 - (count - 1) as f32 / 2.0) * 0.95 * height;
                [
                    [1.0, 0.0, 0.0, aside - center[0]],
                    [0.0, 1.0, 0.0, -center[1]],
                    [0.0, 0.0, 1.0, -distance * height - center[2]],
                ]
            })
        };
        let focal = HEIGHT as f32;
        let camera = Camera {
            width: WIDTH,
            height: HEIGHT,
            fx: focal,
            fy: focal,
            cx: WIDTH as f32 / 2.0,
            cy: HEIGHT as f32 / 2.0,
            // In the world's origin, looking along −Z.
            world_to_camera: [[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0]],
        };
        Self { avatar, rest, camera, places: ROWS.into_iter().flat_map(place).collect() }
    }

    fn camera_of(&self, index: usize) -> Camera {
        self.camera.for_place(&self.places[index])
    }

    /// Each is in another moment of the first clip.
    fn pose(&self, index: usize) -> Pose<'static> {
        let moves = self.avatar.header().clips > 0;
        let seconds = 0.35 * index as f32;
        if moves { Pose::Clip { clip: 0, seconds } } else { Pose::Rest }
    }

    fn plans(&self, gaussians: u32) -> Result<Vec<Plan>> {
        let instance = |(index, place): (usize, &Affine)| {
            let carried = compose(place, &carried(self.avatar, &self.pose(index)));
            Instance {
                avatar: self.avatar,
                footprints: self.rest.footprints(&self.camera.for_place(&carried)),
                weight: 1.0,
            }
        };
        let instances: Vec<Instance<'_, '_>> =
            self.places.iter().enumerate().map(instance).collect();
        let mut plans = vec![Plan::default(); instances.len()];
        let mut scratch = vec![0; budget::scratch_len(&instances)];
        let budget = Budget { movement: UNSEEN, ..Budget::of_gaussians(gaussians) };
        budget::plan(&instances, &budget, None, &mut scratch, &mut plans)?;
        Ok(plans)
    }

    /// Everyone, as far as the plans show.
    fn posed<'m>(
        &'m self,
        plans: &[Plan],
        memories: &'m mut [Vec<u32>],
    ) -> Result<Vec<Posed<'m, 'a>>> {
        let pose = |((index, plan), memory): ((usize, &Plan), &'m mut Vec<u32>)| {
            Ok(Posed::for_plan(self.avatar, &self.pose(index), plan, self.rest.kernel(), memory)?)
        };
        plans.iter().enumerate().zip(memories).map(pose).collect()
    }

    /// Blends one over the pixels that are there.
    fn draw(
        &self,
        posed: &Posed<'_, 'a>,
        index: usize,
        plan: &Plan,
        pixels: &mut [u8],
    ) -> Result<Statistics> {
        let (camera, budget) = (self.camera_of(index), plan.gaussians());
        let mut scratch = vec![0; Prepared::scratch_len(self.avatar, budget, WIDTH, HEIGHT)];
        let prepared = Prepared::new(posed, plan, &camera, &mut scratch)?;
        let mut scratch = vec![0; Prepared::band_scratch_len(budget, WIDTH, HEIGHT)];
        let mut framebuffer = Framebuffer {
            pixels: Pixels::Rgba8(pixels),
            stride: WIDTH as usize * 4,
            background: Background::Existing,
            depth: None,
        };
        let counts = prepared.draw(&mut scratch, &mut framebuffer)?;
        Ok(Statistics {
            gaussians_selected: budget,
            gaussians_visible: prepared.splats().len() as u32,
            counts,
        })
    }

    /// The front avatar alone.
    fn front(&self, posed: &Posed<'_, 'a>, plan: &Plan) -> Result<Vec<u8>> {
        let mut pixels = vec![0; (WIDTH * HEIGHT * 4) as usize];
        self.draw(posed, 0, plan, &mut pixels)?;
        Ok(pixels)
    }

    fn by_row(&self, plans: &[Plan]) -> Vec<u32> {
        let mut rest = plans.iter().map(Plan::gaussians);
        ROWS.map(|(_, count)| rest.by_ref().take(count as usize).sum()).to_vec()
    }
}
