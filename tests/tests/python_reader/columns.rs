//! All numbers of an avatar by name, as the Python reader gives them: columns of 32-bit words.

use std::collections::BTreeMap;

use dermis_format::curves::stops;
use dermis_format::quant::opacity_value;
use dermis_format::rig::{Clip, MorphTarget, Property};
use dermis_format::section::tag;
use dermis_format::{Avatar, Block, Discs, Fulls, Records, order};

/// Columns that are not empty.
pub(crate) type Columns = BTreeMap<String, Vec<u32>>;

/// Everything in an avatar, decoded through the public interface of `dermis-format`.
pub(crate) fn columns(avatar: &Avatar<'_>) -> Columns {
    let mut columns = Columns::new();
    columns.insert("header".into(), header(avatar));
    add_mesh(avatar, &mut columns);
    add_samples(avatar, &mut columns);
    add_rig(avatar, &mut columns);
    for (index, block) in avatar.blocks().enumerate() {
        add_block(avatar, &block, &format!("BLCK {index}"), &mut columns);
    }
    let mut places = [0, 0];
    for level in avatar.levels() {
        let (name, kind) = if level.tag == tag::SHAPE { ("SHAP", 1) } else { ("LEVL", 0) };
        let place = format!("{name} {}", places[kind]);
        places[kind] += 1;
        let head = [level.region.into(), level.level.into(), level.count, level.first];
        columns.insert(place.clone(), head.to_vec());
        add_discs(&level.discs, &place, &mut columns);
    }
    columns.retain(|_, words| !words.is_empty());
    columns
}

fn bits(numbers: impl IntoIterator<Item = f32>) -> impl Iterator<Item = u32> {
    numbers.into_iter().map(f32::to_bits)
}

/// Of each text its length and its bytes.
fn letters<'a>(texts: impl IntoIterator<Item = &'a str>) -> Vec<u32> {
    let of = |text: &'a str| {
        [text.len() as u32].into_iter().chain(text.bytes().map(u32::from)).collect::<Vec<_>>()
    };
    texts.into_iter().flat_map(of).collect()
}

fn header(avatar: &Avatar<'_>) -> Vec<u32> {
    let h = avatar.header();
    let mut words = vec![h.vertices, h.triangles];
    words.extend([h.joints, h.binds, h.morph_targets, h.clips].map(u32::from));
    words.extend([h.regions.into(), h.layers.into(), h.gaussians]);
    words.extend([h.frame as u32, h.record as u32, h.low_pass as u32, h.scale_law as u32]);
    words.extend([h.harmonics_degree.into(), h.per_level as u32]);
    words.extend(bits([h.box_min, h.box_max, h.position_min, h.position_step].concat()));
    words
}

fn add_mesh(avatar: &Avatar<'_>, columns: &mut Columns) {
    let header = avatar.header();
    let (vertices, triangles) = (0..header.vertices as usize, 0..header.triangles as usize);
    let regions = 0..usize::from(header.regions);
    let mut add = |tag: &str, words: Vec<u32>| columns.insert(tag.into(), words);
    let coarser = avatar.mesh_levels().ranges().skip(1).map(|mesh| mesh.len() as u32);
    add("MLEV", coarser.collect());
    add("VERT", bits(vertices.clone().flat_map(|i| avatar.vertex_position(i))).collect());
    add("TRIS", triangles.clone().flat_map(|i| avatar.triangle(i)).collect());
    if header.binds > 0 {
        let influences: Vec<_> = vertices.flat_map(|i| avatar.influences(i)).collect();
        let weights = influences.iter().map(|&(_, weight)| u32::from(weight));
        add("SKIN", influences.iter().map(|&(bind, _)| bind).chain(weights).collect());
    }
    add("SIDE", triangles.clone().map(|i| avatar.is_two_sided(i).into()).collect());
    add("TREG", triangles.map(|i| avatar.triangle_region(i).into()).collect());
    add("REGN", letters(avatar.region_names()));
    let layers = 0..usize::from(header.layers);
    let lengths = |region| layers.clone().map(move |layer| avatar.layer_len(region, layer));
    add("LAYR", regions.clone().flat_map(lengths).collect());
    let importance = |region: usize| match avatar.importances().get(region) {
        Some(of) => [of.weight, of.mobility, of.visible, of.residual].map(|x| x.get()),
        None => [avatar.region_weight(region), 0.0, 0.0, 0.0],
    };
    add("IMPO", bits(regions.flat_map(importance)).collect());
    if let Some(curves) = avatar.curves() {
        let (octaves, counts) = (0..curves.octaves(), 0..stops(header.layers.into()));
        let regions = 0..usize::from(header.regions);
        let places = regions.flat_map(|region| octaves.clone().map(move |o| (region, o)));
        let points = places.flat_map(|(region, octave)| {
            counts.clone().filter_map(move |stop| curves.point(region, octave, stop))
        });
        let numbers = points.flat_map(|point| [point.error, point.blends]);
        let mut words = vec![curves.density().to_bits(), curves.octaves() as u32];
        words.extend(bits(numbers));
        add("CURV", words);
    }
}

fn add_samples(avatar: &Avatar<'_>, columns: &mut Columns) {
    let Some(samples) = avatar.samples() else { return };
    let mut words: Vec<u32> = samples.iter().map(|sample| sample.triangle).collect();
    words.extend(bits(samples.iter().flat_map(|sample| [sample.area, sample.fill])));
    columns.insert("SAMP".into(), words);
}

