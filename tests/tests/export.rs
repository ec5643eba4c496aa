//! Avatars in files of other programs: what was exported is what the runtime draws, and comes back as it was.

use std::fs;
use std::path::Path;

use dermis_runtime::{Avatar, Kernel, Plan, Pose, Posed, PosedGaussian, Sides};
use dermis_tests::command::{Run, run};
use dermis_tests::converted::{ALL, exact, orbit_at_rest, psnr_at_rest};
use dermis_tests::files::{self, written};
use dermis_tests::small::{options, trained_demo};
use dermis_tests::splats::SplatPly;
use dermis_trainer::convert::{self, LeftOut, Splats};
use dermis_trainer::export::{self, Packed};
use serde_json::{Value, json};

fn read(path: &Path) -> Splats {
    let (splats, left_out) = convert::read(path, None).unwrap_or_else(|error| panic!("{error:#}"));
    assert_eq!(left_out, LeftOut::default());
    splats
}

/// Greatest difference of two lists of numbers.
fn off(a: impl IntoIterator<Item = f32>, b: impl IntoIterator<Item = f32>) -> f32 {
    a.into_iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// Greatest differences of position, rotation, log₂ scale, colour, opacity and harmonics.
fn differences(a: &Splats, b: &Splats) -> [f32; 6] {
    assert_eq!((a.degree, a.compensated), (b.degree, b.compensated));
    assert_eq!(a.gaussians.len(), b.gaussians.len());
    let mut greatest = [0.0f32; 6];
    for (a, b) in a.gaussians.iter().zip(&b.gaussians) {
        // q and −q are one rotation.
        let dot: f32 = a.rotation.iter().zip(b.rotation).map(|(a, b)| a * b).sum();
        let differences = [
            off(a.position, b.position),
            off(a.rotation, b.rotation.map(|x| x * dot.signum())),
            off(a.log2_scale, b.log2_scale),
            off(a.color, b.color),
            (a.opacity - b.opacity).abs(),
        ];
        greatest.iter_mut().zip(differences).for_each(|(g, d)| *g = g.max(d));
    }
    let numbers = |splats: &Splats| splats.harmonics.concat();
    greatest[5] = off(numbers(a), numbers(b));
    greatest
}

#[test]
fn a_ply_comes_back_as_it_was() {
    let folder = files::empty_folder("export_ply");
    for degree in 0..=3 {
        let ply = SplatPly::random(300, degree, 7).with(3, "opacity", f32::INFINITY);
        let mut splats = read(&written(&folder, "a.ply", ply.bytes()));
        splats.compensated = degree == 2;
        let bytes = export::ply(&splats);
        let parsed = SplatPly::parse(&bytes);
        assert_eq!(
            parsed.names, ply.names,
            "the properties of the reference program, in its order"
        );
        let other = read(&written(&folder, "b.ply", bytes));
        let differences = differences(&splats, &other);
        let bounds = [0.0, 1e-6, 1e-5, 1e-6, 2e-5, 0.0];
        assert!(differences.iter().zip(bounds).all(|(d, b)| *d <= b), "{degree}: {differences:?}");
    }
}

#[test]
fn an_spz_comes_back_within_its_steps() {
    let folder = files::empty_folder("export_spz");
    // Half a step of each, and what f32 rounds; the component that is left out has the errors of all others.
    let step = 1.0 / 16.0 * std::f32::consts::LOG2_E;
    let color = 0.282_095 / 0.15 / 255.0;
    let bounds = [0.5 / 65_536.0, 1.5 / 723.0, 0.5 * step, 0.5 * color, 0.5 / 255.0, 0.5 / 128.0];
    for degree in 0..=3 {
        for seed in 0..8 {
            let ply = SplatPly::random(200, degree, seed);
            let splats = read(&written(&folder, "a.ply", ply.bytes()));
            let Packed { bytes, clamped } = export::spz(&splats).expect("it fits");
            assert_eq!(clamped, 0);
            let differences = differences(&splats, &read(&written(&folder, "a.spz", bytes)));
            let close = |(d, b): (&f32, f32)| *d <= 1.01 * b + 1e-6;
            assert!(
                differences.iter().zip(bounds).all(close),
                "{degree}: {differences:?} {bounds:?}"
            );
        }
    }
}

#[test]
fn a_splat_comes_back_within_its_steps() {
    let folder = files::empty_folder("export_splat");
    // Numbers in f32; half a step of each code, of a quaternion's components before they get length 1 again.
    let bounds = [0.0, 1.0 / 128.0, 1e-5, 0.5 / 255.0, 0.5 / 255.0, 0.0];
    for seed in 0..8 {
        let ply = SplatPly::random(200, 1, seed).with(7, "f_dc_0", 4.0).with(8, "f_dc_2", -4.0);
        let mut splats = read(&written(&folder, "a.ply", ply.bytes()));
        let Packed { bytes, clamped } = export::splat(&splats);
        assert_eq!(bytes.len(), 32 * 200);
        // Colours of 0.5 ± 0.28, but two.
        assert_eq!(clamped, 2);
        for g in &mut splats.gaussians {
            g.color.iter_mut().for_each(|c| *c = c.clamp(0.0, 1.0));
        }
        // What a .splat does not have.
        splats.cut_degree(0);
        let differences = differences(&splats, &read(&written(&folder, "a.splat", bytes)));
        let close = |(d, b): (&f32, f32)| *d <= 1.01 * b + 1e-6;
        assert!(differences.iter().zip(bounds).all(close), "{differences:?} {bounds:?}");
    }
}

#[test]
fn what_spz_cannot_hold_is_counted() {
    let folder = files::empty_folder("export_beyond");
    let ply = SplatPly::random(20, 1, 7)
        .with(1, "f_dc_0", 4.0)
        .with(2, "f_rest_3", -1.5)
        .with(2, "f_rest_4", 1.5)
        .with(3, "scale_1", 6.5)
        // Points and flat Gaussians are no loss.
        .with(4, "scale_1", -14.0)
        .with(5, "x", 2000.0);
    let splats = read(&written(&folder, "a.ply", ply.bytes()));
    let Packed { bytes, clamped } = export::spz(&splats).expect("it fits");
    assert_eq!(clamped, 3);
    let other = read(&written(&folder, "a.spz", bytes));
    // 2000 m leave 12 bits after the binary point.
    let positions =
        |splats: &Splats| splats.gaussians.iter().flat_map(|g| g.position).collect::<Vec<_>>();
    assert!(off(positions(&splats), positions(&other)) <= 0.5 / 4096.0);
    assert!((other.gaussians[1].color[0] - 1.44).abs() < 0.01);
    assert_eq!(other.harmonics[2][0..6].iter().filter(|x| x.abs() > 0.99).count(), 2);
    let far = ply.with(5, "x", 9e6);
    let splats = read(&written(&folder, "far.ply", far.bytes()));
    let error = export::spz(&splats).expect_err("24 bits end before");
    assert!(format!("{error:#}").contains("9000000 m"), "{error:#}");
}

#[test]
fn pictures_of_what_stands_free_are_kept() {
    let folder = files::empty_folder("export_pictures");
    for degree in [0, 3] {
        let ply = SplatPly::random(900, degree, 11);
        let bytes =
            convert::pack(read(&written(&folder, "a.ply", ply.bytes()))).expect("it can be packed");
        let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
        for (budget, count) in [(ALL, 900), (300, 300)] {
            let plan = Plan::with_budget(&avatar, budget);
            let (splats, _) = export::posed(&avatar, &Pose::Rest, &plan).expect("it is drawn");
            assert_eq!((splats.gaussians.len(), usize::from(splats.degree)), (count, degree));
            let exported = SplatPly::parse(&export::ply(&splats));
            let camera = orbit_at_rest(&avatar, 40.0, 15.0, None, 160);
            let db = psnr_at_rest(&avatar, budget, &exact(&exported, &camera), &camera);
            assert!(db > 60.0, "degree {degree}, {budget}: {db:.2} dB");
            // Once more the same codes: what was quantized is not quantized again.
            let path = written(&folder, "b.ply", export::ply(&splats));
            let again = convert::pack(read(&path)).expect("it can be packed");
            let again = Avatar::parse(&again).expect("what was packed is valid");
            let db = psnr_at_rest(&again, ALL, &exact(&exported, &camera), &camera);
            assert!(db > 45.0, "degree {degree}, {budget}: {db:.2} dB");
        }
    }
}

#[test]
fn a_posed_mesh_leaves_with_the_covariances_of_the_runtime() {
    let (_, trained) = trained_demo(&options(1500, 20));
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    let pose = Pose::Clip { clip: 0, seconds: 0.4 };
    for budget in [ALL, 400] {
        let plan = Plan::with_budget(&avatar, budget);
        let (splats, left_out) = export::posed(&avatar, &pose, &plan).expect("it is drawn");
        let mut scratch = vec![0; Posed::scratch_len(&avatar)];
        let posed =
            Posed::new(&avatar, &pose, Kernel::Scalar, &mut scratch).expect("it can be posed");
        let mut expected = vec![PosedGaussian::default(); plan.gaussians() as usize];
        let count =
            posed.export(&plan, [0.0; 3], Sides::All, &mut expected).expect("there is room");
        assert_eq!(splats.gaussians.len() + left_out.faint, count);
        assert_eq!((left_out, splats.compensated), (LeftOut::default(), true));
        let exported = SplatPly::parse(&export::ply(&splats));
        for (row, gaussian) in exported.rows.iter().zip(&expected) {
            let numbers = |names: &str| -> Vec<f64> {
                names.split(' ').map(|name| exported.get(row, name)).collect()
            };
            let center = numbers("x y z");
            assert_eq!(center, gaussian.center.map(f64::from));
            let size =
                gaussian.axis_0.iter().chain(&gaussian.axis_1).fold(0.0f32, |m, x| m.max(x.abs()));
            let near = |a: f64, b: f32| (a - f64::from(b)).abs() < 2e-5 * f64::from(size * size);
            let covariance = covariance(
                &numbers("rot_0 rot_1 rot_2 rot_3"),
                &numbers("scale_0 scale_1 scale_2"),
            );
            let of_runtime = gaussian.covariance();
            let same = covariance.iter().zip(of_runtime).all(|(&a, b)| near(a, b));
            assert!(same, "{covariance:?} {of_runtime:?}");
            let color = numbers("f_dc_0 f_dc_1 f_dc_2");
            for (dc, channel) in color.iter().zip([gaussian.red, gaussian.green, gaussian.blue]) {
                assert!((0.5 + 0.282_094_79 * dc - f64::from(channel)).abs() < 1e-5);
            }
            let opacity = 1.0 / (1.0 + (-exported.get(row, "opacity")).exp());
            assert!((opacity - f64::from(gaussian.opacity)).abs() < 2e-5);
        }
    }
}

/// xx, xy, xz, yy, yz, zz of R S² Rᵀ.
fn covariance(q: &[f64], ln_scale: &[f64]) -> [f64; 6] {
    let [w, x, y, z] = [q[0], q[1], q[2], q[3]];
    let rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ];
    let of = |i: usize, j: usize| {
        (0..3).map(|k| rows[i][k] * rows[j][k] * (2.0 * ln_scale[k]).exp()).sum()
    };
    [of(0, 0), of(0, 1), of(0, 2), of(1, 1), of(1, 2), of(2, 2)]
}

