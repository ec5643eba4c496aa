//! A file to packed bytes.
//!
//! Two walks through every payload: the first ([`super::survey`]) counts how often each difference comes by each
//! prediction, the second writes by the prediction that takes the fewest bits. A section is unpacked again at once;
//! where that is not the section, or is no shorter, it stands as it is.

use std::collections::BTreeMap;

use super::between::{BACK_BITS, Sides};
use super::columns::{Coder, Column, Rows, Table, walk};
use super::mesh::to_codes;
use super::predict::{PREDICTION_BITS, Prediction};
use super::rans::{Run, encode};
use super::reader::Memory;
use super::sides::sides;
use super::survey::{Choice, Key, Scope, Survey, Told, differences, told};
use super::{
    CODING_BITS, COUNT_BITS, Coding, ESCAPE, ESCAPED_BITS, MAGIC, MOST_EXPANSION, VERSION,
};
use crate::Avatar;
use crate::bits::BitWriter;
use crate::error::Error;
use crate::header::Header;
use crate::section::{Section, Sections, preamble, section_crc, split_header};

/// The packed form of a file, by which [`super::unpack`] gives the same bytes again.
///
/// # Errors
///
/// Where `bytes` is no valid file, or has more than 16,384 sections.
pub fn pack(bytes: &[u8]) -> Result<Vec<u8>, Error> {
    Avatar::parse(bytes)?;
    let (header_bytes, rest) = split_header(bytes)?;
    let header = Header::parse(header_bytes)?;
    let head_len = preamble::LEN + header_bytes.len();
    super::check_sections(Sections::new(rest).count())?;
    let sides = sides(Sections::new(rest), &header);
    let (mut counts, mut at) = (BTreeMap::new(), head_len);
    let mut sections = Vec::new();
    for (index, section) in Sections::new(rest).enumerate() {
        let sides = sides.get(&index).copied();
        let mut survey = Survey { scope: Scope::of(index, &section), sides, counts: &mut counts };
        let mut payload = section.payload.to_vec();
        to_codes(section.tag, &mut payload, header.vertices);
        // What cannot be walked stands as it is.
        let _ = walk(section.tag, &mut payload, &header, &bytes[..at], &mut survey);
        sections.push((section, payload, at));
        at += crate::section::head::LEN + section.payload.len();
    }
    let choices: BTreeMap<Key, Choice> =
        counts.into_iter().map(|(key, counts)| (key, counts.choice())).collect();
    let mut out = MAGIC.to_vec();
    out.extend(VERSION.to_le_bytes());
    out.extend((bytes.len() as u32).to_le_bytes());
    out.extend(crc32fast::hash(&out).to_le_bytes());
    out.extend(&bytes[..head_len]);
    let mut packer = Packer { header, sides, choices, state: State::default() };
    for (index, (section, payload, at)) in sections.into_iter().enumerate() {
        let coded = packer.section(index, &section, payload, &bytes[..at]);
        let coded = coded.as_deref().unwrap_or(section.payload);
        out.extend(section.tag);
        out.extend((section.payload.len() as u32).to_le_bytes());
        out.extend((coded.len() as u32).to_le_bytes());
        out.extend(section_crc(&section).to_le_bytes());
        out.extend(coded);
    }
    Ok(out)
}

/// The second walk through all sections.
struct Packer {
    header: Header,
    /// Of blocks that stand between others, by the index of their section.
    sides: BTreeMap<usize, Sides>,
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
    fn section(
        &mut self,
        index: usize,
        section: &Section<'_>,
        payload: Vec<u8>,
        before: &[u8],
    ) -> Option<Vec<u8>> {
        let state = self.state.clone();
        let coded = self.coded(index, section, payload, before);
        if coded.is_none() {
            // Readers do not see it.
            self.state = state;
        }
        coded
    }

    /// Codes the section's `payload`, which has its triangles and weights as [`to_codes`] makes them.
    fn coded(
        &mut self,
        index: usize,
        section: &Section<'_>,
        mut payload: Vec<u8>,
        before: &[u8],
    ) -> Option<Vec<u8>> {
        let mut writer = Writer {
            scope: Scope::of(index, section),
            sides: self.sides.get(&index).copied(),
            choices: &self.choices,
            held: &mut self.state.held,
            side: BitWriter::default(),
            runs: Vec::new(),
        };
        walk(section.tag, &mut payload, &self.header, before, &mut writer).ok()?;
        let (side, symbols) = (writer.side.finish(), encode(&writer.runs));
        let mut coded = [&(side.len() as u32).to_le_bytes()[..], &side, &symbols].concat();
        // Readers refuse what claims more.
        coded.resize(coded.len().max(payload.len().div_ceil(MOST_EXPANSION)), 0);
        payload.fill(0);
        self.state.memory.decode(section.tag, &mut payload, &self.header, before, &coded).ok()?;
        (payload == section.payload && coded.len() < payload.len()).then_some(coded)
    }
}

/// The second walk through a section.
struct Writer<'a> {
    scope: (Scope, Scope),
    sides: Option<Sides>,
    choices: &'a BTreeMap<Key, Choice>,
    held: &'a mut BTreeMap<(bool, u8), Key>,
    side: BitWriter,
    runs: Vec<Run>,
}

impl Writer<'_> {
    /// Says how numbers are coded, and codes those that have a table; whether they have none.
    fn symbols(
        &mut self,
        key: Key,
        table: Table,
        part: u8,
        symbols: impl Iterator<Item = u8>,
    ) -> bool {
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
        let key = Key::of_column(self.scope, column);
        let choice = self.choices.get(&key);
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
            if self.symbols(key, column.table, part as u8, halves.clone()) {
                halves.for_each(|half| self.side.push(half.into(), width));
            }
        }
        Ok(())
    }

    fn sides(&mut self) -> Option<Sides> {
        self.side.push(self.sides.is_some().into(), 1);
        if let Some(Sides { low, high, next }) = self.sides {
            self.side.push(low, BACK_BITS);
            self.side.push(high, BACK_BITS);
            self.side.push(next.into(), 1);
        }
        self.sides
    }

    fn triangles(&mut self, payload: &mut [u8], rows: &Rows<'_>) -> Result<(), Error> {
        let told = told(payload, rows).unwrap_or_default();
        let symbols = told.iter().filter_map(|told| match told {
            Told::Symbol(symbol, _) => Some(*symbol),
            _ => None,
        });
        let count = symbols.clone().count() as u32;
        let are_raw = self.symbols(Key::of_rows(self.scope, rows), rows.table, 0, symbols);
        if rows.between.is_some() {
            self.side.push(count, COUNT_BITS);
        }
        for told in told {
            match told {
                Told::Symbol(symbol, otherwise) if are_raw || symbol == ESCAPE => {
                    self.side.push(otherwise, ESCAPED_BITS);
                }
                Told::Raw(triangle) => self.side.push(triangle, ESCAPED_BITS),
                Told::Known | Told::Symbol(..) => {}
            }
        }
        Ok(())
    }
}
