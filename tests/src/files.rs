//! The workspace, its data, and small glTF files.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The root of the workspace.
pub fn workspace() -> &'static Path {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
    tests.parent().expect("the tests are a folder of the workspace")
}

/// A place for what a failing test wants to show.
pub fn failures() -> PathBuf {
    let folder = crate::command::target().join("dermis-failures");
    std::fs::create_dir_all(&folder).expect("the target folder can be written");
    folder
}

/// An empty folder of this name inside the target folder, for a test to fill.
pub fn empty_folder(name: &str) -> PathBuf {
    let folder = crate::command::target().join("dermis-tests").join(name);
    if folder.exists() {
        std::fs::remove_dir_all(&folder).expect("what a test made can be removed");
    }
    std::fs::create_dir_all(&folder).expect("the target folder can be written");
    folder
}

/// Writes a file into a folder.
pub fn written(folder: &Path, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("it can be written");
    path
}

/// Names in a folder, in order.
pub fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("it is a folder");
    let name = |entry: std::io::Result<std::fs::DirEntry>| {
        entry.expect("it can be listed").file_name().to_string_lossy().into_owned()
    };
    let mut names: Vec<String> = entries.map(name).collect();
    names.sort();
    names
}

/// The folder of real avatars: `DERMIS_DATA`, or `../shared/data` from the workspace. Without it
/// the test `who` says that it was skipped, or fails under CI, where the folder should be there.
pub fn data(who: &str) -> Option<PathBuf> {
    let named = std::env::var_os("DERMIS_DATA").map(PathBuf::from);
    let folder = named.unwrap_or_else(|| workspace().join("../shared/data"));
    if folder.is_dir() {
        return Some(folder);
    }
    skipped(who, &format!("no folder {}; set DERMIS_DATA to the avatars", folder.display()));
    None
}

/// Says that the test `who` was skipped, and why.
///
/// # Panics
///
/// Under CI, where everything that tests need should be there.
pub fn skipped(who: &str, why: &str) {
    assert!(std::env::var_os("CI").is_none(), "{who}: {why}");
    // Not by a macro: those are captured from tests that pass.
    let mut stderr = std::io::stderr().lock();
    writeln!(stderr, "SKIPPED {who}: {why}").expect("stderr takes a line");
}

/// A mesh on its way into a glTF file: positions, indices and what materials say, nothing else.
#[derive(Clone, Debug)]
pub struct SmallMesh {
    /// Corners, metres.
    pub positions: Vec<[f32; 3]>,
    /// Three for each triangle.
    pub indices: Vec<u16>,
    /// One for each position; empty: none.
    pub uvs: Vec<[f32; 2]>,
    /// Image that the base colour comes from.
    pub image: Option<String>,
}

impl SmallMesh {
    /// A pyramid, 1 m high, without texture coordinates.
    pub fn pyramid() -> Self {
        let (a, b) = (0.5, -0.5);
        Self {
            positions: vec![[a, 0.0, a], [b, 0.0, a], [b, 0.0, b], [a, 0.0, b], [0.0, 1.0, 0.0]],
            indices: vec![0, 4, 1, 1, 4, 2, 2, 4, 3, 3, 4, 0, 0, 1, 2, 0, 2, 3],
            uvs: Vec::new(),
            image: None,
        }
    }

    /// As a GLB.
    pub fn glb(&self) -> Vec<u8> {
        let (json, mut buffer) = self.parts();
        let mut json = json.into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        buffer.resize(buffer.len().next_multiple_of(4), 0);
        let mut file = b"glTF\x02\0\0\0".to_vec();
        file.extend(((12 + 8 + json.len() + 8 + buffer.len()) as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &buffer)] {
            file.extend((chunk.len() as u32).to_le_bytes());
            file.extend(kind);
            file.extend(chunk);
        }
        file
    }

    /// JSON and buffer.
    fn parts(&self) -> (String, Vec<u8>) {
        let mut buffer = Vec::new();
        let mut views = Vec::new();
        let mut add = |bytes: Vec<u8>| {
            views.push((buffer.len(), bytes.len()));
            buffer.extend(bytes);
            buffer.resize(buffer.len().next_multiple_of(4), 0);
        };
        add(self.positions.iter().flatten().flat_map(|x| x.to_le_bytes()).collect());
        add(self.indices.iter().flat_map(|i| i.to_le_bytes()).collect());
        if !self.uvs.is_empty() {
            add(self.uvs.iter().flatten().flat_map(|x| x.to_le_bytes()).collect());
        }
        let counts = [
            (self.positions.len(), 5126, "VEC3"),
            (self.indices.len(), 5123, "SCALAR"),
            (self.uvs.len(), 5126, "VEC2"),
        ];
        let accessors = counts.iter().zip(0..views.len()).map(|((count, component, kind), view)| {
            format!(
                r#"{{"bufferView":{view},"componentType":{component},"count":{count},"type":"{kind}"}}"#
            )
        });
        let accessors: Vec<String> = accessors.collect();
        let views = views.iter().map(|(offset, len)| {
            format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{len}}}"#)
        });
        let views: Vec<String> = views.collect();
        let uv = if self.uvs.is_empty() { "" } else { r#","TEXCOORD_0":2"# };
        let mut json = format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
            "buffers":[{{"byteLength":{}}}],"bufferViews":[{}],"accessors":[{}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0{uv}}},"indices":1,"material":0}}]}}],
            "materials":[{{"pbrMetallicRoughness":{{"baseColorFactor":[0.8,0.3,0.1,1.0]"#,
            buffer.len(),
            views.join(","),
            accessors.join(",")
        );
        if let Some(image) = &self.image {
            write!(
                json,
                r#","baseColorTexture":{{"index":0}}}}}}],"textures":[{{"source":0}}],"images":[{{"uri":"{image}"}}]}}"#
            )
            .expect("a string takes it");
        } else {
            json.push_str("}}]}");
        }
        (json, buffer)
    }
}
