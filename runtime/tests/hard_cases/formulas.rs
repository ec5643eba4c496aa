//! Formulas against others that were written independently of them, mostly in f64.

use dermis_format::{FrameKind, Full, LowPass};
use dermis_runtime::frame::Frame;
use dermis_runtime::gaussian::Ellipsoid;
use dermis_runtime::harmonics;
use dermis_runtime::math::{add, cross, dot, scale, sub};
use dermis_runtime::project::{Projected, View, project};
use dermis_runtime::select::Harmonics;
use dermis_runtime::{Avatar, Camera, Kernel, Plan, Pose, Posed, Prepared};

use crate::scenes::{BALL, bytes, camera, camera_behind, cloud, sheet, visible};

const TRIANGLE: [[f64; 3]; 3] = [[0.1, 0.2, 0.3], [1.0, 0.4, -0.2], [0.3, 1.5, 0.6]];

#[track_caller]
fn near(found: f64, expected: f64, bound: f64) {
    assert!((found - expected).abs() <= bound, "{found} {expected} {bound}");
}

#[test]
fn the_edge_frame_is_gaussian_avatars() {
    for corners in [TRIANGLE, [TRIANGLE[0], TRIANGLE[2], TRIANGLE[1]]] {
        let frame = Frame::of_triangle(FrameKind::Edge, corners).unwrap();
        let [v0, v1, v2] = corners;
        let (base, side) = (sub(v1, v0), sub(v2, v0));
        let length = dot(base, base).sqrt();
        // The height of v2 over the base, by Pythagoras.
        let along = dot(side, base) / length;
        let height = (dot(side, side) - along * along).sqrt();
        let size = (length + height) / 2.0;
        let normal = cross(base, side);
        let normal_length = dot(normal, normal).sqrt();
        for i in 0..3 {
            near(frame.x[i], size * base[i] / length, 1e-12);
            near(frame.y[i], size * normal[i] / normal_length, 1e-12);
            near(frame.origin[i], (v0[i] + v1[i] + v2[i]) / 3.0, 1e-12);
        }
        let z = cross(frame.x, frame.y);
        (0..3).for_each(|i| near(frame.z[i], z[i] / size, 1e-12));
        near((dot(frame.z, side) / size).abs(), height, 1e-12);
        let ahead = add(frame.origin, normal);
        let behind = sub(frame.origin, normal);
        assert!(frame.faces(FrameKind::Edge, ahead) && !frame.faces(FrameKind::Edge, behind));
    }
}

/// The front is where corners stand counter-clockwise, on frames of any kind.
#[test]
fn all_frames_are_culled_from_behind() {
    for frame in [FrameKind::Area, FrameKind::Edge, FrameKind::Affine] {
        let mut source = sheet(&[]);
        source.regions = cloud(&[BALL]).regions;
        source.regions[0].triangles = vec![0];
        source.mathematics.frame = frame;
        for (two_sided, behind) in [(false, 0), (true, 1)] {
            source.mesh.two_sided = vec![two_sided];
            let bytes = bytes(&source);
            let avatar = Avatar::parse(&bytes).unwrap();
            let seen = |camera: Camera| visible(&avatar, &Pose::Rest, &camera);
            assert_eq!(seen(camera(8, 8, 8.0, 2.0)), 1, "{frame:?}");
            assert_eq!(seen(camera_behind(8, 8, 8.0, 2.0)), behind, "{frame:?}");
        }
    }
}

/// `eval_sh` of 3D Gaussian Splatting (utils/sh_utils.py), term by term, signs in the constants as
/// there; coefficient 0 is the colour.
fn splatting_basis([x, y, z]: [f64; 3]) -> [f64; 15] {
    const C1: f64 = 0.4886025119029199;
    const C2: [f64; 5] = [
        1.0925484305920792,
        -1.0925484305920792,
        0.31539156525252005,
        -1.0925484305920792,
        0.5462742152960396,
    ];
    const C3: [f64; 7] = [
        -0.5900435899266435,
        2.890611442640554,
        -0.4570457994644658,
        0.3731763325901154,
        -0.4570457994644658,
        1.445305721320277,
        -0.5900435899266435,
    ];
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let (xy, yz, xz) = (x * y, y * z, x * z);
    [
        -C1 * y,
        C1 * z,
        -C1 * x,
        C2[0] * xy,
        C2[1] * yz,
        C2[2] * (2.0 * zz - xx - yy),
        C2[3] * xz,
        C2[4] * (xx - yy),
        C3[0] * y * (3.0 * xx - yy),
        C3[1] * xy * z,
        C3[2] * y * (4.0 * zz - xx - yy),
        C3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        C3[4] * x * (4.0 * zz - xx - yy),
        C3[5] * z * (xx - yy),
        C3[6] * x * (xx - 3.0 * yy),
    ]
}

