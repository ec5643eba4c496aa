//! What a file is made of: Gaussians, the mesh that carries them, the levels they change at.

use anyhow::{Context, Result};
use dermis_format::source::Source;
use dermis_format::{Avatar, FrameKind};
use dermis_runtime::frame::Frame;
use dermis_runtime::{Kernel, Pose, Posed};

use super::splats::Splats;
use crate::model::Model;
use crate::package;
use crate::scene::{self, KeyFrame};

/// Poses of the clips in which coarser levels are trained.
const KEY_FRAMES: usize = 4;

/// Gaussians on their way into a file.
#[derive(Clone, Debug, Default)]
pub struct Assembly {
    /// In the frames of their triangles, in units of a frame's size; without a mesh in world axes, metres.
    pub splats: Splats,
    /// What carries them, if anything does.
    pub mount: Option<Mount>,
    /// Levels that were trained, if any.
    pub levels: Option<Levels>,
}

/// Where Gaussians hang.
#[derive(Clone, Debug)]
pub struct Mount {
    /// The mesh.
    pub carrier: Carrier,
    /// The kind of frame in which they stand.
    pub frame: FrameKind,
    /// Triangle of each.
    pub triangles: Vec<u32>,
}

/// Levels that differ in who is there and in opacity alone.
#[derive(Clone, Debug, Default)]
pub struct Levels {
    /// How many Gaussians each level adds, in their order.
    pub layers: Vec<u32>,
    /// Of each Gaussian, its opacities at the levels after the one that adds it; empty with one level.
    pub later_opacities: Vec<Vec<f32>>,
}

/// A mesh to hang Gaussians on, as the runtime will pose it.
#[derive(Clone, Debug)]
pub struct Carrier {
    /// Its file, for errors.
    pub(super) name: String,
    /// Mesh, rig and clips, both sides of every triangle shown: free Gaussians have no back.
    pub(super) source: Source,
    /// Poses in which coarser levels are trained.
    pub(super) key_frames: Vec<KeyFrame>,
    /// World, metres, at rest.
    vertices: Vec<[f32; 3]>,
}

impl From<Splats> for Assembly {
    /// Gaussians that stand free.
    fn from(splats: Splats) -> Self {
        Self { splats, ..Self::default() }
    }
}

impl Mount {
    /// The middle of each Gaussian's triangle at rest: world, metres.
    pub(super) fn centers(&self) -> Vec<[f32; 3]> {
        let center = |&triangle: &u32| {
            let [a, b, c] = self.carrier.corners(triangle);
            core::array::from_fn(|i| ((a[i] + b[i] + c[i]) / 3.0) as f32)
        };
        self.triangles.iter().map(center).collect()
    }
}

impl Carrier {
    /// A mesh with its rig and clips, from the file `name`.
    ///
    /// # Errors
    ///
    /// Where the format cannot hold it.
    pub fn of(model: &Model, name: String) -> Result<Self> {
        let mut source = package::rigged_mesh(model);
        source.mesh.two_sided.fill(true);
        // Positions and weights are rounded in a file: what counts is where the runtime puts them.
        let bytes = package::encode(&source).with_context(|| name.clone())?;
        let avatar = Avatar::parse(&bytes)?;
        let mut scratch = vec![0; Posed::scratch_len(&avatar)];
        let posed = Posed::new(&avatar, &Pose::Rest, Kernel::detect(), &mut scratch)?;
        let clips = scene::training_clips(model, None);
        let key_frames = scene::training_key_frames(model, &clips, KEY_FRAMES);
        Ok(Self { vertices: posed.vertices().to_vec(), name, source, key_frames })
    }

    /// How many triangles it has.
    pub fn triangles(&self) -> usize {
        self.source.mesh.triangles.len()
    }

    /// Corners at rest: world, metres.
    pub(super) fn corners(&self, triangle: u32) -> [[f64; 3]; 3] {
        let corner = |vertex: u32| self.vertices[vertex as usize].map(f64::from);
        self.source.mesh.triangles[triangle as usize].map(corner)
    }

    /// The frame at rest; none for a triangle without area.
    pub(super) fn frame(&self, kind: FrameKind, triangle: u32) -> Option<Frame<f64>> {
        Frame::of_triangle(kind, self.corners(triangle))
    }
}
