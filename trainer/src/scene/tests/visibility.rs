//! Coverage, depth, sides and alpha.

use glam::{DVec3, Vec3, Vec4, vec3};

use super::super::mesh_render::{Truth, render};
use super::super::raster::Setup;
use super::super::rig::camera_towards;
use super::super::surface::Painter;
use super::{WHITE, ball, head_on, mesh, positions, scattered, square, texture};
use crate::model::{AlphaMode, Material, Model};

fn seen_head_on(model: &Model, size: u32, scale: f32) -> Truth {
    render(&Painter::new(model), &positions(model), &head_on(size, scale), [0.0; 3], 4)
}

/// Rows of pixels: `#` covered, `+` in part, `.` not at all.
fn drawn(truth: &Truth) -> Vec<String> {
    truth
        .coverage
        .chunks(truth.picture.width as usize)
        .map(|row| {
            row.iter()
                .map(|&share| match share {
                    0.0 => '.',
                    1.0 => '#',
                    _ => '+',
                })
                .collect()
        })
        .collect()
}

#[test]
fn ball_covers_its_analytic_area() {
    const SIZE: u32 = 256;
    let model = ball(0.8, 96);
    let camera = camera_towards(Vec3::ZERO, vec3(0.6, 0.0, 0.8), 2.0, 1.0, SIZE, SIZE);
    let truth = render(&Painter::new(&model), &positions(&model), &camera, WHITE, 4);
    // The cone that touches it has slope r / √(d² − r²).
    let radius = f64::from(camera.fx) * 0.8 / (4.0_f64 - 0.64).sqrt();
    let expected = std::f64::consts::PI * radius * radius;
    let area: f64 = truth.coverage.iter().copied().map(f64::from).sum();
    assert!((area / expected - 1.0).abs() < 1e-3, "{area} {expected}");
    let seen: u32 = truth.seen.iter().map(|sides| sides.front).sum();
    assert_eq!(f64::from(seen), 16.0 * area);
}

/// A sheet of `cells × cells` squares over [−1, 1]², its inner corners moved about.
fn crumpled(cells: u32, seed: u64) -> Model {
    let mut next = scattered(seed);
    let corners = cells + 1;
    let mut points = Vec::new();
    for i in 0..corners * corners {
        let at = |i: u32| 2.0 * i as f32 / cells as f32 - 1.0;
        let (x, y) = (i % corners, i / corners);
        let loose = |i: u32| if i.is_multiple_of(cells) { 0.0 } else { 0.8 / cells as f32 };
        points.push(vec3(
            at(x) + loose(x) * (next() - 0.5),
            at(y) + loose(y) * (next() - 0.5),
            0.0,
        ));
    }
    let mut triangles = Vec::new();
    for y in 0..cells {
        for x in 0..cells {
            let [a, b] = [y, y + 1].map(|y| y * corners + x);
            triangles.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
        }
    }
    mesh(&points, &triangles, Material::default())
}

#[test]
fn shared_edges_cover_each_sub_sample_once() {
    // Whole numbers of pixels, halves and crumbs, so that corners and edges meet sub-samples.
    for (cells, scale, seed) in [(4, 16.0, 0), (7, 15.5, 1), (9, 13.3, 2), (16, 16.0, 3)] {
        let mut model = crumpled(cells, seed);
        if seed == 0 {
            // On the grid: sub-samples lie exactly on diagonals.
            let points = crumpled(cells, 0);
            for (vertex, point) in model.vertices.iter_mut().zip(&points.vertices) {
                vertex.position = (point.position * 32.0).round() / 32.0;
            }
        }
        let together = seen_head_on(&model, 32, scale);
        let sum = |truth: &Truth| truth.coverage.iter().sum::<f32>();
        let mut alone = 0.0;
        for i in 0..model.triangles.len() {
            let single = Model { triangles: vec![model.triangles[i]], ..model.clone() };
            let truth = seen_head_on(&single, 32, scale);
            assert_eq!(truth.seen[0], together.seen[i], "{cells} {i}");
            alone += sum(&truth);
        }
        // None twice, and within the sheet's outline none missed.
        assert_eq!(alone, sum(&together), "{cells}");
        let inside = |i: usize| i % 32 > 3 && i % 32 < 28 && i / 32 > 3 && i / 32 < 28;
        let holes = together.coverage.iter().enumerate().filter(|(i, c)| inside(*i) && **c < 1.0);
        assert_eq!(holes.count(), 0, "{cells}");
    }
}

