//! What time is measured with.

use std::time::Instant;

use anyhow::Result;
use serde::Serialize;

/// What time is measured with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Clock {
    /// Time that the CPU spends in this thread: what other programs take is not counted.
    ThreadCpu,
    /// Time that passes.
    Wall,
}

impl Clock {
    /// The best for work on one thread.
    pub const ONE_THREAD: Self = if cfg!(unix) { Self::ThreadCpu } else { Self::Wall };

    /// What `work` gives, and how long it took, ms.
    ///
    /// # Errors
    ///
    /// Where `work` fails.
    pub fn time<T, E: Into<anyhow::Error>>(
        self,
        work: impl FnOnce() -> Result<T, E>,
    ) -> Result<(T, f64)> {
        match self {
            Self::Wall => {
                let start = Instant::now();
                let done = work().map_err(Into::into)?;
                Ok((done, start.elapsed().as_secs_f64() * 1e3))
            }
            Self::ThreadCpu => {
                let start = thread_ms();
                let done = work().map_err(Into::into)?;
                Ok((done, thread_ms() - start))
            }
        }
    }
}

/// CPU time of this thread, ms.
#[cfg(unix)]
fn thread_ms() -> f64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    now.tv_sec as f64 * 1e3 + now.tv_nsec as f64 * 1e-6
}

/// Not known here: [`Clock::ONE_THREAD`] is another clock.
#[cfg(not(unix))]
fn thread_ms() -> f64 {
    0.0
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
        for clock in [Clock::ThreadCpu, Clock::Wall, Clock::ONE_THREAD] {
            let work =
                || Ok::<f64, anyhow::Error>((0..1_000_000).map(f64::from).map(f64::sqrt).sum());
            let (sum, ms) = clock.time(work).expect("it does not fail");
            assert!(sum > 0.0 && (ms > 0.0 || !cfg!(unix)), "{clock:?} {ms}");
        }
    }
}
