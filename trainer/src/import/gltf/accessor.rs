//! Checked reading of accessors: every component type, normalized or not, strided, sparse.

use super::super::MAX_VERTICES;
use super::document::{Document, item, range};
use anyhow::{Context, Result, bail, ensure};
use gltf::json::accessor::{ComponentType, sparse};
use gltf::json::validation::Checked;

/// An accessor whose every element is known to lie inside its buffer view.
pub(super) struct Accessor<'a> {
    count: usize,
    /// Numbers in an element.
    width: usize,
    component: ComponentType,
    normalized: bool,
    /// From the first byte of the first element; `None` where all elements are zero.
    bytes: Option<&'a [u8]>,
    /// Bytes from an element to the next.
    stride: usize,
    /// Elements that differ: their indices, ascending, and their packed bytes.
    sparse: Option<(Vec<u32>, &'a [u8])>,
}

/// A vertex and the numbers there.
pub(super) type Moved<const N: usize> = (u32, [f32; N]);

impl<'a> Accessor<'a> {
    /// Opens accessor `index`, which must have one of `widths` numbers in an element.
    pub(super) fn open(document: &'a Document, index: usize, widths: &[usize]) -> Result<Self> {
        Self::open_unnamed(document, index, widths).with_context(|| format!("accessor {index}"))
    }

    fn open_unnamed(document: &'a Document, index: usize, widths: &[usize]) -> Result<Self> {
        let json = item(&document.root.accessors, index, "accessor")?;
        let (Checked::Valid(component), Checked::Valid(kind)) = (json.component_type, json.type_)
        else {
            bail!("is of an unknown type; export it again");
        };
        let width = kind.multiplicity();
        ensure!(widths.contains(&width), "holds {width} numbers an element, not {widths:?}");
        let size = width * component.0.size();
        let mut accessor = Self {
            count: usize::try_from(json.count.0).unwrap_or(usize::MAX),
            width,
            component: component.0,
            normalized: json.normalized,
            bytes: None,
            stride: size,
            sparse: None,
        };
        if let Some(view) = json.buffer_view {
            let offset = json.byte_offset.unwrap_or_default().0;
            accessor.bind(document, view.value(), offset, size)?;
        } else {
            let count = accessor.count;
            ensure!(count <= MAX_VERTICES, "claims {count} elements without data; export it again");
        }
        if let Some(sparse) = &json.sparse {
            accessor.sparse = Some(accessor.read_sparse(document, sparse, size)?);
        }
        Ok(accessor)
    }

    fn bind(
        &mut self,
        document: &'a Document,
        view: usize,
        offset: u64,
        size: usize,
    ) -> Result<()> {
        let bytes = document.view(view)?;
        let stride = document.root.buffer_views[view].byte_stride.map_or(0, |stride| stride.0);
        self.stride = if stride == 0 { size } else { stride };
        ensure!(self.stride >= size, "has a stride of {stride} bytes under its size of {size}");
        // The last element need not fill its stride.
        let length = match self.count {
            0 => 0,
            count => ((count - 1) as u64)
                .checked_mul(self.stride as u64)
                .and_then(|length| length.checked_add(size as u64))
                .with_context(|| format!("claims {count} elements; export it again"))?,
        };
        self.bytes = Some(range(bytes, offset, length)?);
        Ok(())
    }

    fn read_sparse(
        &self,
        document: &'a Document,
        json: &sparse::Sparse,
        size: usize,
    ) -> Result<(Vec<u32>, &'a [u8])> {
        let Checked::Valid(component) = json.indices.component_type else {
            bail!("has sparse indices of an unknown type; export it again");
        };
        let count = json.count.0;
        let bytes_of = |view: usize, offset: u64, size: usize| {
            let length = count.checked_mul(size as u64).context("claims too many elements")?;
            range(document.view(view)?, offset, length).context("sparse elements")
        };
        let size_of_index = component.0.size();
        let indices = &json.indices;
        let indices = bytes_of(indices.buffer_view.value(), indices.byte_offset.0, size_of_index)?;
        let indices: Vec<u32> = indices.chunks_exact(size_of_index).map(unsigned).collect();
        let ascends = indices.is_sorted_by(|a, b| a < b);
        let fits = indices.last().is_none_or(|&last| (last as usize) < self.count);
        ensure!(ascends && fits, "has sparse indices out of order or range; export it again");
        let values = &json.values;
        Ok((indices, bytes_of(values.buffer_view.value(), values.byte_offset.0, size)?))
    }

