//! Steps that an author asks for: as coarse as that, never finer than the codes can be.

use dermis_format::Avatar;
use dermis_format::writer::encode;

use crate::avatars;

/// Morph targets whose author asks for a coarse step lose what is under half of it, and the vertices that move no further.
#[test]
fn steps_of_morph_targets_are_as_coarse_as_is_asked() {
    let mut source = avatars::rigged();
    source.mesh.morph_targets[0].deltas = vec![(1, [0.1, 0.004, -0.2]), (4, [0.004, 0.0, 0.0])];
    for (step, vertices, within) in [(0.0, 2, 1e-5), (1e-9, 2, 1e-5), (0.01, 1, 0.005)] {
        source.mesh.morph_targets[0].step = step;
        let bytes = encode(&source).unwrap();
        let avatar = Avatar::parse(&bytes).unwrap();
        let target = avatar.morph_targets().next().unwrap();
        assert_eq!(target.vertices.iter().count(), vertices, "{step}");
        let found = target.deltas[0].map(|code| f32::from(code.get()) * target.step);
        let wanted = [0.1, 0.004, -0.2];
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() <= within), "{found:?}");
    }
}

#[test]
fn steps_of_vertices_and_clips_are_as_coarse_as_is_asked() {
    let mut source = avatars::rigged();
    // Flat, one side longer than the other.
    source.mesh.positions.iter_mut().for_each(|position| position[2] = 0.25);
    let values = source.rig.clips[0].channels[0].values.clone();
    for step in [0.0, 1e-9, 0.01, 0.3] {
        source.mesh.step = step;
        source.rig.clips[0].channels[0].step = step;
        let bytes = encode(&source).unwrap();
        let avatar = Avatar::parse(&bytes).unwrap();
        let off = |here: f32, there: f32| (here - there).abs() <= 0.5 * step.max(1e-4) * 1.001;
        for (vertex, wanted) in source.mesh.positions.iter().enumerate() {
            let found = avatar.vertex_position(vertex);
            assert!((0..3).all(|i| off(found[i], wanted[i])), "{step}: {found:?}, {wanted:?}");
        }
        let clip = avatar.clips().next().unwrap();
        let channel = clip.channels().next().unwrap();
        let width = channel.property.width();
        for (at, &wanted) in values.iter().enumerate() {
            let found = channel.value(at / width, at % width);
            assert!(off(found, wanted), "{step}: {found}, {wanted}");
        }
    }
}
