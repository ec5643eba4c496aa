//! One budget for many avatars: never exceeded, spent where it helps, the same every time.

use dermis_format::curves::stops;
use dermis_format::source::{Gaussians, MeasuredCurves, Region, Source};
use dermis_format::{CurvePoint, FrameKind, Sample};
use dermis_runtime::budget::{Budget, Gaze, Instance, Spent, plan, scratch_len};
use dermis_runtime::footprint::{Footprint, covered};
use dermis_runtime::project::View;
use dermis_runtime::{Avatar, Camera, Error, Kernel, Plan, Pose, Posed};
use proptest::prelude::*;

use crate::scenes::{DOT, UNIT, bytes, camera, crowd, sheet};

/// Regions with these layers and, if any, curves of two octaves from these numbers.
fn measured(layers: &[Vec<u32>], numbers: &[[f32; 2]]) -> Source {
    let mut source = sheet(&[]);
    let region = source.regions.remove(0);
    let of = |layers: &Vec<u32>| {
        let n = layers.iter().sum::<u32>() as usize;
        Region {
            layers: layers.clone(),
            gaussians: Gaussians::Disc(vec![DOT; n]),
            triangles: vec![0; n],
            ..region.clone()
        }
    };
    source.regions = layers.iter().map(of).collect();
    source.mesh.triangle_regions = vec![0];
    if let Some(stops) = layers.first().map(|layers| stops(layers.len())) {
        let points = numbers.iter().cycle().take(2 * stops * layers.len());
        let points = points.map(|&[error, blends]| CurvePoint { error, blends }).collect();
        source.curves =
            (!numbers.is_empty()).then_some(MeasuredCurves { density: 100.0, octaves: 2, points });
    }
    source
}

fn any_avatar() -> impl Strategy<Value = Vec<u8>> {
    let layers = (1usize..5, 1usize..4).prop_flat_map(|(layers, regions)| {
        let layer = prop_oneof![1 => Just(0u32), 4 => 1u32..60];
        prop::collection::vec(prop::collection::vec(layer, layers), regions)
    });
    let numbers = prop::collection::vec([0.0f32..0.3, 0.0f32..40.0], 0..40);
    (layers, numbers).prop_map(|(layers, numbers)| bytes(&measured(&layers, &numbers)))
}

fn any_footprint() -> impl Strategy<Value = Footprint> {
    let area = prop_oneof![1 => Just(0.0f32), 4 => 1.0f32..1e5];
    (area, -2.0f32..9.0).prop_map(|(area, octave)| Footprint {
        area,
        fill: area,
        density: octave.exp2(),
        center: [area.sqrt(), 3.0],
    })
}

/// Avatars, and which of them stand where, with what weight.
type Scene = (Vec<Vec<u8>>, Vec<(usize, Vec<Footprint>, f32)>);

fn any_scene() -> impl Strategy<Value = Scene> {
    let instance = (
        any::<usize>(),
        prop::collection::vec(any_footprint(), 3),
        prop_oneof![Just(1.0f32), 0.0f32..9.0],
    );
    (prop::collection::vec(any_avatar(), 1..4), prop::collection::vec(instance, 0..=16))
}

/// Calls `check` with the instances of a scene.
fn with_instances<T>((files, places): &Scene, check: impl FnOnce(&[Instance<'_, '_>]) -> T) -> T {
    let avatars: Vec<Avatar<'_>> = files.iter().map(|file| Avatar::parse(file).unwrap()).collect();
    let instances: Vec<Instance<'_, '_>> = places
        .iter()
        .map(|(avatar, footprints, weight)| {
            let avatar = &avatars[avatar % avatars.len()];
            let regions = usize::from(avatar.header().regions);
            let footprints = footprints.iter().take(regions).copied().collect();
            Instance { avatar, footprints, weight: *weight }
        })
        .collect();
    check(&instances)
}

