//! Materials: what triangles are painted with, and where on their texture.

use super::document::{Document, item};
use super::texture::Textures;
use crate::model::{AlphaMode, Material, Texture};
use anyhow::{Context, Result, anyhow};
use glam::{Vec2, Vec4};
use gltf::json::material;
use gltf::json::texture::Info;
use gltf::json::validation::Checked;
use std::collections::BTreeMap;

const SPECULAR_GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";

/// The materials that meshes use, in order of first use.
#[derive(Default)]
pub(super) struct Materials {
    materials: Vec<Material>,
    uv_maps: Vec<UvMap>,
    /// From the file's index; `None` is glTF's default material.
    of_file: BTreeMap<Option<usize>, u32>,
    textures: Textures,
}

/// How texture coordinates are chosen and transformed (`KHR_texture_transform`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct UvMap {
    /// Which TEXCOORD.
    pub(super) set: u32,
    offset: Vec2,
    rotation: f32,
    scale: Vec2,
}

impl UvMap {
    const IDENTITY: Self = Self { set: 0, offset: Vec2::ZERO, rotation: 0.0, scale: Vec2::ONE };

    fn read(info: &Info) -> Self {
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        let Some(transform) = transform else {
            return Self { set: info.tex_coord, ..Self::IDENTITY };
        };
        Self {
            set: transform.tex_coord.unwrap_or(info.tex_coord),
            offset: transform.offset.0.into(),
            rotation: transform.rotation.0,
            scale: transform.scale.0.into(),
        }
    }

    /// Offset · rotation · scale. The rotation is counter-clockwise as one sees the image, whose
    /// v points down: so says the extension's prose, and so draw its sample model and the viewers,
    /// though the listing in its text has the other sign.
    pub(super) fn apply(&self, uv: Vec2) -> Vec2 {
        let (sin, cos) = self.rotation.sin_cos();
        let uv = self.scale * uv;
        let uv = self.offset + Vec2::new(cos * uv.x + sin * uv.y, cos * uv.y - sin * uv.x);
        if uv.is_finite() { uv } else { Vec2::ZERO }
    }
}

/// Base colour as either material model has it.
struct BaseColor {
    factor: [f32; 4],
    texture: Option<Info>,
}

impl Materials {
    /// The model's index of a primitive's material, and how its texture lies.
    pub(super) fn get(&mut self, document: &Document, file: Option<usize>) -> Result<(u32, UvMap)> {
        if let Some(&index) = self.of_file.get(&file) {
            return Ok((index, self.uv_maps[index as usize]));
        }
        let (material, uv_map) = match file {
            Some(file) => self.read(document, file).with_context(|| format!("material {file}"))?,
            None => (Material { name: "default".into(), ..Material::default() }, UvMap::IDENTITY),
        };
        let index = self.materials.len() as u32;
        self.materials.push(material);
        self.uv_maps.push(uv_map);
        self.of_file.insert(file, index);
        Ok((index, uv_map))
    }

    /// The materials and their textures.
    pub(super) fn finish(self) -> (Vec<Material>, Vec<Texture>) {
        (self.materials, self.textures.finish())
    }

    fn read(&mut self, document: &Document, file: usize) -> Result<(Material, UvMap)> {
        let json = item(&document.root.materials, file, "material")?;
        let base = base_color(json)?;
        let texture = match &base.texture {
            Some(info) => Some(self.textures.get(document, info.index.value())?),
            None => None,
        };
        let material = Material {
            name: json.name.clone().unwrap_or_else(|| format!("material{file}")),
            base_color: Vec4::from(base.factor).clamp(Vec4::ZERO, Vec4::ONE),
            texture,
            alpha: alpha(json),
            double_sided: json.double_sided,
        };
        Ok((material, base.texture.as_ref().map_or(UvMap::IDENTITY, UvMap::read)))
    }
}

fn alpha(json: &material::Material) -> AlphaMode {
    match json.alpha_mode {
        Checked::Valid(material::AlphaMode::Mask) => {
            AlphaMode::Mask(json.alpha_cutoff.unwrap_or_default().0)
        }
        Checked::Valid(material::AlphaMode::Blend) => AlphaMode::Blend,
        Checked::Valid(material::AlphaMode::Opaque) | Checked::Invalid => AlphaMode::Opaque,
    }
}

fn base_color(json: &material::Material) -> Result<BaseColor> {
    let pbr = &json.pbr_metallic_roughness;
    let metallic =
        BaseColor { factor: pbr.base_color_factor.0, texture: pbr.base_color_texture.clone() };
    let old = json.extensions.as_ref().and_then(|e| e.others.get(SPECULAR_GLOSSINESS));
    match old {
        // Files with both state the metallic model as the fallback for readers like us.
        Some(old) if metallic.texture.is_none() && metallic.factor == [1.0; 4] => {
            specular_glossiness(old).map_err(|error| anyhow!("{SPECULAR_GLOSSINESS}: {error}"))
        }
        _ => Ok(metallic),
    }
}

/// Diffuse stands in for base colour: both are what an unlit picture shows.
fn specular_glossiness(json: &serde_json::Value) -> serde_json::Result<BaseColor> {
    let factor =
        json.get("diffuseFactor").map_or(Ok([1.0; 4]), |v| serde_json::from_str(&v.to_string()));
    // Through text, because raw extras cannot be read from a value.
    let texture = json.get("diffuseTexture").map(|v| serde_json::from_str(&v.to_string()));
    Ok(BaseColor { factor: factor?, texture: texture.transpose()? })
}
