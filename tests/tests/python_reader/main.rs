//! SPEC.md is a complete text: a reader in Python that was written from it alone (`tests/reader`) decodes every number of
//! every file to the bits that `dermis-format` decodes, and refuses the same files.

#[path = "../../../format/tests/hostile/avatars.rs"]
mod avatars;
mod columns;
mod damage;

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use columns::{Columns, columns};
use dermis_conformance::File;
use dermis_format::writer::encode;
use dermis_format::{Avatar, Error};
use dermis_tests::files;
use dermis_tests::small::{options, trained_demo};
use dermis_trainer::convert::{self, Taken};
use dermis_trainer::import;
use dermis_trainer::options::Options;
use dermis_trainer::train::train;

/// Whether there is a Python; without one the test `who` is skipped, or fails under CI.
fn python(who: &str) -> bool {
    let found = Command::new("python3").arg("--version").output().is_ok();
    if !found {
        files::skipped(who, "no python3; install it");
    }
    found
}

/// Runs the reader in a folder.
fn reader(folder: &Path, arguments: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Output {
    let script = files::workspace().join("tests/reader/dermis.py");
    let mut command = Command::new("python3");
    // -B: no compiled copy beside the script.
    command.current_dir(folder).arg("-B").arg(script).args(arguments);
    command.output().expect("python3 starts")
}

/// Whether files are taken that are cut short.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cut {
    Never,
    Anywhere,
}

/// Of each column its length and its CRC-32.
type Sums = BTreeMap<String, (usize, u32)>;

/// What the Python reader says of a folder's files: sums, or none where it refused one.
fn by_python(folder: &Path, names: &[String], cut: Cut) -> BTreeMap<String, Option<Sums>> {
    let flags = (cut == Cut::Anywhere).then(|| "--prefix".to_owned());
    let output = reader(folder, flags.iter().chain(names));
    let said = String::from_utf8(output.stderr).expect("it speaks UTF-8");
    let mut files: BTreeMap<String, Option<Sums>> = BTreeMap::new();
    for line in said.lines() {
        // file: place: cause
        let (name, cause) = line.split_once(": ").unwrap_or_else(|| panic!("{said}"));
        assert!(cause.contains(": "), "{said}");
        assert!(files.insert(name.to_owned(), None).is_none(), "{said}");
    }
    assert_eq!(output.status.code(), Some(i32::from(!files.is_empty())), "{said}");
    let mut name = "";
    let printed = String::from_utf8(output.stdout).expect("it speaks UTF-8");
    for line in printed.lines() {
        if let Some(column) = line.strip_prefix("  ") {
            let (column, numbers) = column.split_once(": ").expect("a column has a name");
            let (count, crc) = numbers.trim_end().split_once(' ').expect("a column has two sums");
            let count = count.parse().expect("a count");
            let crc = u32::from_str_radix(crc, 16).expect("a CRC");
            let sums = files.get_mut(name).and_then(Option::as_mut).expect("a file is open");
            if count > 0 {
                sums.insert(column.into(), (count, crc));
            }
        } else {
            name = line;
            assert!(files.insert(name.into(), Some(Sums::new())).is_none(), "{name} twice");
        }
    }
    assert!(files.keys().eq(names.iter().collect::<BTreeSet<_>>()), "{said}");
    files
}

/// The same by `dermis-format`.
fn by_rust(bytes: &[u8], cut: Cut) -> Result<Columns, Error> {
    let avatar = match cut {
        Cut::Never => Avatar::parse(bytes),
        Cut::Anywhere => Avatar::parse_prefix(bytes),
    };
    avatar.map(|avatar| columns(&avatar))
}

fn sums(columns: &Columns) -> Sums {
    let sum = |words: &[u32]| {
        let mut crc = flate2::Crc::new();
        words.iter().for_each(|word| crc.update(&word.to_le_bytes()));
        (words.len(), crc.sum())
    };
    columns.iter().map(|(name, words)| (name.clone(), sum(words))).collect()
}

/// Both read a folder of files; they must agree on each. How many they take.
fn agree(folder: &Path, cut: Cut) -> usize {
    let names = files::names(folder);
    let mut taken = 0;
    for (name, python) in by_python(folder, &names, cut) {
        let bytes = std::fs::read(folder.join(&name)).expect("it can be read");
        match (by_rust(&bytes, cut), python) {
            (Ok(rust), Some(python)) => {
                taken += 1;
                if sums(&rust) != python {
                    panic!("{name}, {cut:?}: {}", first_difference(folder, &name, cut, &rust));
                }
            }
            (Err(_), None) => {}
            (Ok(_), None) => {
                let said = String::from_utf8(reader(folder, [&name]).stderr).unwrap_or_default();
                panic!("{name}, {cut:?}: Python alone refuses it: {said}");
            }
            (Err(error), Some(_)) => panic!("{name}, {cut:?}: Rust alone refuses it: {error}"),
        }
    }
    taken
}

