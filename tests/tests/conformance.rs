//! What the avatars of the conformance set hold, and a picture of all its frames.

use dermis_conformance::{CASES, FRAME_WORDS, Format, How, SCRATCH_WORDS, run};
use dermis_format::{Avatar, FrameKind, LowPass, RecordKind, ScaleLaw};
use dermis_runtime::Kernel;
use dermis_tests::files::{failures, workspace};
use image::{Rgba, RgbaImage, imageops};

/// The stored bytes hold what the set needs of them.
#[test]
fn stored_avatars_cover_the_format() {
    let read = |name: &str| {
        let path = workspace().join("tests/conformance/data").join(format!("{name}.dermis"));
        std::fs::read(path).expect("the avatar is stored; the example conformance_avatars makes it")
    };
    let (figure, layered) = (read("figure"), read("layered"));
    let figure = *Avatar::parse(&figure).expect("stored avatars are valid").header();
    assert_eq!((figure.record, figure.frame), (RecordKind::Disc, FrameKind::Area));
    assert_eq!((figure.low_pass, figure.scale_law), (LowPass::Compensated, ScaleLaw::SquareRoot));
    assert!(figure.joints > 1 && figure.morph_targets > 1 && figure.clips > 1);
    assert!(figure.gaussians >= 4_000 && figure.layers == 4);
    let layered = *Avatar::parse(&layered).expect("stored avatars are valid").header();
    assert_eq!((layered.record, layered.frame), (RecordKind::Full, FrameKind::Edge));
    assert_eq!((layered.low_pass, layered.scale_law), (LowPass::Classic, ScaleLaw::Constant));
    assert!(layered.opacity_per_level && layered.harmonics_degree == 3 && layered.regions == 2);
}

/// Frames in a row of the sheet, and the side of a frame's cell, px.
const SHEET: usize = 12;
const CELL: u32 = 102;

/// A sheet of all frames in the order of the table, for a person to look at.
#[test]
fn frames_can_be_looked_at() {
    let (mut scratch, mut frame) = (vec![0; SCRATCH_WORDS], vec![0; FRAME_WORDS]);
    let rows = CASES.len().div_ceil(SHEET) as u32;
    let mut sheet = RgbaImage::from_pixel(SHEET as u32 * CELL, rows * CELL, Rgba([90, 0, 90, 255]));
    let format = Format::Rgba8;
    for (index, case) in CASES.iter().enumerate() {
        run(case, &How { format, bands: 1, kernel: Kernel::detect() }, &mut scratch, &mut frame)
            .expect(case.name);
        let words = &frame[..format.frame_len(case)];
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_ne_bytes()).collect();
        let rows = bytes.chunks_exact(format.stride(case));
        let packed = rows.flat_map(|row| &row[..case.size[0] as usize * 4]).copied().collect();
        let picture = RgbaImage::from_raw(case.size[0], case.size[1], packed).expect("its size");
        let side = CELL - 6;
        let (width, height) = (case.size[0].min(side), case.size[1].min(side));
        let cropped = imageops::crop_imm(&picture, 0, 0, width, height).to_image();
        let (x, y) = (index % SHEET, index / SHEET);
        let at = |cell: usize| i64::from(cell as u32 * CELL + 3);
        imageops::replace(&mut sheet, &cropped, at(x), at(y));
    }
    let path = failures().join("conformance.png");
    sheet.save(&path).expect("the target folder can be written");
}
