//! Posing what a plan needs, no more: the same bytes, or as far from them as is said.

use dermis_format::rig::Property;
use dermis_format::source::{Channel, Clip, Joint, MeasuredMovements, Morph, Rig, Source};
use dermis_runtime::budget::{Budget, Instance, plan, scratch_len};
use dermis_runtime::math::{Affine, IDENTITY, affine_of, compose, inverse, transform};
use dermis_runtime::pose::carried;
use dermis_runtime::rate::{MOST_FRAMES, frames_to_hold, is_due};
use dermis_runtime::{
    Avatar, Camera, Error, Kernel, Plan, Pose, Posed, PosedGaussian, Prepared, Sides,
};
use proptest::prelude::*;

use crate::scenes::{Picture, bytes, camera, kernels, leveled_crowd};

/// Half a turn about z, halfway.
const TURNED: [f32; 8] = [1.0, 0.0, 0.0, 0.0, 0.8, 0.0, 0.0, 0.6];

/// The crowd of levels on three joints in a row, of which the second turns and the third turns less, and with two morph targets.
/// What moves how far is made up: 3, 1 and 0.25 m, and 0.5 and 0.01 m.
fn rigged() -> Source {
    let mut source = leveled_crowd();
    let joint = |name: &str, parent| Joint {
        name: name.into(),
        parent,
        translation: [0.1, 0.0, 0.0],
        ..Joint::default()
    };
    let count = source.mesh.positions.len();
    let influences = (0..count).map(|i| {
        let share = (i % 7) as f32 / 6.0;
        let bind = (i / 40).min(1) as u16;
        [(bind, 1.0 - share), (bind + 1, share), (0, 0.0), (0, 0.0)]
    });
    source.mesh.influences = influences.collect();
    let morph = |name: &str, first: u32, length: f32| Morph {
        name: name.into(),
        default_weight: 0.0,
        deltas: (first..first + 30).map(|vertex| (vertex, [0.0, length, 0.1])).collect(),
        ..Morph::default()
    };
    source.mesh.morph_targets = vec![morph("far", 5, 0.5), morph("near", 60, 0.01)];
    let channel = |property, values: &[f32]| Channel {
        property,
        holds: false,
        values: values.to_vec(),
        step: 0.0,
    };
    source.rig = Rig {
        joints: vec![joint("root", None), joint("arm", Some(0)), joint("hand", Some(1))],
        binds: (0..3).map(|joint| (joint, IDENTITY)).collect(),
        clips: vec![Clip {
            name: "wave".into(),
            seconds: 1.0,
            channels: vec![
                channel(Property::Translation(0), &[0.1, 0.0, 0.0, 0.3, 0.2, 0.1]),
                channel(Property::Rotation(1), &TURNED),
                channel(Property::Rotation(2), &TURNED),
                channel(Property::Weight(0), &[0.0, 1.0]),
                channel(Property::Weight(1), &[0.0, 1.0]),
            ],
        }],
    };
    source.movements = Some(MeasuredMovements {
        joints: vec![3.0, 1.0, 0.25],
        targets: vec![0.5, 0.01],
        clips: vec![2.0],
    });
    source
}

const LATER: Pose<'_> = Pose::Clip { clip: 0, seconds: 0.75 };

