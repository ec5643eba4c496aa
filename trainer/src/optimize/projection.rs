//! From the gradient by a splat to the gradient by its Gaussian's parameters: the derivative of
//! `dermis_runtime::{gaussian::{disc_on, full_on}, project::project, project::Splat::pack}`.

use dermis_format::LowPass;
use dermis_runtime::frame::Frame;
use dermis_runtime::gaussian::{Ellipsoid, disc_on, full_on};
use dermis_runtime::math::{Real, add, cross, dot, each, rotation_rows, scale};
use dermis_runtime::project::{HALF_LOG2_E, OnPlane, View, covariance_on_plane};

/// Gradient by a splat's mean (2), falloff (3) and log₂ opacity.
#[derive(Clone, Copy, Debug)]
pub struct ByScreen<R> {
    /// By the mean, px.
    pub mean: [R; 2],
    /// By a, b, c of the falloff.
    pub falloff: [R; 3],
    /// By log₂ of the opacity after compensation.
    pub log2_opacity: R,
}

/// Gradient by a disc's geometry in its frame.
#[derive(Clone, Copy, Debug)]
pub struct ByDisc<R> {
    /// By the position.
    pub position: [R; 3],
    /// By the angle.
    pub angle: R,
    /// By log₂ of the scales.
    pub log2_scale: [R; 2],
}

/// Gradient by the geometry of a Gaussian with rotation and three scales in its frame.
#[derive(Clone, Copy, Debug)]
pub struct ByFull<R> {
    /// By the position.
    pub position: [R; 3],
    /// By a small rotation about the frame's axes after its own, radians.
    pub turn: [R; 3],
    /// By log₂ of the scales.
    pub log2_scale: [R; 3],
}

/// Takes the gradient of one splat to the disc it came from, which was at `position`, `angle`,
/// `log2_scale` in `frame`.
#[inline(always)]
pub fn by_disc<R: Real>(
    view: &View<R>,
    low_pass: LowPass,
    frame: &Frame<R>,
    (position, angle, log2_scale): ([R; 3], R, [R; 2]),
    by: &ByScreen<R>,
) -> ByDisc<R> {
    let disc = disc_on(frame, position, angle, log2_scale);
    let Ellipsoid { center: by_center, axes: by_axes } = by_ellipsoid(view, low_pass, &disc, by);
    let [sin, cos] = angle.line();
    let [first, second] = each(
        log2_scale,
        #[inline(always)]
        |scale: R| scale.exp2(),
    );
    let along = add(scale(frame.x, cos), scale(frame.y, sin));
    let across = add(scale(frame.x, -sin), scale(frame.y, cos));
    let ln2 = angle.like(core::f32::consts::LN_2);
    ByDisc {
        position: to_frame(frame, by_center),
        angle: first * dot(by_axes[0], across) - second * dot(by_axes[1], along),
        log2_scale: [ln2 * dot(by_axes[0], disc.axes[0]), ln2 * dot(by_axes[1], disc.axes[1])],
    }
}

/// The same for a Gaussian with rotation and three scales. An axis aᵢ = F lᵢ turns by F (ω × lᵢ), F being the frame's axes.
#[inline(always)]
pub fn by_full<R: Real>(
    view: &View<R>,
    low_pass: LowPass,
    frame: &Frame<R>,
    (position, rotation, log2_scale): ([R; 3], [R; 4], [R; 3]),
    by: &ByScreen<R>,
) -> ByFull<R> {
    let full = full_on(frame, position, rotation, log2_scale);
    let Ellipsoid { center: by_center, axes: by_axes } = by_ellipsoid(view, low_pass, &full, by);
    let zero = position[0].like(0.0);
    let ln2 = zero.like(core::f32::consts::LN_2);
    let rows = rotation_rows(rotation);
    let mut turn = [zero; 3];
    let mut by_scale = [zero; 3];
    for i in 0..3 {
        let own = scale([rows[0][i], rows[1][i], rows[2][i]], log2_scale[i].exp2());
        turn = add(turn, cross(own, to_frame(frame, by_axes[i])));
        by_scale[i] = ln2 * dot(by_axes[i], full.axes[i]);
    }
    ByFull { position: to_frame(frame, by_center), turn, log2_scale: by_scale }
}