fn planned(instances: &[Instance<'_, '_>], budget: &Budget) -> (Spent, Vec<Plan>) {
    let mut plans = vec![Plan::default(); instances.len()];
    let mut scratch = vec![0xdead_beef; scratch_len(instances)];
    let spent = plan(instances, budget, None, &mut scratch, &mut plans).unwrap();
    (spent, plans)
}

/// Gaussians that some budget would still be spent on: what the greatest spends.
fn worth_drawing(instances: &[Instance<'_, '_>]) -> u32 {
    planned(instances, &Budget::of_gaussians(u32::MAX)).0.gaussians
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn no_budget_is_exceeded(
        scene in any_scene(),
        gaussians in 0u32..3_000,
        blends in prop_oneof![Just(f32::INFINITY), 0.0f32..3e6],
    ) {
        with_instances(&scene, |instances| {
            let budget = Budget { gaussians, blends, movement: 0.0 };
            let (spent, plans) = planned(instances, &budget);
            prop_assert!(spent.gaussians <= gaussians && spent.blends <= blends, "{spent:?}");
            prop_assert_eq!(plans.iter().map(Plan::gaussians).sum::<u32>(), spent.gaussians);
            prop_assert_eq!(&planned(instances, &budget).1, &plans);
            for (instance, plan) in instances.iter().zip(&plans) {
                for (region, footprint) in plan.regions().iter().zip(&instance.footprints) {
                    prop_assert!(footprint.area > 0.0 || region.count == 0, "{footprint:?}");
                }
            }
            Ok(())
        })?;
    }

    #[test]
    fn all_is_spent_while_something_is_worth_it(scene in any_scene(), gaussians in 0u32..3_000) {
        with_instances(&scene, |instances| {
            let spent = planned(instances, &Budget::of_gaussians(gaussians)).0;
            prop_assert_eq!(spent.gaussians, gaussians.min(worth_drawing(instances)));
            Ok(())
        })?;
    }

    #[test]
    fn more_is_never_worse(scene in any_scene(), budgets in prop::collection::vec(0u32..2_000, 2..20)) {
        with_instances(&scene, |instances| {
            let mut budgets = budgets;
            budgets.sort_unstable();
            let errors: Vec<f32> = budgets
                .iter()
                .map(|&gaussians| planned(instances, &Budget::of_gaussians(gaussians)).0.error)
                .collect();
            for pair in errors.windows(2) {
                // Sums of up to 200 steps in f32.
                prop_assert!(pair[1] <= pair[0] + 1e-5 * errors[0], "{errors:?}");
            }
            Ok(())
        })?;
    }

    #[test]
    fn counts_rise_slowly_and_fall_at_once(
        file in any_avatar(),
        budgets in prop::collection::vec(0u32..800, 1..6),
        factor in prop_oneof![1.05f32..3.0, Just(f32::NAN), -1.0f32..1.0],
    ) {
        let avatar = Avatar::parse(&file).unwrap();
        let mut before = Plan::default();
        for budget in budgets {
            let wanted = Plan::with_budget(&avatar, budget);
            for frame in 0..200 {
                let now = wanted.rising_from(&avatar, &before, factor);
                let counts = now.regions().iter().zip(wanted.regions()).enumerate();
                for (region, (now, wanted)) in counts {
                    let base = before.regions().get(region).map_or(0, |plan| plan.count).max(64);
                    let most = (f64::from(base) * f64::from(factor)).max(base.into()) as u32;
                    prop_assert_eq!(now.count, wanted.count.min(most), "frame {}", frame);
                }
                before = now;
            }
            // 64 · 1.05²⁰⁰ is more than there are.
            prop_assert!(!(factor >= 1.05) || before == wanted);
        }
    }

    /// A count stays where it would rise by little, and never is above its plan's.
    #[test]
    fn counts_that_tremble_are_held_and_never_over_their_plan(
        file in any_avatar(),
        first in 0u32..800,
        budgets in prop::collection::vec(0u32..800, 1..20),
        share in prop_oneof![0f32..1.0, Just(f32::NAN), -1f32..0.0],
    ) {
        let avatar = Avatar::parse(&file).unwrap();
        let mut before = Plan::with_budget(&avatar, first);
        for budget in budgets {
            let wanted = Plan::with_budget(&avatar, budget);
            let now = wanted.holding_from(&avatar, &before, share);
            let counts = now.regions().iter().zip(wanted.regions()).zip(before.regions());
            for ((now, wanted), before) in counts {
                let most = f64::from(before.count) * (1.0 + f64::from(share));
                let held = wanted.count >= before.count && f64::from(wanted.count) <= most;
                prop_assert_eq!(now.count, if held { before.count } else { wanted.count });
                prop_assert!(now.count <= wanted.count);
            }
            // Held once it is held again: what trembles between the two stands still.
            prop_assert_eq!(&wanted.holding_from(&avatar, &now, share), &now);
            before = now;
        }
    }

    /// No other sharing out of a few Gaussians, by levels, is better.
    #[test]
    fn no_plan_of_whole_levels_is_better(
        files in prop::collection::vec(any_avatar(), 2),
        footprints in prop::collection::vec(any_footprint(), 6),
        gaussians in 0u32..200,
    ) {
        let places = vec![(0, footprints[..3].to_vec(), 1.0), (1, footprints[3..].to_vec(), 1.0)];
        with_instances(&(files, places), |instances| {
            let (spent, _) = planned(instances, &Budget::of_gaussians(gaussians));
            let best = best_of_levels(instances, gaussians);
            prop_assert!(spent.error <= best * 1.000_1 + 1e-3, "{} of {best}", spent.error);
            Ok(())
        })?;
    }
}

