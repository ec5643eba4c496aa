//! A coded payload to the payload.

use super::between::{ALIKE, BACK_BITS, Between, Sides};
use super::columns::{Coder, Column, KEPT, Known, Rows, Table, walk};
use super::mesh::from_codes;
use super::predict::{
    BATCH, FromEarlier, PREDICTION_BITS, Prediction, Predictor, Previous, Zero, unfold_column,
};
use super::rans::Decoder;
use super::table::{Frequencies, Slots};
use super::{CODING_BITS, COUNT_BITS, Coding, ESCAPE, ESCAPED_BITS};
use crate::bits::{Appender, Bits, flip, mask};
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

    /// How a column of at most 8 bits is coded, and its numbers, a batch at a time.
    fn numbers(
        &mut self,
        payload: &mut [u8],
        column: &Column<'_>,
        prediction: Prediction,
        put: impl FnMut(&mut [u8], &[u8]),
    ) -> Result<(), Error> {
        let coding = self.coding(column.table, 0)?;
        match (prediction, column.known) {
            (Prediction::Zero, _) => self.batches(payload, column, coding, Zero, put),
            (Prediction::Previous, _) => {
                self.batches(payload, column, coding, Previous::default(), put);
            }
            (Prediction::Earlier, Known::Earlier(earlier)) => {
                self.batches(payload, column, coding, FromEarlier::new(earlier), put);
            }
            (Prediction::Earlier | Prediction::Between, _) => return unpredictable(),
        }
        Ok(())
    }

    fn prediction(&mut self) -> Prediction {
        Prediction::of(self.side.take(PREDICTION_BITS))
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

impl Reader<'_> {
    /// Stages what discs on either side say.
    fn stage(&mut self, payload: &[u8], between: Between<'_>, count: usize) {
        for batch in 0..count.div_ceil(BATCH) {
            let alike = between.predict(payload, batch);
            for (staged, codes) in self.staged[ALIKE].iter_mut().zip(alike) {
                if let Some(staged) = staged.as_chunks_mut().0.get_mut(batch) {
                    *staged = codes;
                }
            }
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
        let prediction = self.source.prediction();
        if column.width <= 8 {
            return self.source.numbers(payload, column, prediction, place(column));
        }
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
        if let Known::Between(between, _) = columns[ALIKE.start].known {
            self.stage(payload, between, columns[ALIKE.start].count);
        }
        for (column, staged) in columns.iter().zip(&mut *self.staged) {
            if column.width == 0 {
                staged.fill(0);
                continue;
            }
            let prediction = self.source.prediction();
            let (rest, is_between) = match (prediction, column.known) {
                (Prediction::Between, Known::Between(..)) => (Prediction::Zero, true),
                _ => (prediction, false),
            };
            let mask = mask(column.width) as u8;
            let mut staged = staged.chunks_mut(BATCH);
            let put = |_: &mut [u8], batch: &[u8]| {
                let Some(staged) = staged.next() else { return };
                if is_between {
                    let numbers = staged.iter_mut().zip(batch);
                    numbers.for_each(|(number, by)| *number = number.wrapping_add(*by) & mask);
                } else if let Some(staged) = staged.get_mut(..batch.len()) {
                    staged.copy_from_slice(batch);
                }
            };
            self.source.numbers(payload, column, rest, put)?;
        }
        let [Column { at, count, .. }, ..] = *columns;
        let [x, y, z, angle, s, t, luma, orange, green, opacity] = &*self.staged;
        let shifts = layout.shifts();
        // Records begin with a byte.
        let mut records = Appender::new(payload.get_mut(at / 8..).unwrap_or_default());
        for index in 0..count.min(x.len()) {
            let codes = [x, y, z, angle, s, t, luma, orange, green, opacity];
            let codes = codes.map(|numbers| numbers.get(index).map_or(0, |&code| code.into()));
            layout.append(&mut records, &shifts, codes);
        }
        records.finish();
        Ok(())
    }

    fn sides(&mut self) -> Option<Sides> {
        let side = &mut self.source.side;
        (side.take(1) == 1).then(|| Sides {
            low: side.take(BACK_BITS),
            high: side.take(BACK_BITS),
            next: side.take(1) == 1,
        })
    }

    fn triangles(&mut self, payload: &mut [u8], rows: &Rows<'_>) -> Result<(), Error> {
        let coding = self.source.coding(rows.table, 0)?;
        let Coded { side, symbols, tables } = &mut self.source;
        let left = if rows.between.is_some() { side.take(COUNT_BITS) as usize } else { rows.count };
        let slots = &tables.slots;
        let batch = [0; BATCH];
        let mut symbols =
            Symbols { coding, decoder: symbols, slots, left, batch, len: BATCH, at: BATCH };
        let mut to = RowsWriter { payload, rows, index: 0, fits: true };
        match rows.between {
            None => {
                let mut triangle = rows.base;
                for _ in 0..rows.count {
                    let step = symbols.next_if(true);
                    let step = if step == ESCAPE { side.take(ESCAPED_BITS) } else { step.into() };
                    triangle = triangle.wrapping_add(step);
                    to.push(triangle);
                }
            }
            Some(between) => {
                let mut sides = between.triangles();
                for _ in 0..rows.count {
                    let Some([low, high]) = sides.next() else {
                        to.push(side.take(ESCAPED_BITS));
                        continue;
                    };
                    let step = symbols.next_if(low != high);
                    let is_escape = step == ESCAPE;
                    let told = low.wrapping_add(step.into());
                    to.push(if is_escape { side.take(ESCAPED_BITS) } else { told });
                }
            }
        }
        if !to.fits {
            return malformed("packed block", "its triangles are longer than it is");
        }
        if !symbols.are_taken() {
            return malformed(
                "packed block",
                "it has more or fewer steps to triangles than it says",
            );
        }
        Ok(())
    }
}

/// Symbols of a part, one at a time.
struct Symbols<'a, 'b> {
    coding: Coding,
    decoder: &'a mut Decoder<'b>,
    slots: &'a Slots,
    /// Symbols after those of the batch.
    left: usize,
    batch: [u8; BATCH],
    /// Those of the batch that are there.
    len: usize,
    at: usize,
}

impl Symbols<'_, '_> {
    /// The next one, [`ESCAPE`] where there are none; or 0, and it stays. Without a branch: which it is cannot be foretold.
    #[inline(always)]
    fn next_if(&mut self, takes: bool) -> u8 {
        if self.at == BATCH && self.left > 0 {
            self.fill();
        }
        let symbol = self.batch.get(self.at).copied().unwrap_or(ESCAPE);
        self.at += usize::from(takes);
        symbol & u8::from(takes).wrapping_neg()
    }

    fn fill(&mut self) {
        self.batch = [ESCAPE; BATCH];
        (self.at, self.len) = (0, self.left.min(BATCH));
        self.left -= self.len;
        if self.coding != Coding::Raw {
            let (batch, _) = self.batch.split_at_mut(self.len.min(BATCH));
            self.decoder.fill(self.slots, batch);
        }
    }

    /// Whether all there are were taken, and no more.
    fn are_taken(&self) -> bool {
        self.left == 0 && self.at == self.len
    }
}

/// Writes triangles into rows of zeros.
struct RowsWriter<'a> {
    payload: &'a mut [u8],
    rows: &'a Rows<'a>,
    index: usize,
    /// Whether all had room.
    fits: bool,
}

impl RowsWriter<'_> {
    #[inline(always)]
    fn push(&mut self, triangle: u32) {
        let Rows { low_bits, lows, steps: (start, end), base, .. } = *self.rows;
        let triangle = triangle.wrapping_sub(base);
        flip(self.payload, lows + self.index * low_bits as usize, triangle & mask(low_bits));
        let step = ((triangle >> low_bits) as usize).saturating_add(start + self.index);
        self.fits &= step < end;
        if step < end {
            flip(self.payload, step, 1);
        }
        self.index += 1;
    }
}

fn unpredictable<T>() -> Result<T, Error> {
    malformed("packed section", "a column is predicted from what is not there")
}