/// All Gaussians of a plan as another renderer would take them.
fn exported(posed: &Posed<'_, '_>, plan: &Plan) -> Vec<PosedGaussian> {
    let mut gaussians = vec![PosedGaussian::default(); plan.gaussians() as usize];
    let written = posed.export(plan, [0.0; 3], Sides::All, &mut gaussians).unwrap();
    gaussians.truncate(written);
    gaussians
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// By every kernel, for the plan and for what is within it.
    #[test]
    fn posing_for_a_plan_does_not_show(counts in prop::array::uniform2(0u32..=200), share in 0f32..=1.0) {
        let file = bytes(&rigged());
        let avatar = Avatar::parse(&file).unwrap();
        let plan = Plan::of_counts(&avatar, counts.into_iter());
        let less = Plan::of_counts(&avatar, counts.into_iter().map(|n| (n as f32 * share) as u32));
        let camera = camera(61, 47, 30.0, 2.0);
        for kernel in kernels() {
            let mut all = vec![0; Posed::scratch_len(&avatar)];
            let all = Posed::new(&avatar, &LATER, kernel, &mut all).unwrap();
            let mut some = vec![u32::MAX; Posed::scratch_len_for_plan(&avatar)];
            let some = Posed::for_plan(&avatar, &LATER, &plan, kernel, &mut some).unwrap();
            for plan in [&plan, &less] {
                prop_assert!(exported(&some, plan) == exported(&all, plan));
                let len = Prepared::scratch_len(&avatar, plan.gaussians(), 61, 47);
                let mut scratch = [vec![0; len], vec![0; len]];
                let [a, b] = scratch.each_mut();
                let a = Prepared::new(&all, plan, &camera, a).unwrap();
                let b = Prepared::new(&some, plan, &camera, b).unwrap();
                prop_assert!(a.splats() == b.splats());
            }
        }
    }

    /// A cofactor's inverse takes back what a transform does.
    #[test]
    fn inverses_take_back(
        t in prop::array::uniform3(-10f32..10.0),
        q in prop::array::uniform4(-1f32..1.0),
        s in prop::array::uniform3(0.1f32..10.0),
        p in prop::array::uniform3(-10f32..10.0),
    ) {
        prop_assume!(q.iter().map(|x| x * x).sum::<f32>() > 0.01);
        let m = affine_of(t, q, s);
        let back = transform(&inverse(&m).unwrap(), transform(&m, p));
        for (a, b) in back.iter().zip(p) {
            prop_assert!((a - b).abs() < 1e-3, "{back:?} {p:?}");
        }
    }
}

#[test]
fn few_gaussians_pose_few_vertices_and_larger_plans_are_refused() {
    let file = bytes(&rigged());
    let avatar = Avatar::parse(&file).unwrap();
    let few = Plan::of_counts(&avatar, [4, 3].into_iter());
    let mut scratch = vec![0; Posed::scratch_len_for_plan(&avatar)];
    let posed = Posed::for_plan(&avatar, &LATER, &few, Kernel::Scalar, &mut scratch).unwrap();
    let finite = posed.vertices().iter().flatten().filter(|x| x.is_finite()).count();
    assert!((9..=7 * 9).contains(&finite), "{finite} of three a vertex");
    let other = Plan::of_counts(&avatar, [4, 4].into_iter());
    let camera = camera(61, 47, 30.0, 2.0);
    let mut preparing = vec![0; Prepared::scratch_len(&avatar, 8, 61, 47)];
    assert_eq!(Prepared::new(&posed, &other, &camera, &mut preparing).err(), Some(Error::Plan));
    let mut gaussians = [PosedGaussian::default(); 8];
    let exported = posed.export(&other, [0.0; 3], Sides::All, &mut gaussians);
    assert_eq!(exported, Err(Error::Plan));
    let mut short = vec![0; Posed::scratch_len_for_plan(&avatar) - 1];
    let refused = Posed::for_plan(&avatar, &LATER, &few, Kernel::Scalar, &mut short);
    assert!(matches!(refused.err(), Some(Error::Scratch { .. })));
}

/// Vertices of a plan of all under which what moves less stays still.
fn vertices(avatar: &Avatar<'_>, pose: &Pose<'_>, still_below: f32) -> Vec<[f32; 3]> {
    let plan = Plan::with_budget(avatar, u32::MAX).with_still_below(still_below);
    let mut scratch = vec![0; Posed::scratch_len_for_plan(avatar)];
    let posed = Posed::for_plan(avatar, pose, &plan, Kernel::Scalar, &mut scratch).unwrap();
    posed.vertices().to_vec()
}

