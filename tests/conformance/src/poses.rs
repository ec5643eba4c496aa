//! How avatars stand in the cases.

use dermis_runtime::{Avatar, Pose};

/// How an avatar stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stand {
    /// As it rests.
    Rest,
    /// Seconds into a clip.
    Clip(usize, f32),
    /// Of the ribbon: its two joints in the world, and the weight of its morph target.
    Joints([[[f32; 4]; 3]; 2], [f32; 1]),
    /// Vertices of the caller's own: those of the bind pose, moved.
    Vertices(Move),
}

/// What a caller may do to a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Move {
    /// Nothing.
    Stay,
    /// Every seventh vertex is no number.
    SomeNan,
    /// No vertex is a number.
    AllNan,
    /// Every fifth vertex is infinitely far away, to either side.
    SomeInfinite,
    /// 10³⁰ times as large: products overflow.
    Huge,
    /// 10⁻³⁰ as large: products underflow.
    Tiny,
    /// 10⁻⁴⁰ as large: coordinates are denormal.
    Denormal,
    /// One point: no triangle has an area.
    Point,
    /// Onto the plane z = 0: front and back at the same depth.
    Flat,
    /// Onto a line: no triangle has an area, but all have a length.
    Line,
    /// To a thousandth of its width: slivers.
    Sliver,
    /// As in a mirror: every triangle faces inwards.
    Mirrored,
    /// The upper half down over the lower one, inside out.
    Folded,
    /// Sideways by three times the height.
    Sheared,
    /// Every vertex by up to 10 cm to a side of its own.
    Torn,
}

impl Move {
    /// Where vertex `index` of the bind pose goes, metres.
    fn apply(self, index: u32, [x, y, z]: [f32; 3]) -> [f32; 3] {
        const MIDDLE: f32 = 0.85;
        let scaled = |factor: f32| [x * factor, y * factor, z * factor];
        match self {
            Self::Stay => [x, y, z],
            Self::SomeNan if index.is_multiple_of(7) => [x, f32::NAN, z],
            Self::SomeNan => [x, y, z],
            Self::AllNan => [f32::NAN; 3],
            Self::SomeInfinite if index.is_multiple_of(10) => [f32::INFINITY, y, z],
            Self::SomeInfinite if index.is_multiple_of(5) => [x, y, f32::NEG_INFINITY],
            Self::SomeInfinite => [x, y, z],
            Self::Huge => scaled(1e30),
            Self::Tiny => scaled(1e-30),
            Self::Denormal => scaled(1e-40),
            Self::Point => [0.0, MIDDLE, 0.0],
            Self::Flat => [x, y, 0.0],
            Self::Line => [0.0, y, 0.0],
            Self::Sliver => [x * 1e-3, y, z],
            Self::Mirrored => [-x, y, z],
            Self::Folded if y > MIDDLE => [x, MIDDLE + MIDDLE - y, z + 0.1],
            Self::Folded => [x, y, z],
            Self::Sheared => [x + 3.0 * (y - MIDDLE), y, z],
            Self::Torn => {
                let [a, b, c, _] = index.wrapping_mul(2_654_435_761).to_be_bytes();
                let by = |byte: u8| (f32::from(byte) - 127.5) * (0.1 / 127.5);
                [x + by(a), y + by(b), z + by(c)]
            }
        }
    }
}

impl Stand {
    /// Vertices that the caller lends a place for.
    pub fn vertices(&self, avatar: &Avatar<'_>) -> usize {
        match self {
            Self::Vertices(_) => avatar.header().vertices as usize,
            _ => 0,
        }
    }

    /// As the runtime takes it; `vertices` is a place for [`Stand::vertices`].
    pub fn pose<'v>(&'v self, avatar: &Avatar<'_>, vertices: &'v mut [[f32; 3]]) -> Pose<'v> {
        match self {
            Self::Rest => Pose::Rest,
            Self::Clip(clip, seconds) => Pose::Clip { clip: *clip, seconds: *seconds },
            Self::Joints(worlds, weights) => Pose::Joints { worlds, weights },
            Self::Vertices(movement) => {
                for (vertex, index) in vertices.iter_mut().zip(0u32..) {
                    *vertex = movement.apply(index, avatar.vertex_position(index as usize));
                }
                Pose::Vertices(vertices)
            }
        }
    }
}

/// Worlds of the ribbon's joints; the upper one rests 0.6 m above the lower.
pub mod joints {
    const UPRIGHT: [[f32; 4]; 3] =
        [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

    /// The upper half turned by 53° about the line of sight.
    pub const BENT: [[[f32; 4]; 3]; 2] =
        [UPRIGHT, [[0.6, -0.8, 0.0, 0.0], [0.8, 0.6, 0.0, 0.6], [0.0, 0.0, 1.0, 0.0]]];
    /// Twice as wide below, half as wide and sheared above: no rotation.
    pub const STRETCHED: [[[f32; 4]; 3]; 2] = [
        [[2.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
        [[0.5, 0.7, 0.0, 0.0], [0.0, 1.0, 0.0, 0.6], [0.0, 0.3, 1.0, 0.0]],
    ];
    /// The upper half has no size.
    pub const COLLAPSED: [[[f32; 4]; 3]; 2] =
        [UPRIGHT, [[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.6], [0.0, 0.0, 0.0, 0.0]]];
    /// The upper half is nowhere.
    pub const NAN: [[[f32; 4]; 3]; 2] = [UPRIGHT, [[f32::NAN; 4]; 3]];
    /// The upper half is infinitely far away.
    pub const INFINITE: [[[f32; 4]; 3]; 2] =
        [UPRIGHT, [[1.0, 0.0, 0.0, f32::INFINITY], [0.0, 1.0, 0.0, 0.6], [0.0, 0.0, 1.0, 0.0]]];
}
