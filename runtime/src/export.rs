//! Posed Gaussians for the caller's own renderer, in place of pixels.

use bytemuck::{Pod, Zeroable};
use dermis_format::FrameKind;

use crate::error::{Buffer, Error};
use crate::frame::Frame;
use crate::gaussian::{Ellipsoid, disc_on, full_on};
use crate::math::{Real, add, dot, scale, sub};
use crate::plan::Plan;
use crate::posed::Posed;
use crate::select::{Harmonics, Local, Place, for_each_block, for_each_of_block};

/// A Gaussian in the world: 64 bytes, 16 numbers (f32), of which every 4 make a vector of a GPU.
///
/// | bytes | what |
/// |---|---|
/// | 0..12 | centre |
/// | 12..16 | opacity |
/// | 16..28, 28..32 | first axis, red |
/// | 32..44, 44..48 | second axis, green |
/// | 48..60, 60..64 | third axis, blue |
///
/// That is the layout of this structure in a storage buffer, in WGSL and in GLSL's std430:
///
/// ```text
/// struct PosedGaussian {
///     center: vec3<f32>, opacity: f32,
///     axis_0: vec3<f32>, red: f32,
///     axis_1: vec3<f32>, green: f32,
///     axis_2: vec3<f32>, blue: f32,
/// }
/// ```
///
/// GPUs align it to 16 bytes, this crate to 4: any slice of f32 can be cast to a slice of it.
///
/// The covariance is Σ = a₀a₀ᵀ + a₁a₁ᵀ + a₂a₂ᵀ, and after a linear map M (Jacobian times view) that of
/// M aᵢ: cheaper than M Σ Mᵀ, and nothing cancels, however thin the Gaussian.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PosedGaussian {
    /// World, metres.
    pub center: [f32; 3],
    /// Its greatest alpha at the plan's level, in [0, 1], before the camera's low-pass: see
    /// [`LowPass`](dermis_format::LowPass) in the avatar's header.
    pub opacity: f32,
    /// World, metres. The three axes are orthogonal, their lengths are the standard deviations.
    pub axis_0: [f32; 3],
    /// Red seen from the eye, display-referred sRGB, not below 0.
    pub red: f32,
    /// World, metres.
    pub axis_1: [f32; 3],
    /// Green.
    pub green: f32,
    /// World, metres; 0 for flat discs.
    pub axis_2: [f32; 3],
    /// Blue.
    pub blue: f32,
}

/// Which sides of the mesh are exported. Where there is no mesh they are one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// What a picture from the eye shows: triangles whose front looks there, or whose back is shown, too.
    Seen,
    /// All of it, for several cameras.
    All,
}

impl PosedGaussian {
    /// xx, xy, xz, yy, yz, zz of Σ, square metres.
    pub fn covariance(&self) -> [f32; 6] {
        let [a, b, c] = [self.axis_0, self.axis_1, self.axis_2];
        let sum = |i: usize, j: usize| a[i] * a[j] + b[i] * b[j] + c[i] * c[j];
        [sum(0, 0), sum(0, 1), sum(0, 2), sum(1, 1), sum(1, 2), sum(2, 2)]
    }

    /// `None` if a number is not finite.
    fn new<const N: usize>(
        ellipsoid: &Ellipsoid<f32, N>,
        opacity: f32,
        constant: [f32; 3],
        harmonics: &Harmonics<'_>,
        eye: [f32; 3],
    ) -> Option<Self> {
        let [red, green, blue] = harmonics.seen(constant, ellipsoid.center, eye);
        let mut axes = [[0.0; 3]; 3];
        axes.iter_mut().zip(ellipsoid.axes).for_each(|(axis, of)| *axis = of);
        let [axis_0, axis_1, axis_2] = axes;
        let center = ellipsoid.center;
        // Ranges reach a little beyond what they hold; drawing lets no alpha pass 0.99.
        let opacity = opacity.at_most(1.0);
        let posed = Self { center, opacity, axis_0, red, axis_1, green, axis_2, blue };
        let numbers: &[f32] = bytemuck::cast_ref::<Self, [f32; 16]>(&posed);
        numbers.iter().all(|number| number.is_finite()).then_some(posed)
    }
}

