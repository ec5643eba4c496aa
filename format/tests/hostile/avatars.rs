//! Avatars of every kind, and a walk over all that a reader offers.

use dermis_format::rig::Property;
use dermis_format::source::{
    Channel, Clip, Gaussians, Importance, Joint, Mathematics, Mesh, Morph, Region, Rig, Source,
};
use dermis_format::{Avatar, Block, Disc, DiscWidths, Discs, FrameKind, Full, Levels, Records};

/// A number in 0..1 that depends on `seed` alone (SplitMix64).
pub(crate) fn random(seed: u64) -> f32 {
    let mut x = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) >> 40) as f32 / 16_777_216.0
}

/// A strip of `triangles` triangles.
pub(crate) fn strip(triangles: usize) -> Mesh {
    let position = |i: usize| [i as f32 * 0.1, (i % 2) as f32, random(i as u64)];
    Mesh {
        positions: (0..triangles + 2).map(position).collect(),
        triangles: (0..triangles as u32).map(|i| [i, i + 1, i + 2]).collect(),
        two_sided: (0..triangles).map(|i| i % 3 == 0).collect(),
        ..Mesh::default()
    }
}

pub(crate) fn disc(seed: u64) -> Disc {
    let r = |i: u64| random(seed * 16 + i);
    Disc {
        position: [r(0) - 0.5, r(1) - 0.5, 0.1 * r(2)],
        angle: 3.0 * r(3),
        log2_scale: [-4.0 * r(4), -4.0 * r(5)],
        color: [r(6), r(7), r(8)],
        opacity: r(9),
    }
}

pub(crate) fn full(seed: u64) -> Full {
    let r = |i: u64| random(seed * 16 + i);
    let rotation = [r(10) - 0.5, r(11) - 0.5, r(12) - 0.5, 0.1 + r(13)];
    let length = rotation.iter().map(|x| x * x).sum::<f32>().sqrt();
    let Disc { position, log2_scale: [a, b], color, opacity, .. } = disc(seed);
    let (rotation, log2_scale) = (rotation.map(|x| x / length), [a, b, -4.0 * r(14)]);
    Full { position, rotation, log2_scale, color, opacity }
}

/// Triangles of Gaussians, ascending in each block.
fn spread(layers: &[u32], triangles: usize) -> Vec<u32> {
    dermis_format::order::blocks(layers)
        .flat_map(|(_, _, n)| {
            (0..n).map(move |i| (u64::from(i) * triangles as u64 / u64::from(n)) as u32)
        })
        .collect()
}

pub(crate) fn discs_on(name: &str, layers: &[u32], triangles: usize) -> Region {
    let n: u32 = layers.iter().sum();
    Region {
        name: name.into(),
        layers: layers.to_vec(),
        gaussians: Gaussians::Disc((0..n).map(|i| disc(i.into())).collect()),
        triangles: spread(layers, triangles),
        ..Region::default()
    }
}

pub(crate) fn discs() -> Source {
    Source { mesh: strip(3), regions: vec![discs_on("all", &[3, 4], 3)], ..Source::default() }
}

pub(crate) fn harmonics() -> Source {
    let harmonic = |i: u64| (0..45).map(|j| random(i * 64 + j) - 0.5).collect();
    Source {
        mesh: strip(2),
        regions: vec![Region {
            name: "all".into(),
            layers: vec![5],
            gaussians: Gaussians::Full((0..5).map(full).collect()),
            triangles: vec![0, 0, 1, 1, 1],
            harmonics: (0..5).map(harmonic).collect(),
            ..Region::default()
        }],
        mathematics: Mathematics {
            frame: FrameKind::Edge,
            harmonics_degree: 3,
            ..Mathematics::default()
        },
        ..Source::default()
    }
}

pub(crate) fn opacities() -> Source {
    let mut source = discs();
    source.regions = vec![discs_on("all", &[2, 2, 3], 3)];
    let later = |i: u64| 0..if i < 2 { 2 } else { u64::from(i < 4) };
    source.regions[0].later_opacities =
        (0..7).map(|i| later(i).map(|j| random(i * 8 + j)).collect()).collect();
    source
}

/// Two regions whose Gaussians are others at each level; one of their layers is empty.
pub(crate) fn levels() -> Source {
    let mut source = discs();
    source.mesh.triangle_regions = vec![0, 1, 1];
    source.regions = vec![
        discs_on("all", &[2, 0, 3, 4], 3),
        discs_on("late", &[0, 3, 2, 0], 3),
        discs_on("never", &[0, 0, 0, 0], 3),
    ];
    add_levels(&mut source);
    source
}

/// Gives every Gaussian parameters of its own at each level.
pub(crate) fn add_levels(source: &mut Source) {
    for region in &mut source.regions {
        let mut earlier = 0;
        region.levels.clear();
        for (level, &len) in (0u64..).zip(&region.layers) {
            if level > 0 {
                let n = if len > 0 { earlier } else { 0 };
                region.levels.push((0..n).map(|i| disc((1000 + i) * 16 + level)).collect());
            }
            earlier += u64::from(len);
        }
    }
}

