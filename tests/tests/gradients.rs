//! Gradients against central differences in f64.
//!
//! A derivative is (8 (f(x + h) − f(x − h)) − (f(x + 2h) − f(x − 2h))) / 12h, whose error is of the
//! fourth order, so that h can be large enough for rounding not to matter.

use std::slice;

use dermis_format::{FrameKind, LowPass};
use dermis_runtime::Camera;
use dermis_runtime::frame::Frame;
use dermis_runtime::gaussian::{disc_on, full_on};
use dermis_runtime::math::{dot, rotation_rows};
use dermis_runtime::plan::prefix_log2_scale;
use dermis_runtime::project::{View, project};
use dermis_runtime::raster::{LEAST_TRANSMITTANCE, alpha, log2_alpha};
use dermis_trainer::optimize::backward::by_splats;
use dermis_trainer::optimize::cloud::{Cloud, Freedom, PARAMETERS, Parameters, Prefix, Seed};
use dermis_trainer::optimize::discs::{BATCH, ByDiscs};
use dermis_trainer::optimize::forward::{Forward, Stage, draw};
use dermis_trainer::optimize::projection::{ByScreen, by_disc, by_full};
use dermis_trainer::optimize::schedule::Random;

const KINDS: [LowPass; 3] = [LowPass::Compensated, LowPass::Classic, LowPass::Pixel];

fn central(h: f64, f: impl Fn(f64) -> f64) -> f64 {
    (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)
}

fn between(random: &mut Random, low: f32, high: f32) -> f32 {
    low + (high - low) * random.unit()
}

/// Mean, falloff and log₂ of what the low-pass leaves, as `Splat::pack` computes them.
fn screen(
    view: &View<f64>,
    low_pass: LowPass,
    frame: &Frame<f64>,
    [x, y, z, angle, s, t]: [f64; 6],
) -> [f64; 6] {
    let disc = disc_on(frame, [x, y, z], angle, [s, t]);
    let (p, drawable) = project(view, low_pass, &disc);
    assert!(drawable, "in front of the camera");
    let [a, b, c] = p.falloff;
    [p.mean[0], p.mean[1], a, b, c, p.compensation.log2()]
}

/// A disc before a camera; most of them stand where slopes are clamped.
fn random_disc(random: &mut Random) -> (View<f64>, Frame<f64>, [f64; 6]) {
    let quaternion = [0; 4].map(|_| between(random, -1.0, 1.0));
    let rows = rotation_rows(quaternion);
    let z = between(random, 0.3, 5.0);
    let place = [between(random, -1.5, 1.5) * z, between(random, -1.5, 1.5) * z, z];
    let camera = Camera {
        width: 640,
        height: 480,
        fx: between(random, 400.0, 600.0),
        fy: between(random, 400.0, 600.0),
        cx: between(random, 300.0, 340.0),
        cy: between(random, 220.0, 260.0),
        world_to_camera: [0, 1, 2].map(|i| [rows[i][0], rows[i][1], rows[i][2], place[i]]),
    };
    let size = between(random, 0.01, 0.2);
    let corners = [0; 3].map(|_| [0; 3].map(|_| f64::from(size * between(random, -1.0, 1.0))));
    let frame = Frame::of_triangle(FrameKind::Affine, corners).expect("corners are random");
    let parameters = [
        between(random, -1.0, 1.0),
        between(random, -1.0, 1.0),
        between(random, -0.3, 0.3),
        between(random, -4.0, 4.0),
        between(random, -3.0, 0.5),
        between(random, -3.0, 0.5),
    ];
    (View::new(&camera), frame, parameters.map(f64::from))
}

/// Which slopes are clamped.
fn clamps(view: &View<f64>, frame: &Frame<f64>, p: [f64; 6]) -> [bool; 2] {
    let point @ [x, y, z] = view.point(frame.point([p[0], p[1], p[2]]));
    let [sx, sy] = view.slopes(point);
    [sx != x / z, sy != y / z]
}

