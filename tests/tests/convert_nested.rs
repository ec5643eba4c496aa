//! Coarser levels of converted Gaussians: better than leaving out, and the same for any number of threads.

use std::fs;
use std::path::{Path, PathBuf};

use dermis_format::{Full, LowPass, PerLevel};
use dermis_runtime::frame::Frame;
use dermis_runtime::math::dot;
use dermis_runtime::{Avatar, Camera, Kernel, Plan, Pose, Posed};
use dermis_tests::command::{self, misuses, run};
use dermis_tests::converted::{ALL, exact, orbit, psnr, psnr_at_rest};
use dermis_tests::files::{self, written};
use dermis_tests::mounted::{PlainMesh, gaussian_avatar_in_world};
use dermis_tests::splats::SplatPly;
use dermis_trainer::convert::{self, Assembly, Coarsening, Measured, Splats, Taken};
use dermis_trainer::import;
use dermis_trainer::optimize::backward::by_splats;
use dermis_trainer::optimize::forward::Stage;
use dermis_trainer::optimize::fulls::Fulls;
use dermis_trainer::optimize::schedule::Random;

/// Where Gaussians are looked at from: degrees, and metres from the middle of their box.
type Views = [(f32, f32, f32)];

fn nested(assembly: impl Into<Assembly>, options: &Coarsening) -> (Vec<u8>, Vec<Measured>) {
    convert::pack_nested(assembly.into(), options).unwrap_or_else(|error| panic!("{error:#}"))
}

fn free(path: &Path) -> Splats {
    convert::read(path, None).unwrap_or_else(|error| panic!("{error:#}")).0
}

/// The mean area that a Gaussian shows, but for a factor that all share.
fn area(full: &Full) -> f32 {
    let [a, b, c] = full.log2_scale.map(f32::exp2);
    dot([a * b, b * c, c * a], [a * b, b * c, c * a]).sqrt()
}

/// How much of all pixels each Gaussian makes up.
fn blending_weights(splats: &Splats, cameras: &[Camera]) -> Vec<f32> {
    let stage = Stage { frames: vec![Some(Frame::world())], two_sided: Box::new([true]) };
    let fulls = Fulls {
        gaussians: splats.gaussians.clone(),
        triangles: vec![0; splats.gaussians.len()],
        harmonics: splats.harmonics.clone(),
    };
    let mut weights = vec![0.0; fulls.len()];
    for camera in cameras {
        let forward = fulls.draw(&stage, camera, LowPass::Classic, [1.0; 3]);
        let by_pixels = vec![[1.0, 0.0, 0.0]; forward.picture.rgb.len()];
        let shares = by_splats(&forward, &by_pixels);
        for (&source, share) in forward.sources.iter().zip(shares) {
            weights[source as usize] += share.color[0];
        }
    }
    weights
}

/// The best mean PSNR of `count` Gaussians by any rank, widened or not, and what it is.
fn best_by_rank(
    splats: &Splats,
    count: usize,
    cameras: &[Camera],
    truths: &[Vec<u8>],
) -> (f64, String) {
    let g = &splats.gaussians;
    let mut random = Random::new(17);
    let ranks = [
        ("opacity", g.iter().map(|g| g.opacity).collect()),
        ("size", g.iter().map(area).collect()),
        ("opacity × area", g.iter().map(|g| g.opacity * area(g)).collect()),
        ("blending weight", blending_weights(splats, cameras)),
        ("random order", g.iter().map(|_| random.unit()).collect::<Vec<f32>>()),
    ];
    let mut best = (0.0, String::new());
    for (name, rank) in ranks {
        let mut order: Vec<usize> = (0..g.len()).collect();
        order.sort_by(|&a, &b| rank[b].total_cmp(&rank[a]));
        order.truncate(count);
        let mut of_rank = (0.0, 0.0);
        for wider in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let mut kept = Splats {
                gaussians: order.iter().map(|&i| g[i]).collect(),
                harmonics: order.iter().filter_map(|&i| splats.harmonics.get(i).cloned()).collect(),
                ..splats.clone()
            };
            for g in &mut kept.gaussians {
                g.log2_scale.iter_mut().for_each(|s| *s += wider);
            }
            let bytes = convert::pack(kept).expect("it can be packed");
            let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
            let views = cameras.iter().zip(truths);
            let sum: f64 = views.map(|(camera, to)| psnr_at_rest(&avatar, ALL, to, camera)).sum();
            let db = sum / cameras.len() as f64;
            if db > of_rank.0 {
                of_rank = (db, wider);
            }
        }
        println!("{count} by {name}: {:.2} dB, σ × {:.2}", of_rank.0, of_rank.1.exp2());
        if of_rank.0 > best.0 {
            best = (of_rank.0, name.to_owned());
        }
    }
    best
}

