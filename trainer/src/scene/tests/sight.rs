//! Vertices in sight, against rays.

use glam::{DVec3, Vec3, vec3};

use super::super::rig::camera_towards;
use super::super::sight::vertices_in_sight;
use super::super::surface::Painter;
use super::{ball, mesh, positions, square};
use crate::model::{Material, Model};

const DISTANCE: f32 = 3.0;

/// Two balls, the smaller one before the larger, and a square between that cuts into both.
fn still_life() -> Model {
    let (large, small) = (ball(0.7, 12), ball(0.3, 9));
    let sheet = square(Material::default(), None);
    let mut model = mesh(&[], &[], Material::default());
    for (part, offset) in
        [(large, Vec3::ZERO), (small, vec3(0.2, 0.1, 0.8)), (sheet, vec3(0.4, -0.3, 0.6))]
    {
        let first = model.vertices.len() as u32;
        model.vertices.extend(part.vertices);
        model.vertices[first as usize..].iter_mut().for_each(|vertex| vertex.position += offset);
        model.triangles.extend(part.triangles.iter().map(|triangle| crate::model::Triangle {
            corners: triangle.corners.map(|corner| corner + first),
            ..*triangle
        }));
    }
    model
}

/// Where the segment from `eye` to `end` meets the front of a triangle: its share of the segment.
fn crossing(eye: DVec3, end: DVec3, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let normal = (b - a).cross(c - a);
    let along = (end - eye).dot(normal);
    let share = (a - eye).dot(normal) / along;
    let at = eye + share * (end - eye);
    let inside = |p: DVec3, q: DVec3| (q - p).cross(at - p).dot(normal) >= 0.0;
    (along < 0.0 && inside(a, b) && inside(b, c) && inside(c, a)).then_some(share)
}

#[test]
fn vertices_are_seen_where_a_ray_reaches_them() {
    let model = still_life();
    let posed = positions(&model);
    let painter = Painter::new(&model);
    let at = |corner: u32| posed[corner as usize].as_dvec3();
    for direction in [Vec3::Z, vec3(0.6, 0.2, 0.8), vec3(-0.9, 0.5, 0.4), Vec3::NEG_X] {
        let direction = direction.normalize();
        let eye = (DISTANCE * direction).as_dvec3();
        // Wide enough for everything to be in the picture.
        let camera = camera_towards(Vec3::ZERO, direction, DISTANCE, 1.8, 64, 64);
        let places = vertices_in_sight(&painter, &posed, &camera);
        let mut seen = 0;
        for (vertex, place) in (0..).zip(&places) {
            let own = |corners: &[u32; 3]| corners.contains(&vertex);
            let all = || model.triangles.iter().map(|triangle| triangle.corners);
            let faces = |corners: [u32; 3]| {
                let [a, b, c] = corners.map(at);
                (b - a).cross(c - a).dot(eye - a) > 1e-9
            };
            let hides = |corners: [u32; 3]| {
                // As nearly as the tolerance: a share of depth is a share of the segment.
                crossing(eye, at(vertex), corners.map(at)).is_some_and(|share| share < 1.0 - 1e-3)
            };
            let expected =
                all().filter(own).any(faces) && !all().filter(|corners| !own(corners)).any(hides);
            assert_eq!(place.is_some(), expected, "vertex {vertex} from {direction}");
            seen += usize::from(expected);
        }
        assert!(seen > 50 && seen < posed.len() / 2, "{seen} of {}", posed.len());
    }
}

#[test]
fn odd_cameras_see_little_and_do_no_harm() {
    let mut model = still_life();
    model.vertices[3].position = Vec3::NAN;
    let posed = positions(&model);
    let painter = Painter::new(&model);
    let outward = camera_towards(Vec3::Z * 9.0, Vec3::NEG_Z, 5.0, 1.0, 8, 8);
    assert!(vertices_in_sight(&painter, &posed, &outward).iter().all(Option::is_none));
    // Among the triangles, so that some are cut at the near plane; and pictures of no shape.
    for (width, height) in [(1, 1), (16384, 1), (1, 16384), (300, 200)] {
        let camera = camera_towards(vec3(0.2, 0.1, 0.8), Vec3::X, 0.1, 2.0, width, height);
        let places = vertices_in_sight(&painter, &posed, &camera);
        assert!(places.iter().flatten().all(|[x, y]| *x < width && *y < height));
        assert_eq!(places[3], None);
    }
    assert!(vertices_in_sight(&Painter::new(&Model::default()), &[], &outward).is_empty());
}
