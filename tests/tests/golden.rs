//! Pictures that must not change, bit by bit, on any target.
//!
//! The avatars are made by hand, so that no change of training touches them, and stored as bytes,
//! so that no change of the encoder does. `DERMIS_BLESS=1` renews avatars and pictures.

use dermis_format::rig::Property;
use dermis_format::source::{
    Channel, Clip, Gaussians, Joint, Mathematics, Mesh, Morph, Region, Rig, Source,
};
use dermis_format::{Disc, FrameKind, Full, LowPass, ScaleLaw, writer};
use dermis_runtime::{Avatar, Camera, Plan, Pose};
use dermis_tests::golden::{self, blessing};
use dermis_trainer::draw::draw;
use dermis_trainer::optimize::cloud::{Cloud, Freedom, Parameters, Seed};
use dermis_trainer::optimize::schedule::Random;
use image::{Rgba, RgbaImage};

const SIZE: u32 = 96;
const ROWS: u32 = 12;

/// A ribbon, 1.2 m high, 0.4 m wide, that two joints and a morph target bend: discs, three layers,
/// compensated low-pass, both sides seen.
fn ribbon() -> Source {
    let mut random = Random::new(3);
    let height = |row: u32| row as f32 * (1.2 / ROWS as f32);
    let positions = (0..=ROWS).flat_map(|row| [-0.2, 0.2].map(|x| [x, height(row), 0.0]));
    let weights = |row: u32| {
        let upper = (row as f32 / ROWS as f32 * 2.0 - 0.5).clamp(0.0, 1.0);
        [[(0, 1.0 - upper), (1, upper), (0, 0.0), (0, 0.0)]; 2]
    };
    let triangles = (0..ROWS).flat_map(|row| {
        let a = 2 * row;
        [[a, a + 1, a + 3], [a, a + 3, a + 2]]
    });
    let seeds: Vec<Seed> = (0..480)
        .map(|_| {
            let triangle = random.below(2 * ROWS);
            let [x, y] = [0; 2].map(|_| 1.2 * random.unit() - 0.6);
            let stripe =
                if (triangle / 4).is_multiple_of(2) { [0.9, 0.35, 0.1] } else { [0.1, 0.4, 0.8] };
            let parameters = Parameters {
                position: [x, y, 0.1 * random.unit() - 0.05],
                angle: 3.0 * random.unit(),
                log2_scale: [0; 2].map(|_| -2.6 - random.unit()),
                logit: 4.0 * random.unit() - 0.5,
                color: stripe.map(|c: f32| (c + 0.2 * random.unit() - 0.1).max(0.0)),
            };
            Seed { triangle, parameters, freedom: Freedom::Free }
        })
        .collect();
    let cloud = Cloud::arrange(vec![30, 90, 360], &seeds);
    let joint = |name: &str, parent, y| Joint {
        name: name.into(),
        parent,
        translation: [0.0, y, 0.0],
        ..Joint::default()
    };
    let inverse = |y: f32| [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, -y], [0.0, 0.0, 1.0, 0.0]];
    // Upright, 45° about x, 45° about z.
    let (cos, sin) = (0.923_879_5, 0.382_683_43);
    let bend = vec![1.0, 0.0, 0.0, 0.0, cos, sin, 0.0, 0.0, cos, 0.0, 0.0, sin];
    Source {
        mesh: Mesh {
            positions: positions.collect(),
            step: 0.0,
            influences: (0..=ROWS).flat_map(weights).collect(),
            triangles: triangles.collect(),
            two_sided: vec![true; 2 * ROWS as usize],
            coarser: Vec::new(),
            triangle_regions: Vec::new(),
            morph_targets: vec![Morph {
                name: "wide".into(),
                default_weight: 0.0,
                deltas: (8..14)
                    .map(|v| (v, [if v % 2 == 0 { -0.15 } else { 0.15 }, 0.0, 0.0]))
                    .collect(),
                ..Morph::default()
            }],
        },
        rig: Rig {
            joints: vec![joint("root", None, 0.0), joint("bend", Some(0), 0.6)],
            binds: vec![(0, inverse(0.0)), (1, inverse(0.6))],
            clips: vec![Clip {
                name: "bow".into(),
                seconds: 1.0,
                channels: vec![
                    Channel {
                        property: Property::Rotation(1),
                        holds: false,
                        values: bend,
                        step: 0.0,
                    },
                    Channel {
                        property: Property::Weight(0),
                        holds: false,
                        values: vec![0.0, 1.0],
                        step: 0.0,
                    },
                ],
            }],
        },
        regions: vec![Region {
            name: "all".into(),
            layers: cloud.layers.clone(),
            gaussians: Gaussians::Disc(
                cloud.full().iter().map(Parameters::disc).collect::<Vec<Disc>>(),
            ),
            triangles: cloud.triangles.clone(),
            ..Region::default()
        }],
        mathematics: Mathematics {
            frame: FrameKind::Area,
            low_pass: LowPass::Compensated,
            ..Mathematics::default()
        },
        bounds: [[-0.2, 0.0, 0.0], [0.2, 1.2, 0.0]],
        ..Source::default()
    }
}

