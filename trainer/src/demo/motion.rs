//! The figure's clips.

use glam::{Quat, Vec3};

use super::rig::{ARM, CHEST, HEAD, HIPS, LEG, NECK, ROOT, SPINE};
use super::{BLINK, SMILE};
use crate::model::{Channel, ChannelTarget, Clip, Interpolation};

/// Where the hips are at rest in the space of the root, metres.
const HIPS_REST: Vec3 = Vec3::new(0.0, 0.66, 0.0);

/// All clips.
pub(super) fn clips() -> Vec<Clip> {
    vec![wave(), walk(), turn()]
}

/// Channels of a clip whose keys are evenly spaced.
struct Builder {
    seconds: f32,
    channels: Vec<Channel>,
}

impl Builder {
    fn add(
        &mut self,
        target: ChannelTarget,
        interpolation: Interpolation,
        values: Vec<f32>,
        keys: usize,
    ) {
        let times = (0..keys).map(|key| self.seconds * key as f32 / (keys - 1) as f32).collect();
        self.channels.push(Channel { target, interpolation, times, values });
    }

    /// Rotations by angles in degrees about x, then y, then z of the parent.
    fn rotate(&mut self, joint: u16, angles: &[[f32; 3]]) {
        let quaternion = |angles: &[f32; 3]| {
            let [x, y, z] = angles.map(f32::to_radians);
            let turn =
                Quat::from_rotation_z(z) * Quat::from_rotation_y(y) * Quat::from_rotation_x(x);
            turn.to_array()
        };
        let values = angles.iter().flat_map(quaternion).collect();
        self.add(ChannelTarget::Rotation(joint), Interpolation::Linear, values, angles.len());
    }

    /// The hips, by offsets from rest in metres.
    fn shift_hips(&mut self, offsets: &[[f32; 3]]) {
        let values = offsets
            .iter()
            .flat_map(|&offset| (HIPS_REST + Vec3::from(offset)).to_array())
            .collect();
        self.add(ChannelTarget::Translation(HIPS), Interpolation::Linear, values, offsets.len());
    }

    fn weigh(&mut self, target: u16, interpolation: Interpolation, values: Vec<f32>) {
        let width = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let keys = values.len() / width;
        self.add(ChannelTarget::Weight(target), interpolation, values, keys);
    }

    fn finish(self, name: &str) -> Clip {
        Clip { name: name.to_owned(), seconds: self.seconds, channels: self.channels }
    }
}

/// Greets with the right hand.
fn wave() -> Clip {
    let mut clip = Builder { seconds: 2.4, channels: Vec::new() };
    let [left, right] = ARM;
    let up = [0.0, 0.0, -76.0];
    clip.rotate(right, &[[0.0; 3], up, up, up, up, up, [0.0; 3]]);
    let swing = |z: f32| [0.0, 0.0, z];
    clip.rotate(right + 1, &[0.0, -64.0, -22.0, -64.0, -22.0, -64.0, 0.0].map(swing));
    clip.rotate(right + 2, &[0.0, -12.0, 12.0, -12.0, 12.0, -12.0, 0.0].map(swing));
    clip.rotate(left, &[[0.0; 3], [8.0, 0.0, -22.0], [8.0, 0.0, -22.0], [0.0; 3]]);
    clip.rotate(left + 1, &[[0.0; 3], [-30.0, 0.0, 0.0], [-30.0, 0.0, 0.0], [0.0; 3]]);
    clip.rotate(HEAD, &[[0.0; 3], [0.0, 0.0, 9.0], [-4.0, -8.0, 9.0], [0.0; 3]]);
    clip.rotate(CHEST, &[[0.0; 3], [0.0, 0.0, 5.0], [0.0, 0.0, 5.0], [0.0; 3]]);
    clip.shift_hips(&[[0.0; 3], [0.012, -0.004, 0.0], [0.012, -0.004, 0.0], [0.0; 3]]);
    // In-tangent, value, out-tangent: one soft blink in the middle.
    let blink = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    clip.weigh(BLINK, Interpolation::CubicSpline, blink.to_vec());
    clip.weigh(SMILE, Interpolation::Linear, vec![0.0, 1.0, 1.0, 0.0]);
    clip.finish("wave")
}

