//! The arithmetic that pixels are made of: its bounds over whole domains, and that vectors do what
//! one f32 does.

mod elementary;
mod lanes;

/// Every `step`-th float from `from` to `to`, both at least 0, by their bits, and both ends.
fn floats(from: f32, to: f32, step: usize) -> impl Iterator<Item = f32> {
    (from.to_bits()..to.to_bits()).step_by(step).chain([to.to_bits()]).map(f32::from_bits)
}

/// `x` and −`x`.
fn both(x: f32) -> [f32; 2] {
    [x, -x]
}
