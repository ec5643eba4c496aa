//! Selective detail enhancement (LoDAvatar, 3.6): more Gaussians where they matter, such as on face
//! and hands.
//!
//! Triangles are chosen by pictures ([`mask`]), or by the names of joints and materials. What is
//! chosen gets further levels of LoDAvatar's embedding ([`super::hierarchy`]), or a higher density in
//! the even placement ([`super::placement`]).

mod by_name;
pub mod mask;
#[cfg(test)]
mod tests;

use anyhow::{Result, ensure};

use crate::model::Model;
use crate::scene::{Painter, Pose, posed_vertices};
pub use mask::DetailMask;

/// Which triangles get more Gaussians, and how many more. Nothing is chosen by default.
#[derive(Clone, Debug)]
pub struct Detail {
    /// Triangles that lie in any of these pictures.
    pub masks: Vec<DetailMask>,
    /// Triangles all of whose corners are moved by more than half by these joints and those below
    /// them, taken together.
    pub joints: Vec<String>,
    /// Triangles of these materials.
    pub materials: Vec<String>,
    /// LoDAvatar: levels on top of those of the whole mesh.
    pub levels: u32,
    /// Even placement: Gaussians per area, relative to other triangles.
    pub density: f32,
}

impl Default for Detail {
    fn default() -> Self {
        Self {
            masks: Vec::new(),
            joints: Vec::new(),
            materials: Vec::new(),
            levels: 1,
            // As much as one level of LoDAvatar adds.
            density: 4.0,
        }
    }
}

impl Detail {
    /// Whether any choice is made.
    pub fn is_asked(&self) -> bool {
        !(self.masks.is_empty() && self.joints.is_empty() && self.materials.is_empty())
    }

    /// Whether each of the model's triangles is chosen; none if nothing is asked for.
    ///
    /// # Errors
    /// Where a name is unknown, or a mask, the joints or the materials choose no triangle: that is a
    /// mistake, which training would hide.
    pub fn select(&self, model: &Model) -> Result<Option<Vec<bool>>> {
        if !self.is_asked() {
            return Ok(None);
        }
        let mut choices = Vec::new();
        if !self.masks.is_empty() {
            let painter = Painter::new(model);
            let rest = posed_vertices(model, &Pose::rest(model));
            for mask in &self.masks {
                choices.push(mask.select(&painter, &rest)?);
            }
        }
        if !self.joints.is_empty() {
            choices.push(by_name::moved_by(model, &self.joints)?);
        }
        if !self.materials.is_empty() {
            choices.push(by_name::painted_with(model, &self.materials)?);
        }
        let any = |triangle| choices.iter().any(|choice: &Vec<bool>| choice[triangle]);
        Ok(Some((0..model.triangles.len()).map(any).collect()))
    }

    /// Multiplies the density wanted on each triangle where it is chosen.
    pub fn thicken(&self, weights: &mut [f32], selected: &[bool]) {
        let chosen = weights.iter_mut().zip(selected).filter(|(_, selected)| **selected);
        chosen.for_each(|(weight, _)| *weight *= self.density);
    }
}

/// Refuses a choice of nothing.
fn not_empty(choice: Vec<bool>, complaint: impl FnOnce() -> String) -> Result<Vec<bool>> {
    ensure!(choice.contains(&true), complaint());
    Ok(choice)
}
