//! On what is measured.

use std::fs;
use std::thread::available_parallelism;

/// What the system calls the CPU; the architecture where it does not say.
pub fn cpu() -> String {
    let names = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = names
        .lines()
        .filter_map(|line| line.split_once(':'))
        .find(|(key, _)| key.trim() == "model name")
        .map(|(_, name)| name.split_whitespace().collect::<Vec<_>>().join(" "));
    name.filter(|name| !name.is_empty()).unwrap_or_else(|| std::env::consts::ARCH.to_owned())
}

/// Threads that this process may run at once.
pub fn cores() -> usize {
    available_parallelism().map_or(1, usize::from)
}
