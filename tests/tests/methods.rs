//! The papers' methods: what each fixes, and what it may move.

use dermis_runtime::Avatar;
use dermis_tests::small::{options, trained_demo};
use dermis_trainer::demo::demo_avatar;
use dermis_trainer::methods::Method;
use dermis_trainer::model::{Material, Model, Triangle, Vertex};
use dermis_trainer::optimize::cloud::Parameters;
use dermis_trainer::options::Options;
use dermis_trainer::train::{Trained, train};
use glam::{Vec2, Vec3, Vec4};

fn trained_by(method: Method) -> Trained {
    trained_demo(&Options { method, ..options(640, 60) }).1
}

/// What stays of an earlier layer when the next one is trained on top of it.
fn changes(trained: &Trained) -> [usize; 2] {
    let (mut opacities, mut others) = (0, 0);
    for levels in trained.clouds[0].levels.windows(2) {
        for (before, after) in levels[0].iter().zip(&levels[1]) {
            opacities += usize::from(before.logit != after.logit);
            let same = Parameters { logit: before.logit, ..*after } == *before;
            others += usize::from(!same);
        }
    }
    [opacities, others]
}

#[test]
fn lapisgs_moves_nothing_but_opacities_of_earlier_layers() {
    let trained = trained_by(Method::Lapisgs);
    assert_eq!(
        trained.clouds[0].layers,
        [40, 120, 480],
        "each layer up to four times the one before"
    );
    let lens: Vec<usize> = trained.clouds[0].levels.iter().map(Vec::len).collect();
    assert_eq!(lens, [40, 160, 640], "a level holds its layer and those before");
    let [opacities, others] = changes(&trained);
    assert!(opacities > 100, "{opacities} of 200 opacities changed");
    assert_eq!(others, 0);
}

#[test]
fn freeze_moves_nothing_of_earlier_layers() {
    let trained = trained_by(Method::Freeze);
    assert_eq!(trained.clouds[0].layers, [40, 120, 480]);
    assert_eq!(changes(&trained), [0, 0]);
}

#[test]
fn a_set_trained_alone_is_one_layer_whatever_it_is_called() {
    let [single, multiscale] = [Method::Single, Method::Multiscale].map(trained_by);
    assert_eq!(single.clouds[0].layers, [640]);
    assert!(single.bytes == multiscale.bytes);
    let downsample = trained_by(Method::Downsample);
    assert_eq!(downsample.clouds[0].layers, [40, 120, 480]);
    let opacities = |cloud: &dermis_trainer::optimize::cloud::Cloud| {
        let mut opacities: Vec<u32> = cloud.full().iter().map(|p| p.logit.to_bits()).collect();
        opacities.sort_unstable();
        opacities
    };
    assert_eq!(
        opacities(&single.clouds[0]),
        opacities(&downsample.clouds[0]),
        "the same Gaussians"
    );
}

#[test]
fn downsample_keeps_what_is_significant() {
    let trained = trained_by(Method::Downsample);
    let model = demo_avatar();
    let corner = |triangle: u32, i: usize| {
        model.vertices[model.triangles[triangle as usize].corners[i] as usize].position
    };
    // In bind space, which the demo's rest pose is: opacity times area of the Gaussian in metres.
    let significance = |place: usize| {
        let (p, triangle) = (&trained.clouds[0].full()[place], trained.clouds[0].triangles[place]);
        let [a, b, c] = [0, 1, 2].map(|i| corner(triangle, i));
        let area = 0.5 * (b - a).cross(c - a).length();
        f64::from(p.opacity() * (p.log2_scale[0] + p.log2_scale[1]).exp2() * area)
    };
    let mean = |places: std::ops::Range<usize>| {
        let len = places.len() as f64;
        places.map(significance).sum::<f64>() / len
    };
    let means = [mean(0..40), mean(40..160), mean(160..640)];
    assert!(means[0] > means[1] && means[1] > means[2], "{means:?}");
}

/// A sheet of 8 × 8 squares whose left half has a checkerboard of colours and whose right half has one.
fn half_checkered() -> Model {
    let square = |i: u32| (i % 8, i / 8);
    let corners = [(0, 0), (1, 0), (1, 1), (0, 1)];
    let vertex = |i: u32| {
        let ((x, y), (dx, dy)) = (square(i / 4), corners[(i % 4) as usize]);
        let dark = x < 4 && (x + y).is_multiple_of(2);
        let color =
            if dark { Vec4::new(0.05, 0.05, 0.3, 1.0) } else { Vec4::new(0.9, 0.6, 0.1, 1.0) };
        Vertex {
            position: Vec3::new((x + dx) as f32, (y + dy) as f32, 0.0) * 0.125,
            uv: Vec2::ZERO,
            color,
            influences: [(0, 0.0); 4],
        }
    };
    let triangles = (0..64).flat_map(|i| [[0, 1, 2], [0, 2, 3]].map(|c| c.map(|k| 4 * i + k)));
    Model {
        vertices: (0..256).map(vertex).collect(),
        triangles: triangles.map(|corners| Triangle { corners, material: 0 }).collect(),
        materials: vec![Material { double_sided: true, ..Material::default() }],
        ..Model::default()
    }
}

#[test]
fn gaussians_go_where_a_survey_finds_the_error() {
    let model = half_checkered();
    let on_the_left = |survey_steps| {
        let options = Options { survey_steps, size: 64, ..options(400, 2) };
        let cloud = train(&model, &options).expect("it trains").clouds.swap_remove(0);
        let left = |triangle: &&u32| **triangle / 2 % 8 < 4;
        cloud.triangles.iter().filter(left).count() as f64 / cloud.len() as f64
    };
    let (even, surveyed) = (on_the_left(0), on_the_left(60));
    assert!((0.45..0.55).contains(&even), "{even}");
    assert!(surveyed > 0.65, "{surveyed}");
}

#[test]
fn a_price_on_blends_makes_pictures_cheaper() {
    let blends = |blend_price| {
        let trained = trained_demo(&Options { blend_price, ..options(1600, 100) }).1;
        trained.culling.culled
    };
    let (free, priced) = (blends(0.0), blends(0.008));
    println!("{free:?}, {priced:?}");
    assert!(priced.blends_per_pixel < 0.85 * free.blends_per_pixel);
    assert!(priced.psnr_foreground_db > free.psnr_foreground_db - 3.0);
}

#[test]
fn culling_is_measured_where_it_saves() {
    let (_, trained) = trained_demo(&options(1600, 100));
    let culling = trained.culling;
    println!("{culling:?}");
    assert_eq!(culling.pictures, 24);
    assert!(culling.all.blends_per_pixel > 1.3 * culling.culled.blends_per_pixel);
    assert!(culling.culled.psnr_foreground_db > 10.0);
    assert!(Avatar::parse(&trained.bytes).is_ok());
}
