//! What drawing costs, as a term of the loss.
//!
//! A splat is blended where its alpha reaches 1/255: in the ellipse (a dx + b dy)² + (c dy)² ≤ ρ with
//! ρ = log₂ o + log₂ 255, whose area is π ρ / (a c) px. That is what it costs, where no pixel is finished early.

use core::f32::consts::PI;

use dermis_runtime::project::{LEAST_LOG2_ALPHA, Splat};

use super::backward::SplatGradient;

/// Blends that a splat takes, in a frame without edges.
pub fn blends(splat: &Splat) -> f32 {
    let [a, _, c] = splat.falloff;
    PI * (splat.log2_opacity - LEAST_LOG2_ALPHA) / (a * c)
}

/// Adds the gradient of `price` · Σ blends to that by each splat.
pub fn add_gradient(price: f32, splats: &[Splat], gradients: &mut [SplatGradient]) {
    for (splat, gradient) in splats.iter().zip(gradients) {
        let [a, _, c] = splat.falloff;
        let cost = price * blends(splat);
        gradient.log2_opacity += price * PI / (a * c);
        gradient.falloff[0] -= cost / a;
        gradient.falloff[2] -= cost / c;
    }
}

#[cfg(test)]
mod tests {
    use dermis_runtime::raster::{alpha, log2_alpha};

    use super::*;

    const SPLAT: Splat = Splat {
        mean: [20.3, 19.8],
        falloff: [0.3, 0.1, 0.2],
        log2_opacity: -0.5,
        color: [0.0; 3],
        depth: 1.0,
        bounds: [0, 0, 40, 40],
    };

    #[test]
    fn blends_are_the_pixels_that_are_touched() {
        let touches = |x: u16, y: u16| {
            let d = [f32::from(x) + 0.5 - SPLAT.mean[0], f32::from(y) + 0.5 - SPLAT.mean[1]];
            alpha(log2_alpha(&SPLAT, d[0], d[1])).1
        };
        let touched =
            (0..40).flat_map(|y| (0..40).map(move |x| (x, y))).filter(|&(x, y)| touches(x, y));
        let (touched, predicted) = (touched.count() as f32, blends(&SPLAT));
        assert!(
            (touched / predicted - 1.0).abs() < 0.03,
            "{touched} pixels, {predicted} predicted"
        );
    }

    #[test]
    fn the_gradient_is_that_of_the_cost() {
        let mut gradient = [SplatGradient::default()];
        add_gradient(2.0, &[SPLAT], &mut gradient);
        let cost = |splat: Splat| 2.0 * f64::from(blends(&splat));
        let h = 1e-3;
        let slope = |up: Splat, down: Splat| (cost(up) - cost(down)) / (2.0 * f64::from(h));
        let moved = |i: usize, h: f32| {
            let mut splat = SPLAT;
            splat.falloff[i] += h;
            splat
        };
        for i in [0, 2] {
            let numeric = slope(moved(i, h), moved(i, -h));
            let error = (f64::from(gradient[0].falloff[i]) / numeric - 1.0).abs();
            assert!(error < 2e-3, "falloff {i}: {error}");
        }
        let fainter = |h: f32| Splat { log2_opacity: SPLAT.log2_opacity + h, ..SPLAT };
        let numeric = slope(fainter(h), fainter(-h));
        assert!((f64::from(gradient[0].log2_opacity) / numeric - 1.0).abs() < 2e-3);
        assert_eq!(gradient[0].color, [0.0; 3]);
    }
}
