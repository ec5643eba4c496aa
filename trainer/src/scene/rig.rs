//! The cameras of LoDAvatar, section 4.2: 42 on a sphere around the avatar, looking inward.

use dermis_runtime::Camera;
use glam::{Quat, Vec3};

use super::pose::{Pose, posed_vertices};
use crate::model::Model;

/// Vertical field of view of the rig, degrees.
const VERTICAL_FOV_DEGREES: f32 = 50.0;
/// Distance for avatars of a person's size, metres ...
const PERSON_DISTANCE: f32 = 2.0;
/// ... that is, with this largest extent at rest, metres ...
const PERSON_EXTENT: std::ops::RangeInclusive<f32> = 1.6..=2.0;
/// ... and for all others this many times their extent.
const DISTANCE_PER_EXTENT: f32 = 1.1;

/// Angle of [`novel_directions`] about (1, 1, 1), degrees. An optimization over all rotations
/// (hill climbing from 300 random starts) finds nothing better than 10.872° between the nearest
/// two directions of the sets, and reaches it on an axis through opposite faces.
pub(super) const NOVEL_TURN_DEGREES: f32 = 31.151;

/// An axis-aligned box around points, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least coordinates.
    pub min: Vec3,
    /// Greatest coordinates.
    pub max: Vec3,
}

impl Bounds {
    /// The box of all finite points; both corners are 0 where there is none.
    pub fn of(points: &[Vec3]) -> Self {
        points
            .iter()
            .filter(|point| point.is_finite())
            .map(|&point| Self { min: point, max: point })
            .reduce(|a, b| Self { min: a.min.min(b.min), max: a.max.max(b.max) })
            .unwrap_or(Self { min: Vec3::ZERO, max: Vec3::ZERO })
    }

    /// The box's centre.
    pub fn center(&self) -> Vec3 {
        0.5 * (self.min + self.max)
    }

    /// The longest of its edges.
    pub fn largest_extent(&self) -> f32 {
        (self.max - self.min).max_element()
    }
}

/// Where an avatar's cameras stand and how wide they look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigScale {
    /// From the centre of the posed box to each camera, metres.
    pub distance: f32,
    /// Radians.
    pub vertical_fov: f32,
}

impl RigScale {
    /// The rig of `model`, from its box at rest.
    pub fn of(model: &Model) -> Self {
        let rest = posed_vertices(model, &Pose::rest(model));
        Self::of_extent(Bounds::of(&rest).largest_extent())
    }

    /// The rig of an avatar whose box at rest has this longest edge, metres.
    pub fn of_extent(extent: f32) -> Self {
        let distance = if PERSON_EXTENT.contains(&extent) {
            PERSON_DISTANCE
        } else {
            DISTANCE_PER_EXTENT * extent
        };
        Self { distance, vertical_fov: VERTICAL_FOV_DEGREES.to_radians() }
    }

    /// The same, so many metres away.
    pub fn at(self, distance: f32) -> Self {
        Self { distance, ..self }
    }

    /// A camera in each of `directions` from the centre of the box of `posed`, for pictures of
    /// `width × height` pixels.
    pub fn cameras(
        &self,
        directions: &[Vec3],
        posed: &[Vec3],
        width: u32,
        height: u32,
    ) -> Vec<Camera> {
        let center = Bounds::of(posed).center();
        directions
            .iter()
            .map(|&direction| {
                camera_towards(center, direction, self.distance, self.vertical_fov, width, height)
            })
            .collect()
    }
}

/// Directions from the avatar to the cameras of training, unit: the corners of an icosahedron and
/// the middles of its edges, pushed out to the sphere.
pub fn training_directions() -> [Vec3; 42] {
    let golden = f32::midpoint(1.0, 5.0_f32.sqrt());
    let mut directions = [Vec3::ZERO; 42];
    let mut corners = [Vec3::ZERO; 12];
    for (i, corner) in corners.iter_mut().enumerate() {
        let sign = |bit: usize| if i >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let (one, golden) = (sign(0), sign(1) * golden);
        *corner = match i / 4 {
            0 => Vec3::new(0.0, one, golden),
            1 => Vec3::new(one, golden, 0.0),
            _ => Vec3::new(golden, 0.0, one),
        };
    }
    let middles = corners.iter().enumerate().flat_map(|(i, a)| {
        // Edges are 2 long; the next distance between corners is more than 3.
        corners[..i].iter().filter(|b| a.distance(**b) < 2.5).map(move |b| a + b)
    });
    for (direction, outward) in directions.iter_mut().zip(corners.into_iter().chain(middles)) {
        *direction = outward.normalize();
    }
    directions
}

/// Directions from the avatar to the cameras of novel views, unit: those of training turned so
/// that each is at least 10.87° from every direction of training, the most there can be.
pub fn novel_directions() -> [Vec3; 42] {
    let turn = Quat::from_axis_angle(Vec3::ONE.normalize(), NOVEL_TURN_DEGREES.to_radians());
    training_directions().map(|direction| turn * direction)
}

/// A camera at `center + distance · direction` (metres; `direction` is unit) that looks at
/// `center`, upright (+Y up) unless it looks along Y within 2.5°, where −Z is up. The vertical
/// field of view is in radians, pixels are square and the principal point is in the middle.
pub fn camera_towards(
    center: Vec3,
    direction: Vec3,
    distance: f32,
    vertical_fov: f32,
    width: u32,
    height: u32,
) -> Camera {
    let up = if direction.y.abs() > 0.999 { Vec3::NEG_Z } else { Vec3::Y };
    let forward = -direction;
    let right = forward.cross(up).normalize();
    let down = forward.cross(right);
    let eye = center + distance * direction;
    let row = |axis: Vec3| [axis.x, axis.y, axis.z, -axis.dot(eye)];
    let focal = 0.5 * height as f32 / (0.5 * vertical_fov).tan();
    Camera {
        width,
        height,
        fx: focal,
        fy: focal,
        cx: 0.5 * width as f32,
        cy: 0.5 * height as f32,
        world_to_camera: [row(right), row(down), row(forward)],
    }
}
