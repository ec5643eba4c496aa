//! A run's way through its descents.

use std::borrow::Cow;
use std::time::Instant;

use anyhow::{Result, ensure};
use dermis_format::Avatar;

use super::file::{Content, Fault};
use super::fingerprint::Fingerprint;
use super::folder::{Folder, Name};
use super::{Checkpoint, Every};
use crate::model::Model;
use crate::optimize::cloud::Cloud;
use crate::optimize::descend::Descent;
use crate::options::Options;
use crate::train::Trained;

/// Follows the descents of a run, one after the other: [`Self::resume`], [`Self::after_steps`] …, [`Self::finish`].
#[derive(Debug)]
pub struct Journal {
    folder: Folder,
    every: Every,
    at_most: Option<u32>,
    /// Which descent runs or comes next.
    index: u32,
    /// Steps of this run.
    taken: u32,
    written: Instant,
}

impl Journal {
    /// Of the training of `model` by `options`, and of no other.
    pub fn open(checkpoint: &Checkpoint, model: &Model, options: &Options) -> Result<Self> {
        let folder = Folder::open(&checkpoint.folder, Fingerprint::of(model, options))?;
        let Checkpoint { every, at_most, .. } = *checkpoint;
        Ok(Self { folder, every, at_most, index: 0, taken: 0, written: Instant::now() })
    }

    /// What came out, where training is done already.
    pub fn result(&self) -> Result<Option<Trained>> {
        if !self.folder.has(Name::Result) {
            return Ok(None);
        }
        match self.folder.read(Name::Result)? {
            Content::Trained(trained) if Avatar::parse(&trained.bytes).is_ok() => {
                // It may have been killed before it had done so itself.
                self.folder.keep_result_only()?;
                Ok(Some(trained.into_owned()))
            }
            _ => Err(self.folder.refusal(Name::Result, &Fault::Damaged)),
        }
    }

    /// Takes a descent that has not begun to where an earlier run left it.
    pub fn resume(&mut self, descent: &mut Descent<'_>) -> Result<()> {
        for name in [Name::Finished(self.index), Name::Running] {
            if !self.folder.has(name) {
                continue;
            }
            let fits = match self.folder.read(name)? {
                // A kill between two writes leaves a descent that others have followed.
                Content::Descent { index, .. } if name == Name::Running && index != self.index => {
                    continue;
                }
                Content::Descent { index, state } => index == self.index && descent.restore(state),
                Content::Trained(_) => false,
            };
            ensure!(fits, self.folder.refusal(name, &Fault::Damaged));
            break;
        }
        // What came before, such as the truth, is no loss of steps.
        self.written = Instant::now();
        Ok(())
    }

    /// Writes down where a descent is, which has just taken `steps`, if it is time to.
    pub fn after_steps(&mut self, steps: u32, descent: &Descent<'_>) -> Result<()> {
        if let Some(at_most) = self.at_most {
            ensure!(
                self.taken < at_most,
                "stopped after {at_most} steps, as asked; run again to go on"
            );
        }
        self.taken += steps;
        let due = match self.every {
            Every::Time(time) => self.written.elapsed() >= time,
            Every::Steps(every) => {
                let every = every.max(1);
                descent.step() / every > (descent.step() - steps) / every
            }
        };
        if due && !descent.is_done() {
            self.write(Name::Running, descent)?;
        }
        Ok(())
    }

    /// Writes down what a descent came to.
    pub fn finish(&mut self, descent: &Descent<'_>) -> Result<()> {
        let name = Name::Finished(self.index);
        if !self.folder.has(name) {
            self.write(name, descent)?;
            self.folder.remove(Name::Running);
        }
        self.index += 1;
        Ok(())
    }

    /// Writes down what came out, which stands for all before.
    pub fn conclude(&self, trained: &Trained) -> Result<()> {
        let numbers = |cloud: &Cloud| cloud.len() * cloud.levels.len();
        let about = trained.bytes.len() + 64 * trained.clouds.iter().map(numbers).sum::<usize>();
        self.folder.write(Name::Result, &Content::Trained(Cow::Borrowed(trained)), about)?;
        self.folder.keep_result_only()
    }

    /// Whether this run has taken a step.
    pub fn has_begun(&self) -> bool {
        self.taken > 0
    }

    fn write(&mut self, name: Name, descent: &Descent<'_>) -> Result<()> {
        let state = descent.state();
        let about = state.bytes();
        self.folder.write(name, &Content::Descent { index: self.index, state }, about)?;
        self.written = Instant::now();
        Ok(())
    }
}