/// The tree shrinks from its leaves: the hand, then the small morph target's like, then the arm, then all.
#[test]
fn what_moves_less_stays_as_it_rests() {
    let source = rigged();
    let file = bytes(&source);
    let avatar = Avatar::parse(&file).unwrap();
    let without = |channels: &[usize]| {
        let mut source = source.clone();
        let mut index = 0;
        source.rig.clips[0].channels.retain(|_| {
            index += 1;
            !channels.contains(&(index - 1))
        });
        let file = bytes(&source);
        let avatar = Avatar::parse(&file).unwrap();
        vertices(&avatar, &LATER, 0.0)
    };
    let everything = without(&[]);
    for (still_below, left_out) in [
        (0.0, &[][..]),
        (0.005, &[]),
        (0.02, &[4]),
        (0.3, &[2, 4]),
        (0.9, &[2, 3, 4]),
        (1.1, &[1, 2, 3, 4]),
        (3.1, &[0, 1, 2, 3, 4]),
    ] {
        let still = vertices(&avatar, &LATER, still_below);
        assert!(still == without(left_out), "below {still_below}");
        assert_eq!(still == everything, left_out.is_empty(), "below {still_below}");
        let plan = Plan::with_budget(&avatar, 9).with_still_below(still_below);
        assert_eq!(plan.is_still(&avatar), left_out.len() == 5, "below {still_below}");
    }
    assert!(vertices(&avatar, &LATER, f32::INFINITY) == vertices(&avatar, &Pose::Rest, 0.0));
    // Joints of the caller are the caller's.
    let worlds: Vec<Affine> = vec![IDENTITY; 3];
    let pose = Pose::Joints { worlds: &worlds, weights: &[1.0, 1.0] };
    assert!(vertices(&avatar, &pose, 0.02) != vertices(&avatar, &pose, 0.0));
    assert!(vertices(&avatar, &pose, 2.0) == vertices(&avatar, &pose, 5.0));
}

/// The whole path moves what its plan lets move.
#[test]
fn pictures_leave_still_what_their_plan_does() {
    let file = bytes(&rigged());
    let avatar = Avatar::parse(&file).unwrap();
    let camera = camera(80, 60, 40.0, 1.5);
    let picture = |pose: &Pose<'_>, still_below: f32| {
        let plan = Plan::with_budget(&avatar, u32::MAX).with_still_below(still_below);
        Picture::of(&avatar, pose, &plan, &camera)
    };
    let rest = picture(&Pose::Rest, 0.0);
    assert!(picture(&LATER, f32::INFINITY) == rest);
    assert!(picture(&LATER, 0.0) != rest);
}

/// A morph target that is there at rest stays there, and rests again when a clip hardly moves it.
#[test]
fn what_stays_still_is_as_at_rest() {
    let mut source = rigged();
    source.mesh.morph_targets[0].default_weight = 0.8;
    source.rig.clips[0].channels.truncate(3);
    source.rig.clips[0].channels.push(Channel {
        property: Property::Weight(0),
        holds: false,
        values: vec![0.7, 0.9],
        step: 0.0,
    });
    let file = bytes(&source);
    let avatar = Avatar::parse(&file).unwrap();
    let rest = vertices(&avatar, &Pose::Rest, 0.0);
    assert!(vertices(&avatar, &Pose::Rest, 0.3) == rest);
    assert!(vertices(&avatar, &LATER, f32::INFINITY) == rest);
    // By 0.05 of 0.5 m it is moved in this moment.
    assert!(vertices(&avatar, &LATER, 0.02) == vertices(&avatar, &LATER, 0.0));
    assert!(vertices(&avatar, &LATER, 0.03) != vertices(&avatar, &LATER, 0.0));
}

/// An avatar is posed for a plan, whether the plan looked for its vertices or all were skinned.
#[test]
fn larger_plans_are_refused_near_and_far() {
    let file = bytes(&rigged());
    let avatar = Avatar::parse(&file).unwrap();
    for counts in [[5, 5], [150, 199]] {
        let plan = Plan::of_counts(&avatar, counts.into_iter());
        let more = Plan::of_counts(&avatar, counts.into_iter().map(|count| count + 1));
        let mut scratch = vec![0; Posed::scratch_len_for_plan(&avatar)];
        let posed = Posed::for_plan(&avatar, &LATER, &plan, Kernel::Scalar, &mut scratch).unwrap();
        let mut gaussians = [PosedGaussian::default(); 400];
        assert!(posed.export(&plan, [0.0; 3], Sides::All, &mut gaussians).is_ok());
        let refused = posed.export(&more, [0.0; 3], Sides::All, &mut gaussians);
        assert_eq!(refused, Err(Error::Plan));
    }
}

