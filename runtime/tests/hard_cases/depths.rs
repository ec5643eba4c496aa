//! Median depths beside pixels.

use dermis_runtime::draw::DEPTH_SCRATCH_LEN;
use dermis_runtime::error::Buffer;
use dermis_runtime::raster::{self, LEAST_TRANSMITTANCE};
use dermis_runtime::{
    Avatar, Background, Camera, Depth, Error, Framebuffer, Kernel, Pixels, Plan, Pose, Posed,
    Prepared, render, scratch_len,
};

use crate::scenes::{BALL, Picture, bytes, camera, cloud, crowd, kernels};
use dermis_format::Full;
use dermis_format::source::Source;

/// Between the rows of a plane.
const GUARD: f32 = -77.0;

/// Draws all of an avatar: its pixels, and its depths in rows that are `stride` apart.
fn draw(
    avatar: &Avatar<'_>,
    camera: &Camera,
    kernel: Kernel,
    words: usize,
    numbers: usize,
    stride: usize,
) -> Result<(Vec<u8>, Vec<f32>), Error> {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let mut bytes = vec![0; width * height * 4];
    let mut metres = vec![GUARD; numbers];
    let mut framebuffer = Framebuffer {
        pixels: Pixels::Rgba8(&mut bytes),
        stride: width * 4,
        background: Background::Color([0.0; 3]),
        depth: Some(Depth { metres: &mut metres, stride }),
    };
    let plan = Plan::with_budget(avatar, u32::MAX);
    let mut scratch = vec![0x7fc0_0001; words];
    render(avatar, &Pose::Rest, &plan, camera, kernel, &mut scratch, &mut framebuffer)?;
    Ok((bytes, metres))
}

/// By every kernel, the same bits; rows without gaps.
fn depths(source: &Source, camera: &Camera) -> Vec<f32> {
    let file = bytes(source);
    let avatar = Avatar::parse(&file).unwrap();
    let (width, height) = (camera.width as usize, camera.height as usize);
    let words = scratch_len(&avatar, u32::MAX, camera.width, camera.height) + DEPTH_SCRATCH_LEN;
    let pixels = Picture::of_all(source, camera).pixels;
    let by = |kernel| draw(&avatar, camera, kernel, words, width * height, width).unwrap();
    let scalar = by(Kernel::Scalar);
    for kernel in kernels() {
        let other = by(kernel);
        let bits = |numbers: &[f32]| numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert!(bits(&other.1) == bits(&scalar.1), "{}", kernel.name());
        assert!(other.0 == pixels, "depths change no pixel: {}", kernel.name());
    }
    scalar.1
}

/// Pixel after pixel, splat after splat.
fn expected(source: &Source, camera: &Camera) -> Vec<f32> {
    let file = bytes(source);
    let avatar = Avatar::parse(&file).unwrap();
    let mut posing = vec![0; Posed::scratch_len(&avatar)];
    let mut preparing = vec![0; Prepared::scratch_len(&avatar, 400, camera.width, camera.height)];
    let posed = Posed::new(&avatar, &Pose::Rest, Kernel::Scalar, &mut posing).unwrap();
    let plan = Plan::with_budget(&avatar, u32::MAX);
    let prepared = Prepared::new(&posed, &plan, camera, &mut preparing).unwrap();
    let mut splats: Vec<_> = prepared.splats().iter().collect();
    splats.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    let pixel = |at: u32| {
        let (x, y) = (at % camera.width, at / camera.width);
        let mut t = 1.0;
        for splat in &splats {
            let [dx, dy] = [x as f32 + 0.5 - splat.mean[0], y as f32 + 0.5 - splat.mean[1]];
            let (alpha, touches) = raster::alpha(raster::log2_alpha(splat, dx, dy));
            if touches {
                t = raster::blend([0.0, 0.0, 0.0, t], alpha, [0.0; 3])[3];
            }
            if t < 0.5 {
                return splat.depth;
            }
        }
        f32::INFINITY
    };
    (0..camera.width * camera.height).map(pixel).collect()
}

