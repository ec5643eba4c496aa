//! Wavefront OBJ with its MTL libraries.
//!
//! Read here rather than by a crate, because the usual one panics on a short `Kd` or a relative
//! index out of range, and confuses the texture coordinates of meshes where only some have them.
//! Of OBJ's many statements `v`, `vt`, `f`, `mtllib` and `usemtl` matter; others are passed over.

mod mtl;

use super::{MAX_TRIANGLES, MAX_VERTICES, add_within, check_within};
use crate::model::{Material, Model, Triangle, Vertex};
use anyhow::{Context, Result, ensure};
use glam::{Vec2, Vec3, Vec4};
use mtl::{Library, Textures};
use std::collections::HashMap;
use std::path::Path;

/// Reads an OBJ file's bytes; `path` is where its libraries and textures are looked for.
pub(super) fn import(bytes: &[u8], path: &Path) -> Result<Model> {
    let text = String::from_utf8_lossy(bytes);
    let mut reader = Reader::new(path.parent().unwrap_or(Path::new("")));
    let mut statement = String::new();
    for (number, line) in (1..).zip(text.trim_start_matches('\u{feff}').lines()) {
        // A backslash continues a statement on the next line.
        if let Some(begun) = line.strip_suffix('\\') {
            statement.push_str(begun);
            statement.push(' ');
            continue;
        }
        statement.push_str(line);
        reader.read(&statement).with_context(|| format!("line {number}"))?;
        statement.clear();
    }
    reader.model.textures = reader.textures.finish();
    Ok(reader.model)
}

struct Reader<'a> {
    folder: &'a Path,
    /// With colours.
    positions: Vec<(Vec3, Vec4)>,
    uvs: Vec<Vec2>,
    library: Library,
    textures: Textures,
    /// Of the faces that follow; `None` before the first.
    material: Option<u32>,
    /// Materials of the model by name; the empty name is the plain one.
    materials: HashMap<String, u32>,
    /// Vertices of the model, by position and texture coordinates.
    vertices: HashMap<(usize, Option<usize>), u32>,
    triangles: usize,
    model: Model,
}

impl<'a> Reader<'a> {
    fn new(folder: &'a Path) -> Self {
        Self {
            folder,
            positions: Vec::new(),
            uvs: Vec::new(),
            library: Library::default(),
            textures: Textures::default(),
            material: None,
            materials: HashMap::new(),
            vertices: HashMap::new(),
            triangles: 0,
            model: Model::default(),
        }
    }

    fn read(&mut self, statement: &str) -> Result<()> {
        let (keyword, rest) = keyword(statement);
        match keyword {
            "v" => {
                let numbers = numbers(rest)?;
                ensure!(numbers.len() >= 3, "has a vertex of {} numbers; give it 3", numbers.len());
                // Six numbers are a position and a colour; a fourth is a weight without use here.
                let color = numbers.get(3..6).map_or(Vec3::ONE, Vec3::from_slice);
                let color = if color.is_finite() { color } else { Vec3::ONE };
                self.positions.push((Vec3::from_slice(&numbers), color.extend(1.0)));
            }
            "vt" => {
                let numbers = numbers(rest)?;
                let at = |index: usize| numbers.get(index).copied().unwrap_or(0.0);
                // OBJ's v points up, glTF's down.
                let uv = Vec2::new(at(0), 1.0 - at(1));
                self.uvs.push(if uv.is_finite() { uv } else { Vec2::ZERO });
            }
            "f" => self.face(rest)?,
            "mtllib" => self.library.add(&self.folder.join(rest)),
            "usemtl" => self.material = Some(self.use_material(rest)?),
            _ => {}
        }
        Ok(())
    }

    /// Adds a polygon as a fan.
    fn face(&mut self, rest: &str) -> Result<()> {
        let material = match self.material {
            Some(material) => material,
            None => self.use_material("")?,
        };
        let corners: Vec<u32> = words(rest).map(|word| self.vertex(word)).collect::<Result<_>>()?;
        let added = corners.len().saturating_sub(2);
        add_within(&mut self.triangles, added, MAX_TRIANGLES, "triangles")?;
        let rim = corners.get(1..).unwrap_or_default();
        self.model.triangles.extend(
            rim.windows(2).map(|w| Triangle { corners: [corners[0], w[0], w[1]], material }),
        );
        Ok(())
    }

    /// The model's vertex for `position/uv/normal`, of which the latter two may be absent.
    fn vertex(&mut self, word: &str) -> Result<u32> {
        let mut parts = word.split('/');
        let position = resolve(parts.next().unwrap_or(""), self.positions.len(), "vertex")?;
        let uv = match parts.next().filter(|part| !part.is_empty()) {
            Some(part) => Some(resolve(part, self.uvs.len(), "texture coordinate")?),
            None => None,
        };
        if let Some(&known) = self.vertices.get(&(position, uv)) {
            return Ok(known);
        }
        let index = self.model.vertices.len();
        check_within(index + 1, MAX_VERTICES, "vertices")?;
        let (at, color) = self.positions[position];
        self.model.vertices.push(Vertex {
            position: at,
            uv: uv.map_or(Vec2::ZERO, |uv| self.uvs[uv]),
            color,
            influences: [(0, 0.0); 4],
        });
        self.vertices.insert((position, uv), index as u32);
        Ok(index as u32)
    }

    /// The model's index of a material; one that no library has is plain.
    fn use_material(&mut self, name: &str) -> Result<u32> {
        let found = self.library.get(name);
        let name = if found.is_some() { name } else { "" };
        if let Some(&known) = self.materials.get(name) {
            return Ok(known);
        }
        let material = match found {
            Some(statement) => statement
                .material(name, &mut self.textures)
                .with_context(|| format!("material {name:?}"))?,
            // OBJ does not say whether backs are drawn, and its users see both sides.
            None => Material { name: "default".into(), double_sided: true, ..Material::default() },
        };
        let index = self.model.materials.len() as u32;
        self.model.materials.push(material);
        self.materials.insert(name.to_owned(), index);
        Ok(index)
    }
}

/// A statement's first word and the rest.
fn keyword(statement: &str) -> (&str, &str) {
    let statement = statement.trim();
    let (keyword, rest) = statement.split_once(char::is_whitespace).unwrap_or((statement, ""));
    (keyword, rest.trim())
}

fn numbers(rest: &str) -> Result<Vec<f32>> {
    let parse = |word: &str| {
        word.parse().ok().with_context(|| format!("has {word:?} for a number; export it again"))
    };
    words(rest).map(parse).collect()
}

/// Words up to a comment.
fn words(rest: &str) -> impl Iterator<Item = &str> {
    rest.split_whitespace().take_while(|word| !word.starts_with('#'))
}

/// From OBJ's numbers, which begin at 1 or count back from the last, to an index.
fn resolve(word: &str, count: usize, what: &str) -> Result<usize> {
    let number: i64 =
        word.parse().ok().with_context(|| format!("has {word:?} for a {what}; export it again"))?;
    let index = if number < 0 { number.checked_add(count as i64) } else { number.checked_sub(1) };
    index
        .and_then(|index| usize::try_from(index).ok())
        .filter(|&index| index < count)
        .with_context(|| format!("names {what} {number} of {count}; export it again"))
}
