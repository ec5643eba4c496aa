//! Avatars of every kind.

use dermis_format::rig::Property;
use dermis_format::samples::{self, Sample};
use dermis_format::source::{
    Channel, Clip, Gaussians, Importance, Joint, Mathematics, MeasuredCurves, MeasuredMovements,
    Mesh, Morph, Region, Rig, Source,
};
use dermis_format::{CurvePoint, Disc, DiscWidths, FrameKind, Full};

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

/// Levels of which the last of each region is a shape, of the level before or of its blocks.
pub(crate) fn shapes() -> Source {
    let mut source = levels();
    make_shapes(&mut source);
    source
}

fn make_shapes(source: &mut Source) {
    for region in &mut source.regions {
        let Gaussians::Disc(own) = &region.gaussians else { unreachable!("they are discs") };
        let Some(last) = region.levels.iter().rposition(|level| !level.is_empty()) else {
            continue;
        };
        let (before, last) = region.levels.split_at_mut(last);
        let before = before.iter().rfind(|level| !level.is_empty()).map_or(&[][..], |level| level);
        let before = before.iter().chain(&own[before.len()..]);
        for (here, before) in last[0].iter_mut().zip(before) {
            *here = Disc { log2_scale: here.log2_scale, opacity: here.opacity, ..*before };
        }
    }
}

/// The same of blocks and groups enough that levels have several.
pub(crate) fn many_shapes() -> Source {
    let mut source = many_levels();
    make_shapes(&mut source);
    source
}

/// Blocks and groups enough that levels have several.
pub(crate) fn many_levels() -> Source {
    let mut source = regions();
    source.curves = None;
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
    // Of three regions and two octaves six stops each.
    let point = |i: u64| CurvePoint { error: 0.3 * random(i), blends: 40.0 * random(i + 99) };
    let points = (0..3 * 2 * 6).map(point).collect();
    source.curves = Some(MeasuredCurves { density: 270.5, octaves: 2, points });
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
            ..Morph::default()
        },
        Morph { name: "nothing".into(), ..Morph::default() },
    ];
    let channel = |property, holds, values: &[f32]| Channel {
        property,
        holds,
        values: values.to_vec(),
        step: 0.0,
    };
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
    source.mesh.coarser = vec![1];
    source.samples = vec![
        Sample { triangle: 0, area: 40.3, fill: 20.1 },
        Sample { triangle: 1, area: 0.0, fill: samples::MOST },
    ];
    source.movements = Some(MeasuredMovements {
        joints: vec![1.5, 0.3],
        targets: vec![0.26, 0.0],
        clips: vec![2.0, 0.0],
    });
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
        ("shapes", shapes()),
        ("many shapes", many_shapes()),
        ("wide", wide()),
        ("sparse", sparse()),
        ("cloud", cloud()),
        ("rigged", rigged()),
    ]
}
