//! A rigged, textured mesh as the importers leave it and everything else reads it.
//!
//! Vertices on which triangles stand stay as the file stores them (a seam counts twice), because the
//! counts of hierarchical embedding depend on them. All skins, rigid parts and node transforms are
//! already folded into one list of [`Joint`]s and [`Bind`]s, so posing has one case.

use glam::{Affine3A, Quat, Vec2, Vec3, Vec4};

/// A rigged, textured mesh. World axes of glTF: metres, right-handed, +Y up.
#[derive(Clone, Debug, Default)]
pub struct Model {
    /// File stem, for reports.
    pub name: String,
    /// Vertices in bind space (see [`Bind`]); in world space where `binds` is empty.
    pub vertices: Vec<Vertex>,
    /// Triangles, counter-clockwise seen from their front.
    pub triangles: Vec<Triangle>,
    /// What triangles are painted with; never empty.
    pub materials: Vec<Material>,
    /// Base colour images.
    pub textures: Vec<Texture>,
    /// Morph targets over all vertices; their deltas add in bind space before skinning.
    pub morph_targets: Vec<MorphTarget>,
    /// Nodes that move something. Parents stand before their children.
    pub joints: Vec<Joint>,
    /// What vertices are bound to. Empty for a mesh that no joint moves.
    pub binds: Vec<Bind>,
    /// Animations.
    pub clips: Vec<Clip>,
}

/// One vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Bind space, metres.
    pub position: Vec3,
    /// Texture coordinates of the material's base colour texture, its transform applied;
    /// (0, 0) is the image's upper left corner (glTF).
    pub uv: Vec2,
    /// Linear vertex colour and alpha that multiplies the base colour; white where absent.
    pub color: Vec4,
    /// Up to four (index into [`Model::binds`], weight). Weights add up to 1 where `binds`
    /// is not empty, else all are 0.
    pub influences: [(u16, f32); 4],
}

/// One triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Triangle {
    /// Indices of its vertices.
    pub corners: [u32; 3],
    /// Index of its material.
    pub material: u32,
}

/// What a triangle is painted with, unlit.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// As in the file.
    pub name: String,
    /// Linear RGBA that multiplies the texture (glTF `baseColorFactor`).
    pub base_color: Vec4,
    /// Index of the base colour texture.
    pub texture: Option<u32>,
    /// How alpha acts.
    pub alpha: AlphaMode,
    /// Whether backs are drawn.
    pub double_sided: bool,
}

/// glTF's alpha modes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    Opaque,
    /// Drawn exactly where alpha is at least the cutoff.
    Mask(f32),
    /// Covers in proportion to alpha.
    Blend,
}

/// An image with its sampler. Texels are sRGB with straight alpha, row 0 on top.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// RGBA8, sRGB-encoded colour, linear alpha.
    pub image: image::RgbaImage,
    /// Wrap mode along u, v.
    pub wrap: [Wrap; 2],
    /// Whether magnification picks the nearest texel.
    pub nearest: bool,
}

/// glTF's wrap modes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// Tile.
    Repeat,
    /// Tile, every second one mirrored.
    Mirror,
    /// Extend the border.
    Clamp,
}

/// Sparse displacements of vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphTarget {
    /// As in the file (`targetNames`), or node and number.
    pub name: String,
    /// (vertex, displacement in bind space), vertices ascending, zero displacements left out.
    pub deltas: Vec<(u32, Vec3)>,
    /// Weight where no clip says otherwise.
    pub default_weight: f32,
}

/// A node of the skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// As in the file.
    pub name: String,
    /// Index of the parent, always smaller than its own.
    pub parent: Option<u16>,
    /// Transform to the parent at rest.
    pub rest: Trs,
}

/// Bind space → joint space. A vertex at `p` moves to Σ wᵢ · world(jointᵢ) · inverseᵢ · p.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bind {
    /// Index of the joint that moves it.
    pub joint: u16,
    /// Inverse bind matrix.
    pub inverse: Affine3A,
}

/// Translation, rotation, scale: applied right to left (scale first).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trs {
    /// Metres, in the parent's space.
    pub translation: Vec3,
    /// Unit quaternion.
    pub rotation: Quat,
    /// Per axis.
    pub scale: Vec3,
}

/// One animation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clip {
    /// As in the file, or `clip0`, `clip1`, ...
    pub name: String,
    /// Time of its last key; its first key may stand after 0.
    pub seconds: f32,
    /// What it moves.
    pub channels: Vec<Channel>,
}

/// Key frames of one property.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// What it moves.
    pub target: ChannelTarget,
    /// Between keys.
    pub interpolation: Interpolation,
    /// Seconds, strictly ascending, at least one.
    pub times: Vec<f32>,
    /// `times.len() · width` numbers, `width` being 3 for translation and scale, 4 (x, y, z, w) for
    /// rotation, 1 for a weight. For cubic splines three times as many: in-tangent,
    /// value, out-tangent of each key.
    pub values: Vec<f32>,
}

/// The property that a channel moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ChannelTarget {
    /// Of a joint.
    Translation(u16),
    /// Of a joint.
    Rotation(u16),
    /// Of a joint.
    Scale(u16),
    /// Of a morph target (one channel for each).
    Weight(u16),
}

/// glTF's interpolations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// Hold the last key.
    Step,
    /// Linear; spherical for rotations.
    Linear,
    /// Cubic Hermite spline.
    CubicSpline,
}

impl Trs {
    /// Leaves everything in its place.
    pub const IDENTITY: Self =
        Self { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale: Vec3::ONE };
}

impl Default for Trs {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec4::ONE,
            texture: None,
            alpha: AlphaMode::Opaque,
            double_sided: false,
        }
    }
}
