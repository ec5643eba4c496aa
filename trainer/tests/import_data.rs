//! Every mesh of the shared data loads, with the counts and boxes of its inventory, and no
//! damage to a file makes the importers panic.

use dermis_trainer::import;
use dermis_trainer::model::Model;
use glam::{Affine3A, Vec3};
use std::io::Write;
use std::path::{Path, PathBuf};

/// The shared data, or `None` where it is absent; under CI, where it should be there, that fails.
fn data() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = std::env::var_os("DERMIS_DATA").map_or(beside, PathBuf::from);
    if !folder.is_dir() {
        let under_ci = std::env::var_os("CI").is_some();
        assert!(!under_ci, "no test data at {}; set DERMIS_DATA", folder.display());
        // Not by a macro: those are captured from tests that pass.
        let mut stderr = std::io::stderr().lock();
        writeln!(stderr, "SKIPPED: no test data at {}; set DERMIS_DATA", folder.display())
            .expect("stderr takes a line");
        return None;
    }
    Some(folder)
}

/// Positions at rest: Σ wᵢ · world(jointᵢ) · inverseᵢ · p.
fn rest_positions(model: &Model) -> Vec<Vec3> {
    let mut worlds: Vec<Affine3A> = Vec::new();
    for joint in &model.joints {
        let rest = joint.rest;
        let local =
            Affine3A::from_scale_rotation_translation(rest.scale, rest.rotation, rest.translation);
        worlds.push(joint.parent.map_or(local, |parent| worlds[usize::from(parent)] * local));
    }
    let place = |vertex: &dermis_trainer::model::Vertex| {
        if model.binds.is_empty() {
            return vertex.position;
        }
        let moved = vertex.influences.iter().map(|&(bind, weight)| {
            let bind = model.binds[usize::from(bind)];
            let matrix = worlds[usize::from(bind.joint)] * bind.inverse;
            matrix.transform_point3(vertex.position) * weight
        });
        moved.sum()
    };
    model.vertices.iter().map(place).collect()
}

fn check_invariants(model: &Model, file: &str) {
    let vertices = model.vertices.len();
    for vertex in &model.vertices {
        let sum: f32 = vertex.influences.iter().map(|influence| influence.1).sum();
        let expected = if model.binds.is_empty() { 0.0 } else { 1.0 };
        assert!((sum - expected).abs() < 1e-5, "{file}: weights add up to {sum}");
    }
    for triangle in &model.triangles {
        assert!(triangle.corners.iter().all(|&corner| (corner as usize) < vertices), "{file}");
        assert!((triangle.material as usize) < model.materials.len(), "{file}");
    }
    for (index, joint) in model.joints.iter().enumerate() {
        assert!(joint.parent.is_none_or(|parent| usize::from(parent) < index), "{file}");
    }
    for target in &model.morph_targets {
        assert!(target.deltas.is_sorted_by(|a, b| a.0 < b.0), "{file}: {}", target.name);
    }
    for channel in model.clips.iter().flat_map(|clip| &clip.channels) {
        assert!(channel.times.is_sorted_by(|a, b| a < b) && !channel.times.is_empty(), "{file}");
    }
    let used: std::collections::HashSet<u16> = model
        .vertices
        .iter()
        .flat_map(|v| v.influences)
        .filter(|i| i.1 > 0.0)
        .map(|i| i.0)
        .collect();
    assert_eq!(used.len(), model.binds.len(), "{file}: every bind is used");
}

