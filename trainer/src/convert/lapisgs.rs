//! LapisGS: a series of PLYs from coarse to fine. Each holds all Gaussians of its predecessor first,
//! in the same order, with opacities of its own, then Gaussians that it adds. They become one set
//! with an opacity per level.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use dermis_format::header::MAX_LAYERS;

use super::assembly::{Assembly, Levels};
use super::splats::{LeftOut, Splat, Splats};

/// A Gaussian of the series.
struct Row {
    /// But for its harmonics; its opacity is that of the first file that has it.
    splat: Splat<'static>,
    harmonics: Vec<f32>,
    /// In each file that has it.
    opacities: Vec<f64>,
}

/// What the files read so far hold.
#[derive(Default)]
struct Series {
    degree: u8,
    compensated: bool,
    rows: Vec<Row>,
    /// Rows of each file.
    counts: Vec<usize>,
}

/// Reads the files from coarse to fine.
pub(super) fn read(paths: &[PathBuf]) -> Result<(Assembly, LeftOut)> {
    if let Some(path) = paths.get(MAX_LAYERS) {
        bail!(
            "{}: is one level more than the {MAX_LAYERS} that the format holds; leave some files out",
            path.display()
        );
    }
    let mut series = Series::default();
    for path in paths {
        series.add(path).with_context(|| path.display().to_string())?;
    }
    series.assemble(paths)
}

impl Series {
    fn add(&mut self, path: &Path) -> Result<()> {
        let ply = super::open(path)?;
        let (known, count) = (self.rows.len(), ply.count());
        let remedy = "give the files of one series, from coarse to fine";
        ensure!(
            count > known,
            "has {count} Gaussians, the file before it {known}, which it should add to; {remedy}"
        );
        ensure!(
            known == 0 || ply.degree == self.degree,
            "has harmonics of degree {}, the file before it of {}; {remedy}",
            ply.degree,
            self.degree
        );
        ensure!(
            known == 0 || ply.compensated == self.compensated,
            "has another low-pass (SplatRenderMode) than the file before it; {remedy}"
        );
        (self.degree, self.compensated) = (ply.degree, ply.compensated);
        ply.for_each(|number, splat, _| {
            if let Some(row) = self.rows.get_mut(number).filter(|_| number < known) {
                ensure!(
                    row.is(splat),
                    "vertex row {number} differs from that of the file before it in more than \
                     opacity; {remedy}"
                );
                row.opacities.push(splat.opacity);
            } else {
                self.rows.push(Row::of(splat));
            }
            Ok(())
        })?;
        self.counts.push(count);
        Ok(())
    }

    /// Leaves out what is seen at no level.
    fn assemble(self, paths: &[PathBuf]) -> Result<(Assembly, LeftOut)> {
        let Self { degree, compensated, .. } = self;
        let mut splats = Splats { degree, compensated, ..Splats::default() };
        let (mut levels, mut left_out) = (Levels::default(), LeftOut::default());
        let mut rows = self.rows.iter();
        let mut start = 0;
        for (path, end) in paths.iter().zip(self.counts) {
            let before = splats.gaussians.len();
            for row in rows.by_ref().take(end - start) {
                if splats.push(&row.brightest(), &mut left_out)
                    && let Some(added) = splats.gaussians.last_mut()
                {
                    added.opacity = row.splat.opacity as f32;
                    let later = row.opacities[1..].iter().map(|&opacity| opacity as f32);
                    levels.later_opacities.push(later.collect());
                }
            }
            let added = splats.gaussians.len() - before;
            ensure!(
                added > 0,
                "{}: none of the {} Gaussians that it adds can be drawn; leave it out",
                path.display(),
                end - start
            );
            levels.layers.push(added as u32);
            start = end;
        }
        if levels.layers.len() == 1 {
            levels.later_opacities.clear();
        }
        splats.lower_degree();
        Ok((Assembly { splats, mount: None, levels: Some(levels) }, left_out))
    }
}

impl Row {
    fn of(splat: &Splat<'_>) -> Self {
        Self {
            splat: Splat { harmonics: &[], ..*splat },
            harmonics: splat.harmonics.to_vec(),
            opacities: vec![splat.opacity],
        }
    }

    /// Whether it is the same Gaussian but for opacity. By bits, as NaN is not NaN.
    fn is(&self, splat: &Splat<'_>) -> bool {
        let numbers = |s: &Splat<'_>| {
            let Splat { position: p, rotation: r, log2_scale: l, color: c, .. } = *s;
            [p.as_slice(), &r, &l, &c].concat()
        };
        let bits = |numbers: Vec<f64>| numbers.into_iter().map(f64::to_bits);
        let (own, harmonics) = (&self.splat, self.harmonics.iter().map(|x| x.to_bits()));
        bits(numbers(own)).eq(bits(numbers(splat)))
            && harmonics.eq(splat.harmonics.iter().map(|x| x.to_bits()))
    }

    /// With the greatest of its opacities, or one that is not a number.
    fn brightest(&self) -> Splat<'_> {
        let greatest = |a: f64, b: f64| if b.is_nan() || b > a { b } else { a };
        let opacity = self.opacities.iter().copied().fold(0.0, greatest);
        Splat { opacity, harmonics: &self.harmonics, ..self.splat }
    }
}
