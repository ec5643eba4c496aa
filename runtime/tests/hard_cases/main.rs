//! The runtime's hard cases (design, section 4) and promises (section 6) on avatars made by hand.

mod batches;
mod formulas;
mod hostile;
mod limits;
mod numbers;
mod pictures;
mod plans;
mod scenes;
