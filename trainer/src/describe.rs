//! What a file holds, byte by byte.

use core::ops::Range;
use std::collections::HashSet;

use dermis_format::Records;
use dermis_format::section::{self, preamble};
use dermis_runtime::Avatar;
use serde::Serialize;

/// What a file holds.
#[derive(Clone, Debug, Serialize)]
pub struct Info {
    /// Of the whole file.
    pub bytes: usize,
    /// Of the blocks of Gaussians and of their levels, for each Gaussian.
    pub bytes_per_gaussian: f64,
    /// In all regions.
    pub gaussians: u32,
    /// Degree of spherical harmonics.
    pub sh_degree: u8,
    /// Coarse to fine.
    pub layers: Vec<Layer>,
    /// Parts with a level of their own.
    pub regions: Vec<Region>,
    /// What moves.
    pub mesh: Mesh,
    /// How far, if that was measured: joints with all below them, and morph targets at weight 1, those that move most first.
    pub movements: Vec<Movement>,
    /// Animations.
    pub clips: Vec<Clip>,
    /// Bytes by section, heads included.
    pub sections: Vec<Part>,
}

/// A layer.
#[derive(Clone, Debug, Serialize)]
pub struct Layer {
    /// Of all regions.
    pub gaussians: u32,
    /// Of its blocks, and of what earlier layers have of their own at its level.
    pub bytes: usize,
    /// Bits of a disc's record; none of an empty layer, or of Gaussians with three scales.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bits_per_disc: Option<u32>,
}

/// A region.
#[derive(Clone, Debug, Serialize)]
pub struct Region {
    /// Its name.
    pub name: String,
    /// Its triangles.
    pub triangles: usize,
    /// Its Gaussians.
    pub gaussians: u32,
    /// How much it matters; 1 is usual.
    pub weight: f32,
    /// What was measured of it.
    #[serde(flatten)]
    pub measured: Option<Measured>,
}

/// What was measured of a region in training.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Measured {
    /// Mean speed of its surface, m/s.
    pub mobility_m_per_s: f32,
    /// Share of what is seen of the avatar.
    pub visible_share: f32,
    /// Share of the squared error.
    pub residual_share: f32,
}

/// A mesh.
#[derive(Clone, Debug, Serialize)]
pub struct Mesh {
    /// As stored: a seam counts twice.
    pub vertices: u32,
    /// Triangles.
    pub triangles: u32,
    /// Those whose back is drawn, too.
    pub two_sided: usize,
    /// Meshes on which the first Gaussians stand, from fine to coarse.
    pub coarser: Vec<CoarserMesh>,
    /// Joints of the skeleton.
    pub joints: u16,
    /// Morph targets.
    pub morph_targets: u16,
}

/// A coarser mesh of the same vertices.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CoarserMesh {
    /// Its triangles.
    pub triangles: usize,
    /// Vertices of these.
    pub vertices: usize,
    /// Gaussians that stand on them.
    pub gaussians: usize,
}

/// How far a joint or a morph target moves the surface.
#[derive(Clone, Debug, Serialize)]
pub struct Movement {
    /// Of the joint or the target; its index where it has none.
    pub name: String,
    /// Root of the mean square.
    pub metres: f32,
}

/// A clip.
#[derive(Clone, Debug, Serialize)]
pub struct Clip {
    /// Its name.
    pub name: String,
    /// Its length.
    pub seconds: f32,
    /// Of the surface in its fastest moment, root of the mean square, if that was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_m_per_s: Option<f32>,
}

/// Sections of one tag.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Part {
    /// Tag, or `header`.
    pub name: String,
    /// How many.
    pub count: usize,
    /// In all of them, heads included.
    pub bytes: usize,
}

impl Info {
    /// Of a file.
    pub fn of(avatar: &Avatar<'_>) -> Self {
        let header = avatar.header();
        let surface = avatar.mesh_levels().surface();
        let sections = parts(avatar);
        let of_gaussians = avatar.sections().filter(|s| section::holds_gaussians(s.tag));
        let gaussian_bytes: usize = of_gaussians.map(len_of).sum();
        Self {
            bytes: avatar.bytes().len(),
            bytes_per_gaussian: gaussian_bytes as f64 / f64::from(header.gaussians.max(1)),
            gaussians: header.gaussians,
            sh_degree: header.harmonics_degree,
            layers: (0..header.layers).map(|layer| layer_of(avatar, layer)).collect(),
            regions: regions(avatar),
            mesh: Mesh {
                vertices: header.vertices,
                triangles: surface,
                two_sided: (0..surface as usize).filter(|&t| avatar.is_two_sided(t)).count(),
                coarser: coarser(avatar),
                joints: header.joints,
                morph_targets: header.morph_targets,
            },
            movements: movements(avatar),
            clips: avatar
                .clips()
                .enumerate()
                .map(|(index, clip)| Clip {
                    name: clip.name.into(),
                    seconds: clip.seconds,
                    speed_m_per_s: avatar
                        .movements()
                        .and_then(|movements| movements.of_clip(index)),
                })
                .collect(),
            sections,
        }
    }
}

