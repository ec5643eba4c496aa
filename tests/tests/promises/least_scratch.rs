//! A band's scratch may be anything from its least length on: more means longer lists, never other pixels.

use dermis_conformance::{File, cameras};
use dermis_format::source::{Gaussians, Mathematics, Region, Source};
use dermis_format::{FrameKind, Full, LowPass, ScaleLaw, writer};
use dermis_runtime::lists::Pair;
use dermis_runtime::raster::TilePixels;
use dermis_runtime::{Avatar, Camera, Error, Plan, Pose, Posed, Prepared};
use dermis_tests::picture::kernels;

use crate::frame::bits;

/// Words of a tile's pixels, and of a list's entry.
const PIXELS: usize = size_of::<TilePixels>() / 4;
const PAIR: usize = size_of::<Pair>() / 4;

/// Faint balls at many depths, each over all of the frame.
fn veils(count: u32) -> Vec<u8> {
    let ball = |i: u32| Full {
        position: [0.01 * (i % 7) as f32, 0.02 * (i % 5) as f32, 0.001 * (i * 37 % count) as f32],
        rotation: [1.0, 0.0, 0.0, 0.0],
        log2_scale: [2.0; 3],
        color: [0.2 + 0.1 * (i % 8) as f32, 0.5, 0.1 * (i % 10) as f32],
        opacity: 0.02,
    };
    let region = Region {
        name: "all".into(),
        layers: vec![count],
        gaussians: Gaussians::Full((0..count).map(ball).collect()),
        ..Region::default()
    };
    let mathematics = Mathematics {
        frame: FrameKind::World,
        low_pass: LowPass::Classic,
        scale_law: ScaleLaw::Constant,
        harmonics_degree: 0,
    };
    let source = Source { regions: vec![region], mathematics, ..Source::default() };
    writer::encode(&source).expect("a valid source")
}

/// Draws with every length of scratch that changes how many tiles are sorted at once, and with some
/// between. Returns the pairs of splat and tile, and the longest list.
fn same_for_all_lengths(file: &[u8], pose: &Pose<'_>, camera: &Camera) -> [usize; 2] {
    let avatar = Avatar::parse(file).expect("a valid file");
    let plan = Plan::with_budget(&avatar, u32::MAX);
    let (width, height, budget) = (camera.width, camera.height, plan.gaussians());
    let mut found = [0; 2];
    for kernel in kernels() {
        let mut posing = vec![0; Posed::scratch_len(&avatar)];
        let mut preparing = vec![0; Prepared::scratch_len(&avatar, budget, width, height)];
        let posed = Posed::new(&avatar, pose, kernel, &mut posing).expect("it fits");
        let prepared = Prepared::new(&posed, &plan, camera, &mut preparing).expect("it fits");
        let Err(Error::Scratch { needed: least, lent: 0 }) = bits(&prepared, &mut []) else {
            panic!("no memory is too little");
        };
        let promised = Prepared::band_scratch_len(budget, width, height);
        assert!(least <= promised, "{least} words, though {promised} were said to be enough");
        let mut lists = Vec::new();
        let mut plenty = vec![0; 40 * promised];
        prepared
            .for_each_list(0..u32::MAX, &mut plenty, |_, list| lists.push(list.len()))
            .expect("it fits");
        let pairs: usize = lists.iter().sum();
        let longest = lists.iter().copied().max().unwrap_or(0);
        found = [pairs, longest];
        let expected = bits(&prepared, &mut plenty).expect("it fits");
        // With this much all tiles are sorted at once: their lists, and the longest once more.
        let fixed = least - 2 * PAIR * prepared.splats().len();
        let whole = least.max(fixed + PAIR * (pairs + longest)) + PAIR;
        let mut lengths = vec![least, least + 1, least + 3, promised, whole - 1, whole, whole + 1];
        lengths.extend((0..20).map(|i| least + (whole - least) * i / 20));
        // Where a run of so many tiles fits just so, or just not.
        let (mut sum, mut longest) = (0, 0);
        for &len in &lists {
            sum += len;
            longest = longest.max(len);
            let other = fixed + PAIR * (sum + longest);
            lengths.extend([other - 1, other, other + 1].into_iter().filter(|len| *len >= least));
        }
        for len in lengths {
            let mut scratch = vec![u32::MAX; len];
            let drawn = bits(&prepared, &mut scratch);
            assert!(drawn.as_ref() == Ok(&expected), "{len} words by {}", kernel.name());
        }
        let error = bits(&prepared, &mut vec![0; least - 1]).err();
        assert_eq!(error, Some(Error::Scratch { needed: least, lent: least - 1 }));
    }
    found
}

#[test]
fn every_gaussian_on_every_tile() {
    let camera = cameras::ORIGIN.camera([97, 75]);
    let [pairs, longest] = same_for_all_lengths(&veils(500), &Pose::Rest, &camera);
    assert_eq!([pairs, longest], [500 * 12, 500], "all on each of 12 tiles");
}

/// The least scratch holds one list of them all, and they are all in one.
#[test]
fn every_gaussian_on_one_tile() {
    let camera = cameras::ORIGIN.camera([32, 32]);
    let [pairs, longest] = same_for_all_lengths(&veils(1000), &Pose::Rest, &camera);
    assert_eq!([pairs, longest], [1000, 1000]);
}

#[test]
fn an_avatar_from_far_and_near() {
    let pose = Pose::Clip { clip: 1, seconds: 0.4 };
    for (view, least) in [(cameras::FRONT, 3_000), (cameras::NEAR, 1_000)] {
        let camera = view.camera([150, 131]);
        let [pairs, _] = same_for_all_lengths(File::Figure.bytes(), &pose, &camera);
        assert!(pairs > least, "{pairs} pairs");
    }
}

/// A band's least scratch: a tile's pixels, an end for each of its tiles, and two lists of all splats.
#[test]
fn least_scratch_of_bands() {
    let file = veils(100);
    let avatar = Avatar::parse(&file).expect("a valid file");
    let plan = Plan::with_budget(&avatar, u32::MAX);
    let camera = cameras::ORIGIN.camera([97, 75]);
    let mut posing = vec![0; Posed::scratch_len(&avatar)];
    let mut preparing = vec![0; Prepared::scratch_len(&avatar, 100, 97, 75)];
    for kernel in kernels() {
        let posed = Posed::new(&avatar, &Pose::Rest, kernel, &mut posing).expect("it fits");
        let prepared = Prepared::new(&posed, &plan, &camera, &mut preparing).expect("it fits");
        assert_eq!(prepared.splats().len(), 100);
        for (rows, tiles) in [(0..1, 4), (1..2, 4), (2..3, 4), (0..2, 8), (1..3, 8), (0..3, 12)] {
            let least = PIXELS + tiles + 2 * PAIR * 100;
            let draw = |len: usize| {
                let mut drawn = Vec::new();
                let mut scratch = vec![u32::MAX; len];
                let done = prepared.for_each_tile(rows.clone(), &mut scratch, |tile, _, pixels| {
                    drawn
                        .push((tile, pixels.0.map(|row| row.map(|plane| plane.map(f32::to_bits)))));
                });
                done.map(|_| drawn)
            };
            let expected = draw(100 * least).expect("it fits");
            assert_eq!(expected.len(), tiles);
            assert!(draw(least).as_ref() == Ok(&expected), "rows {rows:?} by {}", kernel.name());
            assert_eq!(draw(least - 1), Err(Error::Scratch { needed: least, lent: least - 1 }));
        }
    }
}
