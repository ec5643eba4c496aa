//! Pixel formats: each against its formula in f64, by every kernel, in memory with guards.

use dermis_format::source::Source;
use dermis_runtime::error::Buffer;
use dermis_runtime::{
    Avatar, Background, Camera, Error, Framebuffer, Kernel, Pixels, Plan, Pose, raster, render,
    scratch_len,
};

use crate::scenes::{DOT, bytes, camera, crowd, kernels, sheet, tiles};

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Rgba8,
    Bgra8,
    Rgb565,
    Rgb565Dithered,
    RgbaF32,
}

const KINDS: [Kind; 5] =
    [Kind::Rgba8, Kind::Bgra8, Kind::Rgb565, Kind::Rgb565Dithered, Kind::RgbaF32];
const BLACK: Background = Background::Color([0.0; 3]);

impl Kind {
    /// Elements of a pixel, and what they are.
    fn elements(self) -> (usize, Buffer) {
        match self {
            Self::Rgba8 | Self::Bgra8 => (4, Buffer::Bytes),
            Self::Rgb565 | Self::Rgb565Dithered => (2, Buffer::Bytes),
            Self::RgbaF32 => (4, Buffer::Numbers),
        }
    }

    fn pixels(self, memory: &mut Memory) -> Pixels<'_> {
        let Memory { bytes, numbers, from } = memory;
        match self {
            Self::Rgba8 => Pixels::Rgba8(&mut bytes[*from..]),
            Self::Bgra8 => Pixels::Bgra8(&mut bytes[*from..]),
            Self::Rgb565 => Pixels::Rgb565(&mut bytes[*from..]),
            Self::Rgb565Dithered => Pixels::Rgb565Dithered(&mut bytes[*from..]),
            Self::RgbaF32 => Pixels::RgbaF32(&mut numbers[*from..]),
        }
    }
}

/// As many bytes as numbers, of which a format takes one kind, from `from` on.
#[derive(Clone, Debug)]
struct Memory {
    bytes: Vec<u8>,
    numbers: Vec<f32>,
    from: usize,
}

impl Memory {
    /// Every byte and every number there is, NaNs among them.
    fn new(from: usize, len: usize) -> Self {
        let odd =
            [0.25, 0.0, 1.0, -0.0, -2.0, 1e30, f32::from_bits(0x7fc0_1234), 0.5, f32::INFINITY];
        let bytes = (0..from + len).map(|i| (i * 89 + i / 256) as u8).collect();
        let numbers = (0..from + len).map(|i| odd[i % odd.len()]).collect();
        Self { bytes, numbers, from }
    }

    fn bits(&self) -> (&[u8], Vec<u32>) {
        (&self.bytes, self.numbers.iter().map(|number| number.to_bits()).collect())
    }

    /// A pixel's channels as the numbers that are stored: red, green, blue, alpha.
    fn pixel(&self, kind: Kind, at: usize) -> [f64; 4] {
        let at = self.from + at;
        let bytes = |i: usize| f64::from(self.bytes[at + i]);
        match kind {
            Kind::Rgba8 => [bytes(0), bytes(1), bytes(2), bytes(3)],
            Kind::Bgra8 => [bytes(2), bytes(1), bytes(0), bytes(3)],
            Kind::Rgb565 | Kind::Rgb565Dithered => {
                let word = u16::from_le_bytes([self.bytes[at], self.bytes[at + 1]]);
                [word >> 11, word >> 5 & 63, word & 31, 1].map(f64::from)
            }
            Kind::RgbaF32 => [0, 1, 2, 3].map(|i| f64::from(self.numbers[at + i])),
        }
    }
}

