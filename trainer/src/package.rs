//! From a model and its Gaussians to the bytes of a file.

use anyhow::{Context, Result};
use dermis_format::Disc;
use dermis_format::ScaleLaw;
use dermis_format::source::{Gaussians, Joint, Mathematics, Mesh, Morph, Region, Rig, Source};
use glam::Affine3A;

use crate::clips::{resampled, wxyz};
use crate::embed::mesh_levels::CoarserMesh;
use crate::embed::regions::Regions;
use crate::model::{Bind, Model, MorphTarget};
use crate::movements;
use crate::optimize::cloud::{Cloud, Parameters};
use crate::scene::{Bounds, KeyFrame, Pose, posed_vertices};

/// What nobody sees, to the longest side of the mesh at rest: a thirtieth of a pixel where that is 540 px long. So far apart, in the world,
/// are the codes of a vertex, of a morph target's displacement, and what its weight's codes make of it.
pub const MESH_STEP: f32 = 1.0 / 16_384.0;

/// The mesh, rig and clips of `model`, without Gaussians.
pub fn rigged_mesh(model: &Model) -> Source {
    let rest = Bounds::of(&posed_vertices(model, &Pose::rest(model)));
    let step = mesh_step(model, rest);
    let bound = !model.binds.is_empty();
    let moves = !model.joints.is_empty() || !model.morph_targets.is_empty();
    Source {
        mesh: Mesh {
            positions: model.vertices.iter().map(|v| v.position.to_array()).collect(),
            step,
            influences: if bound {
                model.vertices.iter().map(|v| v.influences).collect()
            } else {
                Vec::new()
            },
            triangles: model.triangles.iter().map(|t| t.corners).collect(),
            two_sided: vec![false; model.triangles.len()],
            coarser: Vec::new(),
            triangle_regions: Vec::new(),
            morph_targets: model.morph_targets.iter().map(|target| morph(target, step)).collect(),
        },
        rig: Rig {
            joints: model.joints.iter().map(joint).collect(),
            binds: model.binds.iter().map(|bind| (bind.joint, rows(&bind.inverse))).collect(),
            clips: (0..model.clips.len()).map(|clip| resampled(model, clip, step)).collect(),
        },
        regions: vec![Region { name: "body".into(), layers: vec![0], ..Region::default() }],
        mathematics: Mathematics::default(),
        bounds: [rest.min.to_array(), rest.max.to_array()],
        movements: moves.then(|| movements::measure(model)),
        ..Source::default()
    }
}

/// What nobody sees in bind space, where some parts may be in other units than the world: in that of the finest.
fn mesh_step(model: &Model, rest: Bounds) -> f32 {
    let worlds = Pose::rest(model).joint_worlds(model);
    let of_bind = |bind: &Bind| {
        let matrix = (worlds[usize::from(bind.joint)] * bind.inverse).matrix3;
        [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|axis| axis.length())
    };
    let greatest = model.binds.iter().flat_map(of_bind).fold(1.0, f32::max);
    (rest.max - rest.min).max_element() * MESH_STEP / greatest
}

/// Cuts a mesh into regions, yet without Gaussians.
pub fn with_regions(mut source: Source, regions: &Regions) -> Source {
    let named = |name: &String| Region { name: name.clone(), layers: vec![0], ..Region::default() };
    source.regions = regions.names.iter().map(named).collect();
    source.mesh.triangle_regions = regions.of_triangles.clone();
    source
}

/// Adds coarser meshes, from fine to coarse, behind the triangles of the surface, whose regions they take over.
pub fn with_coarser(mut source: Source, meshes: &[CoarserMesh]) -> Source {
    let mesh = &mut source.mesh;
    for CoarserMesh { triangles, originals, two_sided } in meshes {
        mesh.triangles.extend(triangles);
        for &original in originals {
            mesh.two_sided.push(*two_sided || mesh.two_sided[original as usize]);
            mesh.triangle_regions.push(mesh.triangle_regions[original as usize]);
        }
        mesh.coarser.push(triangles.len() as u32);
    }
    source
}

