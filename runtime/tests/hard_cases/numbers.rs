//! Odd numbers: what each draws, and that none of them reaches a pixel.

use dermis_format::rig::Property;
use dermis_format::source::{Channel, Clip, Gaussians, Joint, Morph, Rig, Source};
use dermis_format::{Disc, FrameKind, Full};
use dermis_runtime::math::{Affine, IDENTITY};
use dermis_runtime::{Avatar, Camera, Error, Kernel, Plan, Pose, Posed};
use proptest::prelude::*;

use crate::scenes::{
    BALL, DOT, Picture, UNIT, bytes, camera, camera_behind, cloud, crowd, sheet, tiles, visible,
};

const NAN: f32 = f32::NAN;
const INFINITE: f32 = f32::INFINITY;
const ODD: [f32; 14] = [
    NAN,
    INFINITE,
    -INFINITE,
    0.0,
    -0.0,
    1.0,
    -1.0,
    1e-30,
    1e30,
    -1e30,
    f32::MAX,
    f32::MIN,
    f32::MIN_POSITIVE,
    1e-40,
];

/// How many of one disc are visible when [`UNIT`] moves to these corners.
fn visible_on(corners: [[f32; 3]; 3], two_sided: bool) -> u32 {
    let mut source = sheet(&[DOT]);
    source.mesh.two_sided = vec![two_sided];
    let bytes = bytes(&source);
    let avatar = Avatar::parse(&bytes).unwrap();
    visible(&avatar, &Pose::Vertices(&corners), &camera(40, 40, 40.0, 3.0))
}

#[test]
fn backs_are_culled_by_the_two_sided_bit() {
    let mut source = sheet(&[DOT]);
    for (two_sided, behind) in [(false, 0), (true, 1)] {
        source.mesh.two_sided = vec![two_sided];
        let bytes = bytes(&source);
        let avatar = Avatar::parse(&bytes).unwrap();
        assert_eq!(visible(&avatar, &Pose::Rest, &camera(8, 8, 8.0, 1.0)), 1);
        assert_eq!(visible(&avatar, &Pose::Rest, &camera_behind(8, 8, 8.0, 1.0)), behind);
    }
    // Seen exactly from the side a triangle has no front.
    let side = Camera {
        world_to_camera: [[0.0, 0.0, -1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 2.0]],
        ..camera(8, 8, 8.0, 1.0)
    };
    source.mesh.two_sided = vec![false];
    let bytes = bytes(&source);
    assert_eq!(visible(&Avatar::parse(&bytes).unwrap(), &Pose::Rest, &side), 0);
}

/// A needle keeps its length along x and thins by its area: finite at every thinness, until f32 sees no area.
#[test]
fn needles_thin_until_they_vanish() {
    let mut last = u32::MAX;
    for exponent in 0..46 {
        let thin = 10f32.powi(-exponent);
        let corners = UNIT.map(|[x, y, z]| [x, y * thin, z]);
        let now = visible_on(corners, true);
        assert!(now <= last && now <= 1, "it came back at 1e-{exponent}");
        last = now;
    }
    assert_eq!(last, 0);
}

#[test]
fn a_bad_vertex_takes_out_its_own_triangles_only() {
    let mut source = sheet(&[DOT, DOT]);
    source.mesh.positions.extend(UNIT.map(|[x, y, z]| [x + 1.0, y, z]));
    source.mesh.triangles.push([3, 4, 5]);
    source.mesh.two_sided.push(false);
    source.regions[0].triangles = vec![0, 1];
    let bytes = bytes(&source);
    let avatar = Avatar::parse(&bytes).unwrap();
    let camera = camera(64, 64, 32.0, 2.0);
    let plan = Plan::with_budget(&avatar, u32::MAX);
    let good = source.mesh.positions.clone();
    assert_eq!(visible(&avatar, &Pose::Vertices(&good), &camera), 2);
    let mut collapsed = good.clone();
    collapsed[4] = collapsed[3];
    let alone = Picture::of(&avatar, &Pose::Vertices(&collapsed), &plan, &camera);
    for odd in [NAN, INFINITE, -INFINITE, f32::MAX] {
        for axis in 0..3 {
            let mut bad = good.clone();
            bad[4][axis] = odd;
            if odd == f32::MAX {
                // Finite, but its triangle is 1e38 m long.
                tiles(&avatar, &Pose::Vertices(&bad), &plan, &camera);
            } else {
                assert_eq!(Picture::of(&avatar, &Pose::Vertices(&bad), &plan, &camera), alone);
            }
        }
    }
}

