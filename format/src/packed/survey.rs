//! How often each difference comes, by each prediction, and what takes the fewest bits.

use std::collections::BTreeMap;

use super::between::{ALIKE, Sides};
use super::columns::{Coder, Column, Known, Rows, Table};
use super::predict::{BATCH, FromEarlier, Prediction, Predictor, Previous, folded, number};
use super::table::{Frequencies, SLOTS};
use super::{ESCAPE, ESCAPED_BITS};
use crate::bits::{BitWriter, mask};
use crate::error::Error;
use crate::record::TrianglesRecord;
use crate::section::{Section, holds_gaussians};
use crate::triangles::Triangles;

/// Columns that share a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Key {
    scope: Scope,
    table: u16,
    /// Whether they are of blocks that stand between others.
    between: bool,
}

/// Where a table is one and the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Scope {
    /// All blocks of a layer, or levels.
    Layer([u8; 4], u8),
    /// A section.
    Section(usize),
}

impl Scope {
    /// Of what a section's columns share with others.
    pub(super) fn of(index: usize, section: &Section<'_>) -> (Self, Self) {
        let own = Self::Section(index);
        match section.tag {
            tag if holds_gaussians(tag) => {
                let layer = section.payload.get(1).copied().unwrap_or(0);
                (Self::Layer(section.tag, layer), own)
            }
            _ => (own, own),
        }
    }
}

impl Key {
    fn new((kept, own): (Scope, Scope), table: Table, between: bool) -> Self {
        match table {
            Table::Kept(id) => Self { scope: kept, table: id.into(), between },
            Table::Own(id) => Self { scope: own, table: id, between },
        }
    }

    /// Of a column.
    pub(super) fn of_column(scopes: (Scope, Scope), column: &Column<'_>) -> Self {
        Self::new(scopes, column.table, matches!(column.known, Known::Between(..)))
    }

    /// Of triangles.
    pub(super) fn of_rows(scopes: (Scope, Scope), rows: &Rows<'_>) -> Self {
        Self::new(scopes, rows.table, rows.between.is_some())
    }
}

/// The numbers of a column, less what was predicted; folded if they have more than 8 bits.
pub(super) fn differences(
    payload: &[u8],
    column: &Column<'_>,
    prediction: Prediction,
) -> Option<Vec<u32>> {
    if column.width > 8 {
        return folded(payload, column, prediction);
    }
    let number = |index: usize| number(payload, column, index) as u8;
    let mut numbers: Vec<u8> = (0..column.count).map(number).collect();
    let mut subtract = |predictor: &mut dyn Predictor| {
        numbers.chunks_mut(BATCH).for_each(|batch| predictor.subtract(payload, batch));
    };
    match (prediction, column.known) {
        (Prediction::Zero, _) => {}
        (Prediction::Previous, _) => subtract(&mut Previous::default()),
        (Prediction::Earlier, Known::Earlier(earlier)) => subtract(&mut FromEarlier::new(earlier)),
        (Prediction::Between, Known::Between(between, number)) => {
            for (batch, numbers) in numbers.chunks_mut(BATCH).enumerate() {
                let predicted = between.predict(payload, batch)[number - ALIKE.start];
                numbers.iter_mut().zip(predicted).for_each(|(n, p)| *n = n.wrapping_sub(p));
            }
        }
        (Prediction::Earlier | Prediction::Between, _) => return None,
    }
    Some(numbers.iter().map(|&number| u32::from(number) & mask(column.width)).collect())
}

/// How a triangle is told.
#[derive(Clone, Copy, Debug)]
pub(super) enum Told {
    /// It is that on either side.
    Known,
    /// By a symbol, or where that is [`ESCAPE`] by a number in the side information.
    Symbol(u8, u32),
    /// By a number in the side information.
    Raw(u32),
}

impl Told {
    fn by_step(step: u32, otherwise: u32) -> Self {
        Self::Symbol(step.min(ESCAPE.into()) as u8, otherwise)
    }
}

/// How the triangles of a block are told; `None` if they are not between those on either side.
pub(super) fn told(payload: &[u8], rows: &Rows<'_>) -> Option<Vec<Told>> {
    let start = (rows.lows / 8).saturating_sub(size_of::<TrianglesRecord>());
    let (triangles, _) = Triangles::split(payload.get(start..)?, rows.count as u32)?;
    let Some(between) = &rows.between else {
        let before = std::iter::once(rows.base).chain(triangles.iter());
        let steps = triangles.iter().zip(before).map(|(here, before)| here.wrapping_sub(before));
        return Some(steps.map(|step| Told::by_step(step, step)).collect());
    };
    let mut sides = between.triangles();
    let told = |here: u32| match sides.next() {
        Some([low, high]) if low == high => (here == low).then_some(Told::Known),
        Some([low, _]) => Some(Told::by_step(here.wrapping_sub(low), here)),
        None => Some(Told::Raw(here)),
    };
    triangles.iter().map(told).collect()
}

