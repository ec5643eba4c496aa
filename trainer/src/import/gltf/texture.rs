//! Base colour textures: images from views, data URIs or files, with their samplers.

use super::super::{MAX_TEXELS, add_within, image_file};
use super::document::{Document, item};
use crate::model::{Texture, Wrap};
use anyhow::{Context, Result, bail};
use gltf::json::texture::{MagFilter, Sampler, WrappingMode};
use gltf::json::validation::Checked;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// The textures that materials use, in order of first use.
#[derive(Default)]
pub(super) struct Textures {
    textures: Vec<Texture>,
    /// From image and sampler, for files that repeat a texture.
    of_file: BTreeMap<(usize, Option<usize>), u32>,
    texels: usize,
}

impl Textures {
    /// The model's index of a texture of the file.
    pub(super) fn get(&mut self, document: &Document, file: usize) -> Result<u32> {
        self.read(document, file).with_context(|| format!("texture {file}"))
    }

    /// All textures.
    pub(super) fn finish(self) -> Vec<Texture> {
        self.textures
    }

    fn read(&mut self, document: &Document, file: usize) -> Result<u32> {
        let json = item(&document.root.textures, file, "texture")?;
        let image = image_of(json)?;
        let sampler = json.sampler.map(|sampler| sampler.value());
        if let Some(&index) = self.of_file.get(&(image, sampler)) {
            return Ok(index);
        }
        let settings = match sampler {
            Some(sampler) => item(&document.root.samplers, sampler, "sampler")?.clone(),
            None => Sampler::default(),
        };
        let pixels = read_image(document, image)?;
        add_within(&mut self.texels, pixels.as_raw().len() / 4, MAX_TEXELS, "texels")?;
        let index = self.textures.len() as u32;
        self.textures.push(Texture {
            image: pixels,
            wrap: [wrap(settings.wrap_s), wrap(settings.wrap_t)],
            nearest: settings.mag_filter == Some(Checked::Valid(MagFilter::Nearest)),
        });
        self.of_file.insert((image, sampler), index);
        Ok(index)
    }
}

/// The WebP image where the texture has one: it is why the file has the extension.
fn image_of(json: &gltf::json::Texture) -> Result<usize> {
    let webp = json.extensions.as_ref().and_then(|e| e.others.get("EXT_texture_webp"));
    let webp = webp.and_then(|webp| webp.get("source")?.as_u64());
    match (webp, json.source.value()) {
        (Some(image), _) => Ok(usize::try_from(image).unwrap_or(usize::MAX)),
        // How the JSON types say that there is none.
        (None, none) if none == u32::MAX as usize => {
            bail!("has no PNG, JPEG or WebP image; export it with one")
        }
        (None, image) => Ok(image),
    }
}

fn read_image(document: &Document, index: usize) -> Result<image::RgbaImage> {
    let json = item(&document.root.images, index, "image")?;
    let name = match (&json.name, &json.uri) {
        (_, Some(uri)) if !uri.starts_with("data:") => uri.clone(),
        (Some(name), _) => format!("image {index} ({name})"),
        _ => format!("image {index}"),
    };
    let bytes = match (&json.uri, json.buffer_view) {
        (Some(uri), _) => document.resolve(uri).map(Cow::from),
        (None, Some(view)) => document.view(view.value()).map(Cow::from),
        (None, None) => bail!("{name} has no data; export it again"),
    };
    bytes.and_then(|bytes| image_file::decode(&bytes)).with_context(|| name)
}

fn wrap(mode: Checked<WrappingMode>) -> Wrap {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
    }
}