fn add_rig(avatar: &Avatar<'_>, columns: &mut Columns) {
    let mut add = |place: String, words: Vec<u32>| columns.insert(place, words);
    if let Some(movements) = avatar.movements() {
        let joints = (0..).map_while(|joint| movements.of_joint(joint));
        let targets = (0..).map_while(|target| movements.of_target(target));
        let clips = (0..).map_while(|clip| movements.of_clip(clip));
        add("MOVE".into(), bits(joints.chain(targets).chain(clips)).collect());
    }
    let mut joints = Vec::new();
    for joint in avatar.joints() {
        joints.push(joint.parent.get().into());
        let numbers = joint.translation.iter().chain(&joint.rotation).chain(&joint.scale);
        joints.extend(bits(numbers.map(|x| x.get())));
    }
    add("JNTS".into(), joints);
    add("JNAM".into(), letters(avatar.joint_names()));
    let mut binds = Vec::new();
    for bind in avatar.binds() {
        binds.push(bind.joint.get().into());
        binds.extend(bits(bind.inverse.iter().flatten().map(|x| x.get())));
    }
    add("BIND".into(), binds);
    let frames = avatar.key_frames().iter();
    let frames = frames.flat_map(|k| [k.clip.get().into(), k.seconds.get().to_bits()]);
    add("KEYF".into(), frames.collect());
    for (index, target) in avatar.morph_targets().enumerate() {
        add(format!("MRPH {index}"), morph(&target));
    }
    for (index, clip) in avatar.clips().enumerate() {
        add(format!("CLIP {index}"), clip_words(clip));
    }
}

fn morph(target: &MorphTarget<'_>) -> Vec<u32> {
    let mut words = letters([target.name]);
    words.extend(bits([target.step, target.default_weight]));
    words.extend(target.vertices.iter());
    // Two's complement in 32 bits, too.
    words.extend(target.deltas.iter().flatten().map(|code| i32::from(code.get()) as u32));
    words
}

fn clip_words(clip: Clip<'_>) -> Vec<u32> {
    let mut words = letters([clip.name]);
    words.push(clip.seconds.to_bits());
    for channel in clip.channels() {
        let (property, target) = match channel.property {
            Property::Translation(joint) => (0, joint),
            Property::Rotation(joint) => (1, joint),
            Property::Scale(joint) => (2, joint),
            Property::Weight(target) => (3, target),
        };
        words.extend([property, u32::from(!channel.holds), target.into(), channel.keys as u32]);
        let components = 0..channel.property.width();
        let key = |key| components.clone().map(move |component| channel.value(key, component));
        words.extend(bits((0..channel.keys).flat_map(key)));
    }
    words
}

fn add_block(avatar: &Avatar<'_>, block: &Block<'_>, place: &str, columns: &mut Columns) {
    let head = [block.region.into(), block.layer.into(), block.count, block.first];
    columns.insert(place.into(), head.to_vec());
    let mut add = |name: &str, words: Vec<u32>| columns.insert(format!("{place} {name}"), words);
    add("rank", (0..block.count).map(|i| block.first + order::rank(i, block.count)).collect());
    add("triangle", block.triangles.iter().collect());
    add("opacities", bits(block.opacities.iter().map(|&code| opacity_value(code))).collect());
    match &block.records {
        Records::Disc(discs) => add_discs(discs, place, columns),
        Records::Full(fulls) => {
            let each = 3 * avatar.header().harmonics();
            let step = |index: usize| fulls.groups[index / each / order::GROUP_LEN].harmonics_step;
            let codes = block.harmonics.iter().enumerate();
            let harmonics = codes.map(|(index, &code)| f32::from(code) * step(index).get());
            add("harmonics", bits(harmonics).collect());
            add_fulls(fulls, place, columns);
        }
    }
}

fn add_discs(discs: &Discs<'_>, place: &str, columns: &mut Columns) {
    for disc in discs.iter() {
        let ([x, y, z], [s, t], [r, g, b]) = (disc.position, disc.log2_scale, disc.color);
        let numbers = [
            ("x", x),
            ("y", y),
            ("z", z),
            ("angle", disc.angle),
            ("scale 0", s),
            ("scale 1", t),
            ("red", r),
            ("green", g),
            ("blue", b),
            ("opacity", disc.opacity),
        ];
        push(columns, place, &numbers);
    }
}

fn add_fulls(fulls: &Fulls<'_>, place: &str, columns: &mut Columns) {
    for full in fulls.iter() {
        let ([x, y, z], [s, t, u], [r, g, b]) = (full.position, full.log2_scale, full.color);
        let [qw, qx, qy, qz] = full.rotation;
        let numbers = [
            ("x", x),
            ("y", y),
            ("z", z),
            ("turn w", qw),
            ("turn x", qx),
            ("turn y", qy),
            ("turn z", qz),
            ("scale 0", s),
            ("scale 1", t),
            ("scale 2", u),
            ("red", r),
            ("green", g),
            ("blue", b),
            ("opacity", full.opacity),
        ];
        push(columns, place, &numbers);
    }
}

/// The next Gaussian.
fn push(columns: &mut Columns, place: &str, numbers: &[(&str, f32)]) {
    for (name, number) in numbers {
        columns.entry(format!("{place} {name}")).or_default().push(number.to_bits());
    }
}
