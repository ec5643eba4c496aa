//! Float pictures: what training compares and metrics measure.

/// A picture of `width × height` pixels, row-major, row 0 on top; display-referred sRGB in [0, 1].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// (r, g, b) of each pixel.
    pub rgb: Vec<[f32; 3]>,
}

impl Picture {
    /// A picture of one colour.
    pub fn filled(width: u32, height: u32, color: [f32; 3]) -> Self {
        Self { width, height, rgb: vec![color; width as usize * height as usize] }
    }
}
