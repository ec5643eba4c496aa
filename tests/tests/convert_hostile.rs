//! Gaussians on a mesh and levels, malformed in every way: one line that names file, fault and remedy.

use std::fs;
use std::path::{Path, PathBuf};

use dermis_tests::command::{fails, misuses, run};
use dermis_tests::files::{SmallMesh, empty_folder, written};
use dermis_tests::mounted::{PlainMesh, SplattingAvatar, gaussian_avatar};
use dermis_tests::splat_files::compressed_ply;
use dermis_tests::splats::SplatPly;
use dermis_trainer::convert::{self, Taken};
use dermis_trainer::import;

const COUNT: usize = 12;

/// Writes `mesh.glb` and `mesh.obj`, a pyramid of six triangles, and gives it.
fn pyramid(folder: &Path) -> PlainMesh {
    let path = folder.join("mesh.glb");
    fs::write(&path, SmallMesh::pyramid().glb()).expect("it can be written");
    let mesh = PlainMesh::at_rest(&import::load(&path).expect("it can be read"));
    written(folder, "mesh.obj", mesh.obj());
    mesh
}

fn succeeds(folder: &Path, arguments: &str) {
    let run = run(folder, arguments);
    assert_eq!(run.code, Some(0), "{arguments}: {run:?}");
}

#[test]
fn gaussian_avatars_that_do_not_fit_are_refused() {
    let folder = empty_folder("hostile_gaussian_avatars");
    let ply = gaussian_avatar(&pyramid(&folder), COUNT as u32, 1, 6);
    let bound = |number: f32| ply.with(3, "binding_0", number).bytes();
    let whole = ply.bytes();
    let edited = |from: &str, to: &str| {
        let head = ply.header("binary_little_endian", "float");
        assert!(head.contains(from), "{from}");
        [head.replacen(from, to, 1).as_bytes(), &whole[head.len()..]].concat()
    };
    let nowhere = (0..COUNT).fold(ply.clone(), |ply, row| ply.with(row, "scale_1", f32::NAN));
    let files: [(&str, Vec<u8>, &str); 11] = [
        (
            "next",
            bound(6.0),
            "vertex row 3: its binding_0 is 6, but mesh.glb has the triangles 0 to 5",
        ),
        ("negative", bound(-1.0), "is -1"),
        ("half", bound(0.5), "is 0.5"),
        ("nan", bound(f32::NAN), "is NaN"),
        ("infinite", bound(f32::INFINITY), "is inf"),
        ("huge", bound(3e38), "vertex row 3"),
        ("no_scale", edited("float scale_1", "float size_1"), "scale_1"),
        ("list", edited("float binding_0", "list uchar float binding_0"), "binding_0 is a list"),
        ("cut", whole[..whole.len() - 1].to_vec(), "at most 11"),
        ("many", edited("vertex 12", "vertex 4294967295"), "4294967295"),
        ("nowhere", nowhere.bytes(), "12 with numbers"),
    ];
    for (name, bytes, part) in &files {
        let name = written(&folder, &format!("{name}.ply"), bytes);
        let name = name.file_name().expect("it has one").to_string_lossy().into_owned();
        for kind in ["", "--from gaussian-avatars"] {
            if kind.is_empty() && ["no_scale.ply", "list.ply"].contains(&name.as_str()) {
                continue;
            }
            let command = format!("convert {name} --mesh mesh.glb {kind} -o out.dermis");
            fails(&folder, &command, &[&format!("{name}: "), "; ", part]);
        }
    }
    written(&folder, "a.ply", &whole);
    written(&folder, "free.ply", SplatPly::random(5, 0, 3).bytes());
    let fails = |arguments: &str, parts: &[&str]| {
        fails(&folder, &format!("convert {arguments} -o out.dermis"), parts);
    };
    for kind in ["", "--from gaussian-avatars"] {
        fails(&format!("a.ply {kind}"), &["a.ply: ", "--mesh"]);
    }
    fails("free.ply --mesh mesh.glb --from gaussian-avatars", &["free.ply: ", "binding_0"]);
    fails("a.ply --mesh mesh.glb --half-turn", &["a.ply: ", "leave --half-turn out"]);
    fails("a.ply --mesh absent.glb", &["absent.glb: ", "path"]);
    fails("a.ply --mesh a.ply", &["a.ply: ", "GLB"]);
    // Flat as a needle, all of it.
    written(&folder, "needle.obj", "v 0 0 0\nv 1 0 0\nv 0.5 0.001 0\nf 1 2 3\n");
    fails("free.ply --mesh needle.obj", &["needle.obj: ", "flat", "; "]);
    // A mesh of a picometre beside Gaussians of centimetres.
    written(&folder, "tiny.obj", "v 0 0 0\nv 1e-12 0 0\nv 0 1e-12 0\nf 1 2 3\n");
    fails("free.ply --mesh tiny.obj", &["tiny.obj: ", "too small", "; "]);
    // A rotation of length 0 is none, as everywhere.
    let zero = (0..4).fold(ply, |ply, i| ply.with(2, &format!("rot_{i}"), 0.0));
    written(&folder, "zero.ply", zero.bytes());
    succeeds(&folder, "convert zero.ply --mesh mesh.obj -o zero.dermis");
    misuses(&folder, "convert -o out.dermis", "IN");
    misuses(&folder, "convert a.ply --mesh -o out.dermis", "--mesh");
}

