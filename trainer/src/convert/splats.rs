//! Gaussians that stand free in the world, on their way from another program's file into ours.

use anyhow::{Result, ensure};
use dermis_format::Full;
use dermis_format::quant::{opacity_code, opacity_value};
use dermis_runtime::select::LEAST_OPACITY;

/// An axis under 1/1024 of the Gaussian's longest shows in no picture: the low-pass of the
/// projection is as wide as a Gaussian of 0.55 px, and one that is 1,024 times as long fills the frame.
const THINNEST_LOG2: f64 = -10.0;

/// log₂ of the least standard deviation, metres: a micrometre, a point at every distance. Scales of
/// neighbours share a range of 8 bits, which a single −100 would make coarse for all.
const POINT_LOG2: f64 = -20.0;

/// Within the format's limits (SPEC, section 7), so that one wild Gaussian is left out instead of the
/// file being refused: metres, log₂ metres, times white.
const GREATEST_POSITION: f64 = 1e9;
const GREATEST_LOG2_SCALE: f64 = 30.0;
const GREATEST_COLOR: f64 = 250.0;

/// Which harmonics of degrees 1 to 3 change their sign with y and z: those whose polynomials have an odd number of both.
const TURNED: [bool; 15] = [
    true, true, false, // y, z, x
    true, false, false, true, false, // xy, yz, 2z² − x² − y², xz, x² − y²
    true, false, true, true, false, true, false, // y…, xyz, y…, z…, x…, z…, x…
];

/// Free Gaussians, metres, world axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Splats {
    /// Degree of the spherical harmonics, 0..=3.
    pub degree: u8,
    /// Each Gaussian.
    pub gaussians: Vec<Full>,
    /// For each Gaussian 3 · ((degree + 1)² − 1) coefficients, (r, g, b) after (r, g, b); empty at
    /// degree 0.
    pub harmonics: Vec<Vec<f32>>,
    /// Whether their low-pass is [compensated](dermis_format::LowPass::Compensated); otherwise classic.
    pub compensated: bool,
    /// The degree that they came with, where harmonics were cut.
    pub cut_from: Option<u8>,
}

/// How many Gaussians of a file were left out, and why.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// Opacity under 1.5/255: rounded to the format's 1/255 they are under the least that is drawn.
    pub faint: usize,
    /// A number is not finite, or further off than the format goes.
    pub wild: usize,
}

/// A Gaussian in numbers as they come.
#[derive(Clone, Copy, Debug)]
pub struct Splat<'a> {
    /// Centre, metres.
    pub position: [f64; 3],
    /// Quaternion w, x, y, z of any length, own axes → world; zero is no rotation.
    pub rotation: [f64; 4],
    /// log₂ of the standard deviations, metres; −∞ is flat.
    pub log2_scale: [f64; 3],
    /// Display-referred sRGB of the constant term.
    pub color: [f64; 3],
    /// In [0, 1].
    pub opacity: f64,
    /// As [`Splats::harmonics`].
    pub harmonics: &'a [f32],
}

impl Splats {
    /// Coefficients of a Gaussian at a degree.
    pub fn harmonics_len(degree: u8) -> usize {
        3 * ((usize::from(degree) + 1).pow(2) - 1)
    }

    /// Adds a Gaussian, or counts it as left out; whether it was added.
    pub fn push(&mut self, splat: &Splat<'_>, left_out: &mut LeftOut) -> bool {
        if !is_tame(splat) {
            left_out.wild += 1;
            return false;
        }
        if opacity_value(opacity_code(splat.opacity as f32)) < LEAST_OPACITY {
            left_out.faint += 1;
            return false;
        }
        let longest = splat.log2_scale.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let least = (longest + THINNEST_LOG2).max(POINT_LOG2);
        self.gaussians.push(Full {
            position: splat.position.map(|x| x as f32),
            rotation: unit(splat.rotation).map(|x| x as f32),
            log2_scale: splat.log2_scale.map(|s| s.max(least) as f32),
            color: splat.color.map(|x| x as f32),
            opacity: splat.opacity as f32,
        });
        if self.degree > 0 {
            self.harmonics.push(splat.harmonics.to_vec());
        }
        true
    }

