//! Unlit colour of a model's surface.

use std::collections::HashMap;

use glam::{Vec2, Vec3, Vec4};

use super::texture::{Footprint, MipChain};
use crate::model::{AlphaMode, Material, Model, Triangle};

/// A model with its textures prepared for sampling.
pub struct Painter<'m> {
    model: &'m Model,
    chains: Vec<MipChain>,
    /// Index into `chains` for each material that has a texture.
    chain_of_material: Vec<Option<usize>>,
}

impl<'m> Painter<'m> {
    /// Prepares the textures that `model`'s materials use.
    ///
    /// # Panics
    /// If a material names a texture that does not exist.
    pub fn new(model: &'m Model) -> Self {
        let mut chains = Vec::new();
        let mut known = HashMap::new();
        let chain_of_material = model
            .materials
            .iter()
            .map(|material| {
                let texture = material.texture?;
                let with_alpha = material.alpha != AlphaMode::Opaque;
                Some(*known.entry((texture, with_alpha)).or_insert_with(|| {
                    chains.push(MipChain::new(&model.textures[texture as usize], with_alpha));
                    chains.len() - 1
                }))
            })
            .collect();
        Self { model, chains, chain_of_material }
    }

    /// The model that is painted.
    pub fn model(&self) -> &'m Model {
        self.model
    }

    /// Mean sRGB colour in [0, 1] and coverage in [0, 1] of a piece of a triangle.
    ///
    /// `barycentrics` are the weights of its corners at the middle of the piece, `footprint` its
    /// extent. The colour is the texture's, averaged as stored; base colour factor and vertex
    /// colour, which are linear, multiply it in linear light unless they are white. Coverage is
    /// 1 for opaque materials, alpha for blended ones, and 0 or 1 by the cutoff for masks.
    pub fn surface_color(
        &self,
        triangle: usize,
        barycentrics: Vec3,
        footprint: &Footprint,
    ) -> ([f32; 3], f32) {
        let (triangle, material) = self.triangle(triangle);
        let (texel, tint) = self.texel_and_tint(triangle, barycentrics, footprint);
        let color = if tint.truncate() == Vec3::ONE {
            texel.truncate().to_array()
        } else {
            std::array::from_fn(|i| srgb_encode(srgb_decode(texel[i]) * tint[i]).clamp(0.0, 1.0))
        };
        (color, coverage(material.alpha, texel.w * tint.w))
    }

    /// Coverage alone, as [`Self::surface_color`] gives it.
    pub fn coverage(&self, triangle: usize, barycentrics: Vec3, footprint: &Footprint) -> f32 {
        let (triangle, material) = self.triangle(triangle);
        if material.alpha == AlphaMode::Opaque {
            return 1.0;
        }
        let (texel, tint) = self.texel_and_tint(triangle, barycentrics, footprint);
        coverage(material.alpha, texel.w * tint.w)
    }

    /// The footprint of a piece with the triangle's proportions and `area_share` of its area.
    pub fn footprint_of_share(&self, triangle: usize, area_share: f32) -> Footprint {
        let [a, b, c] = self.uvs(triangle);
        // Two sides span twice the triangle's area.
        let scale = (0.5 * area_share).sqrt();
        Footprint { along: scale * (b - a), across: scale * (c - a) }
    }

    /// Texture coordinates of the triangle's corners.
    pub fn uvs(&self, triangle: usize) -> [Vec2; 3] {
        self.model.triangles[triangle].corners.map(|corner| self.model.vertices[corner as usize].uv)
    }

    /// Whether no part of the triangle lets anything through, so that alpha need not be looked up.
    pub(super) fn is_opaque(&self, triangle: usize) -> bool {
        let (triangle, material) = self.triangle(triangle);
        let full = || {
            let chain = self.chain_of_material[triangle.material as usize];
            chain.is_none_or(|chain| self.chains[chain].is_opaque())
                && material.base_color.w >= 1.0
                && self.vertex_colors(triangle).iter().all(|color| color.w >= 1.0)
        };
        match material.alpha {
            AlphaMode::Opaque => true,
            AlphaMode::Mask(cutoff) => cutoff <= 1.0 && full(),
            AlphaMode::Blend => full(),
        }
    }

    fn triangle(&self, triangle: usize) -> (&'m Triangle, &'m Material) {
        let triangle = &self.model.triangles[triangle];
        (triangle, &self.model.materials[triangle.material as usize])
    }

    fn vertex_colors(&self, triangle: &Triangle) -> [Vec4; 3] {
        triangle.corners.map(|corner| self.model.vertices[corner as usize].color)
    }

    /// The texture's mean (sRGB, straight alpha), and what multiplies it (linear).
    fn texel_and_tint(
        &self,
        triangle: &Triangle,
        barycentrics: Vec3,
        footprint: &Footprint,
    ) -> (Vec4, Vec4) {
        let material = triangle.material as usize;
        let [a, b, c] = triangle.corners.map(|corner| &self.model.vertices[corner as usize]);
        let weights = barycentrics;
        let texel = match self.chain_of_material[material] {
            Some(chain) => {
                let uv = weights.x * a.uv + weights.y * b.uv + weights.z * c.uv;
                self.chains[chain].sample(uv, footprint)
            }
            None => Vec4::ONE,
        };
        // Weights add up to 1 only up to rounding: white must stay exactly white.
        let vertex_color = if [a, b, c].iter().all(|vertex| vertex.color == a.color) {
            a.color
        } else {
            weights.x * a.color + weights.y * b.color + weights.z * c.color
        };
        (texel, self.model.materials[material].base_color * vertex_color)
    }
}

fn coverage(mode: AlphaMode, alpha: f32) -> f32 {
    match mode {
        AlphaMode::Opaque => 1.0,
        AlphaMode::Mask(cutoff) => f32::from(u8::from(alpha >= cutoff)),
        AlphaMode::Blend => alpha.clamp(0.0, 1.0),
    }
}

/// sRGB's transfer function, display-referred value to linear light; [0, 1] to [0, 1].
pub fn srgb_decode(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// The inverse of [`srgb_decode`].
pub fn srgb_encode(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}
