//! Placeholder tour.
pub mod model;
pub mod picture;
pub mod scene;
