//! Placeholder tour.
pub mod metrics;
pub mod model;
pub mod picture;
