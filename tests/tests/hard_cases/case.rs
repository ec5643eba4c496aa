//! A hard case, and how it is checked.

use dermis_runtime::framebuffer::to_byte;
use dermis_runtime::math::Affine;
use dermis_runtime::tiles::TileGrid;
use dermis_runtime::{
    Avatar, Background, Camera, Framebuffer, Kernel, Pixels, Plan, Pose, Posed, Prepared, raster,
    render, scratch_len,
};
use dermis_tests::picture::kernels;
use dermis_trainer::eval::reference::draw_reference;

/// Under every picture: red shows the Gaussians alone, blue what shines through, too.
const BACKGROUND: [f32; 3] = [0.0, 0.5, 1.0];

/// How the avatar stands.
#[derive(Clone, Debug)]
pub(crate) enum Stand {
    Rest,
    /// Seconds of the first clip.
    Clip(f32),
    Joints(Vec<Affine>, Vec<f32>),
    Vertices(Vec<[f32; 3]>),
}

impl Stand {
    fn pose(&self) -> Pose<'_> {
        match self {
            Self::Rest => Pose::Rest,
            Self::Clip(seconds) => Pose::Clip { clip: 0, seconds: *seconds },
            Self::Joints(worlds, weights) => Pose::Joints { worlds, weights },
            Self::Vertices(vertices) => Pose::Vertices(vertices),
        }
    }
}

/// What is drawn, and what must come out.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub(crate) name: &'static str,
    pub(crate) file: Vec<u8>,
    pub(crate) stand: Stand,
    pub(crate) camera: Camera,
    pub(crate) budget: u32,
    /// Gaussians that touch a pixel's bounds.
    pub(crate) visible: u32,
    /// Pixels that they change.
    pub(crate) covered: u32,
    /// Column, row and bytes of some pixels, over (0, 0.5, 1).
    pub(crate) pixels: Vec<([u32; 2], [u8; 3])>,
    /// Greatest difference from f64 of any channel before rounding, 8-bit steps.
    pub(crate) off: f64,
    /// Why it is that much.
    pub(crate) why: &'static str,
}

/// How far ordinary pictures are from f64: 3e-6 of 255 by the exponential, and the roundings of
/// exponents up to 8 and of sums over some hundred blends. 0.004 is the most that was found.
pub(crate) const ORDINARY: f64 = 0.01;

impl Case {
    /// At rest, all of it, nothing seen.
    pub(crate) fn new(name: &'static str, file: Vec<u8>, camera: Camera) -> Self {
        Self {
            name,
            file,
            stand: Stand::Rest,
            camera,
            budget: u32::MAX,
            visible: 0,
            covered: 0,
            pixels: Vec::new(),
            off: 0.0,
            why: "nothing is drawn",
        }
    }

    pub(crate) fn standing(self, stand: Stand) -> Self {
        Self { stand, ..self }
    }

    pub(crate) fn with_budget(self, budget: u32) -> Self {
        Self { budget, ..self }
    }

    /// How many Gaussians are visible, and how many pixels they cover.
    pub(crate) fn shows(self, visible: u32, covered: u32) -> Self {
        Self { visible, covered, off: ORDINARY, why: "as any picture", ..self }
    }

    /// A pixel's bytes.
    pub(crate) fn pixel(mut self, place: [u32; 2], bytes: [u8; 3]) -> Self {
        self.pixels.push((place, bytes));
        self
    }

    /// How far from f64, and why.
    pub(crate) fn within(self, off: f64, why: &'static str) -> Self {
        Self { off, why, ..self }
    }
}