#[test]
fn edges_own_their_points_above_and_to_the_left() {
    // One sub-sample a pixel, the square's edges exactly through sub-samples: it owns those on
    // its upper and left edges only.
    let model = square(Material::default(), None);
    let posed: Vec<Vec3> = positions(&model).iter().map(|p| *p + vec3(0.5, -0.5, 0.0)).collect();
    let truth = render(&Painter::new(&model), &posed, &head_on(6, 1.0), WHITE, 1);
    assert_eq!(drawn(&truth), ["......", "......", "..##..", "..##..", "......", "......"]);
}

#[test]
fn nearer_surfaces_hide_farther_ones() {
    // Two crossing squares: each is in front on one side.
    let mut model = square(Material::default(), None);
    model.vertices.extend(model.vertices.clone());
    let more = model.triangles.iter().map(|triangle| crate::model::Triangle {
        corners: triangle.corners.map(|corner| corner + 4),
        material: 1,
    });
    model.triangles.extend(more.collect::<Vec<_>>());
    model
        .materials
        .push(Material { base_color: Vec4::new(0.0, 0.0, 0.0, 1.0), ..Material::default() });
    let posed: Vec<Vec3> = positions(&model)
        .iter()
        .enumerate()
        .map(|(i, p)| *p + Vec3::Z * if i < 4 { 0.5 * p.x } else { -0.5 * p.x })
        .collect();
    let truth = render(&Painter::new(&model), &posed, &head_on(16, 4.0), [0.5; 3], 4);
    let row = &truth.picture.rgb[8 * 16..9 * 16];
    assert!(row[5..8].iter().all(|rgb| rgb[0] == 0.0), "{row:?}");
    assert!(row[8..11].iter().all(|rgb| rgb[0] == 1.0), "{row:?}");
}

#[test]
fn backs_are_seen_where_the_material_says() {
    for double_sided in [false, true] {
        let model = square(Material { double_sided, ..Material::default() }, None);
        let behind = camera_towards(Vec3::ZERO, Vec3::NEG_Z, 2.0, 1.5, 16, 16);
        let truth = render(&Painter::new(&model), &positions(&model), &behind, WHITE, 4);
        let (front, back) = truth
            .seen
            .iter()
            .fold((0, 0), |(front, back), sides| (front + sides.front, back + sides.back));
        assert_eq!(front, 0);
        assert_eq!(back > 0, double_sided);
        assert_eq!(truth.coverage.iter().any(|&share| share > 0.0), double_sided);
    }
}

#[test]
fn floors_are_cut_at_the_near_plane() {
    // One triangle that reaches from far ahead to far behind the camera, 1 m below it, and far
    // to both sides. From 20 m ahead it covers what is below the horizon.
    let points = [vec3(-1e5, -1.0, -2e4), vec3(0.0, -1.0, 1e5), vec3(1e5, -1.0, -2e4)];
    let floor = mesh(&points, &[[0, 1, 2]], Material::default());
    let camera = camera_towards(Vec3::ZERO, Vec3::Z, 2.0, 1.5, 16, 16);
    let truth = render(&Painter::new(&floor), &positions(&floor), &camera, WHITE, 4);
    for (row, line) in drawn(&truth).iter().enumerate() {
        let expected = if row < 8 { "................" } else { "################" };
        assert_eq!(line, expected, "row {row}");
    }
    for (distance, covered) in [(0.009, 0.0), (0.011, 1.0), (-0.5, 0.0)] {
        let near = square(Material { double_sided: true, ..Material::default() }, None);
        let posed: Vec<Vec3> =
            positions(&near).iter().map(|p| *p + Vec3::Z * (2.0 - distance)).collect();
        let truth = render(&Painter::new(&near), &posed, &camera, WHITE, 4);
        assert!(truth.coverage.iter().all(|&share| share == covered), "{distance}");
    }
}