/// File; vertices, triangles, morph targets, clips, textures; box at rest, x, y, z.
type Row = (&'static str, [usize; 5], [[f32; 2]; 3]);

#[rustfmt::skip]
const INVENTORY: [Row; 14] = [
    ("CesiumMan.glb", [3273, 4672, 0, 1, 1], [[-0.569, 0.569], [0.0, 1.507], [-0.131, 0.181]]),
    ("Fox.glb", [1728, 576, 0, 3, 1], [[-12.593, 12.593], [-0.122, 78.907], [-88.095, 66.625]]),
    ("MorphStressTest.gltf", [1528, 2412, 8, 3, 2], [[-2.0, 2.0], [-0.1, 0.5], [-0.5, 0.5]]),
    ("SimpleSkin.gltf", [10, 8, 0, 1, 0], [[-0.5, 0.5], [0.0, 2.0], [0.0, 0.0]]),
    ("greenman.glb", [196, 356, 0, 4, 1], [[-1.36, 1.36], [-0.042, 1.99], [-0.723, 0.726]]),
    ("hand_left.glb", [1360, 2314, 0, 0, 0], [[-0.057, 0.02], [-0.134, 0.078], [-0.08, 0.066]]),
    ("kaykit_knight.glb", [7024, 6952, 0, 76, 1], [[-1.303, 1.387], [0.0, 2.467], [-0.579, 1.998]]),
    ("mannequiny.glb", [10366, 13932, 0, 10, 0], [[-0.65, 0.685], [0.294, 1.8], [-0.017, 0.641]]),
    ("robot_expressive.glb", [7218, 3238, 0, 14, 0], [[-3.312, 3.309], [-0.02, 4.539], [-1.308, 1.308]]),
    ("valid_hand_left.glb", [2674, 4870, 0, 1, 1], [[0.669, 0.869], [1.398, 1.487], [-0.028, 0.101]]),
    ("valid_head_female.glb", [6221, 11686, 65, 2, 2], [[-0.123, 0.12], [1.284, 1.738], [-0.101, 0.167]]),
    ("valid_male.glb", [7505, 13605, 12, 3, 2], [[-0.868, 0.869], [0.0, 1.805], [-0.131, 0.248]]),
    // 65 of the body and 31 of the lower teeth; the box is the derived file's.
    ("valid_male_original.glb", [36760, 68120, 96, 0, 2], [[-0.868, 0.869], [0.0, 1.805], [-0.131, 0.248]]),
    ("obj/valid_male.obj", [7505, 13605, 0, 0, 2], [[-0.868, 0.869], [0.0, 1.805], [-0.131, 0.248]]),
];

#[test]
fn every_mesh_of_the_inventory_loads() {
    let Some(folder) = data() else { return };
    for (file, counts, extent) in INVENTORY {
        let model = import::load(&folder.join(file)).unwrap_or_else(|error| panic!("{error:#}"));
        let read = [
            model.vertices.len(),
            model.triangles.len(),
            model.morph_targets.len(),
            model.clips.len(),
            model.textures.len(),
        ];
        eprintln!("{file}: {} joints, {} binds", model.joints.len(), model.binds.len());
        assert_eq!(read, counts, "{file}");
        check_invariants(&model, file);
        let positions = rest_positions(&model);
        let low = positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let high = positions.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        for axis in 0..3 {
            let [from, to] = extent[axis];
            // The inventory has three decimals.
            let near = (low[axis] - from).abs() < 2e-3 && (high[axis] - to).abs() < 2e-3;
            assert!(near, "{file}: axis {axis} is {}..{}", low[axis], high[axis]);
        }
    }
}

#[test]
fn skins_with_the_same_rest_pose_share_their_binds() {
    let Some(folder) = data() else { return };
    let model = import::load(&folder.join("valid_male.glb")).unwrap();
    assert!(model.binds.len() <= 84, "4 skins of 84 joints became {} binds", model.binds.len());
    let stray = model.vertices.iter().any(|v| v.position.abs().max_element() > 3.0);
    assert!(!stray, "bind space is in metres");
}

#[test]
fn compressed_and_plain_files_agree() {
    let Some(folder) = data() else { return };
    let plain = import::load(&folder.join("valid_male.glb")).unwrap();
    let packed = import::load(&folder.join("valid_male_original.glb")).unwrap();
    let name = &plain.morph_targets[0].name;
    assert!(packed.morph_targets.iter().any(|target| target.name == *name), "{name}");
    assert_eq!(plain.materials.len(), packed.materials.len());
    let size =
        |model: &Model| model.textures.iter().map(|t| t.image.dimensions()).collect::<Vec<_>>();
    assert_eq!(size(&plain), size(&packed));
}

/// Loads damaged bytes; an error is one line that begins with the path.
fn load_damaged(bytes: &[u8], path: &Path) {
    std::fs::write(path, bytes).unwrap();
    match import::load(path) {
        Ok(model) => check_invariants(&model, "damaged"),
        Err(error) => {
            let line = format!("{error:#}");
            assert!(line.starts_with(&path.display().to_string()), "{line}");
            assert_eq!(line.lines().count(), 1, "{line}");
        }
    }
}

#[test]
fn files_cut_short_do_not_panic() {
    let Some(folder) = data() else { return };
    let temporary = tempfile::tempdir().unwrap();
    for (file, step) in
        [("greenman.glb", 997), ("SimpleSkin.gltf", 7), ("obj/valid_male.obj", 40_009)]
    {
        let bytes = std::fs::read(folder.join(file)).unwrap();
        let path = temporary.path().join(Path::new(file).file_name().unwrap());
        for length in (0..bytes.len()).step_by(step).chain(0..48) {
            load_damaged(&bytes[..length], &path);
            let glb = file.ends_with(".glb");
            assert!(!glb || import::load(&path).is_err(), "{length} bytes of a GLB are no GLB");
        }
    }
}

#[test]
fn flipped_bytes_do_not_panic() {
    let Some(folder) = data() else { return };
    let temporary = tempfile::tempdir().unwrap();
    let files = [
        ("greenman.glb", 300),
        ("SimpleSkin.gltf", 3000),
        ("valid_male_original.glb", 6),
        ("obj/valid_male.obj", 10),
    ];
    // A linear congruential generator (Knuth's MMIX constants) keeps failures repeatable.
    let mut state = 1u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize % below
    };
    for (file, runs) in files {
        let bytes = std::fs::read(folder.join(file)).unwrap();
        let path = temporary.path().join(Path::new(file).file_name().unwrap());
        // JSON stands first, and damage there is the more telling.
        let json = bytes.len().min(20_000);
        for _ in 0..runs {
            let mut damaged = bytes.clone();
            for _ in 0..=random(3) {
                let reach = if random(2) == 0 { json } else { bytes.len() };
                let at = random(reach);
                damaged[at] = match random(3) {
                    0 => b'0' + random(10) as u8,
                    1 => damaged[at] ^ 1 << random(8),
                    _ => random(256) as u8,
                };
            }
            load_damaged(&damaged, &path);
        }
    }
}

