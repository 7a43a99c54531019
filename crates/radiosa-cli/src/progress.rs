//! What a person sees while waiting: on standard error, only on a terminal.

use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

/// A bar with the time left and the work a second.
pub(crate) struct Progress {
    bar: ProgressBar,
    start: Instant,
    unit: &'static str,
}

impl Progress {
    pub(crate) fn new(what: &str, unit: &'static str, quiet: bool) -> Self {
        let bar = if quiet { ProgressBar::hidden() } else { ProgressBar::new(1000) };
        let style =
            ProgressStyle::with_template("{prefix} [{bar:40}] {percent:>3}%  {eta} left  {msg}").expect("the template is valid");
        bar.set_style(style.progress_chars("=> "));
        bar.set_prefix(what.to_owned());
        bar.enable_steady_tick(Duration::from_millis(200));
        Self { bar, start: Instant::now(), unit }
    }

    pub(crate) fn update(&self, done: f64, count: u64) {
        self.bar.set_position((done * 1000.0) as u64);
        let rate = count as f64 / self.start.elapsed().as_secs_f64().max(1e-3) * 1e-6;
        self.bar.set_message(format!("{rate:.2} M{}/s", self.unit));
    }

    pub(crate) fn finish(self) {
        self.bar.finish_and_clear();
    }
}
