//! Projection: a Gaussian in the world becomes a splat on the screen (EWA, as 3D Gaussian Splatting).

use bytemuck::{Pod, Zeroable};
use dermis_format::LowPass;

use crate::camera::Camera;
use crate::gaussian::Ellipsoid;
use crate::math::{Real, Scalar, dot, each};

/// Gaussians whose centre is nearer than this are not drawn, metres.
pub const NEAR: f32 = 0.01;
/// The Jacobian is taken no further out than this many times the half width of the view.
pub const JACOBIAN_LIMIT: f32 = 1.3;
/// log₂ of the least alpha that touches a pixel, 1/255.
pub const LEAST_LOG2_ALPHA: f32 = -7.994_353;
/// log₂(e) / 2: a Gaussian's exponent −q/2 in powers of two.
pub const HALF_LOG2_E: f32 = 0.721_347_5;

/// A camera in the numbers that projection needs.
#[derive(Clone, Copy, Debug)]
pub struct View<R> {
    /// Rows of world → camera.
    rows: [[R; 4]; 3],
    /// Centre of projection, world axes.
    pub eye: [R; 3],
    focal: [R; 2],
    center: [R; 2],
    /// Greatest |x / z| and |y / z| of the Jacobian.
    limit: [R; 2],
    /// Width and height, px.
    size: [R; 2],
}

impl<R: Scalar> View<R> {
    /// Of a camera.
    pub fn new(camera: &Camera) -> Self {
        let half = |pixels: u32, focal: f32| {
            R::of(JACOBIAN_LIMIT) * R::of(pixels as f32) / (R::of(2.0) * R::of(focal).abs())
        };
        Self {
            rows: camera.world_to_camera.map(|row| row.map(R::of)),
            eye: camera.position(),
            focal: [R::of(camera.fx), R::of(camera.fy)],
            center: [R::of(camera.cx), R::of(camera.cy)],
            limit: [half(camera.width, camera.fx), half(camera.height, camera.fy)],
            size: [R::of(camera.width as f32), R::of(camera.height as f32)],
        }
    }
}

impl<R: Real> View<R> {
    /// The same camera in other numbers.
    #[inline(always)]
    pub fn map<T: Copy>(&self, to: impl Fn(R) -> T) -> View<T> {
        View {
            rows: each(
                self.rows,
                #[inline(always)]
                |row| each(row, &to),
            ),
            eye: each(self.eye, &to),
            focal: each(self.focal, &to),
            center: each(self.center, &to),
            limit: each(self.limit, &to),
            size: each(self.size, &to),
        }
    }

    /// A world point in camera axes.
    #[inline(always)]
    pub fn point(&self, p: [R; 3]) -> [R; 3] {
        each(
            self.rows,
            #[inline(always)]
            |[x, y, z, t]| dot([x, y, z], p) + t,
        )
    }

    /// A world direction in camera axes.
    #[inline(always)]
    pub fn direction(&self, d: [R; 3]) -> [R; 3] {
        each(
            self.rows,
            #[inline(always)]
            |[x, y, z, _]| dot([x, y, z], d),
        )
    }

    /// Rows of world → camera.
    pub fn rows(&self) -> &[[R; 4]; 3] {
        &self.rows
    }

    /// Focal lengths, px.
    pub fn focal(&self) -> [R; 2] {
        self.focal
    }

    /// Principal point, px.
    pub(crate) fn center(&self) -> [R; 2] {
        self.center
    }

    /// Greatest |x / z| and |y / z| of the Jacobian.
    pub(crate) fn limit(&self) -> [R; 2] {
        self.limit
    }

    /// Width and height, px.
    pub(crate) fn size(&self) -> [R; 2] {
        self.size
    }

    /// Slopes x/z and y/z at which the Jacobian is taken: no further out than
    /// [`JACOBIAN_LIMIT`] times the half width of the view.
    #[inline(always)]
    pub fn slopes(&self, [x, y, z]: [R; 3]) -> [R; 2] {
        let [u, v] = self.limit;
        [(x / z).at_most(u).at_least(-u), (y / z).at_most(v).at_least(-v)]
    }
}

