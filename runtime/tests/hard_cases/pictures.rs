//! What is drawn, in numbers and in pictures of letters.

use dermis_format::source::Source;
use dermis_format::{Disc, Full, LowPass};
use dermis_runtime::{
    Avatar, Background, Camera, Framebuffer, Kernel, Pixels, Plan, Pose, Posed, Prepared, raster,
    render, scratch_len,
};
use proptest::prelude::*;
use proptest::sample::select;

use crate::scenes::{
    BALL, DOT, Picture, UNIT, bytes, camera, camera_behind, cloud, crowd, sheet, tiles,
};

#[test]
fn one_dot() {
    // σ = 1 px, and 0.3 px² of low-pass.
    let picture = Picture::of_all(&sheet(&[DOT]), &camera(9, 9, 8.0, 1.0));
    assert_eq!(
        picture.art(),
        "\
         |         |\n\
         |         |\n\
         |   .:.   |\n\
         |  .=*=.  |\n\
         |  :*@*:  |\n\
         |  .=*=.  |\n\
         |   .:.   |\n\
         |         |\n\
         |         |\n\
         "
    );
}

#[test]
fn two_discs_turned_and_stacked() {
    let long = Disc { log2_scale: [-2.0, -5.0], ..DOT };
    let discs = [
        Disc { angle: std::f32::consts::FRAC_PI_4, position: [-0.4, 0.0, 0.0], ..long },
        Disc { position: [0.4, -0.3, 0.0], opacity: 0.5, ..long },
    ];
    let picture = Picture::of_all(&sheet(&discs), &camera(16, 12, 8.0, 1.0));
    assert_eq!(
        picture.art(),
        "\
         |                |\n\
         |                |\n\
         |                |\n\
         |      :.        |\n\
         |     =+.        |\n\
         |   .*%:         |\n\
         |   +@-          |\n\
         |  :*-    ....   |\n\
         |  :.   .:-===:. |\n\
         |                |\n\
         |                |\n\
         |                |\n\
         "
    );
}

