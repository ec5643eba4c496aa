//! The hard cases of the mathematics, by name: what each draws, in numbers, by every kernel of this
//! machine and by the one that vectors fall back to, with f64 beside it.
//!
//! A case states how many Gaussians touch a pixel's bounds, how many pixels they cover, what some
//! pixels are, and how far the picture may be from the f64 reference's, in 8-bit steps, and why so
//! far. [`case`] says how that is checked; `-- --nocapture` prints what was found.
//!
//! Beside these stand, in the runtime's own tests (`runtime/tests/hard_cases`): odd numbers in every
//! place of a camera, a joint and a vertex, needles down to nothing, hostile files, scratch that is
//! too short, strides and framebuffers that do not fit, bands and shares.

mod case;
mod frames;
mod gaussians;
mod meshes;
mod odd;
mod scenes;