/// Levels of a real file against what ranks leave, at each of `shares` of its Gaussians; writes pictures, too.
fn compared(
    name: &str,
    path: &Path,
    ply: &SplatPly,
    options: &Coarsening,
    (views, size): (&Views, u32),
    shares: &[f64],
) -> Vec<[f64; 2]> {
    let splats = free(path);
    let plain = convert::pack(splats.clone()).expect("it can be packed");
    let plain = Avatar::parse(&plain).expect("what was packed is valid");
    let camera = |&(yaw, pitch, distance): &(f32, f32, f32)| {
        orbit(&plain, &Pose::Rest, yaw, pitch, Some(distance), size)
    };
    let cameras: Vec<Camera> = views.iter().map(camera).collect();
    let truths: Vec<Vec<u8>> = cameras.iter().map(|camera| exact(ply, camera)).collect();
    let start = std::time::Instant::now();
    let (bytes, measured) = nested(splats.clone(), options);
    println!(
        "{name}: {} bytes in {:.1} s, {measured:.2?}",
        bytes.len(),
        start.elapsed().as_secs_f64()
    );
    let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
    let mean = |avatar: &Avatar<'_>, count: u32| {
        let views = cameras.iter().zip(&truths);
        let sum: f64 = views.map(|(camera, to)| psnr_at_rest(avatar, count, to, camera)).sum();
        sum / cameras.len() as f64
    };
    println!("{name}: all {:.2} dB", mean(&avatar, ALL));
    let of_share = |&share: &f64| {
        let count = (splats.gaussians.len() as f64 * share) as u32;
        let db = mean(&avatar, count);
        let today = mean(&plain, count);
        let (best, rank) = best_by_rank(&splats, count as usize, &cameras, &truths);
        println!(
            "{name}: first {count} {db:.2} dB; by {rank} {best:.2}, evenly widened {today:.2}: {:+.2}",
            db - best.max(today)
        );
        [db, best.max(today)]
    };
    let rows = shares.iter().map(of_share).collect();
    assert!(mean(&avatar, ALL) > 45.0, "the whole is as it came");
    rows
}

#[test]
fn a_quarter_is_6_db_better_than_the_best_by_any_rank() {
    let Some(folder) = files::data("a_quarter_is_6_db_better_than_the_best_by_any_rank") else {
        return;
    };
    // The end of the plant's leaves.
    let plant = fs::read(folder.join("splats/plant.splat")).expect("it is there");
    let mut ply = SplatPly::of_splat_file(&plant);
    ply.rows.retain(|row| (-0.6..-0.2).contains(&row[1]) && row[0].hypot(row[2]) < 0.3);
    let path = written(&files::empty_folder("convert_nested_leaves"), "a.ply", ply.bytes());
    let options = Coarsening { steps: 300, size: 200, ..Coarsening::default() };
    let views: Vec<_> = [15.0, 135.0, 255.0].map(|yaw| (yaw, 10.0, 0.7)).to_vec();
    let rows = compared("leaves", &path, &ply, &options, (&views, 200), &[0.25, 0.5]);
    assert!(rows[0][0] > rows[0][1] + 6.0, "{rows:.2?}");
}

