//! Plans, poses and cameras, made of an input's parameters: most of them sensible, some of them not.

use dermis_format::Avatar;
use dermis_fuzz::Parameters;
use dermis_runtime::{Camera, Plan, Pose};

/// Greatest sides of a frame, px: three tiles, the last one cut.
const MOST: [u32; 2] = [72, 40];

/// What is drawn, and from where.
pub(crate) struct Scene<'s, 'a> {
    pub(crate) avatar: &'s Avatar<'a>,
    pub(crate) plan: Plan,
    /// What the plan was asked to keep to.
    pub(crate) budget: u32,
    pub(crate) camera: Camera,
}

impl<'s, 'a> Scene<'s, 'a> {
    pub(crate) fn new(avatar: &'s Avatar<'a>, parameters: &mut Parameters<'_>) -> Self {
        let (plan, budget) = plan(avatar, parameters);
        Self { avatar, plan, budget, camera: camera(avatar, parameters) }
    }
}

fn plan(avatar: &Avatar<'_>, parameters: &mut Parameters<'_>) -> (Plan, u32) {
    let regions = usize::from(avatar.header().regions);
    let present: u32 = (0..regions).map(|region| avatar.present(region)).sum();
    match parameters.byte() % 4 {
        0 => (Plan::with_budget(avatar, u32::MAX), u32::MAX),
        1 => {
            let budget = parameters.word() % present.saturating_add(2);
            let plan = Plan::with_budget(avatar, budget);
            assert_eq!(plan.gaussians(), budget.min(present), "budgets are used");
            (plan, budget)
        }
        2 => {
            let usual = f32::from(parameters.byte()) / 32.0 - 1.0;
            (Plan::at_level(avatar, parameters.or_odd(usual)), u32::MAX)
        }
        _ => {
            let [a, b] = [0; 2].map(|_| parameters.word());
            let count = |i: usize| a.rotate_left(7 * i as u32) ^ (b >> (i % 32));
            let counts = (0..regions).map(|i| match i % 3 {
                0 => count(i),
                _ => count(i) % avatar.present(i).saturating_add(1),
            });
            let budget = counts.clone().map(u64::from).sum::<u64>().min(u64::from(u32::MAX));
            (Plan::of_counts(avatar, counts), budget as u32)
        }
    }
}

/// Looks at the middle of the avatar's box, from any side and distance; up to three of its numbers are others.
fn camera(avatar: &Avatar<'_>, parameters: &mut Parameters<'_>) -> Camera {
    let [low, high] = [avatar.header().box_min, avatar.header().box_max];
    let middle: [f32; 3] = core::array::from_fn(|i| 0.5 * (low[i] + high[i]));
    let size = (0..3).map(|i| (high[i] - low[i]).abs()).fold(0.1, f32::max);
    let (yaw, pitch) = (core::f32::consts::PI * parameters.signed(), 1.6 * parameters.signed());
    let ([sy, cy], [sp, cp]) = ([yaw.sin(), yaw.cos()], [pitch.sin(), pitch.cos()]);
    let rows = [[cy, 0.0, -sy], [-sy * sp, -cp, -cy * sp], [-sy * cp, sp, -cy * cp]];
    let distance = 1.5 * size * (4.0 * parameters.signed()).exp2();
    let shift = [parameters.signed(), parameters.signed(), 1.0].map(|x| x * distance);
    let mut numbers: [f32; 16] = [0.0; 16];
    for (i, row) in rows.iter().enumerate() {
        let moved: f32 = (0..3).map(|j| row[j] * middle[j]).sum();
        numbers[4 * i..4 * i + 3].copy_from_slice(row);
        numbers[4 * i + 3] = shift[i] * if i == 2 { 1.0 } else { 0.3 } - moved;
    }
    let [width, height] = MOST.map(|most| 1 + u32::from(parameters.byte()) % most);
    let side = width.max(height) as f32;
    numbers[12] = side * (2.0 * parameters.signed()).exp2();
    numbers[13] = numbers[12];
    numbers[14] = 0.5 * width as f32;
    numbers[15] = 0.5 * height as f32;
    for _ in 0..parameters.byte().saturating_sub(192) / 16 {
        let at = usize::from(parameters.byte() % 16);
        numbers[at] = parameters.odd();
    }
    let row = |i: usize| core::array::from_fn(|j| numbers[4 * i + j]);
    Camera {
        width,
        height,
        fx: numbers[12],
        fy: numbers[13],
        cx: numbers[14],
        cy: numbers[15],
        world_to_camera: [row(0), row(1), row(2)],
    }
}

/// How it stands, with what that borrows.
pub(crate) enum Standing {
    Rest,
    Clip(usize, f32),
    Joints(Vec<[[f32; 4]; 3]>, Vec<f32>),
    Vertices(Vec<[f32; 3]>),
}

impl Standing {
    pub(crate) fn new(avatar: &Avatar<'_>, parameters: &mut Parameters<'_>) -> Self {
        let header = avatar.header();
        let kind = parameters.byte() % 8;
        // Now and then one too many.
        let len = |len: usize, odd: u8| len + usize::from(odd == 255);
        match kind {
            0 => Self::Rest,
            1..4 => {
                let clip = usize::from(parameters.byte()) % (usize::from(header.clips) + 1);
                let seconds = 4.0 * parameters.signed();
                Self::Clip(clip, parameters.or_odd(seconds))
            }
            4..6 => {
                let odd = parameters.byte();
                let mut worlds =
                    vec![
                        [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
                        len(header.joints.into(), odd)
                    ];
                let mut weights = vec![0.0; len(header.morph_targets.into(), odd)];
                for _ in 0..8 {
                    let [joint, at] = [0; 2].map(|_| usize::from(parameters.byte()));
                    let (usual, n) = (parameters.signed(), worlds.len().max(1));
                    let number = parameters.or_odd(usual);
                    if let Some(world) = worlds.get_mut(joint % n) {
                        world[at % 3][at / 3 % 4] += number;
                    }
                    if let Some(weight) = weights.get_mut(joint) {
                        *weight = number;
                    }
                }
                Self::Joints(worlds, weights)
            }
            _ => {
                let n = len(header.vertices as usize, parameters.byte());
                let mut vertices: Vec<[f32; 3]> =
                    (0..n).map(|index| avatar.vertex_position(index)).collect();
                for _ in 0..8 {
                    let at = usize::from(parameters.byte());
                    let usual = parameters.signed();
                    let number = parameters.or_odd(usual);
                    if let Some(vertex) = vertices.get_mut(at / 3 % n.max(1)) {
                        vertex[at % 3] = number;
                    }
                }
                Self::Vertices(vertices)
            }
        }
    }

    pub(crate) fn pose(&self) -> Pose<'_> {
        match self {
            Self::Rest => Pose::Rest,
            &Self::Clip(clip, seconds) => Pose::Clip { clip, seconds },
            Self::Joints(worlds, weights) => Pose::Joints { worlds, weights },
            Self::Vertices(vertices) => Pose::Vertices(vertices),
        }
    }
}
