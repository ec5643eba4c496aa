//! Fixed-size records: byte arrays of alignment 1, little-endian, viewed in place.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

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

/// The upper half of an f32 (bfloat16), little-endian, at any address.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Bf16([u8; 2]);

impl Bf16 {
    /// The number.
    #[inline]
    pub fn get(self) -> f32 {
        f32::from_bits(u32::from(u16::from_le_bytes(self.0)) << 16)
    }

    /// The greatest that is not above `value`, which is finite and not near the greatest f32.
    pub fn at_most(value: f32) -> Self {
        let bits = value.to_bits();
        let up = value < 0.0 && bits & 0xffff != 0;
        Self((((bits >> 16) + u32::from(up)) as u16).to_le_bytes())
    }

    /// The least that is not below `value`, which is finite and not near the greatest f32.
    pub fn at_least(value: f32) -> Self {
        let Self([low, high]) = Self::at_most(-value);
        Self([low, high ^ 0x80])
    }
}

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

/// `offset + code · step`, in half the bytes of a [`Range`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct ShortRange {
    /// Value of code 0.
    pub offset: Bf16,
    /// Difference between codes.
    pub step: Bf16,
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

/// Head of the regions' curves ([`crate::curves`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct CurvesRecord {
    /// Pixels to a metre of octave 0.
    pub density: F32,
    /// How many octaves follow, 1 to 8.
    pub octaves: u8,
}

/// A region at an octave and a level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct CurvePointRecord {
    /// Mean squared difference to the mesh, in 0..=10⁶.
    pub error: Bf16,
    /// Gaussians blended in a pixel, in 0..=10⁶.
    pub blends: Bf16,
}

/// A triangle that stands for a part of its region ([`crate::samples`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct SampleRecord {
    /// Its index.
    pub triangle: U32,
    /// Footprint of what it stands for to its own, in 0..=[`crate::samples::MOST`].
    pub area: Bf16,
    /// The same, weighted by blends, in the same range.
    pub fill: Bf16,
}

/// Head of a block, or of a block at a later level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct BlockRecord {
    /// Region.
    pub region: u8,
    /// Layer.
    pub layer: u8,
    /// Gaussians.
    pub count: U16,
    /// Rank in the region's order of the block's first Gaussian.
    pub first: U32,
}

/// Head of a block's triangles ([`crate::triangles`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct TrianglesRecord {
    /// The first one.
    pub base: U32,
    /// Bits of each that stand as they are.
    pub low_bits: u8,
    /// Bytes of the unary part.
    pub step_bytes: U16,
}

/// Bits of each number of a disc, 0 to 8 ([`crate::discs`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable, Serialize, Deserialize)]
#[repr(C)]
pub struct DiscWidths {
    /// Position x, y, z.
    pub position: [u8; 3],
    /// Angle.
    pub angle: u8,
    /// log₂ of each of the two scales.
    pub scale: u8,
    /// Y, Co, Cg.
    pub color: [u8; 3],
    /// Opacity.
    pub opacity: u8,
}

impl DiscWidths {
    /// Those of scales and opacity; no bits for other numbers.
    pub fn of_shape(self) -> Self {
        Self { position: [0; 3], angle: 0, color: [0; 3], ..self }
    }

    /// As the numbers stand in a record.
    pub fn numbers(&self) -> [u8; 10] {
        let ([x, y, z], [luma, orange, green]) = (self.position, self.color);
        [x, y, z, self.angle, self.scale, self.scale, luma, orange, green, self.opacity]
    }
}

/// Ranges that up to 256 discs of a block share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct DiscGroup {
    /// Position x, y and ∛z, in units of the frame's size.
    pub position: [ShortRange; 3],
    /// log₂ of the scales, in units of the frame's size.
    pub log2_scale: ShortRange,
    /// Luma Y, chroma Co, Cg.
    pub color: [ShortRange; 3],
    /// Opacity.
    pub opacity: ShortRange,
}

/// Ranges that up to 256 Gaussians with three scales share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct FullGroup {
    /// Position x, y, z in units of the frame's size.
    pub position: [Range; 3],
    /// log₂ of the scales, in units of the frame's size.
    pub log2_scale: Range,
    /// Luma Y, chroma Co, Cg.
    pub color: [Range; 3],
    /// Step of the harmonics' codes.
    pub harmonics_step: F32,
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
