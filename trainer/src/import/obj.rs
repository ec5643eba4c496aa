//! Wavefront OBJ with its MTL libraries.

use super::{MAX_TRIANGLES, MAX_VERTICES, add_within, image_file};
use crate::model::{AlphaMode, Material, Model, Texture, Triangle, Vertex, Wrap};
use anyhow::{Context, Result, anyhow, ensure};
use glam::{Vec2, Vec3, Vec4};
use std::collections::HashMap;
use std::path::Path;

const OPTIONS: tobj::LoadOptions = tobj::LoadOptions {
    triangulate: true,
    single_index: true,
    ignore_points: true,
    ignore_lines: true,
};

/// Reads an OBJ file's bytes; `path` is where its libraries and textures are looked for.
pub(super) fn import(mut bytes: &[u8], path: &Path) -> Result<Model> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let library = |name: &Path| read_library(&folder.join(name));
    let (meshes, materials) = tobj::load_obj_buf(&mut bytes, &OPTIONS, library)
        .map_err(|error| anyhow!("is not a valid OBJ ({error}); export it again"))?;
    let mut model = Model::default();
    let mut textures = HashMap::new();
    for material in materials.unwrap_or_default() {
        add_material(material, &mut textures, &mut model)?;
    }
    let mut plain = None;
    let (mut vertices, mut triangles) = (0, 0);
    for tobj::Model { mesh, .. } in &meshes {
        add_within(&mut vertices, mesh.positions.len() / 3, MAX_VERTICES, "vertices")?;
        add_within(&mut triangles, mesh.indices.len() / 3, MAX_TRIANGLES, "triangles")?;
        let material = mesh.material_id.filter(|&id| id < model.materials.len());
        let material = material.map_or_else(
            || *plain.get_or_insert_with(|| add_plain_material(&mut model)),
            |id| id as u32,
        );
        add_mesh(mesh, material, &mut model)?;
    }
    Ok(model)
}

/// A library's materials, with texture paths made relative to where the OBJ's caller stands.
/// A library that cannot be read leaves materials plain, as other programs do.
fn read_library(path: &Path) -> tobj::MTLLoadResult {
    let bytes = std::fs::read(path).unwrap_or_default();
    let (mut materials, names) = tobj::load_mtl_buf(&mut bytes.as_slice()).unwrap_or_default();
    let folder = path.parent().unwrap_or(Path::new(""));
    for texture in materials.iter_mut().filter_map(|material| material.diffuse_texture.as_mut()) {
        *texture = folder.join(without_options(texture)).to_string_lossy().into_owned();
    }
    Ok((materials, names))
}

/// The file name of a map statement such as `-s 1 1 1 -clamp on skin.png`.
fn without_options(statement: &str) -> String {
    let is_value = |word: &str| word.parse::<f32>().is_ok() || word == "on" || word == "off";
    let mut rest = statement.trim();
    while rest.starts_with('-') {
        rest = rest.split_once(char::is_whitespace).map_or("", |(_, after)| after.trim_start());
        while let Some((word, after)) = rest.split_once(char::is_whitespace)
            && is_value(word)
        {
            rest = after.trim_start();
        }
    }
    rest.replace('\\', "/")
}

fn add_material(
    json: tobj::Material,
    textures: &mut HashMap<String, u32>,
    model: &mut Model,
) -> Result<()> {
    let opacity = json.dissolve.unwrap_or(1.0).clamp(0.0, 1.0);
    let texture = match json.diffuse_texture {
        Some(path) if textures.contains_key(&path) => Some(textures[&path]),
        Some(path) => {
            let index = add_texture(&path, model)
                .with_context(|| format!("material {:?}: texture {path}", json.name))?;
            textures.insert(path, index);
            Some(index)
        }
        None => None,
    };
    let color = Vec3::from(json.diffuse.unwrap_or([1.0; 3])).clamp(Vec3::ZERO, Vec3::ONE);
    model.materials.push(Material {
        name: json.name,
        base_color: color.extend(opacity),
        texture,
        alpha: if opacity < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque },
        // OBJ has no such setting, and its users see both sides.
        double_sided: true,
    });
    Ok(())
}

fn add_plain_material(model: &mut Model) -> u32 {
    let name = "default".to_owned();
    model.materials.push(Material { name, double_sided: true, ..Material::default() });
    model.materials.len() as u32 - 1
}

fn add_texture(path: &str, model: &mut Model) -> Result<u32> {
    let bytes = std::fs::read(path).context("cannot be read; put it there")?;
    let image = image_file::decode(&bytes)?;
    model.textures.push(Texture { image, wrap: [Wrap::Repeat; 2], nearest: false });
    Ok(model.textures.len() as u32 - 1)
}

fn add_mesh(mesh: &tobj::Mesh, material: u32, model: &mut Model) -> Result<()> {
    let base = model.vertices.len() as u32;
    let count = mesh.positions.len() / 3;
    let fits = mesh.indices.iter().all(|&index| (index as usize) < count);
    ensure!(fits, "has a face with a vertex that is not there; export it again");
    for (index, position) in mesh.positions.chunks_exact(3).enumerate() {
        // OBJ's v points up, glTF's down.
        let uv = mesh.texcoords.get(2 * index..2 * index + 2);
        let uv = uv.map_or(Vec2::ZERO, |uv| Vec2::new(uv[0], 1.0 - uv[1]));
        let color = mesh.vertex_color.get(3 * index..3 * index + 3);
        let color = color.map_or(Vec4::ONE, |color| Vec3::from_slice(color).extend(1.0));
        model.vertices.push(Vertex {
            position: Vec3::from_slice(position),
            uv: if uv.is_finite() { uv } else { Vec2::ZERO },
            color: if color.is_finite() { color } else { Vec4::ONE },
            influences: [(0, 0.0); 4],
        });
    }
    model.triangles.extend(mesh.indices.chunks_exact(3).map(|corners| Triangle {
        corners: [corners[0] + base, corners[1] + base, corners[2] + base],
        material,
    }));
    Ok(())
}
