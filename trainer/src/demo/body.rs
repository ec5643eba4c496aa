//! The figure's parts: shape, place in the texture, and what moves them.

use glam::{Vec2, Vec3};

use super::loft::{Loft, Ring};
use super::rig::{ANKLE, ELBOW, HIP, SHOULDER, WRIST};

/// What a part is painted as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Surface {
    Head,
    Torso,
    Hair,
    Arm,
    Leg,
    Shoe,
    /// Hands, neck, ears and nose.
    Skin,
    /// Strands that stick out of the hair.
    Lock,
}

/// How a part hangs on the joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Hold {
    Head,
    Neck,
    Torso,
    Arm,
    Hand,
    Leg,
    Foot,
}

/// A closed surface of the figure, at rest.
pub(super) struct Part {
    pub(super) loft: Loft,
    pub(super) surface: Surface,
    pub(super) hold: Hold,
    /// Whether it stands for a second one at −x as well.
    pub(super) paired: bool,
}

/// Middle of the head, metres.
pub(super) const HEAD: Vec3 = Vec3::new(0.0, 1.40, 0.0);
const HEAD_RADII: Vec3 = Vec3::new(0.215, 0.235, 0.200);
/// The hair is an ellipsoid that the face sticks out of; where they cross is the hairline.
const HAIR: Vec3 = Vec3::new(0.0, 1.453, -0.040);
const HAIR_RADII: Vec3 = Vec3::new(0.233, 0.235, 0.212);

/// How deep a place is in the hair: under 1 inside, 1 on its surface.
pub(super) fn hair_depth(position: Vec3) -> f32 {
    ((position - HAIR) / HAIR_RADII).length()
}

impl Surface {
    /// Pixels of the texture: left, top, width, height. Parts of one surface share them.
    pub(super) const fn texels(self) -> [u32; 4] {
        match self {
            Self::Head => [0, 0, 288, 240],
            Self::Torso => [0, 240, 288, 272],
            Self::Hair => [288, 0, 224, 96],
            Self::Arm => [288, 96, 112, 176],
            Self::Leg => [400, 96, 112, 304],
            Self::Shoe => [288, 272, 112, 128],
            Self::Skin => [400, 400, 112, 112],
            Self::Lock => [288, 400, 112, 112],
        }
    }
}

/// All parts; of pairs the one at +x, the figure's left.
pub(super) fn parts() -> Vec<Part> {
    let single = |loft, surface, hold| Part { loft, surface, hold, paired: false };
    let pair = |loft, surface, hold| Part { loft, surface, hold, paired: true };
    let mut parts = vec![
        single(head(), Surface::Head, Hold::Head),
        single(torso(), Surface::Torso, Hold::Torso),
        single(hair(), Surface::Hair, Hold::Head),
        single(neck(), Surface::Skin, Hold::Neck),
        single(nose(), Surface::Skin, Hold::Head),
        pair(ear(), Surface::Skin, Hold::Head),
        pair(arm(), Surface::Arm, Hold::Arm),
        pair(palm(), Surface::Skin, Hold::Hand),
        pair(leg(), Surface::Leg, Hold::Leg),
        pair(shoe(), Surface::Shoe, Hold::Foot),
    ];
    parts.extend(fingers().map(|finger| pair(finger, Surface::Skin, Hold::Hand)));
    parts.extend(locks().map(|lock| single(lock, Surface::Lock, Hold::Head)));
    parts
}

fn head() -> Loft {
    // Rings are close where eyes and mouth move.
    let latitudes =
        [-68.0, -50.0, -38.0, -29.0, -21.0, -13.0, -5.0, 3.0, 11.0, 20.0, 31.0, 46.0, 66.0];
    let mut loft = Loft::ellipsoid(HEAD, HEAD_RADII, &latitudes, 26);
    loft.front_density = 0.5;
    let last = loft.rings.len() - 1;
    // Texels are as close as rings.
    loft.stations = (0..=last).map(|ring| ring as f32 / last as f32).collect();
    for ring in &mut loft.rings {
        // Round cheeks: wider a little under the middle.
        let height = (ring.center.y - HEAD.y) / HEAD_RADII.y;
        let cheeks = 1.0 + 0.05 * (-((height + 0.45) / 0.35).powi(2)).exp();
        ring.side *= cheeks;
        ring.front *= cheeks;
    }
    loft
}

fn hair() -> Loft {
    let latitudes = [-62.0, -40.0, -20.0, -2.0, 15.0, 32.0, 50.0, 70.0];
    Loft::ellipsoid(HAIR, HAIR_RADII, &latitudes, 18)
}

