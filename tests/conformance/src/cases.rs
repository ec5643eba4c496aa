//! What is drawn.

use dermis_runtime::Background;

use crate::avatars::File;
use crate::cameras::{self, View, broken};
use crate::poses::{Move, Stand, joints};

/// A frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// Its row of the table.
    pub name: &'static str,
    /// Who.
    pub avatar: File,
    /// How it stands.
    pub stand: Stand,
    /// How much of it is drawn.
    pub amount: Amount,
    /// From where.
    pub view: View,
    /// Width and height, px.
    pub size: [u32; 2],
    /// Pixels between the end of a row and the beginning of the next.
    pub padding: u32,
    /// Over what.
    pub background: Background,
}

/// How much of an avatar is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Amount {
    /// As many Gaussians.
    Budget(u32),
    /// Level λ of every region.
    Level(f32),
    /// As many Gaussians of each region.
    Counts(&'static [u32]),
}

const ALL: Amount = Amount::Budget(u32::MAX);
const WHITE: Background = Background::Color([1.0; 3]);

const FIGURE: Case = Case {
    name: "",
    avatar: File::Figure,
    stand: Stand::Rest,
    amount: ALL,
    view: cameras::FRONT,
    size: [96, 96],
    padding: 0,
    background: WHITE,
};
const LEVELED: Case = Case { avatar: File::Leveled, ..FIGURE };
const RIBBON: Case = Case {
    avatar: File::Ribbon,
    stand: Stand::Clip(0, 0.35),
    view: cameras::RIBBON,
    background: Background::Color([0.1, 0.1, 0.15]),
    ..FIGURE
};
const BALL: Case = Case { avatar: File::Ball, view: cameras::ORIGIN, ..FIGURE };
const LAYERED: Case = Case { avatar: File::Layered, ..BALL };

const fn seen(name: &'static str, view: View) -> Case {
    Case { name, view, ..FIGURE }
}

const fn standing(name: &'static str, stand: Stand) -> Case {
    Case { name, stand, ..FIGURE }
}

const fn moved(name: &'static str, movement: Move) -> Case {
    standing(name, Stand::Vertices(movement))
}

const fn ribbon(name: &'static str, stand: Stand) -> Case {
    Case { name, stand, ..RIBBON }
}

const fn leveled(name: &'static str, stand: Stand) -> Case {
    Case { name, stand, ..LEVELED }
}

const fn of(case: Case, name: &'static str, amount: Amount) -> Case {
    Case { name, amount, ..case }
}

const fn sized(name: &'static str, width: u32, height: u32, padding: u32) -> Case {
    Case { name, size: [width, height], padding, ..FIGURE }
}

const fn over(name: &'static str, background: Background) -> Case {
    Case { name, background, amount: Amount::Budget(1000), ..FIGURE }
}