/// Bytes of a section, its head included.
fn len_of(section: section::Section<'_>) -> usize {
    section::head::LEN + section.payload.len()
}

fn layer_of(avatar: &Avatar<'_>, layer: u8) -> Layer {
    let blocks = avatar.sections().filter(|s| s.tag == section::tag::BLOCK);
    let blocks = blocks.zip(avatar.blocks()).filter(|(_, block)| block.layer == layer);
    let is_level =
        |s: &section::Section<'_>| section::holds_gaussians(s.tag) && s.tag != section::tag::BLOCK;
    let levels = avatar.sections().filter(is_level);
    let levels = levels.zip(avatar.levels()).filter(|(_, level)| level.level == layer);
    Layer {
        gaussians: (0..usize::from(avatar.header().regions))
            .map(|r| avatar.layer_len(r, usize::from(layer)))
            .sum(),
        bytes: blocks.map(|(s, _)| s).chain(levels.map(|(s, _)| s)).map(len_of).sum(),
        bits_per_disc: avatar.blocks().filter(|block| block.layer == layer).find_map(|block| {
            let Records::Disc(discs) = block.records else { return None };
            Some(discs.layout().bits())
        }),
    }
}

fn coarser(avatar: &Avatar<'_>) -> Vec<CoarserMesh> {
    let mesh = |triangles: Range<u32>| {
        let corners = triangles.clone().flat_map(|triangle| avatar.triangle(triangle as usize));
        let on_it = avatar.blocks().flat_map(|block| block.triangles.iter());
        CoarserMesh {
            triangles: triangles.len(),
            vertices: corners.collect::<HashSet<u32>>().len(),
            gaussians: on_it.filter(|triangle| triangles.contains(triangle)).count(),
        }
    };
    avatar.mesh_levels().ranges().skip(1).map(mesh).collect()
}

fn movements(avatar: &Avatar<'_>) -> Vec<Movement> {
    let Some(measured) = avatar.movements() else { return Vec::new() };
    let joints = (0..).map_while(|joint| Some((joint, measured.of_joint(joint)?)));
    let named = |(index, metres): (usize, f32)| {
        let name = avatar.joint_names().nth(index).map_or_else(|| index.to_string(), String::from);
        Movement { name, metres }
    };
    let targets = avatar.morph_targets().enumerate().filter_map(|(index, target)| {
        Some(Movement { name: target.name.into(), metres: measured.of_target(index)? })
    });
    let mut all: Vec<Movement> = joints.map(named).chain(targets).collect();
    all.sort_by(|a, b| b.metres.total_cmp(&a.metres));
    all
}

fn regions(avatar: &Avatar<'_>) -> Vec<Region> {
    let triangles = avatar.mesh_levels().surface() as usize;
    let region = |(index, name): (usize, &str)| Region {
        name: name.into(),
        triangles: (0..triangles)
            .filter(|&t| usize::from(avatar.triangle_region(t)) == index)
            .count(),
        gaussians: avatar.region_len(index),
        weight: avatar.region_weight(index),
        measured: avatar.importances().get(index).map(|importance| Measured {
            mobility_m_per_s: importance.mobility.get(),
            visible_share: importance.visible.get(),
            residual_share: importance.residual.get(),
        }),
    };
    avatar.region_names().enumerate().map(region).collect()
}

fn parts(avatar: &Avatar<'_>) -> Vec<Part> {
    let mut parts: Vec<Part> = Vec::new();
    let mut sum = 0;
    for s in avatar.sections() {
        let name = String::from_utf8_lossy(&s.tag).into_owned();
        let bytes = len_of(s);
        sum += bytes;
        match parts.iter_mut().find(|part| part.name == name) {
            Some(part) => (part.count, part.bytes) = (part.count + 1, part.bytes + bytes),
            None => parts.push(Part { name, count: 1, bytes }),
        }
    }
    let header = avatar.bytes().len() - sum;
    debug_assert!(header > preamble::LEN);
    parts.insert(0, Part { name: "header".into(), count: 1, bytes: header });
    parts
}
