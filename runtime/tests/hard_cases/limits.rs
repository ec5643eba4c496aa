//! Budgets, sizes, strides, scratch and bands.

use dermis_runtime::{
    Avatar, Background, Camera, Error, Framebuffer, Kernel, Part, Pixels, Plan, Pose, Posed,
    Prepared, Statistics, render, scratch_len, scratch_len_for_threads,
};

use crate::scenes::{DOT, Picture, bytes, camera, crowd, sheet};
use dermis_runtime::error::Buffer;
use dermis_runtime::raster::Counts;

/// 97 × 75 pixels: four columns and three rows of tiles, the last of both cut.
fn view() -> Camera {
    camera(97, 75, 60.0, 1.5)
}

fn whole(avatar: &Avatar<'_>, camera: &Camera) -> Picture {
    Picture::of(avatar, &Pose::Rest, &Plan::with_budget(avatar, u32::MAX), camera)
}

fn rgba8(bytes: &mut [u8], stride: usize, background: Background) -> Framebuffer<'_> {
    Framebuffer { pixels: Pixels::Rgba8(bytes), stride, background, depth: None }
}

fn draw(
    avatar: &Avatar<'_>,
    camera: &Camera,
    words: usize,
    bytes: usize,
    stride: usize,
) -> (Result<Statistics, Error>, Vec<u8>) {
    let mut scratch = vec![0xdead_beef; words];
    let mut pixels = vec![0x5a; bytes];
    let background = Background::Color([0.0; 3]);
    let mut framebuffer = rgba8(&mut pixels, stride, background);
    let plan = Plan::with_budget(avatar, u32::MAX);
    let result =
        render(avatar, &Pose::Rest, &plan, camera, Kernel::Scalar, &mut scratch, &mut framebuffer);
    (result, pixels)
}

#[test]
fn budgets_are_kept() {
    let bytes = bytes(&crowd());
    let avatar = Avatar::parse(&bytes).unwrap();
    for (budget, expected) in [(0, 0), (1, 1), (399, 399), (400, 400), (401, 400), (u32::MAX, 400)]
    {
        let plan = Plan::with_budget(&avatar, budget);
        let statistics = Picture::of(&avatar, &Pose::Rest, &plan, &view()).statistics;
        assert_eq!(statistics.gaussians_selected, expected);
        assert!(statistics.gaussians_visible <= expected);
    }
}

#[test]
fn frames_of_every_shape_are_drawn() {
    let bytes = bytes(&crowd());
    let avatar = Avatar::parse(&bytes).unwrap();
    for (width, height) in [(1, 1), (1, 4096), (4096, 1), (31, 33), (32, 32), (97, 75), (16_384, 1)]
    {
        let camera = camera(width, height, 60.0, 1.5);
        let picture = whole(&avatar, &camera);
        assert_eq!(picture.pixels.len(), (width * height * 4) as usize);
        assert!(picture.pixels.chunks_exact(4).all(|pixel| pixel[3] == 255), "{width}×{height}");
        assert!(picture.statistics.counts.blends > 0, "{width}×{height}");
    }
}

#[test]
fn frames_that_cannot_be_drawn_are_errors() {
    let bytes = bytes(&crowd());
    let avatar = Avatar::parse(&bytes).unwrap();
    let sizes = [(0, 1), (1, 0), (0, 0), (16_385, 1), (1, 16_385), (u32::MAX, u32::MAX)];
    for (width, height) in sizes {
        let camera = camera(width, height, 60.0, 1.5);
        let (result, _) = draw(&avatar, &camera, 0, 0, 0);
        assert_eq!(result, Err(Error::Size { width, height }));
    }
    // Asking for the scratch of such a frame is no panic, either.
    assert!(scratch_len(&avatar, u32::MAX, u32::MAX, u32::MAX) > 0);
    assert!(Prepared::scratch_len(&avatar, u32::MAX, u32::MAX, u32::MAX) > 0);
}

