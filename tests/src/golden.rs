//! Stored pictures, and a panel that shows how another one differs.

use std::path::{Path, PathBuf};

use image::{Rgba, RgbaImage};

use crate::files;

/// Whether stored files are to be renewed: `DERMIS_BLESS=1`.
pub fn blessing() -> bool {
    std::env::var_os("DERMIS_BLESS").is_some_and(|value| value == "1")
}

/// A stored file of the tests.
pub fn path(folder: &str, name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(folder).join(name)
}

/// Compares RGBA8 pixels with `golden/<name>.png`, bit by bit.
///
/// # Panics
///
/// Where they differ: the message names a panel of expected picture, difference and actual one.
pub fn check(name: &str, rgba: &[u8], width: u32, height: u32) {
    let actual = RgbaImage::from_raw(width, height, rgba.to_vec()).expect("4 bytes a pixel");
    let path = path("golden", &format!("{name}.png"));
    if blessing() {
        actual.save(&path).expect("the golden folder can be written");
        return;
    }
    let expected = image::open(&path)
        .unwrap_or_else(|error| panic!("{}: {error}; DERMIS_BLESS=1 makes it", path.display()))
        .into_rgba8();
    if expected == actual {
        return;
    }
    let panel = files::failures().join(format!("{name}.png"));
    self::panel(&expected, &actual).save(&panel).expect("the target folder can be written");
    let pixels = expected.pixels().zip(actual.pixels());
    let differing = pixels.filter(|(a, b)| a != b).count();
    panic!(
        "{name}: {differing} pixels differ; see expected, difference and actual in {}. \
         DERMIS_BLESS=1 takes the actual picture as the expected one",
        panel.display()
    );
}

/// Expected picture, difference (mid-grey where equal, 16 times as strong), actual picture.
pub fn panel(expected: &RgbaImage, actual: &RgbaImage) -> RgbaImage {
    let (width, height) = (expected.width().max(actual.width()), expected.height());
    let height = height.max(actual.height());
    RgbaImage::from_fn(3 * width, height, |x, y| {
        let (place, x) = (x / width, x % width);
        let outside = Rgba([255, 0, 255, 255]);
        let [a, b] = [expected, actual].map(|p| p.get_pixel_checked(x, y).copied());
        match (place, a, b) {
            (0, Some(a), _) => a,
            (1, Some(Rgba(a)), Some(Rgba(b))) => {
                let channel =
                    |i: usize| (128 + 16 * (i32::from(b[i]) - i32::from(a[i]))).clamp(0, 255) as u8;
                Rgba([channel(0), channel(1), channel(2), 255])
            }
            (2, _, Some(b)) => b,
            _ => outside,
        }
    })
}
