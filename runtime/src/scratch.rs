//! Cuts typed slices off memory that the caller lends.

use bytemuck::Pod;

use crate::error::Error;

/// Words (u32) of the scratch that `count` values of type `T` take.
pub(crate) const fn words<T>(count: usize) -> usize {
    count.saturating_mul(size_of::<T>().div_ceil(4))
}

/// Memory lent by the caller, cut from the front.
pub(crate) struct Scratch<'a> {
    rest: &'a mut [u32],
    used: usize,
}

impl<'a> Scratch<'a> {
    /// An error that names the whole shortage if there are fewer words than `needed`.
    pub(crate) fn new(words: &'a mut [u32], needed: usize) -> Result<Self, Error> {
        let lent = words.len();
        if lent < needed {
            return Err(Error::Scratch { needed, lent });
        }
        Ok(Self { rest: words, used: 0 })
    }

    /// `count` values; what they are is what the memory held.
    pub(crate) fn take<T: Pod>(&mut self, count: usize) -> Result<&'a mut [T], Error> {
        let needed = words::<T>(count);
        let lent = self.rest.len();
        let missing = Error::Scratch {
            needed: self.used.saturating_add(needed),
            lent: self.used.saturating_add(lent),
        };
        let rest = core::mem::take(&mut self.rest);
        let (front, rest) = rest.split_at_mut_checked(needed).ok_or(missing)?;
        self.rest = rest;
        self.used += needed;
        // Every T of ours is made of 4-byte words, so this cannot fail.
        bytemuck::try_cast_slice_mut(front).map_err(|_| missing)
    }

    /// As many values as are left.
    pub(crate) fn take_rest<T: Pod>(&mut self) -> &'a mut [T] {
        let count = self.rest.len() / words::<T>(1);
        self.take(count).unwrap_or(&mut [])
    }
}
