//! What the encoder takes: an avatar in plain numbers.

use crate::curves::CurvePoint;
use crate::header::{FrameKind, LowPass, ScaleLaw};
use crate::quant::{Disc, Full};
use crate::record::DiscWidths;
use crate::rig::Property;
use crate::samples::Sample;

/// An avatar before it is encoded.
#[derive(Clone, Debug, Default)]
pub struct Source {
    /// Mesh; empty for a cloud that nothing moves.
    pub mesh: Mesh,
    /// Skeleton and clips.
    pub rig: Rig,
    /// Regions with their Gaussians; at least one.
    pub regions: Vec<Region>,
    /// Kind of frame, prefix and low-pass.
    pub mathematics: Mathematics,
    /// Bits of the discs' numbers at each level, coarse to fine; 8 each where there are none.
    pub widths: Vec<DiscWidths>,
    /// Rest pose's box: lower and upper corner, metres.
    pub bounds: [[f32; 3]; 2],
    /// Key frames trained on: (clip, seconds); no clip is the rest pose.
    pub key_frames: Vec<(Option<u16>, f32)>,
    /// How near the picture is to the mesh, if that was measured.
    pub curves: Option<MeasuredCurves>,
    /// Which triangles stand for the others, by ascending triangle; none: nobody chose any.
    pub samples: Vec<Sample>,
    /// How far joints and morph targets move the mesh, if that was measured.
    pub movements: Option<MeasuredMovements>,
}

/// How far joints and morph targets move the mesh, as [`crate::movement`] says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeasuredMovements {
    /// Of each joint, metres.
    pub joints: Vec<f32>,
    /// Of each morph target at weight 1, metres.
    pub targets: Vec<f32>,
    /// Of each clip, m/s.
    pub clips: Vec<f32>,
}

/// How near each region's picture is to the mesh, by level and distance.
#[derive(Clone, Debug, Default)]
pub struct MeasuredCurves {
    /// Pixels to a metre of octave 0; each octave has half as many as the one before.
    pub density: f32,
    /// Octaves, 1 to 8.
    pub octaves: u8,
    /// Of each region, of each octave, of each stop ([`crate::curves::count_at`]).
    pub points: Vec<CurvePoint>,
}

/// Which mathematics the Gaussians are meant for.
#[derive(Clone, Copy, Debug)]
pub struct Mathematics {
    /// Kind of triangle frame.
    pub frame: FrameKind,
    /// Low-pass of the projection.
    pub low_pass: LowPass,
    /// Scales of a prefix.
    pub scale_law: ScaleLaw,
    /// Degree of spherical harmonics, 0..=3; above 0 only for full Gaussians.
    pub harmonics_degree: u8,
}

impl Default for Mathematics {
    fn default() -> Self {
        Self {
            frame: FrameKind::Affine,
            low_pass: LowPass::Pixel,
            scale_law: ScaleLaw::SquareRoot,
            harmonics_degree: 0,
        }
    }
}

/// Mesh.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Bind space, metres.
    pub positions: Vec<[f32; 3]>,
    /// What one code of a position stands for, 0 to 10⁶ metres, if that is more than codes of 16 bits need: what is finer than
    /// anyone sees packs badly.
    pub step: f32,
    /// Bind and weight, four for each vertex, weights adding up to 1; empty if no joint moves the mesh.
    pub influences: Vec<[(u16, f32); 4]>,
    /// Indices of vertices.
    pub triangles: Vec<[u32; 3]>,
    /// Whether a triangle's back is seen.
    pub two_sided: Vec<bool>,
    /// How many of the last triangles are those of each coarser mesh, from fine to coarse ([`crate::mesh_levels`]).
    pub coarser: Vec<u32>,
    /// Region of each triangle; may be empty with one region.
    pub triangle_regions: Vec<u8>,
    /// Morph targets.
    pub morph_targets: Vec<Morph>,
}

/// Morph target.
#[derive(Clone, Debug, Default)]
pub struct Morph {
    /// Name.
    pub name: String,
    /// Weight where no clip says otherwise.
    pub default_weight: f32,
    /// Vertex and its displacement in bind space, metres; vertices ascend, each once.
    pub deltas: Vec<(u32, [f32; 3])>,
    /// What one code stands for, metres, if that is more than codes of the greatest displacement need: what is finer than anyone
    /// sees packs badly. Vertices that move less than half as far are left out.
    pub step: f32,
}

