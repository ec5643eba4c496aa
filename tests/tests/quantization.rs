//! What writing an avatar to a file costs.

use dermis_format::LowPass;
use dermis_runtime::{Avatar, Plan};
use dermis_tests::small::{WHITE, options, stage, trained_demo};
use dermis_trainer::draw::{draw, rgb_of};
use dermis_trainer::metrics::psnr::psnr_db;
use dermis_trainer::optimize::forward::{self, Prefix};
use dermis_trainer::scene::{self, Painter, RigScale};
use dermis_trainer::train::{key_frames, runtime_pose};

/// The float cloud and the file, both against the mesh, from directions that training did not see.
#[test]
fn the_file_costs_at_most_three_tenths_of_a_decibel() {
    let options = options(2000, 200);
    let (model, trained) = trained_demo(&options);
    let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
    let painter = Painter::new(&model);
    let len = trained.cloud.len() as u32;
    for count in [len, len / 4] {
        let plan = Plan::with_budget(&avatar, count);
        let (mut floats, mut file, mut change, mut pictures) = (0.0, 0.0, 0.0, 0.0);
        for frame in key_frames(&model, &options).expect("it has clips") {
            let pose = runtime_pose(&frame);
            let stage = stage(&avatar, &pose);
            let posed = scene::posed_vertices(&model, &frame.pose(&model));
            let directions = &scene::novel_directions()[..6];
            for camera in RigScale::of(&model).cameras(directions, &posed, 96, 96) {
                let truth = scene::render(&painter, &posed, &camera, WHITE, 4);
                let mask: Vec<bool> = truth.coverage.iter().map(|&c| c > 0.0).collect();
                let exact = truth.picture.to_bytes();
                let psnr = |a: &[u8], b: &[u8]| psnr_db(a, b, Some(&mask)).expect("it is seen");
                let prefix = Prefix::of(count, len);
                let low_pass = LowPass::Compensated;
                let cloud = &trained.cloud;
                let before = forward::draw(cloud, prefix, &stage, &camera, low_pass, WHITE);
                let before = before.picture.to_bytes();
                let after = draw(&avatar, &pose, &plan, &camera, WHITE).expect("it can be drawn");
                let after = rgb_of(&after.rgba);
                floats += psnr(&exact, &before);
                file += psnr(&exact, &after);
                change += psnr(&before, &after);
                pictures += 1.0;
            }
        }
        let (floats, file) = (floats / pictures, file / pictures);
        let change = change / pictures;
        println!(
            "{count}: {floats:.3} dB before, {file:.3} from the file, {change:.1} between them"
        );
        assert!(floats > 15.0, "{floats} dB is no picture of it");
        assert!(change > 50.0, "the pictures differ by {change:.1} dB");
        assert!(floats - file <= 0.3, "quantization costs {:.2} dB", floats - file);
    }
}
