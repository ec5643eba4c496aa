//! Rows of pixels as runs of bytes, without loss.
//!
//! A run begins with two bytes, little-endian: the number of pixels in bits 0 to 13, the kind in 14
//! and 15. It ends with its row.
//!
//! | kind | pixels | bytes of each |
//! |---|---|---|
//! | 0 | nothing but the background | none |
//! | 1 | wholly covered | r, g, b |
//! | 2 | any others | r, g, b, coverage |

/// Pixels that one run can hold.
const MAX_LEN: usize = (1 << KIND_BIT) - 1;
/// Where the kind begins.
const KIND_BIT: u32 = 14;
const EMPTY: u16 = 0;
const FULL: u16 = 1;
const MIXED: u16 = 2;

/// Neighbours in a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Run<'a> {
    /// So many pixels of the background alone.
    Empty(usize),
    /// (r, g, b) of pixels that are wholly covered.
    Full(&'a [[u8; 3]]),
    /// (r, g, b, coverage) of pixels.
    Mixed(&'a [[u8; 4]]),
}

impl Run<'_> {
    /// Pixels.
    pub(super) const fn len(self) -> usize {
        match self {
            Self::Empty(len) => len,
            Self::Full(pixels) => pixels.len(),
            Self::Mixed(pixels) => pixels.len(),
        }
    }
}

/// Appends a row of (r, g, b, coverage); `empty` is a pixel that shows the background alone.
pub(super) fn encode(row: &[[u8; 4]], empty: [u8; 4], bytes: &mut Vec<u8>) {
    let kind = |pixel: &[u8; 4]| match pixel {
        pixel if *pixel == empty => EMPTY,
        [_, _, _, 255] => FULL,
        _ => MIXED,
    };
    let alike = row.chunk_by(|a, b| kind(a) == kind(b));
    for run in alike.flat_map(|run| run.chunks(MAX_LEN)) {
        let kind = kind(&run[0]);
        bytes.extend((kind << KIND_BIT | run.len() as u16).to_le_bytes());
        match kind {
            EMPTY => {}
            FULL => run.iter().for_each(|pixel| bytes.extend(&pixel[..3])),
            _ => bytes.extend(run.as_flattened()),
        }
    }
}

/// What [`encode`] wrote, run by run. Ends early where bytes are missing.
#[derive(Clone, Debug)]
pub(super) struct Runs<'a>(pub(super) &'a [u8]);

impl<'a> Iterator for Runs<'a> {
    type Item = Run<'a>;

    fn next(&mut self) -> Option<Run<'a>> {
        let (&head, rest) = self.0.split_first_chunk()?;
        let head = u16::from_le_bytes(head);
        let (kind, len) = (head >> KIND_BIT, usize::from(head) & MAX_LEN);
        let size = match kind {
            FULL => 3,
            MIXED => 4,
            _ => 0,
        };
        let (pixels, rest) = rest.split_at_checked(size * len)?;
        self.0 = rest;
        Some(match kind {
            FULL => Run::Full(pixels.as_chunks().0),
            MIXED => Run::Mixed(pixels.as_chunks().0),
            _ => Run::Empty(len),
        })
    }
}
