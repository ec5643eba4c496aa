//! What the avatars of the conformance set hold.

use dermis_format::{Avatar, FrameKind, LowPass, PerLevel, RecordKind, ScaleLaw};
use dermis_tests::files::workspace;

/// The stored bytes hold what the set needs of them.
#[test]
fn stored_avatars_cover_the_format() {
    let read = |name: &str| {
        let path = workspace().join("tests/conformance/data").join(format!("{name}.dermis"));
        std::fs::read(path).expect("the avatar is stored; the example conformance_avatars makes it")
    };
    let [figure, layered, leveled] = ["figure", "layered", "leveled"].map(read);
    let figure = *Avatar::parse(&figure).expect("stored avatars are valid").header();
    assert_eq!((figure.record, figure.frame), (RecordKind::Disc, FrameKind::Area));
    assert_eq!((figure.low_pass, figure.scale_law), (LowPass::Compensated, ScaleLaw::SquareRoot));
    assert!(figure.joints > 1 && figure.morph_targets > 1 && figure.clips > 1);
    assert!(figure.gaussians >= 4_000 && figure.layers == 4);
    let layered = *Avatar::parse(&layered).expect("stored avatars are valid").header();
    assert_eq!((layered.record, layered.frame), (RecordKind::Full, FrameKind::Edge));
    assert_eq!((layered.low_pass, layered.scale_law), (LowPass::Classic, ScaleLaw::Constant));
    assert_eq!(layered.per_level, PerLevel::Opacity);
    assert!(layered.harmonics_degree == 3 && layered.regions == 2);
    let leveled = *Avatar::parse(&leveled).expect("stored avatars are valid").header();
    assert_eq!((leveled.record, leveled.frame), (RecordKind::Disc, FrameKind::Affine));
    assert_eq!((leveled.low_pass, leveled.per_level), (LowPass::Pixel, PerLevel::All));
    assert_eq!((leveled.gaussians, leveled.layers), (1500, 3));
}
