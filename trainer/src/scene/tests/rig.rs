use glam::{Quat, Vec3, vec3};

use super::super::rig::{Bounds, RigScale, camera_towards, novel_directions, training_directions};

/// Angle between the nearest two, one of each set, degrees. In f64: `acos` of an f32 near 1 is
/// coarse.
fn separation(a: &[Vec3], b: &[Vec3]) -> f64 {
    let unit = |v: &Vec3| v.as_dvec3().normalize();
    a.iter()
        .flat_map(|a| b.iter().filter(move |b| a != *b).map(move |b| unit(a).dot(unit(b))))
        .fold(-1.0, f64::max)
        .acos()
        .to_degrees()
}

#[test]
fn training_directions_are_a_subdivided_icosahedron() {
    let directions = training_directions();
    assert!(directions.iter().all(|direction| (direction.length() - 1.0).abs() < 1e-6));
    // Nearest are a corner and the middle of its edge: half of atan 2.
    let expected = 0.5 * 2.0_f64.atan().to_degrees();
    assert!((separation(&directions, &directions) - expected).abs() < 1e-4);
    assert!(directions.iter().sum::<Vec3>().length() < 1e-5);
}

#[test]
fn novel_directions_are_as_far_from_training_as_can_be() {
    let training = training_directions();
    let novel = novel_directions();
    let best = separation(&novel, &training);
    assert!(best >= 10.87, "{best}");
    let mut next = super::scattered(7);
    for _ in 0..300 {
        let axis = vec3(next() - 0.5, next() - 0.5, next() - 0.5).normalize();
        let nudge = Quat::from_axis_angle(axis, 0.2 * next());
        let nudged = novel.map(|direction| nudge * direction);
        assert!(separation(&nudged, &training) < best + 0.002);
    }
}

#[test]
fn cameras_look_at_the_centre_upright() {
    let center = vec3(0.3, -2.0, 5.0);
    for direction in training_directions().into_iter().chain([Vec3::Y, Vec3::NEG_Y]) {
        let camera = camera_towards(center, direction, 2.0, 1.0, 640, 480);
        let view = |world: Vec3| {
            let [x, y, z] = camera.world_to_camera.map(|[a, b, c, d]| vec3(a, b, c).dot(world) + d);
            vec3(x, y, z)
        };
        assert!(view(center).distance(vec3(0.0, 0.0, 2.0)) < 1e-5);
        let [right, down, forward] = camera.world_to_camera.map(|[a, b, c, _]| vec3(a, b, c));
        assert!(right.cross(down).distance(forward) < 1e-5, "right-handed");
        if direction.y.abs() < 0.99 {
            assert!(right.y.abs() < 1e-6 && down.y < 0.0, "upright");
        }
        // The upper edge of the picture is half the field of view above the axis.
        assert!((camera.cy / camera.fy - 0.5_f32.tan()).abs() < 1e-6);
        assert_eq!((camera.fx, camera.cx), (camera.fy, 320.0));
    }
}

#[test]
fn distance_follows_size() {
    assert_eq!(RigScale::of_extent(1.75).distance, 2.0);
    assert_eq!(RigScale::of_extent(0.3).distance, 1.1 * 0.3);
    assert_eq!(RigScale::of_extent(150.0).distance, 1.1 * 150.0);
    let model = super::ball(0.9, 8);
    assert_eq!(RigScale::of(&model).distance, 2.0);
}

#[test]
fn cameras_follow_the_posed_box() {
    let posed = [vec3(1.0, 2.0, 3.0), vec3(3.0, 2.0, 7.0), Vec3::NAN];
    assert_eq!(Bounds::of(&posed).center(), vec3(2.0, 2.0, 5.0));
    assert_eq!(Bounds::of(&[]).largest_extent(), 0.0);
    let cameras = RigScale::of_extent(1.8).cameras(&[Vec3::X], &posed, 8, 8);
    let [_, _, forward] = cameras[0].world_to_camera;
    // The eye is at (4, 2, 5), and forward is −X.
    assert!((forward[0] + 1.0).abs() < 1e-6 && (forward[3] - 4.0).abs() < 1e-5);
}
