//! What writing an avatar to a file costs.

use dermis_tests::compare::cost_of_packing;
use dermis_tests::small::{options, trained_demo};

/// The float cloud and the file, both against the mesh, from directions that training did not see.
#[test]
fn the_file_costs_at_most_three_tenths_of_a_decibel() {
    let options = options(2000, 200);
    let (model, trained) = trained_demo(&options);
    let len = trained.clouds[0].len() as u32;
    for count in [len, len / 4] {
        let cost = cost_of_packing(&model, &trained, &options, count, 6);
        println!("{count} Gaussians: {cost:.3?}");
        assert!(cost.cloud > 15.0, "{} dB is no picture of it", cost.cloud);
        assert!(cost.between > 50.0, "the pictures differ by {:.1} dB", cost.between);
        assert!(cost.cloud - cost.file <= 0.3, "{cost:?}");
    }
}
