//! How densely Gaussians stand on each triangle.

use super::surface::Surface;

/// No triangle is less dense than this, nor more, relative to the mean: a survey is noisy, and other poses
/// show what it did not see.
const RANGE: [f64; 2] = [0.2, 8.0];

/// Multiplies the density of each triangle, `weights`, by how much the error there asks for: where density ρ leaves
/// an error c / ρ on each unit of area, the sum over a surface of given ∫ ρ is least for ρ ~ √c. `residuals`
/// are sums over each triangle.
pub fn follow(residuals: &[f64], surface: &Surface, weights: &mut [f32]) {
    let areas: Vec<f64> = (0..surface.len()).map(|t| f64::from(surface.area(t as u32))).collect();
    let wanted = |(residual, area): (&f64, &f64)| (residual / area.max(f64::MIN_POSITIVE)).sqrt();
    let wanted: Vec<f64> = residuals.iter().zip(&areas).map(wanted).collect();
    // By the density that there was: what is seldom seen counts for little.
    let (mut sum, mut covered) = (0.0, 0.0);
    for ((wanted, area), weight) in wanted.iter().zip(&areas).zip(&*weights) {
        let share = area * f64::from(*weight);
        sum += wanted * share;
        covered += share;
    }
    if sum > 0.0 {
        let mean = sum / covered;
        let [least, greatest] = RANGE;
        // What is never seen has no error, and keeps the little it has.
        for (weight, wanted) in weights.iter_mut().zip(&wanted).filter(|(_, wanted)| **wanted > 0.0)
        {
            *weight *= (wanted / mean).clamp(least, greatest) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use dermis_format::FrameKind;

    use super::*;

    #[test]
    fn density_follows_the_root_of_the_error_of_an_area() {
        // Two triangles of area ½ and one of area 2, none beside the others.
        let vertices =
            [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
        let surface =
            Surface::new(FrameKind::Affine, &vertices, &[[0, 1, 2], [0, 1, 2], [0, 3, 4]]);
        let mut weights = [1.0; 3];
        follow(&[1.0, 4.0, 4.0], &surface, &mut weights);
        assert!((weights[1] / weights[0] - 2.0).abs() < 1e-5, "four times the error: {weights:?}");
        assert!((weights[2] - weights[0]).abs() < 1e-5, "of four times the area: {weights:?}");
        let covered: f32 = weights[0] * 0.5 + weights[1] * 0.5 + weights[2] * 2.0;
        assert!((covered - 3.0).abs() < 1e-4, "as many Gaussians as before: {weights:?}");
        let mut weights = [1.0, 0.5, 1.0];
        follow(&[0.0; 3], &surface, &mut weights);
        assert_eq!(weights, [1.0, 0.5, 1.0], "no error, no wish");
    }
}
