//! Gaussians too near, too large, too thin, too faint and too many.

use dermis_format::{Disc, Full};
use dermis_runtime::project::NEAR;
use dermis_runtime::{Avatar, Plan, Pose, Posed, Prepared};
use dermis_tests::picture::kernels;

use crate::case::{Case, check};
use crate::scenes::{BALL, DOT, camera, compensated, file, free, one_disc, triangles};

const SIZE: [u32; 2] = [33, 33];

#[test]
fn gaussians_next_to_the_camera() {
    let ball = file(&free(&[BALL]));
    let at = |name, distance| Case::new(name, ball.clone(), camera(SIZE, 33.0, distance));
    let wide = file(&free(&[Full { position: [0.0, 0.0, -0.02], log2_scale: [3.0; 3], ..BALL }]));
    check([
        at("centred on the camera", 0.0),
        at("behind the camera", -1.0),
        at("just behind the near plane", NEAR.next_down()),
        at("on the near plane", NEAR).shows(1, 1089).pixel([16, 16], [252, 254, 255]),
        Case::new("8 m wide, 2 cm away", wide, camera(SIZE, 33.0, 0.0))
            .shows(1, 1089)
            .pixel([0, 0], [252, 254, 255])
            .pixel([32, 16], [252, 254, 255]),
    ]);
}

/// A billionth of a metre leaves what the low-pass makes of it: a dot of 0.3 px², or nothing.
#[test]
fn gaussians_of_a_nanometre() {
    let speck = Disc { log2_scale: [-30.0; 2], ..DOT };
    let ball = Full { log2_scale: [-30.0; 3], ..BALL };
    let case = |name, file| Case::new(name, file, camera(SIZE, 33.0, 1.0));
    check([
        case("a disc of 1e-9 m, classic", file(&one_disc(speck)))
            .shows(1, 9)
            .pixel([16, 16], [252, 254, 255])
            .pixel([17, 16], [48, 152, 255]),
        case("a ball of 1e-9 m, classic", file(&free(&[ball])))
            .shows(1, 9)
            .pixel([16, 16], [252, 254, 255])
            .pixel([17, 16], [48, 152, 255]),
        case("a disc of 1e-9 m, compensated", compensated(one_disc(speck))),
        case("a ball of 1e-9 m, compensated", compensated(free(&[ball]))),
    ]);
}

/// A disc's axes on the screen in pixels, by 2 to their powers.
fn splinter(name: &'static str, log2_pixels: [f32; 2], position: [f32; 3]) -> Case {
    let log2_scale = log2_pixels.map(|power| power - 6.0);
    let disc = Disc { log2_scale, angle: 0.7, position, ..DOT };
    // 64 pixels a metre.
    Case::new(name, file(&one_disc(disc)), camera([65, 65], 64.0, 1.0))
}

/// Condition is the ratio of a covariance's greatest variance to its least.
#[test]
fn covariances_of_condition_1e12() {
    const FAR: &str = "490 px from the centre terms of 800 cancel, each off by 5e-5";
    // 2²⁰ between the axes: 2⁴⁰ = 1.1e12 between the variances.
    check([
        splinter("2¹⁰ by 2⁻¹⁰ px", [10.0, -10.0], [0.0; 3])
            .shows(1, 311)
            .pixel([32, 32], [252, 254, 255]),
        // With the low-pass of 0.3 px², too: 2³⁸ / 0.3.
        splinter("2¹⁹ by 2⁻³⁰ px", [19.0, -30.0], [0.0; 3])
            .shows(1, 311)
            .pixel([32, 32], [252, 254, 255]),
        splinter("2³⁰ by 2¹⁰ px", [30.0, 10.0], [0.0; 3])
            .shows(1, 4225)
            .pixel([32, 32], [252, 254, 255]),
        // Its centre 7.6 m, 490 px, along it.
        splinter("2¹⁹ by 2⁻³⁰ px from far outside", [19.0, -30.0], [5.8, 4.9, 0.0])
            .shows(1, 311)
            .within(0.03, FAR),
        Case::new(
            "a full record of 2¹⁰ by 2⁻¹⁰ by 2⁻¹⁰ px",
            file(&free(&[Full {
                rotation: [0.8, 0.0, 0.0, 0.6],
                log2_scale: [4.0, -16.0, -16.0],
                ..BALL
            }])),
            camera([65, 65], 64.0, 1.0),
        )
        .shows(1, 245)
        .pixel([32, 32], [252, 254, 255]),
    ]);
}

