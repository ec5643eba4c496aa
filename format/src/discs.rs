//! Discs packed bit by bit: as many bits for each number as the avatar needs.
//!
//! Records stand in a row without gaps. The numbers of a disc fill three words of at most 32 bits, which a reader takes out
//! at once: [x y z angle] [s t Y Co] [Cg opacity], the first one in the lowest bits.

use crate::bits::{Appender, bits, bytes_for, mask, window};
use crate::order::GROUP_LEN;
use crate::quant::{Disc, Linear, Number, last_code};
use crate::record::{DiscGroup, DiscWidths, ShortRange, take_plane};

/// Most bits of a number.
pub const MOST_BITS: u8 = 8;

/// Where each number of a record stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DiscLayout {
    widths: DiscWidths,
    /// Bits of each word.
    words: [u32; 3],
}

impl Default for DiscLayout {
    /// 8 bits for every number.
    fn default() -> Self {
        Self::of(DiscWidths::default())
    }
}

impl Default for DiscWidths {
    /// 8 bits for every number.
    fn default() -> Self {
        let [position, color] = [[MOST_BITS; 3]; 2];
        Self { position, angle: MOST_BITS, scale: MOST_BITS, color, opacity: MOST_BITS }
    }
}

impl DiscLayout {
    /// `None` if a width is above [`MOST_BITS`].
    pub fn new(widths: DiscWidths) -> Option<Self> {
        let valid = bytemuck::bytes_of(&widths).iter().all(|&width| width <= MOST_BITS);
        valid.then(|| Self::of(widths))
    }

    fn of(widths: DiscWidths) -> Self {
        let ([x, y, z], [luma, orange, green]) = (widths.position, widths.color);
        let sum = |widths: &[u8]| widths.iter().map(|&width| u32::from(width)).sum();
        let words = [
            sum(&[x, y, z, widths.angle]),
            sum(&[widths.scale, widths.scale, luma, orange]),
            sum(&[green, widths.opacity]),
        ];
        Self { widths, words }
    }

    /// Bits of each number.
    pub fn widths(&self) -> DiscWidths {
        self.widths
    }

    /// Bits of a record, at most 80.
    pub fn bits(&self) -> u32 {
        self.words.iter().sum()
    }

    /// Bits of each word.
    pub(crate) fn word_bits(&self) -> [u32; 3] {
        self.words
    }

    /// Where each number stands in its word.
    pub(crate) fn shifts(&self) -> [u32; 10] {
        self.codes(|_, shift, _| shift).numbers()
    }

    /// Appends the record of codes, each as narrow as its number, by [`Self::shifts`].
    #[inline(always)]
    pub(crate) fn append(&self, to: &mut Appender<'_>, shifts: &[u32; 10], codes: [u32; 10]) {
        let at = |i: usize| codes[i] << (shifts[i] & 31);
        let [first, second, third] = self.words;
        let front = u64::from(at(0) | at(1) | at(2) | at(3));
        let middle = u64::from(at(4) | at(5) | at(6) | at(7));
        to.push(front | middle << (first & 63), first + second);
        to.push((at(8) | at(9)).into(), third);
    }

    /// Every number of a record: `field(word, shift, mask)` takes one out of a word.
    #[inline(always)]
    pub fn codes<F>(&self, field: impl Fn(usize, u32, u32) -> F) -> Disc<F> {
        let widths = &self.widths;
        let ([x, y, z], [luma, orange, green]) =
            (widths.position.map(u32::from), widths.color.map(u32::from));
        let (angle, scale, opacity) =
            (u32::from(widths.angle), u32::from(widths.scale), u32::from(widths.opacity));
        Disc {
            position: [field(0, 0, mask(x)), field(0, x, mask(y)), field(0, x + y, mask(z))],
            angle: field(0, x + y + z, mask(angle)),
            log2_scale: [field(1, 0, mask(scale)), field(1, scale, mask(scale))],
            color: [
                field(1, 2 * scale, mask(luma)),
                field(1, 2 * scale + luma, mask(orange)),
                field(2, 0, mask(green)),
            ],
            opacity: field(2, green, mask(opacity)),
        }
    }
}

/// Discs of a block, or of a block at a later level.
#[derive(Clone, Copy, Debug)]
pub struct Discs<'a> {
    layout: DiscLayout,
    groups: &'a [DiscGroup],
    records: &'a [u8],
    len: usize,
    shape: Option<Shape<'a>>,
}

/// Scales and opacities of a level, in place of those of the records.
#[derive(Clone, Copy, Debug)]
pub struct Shape<'a> {
    layout: DiscLayout,
    groups: &'a [DiscGroup],
    records: &'a [u8],
}

