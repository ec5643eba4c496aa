//! Colours.

use dermis_runtime::Camera;
use glam::{Quat, Vec3, Vec4, vec3};

use super::super::mesh_render::{View, render, render_views};
use super::super::rig::camera_towards;
use super::super::surface::{Painter, srgb_encode};
use super::{WHITE, head_on, positions, square, texture};
use crate::model::{Material, Model};

/// (x, y) of each pixel with its colour.
fn pixels(size: u32, rgb: &[[f32; 3]]) -> impl Iterator<Item = (u32, u32, Vec3)> {
    rgb.iter().zip(0..).map(move |(&color, i)| (i % size, i / size, Vec3::from_array(color)))
}

/// 4 × 4 texels, all different.
fn sixteen(x: u32, y: u32) -> [u8; 4] {
    [(80 * x) as u8, (70 * y + 3) as u8, 200, 255]
}

#[test]
fn head_on_square_is_its_texels() {
    // 24 pixels; the square is the middle 16, so 4 pixels a texel.
    let model = square(Material::default(), Some(texture(4, 4, true, sixteen)));
    let painter = Painter::new(&model);
    let background = [0.1, 0.2, 0.3];
    let truth = render(&painter, &positions(&model), &head_on(24, 8.0), background, 4);
    for (x, y, color) in pixels(24, &truth.picture.rgb) {
        let inside = (4..20).contains(&x) && (4..20).contains(&y);
        let expected = if inside {
            let [r, g, b, _] = sixteen((x - 4) / 4, (y - 4) / 4).map(|v| f32::from(v) / 255.0);
            vec3(r, g, b)
        } else {
            Vec3::from_array(background)
        };
        assert!(color.distance(expected) < 1e-5, "({x}, {y}): {color} {expected}");
        assert_eq!(truth.coverage[(y * 24 + x) as usize], f32::from(u8::from(inside)));
    }
    let seen: u32 = truth.seen.iter().map(|sides| sides.front).sum();
    assert_eq!(seen, 16 * 16 * 16);
    assert!(truth.seen.iter().all(|sides| sides.back == 0));
}

#[test]
fn edges_mix_with_the_background_by_area() {
    let texel = Vec3::splat(51.0 / 255.0);
    let model = square(Material::default(), Some(texture(1, 1, true, |_, _| [51, 51, 51, 255])));
    // Three quarters of a pixel to the right: the first column is a quarter covered.
    let posed: Vec<Vec3> = positions(&model).iter().map(|p| *p + Vec3::X * 0.75 / 8.0).collect();
    let truth = render(&Painter::new(&model), &posed, &head_on(24, 8.0), WHITE, 4);
    for (x, share) in [(3, 0.0), (4, 0.25), (5, 1.0), (19, 1.0), (20, 0.75), (21, 0.0)] {
        let pixel = 12 * 24 + x;
        let expected = share * texel + (1.0 - share) * Vec3::ONE;
        assert_eq!(truth.coverage[pixel], share, "{x}");
        assert!(Vec3::from_array(truth.picture.rgb[pixel]).distance(expected) < 1e-5, "{x}");
    }
}

#[test]
fn fine_texture_is_averaged_as_stored() {
    // 4 texels a pixel, black and white in turn.
    let checks = texture(64, 64, false, |x, y| {
        let value = 255 * ((x + y) % 2) as u8;
        [value, value, value, 255]
    });
    let model = square(Material::default(), Some(checks));
    let truth = render(&Painter::new(&model), &positions(&model), &head_on(16, 8.0), WHITE, 4);
    for (x, y, color) in pixels(16, &truth.picture.rgb) {
        assert!(color.distance(Vec3::splat(0.5)) < 1e-4, "({x}, {y}): {color}");
    }
}

#[test]
fn vertex_colours_are_interpolated_in_linear_light() {
    let mut model = square(Material::default(), None);
    for vertex in &mut model.vertices {
        let light = 0.5 + 0.5 * vertex.position.x;
        vertex.color = Vec4::new(light, 1.0, 1.0, 1.0);
    }
    let truth = render(&Painter::new(&model), &positions(&model), &head_on(32, 16.0), WHITE, 4);
    for (x, y, color) in pixels(32, &truth.picture.rgb) {
        // Colour is curved within a pixel only near black.
        let expected = srgb_encode((x as f32 + 0.5) / 32.0);
        let allowed = if x < 3 { 0.03 } else { 1e-3 };
        assert!((color.x - expected).abs() < allowed, "({x}, {y}) {color} {expected}");
    }
}