/// A fringe swept to one side, and a tuft on top.
fn locks() -> impl Iterator<Item = Loft> {
    let fringe = [
        (-0.135, -0.150, 1.47),
        (-0.07, -0.105, 1.475),
        (0.0, -0.035, 1.485),
        (0.075, 0.055, 1.49),
        (0.14, 0.145, 1.475),
    ];
    let fringe = fringe.into_iter().map(|(root, tip, height)| {
        let on_head = |x: f32, y: f32, lift: f32| {
            let around = 1.0 - (x / HEAD_RADII.x).powi(2) - ((y - HEAD.y) / HEAD_RADII.y).powi(2);
            Vec3::new(x, y, HEAD_RADII.z * around.max(0.0).sqrt() + lift)
        };
        let middle = 0.5 * (root + tip);
        let path = [
            (on_head(root, 1.600, -0.02), 0.0),
            (on_head(root, 1.585, -0.004), 0.030),
            (on_head(middle, 1.54, 0.010), 0.040),
            (on_head(tip, 0.4 * 1.54 + 0.6 * height, 0.008), 0.026),
            (on_head(tip * 1.08, height - 0.012, 0.006), 0.0),
        ];
        Loft::tube(&path, Vec3::Z, 6)
    });
    let tufts = [(-0.015, -0.055), (0.02, 0.045)].into_iter().map(|(root, tip)| {
        let path = [
            (Vec3::new(root, 1.655, -0.04), 0.0),
            (Vec3::new(root, 1.675, -0.04), 0.026),
            (Vec3::new(0.5 * (root + tip), 1.705, -0.045), 0.018),
            (Vec3::new(tip, 1.735, -0.065), 0.0),
        ];
        Loft::tube(&path, Vec3::Z, 6)
    });
    fringe.chain(tufts)
}

fn neck() -> Loft {
    let at = |y: f32, radius: f32| (Vec3::new(0.0, y, -0.01), radius);
    Loft::tube(
        &[at(1.05, 0.0), at(1.07, 0.07), at(1.12, 0.066), at(1.2, 0.07), at(1.23, 0.0)],
        Vec3::Z,
        10,
    )
}

fn nose() -> Loft {
    let radii = Vec3::new(0.021, 0.018, 0.020);
    Loft::ellipsoid(Vec3::new(0.0, 1.335, 0.200), radii, &[-35.0, 15.0, 55.0], 7)
}

fn ear() -> Loft {
    let radii = Vec3::new(0.030, 0.048, 0.036);
    Loft::ellipsoid(Vec3::new(0.216, 1.365, -0.005), radii, &[-50.0, -10.0, 25.0, 60.0], 6)
}

fn torso() -> Loft {
    let ring = |&(y, side, front): &(f32, f32, f32)| Ring {
        center: Vec3::new(0.0, y, 0.0),
        front: Vec3::Z * front,
        side: Vec3::X * side,
    };
    // Height, half width, half depth. The shirt hangs over the belt by a step.
    let rings = [
        (0.545, 0.0, 0.0),
        (0.560, 0.090, 0.072),
        (0.600, 0.160, 0.112),
        (0.650, 0.176, 0.125),
        (0.705, 0.171, 0.124),
        (0.735, 0.169, 0.125),
        (0.738, 0.180, 0.134),
        (0.820, 0.177, 0.130),
        (0.900, 0.175, 0.126),
        (0.970, 0.178, 0.124),
        (1.030, 0.172, 0.118),
        (1.075, 0.142, 0.102),
        (1.110, 0.092, 0.082),
        (1.125, 0.0, 0.0),
    ];
    Loft::new(rings.iter().map(ring).collect(), 18)
}

fn arm() -> Loft {
    let along = (ELBOW - SHOULDER).normalize();
    // Metres from the shoulder, radius. The sleeve ends by a step.
    let path = [
        (-0.070, 0.0),
        (-0.058, 0.040),
        (-0.025, 0.063),
        (0.030, 0.068),
        (0.095, 0.069),
        (0.098, 0.054),
        (0.155, 0.051),
        (0.190, 0.049),
        (0.220, 0.048),
        (0.255, 0.046),
        (0.320, 0.042),
        (0.375, 0.036),
        (0.396, 0.028),
        (0.410, 0.0),
    ];
    let path = path.map(|(distance, radius)| (SHOULDER + along * distance, radius));
    Loft::tube(&path, Vec3::Z, 8)
}