/// Skeleton and clips.
#[derive(Clone, Debug, Default)]
pub struct Rig {
    /// Parents before children.
    pub joints: Vec<Joint>,
    /// Joint and rows of its 3×4 inverse bind matrix.
    pub binds: Vec<(u16, [[f32; 4]; 3])>,
    /// Animations.
    pub clips: Vec<Clip>,
}

/// Joint; by default a root that is neither moved, nor turned, nor scaled.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Name.
    pub name: String,
    /// Index of the parent.
    pub parent: Option<u16>,
    /// At rest, metres.
    pub translation: [f32; 3],
    /// At rest, w, x, y, z.
    pub rotation: [f32; 4],
    /// At rest.
    pub scale: [f32; 3],
}

impl Default for Joint {
    fn default() -> Self {
        Self {
            name: String::new(),
            parent: None,
            translation: [0.0; 3],
            rotation: [1.0, 0.0, 0.0, 0.0],
            scale: [1.0; 3],
        }
    }
}

/// Animation.
#[derive(Clone, Debug, Default)]
pub struct Clip {
    /// Name.
    pub name: String,
    /// Length.
    pub seconds: f32,
    /// What moves.
    pub channels: Vec<Channel>,
}

/// Keys evenly spaced over the clip.
#[derive(Clone, Debug)]
pub struct Channel {
    /// What it moves.
    pub property: Property,
    /// Whether a key holds until the next one.
    pub holds: bool,
    /// Keys of `property.width()` numbers each, in a row.
    pub values: Vec<f32>,
    /// What one code stands for, 0 to 10⁶ in the unit of the values, if that is more than codes of 16 bits need.
    pub step: f32,
}

/// A region and its Gaussians.
#[derive(Clone, Debug, Default)]
pub struct Region {
    /// Name.
    pub name: String,
    /// Gaussians of each layer; as many layers in every region.
    pub layers: Vec<u32>,
    /// In the order of [`crate::order`]: layer by layer, block by block, in a block by triangle.
    pub gaussians: Gaussians,
    /// Triangle of each; empty without a mesh.
    pub triangles: Vec<u32>,
    /// For each Gaussian of layer m, its opacities at levels m+1, m+2, … to the last; the whole list
    /// is empty if opacity is the same at all levels.
    pub later_opacities: Vec<Vec<f32>>,
    /// For levels 1, 2, … each the discs of all Gaussians of earlier layers there, in the same order; a level
    /// whose layer is empty, or the first one that is not, has none. The whole list is empty if Gaussians are
    /// the same at all levels. For discs alone, under [`ScaleLaw::SquareRoot`], without later opacities.
    pub levels: Vec<Vec<Disc>>,
    /// For each Gaussian 3 · ((degree + 1)² − 1) coefficients, (r, g, b) after (r, g, b); empty at degree 0.
    pub harmonics: Vec<Vec<f32>>,
    /// How much the region matters; with none in any region the file says nothing of it.
    pub importance: Option<Importance>,
}

/// How much a region matters, and what was measured of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Importance {
    /// Relative to a usual region's 1, in 0..=1000.
    pub weight: f32,
    /// How fast it moves in the avatar's clips, m/s.
    pub mobility: f32,
    /// Its share of what is seen of the avatar, in 0..=1.
    pub visible: f32,
    /// Its share of the squared error, in 0..=1.
    pub residual: f32,
}

impl Default for Importance {
    /// Of a region that nobody weighed or measured.
    fn default() -> Self {
        Self { weight: 1.0, mobility: 0.0, visible: 0.0, residual: 0.0 }
    }
}

/// Gaussians of one kind.
#[derive(Clone, Debug)]
pub enum Gaussians {
    /// Discs.
    Disc(Vec<Disc>),
    /// With rotation and three scales.
    Full(Vec<Full>),
}

impl Default for Gaussians {
    fn default() -> Self {
        Self::Disc(Vec::new())
    }
}

impl Gaussians {
    /// How many.
    pub fn len(&self) -> usize {
        match self {
            Self::Disc(discs) => discs.len(),
            Self::Full(fulls) => fulls.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
