//! MTL libraries: `newmtl`, `Kd`, `d`, `Tr` and `map_Kd`; the rest is about lighting.

use super::super::{MAX_TEXELS, add_within, image_file};
use super::{keyword, numbers};
use crate::model::{AlphaMode, Material, Texture, Wrap};
use crate::output::read_unnamed;
use anyhow::{Context, Result};
use glam::{Vec3, Vec4};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// What libraries say, by material.
#[derive(Default)]
pub(super) struct Library {
    materials: HashMap<String, Statement>,
}

/// What a library says of one material.
pub(super) struct Statement {
    color: Vec3,
    opacity: f32,
    texture: Option<PathBuf>,
}

/// Decoded textures, each file once.
#[derive(Default)]
pub(super) struct Textures {
    textures: Vec<Texture>,
    of_file: HashMap<PathBuf, u32>,
    texels: usize,
}

impl Library {
    /// Reads one more file. If that cannot be read materials stay plain, as in other programs.
    pub(super) fn add(&mut self, path: &Path) {
        let bytes = read_unnamed(path).unwrap_or_default();
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut name = None;
        for line in String::from_utf8_lossy(&bytes).trim_start_matches('\u{feff}').lines() {
            let (keyword, rest) = keyword(line);
            if keyword == "newmtl" {
                let plain = Statement { color: Vec3::ONE, opacity: 1.0, texture: None };
                self.materials.insert(rest.to_owned(), plain);
                name = Some(rest.to_owned());
            } else if let Some(name) = &name
                && let Some(material) = self.materials.get_mut(name)
            {
                material.read(keyword, rest, folder);
            }
        }
    }

    pub(super) fn get(&self, name: &str) -> Option<&Statement> {
        self.materials.get(name)
    }
}

impl Statement {
    /// Values that are no numbers leave the default.
    fn read(&mut self, keyword: &str, rest: &str, folder: &Path) {
        let numbers = || numbers(rest).unwrap_or_default();
        match keyword {
            "Kd" => {
                if let [red, green, blue, ..] = numbers()[..] {
                    self.color = Vec3::new(red, green, blue).clamp(Vec3::ZERO, Vec3::ONE);
                }
            }
            "d" => self.opacity = numbers().last().map_or(1.0, |d| d.clamp(0.0, 1.0)),
            "Tr" => self.opacity = numbers().last().map_or(1.0, |t| (1.0 - t).clamp(0.0, 1.0)),
            "map_Kd" => self.texture = Some(folder.join(without_options(rest))),
            _ => {}
        }
    }

    /// The material, its texture decoded.
    pub(super) fn material(&self, name: &str, textures: &mut Textures) -> Result<Material> {
        let texture = match &self.texture {
            Some(path) => {
                Some(textures.get(path).with_context(|| format!("texture {}", path.display()))?)
            }
            None => None,
        };
        Ok(Material {
            name: name.to_owned(),
            base_color: Vec4::from((self.color, self.opacity)),
            texture,
            alpha: if self.opacity < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque },
            // As for plain materials: MTL has no such setting.
            double_sided: true,
        })
    }
}

impl Textures {
    /// All of them.
    pub(super) fn finish(self) -> Vec<Texture> {
        self.textures
    }

    fn get(&mut self, path: &Path) -> Result<u32> {
        if let Some(&known) = self.of_file.get(path) {
            return Ok(known);
        }
        let bytes = read_unnamed(path)?;
        let image = image_file::decode(&bytes)?;
        add_within(&mut self.texels, image.as_raw().len() / 4, MAX_TEXELS, "texels")?;
        let index = self.textures.len() as u32;
        self.textures.push(Texture { image, wrap: [Wrap::Repeat; 2], nearest: false });
        self.of_file.insert(path.to_owned(), index);
        Ok(index)
    }
}

/// The file name of a map statement such as `-s 1 1 1 -clamp on my skin.png`.
fn without_options(statement: &str) -> String {
    let is_value = |word: &str| word.parse::<f32>().is_ok() || word == "on" || word == "off";
    let mut rest = statement;
    while rest.starts_with('-') {
        rest = keyword(rest).1;
        while let (word, after) = keyword(rest)
            && is_value(word)
        {
            rest = after;
        }
    }
    rest.replace('\\', "/")
}
