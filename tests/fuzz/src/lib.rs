//! What the fuzzer's targets share. An input is a byte of [`flags`], parameters of the target, and a file.
//!
//! 1. [`seal`] makes the CRCs of a changed file right, so that what is behind them is reached.
//! 2. [`mutate`] changes sections, and parameters, in place of bytes anywhere: most files stay ones that can be cut
//!    into sections.
//! 3. [`input`] takes an input apart, and makes numbers of parameters.

pub mod input;
pub mod mutate;
pub mod seal;

pub use input::{Input, Parameters, flags};
pub use mutate::mutate;
pub use seal::seal;
