//! The PLY container: rows of numbers with named columns. The parsing is `serde_ply`'s; what stands
//! here distrusts the file before its rows are read, and says in one line what is wrong with it.

use std::io::{BufRead, Chain, Cursor, ErrorKind, Read};

use anyhow::{Context, Result, anyhow, bail, ensure};
use serde::de::{DeserializeSeed, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_ply::{
    DeserializeError, ElementDef, PlyFormat, PlyHeader, PlyReader, PropertyType, ScalarType,
};

/// Headers that end later are none: real ones have some kilobytes.
const HEADER_LIMIT: u64 = 1 << 20;

/// Ends the last number of a text that has no line break at its end.
const LINE_BREAK: &[u8] = b"\n";

/// The header again, the rest of the file, and a line break.
type Body<R> = Chain<Chain<Cursor<Vec<u8>>, R>, &'static [u8]>;

/// A PLY whose header has been read and found possible.
pub(super) struct Ply<R> {
    reader: PlyReader<Body<R>>,
    /// Place of the element that is wanted among all elements.
    index: usize,
}

impl<R: BufRead> Ply<R> {
    /// Reads the header of a file of `len` bytes, and checks that the rows up to the last one of
    /// `element` can be there. Takes memory for the header alone.
    pub(super) fn open(mut file: R, len: u64, element: &str) -> Result<Self> {
        let mut start = Vec::new();
        file.by_ref()
            .take(HEADER_LIMIT)
            .read_to_end(&mut start)
            .context("cannot be read; is it a file?")?;
        ensure!(start.starts_with(b"ply"), "is no PLY; give a file that begins with \"ply\"");
        let mut cursor = Cursor::new(start.as_slice());
        let header = PlyReader::from_reader(&mut cursor).map_err(header_error)?.header().clone();
        let body_len = len.saturating_sub(cursor.position());
        let index = header.elem_defs.iter().position(|e| e.name == element).with_context(|| {
            format!("has no element {element}; export it as a PLY of 3D Gaussian Splatting")
        })?;
        check_lengths(&header, index, body_len)?;
        let end = if header.format == PlyFormat::Ascii { LINE_BREAK } else { &[] };
        let body = Cursor::new(start).chain(file).chain(end);
        let reader = PlyReader::from_reader(body).map_err(header_error)?;
        Ok(Self { reader, index })
    }

    /// The element that is wanted.
    pub(super) fn element(&self) -> &ElementDef {
        &self.reader.header().elem_defs[self.index]
    }

    /// Whether the file has an element of this name.
    pub(super) fn has_element(&self, name: &str) -> bool {
        self.reader.header().elem_defs.iter().any(|element| element.name == name)
    }

    /// What the header says in comments.
    pub(super) fn comments(&self) -> impl Iterator<Item = &str> {
        self.reader.header().comments.iter().map(|comment| comment.trim())
    }

    /// The place of a property that holds one number in each row; `None` if there is none of this name.
    pub(super) fn column(&self, name: &str) -> Result<Option<usize>> {
        let element = self.element();
        let mut columns = element.properties.iter().enumerate().filter(|(_, p)| p.name == name);
        let Some((column, property)) = columns.next() else { return Ok(None) };
        let again = "export it again";
        ensure!(columns.next().is_none(), "has the property {name} twice; {again}");
        let is_number = matches!(property.property_type, PropertyType::Scalar(_));
        ensure!(is_number, "its property {name} is a list, not a number; {again}");
        Ok(Some(column))
    }

    /// Calls `visit` with the numbers in `columns` of each row of the element.
    pub(super) fn for_each_row(
        mut self,
        columns: &[usize],
        visit: impl FnMut(&[f64]),
    ) -> Result<()> {
        let elements = self.reader.header().elem_defs.clone();
        let mut reader = &mut self.reader;
        for element in &elements[..self.index] {
            read_rows(&mut reader, element, &[], |_| ())?;
        }
        read_rows(&mut reader, &elements[self.index], columns, visit)
    }
}

fn header_error(error: DeserializeError) -> anyhow::Error {
    match error.0.kind() {
        ErrorKind::UnexpectedEof => anyhow!(
            "its header does not end within its first {HEADER_LIMIT} bytes; copy or export it again"
        ),
        _ => anyhow!("its header: {}; export it again", error.0),
    }
}

/// Whether `body_len` bytes can hold the elements up to the one at `index`.
fn check_lengths(header: &PlyHeader, index: usize, body_len: u64) -> Result<()> {
    let mut free = body_len;
    for (place, element) in header.elem_defs[..=index].iter().enumerate() {
        let row: u64 =
            element.properties.iter().map(|p| least_bytes(&p.property_type, header)).sum();
        let count = element.count as u64;
        let fits = match row {
            0 => u64::MAX,
            // The last number of a text may end without a blank.
            _ => (free + u64::from(header.format == PlyFormat::Ascii)) / row,
        };
        ensure!(
            count <= fits,
            "its header claims {count} rows of {}, its bytes hold at most {fits}; copy or export it again",
            element.name
        );
        free = free.saturating_sub(count.saturating_mul(row));
        ensure!(place < index || count > 0, "has no row of {}; export it again", element.name);
    }
    Ok(())
}

/// Fewest bytes that a property takes in a row.
fn least_bytes(property: &PropertyType, header: &PlyHeader) -> u64 {
    let (PropertyType::Scalar(scalar) | PropertyType::List { count_type: scalar, .. }) = property;
    match (header.format, scalar) {
        // A digit and a blank.
        (PlyFormat::Ascii, _) => 2,
        (_, ScalarType::I8 | ScalarType::U8) => 1,
        (_, ScalarType::I16 | ScalarType::U16) => 2,
        (_, ScalarType::I32 | ScalarType::U32 | ScalarType::F32) => 4,
        (_, ScalarType::F64) => 8,
    }
}

/// Reads the rows of the next element.
fn read_rows<R: BufRead>(
    reader: &mut &mut PlyReader<R>,
    element: &ElementDef,
    columns: &[usize],
    visit: impl FnMut(&[f64]),
) -> Result<()> {
    let mut slots = vec![None; element.properties.len()];
    for (slot, &column) in columns.iter().enumerate() {
        slots[column] = Some(slot);
    }
    let mut done = 0;
    let rows = Rows { slots: &slots, values: vec![0.0; columns.len()], done: &mut done, visit };
    let read = reader.next_value_seed(rows);
    let Err(DeserializeError(error)) = read else { return Ok(()) };
    let ElementDef { name, count, .. } = element;
    match error.kind() {
        ErrorKind::UnexpectedEof => {
            bail!("ends after {done} of {count} rows of {name}; copy or export it again")
        }
        _ => bail!("{name} row {done}: {error}; export it again"),
    }
}

/// All rows of an element.
struct Rows<'a, F> {
    /// Of each property: where its number goes, if it is wanted.
    slots: &'a [Option<usize>],
    values: Vec<f64>,
    /// Rows read so far.
    done: &'a mut usize,
    visit: F,
}

impl<'de, F: FnMut(&[f64])> DeserializeSeed<'de> for Rows<'_, F> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de, F: FnMut(&[f64])> Visitor<'de> for Rows<'_, F> {
    type Value = ();

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("rows")
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut rows: A) -> Result<(), A::Error> {
        // Rows without properties have no end that the file's length would set.
        if self.slots.is_empty() {
            return Ok(());
        }
        while rows.next_element_seed(Row { slots: self.slots, values: &mut self.values })?.is_some()
        {
            *self.done += 1;
            (self.visit)(&self.values);
        }
        Ok(())
    }
}

/// One row.
struct Row<'a> {
    slots: &'a [Option<usize>],
    values: &'a mut [f64],
}

impl<'de> DeserializeSeed<'de> for Row<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for Row<'_> {
    type Value = ();

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a row")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut row: A) -> Result<(), A::Error> {
        for slot in self.slots {
            match slot {
                Some(slot) => {
                    (_, self.values[*slot]) =
                        row.next_entry::<IgnoredAny, f64>()?.unwrap_or((IgnoredAny, 0.0))
                }
                None => drop(row.next_entry::<IgnoredAny, IgnoredAny>()?),
            }
        }
        Ok(())
    }
}