impl<'a> Shape<'a> {
    /// Ranges of 256 discs each, in a row.
    pub fn groups(&self) -> &'a [DiscGroup] {
        self.groups
    }

    /// Both scales and the opacity of disc `index`, 24 bits at most, the first one in the lowest bits; zeros beyond the end.
    #[inline]
    fn word(&self, index: usize) -> u32 {
        let width = self.layout.bits();
        bits(self.records, index.saturating_mul(width as usize), width)
    }

    /// log₂ of the scales of discs of a group, or of several side by side: `field(shift, mask)` takes a code out of their words,
    /// `constant` makes an `F` of an f32.
    #[inline(always)]
    pub fn log2_scale<F: Number>(
        &self,
        group: usize,
        field: impl Fn(u32, u32) -> F,
        constant: impl Fn(f32) -> F,
    ) -> [F; 2] {
        let width = u32::from(self.layout.widths.scale);
        let range = self.groups.get(group).map_or(ShortRange::default(), |group| group.log2_scale);
        let codes = [field(0, mask(width)), field(width, mask(width))];
        [range.decode(codes[0], &constant), range.decode(codes[1], &constant)]
    }

    /// Opacity of disc `index`; 0 beyond the end.
    #[inline]
    fn opacity(&self, index: usize) -> f32 {
        let Some(group) = self.groups.get(index / GROUP_LEN) else { return 0.0 };
        group.opacity.value((self.word(index) >> ((2 * self.layout.widths.scale) & 31)) as u16)
    }
}

impl<'a> Discs<'a> {
    /// `len` discs of these planes; `None` if the planes are not as long as so many need, or a width is above 8.
    pub fn new(
        widths: DiscWidths,
        groups: &'a [DiscGroup],
        records: &'a [u8],
        len: usize,
    ) -> Option<Self> {
        let layout = DiscLayout::new(widths)?;
        let bytes = bytes_for(len.checked_mul(layout.bits() as usize)?);
        let fits = groups.len() == len.div_ceil(GROUP_LEN) && records.len() == bytes;
        fits.then_some(Self { layout, groups, records, len, shape: None })
    }

    /// All records, bit by bit.
    pub(crate) fn records(&self) -> &'a [u8] {
        self.records
    }

    /// Splits `len` discs off the front of a block's bytes. Lengths are checked, ranges are not.
    pub(crate) fn split(bytes: &'a [u8], len: usize) -> Option<(Self, &'a [u8])> {
        let (widths, rest) = take_plane::<DiscWidths>(bytes, 1)?;
        let layout = DiscLayout::new(*widths.first()?)?;
        let (groups, rest) = take_plane(rest, len.div_ceil(GROUP_LEN))?;
        let (records, rest) = take_plane(rest, bytes_for(len * layout.bits() as usize))?;
        Some((Self { layout, groups, records, len, shape: None }, rest))
    }

    /// The same discs with scales and opacities of `shape`.
    pub(crate) fn shaped(self, shape: Self) -> Self {
        let Self { layout, groups, records, .. } = shape;
        Self { shape: Some(Shape { layout, groups, records }), ..self }
    }

    /// What stands in place of the records' scales and opacities, if anything does.
    #[inline(always)]
    pub fn shape(&self) -> Option<Shape<'a>> {
        self.shape
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Where the numbers of a record stand.
    pub fn layout(&self) -> DiscLayout {
        self.layout
    }

    /// Ranges of 256 discs each, in a row.
    pub fn groups(&self) -> &'a [DiscGroup] {
        self.groups
    }

    /// Greatest log₂ of a scale of each group, as it is drawn.
    pub fn greatest_log2_scales(&self) -> impl Iterator<Item = f32> + 'a {
        let own = (self.groups, self.layout);
        let (groups, layout) = self.shape.map_or(own, |shape| (shape.groups, shape.layout));
        let last = last_code(layout.widths.scale);
        groups.iter().map(move |group| group.log2_scale.value(last))
    }

    /// The words of disc `index`, and that of its [`Shape`]; zeros beyond the end.
    #[inline]
    pub fn words(&self, index: usize) -> [u32; 4] {
        let [first, second, third] = self.layout.words;
        let record = window(self.records, index.saturating_mul((first + second + third) as usize));
        let word = |at: u32, width: u32| ((record >> at) as u64 & ((1 << width) - 1)) as u32;
        let shape = self.shape.map_or(0, |shape| shape.word(index));
        [word(0, first), word(first, second), word(first + second, third), shape]
    }

    /// Disc `index`, decoded.
    #[inline]
    pub fn get(&self, index: usize) -> Option<Disc> {
        let group = self.groups.get(index / GROUP_LEN)?;
        let words = self.words(index);
        let field = |word: usize, shift: u32, mask: u32| (words[word] >> shift & mask) as f32;
        let codes = self.layout.codes(field);
        let mut disc = group.disc_of_codes(&codes, self.layout.widths.angle, |x| x);
        if let Some(shape) = self.shape {
            let scale = |shift, mask| field(3, shift, mask);
            disc.log2_scale = shape.log2_scale(index / GROUP_LEN, scale, |x| x);
            disc.opacity = shape.opacity(index);
        }
        (index < self.len).then_some(disc)
    }

    /// Opacity of disc `index`; 0 beyond the end.
    #[inline]
    pub fn opacity(&self, index: usize) -> f32 {
        if let Some(shape) = self.shape {
            return shape.opacity(index);
        }
        let Some(group) = self.groups.get(index / GROUP_LEN) else { return 0.0 };
        let width = u32::from(self.layout.widths.opacity);
        let end = index.saturating_add(1).saturating_mul(self.layout.bits() as usize);
        let code = bits(self.records, end - width as usize, width);
        group.opacity.value(code as u16)
    }

    /// All of them, decoded.
    pub fn iter(&self) -> impl Iterator<Item = Disc> + '_ {
        (0..self.len).filter_map(|index| self.get(index))
    }
}
