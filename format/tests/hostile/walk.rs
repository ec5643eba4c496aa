//! A walk over all that a reader offers. The fuzzer (`tests/fuzz`) takes this file, too.

use dermis_format::curves::{MAX_OCTAVES, stops};
use dermis_format::{Avatar, Block, Discs, FrameKind, Levels, Records};

/// Reads everything there is, within and beyond its ends, and asserts that it is finite and in range.
pub(crate) fn walk(avatar: &Avatar<'_>) {
    let header = avatar.header();
    let (vertices, triangles) = (header.vertices as usize, header.triangles as usize);
    for index in (0..vertices).chain([vertices, usize::MAX]) {
        assert!(avatar.vertex_position(index).iter().all(|x| x.is_finite()));
        for (bind, _) in avatar.influences(index) {
            assert!(bind == 0 || bind < u32::from(header.binds));
        }
    }
    for index in (0..triangles).chain([triangles, usize::MAX]) {
        assert!(avatar.triangle(index).iter().all(|&v| v == 0 || v < header.vertices));
        assert!(avatar.triangle_region(index) < header.regions);
        let sixteen = avatar.two_sided_of_sixteen(index / 16);
        assert_eq!(avatar.is_two_sided(index), sixteen >> (index % 16) & 1 == 1);
    }
    assert_eq!(avatar.region_names().count(), usize::from(header.regions));
    assert!([0, usize::from(header.joints)].contains(&avatar.joint_names().count()));
    let regions = usize::from(header.regions);
    let sum: u64 = (0..regions).map(|region| u64::from(avatar.region_len(region))).sum();
    assert_eq!(sum, u64::from(header.gaussians));
    for (region, layer) in
        [(0, usize::MAX), (usize::MAX, 0), (0, header.layers.into()), (regions, 0)]
    {
        assert_eq!(avatar.layer_len(region, layer), 0);
    }
    assert!([0, regions].contains(&avatar.importances().len()));
    for region in (0..regions).chain([regions, usize::MAX]) {
        assert!((0.0..=1000.0).contains(&avatar.region_weight(region)));
    }
    if let Some(curves) = avatar.curves() {
        let stops = stops(header.layers.into());
        assert!(curves.density() > 0.0 && (1..=MAX_OCTAVES).contains(&curves.octaves()));
        for region in (0..regions).chain([regions, usize::MAX]) {
            for (octave, stop) in [(0, 0), (curves.octaves() - 1, stops - 1)] {
                let point = curves.point(region, octave, stop);
                assert_eq!(point.is_some(), region < regions);
                assert!(point.is_none_or(|p| (0.0..=1e6).contains(&p.error)));
            }
        }
        for (octave, stop) in [(curves.octaves(), 0), (0, stops), (usize::MAX, usize::MAX)] {
            assert_eq!(curves.point(0, octave, stop), None);
        }
    }
    if let Some(samples) = avatar.samples() {
        let triangles: Vec<u32> = samples.iter().map(|sample| sample.triangle).collect();
        assert!(triangles.is_sorted() && triangles.iter().all(|&t| t < header.triangles));
        let mut numbers = samples.iter().flat_map(|sample| [sample.area, sample.fill]);
        assert!(numbers.all(|number| (0.0..=1e6).contains(&number)));
    }
    if let Some(movements) = avatar.movements() {
        let lens = [header.joints, header.morph_targets, header.clips].map(usize::from);
        let of = |kind: usize, index: usize| match kind {
            0 => movements.of_joint(index),
            1 => movements.of_target(index),
            _ => movements.of_clip(index),
        };
        for (kind, len) in lens.into_iter().enumerate() {
            for index in (0..len).chain([len, usize::MAX]) {
                let number = of(kind, index);
                assert_eq!(number.is_some(), index < len);
                assert!(number.is_none_or(|number| (0.0..=1e6).contains(&number)));
            }
        }
    }
    walk_rig(avatar);
    let mut gaussians = 0;
    for block in avatar.blocks() {
        assert!(block.region < header.regions && block.layer < header.layers);
        assert_eq!(block.opacities.len(), block.count as usize * block.later_levels);
        assert_eq!(block.harmonics.len(), block.count as usize * header.harmonics() * 3);
        assert!(block.below.is_none());
        let triangles: Vec<u32> = block.triangles.iter().collect();
        let bound = if header.frame == FrameKind::World { 0 } else { block.count as usize };
        assert_eq!(triangles.len(), bound);
        assert!(triangles.is_sorted() && triangles.iter().all(|&t| t < header.triangles));
        gaussians += walk_records(&block.records);
    }
    let present: u32 = (0..regions).map(|region| avatar.present(region)).sum();
    assert_eq!(gaussians, present);
    for level in avatar.levels() {
        assert!(level.region < header.regions && level.level < header.layers);
        assert_eq!(walk_discs(&level.discs), level.count);
    }
    assert!(avatar.sections().count() >= avatar.blocks().count() + avatar.levels().count());
    // Between any two levels, in sense or not, there are as many.
    for upper in [0, 1, 2, header.layers - 1, u8::MAX] {
        for lower in [None, Some(0), Some(1), Some(upper)] {
            let blocks = avatar.blocks_at(|_| Levels { upper, lower });
            assert!(blocks.zip(avatar.blocks()).all(|(at, block)| walk_at(&at, &block)));
            assert_eq!(
                avatar.blocks_at(|_| Levels { upper, lower }).count(),
                avatar.blocks().count()
            );
        }
    }
}

