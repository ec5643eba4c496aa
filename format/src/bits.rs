//! Numbers of any width in a row of bytes, the lowest bit of the first byte first.

/// `N` bytes from byte `at` on; zeros beyond the end.
#[inline]
pub(crate) fn chunk<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    let rest = bytes.get(at..).unwrap_or(&[]);
    if let Some(chunk) = rest.first_chunk() {
        return *chunk;
    }
    let mut chunk = [0; N];
    chunk.iter_mut().zip(rest).for_each(|(to, from)| *to = *from);
    chunk
}

/// The 121 bits, or more, from bit `at` on; zeros beyond the end.
#[inline]
pub(crate) fn window(bytes: &[u8], at: usize) -> u128 {
    u128::from_le_bytes(chunk(bytes, at / 8)) >> (at % 8)
}

/// `width` bits from bit `at` on, at most 25; zeros beyond the end.
#[inline]
pub(crate) fn bits(bytes: &[u8], at: usize, width: u32) -> u32 {
    u32::from_le_bytes(chunk(bytes, at / 8)) >> (at % 8) & mask(width)
}

/// Reads numbers of any width one after the other; zeros beyond the end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Bits<'a> {
    /// From the first bit on.
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// The next `width` bits, at most 25.
    #[inline]
    pub(crate) fn take(&mut self, width: u32) -> u32 {
        let number = bits(self.bytes, self.at, width);
        self.at = self.at.saturating_add(width as usize);
        number
    }

    /// Whether more was taken than is there.
    pub(crate) fn is_overdrawn(&self) -> bool {
        self.at.div_ceil(8) > self.bytes.len()
    }
}

/// Flips the bits of `number`, of at most 25, from bit `at` on: writes it where zeros stand. Nothing beyond the end.
#[inline]
pub(crate) fn flip(bytes: &mut [u8], at: usize, number: u32) {
    let Some(rest) = bytes.get_mut(at / 8..) else { return };
    let by = (number << (at % 8)).to_le_bytes();
    match rest.first_chunk_mut::<4>() {
        // Of a length that is known: one operation.
        Some(window) => window.iter_mut().zip(by).for_each(|(to, by)| *to ^= by),
        None => rest.iter_mut().zip(by).for_each(|(to, by)| *to ^= by),
    }
}

/// Writes numbers one after the other from the start of a byte on, and nothing beyond the end.
#[derive(Debug)]
pub(crate) struct Appender<'a> {
    rest: &'a mut [u8],
    /// What is not written yet: fewer than 64 bits.
    pending: u128,
    len: u32,
}

impl<'a> Appender<'a> {
    /// From the first bit on.
    pub(crate) fn new(bytes: &'a mut [u8]) -> Self {
        Self { rest: bytes, pending: 0, len: 0 }
    }

    /// Appends a number of at most `width` bits, 64 at most.
    #[inline(always)]
    pub(crate) fn push(&mut self, number: u64, width: u32) {
        self.pending |= u128::from(number) << (self.len & 63);
        self.len += width;
        if self.len >= u64::BITS {
            self.write();
        }
    }

    /// Writes 64 bits, or what is there of them.
    #[inline(always)]
    fn write(&mut self) {
        let bytes = (self.pending as u64).to_le_bytes();
        let rest = core::mem::take(&mut self.rest);
        let room = rest.len().min(bytes.len());
        let (first, others) = rest.split_at_mut(room);
        match first.first_chunk_mut() {
            // Of a length that is known: one operation.
            Some(first) => *first = bytes,
            None => first.iter_mut().zip(bytes).for_each(|(to, from)| *to = from),
        }
        self.rest = others;
        self.pending >>= u64::BITS;
        self.len = self.len.saturating_sub(u64::BITS);
    }

    /// Writes what is left; zeros follow up to the end of a byte.
    pub(crate) fn finish(mut self) {
        let left = self.len.div_ceil(8) as usize;
        let rest = core::mem::take(&mut self.rest);
        self.rest = rest.get_mut(..left).unwrap_or_default();
        self.write();
    }
}

/// The lowest `width` bits, at most 31.
#[inline]
pub(crate) const fn mask(width: u32) -> u32 {
    (1 << (width & 31)) - 1
}

/// Bytes that hold `bits` bits.
#[inline]
pub(crate) const fn bytes_for(bits: usize) -> usize {
    bits.div_ceil(8)
}

/// Writes numbers of any width one after the other.
#[cfg(feature = "std")]
#[derive(Debug, Default)]
pub(crate) struct BitWriter {
    bytes: Vec<u8>,
    /// Bits that are written.
    len: usize,
}

#[cfg(feature = "std")]
impl BitWriter {
    /// Appends the lowest `width` bits of `number`.
    pub(crate) fn push(&mut self, number: u32, width: u32) {
        for bit in 0..width {
            if self.len.is_multiple_of(8) {
                self.bytes.push(0);
            }
            if let Some(last) = self.bytes.last_mut() {
                *last |= ((number >> bit & 1) as u8) << (self.len % 8);
            }
            self.len += 1;
        }
    }

    /// Bits that are written.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// What was written; the bits that fill the last byte are 0.
    pub(crate) fn finish(self) -> Vec<u8> {
        self.bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_any_width_return() {
        let numbers: Vec<(u32, u32)> =
            (0..500u32).map(|i| (i % 26, i.wrapping_mul(2_654_435_761) & mask(i % 26))).collect();
        let mut writer = BitWriter::default();
        numbers.iter().for_each(|&(width, number)| writer.push(number, width));
        let bytes = writer.finish();
        let mut at = 0;
        for (width, number) in numbers {
            assert_eq!(bits(&bytes, at, width), number);
            assert_eq!(window(&bytes, at) as u32 & mask(width), number);
            at += width as usize;
        }
        assert_eq!(bytes.len(), bytes_for(at));
        assert_eq!((bits(&bytes, at + 64, 25), window(&bytes, usize::MAX)), (0, 0));
    }
}
