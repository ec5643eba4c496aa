//! Files that are damaged where their CRCs do not tell: what lies behind those is reached.

use dermis_format::section::{
    Section, Sections, head, preamble, preamble_crc, section_crc, split_header,
};

/// SplitMix64.
struct Random(u64);

impl Random {
    /// Below `end`.
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) % end as u64) as usize
    }
}

/// The bytes before the first section, and the sections, tag and payload each.
fn parts(bytes: &[u8]) -> (Vec<u8>, Vec<([u8; 4], Vec<u8>)>) {
    let (_, rest) = split_header(bytes).expect("it has a header");
    let sections = Sections::new(rest).map(|section| (section.tag, section.payload.to_vec()));
    (bytes[..bytes.len() - rest.len()].to_vec(), sections.collect())
}

/// A file of them, every CRC being right.
fn file(start: &[u8], sections: &[([u8; 4], Vec<u8>)]) -> Vec<u8> {
    let (fixed, header) = start.split_at(preamble::LEN);
    let mut bytes = start.to_vec();
    bytes[preamble::CRC].copy_from_slice(&preamble_crc(fixed, header).to_le_bytes());
    for (tag, payload) in sections {
        bytes.extend(tag);
        bytes.extend((payload.len() as u32).to_le_bytes());
        bytes.extend(section_crc(&Section { tag: *tag, payload }).to_le_bytes());
        bytes.extend(payload);
    }
    bytes
}

/// Files that are damaged in one place each, and how. The same for the same bytes.
pub(crate) fn of(bytes: &[u8], count: usize) -> Vec<(&'static str, Vec<u8>)> {
    let mut random = Random(bytes.len() as u64);
    (0..count).map(|_| damaged(bytes, &mut random)).collect()
}

fn damaged(bytes: &[u8], random: &mut Random) -> (&'static str, Vec<u8>) {
    let (mut start, mut sections) = parts(bytes);
    let at = random.below(sections.len());
    let other = random.below(sections.len());
    let how = match random.below(10) {
        0 => {
            let place = preamble::LEN + random.below(start.len() - preamble::LEN);
            start[place] ^= 1 << random.below(8);
            "header"
        }
        1 => {
            sections.swap(at, other);
            "swapped"
        }
        2 => {
            let copy = sections[at].clone();
            sections.insert(other, copy);
            "repeated"
        }
        3 => {
            sections.remove(at);
            "removed"
        }
        4 => {
            let payload = &mut sections[at].1;
            payload.truncate(random.below(payload.len() + 1));
            "shorter"
        }
        5 => {
            let payload = &mut sections[at].1;
            payload.extend(vec![0; 1 + random.below(8)]);
            "longer"
        }
        // Anywhere, with a CRC that tells.
        6 => {
            let mut bytes = bytes.to_vec();
            let place = random.below(bytes.len());
            bytes[place] ^= 1 << random.below(8);
            return ("flipped", bytes);
        }
        7 => {
            set(&mut sections[at].1, 48, random);
            "set"
        }
        _ => {
            // Heads stand in front and are short.
            let reach = [24, 80, usize::MAX][random.below(3)];
            flip(&mut sections[at].1, reach, random);
            "bit"
        }
    };
    (how, file(&start, &sections))
}

/// Inverts one of the first bits.
fn flip(payload: &mut [u8], reach: usize, random: &mut Random) {
    if !payload.is_empty() {
        let place = random.below(payload.len().min(reach));
        payload[place] ^= 1 << random.below(8);
    }
}

/// Makes two bytes next to each other those of a NaN, of an infinity, all bits, or none.
fn set(payload: &mut [u8], reach: usize, random: &mut Random) {
    if payload.len() >= 2 {
        let place = random.below((payload.len() - 1).min(reach));
        let value = [[0xc0, 0x7f], [0x80, 0x7f], [0xff, 0xff], [0, 0]][random.below(4)];
        payload[place..place + 2].copy_from_slice(&value);
    }
}

/// Lengths to cut a file to: at the ends of sections, inside their heads and inside their payloads; `count` of them.
pub(crate) fn cuts(bytes: &[u8], count: usize) -> Vec<usize> {
    let (start, sections) = parts(bytes);
    let mut end = start.len();
    let mut cuts = vec![0, 7, preamble::LEN, end];
    for (_, payload) in &sections {
        cuts.extend([end + 5, end + head::LEN + payload.len() / 2]);
        end += head::LEN + payload.len();
        cuts.push(end);
    }
    // The last ones, and some of the others.
    cuts.retain(|&cut| cut < bytes.len());
    let mut random = Random(bytes.len() as u64);
    while cuts.len() > count {
        cuts.remove(random.below(cuts.len() * 2 / 3));
    }
    cuts
}