/// A file holds opacities in 1/255. Under 0.005 a Gaussian is in no level's occupancy.
#[test]
fn opacities_from_0_to_1() {
    let case = |name, opacity| {
        Case::new(name, file(&one_disc(Disc { opacity, ..DOT })), camera(SIZE, 33.0, 1.0))
    };
    check([
        case("opacity 0", 0.0),
        case("opacity 1e-40, denormal", 1e-40),
        case("opacity 1/255, below occupancy", 1.0 / 255.0),
        case("opacity 2/255", 2.0 / 255.0).shows(1, 69).pixel([16, 16], [2, 129, 255]),
        case("opacity 254/255", 254.0 / 255.0).shows(1, 593).pixel([16, 16], [252, 254, 255]),
        // No Gaussian covers more than 0.99.
        case("opacity 1", 1.0).shows(1, 593).pixel([16, 16], [252, 254, 255]),
    ]);
}

/// Two halves, red and then green, all at depth 2.
fn ten_thousand() -> Vec<u8> {
    let disc = |i: u32| {
        let along = |x: u32| x as f32 / 100.0 - 0.5;
        Disc {
            position: [along(i % 100), along(i * 7 % 100), 0.0],
            log2_scale: [0.0; 2],
            color: if i < 5000 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] },
            opacity: 2.0 / 255.0,
            ..DOT
        }
    };
    let discs: Vec<_> = (0..10_000).map(|i| (0, disc(i))).collect();
    file(&triangles(1, &discs))
}

#[test]
fn ten_thousand_at_one_depth() {
    let case = |name| Case::new(name, ten_thousand(), camera(SIZE, 33.0, 2.0));
    check([
        // Opaque before the first green one.
        case("10,000 at one depth").shows(10000, 1089).pixel([16, 16], [255, 0, 0]),
        case("4,000 of 10,000 at one depth")
            .with_budget(4_000)
            .shows(4000, 1089)
            .pixel([16, 16], [255, 0, 0]),
    ]);
}

/// The list of every tile is in the order of the file.
#[test]
fn ten_thousand_at_one_depth_keep_the_order_of_the_file() {
    let file = ten_thousand();
    let avatar = Avatar::parse(&file).expect("a valid file");
    let plan = Plan::with_budget(&avatar, u32::MAX);
    let camera = camera([65, 65], 33.0, 2.0);
    for kernel in kernels() {
        let mut posing = vec![0; Posed::scratch_len(&avatar)];
        let mut preparing = vec![0; Prepared::scratch_len(&avatar, 10_000, 65, 65)];
        let mut drawing = vec![0; Prepared::band_scratch_len(10_000, 65, 65)];
        let posed = Posed::new(&avatar, &Pose::Rest, kernel, &mut posing).expect("it fits");
        let prepared = Prepared::new(&posed, &plan, &camera, &mut preparing).expect("it fits");
        assert!(prepared.splats().iter().all(|splat| splat.depth == 2.0));
        let mut pairs = 0;
        let lists = prepared.for_each_list(0..3, &mut drawing, |tile, list| {
            assert!(list.is_sorted_by_key(|pair| pair.splat), "tile {tile}, {}", kernel.name());
            pairs += list.len();
        });
        lists.expect("it fits");
        assert_eq!(pairs, 40_000, "each in the four tiles about the middle");
    }
}