#[test]
fn projection_has_the_gradient_of_the_runtimes_projection() {
    let mut random = Random::new(7);
    let (mut worst, mut clamped, mut tested) = (0.0f64, 0, 0);
    const STEP: f64 = 1e-4;
    for round in 0..600 {
        let (view, frame, at) = random_disc(&mut random);
        let low_pass = KINDS[round % 3];
        let moved = |i: usize, h: f64| {
            let mut p = at;
            p[i] += h;
            p
        };
        // At the limit of the slopes there is no derivative.
        let here = clamps(&view, &frame, at);
        let steps = [-2.0 * STEP, 2.0 * STEP];
        let near_limit =
            (0..3).any(|i| steps.iter().any(|&h| clamps(&view, &frame, moved(i, h)) != here));
        // Seen edge-on a compensated disc has no opacity, whose logarithm has no derivative.
        let now = screen(&view, low_pass, &frame, at);
        if near_limit || now[5] < -9.0 {
            continue;
        }
        tested += 1;
        clamped += usize::from(here.contains(&true));
        // Each output weighs about as much as the others.
        let weights: [f64; 6] = std::array::from_fn(|i| {
            f64::from(between(&mut random, -1.0, 1.0))
                / if (2..5).contains(&i) { now[2].abs() + now[4].abs() } else { 1.0 }
        });
        let value = |p| {
            let outputs = screen(&view, low_pass, &frame, p);
            outputs.iter().zip(weights).map(|(x, w)| x * w).sum::<f64>()
        };
        let by = ByScreen {
            mean: [weights[0], weights[1]],
            falloff: [weights[2], weights[3], weights[4]],
            log2_opacity: weights[5],
        };
        let [x, y, z, angle, s, t] = at;
        let by = by_disc(&view, low_pass, &frame, ([x, y, z], angle, [s, t]), &by);
        let [px, py, pz] = by.position;
        let analytic = [px, py, pz, by.angle, by.log2_scale[0], by.log2_scale[1]];
        let numeric: [f64; 6] = std::array::from_fn(|i| central(STEP, |h| value(moved(i, h))));
        let length =
            dot([numeric[0], numeric[1], numeric[2]], [numeric[0], numeric[1], numeric[2]]);
        for (i, (a, n)) in analytic.into_iter().zip(numeric).enumerate() {
            // A component of the position may be 0 by chance; angle and scales are of order 1.
            let size = if i < 3 { length.sqrt() } else { n.abs().max(0.1) };
            let error = (a - n).abs() / size;
            assert!(error < 1e-6, "round {round}, parameter {i}: {a} instead of {n}");
            worst = worst.max(error);
        }
    }
    println!("{tested} discs, {clamped} of them clamped, worst relative error {worst:.1e}");
    assert!(tested > 300 && clamped > 100, "{tested} {clamped}");
}

/// A rotation, and after it one about `turn` by as much as that is long.
fn turned([w, x, y, z]: [f64; 4], turn: [f64; 3]) -> [f64; 4] {
    let angle = dot(turn, turn).sqrt();
    let (sin, c) = (0.5 * angle).sin_cos();
    let [i, j, k] = turn.map(|t| if angle > 0.0 { t / angle * sin } else { 0.0 });
    [
        c * w - i * x - j * y - k * z,
        c * x + i * w + j * z - k * y,
        c * y - i * z + j * w + k * x,
        c * z + i * y - j * x + k * w,
    ]
}

#[test]
fn projection_of_three_axes_has_the_gradient_of_the_runtimes_projection() {
    let mut random = Random::new(19);
    let (mut worst, mut tested) = (0.0f64, 0);
    const STEP: f64 = 1e-4;
    for round in 0..600 {
        let (view, frame, [x, y, z, .., s, t]) = random_disc(&mut random);
        let low_pass = KINDS[round % 3];
        let quaternion = [0; 4].map(|_| f64::from(between(&mut random, -1.0, 1.0)));
        let length = quaternion.iter().map(|q| q * q).sum::<f64>().sqrt();
        let rotation = quaternion.map(|q| q / length);
        let at = [x, y, z, 0.0, 0.0, 0.0, s, t, f64::from(between(&mut random, -3.0, 0.5))];
        let screen = |[x, y, z, i, j, k, s, t, u]: [f64; 9]| {
            let full = full_on(&frame, [x, y, z], turned(rotation, [i, j, k]), [s, t, u]);
            let (p, drawable) = project(&view, low_pass, &full);
            let [a, b, c] = p.falloff;
            drawable.then(|| [p.mean[0], p.mean[1], a, b, c, p.compensation.log2()])
        };
        let moved = |i: usize, h: f64| {
            let mut p = at;
            p[i] += h;
            p
        };
        let slopes = |p: [f64; 9]| clamps(&view, &frame, [p[0], p[1], p[2], 0.0, 0.0, 0.0]);
        let here = slopes(at);
        let near = |i| [-2.0 * STEP, 2.0 * STEP].iter().any(|&h| slopes(moved(i, h)) != here);
        let Some(now) = screen(at).filter(|_| !(0..3).any(near)) else { continue };
        tested += 1;
        let weights: [f64; 6] = std::array::from_fn(|i| {
            f64::from(between(&mut random, -1.0, 1.0))
                / if (2..5).contains(&i) { now[2].abs() + now[4].abs() } else { 1.0 }
        });
        let value = |p| {
            let outputs = screen(p).expect("it is as near as before");
            outputs.iter().zip(weights).map(|(x, w)| x * w).sum::<f64>()
        };
        let by = ByScreen {
            mean: [weights[0], weights[1]],
            falloff: [weights[2], weights[3], weights[4]],
            log2_opacity: weights[5],
        };
        let by = by_full(&view, low_pass, &frame, ([x, y, z], rotation, [s, t, at[8]]), &by);
        let analytic = [by.position, by.turn, by.log2_scale];
        let numeric: [f64; 9] = std::array::from_fn(|i| central(STEP, |h| value(moved(i, h))));
        for (i, (kind, n)) in analytic.iter().zip(numeric.as_chunks::<3>().0).enumerate() {
            let size = dot(*n, *n).sqrt().max(if i > 0 { 0.1 } else { 0.0 });
            for (a, n) in kind.iter().zip(n) {
                let error = (a - n).abs() / size;
                assert!(error < 1e-6, "round {round}, {i}: {a} instead of {n}");
                worst = worst.max(error);
            }
        }
    }
    println!("{tested} Gaussians, worst relative error {worst:.1e}");
    assert!(tested > 300, "{tested}");
}

