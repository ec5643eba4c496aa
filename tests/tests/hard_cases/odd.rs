//! Numbers that are none, in poses, cameras and weights, on the ribbon of the conformance set: what
//! hangs on them is gone, the rest is drawn as ever.

use dermis_conformance::File;
use dermis_runtime::math::{Affine, IDENTITY};
use dermis_runtime::{Avatar, Camera};

use crate::case::{Case, Stand, check};
use crate::scenes::camera;

const NAN: f32 = f32::NAN;
const INFINITE: f32 = f32::INFINITY;

/// The ribbon, upwards from the origin, from 2 m before its middle.
fn ribbon(name: &'static str) -> Case {
    let mut camera = camera([61, 83], 100.0, 2.0);
    camera.world_to_camera[1][3] = 0.6;
    Case::new(name, File::Ribbon.bytes().to_vec(), camera)
}

/// Its upper joint, 0.6 m above the lower one.
fn upper() -> Affine {
    let mut joint = IDENTITY;
    joint[1][3] = 0.6;
    joint
}

fn joints(name: &'static str, lower: Affine, upper: Affine, weight: f32) -> Case {
    ribbon(name).standing(Stand::Joints(vec![lower, upper], vec![weight]))
}

#[test]
fn joints_and_weights() {
    let with = |row: usize, column: usize, odd: f32| {
        let mut joint = upper();
        joint[row][column] = odd;
        joint
    };
    check([
        joints("upright", IDENTITY, upper(), 0.0).shows(480, 1415),
        joints("the upper joint is no number", IDENTITY, [[NAN; 4]; 3], 0.0).shows(127, 464),
        joints("one number of the upper joint is none", IDENTITY, with(1, 1, NAN), 0.0)
            .shows(127, 464),
        joints("the upper joint is infinitely high", IDENTITY, with(1, 3, INFINITE), 0.0)
            .shows(127, 464),
        joints("the upper joint is infinitely wide", IDENTITY, with(0, 0, -INFINITE), 0.0)
            .shows(127, 464),
        // The upper end hangs on the upper joint alone.
        joints("the lower joint is no number", [[NAN; 4]; 3], upper(), 0.0).shows(114, 457),
        joints("no joint is a number", [[NAN; 4]; 3], [[NAN; 4]; 3], 0.0),
        joints("a weight that is no number", IDENTITY, upper(), NAN).shows(335, 1133),
        joints("an infinite weight", IDENTITY, upper(), INFINITE).shows(335, 1133),
        joints("a weight of −infinity", IDENTITY, upper(), -INFINITE).shows(335, 1133),
        // Vertices are finite, but 5e37 m away: the squares of their discs' axes are not.
        joints("the greatest weight", IDENTITY, upper(), f32::MAX).shows(335, 1133),
        joints("a denormal weight", IDENTITY, upper(), 1e-45).shows(480, 1415),
    ]);
}

#[test]
fn clips_and_vertices() {
    let clip = |name, seconds| ribbon(name).standing(Stand::Clip(seconds));
    let avatar = Avatar::parse(File::Ribbon.bytes()).expect("a valid file");
    let vertices = |name, odd: &dyn Fn(usize) -> Option<f32>| {
        let vertex = |index| {
            let [x, y, z] = avatar.vertex_position(index);
            odd(index).map_or([x, y, z], |odd| [x, odd, z])
        };
        let count = avatar.header().vertices as usize;
        ribbon(name).standing(Stand::Vertices((0..count).map(vertex).collect()))
    };
    check([
        clip("the start of a clip", 0.0).shows(480, 1415),
        clip("a clip at a time that is no number", NAN).shows(480, 1415),
        clip("a clip before all times", -INFINITE).shows(480, 1415),
        clip("the end of a clip", 1.0).shows(480, 1575),
        clip("a clip after all times", INFINITE).shows(480, 1575),
        vertices("one vertex is no number", &|i| (i == 12).then_some(NAN)).shows(429, 1379),
        vertices("one vertex is infinitely low", &|i| (i == 12).then_some(-INFINITE))
            .shows(429, 1379),
        vertices("every other vertex is no number", &|i| (i % 2 == 0).then_some(NAN)),
        vertices("no vertex is a number", &|_| Some(NAN)),
    ]);
}

#[test]
fn cameras() {
    let with = |name, change: &dyn Fn(&mut Camera)| {
        let mut case = ribbon(name);
        change(&mut case.camera);
        case
    };
    check([
        with("a focal length that is no number", &|camera| camera.fx = NAN),
        with("an infinite focal length", &|camera| camera.fy = INFINITE),
        with("a middle that is no number", &|camera| camera.cx = NAN),
        with("a turn that is no number", &|camera| camera.world_to_camera[0][1] = NAN),
        with("a place that is no number", &|camera| camera.world_to_camera[2][3] = NAN),
        with("infinitely far away", &|camera| camera.world_to_camera[2][3] = INFINITE),
        with("infinitely far to the left", &|camera| camera.world_to_camera[0][3] = INFINITE),
        // All in the middle, each a dot of the low-pass, but this avatar's is compensated.
        with("a focal length of 0", &|camera| (camera.fx, camera.fy) = (0.0, 0.0)),
        with("a denormal focal length", &|camera| (camera.fx, camera.fy) = (1e-40, 1e-40)),
        with("the greatest focal length", &|camera| (camera.fx, camera.fy) = (f32::MAX, f32::MAX)),
    ]);
}
