//! Files with changed bytes whose checksums are right: what the reader lets through can be drawn.

use std::sync::atomic::{AtomicUsize, Ordering};

use dermis_format::section::{Section, head, preamble, preamble_crc, section_crc};
use dermis_runtime::{Avatar, Pose};
use proptest::prelude::*;

use crate::numbers::rigged;
use crate::scenes::{BALL, bytes, camera, cloud, visible};

/// Makes every CRC right.
fn fix_crcs(bytes: &mut [u8]) {
    let Some((fixed, rest)) = bytes.split_at_mut_checked(preamble::LEN) else { return };
    let len = usize::from(u16::from_le_bytes([fixed[10], fixed[11]]));
    let Some((header, mut rest)) = rest.split_at_mut_checked(len) else { return };
    let crc = preamble_crc(fixed, header);
    fixed[preamble::CRC].copy_from_slice(&crc.to_le_bytes());
    while let Some((fixed, after)) = rest.split_at_mut_checked(head::LEN) {
        let tag = [fixed[0], fixed[1], fixed[2], fixed[3]];
        let len = u32::from_le_bytes([fixed[4], fixed[5], fixed[6], fixed[7]]) as usize;
        let Some((payload, after)) = after.split_at_mut_checked(len) else { return };
        let crc = section_crc(&Section { tag, payload });
        fixed[head::CRC].copy_from_slice(&crc.to_le_bytes());
        rest = after;
    }
}

/// Changed files of each kind that the reader let through.
static PARSED: [AtomicUsize; 3] = [const { AtomicUsize::new(0) }; 3];

#[test]
fn changed_files_are_refused_or_drawn() {
    changed_files_are_refused_or_drawn_without_a_nan();
    // Else nothing was drawn, and the test said nothing.
    let parsed = PARSED.each_ref().map(|count| count.load(Ordering::Relaxed));
    assert!(parsed.iter().all(|&count| count > 50), "{parsed:?} of 1500");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    fn changed_files_are_refused_or_drawn_without_a_nan(
        kind in 0..3usize,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        number in prop::option::of((any::<prop::sample::Index>(), prop::sample::select(vec![
            1e12f32, -1e12, 1e6, 1e3, 40.0, -40.0, 1e-40, 0.0, 1e38, f32::NAN, f32::INFINITY,
        ]))),
        seconds in prop::sample::select(vec![0f32, 0.7, 2.0, 1e30, f32::NAN]),
    ) {
        let mut source = if kind < 2 { rigged() } else { cloud(&[BALL, BALL]) };
        if kind == 2 {
            source.mathematics.harmonics_degree = 2;
            source.regions[0].harmonics = vec![vec![0.25; 24]; 2];
        }
        let mut bytes = bytes(&source);
        for (index, value) in changes {
            let index = preamble::LEN + index.index(bytes.len() - preamble::LEN);
            bytes[index] = value;
        }
        if let Some((at, number)) = number {
            let at = preamble::LEN + at.index(bytes.len() - preamble::LEN - 4);
            bytes[at..at + 4].copy_from_slice(&number.to_le_bytes());
        }
        fix_crcs(&mut bytes);
        if let Ok(avatar) = Avatar::parse(&bytes) {
            PARSED[kind].fetch_add(1, Ordering::Relaxed);
            let camera = camera(33, 17, 20.0, 2.0);
            visible(&avatar, &Pose::Rest, &camera);
            if avatar.header().clips > 0 {
                visible(&avatar, &Pose::Clip { clip: 0, seconds }, &camera);
            }
        }
    }
}
