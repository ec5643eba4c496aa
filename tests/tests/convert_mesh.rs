//! Gaussians of other programs that hang on a mesh: the same pictures, at rest and in motion.

use std::path::{Path, PathBuf};

use dermis_format::{FrameKind, LowPass, RecordKind};
use dermis_runtime::{Avatar, Kernel, Plan, Pose, Posed};
use dermis_tests::command::run;
use dermis_tests::converted::{ALL, exact, orbit, psnr};
use dermis_tests::files::{self, SmallMesh, written};
use dermis_tests::mounted::{
    PlainMesh, SplattingAvatar, covering, free_around, gaussian_avatar, gaussian_avatar_in_world,
};
use dermis_tests::small::WHITE;
use dermis_tests::splat_files::in_every_format;
use dermis_tests::splats::SplatPly;
use dermis_trainer::convert::{self, Kind, LeftOut, Taken};
use dermis_trainer::demo::demo_avatar;
use dermis_trainer::import;
use dermis_trainer::model::Material;
use dermis_trainer::scene::{self, Painter, srgb_encode};
use glam::{DVec3, Vec3};

/// Least PSNR of a converted file's pictures, dB over the foreground.
const LEAST_DB: f64 = 45.0;

/// With a mesh that carries what is read.
fn on(mesh: &Path) -> Taken<'_> {
    Taken { mesh: Some(mesh), ..Taken::default() }
}

fn as_kind(kind: Kind) -> Taken<'static> {
    Taken { kind: Some(kind), ..Taken::default() }
}

fn converted(inputs: &[PathBuf], taken: &Taken<'_>) -> Vec<u8> {
    let assembled = convert::assemble(inputs, taken);
    let (assembly, left_out) = assembled.unwrap_or_else(|error| panic!("{error:#}"));
    assert_eq!(left_out, LeftOut::default());
    convert::pack(assembly).unwrap_or_else(|error| panic!("{error:#}"))
}

/// Vertices in a pose, world, metres.
fn vertices(avatar: &Avatar<'_>, pose: &Pose<'_>) -> Vec<[f32; 3]> {
    let mut scratch = vec![0; Posed::scratch_len(avatar)];
    let posed = Posed::new(avatar, pose, Kernel::detect(), &mut scratch).expect("it can be posed");
    posed.vertices().to_vec()
}

/// Least PSNR of three views.
fn worst_view(
    what: &str,
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    world: &SplatPly,
    size: u32,
) -> f64 {
    let plan = Plan::with_budget(avatar, ALL);
    let mut worst = f64::INFINITY;
    for (yaw, pitch) in [(0.0, 0.0), (130.0, 25.0), (250.0, -20.0)] {
        let camera = orbit(avatar, pose, yaw, pitch, None, size);
        worst = worst.min(psnr(avatar, pose, &plan, &exact(world, &camera), &camera));
    }
    println!("{what}: {worst:.2} dB");
    worst
}

/// Bends and stretches what stands on a mesh.
fn bent(mesh: &PlainMesh) -> Vec<[f32; 3]> {
    let bend = |v: &DVec3| {
        let (sin, cos) = (0.9 * v.y).sin_cos();
        let [x, y, z] = [v.x * 1.2, v.y, v.z + 0.3 * v.x].map(|x| x as f32);
        let (sin, cos) = (sin as f32, cos as f32);
        [x * cos - z * sin, y * 0.9 + 0.1 * x, x * sin + z * cos]
    };
    mesh.vertices.iter().map(bend).collect()
}

/// The avatar that the program makes itself, as an OBJ file at rest, and what is read of it.
fn figure(folder: &Path, name: &str) -> (PathBuf, PlainMesh) {
    let path = written(folder, name, PlainMesh::at_rest(&demo_avatar()).obj());
    let mesh = PlainMesh::at_rest(&import::load(&path).expect("it can be read"));
    (path, mesh)
}