#[test]
fn cut_neighbours_stay_joined() {
    // A fan around a point in view, its rim far outside, in part behind the camera.
    let mut next = scattered(5);
    for _ in 0..20 {
        let mut setup = Setup::new(&head_on(32, 16.0), 4);
        let ring: Vec<DVec3> = (0..9)
            .map(|i| {
                let angle = -std::f64::consts::TAU * f64::from(i) / 9.0;
                let far = 10.0_f64.powf(f64::from(1.0 + 4.0 * next()));
                DVec3::new(angle.cos() * far, angle.sin() * far, 1.0 - 3.0 * f64::from(next()))
            })
            .collect();
        let hub = DVec3::new(f64::from(next()) - 0.5, f64::from(next()) - 0.5, 1.0);
        for i in 0..9 {
            setup.add(i, [hub, ring[i as usize], ring[(i as usize + 1) % 9]], true);
        }
        for row in 0..128 {
            let mut covered = [0; 128];
            for piece in setup.pieces.iter().filter(|piece| piece.rows.contains(&row)) {
                piece.span(row).for_each(|column| covered[column as usize] += 1);
            }
            assert!(covered.iter().all(|&times| times == 1), "{row} {covered:?}");
        }
    }
}

#[test]
fn broken_triangles_are_left_out() {
    let whole = square(Material::default(), None);
    let expected = seen_head_on(&whole, 16, 4.0).picture;
    for odd in [Vec3::NAN, Vec3::INFINITY, Vec3::splat(f32::MAX), Vec3::ZERO] {
        let mut model = whole.clone();
        model.vertices.push(super::vertex(odd, glam::Vec2::ZERO));
        let corners = if odd == Vec3::ZERO { [4, 4, 0] } else { [0, 1, 4] };
        model.triangles.push(crate::model::Triangle { corners, material: 0 });
        let truth = seen_head_on(&model, 16, 4.0);
        if odd != Vec3::splat(f32::MAX) {
            assert_eq!(truth.picture, expected, "{odd}");
        }
        assert!(truth.picture.rgb.iter().flatten().all(|value| value.is_finite()));
    }
}

#[test]
fn masks_cut_at_texels() {
    // Opaque on the left half.
    let image = texture(4, 4, true, |x, _| [255, 255, 255, if x < 2 { 255 } else { 100 }]);
    let material = Material { alpha: AlphaMode::Mask(0.5), ..Material::default() };
    let truth = seen_head_on(&square(material, Some(image)), 8, 2.0);
    let lines = drawn(&truth);
    assert_eq!(lines[2..6], ["..##....", "..##....", "..##....", "..##...."]);
    assert_eq!((&*lines[1], &*lines[6]), ("........", "........"));
}

#[test]
fn blends_cover_in_proportion() {
    for alpha in [0.0, 0.1, 0.37, 0.5, 0.9, 1.0] {
        let material = Material {
            alpha: AlphaMode::Blend,
            base_color: Vec4::new(1.0, 1.0, 1.0, alpha),
            ..Material::default()
        };
        let one = square(material, None);
        let truth = seen_head_on(&one, 64, 32.0);
        // Pixels off the diagonal belong to one triangle.
        for (i, &share) in truth.coverage.iter().enumerate().filter(|(i, _)| i % 64 != i / 64) {
            assert!((share - alpha).abs() < 1.0 / 16.0, "{i}: {share} {alpha}");
        }
        let mean = |truth: &Truth| truth.coverage.iter().sum::<f32>() / 4096.0;
        assert!((mean(&truth) - alpha).abs() < 0.003, "{alpha}");

        // A second layer behind shows through what the first leaves.
        let mut two = one.clone();
        two.vertices.extend(one.vertices.clone());
        for triangle in &one.triangles {
            let corners = triangle.corners.map(|corner| corner + 4);
            two.triangles.push(crate::model::Triangle { corners, material: 0 });
        }
        two.vertices[4..].iter_mut().for_each(|v| v.position = v.position * 1.1 - 0.1 * Vec3::Z);
        let expected = 1.0 - (1.0 - alpha) * (1.0 - alpha);
        let both = mean(&seen_head_on(&two, 64, 32.0));
        assert!((both - expected).abs() < 0.005, "{alpha}: {both} {expected}");
    }
}