    /// Refuses to go on with none.
    pub(super) fn ensure_any(&self, left_out: &LeftOut) -> Result<()> {
        let LeftOut { faint, wild } = left_out;
        ensure!(
            !self.gaussians.is_empty(),
            "none of its {} Gaussians can be drawn ({faint} too faint, {wild} with numbers that are \
             not finite or too great); export it again",
            faint + wild
        );
        Ok(())
    }

    /// Lowers the degree to the greatest that has a coefficient other than zero: files of degree 3
    /// that hold plain colours are common.
    pub fn lower_degree(&mut self) {
        let is_used = |degree: u8| {
            let band = Self::harmonics_len(degree - 1)..Self::harmonics_len(degree);
            self.harmonics.iter().flat_map(|h| &h[band.clone()]).any(|&x| x != 0.0)
        };
        let mut degree = self.degree;
        while degree > 0 && !is_used(degree) {
            degree -= 1;
        }
        self.truncate_harmonics(degree);
    }

    /// Cuts harmonics above `degree` and remembers the degree that they came with.
    pub fn cut_degree(&mut self, degree: u8) {
        if degree < self.degree {
            self.cut_from.get_or_insert(self.degree);
            self.truncate_harmonics(degree);
        }
    }

    /// Turns everything half around the x axis: from y down and z forward, as most captures have them, to y up and
    /// z back, and the other way.
    pub fn half_turn(&mut self) {
        for g in &mut self.gaussians {
            let ([x, y, z], [w, i, j, k]) = (g.position, g.rotation);
            g.position = [x, -y, -z];
            // Its own axes are turned, too, which changes no covariance.
            g.rotation = [w, i, -j, -k];
        }
        for coefficients in &mut self.harmonics {
            let bands = coefficients.as_chunks_mut::<3>().0.iter_mut().zip(TURNED);
            bands.filter(|(_, turned)| *turned).for_each(|(c, _)| *c = c.map(|x| -x));
        }
    }

    fn truncate_harmonics(&mut self, degree: u8) {
        self.degree = degree;
        if degree == 0 {
            self.harmonics = Vec::new();
        }
        self.harmonics.iter_mut().for_each(|h| h.truncate(Self::harmonics_len(degree)));
    }
}

/// Whether the format can hold all numbers of a Gaussian.
fn is_tame(splat: &Splat<'_>) -> bool {
    splat.position.iter().all(|x| x.abs() <= GREATEST_POSITION)
        && splat.rotation.iter().all(|x| x.is_finite())
        && splat.log2_scale.iter().all(|&s| s <= GREATEST_LOG2_SCALE)
        && splat.color.iter().all(|x| x.abs() <= GREATEST_COLOR)
        && splat.harmonics.iter().all(|x| f64::from(x.abs()) <= GREATEST_COLOR)
        && splat.opacity.is_finite()
}