/// A Gaussian is drawn from 0.01 m before the camera on; far away the classic low-pass leaves a dot.
#[test]
fn the_near_plane_is_at_a_centimetre() {
    let source = cloud(&[BALL]);
    let bytes = bytes(&source);
    let avatar = Avatar::parse(&bytes).unwrap();
    let expected =
        [(-1.0, 0), (-0.01, 0), (0.0, 0), (0.009_999, 0), (0.01, 1), (1.0, 1), (1e30, 1)];
    for (depth, expected) in expected {
        assert_eq!(
            visible(&avatar, &Pose::Rest, &camera(32, 32, 32.0, depth)),
            expected,
            "{depth} m"
        );
    }
}

#[test]
fn a_camera_that_is_not_finite_sees_nothing() {
    let sources = [cloud(&[BALL]), sheet(&[DOT])];
    for source in sources {
        let bytes = bytes(&source);
        let avatar = Avatar::parse(&bytes).unwrap();
        for odd in [NAN, INFINITE, -INFINITE] {
            for number in 0..16 {
                let mut camera = camera(32, 32, 32.0, 1.0);
                match number {
                    0 => camera.fx = odd,
                    1 => camera.fy = odd,
                    2 => camera.cx = odd,
                    3 => camera.cy = odd,
                    n => camera.world_to_camera[(n - 4) / 4][n % 4] = odd,
                }
                assert_eq!(visible(&avatar, &Pose::Rest, &camera), 0, "number {number}: {odd}");
            }
        }
    }
}

/// Two joints, one triangle on each, a morph target that moves the second, and a clip.
pub(crate) fn rigged() -> Source {
    let mut source = sheet(&[DOT, DOT]);
    source.mesh.positions.extend(UNIT.map(|[x, y, z]| [x + 1.0, y, z]));
    source.mesh.triangles.push([3, 4, 5]);
    source.mesh.two_sided.push(false);
    source.regions[0].triangles = vec![0, 1];
    let one = |bind| [(bind, 1.0), (1 - bind, 0.0), (0, 0.0), (0, 0.0)];
    source.mesh.influences = [0, 0, 0, 1, 1, 1].map(one).to_vec();
    source.mesh.morph_targets = vec![Morph {
        name: "lift".into(),
        default_weight: 0.0,
        deltas: (3..6).map(|v| (v, [0.0, 0.5, 0.0])).collect(),
        ..Morph::default()
    }];
    let joint = |parent| Joint { name: "joint".into(), parent, ..Joint::default() };
    source.rig = Rig {
        joints: vec![joint(None), joint(Some(0))],
        binds: vec![(0, IDENTITY), (1, IDENTITY)],
        clips: vec![Clip {
            name: "move".into(),
            seconds: 2.0,
            channels: vec![
                Channel {
                    property: Property::Translation(1),
                    holds: false,
                    values: vec![0.0, 0.0, 0.0, 0.0, 0.25, 0.0, 0.5, 0.25, 0.0],
                    step: 0.0,
                },
                Channel {
                    property: Property::Weight(0),
                    holds: true,
                    values: vec![0.0, 1.0],
                    step: 0.0,
                },
            ],
        }],
    };
    source
}

/// Vertex 3 in a pose.
fn vertex(avatar: &Avatar<'_>, pose: &Pose<'_>) -> [f32; 3] {
    let mut scratch = vec![0; Posed::scratch_len(avatar)];
    Posed::new(avatar, pose, Kernel::Scalar, &mut scratch).unwrap().vertices()[3]
}

