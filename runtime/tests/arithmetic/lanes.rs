//! Every width of vector at every level of this CPU, and at the fallback, gives each lane the bits
//! that one f32 gives. A NaN is a NaN, whatever its payload: targets differ in it, and none reaches a pixel.

use dermis_runtime::kernel::Work;
use dermis_runtime::lanes::{Lanes, MAX_LANES};
use dermis_runtime::math::exp2_in_range;
use dermis_runtime::{Kernel, Level};
use fearless_simd::{Simd, dispatch, f32x4, f32x8, f32x16};

use crate::{both, floats};

fn levels() -> impl Iterator<Item = Level> {
    let of = |kernel| if let Kernel::Simd(level) = kernel { Some(level) } else { None };
    Kernel::available().into_iter().filter_map(of).chain([Level::fallback()])
}

/// Does `work` one number at a time, and in every width at every level: all outcomes are the same.
fn assert_same<W: Work<Output: PartialEq> + Copy>(what: &str, work: W) {
    let expected = work.run::<f32>(());
    for level in levels() {
        let name = Kernel::Simd(level).name();
        let same = dispatch!(level, simd => in_all_widths(simd, work)).map(|o| o == expected);
        assert_eq!(same, [true; 3], "{what} at {name} in 4, 8 and 16 lanes");
    }
}

#[inline(always)]
fn in_all_widths<S: Simd, W: Work + Copy>(simd: S, work: W) -> [W::Output; 3] {
    [work.run::<f32x4<S>>(simd), work.run::<f32x8<S>>(simd), work.run::<f32x16<S>>(simd)]
}

/// Bits of all outcomes, all NaNs alike.
fn push<V: Lanes>(values: V, outcomes: &mut Vec<u32>) {
    let mut lanes = [0.0; MAX_LANES];
    values.store(&mut lanes);
    let bits = |x: &f32| if x.is_nan() { f32::NAN.to_bits() } else { x.to_bits() };
    outcomes.extend(lanes[..V::LEN].iter().map(bits));
}

fn push_mask<V: Lanes>(mask: V::Mask, outcomes: &mut Vec<u32>) {
    let bits = V::bits(mask);
    assert_eq!(bits >> V::LEN, 0, "a bit for each lane, no more");
    outcomes.extend((0..V::LEN).map(|lane| bits >> lane & 1));
}

/// All kinds of floats, and many of each size that a frame knows: a multiple of 16.
fn sample() -> Vec<f32> {
    let edges = [
        0.0,
        f32::MIN_POSITIVE,
        f32::MIN_POSITIVE.next_down(),
        1e-45,
        f32::EPSILON,
        0.5,
        core::f32::consts::FRAC_1_SQRT_2,
        core::f32::consts::FRAC_1_SQRT_2.next_down(),
        core::f32::consts::SQRT_2,
        core::f32::consts::FRAC_PI_2,
        1.0,
        1.0f32.next_down(),
        1.0f32.next_up(),
        1.5,
        2.5,
        125.0,
        125.0f32.next_up(),
        126.0,
        127.0,
        127.0f32.next_up(),
        128.0,
        4_194_303.5,
        4_194_304.0,
        8_388_608.0,
        12_582_912.0,
        1e30,
        f32::MAX,
        f32::INFINITY,
        f32::NAN,
    ];
    let bits = floats(0.0, f32::INFINITY, 65_521);
    let even = (0..20_000u16).map(|i| f32::from(i) * (130.0 / 20_000.0));
    let mut sample: Vec<f32> = bits.chain(even).chain(edges).flat_map(both).collect();
    sample.resize(sample.len().next_multiple_of(MAX_LANES), 0.25);
    sample
}

/// Functions of one number.
#[derive(Clone, Copy)]
struct One<'a>(&'a [f32]);

impl Work for One<'_> {
    type Output = Vec<u32>;

    fn run<V: Lanes>(self, token: V::Token) -> Vec<u32> {
        let mut outcomes = Vec::new();
        for chunk in self.0.chunks_exact(V::LEN) {
            let x = V::load(token, chunk);
            let [sin, cos] = x.line();
            let of_all = [x, x.exp2(), x.log2(), sin, cos, x.sqrt(), x.abs(), -x];
            for value in of_all.into_iter().chain([x.nearest()]) {
                push(value, &mut outcomes);
            }
            push_mask::<V>(x.finite(), &mut outcomes);
            push_mask::<V>(!x.finite(), &mut outcomes);
        }
        by_number(outcomes, V::LEN, 11)
    }
}

/// Outcomes of a chunk stand function by function; afterwards number by number, for any width.
fn by_number(outcomes: Vec<u32>, width: usize, functions: usize) -> Vec<u32> {
    let chunks = outcomes.chunks_exact(width * functions);
    let lane = |chunk: &[u32], lane: usize| -> Vec<u32> {
        chunk.iter().skip(lane).step_by(width).copied().collect()
    };
    chunks.flat_map(|chunk| (0..width).flat_map(move |at| lane(chunk, at))).collect()
}

