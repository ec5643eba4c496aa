//! What can be wrong with the bytes.

use core::fmt;

use crate::section::VERSION;

/// Why bytes are not an avatar. Names the place (a section of SPEC.md) and the cause.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// The bytes end too early.
    Truncated {
        /// Where.
        place: &'static str,
        /// Bytes that the place needs from its start.
        needed: u64,
        /// Bytes that are there.
        present: u64,
    },
    /// The bytes contradict the specification.
    Malformed {
        /// Where.
        place: &'static str,
        /// What is wrong.
        cause: &'static str,
    },
    /// A checksum does not match: the bytes were damaged after they were written.
    Damaged {
        /// Where.
        place: &'static str,
    },
    /// A version that this crate does not read.
    Version {
        /// The version in the file.
        found: u16,
    },
    /// A version of the packed form that this crate does not read.
    PackedVersion {
        /// The version in the file.
        found: u16,
    },
    /// The caller's memory is less than the unpacked file.
    Room {
        /// Bytes of the file.
        needed: u64,
        /// Bytes of the memory.
        present: u64,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Truncated { place, needed, present } => write!(
                f,
                "{place}: needs {needed} bytes but only {present} are there; the file is cut short, copy it again"
            ),
            Self::Malformed { place, cause } => {
                write!(
                    f,
                    "{place}: {cause}; the file is damaged or no valid .dermis avatar, copy it or write it again"
                )
            }
            Self::Damaged { place } => {
                write!(
                    f,
                    "{place}: the checksum does not match; the file is damaged, copy it again"
                )
            }
            Self::PackedVersion { found } => {
                let reads = crate::packed::VERSION;
                let remedy = if found > reads { "update Dermis" } else { "pack the file again" };
                write!(
                    f,
                    "version {found} of the packed form is not supported (this reads version {reads}); {remedy}"
                )
            }
            Self::Room { needed, present } => write!(
                f,
                "the unpacked file has {needed} bytes, and there is room for {present}; lend more memory"
            ),
            Self::Version { found } => {
                let remedy =
                    if found > VERSION { "update Dermis" } else { "train or convert again" };
                write!(
                    f,
                    "version {found} of the format is not supported (this reads version {VERSION}); {remedy}"
                )
            }
        }
    }
}

impl core::error::Error for Error {}

pub(crate) fn malformed<T>(place: &'static str, cause: &'static str) -> Result<T, Error> {
    Err(Error::Malformed { place, cause })
}