#[test]
fn clips_move_joints_and_morph_targets() {
    let bytes = bytes(&rigged());
    let avatar = Avatar::parse(&bytes).unwrap();
    let at = |seconds| {
        let [x, y, _] = vertex(&avatar, &Pose::Clip { clip: 0, seconds });
        [x - 2.0, y]
    };
    let expected = [
        (-1.0, [0.0, 0.0]),
        (NAN, [0.0, 0.0]),
        (0.0, [0.0, 0.0]),
        (0.5, [0.0, 0.125]),
        (1.0, [0.0, 0.25]),
        (1.5, [0.25, 0.25]),
        // The weight holds its first key until the clip's end.
        (2.0, [0.5, 0.75]),
        (9.0, [0.5, 0.75]),
        (INFINITE, [0.5, 0.75]),
    ];
    for (seconds, expected) in expected {
        let found = at(seconds);
        let near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4);
        assert!(near, "{seconds} s: {found:?}, expected {expected:?}");
    }
}

#[test]
fn poses_of_other_avatars_are_errors() {
    let bytes = bytes(&rigged());
    let avatar = Avatar::parse(&bytes).unwrap();
    let mut scratch = vec![0; Posed::scratch_len(&avatar)];
    let mut error = |pose: &Pose<'_>| {
        Posed::new(&avatar, pose, Kernel::Scalar, &mut scratch).map(|_| ()).unwrap_err()
    };
    let pose = |what, expected, found| Error::Pose { what, expected, found };
    let worlds = [IDENTITY; 3];
    assert_eq!(error(&Pose::Vertices(&[[0.0; 3]; 5])), pose("vertices", 6, 5));
    assert_eq!(error(&Pose::Joints { worlds: &worlds, weights: &[0.0] }), pose("joints", 2, 3));
    assert_eq!(
        error(&Pose::Joints { worlds: &worlds[..2], weights: &[] }),
        pose("morph weights", 1, 0)
    );
    let late = Pose::Clip { clip: 1, seconds: 0.0 };
    assert_eq!(error(&late), Error::Clip { clips: 1, index: 1 });
}