/// README's figures.
#[test]
#[ignore = "takes minutes"]
fn real_files_have_levels() {
    let Some(folder) = files::data("real_files_have_levels") else { return };
    let plant = fs::read(folder.join("splats/plant.splat")).expect("it is there");
    let plant = SplatPly::of_splat_file(&plant);
    let path = written(&files::empty_folder("convert_nested_plant"), "plant.ply", plant.bytes());
    let playbot = folder.join("splats/playbot_lod3.ply");
    let robot = SplatPly::parse(&fs::read(&playbot).expect("it is there"));
    // The robot stands on a ground of noise, which few Gaussians cannot show.
    for (name, path, ply, distance, least) in
        [("plant", &path, &plant, 1.3, 6.0), ("playbot, level 3", &playbot, &robot, 2.5, 0.0)]
    {
        let views: Vec<_> =
            (0..6).map(|i| (60.0 * i as f32, [-25.0, 10.0][i % 2], distance)).collect();
        let options = Coarsening::default();
        let shares = [0.5, 0.25, 1.0 / 16.0];
        let rows = compared(name, path, ply, &options, (&views, 400), &shares);
        assert!(rows[1][0] > rows[1][1] + least, "{name}: {rows:.2?}");
    }
}

fn with_threads<T: Send>(threads: usize, act: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
    pool.install(act)
}

/// Few steps of small pictures.
const QUICK: Coarsening = Coarsening { steps: 30, size: 64, seed: 3, memory_bytes: 1 << 16 };

#[test]
fn bytes_do_not_depend_on_threads() {
    let folder = files::empty_folder("convert_nested_threads");
    let splats = free(&written(&folder, "a.ply", SplatPly::random(9000, 1, 5).bytes()));
    let [one, three] =
        [1, 3].map(|threads| with_threads(threads, || nested(splats.clone(), &QUICK).0));
    assert!(one == three);
    let other = nested(splats, &Coarsening { seed: 4, memory_bytes: 1 << 30, ..QUICK }).0;
    assert!(one != other, "the seed decides");
}

#[test]
fn levels_and_those_that_came_are_in_one_file() {
    let folder = files::empty_folder("convert_nested_levels");
    let ply = SplatPly::random(2000, 2, 5);
    let splats = free(&written(&folder, "a.ply", ply.bytes()));
    let (bytes, measured) = nested(splats.clone(), &QUICK);
    let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
    let header = avatar.header();
    assert_eq!((header.per_level, header.harmonics_degree), (PerLevel::Opacity, 2));
    assert_eq!(header.gaussians, 2500);
    let camera = orbit(&avatar, &Pose::Rest, 40.0, 10.0, None, 160);
    let db = psnr_at_rest(&avatar, ALL, &exact(&ply, &camera), &camera);
    assert!(db > 45.0, "{db:.2} dB");
    let last = measured.last().expect("there are levels");
    assert!(last.gaussians == 2500 && last.psnr_foreground_db > 45.0, "{measured:?}");
    assert!(measured[0].gaussians == 500 && measured[0].psnr_foreground_db > 10.0, "{measured:?}");
}

/// Gaussians as GaussianAvatars has them, each coloured by place: neighbours are alike, as on any person.
fn painted(mesh: &PlainMesh, count: u32) -> SplatPly {
    let mut ply = dermis_tests::mounted::gaussian_avatar(mesh, count, 0, 4);
    let world = gaussian_avatar_in_world(&ply, mesh);
    let column =
        |name: &str| ply.names.iter().position(|n| n == name).expect("it has this property");
    let colors = ["f_dc_0", "f_dc_1", "f_dc_2"].map(column);
    let opacity = column("opacity");
    for (row, placed) in ply.rows.iter_mut().zip(&world.rows) {
        let place = ["x", "y", "z"].map(|name| world.get(placed, name));
        for (axis, &column) in colors.iter().enumerate() {
            row[column] = (1.5 * (9.0 * place[axis]).sin()) as f32;
        }
        row[opacity] = 2.0 + 0.3 * row[opacity];
    }
    ply
}

