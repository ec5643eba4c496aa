//! Every case on the machine, or the emulator, that runs this: whole frames, bands, threads.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use dermis_format::order::BLOCK_LEN;
use dermis_format::packed::pack;
use dermis_format::source::{Gaussians, Mesh, Region, Source};
use dermis_format::writer::encode;
use dermis_format::{Disc, DiscWidths};
use dermis_runtime::{Kernel, Level};

use dermis_conformance::export::{self, export};
use dermis_conformance::{
    CASES, Case, FRAME_WORDS, File, Format, How, Outcome, SCRATCH_WORDS, check, check_export,
    digest, draw, expected, run, unpacking, unpacks,
};

const WHOLE: How = How { format: Format::Rgba8, bands: 1, kernel: Kernel::Scalar };

/// Scratch and frame.
fn memory() -> (Vec<u32>, Vec<u32>) {
    (vec![0; SCRATCH_WORDS], vec![0; FRAME_WORDS])
}

fn hows() -> impl Iterator<Item = How> {
    Format::ALL.iter().map(|&format| How { format, ..WHOLE })
}

/// The table as this machine draws it. The words above its head are kept.
fn table() -> String {
    let (mut scratch, mut frame) = memory();
    let mut table = String::new();
    for line in expected::TABLE.lines().filter(|line| line.starts_with('#')) {
        writeln!(table, "{line}").expect("a string takes it");
    }
    let width = CASES.iter().map(|case| case.name.len()).max().unwrap_or(0);
    write!(table, "{:width$}", "case").expect("a string takes it");
    for format in Format::ALL {
        write!(table, " {:8}", format.name()).expect("a string takes it");
    }
    write!(table, " {:8}", export::COLUMN).expect("a string takes it");
    for case in CASES {
        write!(table, "\n{:width$}", case.name).expect("a string takes it");
        for how in hows() {
            let crc = run(case, &how, &mut scratch, &mut frame).expect(case.name);
            write!(table, " {crc:08x}").expect("a string takes it");
        }
        let crc = export(case, Kernel::Scalar, &mut scratch, &mut frame).expect(case.name);
        write!(table, " {crc:08x}").expect("a string takes it");
    }
    table.lines().map(|line| format!("{}\n", line.trim_end())).collect()
}

/// `DERMIS_BLESS=1` renews the table.
#[test]
fn frames_are_those_of_the_table() {
    if std::env::var_os("DERMIS_BLESS").is_some_and(|value| value == "1") {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("crc32.txt");
        std::fs::write(path, table()).expect("the table can be written");
        return;
    }
    let (mut scratch, mut frame) = memory();
    let mut others = String::new();
    for how in hows() {
        for case in CASES {
            let outcome = check(case, &how, &mut scratch, &mut frame);
            if !matches!(outcome, Outcome::Same(_)) {
                writeln!(others, "{} {}: {outcome:x?}", case.name, how.format.name())
                    .expect("a string takes it");
            }
        }
    }
    for case in CASES {
        let outcome = check_export(case, Kernel::Scalar, &mut scratch, &mut frame);
        if !matches!(outcome, Outcome::Same(_)) {
            writeln!(others, "{} {}: {outcome:x?}", case.name, export::COLUMN)
                .expect("a string takes it");
        }
    }
    assert!(others.is_empty(), "{others}DERMIS_BLESS=1 takes these frames as the expected ones");
}

/// What stands in the scratch and the framebuffer before does not show, nor does memory to spare.
#[test]
fn frames_do_not_depend_on_the_memory_lent() {
    let (mut scratch, mut frame) = memory();
    for (case, how) in CASES.iter().flat_map(|case| hows().map(move |how| (case, how))) {
        let name = format!("{} {}", case.name, how.format.name());
        let crc = run(case, &how, &mut scratch, &mut frame);
        let mut least = vec![0xAAAA_AAAA; draw::scratch_len(case, how.format).expect(&name)];
        let mut exact = vec![0x5555_5555; how.format.frame_len(case)];
        assert_eq!(run(case, &how, &mut least, &mut exact), crc, "{name}");
        let at_once = draw::run_at_once(case, &how, &mut least, &mut exact);
        assert_eq!(at_once, crc, "{name} by render");
    }
}

/// Every kernel that this machine has.
#[test]
fn kernels_do_not_show() {
    let (mut scratch, mut frame) = memory();
    let mut others = String::new();
    for (case, whole) in CASES.iter().flat_map(|case| hows().map(move |how| (case, how))) {
        let expected = run(case, &whole, &mut scratch, &mut frame);
        for kernel in kernels() {
            // Emulating the emulated is slow: the fallback writes one format, and depths.
            let few = matches!(kernel, Kernel::Simd(level) if level.is_fallback());
            if few && !matches!(whole.format, Format::Rgba8 | Format::Depth) {
                continue;
            }
            let how = How { kernel, bands: 2, ..whole };
            let drawn = run(case, &how, &mut scratch, &mut frame);
            if drawn != expected {
                writeln!(others, "{} {how:?}: {drawn:x?}", case.name).expect("a string takes it");
            }
        }
    }
    assert!(others.is_empty(), "{others}");
}

/// The fallback of vectors, and each level that this machine has.
fn kernels() -> impl Iterator<Item = Kernel> {
    let vectors =
        Kernel::available().into_iter().filter(|kernel| matches!(kernel, Kernel::Simd(_)));
    [Kernel::Simd(Level::fallback())].into_iter().chain(vectors)
}

/// Gaussians that another renderer would draw.
#[test]
fn exports_do_not_depend_on_the_kernel() {
    let (mut scratch, mut records) = memory();
    for case in CASES {
        let expected = export(case, Kernel::Scalar, &mut scratch, &mut records);
        for kernel in kernels() {
            let found = export(case, kernel, &mut scratch, &mut records);
            assert_eq!(found, expected, "{} by {}", case.name, kernel.name());
        }
    }
}

