//! The `dermis` command: arguments, files, exit codes. What it does stands in the library.

mod commands;

use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::{Parser, Subcommand};

/// Turns rigged meshes into layered Gaussian avatars, draws and measures them.
#[derive(Parser)]
#[command(name = "dermis", version)]
struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

/// Options of every command.
#[derive(clap::Args)]
pub(crate) struct Common {
    /// Print one JSON object on stdout, and nothing else there.
    #[arg(long, global = true)]
    json: bool,
    /// Worker threads; 0: one for each core. `bench` takes several numbers.
    #[arg(long, global = true, value_delimiter = ',', value_name = "N", value_parser = clap::value_parser!(u16).range(0..=1024))]
    threads: Vec<u16>,
    /// Seed of everything random.
    #[arg(long, global = true, default_value_t = 1, value_name = "N")]
    seed: u64,
}

#[derive(Subcommand)]
enum Command {
    /// The whole path on a small built-in avatar: train, pack, render at several budgets, report.
    Demo(commands::demo::Arguments),
    /// Trains an avatar from a rigged mesh (GLB, glTF or OBJ).
    Train(commands::train::Arguments),
    /// Turns trained Gaussians of another program into an avatar, on a mesh or without.
    Convert(commands::convert::Arguments),
    /// Writes posed Gaussians as a file of other programs.
    Export(commands::export::Arguments),
    /// Packs an avatar for the wire: the same bytes come out of `unpack`, and all other commands read packed files, too.
    Pack(commands::pack::Arguments),
    /// Unpacks a packed avatar: the bytes that were packed.
    Unpack(commands::unpack::Arguments),
    /// Prints what a file holds, byte by byte.
    Info(commands::info::Arguments),
    /// Draws one picture.
    Render(commands::render::Arguments),
    /// Measures quality against the mesh, on unseen views and poses.
    Eval(commands::eval::Arguments),
    /// Measures the time of every stage of a frame, and its error.
    Bench(commands::bench::Arguments),
    /// Makes a paper's tables for a mesh: trains and measures its methods and ours.
    Reproduce(commands::reproduce::Arguments),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    match run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("dermis: {}", one_line(&format!("{error:#}")));
            ExitCode::FAILURE
        }
    }
}

fn run(cli: &Cli) -> Result<()> {
    let threads = match (&cli.command, cli.common.threads.as_slice()) {
        // Those that it measures are its own.
        (Command::Bench(_), _) | (_, []) => 0,
        (_, &[threads]) => usize::from(threads),
        _ => commands::misuse("--threads: this command takes one number; bench takes several"),
    };
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()
        .context("the worker threads cannot be started; choose fewer with --threads")?;
    match &cli.command {
        Command::Demo(arguments) => commands::demo::run(arguments, &cli.common),
        Command::Train(arguments) => commands::train::run(arguments, &cli.common),
        Command::Convert(arguments) => commands::convert::run(arguments, &cli.common),
        Command::Export(arguments) => commands::export::run(arguments, &cli.common),
        Command::Pack(arguments) => commands::pack::run(arguments, &cli.common),
        Command::Unpack(arguments) => commands::unpack::run(arguments, &cli.common),
        Command::Info(arguments) => commands::info::run(arguments, &cli.common),
        Command::Render(arguments) => commands::render::run(arguments, &cli.common),
        Command::Eval(arguments) => commands::eval::run(arguments, &cli.common),
        Command::Bench(arguments) => commands::bench::run(arguments, &cli.common),
        Command::Reproduce(arguments) => commands::reproduce::run(arguments, &cli.common),
    }
}

/// Messages of libraries may hold line breaks, and names in files what terminals obey.
fn one_line(message: &str) -> String {
    let words = message.split(|c: char| c.is_whitespace() || c.is_control());
    words.filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ")
}