/// α = min(0.99, o · exp(−q/2)) where that is at least 1/255, nothing elsewhere, against f64.
fn check_against_formula(disc: Disc, low_pass: LowPass) {
    let mut source = sheet(&[disc]);
    source.mathematics.low_pass = low_pass;
    let bytes = bytes(&source);
    let avatar = Avatar::parse(&bytes).unwrap();
    let block = avatar.blocks().next().unwrap();
    let dermis_format::Records::Disc(records) = block.records else { panic!("discs") };
    let disc = records.get(0).expect("it holds one");
    let camera = camera(32, 32, 24.0, 1.0);
    let plan = Plan::with_budget(&avatar, 1);
    let tiles = tiles(&avatar, &Pose::Vertices(&UNIT), &plan, &camera);
    let [s, t] = disc.log2_scale.map(|s| 24.0 * f64::from(s).exp2());
    let (sin, cos) = f64::from(disc.angle).sin_cos();
    // Rows go down, y goes up.
    let axes = [[cos * s, -sin * s], [-sin * t, -cos * t]];
    let sum = |i: usize, j: usize| axes[0][i] * axes[0][j] + axes[1][i] * axes[1][j];
    let added = if low_pass == LowPass::Pixel { 1.0 / 12.0 } else { 0.3 };
    let (xx, xy, yy) = (sum(0, 0) + added, sum(0, 1), sum(1, 1) + added);
    let filtered = xx * yy - xy * xy;
    let left = match low_pass {
        LowPass::Classic => 1.0,
        LowPass::Compensated | LowPass::Pixel => ((s * t).powi(2) / filtered).sqrt(),
    };
    let center =
        [16.0 + 24.0 * f64::from(disc.position[0]), 16.0 - 24.0 * f64::from(disc.position[1])];
    for at in 0..32 * 32 {
        let pixel = raster::pixel(&tiles[0].0[at / 32], at % 32);
        let dx = (at % 32) as f64 + 0.5 - center[0];
        let dy = (at / 32) as f64 + 0.5 - center[1];
        let q = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / filtered;
        let alpha = f64::from(disc.opacity) * left * (-q / 2.0).exp();
        let drawn = 1.0 - f64::from(pixel[3]);
        let least = 1.0 / 255.0;
        // Next to 1/255 either is right.
        if (alpha / least - 1.0).abs() < 1e-3 {
            continue;
        }
        let expected = if alpha < least { 0.0 } else { alpha.min(0.99) };
        assert!((drawn - expected).abs() < 2e-5, "{disc:?}: {drawn} {expected} at {at}");
        assert!((f64::from(pixel[1]) - expected).abs() < 2e-5);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn one_disc_follows_the_formula(
        x in -0.6f32..0.6, y in -0.6f32..0.6, angle in 0f32..3.1,
        a in -7f32..-1.0, b in -7f32..-1.0, opacity in 0.02f32..=1.0,
        low_pass in select(vec![LowPass::Classic, LowPass::Compensated, LowPass::Pixel]),
    ) {
        let disc = Disc { position: [x, y, 0.0], angle, log2_scale: [a, b], opacity, ..DOT };
        check_against_formula(disc, low_pass);
    }
}

/// The nearer of two is in front, however they stand in the file; of two as near the first.
#[test]
fn depth_orders_and_the_file_breaks_ties() {
    let red = Full { color: [1.0, 0.0, 0.0], ..BALL };
    let green = Full { color: [0.0, 1.0, 0.0], position: [0.0, 0.0, -0.5], ..BALL };
    let camera = camera(9, 9, 8.0, 1.0);
    let one = Picture::of_all(&cloud(&[red, green]), &camera);
    let other = Picture::of_all(&cloud(&[green, red]), &camera);
    assert_eq!(one, other);
    // Alpha is 0.99 in the middle: 0.99 · 255 of red, then 0.01 · 0.99 · 255 of green.
    assert_eq!(one.pixel(4, 4), [252, 3, 0, 255]);
    let beside = Full { position: [0.0; 3], ..green };
    let first = |fulls: &[Full]| Picture::of_all(&cloud(fulls), &camera).pixel(4, 4);
    assert_eq!(first(&[red, beside]), [252, 3, 0, 255]);
    assert_eq!(first(&[beside, red]), [3, 252, 0, 255]);
    // From behind the green one is nearer.
    let back = Picture::of_all(&cloud(&[red, green]), &camera_behind(9, 9, 8.0, 1.0));
    assert_eq!(back.pixel(4, 4), [3, 252, 0, 255]);
}

/// A negative focal length mirrors the picture.
#[test]
fn a_mirrored_camera_mirrors_the_picture() {
    let source = crowd();
    let camera = camera(64, 48, 40.0, 1.5);
    let plain = Picture::of_all(&source, &camera);
    let mirrored = Picture::of_all(&source, &Camera { fx: -40.0, ..camera });
    for (row, expected) in mirrored.pixels.chunks_exact(256).zip(plain.pixels.chunks_exact(256)) {
        let expected = expected.chunks_exact(4).rev().flatten();
        assert!(row.iter().zip(expected).all(|(a, b)| a.abs_diff(*b) <= 1));
    }
}

/// Two of 0.99 leave T = 1e-4, in f32 a little less: the pixel is finished.
#[test]
fn a_pixel_stops_when_it_is_opaque() {
    let camera = camera(1, 1, 8.0, 1.0);
    for (count, blends) in [(1, 1), (2, 2), (3, 2), (9, 2)] {
        let picture = Picture::of_all(&sheet(&vec![DOT; count]), &camera);
        assert_eq!(picture.statistics.counts.blends, blends, "{count} discs");
        assert_eq!(picture.statistics.gaussians_visible, count as u32);
    }
}

/// Colour of the first splat.
fn splat_color(source: &Source, camera: &Camera) -> [f32; 3] {
    let bytes = bytes(source);
    let avatar = Avatar::parse(&bytes).unwrap();
    let mut posing = vec![0; Posed::scratch_len(&avatar)];
    let mut preparing = vec![0; Prepared::scratch_len(&avatar, 1, camera.width, camera.height)];
    let posed = Posed::new(&avatar, &Pose::Rest, Kernel::Scalar, &mut posing).unwrap();
    let plan = Plan::with_budget(&avatar, 1);
    let prepared = Prepared::new(&posed, &plan, camera, &mut preparing).unwrap();
    prepared.splats()[0].color
}

/// Degree 1 of the harmonics is −y, z, −x of the direction from the camera, times √(3 / 4π).
#[test]
fn harmonics_turn_with_the_view() {
    const C1: f32 = 0.488_602_5;
    let mut source = cloud(&[Full { color: [0.5; 3], ..BALL }]);
    source.mathematics.harmonics_degree = 1;
    // (r, g, b) for each of −y, z, −x: z makes red, −x green, −y blue.
    source.regions[0].harmonics = vec![vec![0.0, 0.0, 0.25, 0.5, 0.0, 0.0, 0.0, 0.5, 0.0]];
    let front = camera(8, 8, 8.0, 1.0);
    let side = [[0.0, 0.0, -1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 1.0]];
    let above = [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 1.0]];
    let cases = [
        (front, [0.5 - 0.5 * C1, 0.5, 0.5]),
        (camera_behind(8, 8, 8.0, 1.0), [0.5 + 0.5 * C1, 0.5, 0.5]),
        (Camera { world_to_camera: side, ..front }, [0.5, 0.5 + 0.5 * C1, 0.5]),
        (Camera { world_to_camera: above, ..front }, [0.5, 0.5, 0.5 + 0.25 * C1]),
    ];
    for (camera, expected) in cases {
        let found = splat_color(&source, &camera);
        let near = found.iter().zip(expected).all(|(a, b): (&f32, f32)| (a - b).abs() < 2e-3);
        assert!(near, "{found:?}, expected {expected:?}");
    }
    // Below black is black.
    source.regions[0].harmonics = vec![vec![0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 0.0, 0.0]];
    assert_eq!(splat_color(&source, &front)[0], 0.0);
    // On the camera itself there is no direction, and the near plane takes it.
    assert_eq!(Picture::of_all(&source, &camera(8, 8, 8.0, 0.0)).statistics.gaussians_visible, 0);
}

