//! The avatars, read in place from the program's own bytes.

/// An avatar of the set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum File {
    /// The trainer's built-in figure, 1.7 m tall, feet at the origin, looking along +Z: 5,000 discs in
    /// four layers, 18 joints, two morph targets, the clips wave, walk and turn, single-sided,
    /// compensated low-pass.
    Figure,
    /// The same figure on affine frames: 1,500 discs in three layers, each level with parameters of its own, the low-pass
    /// of a pixel.
    Leveled,
    /// A ribbon, 1.2 m high, upwards from the origin: 480 discs in three layers, two joints, one
    /// morph target, the clip bow, two-sided.
    Ribbon,
    /// A ball about the origin, 1 m across: 300 full Gaussians without a mesh, harmonics of
    /// degree 1, classic low-pass.
    Ball,
    /// A column about the origin, 1 m high: 560 full Gaussians on edge frames in two regions and
    /// three layers, harmonics of degree 3, an opacity for each level, constant scales.
    Layered,
}

impl File {
    /// All of them.
    pub const ALL: &[Self] =
        &[Self::Figure, Self::Leveled, Self::Ribbon, Self::Ball, Self::Layered];

    /// Its bytes.
    pub const fn bytes(self) -> &'static [u8] {
        match self {
            Self::Figure => include_bytes!("../data/figure.dermis"),
            Self::Leveled => include_bytes!("../data/leveled.dermis"),
            Self::Ribbon => include_bytes!("../../data/ribbon.dermis"),
            Self::Ball => include_bytes!("../../data/ball.dermis"),
            Self::Layered => include_bytes!("../data/layered.dermis"),
        }
    }
}
