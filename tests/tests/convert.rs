//! Trained Gaussians of other programs, converted: the same pictures, from files of every shape.

use std::fs;
use std::path::Path;

use dermis_runtime::{Avatar, Camera, Plan, Pose};
use dermis_tests::converted::{
    ALL, exact, orbit_at_rest, psnr_at_rest, real_file_keeps_its_pictures,
};
use dermis_tests::files::{self, written};
use dermis_tests::splats::SplatPly;
use dermis_trainer::convert::{self, LeftOut};
use dermis_trainer::draw::draw;
use dermis_trainer::mannequin;

fn converted(path: &Path) -> Vec<u8> {
    let (splats, left_out) = convert::read(path, None).unwrap_or_else(|error| panic!("{error:#}"));
    assert_eq!(left_out, LeftOut::default());
    convert::pack(splats).expect("what can be read can be packed")
}

#[test]
fn every_degree_keeps_its_pictures() {
    let folder = files::empty_folder("convert_degrees");
    for degree in 0..=3 {
        let ply = SplatPly::random(700, degree, 5);
        let bytes = converted(&written(&folder, "a.ply", ply.bytes()));
        let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
        let header = avatar.header();
        assert_eq!((header.gaussians, usize::from(header.harmonics_degree)), (700, degree));
        // From outside, and from between them.
        for (yaw, pitch, distance) in
            [(0.0, 0.0, None), (140.0, -35.0, None), (70.0, 20.0, Some(0.2))]
        {
            let camera = orbit_at_rest(&avatar, yaw, pitch, distance, 160);
            let db = psnr_at_rest(&avatar, ALL, &exact(&ply, &camera), &camera);
            println!("degree {degree} from {yaw}°: {db:.2} dB");
            assert!(db > 45.0, "degree {degree} from {yaw}°: {db:.2} dB");
        }
    }
}

#[test]
fn the_shape_of_the_file_does_not_matter() {
    let folder = files::empty_folder("convert_shapes");
    let ply = SplatPly::random(300, 2, 9);
    let expected = converted(&written(&folder, "plain.ply", ply.bytes()));
    let same = |name: &str, bytes: &[u8]| {
        assert!(converted(&written(&folder, name, bytes)) == expected, "{name}");
    };
    same("shuffled.ply", &ply.shuffled(4).bytes());
    same("ascii.ply", ply.ascii().as_bytes());
    same("ascii_crlf.ply", ply.ascii().replace('\n', "\r\n").as_bytes());
    let numbers = || ply.rows.iter().flatten();
    let mut big = ply.header("binary_big_endian", "float32").into_bytes();
    big.extend(numbers().flat_map(|x| x.to_be_bytes()));
    same("big_endian.ply", &big);
    let mut doubles = ply.header("binary_little_endian", "double").into_bytes();
    doubles.extend(numbers().flat_map(|x| f64::from(*x).to_le_bytes()));
    same("doubles.ply", &doubles);

    // Other elements before and behind, with lists; properties nobody knows.
    let head = ply.header("binary_little_endian", "float");
    let (format, vertex) = head.split_at(head.find("element").expect("it has an element"));
    let (vertex, end) = vertex.split_at(vertex.find("end_header").expect("it ends"));
    let mut more = format!(
        "{format}comment made by a test\nelement camera 2\nproperty uchar kind\n\
         property list uchar double views\nelement nothing 4000000000\n{vertex}\
         property list uint ushort neighbours\nproperty uchar label\n\
         element face 1\nproperty list uchar int vertex_indices\n{end}"
    )
    .into_bytes();
    more.extend([7, 0, 8, 2]);
    more.extend([1.5f64, 2.5].map(f64::to_le_bytes).concat());
    for row in &ply.rows {
        more.extend(row.iter().flat_map(|x| x.to_le_bytes()));
        more.extend([2, 0, 0, 0, 1, 2, 3, 4, 9]);
    }
    more.extend([1, 5, 0, 0, 0]);
    same("more.ply", &more);

    // Whole numbers where they will do.
    let whole = (0..300).fold(ply, |ply, row| ply.with(row, "opacity", (row % 4) as f32));
    let floats = converted(&written(&folder, "floats.ply", whole.bytes()));
    let text = whole.ascii().replace("float opacity", "short opacity");
    assert!(converted(&written(&folder, "shorts.ply", text)) == floats, "opacity in shorts");
}

#[test]
fn a_half_turn_shows_the_same_to_a_camera_that_turns_with_it() {
    let folder = files::empty_folder("convert_turned");
    let ply = SplatPly::random(500, 3, 4);
    let path = written(&folder, "a.ply", ply.bytes());
    let (mut splats, _) = convert::read(&path, None).expect("it can be read");
    let as_read = splats.clone();
    splats.half_turn();
    let turned = convert::pack(splats.clone()).expect("it can be packed");
    let turned = Avatar::parse(&turned).expect("what was packed is valid");
    for yaw in [20.0, 110.0, 250.0] {
        let camera = orbit_at_rest(&turned, yaw, 25.0, None, 160);
        let world_to_camera = camera.world_to_camera.map(|[x, y, z, t]| [x, -y, -z, t]);
        let of_file = exact(&ply, &Camera { world_to_camera, ..camera });
        let db = psnr_at_rest(&turned, ALL, &of_file, &camera);
        assert!(db > 45.0, "{db:.2} dB");
    }
    splats.half_turn();
    assert!(splats == as_read, "and back");
}