#[test]
fn harmonics_are_those_of_gaussian_splatting() {
    let length = (0.4f64 * 0.4 + 0.5 * 0.5 + 0.7 * 0.7).sqrt();
    let direction = [0.4, -0.5, 0.7].map(|x| x / length);
    for (number, expected) in splatting_basis(direction).into_iter().enumerate() {
        assert!(expected.abs() > 0.01, "a direction at which basis {number} says nothing");
        for channel in 0..3 {
            let mut codes = [0i8; 45];
            codes[number * 3 + channel] = 2;
            let harmonics = Harmonics { codes: &codes, step: 0.5 };
            let color: [f64; 3] = harmonics::color([4.0; 3], harmonics.values(0.0), direction);
            for (i, found) in color.into_iter().enumerate() {
                let expected = if i == channel { expected } else { 0.0 };
                near(found - 4.0, expected, 1e-6);
            }
        }
    }
    // Not below 0.
    let harmonics = Harmonics { codes: &[0, 0, 0, 127, -127, 0], step: 1.0 };
    assert_eq!(harmonics::color([0.0; 3], harmonics.values(0.0), [0.0f64, 0.0, -1.0])[0], 0.0);
}

/// The direction goes from the camera to the Gaussian, in world axes, and coefficients reach it
/// through a file.
#[test]
fn a_gaussian_is_coloured_by_the_direction_in_which_it_is_seen() {
    let ball = Full { color: [0.5; 3], ..BALL };
    for degree in 1..=3u8 {
        let mut source = cloud(&[ball]);
        source.mathematics.harmonics_degree = degree;
        let coefficients = (usize::from(degree) + 1).pow(2) - 1;
        // Green of every coefficient, each another value; red of none.
        let value = |i: usize| (i + 1) as f32 / 127.0;
        let coefficient = |i: usize| [0.0, value(i), 0.0];
        let mut all: Vec<f32> = (0..coefficients).flat_map(coefficient).collect();
        // The step is then 1/127.
        all[2] = 1.0;
        source.regions[0].harmonics = vec![all];
        let bytes = bytes(&source);
        let avatar = Avatar::parse(&bytes).unwrap();
        // From (−3, 2, −6), 7 m away.
        let seen_along = [3.0 / 7.0, -2.0 / 7.0, 6.0 / 7.0];
        let camera = Camera {
            world_to_camera: [[1.0, 0.0, 0.0, 3.0], [0.0, -1.0, 0.0, 2.0], [0.0, 0.0, 1.0, 6.0]],
            ..camera(64, 64, 32.0, 0.0)
        };
        let mut posing = vec![0; Posed::scratch_len(&avatar)];
        let posed = Posed::new(&avatar, &Pose::Rest, Kernel::Scalar, &mut posing).unwrap();
        let mut preparing = vec![0; Prepared::scratch_len(&avatar, 1, 64, 64)];
        let plan = Plan::with_budget(&avatar, 1);
        let prepared = Prepared::new(&posed, &plan, &camera, &mut preparing).unwrap();
        let [splat] = prepared.splats() else { panic!("one splat") };
        let basis = splatting_basis(seen_along);
        let sum: f64 = (0..coefficients).map(|i| f64::from(value(i)) * basis[i]).sum();
        near(f64::from(splat.color[0]), 0.5, 1e-5);
        near(f64::from(splat.color[1]), (0.5 + sum).max(0.0), 1e-5);
        near(f64::from(splat.color[2]), 0.5 + basis[0], 1e-5);
    }
}

/// A camera turned about two axes, its view 2 · 64/100 wide and 2 · 48/80 high at 1 m.
fn turned() -> Camera {
    // 3-4-5 and 5-12-13: rotations without rounding worth naming.
    let (s, c, t, d) = (0.6, 0.8, 5.0 / 13.0, 12.0 / 13.0);
    Camera {
        fx: 100.0,
        fy: 80.0,
        world_to_camera: [[c, 0.0, s, 0.25], [s * t, d, -c * t, -0.5], [-s * d, t, c * d, 2.0]],
        ..camera(128, 96, 0.0, 0.0)
    }
}

