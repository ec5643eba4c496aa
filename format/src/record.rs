//! Fixed-size records: byte arrays of alignment 1, little-endian, viewed in place.

use bytemuck::{Pod, Zeroable};

/// u16, little-endian, at any address.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct U16([u8; 2]);

/// i16, little-endian, at any address.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct I16([u8; 2]);

/// u32, little-endian, at any address.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct U32([u8; 4]);

/// f32, little-endian, at any address.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct F32([u8; 4]);

macro_rules! little_endian {
    ($($name:ident $number:ty),*) => {$(
        impl $name {
            /// The number.
            #[inline]
            pub fn get(self) -> $number {
                <$number>::from_le_bytes(self.0)
            }
        }

        impl From<$number> for $name {
            fn from(value: $number) -> Self {
                Self(value.to_le_bytes())
            }
        }
    )*};
}
little_endian!(U16 u16, I16 i16, U32 u32, F32 f32);

/// `offset + code · step`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Range {
    /// Value of code 0.
    pub offset: F32,
    /// Difference between codes.
    pub step: F32,
}

/// Vertex position: codes along x, y, z (header: `position_min`, `position_step`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct VertexRecord {
    /// Codes.
    pub position: [U16; 3],
}

/// Head of a morph target's section; its deltas follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct MorphRecord {
    /// Metres per code.
    pub step: F32,
    /// Weight where no clip says otherwise.
    pub default_weight: F32,
    /// Bytes of the name (UTF-8) that follows this record.
    pub name_len: U16,
}

/// A joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct JointRecord {
    /// Index of the parent, smaller than its own; 0xFFFF: none.
    pub parent: U16,
    /// Metres, to the parent.
    pub translation: [F32; 3],
    /// Unit quaternion w, x, y, z.
    pub rotation: [F32; 4],
    /// Per axis.
    pub scale: [F32; 3],
}

/// An inverse bind matrix.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct BindRecord {
    /// Index of its joint.
    pub joint: U16,
    /// Rows of a 3×4 affine matrix: bind space → joint space.
    pub inverse: [[F32; 4]; 3],
}

/// Head of a clip's section; its name, channels and keys follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct ClipRecord {
    /// Length, seconds.
    pub seconds: F32,
    /// Channels.
    pub channels: U16,
    /// Bytes of the name (UTF-8).
    pub name_len: U16,
}

/// Keys of one property, evenly spaced from 0 to the clip's end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct ChannelRecord {
    /// 0 translation, 1 rotation, 2 scale, 3 morph weight.
    pub property: u8,
    /// 0 hold, 1 linear.
    pub interpolation: u8,
    /// Index of the joint or morph target.
    pub target: U16,
    /// Keys, at least 1.
    pub keys: U32,
    /// Of the u16 codes of all components.
    pub range: Range,
}

/// A key frame of training.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct KeyFrameRecord {
    /// Index of the clip; 0xFFFF: the rest pose.
    pub clip: U16,
    /// Seconds.
    pub seconds: F32,
}

/// How much a region matters, and what was measured of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct ImportanceRecord {
    /// Relative to a usual region's 1, in 0..=1000.
    pub weight: F32,
    /// How fast it moves in the avatar's clips, m/s.
    pub mobility: F32,
    /// Its share of what is seen of the avatar, in 0..=1.
    pub visible: F32,
    /// Its share of the squared error, in 0..=1.
    pub residual: F32,
}

impl ImportanceRecord {
    /// Whether every number is in its range.
    pub(crate) fn is_valid(&self) -> bool {
        let share = |x: F32| (0.0..=1.0).contains(&x.get());
        (0.0..=1e3).contains(&self.weight.get())
            && (0.0..=1e6).contains(&self.mobility.get())
            && share(self.visible)
            && share(self.residual)
    }
}

/// Head of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct BlockRecord {
    /// Region.
    pub region: u8,
    /// Layer.
    pub layer: u8,
    /// Groups.
    pub groups: U16,
    /// Rank in the region's order of the block's first Gaussian.
    pub first: U32,
    /// Gaussians.
    pub count: U32,
}