/// A splat before it is packed: screen space, px.
#[derive(Clone, Copy, Debug)]
pub struct Projected<R> {
    /// Centre, px.
    pub mean: [R; 2],
    /// Variances xx, xy, yy after the low-pass, px².
    pub covariance: [R; 3],
    /// a, b, c of the exponent (a dx + b dy)² + (c dy)² = q/2 · log₂ e at (dx, dy) px from the centre:
    /// the Cholesky factor of the inverse of `covariance`, scaled, px⁻¹.
    pub falloff: [R; 3],
    /// What the low-pass leaves of opacity: √(det Σ / det(Σ + h I)), or 1 (classic).
    pub compensation: R,
    /// z of the centre in camera axes, metres.
    pub depth: R,
}

/// Σ = Σᵢ bᵢ bᵢᵀ of projected axes, px², before the low-pass.
#[derive(Clone, Copy, Debug)]
pub struct OnPlane<R> {
    /// Variance to the right.
    pub xx: R,
    /// Covariance.
    pub xy: R,
    /// Variance downwards.
    pub yy: R,
    /// det Σ = Σ (bᵢ × bⱼ)² over pairs, which no cancellation makes negative.
    pub det: R,
}

/// The covariance that projected axes span.
#[inline(always)]
pub fn covariance_on_plane<R: Real, const N: usize>(axes: &[[R; 2]; N], zero: R) -> OnPlane<R> {
    let (mut xx, mut xy, mut yy, mut det) = (zero, zero, zero, zero);
    for (i, &[u, v]) in axes.iter().enumerate() {
        xx = xx + u * u;
        xy = xy + u * v;
        yy = yy + v * v;
        for &[s, t] in axes.iter().take(i) {
            let area = u * t - v * s;
            det = det + area * area;
        }
    }
    OnPlane { xx, xy, yy, det }
}

/// Projects Gaussians, and says which can be drawn: not those whose centre is nearer than
/// [`NEAR`], nor where a number is not finite.
///
/// With bᵢ = J W aᵢ (2-vectors) Σ' = Σ bᵢbᵢᵀ and, by Cauchy and Binet, det Σ' = Σ (bᵢ × bⱼ)² over
/// pairs, a sum of squares: no cancellation, however thin the Gaussian. So is
/// det(Σ' + h I) = det Σ' + h tr Σ' + h². The quadratic form is kept as a sum of two squares for the
/// same reason: far from the centre of a long needle the terms of a dx² + b dx dy + c dy² are
/// millions and cancel.
#[inline(always)]
pub fn project<R: Real, const N: usize>(
    view: &View<R>,
    low_pass: LowPass,
    gaussian: &Ellipsoid<R, N>,
) -> (Projected<R>, R::Mask) {
    let p @ [x, y, z] = view.point(gaussian.center);
    let (zero, one) = (z.like(0.0), z.like(1.0));
    let [sx, sy] = view.slopes(p);
    let (jx, jy) = (view.focal[0] / z, view.focal[1] / z);
    let b: [[R; 2]; N] = each(
        gaussian.axes,
        #[inline(always)]
        |axis| {
            let [ax, ay, az] = view.direction(axis);
            [jx * (ax - sx * az), jy * (ay - sy * az)]
        },
    );
    let OnPlane { xx, xy, yy, det } = covariance_on_plane(&b, zero);
    let h = z.like(low_pass.variance());
    let filtered = det + h * (xx + yy) + h * h;
    let compensation = match low_pass {
        LowPass::Compensated | LowPass::Pixel => (det / filtered).sqrt(),
        LowPass::Classic => one,
    };
    let inverse = one / filtered;
    let (xx, yy) = (xx + h, yy + h);
    let half_log2_e = z.like(HALF_LOG2_E);
    let a = (half_log2_e * yy * inverse).sqrt();
    let mean = [view.focal[0] * (x / z) + view.center[0], view.focal[1] * (y / z) + view.center[1]];
    let sum = mean[0] + mean[1] + xx + yy + filtered + z;
    let drawable = z.reaches(z.like(NEAR)) & sum.finite() & zero.below(inverse);
    let projected = Projected {
        mean,
        covariance: [xx, xy, yy],
        falloff: [a, -(a * (xy / yy)), (half_log2_e / yy).sqrt()],
        compensation,
        depth: z,
    };
    (projected, drawable)
}

