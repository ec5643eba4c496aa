//! Selective detail: counts by LoDAvatar's levels, density in the nested order, choice on a real avatar.

use dermis_runtime::Avatar;
use dermis_tests::files;
use dermis_tests::small::{options, trained_demo};
use dermis_trainer::embed::choice::Choice;
use dermis_trainer::embed::detail::Detail;
use dermis_trainer::embed::hierarchy::{gaussians_at_level, gaussians_of_detail};
use dermis_trainer::import;
use dermis_trainer::methods::Method;
use dermis_trainer::model::Model;
use dermis_trainer::optimize::cloud::Cloud;
use dermis_trainer::options::Options;
use dermis_trainer::scene::{Pose, posed_vertices};
use dermis_trainer::train::Trained;
use glam::Vec3;

fn of_joints(names: &[&str]) -> Detail {
    let joints = names.iter().map(|&name| name.to_owned()).collect();
    Detail { choice: Choice { joints, ..Choice::default() }, ..Detail::default() }
}

fn selected(detail: &Detail, model: &Model) -> Vec<bool> {
    let selected = detail.select(model).expect("the joints are known");
    selected.expect("something is asked for")
}

fn count(selected: &[bool]) -> u64 {
    selected.iter().filter(|selected| **selected).count() as u64
}

#[test]
fn lodavatar_adds_exactly_the_detail_of_chosen_triangles() {
    let detail = Detail { levels: 2, ..of_joints(&["head", "hand_left", "hand_right"]) };
    let options = Options {
        method: Method::Lodavatar,
        levels: 2,
        steps: 8,
        size: 48,
        views: 6,
        key_frames: 1,
        detail,
        ..options(0, 0)
    };
    let (model, Trained { bytes, clouds, steps, .. }) = trained_demo(&options);
    let selected = selected(&options.detail, &model);
    let chosen = count(&selected);
    let avatar = Avatar::parse(&bytes).expect("what was trained is valid");
    let layers: Vec<u64> = (0..4).map(|layer| u64::from(avatar.layer_len(0, layer))).collect();
    let (vertices, triangles) = (model.vertices.len() as u64, model.triangles.len() as u64);
    assert_eq!(layers, [vertices + triangles, 4 * triangles, 16 * chosen, 64 * chosen]);
    let total = gaussians_at_level(vertices, triangles, 1) + gaussians_of_detail(4 * chosen, 2);
    assert_eq!(u64::from(avatar.header().gaussians), total);
    assert_eq!(avatar.header().layers, 4);
    assert_eq!(steps, 8, "all levels share the steps");
    let uniform = (layers[0] + layers[1]) as usize;
    assert!(clouds[0].triangles[uniform..].iter().all(|&triangle| selected[triangle as usize]));
}

/// Gaussians on chosen triangles, and on the others; `triangles` are those that they stand on.
fn split(triangles: &[u32], selected: &[bool]) -> [f64; 2] {
    let on = triangles.iter().filter(|&&triangle| selected[triangle as usize]).count();
    [on, triangles.len() - on].map(|n| n as f64)
}

#[test]
fn chosen_triangles_have_their_density_in_every_prefix() {
    let plain = Options { size: 48, ..options(4000, 2) };
    let options = Options { detail: of_joints(&["head"]), ..plain.clone() };
    let (model, dense) = trained_demo(&options);
    let (_, even) = trained_demo(&plain);
    assert_eq!((dense.clouds[0].len(), even.clouds[0].len()), (4000, 4000), "the total stays");
    let selected = selected(&options.detail, &model);
    // Layers 0 to 2 of a quarter each: prefixes of 250, 1000 and 4000.
    for len in [250, 1000, 4000] {
        let prefix = |cloud: &Cloud| split(&cloud.triangles[..len], &selected);
        let [on, off] = prefix(&dense.clouds[0]);
        let [even_on, even_off] = prefix(&even.clouds[0]);
        let ratio = on / off / (even_on / even_off);
        println!("{len}: {ratio:.2} times the density");
        assert!((3.2..=4.8).contains(&ratio), "{len}: {ratio:.2} times the density");
    }
}

#[test]
fn head_and_hands_of_a_real_human_are_where_they_should_be() {
    let Some(folder) = files::data("head_and_hands_of_a_real_human") else { return };
    let model = import::load(&folder.join("valid_male.glb")).expect("it can be read");
    let selected = selected(&of_joints(&["Head", "LeftHand", "RightHand"]), &model);
    let rest = Pose::rest(&model);
    let (posed, joints) = (posed_vertices(&model, &rest), rest.joint_worlds(&model));
    let place = |name: &str| -> Vec3 {
        let joint = model.joints.iter().position(|joint| joint.name == name);
        joints[joint.expect("the avatar has this joint")].translation.into()
    };
    let hands = ["LeftHand", "RightHand"].map(place);
    let (mut head, mut by_hand) = (0, [0, 0]);
    for (triangle, _) in model.triangles.iter().zip(&selected).filter(|(_, selected)| **selected) {
        let corners = triangle.corners.map(|corner| posed[corner as usize]);
        let centroid = corners.iter().sum::<Vec3>() / 3.0;
        // A hand is about 20 cm long from the wrist on, and a head is around its joint.
        let near = hands.map(|hand| centroid.distance(hand) < 0.25);
        match near {
            [true, _] => by_hand[0] += 1,
            [_, true] => by_hand[1] += 1,
            _ => {
                let off = centroid - place("Head");
                // The hair falls over the neck.
                let is_hair = model.materials[triangle.material as usize].name == "Hair";
                let lowest = if is_hair { -0.3 } else { -0.08 };
                let is_head = off.y > lowest && off.length() < 0.32;
                assert!(is_head, "{centroid} is neither head nor hand");
                head += 1;
            }
        }
    }
    let share = count(&selected) as f64 / selected.len() as f64;
    println!("{share:.3} of the triangles: head {head}, hands {by_hand:?}");
    assert!((0.3..0.6).contains(&share), "{share:.3} of the triangles");
    assert!(head > 500 && by_hand.iter().all(|&hand| hand > 300), "{head}, {by_hand:?}");
    // Level 2 with one more: the count of `dermis train --levels 2 --detail-joints …`.
    let (vertices, triangles) = (model.vertices.len() as u64, model.triangles.len() as u64);
    let uniform = gaussians_at_level(vertices, triangles, 1);
    let detail = gaussians_of_detail(4 * count(&selected), 1);
    println!(
        "{uniform} + {detail} Gaussians; all of level 2: {}",
        gaussians_at_level(vertices, triangles, 2)
    );
}
