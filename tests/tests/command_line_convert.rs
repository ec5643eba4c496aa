//! `dermis convert` from outside: what is left out is said, and hostile files are refused.

use std::fs;

use dermis_tests::command::{fails, has_keys, json, misuses, run};
use dermis_tests::files::{SmallMesh, empty_folder};
use dermis_tests::splats::SplatPly;
use serde_json::{Value, json};

#[test]
fn gaussians_convert_and_are_drawn() {
    let folder = empty_folder("converting");
    let ply = SplatPly::random(60, 1, 8).with(2, "opacity", -9.0).with(4, "y", f32::NAN);
    fs::write(folder.join("a.ply"), ply.bytes()).expect("it can be written");
    let converted = run(&folder, "convert a.ply -o a.dermis --json");
    assert_eq!(converted.code, Some(0), "{converted:?}");
    assert_eq!(converted.stderr.lines().count(), 1, "{converted:?}");
    for part in ["a.ply: ", "2 Gaussians", "1 of", "1 with"] {
        assert!(converted.stderr.contains(part), "{part:?} is not in {:?}", converted.stderr);
    }
    let report: Value = serde_json::from_str(&converted.stdout).expect("stdout is JSON");
    has_keys(
        &report,
        "seconds left_out bytes bytes_per_gaussian gaussians sh_degree layers regions",
    );
    assert_eq!(report["left_out"], json!({ "faint": 1, "wild": 1 }));
    assert_eq!([&report["gaussians"], &report["sh_degree"]], [58, 1]);

    let info = json(&folder, "info a.dermis");
    assert_eq!([&info["gaussians"], &info["mesh"]["triangles"]], [58, 0]);
    let render = "render a.dermis -o a.png --size 48x32";
    let mut frames = Vec::new();
    for more in ["", "--yaw 90", "--pitch 60", "--distance 9", "--budget 20", "--level 0"] {
        let report = json(&folder, &format!("{render} {more}"));
        assert!(report["gaussians_visible"].as_u64() > Some(15), "{more}: {report}");
        frames.push(report["frame_crc32"].as_u64());
    }
    assert_eq!(frames.pop(), Some(frames[0]), "level 0 is all there is");
    frames.sort_unstable();
    frames.dedup();
    assert_eq!(frames.len(), 5, "each camera and budget has its picture");
    fails(&folder, &format!("{render} --clip walk"), &["a.dermis: ", "walk"]);
    fs::write(folder.join("mesh.glb"), SmallMesh::pyramid().glb()).expect("it can be written");
    fails(&folder, "eval a.dermis --mesh mesh.glb", &["a.dermis: ", "; "]);
    fails(&folder, "convert a.ply -o absent/b.dermis", &["absent/b.dermis: ", "; "]);
    misuses(&folder, "convert a.ply", "--output");
    misuses(&folder, "convert a.ply -o b.dermis --from doc", "--from");
    // Nothing to say of a file that is taken whole; what is there is replaced.
    let whole = SplatPly::random(60, 0, 8);
    fs::write(folder.join("b.ply"), whole.bytes()).expect("it can be written");
    let converted = run(&folder, "convert b.ply -o a.dermis --from ply");
    assert_eq!((converted.code, converted.stderr.as_str()), (Some(0), ""));
    assert!(converted.stdout.contains("60 Gaussians"), "{converted:?}");
}

#[test]
fn hostile_plys_are_refused() {
    let folder = empty_folder("hostile_plys");
    let ply = SplatPly::random(5, 1, 6);
    let whole = ply.bytes();
    let edited = |from: &str, to: &str| {
        let head = ply.header("binary_little_endian", "float");
        assert!(head.contains(from), "{from}");
        [head.replacen(from, to, 1).as_bytes(), &whole[head.len()..]].concat()
    };
    let text = |from: &str, to: &str| ply.ascii().replacen(from, to, 1).into_bytes();
    let faint = (0..5).fold(ply.clone(), |ply, row| ply.with(row, "opacity", -20.0));
    let endless = [b"ply\ncomment ".as_slice(), &[b'a'; 3 << 20]].concat();
    let junk = "element junk 4000000000\nproperty uchar a\nelement vertex";
    let hollow = "element junk 18446744073709551615\nelement vertex 4000000000";
    let lists = "element junk 3\nproperty list uint double a\nelement vertex";
    let files: [(&str, Vec<u8>, &str); 31] = [
        ("empty", Vec::new(), "ply"),
        ("other", b"solid cube\n".to_vec(), "ply"),
        ("magic", b"ply".to_vec(), "header"),
        ("half_header", whole[..200].to_vec(), "header"),
        ("endless", endless, "header"),
        ("not_text", b"ply\nformat \xff\xfe\n".to_vec(), "header"),
        ("no_format", edited("format binary_little_endian 1.0\n", ""), "ormat"),
        ("bad_format", edited("binary_little_endian", "binary_middle_endian"), "middle"),
        ("bad_type", edited("property float opacity", "property half opacity"), "half"),
        ("bad_count", edited("vertex 5", "vertex -5"), "-5"),
        ("no_count", edited("vertex 5", "vertex"), "element"),
        ("too_many", edited("vertex 5", "vertex 4294967295"), "4294967295"),
        ("far_too_many", edited("vertex 5", "vertex 18446744073709551615"), "1844674407370955"),
        ("one_more", edited("vertex 5", "vertex 6"), "at most 5"),
        ("cut", whole[..whole.len() - 1].to_vec(), "at most 4"),
        ("none", edited("vertex 5", "vertex 0"), "no row of vertex"),
        ("no_vertex", edited("vertex", "point"), "vertex"),
        ("much_junk", edited("element vertex", junk), "junk"),
        ("hollow_junk", edited("element vertex 5", hollow), "4000000000"),
        ("junk_lists", edited("element vertex", lists), "junk"),
        ("no_property", edited("property float scale_1", "property float size_1"), "scale_1"),
        (
            "no_properties",
            b"ply\nformat ascii 1.0\nelement vertex 4000000000\nend_header\n".to_vec(),
            "x",
        ),
        ("twice", edited("property float nx", "property float x"), "twice"),
        ("list", edited("property float x", "property list uchar float x"), "list"),
        (
            "odd_harmonics",
            edited("property float f_rest_8", "property float other"),
            "8 properties",
        ),
        ("packed", edited("property float x", "property uint packed_position"), "chunk"),
        ("bound", edited("property float nx", "property float binding_0"), "--from"),
        ("no_number", text("end_header\n", "end_header\nbanana "), "vertex row 0"),
        ("short_text", text("vertex 5", "vertex 6"), "5"),
        ("long_list", text("property float nx", "property list uint float nx"), "vertex"),
        ("faint", faint.bytes(), "5 too faint"),
    ];
    for (name, bytes, _) in &files {
        fs::write(folder.join(format!("{name}.ply")), bytes).expect("it can be written");
    }
    for (name, _, part) in &files {
        let command = format!("convert {name}.ply -o out.dermis");
        fails(&folder, &command, &[&format!("{name}.ply: "), "; ", part]);
    }
    // As it stands, where the user says so.
    json(&folder, "convert bound.ply -o bound.dermis --from ply");
    for (name, part) in [("absent.ply", "path"), (".", "folder"), ("/dev/zero", "device")] {
        fails(
            &folder,
            &format!("convert {name} -o out.dermis"),
            &[&format!("{name}: "), part, "; "],
        );
    }
}
