//! The `dermis` command from outside: exit codes, messages, JSON, and files that are whole or absent.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use dermis_tests::command::{dermis, fails, has_keys, json, misuses, run};
use dermis_tests::files::{SmallMesh, empty_folder, names};
use dermis_tests::small::{options, trained_demo};
use serde_json::{Value, json};

const TINY: &str = "--preset draft --gaussians 150 --views 4 --keyframes 1 --size 24 --levels 2";

/// A folder with `a.dermis`, the built-in avatar in a few Gaussians.
fn folder(name: &str) -> PathBuf {
    let folder = empty_folder(name);
    let options = dermis_trainer::options::Options { size: 32, ..options(300, 5) };
    fs::write(folder.join("a.dermis"), trained_demo(&options).1.bytes).expect("it can be written");
    folder
}

#[test]
fn damaged_avatars_are_refused() {
    let folder = folder("damaged_avatars");
    let whole = fs::read(folder.join("a.dermis")).expect("it was written");
    let damaged = folder.join("damaged.dermis");
    let refused = |bytes: &[u8]| {
        fs::write(&damaged, bytes).expect("it can be written");
        fails(&folder, "info damaged.dermis", &["damaged.dermis: ", "; "]);
        fails(&folder, "render damaged.dermis -o out.png --size 16x16", &["damaged.dermis: "]);
    };
    // Every byte and bit is the format's own test; here the message matters.
    for len in [0, 3, 20, whole.len() / 3, whole.len() - 1] {
        refused(&whole[..len]);
    }
    for place in (1..8).map(|i| i * whole.len() / 8) {
        let mut flipped = whole.clone();
        flipped[place] ^= 1 << (place % 8);
        refused(&flipped);
    }
}

