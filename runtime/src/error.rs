//! What a caller can get wrong.

use core::fmt;

/// Why a frame could not be drawn. Bad bytes are [`dermis_format::Error`]'s; odd numbers (NaN
/// poses, zero areas, Gaussians on the camera) are no errors, they draw nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// A lent slice of words is too short.
    Scratch {
        /// Words that are needed.
        needed: usize,
        /// Words that were lent.
        lent: usize,
    },
    /// A buffer is too short for its size and stride.
    Buffer {
        /// Which.
        buffer: Buffer,
        /// As many of its units are needed.
        needed: usize,
        /// As many were lent.
        lent: usize,
    },
    /// The rows of a buffer are nearer to each other than they are long.
    Stride {
        /// Which.
        buffer: Buffer,
        /// Its units in a row.
        needed: usize,
        /// From row to row.
        given: usize,
    },
    /// The avatar has no clip of this index.
    Clip {
        /// How many it has.
        clips: usize,
        /// The index.
        index: usize,
    },
    /// A slice of joints, weights or vertices does not fit the avatar.
    Pose {
        /// What does not fit.
        what: &'static str,
        /// What the avatar has.
        expected: usize,
        /// What was given.
        found: usize,
    },
    /// A frame of more than 16,384 pixels in a row or column, or of none.
    Size {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// The plan was made for another avatar, or the avatar posed for a plan of fewer Gaussians.
    Plan,
}

/// What the caller lends to be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Buffer {
    /// Pixels of an integer format, counted in bytes.
    Bytes,
    /// Pixels of a float format, counted in numbers.
    Numbers,
    /// Depths, counted in numbers.
    Depths,
    /// Posed Gaussians, counted in records.
    Gaussians,
}

impl Buffer {
    const fn name(self) -> &'static str {
        match self {
            Self::Bytes | Self::Numbers => "framebuffer",
            Self::Depths => "depths",
            Self::Gaussians => "posed Gaussians",
        }
    }

    const fn unit(self) -> &'static str {
        match self {
            Self::Bytes => "bytes",
            Self::Numbers | Self::Depths => "numbers",
            Self::Gaussians => "records",
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Scratch { needed, lent } => write!(
                f,
                "scratch: {lent} words were lent but {needed} are needed; lend {} more",
                needed.saturating_sub(lent)
            ),
            Self::Buffer { buffer, needed, lent } => write!(
                f,
                "{}: {lent} {unit} were lent but {needed} are needed; lend {} more",
                buffer.name(),
                needed.saturating_sub(lent),
                unit = buffer.unit(),
            ),
            Self::Stride { buffer, needed, given } => write!(
                f,
                "{}: its stride is {given} {unit} but a row has {needed}; give a stride of at least that",
                buffer.name(),
                unit = buffer.unit(),
            ),
            Self::Clip { clips, index } => {
                write!(
                    f,
                    "pose: there is no clip {index}, the avatar has {clips}; count them from 0"
                )
            }
            Self::Pose { what, expected, found } => {
                write!(
                    f,
                    "pose: {found} {what} were given but the avatar has {expected}; give as many"
                )
            }
            Self::Size { width, height } => {
                write!(
                    f,
                    "camera: {width}×{height} pixels cannot be drawn; choose 1 to 16,384 each way"
                )
            }
            Self::Plan => {
                f.write_str("plan: it was made for another avatar, or has more than the avatar was posed for; plan or pose again")
            }
        }
    }
}

impl core::error::Error for Error {}
