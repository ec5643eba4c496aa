//! How far joints and morph targets move the mesh, and how fast clips do: what the runtime may leave out where nobody sees it.

use anyhow::{Result, bail};
use dermis_format::movement::MOST;
use dermis_format::source::MeasuredMovements;
use glam::{Affine3A, Vec3};
use rayon::prelude::*;

use crate::model::{Model, MorphTarget, Vertex};
use crate::scene::{Pose, posed_vertices};

/// Moments of a clip that are looked at, each second and at most.
const MOMENTS_PER_SECOND: f32 = 10.0;
const MOST_MOMENTS: usize = 64;
/// Joints squared times moments at most. Of more, clips are looked at in fewer moments each; where two are too many, all joints
/// count as moving. Avatars have a hundredth of it.
const MOST_LOOKS: usize = 1 << 29;
/// Over which speed is measured, seconds: from key to key of the file.
const INSTANT: f32 = 1.0 / 30.0;

/// Measures all joints, morph targets and clips of a model.
pub fn measure(model: &Model) -> MeasuredMovements {
    let areas = vertex_areas(model);
    let rest = Pose::rest(model);
    let mut joints = match most_moments(model.joints.len(), model.clips.len()) {
        Some(most) => of_joints(model, most, &rest, &areas),
        None => vec![MOST; model.joints.len()],
    };
    // What is above moves at least as far: what stays still is a tree's leaves.
    for index in (0..joints.len()).rev() {
        if let Some(parent) = model.joints[index].parent.map(usize::from) {
            joints[parent] = joints[parent].max(joints[index]);
        }
    }
    let at_rest = matrices(model, &rest);
    let targets = model.morph_targets.iter();
    let targets = targets.map(|target| length(model, target, &at_rest, &areas)).collect();
    let clips = (0..model.clips.len()).map(|clip| speed(model, clip, &areas)).collect();
    MeasuredMovements { joints, targets, clips }
}

/// How far each joint with all below it moves the surface in `most` moments of each clip.
fn of_joints(model: &Model, most: usize, rest: &Pose, areas: &[f64]) -> Vec<f32> {
    let poses: Vec<Pose> = (0..model.clips.len())
        .flat_map(|clip| moments(model.clips[clip].seconds, most).map(move |s| (clip, s)))
        .map(|(clip, seconds)| Pose::of_clip(model, clip, seconds))
        .collect();
    let greatest = |joint: usize| {
        let below = Below::new(model, joint);
        poses.iter().map(|pose| below.error(model, pose, rest, areas)).fold(0.0, f32::max)
    };
    (0..model.joints.len()).into_par_iter().map(greatest).collect()
}

/// A movement that the author knows better.
#[derive(Clone, Debug, PartialEq)]
pub struct Edit {
    /// Of a joint, or of a morph target.
    pub name: String,
    /// In place of what is measured.
    pub metres: f32,
}

/// Puts the author's movements in the place of measured ones; a name may be that of several. Joints above one that moves further
/// move as far, those below one that moves less no further: what stays still is a tree's leaves.
///
/// # Errors
///
/// Where nothing has the name.
pub fn edit(movements: &mut MeasuredMovements, model: &Model, edits: &[Edit]) -> Result<()> {
    for Edit { name, metres } in edits {
        let metres = metres.min(MOST);
        let mut found = false;
        for joint in (0..model.joints.len()).filter(|&joint| model.joints[joint].name == *name) {
            set_joint(&mut movements.joints, model, joint, metres);
            found = true;
        }
        for (target, movement) in model.morph_targets.iter().zip(&mut movements.targets) {
            if target.name == *name {
                *movement = metres;
                found = true;
            }
        }
        if !found {
            let joints = model.joints.iter().map(|joint| joint.name.as_str());
            let targets = model.morph_targets.iter().map(|target| target.name.as_str());
            let names: Vec<&str> = joints.chain(targets).collect();
            let names = names.join(", ");
            bail!("movement of {name}: no joint or morph target; choose one of: {names}");
        }
    }
    Ok(())
}

fn set_joint(joints: &mut [f32], model: &Model, joint: usize, metres: f32) {
    joints[joint] = metres;
    let mut above = joint;
    while let Some(parent) = model.joints[above].parent.map(usize::from) {
        joints[parent] = joints[parent].max(metres);
        above = parent;
    }
    // Parents stand before their children.
    for index in joint + 1..joints.len() {
        if let Some(parent) = model.joints[index].parent.map(usize::from) {
            joints[index] = joints[index].min(joints[parent]);
        }
    }
}

/// Moments in which each clip is looked at, at most; `None` where two are too many.
fn most_moments(joints: usize, clips: usize) -> Option<usize> {
    let looks = joints.saturating_mul(joints).saturating_mul(clips).max(1);
    let most = MOST_LOOKS / looks;
    (most >= 2).then(|| most.min(MOST_MOMENTS))
}

