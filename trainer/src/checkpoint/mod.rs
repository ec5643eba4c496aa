//! Training that may be killed at any moment and goes on when it is run again, to the same bytes.
//!
//! A run is a row of descents ([`crate::methods`]). All between them follows from the mesh, the options and what the
//! descents before came to, and is done again, as are the short ones that try coarser meshes; only descents are kept. In the
//! folder lie
//!
//! | file | holds |
//! |---|---|
//! | `finished.N` | what descent N came to, written once, at its end |
//! | `running` | the descent that runs, written again from time to time |
//! | `result` | the trained avatar; all others are removed when it is there |
//! | `lock` | nothing; whoever trains holds it, and the system lets go of it when that process ends |
//!
//! and temporary files, which get one of these names when they are whole and on the disk. Each begins with 24 bytes
//! (little-endian): magic, CRC32 of all that follows, then CRC32s of the program's version, the mesh, and the
//! options. The rest is postcard's. What is damaged or of another training is refused, never guessed at: a training
//! that silently began anew would be a loss of hours.
//!
//! 1. `fingerprint` tells trainings apart.
//! 2. `file` makes and checks the bytes of a file.
//! 3. `folder` names, locks, reads and writes files.
//! 4. [`Journal`] says when, and follows the descents of a run.

mod file;
mod fingerprint;
mod folder;
mod journal;
#[cfg(test)]
mod tests;

use std::path::PathBuf;
use std::time::Duration;

pub use journal::Journal;

/// Where and when training keeps what it came to. Neither changes the result.
#[derive(Clone, Debug)]
pub struct Checkpoint {
    /// Made where it is absent.
    pub folder: PathBuf,
    /// How often, beside the end of each descent.
    pub every: Every,
    /// Steps that this run may take: with the next one it ends with an error, and that is lost as by a kill.
    pub at_most: Option<u32>,
}

/// How often.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Every {
    /// After this time on the clock.
    Time(Duration),
    /// Whenever the steps of a descent, of which several may be taken at once, pass a multiple of this.
    Steps(u32),
}

impl Checkpoint {
    /// In `folder`, every 10 seconds: a checkpoint takes less than a hundredth of that.
    pub fn new(folder: PathBuf) -> Self {
        Self { folder, every: Every::Time(Duration::from_secs(10)), at_most: None }
    }
}