const SIZE: u32 = 48;

/// Discs on four triangles that look at the camera from 2 m.
struct Scene {
    cloud: Cloud,
    corners: Vec<[[f32; 3]; 3]>,
    stage: Stage,
    camera: Camera,
    prefix: Prefix,
    low_pass: LowPass,
    background: [f32; 3],
    /// The value whose gradient is taken is Σ weight · pixel: what comes after pixels is no part
    /// of this test, and a linear function adds no error of its own.
    weights: Vec<[f32; 3]>,
}

impl Scene {
    /// Levels have parameters of their own or not; `sigmas` bound the standard deviations in units of the triangles' size, about 14 px.
    fn new(low_pass: LowPass, own_levels: bool, sigmas: [f32; 2], opacities: [f32; 2]) -> Self {
        let mut random = Random::new(11);
        let mut jitter = || between(&mut random, -0.08, 0.08);
        // At z = 0 the camera at z = 2 sees 1 m as 24 px.
        let corners: Vec<[[f32; 3]; 3]> = [(-0.5, -0.4), (0.4, -0.5), (-0.3, 0.5), (0.5, 0.4)]
            .map(|(x, y)| {
                [[-0.4, -0.4], [0.45, -0.35], [0.0, 0.5]]
                    .map(|[dx, dy]| [x + dx + jitter(), y + dy + jitter(), 2.0 * jitter()])
            })
            .to_vec();
        let camera = Camera {
            width: SIZE,
            height: SIZE,
            fx: 48.0,
            fy: 47.0,
            cx: 24.2,
            cy: 23.7,
            world_to_camera: [[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 2.0]],
        };
        let seeds: Vec<Seed> = (0..30)
            .map(|i| {
                let opacity = between(&mut random, opacities[0], opacities[1]);
                let log2 = sigmas.map(f32::log2);
                let parameters = Parameters {
                    position: [
                        between(&mut random, -0.5, 0.5),
                        between(&mut random, -0.5, 0.5),
                        between(&mut random, -0.2, 0.2),
                    ],
                    angle: between(&mut random, -1.5, 1.5),
                    log2_scale: [0; 2].map(|_| between(&mut random, log2[0], log2[1])),
                    logit: (opacity / (1.0 - opacity)).ln(),
                    color: [0; 3].map(|_| between(&mut random, 0.05, 0.95)),
                };
                Seed { triangle: i % 4, parameters, freedom: Freedom::Free }
            })
            .collect();
        let frame = |c: &[[f32; 3]; 3]| Frame::of_triangle(FrameKind::Affine, *c);
        let stage =
            Stage { frames: corners.iter().map(frame).collect(), two_sided: Box::new([false; 4]) };
        let pixels = (SIZE * SIZE) as usize;
        let weights =
            (0..pixels).map(|_| [0; 3].map(|_| between(&mut random, -0.2, 1.0))).collect();
        let mut cloud = Cloud::arrange(vec![8, 22], &seeds);
        if own_levels {
            cloud.split_into_levels(|[count, all]| prefix_log2_scale(count, all));
            // Levels that differ in all they can.
            for (upper, lower) in (0..8).map(|i| (i, i)) {
                let full = cloud.levels[1][upper].to_array();
                let changed = full.map(|p| p + between(&mut random, -0.1, 0.1));
                cloud.levels[0][lower] = Parameters::from_array(changed);
            }
        }
        let prefix = Prefix::of(24, &cloud);
        Self {
            cloud,
            corners,
            stage,
            camera,
            prefix,
            low_pass,
            background: [0.9, 0.4, 0.6],
            weights,
        }
    }