/// Two steps in place.
fn walk() -> Clip {
    let mut clip = Builder { seconds: 1.2, channels: Vec::new() };
    // Left thigh and shin over one cycle; the right side is half a cycle later. Negative swings
    // a leg to the front, positive bends a knee.
    let thigh = [-28.0, -16.0, 2.0, 18.0, 24.0, 4.0, -24.0, -32.0];
    let shin = [4.0, 10.0, 6.0, 8.0, 28.0, 56.0, 46.0, 12.0];
    let foot = [-4.0, 4.0, 0.0, 2.0, 14.0, 8.0, -6.0, -10.0];
    let cycle = |angles: [f32; 8], delay: usize| {
        std::array::from_fn::<_, 9, _>(|key| [angles[(key + delay) % 8], 0.0, 0.0])
    };
    for (side, delay) in [(0, 0), (1, 4)] {
        clip.rotate(LEG[side], &cycle(thigh, delay));
        clip.rotate(LEG[side] + 1, &cycle(shin, delay));
        clip.rotate(LEG[side] + 2, &cycle(foot, delay));
        // Arms hang beside the body and swing against the legs.
        let down = if side == 0 { -26.0 } else { 26.0 };
        let swing = cycle([30.0, 22.0, 2.0, -20.0, -30.0, -20.0, 2.0, 22.0], delay);
        clip.rotate(ARM[side], &swing.map(|[x, ..]| [x, 0.0, down]));
        clip.rotate(ARM[side] + 1, &swing.map(|[x, ..]| [0.5 * x - 24.0, 0.0, 0.0]));
    }
    let turned = |degrees: f32| {
        [8.0, 5.0, 0.0, -5.0, -8.0, -5.0, 0.0, 5.0, 8.0].map(|y| [0.0, y / 8.0 * degrees, 0.0])
    };
    clip.rotate(HIPS, &turned(-6.0));
    clip.rotate(CHEST, &turned(11.0));
    clip.rotate(NECK, &turned(-5.0));
    clip.shift_hips(
        &[-0.022, -0.014, 0.004, 0.002, -0.022, -0.014, 0.004, 0.002, -0.022]
            .map(|y| [0.0, y, 0.0]),
    );
    clip.finish("walk")
}

/// Looks over one shoulder and the other, then turns around a little. Its poses are in no other clip.
fn turn() -> Clip {
    let mut clip = Builder { seconds: 3.0, channels: Vec::new() };
    let yaw = |y: f32| [0.0, y, 0.0];
    clip.rotate(ROOT, &[0.0, 25.0, 70.0, 20.0, -40.0, 0.0].map(yaw));
    clip.rotate(SPINE, &[0.0, 14.0, 10.0, -12.0, -14.0, 0.0].map(yaw));
    clip.rotate(
        CHEST,
        &[
            [0.0; 3],
            [4.0, 14.0, 0.0],
            [-4.0, 8.0, 4.0],
            [6.0, -14.0, 0.0],
            [0.0, -10.0, -4.0],
            [0.0; 3],
        ],
    );
    clip.rotate(
        HEAD,
        &[
            [0.0; 3],
            [6.0, 26.0, 0.0],
            [-6.0, 10.0, 6.0],
            [8.0, -24.0, 0.0],
            [0.0, -20.0, -8.0],
            [0.0; 3],
        ],
    );
    let [left, right] = ARM;
    clip.rotate(
        left,
        &[
            [0.0; 3],
            [-30.0, 0.0, 30.0],
            [-10.0, 0.0, 45.0],
            [-50.0, 0.0, 0.0],
            [20.0, 0.0, 10.0],
            [0.0; 3],
        ],
    );
    clip.rotate(
        right,
        &[
            [0.0; 3],
            [20.0, 0.0, -10.0],
            [-40.0, 0.0, -40.0],
            [-20.0, 0.0, 10.0],
            [-55.0, 0.0, -20.0],
            [0.0; 3],
        ],
    );
    clip.rotate(
        left + 1,
        &[
            [0.0; 3],
            [-50.0, 0.0, 0.0],
            [-20.0, 0.0, 30.0],
            [-70.0, 0.0, 0.0],
            [-15.0, 0.0, 0.0],
            [0.0; 3],
        ],
    );
    clip.rotate(
        right + 1,
        &[
            [0.0; 3],
            [-15.0, 0.0, 0.0],
            [-60.0, 0.0, 0.0],
            [-30.0, 0.0, 0.0],
            [-75.0, 0.0, 0.0],
            [0.0; 3],
        ],
    );
    // A shallow bend of the knees: hips sink by what thigh and shin lose.
    let depth = [0.0, 0.5, 1.0, 0.3, 0.8, 0.0];
    for leg in LEG {
        clip.rotate(leg, &depth.map(|depth| [-24.0 * depth, 0.0, 0.0]));
        clip.rotate(leg + 1, &depth.map(|depth| [46.0 * depth, 0.0, 0.0]));
        clip.rotate(leg + 2, &depth.map(|depth| [-22.0 * depth, 0.0, 0.0]));
    }
    clip.shift_hips(&depth.map(|depth| [0.0, -0.045 * depth, 0.0]));
    clip.weigh(BLINK, Interpolation::Step, vec![0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    clip.finish("turn")
}
