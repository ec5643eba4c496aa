//! Which triangles masks, joints and materials choose.

use std::f32::consts::FRAC_PI_3;

use dermis_runtime::Camera;
use glam::{Vec2, Vec3, Vec4, vec3};
use image::{Rgba, RgbaImage};

use super::{Choice, Mask};
use crate::demo::demo_avatar;
use crate::model::{AlphaMode, Material, Model, Triangle, Vertex};
use crate::scene::{Pose, camera_towards, posed_vertices};

const SIZE: u32 = 200;
const WHITE: Rgba<u8> = Rgba([255; 4]);
const BLACK: Rgba<u8> = Rgba([0, 0, 0, 255]);

/// A sheet of 4 × 4 squares over [−1, 1]² in the plane z = 0, with a pane of material 1 over
/// [−0.3, 0.3]² before it, at z = 0.5. Fronts are towards +Z, the pane's if it `faces` it.
fn sheet_behind_pane(faces: bool, pane: AlphaMode) -> Model {
    let grid =
        (0..25).map(|i| vec3((i % 5) as f32, (i / 5) as f32, 0.0) * 0.5 - vec3(1.0, 1.0, 0.0));
    let over = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let over = over.map(|[x, y]| vec3(0.3 * x, 0.3 * y, 0.5));
    let squares = (0..16).map(|i| i / 4 * 5 + i % 4);
    let sheet = squares.flat_map(|a| [[a, a + 1, a + 6], [a, a + 6, a + 5]]);
    let pane_corners =
        if faces { [[25, 26, 27], [25, 27, 28]] } else { [[25, 27, 26], [25, 28, 27]] };
    let triangle = |material| move |corners| Triangle { corners, material };
    // Blended glass covers a little.
    let glass = Material {
        name: "pane".into(),
        alpha: pane,
        base_color: Vec4::new(1.0, 1.0, 1.0, 0.3),
        ..Material::default()
    };
    let vertex =
        |position| Vertex { position, uv: Vec2::ZERO, color: Vec4::ONE, influences: [(0, 0.0); 4] };
    Model {
        vertices: grid.chain(over).map(vertex).collect(),
        triangles: sheet.map(triangle(0)).chain(pane_corners.map(triangle(1))).collect(),
        materials: vec![Material { name: "sheet".into(), ..Material::default() }, glass],
        ..Model::default()
    }
}

/// Looks at the origin from 2 m away.
fn camera(from: Vec3) -> Camera {
    camera_towards(Vec3::ZERO, from, 2.0, FRAC_PI_3, SIZE, SIZE)
}

fn masked(from: Vec3, pixel: impl Fn(u32, u32) -> Rgba<u8>) -> Choice {
    let mask = RgbaImage::from_fn(SIZE, SIZE, pixel);
    let mask = Mask::new("mask.png".into(), mask, camera(from)).expect("of the camera's size");
    Choice { masks: vec![mask], ..Choice::default() }
}

fn named(joints: &[&str], materials: &[&str]) -> Choice {
    let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    Choice { joints: owned(joints), materials: owned(materials), ..Choice::default() }
}

fn selected(choice: &Choice, model: &Model) -> Vec<bool> {
    let selected = choice.select(model).expect("it can be chosen");
    assert_eq!(selected.len(), model.triangles.len());
    selected
}

fn count(choice: &Choice, model: &Model) -> usize {
    selected(choice, model).iter().filter(|selected| **selected).count()
}

/// What an error says, in one line.
fn complaint(choice: &Choice, model: &Model) -> String {
    format!("{:#}", choice.select(model).expect_err("nothing can be chosen"))
}

