//! A file's vertices move as the model's do: positions, skin weights, morph targets and clips are rounded to what nobody sees.

use dermis_format::Avatar;
use dermis_runtime::{Kernel, Pose, Posed};
use dermis_tests::files;
use dermis_trainer::demo::demo_avatar;
use dermis_trainer::model::Model;
use dermis_trainer::scene::{self, Bounds, posed_vertices};
use dermis_trainer::{clips, import, package};
use glam::Vec3;

/// Moments of each clip, all at keys: there nothing is interpolated.
const MOMENTS: usize = 9;

/// How far vertices are off, to the longest side of the rest pose: root mean square of the worst moment, and greatest.
fn off(model: &Model) -> [f64; 2] {
    let bytes = package::encode(&package::rigged_mesh(model)).expect("it can be written");
    let avatar = Avatar::parse(&bytes).expect("it is valid");
    let mut scratch = vec![0; Posed::scratch_len(&avatar)];
    let rest = posed_vertices(model, &scene::Pose::rest(model));
    let Bounds { min, max } = Bounds::of(&rest);
    let side = f64::from((max - min).max_element());
    let mut compare = |here: &Pose<'_>, there: &scene::Pose| {
        let posed = Posed::new(&avatar, here, Kernel::detect(), &mut scratch);
        let posed = posed.expect("it can be posed");
        let truth = posed_vertices(model, there);
        assert_eq!(posed.vertices().len(), truth.len());
        for triangle in &model.triangles {
            let corners = triangle.corners.map(|corner| corner as usize);
            let normal = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a);
            let stored = normal(corners.map(|corner| Vec3::from(posed.vertices()[corner])));
            let exact = normal(corners.map(|corner| truth[corner]));
            // What has a width of three steps keeps its front.
            let longest = (0..3).map(|i| truth[corners[i]].distance(truth[corners[(i + 1) % 3]]));
            let width = exact.length() / longest.fold(f32::MIN_POSITIVE, f32::max);
            if f64::from(width) > f64::from(3.0 * package::MESH_STEP) * side {
                assert!(stored.dot(exact) > 0.0, "a triangle has turned round");
            }
        }
        let squares = posed.vertices().iter().zip(&truth).map(|(here, there)| {
            let there = there.to_array();
            (0..3).map(|i| f64::from(here[i] - there[i]).powi(2)).sum::<f64>()
        });
        let squares: Vec<f64> = squares.collect();
        let mean = squares.iter().sum::<f64>() / squares.len() as f64;
        [mean.sqrt() / side, squares.iter().copied().fold(0.0, f64::max).sqrt() / side]
    };
    let mut worst = compare(&Pose::Rest, &scene::Pose::rest(model));
    for (index, clip) in model.clips.iter().enumerate() {
        let last = clips::last_key(clip.seconds);
        for moment in 0..MOMENTS {
            let seconds = clip.seconds * (moment * last / MOMENTS) as f32 / last as f32;
            let pose = Pose::Clip { clip: index, seconds };
            let of_moment = compare(&pose, &scene::Pose::of_clip(model, index, seconds));
            worst = [0, 1].map(|i| worst[i].max(of_moment[i]));
        }
    }
    worst
}

fn check(name: &str, model: &Model) {
    let [mean, greatest] = off(model);
    println!("{name}: {mean:.2e} of its side, {greatest:.2e} at most");
    // A twentieth of a pixel where the side is 540 px long; single vertices a third, most of it by weights in 1/255.
    assert!(mean < 0.05 / 540.0 && greatest < 0.33 / 540.0, "{name}: {mean:.2e}, {greatest:.2e}");
}

#[test]
fn the_demo_moves_as_its_model() {
    check("demo", &demo_avatar());
}

#[test]
fn real_avatars_move_as_their_models() {
    let Some(folder) = files::data("real_avatars_move") else { return };
    for name in [
        "valid_male.glb",
        "valid_head_female.glb",
        "CesiumMan.glb",
        "mannequiny.glb",
        "robot_expressive.glb",
        "kaykit_knight.glb",
        "Fox.glb",
        "MorphStressTest.gltf",
    ] {
        let model = import::load(&folder.join(name)).unwrap_or_else(|error| panic!("{error:#}"));
        check(name, &model);
    }
}
