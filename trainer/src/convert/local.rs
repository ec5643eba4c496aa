//! From world axes into the frame of a triangle.

use dermis_format::Full;
use dermis_runtime::frame::Frame;
use glam::{DMat3, DQuat, DVec3};

/// Axes whose cosine is below this are orthogonal.
const ORTHOGONAL: f64 = 1e-15;

/// More sweeps than three axes ever need.
const MOST_SWEEPS: usize = 30;

/// A Gaussian in world axes, metres, as it stands in `frame`: Σ = F Σ' Fᵀ where F are the frame's axes,
/// which need not be orthogonal.
pub(super) fn local(gaussian: &Full, frame: &Frame<f64>) -> Full {
    let axes = DMat3::from_cols(frame.x.into(), frame.y.into(), frame.z.into());
    let inverse = axes.inverse();
    let [w, x, y, z] = gaussian.rotation.map(f64::from);
    let rotation = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
    let sigma = gaussian.log2_scale.map(|s| libm::exp2(f64::from(s)));
    // Of the frame's unit, columns.
    let (turned, sigma) = principal_axes(inverse * rotation * DMat3::from_diagonal(sigma.into()));
    let offset = DVec3::from(gaussian.position.map(f64::from)) - DVec3::from(frame.origin);
    let DQuat { w, x, y, z } = DQuat::from_mat3(&turned).normalize();
    Full {
        position: (inverse * offset).as_vec3().to_array(),
        rotation: [w, x, y, z].map(|x| x as f32),
        log2_scale: sigma.map(|s| libm::log2(s) as f32),
        ..*gaussian
    }
}

/// A rotation R and lengths s with R diag(s²) Rᵀ = A Aᵀ: one-sided Jacobi, which turns the columns of A
/// against each other until they are orthogonal. No column of `a` is zero.
pub(super) fn principal_axes(a: DMat3) -> (DMat3, [f64; 3]) {
    let mut columns = [a.x_axis, a.y_axis, a.z_axis];
    for _ in 0..MOST_SWEEPS {
        let mut turned = false;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (u, v) = (columns[p], columns[q]);
            let (uu, vv, uv) = (u.length_squared(), v.length_squared(), u.dot(v));
            if uv.abs() <= ORTHOGONAL * (uu * vv).sqrt() {
                continue;
            }
            turned = true;
            let ratio = (vv - uu) / (2.0 * uv);
            let tangent = ratio.signum() / (ratio.abs() + (1.0 + ratio * ratio).sqrt());
            let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
            let sine = cosine * tangent;
            columns[p] = cosine * u - sine * v;
            columns[q] = sine * u + cosine * v;
        }
        if !turned {
            break;
        }
    }
    let lengths = columns.map(DVec3::length);
    let [x, y] = [0, 1].map(|i| columns[i] / lengths[i]);
    // A Gaussian is the same with an axis reversed.
    (DMat3::from_cols(x, y, x.cross(y).normalize()), lengths)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimize::schedule::Random;
    use dermis_format::FrameKind;

    /// Σ of a Gaussian that stands in a frame.
    fn covariance(gaussian: &Full, frame: &Frame<f64>) -> DMat3 {
        let axes = DMat3::from_cols(frame.x.into(), frame.y.into(), frame.z.into());
        let [w, x, y, z] = gaussian.rotation.map(f64::from);
        let sigma = gaussian.log2_scale.map(|s| f64::from(s).exp2());
        let own = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w));
        let root = axes * own * DMat3::from_diagonal(sigma.into());
        root * root.transpose()
    }

    #[test]
    fn place_and_covariance_stay_in_every_frame() {
        let mut random = Random::new(11);
        let mut number = || 2.0 * random.unit() - 1.0;
        for thin in [1.0, 0.1, 0.01] {
            for kind in [FrameKind::Area, FrameKind::Affine, FrameKind::Edge] {
                let corners = [[0.0, 0.1, 0.2], [1.0, 0.3, 0.1], [0.4, 0.2 + thin, 0.3 * thin]];
                let frame = Frame::of_triangle(kind, corners).expect("it has an area");
                for _ in 0..50 {
                    let rotation = [(); 4].map(|()| number());
                    let length = rotation.iter().map(|x| x * x).sum::<f32>().sqrt();
                    let gaussian = Full {
                        position: [(); 3].map(|()| number()),
                        rotation: rotation.map(|x| x / length),
                        log2_scale: [(); 3].map(|()| -5.0 + 5.0 * number()),
                        color: [0.5; 3],
                        opacity: 1.0,
                    };
                    let local = local(&gaussian, &frame);
                    let place = frame.point(local.position.map(f64::from));
                    for (a, b) in place.into_iter().zip(gaussian.position) {
                        assert!((a - f64::from(b)).abs() < 1e-5, "{kind:?} {thin}");
                    }
                    let (a, b) =
                        (covariance(&gaussian, &Frame::world()), covariance(&local, &frame));
                    let greatest = a.to_cols_array().into_iter().fold(0.0, f64::max);
                    assert!(a.abs_diff_eq(b, 1e-4 * greatest), "{kind:?} {thin}: {a} {b}");
                    assert_eq!((local.color, local.opacity), ([0.5; 3], 1.0));
                }
            }
        }
    }
}
