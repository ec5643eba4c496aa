//! Placeholder tour.
pub mod demo;
pub mod import;
pub mod metrics;
pub mod model;
pub mod picture;
pub mod scene;