fn palm() -> Loft {
    let along = (WRIST - ELBOW).normalize();
    let flat = along.cross(Vec3::Z);
    let ring = |&(distance, wide, thick): &(f32, f32, f32)| Ring {
        center: WRIST + along * distance,
        front: Vec3::Z * wide,
        side: flat * thick,
    };
    let rings = [
        (-0.032, 0.0, 0.0),
        (-0.022, 0.032, 0.031),
        (0.000, 0.041, 0.033),
        (0.035, 0.050, 0.034),
        (0.075, 0.049, 0.031),
        (0.100, 0.034, 0.022),
        (0.106, 0.0, 0.0),
    ];
    Loft::new(rings.iter().map(ring).collect(), 8)
}

/// Three fingers and the thumb.
fn fingers() -> impl Iterator<Item = Loft> {
    let along = (WRIST - ELBOW).normalize();
    // Root along the hand, root and direction towards the front, length.
    let list = [
        (0.080, -0.033, -0.15, 0.052),
        (0.085, 0.0, 0.0, 0.060),
        (0.080, 0.033, 0.15, 0.054),
        (0.025, 0.036, 1.0, 0.064),
    ];
    list.into_iter().map(move |(root, front, spread, length)| {
        let direction = (along + Vec3::Z * spread).normalize();
        let root = WRIST + along * root + Vec3::Z * front;
        let path = [(-0.01, 0.0), (0.0, 0.017), (0.7, 0.0185), (0.93, 0.013), (1.0, 0.0)];
        let path = path.map(|(t, radius)| (root + direction * (t * length), radius));
        Loft::tube(&path, along.cross(Vec3::Z), 5)
    })
}

fn leg() -> Loft {
    // Height, radius, top to bottom. The rolled hem ends by a step.
    let path = [
        (0.690, 0.0),
        (0.670, 0.056),
        (0.630, 0.078),
        (0.550, 0.088),
        (0.470, 0.083),
        (0.405, 0.080),
        (0.365, 0.079),
        (0.325, 0.079),
        (0.178, 0.080),
        (0.175, 0.089),
        (0.122, 0.090),
        (0.118, 0.058),
        (0.085, 0.054),
        (0.060, 0.0),
    ];
    let path = path.map(|(y, radius)| {
        let down = (HIP.y - y) / (HIP.y - ANKLE.y);
        (Vec3::new(HIP.x + (ANKLE.x - HIP.x) * down, y, 0.0), radius)
    });
    Loft::tube(&path, Vec3::Z, 10)
}

fn shoe() -> Loft {
    // Front coordinate, middle height, half width, half height: heel to toe.
    let rings = [
        (-0.090, 0.045, 0.0, 0.0),
        (-0.084, 0.045, 0.034, 0.036),
        (-0.055, 0.050, 0.056, 0.062),
        (-0.005, 0.055, 0.061, 0.070),
        (0.050, 0.045, 0.066, 0.062),
        (0.105, 0.036, 0.072, 0.054),
        (0.150, 0.032, 0.064, 0.044),
        (0.178, 0.030, 0.036, 0.028),
        (0.184, 0.030, 0.0, 0.0),
    ];
    let ring = |&(z, height, side, up): &(f32, f32, f32, f32)| Ring {
        center: Vec3::new(ANKLE.x + 0.006, height, z),
        front: Vec3::Y * up,
        side: Vec3::NEG_X * side,
    };
    let mut loft = Loft::new(rings.iter().map(ring).collect(), 10);
    loft.floor = 0.0;
    loft
}

/// How a morph target moves a place of the head's surface, metres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Expression {
    Blink,
    Smile,
}

/// Middle of the left eye, on the plane of the face, metres.
pub(super) const EYE: Vec2 = Vec2::new(0.083, 1.392);
/// Middle of the mouth.
pub(super) const MOUTH: Vec2 = Vec2::new(0.0, 1.272);

impl Expression {
    /// Displacement of a place on the head.
    pub(super) fn displacement(self, position: Vec3) -> Vec3 {
        if position.z < 0.05 {
            return Vec3::ZERO;
        }
        let place = Vec2::new(position.x.abs(), position.y);
        match self {
            Self::Blink => {
                // The painted eye is pressed to a line under its middle; the skin around follows.
                let offset = place - EYE;
                let inside = falloff(offset.length() / 0.125, 0.47);
                Vec3::Y * (-inside * (0.95 * offset.y + 0.012))
            }
            Self::Smile => {
                // The corners go up and apart, the middle stays.
                let offset = place - MOUTH;
                let lift = falloff(offset.length() / 0.135, 0.4);
                let bow = (offset.x / 0.06).powi(2).min(1.5);
                Vec3::new(0.26 * position.x, 0.019 * bow - 0.004, 0.0) * lift
            }
        }
    }
}

/// 1 up to `plateau`, then smoothly to 0 at 1.
fn falloff(distance: f32, plateau: f32) -> f32 {
    let t = ((1.0 - distance) / (1.0 - plateau)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
