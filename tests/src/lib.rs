//! What the tests that span the crates share.
//!
//! 1. [`small`] trains the built-in avatar in seconds.
//! 2. [`picture`] draws and compares pictures.
//! 3. [`compare`] measures the runtime against the reference, and a file against its cloud.
//! 4. [`golden`] compares with stored pictures and shows the difference.
//! 5. [`files`] finds the workspace and its data, and makes small glTF files; [`splats`] makes PLYs of
//!    Gaussians and draws them without our file in between, [`splat_files`] and [`spz`] write them as other files,
//!    [`mounted`] puts those that hang on a mesh in their places; [`converted`] compares.
//! 6. [`command`] builds and runs the `dermis` command.

pub mod command;
pub mod compare;
pub mod converted;
pub mod files;
pub mod golden;
pub mod mounted;
pub mod picture;
pub mod small;
pub mod splat_files;
pub mod splats;
pub mod spz;
