//! A coded payload to the payload.

use super::columns::{Coder, Column, KEPT, Rows, Table, walk};
use super::mesh::from_codes;
use super::predict::{
    BATCH, FromEarlier, PREDICTION_BITS, Prediction, Predictor, Previous, Zero, unfold_column,
};
use super::rans::Decoder;
use super::table::{Frequencies, Slots};
use super::{CODING_BITS, Coding, ESCAPE, ESCAPED_BITS};
use crate::bits::{Bits, flip, flip_wide, mask};
use crate::discs::DiscLayout;
use crate::error::{Error, malformed};
use crate::header::Header;
use crate::order::BLOCK_LEN;

/// What unpacking needs beside the bytes: 72 KB.
#[derive(Clone, Debug)]
pub(super) struct Memory {
    tables: Tables,
    /// Numbers of a block's discs, before they are put together to records.
    staged: [[u8; BLOCK_LEN as usize]; 10],
}

/// Tables that columns leave behind.
#[derive(Clone, Debug)]
struct Tables {
    kept: [Frequencies; KEPT],
    own: [Frequencies; 2],
    /// Of the table that is in use.
    slots: Slots,
}

impl Default for Memory {
    fn default() -> Self {
        let none = Frequencies::default();
        let tables = Tables { kept: [none; KEPT], own: [none; 2], slots: Slots::default() };
        Self { tables, staged: [[0; BLOCK_LEN as usize]; 10] }
    }
}

impl Memory {
    pub(super) fn decode(
        &mut self,
        tag: [u8; 4],
        payload: &mut [u8],
        header: &Header,
        before: &[u8],
        coded: &[u8],
    ) -> Result<(), Error> {
        let (side, symbols) = super::split_side(coded)?;
        let Self { tables, staged } = self;
        let source = Coded { side: Bits::new(side), symbols: Decoder::new(symbols), tables };
        let mut reader = Reader { source, staged };
        walk(tag, payload, header, before, &mut reader)?;
        if reader.source.side.is_overdrawn() {
            return malformed("packed section", "its side information is too short");
        }
        from_codes(tag, payload, header.vertices)
    }
}

/// Fills payloads in.
struct Reader<'a> {
    source: Coded<'a>,
    staged: &'a mut [[u8; BLOCK_LEN as usize]; 10],
}

/// A coded payload, column by column.
struct Coded<'a> {
    side: Bits<'a>,
    symbols: Decoder<'a>,
    tables: &'a mut Tables,
}

impl Coded<'_> {
    /// How the next numbers are coded; makes their table ready.
    fn coding(&mut self, table: Table, part: u8) -> Result<Coding, Error> {
        let Some(coding) = Coding::of(self.side.take(CODING_BITS)) else {
            return malformed("packed section", "a column is coded in an unknown way");
        };
        let place = match table {
            Table::Kept(id) => self.tables.kept.get_mut(usize::from(id + part)),
            Table::Own(_) => self.tables.own.get_mut(usize::from(part)),
        };
        let Some(place) = place else {
            return malformed("packed section", "a table has no place");
        };
        if coding == Coding::NewTable {
            match Frequencies::read(&mut self.side) {
                Some(table) => *place = table,
                None => return malformed("packed section", "frequencies do not add up to 4,096"),
            }
        }
        if coding != Coding::Raw {
            self.tables.slots.fill(place);
        }
        Ok(coding)
    }

    /// How a column of at most 8 bits is predicted and coded, and its numbers, a batch at a time.
    fn numbers(
        &mut self,
        payload: &mut [u8],
        column: &Column<'_>,
        put: impl FnMut(&mut [u8], &[u8]),
    ) -> Result<(), Error> {
        let prediction = self.prediction()?;
        let coding = self.coding(column.table, 0)?;
        match (prediction, column.earlier) {
            (Prediction::Zero, _) => self.batches(payload, column, coding, Zero, put),
            (Prediction::Previous, _) => {
                self.batches(payload, column, coding, Previous::default(), put);
            }
            (Prediction::Earlier, Some(earlier)) => {
                self.batches(payload, column, coding, FromEarlier::new(earlier), put);
            }
            (Prediction::Earlier, None) => return unpredictable(),
        }
        Ok(())
    }

    fn prediction(&mut self) -> Result<Prediction, Error> {
        match Prediction::of(self.side.take(PREDICTION_BITS)) {
            Some(prediction) => Ok(prediction),
            None => malformed("packed section", "a column is predicted in an unknown way"),
        }
    }

    fn batches(
        &mut self,
        payload: &mut [u8],
        column: &Column<'_>,
        coding: Coding,
        mut predictor: impl Predictor,
        mut put: impl FnMut(&mut [u8], &[u8]),
    ) {
        let mut batch = [0; BATCH];
        let mut left = column.count;
        while left > 0 {
            let batch = &mut batch[..left.min(BATCH)];
            if coding == Coding::Raw {
                let side = &mut self.side;
                batch.iter_mut().for_each(|number| *number = side.take(column.width) as u8);
            } else {
                self.symbols.fill(&self.tables.slots, batch);
            }
            predictor.add(payload, batch);
            let mask = mask(column.width) as u8;
            batch.iter_mut().for_each(|number| *number &= mask);
            put(payload, batch);
            left -= batch.len();
        }
    }
}

