//! Ten thousand frames in the same memory.

use dermis_conformance::File;
use dermis_runtime::{
    Avatar, Background, Camera, Framebuffer, Kernel, Pixels, Plan, Pose, Statistics, render,
    scratch_len,
};

const FRAMES: u32 = 10_000;
const SIZE: u32 = 64;
const GREATEST_BUDGET: u32 = 3_000;

/// Goes from 0 to 1 and back, once in `period` frames.
fn back_and_forth(frame: u32, period: u32) -> f64 {
    let at = f64::from(frame % period) / f64::from(period);
    1.0 - (2.0 * at - 1.0).abs()
}

/// Round the figure, nearer and farther, up and down, now and then through it.
fn camera(frame: u32) -> Camera {
    let yaw = f64::from(frame) * 0.0137;
    let distance = 3.0 * back_and_forth(frame, 1733) + 0.05;
    let height = 1.8 * back_and_forth(frame, 977);
    let (sin, cos) = yaw.sin_cos();
    let rows = [[cos, 0.0, -sin, 0.0], [0.0, -1.0, 0.0, height], [-sin, 0.0, -cos, distance]];
    let focal = 60.0;
    Camera {
        width: SIZE,
        height: SIZE,
        fx: focal,
        fy: focal,
        cx: 32.0,
        cy: 32.0,
        world_to_camera: rows.map(|row| row.map(|x| x as f32)),
    }
}

/// Draws frame `frame` of the run: the clips after each other, budgets from 300 to 3,000.
fn draw(frame: u32, avatar: &Avatar<'_>, scratch: &mut [u32], pixels: &mut [u8]) -> Statistics {
    let clip = (frame / 150) as usize % usize::from(avatar.header().clips);
    let pose = Pose::Clip { clip, seconds: (frame % 150) as f32 / 60.0 };
    let budget = 300 + (2_700.0 * back_and_forth(frame, 611)) as u32;
    let plan = Plan::with_budget(avatar, budget);
    let background = Background::Color([0.1, 0.2, 0.3]);
    let mut framebuffer = Framebuffer {
        pixels: Pixels::Rgba8(pixels),
        stride: SIZE as usize * 4,
        background,
        depth: None,
    };
    let camera = camera(frame);
    let kernel = Kernel::detect();
    let drawn = render(avatar, &pose, &plan, &camera, kernel, scratch, &mut framebuffer);
    let statistics = drawn.expect("scratch is for the greatest budget");
    assert!(statistics.gaussians_selected == budget && budget <= GREATEST_BUDGET);
    statistics
}

#[test]
fn frame_ten_thousand_is_the_same_frame_drawn_alone() {
    let avatar = Avatar::parse(File::Figure.bytes()).expect("a valid file");
    let words = scratch_len(&avatar, GREATEST_BUDGET, SIZE, SIZE);
    let fresh = || (vec![0; words], vec![0; (SIZE * SIZE * 4) as usize]);
    let (mut scratch, mut pixels) = fresh();
    let (mut seen, mut blends) = (0, 0);
    for frame in 0..FRAMES {
        let statistics = draw(frame, &avatar, &mut scratch, &mut pixels);
        seen += u32::from(statistics.gaussians_visible > 0);
        blends += statistics.counts.blends;
        // Some on the way, too, so that a failure is found near its cause.
        if frame % 625 == 0 || frame == FRAMES - 1 {
            let (mut scratch, mut alone) = fresh();
            assert_eq!(draw(frame, &avatar, &mut scratch, &mut alone), statistics);
            assert!(alone == pixels, "frame {frame} is another one when drawn alone");
        }
    }
    let per_frame = blends / u64::from(FRAMES);
    println!("{seen} of {FRAMES} frames show something, {per_frame} blends each");
    assert!(seen > FRAMES / 10 * 9 && per_frame > 1000, "{seen} {per_frame}");
}
