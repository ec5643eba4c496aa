//! One file a subcommand: its arguments, and what it prints.

pub(crate) mod demo;
pub(crate) mod eval;
pub(crate) mod info;
pub(crate) mod render;
pub(crate) mod train;

use std::path::Path;

use anyhow::{Context, Result};
use dermis_runtime::Avatar;
use serde::Serialize;

use crate::Common;

/// Reads a file's bytes as an avatar and hands it on.
fn with_avatar<T>(path: &Path, act: impl FnOnce(&Avatar<'_>) -> Result<T>) -> Result<T> {
    let bytes = dermis_trainer::output::read(path)?;
    let avatar = Avatar::parse(&bytes).with_context(|| path.display().to_string())?;
    act(&avatar).with_context(|| path.display().to_string())
}

/// Prints `value` as JSON, or what `text` makes of it.
fn print<T: Serialize>(common: &Common, value: &T, text: impl FnOnce(&T) -> String) -> Result<()> {
    if common.json {
        println!("{}", serde_json::to_string(value)?);
    } else {
        print!("{}", text(value));
    }
    Ok(())
}
