//! The threads that draw a frame: the only place that knows how its work is shared among them.
//!
//! Poses and plans are made by one thread. Splats are made in parts, and the frame is drawn in bands of
//! tile rows, both as the runtime divides them, one for each thread: it cuts them evenly, and each band
//! looks at all splats once more.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use anyhow::{Context, Result, ensure};
use dermis_runtime::prepare::Part;
use dermis_runtime::raster::Counts;
use dermis_runtime::tiles::TILE;
use dermis_runtime::{Background, Camera, Error, Framebuffer, Pixels, Plan, Posed, Prepared};
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Some threads.
#[derive(Debug)]
pub struct Team {
    /// None: this thread alone.
    pool: Option<ThreadPool>,
    threads: usize,
}

/// Where a picture goes.
#[derive(Debug)]
pub struct Canvas<'p> {
    /// RGBA8, row after row without gaps.
    pub rgba: &'p mut [u8],
    /// Pixels in a row.
    pub width: u32,
    /// Behind the avatar, sRGB.
    pub background: [f32; 3],
}

/// Says that something is done, however it ends.
struct End<'d>(&'d AtomicBool);

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::SeqCst);
    }
}

/// A part of a frame, and what draws it.
struct Band<'b> {
    tile_rows: Range<u32>,
    scratch: &'b mut [u32],
    rgba: &'b mut [u8],
}

impl Team {
    /// This thread alone.
    pub const ONE: Self = Self { pool: None, threads: 1 };

    /// So many threads.
    ///
    /// # Errors
    ///
    /// Where they cannot be started.
    pub fn of(threads: usize) -> Result<Self> {
        if threads <= 1 {
            return Ok(Self::ONE);
        }
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        let pool =
            pool.context("the worker threads cannot be started; choose fewer with --threads")?;
        Ok(Self { pool: Some(pool), threads })
    }

    /// Does `work` on one of the threads, while the others look for work of it without falling asleep:
    /// where waking takes as long as a frame it would be counted against the bands, and a renderer that
    /// wants its frames keeps its threads awake. One call at a time: two would wait for each other's
    /// thread for ever.
    pub fn awake<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        let Some(pool) = &self.pool else { return work() };
        let (awake, done) = (AtomicUsize::new(1), AtomicBool::new(false));
        // More threads than cores must let each other go on.
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let pause: fn() =
            if self.threads <= cores { std::hint::spin_loop } else { std::thread::yield_now };
        pool.scope(|scope| {
            for _ in 1..self.threads {
                scope.spawn(|_| {
                    awake.fetch_add(1, Ordering::SeqCst);
                    // Nobody looks for work until all have a task like this: it could be another's.
                    while awake.load(Ordering::SeqCst) < self.threads {
                        pause();
                    }
                    while !done.load(Ordering::SeqCst) {
                        if rayon::yield_now() != Some(rayon::Yield::Executed) {
                            pause();
                        }
                    }
                });
            }
            // Nor does this thread, which may not take one while it waits for others.
            while awake.load(Ordering::SeqCst) < self.threads {
                pause();
            }
            let _ends = End(&done);
            work()
        })
    }

    /// How many.
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// Into how many bands a frame is cut: each takes a scratch of its own.
    pub fn bands(&self) -> usize {
        self.threads
    }

    /// [`Prepared::new`].
    ///
    /// # Errors
    ///
    /// As [`Prepared::new`].
    pub fn prepare<'s>(
        &self,
        posed: &Posed<'_, '_>,
        plan: &Plan,
        camera: &Camera,
        scratch: &'s mut [u32],
    ) -> Result<Prepared<'s>, Error> {
        let Some(pool) = &self.pool else { return Prepared::new(posed, plan, camera, scratch) };
        Prepared::in_parts(posed, plan, camera, scratch, self.bands(), |parts| {
            pool.install(|| parts.par_iter_mut().with_max_len(1).for_each(Part::project));
        })
    }

    /// Makes the lists of all tiles as [`Team::draw`] makes them, and draws nothing.
    ///
    /// # Errors
    ///
    /// Where a scratch is too short.
    pub fn lists(&self, prepared: &Prepared<'_>, scratches: &mut [Vec<u32>]) -> Result<()> {
        let bands = self.cut(prepared, &mut [], 0, scratches)?;
        self.each(bands, |band| prepared.for_each_list(band.tile_rows, band.scratch, |_, _| ()))?;
        Ok(())
    }

    /// Draws the frame.
    ///
    /// # Errors
    ///
    /// Where a scratch or the canvas is too short.
    pub fn draw(
        &self,
        prepared: &Prepared<'_>,
        scratches: &mut [Vec<u32>],
        canvas: &mut Canvas<'_>,
    ) -> Result<Counts> {
        let stride = canvas.width as usize * 4;
        let background = Background::Color(canvas.background);
        let draw = |band: Band<'_>| {
            let mut framebuffer =
                Framebuffer { pixels: Pixels::Rgba8(band.rgba), stride, background, depth: None };
            prepared.draw_band(band.tile_rows, band.scratch, &mut framebuffer)
        };
        let bands = self.cut(prepared, canvas.rgba, stride, scratches)?;
        let mut sum = Counts::default();
        self.each(bands, draw)?.into_iter().for_each(|counts| sum += counts);
        Ok(sum)
    }

    /// Bands of the frame, top to bottom; `rgba` may be empty.
    fn cut<'b>(
        &self,
        prepared: &Prepared<'_>,
        rgba: &'b mut [u8],
        stride: usize,
        scratches: &'b mut [Vec<u32>],
    ) -> Result<Vec<Band<'b>>> {
        let bands = self.bands();
        ensure!(scratches.len() >= bands, "{} scratches for {bands} bands", scratches.len());
        let mut rest = rgba;
        let mut cut = Vec::with_capacity(bands);
        for (tile_rows, scratch) in prepared.bands(bands as u32).zip(scratches) {
            let bytes = tile_rows.len() * TILE as usize * stride;
            let (rgba, below) = rest.split_at_mut(bytes.min(rest.len()));
            rest = below;
            cut.push(Band { tile_rows, scratch, rgba });
        }
        Ok(cut)
    }

    /// `work` on each band, by all threads.
    fn each<T: Send>(
        &self,
        bands: Vec<Band<'_>>,
        work: impl Fn(Band<'_>) -> Result<T, Error> + Send + Sync,
    ) -> Result<Vec<T>, Error> {
        match &self.pool {
            None => bands.into_iter().map(work).collect(),
            // One task a band: rayon would leave several to one thread.
            Some(pool) => {
                pool.install(|| bands.into_par_iter().with_max_len(1).map(work).collect())
            }
        }
    }
}
