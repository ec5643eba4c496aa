use glam::{Vec2, Vec3, Vec4, vec2};

use super::super::surface::{Painter, srgb_decode, srgb_encode};
use super::super::texture::{Footprint, MipChain};
use super::{square, texture};
use crate::model::{AlphaMode, Material, Texture, Wrap};

fn gray(value: u8) -> [u8; 4] {
    [value, value, value, 255]
}

/// Covers `texels` of `size` texels each way.
fn footprint(texels: f32, size: f32) -> Footprint {
    Footprint { along: vec2(texels / size, 0.0), across: vec2(0.0, texels / size) }
}

#[test]
fn texels_come_back_as_stored() {
    let texture = texture(3, 2, false, |x, y| [(40 * x) as u8, (100 * y) as u8, 7, 255]);
    let chain = MipChain::new(&texture, true);
    for (x, y, pixel) in texture.image.enumerate_pixels() {
        let uv = vec2((x as f32 + 0.5) / 3.0, (y as f32 + 0.5) / 2.0);
        let expected = Vec4::from_array(pixel.0.map(|value| f32::from(value) / 255.0));
        assert!(chain.sample(uv, &Footprint::POINT).distance(expected) < 1e-6);
    }
    // Between two texels, their mean.
    let between = chain.sample(vec2(1.0 / 3.0, 0.25), &Footprint::POINT);
    assert!((between.x - 20.0 / 255.0).abs() < 1e-6);
}

#[test]
fn wrap_modes_repeat_mirror_and_extend() {
    let base = Texture { nearest: true, ..texture(4, 1, true, |x, _| gray(60 * x as u8)) };
    // In texels: half of the first tile to the left, one and a half tiles to the right.
    for (wrap, expected) in [
        (Wrap::Repeat, [2, 3, 0, 1, 2, 3, 0, 1, 2, 3]),
        (Wrap::Mirror, [1, 0, 0, 1, 2, 3, 3, 2, 1, 0]),
        (Wrap::Clamp, [0, 0, 0, 1, 2, 3, 3, 3, 3, 3]),
    ] {
        for nearest in [true, false] {
            let texture = Texture { wrap: [wrap; 2], nearest, ..base.clone() };
            let chain = MipChain::new(&texture, false);
            for (i, expected) in expected.into_iter().enumerate() {
                let u = (i as f32 - 1.5) / 4.0;
                let value = chain.sample(vec2(u, 0.5), &Footprint::POINT).x;
                let expected = 60.0 * expected as f32 / 255.0;
                assert!((value - expected).abs() < 1e-5, "{wrap:?} {u} {value} {expected}");
            }
        }
    }
}

#[test]
fn bilinear_samples_blend_across_the_seam() {
    let texture =
        Texture { wrap: [Wrap::Repeat; 2], ..texture(4, 4, false, |x, _| gray(60 * x as u8)) };
    let chain = MipChain::new(&texture, false);
    for u in [-1.0, 0.0, 1.0, 5.0] {
        let value = chain.sample(vec2(u, 0.3), &Footprint::POINT).x;
        assert!((value - 90.0 / 255.0).abs() < 1e-5, "{u} {value}");
    }
}

#[test]
fn footprints_average_as_stored() {
    // The mean of black and white is half as stored, not half the light. Sides are odd.
    for (width, height) in [(7, 5), (8, 8), (1, 9), (31, 2)] {
        let texture = texture(width, height, false, |x, y| gray(255 * ((x + y) % 2) as u8));
        let chain = MipChain::new(&texture, false);
        let stored = texture.image.pixels().map(|pixel| f32::from(pixel.0[0])).sum::<f32>();
        let mean = stored / (255 * width * height) as f32;
        let whole = Footprint { along: Vec2::X, across: Vec2::Y };
        let long = width.max(height) as f32;
        let wide = Footprint { along: long * Vec2::X, across: long * Vec2::Y };
        let value = chain.sample(vec2(0.5, 0.5), &wide).x;
        assert!((value - mean).abs() < 1e-3, "{width} {height} {value} {mean}");
        assert!((chain.sample(vec2(0.5, 0.5), &whole).x - mean).abs() < 0.1);
    }
}

#[test]
fn long_footprints_stay_sharp_across() {
    // Stripes of 8 texels; the footprint covers 64 texels along a stripe and 2 across.
    let texture = texture(128, 128, false, |x, _| gray(255 * (x / 8 % 2) as u8));
    let chain = MipChain::new(&texture, false);
    let along = Footprint { along: vec2(0.0, 0.5), across: vec2(2.0 / 128.0, 0.0) };
    assert!(chain.sample(vec2(68.0 / 128.0, 0.5), &along).x < 0.01);
    assert!(chain.sample(vec2(76.0 / 128.0, 0.5), &along).x > 0.99);
    let across = Footprint { along: vec2(0.5, 0.0), across: vec2(0.0, 2.0 / 128.0) };
    assert!((chain.sample(vec2(0.5, 0.5), &across).x - 0.5).abs() < 0.05);
}

