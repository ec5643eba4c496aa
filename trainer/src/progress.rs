//! Progress bars on a terminal; nothing in a pipe.

use indicatif::{ProgressBar, ProgressStyle};

/// A bar of `len` steps on stderr. Hidden where stderr is no terminal.
pub fn bar(what: &'static str, len: u64) -> ProgressBar {
    let bar = ProgressBar::new(len).with_message(what);
    let template = "{msg:>16} [{bar:32}] {pos}/{len} {elapsed} +{eta} {prefix}";
    // The template is a constant; were it wrong the plain bar would do.
    let style =
        ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.set_style(style.progress_chars("=> "));
    bar
}

/// Moves a bar to where an earlier run left it, and says so above it: at step `run` of the whole run.
pub fn resume(bar: &ProgressBar, here: u64, run: u64) {
    bar.set_position(here);
    // Or the steps of the earlier run would count as fast ones of this.
    bar.reset_eta();
    bar.println(format!("resuming at step {run}"));
}