#[test]
fn a_hidden_vertex_leaves_its_triangles_out() {
    let model = sheet_behind_pane(true, AlphaMode::Opaque);
    // At z = 0 the pane covers [−0.4, 0.4]²: the middle vertex, which 6 triangles share.
    let choice = selected(&masked(Vec3::Z, |_, _| WHITE), &model);
    let hidden = choice.iter().zip(&model.triangles).filter(|(selected, _)| !**selected);
    let hidden: Vec<_> = hidden.map(|(_, triangle)| triangle.corners).collect();
    assert_eq!(hidden.len(), 6);
    assert!(hidden.iter().all(|corners| corners.contains(&12)), "{hidden:?}");
}

#[test]
fn what_is_not_drawn_hides_nothing() {
    let everywhere = masked(Vec3::Z, |_, _| WHITE);
    let turned_away = sheet_behind_pane(false, AlphaMode::Opaque);
    assert_eq!(count(&everywhere, &turned_away), 32, "the sheet, but not the pane's back");
    let glass = sheet_behind_pane(true, AlphaMode::Blend);
    assert_eq!(count(&everywhere, &glass), 34, "both");
    let behind = masked(Vec3::NEG_Z, |_, _| WHITE);
    assert_eq!(count(&behind, &turned_away), 2, "the pane; of the sheet only the back is in view");
}

#[test]
fn vertices_do_not_hide_their_copies() {
    // Every triangle has corners of its own, as along seams; one sheet touches another.
    let mut whole = sheet_behind_pane(true, AlphaMode::Opaque);
    whole.triangles.truncate(32);
    let corners = whole.triangles.iter().flat_map(|triangle| triangle.corners);
    let vertices: Vec<Vertex> = corners.map(|corner| whole.vertices[corner as usize]).collect();
    let triangle = |i: u32| Triangle { corners: [3 * i, 3 * i + 1, 3 * i + 2], material: 0 };
    let copies = Model {
        vertices: vertices.repeat(2),
        triangles: (0..64).map(triangle).collect(),
        ..whole.clone()
    };
    for from in [Vec3::Z, vec3(0.5, 0.3, 0.8).normalize(), vec3(0.9, 0.3, 0.1).normalize()] {
        let everywhere = masked(from, |_, _| WHITE);
        let in_sight = count(&everywhere, &whole);
        assert_eq!(count(&everywhere, &copies), 2 * in_sight, "from {from}");
    }
}

#[test]
fn inside_is_bright_and_opaque() {
    let model = sheet_behind_pane(false, AlphaMode::Opaque);
    let left_is = |inside: Rgba<u8>, outside: Rgba<u8>| {
        masked(Vec3::Z, move |x, _| if x < SIZE / 2 - 5 { inside } else { outside })
    };
    // Two of four columns of squares lie left of the middle, one of them with all corners.
    for (inside, outside) in [
        (WHITE, BLACK),
        (Rgba([128, 128, 128, 128]), Rgba([127, 127, 127, 255])),
        (Rgba([0, 255, 0, 255]), Rgba([255, 255, 255, 127])),
    ] {
        let choice = selected(&left_is(inside, outside), &model);
        for (selected, triangle) in choice.iter().zip(&model.triangles[..32]) {
            let left =
                triangle.corners.iter().all(|&i| model.vertices[i as usize].position.x < 0.0);
            assert_eq!(*selected, left, "{triangle:?}");
        }
    }
    let message = complaint(&left_is(BLACK, BLACK), &model);
    assert!(message.starts_with("mask.png: no triangle") && message.contains("; "), "{message}");
}

#[test]
fn masks_have_the_size_of_their_camera() {
    let mask = RgbaImage::new(SIZE / 2, SIZE);
    let error = Mask::new("mask.png".into(), mask, camera(Vec3::Z)).expect_err("too small");
    let message = format!("{error:#}");
    assert!(
        message.contains("mask.png: is 100×200 px") && message.contains("200×200"),
        "{message}"
    );
}

