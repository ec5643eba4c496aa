//! The runtime's hard cases (design, section 4) and promises (section 6) on avatars made by hand.

mod depths;
mod export;
mod formats;
mod formulas;
mod hostile;
mod limits;
mod numbers;
mod pictures;
mod plans;
mod scenes;
