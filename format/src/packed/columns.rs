//! What a section's payload consists of: columns, each the same number of every record in a row.
//!
//! A coder is led through a payload column by column. What the next columns are follows from what stands in those
//! before, so that the same walk leads the packer, which has all of it, and the unpacker, which has what it wrote so
//! far.

use super::between::{ALIKE, Between, Neighbours, Sides};
use super::earlier::Earlier;
use crate::bits::bytes_for;
use crate::discs::DiscLayout;
use crate::error::{Error, malformed};
use crate::header::{FrameKind, Header, PerLevel, RecordKind};
use crate::order::{BLOCK_LEN, GROUP_LEN};
use crate::record::{
    BlockRecord, ChannelRecord, ClipRecord, DiscGroup, DiscWidths, FullGroup, FullRecord,
    MorphRecord, TrianglesRecord, take_plane,
};
use crate::section::tag;

/// The same number of every record in a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Column<'a> {
    /// First bit of the first number.
    pub(super) at: usize,
    /// Bits from one to the next.
    pub(super) stride: usize,
    /// Numbers.
    pub(super) count: usize,
    /// Bits of each, 1 to 16.
    pub(super) width: u32,
    /// How far before a number the one stands that is most like it, in numbers; 1 if they have at most 8 bits.
    pub(super) lag: usize,
    /// What earlier sections say of them.
    pub(super) known: Known<'a>,
    /// Whose symbols come equally often.
    pub(super) table: Table,
}

/// What earlier sections say of the numbers of a column.
#[derive(Clone, Copy, Debug)]
pub(super) enum Known<'a> {
    /// Nothing.
    Nothing,
    /// Of discs of a level: the same number at an earlier one.
    Earlier(Earlier<'a>),
    /// Of discs of a block: those on either side; and which number it is, one of [`ALIKE`].
    Between(Between<'a>, usize),
}

/// Where a table of frequencies is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Table {
    /// For a number of a disc or of a group, or for triangles; for all blocks of a layer, or all of its levels. High
    /// bytes have the next one.
    Kept(u8),
    /// For one column, or for several in a row that are named alike.
    Own(u16),
}

/// Kept tables of a block.
mod kept {
    /// After those of a disc's ten numbers.
    pub(super) const TRIANGLES: u8 = 10;
    /// Of ranges: two.
    pub(super) const GROUPS: u8 = 11;
    /// Tables of a block, before those of a level.
    pub(super) const OF_BLOCK: u8 = 13;
}

/// Tables that are kept.
pub(super) const KEPT: usize = 2 * kept::OF_BLOCK as usize;

/// Triangles of a block: Elias and Fano's rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rows<'a> {
    /// Triangles.
    pub(super) count: usize,
    /// Bits below.
    pub(super) low_bits: u32,
    /// First bit of the lower parts.
    pub(super) lows: usize,
    /// First bit of the steps, and the bit after the last one.
    pub(super) steps: (usize, usize),
    /// What the first step begins at.
    pub(super) base: u32,
    /// Blocks on either side.
    pub(super) between: Option<Neighbours<'a>>,
    pub(super) table: Table,
}

