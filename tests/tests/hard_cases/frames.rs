//! Frames of all shapes, views of nothing, and budgets, on the figure of the conformance set.

use dermis_conformance::{File, cameras};

use crate::case::{Case, check};

fn figure(name: &'static str, view: cameras::View, size: [u32; 2]) -> Case {
    Case::new(name, File::Figure.bytes().to_vec(), view.camera(size))
}

#[test]
fn sizes() {
    let of = |name, size| figure(name, cameras::FRONT, size);
    // It is 1.7 m tall; the frame's greater side sees 1.9 m.
    check([
        // Each Gaussian is so small that the compensated low-pass leaves less than 1/255 of it.
        of("1 × 1", [1, 1]),
        figure("1 × 1, the face all over it", cameras::NEAR, [1, 1]).shows(130, 1),
        of("1 × 4096", [1, 4096]).shows(345, 2799),
        of("4096 × 1", [4096, 1]).shows(135, 1539),
        of("2 × 3", [2, 3]).shows(8, 5),
        of("31 × 33", [31, 33]).shows(2162, 347),
        of("32 × 32", [32, 32]).shows(2159, 317),
        of("97 × 75", [97, 75]).shows(1997, 1961),
    ]);
}

#[test]
fn everything_off_screen() {
    let moved = |name, row: usize, by: f32| {
        let mut view = cameras::FRONT;
        view.world_to_camera[row][3] += by;
        figure(name, view, [64, 64])
    };
    check([
        moved("to the right", 0, 5.0),
        moved("to the left", 0, -5.0),
        moved("below", 1, 5.0),
        moved("above", 1, -5.0),
        moved("behind the camera", 2, -5.0),
        moved("so far away that it is a thousandth of a pixel", 2, 1e5),
        figure("looking away", cameras::AWAY, [64, 64]),
    ]);
}

/// Both sides of the ribbon are seen, so that all that is selected is visible.
#[test]
fn budgets() {
    let camera = cameras::RIBBON.camera([64, 64]);
    let of =
        |name, budget| Case::new(name, File::Ribbon.bytes().to_vec(), camera).with_budget(budget);
    check([
        of("budget 0", 0),
        of("budget 1", 1).shows(1, 3292),
        of("budget 2", 2).shows(2, 3305),
        of("budget 479", 479).shows(479, 919),
        of("budget 480: all", 480).shows(480, 918),
        of("budget u32::MAX: all", u32::MAX).shows(480, 918),
    ]);
}

/// The figure is one-sided: from inside it nothing looks back.
#[test]
fn views_from_within() {
    check([
        figure("from inside the figure", cameras::INSIDE, [64, 64]),
        figure("its nose in the lens", cameras::NEAR, [64, 64]).shows(457, 4090),
    ]);
}