#[test]
fn rows_may_be_further_apart() {
    let bytes = bytes(&crowd());
    let avatar = Avatar::parse(&bytes).unwrap();
    let (camera, tight) = (view(), whole(&avatar, &view()));
    let words = scratch_len(&avatar, u32::MAX, 97, 75);
    for stride in [97 * 4, 97 * 4 + 1, 97 * 4 + 13, 1000] {
        // The last row need not be as long as the stride.
        let (buffer, needed) = (Buffer::Bytes, stride * 74 + 97 * 4);
        let (result, pixels) = draw(&avatar, &camera, words, needed, stride);
        assert_eq!(result, Ok(tight.statistics));
        for (row, expected) in pixels.chunks(stride).zip(tight.pixels.chunks_exact(97 * 4)) {
            assert_eq!(&row[..97 * 4], expected);
            assert!(row[97 * 4..].iter().all(|&byte| byte == 0x5a), "bytes between rows");
        }
        let (result, pixels) = draw(&avatar, &camera, words, needed - 1, stride);
        assert_eq!(result, Err(Error::Buffer { buffer, needed, lent: needed - 1 }));
        assert!(pixels.iter().all(|&byte| byte == 0x5a), "nothing is drawn");
    }
    let (result, _) = draw(&avatar, &camera, words, 1 << 20, 97 * 4 - 1);
    assert!(
        matches!(result, Err(Error::Stride { buffer: Buffer::Bytes, needed: 388, given: 387 })),
        "rows overlap: {result:?}"
    );
    let (result, _) = draw(&avatar, &camera, words, 1 << 20, usize::MAX);
    assert!(matches!(result, Err(Error::Buffer { .. })), "{result:?}");
}

#[test]
fn scratch_is_as_long_as_it_says() {
    let bytes = bytes(&crowd());
    let avatar = Avatar::parse(&bytes).unwrap();
    let (camera, expected) = (view(), whole(&avatar, &view()));
    let needed = scratch_len(&avatar, u32::MAX, 97, 75);
    let len = 97 * 75 * 4;
    for lent in [0, 1, needed / 2, needed - 1] {
        let (result, _) = draw(&avatar, &camera, lent, len, 97 * 4);
        let error = Error::Scratch { needed, lent };
        assert_eq!(result, Err(error));
        assert!(error.to_string().ends_with(&format!("lend {} more", needed - lent)));
    }
    for lent in [needed, needed + 1, needed + 777, 3 * needed, 100 * needed] {
        let (result, pixels) = draw(&avatar, &camera, lent, len, 97 * 4);
        assert_eq!(
            (result, pixels),
            (Ok(expected.statistics), expected.pixels.clone()),
            "{lent} words"
        );
    }
}

