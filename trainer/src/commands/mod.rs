//! One file a subcommand: its arguments, and what it prints.

pub(crate) mod bench;
pub(crate) mod convert;
pub(crate) mod demo;
pub(crate) mod eval;
pub(crate) mod info;
pub(crate) mod options;
pub(crate) mod render;
pub(crate) mod train;

use std::path::Path;

use anyhow::{Context, Result};
use clap::CommandFactory;
use clap::error::ErrorKind;
use dermis_runtime::Avatar;
use serde::Serialize;

use crate::Common;

/// Reads a file's bytes as an avatar and hands it on.
fn with_avatar<T>(path: &Path, act: impl FnOnce(&Avatar<'_>) -> Result<T>) -> Result<T> {
    let bytes = dermis_trainer::output::read(path)?;
    let avatar = Avatar::parse(&bytes).with_context(|| path.display().to_string())?;
    act(&avatar).with_context(|| path.display().to_string())
}

/// Ends the program for options that contradict each other, as clap does for a bad one: exit code 2.
pub(crate) fn misuse(message: &str) -> ! {
    crate::Cli::command().error(ErrorKind::ArgumentConflict, message).exit()
}

/// A number that is neither infinite nor NaN.
fn finite(text: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|x: &f32| x.is_finite());
    number.ok_or_else(|| "give a finite number".into())
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
