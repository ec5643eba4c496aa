//! The header: how much of everything, and which mathematics.

use serde::{Deserialize, Serialize};

use crate::error::{Error, malformed};

/// At most this many regions.
pub const MAX_REGIONS: usize = 32;
/// At most this many layers.
pub const MAX_LAYERS: usize = 16;

/// How a posed triangle gives a coordinate system. In every kind but Affine a Gaussian's position and scales are in units
/// of the frame's size, so that `X' = size · R · X + T` (LoDAvatar, eq. 5, whose k · X equals
/// `size · X` here: the rest size is divided out once, when the file is written).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FrameKind {
    /// No triangles: one frame, the world's, of size 1 m.
    World,
    /// LoDAvatar: T = centroid, z = unit normal, x = unit(v0 − T), y = z × x, size = √area.
    Area,
    /// GaussianAvatars: T = centroid, x = unit(v1 − v0), y = unit normal, z = x × y, size =
    /// (|v1 − v0| + |z · (v2 − v0)|) / 2.
    Edge,
    /// What takes an equilateral triangle of area 1 to this one: Gaussians shear and stretch with it, and neighbours that
    /// met at rest meet in every pose. Trained avatars have it: 0.3 to 3.8 dB more than with Area on new poses, for no byte
    /// (trainer/notes/training.md). T = centroid, x along v0 − T, y along v1 − v2, z = √area · unit normal.
    Affine,
}

/// How a Gaussian is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum RecordKind {
    /// A flat disc in a plane parallel to its triangle.
    Disc,
    /// A rotation and three scales.
    Full,
}

/// The low-pass of the projection: a variance added on the screen along both axes, and what that does to opacity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum LowPass {
    /// 0.3 px², and nothing (3D Gaussian Splatting).
    Classic,
    /// 0.3 px², and opacity times √(det Σ / det(Σ + 0.3 I)): the energy of a Gaussian far away stays right.
    Compensated,
    /// 1/12 px², the variance of the square that a pixel is, and opacity as in Compensated: edges and textures stay
    /// sharp, for Gaussians that were trained on pixels that are means over squares.
    Pixel,
}

impl LowPass {
    /// What is added along both axes of the screen, px².
    #[inline(always)]
    pub const fn variance(self) -> f32 {
        match self {
            Self::Classic | Self::Compensated => 0.3,
            Self::Pixel => 1.0 / 12.0,
        }
    }
}

/// What drawing a prefix of k out of N Gaussians does to scales.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ScaleLaw {
    /// Nothing.
    Constant,
    /// All scales times √(N / k): in the plane for discs, all three for full records.
    SquareRoot,
}

/// What a Gaussian of an earlier layer has of its own at each later level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum PerLevel {
    /// Nothing: it is the same at all levels.
    #[default]
    Nothing,
    /// Its opacity (LapisGS): planes of the blocks.
    Opacity,
    /// Everything: sections of their own ([`crate::level`]). Discs under [`ScaleLaw::SquareRoot`] alone.
    All,
}

/// What the file holds. Encoded by postcard, fields in this order.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Vertices of the mesh.
    pub vertices: u32,
    /// Triangles of the mesh.
    pub triangles: u32,
    /// Joints of the skeleton.
    pub joints: u16,
    /// Inverse bind matrices.
    pub binds: u16,
    /// Morph targets.
    pub morph_targets: u16,
    /// Clips.
    pub clips: u16,
    /// Regions, 1..=[`MAX_REGIONS`].
    pub regions: u8,
    /// Layers, 1..=[`MAX_LAYERS`].
    pub layers: u8,
    /// Gaussians in all blocks.
    pub gaussians: u32,
    /// Kind of triangle frame.
    pub frame: FrameKind,
    /// Kind of record.
    pub record: RecordKind,
    /// Low-pass of the projection.
    pub low_pass: LowPass,
    /// Scales of a prefix.
    pub scale_law: ScaleLaw,
    /// Degree of the spherical harmonics, 0..=3; 0: a colour only.
    pub harmonics_degree: u8,
    /// What a Gaussian of layer m has of its own at levels m+1, m+2, ….
    pub per_level: PerLevel,
    /// Lower corner of the rest pose's box (World: of the Gaussians'), metres.
    pub box_min: [f32; 3],
    /// Upper corner of the rest pose's box, metres.
    pub box_max: [f32; 3],
    /// Bind-space position of code (0, 0, 0), metres.
    pub position_min: [f32; 3],
    /// Metres per code, per axis.
    pub position_step: [f32; 3],
}

impl Header {
    /// Decodes and checks.
    pub fn parse(bytes: &[u8]) -> Result<Self, Error> {
        let Ok((header, rest)) = postcard::take_from_bytes::<Self>(bytes) else {
            return malformed("header", "its fields cannot be read");
        };
        if !rest.is_empty() {
            return malformed("header", "it is longer than its fields");
        }
        header.check()?;
        Ok(header)
    }

    fn check(&self) -> Result<(), Error> {
        if self.regions == 0 || usize::from(self.regions) > MAX_REGIONS {
            return malformed("header", "the number of regions is not in 1..=32");
        }
        if self.layers == 0 || usize::from(self.layers) > MAX_LAYERS {
            return malformed("header", "the number of layers is not in 1..=16");
        }
        if self.harmonics_degree > 3 {
            return malformed("header", "the degree of harmonics is over 3");
        }
        if self.record == RecordKind::Disc && self.harmonics_degree > 0 {
            return malformed("header", "discs have no harmonics");
        }
        if (self.frame == FrameKind::World) != (self.triangles == 0) {
            return malformed(
                "header",
                "triangles and the kind of triangle frame contradict each other",
            );
        }
        if self.frame == FrameKind::World
            && (self.vertices != 0 || self.binds != 0 || self.record == RecordKind::Disc)
        {
            return malformed("header", "an avatar without triangles has vertices, binds or discs");
        }
        if self.per_level == PerLevel::All
            && (self.record != RecordKind::Disc || self.scale_law != ScaleLaw::SquareRoot)
        {
            return malformed(
                "header",
                "levels have records of their own, which only discs under SquareRoot can have",
            );
        }
        let numbers = [self.box_min, self.box_max, self.position_min, self.position_step];
        // Far below the range of f32, so that no product of theirs overflows.
        if numbers.iter().flatten().any(|x| x.is_nan() || x.abs() > 1e12) {
            return malformed("header", "a box or a position is not finite or over 1e12 m");
        }
        if self.joints == u16::MAX || (self.binds > 0 && self.joints == 0) {
            return malformed("header", "there are binds without joints, or too many joints");
        }
        Ok(())
    }

    /// Coefficients of spherical harmonics per colour channel beyond the constant one.
    pub fn harmonics(&self) -> usize {
        let bands = usize::from(self.harmonics_degree) + 1;
        bands * bands - 1
    }
}
