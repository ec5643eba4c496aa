//! Where training puts more Gaussians.

use std::path::{Path, PathBuf};

use anyhow::Result;
use dermis_trainer::embed::choice::{Choice, Mask};
use dermis_trainer::embed::detail::Detail;
use dermis_trainer::methods::Method;

/// The choice of triangles, and what they get. Several choices add up.
#[derive(clap::Args)]
pub(crate) struct DetailArguments {
    /// More detail where this picture of the mesh at rest is bright and opaque: on triangles in sight
    /// with all corners inside. As large as the camera's picture; repeatable.
    #[arg(long, value_name = "IMG")]
    detail_mask: Vec<PathBuf>,
    /// The camera file of each --detail-mask, in the same order.
    #[arg(long, value_name = "CAM.json")]
    detail_camera: Vec<PathBuf>,
    /// More detail on what these joints and those below them move by more than half.
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    detail_joints: Vec<String>,
    /// More detail on what these materials paint.
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    detail_material: Vec<String>,
    /// lodavatar: levels that are made of the chosen triangles alone, after --levels [default: 1].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=8))]
    detail_levels: Option<u32>,
    /// Others: times as many Gaussians per area as elsewhere, of the same --gaussians [default: 4].
    #[arg(long, value_name = "X", value_parser = density)]
    detail_density: Option<f32>,
}

impl DetailArguments {
    /// Files that are read for it.
    pub(crate) fn files(&self) -> impl Iterator<Item = &Path> {
        self.detail_mask.iter().chain(&self.detail_camera).map(PathBuf::as_path)
    }

    /// What they ask for; masks are read.
    pub(crate) fn detail(&self, method: Method) -> Result<Detail> {
        let (masks, cameras) = (&self.detail_mask, &self.detail_camera);
        if masks.len() != cameras.len() {
            super::misuse("--detail-mask, --detail-camera: give one camera for each mask");
        }
        let subdivides = method == Method::Lodavatar;
        if self.detail_levels.is_some() && !subdivides {
            super::misuse("--detail-levels: is lodavatar's; choose --detail-density instead");
        }
        if self.detail_density.is_some() && subdivides {
            super::misuse("--detail-density: is not lodavatar's; choose --detail-levels instead");
        }
        let read = masks.iter().zip(cameras).map(|(mask, camera)| Mask::load(mask, camera));
        let default = Detail::default();
        let detail = Detail {
            choice: Choice {
                masks: read.collect::<Result<_>>()?,
                joints: self.detail_joints.clone(),
                materials: self.detail_material.clone(),
            },
            levels: self.detail_levels.unwrap_or(default.levels),
            density: self.detail_density.unwrap_or(default.density),
        };
        if !detail.is_asked() && (self.detail_levels.is_some() || self.detail_density.is_some()) {
            super::misuse(
                "--detail-levels, --detail-density: of what? \
                 choose by --detail-mask, --detail-joints or --detail-material",
            );
        }
        Ok(detail)
    }
}

/// 1 to 100: more would leave nothing for the rest.
fn density(text: &str) -> Result<f32, String> {
    let number = super::finite(text).ok().filter(|x| (1.0..=100.0).contains(x));
    number.ok_or_else(|| "give a number from 1 to 100".into())
}
