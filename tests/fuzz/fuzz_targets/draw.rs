//! What the reader lets through is drawn, whatever the plan, the pose and the camera: within the budget, in the memory
//! that was promised, the same bytes by every kernel and in any bands, and every number finite.
#![no_main]

mod draw {
    pub(crate) mod frame;
    pub(crate) mod scene;
}

use dermis_format::Avatar;
use dermis_fuzz::{Input, flags, mutate};
use draw::frame::Frame;
use draw::scene::{Scene, Standing};
use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};

/// Bytes of plan, pose, camera and framebuffer.
const PARAMETERS: usize = 96;

fuzz_target!(|data: &[u8]| {
    let Some(mut input) = Input::new(data, PARAMETERS) else { return };
    let avatar = if input.flags & flags::PREFIX == 0 {
        Avatar::parse(&input.file)
    } else {
        Avatar::parse_prefix(&input.file)
    };
    let Ok(avatar) = avatar else { return };
    let scene = Scene::new(&avatar, &mut input.parameters);
    let standing = Standing::new(&avatar, &mut input.parameters);
    Frame::new(&scene, &mut input.parameters).check(&scene, &standing.pose());
});

fuzz_mutator!(|data: &mut [u8], len: usize, most: usize, seed: u32| {
    mutate(data, len, most, seed, PARAMETERS, fuzzer_mutate)
});
