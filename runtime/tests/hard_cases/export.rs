//! Posed Gaussians for renderers of others.

use bytemuck::Zeroable;
use dermis_format::source::Source;
use dermis_format::{Disc, FrameKind, Full, Records};
use dermis_runtime::error::Buffer;
use dermis_runtime::math::dot;
use dermis_runtime::{
    Avatar, Camera, Error, Kernel, Plan, Pose, Posed, PosedGaussian, Prepared, Sides,
};

use crate::numbers::rigged;
use crate::scenes::{BALL, DOT, bytes, camera, cloud, crowd, leveled_crowd, plain, random, sheet};

/// What is in memory that nothing was written to.
const UNTOUCHED: f32 = -77.0;

fn export(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    plan: &Plan,
    eye: [f32; 3],
    sides: Sides,
    lent: usize,
) -> Result<Vec<PosedGaussian>, Error> {
    let mut posing = vec![0; Posed::scratch_len(avatar)];
    let posed = Posed::new(avatar, pose, Kernel::detect(), &mut posing).unwrap();
    let untouched = PosedGaussian { opacity: UNTOUCHED, ..PosedGaussian::zeroed() };
    let mut gaussians = vec![untouched; lent];
    let written = posed.export(plan, eye, sides, &mut gaussians)?;
    assert!(gaussians[written..].iter().all(|gaussian| *gaussian == untouched));
    gaussians.truncate(written);
    Ok(gaussians)
}

fn all(source: &Source, eye: [f32; 3], sides: Sides) -> Vec<PosedGaussian> {
    some(source, u32::MAX, eye, sides)
}

fn some(source: &Source, budget: u32, eye: [f32; 3], sides: Sides) -> Vec<PosedGaussian> {
    let file = bytes(source);
    let avatar = Avatar::parse(&file).unwrap();
    let plan = Plan::with_budget(&avatar, budget);
    export(&avatar, &Pose::Rest, &plan, eye, sides, plan.gaussians() as usize).unwrap()
}

/// EWA in f64 from a record: centre and variances (xx, xy, yy) in pixels.
fn projected(camera: &Camera, gaussian: &PosedGaussian) -> ([f64; 2], [f64; 3]) {
    let m = camera.world_to_camera.map(|row| row.map(f64::from));
    let c = gaussian.center.map(f64::from);
    let [x, y, z] = m.map(|row| row[0] * c[0] + row[1] * c[1] + row[2] * c[2] + row[3]);
    let [fx, fy] = [camera.fx, camera.fy].map(f64::from);
    let limit =
        [0.65 * f64::from(camera.width) / fx.abs(), 0.65 * f64::from(camera.height) / fy.abs()];
    let slope = [(x / z).clamp(-limit[0], limit[0]), (y / z).clamp(-limit[1], limit[1])];
    // Rows of J W.
    let row = |i: usize, focal: f64, slope: f64| {
        [0, 1, 2].map(|column| focal / z * (m[i][column] - slope * m[2][column]))
    };
    let rows = [row(0, fx, slope[0]), row(1, fy, slope[1])];
    let [xx, xy, xz, yy, yz, zz] = gaussian.covariance().map(f64::from);
    let sigma = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let product = |a: [f64; 3], b: [f64; 3]| -> f64 {
        (0..3)
            .flat_map(|i| (0..3).map(move |j| (i, j)))
            .map(|(i, j)| a[i] * sigma[i][j] * b[j])
            .sum()
    };
    let variances = [
        product(rows[0], rows[0]) + 0.3,
        product(rows[0], rows[1]),
        product(rows[1], rows[1]) + 0.3,
    ];
    ([fx * x / z + f64::from(camera.cx), fy * y / z + f64::from(camera.cy)], variances)
}

/// What is exported and projected elsewhere is what this crate draws: the same Gaussians in the same
/// order, where they stand, how they extend, in their colours.
fn check_against_splats(source: &Source, budget: u32) {
    let file = bytes(source);
    let avatar = Avatar::parse(&file).unwrap();
    // All is in view, and nothing is too faint.
    let camera = camera(400, 400, 150.0, 2.5);
    let plan = Plan::with_budget(&avatar, budget);
    let mut posing = vec![0; Posed::scratch_len(&avatar)];
    let mut preparing = vec![0; Prepared::scratch_len(&avatar, plan.gaussians(), 400, 400)];
    let posed = Posed::new(&avatar, &Pose::Rest, Kernel::detect(), &mut posing).unwrap();
    let prepared = Prepared::new(&posed, &plan, &camera, &mut preparing).unwrap();
    let exported = some(source, budget, camera.position(), Sides::Seen);
    assert!(prepared.splats().len() > 100);
    assert_eq!(prepared.splats().len(), exported.len());
    for (splat, gaussian) in prepared.splats().iter().zip(&exported) {
        let (mean, [xx, xy, yy]) = projected(&camera, gaussian);
        assert!((mean[0] - f64::from(splat.mean[0])).abs() < 1e-3, "{splat:?} {gaussian:?}");
        assert!((mean[1] - f64::from(splat.mean[1])).abs() < 1e-3, "{splat:?} {gaussian:?}");
        // (a dx + b dy)² + (c dy)² is the inverse of the variances, times ½ log₂ e.
        let [a, b, c] = splat.falloff.map(f64::from);
        let (det, half) = (xx * yy - xy * xy, 0.5 * std::f64::consts::LOG2_E);
        let expected = [half * yy / det, -half * xy / det, half * xx / det];
        let scale = expected[0].abs().max(expected[2].abs());
        for (found, expected) in [a * a, a * b, b * b + c * c].into_iter().zip(expected) {
            assert!((found - expected).abs() < 2e-4 * scale, "{splat:?} {gaussian:?}");
        }
        assert_eq!([gaussian.red, gaussian.green, gaussian.blue], splat.color);
    }
}