#[test]
fn gaussian_avatars_move_as_their_authors_meant() {
    let folder = files::empty_folder("convert_gaussian_avatars");
    let (path, mesh) = figure(&folder, "mesh.obj");
    for degree in [0, 3] {
        let ply = gaussian_avatar(&mesh, 3000, degree, 4);
        let input = [written(&folder, "a.ply", ply.bytes())];
        let bytes = converted(&input, &on(&path));
        assert!(
            bytes
                == converted(
                    &input,
                    &Taken { mesh: Some(&path), ..as_kind(Kind::GaussianAvatars) }
                )
        );
        let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
        let header = avatar.header();
        assert_eq!((header.frame, header.record), (FrameKind::Edge, RecordKind::Full));
        assert_eq!((header.gaussians, usize::from(header.harmonics_degree)), (3000, degree));
        let bent = bent(&mesh);
        for (what, pose) in [("rest", Pose::Rest), ("bent", Pose::Vertices(&bent))] {
            let world = gaussian_avatar_in_world(&ply, &mesh.posed(&vertices(&avatar, &pose)));
            let what = format!("GaussianAvatars of degree {degree}, {what}");
            let db = worst_view(&what, &avatar, &pose, &world, 200);
            assert!(db > LEAST_DB, "{what}: {db:.2} dB");
        }
        // The mesh of the file is the one that went in.
        let world = gaussian_avatar_in_world(&ply, &mesh);
        let db = worst_view("against the mesh as it came", &avatar, &Pose::Rest, &world, 200);
        assert!(db > LEAST_DB, "{db:.2} dB");
    }
}

#[test]
fn splatting_avatars_are_the_same_in_their_canonical_pose() {
    let folder = files::empty_folder("convert_splatting_avatar");
    let (_, mesh) = figure(&folder, "embedding.obj");
    for degree in [0, 2] {
        let source = SplattingAvatar::random(&mesh, 3000, degree, 6);
        written(&folder, "embedding.json", source.embedding("embedding.obj"));
        let input = [written(&folder, "point_cloud.ply", source.ply.bytes())];
        let bytes = converted(&input, &Taken::default());
        assert!(bytes == converted(&input, &as_kind(Kind::SplattingAvatar)));
        let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
        let db = worst_view(
            &format!("SplattingAvatar of degree {degree}"),
            &avatar,
            &Pose::Rest,
            &source.in_world(&mesh, &mesh),
            200,
        );
        assert!(db > LEAST_DB, "{db:.2} dB");
        // As it stands, on request.
        let bytes = converted(&input, &as_kind(Kind::Ply));
        let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
        assert_eq!(avatar.header().frame, FrameKind::World);
        let db = worst_view("its PLY alone", &avatar, &Pose::Rest, &source.ply, 200);
        assert!(db > LEAST_DB, "{db:.2} dB");
    }
}

#[test]
fn free_gaussians_stay_in_place_on_a_mesh() {
    let folder = files::empty_folder("convert_free_on_mesh");
    let (path, mesh) = figure(&folder, "mesh.obj");
    for degree in [0, 1] {
        let ply = free_around(&mesh, 3000, degree, 8);
        let bytes = converted(&[written(&folder, "a.ply", ply.bytes())], &on(&path));
        let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
        let what = format!("free on a mesh, degree {degree}");
        let db = worst_view(&what, &avatar, &Pose::Rest, &ply, 200);
        assert!(db > LEAST_DB, "{db:.2} dB");
        // Moved as one, Gaussians go with it.
        let aside: Vec<[f32; 3]> =
            vertices(&avatar, &Pose::Rest).iter().map(|[x, y, z]| [x + 3.0, *y, z - 1.0]).collect();
        let mut moved = ply.clone();
        for row in &mut moved.rows {
            row[0] += 3.0;
            row[2] -= 1.0;
        }
        let db = worst_view("moved as one", &avatar, &Pose::Vertices(&aside), &moved, 200);
        assert!(db > LEAST_DB, "{db:.2} dB");
    }
}

#[test]
fn every_file_of_free_gaussians_hangs_on_a_mesh() {
    let folder = files::empty_folder("convert_files_on_mesh");
    let (path, mesh) = figure(&folder, "mesh.obj");
    for (name, bytes, said) in in_every_format(&free_around(&mesh, 2000, 0, 8)) {
        let bytes = converted(&[written(&folder, name, bytes)], &on(&path));
        let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
        let header = avatar.header();
        assert_eq!((header.frame, header.gaussians), (FrameKind::Affine, 2000), "{name}");
        let db = worst_view(&format!("{name} on a mesh"), &avatar, &Pose::Rest, &said, 200);
        assert!(db > LEAST_DB, "{name}: {db:.2} dB");
    }
}