#[test]
fn embeddings_that_do_not_fit_are_refused() {
    let folder = empty_folder("hostile_embeddings");
    let source = SplattingAvatar::random(&pyramid(&folder), COUNT as u32, 0, 6);
    written(&folder, "a.ply", source.ply.bytes());
    let whole = source.embedding("mesh.obj");
    succeeds(&write_and(&folder, &whole), "convert a.ply -o whole.dermis");
    let command = "convert a.ply --half-turn -o out.dermis";
    fails(&folder, command, &["a.ply: ", "leave --half-turn out"]);
    let other = |change: &dyn Fn(&mut SplattingAvatar)| {
        let mut other = source.clone();
        change(&mut other);
        other.embedding("mesh.obj")
    };
    let with = |from: &str, to: &str| {
        assert!(whole.contains(from), "{from}");
        whole.replacen(from, to, 1)
    };
    let deep = format!(r#"{{"a": {}"#, "[".repeat(1 << 20));
    let files: [(&str, String, &str); 24] = [
        ("empty", String::new(), "EOF"),
        ("none", "solid cube".into(), "expected value"),
        ("list", "[1, 2, 3]".into(), "invalid type"),
        ("nothing", "{}".into(), "cano_mesh"),
        ("cut", whole[..whole.len() / 2].into(), "EOF"),
        ("deep", deep, "EOF"),
        ("no_bary", with("sample_bary", "other"), "sample_bary"),
        ("no_xyz", with("_xyz", "other"), "_xyz"),
        ("twice", with("{", r#"{"cano_mesh": "mesh.obj", "#), "duplicate"),
        ("few_triangles", other(&|s| s.triangles.truncate(11)), "sample_bary has 12"),
        ("few_bary", other(&|s| s.barycentric.truncate(11)), "sample_bary has 11"),
        ("few_xyz", other(&|s| s.distances.truncate(11)), "_xyz has 11"),
        ("few_rotations", other(&|s| s.rotations.truncate(11)), "_rotation has 11"),
        (
            "few",
            other(&|s| {
                s.triangles.pop();
                s.barycentric.pop();
                s.distances.pop();
                s.rotations.pop();
            }),
            "a.ply: has 12 Gaussians, its embedding.json 11",
        ),
        ("outside", other(&|s| s.triangles[4] = 6), "sample_fidxs 4 is 6, but mesh.obj"),
        ("far_outside", other(&|s| s.triangles[4] = 99_999_999_999), "99999999999"),
        ("negative", with(r#""sample_fidxs": ["#, r#""sample_fidxs": [-1, "#), "-1"),
        ("half", with(r#""sample_fidxs": ["#, r#""sample_fidxs": [0.5, "#), "0.5"),
        ("text", with(r#""sample_fidxs": ["#, r#""sample_fidxs": ["a", "#), "string"),
        ("pair", with(r#""_xyz": [["#, r#""_xyz": [[0, 0], ["#), "3"),
        ("nan", with(r#""_xyz": [["#, r#""_xyz": [[0, 0, NaN], ["#), "expected"),
        ("huge", with(r#""_xyz": [["#, r#""_xyz": [[0, 0, 1e999], ["#), "out of range"),
        ("no_mesh", with(r#""mesh.obj""#, "7"), "integer `7`"),
        ("absent_mesh", with("mesh.obj", "absent.obj"), "absent.obj"),
    ];
    for (name, json, part) in files {
        println!("{name}");
        written(&folder, "embedding.json", json);
        for kind in ["", "--from splatting-avatar"] {
            let command = format!("convert a.ply {kind} -o out.dermis");
            fails(&folder, &command, &["embedding.json", "; ", part]);
        }
        // The PLY itself is as it was.
        succeeds(&folder, "convert a.ply --from ply -o ply.dermis");
    }
    for mesh in [".", "/dev/zero"] {
        written(&folder, "embedding.json", with("mesh.obj", mesh));
        fails(&folder, "convert a.ply -o out.dermis", &["embedding.json: ", "folder or a device"]);
    }
    written(&folder, "embedding.json", &whole);
    written(&folder, "one.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let command = "convert a.ply --mesh one.obj -o out.dermis";
    fails(&folder, command, &["one.obj: has 1 triangles, mesh.obj has 6; "]);
    succeeds(&folder, "convert a.ply --mesh mesh.glb -o moved.dermis");
    fs::remove_file(folder.join("embedding.json")).expect("it is there");
    let command = "convert a.ply --from splatting-avatar -o out.dermis";
    fails(&folder, command, &["embedding.json: ", "path"]);
}

/// Writes an embedding, and gives the folder again.
fn write_and(folder: &Path, embedding: &str) -> PathBuf {
    written(folder, "embedding.json", embedding);
    folder.to_owned()
}

#[test]
fn series_that_are_none_are_refused() {
    let folder = empty_folder("hostile_series");
    let fine = SplatPly::random(10, 1, 6);
    let coarse = SplatPly { rows: fine.rows[..4].to_vec(), ..fine.clone() };
    written(&folder, "0.ply", coarse.bytes());
    let fails = |arguments: &str, parts: &[&str]| {
        fails(&folder, &format!("convert {arguments} -o out.dermis"), parts);
    };
    let other = SplatPly::random(10, 2, 6);
    let mip = fine.ascii().replace("element", "comment SplatRenderMode: mip\nelement");
    let faint = (4..10).fold(fine.clone(), |ply, row| ply.with(row, "opacity", -20.0));
    let files = [
        ("moved", fine.with(2, "x", 7.0).bytes(), "vertex row 2 differs"),
        ("turned", fine.with(1, "rot_2", 7.0).bytes(), "vertex row 1 differs"),
        ("grown", fine.with(3, "scale_0", -1.0).bytes(), "vertex row 3 differs"),
        ("painted", fine.with(0, "f_dc_1", 0.1).bytes(), "vertex row 0 differs"),
        ("lit", fine.with(0, "f_rest_8", 0.1).bytes(), "vertex row 0 differs"),
        ("same", coarse.bytes(), "has 4 Gaussians, the file before it 4"),
        (
            "fewer",
            SplatPly { rows: fine.rows[..3].to_vec(), ..fine.clone() }.bytes(),
            "3 Gaussians",
        ),
        ("degree", other.bytes(), "of degree 2, the file before it of 1"),
        ("mip", mip.into_bytes(), "another low-pass"),
        ("packed", compressed_ply(&fine, true).0, "has no property x"),
        ("cut", fine.bytes()[..900].to_vec(), "at most"),
        ("text", b"solid cube\n".to_vec(), "ply"),
        ("faint", faint.bytes(), "none of the 6 Gaussians that it adds"),
    ];
    for (name, bytes, part) in files {
        written(&folder, &format!("{name}.ply"), bytes);
        fails(&format!("0.ply {name}.ply"), &[&format!("{name}.ply: "), "; ", part]);
    }
    written(&folder, "1.ply", fine.bytes());
    fails("1.ply 0.ply", &["0.ply: has 4 Gaussians, the file before it 10", "coarse to fine"]);
    fails("0.ply absent.ply", &["absent.ply: ", "path"]);
    fails("0.ply 1.ply --from ply", &["0.ply: ", "2 files", "; "]);
    fails(&"0.ply ".repeat(17), &["0.ply: ", "16", "; "]);
    succeeds(&folder, "convert 0.ply 1.ply --from lapisgs -o a.dermis");
    succeeds(&folder, "convert 1.ply --from lapisgs -o b.dermis");
}

#[test]
fn damaged_files_neither_panic_nor_hang() {
    let folder = empty_folder("hostile_damaged");
    let mesh = pyramid(&folder);
    let glb = folder.join("mesh.glb");
    let bound = written(&folder, "bound.ply", []);
    let whole = gaussian_avatar(&mesh, 2, 0, 4).bytes();
    let avatar = SplattingAvatar::random(&mesh, 2, 0, 6);
    let embedded = folder.join("embedded");
    fs::create_dir(&embedded).expect("it can be made");
    written(&embedded, "mesh.obj", mesh.obj());
    let ply = written(&embedded, "a.ply", avatar.ply.bytes());
    let json = avatar.embedding("mesh.obj").into_bytes();
    let each = |whole: &[u8], try_it: &dyn Fn(&[u8])| {
        for place in 0..whole.len() {
            try_it(&whole[..place]);
            let mut flipped = whole.to_vec();
            flipped[place] ^= 1 << (place % 8);
            try_it(&flipped);
        }
    };
    let pack = |inputs: &[PathBuf], mesh: Option<&Path>| {
        if let Ok((assembly, _)) = convert::assemble(inputs, &Taken { mesh, ..Taken::default() }) {
            convert::pack(assembly).expect("what can be read can be packed");
        }
    };
    each(&whole, &|bytes| {
        written(&folder, "bound.ply", bytes);
        pack(std::slice::from_ref(&bound), Some(&glb));
    });
    each(&json, &|bytes| {
        written(&embedded, "embedding.json", bytes);
        pack(std::slice::from_ref(&ply), None);
    });
}