/// The gradient by a Gaussian's centre and axes in the world.
#[inline(always)]
fn by_ellipsoid<R: Real, const N: usize>(
    view: &View<R>,
    low_pass: LowPass,
    gaussian: &Ellipsoid<R, N>,
    by: &ByScreen<R>,
) -> Ellipsoid<R, N> {
    let p @ [x, y, z] = view.point(gaussian.center);
    let zero = z.like(0.0);
    let slopes = [x / z, y / z];
    let [sx, sy] = view.slopes(p);
    let [fx, fy] = view.focal();
    let (jx, jy) = (fx / z, fy / z);
    let axes = each(
        gaussian.axes,
        #[inline(always)]
        |axis| view.direction(axis),
    );
    let b = each(
        axes,
        #[inline(always)]
        |[ax, ay, az]| [jx * (ax - sx * az), jy * (ay - sy * az)],
    );

    let by_b = by_screen_axes(b, low_pass, by);

    // bᵢ = (jx (ax − sx az), jy (ay − sy az)).
    let (mut by_jx, mut by_jy, mut by_sx, mut by_sy) = (zero, zero, zero, zero);
    let mut by_axes = [[zero; 3]; N];
    for (i, &[gu, gv]) in by_b.iter().enumerate() {
        let [ax, ay, az] = axes[i];
        by_axes[i] = [jx * gu, jy * gv, -(jx * sx * gu + jy * sy * gv)];
        by_jx = by_jx + gu * (ax - sx * az);
        by_jy = by_jy + gv * (ay - sy * az);
        by_sx = by_sx - gu * jx * az;
        by_sy = by_sy - gv * jy * az;
    }
    // mean = f (x / z) + c, j = f / z, s = x / z unless clamped.
    let [clamped_x, clamped_y] = [differ(sx, slopes[0]), differ(sy, slopes[1])];
    let by_slope_x = by.mean[0] * fx + R::select(clamped_x, zero, by_sx);
    let by_slope_y = by.mean[1] * fy + R::select(clamped_y, zero, by_sy);
    let by_z = -(by_jx * jx + by_jy * jy + by_slope_x * slopes[0] + by_slope_y * slopes[1]) / z;
    Ellipsoid {
        center: to_world(view, [by_slope_x / z, by_slope_y / z, by_z]),
        axes: each(
            by_axes,
            #[inline(always)]
            |g| to_world(view, g),
        ),
    }
}

/// By the projected axes bᵢ. With D = det Σ + h tr Σ + h², det Σ = Σ (bᵢ × bⱼ)² over pairs, κ = log₂e/2:
/// falloff a = √(κ yy / D), b = −a xy / yy, c = √(κ / yy), log₂ opacity = … + ½ log₂(det Σ / D).
#[inline(always)]
fn by_screen_axes<R: Real, const N: usize>(
    b: [[R; 2]; N],
    low_pass: LowPass,
    by: &ByScreen<R>,
) -> [[R; 2]; N] {
    let constant = |x: f32| by.log2_opacity.like(x);
    let (zero, h) = (constant(0.0), constant(low_pass.variance()));
    let OnPlane { xx, xy, yy, det } = covariance_on_plane(&b, zero);
    let filtered = det + h * (xx + yy) + h * h;
    let yy = yy + h;
    let (two, kappa) = (constant(2.0), constant(HALF_LOG2_E));
    let a = (kappa * yy / filtered).sqrt();
    let slope = -(xy / yy);
    let c = (kappa / yy).sqrt();
    let [by_a, by_b, by_c] = by.falloff;
    let by_a = by_a + by_b * slope;
    let by_xy = -(by_b * a / yy);
    let by_yy = (by_a * a - by_c * c) / (two * yy) - by_b * a * slope / yy;
    let mut by_filtered = -(by_a * a / (two * filtered));
    let mut by_det = zero;
    if low_pass != LowPass::Classic {
        let spans = zero.below(det);
        let per_ratio = by.log2_opacity * kappa;
        by_filtered = by_filtered - R::select(spans, per_ratio / filtered, zero);
        by_det = R::select(spans, per_ratio / det, zero);
    }
    let by_det = by_det + by_filtered;
    let by_trace = h * by_filtered;
    let mut by_axes = each(
        b,
        #[inline(always)]
        |[u, v]| [two * u * by_trace + v * by_xy, two * v * (by_yy + by_trace) + u * by_xy],
    );
    for (j, &[u, v]) in b.iter().enumerate() {
        for (i, &[s, t]) in b.iter().enumerate().take(j) {
            let by_area = two * (s * v - t * u) * by_det;
            by_axes[i] = [by_axes[i][0] + by_area * v, by_axes[i][1] - by_area * u];
            by_axes[j] = [by_axes[j][0] - by_area * t, by_axes[j][1] + by_area * s];
        }
    }
    by_axes
}

/// By what a frame takes to a world direction.
#[inline(always)]
fn to_frame<R: Real>(frame: &Frame<R>, by: [R; 3]) -> [R; 3] {
    [dot(by, frame.x), dot(by, frame.y), dot(by, frame.z)]
}

/// Where a ≠ b; not where either is NaN.
#[inline(always)]
fn differ<R: Real>(a: R, b: R) -> R::Mask {
    a.below(b) | b.below(a)
}

/// Transposed rotation: camera axes → world axes.
#[inline(always)]
fn to_world<R: Real>(view: &View<R>, [gx, gy, gz]: [R; 3]) -> [R; 3] {
    let [x, y, z] = view.rows();
    each(
        [0, 1, 2],
        #[inline(always)]
        |i: usize| x[i] * gx + y[i] * gy + z[i] * gz,
    )
}