#[test]
fn depth_is_of_the_splat_that_makes_a_pixel_half_opaque() {
    for camera in [camera(1, 1, 8.0, 1.5), camera(33, 31, 20.0, 1.5), camera(97, 75, 60.0, 1.5)] {
        let found = depths(&crowd(), &camera);
        assert!(found == expected(&crowd(), &camera), "{}×{}", camera.width, camera.height);
        let some = found.iter().filter(|depth| depth.is_finite()).count();
        assert!(some > 0 && (camera.width == 1 || some < found.len()), "{some}");
    }
    const { assert!(LEAST_TRANSMITTANCE < 0.5) };
}

#[test]
fn depth_waits_for_half() {
    let camera = camera(9, 9, 8.0, 2.0);
    let at = |z: f32, opacity: f32| Full { position: [0.0, 0.0, z], opacity, ..BALL };
    let middle = |fulls: &[Full]| depths(&cloud(fulls), &camera)[40];
    let near = |found: f32, expected: f32| assert!((found - expected).abs() < 1e-3, "{found}");
    near(middle(&[at(0.0, 0.9)]), 2.0);
    near(middle(&[at(0.5, 0.4), at(0.0, 0.4), at(-0.5, 0.9)]), 2.0);
    near(middle(&[at(0.5, 0.4), at(0.0, 0.1), at(-0.5, 0.9)]), 2.5);
    assert_eq!(middle(&[at(0.5, 0.4)]), f32::INFINITY);
    assert_eq!(middle(&[]), f32::INFINITY);
}

#[test]
fn planes_may_have_gaps_and_must_be_long_enough() {
    let file = bytes(&crowd());
    let avatar = Avatar::parse(&file).unwrap();
    let camera = camera(97, 75, 60.0, 1.5);
    let tight = depths(&crowd(), &camera);
    let words = scratch_len(&avatar, u32::MAX, 97, 75) + DEPTH_SCRATCH_LEN;
    let draw = |words, numbers, stride| {
        draw(&avatar, &camera, Kernel::detect(), words, numbers, stride).map(|(_, metres)| metres)
    };
    for stride in [97, 98, 200] {
        let needed = stride * 74 + 97;
        let metres = draw(words, needed, stride).unwrap();
        for (row, expected) in metres.chunks(stride).zip(tight.chunks_exact(97)) {
            assert_eq!(&row[..97], expected);
            assert!(row[97..].iter().all(|&number| number == GUARD), "numbers between rows");
        }
        let (buffer, lent) = (Buffer::Depths, needed - 1);
        let error = draw(words, lent, stride).unwrap_err();
        assert_eq!(error, Error::Buffer { buffer, needed, lent });
        assert!(error.to_string().ends_with("lend 1 more"), "{error}");
    }
    let error = draw(words, 1 << 16, 96).unwrap_err();
    assert_eq!(error, Error::Stride { buffer: Buffer::Depths, needed: 97, given: 96 });
    // The tile of depths is in the scratch that is asked for.
    let lent = words - 1;
    assert_eq!(draw(lent, 1 << 16, 97), Err(Error::Scratch { needed: words, lent }));
}

#[test]
fn bands_have_the_same_depths() {
    let file = bytes(&crowd());
    let avatar = Avatar::parse(&file).unwrap();
    let camera = camera(97, 75, 60.0, 1.5);
    let whole = depths(&crowd(), &camera);
    let mut posing = vec![0; Posed::scratch_len(&avatar)];
    let mut preparing = vec![0; Prepared::scratch_len(&avatar, 400, 97, 75)];
    let posed = Posed::new(&avatar, &Pose::Rest, Kernel::detect(), &mut posing).unwrap();
    let plan = Plan::with_budget(&avatar, 400);
    let prepared = Prepared::new(&posed, &plan, &camera, &mut preparing).unwrap();
    let mut scratch = vec![0; Prepared::band_scratch_len(400, 97, 75) + DEPTH_SCRATCH_LEN];
    let mut found = Vec::new();
    for row in 0..3u32 {
        let rows = 75.min(32 * (row as usize + 1)) - 32 * row as usize;
        let (mut bytes, mut metres) = (vec![0; rows * 97 * 2], vec![GUARD; rows * 97]);
        let mut framebuffer = Framebuffer {
            pixels: Pixels::Rgb565Dithered(&mut bytes),
            stride: 97 * 2,
            background: Background::Existing,
            depth: Some(Depth { metres: &mut metres, stride: 97 }),
        };
        prepared.draw_band(row..row + 1, &mut scratch, &mut framebuffer).unwrap();
        found.extend(metres);
    }
    assert_eq!(found, whole);
}