fn vertices(avatar: &Avatar<'_>, pose: &Pose<'_>) -> Vec<[f32; 3]> {
    let mut scratch = vec![0; Posed::scratch_len(avatar)];
    let posed = Posed::new(avatar, pose, Kernel::detect(), &mut scratch).expect("it can be posed");
    posed.vertices().to_vec()
}

#[test]
fn what_hangs_on_a_mesh_has_levels_in_every_pose() {
    let Some(data) = files::data("what_hangs_on_a_mesh_has_levels_in_every_pose") else { return };
    let folder = files::empty_folder("convert_nested_mesh");
    let path = data.join("CesiumMan.glb");
    let mesh = PlainMesh::at_rest(&import::load(&path).expect("it can be read"));
    let ply = painted(&mesh, 8000);
    let input: [PathBuf; 1] = [written(&folder, "a.ply", ply.bytes())];
    let taken = Taken { mesh: Some(&path), ..Taken::default() };
    let (assembly, _) = convert::assemble(&input, &taken).expect("it can be read");
    let plain = convert::pack(assembly.clone()).expect("it can be packed");
    let plain = Avatar::parse(&plain).expect("what was packed is valid");
    let options = Coarsening { steps: 400, size: 200, ..Coarsening::default() };
    let (bytes, measured) = nested(assembly, &options);
    println!("{measured:.2?}");
    let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
    for pose in [Pose::Rest, Pose::Clip { clip: 0, seconds: 0.4 }] {
        let world = gaussian_avatar_in_world(&ply, &mesh.posed(&vertices(&avatar, &pose)));
        let mut sums = [0.0; 3];
        for yaw in [25.0, 145.0, 265.0] {
            let camera = orbit(&avatar, &pose, yaw, 12.0, None, 200);
            let truth = exact(&world, &camera);
            let of = |avatar: &Avatar<'_>, count| {
                psnr(avatar, &pose, &Plan::with_budget(avatar, count), &truth, &camera)
            };
            sums[0] += of(&avatar, ALL) / 3.0;
            sums[1] += of(&avatar, 2000) / 3.0;
            sums[2] += of(&plain, 2000) / 3.0;
        }
        println!(
            "{pose:?}: all {:.2} dB, a quarter {:.2}, evenly widened {:.2}",
            sums[0], sums[1], sums[2]
        );
        assert!(sums[0] > 45.0 && sums[1] > sums[2] + 6.0, "{sums:.2?}");
    }
}

#[test]
fn what_cannot_have_levels_says_so() {
    let folder = files::empty_folder("convert_nested_errors");
    let few = SplatPly::random(1000, 0, 5);
    written(&folder, "few.ply", few.bytes());
    let mut more = SplatPly::random(1500, 0, 7);
    more.rows.splice(..1000, few.rows);
    written(&folder, "more.ply", more.bytes());
    let fails = |arguments: &str, parts: &[&str]| {
        command::fails(&folder, &format!("convert {arguments} -o a.dermis --nested"), parts);
    };
    fails("few.ply", &["few.ply: its 1000 Gaussians are too few", "leave --nested out"]);
    fails("few.ply more.ply", &["levels of its own", "leave --nested out"]);
    misuses(&folder, "convert more.ply -o a.dermis --steps 5", "--nested");
    misuses(&folder, "convert more.ply -o a.dermis --nested --steps 0", "--steps");
    let ran = run(&folder, "convert more.ply -o a.dermis --nested --steps 8 --json");
    let json: serde_json::Value = serde_json::from_str(&ran.stdout).expect("it is JSON");
    assert_eq!(json["levels"][0]["gaussians"], 375);
    assert_eq!(json["levels"][4]["gaussians"], 1875);
    assert!(json["levels"][4]["psnr_foreground_db"].as_f64().is_some_and(|db| db > 45.0));
}
