//! How often each difference comes, by each prediction, and what takes the fewest bits.

use std::collections::BTreeMap;

use super::ESCAPE;
use super::columns::{Coder, Column, Rows, Table};
use super::predict::{BATCH, FromEarlier, Prediction, Predictor, Previous, Zero, folded, number};
use super::table::{Frequencies, SLOTS};
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

pub(super) fn key((kept, own): (Scope, Scope), table: Table) -> Key {
    match table {
        Table::Kept(id) => Key { scope: kept, table: id.into() },
        Table::Own(id) => Key { scope: own, table: id },
    }
}

/// The numbers of a column, less what was predicted; folded if they have more than 8 bits.
pub(super) fn differences(
    payload: &[u8],
    column: &Column<'_>,
    prediction: Prediction,
) -> Option<Vec<u32>> {
    let numbers = (0..column.count).map(|index| number(payload, column, index));
    if column.width > 8 {
        return folded(payload, column, prediction);
    }
    let less = |mut predictor: Box<dyn Predictor + '_>| {
        let mut numbers: Vec<u8> = numbers.map(|number| number as u8).collect();
        numbers.chunks_mut(BATCH).for_each(|batch| predictor.subtract(payload, batch));
        numbers.iter().map(|&number| u32::from(number) & mask(column.width)).collect()
    };
    match (prediction, column.earlier) {
        (Prediction::Zero, _) => Some(less(Box::new(Zero))),
        (Prediction::Previous, _) => Some(less(Box::new(Previous::default()))),
        (Prediction::Earlier, Some(earlier)) => Some(less(Box::new(FromEarlier::new(earlier)))),
        (Prediction::Earlier, None) => None,
    }
}

/// Steps from one triangle to the next.
pub(super) fn gaps(payload: &[u8], rows: &Rows) -> Vec<u32> {
    let start = (rows.lows / 8).saturating_sub(size_of::<TrianglesRecord>());
    let triangles = payload.get(start..).and_then(|b| Triangles::split(b, rows.count as u32));
    let triangles: Vec<u32> = triangles.map_or(Vec::new(), |(all, _)| all.iter().collect());
    let first = triangles.first().copied().unwrap_or(0);
    let before = std::iter::once(first).chain(triangles.iter().copied());
    let gaps = triangles.iter().zip(before).map(|(here, before)| here.wrapping_sub(before));
    gaps.collect()
}

pub(super) fn gap_symbol(gap: u32) -> u8 {
    gap.min(ESCAPE.into()) as u8
}

/// How often each symbol comes in columns that share a table, by each prediction.
#[derive(Clone, Debug)]
pub(super) struct Counts {
    width: u32,
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
    fn new(width: u32) -> Self {
        let none = || Predicted { columns: 0, parts: [[0; 256]; 2] };
        Self { width, columns: 0, by: Prediction::ALL.map(|_| none()) }
    }

    /// What takes the fewest bits.
    pub(super) fn choice(&self) -> Choice {
        let all = Prediction::ALL.iter().zip(&self.by);
        let can = all.filter(|(_, predicted)| predicted.columns == self.columns);
        let options = can.map(|(&prediction, predicted)| {
            let widths = [self.width.min(8), self.width.saturating_sub(8)];
            let parts: [(f64, Option<Frequencies>); 2] =
                std::array::from_fn(|part| part_choice(&predicted.parts[part], widths[part]));
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
fn part_choice(counts: &[u32; 256], width: u32) -> (f64, Option<Frequencies>) {
    let total: u32 = counts.iter().sum();
    let raw = f64::from(total) * f64::from(width);
    let Some(table) = Frequencies::of(counts) else { return (raw, None) };
    let bits = |(&count, &frequency): (&u32, &u16)| {
        let each = libm::log2(SLOTS as f64 / f64::from(frequency.max(1)));
        f64::from(count) * each
    };
    let mut written = BitWriter::default();
    table.write(&mut written);
    let coded = counts.iter().zip(&table.0).map(bits).sum::<f64>() + written.len() as f64;
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
    pub(super) counts: &'a mut BTreeMap<Key, Counts>,
}

impl Coder for Survey<'_> {
    fn column(&mut self, payload: &mut [u8], column: &Column<'_>) -> Result<(), Error> {
        let counts = self
            .counts
            .entry(key(self.scope, column.table))
            .or_insert_with(|| Counts::new(column.width));
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

    fn triangles(&mut self, payload: &mut [u8], rows: &Rows) -> Result<(), Error> {
        let counts =
            self.counts.entry(key(self.scope, rows.table)).or_insert_with(|| Counts::new(8));
        counts.columns += 1;
        counts.by[0].columns += 1;
        for gap in gaps(payload, rows) {
            counts.by[0].parts[0][usize::from(gap_symbol(gap))] += 1;
        }
        Ok(())
    }
}
