//! Pictures come back to the bit, from memory and from the file, at every scale.

use std::path::Path;

use dermis_runtime::framebuffer::to_byte;

use super::scale::{scaled_length, scaled_rect};
use super::spill::Spill;
use super::{Crop, Scratch, Store, Stored, scaled};
use crate::metrics::Rect;
use crate::picture::Picture;
use crate::scene::mesh_render::Truth;

const GREY: [f32; 3] = [0.3, 0.55, 0.7];
const OTHERS: [[f32; 3]; 3] = [GREY, [1.0; 3], [0.1234, 0.9, 0.0]];

/// Bits that look random.
fn noise(seed: u32) -> u32 {
    let mut bits = seed.wrapping_mul(0x9e37_79b9) ^ 0x85eb_ca6b;
    bits = (bits ^ (bits >> 16)).wrapping_mul(0x7feb_352d);
    bits ^ (bits >> 15)
}

/// A noisy truth over [`GREY`]: inside `rect` there are gaps, edges and covered runs.
fn truth(width: u32, height: u32, rect: Rect, seed: u32) -> Truth {
    let mut picture = Picture::filled(width, height, GREY);
    let mut coverage = vec![0.0; picture.rgb.len()];
    for (y, x) in (0..rect.height).flat_map(|y| (0..rect.width).map(move |x| (y, x))) {
        let at = ((rect.y + y) * width + rect.x + x) as usize;
        let bits = noise(at as u32 ^ seed << 20);
        // Runs of five pixels; the corners are covered, so that the rectangle is the covered one.
        let corner = (x == 0 || x + 1 == rect.width) && (y == 0 || y + 1 == rect.height);
        let share = match noise(x / 5 + y * 977 + seed) % 3 {
            0 if !corner => 0.0,
            1 => (bits >> 3 & 15) as f32 / 16.0,
            _ => 1.0,
        };
        let share: f32 = if corner { 1.0 } else { share };
        let color = [bits >> 8, bits >> 16, bits >> 24].map(|c| (c & 255) as f32 / 255.0);
        coverage[at] = share;
        picture.rgb[at] = std::array::from_fn(|i| share * color[i] + (1.0 - share) * GREY[i]);
    }
    Truth { picture, coverage, seen: Vec::new() }
}

/// What a crop over [`GREY`] promises to look like, pixel by pixel.
fn expected(truth: &Truth, rect: Rect, background: [f32; 3]) -> Picture {
    let (width, height) = (truth.picture.width, truth.picture.height);
    let mut picture = Picture::filled(width, height, background);
    let rows = rect.y..rect.y + rect.height;
    for at in rows.flat_map(|y| (rect.x..rect.x + rect.width).map(move |x| y * width + x)) {
        let at = at as usize;
        let seen_through = f32::from(255 - to_byte(truth.coverage[at])) / 255.0;
        picture.rgb[at] = std::array::from_fn(|i| {
            let color = f32::from(to_byte(truth.picture.rgb[at][i])) / 255.0;
            color + seen_through * (background[i] - GREY[i])
        });
    }
    picture
}

fn bits(picture: &Picture) -> (u32, u32, Vec<u32>) {
    let values = picture.rgb.as_flattened().iter().map(|value| value.to_bits());
    (picture.width, picture.height, values.collect())
}

/// (width, height, rectangle), odd and even, at edges, thin, whole, empty.
const SHAPES: [(u32, u32, [u32; 4]); 8] = [
    (37, 23, [3, 2, 31, 20]),
    (37, 23, [0, 0, 37, 23]),
    (64, 32, [16, 8, 32, 16]),
    (41, 19, [40, 18, 1, 1]),
    (41, 19, [7, 3, 1, 16]),
    (50, 9, [1, 8, 49, 1]),
    (1, 1, [0, 0, 1, 1]),
    (13, 7, [0, 0, 0, 0]),
];

fn shapes() -> impl Iterator<Item = (Truth, Rect)> {
    SHAPES.into_iter().zip(0..).map(|((w, h, [x, y, width, height]), seed)| {
        let rect = Rect { x, y, width, height };
        (truth(w, h, rect, seed), rect)
    })
}

fn drawn(stored: &Stored, background: [f32; 3], shift: u32) -> Picture {
    // A buffer that held another picture leaves no trace.
    let mut picture = Picture::filled(71, 3, [9.0; 3]);
    let scratch = &mut Scratch::default();
    stored.draw(background, shift, scratch, &mut picture).expect("it can be read back");
    picture
}

