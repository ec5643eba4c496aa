//! The figure's joints, and how smoothly its skin follows them.

use glam::{Affine3A, Vec3};

use super::body::Hold;
use crate::model::{Bind, Joint, Trs};

pub(super) const ROOT: u16 = 0;
pub(super) const HIPS: u16 = 1;
pub(super) const SPINE: u16 = 2;
pub(super) const CHEST: u16 = 3;
pub(super) const NECK: u16 = 4;
pub(super) const HEAD: u16 = 5;
/// Upper arm, forearm and hand of the left, then the same of the right.
pub(super) const ARM: [u16; 2] = [6, 9];
/// Thigh, shin and foot of the left, then the same of the right.
pub(super) const LEG: [u16; 2] = [12, 15];

/// Places of the left joints at rest, metres; the right ones are at −x.
pub(super) const SHOULDER: Vec3 = Vec3::new(0.152, 1.020, -0.005);
pub(super) const ELBOW: Vec3 = Vec3::new(0.284, 0.854, -0.005);
pub(super) const WRIST: Vec3 = Vec3::new(0.402, 0.706, -0.005);
pub(super) const HIP: Vec3 = Vec3::new(0.090, 0.620, 0.0);
const KNEE: Vec3 = Vec3::new(0.095, 0.365, 0.0);
pub(super) const ANKLE: Vec3 = Vec3::new(0.100, 0.095, 0.0);
/// Heights where the trunk bends, and the middle of each bend.
const WAIST_Y: f32 = 0.77;
const CHEST_Y: f32 = 0.90;
const NECK_Y: f32 = 1.11;
const HEAD_Y: f32 = 1.18;

/// (joint, weight); unused ones weigh nothing.
pub(super) type Influences = [(u16, f32); 4];

/// Name, parent and place at rest of every joint.
fn places() -> Vec<(String, Option<u16>, Vec3)> {
    let height = |y: f32| Vec3::new(0.0, y, 0.0);
    let mut list = vec![
        ("root".to_owned(), None, Vec3::ZERO),
        ("hips".to_owned(), Some(ROOT), height(0.66)),
        ("spine".to_owned(), Some(HIPS), height(WAIST_Y)),
        ("chest".to_owned(), Some(SPINE), height(CHEST_Y)),
        ("neck".to_owned(), Some(CHEST), height(NECK_Y)),
        ("head".to_owned(), Some(NECK), height(HEAD_Y)),
    ];
    let chains = [
        (CHEST, [("upper_arm", SHOULDER), ("forearm", ELBOW), ("hand", WRIST)]),
        (HIPS, [("thigh", HIP), ("shin", KNEE), ("foot", ANKLE)]),
    ];
    for (start, chain) in chains {
        for (side, mirror) in [("left", 1.0), ("right", -1.0)] {
            let mut parent = start;
            for (name, place) in chain {
                let own = list.len() as u16;
                let place = place * Vec3::new(mirror, 1.0, 1.0);
                list.push((format!("{name}_{side}"), Some(parent), place));
                parent = own;
            }
        }
    }
    list
}

/// Joints, and one bind for each in the same order. At rest none is turned.
pub(super) fn skeleton() -> (Vec<Joint>, Vec<Bind>) {
    let places = places();
    let joint = |(name, parent, place): &(String, Option<u16>, Vec3)| {
        let origin = parent.map_or(Vec3::ZERO, |parent| places[usize::from(parent)].2);
        let rest = Trs { translation: *place - origin, ..Trs::IDENTITY };
        Joint { name: name.clone(), parent: *parent, rest }
    };
    let bind = |(joint, place): (u16, &(String, Option<u16>, Vec3))| Bind {
        joint,
        inverse: Affine3A::from_translation(-place.2),
    };
    let joints = places.iter().map(joint).collect();
    (joints, (0..).zip(&places).map(bind).collect())
}

/// What moves a place of the left half or the middle; see [`mirrored`].
pub(super) fn influences(hold: Hold, place: Vec3) -> Influences {
    let [arm, leg] = [ARM[0], LEG[0]];
    match hold {
        Hold::Head => chain(&[HEAD], &[]),
        Hold::Neck => {
            chain(&[CHEST, NECK, HEAD], &[bend(place.y, NECK_Y, 0.04), bend(place.y, HEAD_Y, 0.03)])
        }
        Hold::Torso => torso(place),
        Hold::Arm | Hold::Hand => {
            let along = (WRIST - SHOULDER).normalize();
            let at = |joint: Vec3, half: f32| bend((place - joint).dot(along), 0.0, half);
            let bends = [at(SHOULDER, 0.06), at(ELBOW, 0.06), at(WRIST, 0.03)];
            // Fingers and thumb follow the hand alone.
            let bends = if hold == Hold::Hand { [1.0, 1.0, bends[2]] } else { bends };
            chain(&[CHEST, arm, arm + 1, arm + 2], &bends)
        }
        Hold::Leg => {
            let at = |joint: Vec3, half: f32| bend(-place.y, -joint.y, half);
            chain(
                &[HIPS, leg, leg + 1, leg + 2],
                &[at(HIP + Vec3::Y * 0.02, 0.06), at(KNEE, 0.065), at(ANKLE, 0.02)],
            )
        }
        Hold::Foot => chain(&[leg + 2], &[]),
    }
}

/// The trunk bends at the waist and the chest, and gives way a little to shoulders and hips.
fn torso(place: Vec3) -> Influences {
    let trunk =
        chain(&[HIPS, SPINE, CHEST], &[bend(place.y, WAIST_Y, 0.06), bend(place.y, CHEST_Y, 0.07)]);
    let side = usize::from(place.x < 0.0);
    let near = place.with_x(place.x.abs());
    let pull = |joint: Vec3, reach: f32, most: f32| {
        most * (1.0 - bend(near.distance(joint), 0.6 * reach, 0.4 * reach))
    };
    let shoulder = pull(SHOULDER, 0.12, 0.45);
    let hip = pull(HIP + Vec3::Z * place.z, 0.14, 0.40) * bend(near.x, 0.03, 0.03);
    let (limb, weight) = if shoulder > hip { (ARM[side], shoulder) } else { (LEG[side], hip) };
    let mut influences = trunk.map(|(joint, share)| (joint, share * (1.0 - weight)));
    influences[3] = (limb, weight);
    influences
}

/// 0 before `middle − half`, 1 after `middle + half`, smooth between.
fn bend(value: f32, middle: f32, half: f32) -> f32 {
    let t = ((value - middle) / (2.0 * half) + 0.5).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Weights along a chain of up to four joints, given how far each bend is passed.
fn chain(joints: &[u16], bends: &[f32]) -> Influences {
    let mut influences = [(joints[0], 0.0); 4];
    let mut left = 1.0;
    for (slot, &joint) in joints.iter().enumerate() {
        // What is past the next bend belongs to later joints.
        let passed = bends.get(slot).map_or(0.0, |&bend| left * bend);
        influences[slot] = (joint, left - passed);
        left = passed;
    }
    influences
}

/// The same influences of the place at −x.
pub(super) fn mirrored(influences: Influences) -> Influences {
    let other = |joint: u16| match joint {
        6..=8 | 12..=14 => joint + 3,
        9..=11 | 15..=17 => joint - 3,
        middle => middle,
    };
    influences.map(|(joint, weight)| (other(joint), weight))
}
