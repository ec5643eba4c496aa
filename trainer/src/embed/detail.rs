//! Selective detail enhancement (LoDAvatar, 3.6): more Gaussians where they matter, such as on face
//! and hands.
//!
//! What is chosen ([`super::choice`]) gets further levels of LoDAvatar's embedding ([`super::hierarchy`]), or a
//! higher density in the even placement ([`super::placement`]).

use anyhow::Result;

use super::choice::Choice;
use crate::model::Model;

/// Which triangles get more Gaussians, and how many more. Nothing is chosen by default.
#[derive(Clone, Debug)]
pub struct Detail {
    /// Which.
    pub choice: Choice,
    /// LoDAvatar: levels on top of those of the whole mesh.
    pub levels: u32,
    /// Even placement: Gaussians per area, relative to other triangles.
    pub density: f32,
}

impl Default for Detail {
    fn default() -> Self {
        Self {
            choice: Choice::default(),
            levels: 1,
            // As much as one level of LoDAvatar adds.
            density: 4.0,
        }
    }
}

impl Detail {
    /// Whether any choice is made.
    pub fn is_asked(&self) -> bool {
        !self.choice.is_empty()
    }

    /// Whether each of the model's triangles is chosen; none if nothing is asked for.
    ///
    /// # Errors
    /// As [`Choice::select`].
    pub fn select(&self, model: &Model) -> Result<Option<Vec<bool>>> {
        self.is_asked().then(|| self.choice.select(model)).transpose()
    }

    /// Multiplies the density wanted on each triangle where it is chosen.
    pub fn thicken(&self, weights: &mut [f32], selected: &[bool]) {
        let chosen = weights.iter_mut().zip(selected).filter(|(_, selected)| **selected);
        chosen.for_each(|(weight, _)| *weight *= self.density);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_chosen_unless_asked() {
        assert!(matches!(Detail::default().select(&crate::demo::demo_avatar()), Ok(None)));
    }

    #[test]
    fn density_is_multiplied_where_chosen() {
        let mut weights = [1.0, 1.0, 0.1, 0.1];
        Detail::default().thicken(&mut weights, &[true, false, true, false]);
        assert_eq!(weights, [4.0, 1.0, 0.4, 0.1]);
    }
}
