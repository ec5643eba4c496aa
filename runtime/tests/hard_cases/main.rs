//! The runtime's hard cases (design, section 4) and promises (section 6) on avatars made by hand.
//!
//! What each named case draws, with f64 beside it, stands in `tests/tests/hard_cases`; here are sweeps
//! and properties, and what needs no reference.

mod batches;
mod budgets;
mod depths;
mod export;
mod formats;
mod formulas;
mod hostile;
mod levels;
mod limits;
mod numbers;
mod pictures;
mod plans;
mod posing;
mod scenes;