#[test]
fn a_half_turn_is_that_of_free_gaussians_alone() {
    let folder = files::empty_folder("convert_turned_on_mesh");
    let (path, mesh) = figure(&folder, "mesh.obj");
    let ply = free_around(&mesh, 300, 1, 8);
    let mut captured = ply.clone();
    // Coefficients of y and z of each channel; that of x stays.
    let turned = ["y", "z", "rot_2", "rot_3"].map(str::to_owned).into_iter();
    let turned = turned.chain([0, 1, 3, 4, 6, 7].map(|i| format!("f_rest_{i}")));
    for name in turned {
        let column = ply.names.iter().position(|own| *own == name).expect("it has this property");
        captured.rows.iter_mut().for_each(|row| row[column] = -row[column]);
    }
    let expected = converted(&[written(&folder, "a.ply", ply.bytes())], &on(&path));
    let captured = [written(&folder, "captured.ply", captured.bytes())];
    assert!(converted(&captured, &Taken { half_turn: true, ..on(&path) }) == expected);
    assert!(converted(&captured, &on(&path)) != expected);
}

#[test]
fn low_pass_and_degree_of_what_hangs_on_a_mesh_are_those_of_the_file() {
    let folder = files::empty_folder("convert_low_pass_on_mesh");
    let (_, mesh) = figure(&folder, "mesh.obj");
    let text = gaussian_avatar(&mesh, 40, 2, 4).ascii();
    let mip = text.replace("element", "comment SplatRenderMode: mip\nelement");
    for (text, low_pass) in [(text, LowPass::Classic), (mip, LowPass::Compensated)] {
        let path = written(&folder, "a.ply", text);
        let bytes = converted(&[path], &on(&folder.join("mesh.obj")));
        let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
        assert_eq!((avatar.header().low_pass, avatar.header().harmonics_degree), (low_pass, 2));
    }
    let cut = run(&folder, "convert a.ply --mesh mesh.obj --sh-degree 1 -o a.dermis --json");
    assert_eq!(cut.stderr, "a.ply: cut harmonics of degree 2 to 1\n");
    let json: serde_json::Value = serde_json::from_str(&cut.stdout).expect("it is JSON");
    assert_eq!([&json["sh_degree"], &json["sh_degree_cut_from"]], [1, 2]);
}

#[test]
fn flat_triangles_carry_nothing() {
    let folder = files::empty_folder("convert_flat_triangles");
    let (_, mesh) = figure(&folder, "plain.obj");
    let ply = free_around(&mesh, 2000, 0, 8);
    // Before each triangle two that lie on its edges: none is farther, and their indices are lower.
    let flat = |&[a, b, c]: &[u32; 3]| [[a, b, a], [c, c, b], [a, b, c]];
    let mixed = PlainMesh { triangles: mesh.triangles.iter().flat_map(flat).collect(), ..mesh };
    let path = written(&folder, "mesh.obj", mixed.obj());
    let bytes = converted(&[written(&folder, "a.ply", ply.bytes())], &on(&path));
    let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
    assert_eq!(avatar.header().triangles as usize, mixed.triangles.len());
    let db = worst_view("beside flat triangles", &avatar, &Pose::Rest, &ply, 200);
    assert!(db > LEAST_DB, "{db:.2} dB");
}

#[test]
fn meshes_in_glb_carry_too() {
    let folder = files::empty_folder("convert_glb");
    let path = written(&folder, "mesh.glb", SmallMesh::pyramid().glb());
    let mesh = PlainMesh::at_rest(&import::load(&path).expect("it can be read"));
    let ply = gaussian_avatar(&mesh, 500, 1, 4);
    let bytes = converted(&[written(&folder, "a.ply", ply.bytes())], &on(&path));
    let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
    let world = gaussian_avatar_in_world(&ply, &mesh);
    let db = worst_view("on a pyramid", &avatar, &Pose::Rest, &world, 120);
    assert!(db > LEAST_DB, "{db:.2} dB");
}

#[test]
fn real_meshes_carry_in_motion() {
    let Some(data) = files::data("real_meshes_carry_in_motion") else { return };
    let folder = files::empty_folder("convert_real_meshes");
    for name in ["valid_male.glb", "CesiumMan.glb", "obj/valid_male.obj"] {
        let path = data.join(name);
        let mesh = PlainMesh::at_rest(&import::load(&path).expect("it can be read"));
        let local = gaussian_avatar(&mesh, 20_000, 0, 4);
        let bytes = converted(&[written(&folder, "a.ply", local.bytes())], &on(&path));
        let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
        let clip = Pose::Clip { clip: 0, seconds: 1.0 };
        let poses = [("rest", Pose::Rest), ("first clip", clip)];
        for (what, pose) in poses.into_iter().take(1 + avatar.clips().count().min(1)) {
            let world = gaussian_avatar_in_world(&local, &mesh.posed(&vertices(&avatar, &pose)));
            let db = worst_view(&format!("{name}, bound, {what}"), &avatar, &pose, &world, 400);
            assert!(db > LEAST_DB, "{name}, {what}: {db:.2} dB");
        }
        let free = free_around(&mesh, 20_000, 0, 9);
        let bytes = converted(&[written(&folder, "b.ply", free.bytes())], &on(&path));
        let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
        let db = worst_view(&format!("{name}, free, rest"), &avatar, &Pose::Rest, &free, 400);
        assert!(db > LEAST_DB, "{name}: {db:.2} dB");
    }
}