    fn forward(&self) -> Forward {
        let (camera, low_pass) = (&self.camera, self.low_pass);
        draw(
            slice::from_ref(&self.cloud),
            &[self.prefix],
            &self.stage,
            camera,
            low_pass,
            self.background,
        )
    }

    /// Each pixel's blends, front to back, as indices into the cloud: the discrete decisions.
    fn decisions(&self, forward: &Forward) -> Vec<Vec<u32>> {
        let mut order: Vec<usize> = (0..forward.splats.len()).collect();
        order.sort_by(|&a, &b| forward.splats[a].depth.total_cmp(&forward.splats[b].depth));
        let pixel = |index: u32| {
            let [x, y] = [index % SIZE, index / SIZE].map(|i| i as f32 + 0.5);
            let mut transmittance = 1.0;
            let mut blended = Vec::new();
            for &splat in &order {
                let s = &forward.splats[splat];
                let (alpha, touches) = alpha(log2_alpha(s, x - s.mean[0], y - s.mean[1]));
                if touches {
                    assert!(alpha < 0.9, "far from the clamp at 0.99");
                    transmittance *= 1.0 - alpha;
                    blended.push(forward.sources[splat]);
                }
            }
            assert!(transmittance > 2.0 * LEAST_TRANSMITTANCE, "no pixel stops early");
            blended
        };
        (0..SIZE * SIZE).map(pixel).collect()
    }

    /// The value in f64, given the decisions, with a parameter changed: `moved` are a level, a Gaussian and the
    /// parameter.
    fn value(&self, decisions: &[Vec<u32>], moved: [usize; 3], h: f64) -> f64 {
        let view = View::<f64>::new(&self.camera);
        let at_level = |level: usize, index: usize| {
            let mut p = self.cloud.levels[level][index].to_array().map(f64::from);
            if moved[..2] == [level, index] {
                p[moved[2]] += h;
            }
            p[6] = 1.0 / (1.0 + (-p[6]).exp());
            p
        };
        let splats: Vec<([f64; 6], [f64; 3])> = (0..self.cloud.len())
            .map(|index| {
                let mut p = at_level(self.prefix.level, index);
                if self.prefix.lower(&self.cloud, index).is_some() {
                    let lower = at_level(self.prefix.level - 1, index);
                    let share = f64::from(self.prefix.lower_share);
                    p.iter_mut().zip(lower).for_each(|(p, lower)| *p += share * (lower - *p));
                } else {
                    p[4..6].iter_mut().for_each(|s| *s += f64::from(self.prefix.log2_scale));
                }
                let triangle = self.cloud.triangles[index] as usize;
                let corners = self.corners[triangle].map(|c| c.map(f64::from));
                let frame = Frame::of_triangle(FrameKind::Affine, corners).expect("it has an area");
                let geometry = [p[0], p[1], p[2], p[3], p[4], p[5]];
                let mut splat = screen(&view, self.low_pass, &frame, geometry);
                splat[5] += p[6].log2();
                (splat, [p[7], p[8], p[9]])
            })
            .collect();
        let mut value = 0.0;
        for (index, (blended, weights)) in decisions.iter().zip(&self.weights).enumerate() {
            let [x, y] = [index as u32 % SIZE, index as u32 / SIZE].map(|i| f64::from(i) + 0.5);
            let (mut transmittance, mut color) = (1.0, [0.0; 3]);
            for &source in blended {
                let ([u, v, a, b, c, log2_opacity], rgb) = splats[source as usize];
                let (dx, dy) = (x - u, y - v);
                let alpha = (log2_opacity - (a * dx + b * dy).powi(2) - (c * dy).powi(2)).exp2();
                for (sum, c) in color.iter_mut().zip(rgb) {
                    *sum += transmittance * alpha * c;
                }
                transmittance *= 1.0 - alpha;
            }
            for i in 0..3 {
                let pixel = color[i] + transmittance * f64::from(self.background[i]);
                value += f64::from(weights[i]) * pixel;
            }
        }
        value
    }

