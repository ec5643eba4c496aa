//! The `dermis` command: arguments, files, exit codes. What it does stands in the library.

mod commands;

use std::process::ExitCode;

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
    /// Worker threads; 0: one for each core.
    #[arg(long, global = true, default_value_t = 0, value_name = "N")]
    threads: usize,
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
    /// Prints what a file holds, byte by byte.
    Info(commands::info::Arguments),
    /// Draws one picture.
    Render(commands::render::Arguments),
    /// Measures quality against the mesh, on unseen views and poses.
    Eval(commands::eval::Arguments),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    // Fails only if a pool was built before, and there was none.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(cli.common.threads).build_global();
    let done = match cli.command {
        Command::Demo(arguments) => commands::demo::run(&arguments, &cli.common),
        Command::Train(arguments) => commands::train::run(&arguments, &cli.common),
        Command::Info(arguments) => commands::info::run(&arguments, &cli.common),
        Command::Render(arguments) => commands::render::run(&arguments, &cli.common),
        Command::Eval(arguments) => commands::eval::run(&arguments, &cli.common),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("dermis: {}", one_line(&format!("{error:#}")));
            ExitCode::FAILURE
        }
    }
}

/// Messages of libraries may hold line breaks.
fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}