/// A quaternion of length 1; the identity for zero, as 3D Gaussian Splatting's kernels take it.
fn unit(q: [f64; 4]) -> [f64; 4] {
    // Of numbers that neither overflow nor underflow when they are squared.
    let greatest = q.iter().fold(0.0f64, |greatest, x| greatest.max(x.abs()));
    if greatest == 0.0 {
        return [1.0, 0.0, 0.0, 0.0];
    }
    let q = q.map(|x| x / greatest);
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    q.map(|x| x / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn splat() -> Splat<'static> {
        Splat {
            position: [0.0; 3],
            rotation: [1.0, 0.0, 0.0, 0.0],
            log2_scale: [-5.0; 3],
            color: [0.5; 3],
            opacity: 0.5,
            harmonics: &[],
        }
    }

    fn pushed(splat: &Splat<'_>) -> (Vec<Full>, LeftOut) {
        let (mut splats, mut left_out) = (Splats::default(), LeftOut::default());
        splats.push(splat, &mut left_out);
        (splats.gaussians, left_out)
    }

    #[test]
    fn quaternions_get_length_1() {
        let of = |rotation| pushed(&Splat { rotation, ..splat() }).0[0].rotation;
        assert_eq!(of([0.0; 4]), [1.0, 0.0, 0.0, 0.0]);
        assert_eq!(of([0.0, -7.0, 0.0, 0.0]), [0.0, -1.0, 0.0, 0.0]);
        assert_eq!(of([1e300, 1e300, 0.0, 0.0]), of([1e-300, 1e-300, 0.0, 0.0]));
        assert!((of([1.0; 4])[3] - 0.5).abs() < 1e-6);
    }

    #[test]
    fn flat_axes_are_thin_and_points_are_small() {
        let flat = f64::NEG_INFINITY;
        let of = |log2_scale| pushed(&Splat { log2_scale, ..splat() }).0[0].log2_scale;
        assert_eq!(of([-3.0, -4.0, -5.0]), [-3.0, -4.0, -5.0]);
        assert_eq!(of([-3.0, flat, -40.0]), [-3.0, -13.0, -13.0]);
        assert_eq!(of([flat; 3]), [-20.0; 3]);
    }

    #[test]
    fn what_is_never_drawn_is_left_out() {
        let faint = |opacity| pushed(&Splat { opacity, ..splat() }).1.faint;
        assert_eq!([0.0, 1.0 / 255.0, 1.49 / 255.0, 1.51 / 255.0, 1.0].map(faint), [1, 1, 1, 0, 0]);
        let nan = f64::NAN;
        for wild in [
            Splat { position: [0.0, nan, 0.0], ..splat() },
            Splat { position: [1e10, 0.0, 0.0], ..splat() },
            Splat { rotation: [f64::INFINITY, 0.0, 0.0, 0.0], ..splat() },
            Splat { log2_scale: [nan, 0.0, 0.0], ..splat() },
            Splat { log2_scale: [31.0, 0.0, 0.0], ..splat() },
            Splat { color: [nan, 0.0, 0.0], ..splat() },
            Splat { color: [0.0, 0.0, -1e9], ..splat() },
            Splat { opacity: nan, ..splat() },
            Splat { harmonics: &[f32::NAN], ..splat() },
            Splat { harmonics: &[f32::INFINITY], ..splat() },
        ] {
            assert_eq!(pushed(&wild), (vec![], LeftOut { faint: 0, wild: 1 }), "{wild:?}");
        }
    }

    #[test]
    fn degrees_that_hold_nothing_are_dropped() {
        let of = |coefficients: &[f32]| {
            let mut splats = Splats { degree: 2, ..Splats::default() };
            let harmonics = &[vec![0.0; 24 - coefficients.len()], coefficients.to_vec()].concat();
            splats.push(&Splat { harmonics, ..splat() }, &mut LeftOut::default());
            splats.lower_degree();
            assert_eq!(splats.cut_from, None, "nothing is lost");
            (splats.degree, splats.harmonics.first().map_or(0, Vec::len))
        };
        assert_eq!(of(&[]), (0, 0));
        assert_eq!(of(&[0.1]), (2, 24));
        assert_eq!(of(&[&[0.1f32][..], &[0.0; 15]].concat()), (1, 9));
    }

    #[test]
    fn a_cut_is_remembered() {
        let mut splats = Splats { degree: 2, ..Splats::default() };
        splats.push(&Splat { harmonics: &[0.5; 24], ..splat() }, &mut LeftOut::default());
        splats.cut_degree(3);
        assert_eq!((splats.degree, splats.cut_from), (2, None));
        splats.cut_degree(1);
        assert_eq!((splats.degree, splats.cut_from, splats.harmonics[0].len()), (1, Some(2), 9));
        splats.cut_degree(0);
        assert_eq!((splats.degree, splats.cut_from, splats.harmonics.len()), (0, Some(2), 0));
    }
}