/// A ball of full Gaussians that no mesh moves: classic low-pass, harmonics of degree 1.
fn ball() -> Source {
    let mut random = Random::new(5);
    let mut signed = || 2.0 * random.unit() - 1.0;
    let mut fulls = Vec::new();
    let mut harmonics = Vec::new();
    for _ in 0..300 {
        let direction: [f32; 3] = [0; 3].map(|_| signed());
        let length = direction.iter().map(|x| x * x).sum::<f32>().sqrt().max(0.1);
        let q: [f32; 4] = [0; 4].map(|_| signed());
        let norm = q.iter().map(|x| x * x).sum::<f32>().sqrt().max(0.1);
        fulls.push(Full {
            position: direction.map(|x| x / length * 0.5),
            rotation: q.map(|x| x / norm),
            log2_scale: [0; 3].map(|_| -4.5 + signed()),
            color: direction.map(|x| 0.5 + 0.4 * x / length),
            opacity: 0.55 + 0.4 * signed(),
        });
        harmonics.push((0..9).map(|_| 0.3 * signed()).collect());
    }
    Source {
        regions: vec![Region {
            name: "all".into(),
            layers: vec![75, 225],
            gaussians: Gaussians::Full(fulls),
            harmonics,
            ..Region::default()
        }],
        mathematics: Mathematics {
            frame: FrameKind::World,
            low_pass: LowPass::Classic,
            scale_law: ScaleLaw::Constant,
            harmonics_degree: 1,
        },
        bounds: [[-0.6; 3], [0.6; 3]],
        ..Source::default()
    }
}

/// A camera before an avatar. Written down instead of made by `orbit`, whose sines are those of
/// the platform.
fn camera(world_to_camera: [[f32; 4]; 3]) -> Camera {
    let (focal, middle) = (102.93633, SIZE as f32 / 2.0);
    Camera {
        width: SIZE,
        height: SIZE,
        fx: focal,
        fy: focal,
        cx: middle,
        cy: middle,
        world_to_camera,
    }
}

/// 35° to the ribbon's left, 10° above the horizon, towards its middle at 0.35 s.
const BEFORE_RIBBON: [[f32; 4]; 3] = [
    [0.81915194, 0.0, -0.5735764, 0.08509153],
    [0.099600494, -0.98480767, 0.14224423, 0.52598095],
    [-0.56486255, -0.17364818, -0.80670726, 1.6605021],
];

/// From the same side, towards its middle at 0.8 s.
const BEFORE_RIBBON_LATER: [[f32; 4]; 3] = [
    [0.81915194, 0.0, -0.5735764, 0.10137266],
    [0.099600494, -0.98480767, 0.14224423, 0.58073145],
    [-0.56486255, -0.17364818, -0.80670726, 1.6924162],
];

/// 20° to the ball's right, 25° above the horizon.
const BEFORE_BALL: [[f32; 4]; 3] = [
    [0.9396926, 0.0, 0.34202012, 2.9802322e-8],
    [-0.14454395, -0.9063077, 0.39713126, 0.0],
    [0.3099755, -0.42261827, -0.8516507, 1.56],
];

/// The stored bytes of an avatar.
fn stored(name: &str, source: impl FnOnce() -> Source) -> Vec<u8> {
    let path = golden::path("data", &format!("{name}.dermis"));
    if blessing() {
        let bytes = writer::encode(&source()).expect("the source is valid");
        std::fs::write(&path, bytes).expect("the data folder can be written");
    }
    std::fs::read(&path).expect("the avatar is stored; DERMIS_BLESS=1 makes it")
}

#[test]
fn ribbon_in_mid_clip_at_a_budget() {
    let bytes = stored("ribbon", ribbon);
    let avatar = Avatar::parse(&bytes).expect("stored avatars are valid");
    for (name, seconds, budget, view) in
        [("ribbon", 0.35, u32::MAX, BEFORE_RIBBON), ("ribbon_100", 0.8, 100, BEFORE_RIBBON_LATER)]
    {
        let pose = Pose::Clip { clip: 0, seconds };
        let plan = Plan::with_budget(&avatar, budget);
        let drawn =
            draw(&avatar, &pose, &plan, &camera(view), [0.1, 0.1, 0.15]).expect("it is drawn");
        golden::check(name, &drawn.rgba, SIZE, SIZE);
    }
}

#[test]
fn ball_of_full_gaussians() {
    let bytes = stored("ball", ball);
    let avatar = Avatar::parse(&bytes).expect("stored avatars are valid");
    let plan = Plan::with_budget(&avatar, u32::MAX);
    let drawn =
        draw(&avatar, &Pose::Rest, &plan, &camera(BEFORE_BALL), [1.0; 3]).expect("it is drawn");
    golden::check("ball", &drawn.rgba, SIZE, SIZE);
}

#[test]
fn a_panel_shows_both_pictures_and_their_difference() {
    let grey = |value| RgbaImage::from_pixel(1, 1, Rgba([value, value, value, 255]));
    let panel = golden::panel(&grey(10), &grey(12));
    assert_eq!(panel.pixels().map(|p| p.0[0]).collect::<Vec<_>>(), [10, 160, 12]);
}