/// Least error of all ways to give each region a level, by trying all.
fn best_of_levels(instances: &[Instance<'_, '_>], gaussians: u32) -> f32 {
    let mut ways = vec![(0u32, 0.0f32)];
    for instance in instances {
        for (region, footprint) in instance.footprints.iter().enumerate() {
            let options = options(instance, region, footprint);
            let more = ways.iter().flat_map(|&(count, error)| {
                options.iter().map(move |&(more, of)| (count + more, error + of))
            });
            ways = more.filter(|&(count, _)| count <= gaussians).collect();
        }
    }
    ways.into_iter().map(|(_, error)| error).fold(f32::MAX, f32::min)
}

/// Gaussians and error of each level of a region, once more and in other words.
fn options(instance: &Instance<'_, '_>, region: usize, footprint: &Footprint) -> Vec<(u32, f32)> {
    let avatar = instance.avatar;
    let octave = |density: f32| (density / footprint.density).log2().clamp(0.0, 1.0);
    let layers: Vec<u32> =
        (0..avatar.header().layers.into()).map(|layer| avatar.layer_len(region, layer)).collect();
    let first = layers.iter().copied().find(|&len| len > 0).unwrap_or(0);
    let mut counts = vec![0, first.div_ceil(16), first.div_ceil(4)];
    let mut sum = 0;
    for (layer, &len) in layers.iter().enumerate() {
        counts.extend((layer > 0).then(|| sum + len.div_ceil(3)));
        sum += len;
        counts.push(sum);
    }
    // Of stops of one count the runtime may take any.
    let repeats = |stop: usize| stop > 0 && counts[..stop].contains(&counts[stop]);
    (0..counts.len())
        .filter(|&stop| !repeats(stop))
        .map(|stop| {
            let count = counts[stop];
            let error = match avatar.curves() {
                Some(curves) => {
                    let at = |octave| curves.point(region, octave, stop).unwrap().error;
                    let share = octave(curves.density());
                    at(0) * (1.0 - share) + at(1) * share
                }
                None if count <= 40 => 0.25,
                None => 10.0 / count as f32,
            };
            (count, error * footprint.area * instance.weight * avatar.region_weight(region))
        })
        .collect()
}