#[test]
fn unseen_texels_lend_no_colour() {
    let texture =
        texture(2, 2, false, |x, _| if x == 0 { [255, 0, 0, 255] } else { [0, 255, 0, 0] });
    let chain = MipChain::new(&texture, true);
    for size in [0.0, 2.0, 4.0] {
        let sample = chain.sample(vec2(0.5, 0.5), &footprint(size, 2.0));
        assert!(sample.distance(Vec4::new(1.0, 0.0, 0.0, 0.5)) < 1e-4, "{sample}");
    }
    // Where alpha has no say every texel counts.
    let opaque = MipChain::new(&texture, false);
    let sample = opaque.sample(vec2(0.5, 0.5), &footprint(2.0, 2.0));
    assert!(sample.distance(Vec4::new(0.5, 0.5, 0.0, 1.0)) < 1e-4, "{sample}");
}

#[test]
fn odd_places_give_a_colour() {
    for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
        let texture = Texture { wrap: [wrap; 2], ..texture(5, 3, false, |_, _| gray(51)) };
        let chain = MipChain::new(&texture, false);
        for u in [1e9, -1e9, 3e38, 16_777_217.0, -1e-9, 0.999_999_94] {
            for side in [0.0, 1e-20, 1.0, 1e30, f32::INFINITY, f32::NAN] {
                let footprint = Footprint { along: vec2(side, 0.0), across: vec2(0.0, 1e-3) };
                let value = chain.sample(vec2(u, -u), &footprint);
                assert!((value.x - 0.2).abs() < 1e-3, "{wrap:?} {u} {side} {value}");
            }
        }
        assert!(chain.sample(Vec2::NAN, &Footprint::POINT).is_finite());
    }
}

#[test]
fn factors_multiply_light_and_white_leaves_texels_alone() {
    let stored = texture(1, 1, false, |_, _| gray(188));
    let middle = Vec3::splat(1.0 / 3.0);
    let mut model = square(Material::default(), Some(stored));
    let (color, coverage) = Painter::new(&model).surface_color(0, middle, &Footprint::POINT);
    assert_eq!((color, coverage), ([188.0 / 255.0; 3], 1.0));

    model.materials[0].base_color = Vec4::new(0.5, 1.0, 0.25, 1.0);
    model.vertices.iter_mut().for_each(|vertex| vertex.color = Vec4::new(1.0, 0.5, 4.0, 1.0));
    let (color, _) = Painter::new(&model).surface_color(0, middle, &Footprint::POINT);
    // 188 is half the light of white to within half a step.
    let light = color.map(srgb_decode);
    for (light, expected) in light.into_iter().zip([0.25, 0.25, 0.5]) {
        assert!((light - expected).abs() < 4e-3, "{color:?}");
    }
    model.materials[0].texture = None;
    let (color, _) = Painter::new(&model).surface_color(0, middle, &Footprint::POINT);
    assert!((color[0] - srgb_encode(0.5)).abs() < 1e-6);
}

#[test]
fn shares_of_a_triangle_have_their_share_of_its_texture() {
    let model = square(Material::default(), None);
    let painter = Painter::new(&model);
    // Half of the square's texture is the triangle's.
    for share in [1.0, 0.25, 0.01] {
        let Footprint { along, across } = painter.footprint_of_share(1, share);
        assert!((along.perp_dot(across).abs() - 0.5 * share).abs() < 1e-6);
    }
}

#[test]
fn coverage_follows_the_alpha_mode() {
    let middle = Vec3::splat(1.0 / 3.0);
    let coverage = |alpha: AlphaMode, factor: f32| {
        let base_color = Vec4::new(1.0, 1.0, 1.0, factor);
        let material = Material { alpha, base_color, ..Material::default() };
        let image = texture(1, 1, false, |_, _| [9, 9, 9, 51]);
        let model = square(material, Some(image));
        Painter::new(&model).surface_color(0, middle, &Footprint::POINT).1
    };
    assert_eq!(coverage(AlphaMode::Opaque, 0.5), 1.0);
    assert!((coverage(AlphaMode::Blend, 0.5) - 0.1).abs() < 1e-6);
    assert_eq!(coverage(AlphaMode::Mask(0.09), 0.5), 1.0);
    assert_eq!(coverage(AlphaMode::Mask(0.11), 0.5), 0.0);
}

#[test]
fn transfer_function_and_inverse_agree() {
    for i in 0..=1000 {
        let value = i as f32 / 1000.0;
        assert!((srgb_encode(srgb_decode(value)) - value).abs() < 2e-6, "{value}");
    }
    assert!((srgb_decode(0.5) - 0.214_041).abs() < 1e-6);
}