#[test]
fn real_files_go_around_and_keep_their_pictures() {
    let who = "export::real_files_go_around_and_keep_their_pictures";
    let Some(folder) = files::data(who) else { return };
    let ours = files::empty_folder("export_real");
    for (name, distance) in [("playbot_lod4.ply", 2.5), ("plant.splat", 1.3)] {
        let path = folder.join("splats").join(name);
        let bytes = fs::read(&path).expect("it is there");
        let splat = name.ends_with("splat");
        let source = if splat { SplatPly::of_splat_file(&bytes) } else { SplatPly::parse(&bytes) };
        let pack = |path: &Path| {
            let (splats, _) = convert::read(path, None).unwrap_or_else(|error| panic!("{error:#}"));
            convert::pack(splats).expect("what can be read can be packed")
        };
        let first = pack(&path);
        let avatar = Avatar::parse(&first).expect("what was packed is valid");
        let plan = Plan::with_budget(&avatar, ALL);
        let (splats, _) = export::posed(&avatar, &Pose::Rest, &plan).expect("it is drawn");
        let spz = export::spz(&splats).expect("it fits").bytes;
        let ply = export::ply(&splats);
        // The robot's colours depend on the direction, which a .splat cannot say.
        let of_splat = if splats.degree > 0 { 20.0 } else { 40.0 };
        let splat = export::splat(&splats).bytes;
        for (name, bytes, least) in
            [("a.ply", ply, 49.0), ("a.spz", spz, 43.0), ("a.splat", splat, of_splat)]
        {
            let len = bytes.len();
            let again = pack(&written(&ours, name, bytes));
            let again = Avatar::parse(&again).expect("what was packed is valid");
            let mut sum = 0.0;
            for view in 0..6 {
                let camera = orbit_at_rest(&again, 60.0 * view as f32, 10.0, Some(distance), 400);
                sum += psnr_at_rest(&again, ALL, &exact(&source, &camera), &camera) / 6.0;
            }
            println!("{} through {name}, {len} bytes: {sum:.2} dB", path.display());
            assert!(sum > least, "{name}: {sum:.2} dB");
        }
    }
}