/// Whether a block at a level has the Gaussians of the block.
fn walk_at(at: &Block<'_>, block: &Block<'_>) -> bool {
    assert_eq!(walk_records(&at.records), block.count);
    if let Some(below) = &at.below {
        assert_eq!(walk_discs(below), block.count);
    }
    assert!(at.triangles.iter().eq(block.triangles.iter()));
    (at.region, at.layer, at.first, at.count)
        == (block.region, block.layer, block.first, block.count)
}

/// Decodes all Gaussians, and says how many.
fn walk_records(records: &Records<'_>) -> u32 {
    let Records::Full(fulls) = records else {
        let Records::Disc(discs) = records else { return 0 };
        return walk_discs(discs);
    };
    assert!(fulls.groups.iter().all(|group| group.harmonics_step.get().is_finite()));
    for f in fulls.iter() {
        let length2: f32 = f.rotation.iter().map(|x| x * x).sum();
        assert!((0.99..1.52).contains(&length2), "{:?}", f.rotation);
        let numbers =
            [&f.position[..], &f.rotation, &f.log2_scale, &f.color, &[f.opacity]].concat();
        assert!(numbers.iter().all(|x| x.is_finite()), "{numbers:?}");
    }
    assert!(fulls.get(fulls.records.len()).is_none() && fulls.get(usize::MAX).is_none());
    fulls.iter().count() as u32
}

fn walk_discs(discs: &Discs<'_>) -> u32 {
    for (index, d) in discs.iter().enumerate() {
        let numbers = [&d.position[..], &[d.angle], &d.log2_scale, &d.color, &[d.opacity]].concat();
        assert!(numbers.iter().all(|x| x.is_finite()), "{numbers:?}");
        assert_eq!(d.opacity, discs.opacity(index));
    }
    for beyond in [discs.len(), discs.len() + 256, usize::MAX] {
        assert!(discs.get(beyond).is_none());
        let _ = (discs.words(beyond), discs.opacity(beyond));
    }
    discs.iter().count() as u32
}

fn walk_rig(avatar: &Avatar<'_>) {
    let header = avatar.header();
    assert_eq!(avatar.joints().len(), usize::from(header.joints));
    for joint in avatar.joints() {
        let mut numbers = joint.translation.iter().chain(&joint.rotation).chain(&joint.scale);
        assert!(numbers.all(|x| x.get().is_finite()));
    }
    for bind in avatar.binds() {
        assert!(bind.joint.get() < header.joints);
        assert!(bind.inverse.iter().flatten().all(|x| x.get().is_finite()));
    }
    assert!(avatar.key_frames().iter().all(|k| k.seconds.get().is_finite()));
    assert_eq!(avatar.morph_targets().count(), usize::from(header.morph_targets));
    for target in avatar.morph_targets() {
        assert!(target.step.is_finite() && target.default_weight.is_finite());
        assert!(target.vertices.iter().all(|v| v < header.vertices));
        assert_eq!(target.vertices.len(), target.deltas.len());
    }
    assert!(avatar.clips().count() <= usize::from(header.clips));
    for clip in avatar.clips() {
        assert!(clip.seconds.is_finite());
        for channel in clip.channels() {
            for key in (0..channel.keys).chain([channel.keys, usize::MAX]) {
                assert!((0..channel.property.width()).all(|i| channel.value(key, i).is_finite()));
            }
        }
    }
}
