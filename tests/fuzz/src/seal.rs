//! Checksums.

use dermis_format::section::{Section, head, preamble, preamble_crc, section_crc};

/// Makes every CRC of a file right: of the preamble, and of each section that is whole.
pub fn seal(bytes: &mut [u8]) {
    let Some((fixed, rest)) = bytes.split_at_mut_checked(preamble::LEN) else { return };
    let Some((header, mut rest)) = rest.split_at_mut_checked(header_len(fixed)) else { return };
    let crc = preamble_crc(fixed, header);
    fixed[preamble::CRC].copy_from_slice(&crc.to_le_bytes());
    while let Some((fixed, after)) = rest.split_at_mut_checked(head::LEN) {
        let Some((payload, after)) = after.split_at_mut_checked(payload_len(fixed)) else { return };
        let tag = [fixed[0], fixed[1], fixed[2], fixed[3]];
        let crc = section_crc(&Section { tag, payload });
        fixed[head::CRC].copy_from_slice(&crc.to_le_bytes());
        rest = after;
    }
}

/// Length of the header that a preamble tells of.
pub(crate) fn header_len(preamble: &[u8]) -> usize {
    let [a, b] = [0, 1].map(|i| preamble[preamble::HEADER_LEN.start + i]);
    u16::from_le_bytes([a, b]).into()
}

/// Length of the payload that a section's head tells of.
pub(crate) fn payload_len(head: &[u8]) -> usize {
    u32::from_le_bytes([0, 1, 2, 3].map(|i| head[head::PAYLOAD_LEN.start + i])) as usize
}
