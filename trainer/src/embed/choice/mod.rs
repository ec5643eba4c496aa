//! Choosing triangles: by pictures ([`mask`]), or by the names of joints and materials.

mod by_name;
pub mod mask;
#[cfg(test)]
mod tests;

use anyhow::{Result, ensure};

use crate::model::Model;
use crate::scene::{Painter, Pose, posed_vertices};
pub use mask::Mask;

/// Triangles of a mesh. Several ways to choose add up; by default nothing is chosen.
#[derive(Clone, Debug, Default)]
pub struct Choice {
    /// Triangles that lie in any of these pictures.
    pub masks: Vec<Mask>,
    /// Triangles all of whose corners are moved by more than half by these joints and those below
    /// them, taken together.
    pub joints: Vec<String>,
    /// Triangles of these materials.
    pub materials: Vec<String>,
}

impl Choice {
    /// Whether nothing is asked for.
    pub fn is_empty(&self) -> bool {
        self.masks.is_empty() && self.joints.is_empty() && self.materials.is_empty()
    }

    /// Whether each of the model's triangles is chosen.
    ///
    /// # Errors
    /// Where a name is unknown, or a mask, the joints or the materials choose no triangle: that is a
    /// mistake, which training would hide.
    pub fn select(&self, model: &Model) -> Result<Vec<bool>> {
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
        Ok((0..model.triangles.len()).map(any).collect())
    }
}

/// Refuses a choice of nothing.
fn not_empty(choice: Vec<bool>, complaint: impl FnOnce() -> String) -> Result<Vec<bool>> {
    ensure!(choice.contains(&true), complaint());
    Ok(choice)
}
