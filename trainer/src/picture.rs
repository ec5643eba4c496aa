//! Pictures: floats that training compares, bytes that metrics measure and people look at.

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

    /// 8 bits a channel, rounded as the runtime rounds: (r, g, b) after (r, g, b).
    pub fn to_bytes(&self) -> Vec<u8> {
        self.rgb.iter().flat_map(|pixel| pixel.map(dermis_runtime::framebuffer::to_byte)).collect()
    }
}

/// Sum of the squared differences of a pixel's channels, on average over all pixels of some pictures.
pub fn mean_square(these: &[Picture], those: &[Picture]) -> f64 {
    let pixels = |pictures: &[Picture]| pictures.iter().map(|p| p.rgb.len()).sum::<usize>();
    let pairs = these.iter().zip(those).flat_map(|(a, b)| a.rgb.iter().zip(&b.rgb));
    let squares =
        pairs.flat_map(|(a, b)| a.iter().zip(b)).map(|(a, b)| f64::from((a - b) * (a - b)));
    squares.sum::<f64>() / pixels(these).max(1) as f64
}