/// Puts numbers into a column, where zeros stand.
fn place(column: &Column<'_>) -> impl FnMut(&mut [u8], &[u8]) {
    let Column { mut at, stride, .. } = *column;
    move |payload, batch| {
        for &number in batch {
            flip(payload, at, number.into());
            at += stride;
        }
    }
}

impl Coder for Reader<'_> {
    fn column(&mut self, payload: &mut [u8], column: &Column<'_>) -> Result<(), Error> {
        if column.width <= 8 {
            return self.source.numbers(payload, column, place(column));
        }
        let prediction = self.source.prediction()?;
        for (part, width) in [8, column.width - 8].into_iter().enumerate() {
            let half = Column { at: column.at + 8 * part, width, ..*column };
            let coding = self.source.coding(column.table, part as u8)?;
            self.source.batches(payload, &half, coding, Zero, place(&half));
        }
        if unfold_column(payload, column, prediction) { Ok(()) } else { unpredictable() }
    }

    fn discs(
        &mut self,
        payload: &mut [u8],
        columns: &[Column<'_>; 10],
        layout: DiscLayout,
    ) -> Result<(), Error> {
        for (column, staged) in columns.iter().zip(&mut *self.staged) {
            if column.width == 0 {
                staged.fill(0);
                continue;
            }
            let mut staged = staged.chunks_mut(BATCH);
            let put = |_: &mut [u8], batch: &[u8]| {
                if let Some(to) = staged.next().and_then(|staged| staged.get_mut(..batch.len())) {
                    to.copy_from_slice(batch);
                }
            };
            self.source.numbers(payload, column, put)?;
        }
        let [Column { mut at, stride, count, .. }, ..] = *columns;
        let [x, y, z, angle, s, t, luma, orange, green, opacity] = &*self.staged;
        let shifts = layout.shifts();
        for index in 0..count.min(x.len()) {
            let codes = [x, y, z, angle, s, t, luma, orange, green, opacity];
            let codes = codes.map(|numbers| numbers.get(index).map_or(0, |&code| code.into()));
            flip_wide(payload, at, layout.record(&shifts, codes));
            at += stride;
        }
        Ok(())
    }

    fn triangles(&mut self, payload: &mut [u8], rows: &Rows) -> Result<(), Error> {
        let coding = self.source.coding(rows.table, 0)?;
        let Coded { side, symbols, tables } = &mut self.source;
        let (mut triangle, mut index) = (0u32, 0usize);
        let (low_bits, end) = (rows.low_bits, rows.steps.1);
        let mut fits = true;
        let mut put = |gap: u32| {
            triangle = triangle.wrapping_add(gap);
            let low = triangle & mask(low_bits);
            flip(payload, rows.lows + index * low_bits as usize, low);
            let step = rows.steps.0 + (triangle >> low_bits) as usize + index;
            fits &= step < end;
            if step < end {
                flip(payload, step, 1);
            }
            index += 1;
        };
        let mut batch = [0; BATCH];
        let mut left = rows.count;
        while left > 0 {
            let batch = &mut batch[..left.min(BATCH)];
            if coding == Coding::Raw {
                batch.fill(ESCAPE);
            } else {
                symbols.fill(&tables.slots, batch);
            }
            for &mut symbol in &mut *batch {
                put(if symbol == ESCAPE { side.take(ESCAPED_BITS) } else { symbol.into() });
            }
            left -= batch.len();
        }
        if fits { Ok(()) } else { malformed("packed block", "its triangles are longer than it is") }
    }
}

fn unpredictable<T>() -> Result<T, Error> {
    malformed("packed section", "a column is predicted from what is not there")
}
