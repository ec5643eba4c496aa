//! What the tests that span the crates share.
//!
//! 1. [`small`] trains the built-in avatar in seconds.
//! 2. [`picture`] draws, compares and measures pictures.
//! 3. [`golden`] compares with stored pictures and shows the difference.
//! 4. [`files`] finds the workspace and its data, and makes small glTF files.
//! 5. [`command`] builds and runs the `dermis` command.

pub mod command;
pub mod files;
pub mod golden;
pub mod picture;
pub mod small;
