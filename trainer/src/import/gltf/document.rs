//! A glTF file opened: its JSON, its buffers, and its buffer views decompressed.

use super::meshopt;
use crate::output::read_unnamed;
use anyhow::{Context, Result, anyhow, bail, ensure};
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use gltf::json::{Root, buffer::View};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// First bytes of a GLB.
pub(in crate::import) const GLB_MAGIC: &[u8] = b"glTF";
/// UTF-8's, which some editors put before JSON.
pub(in crate::import) const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";

/// Bytes of a GLB's header: magic, version, length of the file.
const GLB_HEADER: usize = 12;
/// Bytes before a chunk's data: length, type.
const CHUNK_HEADER: usize = 8;

/// Greatest number of bytes that compressed views may unfold to.
const MAX_UNFOLDED: usize = 1 << 29;

/// Extensions that a file may require. Those that only change lighting need nothing from us.
const READ_EXTENSIONS: [&str; 6] = [
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// Accepts data URIs with and without padding.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// An opened file. What its JSON says is unchecked: use [`item`] for its indices.
pub(super) struct Document {
    pub(super) root: Root,
    /// Empty for those that are only the fallback of compressed views.
    buffers: Vec<Vec<u8>>,
    /// Of compressed views, their plain bytes.
    unfolded: Vec<Option<Vec<u8>>>,
    folder: PathBuf,
}

/// `items[index]`, or an error that says what is missing.
pub(super) fn item<'a, T>(items: &'a [T], index: usize, what: &str) -> Result<&'a T> {
    items.get(index).with_context(|| {
        format!("refers to {what} {index}, but holds only {}; export it again", items.len())
    })
}

/// `bytes[offset..offset + length]`, or an error.
pub(super) fn range(bytes: &[u8], offset: u64, length: u64) -> Result<&[u8]> {
    let end = offset.checked_add(length).and_then(|end| usize::try_from(end).ok());
    end.and_then(|end| bytes.get(offset as usize..end)).with_context(|| {
        let have = bytes.len();
        format!("bytes {offset}+{length} lie outside the {have} present; export it again")
    })
}

impl Document {
    pub(super) fn open(bytes: &[u8], path: &Path) -> Result<Self> {
        let (json, binary) = split(bytes)?;
        let json = json.strip_prefix(BYTE_ORDER_MARK).unwrap_or(json);
        // Some exporters pad the chunk with zeros instead of spaces.
        let padding = json.iter().rev().take_while(|&&byte| byte == 0).count();
        let json = &json[..json.len() - padding];
        let root: Root = gltf::json::deserialize::from_slice(json)
            .map_err(|error| anyhow!("its JSON is not glTF 2.0 ({error}); export it again"))?;
        let version = &root.asset.version;
        ensure!(version.starts_with("2."), "is glTF {version}; export it as glTF 2.0");
        check_extensions(&root)?;
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        let mut document = Self { root, buffers: Vec::new(), unfolded: Vec::new(), folder };
        for index in 0..document.root.buffers.len() {
            let buffer =
                document.read_buffer(index, binary).with_context(|| format!("buffer {index}"))?;
            document.buffers.push(buffer);
        }
        document.unfold_views()?;
        Ok(document)
    }

    /// The bytes of a buffer view, decompressed.
    pub(super) fn view(&self, index: usize) -> Result<&[u8]> {
        let view = item(&self.root.buffer_views, index, "buffer view")?;
        if let Some(Some(bytes)) = self.unfolded.get(index) {
            return Ok(bytes);
        }
        let buffer = item(&self.buffers, view.buffer.value(), "buffer")?;
        range(buffer, view.byte_offset.unwrap_or_default().0, view.byte_length.0)
            .with_context(|| format!("buffer view {index}"))
    }

    /// The bytes that a URI holds or names.
    pub(super) fn resolve(&self, uri: &str) -> Result<Vec<u8>> {
        if let Some(data) = uri.strip_prefix("data:") {
            let (_, text) = data
                .split_once(";base64,")
                .context("holds a data URI that is not base64; export it again")?;
            return BASE64.decode(text).map_err(|error| anyhow!("broken base64: {error}"));
        }
        ensure!(
            !uri.contains("://"),
            "refers to {uri:?}; put that file beside it and export again"
        );
        let path = self.folder.join(percent_decoded(uri).as_ref());
        read_unnamed(&path)
            .with_context(|| format!("refers to {}, which must be put there", path.display()))
    }

