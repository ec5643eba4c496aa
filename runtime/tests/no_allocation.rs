//! Reading, posing, planning and drawing take nothing from the heap, whatever the avatar holds.

use std::alloc::System;

use dermis_format::rig::Property;
use dermis_format::source::{Channel, Clip, Gaussians, Joint, Mathematics, Morph, Rig};
use dermis_format::source::{Mesh, Region, Source};
use dermis_format::writer::encode;
use dermis_format::{Disc, FrameKind, Full};
use dermis_runtime::math::IDENTITY;
use dermis_runtime::{
    Avatar, Background, Camera, Framebuffer, Kernel, Pixels, Plan, Pose, render, scratch_len,
};
use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

fn disc(i: u16) -> Disc {
    Disc {
        position: [f32::from(i % 17) / 17.0 - 0.5, f32::from(i % 13) / 13.0 - 0.5, 0.0],
        angle: 0.1,
        log2_scale: [-2.0, -4.0],
        color: [1.0, 0.5, 0.0],
        opacity: 0.5,
    }
}

fn full(i: u16) -> Full {
    let Disc { position, log2_scale: [a, b], color, opacity, .. } = disc(i);
    Full { position, rotation: [0.6, 0.0, 0.8, 0.0], log2_scale: [a, b, b], color, opacity }
}

/// 500 discs in two layers.
fn discs() -> Source {
    Source {
        mesh: Mesh {
            positions: vec![[1.0, 0.0, 0.0], [-0.5, 0.7, 0.0], [-0.5, -0.7, 0.0]],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        },
        regions: vec![Region {
            name: "all".into(),
            layers: vec![200, 300],
            gaussians: Gaussians::Disc((0..500).map(disc).collect()),
            triangles: vec![0; 500],
            ..Region::default()
        }],
        ..Source::default()
    }
}

/// The same with parameters per level.
fn leveled() -> Source {
    let mut source = discs();
    let earlier = (0..200).map(|i| Disc { angle: 2.0, ..disc(i) }).collect();
    source.regions[0].levels = vec![earlier];
    source
}

/// The same with an opacity per level, two joints, a morph target and a clip.
fn rigged() -> Source {
    let mut source = discs();
    source.regions[0].later_opacities =
        (0..500).map(|i| if i < 200 { vec![0.4] } else { Vec::new() }).collect();
    source.mesh.influences = vec![[(0, 0.5), (1, 0.5), (0, 0.0), (0, 0.0)]; 3];
    source.mesh.morph_targets = vec![Morph {
        name: "lift".into(),
        default_weight: 0.5,
        deltas: vec![(1, [0.0, 0.1, 0.0])],
        ..Morph::default()
    }];
    let joint = |parent| Joint { name: "joint".into(), parent, ..Joint::default() };
    let channel = |property, holds, values: &[f32]| Channel {
        property,
        holds,
        values: values.to_vec(),
        step: 0.0,
    };
    source.rig = Rig {
        joints: vec![joint(None), joint(Some(0))],
        binds: vec![(0, IDENTITY), (1, IDENTITY)],
        clips: vec![Clip {
            name: "move".into(),
            seconds: 2.0,
            channels: vec![
                channel(Property::Translation(1), false, &[0.0, 0.0, 0.0, 0.1, 0.0, 0.0]),
                channel(Property::Rotation(1), false, &[1.0, 0.0, 0.0, 0.0, 0.8, 0.0, 0.0, 0.6]),
                channel(Property::Scale(0), true, &[1.0, 1.0, 1.0]),
                channel(Property::Weight(0), false, &[0.0, 1.0]),
            ],
        }],
    };
    source
}

/// Full Gaussians with harmonics of degree 3, on an Edge frame or in the world.
fn fulls(frame: FrameKind) -> Source {
    let mut source = discs();
    if frame == FrameKind::World {
        source.mesh = Mesh::default();
        source.regions[0].triangles.clear();
    }
    source.regions[0].gaussians = Gaussians::Full((0..500).map(full).collect());
    source.regions[0].harmonics = vec![vec![0.1; 45]; 500];
    source.mathematics = Mathematics { frame, harmonics_degree: 3, ..Mathematics::default() };
    source
}

/// Fewest allocations of a frame in eight runs: the test's own threads may allocate beside us, and
/// what we do not need is not there in every run.
fn least_allocations(source: &Source, pose: &Pose<'_>) -> usize {
    let bytes = encode(source).unwrap();
    let camera = Camera {
        width: 100,
        height: 60,
        fx: 60.0,
        fy: 60.0,
        cx: 50.0,
        cy: 30.0,
        world_to_camera: [[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 2.0]],
    };
    let mut pixels = vec![0; 100 * 60 * 4];
    let mut scratch = vec![0; scratch_len(&Avatar::parse(&bytes).unwrap(), 500, 100, 60)];
    let runs = (0..8).map(|_| {
        let kernel = Kernel::detect();
        let before = ALLOCATOR.stats().allocations;
        let avatar = Avatar::parse(&bytes).unwrap();
        let plan = Plan::with_budget(&avatar, 400);
        let background = Background::Color([1.0; 3]);
        let pixels = Pixels::Rgba8(&mut pixels);
        let mut framebuffer = Framebuffer { pixels, stride: 400, background, depth: None };
        let statistics =
            render(&avatar, pose, &plan, &camera, kernel, &mut scratch, &mut framebuffer).unwrap();
        assert_eq!(statistics.gaussians_selected, 400);
        assert!(statistics.counts.blends > 1000);
        ALLOCATOR.stats().allocations - before
    });
    runs.min().unwrap_or(usize::MAX)
}

/// One test, so that no other allocates meanwhile.
#[test]
fn a_frame_allocates_nothing() {
    let vertices = discs().mesh.positions;
    let clip = Pose::Clip { clip: 0, seconds: 0.7 };
    let joints = Pose::Joints { worlds: &[IDENTITY; 2], weights: &[0.5] };
    let cases = [
        ("discs at rest", discs(), Pose::Rest),
        ("discs on given vertices", discs(), Pose::Vertices(&vertices)),
        ("parameters per level", leveled(), Pose::Rest),
        ("rig and opacity per level at rest", rigged(), Pose::Rest),
        ("rig and opacity per level in a clip", rigged(), clip),
        ("rig and opacity per level with given joints", rigged(), joints),
        ("full records and harmonics on a triangle", fulls(FrameKind::Edge), Pose::Rest),
        ("full records and harmonics in the world", fulls(FrameKind::World), Pose::Rest),
    ];
    for (name, source, pose) in cases {
        assert_eq!(least_allocations(&source, &pose), 0, "{name}");
    }
}
