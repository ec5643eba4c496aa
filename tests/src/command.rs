//! The `dermis` command as its users run it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use serde_json::Value;

/// The folder of this build's profile, such as `target/debug`.
fn profile() -> PathBuf {
    let test = std::env::current_exe().expect("a test has a path");
    // target/debug/deps/test-0123…
    test.ancestors().nth(2).expect("tests stand in a folder of the profile").to_owned()
}

/// The target folder of this build.
pub fn target() -> PathBuf {
    profile().parent().expect("the profile is a folder of the target").to_owned()
}

/// Whether `binary` is younger than every source it is made of. Cargo would know better, but asked
/// for this package alone it may choose other features of dependencies than for the whole
/// workspace, and build those once more.
fn is_fresh(binary: &Path) -> bool {
    let changed = |path: &Path| path.metadata().and_then(|m| m.modified()).ok();
    let Some(built) = changed(binary) else { return false };
    let root = crate::files::workspace();
    let mut open: Vec<PathBuf> = ["format", "runtime", "trainer", "Cargo.toml", "Cargo.lock"]
        .map(|name| root.join(name))
        .to_vec();
    while let Some(path) = open.pop() {
        if changed(&path).is_none_or(|changed| changed > built) {
            return false;
        }
        let entries = std::fs::read_dir(&path).into_iter().flatten().flatten();
        open.extend(entries.map(|entry| entry.path()));
    }
    true
}

/// The path of `dermis`, built on the first call in the profile and folder of the running test.
pub fn dermis() -> &'static Path {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| {
        let folder = profile();
        let binary = folder.join(format!("dermis{}", std::env::consts::EXE_SUFFIX));
        if is_fresh(&binary) {
            return binary;
        }
        let name = folder.file_name().expect("a profile has a name").to_string_lossy();
        let name = if name == "debug" { "dev" } else { &name };
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let built = Command::new(cargo)
            .args(["build", "--quiet", "--package", "dermis-trainer", "--bin", "dermis"])
            .args(["--profile", name, "--target-dir"])
            .arg(target())
            .current_dir(crate::files::workspace())
            .status();
        assert!(built.expect("cargo runs").success(), "dermis does not build");
        binary
    })
}

/// A run of `dermis`.
#[derive(Debug)]
pub struct Run {
    /// Its exit code; none where a signal ended it.
    pub code: Option<i32>,
    /// What it printed.
    pub stdout: String,
    /// What it said beside that.
    pub stderr: String,
}

/// Runs `dermis` in `folder` with arguments that blanks separate.
pub fn run(folder: &Path, arguments: &str) -> Run {
    let Output { status, stdout, stderr } = Command::new(dermis())
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .output()
        .expect("dermis starts");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("it prints UTF-8");
    Run { code: status.code(), stdout: text(stdout), stderr: text(stderr) }
}

/// Runs, and checks that the folder holds what it held and nothing was printed.
fn run_in_vain(folder: &Path, arguments: &str) -> Run {
    let before = crate::files::names(folder);
    let run = run(folder, arguments);
    assert_eq!(run.stdout, "", "{arguments}: nothing on stdout");
    assert_eq!(crate::files::names(folder), before, "{arguments}: no file made, none left");
    run
}

/// A failure: exit code 1 and one line that holds all of `parts`, the file and the remedy.
///
/// # Panics
///
/// Where it is not so.
pub fn fails(folder: &Path, arguments: &str, parts: &[&str]) {
    let run = run_in_vain(folder, arguments);
    assert_eq!(run.code, Some(1), "{arguments}: {run:?}");
    assert!(run.stderr.ends_with('\n') && run.stderr.lines().count() == 1, "{arguments}: {run:?}");
    for part in parts {
        assert!(run.stderr.contains(part), "{arguments}: {part:?} is not in {:?}", run.stderr);
    }
    println!("{}", run.stderr.trim_end());
}

/// Bad usage: exit code 2 and a message that names the option.
///
/// # Panics
///
/// Where it is not so.
pub fn misuses(folder: &Path, arguments: &str, option: &str) {
    let run = run_in_vain(folder, arguments);
    assert_eq!(run.code, Some(2), "{arguments}: {run:?}");
    assert!(run.stderr.contains(option), "{arguments}: {option:?} is not in {:?}", run.stderr);
}

/// The one JSON object on stdout, and nothing else there.
///
/// # Panics
///
/// Where it is not so.
pub fn json(folder: &Path, arguments: &str) -> Value {
    let run = run(folder, &format!("{arguments} --json"));
    assert_eq!(run.code, Some(0), "{arguments}: {run:?}");
    assert_eq!(run.stdout.lines().count(), 1, "{arguments}: one line");
    let value: Value = serde_json::from_str(&run.stdout).expect("stdout is JSON");
    assert!(value.is_object(), "{arguments}: an object");
    value
}

/// Whether a JSON object has all keys, which blanks separate.
///
/// # Panics
///
/// Where one is missing.
pub fn has_keys(value: &Value, keys: &str) {
    for key in keys.split_whitespace() {
        assert!(value.get(key).is_some(), "no {key} in {value}");
    }
}