impl Posed<'_, '_> {
    /// Writes the Gaussians of `plan` to the front of `to`, in the order of the file, and returns how
    /// many. `eye`, world, metres, is where colours are seen from, and sides.
    ///
    /// `to` must have room for the whole plan, though fewer may be written: not those on triangles
    /// that `sides` leaves out or that have no frame, of an opacity under
    /// [`LEAST_OPACITY`](crate::select::LEAST_OPACITY), or with a number that is not finite. What
    /// stands behind them stays. Takes no scratch.
    pub fn export(
        &self,
        plan: &Plan,
        eye: [f32; 3],
        sides: Sides,
        to: &mut [PosedGaussian],
    ) -> Result<usize, Error> {
        plan.check(self.avatar())?;
        self.check(plan)?;
        let (needed, lent) = (plan.gaussians() as usize, to.len());
        if lent < needed {
            return Err(Error::Buffer { buffer: Buffer::Gaussians, needed, lent });
        }
        let shows = |triangle| match sides {
            Sides::Seen => self.shows(triangle, eye),
            Sides::All => true,
        };
        let kind = self.avatar().header().frame;
        let mut written = 0;
        for_each_block(self.avatar(), plan, |block, region, drawn| {
            for_each_of_block(block, region, drawn, shows, |place| {
                let frame = place.triangle.map_or(Some(Frame::world()), |t| self.frame(t));
                if let Some(slot) = to.get_mut(written)
                    && let Some(frame) = frame
                    && let Some(gaussian) = pose(&place, kind, &frame, eye)
                {
                    *slot = gaussian;
                    written += 1;
                }
            });
        });
        Ok(written)
    }
}

/// Orthogonal axes of the same covariance, which a projection does not ask for, but renderers with a rotation and scales
/// do: one rotation of Jacobi's.
fn orthogonal([a, b]: [[f32; 3]; 2]) -> [[f32; 3]; 2] {
    let (aa, ab, bb) = (dot(a, a), dot(a, b), dot(b, b));
    // In parts of both, so that no square of these over- or underflows.
    let both = aa + bb;
    let (twice, difference) = (2.0 * ab / both, (bb - aa) / both);
    // Neither NaN nor what rounding leaves.
    if !(twice.abs() > f32::EPSILON) {
        return [a, b];
    }
    let root = Real::sqrt(difference * difference + twice * twice);
    let tangent = twice / (difference + root.copysign(difference));
    let cosine = 1.0 / Real::sqrt(1.0 + tangent * tangent);
    let sine = tangent * cosine;
    [sub(scale(a, cosine), scale(b, sine)), add(scale(a, sine), scale(b, cosine))]
}

/// A Gaussian of the file on the frame of its triangle.
fn pose(
    place: &Place<'_, '_>,
    kind: FrameKind,
    frame: &Frame<f32>,
    eye: [f32; 3],
) -> Option<PosedGaussian> {
    let selected = place.decode()?;
    match &selected.gaussian {
        Local::Disc(disc) => {
            let mut ellipsoid = disc_on(frame, disc.position, disc.angle, disc.log2_scale);
            if kind == FrameKind::Affine {
                ellipsoid.axes = orthogonal(ellipsoid.axes);
            }
            PosedGaussian::new(&ellipsoid, disc.opacity, disc.color, &selected.harmonics, eye)
        }
        Local::Full(full) => {
            let ellipsoid = full_on(frame, full.position, full.rotation, full.log2_scale);
            PosedGaussian::new(&ellipsoid, full.opacity, full.color, &selected.harmonics, eye)
        }
    }
}