/// The JSON of a glTF or GLB file, and what follows it.
fn split(bytes: &[u8]) -> (String, &[u8]) {
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    if !bytes.starts_with(b"glTF") {
        return (text(bytes), &[]);
    }
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    (text(&bytes[20..20 + length]), &bytes[20 + length..])
}

/// A GLB of that JSON, if anything follows it, else the JSON.
fn join(json: &str, rest: &[u8]) -> Vec<u8> {
    if rest.is_empty() {
        return json.as_bytes().to_vec();
    }
    let mut json = json.to_owned();
    json.extend(std::iter::repeat_n(' ', json.len().next_multiple_of(4) - json.len()));
    let total = (20 + json.len() + rest.len()) as u32;
    let length = (json.len() as u32).to_le_bytes();
    [
        b"glTF",
        &2u32.to_le_bytes()[..],
        &total.to_le_bytes(),
        &length,
        b"JSON",
        json.as_bytes(),
        rest,
    ]
    .concat()
}

#[test]
fn lies_in_the_json_do_not_panic() {
    let Some(folder) = data() else { return };
    let temporary = tempfile::tempdir().unwrap();
    let lies =
        ["0", "1", "2", "255", "-1", "1.5", "65536", "4294967295", "18446744073709551615", "1e39"];
    for (file, step) in
        [("SimpleSkin.gltf", 1), ("greenman.glb", 5), ("valid_male_original.glb", 150)]
    {
        let bytes = std::fs::read(folder.join(file)).unwrap();
        let (json, rest) = split(&bytes);
        let path = temporary.path().join(file);
        // Numbers stand after these; digits in names and base64 do not.
        let starts = json.match_indices([':', ',', '[']).map(|(at, _)| at + 1);
        let numbers = starts.filter_map(|start| {
            let skipped = json[start..].find(|c: char| !c.is_whitespace())? + start;
            let length =
                json[skipped..].find(|c: char| !c.is_ascii_digit() && !"+-.e".contains(c))?;
            (length > 0).then_some(skipped..skipped + length)
        });
        for (index, number) in numbers.enumerate().filter(|(index, _)| index % step == 0) {
            let mut lying = json.clone();
            lying.replace_range(number, lies[index / step % lies.len()]);
            load_damaged(&join(&lying, rest), &path);
        }
    }
}
