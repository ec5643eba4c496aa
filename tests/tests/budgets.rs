//! Plans of a trained avatar: from any distance no worse than a level, and nothing pops as it comes nearer.

use dermis_runtime::footprint::{Covered, covered};
use dermis_runtime::project::View;
use dermis_runtime::{Avatar, Camera, Kernel, Pose, Posed};
use dermis_tests::small::{options, trained_demo};
use dermis_trainer::bench::approach::{self, Approach, Track, Way};
use dermis_trainer::eval::{EvalOptions, Row, evaluate};
use dermis_trainer::orbit::Orbit;

const BUDGETS: [u32; 4] = [100, 400, 1000, 2000];

#[test]
fn a_plan_is_no_worse_than_the_finest_level_that_fits() {
    let (model, trained) = trained_demo(&options(2000, 1200));
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    let (mut better, mut finer) = (0, 0);
    for distance in [1.5, 3.0, 8.0, 14.0] {
        let measure = |background| EvalOptions {
            key_frames: 1,
            views: 4,
            size: 160,
            background,
            budgets: BUDGETS.to_vec(),
            prefixes: Vec::new(),
            packed: None,
            planned: true,
            distance: Some(distance),
        };
        // A plan foretells the mean over both: it does not know what is behind.
        let rows = [[1.0; 3], [0.0; 3]].map(|background| {
            let measured = evaluate(&avatar, &model, &measure(background));
            measured.expect("it can be measured").rows
        });
        let [on_white, on_black] = rows;
        let both = || on_white.iter().zip(&on_black);
        let novel = || both().filter(|(row, _)| row.split.name() == "novel view");
        let error = |(white, black): (&Row, &Row)| {
            let squares = [white, black].map(|row| 10f64.powf(-row.psnr_foreground_db / 10.0));
            squares.iter().sum::<f64>()
        };
        let levels: Vec<_> = novel().filter(|(row, _)| row.budget.is_none()).collect();
        for (row, on_black) in novel().filter(|(row, _)| row.planned) {
            let budget = row.budget.expect("a plan has one");
            assert!(row.gaussians <= budget, "{row:?}");
            let Some(&(level, level_on_black)) =
                levels.iter().rev().find(|(level, _)| level.gaussians <= budget)
            else {
                continue;
            };
            let gain = 10.0 * (error((level, level_on_black)) / error((row, on_black))).log10();
            println!(
                "{distance} m, {budget}: {gain:+.2} dB, {} for {}",
                row.gaussians, level.gaussians
            );
            assert!(gain > -0.1, "{distance} m: {row:?} after {level:?}");
            better += u32::from(gain > 0.5);
            finer += u32::from(gain > 0.5 && row.gaussians < level.gaussians);
        }
    }
    // Between levels there are more, and far away fewer are better.
    assert!(better >= 5 && finer >= 1, "{better} better, {finer} with fewer");
}

/// To 1.5 m.
fn track(far: f32, pictures: u32) -> Track {
    Track { yaw: 0.0, far, near: 1.5, pictures }
}

#[test]
fn nothing_pops_as_an_avatar_comes_nearer() {
    // So long that from afar fewer are better.
    let (_, trained) = trained_demo(&options(2000, 600));
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    let ways = [1000, 2000].map(Way::of_budget);
    let approaches = approach::measure(&avatar, &Pose::Rest, [120, 120], &ways, &track(16.0, 60));
    for approach in approaches.expect("it can be drawn") {
        let counts = || approach.steps.iter().map(|step| step.gaussians);
        let ratio = approach.greatest_change_to_all();
        println!(
            "{}: {ratio:.3}, {:?} Gaussians",
            approach.way.budget,
            [counts().min(), counts().max()]
        );
        assert!(counts().all(|count| count <= approach.way.budget), "{approach:?}");
        assert!(counts().max() > counts().min(), "{approach:?}");
        assert!(ratio <= 1.1, "{ratio} of {approach:?}");
    }
}