    fn read_buffer(&self, index: usize, binary: Option<&[u8]>) -> Result<Vec<u8>> {
        let buffer = &self.root.buffers[index];
        let extension = buffer
            .extensions
            .as_ref()
            .and_then(|extensions| extensions.others.get(meshopt::EXTENSION));
        let mut bytes = match &buffer.uri {
            _ if extension.is_some() => return Ok(Vec::new()),
            Some(uri) => self.resolve(uri)?,
            None if index == 0 => {
                binary.context("lies in the binary chunk, which is missing")?.to_vec()
            }
            None => bail!("has no address; export it again"),
        };
        let length = buffer.byte_length.0;
        let have = bytes.len();
        ensure!(
            length <= have as u64,
            "holds {have} bytes where {length} are promised; copy or export the file again"
        );
        bytes.truncate(length as usize);
        Ok(bytes)
    }

    fn unfold_views(&mut self) -> Result<()> {
        let mut total = 0;
        for (index, view) in self.root.buffer_views.iter().enumerate() {
            let bytes = match compression(view) {
                Some(json) => Some(
                    self.unfold(json, &mut total)
                        .with_context(|| format!("compressed buffer view {index}"))?,
                ),
                None => None,
            };
            self.unfolded.push(bytes);
        }
        Ok(())
    }

    fn unfold(&self, json: &serde_json::Value, total: &mut usize) -> Result<Vec<u8>> {
        let parameters = meshopt::Parameters::parse(json)?;
        let buffer = item(&self.buffers, parameters.buffer, "buffer")?;
        let source = range(buffer, parameters.byte_offset, parameters.byte_length)?;
        let size = parameters.checked_size(source)?;
        super::super::add_within(total, size, MAX_UNFOLDED, "bytes in compressed views")?;
        meshopt::decode(&parameters, source)
    }
}

fn compression(view: &View) -> Option<&serde_json::Value> {
    view.extensions.as_ref()?.others.get(meshopt::EXTENSION)
}

fn check_extensions(root: &Root) -> Result<()> {
    let unread = |name: &&String| !READ_EXTENSIONS.contains(&name.as_str());
    if let Some(name) = root.extensions_required.iter().find(unread) {
        bail!("requires the extension {name}, which Dermis does not read; export without it");
    }
    Ok(())
}

/// A GLB's JSON and binary chunks; plain JSON as it is.
fn split(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>)> {
    if !bytes.starts_with(GLB_MAGIC) {
        return Ok((bytes, None));
    }
    let word = |at: usize| -> Result<u32> {
        let bytes = range(bytes, at as u64, 4).context("is cut short")?;
        Ok(bytes.iter().rev().fold(0, |word, &byte| word << 8 | u32::from(byte)))
    };
    let version = word(4)?;
    ensure!(version == 2, "is GLB version {version}; export it as glTF 2.0");
    let (length, have) = (word(8)?, bytes.len());
    ensure!(
        length as usize <= have,
        "is cut short: {have} of {length} bytes; copy or export it again"
    );
    let chunk = |at: usize| -> Result<(&[u8], &[u8])> {
        let data = range(bytes, (at + CHUNK_HEADER) as u64, word(at)?.into())?;
        Ok((&bytes[at + 4..at + 8], data))
    };
    let (kind, json) = chunk(GLB_HEADER).context("JSON chunk")?;
    ensure!(kind == b"JSON", "does not begin with a JSON chunk; export it again");
    let next = (GLB_HEADER + CHUNK_HEADER + json.len()).next_multiple_of(4);
    if next + CHUNK_HEADER > (length as usize) {
        return Ok((json, None));
    }
    let (kind, binary) = chunk(next).context("binary chunk")?;
    Ok((json, (kind == b"BIN\0").then_some(binary)))
}

/// Undoes the %20 of addresses; what is not UTF-8 or no escape stays as it is.
fn percent_decoded(uri: &str) -> Cow<'_, str> {
    if !uri.contains('%') {
        return uri.into();
    }
    let bytes = uri.as_bytes();
    let (mut decoded, mut at) = (Vec::with_capacity(bytes.len()), 0);
    while at < bytes.len() {
        let escape = bytes.get(at + 1..at + 3).filter(|_| bytes[at] == b'%');
        let digits = escape.and_then(|hex| std::str::from_utf8(hex).ok());
        match digits.and_then(|hex| u8::from_str_radix(hex, 16).ok()) {
            Some(byte) => (decoded.push(byte), at += 3).1,
            None => (decoded.push(bytes[at]), at += 1).1,
        }
    }
    String::from_utf8(decoded).map_or(uri.into(), Cow::from)
}