#[test]
fn functions_of_one_number() {
    let sample = sample();
    assert!(sample.len() > 100_000);
    assert_same("a function of one number", One(&sample));
}

/// Functions of two numbers: each with one that stands so far behind it.
#[derive(Clone, Copy)]
struct Two<'a>(&'a [f32], &'a [f32]);

impl Work for Two<'_> {
    type Output = Vec<u32>;

    fn run<V: Lanes>(self, token: V::Token) -> Vec<u32> {
        let mut outcomes = Vec::new();
        for (x, y) in self.0.chunks_exact(V::LEN).zip(self.1.chunks_exact(V::LEN)) {
            let (x, y) = (V::load(token, x), V::load(token, y));
            for value in [x + y, x - y, x * y, x / y, x.at_most(y), x.at_least(y)] {
                push(value, &mut outcomes);
            }
            let (below, reaches) = (x.below(y), x.reaches(y));
            push(V::select(below, x, y), &mut outcomes);
            for mask in [below, reaches, below & reaches, below | reaches] {
                push_mask::<V>(mask, &mut outcomes);
            }
        }
        by_number(outcomes, V::LEN, 11)
    }
}

#[test]
fn functions_of_two_numbers() {
    let sample = sample();
    for behind in [0, 1, 2, 59, 1009, 30_011] {
        let mut other = sample.clone();
        other.rotate_left(behind);
        assert_same("a function of two numbers", Two(&sample, &other));
    }
}

/// What is defined on a part of the numbers only.
#[derive(Clone, Copy)]
struct Bounded<'a> {
    /// In [−8, 0].
    exponents: &'a [f32],
    /// Normal and above 0.
    normal: &'a [f32],
}

impl Work for Bounded<'_> {
    type Output = Vec<u32>;

    fn run<V: Lanes>(self, token: V::Token) -> Vec<u32> {
        let mut outcomes = Vec::new();
        let chunks = self.exponents.chunks_exact(V::LEN).zip(self.normal.chunks_exact(V::LEN));
        for (p, x) in chunks {
            let (p, x) = (V::load(token, p), V::load(token, x));
            let [m, n] = x.mantissa_and_exponent();
            let rounded = p + p.like(dermis_runtime::math::ROUNDER);
            for value in [exp2_in_range(p), m, n, m.times_power_of_two(rounded), m.least(x)] {
                push(value, &mut outcomes);
            }
        }
        by_number(outcomes, V::LEN, 5)
    }
}

#[test]
fn functions_of_some_numbers() {
    let mut exponents: Vec<f32> = floats(0.0, 8.0, 4093).map(|x| -x).collect();
    exponents.resize(exponents.len().next_multiple_of(MAX_LANES), 0.0);
    let normal = floats(f32::MIN_POSITIVE, f32::MAX, 7993);
    let normal: Vec<f32> = normal.take(exponents.len()).collect();
    let exponents = &exponents[..normal.len() / MAX_LANES * MAX_LANES];
    assert!(exponents.len() > 250_000);
    assert_same("a function of some numbers", Bounded { exponents, normal: &normal });
}

/// Integers in and out.
#[derive(Clone, Copy)]
struct Integers<'a>(&'a [i32]);

impl Work for Integers<'_> {
    type Output = [Vec<u32>; 5];

    fn run<V: Lanes>(self, token: V::Token) -> [Vec<u32>; 5] {
        let [mut loaded, mut shorts, mut bytes, mut tiles, mut fields] = [const { Vec::new() }; 5];
        let (mut words, mut wide) = ([0; MAX_LANES], [0; MAX_LANES]);
        for chunk in self.0.chunks_exact(V::LEN) {
            push(V::load_integers(token, chunk), &mut loaded);
            let of = |f: fn(i32) -> i32| {
                let codes: Vec<i32> = chunk.iter().map(|&x| f(x)).collect();
                V::load_integers(token, &codes)
            };
            // Rounded down.
            let (x, y) = (of(|x| x & 0xffff), of(|x| (x * 7) & 0xffff));
            V::store_words(V::pack(token, [x + x.like(0.5), y], [0, 16]), &mut words);
            shorts.extend(&words[..V::LEN]);
            let channels = [of(|x| x & 255), of(|x| (x * 3) & 255), of(|x| (x >> 8) & 255)];
            let [r, g, b] = channels;
            let packed = V::pack(token, [r, g, b, of(|x| !x & 255)], [0, 8, 16, 24]);
            V::store_words(packed, &mut words);
            bytes.extend(&words[..V::LEN]);
            // As wide as the index of a tile, below three bits.
            let (x, y) = (of(|x| x & 0x3_ffff), of(|x| x % 5));
            V::store_words(V::pack(token, [x, y], [0, 29]), &mut wide);
            tiles.extend(&wide[..V::LEN]);
            let packed = V::load_words(token, &words);
            push(V::field(packed, 24, 0xff), &mut fields);
            push(V::field(packed, 5, 0x3f), &mut fields);
            push(V::field(packed, 0, 0xff_ffff), &mut fields);
        }
        [loaded, shorts, bytes, tiles, by_number(fields, V::LEN, 3)]
    }
}