/// Blocks and groups enough that levels have several.
pub(crate) fn many_levels() -> Source {
    let mut source = regions();
    source.regions[0] = discs_on("Gesicht", &[300, 5000, 700], 3);
    source.regions[1] = discs_on("leer", &[0, 0, 0], 3);
    source.regions[2] = discs_on("手", &[2, 0, 4200], 3);
    add_levels(&mut source);
    source
}

pub(crate) fn regions() -> Source {
    let mut source = discs();
    source.mesh.triangle_regions = vec![0, 2, 1];
    source.regions = vec![
        discs_on("Gesicht", &[300, 50], 3),
        discs_on("leer", &[0, 0], 3),
        discs_on("手", &[2, 0], 3),
    ];
    source.regions[2].importance =
        Some(Importance { weight: 4.0, mobility: 0.25, visible: 0.5, residual: 1.0 });
    source
}

/// Triangles far apart.
pub(crate) fn wide() -> Source {
    Source {
        mesh: strip(70_000),
        regions: vec![discs_on("all", &[200, 5000], 70_000)],
        ..Source::default()
    }
}

/// Few Gaussians, on triangles that are far apart for them, or the same.
pub(crate) fn sparse() -> Source {
    let region =
        Region { triangles: vec![0, 7, 50, 3, 3, 3, 40, 55], ..discs_on("all", &[3, 5], 60) };
    Source { mesh: strip(60), regions: vec![region], ..Source::default() }
}

pub(crate) fn cloud() -> Source {
    Source {
        regions: vec![Region {
            name: String::new(),
            layers: vec![4],
            gaussians: Gaussians::Full((0..4).map(full).collect()),
            ..Region::default()
        }],
        mathematics: Mathematics { frame: FrameKind::World, ..Mathematics::default() },
        ..Source::default()
    }
}

/// Numbers of few bits, or none, other ones at each level.
pub(crate) fn narrow() -> Source {
    let mut source = levels();
    source.widths = [[7, 7, 6, 6, 5, 7, 5, 4, 2], [1, 2, 3, 4, 5, 6, 7, 8, 0], [0; 9]]
        .map(|[x, y, z, angle, scale, luma, orange, green, opacity]| DiscWidths {
            position: [x, y, z],
            angle,
            scale,
            color: [luma, orange, green],
            opacity,
        })
        .to_vec();
    source
}

/// Joints, binds, morph targets, clips and key frames.
pub(crate) fn rigged() -> Source {
    let mut source = discs();
    let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.5], [0.0, 0.0, 1.0, 0.0]];
    let joint = |name: &str, parent| Joint {
        name: name.into(),
        parent,
        translation: [0.0, 0.5, 0.0],
        ..Joint::default()
    };
    source.mesh.influences = (0..5)
        .map(|i| [(0, 0.25 * i as f32), (1, 1.0 - 0.25 * i as f32), (0, 0.0), (0, 0.0)])
        .collect();
    source.mesh.morph_targets = vec![
        Morph {
            name: "smile".into(),
            default_weight: 0.5,
            deltas: vec![(1, [0.1, 0.0, -0.2]), (4, [0.0, 0.3, 0.0])],
        },
        Morph { name: "nothing".into(), ..Morph::default() },
    ];
    let channel =
        |property, holds, values: &[f32]| Channel { property, holds, values: values.to_vec() };
    source.rig = Rig {
        joints: vec![joint("root", None), joint("头", Some(0))],
        binds: vec![(0, identity), (1, identity)],
        clips: vec![
            Clip {
                name: "nod".into(),
                seconds: 2.0,
                channels: vec![
                    channel(Property::Translation(0), false, &[0.0, 0.0, 0.0, 1.0, 2.0, 3.0]),
                    channel(
                        Property::Rotation(1),
                        false,
                        &[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
                    ),
                    channel(Property::Scale(1), true, &[1.0; 3]),
                    channel(Property::Weight(0), true, &[0.0, 1.0, 0.5]),
                ],
            },
            Clip { name: "still".into(), ..Clip::default() },
        ],
    };
    source.key_frames = vec![(None, 0.0), (Some(0), 1.5)];
    source
}

/// All of them, by name.
pub(crate) fn all() -> Vec<(&'static str, Source)> {
    vec![
        ("discs", discs()),
        ("harmonics", harmonics()),
        ("opacities", opacities()),
        ("regions", regions()),
        ("levels", levels()),
        ("narrow", narrow()),
        ("many levels", many_levels()),
        ("wide", wide()),
        ("sparse", sparse()),
        ("cloud", cloud()),
        ("rigged", rigged()),
    ]
}

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
        let _ = avatar.is_two_sided(index);
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
