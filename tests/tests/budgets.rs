//! Plans of a trained avatar: from any distance no worse than a level, and nothing pops as it comes nearer.

use dermis_runtime::{Avatar, Pose};
use dermis_tests::small::{options, trained_demo};
use dermis_trainer::bench::approach::{self, Way};
use dermis_trainer::eval::{EvalOptions, Row, evaluate};

const BUDGETS: [u32; 4] = [100, 400, 1000, 2000];

#[test]
fn a_plan_is_no_worse_than_the_finest_level_that_fits() {
    let (model, trained) = trained_demo(&options(2000, 600));
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    let (mut better, mut finer) = (0, 0);
    for distance in [1.5, 3.0, 8.0, 14.0] {
        let measure = EvalOptions {
            key_frames: 1,
            views: 4,
            size: 160,
            background: [1.0; 3],
            budgets: BUDGETS.to_vec(),
            prefixes: Vec::new(),
            packed: None,
            planned: true,
            distance: Some(distance),
        };
        let measured = evaluate(&avatar, &model, &measure).expect("it can be measured");
        let novel = || measured.rows.iter().filter(|row| row.split.name() == "novel view");
        let levels: Vec<&Row> = novel().filter(|row| row.budget.is_none()).collect();
        for row in novel().filter(|row| row.planned) {
            let budget = row.budget.expect("a plan has one");
            assert!(row.gaussians <= budget, "{row:?}");
            let Some(level) = levels.iter().rev().find(|level| level.gaussians <= budget) else {
                continue;
            };
            let gain = row.psnr_foreground_db - level.psnr_foreground_db;
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

#[test]
fn nothing_pops_as_an_avatar_comes_nearer() {
    let (_, trained) = trained_demo(&options(2000, 200));
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    let ways = [1000, 2000].map(Way::of_budget);
    let approaches = approach::measure(&avatar, &Pose::Rest, [120, 120], &ways, [16.0, 1.5], 60);
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
    let approaches = approach::measure(&avatar, &Pose::Rest, [120, 120], &ways, [3.0, 1.5], 80);
    let approaches = approaches.expect("it can be drawn");
    let [at_once, slowly] = &approaches[..] else { panic!("two ways") };
    println!("{:.3} at once", at_once.greatest_change_to_all());
    println!("{:.3} in {} pictures", slowly.greatest_change_to_all(), slowly.pictures_to_rise());
    assert_eq!(at_once.pictures_to_rise(), 0);
    // 150 · 1.1ⁿ ≥ 2,000 at n = 28; the picture of the step is the first one.
    assert!((25..=30).contains(&slowly.pictures_to_rise()), "{}", slowly.pictures_to_rise());
    assert!(slowly.greatest_change_to_all() < 0.7 * at_once.greatest_change_to_all());
}
