//! An input: flags, parameters, a file.

use crate::seal::seal;

/// Bits of an input's first byte.
pub mod flags {
    /// The file is taken as it is, checksums and all; else it is [sealed](crate::seal()).
    pub const RAW: u8 = 1;
    /// It is read as a prefix.
    pub const PREFIX: u8 = 2;
}

/// An input, taken apart.
pub struct Input<'a> {
    /// [`flags`].
    pub flags: u8,
    /// What the target makes of it.
    pub parameters: Parameters<'a>,
    /// The file.
    pub file: Vec<u8>,
}

impl<'a> Input<'a> {
    /// `None` of fewer bytes than flags and `parameters` bytes take.
    pub fn new(data: &'a [u8], parameters: usize) -> Option<Self> {
        let (&flags, rest) = data.split_first()?;
        let (parameters, file) = rest.split_at_checked(parameters)?;
        let mut file = file.to_vec();
        if flags & flags::RAW == 0 {
            seal(&mut file);
        }
        Some(Self { flags, parameters: Parameters(parameters), file })
    }
}

/// Bytes that numbers are made of; zeros without end behind the last.
#[derive(Clone, Copy, Debug)]
pub struct Parameters<'a>(&'a [u8]);

impl Parameters<'_> {
    /// The next byte.
    pub fn byte(&mut self) -> u8 {
        let Some((&byte, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        byte
    }

    /// Four bytes.
    pub fn word(&mut self) -> u32 {
        u32::from_le_bytes([0; 4].map(|_| self.byte()))
    }

    /// In [−1, 1), by a byte.
    pub fn signed(&mut self) -> f32 {
        f32::from(self.byte() as i8) / 128.0
    }

    /// `usual`, or once in 8 times a number that is not.
    pub fn or_odd(&mut self, usual: f32) -> f32 {
        if self.byte() % 8 == 7 { self.odd() } else { usual }
    }

    /// A number at an end of what numbers can be, or of any bits.
    pub fn odd(&mut self) -> f32 {
        const ODD: [f32; 14] = [
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::MAX,
            f32::MIN,
            f32::MIN_POSITIVE,
            1e-45,
            0.0,
            -0.0,
            1e12,
            -1e12,
            1e20,
            -1e30,
            0.01,
        ];
        let which = usize::from(self.byte() % 16);
        ODD.get(which).copied().unwrap_or_else(|| f32::from_bits(self.word()))
    }
}
