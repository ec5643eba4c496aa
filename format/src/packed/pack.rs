//! A file to packed bytes.
//!
//! Two walks through every payload: the first counts how often each difference comes by each prediction, the second writes by the
//! prediction that takes the fewest bits. A section is unpacked again at once; where that is not the section, or is no shorter, it stands
//! as it is.

use std::collections::BTreeMap;

use super::columns::{Coder, Column, Rows, Table, walk};
use super::predict::{
    BATCH, FromEarlier, PREDICTION_BITS, Prediction, Predictor, Previous, Zero, folded, number,
};
use super::rans::{Run, encode};
use super::table::{Frequencies, SLOTS};
use super::unpack::Memory;
use super::{CODING_BITS, Coding, ESCAPE, ESCAPED_BITS, MAGIC, MOST_EXPANSION, VERSION};
use crate::Avatar;
use crate::bits::{BitWriter, mask};
use crate::error::Error;
use crate::header::Header;
use crate::record::TrianglesRecord;
use crate::section::{Section, Sections, preamble, section_crc, split_header, tag};
use crate::triangles::Triangles;

/// The packed form of a file, by which [`super::unpack`] gives the same bytes again.
///
/// # Errors
///
/// Where `bytes` is no valid file.
pub fn pack(bytes: &[u8]) -> Result<Vec<u8>, Error> {
    Avatar::parse(bytes)?;
    let (header_bytes, rest) = split_header(bytes)?;
    let header = Header::parse(header_bytes)?;
    let head_len = preamble::LEN + header_bytes.len();
    let (mut counts, mut at) = (BTreeMap::new(), head_len);
    let mut sections = Vec::new();
    for (index, section) in Sections::new(rest).enumerate() {
        let mut survey = Survey { scope: Scope::of(index, &section), counts: &mut counts };
        let mut payload = section.payload.to_vec();
        // What cannot be walked stands as it is.
        let _ = walk(section.tag, &mut payload, &header, &bytes[..at], &mut survey);
        sections.push((section, at));
        at += crate::section::head::LEN + section.payload.len();
    }
    let choices: BTreeMap<Key, Choice> =
        counts.into_iter().map(|(key, counts)| (key, counts.choice())).collect();
    let mut out = MAGIC.to_vec();
    out.extend(VERSION.to_le_bytes());
    out.extend((bytes.len() as u32).to_le_bytes());
    out.extend(crc32fast::hash(&out).to_le_bytes());
    out.extend(&bytes[..head_len]);
    let mut packer = Packer { header, choices, state: State::default() };
    for (index, (section, at)) in sections.into_iter().enumerate() {
        let coded = packer.section(index, &section, &bytes[..at]);
        let coded = coded.as_deref().unwrap_or(section.payload);
        out.extend(section.tag);
        out.extend((section.payload.len() as u32).to_le_bytes());
        out.extend((coded.len() as u32).to_le_bytes());
        out.extend(section_crc(&section).to_le_bytes());
        out.extend(coded);
    }
    Ok(out)
}

/// Columns that share a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    scope: Scope,
    table: u16,
}

/// Where a table is one and the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Scope {
    /// All blocks of a layer, or levels.
    Layer([u8; 4], u8),
    /// A section.
    Section(usize),
}

impl Scope {
    /// Of what a section's columns share with others.
    fn of(index: usize, section: &Section<'_>) -> (Self, Self) {
        let own = Self::Section(index);
        match section.tag {
            tag::BLOCK | tag::LEVEL => {
                let layer = section.payload.get(1).copied().unwrap_or(0);
                (Self::Layer(section.tag, layer), own)
            }
            _ => (own, own),
        }
    }
}

fn key((kept, own): (Scope, Scope), table: Table) -> Key {
    match table {
        Table::Kept(id) => Key { scope: kept, table: id.into() },
        Table::Own(id) => Key { scope: own, table: id },
    }
}

