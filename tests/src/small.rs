//! The built-in avatar, trained small.

use dermis_trainer::demo::demo_avatar;
use dermis_trainer::model::Model;
use dermis_trainer::options::{Options, Preset};
use dermis_trainer::train::{Trained, train};

/// White, as in training.
pub const WHITE: [f32; 3] = [1.0; 3];

/// Options for seconds of work: 2 poses from 12 directions, 96 px; numbers of 8 bits, so that a file is what training drew.
pub fn options(gaussians: u32, steps: u32) -> Options {
    Options {
        gaussians,
        steps,
        survey_steps: 0,
        levels: 3,
        views: 12,
        key_frames: 2,
        size: 96,
        max_loss_db: 0.0,
        ..Options::preset(Preset::Draft)
    }
}

/// The built-in avatar and what `options` make of it.
pub fn trained_demo(options: &Options) -> (Model, Trained) {
    let model = demo_avatar();
    let trained = train(&model, options).expect("the built-in avatar trains");
    (model, trained)
}