    /// Its first `count` elements, if it has as many.
    pub(super) fn truncated(mut self, count: usize) -> Option<Self> {
        if let Some((indices, _)) = &mut self.sparse {
            indices.retain(|&index| (index as usize) < count);
        }
        let enough = count <= self.count;
        self.count = count;
        enough.then_some(self)
    }

    /// Whether [`Self::nonzero`] looks at every element.
    pub(super) fn is_dense(&self) -> bool {
        self.bytes.is_some()
    }

    /// Number of elements.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Number of numbers in an element.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// All elements; numbers past the accessor's width are `fill`.
    pub(super) fn floats<const N: usize>(&self, fill: f32) -> Vec<[f32; N]> {
        let mut floats: Vec<_> = (0..self.count)
            .map(|index| self.base(index).map_or([0.0; N], |bytes| self.decode(bytes, fill)))
            .collect();
        for (index, value) in self.replaced(fill) {
            floats[index as usize] = value;
        }
        floats
    }

    /// Elements that are not zero, by ascending index. Costs nothing for the zeros of a sparse
    /// accessor without a base.
    pub(super) fn nonzero<const N: usize>(&self) -> Vec<Moved<N>> {
        let moved: Vec<Moved<N>> = match (&self.bytes, &self.sparse) {
            (None, _) => self.replaced(0.0).collect(),
            (Some(_), _) => (0..).zip(self.floats(0.0)).collect(),
        };
        moved.into_iter().filter(|(_, value)| *value != [0.0; N]).collect()
    }

    /// All elements as unsigned integers; numbers past the accessor's width are 0.
    pub(super) fn integers<const N: usize>(&self) -> Result<Vec<[u32; N]>> {
        use ComponentType::{U8, U16, U32};
        ensure!(
            matches!(self.component, U8 | U16 | U32),
            "holds numbers that are not unsigned integers where indices are expected"
        );
        let size = self.component.size();
        let decode = |bytes: &[u8]| {
            let mut element = [0; N];
            element.iter_mut().zip(bytes.chunks_exact(size)).for_each(|(e, b)| *e = unsigned(b));
            element
        };
        let mut integers: Vec<_> =
            (0..self.count).map(|index| self.base(index).map_or([0; N], decode)).collect();
        if let Some((indices, bytes)) = &self.sparse {
            for (&index, bytes) in indices.iter().zip(bytes.chunks_exact(self.size())) {
                integers[index as usize] = decode(bytes);
            }
        }
        Ok(integers)
    }

    fn size(&self) -> usize {
        self.width * self.component.size()
    }

    fn base(&self, index: usize) -> Option<&'a [u8]> {
        let at = index * self.stride;
        self.bytes.map(|bytes| &bytes[at..at + self.size()])
    }

    fn replaced<const N: usize>(&self, fill: f32) -> impl Iterator<Item = Moved<N>> {
        let (indices, bytes) =
            self.sparse.as_ref().map_or((&[][..], &[][..]), |(i, b)| (i.as_slice(), *b));
        let values = bytes.chunks_exact(self.size()).map(move |bytes| self.decode(bytes, fill));
        indices.iter().copied().zip(values)
    }

    fn decode<const N: usize>(&self, bytes: &[u8], fill: f32) -> [f32; N] {
        let mut element = [fill; N];
        let numbers = bytes.chunks_exact(self.component.size());
        element.iter_mut().zip(numbers).for_each(|(e, bytes)| *e = self.number(bytes));
        element
    }

    fn number(&self, bytes: &[u8]) -> f32 {
        // glTF 3.6.2.2: c / max, and at least -1 for the signed.
        let scaled = |number: f32, max: f32| match self.normalized {
            true => (number / max).max(-1.0),
            false => number,
        };
        match self.component {
            ComponentType::I8 => scaled(f32::from(bytes[0] as i8), 127.0),
            ComponentType::U8 => scaled(f32::from(bytes[0]), 255.0),
            ComponentType::I16 => scaled(f32::from(unsigned(bytes) as i16), 32767.0),
            ComponentType::U16 => scaled(f32::from(unsigned(bytes) as u16), 65535.0),
            ComponentType::U32 => scaled(unsigned(bytes) as f32, u32::MAX as f32),
            ComponentType::F32 => f32::from_bits(unsigned(bytes)),
        }
    }
}

/// Little-endian, of up to four bytes.
fn unsigned(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |number, &byte| number << 8 | u32::from(byte))
}
