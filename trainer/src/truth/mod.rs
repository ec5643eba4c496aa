//! The pictures that training matches: made once, kept small, in no more memory than allowed.
//!
//! 1. [`crop`] cuts a picture to what the mesh covers; `runs` writes its rows as bytes.
//! 2. [`store`] keeps those bytes in memory up to a bound, and the rest in one temporary file (`spill`).
//! 3. [`mod@observe`] makes the pictures of all cameras and key frames.
//! 4. [`scale`] says what a coarser picture's camera and rectangle are.

pub mod crop;
pub mod observe;
mod runs;
pub mod scale;
mod spill;
pub mod store;

#[cfg(test)]
mod tests;

pub use crop::{Crop, Scratch};
pub use observe::observe;
pub use scale::scaled;
pub use store::{Store, Stored};

use dermis_runtime::Camera;

/// A picture to be matched.
#[derive(Debug)]
pub struct TrainingView {
    /// Index of its pose.
    pub stage: usize,
    /// Who looks.
    pub camera: Camera,
    /// What is seen.
    pub truth: Stored,
}