#[test]
fn what_is_never_seen_is_left_out() {
    let folder = files::empty_folder("convert_left_out");
    let ply = SplatPly::random(40, 1, 2)
        .with(3, "opacity", -9.0)
        .with(5, "opacity", f32::NEG_INFINITY)
        .with(7, "x", f32::NAN)
        .with(9, "f_rest_2", f32::INFINITY)
        .with(11, "scale_1", 80.0)
        // These are seen: opaque, flat, a point, not turned.
        .with(13, "opacity", f32::INFINITY)
        .with(15, "scale_2", f32::NEG_INFINITY)
        .with(17, "scale_0", -300.0);
    let ply = (0..4).fold(ply, |ply, i| ply.with(19, &format!("rot_{i}"), 0.0));
    let path = written(&folder, "a.ply", ply.bytes());
    let (splats, left_out) = convert::read(&path, None).expect("it can be read");
    assert_eq!(left_out, LeftOut { faint: 2, wild: 3 });
    assert_eq!(splats.gaussians.len(), 35);
    let bytes = convert::pack(splats).expect("it can be packed");
    let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
    let camera = orbit_at_rest(&avatar, 0.0, 0.0, None, 100);
    let kept: Vec<Vec<f32>> =
        (0..40).filter(|i| ![3, 5, 7, 9, 11].contains(i)).map(|i| ply.rows[i].clone()).collect();
    // The formulas' quaternion of length 0 is the identity.
    let ply = SplatPly { rows: kept, ..ply };
    let ply = ply.with(14, "rot_0", 1.0);
    let db = psnr_at_rest(&avatar, ALL, &exact(&ply, &camera), &camera);
    assert!(db > 45.0, "{db:.2} dB");
}

#[test]
fn damaged_files_neither_panic_nor_hang() {
    let folder = files::empty_folder("convert_damaged");
    let ply = SplatPly::random(4, 0, 1);
    let path = folder.join("a.ply");
    for whole in [ply.bytes(), ply.ascii().into_bytes()] {
        for len in 0..whole.len() {
            fs::write(&path, &whole[..len]).expect("it can be written");
            let read = convert::read(&path, None);
            // A number of a text may lose its end and still be one.
            let text = whole.starts_with(b"ply\nformat ascii") && len > whole.len() - 20;
            assert!(read.is_err() || text, "{len} of {} bytes", whole.len());
        }
        for place in 0..whole.len() {
            let mut flipped = whole.clone();
            flipped[place] ^= 1 << (place % 8);
            fs::write(&path, flipped).expect("it can be written");
            if let Ok((splats, _)) = convert::read(&path, None) {
                convert::pack(splats).expect("what can be read can be packed");
            }
        }
    }
}

#[test]
fn one_gaussian_has_a_picture() {
    let folder = files::empty_folder("convert_one");
    let ply = SplatPly::random(1, 0, 3).with(0, "opacity", 3.0);
    let bytes = converted(&written(&folder, "a.ply", ply.bytes()));
    let avatar = Avatar::parse(&bytes).expect("what was packed is valid");
    let camera = orbit_at_rest(&avatar, 30.0, 10.0, None, 64);
    let db = psnr_at_rest(&avatar, ALL, &exact(&ply, &camera), &camera);
    assert!(db > 45.0, "{db:.2} dB");
}

#[test]
fn real_files_keep_their_pictures() {
    let Some(folder) = files::data("real_files_keep_their_pictures") else { return };
    for level in 3..=6 {
        let name = format!("playbot_lod{level}.ply");
        let path = folder.join("splats").join(&name);
        let ply = SplatPly::parse(&fs::read(&path).expect("it is there"));
        real_file_keeps_its_pictures(&name, &ply, &path, 2.5);
    }
    let plant = fs::read(folder.join("splats/plant.splat")).expect("it is there");
    let ply = SplatPly::of_splat_file(&plant);
    let path = written(&files::empty_folder("convert_plant"), "plant.ply", ply.bytes());
    real_file_keeps_its_pictures("plant", &ply, &path, 1.3);
}

#[test]
fn the_mannequin_is_the_same_everywhere_and_closed_at_every_count() {
    let bytes = mannequin::avatar(5000).expect("it can be made");
    assert!(bytes == mannequin::avatar(5000).expect("as before"), "the same bytes again");
    let shot = mannequin::camera(2.0, 135);
    let picture = |bytes: &[u8], budget| {
        let avatar = Avatar::parse(bytes).expect("what was packed is valid");
        let plan = Plan::with_budget(&avatar, budget);
        let drawn = draw(&avatar, &Pose::Rest, &plan, &shot.camera, shot.background);
        drawn.expect("it can be drawn").rgba
    };
    let drawn = picture(&bytes, ALL);
    dermis_tests::golden::check("mannequin", &drawn, 135, 135);
    let covered = |rgba: &[u8]| {
        let dark = rgba.as_chunks::<4>().0.iter().filter(|p| p[..3].iter().all(|&c| c < 225));
        dark.count() as f64
    };
    let other = mannequin::avatar(20_000).expect("it can be made");
    let full = covered(&picture(&other, ALL));
    for (bytes, budget) in [(&bytes, ALL), (&other, 10_000), (&other, 5000)] {
        let share = covered(&picture(bytes, budget)) / full;
        assert!((0.8..1.25).contains(&share), "{share} of the silhouette at {budget}");
    }
}
