//! Sixteen avatars at mixed distances under one budget, swept from little to plenty, as an animated PNG:
//! `cargo run --release --example crowd -- IN.dermis OUT.png`.
//!
//! For each budget it prints what the plan cost beside the frame, what each row of the crowd got, and how near the front
//! avatar is to itself with all its Gaussians, by the plan and by an even share.

use std::time::Instant;

use anyhow::{Context, Result};
use dermis_runtime::budget::{self, Budget, Instance};
use dermis_runtime::math::Affine;
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

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let (file, picture) =
        arguments.next().zip(arguments.next()).context("usage: crowd IN.dermis OUT.png")?;
    let bytes = std::fs::read(&file).context(file)?;
    let avatar = Avatar::parse(&bytes)?;
    let crowd = Crowd::new(&avatar);
    let posed = crowd.posed()?;

    let output = std::fs::File::create(&picture).context(picture)?;
    let mut encoder = png::Encoder::new(output, WIDTH, HEIGHT);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_animated(BUDGETS.len() as u32, 0)?;
    encoder.set_frame_delay(SECONDS_PER_PICTURE, 1)?;
    let mut writer = encoder.write_header()?;

    println!(
        "budget  spent   plan ms  frame ms  Gaussians by row           front avatar dB, plan / even"
    );
    for gaussians in BUDGETS {
        let start = Instant::now();
        let plans = crowd.plans(&posed, gaussians)?;
        let planned = start.elapsed();
        let mut pixels = vec![255; (WIDTH * HEIGHT * 4) as usize];
        for (index, plan) in plans.iter().enumerate().rev() {
            crowd.draw(&posed[index], index, plan, &mut pixels)?;
        }
        let frame = start.elapsed();
        writer.write_image_data(&pixels)?;
        let even = Plan::with_budget(&avatar, gaussians / plans.len() as u32);
        let [by_plan, by_even] = [&plans[0], &even].map(|plan| crowd.front_db(&posed[0], plan));
        let spent: u32 = plans.iter().map(Plan::gaussians).sum();
        println!(
            "{gaussians:6} {spent:6} {:9.3} {:9.1}  {:25}  {:.1} / {:.1}",
            planned.as_secs_f64() * 1e3,
            frame.as_secs_f64() * 1e3,
            format!("{:?}", crowd.by_row(&plans)),
            by_plan?,
            by_even?,
        );
    }
    writer.finish()?;
    Ok(())
}

/// Copies of one avatar, the nearest first.
struct Crowd<'a> {
    avatar: &'a Avatar<'a>,
    camera: Camera,
    places: Vec<Affine>,
}

impl<'a> Crowd<'a> {
    fn new(avatar: &'a Avatar<'a>) -> Self {
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
        Self { avatar, camera, places: ROWS.into_iter().flat_map(place).collect() }
    }

    fn camera_of(&self, index: usize) -> Camera {
        self.camera.for_place(&self.places[index])
    }

    /// Each in another moment of the first clip. Their scratch is never freed: they live as long as the program.
    fn posed(&self) -> Result<Vec<Posed<'_, 'a>>> {
        let moves = self.avatar.header().clips > 0;
        (0..self.places.len())
            .map(|index| {
                let seconds = 0.35 * index as f32;
                let pose = if moves { Pose::Clip { clip: 0, seconds } } else { Pose::Rest };
                let scratch = vec![0; Posed::scratch_len(self.avatar)].leak();
                Ok(Posed::new(self.avatar, &pose, Kernel::detect(), scratch)?)
            })
            .collect()
    }

    fn plans(&self, posed: &[Posed<'_, 'a>], gaussians: u32) -> Result<Vec<Plan>> {
        let instance = |(index, posed): (usize, &Posed<'_, 'a>)| Instance {
            avatar: self.avatar,
            footprints: posed.footprints(&self.camera_of(index)),
            weight: 1.0,
        };
        let instances: Vec<Instance<'_, '_>> = posed.iter().enumerate().map(instance).collect();
        let mut plans = vec![Plan::default(); instances.len()];
        let mut scratch = vec![0; budget::scratch_len(&instances)];
        let budget = Budget::of_gaussians(gaussians);
        budget::plan(&instances, &budget, None, &mut scratch, &mut plans)?;
        Ok(plans)
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

    /// PSNR of the front avatar to itself with all Gaussians, over the pixels that it covers then.
    fn front_db(&self, posed: &Posed<'_, 'a>, plan: &Plan) -> Result<f64> {
        let all = Plan::with_budget(self.avatar, u32::MAX);
        let [exact, drawn] = [&all, plan].map(|plan| {
            let mut pixels = vec![0; (WIDTH * HEIGHT * 4) as usize];
            self.draw(posed, 0, plan, &mut pixels).map(|_| pixels)
        });
        let (exact, drawn) = (exact?, drawn?);
        let covered =
            exact.chunks_exact(4).zip(drawn.chunks_exact(4)).filter(|(exact, _)| exact[3] > 0);
        let (mut squares, mut numbers) = (0.0, 0.0f64);
        for (exact, drawn) in covered {
            for (a, b) in exact[..3].iter().zip(drawn) {
                squares += (f64::from(*a) - f64::from(*b)).powi(2);
                numbers += 1.0;
            }
        }
        Ok(10.0 * (255.0f64 * 255.0 * numbers / squares.max(1e-9)).log10())
    }

    fn by_row(&self, plans: &[Plan]) -> Vec<u32> {
        let mut rest = plans.iter().map(Plan::gaussians);
        ROWS.map(|(_, count)| rest.by_ref().take(count as usize).sum()).to_vec()
    }
}