#[test]
fn a_near_avatar_gets_more_than_a_far_one_and_the_eye_decides_between_equals() {
    // Of 0, 7, 25, 100, 200 and 400.
    let of_octave =
        [[0.2, 0.0], [0.1, 20.0], [0.05, 20.0], [0.02, 20.0], [0.01, 22.0], [0.005, 25.0]];
    let numbers = [of_octave, of_octave].concat();
    let file = bytes(&measured(&[vec![100, 300]], &numbers));
    let avatar = Avatar::parse(&file).unwrap();
    let at = |area: f32, x: f32| Instance {
        avatar: &avatar,
        footprints: [Footprint { area, fill: area, density: 100.0, center: [x, 0.0] }]
            .into_iter()
            .collect(),
        weight: 1.0,
    };
    let budget = Budget::of_gaussians(500);
    let counts = |instances: &[Instance<'_, '_>], gaze: Option<&Gaze>| -> Vec<u32> {
        let mut plans = vec![Plan::default(); instances.len()];
        let mut scratch = vec![0; scratch_len(instances)];
        plan(instances, &budget, gaze, &mut scratch, &mut plans).unwrap();
        plans.iter().map(Plan::gaussians).collect()
    };
    assert_eq!(counts(&[at(900.0, 0.0), at(90_000.0, 0.0)], None), [100, 400]);
    let equals = [at(900.0, 10.0), at(900.0, 500.0)];
    assert_eq!(counts(&equals, Some(&Gaze { point: [500.0, 0.0], falloff: 50.0 })), [100, 400]);
    assert_eq!(counts(&equals, Some(&Gaze { point: [0.0, 0.0], falloff: 50.0 })), [400, 100]);
}

#[test]
fn too_little_memory_and_too_few_plans_are_said() {
    let file = bytes(&measured(&[vec![4]], &[]));
    let avatar = Avatar::parse(&file).unwrap();
    let instances = [Instance { avatar: &avatar, footprints: Default::default(), weight: 1.0 }];
    let budget = Budget::of_gaussians(9);
    let needed = scratch_len(&instances);
    let mut plans = [Plan::default()];
    let mut short = vec![0; needed - 1];
    let refused = plan(&instances, &budget, None, &mut short, &mut plans);
    assert_eq!(refused, Err(Error::Scratch { needed, lent: needed - 1 }));
    let refused = plan(&instances, &budget, None, &mut vec![0; needed], &mut []);
    assert_eq!(refused, Err(Error::Plan));
}

/// The same bits by every kernel, also where sixteen triangles in a row are of two regions.
#[test]
fn footprints_do_not_depend_on_the_kernel() {
    let mut source = crowd();
    source.mesh.triangle_regions = (0..40).map(|i| u8::from(i > 20)).collect();
    source.mesh.two_sided = (0..40).map(|i| i % 3 == 0).collect();
    let file = bytes(&source);
    let avatar = Avatar::parse(&file).unwrap();
    let camera = Camera {
        width: 90,
        height: 70,
        fx: 80.0,
        fy: 90.0,
        cx: 40.0,
        cy: 33.0,
        world_to_camera: [[0.8, 0.0, 0.6, 0.1], [0.0, -1.0, 0.0, 0.2], [0.6, 0.0, -0.8, 1.1]],
    };
    let mut scratch = vec![0; Posed::scratch_len(&avatar)];
    let mut of = |kernel| {
        let posed = Posed::new(&avatar, &Pose::Rest, kernel, &mut scratch).unwrap();
        posed.footprints(&camera)
    };
    let expected = of(Kernel::Scalar);
    assert!(expected.iter().all(|footprint| footprint.area > 10.0), "{expected:?}");
    for kernel in Kernel::available() {
        assert_eq!(of(kernel), expected, "{}", kernel.name());
    }
}

