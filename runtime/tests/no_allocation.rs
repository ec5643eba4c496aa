//! Reading, posing, planning and drawing take nothing from the heap.

use std::alloc::System;

use dermis_format::Disc;
use dermis_format::source::{Gaussians, Mesh, Region, Source};
use dermis_format::writer::encode;
use dermis_runtime::{Avatar, Background, Camera, Framebuffer, Plan, Pose, render, scratch_len};
use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

#[test]
fn a_frame_allocates_nothing() {
    let disc = |i: u16| Disc {
        position: [f32::from(i % 17) / 17.0 - 0.5, f32::from(i % 13) / 13.0 - 0.5, 0.0],
        angle: 0.1,
        log2_scale: [-2.0, -4.0],
        color: [1.0, 0.5, 0.0],
        opacity: 0.5,
    };
    let source = Source {
        mesh: Mesh {
            positions: vec![[1.0, 0.0, 0.0], [-0.5, 0.7, 0.0], [-0.5, -0.7, 0.0]],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        },
        regions: vec![Region {
            name: "all".into(),
            layers: vec![500],
            gaussians: Gaussians::Disc((0..500).map(disc).collect()),
            triangles: vec![0; 500],
            ..Region::default()
        }],
        ..Source::default()
    };
    let bytes = encode(&source).unwrap();
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
    // The test's own threads may allocate beside us: what we do not need is not there in every run.
    let least = (0..8).map(|_| {
        let before = ALLOCATOR.stats().allocations;
        let avatar = Avatar::parse(&bytes).unwrap();
        let plan = Plan::with_budget(&avatar, 400);
        let background = Background::Color([1.0; 3]);
        let mut framebuffer = Framebuffer { pixels: &mut pixels, stride: 400, background };
        let statistics =
            render(&avatar, &Pose::Rest, &plan, &camera, &mut scratch, &mut framebuffer).unwrap();
        assert_eq!(statistics.gaussians_selected, 400);
        assert!(statistics.blends > 1000);
        ALLOCATOR.stats().allocations - before
    });
    assert_eq!(least.min(), Some(0));
}