/// A chain as long as a file can hold costs little to follow.
#[test]
fn joints_under_too_many_carry_nothing() {
    let mut source = rigged();
    let joint = |index: usize| Joint {
        parent: (index > 0).then(|| index as u16 - 1),
        translation: [0.0; 3],
        ..Joint::default()
    };
    for (count, carries) in [(200, true), (60_000, false)] {
        source.rig.joints = (0..count).map(joint).collect();
        source.rig.binds = (0..3).map(|bind| (count as u16 - 3 + bind, IDENTITY)).collect();
        source.rig.clips[0].channels.truncate(1);
        source.movements = None;
        let file = bytes(&source);
        let avatar = Avatar::parse(&file).unwrap();
        assert_eq!(carried(&avatar, &LATER) != IDENTITY, carries, "{count} joints");
    }
}

/// Half a pixel where the avatar is largest is so many metres; an avatar that nobody sees need not move.
#[test]
fn a_budget_of_pixels_is_one_of_metres() {
    let file = bytes(&rigged());
    let avatar = Avatar::parse(&file).unwrap();
    let mut scratch = vec![0; Posed::scratch_len(&avatar)];
    let posed = Posed::new(&avatar, &Pose::Rest, Kernel::Scalar, &mut scratch).unwrap();
    let still_below = |camera: &Camera, movement: f32| {
        let footprints = posed.footprints(camera);
        let densest = footprints.iter().map(|f| f.density).fold(0.0, f32::max);
        let instances = [Instance { avatar: &avatar, footprints, weight: 1.0 }];
        let mut scratch = vec![0; scratch_len(&instances)];
        let mut plans = [Plan::default()];
        let budget = Budget { movement, ..Budget::of_gaussians(100) };
        plan(&instances, &budget, None, &mut scratch, &mut plans).unwrap();
        (plans[0].still_below(), densest)
    };
    let (near, density) = still_below(&camera(200, 200, 100.0, 2.0), 0.5);
    assert!((near - 0.5 / density).abs() < 1e-6 && (20.0..200.0).contains(&density), "{density}");
    let (far, _) = still_below(&camera(200, 200, 100.0, 20.0), 0.5);
    assert!((9.0..20.0).contains(&(far / near)), "{far} {near}");
    assert_eq!(still_below(&camera(200, 200, 100.0, 2.0), 0.0).0, 0.0);
    assert_eq!(still_below(&camera(200, 200, 100.0, -20.0), 0.5).0, f32::INFINITY);
}

/// Where the root takes the avatar, footprints of the rest pose go along.
#[test]
fn a_rest_pose_is_carried_by_the_joint_above_all() {
    let mut source = rigged();
    let mut turned = source.rig.clips[0].clone();
    turned.channels.truncate(1);
    turned.channels[0].property = Property::Rotation(0);
    turned.channels[0].values = TURNED.to_vec();
    source.rig.clips[0].channels.truncate(1);
    source.rig.clips.push(turned);
    source.movements = None;
    let file = bytes(&source);
    let avatar = Avatar::parse(&file).unwrap();
    let mut scratch = vec![0; Posed::scratch_len(&avatar)];
    let rest = Posed::new(&avatar, &Pose::Rest, Kernel::Scalar, &mut scratch).unwrap();
    let camera = camera(200, 200, 100.0, 2.0);
    for clip in [0, 1] {
        let pose = Pose::Clip { clip, seconds: 0.5 };
        let mut scratch = vec![0; Posed::scratch_len(&avatar)];
        let posed = Posed::new(&avatar, &pose, Kernel::Scalar, &mut scratch).unwrap();
        let carried = carried(&avatar, &pose);
        assert_ne!(carried, IDENTITY);
        for (moved, vertex) in rest.vertices().iter().zip(posed.vertices()) {
            let moved = transform(&carried, *moved);
            assert!(moved.iter().zip(vertex).all(|(a, b)| (a - b).abs() < 1e-5), "{clip}");
        }
        let by_rest = rest.footprints(&camera.for_place(&compose(&IDENTITY, &carried)));
        assert!(by_rest[0].area > 100.0);
        for (a, b) in by_rest.iter().zip(posed.footprints(&camera)).filter(|(a, _)| a.area > 0.0) {
            assert!((a.area / b.area - 1.0).abs() < 1e-3, "{a:?} {b:?}");
            assert!((a.density / b.density - 1.0).abs() < 1e-3, "{a:?} {b:?}");
        }
    }
    assert_eq!(carried(&avatar, &Pose::Rest), IDENTITY);
    assert_eq!(carried(&avatar, &Pose::Clip { clip: 7, seconds: 0.0 }), IDENTITY);
    // Nothing is above two roots.
    source.rig.joints[1].parent = None;
    let file = bytes(&source);
    assert_eq!(carried(&Avatar::parse(&file).unwrap(), &LATER), IDENTITY);
}

