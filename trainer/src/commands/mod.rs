//! One file a subcommand: its arguments, and what it prints.

pub(crate) mod bench;
pub(crate) mod convert;
pub(crate) mod demo;
pub(crate) mod detail;
pub(crate) mod eval;
pub(crate) mod export;
pub(crate) mod info;
pub(crate) mod options;
pub(crate) mod pack;
pub(crate) mod regions;
pub(crate) mod render;
pub(crate) mod reproduce;
pub(crate) mod train;
pub(crate) mod unpack;

use std::io::{ErrorKind, Write};
use std::path::Path;

use anyhow::{Context, Result};
use clap::CommandFactory;
use dermis_format::packed;
use dermis_runtime::Avatar;
use serde::Serialize;

use crate::Common;

/// The bytes of an avatar, unpacked if they are packed.
fn avatar_bytes(path: &Path) -> Result<Vec<u8>> {
    unpacked(path, dermis_trainer::output::read(path)?)
}

/// The avatar in a file that may be packed.
fn unpacked(path: &Path, bytes: Vec<u8>) -> Result<Vec<u8>> {
    if packed::is_packed(&bytes) {
        packed::unpack(&bytes).with_context(|| path.display().to_string())
    } else {
        Ok(bytes)
    }
}

/// Reads a file's bytes as an avatar and hands it on.
fn with_avatar<T>(path: &Path, act: impl FnOnce(&Avatar<'_>) -> Result<T>) -> Result<T> {
    let bytes = avatar_bytes(path)?;
    let avatar = Avatar::parse(&bytes).with_context(|| path.display().to_string())?;
    act(&avatar).with_context(|| path.display().to_string())
}

/// Ends the program for options that contradict each other, as clap does for a bad one: exit code 2.
pub(crate) fn misuse(message: &str) -> ! {
    let mut program = crate::Cli::command();
    program.build();
    let named = std::env::args_os().skip(1).find_map(|word| program.find_subcommand(word).cloned());
    named.unwrap_or(program).error(clap::error::ErrorKind::ArgumentConflict, message).exit()
}

/// A number that is neither infinite nor NaN.
fn finite(text: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|x: &f32| x.is_finite());
    number.ok_or_else(|| "give a finite number".into())
}

/// A finite number not below 0.
fn not_negative(text: &str) -> Result<f32, String> {
    finite(text).ok().filter(|&x| x >= 0.0).ok_or_else(|| "give a number not below 0".into())
}

/// A number from 0 to 1.
fn share(text: &str) -> Result<f32, String> {
    finite(text).ok().filter(|x| (0.0..=1.0).contains(x)).ok_or_else(|| "give 0 to 1".into())
}

/// Three such numbers.
fn color(text: &str) -> Result<[f32; 3], String> {
    let numbers: Result<Vec<f32>, _> = text.split(',').map(share).collect();
    let color = numbers.ok().and_then(|numbers| numbers.try_into().ok());
    color.ok_or_else(|| "give red, green and blue from 0 to 1, as in 0,0,0".into())
}

/// A finite number above 0.
fn positive(text: &str) -> Result<f32, String> {
    finite(text).ok().filter(|&x| x > 0.0).ok_or_else(|| "give a number above 0".into())
}

/// Prints `value` as JSON, or what `text` makes of it.
fn print<T: Serialize>(common: &Common, value: &T, text: impl FnOnce(&T) -> String) -> Result<()> {
    // Names in files may hold what terminals obey.
    let plain = |c: char| if c.is_control() && c != '\n' { ' ' } else { c };
    let text = if common.json {
        serde_json::to_string(value)? + "\n"
    } else {
        text(value).chars().map(plain).collect()
    };
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        // Who reads has seen enough.
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written.context("standard output: cannot be written"),
    }
}
