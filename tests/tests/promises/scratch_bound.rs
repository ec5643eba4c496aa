//! How much scratch a frame takes, over every avatar that there is.

use dermis_conformance::File;
use dermis_runtime::lists::Pair;
use dermis_runtime::raster::TilePixels;
use dermis_runtime::tiles::TileGrid;
use dermis_runtime::{Avatar, Prepared, scratch_len};
use dermis_tests::files;
use dermis_tests::small::{options, trained_demo};
use dermis_trainer::options::Options;
use dermis_trainer::train::train;
use dermis_trainer::{convert, import};

/// Frames from one pixel to the greatest.
const SIZES: [[u32; 2]; 7] =
    [[1, 1], [64, 64], [540, 540], [1080, 1080], [3840, 2160], [1, 16_384], [16_384, 16_384]];

/// At most, with the scratch of one band: 80 bytes a Gaussian of the budget, 12 a vertex, 48 a triangle, 64
/// for each joint and each bind (both move: a joint is a matrix, and so is a bind), 8 a tile, and
/// 64 KB that hold a tile's pixels, the triangles' visibility (a bit each, up to 200,000 of them)
/// and morph weights.
fn check(name: &str, file: &[u8]) {
    let avatar = Avatar::parse(file).expect("a valid file");
    let header = avatar.header();
    let fixed = 12 * header.vertices as usize
        + 48 * header.triangles as usize
        + 64 * (usize::from(header.joints) + usize::from(header.binds))
        + 64 * 1024;
    for budget in [0, 1, 1000, header.gaussians, u32::MAX] {
        for [width, height] in SIZES {
            let found = 4 * scratch_len(&avatar, budget, width, height);
            let budget = budget.min(header.gaussians) as usize;
            let bound = fixed + 80 * budget + 8 * TileGrid::new(width, height).tiles();
            assert!(found <= bound, "{name}: {budget} on {width} × {height}: {found}, not {bound}");
        }
    }
    let [triangles, joints, gaussians] =
        [header.triangles, u32::from(header.joints), header.gaussians];
    let words = scratch_len(&avatar, u32::MAX, 1080, 1080);
    println!(
        "{name}: {gaussians} Gaussians, {triangles} triangles, {joints} joints: {} KB at 1080 × 1080",
        words / 256
    );
}

#[test]
fn scratch_of_stored_avatars_is_bounded() {
    for avatar in File::ALL {
        check(&format!("{avatar:?}"), avatar.bytes());
    }
    let (_, trained) = trained_demo(&Options { size: 32, ..options(3_000, 1) });
    check("the built-in avatar", &trained.bytes);
}

#[test]
fn scratch_of_real_avatars_is_bounded() {
    let Some(folder) = files::data("scratch_of_real_avatars_is_bounded") else { return };
    // From one joint to many, from few triangles to many, with morph targets and without.
    for name in ["valid_male.glb", "valid_head_female.glb", "hand_left.glb", "CesiumMan.glb"] {
        let model = import::load(&folder.join(name)).expect("it can be read");
        let options = Options { size: 32, views: 2, key_frames: 1, ..options(2_000, 1) };
        check(name, &train(&model, &options).expect("it trains").bytes);
    }
    for name in ["playbot_lod4.ply", "playbot_lod6.ply"] {
        let (splats, _) = convert::read(&folder.join("splats").join(name), None).expect("it reads");
        check(name, &convert::pack(splats).expect("it can be packed"));
    }
}

/// The scratch of a band, exactly: a tile's pixels (16 KB), 4 bytes a tile of the frame, and two lists of
/// 8 bytes for each Gaussian of the budget.
#[test]
fn scratch_of_a_band() {
    assert_eq!((size_of::<TilePixels>(), size_of::<Pair>()), (16_384, 8));
    for [width, height] in SIZES {
        for budget in [0, 1, 999, 100_000, 5_000_000] {
            let bytes = 4 * Prepared::band_scratch_len(budget, width, height);
            let tiles = TileGrid::new(width, height).tiles();
            assert_eq!(bytes, 16_384 + 4 * tiles + 16 * budget as usize);
        }
    }
    // More than there is memory is said to be more than there is memory.
    assert!(Prepared::band_scratch_len(u32::MAX, u32::MAX, u32::MAX) >= u32::MAX as usize);
}
