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
    /// The framebuffer is too short for its size and stride.
    Framebuffer {
        /// Bytes that are needed.
        needed: usize,
        /// Bytes that were lent.
        lent: usize,
    },
    /// The framebuffer's rows are nearer to each other than they are long.
    Stride {
        /// Bytes of a row.
        needed: usize,
        /// Bytes from row to row.
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
    /// The plan was made for another avatar.
    Plan,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Scratch { needed, lent } => write!(
                f,
                "scratch: {lent} words were lent but {needed} are needed; lend {} more",
                needed.saturating_sub(lent)
            ),
            Self::Framebuffer { needed, lent } => write!(
                f,
                "framebuffer: {lent} bytes were lent but its size and stride need {needed}; lend {} more",
                needed.saturating_sub(lent)
            ),
            Self::Stride { needed, given } => write!(
                f,
                "framebuffer: its stride is {given} bytes but a row has {needed}; give a stride of at least that"
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
                f.write_str("plan: it was made for another avatar; plan again for this one")
            }
        }
    }
}

impl core::error::Error for Error {}
