//! Placeholder tour.
pub mod import;
pub mod model;
pub mod picture;