#[test]
fn a_crop_keeps_its_bits() {
    for (truth, rect) in shapes() {
        let crop = Crop::of(&truth, GREY);
        assert_eq!(crop.rect(), rect);
        for background in OTHERS {
            let picture = crop.picture(background);
            assert!(bits(&picture) == bits(&expected(&truth, rect, background)), "{rect:?}");
        }
    }
}

#[test]
fn runs_longer_than_a_header_can_say_are_split() {
    let rect = Rect { x: 1, y: 0, width: 40_000, height: 1 };
    let mut whole = truth(40_002, 1, rect, 5);
    for share in [1.0, 0.5] {
        whole.coverage[1..40_001].fill(share);
        let picture = Crop::of(&whole, GREY).picture(OTHERS[2]);
        assert!(bits(&picture) == bits(&expected(&whole, rect, OTHERS[2])), "{share}");
    }
    whole.coverage[2..40_000].fill(0.0);
    whole.picture.rgb[2..40_000].fill(GREY);
    let crop = Crop::of(&whole, GREY);
    assert!(crop.bytes.len() < 30, "a gap takes no bytes of its own");
    assert!(bits(&crop.picture(OTHERS[2])) == bits(&expected(&whole, rect, OTHERS[2])));
}

#[test]
fn the_file_holds_what_memory_would_and_the_bound_is_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let crops: Vec<_> = shapes().map(|(truth, _)| Crop::of(&truth, GREY)).collect();
    let sizes = crops.iter().map(|crop| crop.bytes.len() as u64);
    let all: u64 = sizes.clone().sum();
    for bound in [0, 1, sizes.clone().next().unwrap_or(0), all / 2, all - 1, all, u64::MAX] {
        let store = Store::new(bound, folder.path());
        let stored: Vec<_> =
            crops.iter().map(|crop| store.keep(crop.clone()).expect("there is room")).collect();
        assert!(store.held_bytes() <= bound, "{} of {bound}", store.held_bytes());
        assert_eq!(store.held_bytes() == all, bound >= all, "what fits stays in memory");
        for (crop, stored) in crops.iter().zip(&stored) {
            for (background, shift) in OTHERS.into_iter().zip([0, 1, 3]) {
                assert_eq!(stored.rect(shift), scaled_rect(crop.rect(), shift));
                let same = bits(&drawn(stored, background, shift))
                    == bits(&crop.picture_at(background, shift));
                assert!(same, "{:?} under {bound} bytes, shift {shift}", crop.rect());
            }
        }
    }
    let left = std::fs::read_dir(folder.path()).expect("the folder is there").count();
    assert_eq!(left, 0, "the file has no name");
}

#[test]
fn several_threads_keep_and_read() {
    let rect = Rect { x: 2, y: 3, width: 50, height: 40 };
    let make = |i: u32| Crop::of(&truth(61, 47, rect, i), GREY);
    let bound = 6 * make(0).bytes.len() as u64;
    let folder = tempfile::tempdir().expect("a folder");
    let store = Store::new(bound, folder.path());
    let stored: Vec<Vec<Stored>> = std::thread::scope(|scope| {
        let threads = [0, 1, 2, 3].map(|thread| {
            let (store, make) = (&store, &make);
            scope.spawn(move || {
                let mine = (0..8).map(|i| store.keep(make(thread * 8 + i)));
                mine.collect::<anyhow::Result<Vec<_>>>().expect("there is room")
            })
        });
        threads.map(|thread| thread.join().expect("no panic")).into()
    });
    assert!(store.held_bytes() <= bound && store.held_bytes() > 0);
    let right: Vec<_> = (0..32).map(|i| bits(&make(i).picture(OTHERS[1]))).collect();
    std::thread::scope(|scope| {
        for thread in 0..4 {
            let (stored, right) = (&stored, &right);
            scope.spawn(move || {
                let (mut scratch, mut picture) = (Scratch::default(), Picture::default());
                for i in (0..320).map(|i| (i * 7 + thread * 11) % 32) {
                    let truth = &stored[i / 8][i % 8];
                    let read = truth.draw(OTHERS[1], 0, &mut scratch, &mut picture);
                    read.expect("it can be read back");
                    assert!(bits(&picture) == right[i], "picture {i} by thread {thread}");
                }
            });
        }
    });
}