#[test]
fn a_budget_that_rises_at_once_pops_less_where_counts_rise_slowly() {
    let (_, trained) = trained_demo(&options(2000, 200));
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    let way = |rising| Way { budget: 150, later_budget: 2000, rising };
    let ways = [way(None), way(Some(1.1))];
    let approaches = approach::measure(&avatar, &Pose::Rest, [120, 120], &ways, &track(3.0, 80));
    let approaches = approaches.expect("it can be drawn");
    let [at_once, slowly] = &approaches[..] else { panic!("two ways") };
    println!("{:.3} at once", at_once.greatest_change_to_all());
    println!("{:.3} in {} pictures", slowly.greatest_change_to_all(), slowly.pictures_to_rise());
    assert_eq!(at_once.pictures_to_rise(), 0);
    // Blends are foretold of what a plan wants; while its rise is bound it has less.
    let foretold = |approach: &Approach| -> Vec<bool> {
        approach.steps.iter().map(|step| step.blends_foretold.is_some()).collect()
    };
    assert_eq!(foretold(at_once), [true; 80]);
    let rise = slowly.pictures_to_rise();
    let expected: Vec<bool> = (0..80).map(|i| !(40..40 + rise).contains(&i)).collect();
    assert_eq!(foretold(slowly), expected);
    // 150 · 1.1ⁿ ≥ 2,000 at n = 28; the picture of the step is the first one.
    assert!((25..=30).contains(&slowly.pictures_to_rise()), "{}", slowly.pictures_to_rise());
    assert!(slowly.greatest_change_to_all() < 0.7 * at_once.greatest_change_to_all());
}

/// Pixels that the triangles of an avatar's surface cover which show something and whose middle is in the frame.
fn area_of_all(avatar: &Avatar<'_>, posed: &Posed<'_, '_>, camera: &Camera) -> f32 {
    let view = View::<f32>::new(camera);
    let of = |triangle: u32| {
        let kind = avatar.header().frame;
        let Covered { area, center: [x, y, z] } = covered(&posed.frame(triangle)?, kind, &view);
        let column = camera.cx + camera.fx * x / z;
        let row = camera.cy + camera.fy * y / z;
        let is_in = (0.0..camera.width as f32).contains(&column)
            && (0.0..camera.height as f32).contains(&row);
        let shows = area > 0.0 || avatar.is_two_sided(triangle as usize);
        (shows && is_in).then_some(area.abs())
    };
    (0..avatar.mesh_levels().surface()).filter_map(of).sum()
}

/// The samples of a file against all of its triangles, from around, near and far, and as it leaves the frame on any side,
/// which it does little by little, however few triangles stand for all.
#[test]
fn samples_stand_for_all_triangles() {
    let (_, trained) = trained_demo(&options(2000, 60));
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    assert!(avatar.samples().expect("training chooses them").iter().count() >= 32);
    let pose = Pose::Clip { clip: 0, seconds: 0.4 };
    let mut scratch = vec![0; Posed::scratch_len(&avatar)];
    let posed = Posed::new(&avatar, &pose, Kernel::detect(), &mut scratch).expect("it fits");
    let (mut greatest, mut partly) = (0.0f32, 0);
    for (yaw, distance) in (0..8).flat_map(|i| [1.5f32, 2.5, 6.0].map(|d| (45.0 * i as f32, d))) {
        let orbit = Orbit { yaw, pitch: 10.0, distance: Some(distance) };
        let middle = orbit.camera(&avatar, &pose, 240, 240).expect("it can be seen");
        let whole = area_of_all(&avatar, &posed, &middle);
        for (dx, dy) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
            let mut before = (0.0, 0.0);
            for by in (0..24).map(|step| 10.0 * step as f32) {
                let (cx, cy) = (middle.cx + by * dx, middle.cy + by * dy);
                let camera = Camera { cx, cy, ..middle };
                let found = posed.footprints(&camera)[0];
                let all = area_of_all(&avatar, &posed, &camera);
                partly += u32::from(all > 0.05 * whole && all < 0.95 * whole);
                let off = (found.area - all).abs() / whole;
                let what = format!("{yaw}°, {distance} m, {by} px: {found:?}, {all} of {whole}");
                if found.fill == 0.0 {
                    // Next to the frame, or out of it.
                    assert!(all < 0.05 * whole, "{what}");
                    continue;
                }
                assert!(off < 0.1, "{what}");
                greatest = greatest.max(off);
                // Where little is in the frame others may be looked at, more exactly.
                let change = (found.area - before.0) - (all - before.1);
                let is_next = by > 0.0 && all.min(before.1) > 0.05 * whole;
                assert!(!is_next || change.abs() < 0.08 * whole, "{change} more, {what}");
                before = (found.area, all);
            }
        }
    }
    println!("{greatest:.3} of the whole at most, {partly} cameras saw a part");
    assert!(partly > 500, "{partly}");
}