/// The pinhole map itself: a world point to pixels.
fn pinhole(camera: &Camera, point: [f64; 3]) -> [f64; 2] {
    let [x, y, z] = camera.world_to_camera.map(|row| {
        let [a, b, c, t] = row.map(f64::from);
        a * point[0] + b * point[1] + c * point[2] + t
    });
    [
        f64::from(camera.fx) * x / z + f64::from(camera.cx),
        f64::from(camera.fy) * y / z + f64::from(camera.cy),
    ]
}

/// The world point at slopes x/z, y/z and depth z of a camera.
fn world_point(camera: &Camera, [sx, sy]: [f64; 2], z: f64) -> [f64; 3] {
    let rows = camera.world_to_camera.map(|row| row.map(f64::from));
    let local = [sx * z - rows[0][3], sy * z - rows[1][3], z - rows[2][3]];
    std::array::from_fn(|i| (0..3).map(|row| rows[row][i] * local[row]).sum())
}

fn of_axes<const N: usize>(
    camera: &Camera,
    center: [f64; 3],
    axes: [[f64; 3]; N],
) -> Projected<f64> {
    let (projected, drawable) =
        project(&View::new(camera), LowPass::Classic, &Ellipsoid { center, axes });
    assert!(drawable);
    projected
}

/// Each axis on the screen is the derivative of the pinhole map along it, by central differences.
#[test]
fn axes_are_projected_by_the_derivative_of_the_pinhole_map() {
    let camera = turned();
    let axes = [[0.02, 0.0, 0.0], [0.0, 0.03, 0.01], [0.01, -0.02, 0.05]];
    for slopes in [[0.0, 0.0], [0.5, -0.45], [-0.7, 0.3], [0.8, 0.75]] {
        let center = world_point(&camera, slopes, 1.7);
        let screen = axes.map(|axis| {
            let h = 1e-4;
            let ahead = pinhole(&camera, add(center, scale(axis, h)));
            let behind = pinhole(&camera, sub(center, scale(axis, h)));
            [0, 1].map(|i| (ahead[i] - behind[i]) / (2.0 * h))
        });
        let low_pass = f64::from(LowPass::Classic.variance());
        let check = |found: Projected<f64>, screen: &[[f64; 2]]| {
            let sum = |i: usize, j: usize| screen.iter().map(|b| b[i] * b[j]).sum::<f64>();
            near(found.covariance[0], sum(0, 0) + low_pass, 1e-5);
            near(found.covariance[1], sum(0, 1), 1e-5);
            near(found.covariance[2], sum(1, 1) + low_pass, 1e-5);
            let mean = pinhole(&camera, center);
            near(found.mean[0], mean[0], 1e-4);
            near(found.mean[1], mean[1], 1e-4);
        };
        for (axis, screen) in axes.iter().zip(&screen) {
            check(of_axes(&camera, center, [*axis]), &[*screen]);
        }
        check(of_axes(&camera, center, axes), &screen);
    }
}

/// A needle along the view's axis: its length on the screen is f/z · slope · σ, the slope held at
/// 1.3 tan(fov / 2), where its centre is not.
#[test]
fn the_slope_of_the_jacobian_is_clamped() {
    let camera = turned();
    let limits = [1.3 * 64.0 / 100.0, 1.3 * 48.0 / 80.0];
    let forward = camera.world_to_camera[2].map(f64::from);
    let needle = scale([forward[0], forward[1], forward[2]], 0.1);
    let focal = [100.0, 80.0];
    for share in [0.5, 0.99, 1.01, 2.0, 30.0] {
        for signs in [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 0.0], [0.0, -1.0]] {
            let slopes = [0, 1].map(|i| share * signs[i] * limits[i]);
            let center = world_point(&camera, slopes, 2.5);
            let found = of_axes(&camera, center, [needle]);
            let held = [0, 1].map(|i| f64::min(share, 1.0) * signs[i] * limits[i]);
            let screen = [0, 1].map(|i| -focal[i] / 2.5 * held[i] * 0.1);
            let low_pass = f64::from(LowPass::Classic.variance());
            near(found.covariance[0], screen[0] * screen[0] + low_pass, 1e-4);
            near(found.covariance[1], screen[0] * screen[1], 1e-4);
            near(found.covariance[2], screen[1] * screen[1] + low_pass, 1e-4);
            near(found.mean[0], focal[0] * slopes[0] + 64.0, 1e-2);
            near(found.mean[1], focal[1] * slopes[1] + 48.0, 1e-2);
        }
    }
}