#[test]
fn bands_make_the_whole_frame() {
    let bytes = bytes(&crowd());
    let avatar = Avatar::parse(&bytes).unwrap();
    let camera = view();
    let expected = whole(&avatar, &camera);
    let plan = Plan::with_budget(&avatar, u32::MAX);
    let mut posing = vec![0; Posed::scratch_len(&avatar)];
    let mut preparing = vec![0; Prepared::scratch_len(&avatar, 400, 97, 75)];
    let posed = Posed::new(&avatar, &Pose::Rest, Kernel::Scalar, &mut posing).unwrap();
    let prepared = Prepared::new(&posed, &plan, &camera, &mut preparing).unwrap();
    assert_eq!(prepared.tile_rows(), 3);
    let background = Background::Color([0.0; 3]);
    let tiles = |first: u16, end: u16| u64::from(end.div_ceil(32) - first / 32);
    let tiles_of = |[x0, y0, x1, y1]: [u16; 4]| tiles(x0, x1) * tiles(y0, y1);
    let pairs: u64 = prepared.splats().iter().map(|splat| tiles_of(splat.bounds)).sum();
    assert_eq!(expected.statistics.counts.pairs, pairs);
    let mut scratch = vec![0; Prepared::band_scratch_len(400, 97, 75)];
    for cuts in [vec![0, 1, 2, 3], vec![0, 2, 3], vec![0, 3]] {
        let mut counts = Counts::default();
        let mut pixels = Vec::new();
        for rows in cuts.windows(2) {
            let height = (rows[1] * 32).min(75) - rows[0] * 32;
            let mut band = vec![0x5a; height as usize * 97 * 4];
            let mut framebuffer = rgba8(&mut band, 97 * 4, background);
            counts += prepared.draw_band(rows[0]..rows[1], &mut scratch, &mut framebuffer).unwrap();
            pixels.extend(band);
        }
        assert_eq!(pixels, expected.pixels, "{cuts:?}");
        assert_eq!(counts, expected.statistics.counts);
    }
    // Rows beyond the frame, and none, draw nothing.
    let mut none = rgba8(&mut [], 97 * 4, background);
    for rows in [3..9, 1..1, 7..u32::MAX, u32::MAX..u32::MAX] {
        assert_eq!(
            prepared.for_each_tile(rows.clone(), &mut scratch, |_, _, _| panic!()),
            Ok(Counts::default())
        );
        assert_eq!(prepared.draw_band(rows, &mut scratch, &mut none).unwrap().blends, 0);
    }
    let mut tiles = 0;
    prepared.for_each_tile(0..u32::MAX, &mut scratch, |_, _, _| tiles += 1).unwrap();
    assert_eq!(tiles, 4 * 3);
    // A band's own shortage.
    let lent = 100;
    let error = prepared.draw(&mut scratch[..lent], &mut none).unwrap_err();
    assert_eq!(error, Error::Buffer { buffer: Buffer::Bytes, needed: 29_100, lent: 0 });
    let error = prepared.for_each_tile(0..1, &mut scratch[..lent], |_, _, _| ()).unwrap_err();
    let needed = 32 * 32 * 4 + 4 + 2 * 2 * prepared.splats().len();
    assert_eq!(error, Error::Scratch { needed, lent });
}

/// However the projection is cut and whatever order its shares are done in, the splats are the same,
/// and so is the frame in even bands.
#[test]
fn shares_and_bands_make_the_same_frame() {
    let file = bytes(&crowd());
    let avatar = Avatar::parse(&file).unwrap();
    let mut posing = vec![0; Posed::scratch_len(&avatar)];
    let posed = Posed::new(&avatar, &Pose::Rest, Kernel::detect(), &mut posing).unwrap();
    for budget in [0, 1, 57, 400] {
        let plan = Plan::with_budget(&avatar, budget);
        let expected = Picture::of(&avatar, &Pose::Rest, &plan, &view());
        let mut preparing = vec![7; Prepared::scratch_len(&avatar, budget, 97, 75)];
        let whole = Prepared::new(&posed, &plan, &view(), &mut preparing).unwrap();
        let splats = whole.splats().to_vec();
        for parts in [0, 1, 2, 3, 7, 64, usize::MAX] {
            let prepared =
                Prepared::in_parts(&posed, &plan, &view(), &mut preparing, parts, |parts| {
                    parts.iter_mut().rev().for_each(Part::project);
                });
            let prepared = prepared.unwrap();
            assert_eq!(prepared.splats(), splats, "{parts} shares of {budget}");
            let mut pixels = vec![0; 97 * 75 * 4];
            let mut drawing = vec![0; Prepared::band_scratch_len(budget, 97, 75)];
            let mut next = 0;
            for rows in prepared.bands(parts.min(100) as u32) {
                assert_eq!(rows.start, next, "bands follow each other");
                next = rows.end;
                let rest = &mut pixels[rows.start as usize * 32 * 97 * 4..];
                let background = Background::Color([0.0; 3]);
                let mut band = rgba8(rest, 97 * 4, background);
                prepared.draw_band(rows, &mut drawing, &mut band).unwrap();
            }
            assert_eq!(next, prepared.tile_rows());
            assert!(pixels == expected.pixels, "{parts} bands of {budget}");
        }
    }
}

