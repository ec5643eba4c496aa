//! Placeholder tour.
#![no_std]

pub mod camera;
pub use camera::Camera;