#[test]
fn bad_meshes_are_refused() {
    let folder = empty_folder("bad_meshes");
    let pyramid = SmallMesh::pyramid();
    let whole = pyramid.glb();
    let mut out_of_range = pyramid.clone();
    out_of_range.indices[4] = 5;
    let mut not_a_number = pyramid.clone();
    not_a_number.positions[2][1] = f32::NAN;
    let mut without_area = pyramid.clone();
    without_area.positions.fill([1.0; 3]);
    let no_triangles = SmallMesh { indices: Vec::new(), ..pyramid.clone() };
    let uvs = pyramid.positions.iter().map(|[x, y, _]| [x + 0.5, *y]).collect();
    let image = Some("absent.png".to_owned());
    let no_image = SmallMesh { uvs, image, ..pyramid };
    let files: [(&str, Vec<u8>, &str); 12] = [
        ("short.glb", whole[..whole.len() - 40].to_vec(), ""),
        ("header.glb", whole[..15].to_vec(), ""),
        ("empty.glb", Vec::new(), ""),
        ("other.gltf", br#"{"name":"not a scene","values":[1,2,3]}"#.to_vec(), ""),
        ("half.gltf", br#"{"asset":{"version":"2.0"},"meshes":["#.to_vec(), ""),
        ("range.glb", out_of_range.glb(), ""),
        ("nan.glb", not_a_number.glb(), ""),
        ("area.glb", without_area.glb(), "area"),
        ("none.glb", no_triangles.glb(), ""),
        ("image.glb", no_image.glb(), "absent.png"),
        ("flat.obj", b"v 0 0\n".to_vec(), "2 numbers"),
        ("face.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n".to_vec(), ""),
    ];
    for (name, bytes, _) in &files {
        fs::write(folder.join(name), bytes).expect("it can be written");
    }
    for (name, _, part) in &files {
        let named = format!("{name}: ");
        fails(&folder, &format!("train {name} -o out.dermis {TINY}"), &[&named, "; ", part]);
    }
}

#[test]
fn files_that_cannot_be_read_or_written() {
    let folder = folder("unwritable");
    fs::write(folder.join("mesh.glb"), SmallMesh::pyramid().glb()).expect("it can be written");
    fs::write(folder.join("notes.txt"), "no avatar").expect("it can be written");
    fs::create_dir(folder.join("there.png")).expect("it can be made");
    for command in ["info", "render -o out.png", "eval --mesh mesh.glb"] {
        fails(&folder, &format!("{command} absent.dermis"), &["absent.dermis: ", "; ", "path"]);
        fails(&folder, &format!("{command} notes.txt"), &["notes.txt: ", "; "]);
    }
    fails(&folder, &format!("train absent.glb -o out.dermis {TINY}"), &["absent.glb: ", "; "]);
    fails(&folder, &format!("train notes.txt -o out.dermis {TINY}"), &["notes.txt: ", "; "]);
    fails(&folder, "render a.dermis -o out.png --camera absent.json", &["absent.json: ", "; "]);
    fails(&folder, "render a.dermis -o out.png --camera notes.txt", &["notes.txt: ", "; "]);
    // A file where a folder should be, no folder at all, and a folder where the file should be.
    for output in ["notes.txt/out.png", "absent/out.png", "there.png"] {
        let mesh = format!("train mesh.glb {TINY} -o {output}");
        for command in [&mesh, &format!("render a.dermis -o {output}")] {
            fails(&folder, command, &[&format!("{output}: "), "; "]);
        }
    }
    fails(&folder, "demo --out notes.txt", &["notes.txt: ", "; "]);
    // What stood there before a failure still stands there.
    fails(&folder, &format!("train notes.txt -o a.dermis {TINY}"), &["notes.txt: "]);
    json(&folder, "info a.dermis");
}

/// The files that a command names to be read stay, however the output's name comes to them; and nothing is written under a name that says something else.
#[test]
fn inputs_are_not_written_over() {
    let folder = folder("own_input");
    let glb = SmallMesh::pyramid().glb();
    fs::write(folder.join("mesh.glb"), &glb).expect("it can be written");
    fs::create_dir(folder.join("sub")).expect("it can be made");
    fs::copy(folder.join("a.dermis"), folder.join("a.png")).expect("it can be copied");
    let said = ": is read, too; ";
    fails(&folder, &format!("train mesh.glb -o sub/../mesh.glb {TINY}"), &["mesh.glb", said]);
    assert_eq!(fs::read(folder.join("mesh.glb")).expect("it is there"), glb);
    fails(&folder, "render a.png -o ./a.png", &["a.png", said]);
    fails(&folder, "bench a.dermis --svg a.dermis", &["a.dermis", said]);
    fails(&folder, "bench a.dermis --camera mesh.glb --svg mesh.glb", &["mesh.glb", said]);
    let masked = format!("train mesh.glb {TINY} --detail-mask a.png --detail-camera a.dermis");
    fails(&folder, &format!("{masked} -o a.png"), &["a.png", said]);
    for command in ["pack", "unpack"] {
        fails(&folder, &format!("{command} a.dermis -o a.dermis"), &["a.dermis", said]);
    }
    misuses(&folder, "render a.dermis -o a.jpg", "png");
    for output in [
        "--checkpoint sub -o sub/out",
        "--checkpoint sub/../sub -o sub/out",
        "--checkpoint . -o out",
    ] {
        misuses(&folder, &format!("train mesh.glb {output} {TINY}"), "--checkpoint");
    }
    json(&folder, "info a.dermis");
}

/// Each command knows the other's file.
#[test]
fn packed_and_unpacked_files_are_told_apart() {
    let folder = folder("packed_or_not");
    json(&folder, "pack a.dermis -o a.packed");
    fails(&folder, "pack a.packed -o again", &["a.packed: is packed already"]);
    fails(&folder, "unpack a.dermis -o again", &["a.dermis: is not packed"]);
}

/// What a command has no use for is not taken in silence.
#[test]
fn options_that_would_do_nothing_are_refused() {
    let folder = folder("foreign_options");
    fs::write(folder.join("mesh.glb"), SmallMesh::pyramid().glb()).expect("it can be written");
    for (paper, option) in [
        ("lodavatar", "--gaussians 500"),
        ("lapisgs", "--mesh-levels 2"),
        ("lapisgs", "--greatest 3"),
        ("formats", "--detail-joints a"),
        ("face-lod", "--greatest 3"),
    ] {
        let name = option.split(' ').next().unwrap_or(option);
        misuses(&folder, &format!("reproduce {paper} mesh.glb {option}"), name);
    }
    let absent = "reproduce lodavatar mesh.glb --detail-joints absent --preset best";
    fails(&folder, absent, &["mesh.glb: ", "has no joints"]);
    misuses(&folder, "reproduce formats --splat a.ply --steps 5", "--steps");
    misuses(&folder, "eval a.dermis --mesh mesh.glb --prefix 5 --budgets 3", "--budgets");
    misuses(&folder, "bench a.dermis --once --stereo", "--stereo");
    misuses(&folder, "bench a.dermis --once --json", "--json");
    misuses(&folder, "--json bench a.dermis --once", "--json");
    misuses(
        &folder,
        "train mesh.glb -o b.dermis --method lodavatar --survey-steps 5",
        "--survey-steps",
    );
    fails(
        &folder,
        "render a.dermis -o out.png --kernel reference --size 4097x4096",
        &["a.dermis: ", "; "],
    );
    misuses(&folder, "train mesh.glb -o b.dermis --method single --levels 2", "--levels");
    // A misspelt key, and a colour of 8 bits.
    let camera = json!({
        "width": 8, "height": 8, "fx": 8, "fy": 8, "cx": 4, "cy": 4,
        "world_to_camera": [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 3, 0, 0, 0, 1],
    });
    for (key, value) in [("backgroud", json!([0, 0, 0])), ("background", json!([0, 0, 255]))] {
        let mut camera = camera.clone();
        camera[key] = value;
        fs::write(folder.join("cam.json"), camera.to_string()).expect("it can be written");
        fails(&folder, "render a.dermis -o out.png --camera cam.json", &["cam.json: ", "; "]);
    }
}

/// A device that never ends, and a pipe that nobody writes to.
#[cfg(unix)]
#[test]
fn what_is_no_file_is_not_read() {
    let folder = folder("devices");
    fs::write(folder.join("mesh.glb"), SmallMesh::pyramid().glb()).expect("it can be written");
    let made = Command::new("mkfifo").arg(folder.join("pipe")).status();
    assert!(made.expect("mkfifo runs").success());
    for path in ["/dev/zero", "pipe"] {
        let said = format!("{path}: is a folder or a device; ");
        for command in ["info", "render -o out.png", "eval --mesh mesh.glb", "bench"] {
            fails(&folder, &format!("{command} {path}"), &[&said]);
        }
        fails(&folder, &format!("train {path} -o out.dermis {TINY}"), &[&said]);
        fails(&folder, &format!("render a.dermis -o out.png --camera {path}"), &[&said]);
    }
}

/// Whoever reads the output may go at any time.
#[test]
fn a_closed_pipe_is_no_failure() {
    let folder = folder("closed_pipe");
    for arguments in [&["info", "a.dermis"][..], &["info", "a.dermis", "--json"]] {
        let mut command = Command::new(dermis());
        command.current_dir(&folder).args(arguments);
        let mut child =
            command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("dermis starts");
        drop(child.stdout.take());
        let output = child.wait_with_output().expect("it ends");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!((output.status.code(), said.as_ref()), (Some(0), ""), "{arguments:?}");
    }
}

#[test]
fn wrong_names_and_numbers() {
    let folder = folder("wrong_names");
    fs::write(folder.join("mesh.glb"), SmallMesh::pyramid().glb()).expect("it can be written");
    let render = "render a.dermis -o out.png";
    fails(&folder, &format!("{render} --clip hover"), &["a.dermis: ", "hover", "wave", "walk"]);
    fails(
        &folder,
        &format!("train mesh.glb -o out.dermis {TINY} --clips fly"),
        &["mesh.glb: ", "fly"],
    );
    fails(&folder, "eval a.dermis --mesh mesh.glb", &["a.dermis: ", "triangles", "; "]);
    for size in ["0x5", "5", "axb", "5x", "-3x4", "99999x10", "10x10x10", "1e3x5"] {
        misuses(&folder, &format!("{render} --size={size}"), "--size");
    }
    for option in
        ["--yaw inf", "--pitch x", "--distance nan", "--level nan", "--clip wave --time nan"]
    {
        let name = option.rsplit(' ').nth(1).unwrap_or(option);
        misuses(&folder, &format!("{render} {option}"), name);
    }
    misuses(&folder, &format!("{render} --budget=-1"), "--budget");
    for distance in ["0", "-1", "-0.0"] {
        misuses(&folder, &format!("{render} --distance={distance}"), "--distance");
    }
    misuses(&folder, &format!("{render} --budget 3 --level 1"), "--level");
    misuses(&folder, &format!("{render} --kernel fast"), "--kernel");
    misuses(&folder, &format!("{render} --time 1"), "--clip");
    misuses(&folder, "render a.dermis", "--output");
    misuses(&folder, "train mesh.glb -o out.dermis --gaussians 0", "--gaussians");
    misuses(&folder, "train mesh.glb -o out.dermis --views 43", "--views");
    misuses(&folder, "train mesh.glb -o out.dermis --preset quick", "--preset");
    misuses(&folder, "train mesh.glb -o out.dermis --random-background 1.1", "--random-background");
    for color in ["1,1", "0,0,2", "black", "0,0,0,0", "nan,0,0"] {
        let eval = "eval a.dermis --mesh mesh.glb --background";
        misuses(&folder, &format!("{eval} {color}"), "--background");
    }
    misuses(
        &folder,
        "train mesh.glb -o out.dermis --method lodavatar --gaussians 5",
        "--gaussians",
    );
    misuses(&folder, "info a.dermis --threads 60000", "--threads");
    misuses(&folder, "info a.dermis --threads 1,2", "--threads");
    // A polygon of 800 triangles, each of which becomes 4 with a level.
    let rim = (0..802).map(|i| i as f32 / 802.0 * std::f32::consts::TAU);
    let mut disc: String = rim.map(|a| format!("v {} {} 0\n", a.cos(), a.sin())).collect();
    disc.push('f');
    (1..=802).for_each(|corner| disc.push_str(&format!(" {corner}")));
    fs::write(folder.join("disc.obj"), disc).expect("it can be written");
    fails(
        &folder,
        "train disc.obj -o out.dermis --method lodavatar --levels 8",
        &["disc.obj: ", "17476802 Gaussians in 8 levels", "; choose fewer --levels"],
    );
    // Its only material is OBJ's default one.
    fails(
        &folder,
        "train disc.obj -o out.dermis --method lodavatar --levels 4 --detail-material default --detail-levels 4",
        &["disc.obj: ", "17476802 Gaussians in 8 levels", "; choose fewer --detail-levels"],
    );
    misuses(&folder, "paint a.dermis", "paint");
    misuses(&folder, "", "Usage");
}

/// A camera that sees one side of the pyramid, and masks: all of its picture, none of it, and a smaller one.
fn write_masks(folder: &Path) {
    // Two metres before the pyramid, upright: +Y is up in the world and down in the camera.
    let camera = json!({
        "width": 40, "height": 30, "fx": 30.0, "fy": 30.0, "cx": 20.0, "cy": 15.0,
        "world_to_camera": [1, 0, 0, 0, 0, -1, 0, 0.5, 0, 0, -1, 3, 0, 0, 0, 1],
    });
    fs::write(folder.join("cam.json"), camera.to_string()).expect("it can be written");
    for (name, size, luma) in
        [("mask.png", [40, 30], 255), ("dark.png", [40, 30], 9), ("small.png", [20, 15], 255)]
    {
        let mask = image::GrayImage::from_pixel(size[0], size[1], image::Luma([luma]));
        mask.save(folder.join(name)).expect("it can be written");
    }
}

#[test]
fn detail_is_chosen_by_masks_and_names() {
    let folder = empty_folder("detail");
    fs::write(folder.join("mesh.glb"), SmallMesh::pyramid().glb()).expect("it can be written");
    let train = format!("train mesh.glb -o out.dermis {TINY}");
    let lodavatar = "train mesh.glb -o out.dermis --preset draft --views 4 --keyframes 1 --size 24 \
                     --method lodavatar";
    misuses(&folder, &format!("{train} --detail-mask mask.png"), "--detail-camera");
    misuses(&folder, &format!("{train} --detail-joints a --detail-levels 1"), "--detail-levels");
    misuses(&folder, &format!("{train} --detail-density 2"), "--detail-density");
    misuses(
        &folder,
        &format!("{train} --detail-joints a --detail-density 0.5"),
        "--detail-density",
    );
    misuses(
        &folder,
        &format!("{lodavatar} --detail-joints a --detail-density 2"),
        "--detail-density",
    );
    fails(&folder, &format!("{train} --detail-joints a"), &["mesh.glb: has no joints; "]);
    fails(&folder, &format!("{train} --detail-material a"), &["mesh.glb: has no material a", "; "]);

    write_masks(&folder);
    let masked = |mask: &str, camera: &str| {
        format!("{lodavatar} --detail-mask {mask} --detail-camera {camera}")
    };
    fails(&folder, &masked("absent.png", "cam.json"), &["absent.png: ", "; "]);
    fails(&folder, &masked("cam.json", "cam.json"), &["cam.json: ", "image", "; "]);
    fails(&folder, &masked("mask.png", "mask.png"), &["mask.png: is not a camera file; "]);
    fails(&folder, &masked("small.png", "cam.json"), &["small.png: is 20×15 px", "40×30", "; "]);
    fails(&folder, &masked("dark.png", "cam.json"), &["dark.png: no triangle", "; "]);
    // 5 vertices, 6 triangles at level 1; one of them looks at the camera, and gets 16 more.
    let value = json(&folder, &masked("mask.png", "cam.json"));
    assert_eq!(value["gaussians"], 5 + 6 * 5 + 16);
}

#[test]
fn regions_are_cut_by_masks_and_names() {
    let folder = empty_folder("regions");
    fs::write(folder.join("mesh.glb"), SmallMesh::pyramid().glb()).expect("it can be written");
    write_masks(&folder);
    let train = format!("train mesh.glb -o out.dermis {TINY}");
    let front = "--region front=mask:mask.png@cam.json";
    for bad in ["front", "=joints:a", "front=joints:", "front=triangles:1", "front=mask:mask.png"] {
        misuses(&folder, &format!("{train} --region {bad}"), "--region <NAME=CHOICE>");
    }
    for bad in ["back=2", "front=0", "front=-1", "front=1e9", "front=NaN", "front", "body=2"] {
        misuses(&folder, &format!("{train} {front} --region-weight {bad}"), "--region-weight");
    }
    let twice = "--region-weight front=2 --region-weight front=3";
    misuses(&folder, &format!("{train} {front} {twice}"), "--region-weight front");
    for (regions, parts) in [
        ("--region a=joints:a", &["mesh.glb: region a: has no joints; "][..]),
        ("--region a=material:a", &["mesh.glb: region a: has no material a", "; "]),
        ("--region a=mask:absent.png@cam.json", &["absent.png: ", "; "]),
        ("--region a=mask:dark.png@cam.json", &["region a: dark.png: no triangle", "; "]),
        ("--region body=mask:mask.png@cam.json", &["region body: is what others leave; "]),
    ] {
        fails(&folder, &format!("{train} {regions}"), parts);
    }
    fails(&folder, &format!("{train} {front} {front}"), &["region front: is there twice; "]);
    let again = "--region again=mask:mask.png@cam.json";
    fails(&folder, &format!("{train} {front} {again}"), &["region again: regions before it", "; "]);
    for method in ["lodavatar --levels 2", "lapisgs", "freeze", "single", "downsample"] {
        let train = format!(
            "train mesh.glb -o out.dermis --preset draft --views 4 --keyframes 1 --size 24 --method {method}"
        );
        fails(&folder, &format!("{train} {front}"), &["mesh.glb: only the method dermis", "; "]);
    }

    fails(
        &folder,
        &format!("{train} --movement tail=0.5"),
        &["mesh.glb: movement of tail: no joint", "; "],
    );
    for bad in ["tail", "tail=-1", "tail=far", "=NaN"] {
        misuses(&folder, &format!("{train} --movement {bad}"), "--movement");
    }

    let steps = "--steps 8 --survey-steps 4";
    let value = json(&folder, &format!("{train} {front} --region-weight front=2 {steps}"));
    let [front, body] = [0, 1].map(|region| &value["regions"][region]);
    assert_eq!((&front["name"], &body["name"]), (&json!("front"), &json!("body")));
    assert_eq!((&front["triangles"], &body["triangles"]), (&json!(1), &json!(5)));
    assert_eq!((&front["weight"], &body["weight"]), (&json!(2.0), &json!(1.0)));
    has_keys(body, "gaussians mobility_m_per_s visible_share residual_share");
    let shares = |key| [front, body].iter().filter_map(|r| r[key].as_f64()).sum::<f64>();
    for key in ["visible_share", "residual_share"] {
        assert!((shares(key) - 1.0).abs() < 1e-6, "{key}: {}", shares(key));
    }
    assert_eq!(shares("gaussians"), 150.0);
    let info = run(&folder, "info out.dermis");
    assert!(info.stdout.contains("region  front: 1 triangles, "), "{info:?}");
    assert!(info.stdout.contains(", weight 2.00; 0.000 m/s, "), "{info:?}");
    for budget in [0, 1, 37, 149] {
        let picture = json(
            &folder,
            &format!("render out.dermis -o {budget}.png --size 16x16 --budget {budget}"),
        );
        assert_eq!(picture["gaussians_selected"], budget);
    }
}

#[test]
fn cameras_are_finite_and_rigid() {
    let folder = folder("cameras");
    let camera = json!({
        "width": 24, "height": 16, "fx": 20.0, "fy": 20.0, "cx": 12.0, "cy": 8.0,
        "world_to_camera": [[1, 0, 0, 0], [0, -1, 0, 1], [0, 0, -1, 3], [0, 0, 0, 1]],
        "background": [0, 0, 0],
    });
    let write = |camera: &Value| {
        fs::write(folder.join("camera.json"), camera.to_string()).expect("it can be written");
    };
    let render = "render a.dermis -o out.png --camera camera.json";
    write(&camera);
    assert!(json(&folder, render)["blends"].as_u64() > Some(0), "the avatar is before the camera");
    fs::remove_file(folder.join("out.png")).expect("it was written");

    let scaled = json!([[2, 0, 0, 0], [0, -2, 0, 1], [0, 0, -2, 3], [0, 0, 0, 1]]);
    let mirrored = json!([[1, 0, 0, 0], [0, 1, 0, 1], [0, 0, -1, 3], [0, 0, 0, 1]]);
    let sheared = json!([[1, 0.1, 0, 0], [0, -1, 0, 1], [0, 0, -1, 3], [0, 0, 0, 1]]);
    let columns = json!([1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0, 1, 3, 1]);
    let far = json!([[1, 0, 0, 1e39], [0, -1, 0, 1], [0, 0, -1, 3], [0, 0, 0, 1]]);
    for (field, value, part) in [
        ("fx", json!(1e39), "finite"),
        ("cy", json!(-1e39), "finite"),
        ("background", json!([0, 1e39, 0]), "finite"),
        ("world_to_camera", far, "finite"),
        ("world_to_camera", scaled, "rotation"),
        ("world_to_camera", mirrored, "rotation"),
        ("world_to_camera", sheared, "rotation"),
        ("world_to_camera", columns, "rotation"),
        ("fy", json!(0), "above 0"),
    ] {
        let mut bad = camera.clone();
        bad[field] = value;
        write(&bad);
        fails(&folder, render, &["camera.json: ", part, "; "]);
    }
}

#[test]
fn small_frames_and_small_budgets_give_right_pictures() {
    let folder = folder("small_frames");
    let picture = |name: &str| image::open(folder.join(name)).expect("it is a PNG").into_rgba8();
    let report = json(&folder, "render a.dermis -o none.png --budget 0 --size 40x30");
    assert_eq!([&report["gaussians_selected"], &report["blends"]], [0, 0]);
    let none = picture("none.png");
    assert_eq!(none.dimensions(), (40, 30));
    assert!(none.pixels().all(|pixel| pixel.0 == [255; 4]), "only background");
    let report = json(&folder, "render a.dermis -o one.png --size 1x1 --distance 0.4");
    assert!(report["blends"].as_u64() > Some(0), "the pixel shows the avatar");
    let one = picture("one.png");
    assert_eq!(one.dimensions(), (1, 1));
    assert_ne!(one.get_pixel(0, 0).0, [255; 4]);
    let report = json(&folder, "render a.dermis -o few.png --budget 7 --size 33x65 --yaw -30");
    assert_eq!(report["gaussians_selected"], 7);
    // The same frame twice has the same checksum, and so has the reference where nothing differs.
    let again = json(&folder, "render a.dermis -o few.png --budget 7 --size 33x65 --yaw -30");
    assert_eq!(report["frame_crc32"], again["frame_crc32"]);
    assert_eq!(names(&folder), ["a.dermis", "few.png", "none.png", "one.png"]);
}

#[test]
fn json_has_the_keys_of_the_design() {
    let folder = folder("json_keys");
    fs::write(folder.join("mesh.glb"), SmallMesh::pyramid().glb()).expect("it can be written");
    const INFO: &str = "bytes bytes_per_gaussian gaussians sh_degree layers regions mesh clips";
    let info = json(&folder, "info a.dermis");
    has_keys(&info, INFO);
    has_keys(&info["layers"][0], "gaussians bytes");
    has_keys(&info["regions"][0], "name triangles gaussians weight");
    has_keys(&info["mesh"], "vertices triangles joints morph_targets");
    has_keys(&info["clips"][0], "name seconds");
    let bytes = fs::metadata(folder.join("a.dermis")).expect("it is there").len();
    assert_eq!(info["bytes"], bytes);

    let render = json(&folder, "render a.dermis -o a.png --clip wave --time 0.4 --size 64x64");
    let keys = "gaussians_selected gaussians_visible blends scratch_bytes level ms frame_crc32";
    has_keys(&render, keys);
    has_keys(&render["ms"], "pose select project sort raster total");

    // Without texture coordinates, too, a mesh trains.
    let train = json(&folder, &format!("train mesh.glb -o b.dermis {TINY}"));
    has_keys(&train, &format!("seconds steps {INFO}"));
    assert_eq!(train["gaussians"], 150);

    let eval = json(&folder, "eval b.dermis --mesh mesh.glb --size 24 --views 2 --budgets 50");
    has_keys(&eval, "views rows");
    let rows = eval["rows"].as_array().expect("rows are a list");
    assert_eq!(rows.len(), 3, "two levels and a budget");
    for row in rows {
        has_keys(
            row,
            "split level budget gaussians bytes views psnr_db psnr_foreground_db ssim flip",
        );
        assert_eq!(row["split"], "novel_view");
    }
    let last = rows[2]["psnr_foreground_db"].as_f64();
    assert!(last > Some(20.0), "a pyramid of one colour is no more than {last:?} dB");
    let whole = &rows[2];

    // The first bytes alone: the last block is missing, or nothing is.
    let shares = "--size 24 --views 2 --prefix 2,80,100";
    let eval = json(&folder, &format!("eval b.dermis --mesh mesh.glb {shares}"));
    assert_eq!(eval["too_short"].as_array().expect("2 % is").as_slice(), [2.0]);
    let rows = eval["rows"].as_array().expect("rows are a list");
    let of = |key: &str| -> Vec<_> { rows.iter().map(|row| row[key].clone()).collect() };
    assert_eq!(of("prefix"), [80.0, 100.0]);
    assert!(rows[0]["gaussians"].as_u64() < Some(150) && rows[0]["gaussians"].as_u64() > Some(0));
    let len = fs::metadata(folder.join("b.dermis")).expect("it is there").len();
    assert!(rows[0]["bytes"].as_u64() <= Some(len * 4 / 5) && rows[1]["bytes"] == len);
    assert_eq!(rows[1]["psnr_foreground_db"], whole["psnr_foreground_db"]);
    fails(&folder, "eval b.dermis --mesh mesh.glb --prefix 2", &["b.dermis: ", " 2 %", "; "]);
    assert_eq!(names(&folder), ["a.dermis", "a.png", "b.dermis", "mesh.glb"]);
}

/// Before backgrounds that training has not seen a picture is worse.
#[test]
fn backgrounds_are_as_asked_for() {
    let folder = empty_folder("backgrounds");
    fs::write(folder.join("mesh.glb"), SmallMesh::pyramid().glb()).expect("it can be written");
    let [never, always] = [0, 1].map(|share| {
        let train = format!("train mesh.glb -o a.dermis {TINY} --steps 120");
        json(&folder, &format!("{train} --random-background {share}"));
        ["", "--background 1,1,1", "--background 0,0,0"].map(|background| {
            let eval = "eval a.dermis --mesh mesh.glb --size 24 --views 4 --budgets 50";
            let eval = json(&folder, &format!("{eval} {background}"));
            let rows = eval["rows"].as_array().expect("rows are a list");
            rows[1]["psnr_foreground_db"].as_f64().expect("a number")
        })
    });
    println!("usual, white, black: {never:.1?} never, {always:.1?} always");
    assert_eq!((never[0], always[0]), (never[1], always[1]));
    let lost_before_black = |[_, white, black]: [f64; 3]| white - black;
    assert!(lost_before_black(always) < lost_before_black(never) - 0.5);
}

#[test]
fn seeds_and_threads_from_outside() {
    let folder = empty_folder("seeds");
    fs::write(folder.join("mesh.glb"), SmallMesh::pyramid().glb()).expect("it can be written");
    let train = |out: &str, more: &str| {
        json(&folder, &format!("train mesh.glb -o {out} {TINY} {more}"));
        fs::read(folder.join(out)).expect("it was written")
    };
    let one = train("one.dermis", "--threads 1");
    assert!(one == train("two.dermis", "--threads 2"), "threads change nothing");
    assert!(one != train("other.dermis", "--seed 2"), "seeds do");
}