/// Where projected Gaussians are seen.
#[derive(Clone, Copy, Debug)]
pub struct Footprint<R> {
    /// log₂ of opacity after compensation.
    pub log2_opacity: R,
    /// First column and row of the pixels that may be touched, then one past the last ones.
    pub bounds: [R; 4],
}

/// Which pixels projected Gaussians may touch, and which of them touch any.
#[inline(always)]
pub fn footprint<R: Real>(view: &View<R>, p: &Projected<R>, opacity: R) -> (Footprint<R>, R::Mask) {
    let constant = |x: f32| opacity.like(x);
    let zero = constant(0.0);
    let log2_opacity = (opacity * p.compensation).log2();
    let reach = log2_opacity - constant(LEAST_LOG2_ALPHA);
    // α ≥ 1/255 where q/2 · log₂ e ≤ reach. A little more, so that rounding loses no pixel.
    let radius2 = reach * constant(1.0 / HALF_LOG2_E);
    let [x0, x1] = pixels(p.mean[0], radius2 * p.covariance[0], view.size[0]);
    let [y0, y1] = pixels(p.mean[1], radius2 * p.covariance[2], view.size[1]);
    let touches = reach.reaches(zero) & x0.below(x1) & y0.below(y1);
    (Footprint { log2_opacity, bounds: [x0, y0, x1, y1] }, touches)
}

/// First pixel whose centre is within √`square` of `mean`, and one past the last, within 0..=len.
#[inline(always)]
fn pixels<R: Real>(mean: R, square: R, len: R) -> [R; 2] {
    let zero = len.like(0.0);
    let reach = square.sqrt() * len.like(1.0001) + len.like(0.01);
    // Edges of the reach, rounded: a pixel's centre is half a pixel from its own edges.
    let edge = |edge: R| edge.at_least(zero).at_most(len).nearest();
    [edge(mean - reach), edge(mean + reach)]
}

/// What the rasterizer blends. A pixel at distance (dx, dy) px from `mean` gets alpha
/// 2^(log2_opacity − (a dx + b dy)² − (c dy)²).
///
/// Three rows of four words: [`screen`](crate::screen) writes them so.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Splat {
    /// Centre, px.
    pub mean: [f32; 2],
    /// a, b, c: see [`Projected::falloff`], px⁻¹.
    pub falloff: [f32; 3],
    /// log₂ of opacity after compensation; at least [`LEAST_LOG2_ALPHA`], may reach 0.
    pub log2_opacity: f32,
    /// Display-referred sRGB, not below 0.
    pub color: [f32; 3],
    /// z in camera axes, metres; above 0.
    pub depth: f32,
    /// Pixels that it may touch: first column and row, then one past the last ones.
    pub bounds: [u16; 4],
}

impl Splat {
    /// Packs a projected Gaussian; `None` if it touches no pixel.
    pub fn pack(
        view: &View<f32>,
        p: &Projected<f32>,
        opacity: f32,
        color: [f32; 3],
    ) -> Option<Self> {
        let (footprint, touches) = footprint(view, p, opacity);
        touches.then_some(Self {
            mean: p.mean,
            falloff: p.falloff,
            log2_opacity: footprint.log2_opacity,
            color,
            depth: p.depth,
            bounds: footprint.bounds.map(|edge| edge as i32 as u16),
        })
    }
}