/// Draws all of an avatar into `kind`, by every kernel to the same bits.
fn draw(
    avatar: &Avatar<'_>,
    camera: &Camera,
    kind: Kind,
    stride: usize,
    background: Background,
    before: &Memory,
) -> Result<Memory, Error> {
    let plan = Plan::with_budget(avatar, u32::MAX);
    let mut scratch = vec![0; scratch_len(avatar, u32::MAX, camera.width, camera.height)];
    let mut by = |kernel: Kernel| {
        let mut memory = before.clone();
        let pixels = kind.pixels(&mut memory);
        let mut framebuffer = Framebuffer { pixels, stride, background, depth: None };
        render(avatar, &Pose::Rest, &plan, camera, kernel, &mut scratch, &mut framebuffer)
            .map(|_| memory)
    };
    let scalar = by(Kernel::Scalar);
    for kernel in kernels() {
        match (by(kernel), &scalar) {
            (Ok(other), Ok(scalar)) => {
                assert!(other.bits() == scalar.bits(), "{kind:?} by {}", kernel.name());
            }
            (other, scalar) => assert_eq!(other.err(), scalar.as_ref().err().copied()),
        }
    }
    scalar
}

/// A picture of nothing but a background.
fn flat(kind: Kind, width: u32, height: u32, background: Background, before: &Memory) -> Memory {
    let bytes = bytes(&sheet(&[DOT]));
    let avatar = Avatar::parse(&bytes).unwrap();
    // Behind the camera.
    let camera = camera(width, height, 8.0, -1.0);
    let stride = width as usize * kind.elements().0;
    draw(&avatar, &camera, kind, stride, background, before).unwrap()
}

/// Bayer's matrix by its recursion: M₂ₙ = 4 Mₙ + M₂ of the quadrant.
fn bayer(x: usize, y: usize, n: usize) -> usize {
    if n == 1 {
        return 0;
    }
    let half = n / 2;
    4 * bayer(x % half, y % half, half) + [[0, 2], [3, 1]][y / half][x / half]
}

/// What a value becomes, and how far from that f32 may be.
fn stored(kind: Kind, channel: usize, value: f64, x: usize, y: usize) -> (f64, f64) {
    let most = match (kind, channel) {
        (Kind::RgbaF32, _) => return (value, 1e-6 * value.abs().max(1.0)),
        (Kind::Rgba8 | Kind::Bgra8, _) => 255.0,
        (_, 1) => 63.0,
        (_, 3) => return (1.0, 0.0),
        _ => 31.0,
    };
    let bias = match kind {
        Kind::Rgb565Dithered => (2 * bayer(x % 8, y % 8, 8) + 1) as f64 / 128.0,
        _ => 0.5,
    };
    let exact = value.clamp(0.0, 1.0) * most + bias;
    // Next to a step either side is right.
    let near = (exact - exact.round()).abs() < 1e-4;
    (exact.floor(), if near { 1.0 } else { 0.0 })
}

/// Of a stored channel.
fn value(kind: Kind, channel: usize, stored: f64) -> f64 {
    match (kind, channel) {
        (Kind::RgbaF32, _) | (Kind::Rgb565 | Kind::Rgb565Dithered, 3) => stored,
        (Kind::Rgba8 | Kind::Bgra8, _) => stored / 255.0,
        (_, 1) => stored / 63.0,
        _ => stored / 31.0,
    }
}

