//! The `dermis` command.
fn main() {}