/// What stands behind the surface's triangles carries Gaussians and covers nothing.
#[test]
fn footprints_are_of_the_surface_alone() {
    let mut source = crowd();
    let file = bytes(&source);
    let again: Vec<[u32; 3]> = source.mesh.triangles.iter().step_by(3).copied().collect();
    source.mesh.coarser = vec![again.len() as u32 - 2, 2];
    source.mesh.triangles.extend(again);
    source.mesh.two_sided.resize(source.mesh.triangles.len(), true);
    source.mesh.triangle_regions.resize(source.mesh.triangles.len(), 0);
    let with_coarser = bytes(&source);
    let camera = camera(90, 70, 80.0, 1.1);
    let of = |file: &[u8]| {
        let avatar = Avatar::parse(file).unwrap();
        let mut scratch = vec![0; Posed::scratch_len(&avatar)];
        let posed = Posed::new(&avatar, &Pose::Rest, Kernel::detect(), &mut scratch).unwrap();
        posed.footprints(&camera)
    };
    assert!(of(&file)[0].area > 10.0);
    assert_eq!(of(&with_coarser), of(&file));
}

/// Two of forty triangles stand for all, the rest for nothing; by every kernel the same.
#[test]
fn samples_stand_for_what_the_file_says() {
    let mut source = sheet(&[DOT]);
    let triangle = |i: u32| {
        let at = 0.02 * i as f32 - 0.4;
        [[at, 0.0, 0.0], [at + 0.01, 0.0, 0.0], [at, 0.01, 0.001 * i as f32]]
    };
    source.mesh.positions = (0..40).flat_map(triangle).collect();
    source.mesh.triangles = (0..40).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    source.mesh.two_sided = vec![false; 40];
    source.mesh.triangle_regions = vec![0; 40];
    let chosen = [(3, 8.0, 2.0), (37, 16.0, 32.0)];
    source.samples = chosen.map(|(triangle, area, fill)| Sample { triangle, area, fill }).to_vec();
    let file = bytes(&source);
    let avatar = Avatar::parse(&file).unwrap();
    let camera = |x: f32| Camera {
        width: 400,
        height: 300,
        fx: 300.0,
        fy: 300.0,
        cx: 200.0,
        cy: 150.0,
        world_to_camera: [[1.0, 0.0, 0.0, x], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 1.0]],
    };
    let mut scratch = vec![0; Posed::scratch_len(&avatar)];
    for kernel in Kernel::available() {
        let posed = Posed::new(&avatar, &Pose::Rest, kernel, &mut scratch).unwrap();
        let view = View::<f32>::new(&camera(0.0));
        let own = |triangle: u32| {
            covered(&posed.frame(triangle).unwrap(), avatar.header().frame, &view).area
        };
        let Footprint { area, fill, .. } = posed.footprints(&camera(0.0))[0];
        let expected = [8.0 * own(3) + 16.0 * own(37), 2.0 * own(3) + 32.0 * own(37)];
        for (found, expected) in [area, fill].into_iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 1e-5, "{found}, not {expected}");
        }
        // Neither is in the frame, but others are, each for itself.
        let near = Camera { fx: 3000.0, fy: 3000.0, ..camera(0.0) };
        let Footprint { area, fill, .. } = posed.footprints(&near)[0];
        assert!(area > 0.0 && area == fill, "{area} {fill}");
        // None is.
        assert_eq!(posed.footprints(&camera(9.0))[0], Footprint::default());
    }
}