/// Checks every case, and says of all that are not as stated how they are.
pub(crate) fn check(cases: impl IntoIterator<Item = Case>) {
    let mut wrong = Vec::new();
    for case in cases {
        println!("{}", case.name);
        if let Err(error) = case.check() {
            wrong.push(format!("{}: {error}", case.name));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// (r, g, b, T) of each pixel.
type Picture = Vec<[f32; 4]>;

impl Case {
    fn check(&self) -> Result<(), String> {
        let avatar = Avatar::parse(&self.file).map_err(|error| error.to_string())?;
        let plan = Plan::with_budget(&avatar, self.budget);
        let selected = self.budget.min(avatar.header().gaussians);
        assert_eq!(plan.gaussians(), selected, "the whole budget, no more");
        let (visible, picture) = self.draw(&avatar, &plan, Kernel::Scalar);
        for kernel in kernels() {
            let other = self.draw(&avatar, &plan, kernel);
            if other.0 != visible || bits(&other.1) != bits(&picture) {
                return Err(format!("{} draws other bits than scalar", kernel.name()));
            }
            self.check_bytes(&avatar, &plan, kernel, &picture)?;
        }
        let covered = picture.iter().filter(|pixel| pixel[3] < 1.0).count() as u32;
        let mut wrong = Vec::new();
        if (visible, covered) != (self.visible, self.covered) {
            wrong.push(format!("{visible} visible and {covered} pixels covered"));
        }
        for &([x, y], expected) in &self.pixels {
            let found = over(picture[(y * self.camera.width + x) as usize]).map(to_byte);
            if found != expected {
                wrong.push(format!("pixel ({x}, {y}) is {found:?}"));
            }
        }
        let off = self.off_from_f64(&avatar, &plan, &picture);
        println!("  {visible} visible, {covered} covered, {off:.5} of 255 off f64");
        if !(off <= self.off) {
            wrong.push(format!("{off:.5} of 255 off f64, more than {}: {}", self.off, self.why));
        }
        if wrong.is_empty() { Ok(()) } else { Err(wrong.join(", ")) }
    }

    /// How many Gaussians are visible, and the picture. No pixel holds anything odd.
    fn draw(&self, avatar: &Avatar<'_>, plan: &Plan, kernel: Kernel) -> (u32, Picture) {
        let Camera { width, height, .. } = self.camera;
        let budget = plan.gaussians();
        let mut posing = vec![u32::MAX; Posed::scratch_len(avatar)];
        let mut preparing = vec![u32::MAX; Prepared::scratch_len(avatar, budget, width, height)];
        let mut drawing = vec![u32::MAX; Prepared::band_scratch_len(budget, width, height)];
        let posed = Posed::new(avatar, &self.stand.pose(), kernel, &mut posing).expect("it fits");
        let prepared = Prepared::new(&posed, plan, &self.camera, &mut preparing).expect("it fits");
        let grid = TileGrid::new(width, height);
        let mut picture = vec![[f32::NAN; 4]; width as usize * height as usize];
        let drawn = prepared.for_each_tile(0..grid.rows, &mut drawing, |tile, _, pixels| {
            let [columns, rows] = grid.pixels(tile);
            for (y, row) in rows.zip(&pixels.0) {
                for (column, x) in columns.clone().enumerate() {
                    picture[(y * width + x) as usize] = raster::pixel(row, column);
                }
            }
        });
        drawn.expect("it fits");
        let sound = |[r, g, b, t]: &[f32; 4]| {
            [r, g, b].iter().all(|c| c.is_finite() && **c >= 0.0) && (0.0..=1.0).contains(t)
        };
        assert!(picture.iter().all(sound), "{} by {}: an odd pixel", self.name, kernel.name());
        (prepared.splats().len() as u32, picture)
    }

    /// A framebuffer whose rows are further apart than they are long holds the nearest bytes, and
    /// between its rows what was there.
    fn check_bytes(
        &self,
        avatar: &Avatar<'_>,
        plan: &Plan,
        kernel: Kernel,
        picture: &Picture,
    ) -> Result<(), String> {
        const PADDING: usize = 12;
        let Camera { width, height, .. } = self.camera;
        let row = width as usize * 4;
        let mut scratch = vec![u32::MAX; scratch_len(avatar, plan.gaussians(), width, height)];
        let mut pixels = vec![0x5a; (row + PADDING) * height as usize];
        let background = Background::Color(BACKGROUND);
        let mut framebuffer = Framebuffer {
            pixels: Pixels::Rgba8(&mut pixels),
            stride: row + PADDING,
            background,
            depth: None,
        };
        let pose = self.stand.pose();
        let drawn =
            render(avatar, &pose, plan, &self.camera, kernel, &mut scratch, &mut framebuffer);
        let statistics = drawn.map_err(|error| error.to_string())?;
        assert_eq!(statistics.gaussians_selected, plan.gaussians());
        let rows = pixels.chunks_exact(row + PADDING).zip(picture.chunks_exact(width as usize));
        for (found, expected) in rows {
            let expected = expected.iter().flat_map(|&pixel| {
                let [r, g, b] = over(pixel).map(to_byte);
                [r, g, b, 255]
            });
            if !expected.eq(found[..row].iter().copied()) {
                return Err(format!("{}: bytes are not the nearest", kernel.name()));
            }
            if found[row..] != [0x5a; PADDING] {
                return Err(format!("{} writes between rows", kernel.name()));
            }
        }
        Ok(())
    }

    /// Greatest difference from the reference's picture, 8-bit steps.
    fn off_from_f64(&self, avatar: &Avatar<'_>, plan: &Plan, picture: &Picture) -> f64 {
        let exact = draw_reference(avatar, &self.stand.pose(), plan, &self.camera, BACKGROUND);
        let exact = exact.expect("it fits");
        let pairs = picture.iter().flat_map(|&pixel| over(pixel)).zip(exact.into_iter().flatten());
        // A NaN of the reference's is a difference, too.
        pairs.fold(0.0, |worst, (found, exact)| {
            let off = 255.0 * (f64::from(found) - exact).abs();
            if off <= worst { worst } else { off }
        })
    }
}

fn bits(picture: &Picture) -> Vec<[u32; 4]> {
    picture.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

/// Over the background.
fn over([r, g, b, t]: [f32; 4]) -> [f32; 3] {
    [r + t * BACKGROUND[0], g + t * BACKGROUND[1], b + t * BACKGROUND[2]]
}