#[test]
fn joints_and_weights_that_are_not_finite_take_out_what_hangs_on_them() {
    let bytes = bytes(&rigged());
    let avatar = Avatar::parse(&bytes).unwrap();
    let camera = camera(64, 64, 32.0, 2.0);
    let mut worlds = [IDENTITY; 2];
    let seen = |worlds: &[Affine], weights: &[f32]| {
        visible(&avatar, &Pose::Joints { worlds, weights }, &camera)
    };
    assert_eq!(seen(&worlds, &[0.0]), 2);
    for odd in [NAN, INFINITE, -INFINITE] {
        assert_eq!(seen(&worlds, &[odd]), 1, "weight {odd}");
        for number in 0..12 {
            worlds[1][number / 4][number % 4] = odd;
            assert_eq!(seen(&worlds, &[0.0]), 1, "number {number}: {odd}");
            worlds[1] = IDENTITY;
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn no_vertices_put_a_nan_in_a_pixel(
        corners in prop::array::uniform9(prop::sample::select(ODD.to_vec())),
        size in prop::sample::select(vec![-40f32, -8.0, 0.0, 8.0, 40.0]),
        at in prop::sample::select(vec![0f32, 1.0, 1e12, -1e12]),
    ) {
        let disc = Disc { position: [at, 0.0, 0.0], log2_scale: [size, 0.0], ..DOT };
        let mut source = sheet(&[disc]);
        source.mesh.two_sided = vec![true];
        let bytes = bytes(&source);
        let avatar = Avatar::parse(&bytes).unwrap();
        let corners = [0, 3, 6].map(|i| [corners[i], corners[i + 1], corners[i + 2]]);
        visible(&avatar, &Pose::Vertices(&corners), &camera(33, 17, 20.0, 2.0));
    }

    #[test]
    fn no_joints_put_a_nan_in_a_pixel(
        numbers in prop::collection::vec(prop::sample::select(ODD.to_vec()), 25),
    ) {
        let bytes = bytes(&rigged());
        let avatar = Avatar::parse(&bytes).unwrap();
        let world = |at: usize| std::array::from_fn(|r| std::array::from_fn(|c| numbers[at + r * 4 + c]));
        let pose = Pose::Joints { worlds: &[world(0), world(12)], weights: &numbers[24..] };
        visible(&avatar, &pose, &camera(33, 17, 20.0, 2.0));
    }

    #[test]
    fn no_camera_puts_a_nan_in_a_pixel(
        numbers in prop::array::uniform16(prop::sample::select(ODD.to_vec())),
        keep in any::<u16>(),
        full in any::<bool>(),
    ) {
        let mut source = sheet(&[DOT, Disc { log2_scale: [6.0, -20.0], ..DOT }]);
        source.mesh.two_sided = vec![true];
        if full {
            source = cloud(&[BALL, Full { log2_scale: [40.0, -40.0, 0.0], ..BALL }]);
        }
        let bytes = bytes(&source);
        let avatar = Avatar::parse(&bytes).unwrap();
        let mut camera = camera(33, 17, 20.0, 2.0);
        let [fx, fy, cx, cy] = [0, 1, 2, 3];
        let set = |bit: usize, slot: &mut f32| {
            if keep >> bit & 1 == 0 {
                *slot = numbers[bit];
            }
        };
        set(fx, &mut camera.fx);
        set(fy, &mut camera.fy);
        set(cx, &mut camera.cx);
        set(cy, &mut camera.cy);
        for (i, slot) in camera.world_to_camera.iter_mut().flatten().enumerate() {
            set(4 + i, slot);
        }
        visible(&avatar, &Pose::Rest, &camera);
    }

    /// Scales and places of any size that the format can hold, on every kind of frame.
    #[test]
    fn no_gaussian_puts_a_nan_in_a_pixel(
        position in prop::array::uniform3(prop::sample::select(vec![0f32, 1e-30, 0.3, -1.0, 1e6, 1e12, -1e12])),
        scale in prop::array::uniform3(-40f32..40.0),
        color in prop::array::uniform3(prop::sample::select(vec![-100f32, -0.1, 0.0, 0.5, 1.0, 100.0])),
        opacity in 0f32..=1.0,
        kind in prop::sample::select(vec![FrameKind::World, FrameKind::Area, FrameKind::Edge, FrameKind::Affine]),
        distance in prop::sample::select(vec![0.011f32, 0.5, 2.0, 1e3, 1e6]),
    ) {
        let full = Full { position, log2_scale: scale, color, opacity, rotation: [0.5, 0.5, -0.5, 0.5] };
        let mut source = cloud(&[full, BALL]);
        if kind != FrameKind::World {
            let regions = source.regions;
            source = sheet(&[]);
            source.regions = regions;
            source.regions[0].triangles = vec![0, 0];
            source.mathematics.frame = kind;
        }
        let bytes = bytes(&source);
        let avatar = Avatar::parse(&bytes).unwrap();
        visible(&avatar, &Pose::Rest, &camera(33, 17, 20.0, distance));
    }
}

/// No Gaussians, in all or in some regions.
#[test]
fn empty_regions_draw_nothing() {
    let mut source = crowd();
    let camera = camera(40, 40, 20.0, 2.0);
    source.regions[0].layers = vec![0, 0];
    source.regions[0].gaussians = Gaussians::default();
    source.regions[0].triangles.clear();
    assert_eq!(Picture::of_all(&source, &camera).statistics.gaussians_selected, 200);
    source.regions.truncate(1);
    let picture = Picture::of_all(&source, &camera);
    assert_eq!(picture.statistics, Default::default());
    assert!(picture.pixels.chunks_exact(4).all(|pixel| pixel == [0, 0, 0, 255]));
}
