//! Where Gaussians are put, and what they are before training.
//!
//! [`surface`] measures the mesh at rest, [`density`] says how densely points stand where, [`placement`] spreads them in coarse to
//! fine order, [`hierarchy`] is LoDAvatar's embedding, [`initial`] gives points their first
//! colour, scale and opacity, [`sides`] says which backs are seen, [`detail`] which triangles get more.

pub mod density;
pub mod detail;
pub mod hierarchy;
pub mod initial;
pub mod placement;
pub mod sides;
pub mod surface;