/// All cases, in the order of the table.
pub const CASES: &[Case] = &[
    // Cameras.
    seen("front", cameras::FRONT),
    seen("side", cameras::SIDE),
    seen("back", cameras::BACK),
    seen("oblique", cameras::OBLIQUE),
    seen("rolled", cameras::ROLLED),
    seen("near", cameras::NEAR),
    seen("touching", cameras::TOUCHING),
    seen("inside", cameras::INSIDE),
    seen("from_below", cameras::FROM_BELOW),
    seen("far", cameras::FAR),
    seen("telescope", cameras::TELESCOPE),
    seen("horizon", cameras::HORIZON),
    seen("away", cameras::AWAY),
    seen("off_screen", cameras::OFF_SCREEN),
    seen("corner", cameras::CORNER),
    seen("wide", cameras::WIDE),
    seen("skewed", cameras::SKEWED),
    // Cameras that are none.
    seen("nan_rotation", broken::NAN_ROTATION),
    seen("nan_all", broken::NAN_ALL),
    seen("nan_depth", broken::NAN_DEPTH),
    seen("infinite_depth", broken::INFINITE_DEPTH),
    seen("infinite_side", broken::INFINITE_SIDE),
    seen("zero_rotation", broken::ZERO_ROTATION),
    seen("zero_focal", broken::ZERO_FOCAL),
    seen("nan_focal", broken::NAN_FOCAL),
    seen("negative_focal", broken::NEGATIVE_FOCAL),
    seen("huge_focal", broken::HUGE_FOCAL),
    seen("tiny_focal", broken::TINY_FOCAL),
    seen("infinite_center", broken::INFINITE_CENTER),
    seen("nan_center", broken::NAN_CENTER),
    // Clips: wave, walk, turn.
    standing("wave_start", Stand::Clip(0, 0.0)),
    standing("wave", Stand::Clip(0, 1.1)),
    standing("wave_before", Stand::Clip(0, -1.0)),
    standing("wave_after", Stand::Clip(0, 99.0)),
    standing("walk", Stand::Clip(1, 0.37)),
    standing("walk_nan", Stand::Clip(1, f32::NAN)),
    standing("walk_infinite", Stand::Clip(1, f32::INFINITY)),
    standing("turn", Stand::Clip(2, 2.2)),
    Case { name: "turn_face", stand: Stand::Clip(2, 1.5), ..seen("", cameras::NEAR) },
    // Joints and morph weights of the caller.
    ribbon("bow", RIBBON.stand),
    ribbon("bow_later", Stand::Clip(0, 0.8)),
    ribbon("joints_bent", Stand::Joints(joints::BENT, [0.0])),
    ribbon("joints_stretched", Stand::Joints(joints::STRETCHED, [0.7])),
    ribbon("joints_collapsed", Stand::Joints(joints::COLLAPSED, [1.0])),
    ribbon("joints_nan", Stand::Joints(joints::NAN, [0.0])),
    ribbon("joints_infinite", Stand::Joints(joints::INFINITE, [0.0])),
    ribbon("weight_beyond", Stand::Joints(joints::BENT, [-2.5])),
    ribbon("weight_nan", Stand::Joints(joints::BENT, [f32::NAN])),
    // Vertices of the caller.
    moved("stay", Move::Stay),
    moved("some_nan", Move::SomeNan),
    moved("all_nan", Move::AllNan),
    moved("some_infinite", Move::SomeInfinite),
    moved("huge", Move::Huge),
    moved("tiny", Move::Tiny),
    moved("denormal", Move::Denormal),
    moved("point", Move::Point),
    moved("flat", Move::Flat),
    moved("line", Move::Line),
    moved("sliver", Move::Sliver),
    moved("mirrored", Move::Mirrored),
    moved("folded", Move::Folded),
    moved("sheared", Move::Sheared),
    moved("torn", Move::Torn),
    Case { name: "tiny_inside", view: cameras::AT_ORIGIN, ..moved("", Move::Tiny) },
    // Budgets, levels and counts.
    of(FIGURE, "budget_0", Amount::Budget(0)),
    of(FIGURE, "budget_1", Amount::Budget(1)),
    of(FIGURE, "budget_7", Amount::Budget(7)),
    of(FIGURE, "budget_300", Amount::Budget(300)),
    of(FIGURE, "budget_4999", Amount::Budget(4999)),
    of(RIBBON, "ribbon_100", Amount::Budget(100)),
    of(FIGURE, "level_1_5", Amount::Level(1.5)),
    of(LAYERED, "layered", ALL),
    of(LAYERED, "layered_77", Amount::Budget(77)),
    of(LAYERED, "layered_none", Amount::Level(-1.0)),
    of(LAYERED, "layered_0", Amount::Level(0.0)),
    of(LAYERED, "layered_0_4", Amount::Level(0.4)),
    of(LAYERED, "layered_1", Amount::Level(1.0)),
    of(LAYERED, "layered_1_7", Amount::Level(1.7)),
    of(LAYERED, "layered_uneven", Amount::Counts(&[17, 200])),
    of(LAYERED, "layered_upper", Amount::Counts(&[0, 280])),
    Case { name: "layered_inside", view: cameras::AT_ORIGIN, ..LAYERED },
    // Levels with parameters of their own, and between them; affine frames.
    of(LEVELED, "leveled", ALL),
    of(LEVELED, "leveled_40", Amount::Budget(40)),
    of(LEVELED, "leveled_0", Amount::Level(0.0)),
    of(LEVELED, "leveled_94", Amount::Budget(94)),
    of(LEVELED, "leveled_0_7", Amount::Level(0.7)),
    of(LEVELED, "leveled_1", Amount::Level(1.0)),
    of(LEVELED, "leveled_376", Amount::Budget(376)),
    of(LEVELED, "leveled_1499", Amount::Budget(1499)),
    leveled("leveled_walk", Stand::Clip(1, 0.37)),
    leveled("leveled_turn", Stand::Clip(2, 2.2)),
    leveled("leveled_huge", Stand::Vertices(Move::Huge)),
    leveled("leveled_tiny", Stand::Vertices(Move::Tiny)),
    leveled("leveled_denormal", Stand::Vertices(Move::Denormal)),
    leveled("leveled_flat", Stand::Vertices(Move::Flat)),
    leveled("leveled_sliver", Stand::Vertices(Move::Sliver)),
    leveled("leveled_sheared", Stand::Vertices(Move::Sheared)),
    leveled("leveled_some_nan", Stand::Vertices(Move::SomeNan)),
    Case { name: "leveled_near", view: cameras::NEAR, size: [130, 70], ..LEVELED },
    Case { name: "leveled_far", view: cameras::FAR, ..LEVELED },
    of(BALL, "ball", ALL),
    of(BALL, "ball_50", Amount::Budget(50)),
    Case { name: "ball_inside", view: cameras::AT_ORIGIN, ..BALL },
    // Sizes and strides.
    Case { view: cameras::NEAR, ..sized("1x1", 1, 1, 0) },
    Case { view: cameras::NEAR, ..sized("1x1_padded", 1, 1, 3) },
    sized("1x97", 1, 97, 0),
    sized("97x1", 97, 1, 0),
    sized("31x33", 31, 33, 1),
    sized("64x65", 64, 65, 0),
    sized("129x37_padded", 129, 37, 7),
    sized("200x3", 200, 3, 0),
    sized("200x200", 200, 200, 0),
    // Backgrounds.
    over("black", Background::Color([0.0; 3])),
    over("beyond_white", Background::Color([2.0, -1.0, 0.5])),
    over("nan_background", Background::Color([f32::NAN, f32::INFINITY, f32::NEG_INFINITY])),
    over("existing", Background::Existing),
    Case { name: "existing_padded", size: [50, 41], padding: 9, ..over("", Background::Existing) },
    Case { name: "existing_untouched", view: cameras::AWAY, ..over("", Background::Existing) },
    Case { name: "existing_far", view: cameras::FAR, ..over("", Background::Existing) },
];