/// Memory for several threads is that of its steps.
#[test]
fn scratch_for_threads_is_the_sum_of_its_steps() {
    let file = bytes(&crowd());
    let avatar = Avatar::parse(&file).unwrap();
    let of = |threads| scratch_len_for_threads(&avatar, 100, 97, 75, threads);
    let band = Prepared::band_scratch_len(100, 97, 75);
    let once = Posed::scratch_len(&avatar) + Prepared::scratch_len(&avatar, 100, 97, 75);
    assert_eq!([of(0), of(1), of(3)], [once, once + band, once + 3 * band]);
    assert_eq!(of(1), scratch_len(&avatar, 100, 97, 75));
}

/// Each step says its own whole shortage.
#[test]
fn steps_say_how_much_scratch_they_lack() {
    let bytes = bytes(&crowd());
    let avatar = Avatar::parse(&bytes).unwrap();
    let plan = Plan::with_budget(&avatar, 100);
    let mut scratch = vec![0; 100_000];
    let needed = Posed::scratch_len(&avatar);
    for lent in [0, needed - 1] {
        let error =
            Posed::new(&avatar, &Pose::Rest, Kernel::Scalar, &mut scratch[..lent]).unwrap_err();
        assert_eq!(error, Error::Scratch { needed, lent });
    }
    let (posing, rest) = scratch.split_at_mut(needed);
    let posed = Posed::new(&avatar, &Pose::Rest, Kernel::Scalar, posing).unwrap();
    let needed = Prepared::scratch_len(&avatar, 100, 97, 75);
    for lent in [0, needed - 1] {
        let error = Prepared::new(&posed, &plan, &view(), &mut rest[..lent]).unwrap_err();
        assert_eq!(error, Error::Scratch { needed, lent });
    }
    assert!(Prepared::new(&posed, &plan, &view(), &mut rest[..needed]).is_ok());
}

#[test]
fn a_plan_of_another_avatar_is_an_error() {
    let (large, small) = (bytes(&sheet(&[DOT; 9])), bytes(&sheet(&[DOT; 2])));
    let [large, small] = [&large, &small].map(|bytes| Avatar::parse(bytes).unwrap());
    let two_regions = bytes(&crowd());
    let two_regions = Avatar::parse(&two_regions).unwrap();
    let mut scratch = vec![0; 100_000];
    let mut pixels = [0; 8 * 8 * 4];
    for (planned, drawn, works) in [
        (large, small, false),
        (small, large, true),
        (two_regions, small, false),
        (small, two_regions, false),
    ] {
        let plan = Plan::with_budget(&planned, u32::MAX);
        let background = Background::Existing;
        let mut framebuffer = rgba8(&mut pixels, 32, background);
        let camera = camera(8, 8, 8.0, 1.0);
        let result = render(
            &drawn,
            &Pose::Rest,
            &plan,
            &camera,
            Kernel::Scalar,
            &mut scratch,
            &mut framebuffer,
        );
        assert_eq!(result.is_ok(), works);
        assert!(works || result == Err(Error::Plan));
    }
}

#[test]
fn what_scratch_held_before_does_not_matter() {
    let file = bytes(&crowd());
    let avatar = Avatar::parse(&file).unwrap();
    let expected = whole(&avatar, &view());
    let plan = Plan::with_budget(&avatar, u32::MAX);
    let mut scratch = vec![0; scratch_len(&avatar, u32::MAX, 97, 75)];
    for fill in [0, 1, u32::MAX, f32::NAN.to_bits()] {
        scratch.fill(fill);
        let mut pixels = vec![0; 97 * 75 * 4];
        let background = Background::Color([0.0; 3]);
        let mut framebuffer = rgba8(&mut pixels, 97 * 4, background);
        render(
            &avatar,
            &Pose::Rest,
            &plan,
            &view(),
            Kernel::detect(),
            &mut scratch,
            &mut framebuffer,
        )
        .unwrap();
        assert_eq!(pixels, expected.pixels);
    }
}
