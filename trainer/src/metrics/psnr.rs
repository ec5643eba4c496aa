//! Peak signal-to-noise ratio of 8-bit pictures.

/// What [`psnr_db`] gives where the pictures are equal, and its greatest value, in dB.
///
/// Equal pictures have no noise, hence no finite ratio; a cap keeps means over pictures finite.
/// 100 dB is a mean squared error of 6.5e-6 of the 8-bit steps: one value in 150,000 off by one.
pub const PSNR_CAP_DB: f64 = 100.0;

/// Mean squared error in squared 8-bit steps, over all three channels.
///
/// `a` and `b` hold (r, g, b) of each pixel, row-major. With a mask (one entry a pixel) only the
/// pixels that are `true` count. `None` where no pixel counts.
///
/// # Panics
///
/// Where the lengths differ or are not those of whole pixels.
pub fn mse(a: &[u8], b: &[u8], mask: Option<&[bool]>) -> Option<f64> {
    assert!(a.len() == b.len() && a.len().is_multiple_of(3), "two RGB pictures of one size");
    assert!(mask.is_none_or(|mask| mask.len() * 3 == a.len()), "one mask entry a pixel");
    let mut sum = 0_u64;
    let mut pixels = 0_u64;
    for (index, (a, b)) in a.chunks_exact(3).zip(b.chunks_exact(3)).enumerate() {
        if mask.is_none_or(|mask| mask[index]) {
            pixels += 1;
            sum += a.iter().zip(b).map(|(&a, &b)| u64::from(a.abs_diff(b)).pow(2)).sum::<u64>();
        }
    }
    (pixels > 0).then(|| sum as f64 / (3 * pixels) as f64)
}

/// 10·log10(255² / [`mse`]) in dB, at most [`PSNR_CAP_DB`].
///
/// With a mask of the pixels that the mesh covers at all, the PSNR over the foreground. `None`
/// where no pixel counts: leave such a picture out of a mean.
///
/// # Panics
///
/// As [`mse`].
pub fn psnr_db(a: &[u8], b: &[u8], mask: Option<&[bool]>) -> Option<f64> {
    // An error of 0 divides to infinity, which the cap catches.
    mse(a, b, mask).map(|mse| (10.0 * (255.0 * 255.0 / mse).log10()).min(PSNR_CAP_DB))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        let black = [0; 12];
        let white = [255; 12];
        assert_eq!(psnr_db(&black, &white, None), Some(0.0));
        assert_eq!(psnr_db(&white, &white, None), Some(PSNR_CAP_DB));
        // Off by one everywhere: 20 log10(255).
        let one = psnr_db(&black, &[1; 12], None).unwrap();
        assert!((one - 48.130_803_608_679_1).abs() < 1e-9);
    }

    #[test]
    fn a_mask_chooses_pixels() {
        let a = [0, 0, 0, 9, 9, 9];
        let b = [0, 0, 0, 6, 9, 12];
        assert_eq!(mse(&a, &b, None), Some(3.0));
        assert_eq!(mse(&a, &b, Some(&[false, true])), Some(6.0));
        assert_eq!(mse(&a, &b, Some(&[false, false])), None);
        assert_eq!(psnr_db(&a, &b, Some(&[true, false])), Some(PSNR_CAP_DB));
    }
}
