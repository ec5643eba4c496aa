//! Views of what moves the mesh: morph targets and clips, one section each.

use crate::quant::Linear;
use crate::record::{ChannelRecord, ClipRecord, I16, Indices, MorphRecord, U16, plane, take_plane};

/// A morph target: sparse displacements in bind space.
#[derive(Clone, Copy, Debug)]
pub struct MorphTarget<'a> {
    /// Its name.
    pub name: &'a str,
    /// Weight where no clip says otherwise.
    pub default_weight: f32,
    /// Metres per code of `deltas`.
    pub step: f32,
    /// Vertices it moves, each below the mesh's number of vertices.
    pub vertices: Indices<'a>,
    /// Displacement of each, codes along x, y, z.
    pub deltas: &'a [[I16; 3]],
}

impl<'a> MorphTarget<'a> {
    pub(crate) fn split(payload: &'a [u8], vertices: u32) -> Option<Self> {
        let (head, rest) = take_plane::<MorphRecord>(payload, 1)?;
        let head = head.first()?;
        let (name, rest) = rest.split_at_checked(usize::from(head.name_len.get()))?;
        let width = if vertices <= 1 << 16 { 2 } else { 4 } + size_of::<[I16; 3]>();
        let count = rest.len() / width;
        let (moved, rest) = Indices::take_vertices(rest, count, vertices)?;
        let target = Self {
            name: core::str::from_utf8(name).ok()?,
            default_weight: head.default_weight.get(),
            step: head.step.get(),
            vertices: moved,
            deltas: plane(rest)?,
        };
        (target.deltas.len() == count).then_some(target)
    }
}

/// An animation.
#[derive(Clone, Copy, Debug)]
pub struct Clip<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its length.
    pub seconds: f32,
    channels: &'a [ChannelRecord],
    codes: &'a [U16],
}

/// Keys of one property, evenly spaced from 0 to the clip's end.
#[derive(Clone, Copy, Debug)]
pub struct Channel<'a> {
    /// What it moves.
    pub property: Property,
    /// Whether a key holds until the next one.
    pub holds: bool,
    /// Keys, at least 1.
    pub keys: usize,
    record: &'a ChannelRecord,
    codes: &'a [U16],
}

/// What a channel moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Property {
    /// Of a joint: x, y, z in metres.
    Translation(u16),
    /// Of a joint: w, x, y, z.
    Rotation(u16),
    /// Of a joint: x, y, z.
    Scale(u16),
    /// Of a morph target.
    Weight(u16),
}

impl Property {
    /// Numbers in a key.
    pub fn width(self) -> usize {
        match self {
            Self::Translation(_) | Self::Scale(_) => 3,
            Self::Rotation(_) => 4,
            Self::Weight(_) => 1,
        }
    }

    fn new(code: u8, target: u16) -> Option<Self> {
        Some(match code {
            0 => Self::Translation(target),
            1 => Self::Rotation(target),
            2 => Self::Scale(target),
            3 => Self::Weight(target),
            _ => return None,
        })
    }

    #[cfg(feature = "std")]
    pub(crate) fn code(self) -> (u8, u16) {
        match self {
            Self::Translation(target) => (0, target),
            Self::Rotation(target) => (1, target),
            Self::Scale(target) => (2, target),
            Self::Weight(target) => (3, target),
        }
    }
}

impl<'a> Clip<'a> {
    pub(crate) fn split(payload: &'a [u8]) -> Option<Self> {
        let (head, rest) = take_plane::<ClipRecord>(payload, 1)?;
        let head = head.first()?;
        let (name, rest) = rest.split_at_checked(usize::from(head.name_len.get()))?;
        let (channels, rest) = take_plane(rest, usize::from(head.channels.get()))?;
        Some(Self {
            name: core::str::from_utf8(name).ok()?,
            seconds: head.seconds.get(),
            channels,
            codes: plane(rest)?,
        })
    }

    /// Its channels.
    pub fn channels(self) -> impl Iterator<Item = Channel<'a>> {
        let mut rest = self.codes;
        self.channels.iter().map_while(move |record| {
            let property = Property::new(record.property, record.target.get())?;
            let keys = usize::try_from(record.keys.get()).ok()?;
            let (codes, after) = rest.split_at_checked(keys.checked_mul(property.width())?)?;
            rest = after;
            Some(Channel { property, holds: record.interpolation == 0, keys, record, codes })
        })
    }

    /// Whether every channel is whole, moves something that exists and has finite keys, and no bytes are left.
    pub(crate) fn is_valid(self, joints: u16, morph_targets: u16) -> bool {
        let valid = |channel: &Channel<'_>| {
            let exists = match channel.property {
                Property::Translation(i) | Property::Rotation(i) | Property::Scale(i) => i < joints,
                Property::Weight(i) => i < morph_targets,
            };
            exists
                && channel.keys > 0
                && channel.record.interpolation < 2
                && channel.record.range.is_within(u16::MAX, 1e12)
        };
        let used: usize = self.channels().map(|channel| channel.codes.len()).sum();
        (0.0..=1e6).contains(&self.seconds)
            && self.channels().count() == self.channels.len()
            && self.channels().all(|channel| valid(&channel))
            && used == self.codes.len()
    }
}

impl Channel<'_> {
    /// Component `component` of key `key`; 0 beyond the last.
    #[inline]
    pub fn value(&self, key: usize, component: usize) -> f32 {
        let at = key.saturating_mul(self.property.width()).saturating_add(component);
        self.codes.get(at).map_or(0.0, |code| self.record.range.value(code.get()))
    }
}