/// Where two readers' numbers differ first.
fn first_difference(folder: &Path, name: &str, cut: Cut, rust: &Columns) -> String {
    let flag = if cut == Cut::Anywhere { "--prefix" } else { "--values" };
    let printed = reader(folder, ["--values", flag, name]).stdout;
    let printed = String::from_utf8(printed).expect("it speaks UTF-8");
    let columns = printed.lines().filter_map(|line| line.strip_prefix("  ")?.split_once(": "));
    let words = |numbers: &str| -> Vec<u32> {
        // Bytes as they stand in memory.
        let word = |word| u32::from_str_radix(word, 16).expect("hex").swap_bytes();
        numbers.split_whitespace().skip(2).map(word).collect()
    };
    let python: Columns = columns.map(|(name, numbers)| (name.into(), words(numbers))).collect();
    let names: BTreeSet<&String> = rust.keys().chain(python.keys()).collect();
    for name in names {
        let [rust, python] = [rust, &python].map(|of| of.get(name).map_or(&[][..], Vec::as_slice));
        let differ = (0..rust.len().max(python.len())).find(|&i| rust.get(i) != python.get(i));
        if let Some(index) = differ {
            let told = [rust, python].map(|of| {
                let word = of.get(index).copied();
                word.map(|bits| format!("{bits:08x} ({bits} or {:?})", f32::from_bits(bits)))
            });
            return format!("{name}, number {index}: Rust {:?}, Python {:?}", told[0], told[1]);
        }
    }
    "the same numbers".into()
}

/// The worked file of SPEC.md.
fn worked() -> Vec<u8> {
    let spec = include_str!("../../../format/SPEC.md");
    let (_, rest) = spec.split_once("```hex\n").expect("SPEC.md has a hex block");
    let (block, _) = rest.split_once("```").expect("the block ends");
    let lines = block.lines().map(|line| line.split(';').next().unwrap_or(""));
    let words = lines.flat_map(|line| line.split_whitespace().skip(1));
    words.map(|word| u8::from_str_radix(word, 16).expect("a byte")).collect()
}

/// Files of every kind, of at most so many bytes.
fn of_every_kind(most_bytes: usize) -> Vec<(String, Vec<u8>)> {
    let made = avatars::all();
    let made = made.iter().map(|(name, source)| {
        ((*name).to_owned(), encode(source).unwrap_or_else(|error| panic!("{name}: {error}")))
    });
    let stored = File::ALL.iter().map(|file| (format!("{file:?}"), file.bytes().to_vec()));
    let mut all: Vec<_> = made.chain(stored).chain([("worked".into(), worked())]).collect();
    all.retain(|(_, bytes)| bytes.len() <= most_bytes);
    all
}

#[test]
fn every_kind_of_file_decodes_to_the_same_bits() {
    if !python("every_kind_of_file_decodes_to_the_same_bits") {
        return;
    }
    let folder = files::empty_folder("python_reader");
    for (name, bytes) in of_every_kind(usize::MAX) {
        files::written(&folder, &name, bytes);
    }
    // Numbers of few bits.
    let options = Options { max_loss_db: 0.3, ..options(2000, 20) };
    files::written(&folder, "trained", trained_demo(&options).1.bytes);
    assert_eq!(agree(&folder, Cut::Never), files::names(&folder).len());
}

#[test]
fn real_avatars_decode_to_the_same_bits() {
    let who = "real_avatars_decode_to_the_same_bits";
    if !python(who) {
        return;
    }
    let Some(data) = files::data(who) else { return };
    let folder = files::empty_folder("python_reader_real");
    for mesh in ["MorphStressTest.gltf", "CesiumMan.glb"] {
        let model = import::load(&data.join(mesh)).unwrap_or_else(|error| panic!("{error:#}"));
        let trained = train(&model, &options(3000, 10)).expect("it trains");
        files::written(&folder, mesh, trained.bytes);
    }
    let splats: PathBuf = data.join("splats/playbot_lod6.ply");
    let mesh = data.join("greenman.glb");
    for (name, mesh) in [("cloud", None), ("mounted", Some(mesh.as_path()))] {
        let taken = Taken { mesh, ..Taken::default() };
        let assembled = convert::assemble(std::slice::from_ref(&splats), &taken);
        let (assembly, _) = assembled.unwrap_or_else(|error| panic!("{error:#}"));
        files::written(&folder, name, convert::pack(assembly).expect("it can be packed"));
    }
    assert_eq!(agree(&folder, Cut::Never), 4);
}

#[test]
fn prefixes_are_read_alike() {
    if !python("prefixes_are_read_alike") {
        return;
    }
    let folder = files::empty_folder("python_reader_prefixes");
    let mut whole = 0;
    for (name, bytes) in of_every_kind(100_000) {
        let cuts = damage::cuts(&bytes, 14);
        for length in cuts {
            files::written(&folder, &format!("{name} {length}"), &bytes[..length]);
        }
        files::written(&folder, &name, &bytes);
        whole += 1;
    }
    let all = files::names(&folder).len();
    let taken = agree(&folder, Cut::Anywhere);
    println!("{taken} of {all} prefixes are avatars");
    assert!(taken > all / 4 && taken < all, "{taken} of {all}");
    assert_eq!(agree(&folder, Cut::Never), whole);
}

#[test]
fn damaged_files_are_refused_alike() {
    if !python("damaged_files_are_refused_alike") {
        return;
    }
    let folder = files::empty_folder("python_reader_damaged");
    for (name, bytes) in of_every_kind(6_000) {
        // A rig has the most to go wrong.
        let count = if name == "rigged" { 240 } else { 60 };
        for (index, (how, damaged)) in damage::of(&bytes, count).into_iter().enumerate() {
            files::written(&folder, &format!("{name} {index} {how}"), damaged);
        }
    }
    let all = files::names(&folder).len();
    for cut in [Cut::Never, Cut::Anywhere] {
        let taken = agree(&folder, cut);
        println!("{cut:?}: {taken} of {all} are avatars");
        assert!(taken > all / 20 && taken < all / 2, "{cut:?}: {taken} of {all}");
    }
}
