//! The differentiable renderer and what descends its gradients.
//!
//! 1. [`cloud`] holds the Gaussians' parameters in the order of the file.
//! 2. [`forward`] draws them with the runtime's own projection, lists and blending.
//! 3. [`loss`] compares with the truth, [`price`] says what drawing costs.
//! 4. [`backward`] walks the same lists again and sums gradients per splat; [`projection`] takes
//!    them from the screen to the discs, many at once by [`discs`].
//! 5. [`mover`] takes them to the parameters of the levels, which [`adam`] moves.
//! 6. [`schedule`] says how many steps, which prefix, and which rates.
//! 7. [`rounding`] is what the last steps draw: the file's numbers, in as many bits as [`precision`] chooses, in ranges that
//!    end at [`limits`].
//! 8. [`descend`] puts them in a loop.
//! 9. [`fulls`] draws and moves Gaussians that another program trained.
//! 10. [`residual`] says where a cloud still differs from the truth.
//!
//! Every sum runs in an order that the data fixes, so the result does not depend on threads.

pub mod adam;
pub mod backward;
pub mod cloud;
pub mod descend;
pub mod discs;
pub mod forward;
pub mod fulls;
pub mod limits;
pub mod loss;
pub mod mover;
pub mod precision;
pub mod price;
pub mod projection;
pub mod residual;
pub mod rounding;
pub mod schedule;
pub mod turns;
