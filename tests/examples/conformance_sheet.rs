//! A sheet of all frames of the conformance set in the order of its table, for a person to look at:
//!
//! ```text
//! cargo run --release -p dermis-tests --example conformance_sheet -- sheet.png
//! ```

use std::path::PathBuf;

use dermis_conformance::{CASES, FRAME_WORDS, Format, How, SCRATCH_WORDS, run};
use dermis_runtime::Kernel;
use image::{Rgba, RgbaImage, imageops};

/// Frames in a row of the sheet, and the side of a frame's cell, px.
const SHEET: usize = 12;
const CELL: u32 = 102;

fn main() {
    let path = std::env::args_os().nth(1).map(PathBuf::from);
    let path = path.expect("usage: conformance_sheet PNG");
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
    sheet.save(&path).expect("the picture can be written");
}
