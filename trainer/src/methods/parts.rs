//! The triangles that options choose.

use anyhow::Result;

use crate::embed::regions::Regions;
use crate::model::Model;
use crate::options::Options;

/// What parts of a mesh its options tell from the rest.
#[derive(Clone, Debug)]
pub struct Parts {
    /// Whether each triangle is chosen for detail.
    pub detail: Option<Vec<bool>>,
    /// Where each triangle's Gaussians have their order.
    pub regions: Regions,
}

impl Parts {
    /// Those of a model.
    ///
    /// # Errors
    /// Where nothing is as described.
    pub fn choose(model: &Model, options: &Options) -> Result<Self> {
        Ok(Self {
            detail: options.detail.select(model)?,
            regions: Regions::cut(model, &options.regions)?,
        })
    }
}