#[test]
fn poses_are_held_as_long_as_it_does_not_show() {
    let file = bytes(&rigged());
    let avatar = Avatar::parse(&file).unwrap();
    // 2 m/s at 30 frames a second.
    let frame = 1.0 / 30.0;
    let hold = |density, pixels| frames_to_hold(&avatar, 0, density, frame, pixels);
    for density in [0.1, 1.0, 3.0, 7.5, 30.0, 500.0] {
        for pixels in [0.0, 0.1, 0.5, 1.0, 4.0] {
            let n = hold(density, pixels);
            let late = 2.0 * density * frame * (n - 1) as f32;
            assert!((1..=MOST_FRAMES).contains(&n) && late <= pixels * 1.001, "{n} {late}");
            let longer = 2.0 * density * frame * n as f32;
            assert!(n == MOST_FRAMES || longer > pixels * 0.999, "{n} {longer} of {pixels}");
        }
    }
    for odd in [f32::NAN, f32::INFINITY, -1.0] {
        assert!((1..=MOST_FRAMES).contains(&hold(odd, 0.5)));
        assert!((1..=MOST_FRAMES).contains(&hold(3.0, odd)));
    }
    assert_eq!(frames_to_hold(&avatar, 9, 1.0, frame, 100.0), 1, "an unknown clip");
    // Instances take turns: each once in so many frames, and as many in each frame.
    for n in [1, 2, 5, 60] {
        for index in 0..7 {
            let due = (100..100 + n).filter(|&frame| is_due(index, frame, n)).count();
            assert_eq!(due, 1);
        }
        let due = |frame| (0..60).filter(|&index| is_due(index, frame, n)).count();
        assert!((0..n).all(|frame| due(frame) == 60 / n as usize));
    }
    assert!(is_due(3, 5, 0));
}

/// A clip that is evaluated every fifth frame, and moves on straight lines between: nearer than what is held,
/// the same at both ends, and as near as the turn allows.
#[test]
fn between_two_poses_is_nearer_than_either() {
    let file = bytes(&rigged());
    let avatar = Avatar::parse(&file).unwrap();
    let at = |seconds: f32| vertices(&avatar, &Pose::Clip { clip: 0, seconds }, 0.0);
    let (from, to) = (at(0.2), at(0.4));
    let between =
        |share: f32| vertices(&avatar, &Pose::Between { from: &from, to: &to, share }, 0.0);
    let rms = |a: &[[f32; 3]], b: &[[f32; 3]]| {
        let squares = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b) * (a - b));
        (squares.sum::<f32>() / a.len() as f32).sqrt()
    };
    assert!(between(0.0) == from && rms(&between(1.0), &to) < 1e-6);
    for share in [0.2, 0.4, 0.6, 0.8] {
        let exact = at(0.2 + 0.2 * share);
        let mixed = rms(&between(share), &exact);
        let held = rms(&from, &exact).min(rms(&to, &exact));
        assert!(mixed < 0.2 * held, "{mixed} {held} at {share}");
        // Two turns of 0.26 rad each, of what is less than 1.5 m away.
        assert!(mixed < 1.5 * (1.0 - (0.26f32).cos()), "{mixed} at {share}");
    }
    let short = Pose::Between { from: &from, to: &to[1..], share: 0.5 };
    let mut scratch = vec![0; Posed::scratch_len(&avatar)];
    let refused = Posed::new(&avatar, &short, Kernel::Scalar, &mut scratch).err();
    let count = from.len();
    let wrong = Error::Pose { what: "vertices", expected: count, found: count - 1 };
    assert_eq!(refused, Some(wrong));
}