/// What happens to each column.
pub(super) trait Coder {
    /// Codes a column of a payload.
    fn column(&mut self, payload: &mut [u8], column: &Column<'_>) -> Result<(), Error>;
    /// Codes the records of discs, whose columns are these; those without a bit are none.
    fn discs(
        &mut self,
        payload: &mut [u8],
        columns: &[Column<'_>; 10],
        _layout: DiscLayout,
    ) -> Result<(), Error> {
        let mut columns = columns.iter().filter(|column| column.width > 0);
        columns.try_for_each(|column| self.column(payload, column))
    }
    /// Codes which blocks a block stands between, if any.
    fn sides(&mut self) -> Option<Sides>;
    /// Codes the triangles of a block.
    fn triangles(&mut self, payload: &mut [u8], rows: &Rows<'_>) -> Result<(), Error>;
}

/// What leads through a payload.
struct Walk<'a, 'p, C> {
    coder: &'a mut C,
    payload: &'p mut [u8],
    /// Bytes that have been coded.
    at: usize,
    /// Columns with a table of their own.
    own: u16,
}

/// Leads `coder` through a payload whose length is known. `before` is the file up to the section.
pub(super) fn walk<C: Coder>(
    tag: [u8; 4],
    payload: &mut [u8],
    header: &Header,
    before: &[u8],
    coder: &mut C,
) -> Result<(), Error> {
    if payload.len().checked_mul(8).is_none() {
        return malformed(
            "packed section",
            "its bits are more than a number of this machine holds",
        );
    }
    let mut walk = Walk { coder, payload, at: 0, own: 0 };
    match tag {
        tag::VERTICES => walk.shorts(3, header.vertices as usize)?,
        tag::TRIANGLES => {
            walk.shorts(3 * shorts_of_index(header), header.triangles as usize)?;
        }
        tag::SKIN => {
            let vertices = header.vertices as usize;
            if header.binds <= 256 {
                walk.bytes(4, vertices)?;
            } else {
                walk.shorts(4, vertices)?;
            }
            walk.bytes(4, vertices)?;
        }
        tag::MORPH => walk.morph_target(header)?,
        tag::CLIP => walk.clip()?,
        tag::BLOCK => walk.block(header, before)?,
        tag::LEVEL | tag::SHAPE => walk.level(header, before)?,
        _ => {}
    }
    walk.rest()
}

/// u16 of an index of a vertex.
fn shorts_of_index(header: &Header) -> usize {
    if header.vertices <= 1 << 16 { 1 } else { 2 }
}

impl<C: Coder> Walk<'_, '_, C> {
    fn column(&mut self, column: Column<'_>) -> Result<(), Error> {
        if column.count == 0 || column.width == 0 {
            return Ok(());
        }
        self.check(&column)?;
        self.coder.column(self.payload, &column)
    }

    /// Whether all of a column lies in the payload.
    fn check(&self, column: &Column<'_>) -> Result<(), Error> {
        let Column { at, stride, count, width, .. } = *column;
        let end = count.saturating_sub(1).checked_mul(stride).and_then(|bits| bits.checked_add(at));
        let end = end.and_then(|bits| bits.checked_add(width as usize));
        if end.is_none_or(|end| end > self.payload.len().saturating_mul(8)) {
            return malformed("packed section", "its parts are longer than it is");
        }
        Ok(())
    }

    /// `len` numbers of `width` bits each in all of `count` records.
    fn plane(&mut self, len: usize, width: u32, count: usize) -> Result<(), Error> {
        let stride = len * width as usize;
        for number in 0..len {
            let at = 8 * self.at + number * width as usize;
            self.own += 1;
            let table = Table::Own(self.own);
            self.column(Column { at, stride, count, width, lag: 1, known: Known::Nothing, table })?;
        }
        self.skip(count.saturating_mul(stride) / 8);
        Ok(())
    }

    /// Records of so many u16.
    fn shorts(&mut self, len: usize, count: usize) -> Result<(), Error> {
        self.plane(len, 16, count)
    }

    /// Records of so many bytes.
    fn bytes(&mut self, len: usize, count: usize) -> Result<(), Error> {
        self.plane(len, 8, count)
    }

    /// Bytes of all kinds.
    fn mixed(&mut self, count: usize) -> Result<(), Error> {
        self.bytes(1, count)
    }

    /// All that is left.
    fn rest(&mut self) -> Result<(), Error> {
        self.mixed(self.payload.len().saturating_sub(self.at))
    }

    fn skip(&mut self, bytes: usize) {
        self.at = self.at.saturating_add(bytes);
    }

    /// Codes a record, and returns what stands in it.
    fn record<T: bytemuck::Pod>(&mut self) -> Result<T, Error> {
        let start = self.at;
        self.mixed(size_of::<T>())?;
        match self.payload.get(start..).and_then(|bytes| take_plane::<T>(bytes, 1)) {
            Some(([record], _)) => Ok(*record),
            _ => malformed("packed section", "it is too short"),
        }
    }

    fn morph_target(&mut self, header: &Header) -> Result<(), Error> {
        let head: MorphRecord = self.record()?;
        self.mixed(head.name_len.get().into())?;
        let index = shorts_of_index(header);
        let rest = self.payload.len().saturating_sub(self.at);
        let count = rest / (2 * index + 6);
        self.shorts(index, count)?;
        self.shorts(3, count)
    }

    fn clip(&mut self) -> Result<(), Error> {
        let head: ClipRecord = self.record()?;
        self.mixed(head.name_len.get().into())?;
        let first = self.at;
        self.mixed(usize::from(head.channels.get()).saturating_mul(size_of::<ChannelRecord>()))?;
        // Channels are short: they share a table.
        self.own += 1;
        let table = Table::Own(self.own);
        for channel in 0..usize::from(head.channels.get()) {
            let at = first + channel * size_of::<ChannelRecord>();
            let record = self.payload.get(at..).and_then(|b| take_plane::<ChannelRecord>(b, 1));
            let Some(([record], _)) = record else {
                return malformed("packed section", "it is too short");
            };
            let lag = match record.property {
                0 | 2 => 3,
                1 => 4,
                _ => 1,
            };
            let count = (record.keys.get() as usize).saturating_mul(lag);
            let at = 8 * self.at;
            self.column(Column {
                at,
                stride: 16,
                count,
                width: 16,
                lag,
                known: Known::Nothing,
                table,
            })?;
            self.skip(2 * count);
        }
        Ok(())
    }

    /// The head of a block or a level: what it says.
    fn head(&mut self) -> Result<BlockRecord, Error> {
        let head: BlockRecord = self.record()?;
        if !(1..=BLOCK_LEN).contains(&head.count.get().into()) {
            return malformed("packed block", "it has none or too many Gaussians");
        }
        Ok(head)
    }

    fn block(&mut self, header: &Header, before: &[u8]) -> Result<(), Error> {
        let head = self.head()?;
        let count = usize::from(head.count.get());
        let mut between = None;
        if header.frame != FrameKind::World {
            if header.record == RecordKind::Disc
                && let Some(sides) = self.coder.sides()
            {
                between = Neighbours::find(before, header, head.region, sides);
                if between.is_none() {
                    return malformed(
                        "packed block",
                        "it stands between blocks that are not there",
                    );
                }
            }
            self.triangles(count, between)?;
        }
        match header.record {
            RecordKind::Disc => self.discs(count, 0, |number, groups, widths| {
                let known = between.filter(|_| ALIKE.contains(&number));
                let known = known.and_then(|sides| sides.discs(groups, widths));
                known.map_or(Known::Nothing, |between| Known::Between(between, number))
            })?,
            RecordKind::Full => {
                self.shorts(size_of::<FullGroup>() / 2, count.div_ceil(GROUP_LEN))?;
                self.full_records(count)?;
            }
        }
        if header.per_level == PerLevel::Opacity {
            let later = usize::from(header.layers).saturating_sub(usize::from(head.layer) + 1);
            self.bytes(later, count)?;
        }
        self.bytes(3 * header.harmonics(), count)
    }

    fn level(&mut self, header: &Header, before: &[u8]) -> Result<(), Error> {
        let head = self.head()?;
        let earlier = Earlier::find(before, header, &head);
        self.discs(head.count.get().into(), kept::OF_BLOCK, |number, groups, widths| {
            let earlier = earlier.map(|discs| Earlier { discs, number, groups, widths });
            earlier.map_or(Known::Nothing, Known::Earlier)
        })
    }

    fn triangles(&mut self, count: usize, between: Option<Neighbours<'_>>) -> Result<(), Error> {
        let head: TrianglesRecord = self.record()?;
        let low_bits = u32::from(head.low_bits).min(24);
        let lows = self.at;
        self.skip(bytes_for(count * low_bits as usize));
        let start = self.at;
        self.skip(head.step_bytes.get().into());
        if self.at > self.payload.len() {
            return malformed("packed block", "its triangles are longer than it is");
        }
        let rows = Rows {
            count,
            low_bits,
            lows: 8 * lows,
            steps: (8 * start, 8 * self.at),
            base: head.base.get(),
            between,
            table: Table::Kept(kept::TRIANGLES),
        };
        self.coder.triangles(self.payload, &rows)
    }

    /// Widths, groups and records of discs. `known` says what is known of a number, whose ranges stand where it is told, with
    /// these widths.
    fn discs<'k>(
        &mut self,
        count: usize,
        tables: u8,
        known: impl Fn(usize, usize, DiscWidths) -> Known<'k>,
    ) -> Result<(), Error> {
        let widths: DiscWidths = self.record()?;
        let Some(layout) = DiscLayout::new(widths) else {
            return malformed("packed block", "a width is above 8");
        };
        let groups = self.at;
        let shorts = size_of::<DiscGroup>() / 2;
        let table = Table::Kept(tables + kept::GROUPS);
        let len = count.div_ceil(GROUP_LEN);
        let (at, count_of_shorts) = (8 * groups, shorts * len);
        self.column(Column {
            at,
            stride: 16,
            count: count_of_shorts,
            width: 16,
            lag: shorts,
            known: Known::Nothing,
            table,
        })?;
        self.skip(2 * count_of_shorts);
        let stride = layout.bits() as usize;
        let (start, fields) = (8 * self.at, fields(layout));
        let columns = core::array::from_fn(|number| {
            let (bit, width) = fields.get(number).copied().unwrap_or_default();
            let table = Table::Kept(tables + number as u8);
            let known = known(number, groups, widths);
            Column { at: start + bit as usize, stride, count, width, lag: 1, known, table }
        });
        columns.iter().try_for_each(|column| self.check(column))?;
        self.coder.discs(self.payload, &columns, layout)?;
        self.skip(bytes_for(count * stride));
        Ok(())
    }

    /// Three u16, then bytes.
    fn full_records(&mut self, count: usize) -> Result<(), Error> {
        let len = size_of::<FullRecord>();
        let fields = (0..3).map(|i| (2 * i, 16)).chain((6..len).map(|i| (i, 8)));
        for (byte, width) in fields {
            self.own += 1;
            let (at, table) = (8 * (self.at + byte), Table::Own(self.own));
            let stride = 8 * len;
            self.column(Column { at, stride, count, width, lag: 1, known: Known::Nothing, table })?;
        }
        self.skip(count * len);
        Ok(())
    }
}

/// First bit and width of each number of a record.
pub(super) fn fields(layout: DiscLayout) -> [(u32, u32); 10] {
    let [first, second, _] = layout.word_bits();
    let start = |word: usize| match word {
        0 => 0,
        1 => first,
        _ => first + second,
    };
    layout.codes(|word, shift, mask| (start(word) + shift, mask.count_ones())).numbers()
}