/// The numbers of a column, less what was predicted; folded if they have more than 8 bits.
fn differences(payload: &[u8], column: &Column<'_>, prediction: Prediction) -> Option<Vec<u32>> {
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
fn gaps(payload: &[u8], rows: &Rows) -> Vec<u32> {
    let start = (rows.lows / 8).saturating_sub(size_of::<TrianglesRecord>());
    let triangles = payload.get(start..).and_then(|b| Triangles::split(b, rows.count as u32));
    let triangles: Vec<u32> = triangles.map_or(Vec::new(), |(all, _)| all.iter().collect());
    let first = triangles.first().copied().unwrap_or(0);
    let before = std::iter::once(first).chain(triangles.iter().copied());
    let gaps = triangles.iter().zip(before).map(|(here, before)| here.wrapping_sub(before));
    gaps.collect()
}

fn gap_symbol(gap: u32) -> u8 {
    gap.min(ESCAPE.into()) as u8
}

/// How often each symbol comes in columns that share a table, by each prediction.
#[derive(Clone, Debug)]
struct Counts {
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
    fn choice(&self) -> Choice {
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
struct Choice {
    prediction: Prediction,
    /// Of low and high bytes; none: as they are.
    tables: [Option<Frequencies>; 2],
}

/// The first walk.
struct Survey<'a> {
    scope: (Scope, Scope),
    counts: &'a mut BTreeMap<Key, Counts>,
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

/// The second walk through all sections.
struct Packer {
    header: Header,
    choices: BTreeMap<Key, Choice>,
    state: State,
}

/// What sections leave behind for those after them.
#[derive(Clone, Debug, Default)]
struct State {
    /// Whose table stands in each place of the reader.
    held: BTreeMap<(bool, u8), Key>,
    /// The reader.
    memory: Memory,
}

impl Packer {
    /// The coded payload, if it is shorter.
    fn section(&mut self, index: usize, section: &Section<'_>, before: &[u8]) -> Option<Vec<u8>> {
        let state = self.state.clone();
        let coded = self.coded(index, section, before);
        if coded.is_none() {
            // Readers do not see it.
            self.state = state;
        }
        coded
    }

    fn coded(&mut self, index: usize, section: &Section<'_>, before: &[u8]) -> Option<Vec<u8>> {
        let mut payload = section.payload.to_vec();
        let mut writer = Writer {
            scope: Scope::of(index, section),
            choices: &self.choices,
            held: &mut self.state.held,
            side: BitWriter::default(),
            runs: Vec::new(),
        };
        walk(section.tag, &mut payload, &self.header, before, &mut writer).ok()?;
        let (side, symbols) = (writer.side.finish(), encode(&writer.runs));
        let coded = [&(side.len() as u32).to_le_bytes()[..], &side, &symbols].concat();
        payload.fill(0);
        self.state.memory.decode(section.tag, &mut payload, &self.header, before, &coded).ok()?;
        let is_short = coded.len() < payload.len() && payload.len() <= MOST_EXPANSION * coded.len();
        (payload == section.payload && is_short).then_some(coded)
    }
}

/// The second walk through a section.
struct Writer<'a> {
    scope: (Scope, Scope),
    choices: &'a BTreeMap<Key, Choice>,
    held: &'a mut BTreeMap<(bool, u8), Key>,
    side: BitWriter,
    runs: Vec<Run>,
}

impl Writer<'_> {
    /// Says how numbers are coded, and codes those that have a table; whether they have none.
    fn symbols(&mut self, table: Table, part: u8, symbols: impl Iterator<Item = u8>) -> bool {
        let key = key(self.scope, table);
        let Some(Some(frequencies)) =
            self.choices.get(&key).map(|choice| choice.tables[usize::from(part)])
        else {
            self.side.push(Coding::Raw as u32, CODING_BITS);
            return true;
        };
        let place = match table {
            Table::Kept(id) => (true, id + part),
            Table::Own(_) => (false, part),
        };
        if self.held.insert(place, key) == Some(key) {
            self.side.push(Coding::SameTable as u32, CODING_BITS);
        } else {
            self.side.push(Coding::NewTable as u32, CODING_BITS);
            frequencies.write(&mut self.side);
        }
        self.runs.push(Run { symbols: symbols.collect(), table: frequencies });
        false
    }
}

impl Coder for Writer<'_> {
    fn column(&mut self, payload: &mut [u8], column: &Column<'_>) -> Result<(), Error> {
        let choice = self.choices.get(&key(self.scope, column.table));
        let prediction = choice.map_or(Prediction::Zero, |choice| choice.prediction);
        let differences = differences(payload, column, prediction).unwrap_or_default();
        self.side.push(prediction.code(), PREDICTION_BITS);
        for (part, width) in
            [column.width.min(8), column.width.saturating_sub(8)].into_iter().enumerate()
        {
            if width == 0 {
                continue;
            }
            let halves = differences.iter().map(|difference| (difference >> (8 * part)) as u8);
            if self.symbols(column.table, part as u8, halves.clone()) {
                halves.for_each(|half| self.side.push(half.into(), width));
            }
        }
        Ok(())
    }

    fn triangles(&mut self, payload: &mut [u8], rows: &Rows) -> Result<(), Error> {
        let gaps = gaps(payload, rows);
        if self.symbols(rows.table, 0, gaps.iter().map(|&gap| gap_symbol(gap))) {
            gaps.iter().for_each(|&gap| self.side.push(gap, ESCAPED_BITS));
        } else {
            let far = gaps.iter().filter(|&&gap| gap_symbol(gap) == ESCAPE);
            far.for_each(|&gap| self.side.push(gap, ESCAPED_BITS));
        }
        Ok(())
    }
}