/// How often each symbol comes in columns that share a table, by each prediction.
#[derive(Clone, Debug)]
pub(super) struct Counts {
    /// Bits of a low part and of a high one that stand as they are.
    widths: [u32; 2],
    /// Bits that follow [`ESCAPE`].
    escaped_bits: u32,
    columns: u32,
    by: [Predicted; Prediction::ALL.len()],
}

#[derive(Clone, Debug)]
struct Predicted {
    /// Columns for which it can be made.
    columns: u32,
    /// Of low bytes, and of high ones.
    parts: [[u32; 256]; 2],
}

impl Counts {
    /// Of columns of numbers of `width` bits.
    fn of_columns(width: u32) -> Self {
        Self::new([width.min(8), width.saturating_sub(8)], 0)
    }

    /// Of triangles.
    fn of_rows() -> Self {
        Self::new([ESCAPED_BITS, 0], ESCAPED_BITS)
    }

    fn new(widths: [u32; 2], escaped_bits: u32) -> Self {
        let none = || Predicted { columns: 0, parts: [[0; 256]; 2] };
        Self { widths, escaped_bits, columns: 0, by: Prediction::ALL.map(|_| none()) }
    }

    /// What takes the fewest bits.
    pub(super) fn choice(&self) -> Choice {
        let all = Prediction::ALL.iter().zip(&self.by);
        let can = all.filter(|(_, predicted)| predicted.columns == self.columns);
        let options = can.map(|(&prediction, predicted)| {
            let parts: [(f64, Option<Frequencies>); 2] = std::array::from_fn(|part| {
                part_choice(&predicted.parts[part], self.widths[part], self.escaped_bits)
            });
            let bits = parts[0].0 + parts[1].0;
            (bits, Choice { prediction, tables: parts.map(|(_, table)| table) })
        });
        let best = options.min_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or(Choice { prediction: Prediction::Zero, tables: [None; 2] }, |(_, choice)| {
            choice
        })
    }
}

/// Bits that symbols take, as they are or by a table.
fn part_choice(counts: &[u32; 256], width: u32, escaped_bits: u32) -> (f64, Option<Frequencies>) {
    let total: u32 = counts.iter().sum();
    let raw = f64::from(total) * f64::from(width);
    let Some(table) = Frequencies::of(counts) else { return (raw, None) };
    let bits = |(&count, &frequency): (&u32, &u16)| {
        let each = libm::log2(SLOTS as f64 / f64::from(frequency.max(1)));
        f64::from(count) * each
    };
    let mut written = BitWriter::default();
    table.write(&mut written);
    let escaped = f64::from(counts[usize::from(ESCAPE)]) * f64::from(escaped_bits);
    let coded = counts.iter().zip(&table.0).map(bits).sum::<f64>() + escaped + written.len() as f64;
    if coded < raw { (coded, Some(table)) } else { (raw, None) }
}

/// How columns that share a table are coded.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    pub(super) prediction: Prediction,
    /// Of low and high bytes; none: as they are.
    pub(super) tables: [Option<Frequencies>; 2],
}

/// The first walk.
pub(super) struct Survey<'a> {
    pub(super) scope: (Scope, Scope),
    pub(super) sides: Option<Sides>,
    pub(super) counts: &'a mut BTreeMap<Key, Counts>,
}

impl Coder for Survey<'_> {
    fn column(&mut self, payload: &mut [u8], column: &Column<'_>) -> Result<(), Error> {
        let counts = self
            .counts
            .entry(Key::of_column(self.scope, column))
            .or_insert_with(|| Counts::of_columns(column.width));
        counts.columns += 1;
        for (&prediction, predicted) in Prediction::ALL.iter().zip(&mut counts.by) {
            let Some(differences) = differences(payload, column, prediction) else { continue };
            predicted.columns += 1;
            for difference in differences {
                predicted.parts[0][difference as usize & 0xff] += 1;
                if column.width > 8 {
                    predicted.parts[1][difference as usize >> 8 & 0xff] += 1;
                }
            }
        }
        Ok(())
    }

    fn sides(&mut self) -> Option<Sides> {
        self.sides
    }

    fn triangles(&mut self, payload: &mut [u8], rows: &Rows<'_>) -> Result<(), Error> {
        let counts =
            self.counts.entry(Key::of_rows(self.scope, rows)).or_insert_with(Counts::of_rows);
        counts.columns += 1;
        counts.by[0].columns += 1;
        for told in told(payload, rows).unwrap_or_default() {
            if let Told::Symbol(symbol, _) = told {
                counts.by[0].parts[0][usize::from(symbol)] += 1;
            }
        }
        Ok(())
    }
}
