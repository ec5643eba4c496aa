//! Changes that leave a file one that can be cut into sections.

use dermis_format::section::{head, preamble, tag};

use crate::seal::{header_len, payload_len, seal};

/// What libFuzzer does to the first `len` of `bytes`, to no more than `most`; says how many there are then.
pub type Bytewise = fn(bytes: &mut [u8], len: usize, most: usize) -> usize;

/// Bytes that a payload may grow by at once.
const GROWTH: usize = 64;

/// Numbers on which something turns.
const TURNING: [u32; 16] = [
    0,
    1,
    0x7f,
    0x80,
    0xff,
    0xffff,
    0x0001_0000,
    0x00ff_ffff,
    0x7fff_ffff,
    0xffff_fffe,
    0xffff_ffff,
    0x3f80_0000,
    0x7f80_0000,
    0x7fc0_0000,
    0x5368_d4a5,
    0x0000_7f80,
];

const TAGS: [[u8; 4]; 17] = [
    tag::VERTICES,
    tag::SKIN,
    tag::TRIANGLES,
    tag::SIDES,
    tag::TRIANGLE_REGIONS,
    tag::REGIONS,
    tag::LAYERS,
    tag::IMPORTANCES,
    tag::JOINTS,
    tag::JOINT_NAMES,
    tag::BINDS,
    tag::MORPH,
    tag::CLIP,
    tag::KEY_FRAMES,
    tag::BLOCK,
    tag::LEVEL,
    tag::SHAPE,
];

/// Changes an input of `len` bytes in place, to at most `most`; `parameters` bytes lie between flags and file. Mostly
/// a section, the header or the parameters; now and then anything, where there is nothing like a file always.
pub fn mutate(
    data: &mut [u8],
    len: usize,
    most: usize,
    seed: u32,
    parameters: usize,
    bytewise: Bytewise,
) -> usize {
    let mut random = Random(u64::from(seed));
    let front = 1 + parameters;
    let parts = data.get(front..len).and_then(Parts::cut);
    let Some(mut parts) = parts.filter(|_| random.below(16) > 0) else {
        return bytewise(data, len, most);
    };
    if parameters > 0 && random.below(4) == 0 {
        let at = 1 + random.below(parameters);
        for byte in &mut data[at..front.min(at + 1 + random.below(4))] {
            *byte = random.next() as u8;
        }
        return len;
    }
    if random.below(64) == 0 {
        data[0] = random.next() as u8;
        return len;
    }
    for _ in 0..=random.below(3) {
        parts.change(&mut random, bytewise);
    }
    let mut file = parts.join();
    if random.below(32) == 0 {
        file.truncate(random.below(file.len() + 1));
    }
    if front + file.len() > most {
        return bytewise(data, len, most);
    }
    data[front..front + file.len()].copy_from_slice(&file);
    front + file.len()
}

/// A file in parts.
struct Parts {
    /// Up to the header.
    preamble: Vec<u8>,
    header: Vec<u8>,
    sections: Vec<([u8; 4], Vec<u8>)>,
    /// What is no whole section.
    rest: Vec<u8>,
}

impl Parts {
    fn cut(file: &[u8]) -> Option<Self> {
        let (preamble, rest) = file.split_at_checked(preamble::LEN)?;
        let (header, mut rest) = rest.split_at_checked(header_len(preamble))?;
        let mut sections = Vec::new();
        while let Some((head, after)) = rest.split_at_checked(head::LEN)
            && let Some((payload, after)) = after.split_at_checked(payload_len(head))
        {
            sections.push(([head[0], head[1], head[2], head[3]], payload.to_vec()));
            rest = after;
        }
        let [preamble, header, rest] = [preamble, header, rest].map(<[u8]>::to_vec);
        Some(Self { preamble, header, sections, rest })
    }

    /// The file, lengths and CRCs right.
    fn join(&self) -> Vec<u8> {
        let mut file = self.preamble.clone();
        file[preamble::HEADER_LEN].copy_from_slice(&(self.header.len() as u16).to_le_bytes());
        file.extend(&self.header);
        for (tag, payload) in &self.sections {
            file.extend(tag);
            file.extend((payload.len() as u32).to_le_bytes());
            file.extend([0; 4]);
            file.extend(payload);
        }
        file.extend(&self.rest);
        seal(&mut file);
        file
    }

    fn change(&mut self, random: &mut Random, bytewise: Bytewise) {
        let n = self.sections.len();
        if n == 0 || random.below(8) == 0 {
            if random.below(4) == 0 {
                by_bytes(&mut self.header, bytewise);
            } else {
                put(&mut self.header, random);
            }
            return;
        }
        let (at, other) = (random.below(n), random.below(n));
        match random.below(24) {
            0 => {
                self.sections.remove(at);
            }
            1 => self.sections.insert(other, self.sections[at].clone()),
            2 => self.sections.swap(at, other),
            3 => self.sections[at].0 = TAGS[random.below(TAGS.len())],
            4 => self.sections[at].1 = self.sections[other].1.clone(),
            5 => self.rest.clear(),
            6..14 => by_bytes(&mut self.sections[at].1, bytewise),
            _ => put(&mut self.sections[at].1, random),
        }
    }
}

/// Lets libFuzzer change bytes and their number.
fn by_bytes(bytes: &mut Vec<u8>, bytewise: Bytewise) {
    let (len, most) = (bytes.len(), bytes.len() + GROWTH);
    bytes.resize(most, 0);
    let len = bytewise(bytes, len, most);
    bytes.truncate(len);
}

/// Writes a number, or a bit of one, over some bytes.
fn put(bytes: &mut [u8], random: &mut Random) {
    if bytes.is_empty() {
        return;
    }
    let at = random.below(bytes.len());
    let word = match random.below(4) {
        0 => random.next() as u32,
        1 => u32::from(bytes[at]) ^ (1 << random.below(8)),
        2 => u32::from(bytes[at].wrapping_add(random.below(9) as u8).wrapping_sub(4)),
        _ => TURNING[random.below(TURNING.len())],
    };
    let width = [1, 1, 2, 4][random.below(4)];
    bytes[at..].iter_mut().zip(word.to_le_bytes()).take(width).for_each(|(to, from)| *to = from);
}

/// Numbers by SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    /// Below `bound`, which is not 0.
    fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound as u64) as usize
    }
}
