//! LoDAvatar, tables 1 (novel views) and 2 (reenactment).

use anyhow::Result;
use serde::Serialize;

use super::{Measure, at, made, rows};
use crate::embed::detail::Detail;
use crate::embed::hierarchy::gaussians_of;
use crate::eval::{Row, Split};
use crate::methods::Method;
use crate::model::Model;
use crate::options::Options;

/// A row of both tables.
#[derive(Clone, Debug, Serialize)]
pub struct Entry {
    /// The paper's name, or ours.
    pub avatar: String,
    /// Seconds of training by [`super::CLOCK`].
    pub seconds: f64,
    /// Table 1.
    pub novel_view: Option<Row>,
    /// Table 2; none where the mesh has no clip to spare.
    pub reenactment: Option<Row>,
}

/// The paper's avatars: name, uniform levels counted from 0, levels of detail after them.
const AVATARS: [(&str, u32, u32); 6] = [
    ("LoD1", 1, 0),
    ("LoD1+2DE", 1, 1),
    ("LoD1+3DE", 1, 2),
    ("LoD2", 2, 0),
    ("LoD2+3DE", 2, 1),
    ("LoD3", 3, 0),
];

/// Trains and measures the paper's avatars up to `greatest` Gaussians, and ours at the same counts: one nested
/// file of as many as the greatest of them has. `detail` says what is detailed (nothing: those avatars are left out);
/// each row has all steps of `options`.
pub fn tables(
    model: &Model,
    options: &Options,
    detail: &Detail,
    measure: Measure,
    greatest: u32,
    mut done: impl FnMut(&Entry),
) -> Result<Vec<Entry>> {
    // A name that nothing has is known before a row is trained.
    detail.select(model)?;
    let mut entries = Vec::new();
    for (name, level, detail_levels) in AVATARS {
        // Without anything to detail they would be the uniform levels by another name.
        if detail_levels > 0 && !detail.is_asked() {
            continue;
        }
        let detail = Detail { levels: detail_levels, ..detail.clone() };
        let detail = if detail_levels > 0 { detail } else { Detail::default() };
        let options =
            Options { method: Method::Lodavatar, levels: level + 1, detail, ..options.clone() };
        if gaussians_of(model, &options)? > u64::from(greatest) {
            continue;
        }
        let file = made(model, &options)?;
        let rows = rows(model, &file, &options, measure, options.size, &[])?;
        let of = |split| at(&rows, split, last(&rows)).cloned();
        let entry = Entry {
            avatar: name.to_owned(),
            seconds: file.seconds,
            novel_view: of(Split::NovelView),
            reenactment: of(Split::Reenactment),
        };
        done(&entry);
        entries.push(entry);
    }
    let counts: Vec<u32> =
        entries.iter().filter_map(|e| Some(e.novel_view.as_ref()?.gaussians)).collect();
    let Some(&most) = counts.iter().max() else { return Ok(entries) };
    let options = Options { method: Method::Dermis, gaussians: most, ..options.clone() };
    let file = made(model, &options)?;
    let rows = rows(model, &file, &options, measure, options.size, &counts)?;
    for count in counts {
        let entry = Entry {
            avatar: "ours".to_owned(),
            seconds: file.seconds,
            novel_view: at(&rows, Split::NovelView, count).cloned(),
            reenactment: at(&rows, Split::Reenactment, count).cloned(),
        };
        done(&entry);
        entries.push(entry);
    }
    Ok(entries)
}

/// Gaussians of the last level.
fn last(rows: &[Row]) -> u32 {
    rows.iter().map(|row| row.gaussians).max().unwrap_or(0)
}
