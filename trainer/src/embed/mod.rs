//! Where Gaussians are put, and what they are before training.
//!
//! [`surface`] measures the mesh at rest, [`density`] says how densely points stand where, [`placement`] spreads them in coarse to
//! fine order, [`hierarchy`] is LoDAvatar's embedding, [`initial`] gives points their first
//! colour, scale and opacity, [`sides`] says which backs are seen. A [`choice`] of triangles is what [`detail`] gets
//! more, or what [`regions`] gets an order of its own, whose [`importance`] is measured. [`mesh_levels`] are coarser meshes, whose
//! triangles are [`carriers`] of the first Gaussians.

pub mod carriers;
pub mod choice;
pub mod density;
pub mod detail;
pub mod hierarchy;
pub mod importance;
pub mod initial;
pub mod mesh_levels;
pub mod placement;
pub mod regions;
pub mod sides;
pub mod surface;