/// Moments of a clip of this length, both ends among them: two to `most`.
fn moments(seconds: f32, most: usize) -> impl Iterator<Item = f32> {
    let steps = ((seconds * MOMENTS_PER_SECOND).ceil() as usize).clamp(1, most.max(2) - 1);
    (0..=steps).map(move |step| seconds * step as f32 / steps as f32)
}

/// A third of the triangles around each vertex at rest, square metres.
fn vertex_areas(model: &Model) -> Vec<f64> {
    let vertices = posed_vertices(model, &Pose::rest(model));
    let mut areas = vec![0.0; vertices.len()];
    for triangle in &model.triangles {
        let [a, b, c] = triangle.corners.map(|corner| vertices[corner as usize]);
        let area = f64::from(0.5 * (b - a).cross(c - a).length());
        triangle.corners.iter().for_each(|&corner| areas[corner as usize] += area / 3.0);
    }
    areas
}

/// Root of the weighted mean of squares; 0 of no weight.
fn rms(squares: impl Iterator<Item = (f64, f32)>) -> f32 {
    let (sum, weight) =
        squares.fold((0.0, 0.0), |(sum, all), (w, square)| (sum + w * f64::from(square), all + w));
    // No file holds more.
    if weight > 0.0 { ((sum / weight).sqrt() as f32).min(MOST) } else { 0.0 }
}

/// A joint with all below it, and the vertices on which they weigh.
struct Below {
    /// Whether a joint is one of them.
    joints: Vec<bool>,
    /// Vertices and the share of their weight.
    vertices: Vec<(usize, f32)>,
}

impl Below {
    fn new(model: &Model, joint: usize) -> Self {
        let mut joints = vec![false; model.joints.len()];
        for index in joint..joints.len() {
            // Parents stand before their children.
            let parent = model.joints[index].parent;
            joints[index] = index == joint || parent.is_some_and(|p| joints[usize::from(p)]);
        }
        let is_below = |bind: u16| joints[usize::from(model.binds[usize::from(bind)].joint)];
        let share = |vertex: &Vertex| -> f32 {
            let influences = vertex.influences.iter();
            influences.filter(|&&(bind, w)| w != 0.0 && is_below(bind)).map(|&(_, w)| w).sum()
        };
        let vertices = if model.binds.is_empty() { &[][..] } else { &model.vertices };
        let vertices = vertices.iter().map(share).enumerate().filter(|&(_, share)| share > 0.0);
        Self { vertices: vertices.collect(), joints }
    }

    /// How far their vertices are from where `pose` has them if these joints alone stay at rest, metres.
    fn error(&self, model: &Model, pose: &Pose, rest: &Pose, areas: &[f64]) -> f32 {
        let mut still = pose.clone();
        for (index, _) in self.joints.iter().enumerate().filter(|(_, below)| **below) {
            still.locals[index] = rest.locals[index];
        }
        if still.locals == pose.locals {
            return 0.0;
        }
        let [now, still] = [pose, &still].map(|pose| matrices(model, pose));
        rms(self.vertices.iter().map(|&(index, share)| {
            let vertex = &model.vertices[index];
            // Morph targets are small beside what joints do.
            let moved: Vec3 = vertex
                .influences
                .iter()
                .filter(|&&(_, weight)| weight != 0.0)
                .map(|&(bind, weight)| {
                    let [a, b] = [&now, &still]
                        .map(|moves| moves[usize::from(bind)].transform_point3(vertex.position));
                    weight * (a - b)
                })
                .sum();
            (areas[index] * f64::from(share), moved.length_squared())
        }))
    }
}

/// Of the vertices that a target moves, in the world at rest: bind space may be smaller or larger.
fn length(model: &Model, target: &MorphTarget, rest: &[Affine3A], areas: &[f64]) -> f32 {
    rms(target.deltas.iter().map(|&(vertex, delta)| {
        let influences = model.vertices[vertex as usize].influences.iter();
        let moved: Vec3 = influences
            .filter(|&&(_, weight)| weight != 0.0)
            .map(|&(bind, weight)| weight * rest[usize::from(bind)].transform_vector3(delta))
            .sum();
        let moved = if rest.is_empty() { delta } else { moved };
        (areas[vertex as usize], moved.length_squared())
    }))
}

/// Bind space → world of each bind.
fn matrices(model: &Model, pose: &Pose) -> Vec<Affine3A> {
    let worlds = pose.joint_worlds(model);
    model.binds.iter().map(|bind| worlds[usize::from(bind.joint)] * bind.inverse).collect()
}

