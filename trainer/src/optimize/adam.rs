//! Adam (Kingma & Ba 2015) with a rate for each kind of parameter.

use serde::{Deserialize, Serialize};

use super::cloud::{PARAMETERS, Parameters};

const BETA1: f32 = 0.9;
const BETA2: f32 = 0.99;
/// Relative to the scale of gradients per pixel, which is about 1e-6.
const EPSILON: f32 = 1e-15;

/// Moments of one Gaussian's gradient.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Moments {
    first: [f32; PARAMETERS],
    second: [f32; PARAMETERS],
    /// β₁ᵗ and β₂ᵗ after t steps of this Gaussian: it moves only when it is drawn.
    decay: [f32; 2],
}

impl Default for Moments {
    fn default() -> Self {
        Self { first: [0.0; PARAMETERS], second: [0.0; PARAMETERS], decay: [1.0; 2] }
    }
}

/// Step lengths, in the unit of each parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// In standard deviations of the Gaussian.
    pub position: f32,
    /// Radians.
    pub angle: f32,
    /// log₂.
    pub log2_scale: f32,
    /// Logit.
    pub logit: f32,
    /// sRGB.
    pub color: f32,
    /// By which z goes to 0 beside its step, in standard deviations of the Gaussian.
    pub flatten_step: f32,
}

impl Rates {
    /// All rates times `factor`.
    pub fn times(self, factor: f32) -> Self {
        Self {
            position: self.position * factor,
            angle: self.angle * factor,
            log2_scale: self.log2_scale * factor,
            logit: self.logit * factor,
            color: self.color * factor,
            flatten_step: self.flatten_step * factor,
        }
    }

    /// Per parameter of a Gaussian whose standard deviation is `sigma`.
    #[inline(always)]
    fn array(&self, sigma: f32) -> [f32; PARAMETERS] {
        Parameters {
            position: [self.position * sigma; 3],
            angle: self.angle,
            log2_scale: [self.log2_scale; 2],
            logit: self.logit,
            color: [self.color; 3],
        }
        .to_array()
    }
}

impl Moments {
    /// Mean square of the gradient of late, `None` before the first step.
    pub fn mean_square(&self) -> Option<[f32; PARAMETERS]> {
        let rest = 1.0 - self.decay[1];
        (rest > 0.0).then(|| self.second.map(|second| second / rest))
    }

    /// One step of one Gaussian. `sigma` scales the steps of its position.
    #[inline(always)]
    pub fn step(
        &mut self,
        parameters: &mut Parameters,
        gradient: &[f32; PARAMETERS],
        rates: &Rates,
        sigma: f32,
    ) {
        let mut values = parameters.to_array();
        let Self { first, second, decay } = self;
        descend(
            &mut values,
            gradient,
            #[inline(always)]
            |factor| rates.times(factor).array(sigma),
            [first, second],
            decay,
        );
        *parameters = Parameters::from_array(values);
    }
}

/// A step of numbers whose gradient has the moments `first` and `second`; `decay` are β₁ᵗ and β₂ᵗ. `rates`
/// gives the step lengths, times a factor.
#[inline(always)]
pub(super) fn descend<const N: usize>(
    values: &mut [f32; N],
    gradient: &[f32; N],
    rates: impl FnOnce(f32) -> [f32; N],
    [first, second]: [&mut [f32; N]; 2],
    decay: &mut [f32; 2],
) {
    *decay = [decay[0] * BETA1, decay[1] * BETA2];
    // Roots are exact by IEEE 754; libm's would be scalar, and of an older encoding that AVX waits for.
    // Of rate · (m / (1 − β₁ᵗ)) / (√(v / (1 − β₂ᵗ)) + ε), what all parameters share.
    let root = (1.0 - decay[1]).sqrt();
    let (rates, epsilon) = (rates(root / (1.0 - decay[0])), EPSILON * root);
    for i in 0..N {
        let g = gradient[i];
        first[i] = BETA1 * first[i] + (1.0 - BETA1) * g;
        second[i] = BETA2 * second[i] + (1.0 - BETA2) * g * g;
        values[i] -= rates[i] * first[i] / (second[i].sqrt() + epsilon);
    }
}