/// Ranges that up to 256 Gaussians of a block share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct GroupRecord {
    /// Gaussians in the group, 1..=256, less one.
    pub count_less_one: u8,
    /// Triangle indices of the group are relative to this.
    pub base_triangle: U32,
    /// Position x, y, z in units of the frame's size.
    pub position: [Range; 3],
    /// log₂ of the scales, in units of the frame's size.
    pub log2_scale: Range,
    /// Luma Y, chroma Co, Cg.
    pub color: [Range; 3],
    /// Step of the harmonics' codes.
    pub harmonics_step: F32,
}

/// A disc.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct DiscRecord {
    /// Codes of the position.
    pub position: [u8; 3],
    /// Angle from the frame's x to the first axis, in π/256.
    pub angle: u8,
    /// Codes of log₂ scale along the two axes.
    pub scale: [u8; 2],
    /// Codes of Y, Co, Cg.
    pub color: [u8; 3],
    /// In 1/255.
    pub opacity: u8,
}

/// A Gaussian with rotation and three scales.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct FullRecord {
    /// Codes of the position.
    pub position: [U16; 3],
    /// Unit quaternion in 32 bits: see `quant`.
    pub rotation: U32,
    /// Codes of log₂ scale along the three axes.
    pub scale: [u8; 3],
    /// Codes of Y, Co, Cg.
    pub color: [u8; 3],
    /// In 1/255.
    pub opacity: u8,
}

/// Indices in 16 bits where they fit, else wider or narrower: the width follows from the number of
/// things they index.
#[derive(Clone, Copy, Debug)]
pub enum Indices<'a> {
    /// Up to 256 things.
    Byte(&'a [u8]),
    /// Up to 65,536 things.
    Short(&'a [U16]),
    /// More.
    Long(&'a [U32]),
}

impl<'a> Indices<'a> {
    /// The index at `at`; 0 beyond the end.
    #[inline]
    pub fn get(self, at: usize) -> u32 {
        match self {
            Self::Byte(plane) => plane.get(at).map_or(0, |&i| u32::from(i)),
            Self::Short(plane) => plane.get(at).map_or(0, |&i| u32::from(i.get())),
            Self::Long(plane) => plane.get(at).map_or(0, |&i| i.get()),
        }
    }

    /// How many there are.
    pub fn len(self) -> usize {
        match self {
            Self::Byte(plane) => plane.len(),
            Self::Short(plane) => plane.len(),
            Self::Long(plane) => plane.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// All of them.
    pub fn iter(self) -> impl Iterator<Item = u32> + 'a {
        (0..self.len()).map(move |at| self.get(at))
    }

    /// Splits `count` indices of vertices off the front: 16 bits each for up to 65,536 vertices, else 32.
    pub fn take_vertices(bytes: &'a [u8], count: usize, vertices: u32) -> Option<(Self, &'a [u8])> {
        if vertices <= 1 << 16 {
            take_plane(bytes, count).map(|(plane, rest)| (Self::Short(plane), rest))
        } else {
            take_plane(bytes, count).map(|(plane, rest)| (Self::Long(plane), rest))
        }
    }

    /// Splits `count` indices of binds off the front: 8 bits each for up to 256 binds, else 16.
    pub fn take_binds(bytes: &'a [u8], count: usize, binds: u16) -> Option<(Self, &'a [u8])> {
        if binds <= 1 << 8 {
            take_plane(bytes, count).map(|(plane, rest)| (Self::Byte(plane), rest))
        } else {
            take_plane(bytes, count).map(|(plane, rest)| (Self::Short(plane), rest))
        }
    }
}

/// `bytes` as records; `None` if the length is not a whole number of them.
pub fn plane<T: Pod>(bytes: &[u8]) -> Option<&[T]> {
    bytemuck::try_cast_slice(bytes).ok()
}

/// Splits `count` records off the front; `None` if the bytes end before.
pub fn take_plane<T: Pod>(bytes: &[u8], count: usize) -> Option<(&[T], &[u8])> {
    let len = count.checked_mul(core::mem::size_of::<T>())?;
    let (front, rest) = bytes.split_at_checked(len)?;
    Some((plane(front)?, rest))
}