    /// The trainer's gradient by all parameters of a level; 0 where a Gaussian is not drawn.
    fn gradient(&self, forward: &Forward, level: usize) -> Vec<[f32; PARAMETERS]> {
        let mut gradient = vec![[0.0; PARAMETERS]; self.cloud.levels[level].len()];
        let by_discs = ByDiscs {
            view: View::new(&self.camera),
            low_pass: self.low_pass,
            stage: &self.stage,
            triangles: &self.cloud.triangles,
            forward,
            gradients: &by_splats(forward, &self.weights),
        };
        let drawn = forward.splats.len();
        assert!(drawn <= BATCH, "they are one batch");
        for (&source, by) in forward.sources.iter().zip(by_discs.of(0..drawn)) {
            let index = source as usize;
            let mixed = self.prefix.lower(&self.cloud, index).is_some();
            let share = if level == self.prefix.level {
                if mixed { 1.0 - self.prefix.lower_share } else { 1.0 }
            } else if mixed {
                self.prefix.lower_share
            } else {
                continue;
            };
            let by = self.cloud.levels[level][index].gradient(&by);
            gradient[index] = by.to_array().map(|g| share * g);
        }
        gradient
    }

    /// Greatest error of each parameter relative to that parameter's root mean square, level by level.
    ///
    /// The trainer works in f32: a gradient is a sum of up to 2304 × 3 terms of both signs, each off
    /// by some 1e-6 of itself. By position, scale, opacity and colour that leaves 1e-5 of the usual
    /// gradient; by the angle of a nearly round disc, where the terms cancel, 1e-4. A wrong or
    /// missing term is 100 times that.
    fn check(&self, forward: &Forward, decisions: &[Vec<u32>]) {
        const NAMES: [&str; PARAMETERS] =
            ["x", "y", "z", "angle", "scale 0", "scale 1", "logit", "red", "green", "blue"];
        for (level, gaussians) in self.cloud.levels.iter().enumerate() {
            let analytic = self.gradient(forward, level);
            for (parameter, name) in NAMES.into_iter().enumerate() {
                let moved = |index| [level, index, parameter];
                let numeric: Vec<f64> = (0..gaussians.len())
                    .map(|index| central(2e-3, |h| self.value(decisions, moved(index), h)))
                    .collect();
                let square: f64 = numeric.iter().map(|n| n * n).sum();
                let usual = (square / numeric.len() as f64).sqrt();
                let error =
                    |(index, n): (usize, &f64)| (f64::from(analytic[index][parameter]) - n).abs();
                let worst = numeric.iter().enumerate().map(error).fold(0.0, f64::max) / usual;
                println!(
                    "{:?} level {level} {name}: usual {usual:.3}, worst {worst:.1e} of it",
                    self.low_pass
                );
                assert!(usual > 1e-3 && worst < 2e-4, "{name}: {worst:e} of {usual}");
            }
        }
    }
}

/// Footprints so large and opacities so middling that every disc blends into every pixel, no alpha
/// is near 1/255 or 0.99 and no pixel is finished early: the picture is smooth in all parameters.
#[test]
fn the_picture_has_the_gradient_of_a_smooth_scene() {
    for low_pass in KINDS {
        for own_levels in [false, true] {
            let scene = Scene::new(low_pass, own_levels, [1.6, 2.6], [0.12, 0.4]);
            let forward = scene.forward();
            let decisions = scene.decisions(&forward);
            assert_eq!(forward.splats.len(), 24, "exactly the prefix is drawn");
            assert!(decisions.iter().all(|blended| blended.len() == 24), "everything everywhere");
            scene.check(&forward, &decisions);
        }
    }
}

/// Footprints down to a pixel, where the low-pass matters, with edges at alpha = 1/255 inside the
/// frame. The differences keep the runtime's own decisions, as the gradient does by its definition.
#[test]
fn the_picture_has_the_gradient_of_small_discs() {
    for low_pass in KINDS {
        for own_levels in [false, true] {
            let scene = Scene::new(low_pass, own_levels, [0.06, 0.6], [0.3, 0.85]);
            let forward = scene.forward();
            let decisions = scene.decisions(&forward);
            assert!(decisions.iter().any(|blended| blended.len() < 8), "not everything everywhere");
            scene.check(&forward, &decisions);
        }
    }
}