#[test]
fn exports_are_what_is_drawn() {
    // Opacities at which each is visible, however small.
    let mut discs = crowd();
    discs.mathematics.low_pass = dermis_format::LowPass::Classic;
    check_against_splats(&discs, u32::MAX);
    // Between two levels.
    let mut discs = leveled_crowd();
    discs.mathematics.low_pass = dermis_format::LowPass::Classic;
    discs.mesh.two_sided = vec![true; 40];
    check_against_splats(&discs, 260);
    discs.mathematics.frame = FrameKind::Affine;
    check_against_splats(&discs, 260);
    let full = |i: u32| Full {
        position: [0, 1, 2].map(|axis| random(i, axis) - 0.5),
        rotation: [0.5 + random(i, 3), random(i, 4) - 0.5, random(i, 5) - 0.5, random(i, 6) - 0.5],
        log2_scale: [7, 8, 9].map(|axis| -2.0 - 4.0 * random(i, axis)),
        color: [10, 11, 12].map(|channel| random(i, channel)),
        opacity: 0.5,
    };
    let mut fulls = cloud(&(0..200).map(full).collect::<Vec<_>>());
    fulls.mathematics.harmonics_degree = 2;
    fulls.regions[0].harmonics =
        (0..200).map(|i| (0..24).map(|salt| random(i, 20 + salt) - 0.5).collect()).collect();
    check_against_splats(&fulls, u32::MAX);
}

/// Renderers that take a rotation and scales need them, though an affine frame shears a disc's axes.
#[test]
fn axes_are_orthogonal_on_frames_of_any_kind() {
    for frame in [FrameKind::Area, FrameKind::Affine] {
        let mut discs = crowd();
        discs.mathematics.frame = frame;
        let gaussians = all(&discs, [0.0, 0.0, 2.0], Sides::All);
        assert!(gaussians.len() > 300);
        for PosedGaussian { axis_0: a, axis_1: b, axis_2, .. } in gaussians {
            let cosine = dot(a, b) / (dot(a, a) * dot(b, b)).sqrt();
            assert!(cosine.abs() < 1e-3 && axis_2 == [0.0; 3], "{frame:?} {cosine}");
        }
    }
}

/// Numbers of one disc by hand: on a triangle whose frame is the world's.
#[test]
fn a_record_holds_what_its_table_says() {
    let disc = Disc {
        position: [0.25, -0.5, 0.0],
        // Stored as 0, with its scales exchanged.
        angle: std::f32::consts::FRAC_PI_2,
        log2_scale: [-1.0, -3.0],
        color: [1.0, 0.0, 0.0],
        opacity: 0.6,
    };
    let [gaussian] = all(&sheet(&[disc]), [0.0, 0.0, 1.0], Sides::All)[..] else { panic!("one") };
    let numbers: [f32; 16] = bytemuck::cast(gaussian);
    let expected = [
        [0.25, -0.5, 0.0, 0.6],
        [0.125, 0.0, 0.0, 1.0],
        [0.0, 0.5, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0],
    ];
    for (found, expected) in numbers.iter().zip(expected.as_flattened()) {
        assert!((found - expected).abs() < 3e-3, "{numbers:?}");
    }
    assert_eq!(size_of::<PosedGaussian>(), 64);
    assert_eq!(align_of::<PosedGaussian>(), 4);
    let variances = gaussian.covariance();
    for (found, expected) in variances.iter().zip([0.015_625, 0.0, 0.0, 0.25, 0.0, 0.0]) {
        assert!((found - expected).abs() < 3e-3, "{variances:?}");
    }
}

