//! Ways to train a cloud: ours and the papers', on the same machinery.
//!
//! 1. [`Workshop`] holds what all share: the posed mesh, its pictures, placement and descent.
//! 2. `parts` are the triangles that options choose; `culling` says what a trained cloud loses by it,
//!    `curves` how good a picture each count makes, `samples` which triangles stand for the others.
//! 3. `dermis` is ours, and `mesh_trials` say which coarser meshes its first layers stand on; [`Method`] names the others, in
//!    `lodavatar`, `lapisgs` and `alone`.

mod alone;
mod culling;
mod curves;
mod dermis;
mod lapisgs;
mod lodavatar;
mod mesh_trials;
mod parts;
mod samples;
mod workshop;

pub use culling::Culling;
pub use mesh_trials::{MeshTrial, TriedMesh, choose_meshes};
pub use parts::Parts;
pub use workshop::{Setting, Workshop};

use anyhow::Result;
use dermis_format::source::Mathematics;
use dermis_format::{FrameKind, ScaleLaw};

use crate::optimize::cloud::{Cloud, Freedom};

/// How Gaussians are placed and trained.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Method {
    /// Even placement in one nested order; every prefix is trained.
    Dermis,
    /// LoDAvatar: uniform subdivision, level by level, earlier levels fixed.
    Lodavatar,
    /// LapisGS: layer by layer on an image pyramid, earlier layers fixed but for an opacity per level.
    Lapisgs,
    /// LapisGS with earlier layers fixed altogether.
    Freeze,
    /// Trained at full size alone, to be shown at every scale.
    Single,
    /// Trained for its count and size alone: one of a series of files.
    Multiscale,
    /// As single; a coarser level leaves out what is least significant.
    Downsample,
}

impl Method {
    /// What its Gaussians are meant for: ours widen in a prefix of the first level, LoDAvatar's stand on that paper's frames.
    pub fn mathematics(self) -> Mathematics {
        let usual = Mathematics { scale_law: ScaleLaw::Constant, ..Mathematics::default() };
        match self {
            Self::Dermis => Mathematics::default(),
            Self::Lodavatar => Mathematics { frame: FrameKind::Area, ..usual },
            _ => usual,
        }
    }

    /// Trains a cloud for each region; but for [`Self::Dermis`] there must be one only.
    pub fn train(self, shop: &mut Workshop<'_>) -> Result<Vec<Cloud>> {
        let cloud = match self {
            Self::Dermis => return dermis::train(shop),
            Self::Lodavatar => lodavatar::train(shop),
            Self::Lapisgs => lapisgs::train(shop, Freedom::Opacity),
            Self::Freeze => lapisgs::train(shop, Freedom::Fixed),
            Self::Single | Self::Multiscale => alone::train(shop),
            Self::Downsample => alone::downsample(shop),
        };
        Ok(vec![cloud?])
    }
}