fn json_of(run: &Run) -> Value {
    assert_eq!(run.code, Some(0), "{run:?}");
    serde_json::from_str(&run.stdout).expect("stdout is JSON")
}

#[test]
fn the_command_exports_and_says_what_is_lost() {
    let folder = files::empty_folder("export_command");
    let ply = SplatPly::random(60, 1, 8).with(2, "f_dc_1", 9.0);
    fs::write(folder.join("a.ply"), ply.bytes()).expect("it can be written");
    assert_eq!(run(&folder, "convert a.ply -o a.dermis").code, Some(0));
    let plain = run(&folder, "export a.dermis -o b.ply --json");
    assert_eq!(plain.stderr, "");
    let report = json_of(&plain);
    assert_eq!(
        [&report["gaussians_selected"], &report["gaussians"], &report["sh_degree"]],
        [60, 60, 1]
    );
    assert_eq!(report["left_out"], json!({ "faint": 0, "wild": 0, "undrawn": 0 }));
    assert_eq!(report["bytes"], fs::metadata(folder.join("b.ply")).expect("it is there").len());
    let packed = run(&folder, "export a.dermis -o B.SPZ --json");
    assert_eq!(packed.stderr.lines().count(), 1, "{packed:?}");
    assert!(
        packed.stderr.contains("B.SPZ: 1 Gaussians") && packed.stderr.contains("PLY"),
        "{packed:?}"
    );
    assert_eq!(json_of(&packed)["clamped"], 1);
    for (more, count) in [("--budget 20", 20), ("--level 0", 60), ("--level -0.5", 30)] {
        let report = json_of(&run(&folder, &format!("export a.dermis -o b.spz --json {more}")));
        assert_eq!(report["gaussians"], count, "{more}");
        let back = json_of(&run(&folder, "convert b.spz -o b.dermis --json"));
        assert_eq!([&back["gaussians"], &back["sh_degree"]], [count, 1]);
    }
    let constant = run(&folder, "export a.dermis -o b.splat --json");
    assert!(constant.stderr.contains("b.splat: harmonics of degree 1 are not"), "{constant:?}");
    let report = json_of(&constant);
    assert_eq!([&report["bytes"], &report["sh_degree"], &report["clamped"]], [60 * 32, 0, 1]);
    let back = json_of(&run(&folder, "convert b.splat -o b.dermis --json"));
    assert_eq!([&back["gaussians"], &back["sh_degree"]], [60, 0]);
    // Half a turn, and half a turn back.
    for (output, more) in [("b.ply", "--half-turn"), ("d.ply", "")] {
        assert_eq!(run(&folder, &format!("export a.dermis -o {output} {more}")).code, Some(0));
    }
    assert_eq!(run(&folder, "convert b.ply -o b.dermis --half-turn").code, Some(0));
    assert_eq!(run(&folder, "convert d.ply -o d.dermis").code, Some(0));
    let file = |name: &str| fs::read(folder.join(name)).expect("it was written");
    assert!(file("b.ply") != file("d.ply") && file("b.dermis") == file("d.dermis"));
    for (arguments, code, part) in [
        ("a.dermis -o c.obj", 2, "--output"),
        ("a.dermis -o c", 2, "--output"),
        ("a.dermis -o c.ply --budget 5 --level 0", 2, "--level"),
        ("a.dermis -o c.ply --time 5", 2, "--clip"),
        ("a.dermis -o c.ply --clip walk", 1, "a.dermis: has no clip walk"),
        ("a.dermis -o c.ply --budget 0", 1, "a.dermis: "),
        ("a.ply -o c.ply", 1, "a.ply: "),
        ("absent.dermis -o c.ply", 1, "absent.dermis: "),
        ("a.dermis -o absent/c.ply", 1, "absent/c.ply: "),
    ] {
        let run = run(&folder, &format!("export {arguments}"));
        assert_eq!((run.code, run.stdout.as_str()), (Some(code), ""), "{arguments}: {run:?}");
        assert!(run.stderr.contains(part), "{arguments}: {run:?}");
        assert!(!files::names(&folder).iter().any(|name| name.starts_with('c')), "{arguments}");
    }
}