fn check_against_formula(source: &Source, camera: &Camera, kind: Kind, background: Background) {
    let bytes = bytes(source);
    let avatar = Avatar::parse(&bytes).unwrap();
    let tiles = tiles(&avatar, &Pose::Rest, &Plan::with_budget(&avatar, u32::MAX), camera);
    let (width, height) = (camera.width as usize, camera.height as usize);
    let (elements, _) = kind.elements();
    // A gap that is no whole number of pixels, and a first byte at an odd address.
    let (row, stride) = (width * elements, width * elements + 7);
    let before = Memory::new(1, stride * height);
    let after = draw(&avatar, camera, kind, stride, background, &before).unwrap();
    let (mut touched, columns) = (0, width.div_ceil(32));
    for at in 0..width * height {
        let (x, y) = (at % width, at / width);
        let tile = &tiles[y / 32 * columns + x / 32];
        let [r, g, b, t] = raster::pixel(&tile.0[y % 32], x % 32).map(f64::from);
        let there = before.pixel(kind, y * stride + x * elements);
        let found = after.pixel(kind, y * stride + x * elements);
        if background == Background::Existing && t == 1.0 {
            continue;
        }
        touched += usize::from(t < 1.0);
        for (channel, c) in [r, g, b, 1.0 - t].into_iter().enumerate() {
            let behind = match background {
                Background::Color(color) => color.map(f64::from).get(channel).map_or(1.0, |b| *b),
                Background::Existing => value(kind, channel, there[channel]),
            };
            let exact = c + t * behind;
            let exact = if exact.is_nan() { 0.0 } else { exact };
            let exact = exact.clamp(f64::from(f32::MIN), f64::from(f32::MAX));
            let (expected, off) = stored(kind, channel, exact, x, y);
            assert!(
                (found[channel] - expected).abs() <= off,
                "{kind:?} {background:?}: channel {channel} of ({x}, {y}) is {}, not {expected}",
                found[channel],
            );
        }
    }
    assert!(touched > 0);
    // All else is as it was: between rows, before and behind them, and where nothing is drawn.
    let ((bytes, numbers), (bytes_before, numbers_before)) = (after.bits(), before.bits());
    for at in 0..bytes.len() {
        let place = at.checked_sub(1).map(|at| (at % stride, at / stride));
        let drawn = place.is_some_and(|(at, y)| {
            let x = at / elements;
            let transmittance = |x: usize| {
                let tile = &tiles[y / 32 * columns + x / 32];
                raster::pixel(&tile.0[y % 32], x % 32)[3]
            };
            at < row && (background != Background::Existing || transmittance(x) < 1.0)
        });
        let same = bytes[at] == bytes_before[at] && numbers[at] == numbers_before[at];
        assert!(drawn || same, "{kind:?} {background:?}: element {at} changed");
    }
}

#[test]
fn every_format_follows_its_formula() {
    let cameras = [camera(1, 1, 1.0, 1.5), camera(33, 31, 20.0, 1.5), camera(97, 75, 60.0, 1.5)];
    for kind in KINDS {
        for camera in cameras {
            for background in [Background::Color([0.2, 0.5, 1.5]), Background::Existing] {
                check_against_formula(&crowd(), &camera, kind, background);
            }
        }
    }
}

#[test]
fn formats_say_what_they_lack() {
    let file = bytes(&crowd());
    let avatar = Avatar::parse(&file).unwrap();
    let camera = camera(97, 75, 60.0, 1.5);
    for kind in KINDS {
        let (elements, buffer) = kind.elements();
        let row = 97 * elements;
        for stride in [row, row + 5] {
            let needed = stride * 74 + row;
            for lent in [0, 1, needed - 1] {
                let before = Memory::new(0, lent);
                let error = draw(&avatar, &camera, kind, stride, BLACK, &before).unwrap_err();
                assert_eq!(error, Error::Buffer { buffer, needed, lent });
                let message = error.to_string();
                assert!(message.ends_with(&format!("lend {} more", needed - lent)), "{message}");
            }
            let before = Memory::new(0, needed);
            assert!(draw(&avatar, &camera, kind, stride, BLACK, &before).is_ok(), "{kind:?}");
        }
        let before = Memory::new(0, 200_000);
        let error = draw(&avatar, &camera, kind, row - 1, BLACK, &before).unwrap_err();
        assert_eq!(error, Error::Stride { buffer, needed: row, given: row - 1 });
    }
}

/// Fewer Gaussians than pixels of a step: what nothing touches is a colour, or stays.
#[test]
fn a_flat_colour_is_rounded_like_any_other() {
    let colour = [0.3, 0.7, 0.9f32];
    for kind in KINDS {
        let (elements, _) = kind.elements();
        for (width, height) in [(1, 1), (9, 3), (70, 41)] {
            let before = Memory::new(0, width * height * elements);
            let size = [width as u32, height as u32];
            let after = flat(kind, size[0], size[1], Background::Color(colour), &before);
            for at in 0..width * height {
                let found = after.pixel(kind, at * elements);
                for (channel, c) in colour.into_iter().chain([1.0]).enumerate() {
                    let (x, y) = (at % width, at / width);
                    let (expected, off) = stored(kind, channel, f64::from(c), x, y);
                    assert!((found[channel] - expected).abs() <= off, "{kind:?} {found:?}");
                }
            }
            let stays = flat(kind, size[0], size[1], Background::Existing, &before);
            assert!(stays.bits() == before.bits(), "{kind:?}");
        }
    }
}