#[test]
fn coarse_pictures_are_averages() {
    for (truth, rect) in shapes() {
        let crop = Crop::of(&truth, GREY);
        for (background, shift) in OTHERS.iter().flat_map(|b| [1, 2, 3, 5, 12].map(|s| (*b, s))) {
            let (fine, coarse) = (crop.picture(background), crop.picture_at(background, shift));
            let [w, h] = [fine.width, fine.height].map(|n| n.div_ceil(1 << shift));
            assert_eq!((coarse.width, coarse.height, coarse.rgb.len()), (w, h, (w * h) as usize));
            let part = scaled_rect(rect, shift);
            for (at, color) in (0..).zip(&coarse.rgb) {
                let (x, y): (u32, u32) = (at % w, at / w);
                let block = |at: u32, length: u32| at << shift..((at + 1) << shift).min(length);
                let rows = block(y, fine.height);
                let covered: Vec<_> = rows
                    .flat_map(|y| block(x, fine.width).map(move |x| y * fine.width + x))
                    .map(|at| fine.rgb[at as usize])
                    .collect();
                for i in 0..3 {
                    let sum: f64 = covered.iter().map(|pixel| f64::from(pixel[i])).sum();
                    let error = f64::from(color[i]) - sum / covered.len() as f64;
                    assert!(error.abs() < 1e-6, "({x}, {y}) of {rect:?}, shift {shift}: {error}");
                }
                let inside = (part.x..part.x + part.width).contains(&x)
                    && (part.y..part.y + part.height).contains(&y);
                assert!(inside || *color == background, "({x}, {y}) is outside {part:?}");
            }
        }
    }
}

#[test]
fn a_coarse_camera_sees_the_same_rays() {
    let camera = dermis_runtime::Camera {
        width: 37,
        height: 24,
        fx: 40.0,
        fy: 41.0,
        cx: 18.5,
        cy: 11.0,
        world_to_camera: [[1.0, 0.0, 0.0, 0.5], [0.0, 1.0, 0.0, 0.25], [0.0, 0.0, 1.0, 2.0]],
    };
    assert_eq!(scaled(&camera, 0), camera);
    let coarse = scaled(&camera, 3);
    assert_eq!((coarse.width, coarse.height), (5, 3));
    assert_eq!((coarse.fx, coarse.fy, coarse.cx, coarse.cy), (5.0, 5.125, 2.3125, 1.375));
    assert_eq!(coarse.world_to_camera, camera.world_to_camera);
    assert_eq!(scaled_length(0, 3), 0);
    let rect = Rect { x: 7, y: 8, width: 2, height: 8 };
    assert_eq!(scaled_rect(rect, 3), Rect { x: 0, y: 1, width: 2, height: 1 });
}

#[test]
fn errors_name_folder_cause_and_remedy() {
    let crop = || Crop::of(&truth(9, 9, Rect { x: 1, y: 1, width: 7, height: 7 }, 1), GREY);
    let missing = Path::new("/no/such/folder");
    let error = Store::new(0, missing).keep(crop()).expect_err("there is no such folder");
    let line = format!("{error:#}");
    assert!(line.contains("/no/such/folder") && line.contains("--memory"), "{line}");
    Store::new(1 << 20, missing).keep(crop()).expect("the file is not made before it is needed");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error() {
    let full = std::fs::OpenOptions::new().read(true).write(true).open("/dev/full");
    let store = Store::with_spill(0, Spill::of_file(full.expect("Linux has one")));
    let crop = Crop::of(&truth(9, 9, Rect { x: 1, y: 1, width: 7, height: 7 }, 1), GREY);
    let line = format!("{:#}", store.keep(crop).expect_err("there is no room"));
    assert!(line.contains("free room") && line.contains("No space left"), "{line}");
    assert_eq!(line.lines().count(), 1);
}

#[test]
fn a_file_that_ends_early_is_an_error() {
    let spill = Spill::of_file(tempfile::tempfile().expect("a file"));
    assert_eq!(spill.append(&[1, 2, 3]).expect("there is room"), 0);
    assert_eq!(spill.append(&[4]).expect("there is room"), 3);
    let mut bytes = [0; 2];
    spill.read(2, &mut bytes).expect("both are there");
    assert_eq!(bytes, [3, 4]);
    let line = format!("{:#}", spill.read(3, &mut bytes).expect_err("one is missing"));
    assert!(line.contains("byte 3"), "{line}");
}