/// A mesh of which one triangle in seven is looked at, its parts of all sizes, near and far, and turned away.
#[test]
fn footprints_of_large_meshes_are_within_a_tenth() {
    const SIDE: u32 = 60;
    let mut source = sheet(&[DOT]);
    let vertex = |i: u32| {
        let [u, v] = [i % (SIDE + 1), i / (SIDE + 1)].map(|n| n as f32 / SIDE as f32);
        let wave = 0.3 * (9.0 * u).sin() * (7.0 * v).cos();
        [1.6 * u * u - 0.8, 1.2 * v - 0.6, wave]
    };
    source.mesh.positions = (0..(SIDE + 1) * (SIDE + 1)).map(vertex).collect();
    let quads = (0..SIDE * SIDE).map(|i| i / SIDE * (SIDE + 1) + i % SIDE);
    let halves = |a| [[a, a + 1, a + SIDE + 2], [a, a + SIDE + 2, a + SIDE + 1]];
    source.mesh.triangles = quads.flat_map(halves).collect();
    source.mesh.two_sided = vec![false; source.mesh.triangles.len()];
    source.mesh.triangle_regions = vec![0; source.mesh.triangles.len()];
    let file = bytes(&source);
    let avatar = Avatar::parse(&file).unwrap();
    let mut scratch = vec![0; Posed::scratch_len(&avatar)];
    let posed = Posed::new(&avatar, &Pose::Rest, Kernel::Scalar, &mut scratch).unwrap();
    for (turn, distance) in [(0.0f32, 1.5), (0.5, 2.0), (-0.8, 3.0), (1.2, 9.0)] {
        let (s, c) = turn.sin_cos();
        let camera = Camera {
            width: 800,
            height: 600,
            fx: 300.0,
            fy: 300.0,
            cx: 400.0,
            cy: 300.0,
            world_to_camera: [[c, 0.0, s, 0.0], [0.0, -1.0, 0.0, 0.0], [s, 0.0, -c, distance]],
        };
        let view = View::<f32>::new(&camera);
        let areas = (0..avatar.header().triangles).filter_map(|triangle| posed.frame(triangle));
        let areas = areas.map(|frame| covered(&frame, FrameKind::Area, &view).area);
        let exact: f32 = areas.filter(|area| *area > 0.0).sum();
        let found = posed.footprints(&camera)[0].area;
        assert!((found / exact - 1.0).abs() < 0.1, "{found} of {exact}, turned by {turn}");
    }
}

/// From in front, from the side, from behind, from afar, and turned away.
#[test]
fn footprints_are_the_pixels_that_triangles_cover() {
    let file = bytes(&sheet(&[DOT]));
    let avatar = Avatar::parse(&file).unwrap();
    let looking = |rows: [[f32; 4]; 3]| Camera {
        width: 200,
        height: 100,
        fx: 50.0,
        fy: 60.0,
        cx: 100.0,
        cy: 50.0,
        world_to_camera: rows,
    };
    let front = |distance: f32| {
        looking([[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, distance]])
    };
    let area_of = |corners: [[f32; 3]; 3]| {
        let [a, b, c] = corners;
        0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
    };
    let expected = |distance: f32| {
        let pixels = UNIT.map(|[x, y, _]| [50.0 * x / distance, 60.0 * y / distance, 0.0]);
        area_of(pixels)
    };
    let mut scratch = vec![0; Posed::scratch_len(&avatar)];
    for kernel in Kernel::available() {
        let posed = Posed::new(&avatar, &Pose::Rest, kernel, &mut scratch).unwrap();
        for distance in [2.0, 5.0, 40.0] {
            let footprints = posed.footprints(&front(distance));
            let Footprint { area, fill, density, center } = footprints[0];
            assert!((area / expected(distance) - 1.0).abs() < 1e-5, "{area} at {distance} m");
            assert_eq!(fill, area, "no file says that blends differ");
            assert!((density * distance / 3000f32.sqrt() - 1.0).abs() < 1e-5, "{density}");
            assert!(center[0] == 100.0 && (center[1] - 50.0).abs() < 1e-3, "{center:?}");
        }
        let behind = looking([[-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 3.0]]);
        let aside = looking([[1.0, 0.0, 0.0, 90.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 3.0]]);
        for nothing in [behind, aside, front(-3.0)] {
            assert_eq!(posed.footprints(&nothing)[0], Footprint::default(), "{nothing:?}");
        }
    }
}