/// The square's texture coordinates where the ray through pixel position (x, y) meets it, for a
/// square turned by `turn`; by intersection with its plane alone.
fn cast(camera: &Camera, turn: Quat, x: f32, y: f32) -> Option<[f32; 2]> {
    let ray = [(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1.0];
    let [right, down, forward] = camera.world_to_camera;
    let axes = [right, down, forward].map(|[a, b, c, _]| vec3(a, b, c));
    let eye: Vec3 = -(axes[0] * right[3] + axes[1] * down[3] + axes[2] * forward[3]);
    let direction = axes[0] * ray[0] + axes[1] * ray[1] + axes[2] * ray[2];
    let (eye, direction) = (turn.inverse() * eye, turn.inverse() * direction);
    let hit = eye - direction * (eye.z / direction.z);
    let inside = hit.x.abs() <= 1.0 && hit.y.abs() <= 1.0;
    inside.then_some([0.5 + 0.5 * hit.x, 0.5 - 0.5 * hit.y])
}

#[test]
fn tilted_checks_match_a_ray_caster() {
    const SIZE: u32 = 96;
    let check = |u: f32, v: f32| ((8.0 * u) as u32 + (8.0 * v) as u32) % 2;
    let image = texture(512, 512, false, |x, y| {
        let value = 255 * check(x as f32 / 512.0, y as f32 / 512.0) as u8;
        [value, value, value, 255]
    });
    let model = square(Material::default(), Some(image));
    let painter = Painter::new(&model);
    let turn = Quat::from_rotation_x(-1.1) * Quat::from_rotation_y(0.3);
    let posed: Vec<Vec3> = positions(&model).iter().map(|&p| turn * p).collect();
    let camera = camera_towards(Vec3::ZERO, Vec3::Z, 2.0, 0.9, SIZE, SIZE);
    let background = 0.5;
    let truth = render(&painter, &posed, &camera, [background; 3], 4);

    let (mut sum, mut worst, mut worst_coverage) = (0.0, 0.0_f32, 0.0_f32);
    for (x, y, color) in pixels(SIZE, &truth.picture.rgb) {
        let (mut expected, mut covered) = (0.0, 0.0);
        for sub in 0..256 {
            let [dx, dy] = [sub % 16, sub / 16].map(|i| (i as f32 + 0.5) / 16.0);
            match cast(&camera, turn, x as f32 + dx, y as f32 + dy) {
                Some([u, v]) => {
                    covered += 1.0 / 256.0;
                    expected += check(u, v) as f32 / 256.0;
                }
                None => expected += background / 256.0,
            }
        }
        sum += (color.x - expected).abs();
        worst = worst.max((color.x - expected).abs());
        let coverage = truth.coverage[(y * SIZE + x) as usize];
        worst_coverage = worst_coverage.max((coverage - covered).abs());
    }
    let mean = sum / (SIZE * SIZE) as f32;
    assert!(mean < 0.002 && worst < 0.1 && worst_coverage < 0.1);
}

#[test]
fn views_come_in_order_and_the_same_each_time() {
    let model = square(Material::default(), Some(texture(4, 4, false, sixteen)));
    let (painter, posed) = (Painter::new(&model), positions(&model));
    let views: Vec<View> =
        (0..6).map(|i| View { posed: &posed, camera: head_on(16 + i, 4.0 + i as f32) }).collect();
    let truths = render_views(&painter, &views, WHITE, 4, |i, truth| (i, truth));
    for (i, (index, truth)) in truths.into_iter().enumerate() {
        assert_eq!(index, i);
        assert_eq!(truth, render(&painter, &posed, &views[i].camera, WHITE, 4));
    }
}

#[test]
fn small_and_empty_pictures_are_made() {
    let model = square(Material::default(), None);
    let painter = Painter::new(&model);
    let one = render(&painter, &positions(&model), &head_on(1, 8.0), [0.0; 3], 1);
    assert_eq!((one.picture.rgb[0], one.coverage[0]), ([1.0; 3], 1.0));
    let none = Camera { width: 0, height: 0, ..head_on(1, 8.0) };
    assert!(render(&painter, &positions(&model), &none, WHITE, 4).picture.rgb.is_empty());
    let nothing = Model::default();
    let truth = render(&Painter::new(&nothing), &[], &head_on(2, 1.0), [0.25; 3], 4);
    assert_eq!(truth.picture.rgb, [[0.25; 3]; 4]);
}