#[test]
fn masks_see_the_rest_pose() {
    // The upper part of the demo avatar from before, half a metre of which is its head.
    let model = demo_avatar();
    let rest = posed_vertices(&model, &Pose::rest(&model));
    let top = rest.iter().fold(f32::NEG_INFINITY, |top, vertex| top.max(vertex.y));
    let camera = camera_towards(Vec3::Y * (top - 0.3), Vec3::Z, 2.0, 0.4, SIZE, SIZE);
    let mask = RgbaImage::from_fn(SIZE, SIZE, |_, y| if y < SIZE * 7 / 10 { WHITE } else { BLACK });
    let mask = Mask::new("face.png".into(), mask, camera).expect("of the camera's size");
    let choice = Choice { masks: vec![mask], ..Choice::default() };
    let choice = selected(&choice, &model);
    let chosen = choice.iter().filter(|selected| **selected).count();
    assert!(chosen > 150 && chosen < choice.len() / 4, "{chosen} of {}", choice.len());
    for (triangle, _) in model.triangles.iter().zip(&choice).filter(|(_, selected)| **selected) {
        let [a, b, c] = triangle.corners.map(|corner| rest[corner as usize]);
        assert!(a.min(b).min(c).y > top - 0.55, "only the head: {a} {b} {c}");
        assert!((b - a).cross(c - a).z > -1e-6, "only what looks forward: {a} {b} {c}");
    }
}

#[test]
fn joints_take_those_below_them_along() {
    let model = demo_avatar();
    let head = selected(&named(&["head"], &[]), &model);
    let neck = selected(&named(&["neck"], &[]), &model);
    let chosen = |choice: &[bool]| choice.iter().filter(|selected| **selected).count();
    assert!(
        head.iter().zip(&neck).all(|(head, neck)| !head || *neck),
        "the head is below the neck"
    );
    assert!(chosen(&head) < chosen(&neck));
    assert_eq!(
        count(&named(&["root"], &[]), &model),
        model.triangles.len(),
        "all are below the root"
    );
    let arm = count(&named(&["upper_arm_left"], &[]), &model);
    let parts = ["upper_arm_left", "forearm_left", "hand_left"];
    assert_eq!(count(&named(&parts, &[]), &model), arm, "forearm and hand are below the upper arm");
    let hand = count(&named(&["hand_left"], &[]), &model);
    let mirrored = count(&named(&["hand_right"], &[]), &model);
    assert!(hand > 0 && hand < arm && hand == mirrored);
    assert_eq!(count(&named(&["head", "hand_left"], &[]), &model), chosen(&head) + hand);
}

#[test]
fn materials_choose_what_they_paint() {
    let model = sheet_behind_pane(true, AlphaMode::Opaque);
    let choice = selected(&named(&[], &["pane"]), &model);
    assert!(choice[..32].iter().all(|selected| !selected) && choice[32..] == [true, true]);
    let choice = Choice { materials: vec!["pane".into()], ..masked(Vec3::Z, |_, _| WHITE) };
    assert_eq!(count(&choice, &model), 28, "several choices add up");
    let below = |x: u32, y: u32| if x < SIZE / 2 && y > SIZE / 2 + 5 { WHITE } else { BLACK };
    let mask = masked(Vec3::Z, below);
    let alone = count(&mask, &model);
    let choice = Choice { materials: vec!["pane".into()], ..mask };
    assert_eq!(count(&choice, &model), alone + 2, "several choices add up");
}

#[test]
fn unknown_names_are_told_with_known_ones() {
    let model = demo_avatar();
    let close = complaint(&named(&["head", "Hand-Left"], &[]), &model);
    assert_eq!(close, "has no joint Hand-Left; choose one of: hand_left");
    let all = complaint(&named(&["tail"], &[]), &model);
    assert!(all.starts_with("has no joint tail; choose one of: root, hips, "), "{all}");
    assert!(all.ends_with("foot_right"), "{all}");
    let material = complaint(&named(&[], &["skin"]), &model);
    assert_eq!(material, "has no material skin; choose one of: paint");
    let stiff = complaint(&named(&["head"], &[]), &sheet_behind_pane(true, AlphaMode::Opaque));
    assert!(stiff.starts_with("has no joints; "), "{stiff}");
}
