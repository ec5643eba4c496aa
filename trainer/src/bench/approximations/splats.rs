//! Splats and their lists, one after the other.

use dermis_runtime::batch::OnScreen;
use dermis_runtime::frame::Frame;
use dermis_runtime::lists::Pair;
use dermis_runtime::project::{Projected, Splat, View, footprint};
use dermis_runtime::screen::SplatCamera;
use dermis_runtime::select::{Harmonics, Local, Selected, for_each_block, for_each_of_block};
use dermis_runtime::tiles::TileGrid;
use dermis_runtime::{Camera, Plan, Posed};

use super::Source;
use super::libm::Number;

/// How much fainter than the runtime's least alpha, 2⁻⁸, is still drawn without its skip: 2⁻²⁴ is
/// half of what an f32 next to 1 can tell from it.
pub(super) const FAINTER_LOG2: f32 = 16.0;

/// Where Gaussians come from.
#[derive(Clone, Copy)]
pub(super) enum From<'s> {
    /// The plan's, of the posed avatar.
    File {
        /// Which.
        plan: &'s Plan,
        /// Whether those on triangles that face away are drawn.
        back_faces: bool,
    },
    /// All of the source.
    Source(&'s Source),
}

/// What turns Gaussians into splats.
struct Projector<N> {
    camera: SplatCamera<N>,
    /// Whether alphas under the runtime's least are drawn, too.
    faint: bool,
}

/// The splats of a frame, in the order of the file.
pub(super) fn splats<N: Number>(
    posed: &Posed<'_, '_>,
    camera: &Camera,
    from: From<'_>,
    faint: bool,
) -> Vec<Splat> {
    let view = View::<f32>::new(camera);
    let low_pass = posed.avatar().header().low_pass;
    let projector = Projector { camera: SplatCamera { view: view.map(N::of), low_pass }, faint };
    let mut splats = Vec::new();
    match from {
        From::Source(source) => {
            let (world, none) = (Frame::world(), Harmonics::default());
            let selected = source
                .gaussians
                .iter()
                .map(|&full| Selected { gaussian: Local::Full(full), harmonics: none });
            splats.extend(selected.filter_map(|selected| projector.splat(&selected, &world)));
        }
        From::File { plan, back_faces } => {
            let shows = |triangle| {
                // Where it has no frame nothing is drawn, either way.
                back_faces || posed.shows(triangle, view.eye)
            };
            for_each_block(posed.avatar(), plan, |block, region, drawn| {
                for_each_of_block(block, region, drawn, shows, |place| {
                    let frame = place.triangle.map_or(Some(Frame::world()), |t| posed.frame(t));
                    let known = place.decode().zip(frame);
                    splats.extend(
                        known.and_then(|(selected, frame)| projector.splat(&selected, &frame)),
                    );
                });
            });
        }
    }
    splats
}

impl<N: Number> Projector<N> {
    fn splat(&self, selected: &Selected<'_>, frame: &Frame<f32>) -> Option<Splat> {
        let OnScreen { projected, drawable, opacity, color } =
            self.camera.on_screen(selected, &frame_of(frame));
        let (footprint, touches) = footprint(&self.camera.view, &projected, opacity);
        let (bounds, touches) = if self.faint {
            self.reach(&projected, opacity.get())
        } else {
            (footprint.bounds, touches)
        };
        (drawable && touches).then(|| Splat {
            mean: projected.mean.map(N::get),
            falloff: projected.falloff.map(N::get),
            log2_opacity: footprint.log2_opacity.get(),
            color: color.map(N::get),
            depth: projected.depth.get(),
            bounds: bounds.map(|edge| edge.get() as u16),
        })
    }

    /// Pixels that get at least 2⁻²⁴: as many as a Gaussian 2¹⁶ times as opaque touches.
    fn reach(&self, projected: &Projected<N>, opacity: f32) -> ([N; 4], bool) {
        let opaque = N::of(opacity * ::libm::exp2f(FAINTER_LOG2));
        let (footprint, touches) = footprint(&self.camera.view, projected, opaque);
        (footprint.bounds, touches)
    }
}

fn frame_of<N: Number>(frame: &Frame<f32>) -> Frame<N> {
    let of = |axis: [f32; 3]| axis.map(N::of);
    Frame { x: of(frame.x), y: of(frame.y), z: of(frame.z), origin: of(frame.origin) }
}

/// The list of each tile, front to back, ties as they stand in the file.
pub(super) fn lists(camera: &Camera, splats: &[Splat]) -> Vec<Vec<Pair>> {
    let grid = TileGrid::new(camera.width, camera.height);
    let mut lists = vec![Vec::new(); grid.tiles()];
    for (splat, index) in splats.iter().zip(0..) {
        let pair = Pair { depth: splat.depth.to_bits(), splat: index };
        let [x0, y0, x1, y1] = splat.bounds.map(u32::from);
        grid.for_each_tile([x0, y0, x1, y1], |tile| lists[tile as usize].push(pair));
    }
    for list in &mut lists {
        list.sort_by_key(|pair| pair.depth);
    }
    lists
}
