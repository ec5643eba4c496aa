//! Whatever a file is, it packs and unpacks to itself, whole or as far as it goes; and whatever packed bytes are, unpacking
//! them is an error or the file.
#![no_main]

use dermis_format::Avatar;
use dermis_format::packed::{pack, unpack, unpack_prefix};
use dermis_fuzz::{Input, mutate};
use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};

/// Where a prefix ends, two bytes; bytes that are changed, five each.
const PARAMETERS: usize = 2 + 5 * CHANGES;
const CHANGES: usize = 4;

fuzz_target!(|data: &[u8]| {
    let Some(Input { mut parameters, file, .. }) = Input::new(data, PARAMETERS) else { return };
    // Of bytes that are none of ours there is an error at once.
    let _ = unpack(&file);
    if Avatar::parse(&file).is_err() {
        assert!(pack(&file).is_err());
        return;
    }
    let packed = pack(&file).expect("what is valid can be packed");
    assert_eq!(unpack(&packed).as_deref(), Ok(&file[..]));
    let share = [0; 2].map(|_| usize::from(parameters.byte()));
    let cut = packed.len() * (256 * share[0] + share[1]) / 65_536;
    if let Ok(first) = unpack_prefix(&packed[..cut]) {
        assert!(file.starts_with(&first));
        assert!(unpack(&packed[..cut]).is_err());
    }
    let mut damaged = packed;
    for _ in 0..CHANGES {
        let (place, change) = (parameters.word() as usize % damaged.len(), parameters.byte());
        damaged[place] ^= change;
    }
    // Its checksum finds what a change makes of a section; the reader has to get that far.
    if let Ok(found) = unpack(&damaged) {
        assert_eq!(found, file);
    }
    if let Ok(first) = unpack_prefix(&damaged) {
        assert!(first.len() <= file.len());
    }
});

fuzz_mutator!(|data: &mut [u8], len: usize, most: usize, seed: u32| {
    mutate(data, len, most, seed, PARAMETERS, fuzzer_mutate)
});