/// What a SplattingAvatar loses in motion, as its authors turn Gaussians by three corners and do not
/// stretch them.
#[test]
fn a_rigged_mesh_moves_a_splatting_avatar() {
    let Some(data) = files::data("a_rigged_mesh_moves_a_splatting_avatar") else { return };
    let folder = files::empty_folder("convert_moved_splatting_avatar");
    let canonical = data.join("obj/valid_male.obj");
    let mesh = PlainMesh::at_rest(&import::load(&canonical).expect("it can be read"));
    let source = SplattingAvatar::random(&mesh, 20_000, 0, 6);
    let name = canonical.canonicalize().expect("it is there").display().to_string();
    written(&folder, "embedding.json", source.embedding(&name));
    let input = [written(&folder, "a.ply", source.ply.bytes())];
    let rigged = data.join("valid_male.glb");
    let bytes = converted(&input, &on(&rigged));
    let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
    let glb = PlainMesh::at_rest(&import::load(&rigged).expect("it can be read"));
    let (from, world) = (glb.clone(), source.in_world(&mesh, &mesh));
    let db = worst_view("SplattingAvatar on a rig, rest", &avatar, &Pose::Rest, &world, 400);
    assert!(db > 40.0, "{db:.2} dB");
    for clip in 0..avatar.clips().count() {
        for seconds in [1.0, 2.5] {
            let pose = Pose::Clip { clip, seconds };
            let world = source.in_world(&from, &glb.posed(&vertices(&avatar, &pose)));
            let what = format!("SplattingAvatar on a rig, clip {clip} at {seconds} s");
            let db = worst_view(&what, &avatar, &pose, &world, 400);
            assert!(db > 25.0, "{db:.2} dB");
        }
    }
}

/// Free Gaussians that cover a mesh at rest, and go with it: against the mesh itself.
#[test]
fn a_gait_opens_no_cracks() {
    let Some(data) = files::data("a_gait_opens_no_cracks") else { return };
    let folder = files::empty_folder("convert_gait");
    let path = data.join("Fox.glb");
    let mut model = import::load(&path).expect("it can be read");
    // Painted so that what covers it can be, too: by place at rest.
    model.materials = vec![Material { double_sided: true, ..Material::default() }];
    model.triangles.iter_mut().for_each(|triangle| triangle.material = 0);
    let mesh = PlainMesh::at_rest(&model);
    let paint = |p: DVec3| (p * 0.01 + 0.5).clamp(DVec3::splat(0.05), DVec3::ONE);
    for (vertex, &place) in model.vertices.iter_mut().zip(&mesh.vertices) {
        vertex.color = paint(place).as_vec3().extend(1.0);
    }
    let cover = covering(&mesh, 20_000, |p| paint(p).to_array().map(|x| srgb_encode(x as f32)));
    let bytes = converted(&[written(&folder, "a.ply", cover.bytes())], &on(&path));
    let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
    let plan = Plan::with_budget(&avatar, ALL);
    let painter = Painter::new(&model);
    for clip in 0..avatar.clips().count() {
        let mut mean = 0.0;
        for (seconds, yaw) in [(0.1, 30.0), (0.3, 120.0), (0.5, 250.0), (0.6, 330.0)] {
            let pose = Pose::Clip { clip, seconds };
            let camera = orbit(&avatar, &pose, yaw, 15.0, None, 300);
            let posed: Vec<Vec3> = vertices(&avatar, &pose).into_iter().map(Vec3::from).collect();
            let truth = scene::render(&painter, &posed, &camera, WHITE, 4).picture.to_bytes();
            mean += psnr(&avatar, &pose, &plan, &truth, &camera) / 4.0;
        }
        println!("Fox, clip {clip}: {mean:.2} dB");
        assert!(mean > 20.0, "{mean:.2} dB");
    }
}
