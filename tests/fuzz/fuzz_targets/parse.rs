//! Whatever the bytes are, reading them is an error or an avatar whose every accessor is total; and so is reading as
//! many of them as one likes.
#![no_main]

#[path = "../../../format/tests/hostile/walk.rs"]
mod walk;

use dermis_format::Avatar;
use dermis_fuzz::{Input, mutate};
use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};
use walk::walk;

/// Two bytes: where a prefix ends.
const PARAMETERS: usize = 2;

fuzz_target!(|data: &[u8]| {
    let Some(Input { mut parameters, file, .. }) = Input::new(data, PARAMETERS) else { return };
    let whole = Avatar::parse(&file);
    let prefix = Avatar::parse_prefix(&file);
    match (&whole, &prefix) {
        (Ok(whole), Ok(prefix)) => {
            walk(whole);
            assert_eq!(whole.bytes(), prefix.bytes(), "a file is its own prefix");
            assert_eq!(whole.bytes(), file);
        }
        (Ok(_), Err(error)) => panic!("a file is no prefix: {error}"),
        (Err(error), Ok(prefix)) => {
            assert!(!error.to_string().is_empty());
            walk(prefix);
            assert!(file.starts_with(prefix.bytes()));
        }
        (Err(error), Err(_)) => assert!(!error.to_string().is_empty()),
    }
    let share = [0; PARAMETERS].map(|_| usize::from(parameters.byte()));
    let cut = file.len() * (256 * share[0] + share[1]) / 65_536;
    if let Ok(shorter) = Avatar::parse_prefix(&file[..cut]) {
        walk(&shorter);
        assert!(shorter.bytes().len() <= cut);
        // What follows may be damaged, but is no reason to hold more of what does not.
        if let Ok(longer) = prefix {
            let mut regions = 0..usize::from(longer.header().regions);
            assert!(regions.all(|region| shorter.present(region) <= longer.present(region)));
        }
    }
});

fuzz_mutator!(|data: &mut [u8], len: usize, most: usize, seed: u32| {
    mutate(data, len, most, seed, PARAMETERS, fuzzer_mutate)
});