/// Of the fastest instant, m/s.
fn speed(model: &Model, clip: usize, areas: &[f64]) -> f32 {
    let length = model.clips[clip].seconds;
    let instants = (length / INSTANT).ceil().max(1.0) as usize;
    let at = |instant: usize| {
        let seconds = length * instant as f32 / instants as f32;
        posed_vertices(model, &Pose::of_clip(model, clip, seconds))
    };
    let instant = length.max(1e-6) / instants as f32;
    let speed = |index: usize| {
        let (before, after) = (at(index), at(index + 1));
        let squares = before.iter().zip(&after).map(|(a, b)| (*a - *b).length_squared());
        rms(areas.iter().copied().zip(squares)) / instant
    };
    (0..instants).into_par_iter().map(speed).reduce(|| 0.0, f32::max).min(MOST)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::demo::demo_avatar;

    #[test]
    fn joints_of_the_demo_move_as_far_as_they_should() {
        let model = demo_avatar();
        let movements = measure(&model);
        assert_eq!(movements.joints.len(), model.joints.len());
        let of = |name: &str| {
            let joint = model.joints.iter().position(|joint| joint.name == name);
            movements.joints[joint.expect("it is there")]
        };
        for (index, joint) in model.joints.iter().enumerate() {
            let moved = movements.joints[index];
            assert!((0.0..3.0).contains(&moved), "{} {moved}", joint.name);
            let above =
                joint.parent.map_or(f32::MAX, |parent| movements.joints[usize::from(parent)]);
            assert!(above >= moved, "{} {moved}, above {above}", joint.name);
        }
        // It waves with its right arm; its left hand follows the forearm.
        assert!(of("upper_arm_right") > of("hand_right"), "{movements:?}");
        assert!(of("hand_right") > 0.01 && of("hand_left") == 0.0, "{movements:?}");
        assert!(movements.clips.iter().all(|&speed| speed > 0.05 && speed < 10.0));
    }

    #[test]
    fn many_joints_and_clips_are_looked_at_less_or_count_as_moving() {
        assert_eq!(most_moments(300, 50), Some(MOST_MOMENTS));
        assert_eq!(most_moments(0, 0), Some(MOST_MOMENTS));
        assert_eq!(most_moments(8_000, 1), Some(8));
        assert_eq!((most_moments(60_000, 1), most_moments(1_000, 60_000)), (None, None));
        let ends = |most| moments(4.0, most).collect::<Vec<_>>();
        assert_eq!((ends(2), ends(3)), (vec![0.0, 4.0], vec![0.0, 2.0, 4.0]));
        assert_eq!(ends(MOST_MOMENTS).len(), 41);
    }

    #[test]
    fn authors_may_know_better() {
        let model = demo_avatar();
        let measured = measure(&model);
        let edited = |name: &str, metres: f32| {
            let mut movements = measured.clone();
            edit(&mut movements, &model, &[Edit { name: name.into(), metres }])
                .expect("it is there");
            for (index, joint) in model.joints.iter().enumerate() {
                if let Some(parent) = joint.parent {
                    assert!(movements.joints[usize::from(parent)] >= movements.joints[index]);
                }
            }
            movements
        };
        let joint = |name: &str| {
            let joint = model.joints.iter().position(|joint| joint.name == name);
            joint.expect("it is there")
        };
        let [upper, hand] = ["upper_arm_right", "hand_right"].map(joint);
        let lively = edited("hand_right", 1000.0);
        assert_eq!([lively.joints[upper], lively.joints[hand], lively.joints[0]], [1000.0; 3]);
        let still = edited("upper_arm_right", 0.0);
        assert_eq!([still.joints[upper], still.joints[hand]], [0.0; 2]);
        assert_eq!(still.joints[0], measured.joints[0]);
        let target = edited(&model.morph_targets[1].name, 1e30);
        assert_eq!((target.targets[1], &target.joints), (MOST, &measured.joints));
        let absent = [Edit { name: "tail".into(), metres: 1.0 }];
        let error = edit(&mut measured.clone(), &model, &absent).expect_err("it has none");
        let error = error.to_string();
        assert!(error.starts_with("movement of tail: no joint or morph target; choose one of: "));
    }

    #[test]
    fn what_a_root_moves_is_as_far_off_as_it_moved() {
        let model = demo_avatar();
        let rest = Pose::rest(&model);
        let root = Below::new(&model, 0);
        let mut moved = rest.clone();
        moved.locals[0].translation.x += 0.25;
        let areas = vertex_areas(&model);
        assert!((root.error(&model, &moved, &rest, &areas) - 0.25).abs() < 1e-4);
        assert_eq!(root.error(&model, &rest, &rest, &areas), 0.0);
        assert_eq!(root.vertices.len(), model.vertices.len());
    }
}