#[test]
fn colours_are_seen_from_the_eye() {
    let mut source = cloud(&[Full { color: [0.5; 3], ..BALL }]);
    source.mathematics.harmonics_degree = 1;
    // (r, g, b) for each of −y, z, −x: z makes red.
    source.regions[0].harmonics = vec![vec![0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0]];
    let red = |eye| all(&source, eye, Sides::Seen)[0].red;
    for (z, expected) in [(2.0, 0.5 - 0.5 * 0.488_602_5), (-2.0, 0.5 + 0.5 * 0.488_602_5)] {
        assert!((red([0.0, 0.0, z]) - expected).abs() < 2e-3);
    }
    // In its middle there is no direction: the constant colour.
    assert!((red([0.0; 3]) - 0.5).abs() < 2e-3);
    // From nowhere it has some colour, and that is one.
    assert!(red([f32::NAN; 3]) >= 0.0);
}

#[test]
fn backs_are_left_out_where_that_is_wanted() {
    for (two_sided, behind) in [(false, 0), (true, 1)] {
        let mut source = sheet(&[DOT]);
        source.mesh.two_sided = vec![two_sided];
        let count = |z: f32, sides| all(&source, [0.0, 0.0, z], sides).len();
        assert_eq!([count(1.0, Sides::Seen), count(-1.0, Sides::Seen)], [1, behind]);
        assert_eq!([count(1.0, Sides::All), count(-1.0, Sides::All)], [1, 1]);
    }
}

#[test]
fn exports_keep_the_budget_and_say_what_they_lack() {
    let file = bytes(&crowd());
    let avatar = Avatar::parse(&file).unwrap();
    let eye = [0.0, 0.0, 2.0];
    let mut last = Vec::new();
    for budget in [0, 1, 7, 399, 400, u32::MAX] {
        let plan = Plan::with_budget(&avatar, budget);
        let needed = plan.gaussians() as usize;
        let export = |lent| export(&avatar, &Pose::Rest, &plan, eye, Sides::All, lent);
        last = export(needed + 3).unwrap();
        assert_eq!(last.len(), needed);
        if let Some(lent) = needed.checked_sub(1) {
            let error = export(lent).unwrap_err();
            assert_eq!(error, Error::Buffer { buffer: Buffer::Gaussians, needed, lent });
            let expected = format!(
                "posed Gaussians: {lent} records were lent but {needed} are needed; lend 1 more"
            );
            assert_eq!(error.to_string(), expected);
        }
    }
    // In the order of the file: that of what is drawn.
    assert_eq!(last, all(&crowd(), eye, Sides::All));
    let small = bytes(&sheet(&[DOT]));
    let small = Avatar::parse(&small).unwrap();
    let plan = Plan::with_budget(&avatar, 9);
    let result = export(&small, &Pose::Rest, &plan, eye, Sides::All, 9);
    assert_eq!(result, Err(Error::Plan));
}

/// Nothing that is not finite is exported, and poses that are no poses export nothing.
#[test]
fn exports_are_finite() {
    let odd = [f32::NAN, f32::INFINITY, 1e38, 1e30, 1e-30, 1e-40, 0.0];
    let mut edge = sheet(&[DOT]);
    edge.mathematics = plain(FrameKind::Edge);
    let mut affine = sheet(&[DOT]);
    affine.mathematics = plain(FrameKind::Affine);
    for source in [sheet(&[DOT]), edge, affine, rigged()] {
        let file = bytes(&source);
        let avatar = Avatar::parse(&file).unwrap();
        let plan = Plan::with_budget(&avatar, u32::MAX);
        let lent = plan.gaussians() as usize;
        for number in odd {
            let mut vertices = source.mesh.positions.clone();
            vertices.iter_mut().flatten().for_each(|x| *x *= number);
            let pose = Pose::Vertices(&vertices);
            for eye in [[0.0; 3], [f32::NAN; 3], [1e38; 3]] {
                let exported = export(&avatar, &pose, &plan, eye, Sides::All, lent).unwrap();
                let numbers: &[f32] = bytemuck::cast_slice(&exported);
                assert!(numbers.iter().all(|number| number.is_finite()), "{number}");
                assert!(number.is_finite() && number != 0.0 || exported.is_empty(), "{number}");
            }
        }
    }
}

/// Ranges reach a little beyond what they hold: opacities of a file may be above 1, those of records are not.
#[test]
fn opacities_are_at_most_one() {
    let mut above = 0;
    for least in 1..40 {
        let faint = Disc { opacity: 0.01 * least as f32, ..DOT };
        let source = sheet(&[faint, DOT]);
        let file = bytes(&source);
        let block = Avatar::parse(&file).unwrap().blocks().next().unwrap();
        let Records::Disc(discs) = block.records else { panic!("discs") };
        above += discs.iter().filter(|disc| disc.opacity > 1.0).count();
        let exported = all(&source, [0.0, 0.0, 2.0], Sides::All);
        assert_eq!(exported.len(), 2);
        assert!(exported.iter().all(|gaussian| (0.0..=1.0).contains(&gaussian.opacity)));
    }
    // Else the test said nothing.
    assert!(above > 0, "{above} opacities above 1");
}