fn over(source: &Source, budget: u32, background: Background, before: [u8; 4]) -> Vec<[u8; 4]> {
    let bytes = bytes(source);
    let avatar = Avatar::parse(&bytes).unwrap();
    let camera = camera(9, 9, 8.0, 1.0);
    let mut pixels = before.repeat(81);
    let bytes = Pixels::Rgba8(&mut pixels);
    let mut framebuffer = Framebuffer { pixels: bytes, stride: 36, background, depth: None };
    let mut scratch = vec![0; scratch_len(&avatar, u32::MAX, 9, 9)];
    let plan = Plan::with_budget(&avatar, budget);
    render(&avatar, &Pose::Rest, &plan, &camera, Kernel::detect(), &mut scratch, &mut framebuffer)
        .unwrap();
    pixels.as_chunks().0.to_vec()
}

#[test]
fn backgrounds() {
    let half = sheet(&[Disc { color: [1.0, 0.25, 0.0], opacity: 0.6, ..DOT }]);
    let existing = Background::Existing;
    // Nothing drawn: the colour, or what was there.
    assert!(
        over(&half, 0, Background::Color([1.0, 0.2, 0.0]), [9; 4])
            .iter()
            .all(|p| *p == [255, 51, 0, 255])
    );
    assert!(over(&half, 0, existing, [9, 8, 7, 6]).iter().all(|p| *p == [9, 8, 7, 6]));
    // What is there, opaque, is as good as a colour.
    for byte in [0u8, 51, 204, 255] {
        let color = Background::Color([f32::from(byte) / 255.0; 3]);
        let onto = over(&half, 1, existing, [byte, byte, byte, 255]);
        assert_eq!(over(&half, 1, color, [9; 4]), onto, "{byte}");
    }
    // Over nothing: premultiplied colour, and alpha.
    let alone = over(&half, 1, existing, [0; 4]);
    assert_eq!(alone[40], [153, 38, 0, 153]);
    assert!(alone.iter().all(|[r, g, b, a]| r == a && g <= a && *b == 0));
    // Colours that are no numbers, or out of range, end at 0 and 255.
    let odd = over(&half, 0, Background::Color([f32::NAN, f32::INFINITY, -1.0]), [9; 4]);
    assert!(odd.iter().all(|pixel| *pixel == [0, 255, 0, 255]));
    // Twice over what is there equals a picture of both, up to one step.
    let twice = {
        let mut source = sheet(&[Disc { color: [1.0, 0.25, 0.0], opacity: 0.6, ..DOT }; 2]);
        source.mathematics = half.mathematics;
        over(&source, 2, existing, [0; 4])
    };
    assert_eq!(twice[40][3], 214, "1 − 0.4²");
}
