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

/// Tag and payload of each section.
type Parts = Vec<([u8; 4], Vec<u8>)>;

/// The bytes before the first section, and the sections.
fn parts(bytes: &[u8]) -> (Vec<u8>, Parts) {
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

/// Files that are damaged in one place each, and how: the same ones for the same bytes.
pub(crate) fn of(bytes: &[u8], count: usize) -> Vec<(&'static str, Vec<u8>)> {
    let mut random = Random(bytes.len() as u64);
    (0..count).map(|_| damaged(bytes, &mut random)).collect()
}

fn damaged(bytes: &[u8], random: &mut Random) -> (&'static str, Vec<u8>) {
    let (mut start, mut sections) = parts(bytes);
    // Any kind of section, then one of its kind.
    let mut tags: Vec<[u8; 4]> = sections.iter().map(|(tag, _)| *tag).collect();
    tags.dedup();
    let tag = tags[random.below(tags.len())];
    let of_kind: Vec<usize> = (0..sections.len()).filter(|&at| sections[at].0 == tag).collect();
    let at = of_kind[random.below(of_kind.len())];
    let other = random.below(sections.len());
    let how = match random.below(16) {
        0..3 => {
            change(&mut start[preamble::LEN..], random);
            "header"
        }
        3 => {
            sections.swap(at, other);
            "swapped"
        }
        4 => {
            let copy = sections[at].clone();
            sections.insert(other, copy);
            "repeated"
        }
        5 => {
            sections.remove(at);
            "removed"
        }
        6 => {
            let payload = &mut sections[at].1;
            payload.truncate(random.below(payload.len() + 1));
            "shorter"
        }
        7 => {
            let more = vec![0; 1 + random.below(8)];
            sections[at].1.extend(more);
            "longer"
        }
        // Anywhere, with a CRC that tells.
        8 => {
            let mut bytes = bytes.to_vec();
            change(&mut bytes, random);
            return ("changed", bytes);
        }
        _ => {
            let payload = &mut sections[at].1;
            // Heads stand in front and are short.
            let reach = [4, 16, 64, usize::MAX][random.below(4)];
            let reach = reach.min(payload.len());
            change(&mut payload[..reach], random);
            "payload"
        }
    };
    (how, file(&start, &sections))
}

/// Inverts a bit, or makes a byte another one, or two next to each other the upper half of a NaN, an infinity, a negative number.
fn change(bytes: &mut [u8], random: &mut Random) {
    if bytes.is_empty() {
        return;
    }
    let place = random.below(bytes.len());
    match (random.below(3), bytes.get_mut(place..place + 2)) {
        (0, Some(two)) => {
            let halves = [[0xc0, 0x7f], [0x80, 0x7f], [0xff, 0xff], [0x80, 0xbf], [0, 0x60]];
            two.copy_from_slice(&halves[random.below(halves.len())]);
        }
        (1, _) => bytes[place] = [0, 1, 2, 3, 4, 17, 33, 255][random.below(8)],
        _ => bytes[place] ^= 1 << random.below(8),
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
