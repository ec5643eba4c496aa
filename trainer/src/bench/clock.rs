//! What time is measured with.

use std::time::Instant;

use anyhow::Result;
use serde::Serialize;

/// What time is measured with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Clock {
    /// Time that CPUs spend in this thread: what other programs take is not counted.
    ThreadCpu,
    /// Time that CPUs spend in this program, of all its threads.
    ProgramCpu,
    /// Time that passes.
    Wall,
}

impl Clock {
    /// The best for work on one thread.
    pub const ONE_THREAD: Self = if cfg!(unix) { Self::ThreadCpu } else { Self::Wall };
    /// The best for work that is compared by what it takes, not by how soon it is done.
    pub const ALL_THREADS: Self = if cfg!(unix) { Self::ProgramCpu } else { Self::Wall };

    /// What it measures, for people.
    pub fn measures(self) -> &'static str {
        match self {
            Self::ThreadCpu | Self::ProgramCpu => "CPU time",
            Self::Wall => "time that passes",
        }
    }

    /// What `work` gives, and how long it took, ms.
    ///
    /// # Errors
    ///
    /// Where `work` fails.
    pub fn time<T, E: Into<anyhow::Error>>(
        self,
        work: impl FnOnce() -> Result<T, E>,
    ) -> Result<(T, f64)> {
        let (passed, spent) = (Instant::now(), self.cpu_ms());
        let done = work().map_err(Into::into)?;
        let ms = match spent.zip(self.cpu_ms()) {
            Some((before, after)) => after - before,
            None => passed.elapsed().as_secs_f64() * 1e3,
        };
        Ok((done, ms))
    }

    /// CPU time so far, ms; of [`Self::Wall`] none.
    #[cfg(unix)]
    fn cpu_ms(self) -> Option<f64> {
        use rustix::time::{ClockId, clock_gettime};
        let id = match self {
            Self::ThreadCpu => ClockId::ThreadCPUTime,
            Self::ProgramCpu => ClockId::ProcessCPUTime,
            Self::Wall => return None,
        };
        let now = clock_gettime(id);
        Some(now.tv_sec as f64 * 1e3 + now.tv_nsec as f64 * 1e-6)
    }

    /// Not known here.
    #[cfg(not(unix))]
    fn cpu_ms(self) -> Option<f64> {
        None
    }
}

/// The middle of some numbers, of an even count the mean of the middle two; 0 of none.
pub fn median(numbers: impl IntoIterator<Item = f64>) -> f64 {
    let mut numbers: Vec<f64> = numbers.into_iter().collect();
    numbers.sort_unstable_by(f64::total_cmp);
    let (low, high) = (numbers.len().saturating_sub(1) / 2, numbers.len() / 2);
    match (numbers.get(low), numbers.get(high)) {
        (Some(a), Some(b)) => (a + b) / 2.0,
        _ => 0.0,
    }
}

/// The least of some numbers; 0 of none.
pub fn least(numbers: impl IntoIterator<Item = f64>) -> f64 {
    numbers.into_iter().reduce(f64::min).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians() {
        assert_eq!(median([]), 0.0);
        assert_eq!(median([3.0]), 3.0);
        assert_eq!(median([9.0, 1.0]), 5.0);
        assert_eq!(median([9.0, 1.0, 2.0]), 2.0);
        assert_eq!(least([9.0, 1.0, 2.0]), 1.0);
    }

    #[test]
    fn clocks_go_forward_while_something_is_done() {
        for clock in [Clock::ThreadCpu, Clock::ProgramCpu, Clock::Wall] {
            let work =
                || Ok::<f64, anyhow::Error>((0..1_000_000).map(f64::from).map(f64::sqrt).sum());
            let (sum, ms) = clock.time(work).expect("it does not fail");
            assert!(sum > 0.0 && ms > 0.0, "{clock:?} {ms}");
        }
    }
}
