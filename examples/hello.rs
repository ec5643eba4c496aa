//! From an avatar's bytes to a picture: `cargo run --release --example hello -- IN.dermis OUT.png`.

use anyhow::{Context, Result};
use dermis_runtime::{
    Avatar, Background, Camera, Framebuffer, Kernel, Pixels, Plan, Pose, render, scratch_len,
};

const WIDTH: u32 = 540;
const HEIGHT: u32 = 540;
const BUDGET: u32 = 20_000;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let (file, picture) =
        arguments.next().zip(arguments.next()).context("usage: hello IN.dermis OUT.png")?;

    // Check the bytes once; they are read in place from then on.
    let bytes = std::fs::read(&file).context(file)?;
    let avatar = Avatar::parse(&bytes)?;

    // At most so many Gaussians, half a second into the first clip.
    let plan = Plan::with_budget(&avatar, BUDGET);
    let clips = avatar.header().clips;
    let pose = if clips > 0 { Pose::Clip { clip: 0, seconds: 0.5 } } else { Pose::Rest };

    // All memory is the caller's.
    let mut scratch = vec![0u32; scratch_len(&avatar, BUDGET, WIDTH, HEIGHT)];
    let mut pixels = vec![0u8; (WIDTH * HEIGHT * 4) as usize];
    let mut framebuffer = Framebuffer {
        pixels: Pixels::Rgba8(&mut pixels),
        stride: WIDTH as usize * 4,
        background: Background::Color([1.0, 1.0, 1.0]),
        depth: None,
    };
    let camera = in_front_of(&avatar);
    // The widest vectors that this CPU has; every kernel draws the same bytes.
    let kernel = Kernel::detect();
    let statistics =
        render(&avatar, &pose, &plan, &camera, kernel, &mut scratch, &mut framebuffer)?;
    println!("{statistics:?}");
    image::save_buffer(&picture, &pixels, WIDTH, HEIGHT, image::ColorType::Rgba8).context(picture)
}

/// A camera on +Z that sees the whole box of the rest pose, 50° high. Camera axes: x right, y down, z forward.
fn in_front_of(avatar: &Avatar<'_>) -> Camera {
    let (min, max) = (avatar.header().box_min, avatar.header().box_max);
    let center: [f32; 3] = std::array::from_fn(|i| (min[i] + max[i]) / 2.0);
    let diagonal = (0..3).map(|i| (max[i] - min[i]).powi(2)).sum::<f32>().sqrt();
    let distance = diagonal / 2.0 / 25f32.to_radians().sin();
    let focal = HEIGHT as f32 / 2.0 / 25f32.to_radians().tan();
    Camera {
        width: WIDTH,
        height: HEIGHT,
        fx: focal,
        fy: focal,
        cx: WIDTH as f32 / 2.0,
        cy: HEIGHT as f32 / 2.0,
        world_to_camera: [
            [1.0, 0.0, 0.0, -center[0]],
            [0.0, -1.0, 0.0, center[1]],
            [0.0, 0.0, -1.0, center[2] + distance],
        ],
    }
}