/// Each case in the formats in which a band could show: where its first row stands matters to a
/// dither, and depths have rows of their own.
fn banded() -> impl Iterator<Item = (&'static Case, How)> {
    let formats = [Format::Rgb565Dithered, Format::Depth];
    CASES.iter().flat_map(move |case| formats.map(|format| (case, How { format, ..WHOLE })))
}

/// Bands drawn one after the other, more of them than there are rows of tiles, too.
#[test]
fn bands_do_not_show() {
    let (mut scratch, mut frame) = memory();
    for (case, whole) in banded() {
        let expected = run(case, &whole, &mut scratch, &mut frame);
        for bands in [2, 3, 64] {
            let how = How { bands, ..whole };
            let banded = run(case, &how, &mut scratch, &mut frame);
            assert_eq!(banded, expected, "{} {how:?}", case.name);
        }
    }
}

/// Four threads, each with a band and a scratch of its own.
#[test]
fn threads_do_not_show() {
    let (mut scratch, mut frame) = memory();
    for (case, whole) in banded() {
        let expected = run(case, &whole, &mut scratch, &mut frame);
        let how = How { bands: 4, ..whole };
        let drawn = threaded(case, &how, &mut scratch, &mut frame);
        assert_eq!(drawn, expected, "{} {how:?}", case.name);
    }
}

fn threaded(
    case: &Case,
    how: &How,
    scratch: &mut [u32],
    frame: &mut [u32],
) -> Result<u32, draw::Error> {
    let mut frame = draw::frame_of(case, how, frame)?;
    draw::prepare(case, how, scratch, |prepared, scratch| {
        let words = scratch.len() / how.bands as usize;
        let (mut scratches, mut rest) = (scratch.chunks_exact_mut(words), frame.all());
        std::thread::scope(|scope| {
            let workers: Vec<_> = draw::bands(case, how, prepared)
                .map(|band| {
                    let scratch = scratches.next().expect("a scratch for each band");
                    let mut framebuffer = rest.take_rows(band.rows).framebuffer();
                    scope.spawn(move || {
                        prepared.draw_band(band.tile_rows, scratch, &mut framebuffer)
                    })
                })
                .collect();
            workers.into_iter().try_for_each(|worker| {
                worker.join().expect("no band panics").map(|_| ()).map_err(draw::Error::Runtime)
            })
        })
    })?;
    Ok(frame.crc32())
}

/// What a file says of itself can be read, and is not the same for all.
#[test]
fn files_can_be_read() {
    let digests: BTreeSet<u32> =
        File::ALL.iter().map(|file| digest(*file).expect("it is valid")).collect();
    assert_eq!(digests.len(), File::ALL.len());
}

/// Two blocks of discs of 5 and 6 bits a number that take turns: the second one is told from the first.
fn turns() -> Source {
    let (count, triangles) = (BLOCK_LEN + 300, 40);
    let mut seed = 1u32;
    let mut random = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 8) as f32 / (1 << 24) as f32
    };
    let turns = (0..count).step_by(2).chain((1..count).step_by(2));
    let discs = turns.clone().map(|turn| {
        let along = turn as f32 / count as f32;
        Disc {
            position: [random(), random(), 0.1 * random()],
            angle: 6.0 * along + random(),
            log2_scale: [3.0 * along + random(), random() - 1.0],
            color: [along, 1.0 - along, 0.8 * random()],
            opacity: 1.0,
        }
    });
    let region = Region {
        layers: vec![count],
        gaussians: Gaussians::Disc(discs.collect()),
        triangles: turns.map(|turn| turn * triangles / count).collect(),
        ..Region::default()
    };
    Source {
        mesh: Mesh {
            positions: (0..triangles + 2).map(|i| [(i % 2) as f32, i as f32, 0.0]).collect(),
            triangles: (0..triangles).map(|i| [i, i + 1, i + 2]).collect(),
            ..Mesh::default()
        },
        regions: vec![region],
        widths: vec![DiscWidths {
            position: [5; 3],
            angle: 6,
            scale: 5,
            color: [6, 5, 5],
            opacity: 0,
        }],
        bounds: [[0.0; 3], [1.0, triangles as f32, 1.0]],
        ..Source::default()
    }
}

/// The packed avatars are what the packer makes today, and unpack to the files.
#[test]
fn packed_files_unpack() {
    let turns = encode(&turns()).expect("it can be written");
    for (name, file, stored) in
        [("leveled", File::Leveled.bytes(), unpacking::PACKED), ("turns", &turns, unpacking::TURNS)]
    {
        let packed = pack(file).expect("it is valid");
        if std::env::var_os("DERMIS_BLESS").is_some() {
            let path = format!("{}/data/{name}.packed", env!("CARGO_MANIFEST_DIR"));
            std::fs::write(path, &packed).expect("it can be written");
        }
        assert!(packed == stored, "{name}: the packer has changed; renew with DERMIS_BLESS=1");
    }
    assert_eq!(unpacks(&mut [0; FRAME_WORDS]), Ok(true));
}

#[test]
fn names_are_unique_and_memory_is_enough() {
    let names: BTreeSet<&str> = CASES.iter().map(|case| case.name).collect();
    assert_eq!(names.len(), CASES.len());
    for case in CASES {
        for &format in Format::ALL {
            let words = draw::scratch_len(case, format).expect(case.name);
            assert!(words <= SCRATCH_WORDS, "{}", case.name);
            assert!(format.frame_len(case) <= FRAME_WORDS, "{}", case.name);
        }
    }
}