#[test]
fn integers_in_and_out() {
    let codes: Vec<i32> = (0..1 << 16).chain((1 << 24) - 1024..1 << 24).collect();
    let [loaded, shorts, bytes, tiles, fields] = Integers(&codes).run::<f32>(());
    for (i, &code) in codes.iter().enumerate() {
        assert_eq!(loaded[i], (code as f32).to_bits());
        assert_eq!(shorts[i], (code & 0xffff | ((code * 7) & 0xffff) << 16) as u32);
        let expected = [code, code * 3, code >> 8, !code].map(|x| (x & 255) as u8);
        let word = u32::from_le_bytes(expected);
        assert_eq!(bytes[i], word);
        assert_eq!(tiles[i], (code & 0x3_ffff) as u32 | ((code % 5) as u32) << 29);
        let expected =
            [word >> 24, word >> 5 & 0x3f, word & 0xff_ffff].map(|x| (x as f32).to_bits());
        assert_eq!(fields[3 * i..3 * i + 3], expected);
    }
    assert_same("integers", Integers(&codes));
}

/// Rows to columns, and back.
#[derive(Clone, Copy)]
struct Rows<'a>(&'a [[u32; 4]]);

impl Work for Rows<'_> {
    /// Columns of numbers and of words; rows of each.
    type Output = [Vec<u32>; 4];

    fn run<V: Lanes>(self, token: V::Token) -> [Vec<u32>; 4] {
        let [mut numbers, mut words, mut rows, mut word_rows] = [const { Vec::new() }; 4];
        for chunk in self.0.chunks_exact(V::LEN) {
            let floats: Vec<[f32; 4]> = chunk.iter().map(|row| row.map(f32::from_bits)).collect();
            let columns = V::load_rows(token, &floats);
            columns.iter().for_each(|&column| push(column, &mut numbers));
            let word_columns = V::load_word_rows(token, chunk);
            for column in word_columns {
                let mut lanes = [0; MAX_LANES];
                V::store_words(column, &mut lanes);
                words.extend(&lanes[..V::LEN]);
            }
            for (columns, rows) in
                [(columns, &mut rows), (word_columns.map(V::of_bits), &mut word_rows)]
            {
                let mut to = [[0.0f32; 4]; MAX_LANES];
                V::store_rows(columns, &mut to);
                rows.extend(to[..V::LEN].iter().flatten().map(|x| x.to_bits()));
            }
        }
        [by_number(numbers, V::LEN, 4), by_number(words, V::LEN, 4), rows, word_rows]
    }
}

#[test]
fn rows_to_columns_and_back() {
    // Infinities and NaN are none of these.
    let rows: Vec<[u32; 4]> = (0..64).map(|i| [i, i | 0x3f00_0000, i << 16, !i >> 2]).collect();
    let expected: Vec<u32> = rows.iter().flatten().copied().collect();
    let found = Rows(&rows).run::<f32>(());
    assert_eq!(found[1], expected, "words, number by number");
    assert_eq!(found[2..], [expected.clone(), expected], "there and back");
    assert_same("rows", Rows(&rows));
}

/// A slice that is too short gives zeros and takes nothing, at any width.
#[derive(Clone, Copy)]
struct Short;

impl Work for Short {
    type Output = bool;

    fn run<V: Lanes>(self, token: V::Token) -> bool {
        let zero = |x: V| {
            let mut lanes = [1.0; MAX_LANES];
            x.store(&mut lanes);
            lanes[..V::LEN].iter().all(|x| x.to_bits() == 0)
        };
        let mut short = vec![7.0; V::LEN - 1];
        V::splat(token, 1.0).store(&mut short);
        let mut words = vec![7; V::LEN - 1];
        V::store_words(V::pack(token, [V::splat(token, 1.0); 4], [0, 8, 16, 24]), &mut words);
        let mut rows = vec![[7.0; 4]; V::LEN - 1];
        V::store_rows([V::splat(token, 1.0); 4], &mut rows);
        let untouched = short.iter().all(|&x| x == 7.0)
            && words.iter().all(|&x| x == 7)
            && rows.as_flattened().iter().all(|&x| x == 7.0);
        let loaded = [
            V::load(token, &short),
            V::load_integers(token, &vec![7; V::LEN - 1]),
            V::of_bits(V::load_words(token, &words)),
        ];
        let word_rows = V::load_word_rows(token, &vec![[7; 4]; V::LEN - 1]).map(V::of_bits);
        let rows = V::load_rows(token, &rows);
        untouched && loaded.into_iter().chain(rows).chain(word_rows).all(zero)
    }
}

#[test]
fn slices_that_are_too_short() {
    assert!(Short.run::<f32>(()));
    assert_same("a short slice", Short);
}