/// Of 8 × 8 pixels the mean of the dither is the colour, up to 1/128 of a step.
#[test]
fn the_mean_of_a_dither_is_the_colour() {
    for i in 0..=500 {
        let v = i as f32 / 500.0;
        let colour = Background::Color([v, 1.0 - v, v * v]);
        let after = flat(Kind::Rgb565Dithered, 8, 8, colour, &Memory::new(0, 128));
        let mut sums = [0.0; 4];
        for at in 0..64 {
            let pixel = after.pixel(Kind::Rgb565Dithered, 2 * at);
            sums.iter_mut().zip(pixel).for_each(|(sum, step)| *sum += step / 64.0);
        }
        let exact = [v * 31.0, (1.0 - v) * 63.0, v * v * 31.0].map(f64::from);
        for (mean, exact) in sums.into_iter().zip(exact) {
            assert!((mean - exact).abs() <= 1.0 / 128.0 + 1e-5, "{mean} for {exact}");
        }
    }
}

/// Greys rise with their bytes, dithered or not, from black to white; whole steps are exact.
#[test]
fn greys_are_monotone() {
    for kind in [Kind::Rgb565, Kind::Rgb565Dithered] {
        let mut last = vec![[0.0; 4]; 64];
        for grey in 0..=255u8 {
            let colour = Background::Color([f32::from(grey) / 255.0; 3]);
            let after = flat(kind, 8, 8, colour, &Memory::new(0, 128));
            for (at, last) in last.iter_mut().enumerate() {
                let pixel = after.pixel(kind, 2 * at);
                assert!(pixel.iter().zip(*last).all(|(now, last)| *now >= last), "{kind:?} {grey}");
                *last = pixel;
            }
            match grey {
                0 => assert!(last.iter().all(|pixel| *pixel == [0.0, 0.0, 0.0, 1.0])),
                255 => assert!(last.iter().all(|pixel| *pixel == [31.0, 63.0, 31.0, 1.0])),
                _ => {}
            }
        }
        for step in 0..=31u8 {
            let colour = Background::Color([f32::from(step) / 31.0; 3]);
            let after = flat(kind, 8, 8, colour, &Memory::new(0, 128));
            assert!((0..64).all(|at| after.pixel(kind, 2 * at)[0] == f64::from(step)), "{step}");
        }
    }
}

/// No NaN and no infinity is written, whatever the background.
#[test]
fn floats_stay_finite() {
    let odd = Background::Color([f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
    let nothing = flat(Kind::RgbaF32, 3, 3, odd, &Memory::new(0, 36));
    let expected = [0.0, f64::from(f32::MAX), f64::from(f32::MIN), 1.0];
    assert!((0..9).all(|at| nothing.pixel(Kind::RgbaF32, 4 * at) == expected));
    let bytes = bytes(&sheet(&[DOT]));
    let avatar = Avatar::parse(&bytes).unwrap();
    let camera = camera(9, 9, 8.0, 1.0);
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
        let mut before = Memory::new(0, 9 * 9 * 4);
        before.numbers.fill(value);
        let after =
            draw(&avatar, &camera, Kind::RgbaF32, 36, Background::Existing, &before).unwrap();
        assert!(after.numbers[40 * 4..41 * 4].iter().all(|number| number.is_finite()), "{value}");
        assert_eq!(after.numbers[0].to_bits(), value.to_bits(), "untouched");
    }
    // What is beyond [0, 1] and finite is kept.
    let bright = flat(Kind::RgbaF32, 1, 1, Background::Color([7.0, -3.0, 0.5]), &Memory::new(0, 4));
    assert_eq!(bright.numbers, [7.0, -3.0, 0.5, 1.0]);
}