/// Adds trained Gaussians to a mesh, a cloud to each region.
///
/// Those of a cloud of several levels come with parameters of their own at each, and the law by which such
/// clouds are drawn; under a constant law, where levels differ in opacity alone, with opacities (LapisGS).
pub fn with_gaussians(mut source: Source, clouds: &[Cloud]) -> Source {
    let constant = source.mathematics.scale_law == ScaleLaw::Constant;
    let with_opacities = constant && clouds.iter().all(differ_in_opacity_alone);
    for (region, cloud) in source.regions.iter_mut().zip(clouds) {
        region.layers = cloud.layers.clone();
        region.triangles = cloud.triangles.clone();
        let own = own_levels(cloud).map(|(level, index)| cloud.levels[level][index].disc());
        region.gaussians = Gaussians::Disc(own.collect());
        if cloud.levels.len() < 2 {
            continue;
        }
        if with_opacities {
            region.later_opacities = later_opacities(cloud);
        } else {
            source.mathematics.scale_law = ScaleLaw::SquareRoot;
            region.levels = later_levels(cloud);
        }
    }
    source
}

/// Level of the cloud at which each Gaussian is first drawn, and its index. One level is everyone's.
fn own_levels(cloud: &Cloud) -> impl Iterator<Item = (usize, usize)> {
    let starts = core::iter::once(0).chain(cloud.levels.iter().map(Vec::len));
    let levels = starts.zip(&cloud.levels).enumerate();
    levels.flat_map(|(level, (start, all))| (start..all.len()).map(move |index| (level, index)))
}

/// Level of the cloud that ends with each layer, none if that is empty: it is no level.
fn level_of_layers(cloud: &Cloud) -> Vec<Option<usize>> {
    let mut levels = 0..;
    cloud.layers.iter().map(|&len| if len > 0 { levels.next() } else { None }).collect()
}

/// As [`Region::levels`].
fn later_levels(cloud: &Cloud) -> Vec<Vec<Disc>> {
    let mut earlier = 0;
    let mut levels = Vec::new();
    for (&len, level) in cloud.layers.iter().zip(level_of_layers(cloud)) {
        let at = level.map_or(&[][..], |level| &cloud.levels[level][..earlier]);
        levels.push(at.iter().map(Parameters::disc).collect());
        earlier += len as usize;
    }
    // No Gaussian is earlier than the first layer.
    levels.remove(0);
    levels
}

fn differ_in_opacity_alone(cloud: &Cloud) -> bool {
    own_levels(cloud).all(|(own, index)| {
        let but_opacity = |level: &Vec<Parameters>| Parameters { logit: 0.0, ..level[index] };
        let first = but_opacity(&cloud.levels[own]);
        cloud.levels[own..].iter().all(|level| but_opacity(level) == first)
    })
}

/// As [`Region::later_opacities`]. With an empty layer nothing changes.
fn later_opacities(cloud: &Cloud) -> Vec<Vec<f32>> {
    let levels = level_of_layers(cloud);
    let of = |(own, index): (usize, usize)| {
        let after = levels.iter().skip_while(move |&&level| level != Some(own)).skip(1);
        let mut last = own;
        after
            .map(|level| {
                last = level.unwrap_or(last);
                cloud.levels[last][index].opacity()
            })
            .collect()
    };
    own_levels(cloud).map(of).collect()
}

/// Key frames as the file names them.
pub fn key_frames(frames: &[KeyFrame]) -> Vec<(Option<u16>, f32)> {
    frames.iter().map(|frame| (frame.clip.map(|clip| clip as u16), frame.seconds)).collect()
}

/// Bytes of a file.
pub fn encode(source: &Source) -> Result<Vec<u8>> {
    dermis_format::writer::encode(source).context("the avatar cannot be written")
}

fn rows(matrix: &Affine3A) -> [[f32; 4]; 3] {
    let (m, t) = (matrix.matrix3, matrix.translation);
    core::array::from_fn(|i| [m.x_axis[i], m.y_axis[i], m.z_axis[i], t[i]])
}

fn morph(target: &MorphTarget, step: f32) -> Morph {
    Morph {
        name: target.name.clone(),
        default_weight: target.default_weight,
        deltas: target.deltas.iter().map(|(vertex, delta)| (*vertex, delta.to_array())).collect(),
        step,
    }
}

fn joint(joint: &crate::model::Joint) -> Joint {
    Joint {
        name: joint.name.clone(),
        parent: joint.parent,
        translation: joint.rest.translation.to_array(),
        rotation: wxyz(joint.rest.rotation),
        scale: joint.rest.scale.to_array(),
    }
}
